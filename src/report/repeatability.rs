//! A study measured more than once (`run --series next`): do its numbers come again?
//!
//! Cells of the series are paired by name, as in a comparison. Of every measured
//! number: how many of the pairs have 95 % intervals that overlap, how many ratios
//! whose interval holds 1, and the coefficient of variation among the trials of one
//! series beside that among the series. What is counted must be identical, and the
//! submitted sets must have the same hash; each difference is named.

use super::compare::cell;
use super::labels::place;
use super::metrics::{self, METRICS, Metric};
use crate::results::{Measured, RunResult, RunStatus};
use crate::stats;
use std::collections::BTreeSet;

/// The same cell in two series.
pub struct Pair<'a> {
    /// Numbers of the series.
    pub series: (u32, u32),
    pub first: &'a RunResult,
    pub second: &'a RunResult,
    pub place: String,
}

/// One metric of one pair.
pub struct Reading {
    /// Index in [`Repeatability::pairs`].
    pub pair: usize,
    pub metric: &'static Metric,
    pub first: (f64, f64, f64),
    pub second: (f64, f64, f64),
    /// Second over first with its 95 % interval.
    pub ratio: (f64, f64, f64),
    /// None where either has a single trial: no interval is known.
    pub overlap: Option<bool>,
}

/// One metric over all pairs.
pub struct Agreement {
    pub metric: &'static Metric,
    pub pairs: usize,
    /// Pairs with intervals, and those of them whose intervals overlap.
    pub with_intervals: usize,
    pub overlapping: usize,
    /// Pairs whose ratio is not told apart from 1.
    pub holding_one: usize,
    pub median_ratio: f64,
    /// Median over cells; none for single trials.
    pub variation_within: Option<f64>,
    pub variation_between: Option<f64>,
    /// The pair that moved most.
    pub farthest: Option<(usize, f64)>,
}

/// Something that must be identical and is not.
pub struct Difference {
    pub series: (u32, u32),
    pub place: String,
    pub label: String,
    pub what: String,
    pub first: String,
    pub second: String,
}

pub struct Repeatability<'a> {
    pub series: Vec<u32>,
    pub pairs: Vec<Pair<'a>>,
    pub readings: Vec<Reading>,
    pub agreements: Vec<Agreement>,
    pub differences: Vec<Difference>,
    /// How many counted numbers (sums and frames) and hashes were compared.
    pub numbers_compared: u64,
    pub hashes_compared: u64,
    /// Cells that some series lacks.
    pub unpaired: usize,
}

/// Measured, but saying again what another metric says, or about the noise itself, or a
/// correlation, of which a ratio says nothing.
const LEFT_OUT: [&str; 11] = [
    "cull_ms",
    "fps_mean_model",
    "mad_total_cull_ms",
    "noise",
    "p99_cull_ms",
    "partial_triangles_cull",
    "pearson_triangles_cull",
    "pearson_triangles_frame_model",
    "spearman_triangles_cull",
    "spearman_triangles_frame_model",
    "total_frame_ms_model",
];

pub fn of(all: &[Measured]) -> Repeatability<'_> {
    let mut out = Repeatability {
        series: all.iter().map(|m| m.series).collect(),
        pairs: Vec::new(),
        readings: Vec::new(),
        agreements: Vec::new(),
        differences: Vec::new(),
        numbers_compared: 0,
        hashes_compared: 0,
        unpaired: 0,
    };
    for (i, a) in all.iter().enumerate() {
        for b in &all[i + 1..] {
            pair(&mut out, a, b);
        }
    }
    let timed = METRICS.iter().filter(|m| matches!(m.kind, metrics::Kind::Measured | metrics::Kind::Modelled));
    for metric in timed.filter(|m| !LEFT_OUT.contains(&m.name)) {
        let readings: Vec<Reading> = out.pairs.iter().enumerate().filter_map(|(i, p)| reading(i, p, metric)).collect();
        out.agreements.extend(agreement(metric, &readings, all));
        out.readings.extend(readings);
    }
    out
}

fn pair<'a>(out: &mut Repeatability<'a>, a: &'a Measured, b: &'a Measured) {
    let mut taken = vec![false; b.results.runs.len()];
    for first in &a.results.runs {
        let found = (0..taken.len()).find(|i| !taken[*i] && cell(&b.results.runs[*i]) == cell(first));
        let Some(i) = found else {
            out.unpaired += 1;
            continue;
        };
        taken[i] = true;
        let second = &b.results.runs[i];
        let pair = Pair { series: (a.series, b.series), first, second, place: place(&a.results, first) };
        counted(out, &pair);
        hashes(out, &pair, a, b);
        out.pairs.push(pair);
    }
    out.unpaired += taken.iter().filter(|t| !**t).count();
}

fn differs(out: &mut Repeatability, p: &Pair, what: String, first: String, second: String) {
    let label = p.first.label();
    out.differences.push(Difference { series: p.series, place: p.place.clone(), label, what, first, second });
}

/// Statuses, answers, sums and frames of what is counted.
fn counted(out: &mut Repeatability, p: &Pair) {
    let (a, b) = (p.first, p.second);
    if a.status != b.status {
        differs(out, p, "status".into(), a.status.word().into(), b.status.word().into());
    }
    if a.answer_id != b.answer_id {
        let short = |id: &str| id.chars().take(12).collect::<String>();
        let what = "answer: scene, path, camera or a revision changed";
        differs(out, p, what.into(), short(&a.answer_id), short(&b.answer_id));
    }
    if a.status != RunStatus::Done || b.status != RunStatus::Done {
        return;
    }
    let names: BTreeSet<&String> = a.counters.keys().chain(b.counters.keys()).collect();
    for name in names {
        let (x, y) = (a.counters.get(name), b.counters.get(name));
        out.numbers_compared += 1;
        if x != y {
            let show = |v: Option<&f64>| v.map_or_else(|| "none".into(), |v| format!("{v}"));
            differs(out, p, name.clone(), show(x), show(y));
        }
    }
    type Frames = fn(&RunResult) -> &Vec<f64>;
    let frames: [(&str, Frames); 3] =
        [("triangles", |r| &r.triangles), ("draw calls", |r| &r.draw_calls), ("nodes visited", |r| &r.nodes_visited)];
    for (name, of) in frames {
        let (x, y) = (of(a), of(b));
        out.numbers_compared += x.len().max(y.len()) as u64;
        let at = (0..x.len().max(y.len())).find(|f| x.get(*f) != y.get(*f));
        if let Some(f) = at {
            let show = |v: Option<&f64>| v.map_or_else(|| "no frame".into(), |v| format!("{v}"));
            differs(out, p, format!("{name} of frame {f}"), show(x.get(f)), show(y.get(f)));
        }
    }
}

fn hashes(out: &mut Repeatability, p: &Pair, a: &Measured, b: &Measured) {
    let of = |m: &'_ Measured, r: &RunResult| m.frames_hashes.get(&r.measurement_id).cloned().unwrap_or_default();
    let (x, y) = (of(a, p.first), of(b, p.second));
    if x.is_empty() || y.is_empty() {
        return;
    }
    out.hashes_compared += 1;
    if x != y || x.len() > 1 {
        let show = |s: &BTreeSet<String>| {
            s.iter().map(|h| h.chars().take(12).collect::<String>()).collect::<Vec<_>>().join(", ")
        };
        differs(out, p, "hash of the submitted sets".into(), show(&x), show(&y));
    }
}

fn reading(pair: usize, p: &Pair, metric: &'static Metric) -> Option<Reading> {
    let done = p.first.status == RunStatus::Done && p.second.status == RunStatus::Done;
    if !done || p.first.machine_class != p.second.machine_class {
        return None;
    }
    let (first, second) = (metric.interval(p.first)?, metric.interval(p.second)?);
    let (x, y) = (metric.values(p.first), metric.values(p.second));
    let ratio = stats::ratio_ci(&y, &x, stats::RESAMPLES, metrics::SEED);
    let known = x.len() > 1 && y.len() > 1;
    let overlap = known.then_some(first.1 <= second.2 && second.1 <= first.2);
    ratio.0.is_finite().then_some(Reading { pair, metric, first, second, ratio, overlap })
}

fn agreement(metric: &'static Metric, readings: &[Reading], all: &[Measured]) -> Option<Agreement> {
    if readings.is_empty() {
        return None;
    }
    let known: Vec<&Reading> = readings.iter().filter(|r| r.overlap.is_some()).collect();
    let median = |v: Vec<f64>| {
        let finite: Vec<f64> = v.into_iter().filter(|x| x.is_finite()).collect();
        (!finite.is_empty()).then(|| stats::median(&finite))
    };
    let runs = || all.iter().flat_map(|m| &m.results.runs).filter(|r| r.status == RunStatus::Done);
    let within = runs().map(|r| metric.values(r)).filter(|v| v.len() > 1);
    let between = cells(all).into_iter().map(|runs| runs.iter().filter_map(|r| metric.value(r)).collect::<Vec<_>>());
    let far = readings.iter().max_by(|a, b| a.ratio.0.ln().abs().total_cmp(&b.ratio.0.ln().abs()));
    Some(Agreement {
        metric,
        pairs: readings.len(),
        with_intervals: known.len(),
        overlapping: known.iter().filter(|r| r.overlap == Some(true)).count(),
        holding_one: known.iter().filter(|r| r.ratio.1 <= 1.0 && 1.0 <= r.ratio.2).count(),
        median_ratio: stats::median(&readings.iter().map(|r| r.ratio.0).collect::<Vec<_>>()),
        variation_within: median(within.map(|v| stats::coefficient_of_variation(&v)).collect()),
        variation_between: median(
            between.filter(|v| v.len() > 1).map(|v| stats::coefficient_of_variation(&v)).collect(),
        ),
        farthest: far.map(|r| (r.pair, r.ratio.0)),
    })
}

/// The finished runs of each cell over all series, of one machine.
fn cells(all: &[Measured]) -> Vec<Vec<&RunResult>> {
    let mut out: std::collections::BTreeMap<String, Vec<&RunResult>> = std::collections::BTreeMap::new();
    for run in all.iter().flat_map(|m| &m.results.runs).filter(|r| r.status == RunStatus::Done) {
        out.entry(format!("{}|{}", cell(run), run.machine_class)).or_default().push(run);
    }
    out.into_values().collect()
}

impl Repeatability<'_> {
    /// What came of it, in sentences.
    pub fn findings(&self) -> Vec<String> {
        use super::format::count;
        let names: Vec<String> = self.series.iter().map(u32::to_string).collect();
        let mut out = vec![format!(
            "{} (series {}), {} of the same cell.",
            count(self.series.len() as u64, "measurement", "measurements"),
            names.join(", "),
            count(self.pairs.len() as u64, "pair", "pairs")
        )];
        if self.unpaired > 0 {
            out.push(format!("{} in one series alone.", count(self.unpaired as u64, "run stands", "runs stand")));
        }
        if let Some(a) = self.agreements.iter().find(|a| a.metric.name == "total_cull_ms" && a.with_intervals > 0) {
            out.push(format!(
                "Total culling time: {} of {} pairs have 95 % intervals that overlap.",
                a.overlapping, a.with_intervals
            ));
        }
        out.push(match self.differences.len() as u64 {
            0 if self.numbers_compared == 0 => "Nothing counted could be compared.".into(),
            0 if self.hashes_compared == 0 => {
                format!("All {} are identical.", count(self.numbers_compared, "counted number", "counted numbers"))
            }
            0 => format!(
                "All {} and the hashes of all {} are identical.",
                count(self.numbers_compared, "counted number", "counted numbers"),
                count(self.hashes_compared, "pair of submitted sets", "pairs of submitted sets")
            ),
            n => format!("{} in what must be identical.", count(n, "difference", "differences")),
        });
        out
    }
}
