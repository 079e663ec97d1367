//! Run time against error, one panel a scene, with the Pareto front: what is
//! dominated fades, what is on the front is joined and named.

use super::facets::{self, SMALL, Sample};
use super::figure::{Anchor, Figure, Part, Rect, TextStyle, plain, text_box};
use super::labels::Grid;
use super::pareto;
use super::scale::{Kind, Scale};
use super::style::{FRAME, GRID, INK, Legend, MUTED, SHADE};
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
        // Labels of the points at zero stack within the bin.
        let bin = if zeros == ys.len() { plot.h } else { (34.0 + 11.0 * zeros as f64).min(plot.h * 0.62) };
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
    staircase(figure, &front.iter().map(|i| dots[*i].at).collect::<Vec<_>>(), plot);
    for on_front in [false, true] {
        for dot in dots.iter().filter(|d| d.on_front == on_front) {
            let look = legend.look(&grid.combinations[dot.combination]);
            let (radius, alpha) = if on_front { (5.0, 1.0) } else { (4.2, 0.45) };
            figure.marker(dot.at.0, dot.at.1, radius, look.shape, look.colour, alpha);
        }
    }
    name_dots(figure, grid, &dots, plot);
    dots
}

fn zero_bin(figure: &mut Figure, plot: Rect, bin: f64, alone: bool) {
    let y = plot.bottom() - bin;
    figure.rect(Rect::new(plot.x, y, plot.w, bin), SHADE, 0.8);
    if !alone {
        figure.segment((plot.x, y), (plot.right(), y), FRAME, 1.0);
    }
    figure.label(plot.x - 7.0, plot.bottom() - bin / 2.0 + 3.6, "0", plain(SMALL, MUTED).end());
    figure.segment((plot.x, plot.bottom() - bin / 2.0), (plot.right(), plot.bottom() - bin / 2.0), GRID, 1.0);
}

/// The border of what is attainable: from each point of the front right, then down.
fn staircase(figure: &mut Figure, front: &[(f64, f64)], plot: Rect) {
    let Some(first) = front.first() else { return };
    let mut line = vec![(first.0, plot.y)];
    for (i, p) in front.iter().enumerate() {
        line.push(*p);
        let right = front.get(i + 1).map_or(plot.right(), |n| n.0);
        line.push((right, p.1));
    }
    figure.dashed(&line, MUTED, 1.1, 0.9, &[4.0, 3.0]);
}

/// Names beside the dots, the front first. A name that finds no free place near
/// its dot moves away on a thin leader; one that finds none at all is left to the legend.
fn name_dots(figure: &mut Figure, grid: &Grid, dots: &[Dot], plot: Rect) {
    let mut taken: Vec<Rect> = dots.iter().map(|d| Rect::new(d.at.0 - 5.0, d.at.1 - 5.0, 10.0, 10.0)).collect();
    let mut order: Vec<&Dot> = dots.iter().collect();
    order.sort_by(|a, b| {
        b.on_front.cmp(&a.on_front).then(a.at.0.total_cmp(&b.at.0)).then(a.combination.cmp(&b.combination))
    });
    for dot in order {
        let name = &grid.combinations[dot.combination];
        let colour = if dot.on_front { INK } else { MUTED };
        let style = TextStyle { bold: dot.on_front, ..plain(SMALL, colour) };
        let Some((r, style, x, y)) = free_place(dot.at, name, style, plot, &taken) else { continue };
        let nearest_x = dot.at.0.clamp(r.x, r.right());
        let nearest_y = if r.y > dot.at.1 { r.y } else { r.bottom().min(dot.at.1) };
        if (nearest_x - dot.at.0).hypot(nearest_y - dot.at.1) > 14.0 {
            figure.line(vec![dot.at, (nearest_x, nearest_y)], MUTED, 0.7, 0.55);
        }
        figure.label(x, y, name, style);
        taken.push(r);
    }
}

fn free_place(
    at: (f64, f64),
    name: &str,
    style: TextStyle,
    plot: Rect,
    taken: &[Rect],
) -> Option<(Rect, TextStyle, f64, f64)> {
    for ring in 0..14 {
        let dy = 12.0 * f64::from(ring);
        let rows = if ring == 0 { vec![3.6] } else { vec![3.6 - dy, 3.6 + dy] };
        for row in rows {
            for (anchor, dx) in [(Anchor::Start, 9.0), (Anchor::End, -9.0), (Anchor::Middle, 0.0)] {
                let style = TextStyle { anchor, ..style };
                let (x, y) = (at.0 + dx, at.1 + row);
                let r = text_box(x, y, name, style);
                if plot.contains(&r) && !taken.iter().any(|t| t.overlaps(&r)) {
                    return Some((r, style, x, y));
                }
            }
        }
    }
    None
}
