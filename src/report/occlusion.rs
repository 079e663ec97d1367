//! Charts of studies in which occlusion is queried: the virtual frame, draw calls and
//! queries, frame by frame.

use super::charts::{basis, with_caption};
use super::curves::{self, Curves};
use super::figure::Figure;
use super::format::count;
use super::labels::Grid;
use super::virtual_clock;
use crate::results::RunResult;

/// Whether any run asks for occlusion.
pub fn concerns(grid: &Grid) -> bool {
    grid.runs().any(|r| r.further.contains_key("queries"))
}

pub fn all(grid: &Grid) -> Vec<Figure> {
    vec![virtual_time(grid), draw_calls(grid), queries(grid)]
}

/// One counted series: identical in every trial, so one line.
fn counted(values: &[f64]) -> Vec<Vec<f64>> {
    if values.is_empty() { vec![] } else { vec![values.to_vec()] }
}

fn chart(grid: &Grid, what: Curves, about: &str) -> Figure {
    let every = grid.results.consolidate_frames.max(1);
    let caption = format!(
        "{about}; {}. Each point is the mean of {}. Identical in every repeat, so there is no band.{}",
        basis(grid),
        count(every.into(), "frame", "frames"),
        curves::words(grid)
    );
    with_caption(curves::draw(grid, &what), caption)
}

fn virtual_time(grid: &Grid) -> Figure {
    let what = Curves {
        id: "virtual-time-per-frame",
        title: "Frame time on the virtual clock",
        sub: "Modelled: processor and graphics queue side by side, stalls of queries included.",
        axis: "virtual frame time (ms)",
        working_only: false,
        series: &|r| counted(&virtual_clock::frames_ms(r)),
    };
    chart(grid, what, &format!("Virtual time of every frame. {}", virtual_clock::WORDS))
}

fn draw_calls(grid: &Grid) -> Figure {
    let what = Curves {
        id: "draw-calls-per-frame",
        title: "Draw calls per frame",
        sub: "Counted: runs of one material in what is submitted.",
        axis: "draw calls",
        working_only: false,
        series: &|r| counted(&r.draw_calls),
    };
    chart(grid, what, "Draw calls of every frame")
}

fn queries(grid: &Grid) -> Figure {
    let series = |r: &RunResult| r.further.get("queries").map_or_else(Vec::new, |q| counted(q));
    let what = Curves {
        id: "queries-per-frame",
        title: "Occlusion queries per frame",
        sub: "Counted; methods that ask none have no line.",
        axis: "queries",
        working_only: false,
        series: &series,
    };
    chart(grid, what, "Occlusion queries of every frame")
}
