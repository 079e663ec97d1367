//! Two studies, or two series of one, cell by cell.
//!
//! The ratio of two runs is paired frame by frame: the geometric mean over the
//! path of the second run's culling time over the first's. Since the mean of
//! log-ratios is the difference of mean logs, each trial reduces to one number,
//! and the bootstrap resamples trials as everywhere else.

use super::metrics::{self, Kind, Metric};
use super::table::{Cell, Column, Table, column, interval, number};
use crate::error::{Error, Result};
use crate::record::cameras;
use crate::registry::format_sum;
use crate::results::{RunResult, RunStatus, StudyResults};
use crate::stats;
use std::collections::{HashMap, VecDeque};

/// What is compared when no metric is named.
pub const PAIRED: &str = "paired_frame_time";

/// Where the second study stands against the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    Lower,
    Higher,
    /// The interval holds 1.
    Same,
    /// Too few trials for an interval.
    Unknown,
    /// Not comparable: the note says why.
    None,
}

impl Change {
    pub fn word(self) -> &'static str {
        match self {
            Change::Lower => "lower",
            Change::Higher => "higher",
            Change::Same => "no significant change",
            Change::Unknown => "single trial: no interval",
            Change::None => "not compared",
        }
    }
}

pub struct Pair<'a> {
    pub first: Option<&'a RunResult>,
    pub second: Option<&'a RunResult>,
    /// Second over first.
    pub ratio: Option<(f64, f64, f64)>,
    pub change: Change,
    pub note: String,
}

/// All cells of both studies, the largest change first, what cannot be compared last.
///
/// # Errors
/// For an unknown metric.
pub fn compare<'a>(first: &'a StudyResults, second: &'a StudyResults, metric: &str) -> Result<Vec<Pair<'a>>> {
    let metric = if metric == PAIRED { None } else { Some(metrics::get(metric)?) };
    let mut taken = vec![false; second.runs.len()];
    let mut pairs = Vec::new();
    let mut places: HashMap<String, VecDeque<usize>> = HashMap::new();
    for (i, b) in second.runs.iter().enumerate() {
        places.entry(cell(b)).or_default().push_back(i);
    }
    for a in &first.runs {
        let found = places.get_mut(&cell(a)).and_then(VecDeque::pop_front);
        if let Some(i) = found {
            taken[i] = true;
        }
        pairs.push(pair(Some(a), found.map(|i| &second.runs[i]), metric));
    }
    let rest = second.runs.iter().zip(&taken).filter(|(_, t)| !**t);
    pairs.extend(rest.map(|(b, _)| pair(None, Some(b), metric)));
    if !pairs.iter().any(|p| p.first.is_some() && p.second.is_some()) {
        return Err(Error::new(format!("`{}` and `{}` have no cell in common", first.name, second.name)).help(
            "cells match by scene, path, camera, structure, culling, walk and arithmetic with all their parameters",
        ));
    }
    let size = |p: &Pair| p.ratio.map_or(-1.0, |(r, ..)| r.ln().abs());
    let rank = |p: &Pair| match p.change {
        Change::Lower | Change::Higher => 0,
        Change::Same | Change::Unknown => 1,
        Change::None => 2,
    };
    pairs.sort_by(|a, b| rank(a).cmp(&rank(b)).then(size(b).total_cmp(&size(a))));
    Ok(pairs)
}

/// What makes two runs the same cell. By name, not by content: a study is also
/// compared with one on a changed scene or algorithm, and a note says so.
pub(super) fn cell(run: &RunResult) -> String {
    let s = &run.spec;
    // The camera stands there by its numbers, however its manifest named it.
    let axes: Vec<String> =
        s.axes.iter().filter(|(k, _)| *k != cameras::AXIS).map(|(k, v)| format!("{k}={v}")).collect();
    format!(
        "{}|{}|{:?}|{}|{}|{}|{}",
        s.scene.name,
        s.path.name,
        s.camera,
        s.structure,
        format_sum(&s.culling),
        s.walk,
        axes.join("|")
    )
}

fn pair<'a>(first: Option<&'a RunResult>, second: Option<&'a RunResult>, metric: Option<&Metric>) -> Pair<'a> {
    let outcome = match (first, second) {
        (Some(a), Some(b)) => ratio(a, b, metric),
        (Some(_), None) => Err("only in the first".into()),
        _ => Err("only in the second".into()),
    };
    let mut note = match (first, second) {
        (Some(a), Some(b)) if a.answer_id != b.answer_id => "answers differ (scene, path or revision changed)".into(),
        _ => String::new(),
    };
    match outcome {
        Ok((ratio, change)) => Pair { first, second, ratio: Some(ratio), change, note },
        Err(why) => {
            note = why;
            Pair { first, second, ratio: None, change: Change::None, note }
        }
    }
}

type Outcome = std::result::Result<((f64, f64, f64), Change), String>;

fn ratio(a: &RunResult, b: &RunResult, metric: Option<&Metric>) -> Outcome {
    for (run, which) in [(a, "first"), (b, "second")] {
        if run.status != RunStatus::Done {
            return Err(format!("{} in the {which}", run.status.word()));
        }
    }
    let timed = metric.is_none_or(|m| matches!(m.kind, Kind::Measured | Kind::Modelled));
    if timed && a.machine_class != b.machine_class {
        return Err(format!("times of different machines ({} and {})", a.machine_class, b.machine_class));
    }
    let (x, y) = match metric {
        Some(m) => (m.values(a), m.values(b)),
        None => {
            if metrics::frames(a) != metrics::frames(b) {
                return Err(format!("paths of {} and {} frames", metrics::frames(a), metrics::frames(b)));
            }
            (geometric_means(a), geometric_means(b))
        }
    };
    if x.is_empty() || y.is_empty() {
        return Err("no value on one side".into());
    }
    let found = stats::ratio_ci(&y, &x, stats::RESAMPLES, metrics::SEED);
    if !found.0.is_finite() {
        return Err("the first is zero".into());
    }
    let change = match found {
        _ if timed && (x.len() < 2 || y.len() < 2) => Change::Unknown,
        (_, _, high) if high < 1.0 => Change::Lower,
        (_, low, _) if low > 1.0 => Change::Higher,
        _ => Change::Same,
    };
    Ok((found, change))
}

/// Geometric mean of the frames' times, one value a trial. The clock's zero
/// counts as one nanosecond.
fn geometric_means(run: &RunResult) -> Vec<f64> {
    let mean = |t: &Vec<f64>| stats::mean(&t.iter().map(|ns| ns.max(1.0).ln()).collect::<Vec<_>>()).exp();
    run.trial_cull_ns.iter().filter(|t| !t.is_empty()).map(mean).collect()
}

/// The pairs as a table; `names` head the columns of both studies.
pub fn table(pairs: &[Pair], metric: &str, names: (&str, &str)) -> Table {
    let shown = if metric == PAIRED { "median_frame_us" } else { metric };
    let m = metrics::known(shown);
    let mut columns = vec![Column::text("scene"), Column::text("structure"), Column::text("culling")];
    columns.push(column(names.0, m.unit, m.about));
    columns.push(column(names.1, m.unit, m.about));
    columns.push(column("ratio", "", "second over first").with_interval());
    columns.extend([Column::text("change"), Column::text("note")]);
    let mut table = Table::new("compare", &format!("{} against {}", names.1, names.0), 3, columns);
    for p in pairs {
        let Some(run) = p.first.or(p.second) else { continue };
        let value = |r: Option<&RunResult>| number(r.and_then(|r| m.value(r)));
        table.rows.push(vec![
            Cell::Text(run.scene().into()),
            Cell::Text(run.structure.clone()),
            Cell::Text(run.culling.clone()),
            value(p.first),
            value(p.second),
            interval(p.ratio),
            Cell::Text(p.change.word().into()),
            Cell::Text(p.note.clone()),
        ]);
    }
    table
}
