//! What a database knows of a matrix: the state of every run, for `plan`.

use crate::error::Result;
use crate::machine;
use crate::matrix::plan::{Known, State};
use crate::matrix::{Matrix, labels};
use crate::record::{Accuracy, RepeatPolicy, RunSpec};
use crate::results::RunStatus;
use crate::stats;
use crate::store::Store;
use crate::store::known::KnownRun;
use std::collections::HashMap;

/// The state of every run of `matrix`, in its order.
///
/// # Errors
/// When the database fails.
pub async fn known(store: &Store, study: &str, matrix: &Matrix, policy: &RepeatPolicy) -> Result<Vec<Known>> {
    let class = machine::environment(None).machine_class;
    // A study that was never submitted has no earlier cells: everything in it is new or shared.
    let before = store.specs(study).await.unwrap_or_default();
    let old: HashMap<[String; 5], (&RunSpec, String)> =
        before.iter().map(|s| (cell(s), (s, s.measurement_id(&class)))).collect();
    let stored_class = store.policy(study).await.map(|(_, class)| class).ok();

    let ids: Vec<String> = matrix.runs.iter().map(|r| r.measurement_id(&class)).collect();
    let wanted: Vec<String> = ids.iter().cloned().chain(old.values().map(|o| o.1.clone())).collect();
    let stored = store.known_runs(&wanted).await?;
    let mut all: Vec<Known> = Vec::with_capacity(ids.len());
    for (run, id) in matrix.runs.iter().zip(&ids) {
        let earlier = old.get(&cell(run));
        let state = match (stored.get(id), earlier) {
            (Some(k), _) => state(k, run, earlier.map(|e| e.0), policy),
            (None, Some((spec, _))) => State::Rerun { why: difference(run, spec, &class, stored_class.as_deref()) },
            (None, None) => State::New,
        };
        let like = stored.get(id).or_else(|| stored.get(&earlier?.1));
        all.push(Known { state, trial_s: like.and_then(|k| k.trial_wall_ns).map(|ns| ns * 1e-9) });
    }
    guess_from_neighbours(&mut all, matrix);
    Ok(all)
}

/// What names a run to its reader, whatever its ids.
fn cell(run: &RunSpec) -> [String; 5] {
    let l = labels(run);
    [l.scene, l.path, l.structure, l.culling, l.walk]
}

/// What `run` would make of a measurement that is stored.
fn state(k: &KnownRun, run: &RunSpec, earlier: Option<&RunSpec>, policy: &RepeatPolicy) -> State {
    let why = || k.reason.clone().unwrap_or_else(|| "no reason is known".into());
    match k.status {
        RunStatus::Failed => State::Failed { why: why() },
        RunStatus::Wrong => State::Failed { why: format!("wrong: {}", why()) },
        RunStatus::Pending => State::Partial { trials: k.repeats },
        RunStatus::Done if k.repeats < policy.repeats => State::Partial { trials: k.repeats },
        RunStatus::Done => match earlier {
            Some(e) if e.accuracy != run.accuracy && run.accuracy.frames > 0 => {
                State::Rejudge { why: format!("accuracy was {}, is {}", grid(&e.accuracy), grid(&run.accuracy)) }
            }
            _ => State::Done,
        },
    }
}

fn grid(a: &Accuracy) -> String {
    let s = if a.frames == 1 { "" } else { "s" };
    format!("{} frame{s} of {} x {} px", a.frames, a.width_px, a.height_px)
}

/// Every part of an id in which two runs of one name differ.
fn difference(run: &RunSpec, was: &RunSpec, class: &str, stored_class: Option<&str>) -> String {
    let mut parts = Vec::new();
    let mut changed = |what: &str, old: String, new: String| {
        if old != new {
            parts.push(format!("{what} was {old}, is {new}"));
        }
    };
    let hash = |h: &str| h.chars().take(8).collect::<String>();
    changed("content of the scene", hash(&was.scene.fingerprint), hash(&run.scene.fingerprint));
    changed("content of the path", hash(&was.path.fingerprint), hash(&run.path.fingerprint));
    let all = |n: Option<u32>| n.map_or("all".into(), |n| n.to_string());
    changed("path.frames", all(was.path.frames), all(run.path.frames));
    changed("path.stride", was.path.stride.to_string(), run.path.stride.to_string());
    changed("camera", json(&was.camera), json(&run.camera));
    for (name, new) in &run.revisions {
        let old = was.revisions.get(name).map_or("none".into(), u32::to_string);
        changed(&format!("revision of {name}"), old, new.to_string());
    }
    let (old, new) = (&was.protocol, &run.protocol);
    changed("measure.passes", old.passes.to_string(), new.passes.to_string());
    changed("measure.warmup_passes", old.warmup_passes.to_string(), new.warmup_passes.to_string());
    let core = |c: Option<u32>| c.map_or("none".into(), |c| c.to_string());
    changed("measuring core", core(old.pin_core), core(new.pin_core));
    changed("build profile", old.build_profile.clone(), new.build_profile.clone());
    changed("instruction set", old.isa.clone(), new.isa.clone());
    changed("threads", old.threads.to_string(), new.threads.to_string());
    changed("machine", stored_class.unwrap_or(class).to_string(), class.to_string());
    changed("series", was.series.to_string(), run.series.to_string());
    if parts.is_empty() { "its definition changed".into() } else { parts.join("; ") }
}

fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// A run without trials of its own takes about what others on its scene took.
fn guess_from_neighbours(all: &mut [Known], matrix: &Matrix) {
    let mut walls: HashMap<&str, Vec<f64>> = HashMap::new();
    for (k, run) in all.iter().zip(&matrix.runs) {
        walls.entry(run.scene.name.as_str()).or_default().extend(k.trial_s);
    }
    for (k, run) in all.iter_mut().zip(&matrix.runs) {
        let near = &walls[run.scene.name.as_str()];
        if k.trial_s.is_none() && !near.is_empty() {
            k.trial_s = Some(stats::median(near));
        }
    }
}
