//! Claims about a metric itself: that it is 0 in every run, or has the published value.

use super::claims::{Group, Ratio, Verdict, decide, stated};
use super::metrics::{self, Kind, Metric};
use super::{labels, pairs::group_name};
use crate::claim::{Claim, Relation, selects};
use crate::math::arithmetic;
use crate::results::{RunResult, RunStatus, StudyResults};
use crate::stats;

/// A group for every value of the claim's axis that has runs and something to be compared with.
pub fn groups(results: &StudyResults, claim: &Claim) -> Vec<Group> {
    let mut named: Vec<(String, Vec<&RunResult>)> = Vec::new();
    for run in results.runs.iter().filter(|r| selects(&claim.numerator, &r.spec)) {
        let name = match claim.for_each.as_deref() {
            Some(arithmetic::NAME) => labels::arithmetic(run),
            _ => group_name(results, claim, run),
        };
        match named.iter_mut().find(|(n, _)| *n == name) {
            Some((_, runs)) => runs.push(run),
            None => named.push((name, vec![run])),
        }
    }
    let Some(metric) = metrics::find(&claim.metric) else { return Vec::new() };
    let published = |name: &str| claim.published_of(name);
    named.retain(|(name, _)| claim.relation == Relation::Zero || published(name).is_some());
    named.into_iter().map(|(name, runs)| judge(claim, name, &runs, metric)).collect()
}

fn judge(claim: &Claim, name: String, runs: &[&RunResult], metric: &Metric) -> Group {
    let published = claim.published_of(&name);
    let (value, missing) = value(claim.relation, runs, metric);
    let modelled = metric.kind == Kind::Modelled;
    // One trial says nothing of its own spread.
    let lonely = (modelled || metric.kind == Kind::Measured) && runs.iter().any(|r| metric.values(r).len() == 1);
    let verdict = match (value, &missing) {
        (Some(v), missing) => match decide(claim.relation, published, claim.tolerance, v) {
            _ if lonely => Verdict::Undecided,
            // What is missing cannot undo a number above 0, but it may hide one.
            Verdict::Reproduced if missing.is_some() => Verdict::Undecided,
            Verdict::Reproduced if modelled => Verdict::ModelOnly,
            verdict => verdict,
        },
        (None, _) => Verdict::Undecided,
    };
    let note = missing.unwrap_or_else(|| match runs.len() {
        _ if lonely => "a single trial: no interval".into(),
        1 => String::new(),
        n => format!("over {n} runs"),
    });
    let (ratio, model_ratio) = if modelled { (None, value) } else { (value, None) };
    Group { name, stated: stated(claim, published), verdict, ratio, model_ratio, note }
}

/// The largest (`zero`) or the mean (`value`) over the runs with its interval, and
/// which run has no number.
fn value(relation: Relation, runs: &[&RunResult], metric: &Metric) -> (Option<Ratio>, Option<String>) {
    let mut missing = None;
    let mut found: Vec<Ratio> = Vec::new();
    for run in runs {
        // A run that is wrong for its class has been judged: its errors are known.
        let unusable = match run.status {
            RunStatus::Done => false,
            RunStatus::Wrong => metric.kind != Kind::Judged,
            RunStatus::Pending | RunStatus::Failed => true,
        };
        match metric.interval(run).filter(|_| !unusable) {
            Some(interval) => found.push(interval),
            None => {
                let state = run.status.word();
                missing.get_or_insert(format!("{} is {state} or has no {}", run.label(), metric.name));
            }
        }
    }
    let column = |of: fn(&Ratio) -> f64| -> f64 {
        let all: Vec<f64> = found.iter().map(of).collect();
        match relation {
            Relation::Zero => all.iter().copied().fold(0.0, f64::max),
            _ => stats::mean(&all),
        }
    };
    let value = (!found.is_empty()).then(|| (column(|v| v.0), column(|v| v.1), column(|v| v.2)));
    (value, missing)
}
