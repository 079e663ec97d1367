//! Charts of studies in which occlusion is queried: the virtual frame, draw calls and
//! queries, frame by frame.

use super::charts::{basis, with_caption};
use super::curves::{self, Curves};
use super::figure::Figure;
use super::format::count;
use super::labels::Grid;
use super::virtual_clock;
use crate::registry::Value;
use crate::results::RunResult;
use std::collections::{BTreeMap, BTreeSet};

/// Whether any run asks for occlusion.
pub fn concerns(grid: &Grid) -> bool {
    grid.runs().any(|r| r.further.contains_key("queries"))
}

pub fn all(grid: &Grid) -> Vec<Figure> {
    vec![virtual_time(grid), draw_calls(grid), queries(grid)]
}

/// Of the first structure, one combination a kind of walk: the first of the matrix.
fn a_kind_each(grid: &Grid) -> Vec<usize> {
    let mut kinds = BTreeSet::new();
    of_first_structure(grid).filter(|(_, r)| kinds.insert(r.spec.walk.kind.clone())).map(|(c, _)| c).collect()
}

/// Of the first structure, what waits for answers as long as most do, beside what asks none.
fn waiting(grid: &Grid) -> Vec<usize> {
    let late = |r: &RunResult| r.spec.walk.params.get("backend") == Some(&Value::Text("latency".into()));
    let latency = |r: &RunResult| r.spec.number("walk.latency_us").unwrap_or_default() as u64;
    let mut often: BTreeMap<u64, usize> = BTreeMap::new();
    of_first_structure(grid).filter(|(_, r)| late(r)).for_each(|(_, r)| *often.entry(latency(r)).or_default() += 1);
    let usual = often.iter().max_by_key(|(_, n)| **n).map(|(us, _)| *us);
    let plain = |r: &RunResult| r.spec.walk.kind == "depth_first";
    let shown = |r: &RunResult| plain(r) || late(r) && Some(latency(r)) == usual;
    of_first_structure(grid).filter(|(_, r)| shown(r)).map(|(c, _)| c).collect()
}

fn first_structure<'a>(grid: &'a Grid) -> &'a str {
    grid.cells.iter().flatten().flatten().next().map_or("", |r| &r.structure)
}

fn of_first_structure<'a>(grid: &'a Grid) -> impl Iterator<Item = (usize, &'a RunResult)> {
    let run = |c: usize| grid.cells.iter().find_map(|place| place[c]);
    let first = first_structure(grid);
    (0..grid.combinations.len()).filter_map(move |c| run(c).filter(|r| r.structure == first).map(|r| (c, r)))
}

/// One counted series: identical in every trial, so one line.
fn counted(values: &[f64]) -> Vec<Vec<f64>> {
    if values.is_empty() { vec![] } else { vec![values.to_vec()] }
}

fn chart(grid: &Grid, what: Curves, about: &str, which: &str) -> Figure {
    let every = grid.results.consolidate_frames.max(1);
    let caption = format!(
        "{about}; {}. Each point is the mean of {}. Drawn is, on {}, {which}; the tables hold all.",
        basis(grid),
        count(every.into(), "frame", "frames"),
        first_structure(grid)
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
        only: Some(waiting(grid)),
        series: &|r| counted(&virtual_clock::frames_ms(r)),
    };
    let about = format!("Virtual time of every frame. {}", virtual_clock::WORDS);
    chart(
        grid,
        what,
        &about,
        "Drawn is, on the first structure, what waits for late answers, beside the frustum alone.",
    )
}

fn draw_calls(grid: &Grid) -> Figure {
    let what = Curves {
        id: "draw-calls-per-frame",
        title: "Draw calls per frame",
        sub: "Counted: runs of one material in what is submitted.",
        axis: "draw calls",
        working_only: false,
        only: Some(a_kind_each(grid)),
        series: &|r| counted(&r.draw_calls),
    };
    chart(grid, what, "Draw calls of every frame", "the first of each kind of walk")
}

fn queries(grid: &Grid) -> Figure {
    let series = |r: &RunResult| r.further.get("queries").map_or_else(Vec::new, |q| counted(q));
    let what = Curves {
        id: "queries-per-frame",
        title: "Occlusion queries per frame",
        sub: "Counted; methods that ask none have no line.",
        axis: "queries",
        working_only: false,
        only: Some(a_kind_each(grid)),
        series: &series,
    };
    chart(grid, what, "Occlusion queries of every frame", "the first of each kind of walk")
}
