//! The charts of a report, in the order of the page.

use super::claims::Judged;
use super::correlation;
use super::curves::{self, Curves};
use super::figure::Figure;
use super::forest;
use super::format::{self, count};
use super::labels::Grid;
use super::metrics::{frames, known};
use super::occlusion;
use super::rows::{self, Datum, Rows};
use super::scatter::{self, Scatter};
use super::style::IDLE;
use crate::results::{RunResult, RunStatus};
use crate::stats;
use std::collections::BTreeSet;

pub fn all(grid: &Grid, judged: &[Judged]) -> Vec<Figure> {
    if grid.results.runs.is_empty() {
        return Vec::new();
    }
    let mut figures = vec![total_model(grid), total_time(grid), time_per_frame(grid), triangles_per_frame(grid)];
    if occlusion::concerns(grid) {
        figures.extend(occlusion::all(grid));
    }
    figures.extend(correlation::draw(grid));
    if grid.runs().any(|r| !r.errors.is_empty()) {
        figures.extend(errors(grid));
    }
    figures.extend([memory(grid), build(grid)]);
    figures.extend(forest::draw(judged));
    figures
}

/// "2000 frames, 5 repeats", ranges where runs differ.
pub fn basis(grid: &Grid) -> String {
    let range = |of: &dyn Fn(&RunResult) -> usize| {
        let values: Vec<usize> = grid.runs().map(of).filter(|n| *n > 0).collect();
        Some((*values.iter().min()? as u64, *values.iter().max()? as u64))
    };
    let say = |range: Option<(u64, u64)>, one: &str, many: &str| match range {
        None => format!("no {many}"),
        Some((a, b)) if a == b => count(a, one, many),
        Some((a, b)) => format!("{} to {}", format::grouped(&a.to_string()), count(b, one, many)),
    };
    let (f, t) = (range(&|r| frames(r)), range(&|r| r.trials.len()));
    format!("{}, {}", say(f, "frame", "frames"), say(t, "repeat", "repeats"))
}

pub(super) fn with_caption(mut figure: Figure, caption: String) -> Figure {
    figure.caption = caption;
    figure
}

fn dot(metric: &'static str) -> impl Fn(&RunResult) -> Option<Datum> {
    move |r| known(metric).interval(r).map(|(v, low, high)| Datum::Dot(v, low, high))
}

const WHISKERS: &str = "Dots: median over repeats; whiskers: its 95 % bootstrap interval.";

/// What the intervals of few trials are worth: less than the 95 % that the resamples say.
pub fn coverage(grid: &Grid) -> Option<String> {
    let done = grid.runs().filter(|r| r.status == RunStatus::Done).map(|r| r.trials.len());
    let few: BTreeSet<usize> = done.filter(|n| (2..=stats::ENDS).contains(n)).collect();
    let (first, rest) = (few.first()?, few.iter().skip(1));
    let percent = |n: &usize| format!("{} %", format::number(100.0 * stats::coverage_of_ends(*n), 3));
    let rest: String = rest.map(|n| format!(", of {n} with {}", percent(n))).collect();
    Some(format!(
        "With so few repeats the intervals of medians reach from the smallest to the largest: those of {first} hold the true \
         median with a probability of {}{rest}, not 95 %.",
        percent(first)
    ))
}

/// Explains the daggers, where there are any.
fn dagger(grid: &Grid) -> &'static str {
    if grid.runs().any(rows::may_lose) {
        " †: aggressive or approximate, it may lose visible triangles; beside it the pixels that lost theirs, per million."
    } else {
        ""
    }
}

/// Who is left out of charts of measured culling time.
fn without_idle(grid: &Grid) -> &'static str {
    if grid.runs().any(|r| r.culling == IDLE) { " “none” does no culling and is left out." } else { "" }
}

fn total_time(grid: &Grid) -> Figure {
    let figure = rows::draw(
        grid,
        &Rows {
            id: "total-time",
            title: "Total culling time over the walkthrough",
            sub: "Measured processor time of culling alone; less is better.",
            axis: "culling time (ms)",
            linear: false,
            errors: true,
            datum: &dot("total_cull_ms"),
        },
    );
    with_caption(
        figure,
        format!("Total measured culling time per combination and scene; {}. {WHISKERS}{}", basis(grid), dagger(grid)),
    )
}

fn total_model(grid: &Grid) -> Figure {
    let figure = rows::draw(
        grid,
        &Rows {
            id: "total-time-modelled",
            title: "Total frame time over the walkthrough (modelled)",
            sub: "Modelled, not measured: culling + cost of submitted indices + cost of draw calls.",
            axis: "modelled frame time, total (ms)",
            linear: false,
            errors: true,
            datum: &dot("total_frame_ms_model"),
        },
    );
    with_caption(
        figure,
        format!("Modelled total frame time; {}. {} {WHISKERS}{}", basis(grid), model_words(grid), dagger(grid)),
    )
}

/// The formula with the constants of the study.
pub fn model_words(grid: &Grid) -> String {
    let model = grid.results.runs.first().map(|r| r.spec.model).unwrap_or_default();
    let number = |x| format::number(x, 3);
    let scale = if model.cull_scale == 1.0 { String::new() } else { format!("{} × ", number(model.cull_scale)) };
    let base = if model.frame_ns == 0.0 { String::new() } else { format!(" + {} ns a frame", number(model.frame_ns)) };
    format!(
        "Model: {scale}measured culling time + {} ns × indices + {} ns × draw calls{base}.",
        number(model.index_ns),
        number(model.draw_call_ns)
    )
}

fn time_per_frame(grid: &Grid) -> Figure {
    let every = grid.results.consolidate_frames.max(1);
    let figure = curves::draw(
        grid,
        &Curves {
            id: "time-per-frame",
            title: "Culling time per frame",
            sub: "Measured; band: smallest to largest of the repeats.",
            axis: "culling time (µs)",
            working_only: true,
            only: None,
            series: &|r| r.trial_cull_ns.iter().map(|t| t.iter().map(|ns| ns / 1e3).collect()).collect(),
        },
    );
    with_caption(
        figure,
        format!(
            "Measured culling time per frame; {}. Each point is the mean of {}; line: median over repeats, band: smallest to largest.{}{}",
            basis(grid),
            count(every.into(), "frame", "frames"),
            without_idle(grid),
            curves::words(grid)
        ),
    )
}

fn triangles_per_frame(grid: &Grid) -> Figure {
    let every = grid.results.consolidate_frames.max(1);
    let figure = curves::draw(
        grid,
        &Curves {
            id: "triangles-per-frame",
            title: "Triangles submitted per frame",
            sub: "Counted; identical in every repeat, so there is no band.",
            axis: "triangles",
            working_only: false,
            only: None,
            series: &|r| if r.triangles.is_empty() { vec![] } else { vec![r.triangles.clone()] },
        },
    );
    with_caption(
        figure,
        format!(
            "Triangles submitted per frame; {}. Each point is the mean of {}. Counts must agree between repeats, or the run fails.{}",
            basis(grid),
            count(every.into(), "frame", "frames"),
            curves::words(grid)
        ),
    )
}

/// Run time against error, and against what is submitted in vain.
fn errors(grid: &Grid) -> Vec<Figure> {
    let judged = grid.runs().map(|r| r.errors.len()).max().unwrap_or(0);
    let samples = format!("Errors at {} of each path.", count(judged as u64, "judged frame", "judged frames"));
    let front = format!(
        "Joined: the points that no other beats in both; hollow: behind them by less than the 95 % intervals (horizontal \
         bars) can tell; faded: dominated beyond the intervals. Of each front a few points are named, its ends first; the \
         table names all.{}",
        dagger(grid)
    );
    let zero = "The bin below the break holds exact zeros; height says nothing in it.";
    let wrong = grid.results.runs.iter().filter(|r| r.status == RunStatus::Wrong).count();
    let wrong = match wrong {
        0 => String::new(),
        n => format!(
            " {} for the declared class: a conservative method above zero is a bug, not a point, and is not drawn.",
            count(n as u64, "run is wrong", "runs are wrong")
        ),
    };
    let chart = |what: Scatter, caption: String| with_caption(scatter::draw(grid, &what), caption);
    vec![
        chart(
            Scatter {
                id: "time-against-error-modelled",
                title: "Frame time (modelled) against false culls",
                sub: "Modelled frame time, so that what is submitted in vain costs something. Lower left is better.",
                x_axis: "modelled frame time, mean (ms)",
                y_axis: "false-cull pixels per million",
                zero_bin: true,
                x: known("frame_ms_model"),
                y: known("false_cull_ppm"),
            },
            format!(
                "Modelled frame time against pixels that lost their triangle; {}. {} {samples} {front} {zero}{wrong}",
                basis(grid),
                model_words(grid)
            ),
        ),
        chart(
            Scatter {
                id: "time-against-error",
                title: "Culling time against false culls",
                sub: "Culling alone: drawing what was not culled is not in it. Lower left is better.",
                x_axis: "culling time of the median frame (µs)",
                y_axis: "false-cull pixels per million",
                zero_bin: true,
                x: known("median_frame_us"),
                y: known("false_cull_ppm"),
            },
            format!(
                "Measured culling time of the median frame against pixels that lost their triangle; {}. {samples} {front}{} {zero}{wrong}",
                basis(grid),
                without_idle(grid)
            ),
        ),
        chart(
            Scatter {
                id: "time-against-over-submission",
                title: "Culling time against over-submission",
                sub: "1 would be drawing exactly what is seen. Lower left is better.",
                x_axis: "culling time of the median frame (µs)",
                y_axis: "submitted / visible triangles",
                zero_bin: false,
                x: known("median_frame_us"),
                y: known("over_submission"),
            },
            format!(
                "Measured culling time of the median frame against over-submission; {}. {samples} Points: against the \
                 triangles that are proved visible; vertical bars reach down to the figure against those that are not proved \
                 invisible, where hiding was bracketed. The truth lies between, for all methods alike. {front}{}{wrong}",
                basis(grid),
                without_idle(grid)
            ),
        ),
    ]
}

fn memory(grid: &Grid) -> Figure {
    let figure = rows::draw(
        grid,
        &Rows {
            id: "memory",
            title: "Memory of structure and tests",
            sub: "Counted bytes; full: the structure, pale: the per-node columns of the tests.",
            axis: "memory (MiB)",
            linear: true,
            errors: false,
            datum: &|r| {
                let all = known("structure_mib").value(r)?;
                let tests = known("test_mib").value(r).unwrap_or(0.0);
                Some(Datum::Bar(vec![(all - tests, 1.0), (tests, 0.45)]))
            },
        },
    );
    with_caption(
        figure,
        "Memory of the structure and of the tests' columns, counted by the program; the same in every repeat. \
         Peak resident sets, the scene included, are in the table."
            .into(),
    )
}

fn build(grid: &Grid) -> Figure {
    let figure = rows::draw(
        grid,
        &Rows {
            id: "build-time",
            title: "Building time",
            sub: "Measured; full: the structure with flattening, pale: preparing the tests. Medians over repeats.",
            axis: "time to build (ms)",
            linear: true,
            errors: false,
            datum: &|r| {
                let build = known("build_ms").value(r)?;
                let prepare = known("prepare_ms").value(r).unwrap_or(0.0);
                Some(Datum::Bar(vec![(build, 1.0), (prepare, 0.45)]))
            },
        },
    );
    with_caption(figure, format!("Measured time to build the structure and to prepare the tests; {}.", basis(grid)))
}
