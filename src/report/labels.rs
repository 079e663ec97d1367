//! Labels of combinations and scenes: as short as they can be and still differ.

use super::style::{Legend, Look};
use crate::claim::axis_value;
use crate::culling;
use crate::math::arithmetic::NAME;
use crate::registry::{Spec, format_sum};
use crate::results::{RunResult, StudyResults};
use std::collections::{BTreeMap, BTreeSet};

/// Labels of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Names {
    /// The scene; with its path when a scene is walked by several.
    pub place: String,
    /// `octree:depth=4`, and whatever else but the culling sets a combination
    /// apart: walk, further axes, machine class, series.
    pub variant: String,
    pub culling: String,
    /// `octree:depth=4 × frustum`: structure, culling, then the rest.
    pub combination: String,
}

/// The arithmetic in which the run's tests are evaluated: what their parts state, else
/// the axis' value; `takes none` where no part knows arithmetics.
pub fn arithmetic(run: &RunResult) -> String {
    let parts = run.spec.culling.iter().filter(|part| culling::knows_arithmetic(&part.kind));
    let of = |part: &Spec| match part.params.get(NAME) {
        Some(stated) => stated.to_string(),
        None => format_sum(&axis_value(&run.spec, NAME)),
    };
    let all: BTreeSet<String> = parts.map(of).collect();
    if all.is_empty() { "takes none".into() } else { all.into_iter().collect::<Vec<_>>().join("+") }
}

/// Names of all runs, in their order. A walk is named only where runs of the
/// same structure differ in it; an arithmetic where it is not the usual one or where
/// runs of one method differ in it; a machine class or series only when they vary.
fn names(results: &StudyResults) -> Vec<Names> {
    let mut walks: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut paths: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut usual_only: BTreeMap<(&str, &str), bool> = BTreeMap::new();
    for run in &results.runs {
        walks.entry(&run.structure).or_default().insert(&run.walk);
        paths.entry(run.scene()).or_default().insert(&run.spec.path.name);
        *usual_only.entry((&run.structure, &run.culling)).or_insert(true) &= !run.spec.axes.contains_key("arithmetic");
    }
    let machines: BTreeSet<&str> = results.runs.iter().map(|r| r.machine_class.as_str()).collect();
    let series: BTreeSet<String> = results.runs.iter().map(|r| r.spec.series.to_string()).collect();
    let name = |run: &RunResult| {
        let mut rest = String::new();
        if walks[run.structure.as_str()].len() > 1 {
            rest += &format!(" × {}", run.walk);
        }
        if !usual_only[&(run.structure.as_str(), run.culling.as_str())] && !run.spec.axes.contains_key("arithmetic") {
            rest += &format!(" × {}", format_sum(&axis_value(&run.spec, "arithmetic")));
        }
        for part in run.spec.further() {
            rest += &format!(" × {part}");
        }
        if machines.len() > 1 {
            rest += &format!(" on {}", run.machine_class);
        }
        if series.len() > 1 {
            rest += &format!(" (series {})", run.spec.series);
        }
        let scene = run.scene();
        let place = if paths[scene].len() > 1 { format!("{scene} / {}", run.spec.path.name) } else { scene.into() };
        Names {
            place,
            variant: format!("{}{rest}", run.structure),
            culling: run.culling.clone(),
            combination: format!("{} × {}{rest}", run.structure, run.culling),
        }
    };
    results.runs.iter().map(name).collect()
}

/// The scene; with its path when a scene is walked by several.
pub fn place(results: &StudyResults, run: &RunResult) -> String {
    let several = |other: &RunResult| other.scene() == run.scene() && other.spec.path.name != run.spec.path.name;
    if results.runs.iter().any(several) {
        format!("{} / {}", run.scene(), run.spec.path.name)
    } else {
        run.scene().to_string()
    }
}

/// A run of every cell of places x combinations: `None` where the matrix has none.
pub struct Grid<'a> {
    pub results: &'a StudyResults,
    pub legend: Legend,
    /// In the order of the matrix.
    pub places: Vec<String>,
    pub combinations: Vec<String>,
    /// Of each combination: its index in `legend.variants`.
    pub variant_of: Vec<usize>,
    /// `cells[place][combination]`.
    pub cells: Vec<Vec<Option<&'a RunResult>>>,
    /// Of each run, in the order of the results.
    pub names: Vec<Names>,
}

impl<'a> Grid<'a> {
    pub fn of(results: &'a StudyResults) -> Grid<'a> {
        let names = names(results);
        let legend = Legend::of(&names);
        let mut places: Vec<String> = Vec::new();
        for n in &names {
            if !places.contains(&n.place) {
                places.push(n.place.clone());
            }
        }
        let combinations: Vec<String> = legend.entries.iter().map(|e| e.label.clone()).collect();
        let mut cells = vec![vec![None; combinations.len()]; places.len()];
        for (run, n) in results.runs.iter().zip(&names) {
            let p = places.iter().position(|p| *p == n.place);
            let c = combinations.iter().position(|c| *c == n.combination);
            if let (Some(p), Some(c)) = (p, c) {
                cells[p][c].get_or_insert(run);
            }
        }
        let variant_of = legend.entries.iter().map(|e| e.variant).collect();
        Grid { results, legend, places, combinations, variant_of, cells, names }
    }

    pub fn runs(&self) -> impl Iterator<Item = &'a RunResult> + '_ {
        self.cells.iter().flatten().filter_map(|c| *c)
    }

    /// All runs of the study with their names.
    pub fn named(&self) -> impl Iterator<Item = (&'a RunResult, &Names)> + '_ {
        self.results.runs.iter().zip(&self.names)
    }

    pub fn look(&self, combination: &str) -> Look {
        self.legend.look(combination)
    }
}
