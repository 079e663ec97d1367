//! `cullmark run`: manifest, matrix, queue, workers, results, report.

use super::progress::{Mode, Progress, duration, json_line};
use super::signals::{self, INTERRUPTED};
use super::{check, preflight};
use crate::claim::Claim;
use crate::error::Error;
use crate::intake::{Wish, series, setting, submission};
use crate::machine;
use crate::manifest::Manifest;
use crate::matrix::{self, Matrix, Setting};
use crate::results::{RunStatus, StudyResults};
use crate::store::{Detail, Store, Submitted};
use crate::worker::child::Launcher;
use crate::worker::{self, Phase, lane};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::watch;

#[derive(clap::Args)]
pub struct Args {
    /// TOML manifest of the study
    manifest: PathBuf,
    /// Lay key=value over the manifest, such as measure.repeats=3 (repeatable)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Database of results
    #[arg(long, value_name = "FILE", default_value = crate::store::DEFAULT_DB)]
    db: PathBuf,
    /// Folder of the report (default: beside the database, named as the study)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Measure again under the next number, or go on with a given one
    #[arg(long, value_name = "next|N")]
    series: Option<String>,
    /// Workers beside the measuring lane (default: one a spare core)
    #[arg(long, value_name = "N")]
    workers: Option<usize>,
    /// Parsed scenes and ground truth are kept here (default: beside the database)
    #[arg(long, value_name = "DIR")]
    cache_dir: Option<PathBuf>,
    /// Try again what failed before
    #[arg(long)]
    retry_failed: bool,
    /// Leave the report out
    #[arg(long)]
    no_report: bool,
    /// No progress, only what went wrong
    #[arg(long, short)]
    quiet: bool,
    /// One JSON object a line on standard output
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let manifest = match Manifest::load(&args.manifest, &args.set) {
        Ok(manifest) => manifest,
        Err(errors) => return Ok(mistakes(&errors, args.json)),
    };
    check::tell_absent(&manifest);
    // Counted and left before any thread starts: threads inherit where they may run.
    let launcher = Launcher::here()?;
    let machine_class = machine::environment(None).machine_class;
    launcher.leave_the_lane();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    runtime.block_on(study(&args, &manifest, launcher, machine_class))
}

fn mistakes(errors: &[Error], json: bool) -> ExitCode {
    check::print_errors(errors, json);
    ExitCode::from(2)
}

async fn study(
    args: &Args,
    manifest: &Manifest,
    launcher: Launcher,
    machine_class: String,
) -> anyhow::Result<ExitCode> {
    let start = Instant::now();
    let auxiliary = worker::auxiliary_workers(args.workers, launcher.cores.len())?;
    let store = Store::open(&args.db).await?;
    let series = series(args.series.as_deref(), &store, &manifest.study.name).await?;
    // The lane's core was counted by the launcher, before this process left it.
    let setting = Setting { pin_core: launcher.lane_core, ..setting(series) };
    let matrix = match matrix::expand(manifest, &setting) {
        Ok(matrix) => matrix,
        Err(errors) => return Ok(mistakes(&errors, args.json)),
    };
    let folder = args.db.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_path_buf();
    let cache_dir = args.cache_dir.clone().unwrap_or_else(|| folder.join("cache"));
    let notes = match preflight::read(&matrix.runs, &cache_dir) {
        Ok(notes) => notes,
        Err(errors) => return Ok(mistakes(&errors, args.json)),
    };
    let wish = Wish { series, retry_failed: args.retry_failed, folder: origin(&args.manifest), ..Wish::default() };
    let submitted = store.submit(&submission(manifest, &matrix, machine_class, wish)).await?;
    let mode = match (args.json, args.quiet) {
        (true, _) => Mode::Json,
        (_, true) => Mode::Quiet,
        _ => Mode::Bar,
    };
    announce(mode, manifest, &matrix, &submitted, series);
    for note in &notes {
        match mode {
            Mode::Json => json_line(&serde_json::json!({ "event": "note", "text": note })),
            _ => eprintln!("note: {note}"),
        }
    }

    let progress = Arc::new(Progress::new(mode, &submitted, auxiliary));
    let options = worker::Options { launcher, cache_dir, lane_file: lane::default_path(), auxiliary };
    let tell = {
        let progress = progress.clone();
        Arc::new(move |event| progress.on(&event))
    };
    let stop = stop_on_signal();
    let stopped = worker::work(&store, submitted.study_id, &options, tell, stop).await;
    let told = progress.end();
    let stopped = stopped?;

    let name = format!("{}@{series}", manifest.study.name);
    let results = store.results_with(&name, Detail::Summary).await?;
    let mut page = None;
    if !args.no_report && !stopped {
        let shown = if series == 0 { &manifest.study.name } else { &name };
        let out = args.out.clone().unwrap_or_else(|| folder.join(shown));
        page = Some(report(&store, submitted.study_id, &name, &manifest.claims(), &out).await?);
    }
    store.close().await;
    Ok(conclude(mode, &results, &End { stopped, page, told, elapsed: start.elapsed() }))
}

/// Writes the report, unless the one in `out` was made of the very same results.
async fn report(store: &Store, study_id: i64, name: &str, claims: &[Claim], out: &Path) -> anyhow::Result<PathBuf> {
    let key = store.report_key(study_id, out).await?;
    if store.report_stands(study_id, &key).await? {
        return Ok(out.join("index.html"));
    }
    let results = store.results_with(name, Detail::Frames).await?;
    let series = store.all_series(name, Detail::Frames).await?;
    let files = crate::report::write_with_series(&results, claims, &series, out)?;
    store.record_artifacts(study_id, &files.all(), &key).await?;
    Ok(files.page)
}

/// What the last words of a run are about, besides its results.
struct End {
    stopped: bool,
    page: Option<PathBuf>,
    /// Failed and wrong runs of which the reader knows.
    told: HashSet<String>,
    elapsed: Duration,
}

/// Where the files that a manifest names start from, wherever a later program stands.
fn origin(manifest: &Path) -> String {
    let folder = manifest.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder.canonicalize().map(|f| f.display().to_string()).unwrap_or_default()
}

fn announce(mode: Mode, manifest: &Manifest, matrix: &Matrix, s: &Submitted, series: u32) {
    let study = &manifest.study;
    match mode {
        Mode::Quiet => {}
        Mode::Json => json_line(&serde_json::json!({
            "event": "submitted", "study": study.name, "series": series, "runs": s.runs, "new": s.new,
            "resumed": s.resumed, "done": s.done, "failed": s.failed, "wrong": s.wrong,
            "excluded": matrix.excluded_runs.len(), "jobs_added": s.jobs_added,
        })),
        Mode::Bar => {
            eprintln!(
                "{} ({}{})",
                study.title,
                study.name,
                if series > 0 { format!("@{series}") } else { String::new() }
            );
            let parts = [
                (s.new, "new"),
                (s.resumed, "to go on with"),
                (s.done, "already done"),
                (s.failed, "failed before (--retry-failed tries again)"),
                (s.wrong, "wrong"),
                (matrix.excluded_runs.len() as u64, "excluded"),
            ];
            let parts: Vec<String> = parts.iter().filter(|p| p.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
            eprintln!("{} {}: {}", s.runs, if s.runs == 1 { "run" } else { "runs" }, parts.join(", "));
        }
    }
}

/// Told to stop by the first Ctrl-C or termination request; a second one ends the
/// process at once (children die with it, leases are returned at the next start).
fn stop_on_signal() -> watch::Receiver<Phase> {
    let (sender, receiver) = watch::channel(Phase::Work);
    let mut signals = signals::listen();
    tokio::spawn(async move {
        let mut asked = 0;
        while signals.recv().await.is_some() {
            asked += 1;
            if asked > 1 {
                std::process::exit(i32::from(INTERRUPTED));
            }
            eprintln!("stopping: what is finished is kept (again to stop at once)");
            let _ = sender.send(Phase::Stop);
        }
    });
    receiver
}

fn conclude(mode: Mode, results: &StudyResults, end: &End) -> ExitCode {
    let count = |status| results.runs.iter().filter(|r| r.status == status).count();
    let (done, failed, wrong, pending) =
        (count(RunStatus::Done), count(RunStatus::Failed), count(RunStatus::Wrong), count(RunStatus::Pending));
    let noisy = results.runs.iter().filter(|r| r.trials.iter().any(|t| t.noisy)).count();
    if mode == Mode::Json {
        json_line(&serde_json::json!({
            "event": "finished", "stopped": end.stopped, "done": done, "failed": failed, "wrong": wrong,
            "pending": pending, "noisy": noisy, "elapsed_s": end.elapsed.as_secs_f64(), "report": end.page,
        }));
    } else {
        problems(results, &end.told);
        if mode == Mode::Bar || end.stopped {
            let mut line = format!("{done} of {} runs done", results.runs.len());
            for (n, what) in [(noisy, "of them on a noisy machine"), (failed, "failed"), (wrong, "wrong")] {
                if n > 0 {
                    line += &format!(", {n} {what}");
                }
            }
            if pending > 0 {
                line += &format!(", {pending} not finished");
            }
            eprintln!("{line}; {}", took(end.elapsed));
            if end.stopped {
                eprintln!("start it again to go on");
            } else if failed > 0 {
                eprintln!("--retry-failed tries the failed ones again");
            }
        }
        if let (Some(page), Mode::Bar) = (&end.page, mode) {
            println!("report: {}", page.display());
        }
    }
    match (end.stopped, failed + wrong + pending) {
        (true, _) => ExitCode::from(INTERRUPTED),
        (_, 0) => ExitCode::SUCCESS,
        _ => ExitCode::from(1),
    }
}

fn took(time: Duration) -> String {
    if time.as_secs() < 10 { format!("{:.1} s", time.as_secs_f64()) } else { duration(time.as_secs()) }
}

/// Every failed or wrong run with its reason, unless the reader was told when it ended.
fn problems(results: &StudyResults, told: &HashSet<String>) {
    let bad: Vec<_> = results
        .runs
        .iter()
        .filter(|r| matches!(r.status, RunStatus::Failed | RunStatus::Wrong) && !told.contains(&r.measurement_id))
        .collect();
    let width = bad.iter().map(|r| r.scene().chars().count() + r.label().chars().count() + 2).max().unwrap_or(0);
    for r in bad {
        let word = if r.status == RunStatus::Wrong { "wrong " } else { "failed" };
        let name = format!("{}: {}", r.scene(), r.label());
        let reason = r.reason.as_deref().unwrap_or("no reason is known").replace('\n', "\n    ");
        eprintln!("{word}  {name:width$}  {reason}");
    }
}
