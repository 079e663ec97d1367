//! The runs that a claim compares: in groups, paired by all that it leaves free.

use super::labels;
use super::metrics::{self, Metric};
use crate::claim::{Claim, axis_value, selects};
use crate::culling;
use crate::record::cameras;
use crate::registry::format_sum;
use crate::results::{RunResult, RunStatus, StudyResults};
use std::collections::{BTreeMap, BTreeSet};

/// Runs of one group, in pairs that agree in all axes that the two selections treat alike:
/// neither names it, or both name the same.
pub struct Pairs<'a> {
    pub name: String,
    pub scene_triangles: Option<f64>,
    pub pairs: Vec<(&'a RunResult, &'a RunResult)>,
}

pub fn groups<'a>(results: &'a StudyResults, claim: &Claim) -> Vec<Pairs<'a>> {
    let mut walks: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for run in &results.runs {
        let structure = format_sum(std::slice::from_ref(&run.spec.structure));
        walks.entry(structure).or_default().insert(run.spec.walk.to_string());
    }
    let fixed = |axis: &str| claim.numerator.get(axis) == claim.denominator.get(axis);
    let free = |run: &RunResult, arithmetic: &str| -> String {
        let mut axes = vec!["scene", "path", "structure", "culling", "walk", "arithmetic"];
        axes.extend(run.spec.axes.keys().map(String::as_str).filter(|a| !matches!(*a, "arithmetic" | "camera")));
        axes.retain(|a| fixed(a));
        let value = |axis: &str| match axis {
            // A structure's only walk is its own: a list is scanned, a tree descended,
            // and a claim about structures compares the two.
            "walk" if walks[&format_sum(std::slice::from_ref(&run.spec.structure))].len() == 1 => "its own".to_string(),
            "arithmetic" => arithmetic.to_string(),
            _ => format_sum(&axis_value(&run.spec, axis)),
        };
        let values = axes.iter().map(|a| format!("{a}={}", value(a)));
        // Times of different machines or series are never mixed; nor, unless a claim
        // asks for it, are scenes of two cameras.
        let camera = if fixed("camera") { format!("{:?}", run.spec.camera) } else { String::new() };
        let key = format!("{} {} {camera}", run.machine_class, run.spec.series);
        values.chain([key]).collect::<Vec<_>>().join(";")
    };
    // What takes no arithmetic ran once, and stands beside the others in each of them.
    let arithmetic = |run: &RunResult| format_sum(&axis_value(&run.spec, "arithmetic"));
    let all: BTreeSet<String> = results.runs.iter().map(arithmetic).collect();
    let keys = |run: &RunResult| -> BTreeSet<String> {
        let takes = run.spec.culling.iter().any(culling::knows_arithmetic);
        if takes { BTreeSet::from([free(run, &arithmetic(run))]) } else { all.iter().map(|a| free(run, a)).collect() }
    };
    let mut partners: BTreeMap<String, Vec<&RunResult>> = BTreeMap::new();
    for b in results.runs.iter().filter(|b| selects(&claim.denominator, &b.spec)) {
        for key in keys(b) {
            partners.entry(key).or_default().push(b);
        }
    }
    let mut groups: Vec<Pairs> = Vec::new();
    for a in results.runs.iter().filter(|r| selects(&claim.numerator, &r.spec)) {
        let name = group_name(results, claim, a);
        let mut beside: Vec<&RunResult> = Vec::new();
        for b in keys(a).iter().flat_map(|key| partners.get(key).into_iter().flatten()) {
            if !beside.iter().any(|other| std::ptr::eq(*other, *b)) {
                beside.push(b);
            }
        }
        for b in beside {
            let group = match groups.iter_mut().position(|g| g.name == name) {
                Some(i) => &mut groups[i],
                None => {
                    let scene_triangles = metrics::known("scene_triangles").value(a);
                    groups.push(Pairs { name: name.clone(), scene_triangles, pairs: Vec::new() });
                    groups.last_mut().expect("just pushed")
                }
            };
            group.pairs.push((a, b));
        }
    }
    groups
}

/// Name of the group that `run` belongs to.
pub fn group_name(results: &StudyResults, claim: &Claim, run: &RunResult) -> String {
    match claim.for_each.as_deref() {
        None => "everywhere".to_string(),
        Some("scene") => labels::place(results, run),
        Some("culling") => run.culling.clone(),
        Some("structure") => run.structure.clone(),
        Some(cameras::AXIS) => axis_value(&run.spec, cameras::AXIS).iter().map(cameras::label).collect(),
        Some(axis) => format_sum(&axis_value(&run.spec, axis)),
    }
}

/// Values of the pairs: (numerator trials, denominator trials); or why there are none.
pub type Trials = Vec<(Vec<f64>, Vec<f64>)>;

pub fn trials(pairs: &Pairs, metric: &Metric) -> Result<Trials, String> {
    let mut out = Vec::new();
    for (a, b) in &pairs.pairs {
        for run in [a, b] {
            if run.status != RunStatus::Done {
                return Err(format!("{} is {}", run.label(), run.status.word()));
            }
            if metric.value(run).is_none() {
                return Err(format!("{} has no {}", run.label(), metric.name));
            }
        }
        out.push((metric.values(a), metric.values(b)));
    }
    Ok(out)
}
