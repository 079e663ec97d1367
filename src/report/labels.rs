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
    let parts = run.spec.culling.iter().filter(|part| culling::knows_arithmetic(part));
    let of = |part: &Spec| match part.params.get(NAME) {
        Some(stated) => stated.to_string(),
        None => format_sum(&axis_value(&run.spec, NAME)),
    };
    let all: BTreeSet<String> = parts.map(of).collect();
    if all.is_empty() { "takes none".into() } else { all.into_iter().collect::<Vec<_>>().join("+") }
}

/// What names are made of.
#[derive(Debug, Clone)]
pub struct Parts {
    pub scene: String,
    pub path: String,
    pub structure: String,
    pub culling: String,
    pub walk: String,
    /// The value of the axis, and whether the run states it.
    pub arithmetic: String,
    pub states_arithmetic: bool,
    pub further: Vec<String>,
    pub machine_class: String,
    pub series: u32,
}

impl Parts {
    pub fn of(run: &RunResult) -> Parts {
        Parts {
            scene: run.scene().to_string(),
            path: run.spec.path.name.clone(),
            structure: run.structure.clone(),
            culling: run.culling.clone(),
            walk: run.walk.clone(),
            arithmetic: format_sum(&axis_value(&run.spec, NAME)),
            states_arithmetic: run.spec.axes.contains_key(NAME),
            further: run.spec.further(),
            machine_class: run.machine_class.clone(),
            series: run.spec.series,
        }
    }
}

/// Names of all runs, in their order. A walk is named only where runs of the
/// same structure differ in it; an arithmetic where it is not the usual one or where
/// runs of one method differ in it; a machine class or series only when they vary.
pub fn names(runs: &[Parts]) -> Vec<Names> {
    let mut walks: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut paths: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut usual_only: BTreeMap<(&str, &str), bool> = BTreeMap::new();
    for run in runs {
        walks.entry(&run.structure).or_default().insert(&run.walk);
        paths.entry(&run.scene).or_default().insert(&run.path);
        *usual_only.entry((&run.structure, &run.culling)).or_insert(true) &= !run.states_arithmetic;
    }
    let machines: BTreeSet<&str> = runs.iter().map(|r| r.machine_class.as_str()).collect();
    let series: BTreeSet<u32> = runs.iter().map(|r| r.series).collect();
    let name = |run: &Parts| {
        let mut rest = String::new();
        if walks[run.structure.as_str()].len() > 1 {
            rest += &format!(" × {}", run.walk);
        }
        if !usual_only[&(run.structure.as_str(), run.culling.as_str())] && !run.states_arithmetic {
            rest += &format!(" × {}", run.arithmetic);
        }
        for part in &run.further {
            rest += &format!(" × {part}");
        }
        if machines.len() > 1 {
            rest += &format!(" on {}", run.machine_class);
        }
        if series.len() > 1 {
            rest += &format!(" (series {})", run.series);
        }
        let scene = &run.scene;
        let several = paths[scene.as_str()].len() > 1;
        let place = if several { format!("{scene} / {}", run.path) } else { scene.clone() };
        Names {
            place,
            variant: format!("{}{rest}", run.structure),
            culling: run.culling.clone(),
            combination: format!("{} × {}{rest}", run.structure, run.culling),
        }
    };
    runs.iter().map(name).collect()
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
        let names = names(&results.runs.iter().map(Parts::of).collect::<Vec<_>>());
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
