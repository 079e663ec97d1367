//! What a study would do: per run whether it is new, finished or would run
//! again and why, and how long all of it may take.

use super::{Matrix, labels};
use crate::manifest::Manifest;
use crate::record::{PathSource, RunSpec};
use crate::registry::Value;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What a store knows of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Known {
    pub state: State,
    /// Seconds that one trial took, where a like run is stored.
    pub trial_s: Option<f64>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum State {
    /// Nothing is stored.
    #[default]
    New,
    /// All trials are stored: skipped.
    Done,
    /// Some trials are stored: the others run.
    Partial { trials: u32 },
    /// Stored, but something it depends on changed: runs again.
    Rerun { why: String },
    /// Measured, but other frames or pixels are to be judged now.
    Rejudge { why: String },
    /// Ended with a failure that is kept: not tried again by itself.
    Failed { why: String },
}

impl State {
    /// One character of the table.
    fn mark(&self) -> char {
        match self {
            State::New => '+',
            State::Done => '=',
            State::Partial { .. } => '~',
            State::Rerun { .. } => '!',
            State::Rejudge { .. } => '?',
            State::Failed { .. } => 'x',
        }
    }
}

#[derive(Debug, Clone, Serialize)]
pub struct Plan {
    pub study: String,
    pub rows: Vec<Row>,
    pub excluded: Vec<Row>,
    pub duplicates: u64,
    pub new: usize,
    pub done: usize,
    pub partial: usize,
    pub rerun: usize,
    pub rejudge: usize,
    pub failed: usize,
    /// Trials still to run at the wanted number of repeats.
    pub trials: u64,
    pub estimate_s: f64,
    /// Runs whose time is guessed by the rule of [`RULE`] for want of stored ones.
    pub guessed: usize,
}

#[derive(Debug, Clone, Serialize)]
pub struct Row {
    pub scene: String,
    pub path: String,
    pub structure: String,
    pub culling: String,
    pub walk: String,
    /// Values of further axes that are not the usual ones.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub axes: BTreeMap<String, String>,
    #[serde(skip)]
    cell: String,
    #[serde(flatten)]
    pub known: Known,
    /// Why it is excluded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excluded: Option<String>,
    pub estimate_s: f64,
}

/// How time is guessed where none is stored.
pub const RULE: &str = "0.3 s a trial + 30 us a frame and pass + 0.2 us a judged sample";

/// The plan of `matrix`; `known` answers from the store, or [`Known::default`] without one.
pub fn plan(manifest: &Manifest, matrix: &Matrix, known: impl Fn(&RunSpec) -> Known) -> Plan {
    let repeats = manifest.repeat.repeats;
    let mut plan = Plan {
        study: manifest.study.name.clone(),
        rows: Vec::with_capacity(matrix.runs.len()),
        excluded: Vec::new(),
        duplicates: matrix.duplicates,
        new: 0,
        done: 0,
        partial: 0,
        rerun: 0,
        rejudge: 0,
        failed: 0,
        trials: 0,
        estimate_s: 0.0,
        guessed: 0,
    };
    for run in &matrix.runs {
        let known = known(run);
        let trials = match &known.state {
            State::New | State::Rerun { .. } => repeats,
            State::Partial { trials } => repeats.saturating_sub(*trials),
            State::Done | State::Rejudge { .. } | State::Failed { .. } => 0,
        };
        *match known.state {
            State::New => &mut plan.new,
            State::Done => &mut plan.done,
            State::Partial { .. } => &mut plan.partial,
            State::Rerun { .. } => &mut plan.rerun,
            State::Rejudge { .. } => &mut plan.rejudge,
            State::Failed { .. } => &mut plan.failed,
        } += 1;
        let judged = !matches!(known.state, State::Done | State::Failed { .. });
        plan.guessed += usize::from(trials > 0 && known.trial_s.is_none());
        let one = known.trial_s.unwrap_or_else(|| trial_guess_s(run));
        let estimate_s = one * f64::from(trials) + if judged { judging_guess_s(run) } else { 0.0 };
        plan.trials += u64::from(trials);
        plan.estimate_s += estimate_s;
        plan.rows.push(row(run, known, None, estimate_s));
    }
    for (run, rule) in &matrix.excluded_runs {
        let why = manifest.exclude[*rule].value.why.clone();
        plan.excluded.push(row(run, Known::default(), Some(why), 0.0));
    }
    plan
}

fn row(run: &RunSpec, known: Known, excluded: Option<String>, estimate_s: f64) -> Row {
    let l = labels(run);
    let cell = l.cell();
    Row {
        scene: l.scene,
        path: l.path,
        structure: l.structure,
        culling: l.culling,
        walk: l.walk,
        axes: run.axes.iter().map(|(axis, spec)| (axis.clone(), spec.to_string())).collect(),
        cell,
        known,
        excluded,
        estimate_s,
    }
}

/// Frames of the path, 1000 where only its file knows.
fn frames(run: &RunSpec) -> f64 {
    let own = match &run.path.source {
        PathSource::Generated(spec) => match spec.params.get("frames") {
            Some(Value::Int(n)) => *n as f64,
            _ => 1000.0,
        },
        PathSource::File(_) => 1000.0,
    };
    let used = run.path.frames.map_or(own, |n| own.min(f64::from(n)));
    (used / f64::from(run.path.stride)).ceil()
}

fn trial_guess_s(run: &RunSpec) -> f64 {
    0.3 + 30e-6 * frames(run) * f64::from(run.protocol.passes + run.protocol.warmup_passes)
}

fn judging_guess_s(run: &RunSpec) -> f64 {
    let a = &run.accuracy;
    let samples = f64::from(a.width_px) * f64::from(a.height_px) * f64::from(a.samples * a.samples);
    0.2e-6 * samples * frames(run).min(f64::from(a.frames))
}

/// More lines than this are summed up unless a list is asked for.
const MAX_LINES: usize = 80;

impl Plan {
    /// The matrix as a table: a line a method, a column a scene.
    pub fn table(&self) -> String {
        let several = {
            let mut pairs: Vec<_> = self.rows.iter().map(|r| (&r.scene, &r.path)).collect();
            pairs.sort();
            pairs.dedup();
            pairs.windows(2).any(|w| w[0].0 == w[1].0)
        };
        let place = |r: &Row| if several { format!("{}/{}", r.scene, r.path) } else { r.scene.clone() };
        let mut columns: Vec<String> = Vec::new();
        let mut lines: Vec<(&str, Vec<(usize, char)>)> = Vec::new();
        let mut at = std::collections::HashMap::new();
        for row in self.rows.iter().chain(&self.excluded) {
            let name = place(row);
            let column = columns.iter().position(|c| *c == name).unwrap_or_else(|| {
                columns.push(name);
                columns.len() - 1
            });
            let line = *at.entry(row.cell.as_str()).or_insert_with(|| {
                lines.push((&row.cell, Vec::new()));
                lines.len() - 1
            });
            let mark = if row.excluded.is_some() { '-' } else { row.known.state.mark() };
            lines[line].1.push((column, mark));
        }
        let wide = lines.iter().take(MAX_LINES).map(|(c, _)| c.chars().count()).max().unwrap_or(0);
        let mut out = String::new();
        let _ = writeln!(out, "{}  {}", " ".repeat(wide), columns.join("  "));
        for (cell, marks) in lines.iter().take(MAX_LINES) {
            let pad = " ".repeat(wide - cell.chars().count());
            let _ = write!(out, "{cell}{pad}");
            for (i, column) in columns.iter().enumerate() {
                let mark = marks.iter().find(|(c, _)| *c == i).map_or(' ', |(_, m)| *m);
                let _ = write!(out, "  {mark:^width$}", width = column.chars().count());
            }
            out.truncate(out.trim_end().len());
            out.push('\n');
        }
        if lines.len() > MAX_LINES {
            let _ = writeln!(out, "... and {} more methods (--list shows all)", lines.len() - MAX_LINES);
        }
        out
    }

    /// Every run on a line of its own.
    pub fn list(&self) -> String {
        let mut out = String::new();
        for r in self.rows.iter().chain(&self.excluded) {
            let state = match (&r.excluded, &r.known.state) {
                (Some(why), _) => format!("excluded: {why}"),
                (None, State::New) => "new".into(),
                (None, State::Done) => "done".into(),
                (None, State::Partial { trials }) => format!("{trials} trials done"),
                (None, State::Rerun { why }) => format!("re-run: {why}"),
                (None, State::Rejudge { why }) => format!("judged again: {why}"),
                (None, State::Failed { why }) => format!("failed: {why}"),
            };
            let _ = writeln!(out, "{}/{}  {}  {state}", r.scene, r.path, r.cell);
        }
        out
    }

    /// Counts, exclusions, reasons and time, in sentences.
    pub fn summary(&self) -> String {
        let mut out = String::new();
        let _ = write!(out, "{} runs: {} new (+), {} done (=)", self.rows.len(), self.new, self.done);
        for (n, what) in [
            (self.partial, "begun (~)"),
            (self.rerun, "to run again (!)"),
            (self.rejudge, "to judge again (?)"),
            (self.failed, "failed (x)"),
        ] {
            if n > 0 {
                let _ = write!(out, ", {n} {what}");
            }
        }
        let _ = writeln!(out, "; {} excluded (-)", self.excluded.len());
        if self.duplicates > 0 {
            let _ = writeln!(out, "{} cells or values are equal to others and run once", self.duplicates);
        }
        for (n, reason) in reasons(self.rows.iter().filter_map(|r| match &r.known.state {
            State::Rerun { why } => Some(why.as_str()),
            _ => None,
        })) {
            let _ = writeln!(out, "! {n} runs again: {reason}");
        }
        for (n, reason) in reasons(self.rows.iter().filter_map(|r| match &r.known.state {
            State::Rejudge { why } => Some(why.as_str()),
            _ => None,
        })) {
            let _ = writeln!(out, "? {n} judged again: {reason}");
        }
        for (n, reason) in reasons(self.rows.iter().filter_map(|r| match &r.known.state {
            State::Failed { why } => Some(why.as_str()),
            _ => None,
        })) {
            let _ = writeln!(out, "x {n} failed: {reason}");
        }
        for (n, reason) in reasons(self.excluded.iter().filter_map(|r| r.excluded.as_deref())) {
            let _ = writeln!(out, "- {n} excluded: {reason}");
        }
        let guess = match self.guessed {
            0 => String::new(),
            n => format!(" ({n} runs guessed: {RULE})"),
        };
        let _ = writeln!(out, "{} trials, about {}{guess}", self.trials, human(self.estimate_s));
        out
    }
}

fn reasons<'a>(all: impl Iterator<Item = &'a str>) -> Vec<(usize, &'a str)> {
    let mut out: Vec<(usize, &str)> = Vec::new();
    for reason in all {
        match out.iter_mut().find(|(_, r)| *r == reason) {
            Some((n, _)) => *n += 1,
            None => out.push((1, reason)),
        }
    }
    out
}

fn human(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
