//! Every number a report, a query, a comparison or a claim can be about, in one table.

use super::over_frames as frame;
use super::virtual_clock;
use crate::claim::Better;
use crate::error::{Error, Result, did_you_mean};
use crate::results::{RunResult, RunStatus};
use crate::stats;

/// Where a number comes from; decides whether it has an interval and whether a
/// wrong run may show it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A clock or the operating system: differs between trials.
    Measured,
    /// Derived from measured time by the stated model of the renderer.
    Modelled,
    /// Identical in every trial.
    Counted,
    /// Found by the oracle at the judged frames.
    Judged,
}

pub struct Metric {
    pub name: &'static str,
    pub unit: &'static str,
    pub kind: Kind,
    pub about: &'static str,
    /// Which of two values is the better one, where either is.
    pub better: Better,
    /// One value a trial for measured and modelled metrics, else one value; none where unknown.
    values: fn(&RunResult) -> Vec<f64>,
    /// How the values of trials become one.
    fold: fn(&[f64]) -> f64,
}

const PARTIAL: &str = "correlation of triangles submitted and culling time of a frame, nodes visited held constant";
const PEARSON: &str = "correlation of triangles submitted and culling time over the frames";
const PEARSON_MODEL: &str =
    "correlation of triangles submitted and modelled frame time, which holds them, over the frames";
const SPEARMAN: &str = "rank correlation of triangles submitted and culling time over the frames";
const SPEARMAN_MODEL: &str = "rank correlation of triangles submitted and modelled frame time over the frames";

const MIB: f64 = 1024.0 * 1024.0;

const fn metric(
    name: &'static str,
    unit: &'static str,
    kind: Kind,
    about: &'static str,
    values: fn(&RunResult) -> Vec<f64>,
) -> Metric {
    Metric { name, unit, kind, about, values, better: Better::Less, fold: stats::median }
}

impl Metric {
    const fn better(mut self, better: Better) -> Metric {
        self.better = better;
        self
    }
}

use Better::{More, Neither};
use Kind::{Counted, Judged, Measured, Modelled};

/// Sorted by name.
pub static METRICS: &[Metric] = &[
    metric("build_ms", "ms", Measured, "building the structure, flattening included", |r| {
        r.trials.iter().map(|t| t.build_ns / 1e6).collect()
    }),
    metric("cull_ms", "ms", Measured, "culling time a frame, mean over the path", |r| per_frame(r, stats::mean, 1e6)),
    metric("depth", "levels", Counted, "depth of the tree", |r| counter(r, "depth")).better(Neither),
    metric(
        "duplicates",
        "entries",
        Judged,
        "entries beyond the first of each triangle, summed over judged frames",
        |r| judged(r, |e| e.duplicates() as f64),
    ),
    metric("fallbacks_exact_share", "", Counted, "signs that needed exact arithmetic, of all asked", |r| {
        of_predicates(r, "fallbacks_exact")
    }),
    metric("fallbacks_f64_share", "", Counted, "signs that single precision could not tell, of all asked", |r| {
        of_predicates(r, "fallbacks_f64")
    }),
    metric("false_cull_ppm", "px/M", Judged, "pixels whose triangle was not submitted, per million pixels", |r| {
        share(r, |e| e.false_cull_pixels as f64, |e| e.pixels as f64, 1e6)
    }),
    metric(
        "false_cull_sample_ppm",
        "smp/M",
        Judged,
        "samples whose triangle was not submitted, per million samples",
        |r| share(r, |e| e.false_cull_samples as f64, |e| e.samples as f64, 1e6),
    ),
    metric("false_cull_share", "", Judged, "visible triangles not submitted, of all visible ones", |r| {
        share(r, |e| e.false_culls as f64, |e| e.visible as f64, 1.0)
    }),
    metric("false_culls", "triangles", Judged, "visible triangles not submitted, summed over judged frames", |r| {
        judged(r, |e| e.false_culls as f64)
    }),
    metric("false_culls_by_ray", "triangles", Judged, "of the false culls those that no sample sees", |r| {
        judged(r, |e| e.false_culls_by_ray as f64)
    }),
    metric("fps_best_model", "fps", Modelled, "rate of the fastest frame, 1 over its modelled time", frame::fps_best)
        .better(More),
    metric("fps_mean_model", "fps", Modelled, "frames over total modelled time", frame::fps_mean).better(More),
    metric("fps_spread_model", "", Modelled, "rate of the fastest frame over that of the slowest", frame::fps_spread)
        .better(Neither),
    metric("fps_worst_model", "fps", Modelled, "rate of the slowest frame, 1 over its modelled time", frame::fps_worst)
        .better(More),
    metric("frame_ms_model", "ms", Modelled, "culling + indices + draw calls, a frame, mean over the path", |r| {
        modelled(r).iter().map(|total| total / frames(r) as f64).collect()
    }),
    metric("frame_ms_virtual", "ms", Modelled, "frame on the virtual clock, stalls of queries included, mean", |r| {
        average(&virtual_clock::frames_ms(r))
    }),
    metric("judged_frames", "frames", Judged, "frames compared with the truth", |r| {
        if r.errors.is_empty() { vec![] } else { vec![r.errors.len() as f64] }
    })
    .better(Neither),
    metric("largest_blob_px", "px", Judged, "largest connected hole in any judged frame", |r| {
        let largest = r.errors.iter().map(|e| e.largest_blob_px).max();
        largest.map(|v| v as f64).into_iter().collect()
    }),
    metric("leaves", "leaves", Counted, "leaves of the structure", |r| counter(r, "leaves")).better(Neither),
    Metric {
        fold: stats::mad,
        ..metric("mad_total_cull_ms", "ms", Measured, "median absolute deviation of the total over trials", totals)
    },
    metric("mean_draw_calls", "calls", Counted, "draw calls a frame", |r| average(&r.draw_calls)),
    metric("mean_entries", "triangles", Counted, "triangles drawn a frame, copies and pieces each", |r| {
        average(r.drawn())
    }),
    metric("mean_nodes_visited", "nodes", Counted, "nodes judged a frame", |r| average(&r.nodes_visited)),
    metric("mean_queries", "queries", Counted, "occlusion queries a frame", |r| by_frame(r, "queries")),
    metric("mean_stall_us", "µs", Modelled, "waiting for answers of queries, a frame, on the virtual clock", |r| {
        // Who asks and never waits has no such counter.
        let asks = !counter(r, "virtual_ns").is_empty();
        let waited = counter(r, "stall_ns").first().copied().or(asks.then_some(0.0));
        waited.iter().map(|ns| ns / frames(r) as f64 / 1e3).collect()
    }),
    metric("mean_triangles", "triangles", Counted, "triangles submitted a frame", |r| average(&r.triangles)),
    metric("median_frame_us", "µs", Measured, "culling time of the median frame", |r| {
        per_frame(r, stats::median, 1e3)
    }),
    metric(
        "missing_ppm",
        "ppm",
        Counted,
        "of what a view cell's samples see, the share that its set lacks by their own estimate",
        |r| by_frame(r, "pvs_missing_ppm"),
    ),
    metric("nodes", "nodes", Counted, "nodes of the structure, root included", |r| counter(r, "nodes")).better(Neither),
    Metric {
        fold: |v| v.iter().copied().fold(f64::NAN, f64::max),
        ..metric("noise", "", Measured, "sentinel over its usual time, worst trial; 1 is quiet", |r| {
            r.trials.iter().map(|t| t.noise).collect()
        })
    },
    metric("over_submission", "", Judged, "submitted over visible triangles, mean over judged frames", |r| {
        let seen: Vec<f64> = r.errors.iter().map(|e| e.over_submission()).filter(|x| x.is_finite()).collect();
        average(&seen)
    }),
    metric("over_submission_hi", "", Judged, "share of what was submitted that is not known to be visible", |r| {
        bracketed(r, |e| e.submitted_unseen as f64)
    }),
    metric("over_submission_lo", "", Judged, "share of what was submitted that is proved invisible", |r| {
        bracketed(r, |e| e.submitted_invisible as f64)
    }),
    metric("p99_cull_ms", "ms", Measured, "99th percentile of culling time a frame", |r| per_frame(r, p99, 1e6)),
    metric("p99_frame_us", "µs", Measured, "99th percentile of culling time a frame", |r| per_frame(r, p99, 1e3)),
    metric("partial_triangles_cull", "", Measured, PARTIAL, frame::partial_cull).better(Neither),
    metric("peak_rss_mib", "MiB", Measured, "peak resident memory of the trial, the scene included", |r| {
        r.trials.iter().map(|t| t.peak_rss_bytes / MIB).collect()
    }),
    metric("pearson_triangles_cull", "", Measured, PEARSON, frame::pearson_cull).better(Neither),
    metric("pearson_triangles_frame_model", "", Modelled, PEARSON_MODEL, frame::pearson_model).better(Neither),
    metric("potential_lost", "triangles", Judged, "members of the exact set lost, seen or hidden", |r| {
        judged(r, |e| e.potential_lost as f64)
    }),
    metric("potential_lost_share", "", Judged, "members of the exact set lost, of all its members", |r| {
        share(r, |e| e.potential_lost as f64, |e| e.potential as f64, 1.0)
    }),
    metric("prepare_ms", "ms", Measured, "building the per-node columns of the tests", |r| {
        r.trials.iter().map(|t| t.prepare_ns / 1e6).collect()
    }),
    metric("replication", "", Counted, "entries of the structure over triangles of the scene", |r| {
        match (counter(r, "entries").first(), counter(r, "scene_triangles").first()) {
            (Some(e), Some(t)) if *t > 0.0 => vec![e / t],
            _ => vec![],
        }
    }),
    metric("scene_triangles", "triangles", Counted, "triangles of the scene", |r| counter(r, "scene_triangles"))
        .better(Neither),
    metric("spearman_triangles_cull", "", Measured, SPEARMAN, frame::spearman_cull).better(Neither),
    metric("spearman_triangles_frame_model", "", Modelled, SPEARMAN_MODEL, frame::spearman_model).better(Neither),
    metric("structure_mib", "MiB", Counted, "bytes of the structure and of the tests' columns", |r| {
        let tests = counter(r, "test_bytes").first().copied().unwrap_or(0.0);
        counter(r, "structure_bytes").iter().map(|b| (b + tests) / MIB).collect()
    }),
    metric("test_mib", "MiB", Counted, "bytes of the tests' columns alone", |r| {
        counter(r, "test_bytes").iter().map(|b| b / MIB).collect()
    }),
    metric("total_cull_ms", "ms", Measured, "culling time summed over the path", totals),
    metric("total_frame_ms_model", "ms", Modelled, "modelled frame time summed over the path", modelled),
    metric("trials", "trials", Counted, "accepted trials", |r| vec![r.trials.len() as f64]).better(Neither),
    metric("visible_hi", "triangles", Judged, "|V_hi|: not proved invisible, mean over judged frames", |r| {
        bracketed_mean(r, |e| e.visible_hi as f64)
    })
    .better(Neither),
    metric("visible_lo", "triangles", Judged, "|V_lo|: proved visible, mean over judged frames", |r| {
        judged(r, |e| e.visible as f64).iter().map(|sum| sum / r.errors.len() as f64).collect()
    })
    .better(Neither),
];

impl Metric {
    /// One value a trial where it is measured or modelled, else at most one.
    /// Empty where unknown: not judged, not started, failed; and times are
    /// withheld from a run that is wrong for its class.
    pub fn values(&self, run: &RunResult) -> Vec<f64> {
        let withheld = match self.kind {
            Measured | Modelled => matches!(run.status, RunStatus::Wrong | RunStatus::Failed),
            Counted | Judged => false,
        };
        if withheld { Vec::new() } else { (self.values)(run).into_iter().filter(|v| v.is_finite()).collect() }
    }

    pub fn value(&self, run: &RunResult) -> Option<f64> {
        let values = self.values(run);
        if values.is_empty() { None } else { Some((self.fold)(&values)) }
    }

    /// Value with its 95 % interval over trials; equal ends where nothing varies or one trial is all there is.
    pub fn interval(&self, run: &RunResult) -> Option<(f64, f64, f64)> {
        let values = self.values(run);
        let value = if values.is_empty() { None } else { Some((self.fold)(&values)) }?;
        if values.len() < 2 || self.name.starts_with("mad_") || self.name == "noise" {
            return Some((value, value, value));
        }
        let (low, high) = stats::median_ci(&values);
        Some((value, low, high))
    }

    /// On the virtual clock: modelled, but the same in every trial.
    pub fn is_virtual(&self) -> bool {
        matches!(self.name, "frame_ms_virtual" | "mean_stall_us")
    }

    /// `total_cull_ms (ms)`.
    pub fn heading(&self) -> String {
        if self.unit.is_empty() { self.name.to_string() } else { format!("{} ({})", self.name, self.unit) }
    }
}

/// Seed of every bootstrap in reports: same results, same bytes.
pub const SEED: u64 = 2014;

pub fn find(name: &str) -> Option<&'static Metric> {
    METRICS.binary_search_by(|m| m.name.cmp(name)).ok().map(|i| &METRICS[i])
}

/// # Errors
/// Names the metric, and the nearest one there is.
pub fn get(name: &str) -> Result<&'static Metric> {
    find(name).ok_or_else(|| {
        let near = did_you_mean(name, METRICS.iter().map(|m| m.name));
        let all = || format!("metrics: {}", METRICS.iter().map(|m| m.name).collect::<Vec<_>>().join(", "));
        Error::new(format!("there is no metric `{name}`"))
            .help(near.map_or_else(all, |n| format!("did you mean `{n}`?")))
    })
}

/// For code of ours that names a metric of [`METRICS`].
///
/// # Panics
/// If the table lacks it.
pub fn known(name: &str) -> &'static Metric {
    find(name).unwrap_or_else(|| panic!("no metric {name}"))
}

pub fn frames(run: &RunResult) -> usize {
    run.cull_ns.len().max(run.triangles.len())
}

/// Modelled time of the path, ms, one value a trial.
fn modelled(run: &RunResult) -> Vec<f64> {
    if run.triangles.is_empty() || run.triangles.len() != run.draw_calls.len() {
        return Vec::new();
    }
    // Copies are drawn, too.
    let frames = run.drawn().iter().zip(&run.draw_calls);
    let render: f64 = frames.map(|(t, d)| run.spec.model.render_ns(*t, *d)).sum();
    let scale = run.spec.model.cull_scale;
    totals(run).iter().map(|cull| scale * cull + render / 1e6).collect()
}

fn totals(run: &RunResult) -> Vec<f64> {
    run.trials.iter().map(|t| t.total_cull_ns / 1e6).collect()
}

/// A statistic of the frames of every trial.
fn per_frame(run: &RunResult, statistic: fn(&[f64]) -> f64, unit: f64) -> Vec<f64> {
    run.trial_cull_ns.iter().filter(|t| !t.is_empty()).map(|t| statistic(t) / unit).collect()
}

fn p99(values: &[f64]) -> f64 {
    stats::quantile(values, 0.99)
}

fn average(values: &[f64]) -> Vec<f64> {
    if values.is_empty() { vec![] } else { vec![stats::mean(values)] }
}

fn counter(run: &RunResult, name: &str) -> Vec<f64> {
    run.counters.get(name).copied().into_iter().collect()
}

/// Mean over the frames of a counter that only some methods have.
fn by_frame(run: &RunResult, name: &str) -> Vec<f64> {
    counter(run, name).iter().map(|sum| sum / frames(run) as f64).collect()
}

type OfFrame = fn(&crate::record::FrameErrors) -> f64;

fn judged(run: &RunResult, of: OfFrame) -> Vec<f64> {
    if run.errors.is_empty() { vec![] } else { vec![run.errors.iter().map(of).sum()] }
}

fn share(run: &RunResult, part: OfFrame, whole: OfFrame, unit: f64) -> Vec<f64> {
    let (part, whole): (f64, f64) = (run.errors.iter().map(part).sum(), run.errors.iter().map(whole).sum());
    if whole > 0.0 { vec![part / whole * unit] } else { vec![] }
}

/// Only where the judgement knew brackets: older ones left these fields 0.
fn bracketed(run: &RunResult, part: OfFrame) -> Vec<f64> {
    if run.errors.iter().all(|e| e.samples == 0) { vec![] } else { share(run, part, |e| e.submitted as f64, 1.0) }
}

fn bracketed_mean(run: &RunResult, of: OfFrame) -> Vec<f64> {
    let known = run.errors.iter().any(|e| e.samples > 0);
    judged(run, of).iter().filter(|_| known).map(|sum| sum / run.errors.len() as f64).collect()
}

/// Of the signs that a filtered predicate was asked; nothing where none was.
fn of_predicates(run: &RunResult, name: &str) -> Vec<f64> {
    match (counter(run, name).first(), counter(run, "predicates").first()) {
        (Some(part), Some(all)) if *all > 0.0 => vec![part / all],
        _ => vec![],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_are_sorted_and_hold_all_that_claims_may_name() {
        assert!(METRICS.windows(2).all(|w| w[0].name < w[1].name));
        for claimed in crate::claim::METRICS {
            let ours = find(claimed.name).unwrap_or_else(|| panic!("claims may name {}", claimed.name));
            assert_eq!(ours.unit, claimed.unit, "{}", ours.name);
            assert_eq!(ours.kind == Modelled, claimed.modelled, "{}", ours.name);
            assert_eq!(ours.better, claimed.better, "{}", ours.name);
        }
    }

    #[test]
    fn a_misspelt_metric_gets_a_suggestion() {
        let e = get("total_cul_ms").err().unwrap();
        assert!(e.to_string().contains("did you mean `total_cull_ms`"), "{e}");
    }
}
