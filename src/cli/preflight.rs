//! Before anything runs: every scene file and camera path of a study is read
//! once, so that a truncated mesh or an empty path is a mistake of the manifest
//! and not thirty failed runs, and what reading left out or doubts is told.

use crate::error::{Error, Result};
use crate::math::DVec3;
use crate::record::{PathSource, RunSpec, SceneSource};
use crate::scene::{load, walkthrough, winding};
use std::collections::BTreeSet;
use std::path::Path;

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
    let report = &scene.report;
    let mut notes = Vec::new();
    let reasons = [
        (report.dropped_non_finite, "with NaN or infinite coordinates"),
        (report.dropped_out_of_range, "out of range"),
        (report.dropped_degenerate, "without area"),
    ];
    for (count, why) in reasons.iter().filter(|(count, _)| *count > 0) {
        notes.push(format!("{name}: {count} of {} faces {why} were left out", report.triangles_in_file));
    }
    // Seen from the path the winding is plain; the blind estimate of loading would only add a doubt.
    let step = poses.len().div_ceil(EYES);
    let eyes: Vec<DVec3> = poses.iter().step_by(step).map(|p| p.eye).collect();
    notes.extend(winding::warning_from(&scene, &eyes, run.scene.winding).map(|w| format!("{name}: {w}")));
    let told = |w: &&String| !w.starts_with("winding") && !w.starts_with("dropped faces");
    notes.extend(report.warnings.iter().filter(told).map(|w| format!("{name}: {w}")));
    // An unwritable cache costs time only, as for scenes.
    let path = file(run, cache);
    if let (Some(folder), Ok(json)) = (path.parent(), serde_json::to_vec(&notes)) {
        let _ = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, json));
    }
    Ok(notes)
}
