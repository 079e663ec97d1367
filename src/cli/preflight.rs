//! Before anything runs: every scene file and camera path of a study is read
//! once, so that a truncated mesh or an empty path is a mistake of the manifest
//! and not thirty failed runs, and what reading left out or doubts is told.

use super::pipe;
use crate::error::{Error, Result};
use crate::machine;
use crate::math::DVec3;
use crate::record::{PathSource, RunSpec, SceneSource};
use crate::scene::{LoadReport, load, walkthrough, winding};
use serde::Deserialize;
use serde_json::json;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The verb `cullmark preflight`, for a server that reads no triangles itself.
#[derive(clap::Args)]
pub struct Args {}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    pub runs: Vec<RunSpec>,
    pub cache_dir: PathBuf,
    #[serde(default)]
    pub memory_limit_mib: Option<u64>,
}

/// `{"ok": notes}`, or `{"errors": [...]}` with exit code 1.
pub fn run(_args: Args) -> anyhow::Result<ExitCode> {
    let notes = pipe::read::<Request>().map_err(|e| vec![e]).and_then(|request| {
        request.memory_limit_mib.map_or(Ok(()), machine::limit_memory).map_err(|e| vec![e])?;
        read(&request.runs, &request.cache_dir)
    });
    let (document, code) = match notes {
        Ok(notes) => (json!({ "ok": notes }), ExitCode::SUCCESS),
        Err(errors) => {
            let errors: Vec<_> = errors.iter().map(pipe::located).collect();
            (json!({ "errors": errors }), ExitCode::from(1))
        }
    };
    pipe::print(&document)?;
    Ok(code)
}

/// Eyes of a path that the winding is probed from.
const EYES: usize = 32;

/// Sentences on what was read, each once; all mistakes, not only the first.
///
/// What is generated is not checked: its parameters were, when the manifest was read.
/// The sentences are kept in the cache, so that the second time costs nothing.
pub fn read(runs: &[RunSpec], cache: &Path) -> Result<Vec<String>, Vec<Error>> {
    let mut seen = BTreeSet::new();
    let (mut notes, mut errors) = (Vec::new(), Vec::new());
    for run in runs {
        let from_file =
            matches!(run.scene.source, SceneSource::File(_)) || matches!(run.path.source, PathSource::File(_));
        if !from_file || !seen.insert((&run.scene.fingerprint, &run.path.fingerprint)) {
            continue;
        }
        match known(run, cache).map_or_else(|| examine(run, cache), Ok) {
            Ok(found) => notes.extend(found),
            Err(e) => errors.push(e),
        }
    }
    notes.sort();
    notes.dedup();
    if errors.is_empty() { Ok(notes) } else { Err(errors) }
}

fn file(run: &RunSpec, cache: &Path) -> std::path::PathBuf {
    let name = |id: &str| id.chars().take(32).collect::<String>();
    let path = format!("{}-{}.json", name(&run.scene.fingerprint), name(&run.path.fingerprint));
    cache.join("preflight").join(path)
}

fn known(run: &RunSpec, cache: &Path) -> Option<Vec<String>> {
    serde_json::from_slice(&std::fs::read(file(run, cache)).ok()?).ok()
}

fn examine(run: &RunSpec, cache: &Path) -> Result<Vec<String>> {
    let scene = load::load_cached(&run.scene, cache)?;
    let poses = walkthrough::load_cached(&run.path, &run.scene, &scene, cache)?;
    if poses.is_empty() {
        return Err(Error::new(format!("the path `{}` has no frames", run.path.name)).help("record or generate one"));
    }
    let name = &run.scene.name;
    let mut notes = left_out(&scene.report);
    // Seen from the path the winding is plain; the blind estimate of loading would only add a doubt.
    let step = poses.len().div_ceil(EYES);
    let eyes: Vec<DVec3> = poses.iter().step_by(step).map(|p| p.eye).collect();
    notes.retain(|note| !note.starts_with("winding"));
    notes.extend(winding::warning_from(&scene, &eyes, run.scene.winding));
    let notes: Vec<String> = notes.iter().map(|note| format!("{name}: {note}")).collect();
    // An unwritable cache costs time only, as for scenes.
    let path = file(run, cache);
    if let (Some(folder), Ok(json)) = (path.parent(), serde_json::to_vec(&notes)) {
        let _ = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, json));
    }
    Ok(notes)
}

/// What loading left out or doubts, a sentence each.
pub(super) fn left_out(report: &LoadReport) -> Vec<String> {
    let reasons = [
        (report.dropped_non_finite, "with NaN or infinite coordinates"),
        (report.dropped_out_of_range, "out of range"),
        (report.dropped_degenerate, "without area"),
    ];
    let dropped = reasons.iter().filter(|(count, _)| *count > 0);
    let dropped =
        dropped.map(|(count, why)| format!("{count} of {} faces {why} were left out", report.triangles_in_file));
    // Their sums are also a warning.
    dropped.chain(report.warnings.iter().filter(|w| !w.starts_with("dropped faces")).cloned()).collect()
}
