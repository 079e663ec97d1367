//! Charts over the frames of a path: one panel a scene, one line a combination.

use super::consolidate::{BandPoint, band};
use super::facets::{self, Sample};
use super::figure::{Figure, Mark, Part};
use super::labels::Grid;
use super::metrics::frames;
use super::rows::absence;
use super::scale::Scale;
use super::style::Legend;
use crate::results::{RunResult, RunStatus};

pub struct Curves<'a> {
    pub id: &'a str,
    pub title: &'a str,
    pub sub: &'a str,
    /// Quantity and unit.
    pub axis: &'a str,
    /// Per trial, frame by frame, in the unit of the axis; empty has no line.
    pub series: &'a dyn Fn(&RunResult) -> Vec<Vec<f64>>,
}

pub fn draw(grid: &Grid, legend: &Legend, what: &Curves) -> Figure {
    let every = grid.results.consolidate_frames;
    let curves: Vec<Vec<Vec<BandPoint>>> = grid
        .cells
        .iter()
        .map(|row| {
            let usable = |cell: &Option<&RunResult>| cell.filter(|r| r.status == RunStatus::Done).map(what.series);
            row.iter().map(|cell| usable(cell).map_or_else(Vec::new, |trials| band(&trials, every))).collect()
        })
        .collect();

    let columns = grid.places.len().clamp(1, 2);
    let rows = grid.places.len().div_ceil(columns);
    let (w, h) = if columns == 1 { (840.0, 300.0) } else { (404.0, 190.0) };
    let (left, gap) = (74.0, (84.0, 76.0));
    let width = left + columns as f64 * w + (columns as f64 - 1.0) * gap.0 + 28.0;
    let legend_h = facets::legend_height(legend, width - 32.0);
    let top = 58.0 + legend_h + 26.0;
    let height = top + rows as f64 * h + (rows as f64 - 1.0) * gap.1 + 46.0;
    let mut figure = Figure::new(what.id, what.title, width, height);
    facets::title(&mut figure, what.title, what.sub);
    facets::legend(&mut figure, legend, 16.0, 58.0, width - 32.0, Sample::Line);

    for (i, plot) in facets::panels(grid.places.len(), columns, left, top, (w, h), gap).into_iter().enumerate() {
        figure.part(Part::Plot, plot);
        let points = || curves[i].iter().flatten();
        let values: Vec<f64> = points().flat_map(|p| [p.low, p.high]).collect();
        let y = y_scale(grid, i, &curves[i], &values).onto(plot.bottom(), plot.y);
        let last = grid.cells[i].iter().flatten().map(|r| frames(r)).max().unwrap_or(1);
        let x = Scale { high: last.max(1) as f64, ..Scale::from_zero([1.0]) }.onto(plot.x, plot.right());
        facets::panel_head(&mut figure, plot, &grid.places[i], &missing(grid, i));
        facets::y_axis(&mut figure, plot, &y, 5);
        facets::x_axis(&mut figure, plot, &x, 6, true);
        facets::x_title(&mut figure, plot, "frame");
        facets::y_title(&mut figure, plot, what.axis, 50.0);
        for (c, curve) in curves[i].iter().enumerate() {
            let colour = legend.look(&grid.combinations[c]).colour;
            let upper = curve.iter().map(|p| (x.at(p.frame), y.at(p.high)));
            let lower = curve.iter().rev().map(|p| (x.at(p.frame), y.at(p.low)));
            if curve.iter().any(|p| p.high > p.low) {
                figure.marks.push(Mark::Polygon { points: upper.chain(lower).collect(), colour, alpha: 0.18 });
            }
        }
        for (c, curve) in curves[i].iter().enumerate() {
            let look = legend.look(&grid.combinations[c]);
            let line: Vec<(f64, f64)> = curve.iter().map(|p| (x.at(p.frame), y.at(p.middle))).collect();
            figure.dashed(&line, look.colour, 1.5, 1.0, look.dash);
            if line.len() == 1 {
                figure.marker(line[0].0, line[0].1, 3.0, look.shape, look.colour, 1.0);
            }
        }
    }
    figure.description = describe(grid, &curves, what);
    figure
}

/// Linear from zero unless the combinations that cull range widely: those that
/// cull nothing cost next to nothing and must not squeeze all others.
fn y_scale(grid: &Grid, place: usize, curves: &[Vec<BandPoint>], all: &[f64]) -> Scale {
    let culls = |c: &usize| grid.cells[place][*c].is_some_and(|r| r.culling != "none");
    let working: Vec<f64> = (0..curves.len()).filter(culls).flat_map(|c| curves[c].iter().map(|p| p.middle)).collect();
    if Scale::fitting(&working).is_log() { Scale::fitting(all) } else { Scale::from_zero(all.iter().copied()) }
}

/// "2 failed, 1 wrong" for the combinations without a line.
fn missing(grid: &Grid, place: usize) -> String {
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for cell in &grid.cells[place] {
        if cell.is_some_and(|r| r.status == RunStatus::Done) {
            continue;
        }
        let words = absence(*cell).0;
        match counts.iter_mut().find(|(w, _)| *w == words) {
            Some((_, n)) => *n += 1,
            None => counts.push((words, 1)),
        }
    }
    let parts: Vec<String> = counts.iter().map(|(w, n)| format!("{n} {w}")).collect();
    parts.join(", ")
}

fn describe(grid: &Grid, curves: &[Vec<Vec<BandPoint>>], what: &Curves) -> String {
    let mut out = format!("{}. {}, against frame. ", what.title, what.axis);
    for (place, row) in grid.places.iter().zip(curves) {
        let parts: Vec<String> = grid
            .combinations
            .iter()
            .zip(row)
            .filter(|(_, c)| !c.is_empty())
            .map(|(label, c)| {
                let low = c.iter().map(|p| p.middle).fold(f64::INFINITY, f64::min);
                let high = c.iter().map(|p| p.middle).fold(0.0, f64::max);
                format!("{label} from {} to {}", super::format::number(low, 3), super::format::number(high, 3))
            })
            .collect();
        out += &format!("{place}: {}. ", parts.join(", "));
    }
    out.trim_end().to_string()
}
