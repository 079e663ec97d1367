//! Labels of combinations and scenes: as short as they can be and still differ.

use crate::results::{RunResult, StudyResults};
use std::collections::BTreeSet;

/// `octree × frustum`; with walk, path, machine class or series only when the
/// study varies them.
pub fn combination(results: &StudyResults, run: &RunResult) -> String {
    let mut label = run.label();
    if varies(results, |r| r.walk.clone()) {
        label += &format!(" × {}", run.walk);
    }
    for axis in results.runs.iter().flat_map(|r| r.spec.axes.keys()).collect::<BTreeSet<_>>() {
        if let Some(part) = run.spec.axes.get(axis) {
            label += &format!(" × {part}");
        }
    }
    if varies(results, |r| r.machine_class.clone()) {
        label += &format!(" on {}", run.machine_class);
    }
    if varies(results, |r| r.spec.series.to_string()) {
        label += &format!(" (series {})", run.spec.series);
    }
    label
}

/// The scene; with its path when a scene is walked by several, and with the
/// camera's number when a study has several cameras.
pub fn place(results: &StudyResults, run: &RunResult) -> String {
    let several = |other: &RunResult| other.scene() == run.scene() && other.spec.path.name != run.spec.path.name;
    if results.runs.iter().any(several) {
        format!("{} / {}", run.scene(), run.spec.path.name)
    } else {
        run.scene().to_string()
    }
}

/// Places in the order of the matrix.
pub fn places(results: &StudyResults) -> Vec<String> {
    let mut places = Vec::new();
    for run in &results.runs {
        let place = place(results, run);
        if !places.contains(&place) {
            places.push(place);
        }
    }
    places
}

fn varies(results: &StudyResults, of: impl Fn(&RunResult) -> String) -> bool {
    let first = results.runs.first().map(&of);
    results.runs.iter().any(|r| Some(of(r)) != first)
}

/// A run of every cell of places x combinations: `None` where the matrix has none.
pub struct Grid<'a> {
    pub results: &'a StudyResults,
    pub places: Vec<String>,
    pub combinations: Vec<String>,
    /// `cells[place][combination]`.
    pub cells: Vec<Vec<Option<&'a RunResult>>>,
}

impl<'a> Grid<'a> {
    pub fn of(results: &'a StudyResults) -> Grid<'a> {
        let places = places(results);
        let legend = super::style::Legend::of(results);
        let combinations: Vec<String> = legend.entries.iter().map(|(l, _)| l.clone()).collect();
        let mut cells = vec![vec![None; combinations.len()]; places.len()];
        for run in &results.runs {
            let p = places.iter().position(|p| *p == place(results, run));
            let c = combinations.iter().position(|c| *c == combination(results, run));
            if let (Some(p), Some(c)) = (p, c) {
                cells[p][c].get_or_insert(run);
            }
        }
        Grid { results, places, combinations, cells }
    }

    pub fn runs(&self) -> impl Iterator<Item = &'a RunResult> + '_ {
        self.cells.iter().flatten().filter_map(|c| *c)
    }
}
