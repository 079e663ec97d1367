//! Run time against error, one panel a scene, with the Pareto front: what is
//! dominated fades, what is on the front is joined and named.

use super::facets::{self, SMALL, Sample};
use super::figure::{Anchor, Figure, Part, Rect, TextStyle, plain, text_box};
use super::labels::Grid;
use super::pareto;
use super::rows;
use super::scale::{Kind, Scale};
use super::style::{ALARM, FRAME, INK, MUTED, SHADE};
use crate::results::{RunResult, RunStatus};

pub struct Scatter<'a> {
    pub id: &'a str,
    pub title: &'a str,
    pub sub: &'a str,
    pub x_axis: &'a str,
    pub y_axis: &'a str,
    /// Give zero a bin of its own below the logarithmic axis.
    pub zero_bin: bool,
    pub point: &'a dyn Fn(&RunResult) -> Option<(f64, f64)>,
}

struct Dot {
    combination: usize,
    data: (f64, f64),
    /// "† 120 ppm" when its class may lose triangles.
    price: Option<String>,
    at: (f64, f64),
    on_front: bool,
}

pub fn draw(grid: &Grid, what: &Scatter) -> Figure {
    let columns = grid.places.len().clamp(1, 2);
    let rows = grid.places.len().div_ceil(columns);
    let (w, h) = if columns == 1 { (840.0, 320.0) } else { (404.0, 236.0) };
    let (left, gap) = (74.0, (84.0, 78.0));
    let width = left + columns as f64 * w + (columns as f64 - 1.0) * gap.0 + 28.0;
    let top = 58.0 + facets::legend_height(&grid.legend, width - 32.0, Sample::Marker) + 26.0;
    let height = top + rows as f64 * h + (rows as f64 - 1.0) * gap.1 + 46.0;
    let mut figure = Figure::new(what.id, what.title, width, height);
    facets::title(&mut figure, what.title, what.sub);
    facets::legend(&mut figure, &grid.legend, 16.0, 58.0, width - 32.0, Sample::Marker);
    let mut words = format!("{}. {} against {}. ", what.title, what.y_axis, what.x_axis);

    for (i, plot) in facets::panels(grid.places.len(), columns, left, top, (w, h), gap).into_iter().enumerate() {
        figure.part(Part::Plot, plot);
        let dots = panel(&mut figure, grid, what, i, plot);
        let front: Vec<&str> =
            dots.iter().filter(|d| d.on_front).map(|d| grid.combinations[d.combination].as_str()).collect();
        words += &format!("{}: on the front {}. ", grid.places[i], front.join(", "));
    }
    figure.description = words.trim_end().to_string();
    figure
}

fn panel(figure: &mut Figure, grid: &Grid, what: &Scatter, place: usize, plot: Rect) -> Vec<Dot> {
    let mut dots: Vec<Dot> = grid.cells[place]
        .iter()
        .enumerate()
        .filter_map(|(combination, cell)| {
            let run = cell.filter(|r| r.status == RunStatus::Done)?;
            let data = (what.point)(run)?;
            Some(Dot { combination, data, price: rows::price(run), at: (0.0, 0.0), on_front: false })
        })
        .collect();
    let zeros = dots.iter().filter(|d| d.data.1 <= 0.0).count();
    let gaps = grid.cells[place].iter().flatten().filter(|r| r.status != RunStatus::Done).count();
    let mut notes = Vec::new();
    if what.zero_bin && zeros == dots.len() && zeros > 0 {
        notes.push(format!("none of the {zeros} lost a sampled pixel: only time differs"));
    } else if what.zero_bin && zeros > 0 {
        notes.push(format!("{zeros} of {} lost no sampled pixel", dots.len()));
    }
    if gaps > 0 {
        notes.push(format!("{gaps} without a usable run"));
    }
    facets::panel_head(figure, plot, &grid.places[place], &notes.join("; "));

    let xs: Vec<f64> = dots.iter().map(|d| d.data.0).collect();
    let ys: Vec<f64> = dots.iter().map(|d| d.data.1).collect();
    // Air at both ends, or markers and labels would leave the panel.
    let x = Scale::fitting(&xs);
    let inset = if x.is_log() { 14.0 } else { 0.0 };
    let x = x.onto(plot.x + inset, plot.right() - 14.0);
    let y = if what.zero_bin {
        // Room for names above and below the points at zero.
        let bin = match zeros {
            0 => 22.0,
            n if n == ys.len() => plot.h,
            _ => 64.0,
        };
        let mut y = Scale::log(ys.iter().copied()).onto(plot.bottom(), plot.y);
        y.kind = Kind::LogZero(bin);
        zero_bin(figure, plot, bin, zeros == ys.len());
        y
    } else {
        Scale::fitting(&ys).onto(plot.bottom(), plot.y + 8.0)
    };
    if !(what.zero_bin && zeros == ys.len()) {
        facets::y_axis(figure, plot, &y, 4);
    }
    facets::x_axis(figure, plot, &x, 6, true);
    facets::x_title(figure, plot, what.x_axis);
    facets::y_title(figure, plot, what.y_axis, 50.0);

    let front = pareto::front(&dots.iter().map(|d| d.data).collect::<Vec<_>>());
    for (i, dot) in dots.iter_mut().enumerate() {
        dot.at = (x.at(dot.data.0), y.at(dot.data.1));
        dot.on_front = front.contains(&i);
    }
    let stairs = staircase(&front.iter().map(|i| dots[*i].at).collect::<Vec<_>>(), plot);
    figure.dashed(&stairs, MUTED, 1.1, 0.9, &[4.0, 3.0]);
    for on_front in [false, true] {
        for dot in dots.iter().filter(|d| d.on_front == on_front) {
            let look = grid.legend.entries[dot.combination].look;
            let (radius, alpha) = if on_front { (5.0, 1.0) } else { (4.2, 0.45) };
            figure.marker(dot.at.0, dot.at.1, radius, look.shape, look.colour, alpha);
        }
    }
    name_front(figure, grid, &dots, &stairs, plot);
    dots
}

fn zero_bin(figure: &mut Figure, plot: Rect, bin: f64, alone: bool) {
    let y = plot.bottom() - bin;
    figure.rect(Rect::new(plot.x, y, plot.w, bin), SHADE, 0.8);
    if !alone {
        figure.segment((plot.x, y), (plot.right(), y), FRAME, 1.0);
    }
    figure.label(plot.x - 7.0, plot.bottom() - bin / 2.0 + 3.6, "0", plain(SMALL, MUTED).end());
}

/// The border of what is attainable: from each point of the front right, then down.
fn staircase(front: &[(f64, f64)], plot: Rect) -> Vec<(f64, f64)> {
    let Some(first) = front.first() else { return Vec::new() };
    let mut line = vec![(first.0, plot.y)];
    for (i, p) in front.iter().enumerate() {
        line.push(*p);
        let right = front.get(i + 1).map_or(plot.right(), |n| n.0);
        line.push((right, p.1));
    }
    line
}

/// Names of the dots on the front, clear of dots, of the front's line and of
/// each other, with the price of those that may lose triangles. The legend
/// names everything else.
fn name_front(figure: &mut Figure, grid: &Grid, dots: &[Dot], stairs: &[(f64, f64)], plot: Rect) {
    let mut taken: Vec<Rect> = dots.iter().map(|d| Rect::new(d.at.0 - 5.0, d.at.1 - 5.0, 10.0, 10.0)).collect();
    taken.extend(stairs.windows(2).map(|s| {
        let (x, y) = (s[0].0.min(s[1].0), s[0].1.min(s[1].1));
        Rect::new(x - 1.0, y - 1.0, (s[1].0 - s[0].0).abs() + 2.0, (s[1].1 - s[0].1).abs() + 2.0)
    }));
    let mut order: Vec<&Dot> = dots.iter().filter(|d| d.on_front).collect();
    order.sort_by(|a, b| a.at.0.total_cmp(&b.at.0).then(a.combination.cmp(&b.combination)));
    for dot in order {
        let name = &grid.combinations[dot.combination];
        let (text, colour) = match &dot.price {
            Some(price) => (format!("{name} {price}"), ALARM),
            None => (name.clone(), INK),
        };
        let style = plain(SMALL, colour).bold();
        let Some((r, style, x, y)) = free_place(dot.at, &text, style, plot, &taken) else { continue };
        figure.label(x, y, &text, style);
        taken.push(r);
        // A name that had to move away gets a thin line back to its dot.
        let near = (x - dot.at.0).hypot(y - dot.at.1) < 20.0;
        if !near {
            let from = (dot.at.0.clamp(r.x, r.right()), if r.y > dot.at.1 { r.y } else { r.bottom() });
            figure.segment(from, dot.at, FRAME, 0.8);
        }
    }
}

/// A place for `name` that touches nothing: right of the dot, left, above, below.
fn free_place(
    at: (f64, f64),
    name: &str,
    style: TextStyle,
    plot: Rect,
    taken: &[Rect],
) -> Option<(Rect, TextStyle, f64, f64)> {
    let beside = [
        (Anchor::Start, 9.0, 3.6),
        (Anchor::Start, 7.0, -5.0),
        (Anchor::Start, 7.0, 13.0),
        (Anchor::End, -9.0, 3.6),
        (Anchor::End, -7.0, -5.0),
        (Anchor::End, -7.0, 13.0),
        (Anchor::Middle, 0.0, -9.0),
        (Anchor::Middle, 0.0, 17.0),
    ];
    // Then farther and farther above and below, as long as the panel lasts.
    let away = (2..14).flat_map(|n| {
        let d = 13.0 * f64::from(n);
        [(Anchor::Start, 6.0, -d), (Anchor::Start, 6.0, d), (Anchor::End, -6.0, -d), (Anchor::End, -6.0, d)]
    });
    beside.into_iter().chain(away).find_map(|(anchor, dx, dy)| {
        let style = TextStyle { anchor, ..style };
        let (x, y) = (at.0 + dx, at.1 + dy);
        let r = text_box(x, y, name, style);
        (plot.contains(&r) && !taken.iter().any(|t| t.overlaps(&r))).then_some((r, style, x, y))
    })
}
