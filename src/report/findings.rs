//! What the data say, in sentences computed from them.

use super::claims::ratio;
use super::format;
use super::labels::{Grid, combination};
use super::metrics::{Metric, known};
use crate::results::{RunResult, RunStatus};

/// The key findings, one sentence each; plain text.
pub fn findings(grid: &Grid) -> Vec<String> {
    let mut out = Vec::new();
    for (place, row) in grid.places.iter().zip(&grid.cells) {
        let done: Vec<&RunResult> = row.iter().filter_map(|c| *c).filter(|r| r.status == RunStatus::Done).collect();
        let cull = fastest(grid, &done, known("total_cull_ms"), true).map(|s| format!("{s} over the path"));
        let frame = fastest(grid, &done, known("frame_ms_model"), false);
        let parts = [("fastest culling", cull), ("shortest modelled frame", frame)];
        let parts: Vec<String> = parts.into_iter().filter_map(|(what, s)| Some(format!("{what}: {}", s?))).collect();
        if !parts.is_empty() {
            out.push(format!("{place}. {}.", super::format::capital(&parts.join("; "))));
        }
    }
    out.extend(exactness(grid));
    out
}

/// The best run by `metric` with its ratio against the baseline. Whoever culls
/// nothing has no culling time to speak of, so `working` leaves it out.
fn fastest(grid: &Grid, done: &[&RunResult], metric: &Metric, working: bool) -> Option<String> {
    let candidates = done.iter().filter(|r| !working || r.culling != "none");
    let (best, value) = candidates.filter_map(|r| Some((*r, metric.value(r)?))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut sentence = format!("{}, {} {}", combination(grid.results, best), format::number(value, 3), metric.unit);
    let Some(base) = baseline(done, best, working) else { return Some(sentence) };
    let (r, low, high) = ratio(&[(metric.values(base), metric.values(best))]);
    let base = combination(grid.results, base);
    sentence += &match (low, high) {
        _ if low <= 1.0 && high >= 1.0 => format!(" (not distinguishable from {base})"),
        // 1.00 times faster is no finding, however sure.
        _ if r < 1.005 => format!(" (within 0.5 % of {base})"),
        _ if low == high => format!(" ({} faster than {base})", format::ratio(r)),
        _ => format!(
            " ({} [{}, {}] faster than {base})",
            format::ratio(r),
            format::number(low, 3),
            format::number(high, 3)
        ),
    };
    Some(sentence)
}

/// `list × none` where work beyond culling counts; among those that cull, the
/// flat list with the same test, or with any.
fn baseline<'a>(done: &[&'a RunResult], best: &RunResult, working: bool) -> Option<&'a RunResult> {
    let list = |r: &&&RunResult| r.spec.structure.kind == "list";
    let found = if working {
        let cullers = || done.iter().filter(|r| r.culling != "none");
        cullers().filter(list).find(|r| r.culling == best.culling).or_else(|| cullers().find(list))
    } else {
        let idle = || done.iter().filter(|r| r.culling == "none");
        idle().find(list).or_else(|| idle().next())
    };
    found.copied().filter(|r| r.measurement_id != best.measurement_id)
}

/// One sentence on errors over the whole study.
fn exactness(grid: &Grid) -> Option<String> {
    let judged: Vec<&RunResult> = grid.runs().filter(|r| !r.errors.is_empty()).collect();
    if judged.is_empty() {
        return Some("No run was judged against the truth: speeds here stand without their errors.".into());
    }
    let lost = |r: &&&RunResult| known("false_culls").value(r).is_some_and(|v| v > 0.0);
    let culprits = judged.iter().filter(lost).count();
    let worst = judged
        .iter()
        .filter_map(|r| Some((*r, known("false_cull_ppm").value(r)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .filter(|(_, ppm)| *ppm > 0.0);
    let mut text = format!("{} judged against the truth: ", format::count(judged.len() as u64, "run was", "runs were"));
    text += &match (culprits, worst) {
        (0, _) => "none lost a visible triangle.".into(),
        (n, None) => format!("{n} lost visible triangles, none a sampled pixel."),
        (n, Some((run, ppm))) => format!(
            "{n} lost visible triangles; the worst is {} on {} with {} pixels per million.",
            combination(grid.results, run),
            super::labels::place(grid.results, run),
            format::number(ppm, 3)
        ),
    };
    Some(text)
}
