//! The tables of a report. Every cell of the matrix has its row in each, with
//! its status, so that a gap is never mistaken for a zero.

use super::claims::Judged;
use super::format::{self, count};
use super::labels::{Grid, Names};
use super::metrics::{Kind, Metric, known};
use super::rows;
use super::table::{Cell, Column, Table, column, interval, number};
use crate::culling::Class;
use crate::record::Winding;
use crate::results::{RunResult, RunStatus, StudyResults};

/// The column of a metric under a heading for people.
pub(super) fn of(metric: &'static Metric, heading: &str) -> Column {
    let c = column(heading, metric.unit, metric.about);
    if matches!(metric.kind, Kind::Measured | Kind::Modelled) { c.with_interval() } else { c }
}

pub(super) fn cell(metric: &Metric, run: &RunResult) -> Cell {
    match metric.kind {
        Kind::Measured | Kind::Modelled => interval(metric.interval(run)),
        Kind::Counted | Kind::Judged => number(metric.value(run)),
    }
}

/// Rows of scene, combination and status, then metrics by name and heading.
fn by_run(grid: &Grid, id: &str, title: &str, metrics: &[(&str, &str)]) -> Table {
    let mut columns = vec![Column::text("scene"), Column::text("combination"), Column::text("status")];
    columns.extend(metrics.iter().map(|(name, heading)| of(known(name), heading)));
    let mut table = Table::new(id, title, 2, columns);
    for (run, names) in grid.named() {
        let mut row = vec![Cell::Text(names.place.clone()), named(grid, names), Cell::Status(run.status)];
        row.extend(metrics.iter().map(|(name, _)| cell(known(name), run)));
        table.rows.push(row);
    }
    table
}

pub(super) fn named(grid: &Grid, names: &Names) -> Cell {
    Cell::Named(names.combination.clone(), grid.look(&names.combination))
}

pub fn times(grid: &Grid) -> Table {
    let mut table = by_run(
        grid,
        "times",
        "Culling time and work",
        &[
            ("total_cull_ms", "total culling"),
            ("median_frame_us", "median frame"),
            ("p99_frame_us", "99th percentile"),
            ("frame_ms_model", "frame, modelled"),
            ("mean_triangles", "triangles a frame"),
            ("mean_entries", "drawn, with copies"),
            ("mean_draw_calls", "draw calls a frame"),
            ("mean_nodes_visited", "nodes a frame"),
            ("trials", "trials"),
            ("noise", "noise"),
            ("false_cull_ppm", "false-cull pixels"),
        ],
    );
    table.columns.push(Column::text("class"));
    table.columns.push(Column::text("marks"));
    for (row, run) in table.rows.iter_mut().zip(&grid.results.runs) {
        row.push(class_of(run));
        row.push(Cell::Text(marks(run)));
    }
    table.caption =
        "Brackets: 95 % bootstrap interval of the median over trials. Noise: sentinel kernel over its usual \
                     time, worst trial; 1 is a quiet machine. “Modelled” is derived, not measured. †: may lose visible \
                     triangles by design; read its times beside its false-cull pixels."
            .into();
    table
}

/// "2 noisy trials", "stopped: relative_ci".
pub fn marks(run: &RunResult) -> String {
    let mut marks = Vec::new();
    let noisy = run.trials.iter().filter(|t| t.noisy).count();
    if noisy > 0 {
        marks.push(count(noisy as u64, "noisy trial", "noisy trials"));
    }
    if run.status == RunStatus::Done {
        marks.extend(run.reason.clone());
    }
    marks.extend(run.stop_reason.as_ref().map(|s| format!("stopped: {s}")));
    marks.join("; ")
}

pub fn memory(grid: &Grid) -> Table {
    let mut table = by_run(
        grid,
        "memory",
        "Memory",
        &[
            ("structure_mib", "structure and tests"),
            ("test_mib", "of these tests"),
            ("peak_rss_mib", "peak resident set"),
        ],
    );
    table.caption = "Bytes of structures and tests are counted by the program; the peak resident set is that of the \
                     whole child process, the scene included."
        .into();
    table
}

pub fn build(grid: &Grid) -> Table {
    by_run(
        grid,
        "build",
        "Building and shape of the structures",
        &[
            ("build_ms", "build"),
            ("prepare_ms", "prepare tests"),
            ("nodes", "nodes"),
            ("leaves", "leaves"),
            ("depth", "depth"),
            ("replication", "entries per triangle"),
            ("structure_mib", "size"),
        ],
    )
}

pub fn errors(grid: &Grid) -> Table {
    let mut table = by_run(
        grid,
        "errors",
        "Errors against the truth",
        &[
            ("judged_frames", "judged"),
            ("false_culls", "false culls"),
            ("false_cull_ppm", "false-cull pixels"),
            ("largest_blob_px", "largest hole"),
            ("false_culls_by_ray", "seen by rays alone"),
            ("potential_lost", "lost from exact set"),
            ("visible_lo", "visible, at least"),
            ("visible_hi", "visible, at most"),
            ("over_submission", "over-submission"),
            ("over_submission_lo", "invisible, at least"),
            ("over_submission_hi", "invisible, at most"),
            ("duplicates", "duplicates"),
        ],
    );
    table.columns.insert(3, Column::text("class"));
    table.columns.insert(4, Column::text("observed"));
    for (row, run) in table.rows.iter_mut().zip(&grid.results.runs) {
        row.insert(3, class_of(run));
        row.insert(4, run.observed.map_or(Cell::Missing, |c| Cell::Text(class_word(c).into())));
    }
    table.caption = "False culls: visible triangles that were not submitted, summed over the judged frames. \
                     False-cull pixels: per million pixels. Over-submission: submitted over visible triangles. \
                     Class is what the method declares, observed the strongest class that the judged frames do \
                     not refute: “approximate” lost visible triangles and kept others beyond the set it is entitled \
                     to reduce to. Visible triangles a frame lie between what samples and witness rays see and what \
                     is not proved hidden; so does the share of what was submitted in vain. \
                     An empty cell was not judged; a zero was."
        .into();
    table
}

pub(super) fn class_of(run: &RunResult) -> Cell {
    let dagger = if rows::may_lose(run) { "† " } else { "" };
    run.class.map_or(Cell::Missing, |c| Cell::Text(format!("{dagger}{}", class_word(c))))
}

pub fn class_word(class: Class) -> &'static str {
    match class {
        Class::Exact => "exact",
        Class::Conservative => "conservative",
        Class::SampleConservative => "sample-conservative",
        Class::Aggressive => "aggressive",
        Class::Approximate => "approximate",
    }
}

/// What failed, is wrong or has yet to run, with its reason.
pub fn problems(grid: &Grid) -> Table {
    let columns = ["scene", "combination", "status", "reason"].map(Column::text).to_vec();
    let mut table = Table::new("problems", "Failed, wrong and pending", 2, columns);
    for (run, names) in grid.named().filter(|(r, _)| r.status != RunStatus::Done) {
        let fallback =
            if run.status == RunStatus::Pending { "not started, or trials are missing" } else { "no reason stored" };
        table.rows.push(vec![
            Cell::Text(names.place.clone()),
            named(grid, names),
            Cell::Status(run.status),
            Cell::Text(run.reason.clone().unwrap_or_else(|| fallback.into())),
        ]);
    }
    table
}

pub fn excluded(results: &StudyResults) -> Table {
    let columns = vec![Column::text("cell"), Column::text("why"), column("runs", "", "")];
    let mut table = Table::new("excluded", "Left out of the matrix", 1, columns);
    for e in &results.excluded {
        table.rows.push(vec![Cell::Text(e.cell.clone()), Cell::Text(e.why.clone()), Cell::Number(e.count as f64)]);
    }
    table
}

/// What was read of each scene, and what reading left out.
pub fn scenes(results: &StudyResults) -> Table {
    let counters = [
        ("scene_triangles", "triangles", "triangles that take part"),
        ("faces_in_file", "in the source", "triangles that the source holds"),
        ("faces_dropped_non_finite", "NaN or infinite", "left out: a coordinate is NaN or infinite"),
        ("faces_dropped_out_of_range", "out of range", "left out: a coordinate is beyond 1e12 m"),
        ("faces_dropped_degenerate", "without area", "left out: no area"),
    ];
    let mut columns = vec![Column::text("scene"), Column::text("winding")];
    columns.extend(counters.iter().map(|(_, name, about)| column(name, "", about)));
    let mut table = Table::new("scenes", "Scenes as read", 1, columns);
    let mut seen = std::collections::BTreeSet::new();
    for run in results.runs.iter().filter(|r| !r.counters.is_empty()) {
        if !seen.insert(&run.spec.scene.fingerprint) {
            continue;
        }
        let winding = match run.spec.scene.winding {
            Winding::Ccw => "counter-clockwise",
            Winding::Cw => "clockwise",
            Winding::TwoSided => "two-sided",
        };
        let mut row = vec![Cell::Text(run.spec.scene.name.clone()), Cell::Text(winding.into())];
        row.extend(counters.iter().map(|(name, ..)| number(run.counters.get(*name).copied())));
        table.rows.push(row);
    }
    table
}

pub fn claims(judged: &[Judged]) -> Table {
    let ratio = column("found", "", "measured ratio, or the metric itself, with its 95 % interval").with_interval();
    let model = column("found, modelled", "", "the same with modelled frame time").with_interval();
    let columns = vec![
        Column::text("claim"),
        Column::text("where"),
        Column::text("stated"),
        Column::text("verdict"),
        ratio,
        model,
        Column::text("note"),
    ];
    let mut table = Table::new("claims", "Published claims, place by place", 2, columns);
    for claim in judged {
        for group in &claim.groups {
            table.rows.push(vec![
                Cell::Text(claim.claim.id.clone()),
                Cell::Text(group.name.clone()),
                Cell::Text(group.stated.clone()),
                Cell::Text(group.verdict.word().into()),
                interval(group.ratio),
                interval(group.model_ratio),
                Cell::Text(group.note.clone()),
            ]);
        }
    }
    table.caption = "Ratios of medians over trials; where the statement is about a metric itself, its largest value \
                     (stated as 0) or its mean over the runs. Brackets: 95 % bootstrap interval."
        .into();
    table
}

/// Machines on which times were taken.
pub fn environments(results: &StudyResults) -> Table {
    let columns = vec![Column::text("machine class"), Column::text("what"), Column::text("value")];
    let mut table = Table::new("environment", "Machine and build", 2, columns);
    for (class, e) in &results.environments {
        let memory = format!("{} MiB", format::grouped(&e.memory_mib.to_string()));
        let pinned = e.pinned_core.map_or_else(|| "no".into(), |c| format!("core {c}"));
        for (what, value) in [
            ("processor", e.cpu.clone()),
            ("cores", e.cores.to_string()),
            ("memory", memory),
            ("system", format!("{}, kernel {}", e.os, e.kernel)),
            ("frequency governor", e.governor.clone()),
            ("cullmark", format!("{} ({}), {} build, {}", e.cullmark, e.commit, e.build_profile, e.isa)),
            ("compiler", e.compiler.clone()),
            ("pinned", pinned),
        ] {
            if !value.is_empty() {
                table.rows.push(vec![Cell::Text(class.clone()), Cell::Text(what.into()), Cell::Text(value)]);
            }
        }
    }
    table
}
