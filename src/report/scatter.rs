//! Run time against error, one panel a scene, with the Pareto front: what is
//! dominated fades, what is on the front is joined and named.

use super::facets::{self, SMALL, Sample};
use super::figure::{Anchor, Figure, Part, Rect, TextStyle, plain, text_box};
use super::labels::Grid;
use super::pareto;
use super::scale::{Kind, Scale};
use super::style::{FRAME, INK, Legend, MUTED, SHADE};
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
    at: (f64, f64),
    on_front: bool,
}

pub fn draw(grid: &Grid, legend: &Legend, what: &Scatter) -> Figure {
    let columns = grid.places.len().clamp(1, 2);
    let rows = grid.places.len().div_ceil(columns);
    let (w, h) = if columns == 1 { (840.0, 320.0) } else { (404.0, 236.0) };
    let (left, gap) = (74.0, (84.0, 78.0));
    let width = left + columns as f64 * w + (columns as f64 - 1.0) * gap.0 + 28.0;
    let top = 58.0 + facets::legend_height(legend, width - 32.0) + 26.0;
    let height = top + rows as f64 * h + (rows as f64 - 1.0) * gap.1 + 46.0;
    let mut figure = Figure::new(what.id, what.title, width, height);
    facets::title(&mut figure, what.title, what.sub);
    facets::legend(&mut figure, legend, 16.0, 58.0, width - 32.0, Sample::Marker);
    let mut words = format!("{}. {} against {}. ", what.title, what.y_axis, what.x_axis);

    for (i, plot) in facets::panels(grid.places.len(), columns, left, top, (w, h), gap).into_iter().enumerate() {
        figure.part(Part::Plot, plot);
        let dots = panel(&mut figure, grid, legend, what, i, plot);
        let front: Vec<&str> =
            dots.iter().filter(|d| d.on_front).map(|d| grid.combinations[d.combination].as_str()).collect();
        words += &format!("{}: on the front {}. ", grid.places[i], front.join(", "));
    }
    figure.description = words.trim_end().to_string();
    figure
}

fn panel(figure: &mut Figure, grid: &Grid, legend: &Legend, what: &Scatter, place: usize, plot: Rect) -> Vec<Dot> {
    let mut dots: Vec<Dot> = grid.cells[place]
        .iter()
        .enumerate()
        .filter_map(|(combination, cell)| {
            let data = cell.filter(|r| r.status == RunStatus::Done).and_then(what.point)?;
            Some(Dot { combination, data, at: (0.0, 0.0), on_front: false })
        })
        .collect();
    let without = grid.cells[place].iter().filter(|c| c.is_some()).count() - dots.len();
    let note = if without > 0 { format!("{without} without a point") } else { String::new() };
    facets::panel_head(figure, plot, &grid.places[place], &note);

    let xs: Vec<f64> = dots.iter().map(|d| d.data.0).collect();
    let ys: Vec<f64> = dots.iter().map(|d| d.data.1).collect();
    // Air at both ends, or markers and labels would leave the panel.
    let x = Scale::fitting(&xs);
    let inset = if x.is_log() { 14.0 } else { 0.0 };
    let x = x.onto(plot.x + inset, plot.right() - 14.0);
    let zeros = ys.iter().filter(|y| **y <= 0.0).count();
    let y = if what.zero_bin {
        // Room for names above and below the points at zero.
        let bin = if zeros == ys.len() { plot.h } else { if zeros == 0 { 22.0 } else { 64.0 } };
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
            let look = legend.look(&grid.combinations[dot.combination]);
            let (radius, alpha) = if on_front { (5.0, 1.0) } else { (4.2, 0.45) };
            figure.marker(dot.at.0, dot.at.1, radius, look.shape, look.colour, alpha);
        }
    }
    name_dots(figure, grid, &dots, &stairs, plot);
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

/// Names beside the dots, the front first, clear of dots, of the front's line
/// and of each other. What is dominated gets its name where there is room right
/// beside it; the legend names everything.
fn name_dots(figure: &mut Figure, grid: &Grid, dots: &[Dot], stairs: &[(f64, f64)], plot: Rect) {
    let mut taken: Vec<Rect> = dots.iter().map(|d| Rect::new(d.at.0 - 5.0, d.at.1 - 5.0, 10.0, 10.0)).collect();
    taken.extend(stairs.windows(2).map(|s| {
        let (x, y) = (s[0].0.min(s[1].0), s[0].1.min(s[1].1));
        Rect::new(x - 1.0, y - 1.0, (s[1].0 - s[0].0).abs() + 2.0, (s[1].1 - s[0].1).abs() + 2.0)
    }));
    let mut order: Vec<&Dot> = dots.iter().collect();
    let key = |d: &Dot| (!d.on_front, d.at.0, d.combination);
    order.sort_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
    });
    for dot in order {
        let name = &grid.combinations[dot.combination];
        let colour = if dot.on_front { INK } else { MUTED };
        let style = TextStyle { bold: dot.on_front, ..plain(SMALL, colour) };
        let Some((r, style, x, y)) = free_place(dot.at, name, style, plot, &taken) else { continue };
        figure.label(x, y, name, style);
        taken.push(r);
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
    let places = [
        (Anchor::Start, 9.0, 3.6),
        (Anchor::Start, 7.0, -5.0),
        (Anchor::Start, 7.0, 13.0),
        (Anchor::End, -9.0, 3.6),
        (Anchor::End, -7.0, -5.0),
        (Anchor::End, -7.0, 13.0),
        (Anchor::Middle, 0.0, -9.0),
        (Anchor::Middle, 0.0, 17.0),
    ];
    places.into_iter().find_map(|(anchor, dx, dy)| {
        let style = TextStyle { anchor, ..style };
        let (x, y) = (at.0 + dx, at.1 + dy);
        let r = text_box(x, y, name, style);
        (plot.contains(&r) && !taken.iter().any(|t| t.overlaps(&r))).then_some((r, style, x, y))
    })
}
