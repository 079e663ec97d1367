//! Claims that something is the best of many: who is best is fixed by the medians, and the
//! best of the numerator stands against the best of the rest.

use super::claims::{Group, Verdict, combine, decide, ratio, stated};
use super::labels;
use super::metrics::{self, Kind, Metric};
use super::pairs::group_name;
use super::rows::may_lose;
use crate::claim::{Better, Claim, Selection, selects};
use crate::record::cameras;
use crate::results::{RunResult, RunStatus, StudyResults};
use std::collections::BTreeSet;

/// What a claim compares in one group: runs of the numerator, and all others that the
/// denominator selects.
struct Field<'a> {
    name: String,
    named: Vec<&'a RunResult>,
    rest: Vec<&'a RunResult>,
}

fn fields<'a>(results: &'a StudyResults, claim: &Claim) -> Vec<Field<'a>> {
    let mut out: Vec<Field> = Vec::new();
    for run in results.runs.iter().filter(|r| selects(&claim.denominator, &r.spec)) {
        let name = group_name(results, claim, run);
        let field = match out.iter_mut().position(|f| f.name == name) {
            Some(i) => &mut out[i],
            None => {
                out.push(Field { name, named: Vec::new(), rest: Vec::new() });
                out.last_mut().expect("just pushed")
            }
        };
        if selects(&claim.numerator, &run.spec) { &mut field.named } else { &mut field.rest }.push(run);
    }
    // The claim speaks of the groups that have runs of the numerator.
    out.retain(|f| !f.named.is_empty());
    out
}

/// By the metric of the claim, measured and modelled as far as there are twins.
pub fn groups(
    results: &StudyResults,
    claim: &Claim,
    measured: Option<&Metric>,
    modelled: Option<&Metric>,
) -> Vec<Group> {
    fields(results, claim).iter().map(|field| judge(results, claim, field, measured, modelled)).collect()
}

fn judge(
    results: &StudyResults,
    claim: &Claim,
    field: &Field,
    measured: Option<&Metric>,
    modelled: Option<&Metric>,
) -> Group {
    let mut notes: Vec<String> = Vec::new();
    let mut one = |metric: Option<&Metric>| {
        let Some(metric) = metric else { return (None, None) };
        let (found, verdict, note) = by(results, claim, field, metric);
        if !notes.contains(&note) {
            notes.push(note);
        }
        (found, Some(verdict))
    };
    let (ratio, measured) = one(measured);
    let (model_ratio, model) = one(modelled);
    let is_modelled = metrics::find(&claim.metric).is_some_and(|m| m.kind == Kind::Modelled);
    let verdict = combine(is_modelled, measured, model);
    let published = claim.published_of(&field.name);
    let note = match (notes.len(), is_modelled) {
        (2, _) => format!("measured: {}; modelled: {}", notes[0], notes[1]),
        _ => notes.concat(),
    };
    Group { name: field.name.clone(), stated: stated(claim, published), verdict, ratio, model_ratio, note }
}

type Found = (Option<(f64, f64, f64)>, Verdict, String);

fn by(results: &StudyResults, claim: &Claim, field: &Field, metric: &Metric) -> Found {
    let undecided = |why: String| (None, Verdict::Undecided, why);
    if let Some(several) = mixed(results, claim, field, metric) {
        return undecided(several);
    }
    let (named, unnamed) = (side(&field.named, metric), side(&field.rest, metric));
    let (Some(a), Some(b)) = (named.best, unnamed.best) else {
        let why = if named.best.is_none() { named.missing } else { unnamed.missing };
        return undecided(why.unwrap_or_else(|| "the denominator selects no other run".into()));
    };
    let (x, y) = (metric.values(a), metric.values(b));
    // Turned so that less is better whatever the metric.
    let pair = if metric.better == Better::More { (y, x) } else { (x, y) };
    let lonely = matches!(metric.kind, Kind::Measured | Kind::Modelled) && (pair.0.len() < 2 || pair.1.len() < 2);
    let found = if metric.value(a) == metric.value(b) && pair.0 == pair.1 { (1.0, 1.0, 1.0) } else { ratio(&[pair]) };
    let verdict = match decide(claim.relation, None, 0.0, found) {
        _ if lonely => Verdict::Undecided,
        // A run without a number might have been the best of its side.
        Verdict::Reproduced if unnamed.missing.is_some() => Verdict::Undecided,
        Verdict::Contradicted if named.missing.is_some() => Verdict::Undecided,
        verdict => verdict,
    };
    let dagger = |run: &RunResult| if may_lose(run) { "† " } else { "" };
    let mut note = format!("{}{} against {}{}", dagger(a), name(a), dagger(b), name(b));
    let withheld = named.withheld + unnamed.withheld;
    if withheld > 0 {
        note += &format!("; {withheld} wrong for the declared class and left out");
    }
    if let Some(missing) = named.missing.or(unnamed.missing) {
        note += &format!("; {missing}");
    }
    if lonely {
        note += "; a single trial: no interval";
    }
    (Some(found), verdict, note)
}

/// The walk is part of what won.
fn name(run: &RunResult) -> String {
    format!("{} × {}", run.label(), run.walk)
}

/// Why runs of the field cannot be set against each other.
fn mixed(results: &StudyResults, claim: &Claim, field: &Field, metric: &Metric) -> Option<String> {
    let all = || field.named.iter().chain(&field.rest);
    let count = |of: &dyn Fn(&RunResult) -> String| all().map(|r| of(r)).collect::<BTreeSet<_>>().len();
    let names_camera = |s: &Selection| s.contains_key(cameras::AXIS);
    let timed = matches!(metric.kind, Kind::Measured | Kind::Modelled);
    if count(&|r| labels::place(results, r)) > 1 {
        return Some("runs of several scenes or paths: judge them for_each = \"scene\"".into());
    }
    if count(&|r| format!("{:?}", r.spec.camera)) > 1 && !names_camera(&claim.numerator) {
        return Some("runs of several cameras: name one in both selections".into());
    }
    (timed && count(&|r| format!("{} {}", r.machine_class, r.spec.series)) > 1)
        .then(|| "times of several machines or series".into())
}

struct Side<'a> {
    best: Option<&'a RunResult>,
    /// Which run has no number, though it may yet have one.
    missing: Option<String>,
    /// Wrong for the class that they declare: no contenders.
    withheld: usize,
}

fn side<'a>(runs: &[&'a RunResult], metric: &Metric) -> Side<'a> {
    let mut out = Side { best: None, missing: None, withheld: 0 };
    let mut best = f64::INFINITY;
    for &run in runs {
        if run.status == RunStatus::Wrong {
            out.withheld += 1;
            continue;
        }
        let Some(value) = metric.value(run).filter(|_| run.status == RunStatus::Done) else {
            let state = run.status.word();
            out.missing.get_or_insert(format!("{} is {state} or has no {}", run.label(), metric.name));
            continue;
        };
        let value = if metric.better == Better::More { -value } else { value };
        if out.best.is_none() || value < best {
            (best, out.best) = (value, Some(run));
        }
    }
    out
}
