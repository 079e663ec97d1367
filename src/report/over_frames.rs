//! What the single frames of a trial say: rates, and how time goes with work. One value a
//! trial, so that the bootstrap over trials holds for these as for any other metric.
//!
//! Frames per second are those of the *modelled* frame, culling plus drawing by the stated
//! model, for nothing here draws. The mean is frames over total time; the mean of the rates
//! of single frames would weigh a fast frame more than a slow one.

use crate::results::RunResult;
use crate::stats;

/// The frames of a trial: how long each took, ns, and how many triangles and nodes it had.
pub struct Frames<'a> {
    pub cull_ns: &'a [f64],
    pub model_ns: Vec<f64>,
    pub triangles: &'a [f64],
    pub nodes: &'a [f64],
}

/// A value for every trial whose frames are all known; none for a trial that has none.
fn per_trial(run: &RunResult, of: fn(&Frames) -> Option<f64>) -> Vec<f64> {
    let known = !run.triangles.is_empty() && run.triangles.len() == run.draw_calls.len();
    let whole = run.trial_cull_ns.iter().filter(|t| known && t.len() == run.triangles.len());
    let frames = whole.map(|cull_ns| Frames {
        cull_ns,
        model_ns: model_ns(run, cull_ns),
        triangles: &run.triangles,
        nodes: &run.nodes_visited,
    });
    frames.filter_map(|f| of(&f)).collect()
}

/// Modelled time of every frame whose culling took `cull_ns`.
pub fn model_ns(run: &RunResult, cull_ns: &[f64]) -> Vec<f64> {
    let drawn = run.drawn().iter().zip(&run.draw_calls).map(|(t, d)| run.spec.model.render_ns(*t, *d));
    cull_ns.iter().zip(drawn).map(|(cull, draw)| run.spec.model.cull_scale * cull + draw).collect()
}

/// 1e9 over a time in ns; none where the clock saw nothing.
fn rate(ns: f64) -> Option<f64> {
    (ns > 0.0).then_some(1e9 / ns)
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn most(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

pub fn fps_best(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| rate(least(&f.model_ns)))
}

pub fn fps_mean(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| rate(stats::mean(&f.model_ns)))
}

pub fn fps_spread(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| Some(rate(least(&f.model_ns))? / rate(most(&f.model_ns))?))
}

pub fn fps_worst(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| rate(most(&f.model_ns)))
}

pub fn partial_cull(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| stats::partial(f.triangles, f.cull_ns, f.nodes))
}

pub fn pearson_cull(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| stats::pearson(f.triangles, f.cull_ns))
}

pub fn pearson_model(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| stats::pearson(f.triangles, &f.model_ns))
}

pub fn spearman_cull(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| stats::spearman(f.triangles, f.cull_ns))
}

pub fn spearman_model(run: &RunResult) -> Vec<f64> {
    per_trial(run, |f| stats::spearman(f.triangles, &f.model_ns))
}
