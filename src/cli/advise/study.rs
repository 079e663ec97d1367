//! `cullmark advise --study`: advice on every place of a finished study, kept with it.

use super::{Args, TURNS, on_the_lane};
use crate::advice::{Combination, Objective, Question};
use crate::error::Error;
use crate::results::{Advised, RunResult, RunStatus};
use crate::scene::{load, walkthrough};
use crate::store::{self, Detail, Store};
use std::path::Path;
use std::process::ExitCode;

pub fn run(study: &str, args: &Args) -> anyhow::Result<ExitCode> {
    let results = store::read_results(&args.db, study, Detail::Summary)?;
    let cache = args.db.parent().unwrap_or(Path::new("")).join("cache");
    let metric = match args.objective {
        Objective::Frame => "total_frame_ms_model",
        Objective::Cull => "total_cull_ms",
    };
    let mut found = Vec::new();
    for place in places(&results.runs, args.aggressive) {
        let first = &place[0].spec;
        let scene = load::load_cached(&first.scene, &cache)?;
        let poses = walkthrough::load_cached(&first.path, &first.scene, &scene, &cache)?;
        let candidates: Vec<Combination> = place.iter().map(|r| combination(r)).collect();
        let advice = on_the_lane(&Question {
            scene: &scene,
            poses: &poses,
            camera: first.camera,
            model: first.model,
            objective: args.objective,
            candidates: candidates.clone(),
            aggressive: args.aggressive,
            short_list: usize::from(args.short_list),
            probe_frames: args.probe_frames as usize,
            turns: TURNS,
        })?;
        let chosen = &advice.considered[advice.chosen];
        let run = candidates.iter().position(|c| *c == chosen.combination).map(|i| place[i]);
        let run = run.ok_or_else(|| Error::new("the adviser chose what the study does not hold"))?;
        println!("{}, {}: {}", first.scene.name, first.path.name, chosen.label);
        found.push(Advised {
            scene: first.scene.name.clone(),
            path: first.path.name.clone(),
            metric: metric.to_string(),
            measurement_id: run.measurement_id.clone(),
            candidates: place.iter().map(|r| r.measurement_id.clone()).collect(),
            short_list: advice.considered.iter().filter(|c| c.timed.is_some()).count() as u32,
            probe_frames: advice.probe.len() as u32,
        });
    }
    if found.is_empty() {
        return Err(Error::new(format!("study `{study}` has no finished runs to choose among"))
            .help("run it first; runs of aggressive methods take part with --aggressive")
            .into());
    }
    store::block_on(async {
        let store = Store::open_existing(&args.db).await?;
        let kept = store.record_advice(study, &found).await;
        store.close().await;
        kept
    })?;
    println!("kept with `{study}`: `cullmark report {study}` tells the regret");
    Ok(ExitCode::SUCCESS)
}

fn combination(run: &RunResult) -> Combination {
    let spec = &run.spec;
    Combination { structure: spec.structure.clone(), culling: spec.culling.clone(), walk: spec.walk.clone() }
}

/// Finished runs by scene, path and camera. Other arithmetics than the usual one are no
/// candidates: who asks for advice asks for the fastest that is right.
fn places(runs: &[RunResult], aggressive: bool) -> Vec<Vec<&RunResult>> {
    let mut places: Vec<Vec<&RunResult>> = Vec::new();
    let usual = |r: &&RunResult| {
        let sound = r.class.is_none_or(|c| c <= crate::culling::Class::Conservative);
        r.status == RunStatus::Done && (sound || aggressive) && r.spec.axes.keys().all(|axis| axis == "camera")
    };
    for run in runs.iter().filter(usual) {
        let same = |p: &&mut Vec<&RunResult>| {
            let (a, b) = (&p[0].spec, &run.spec);
            a.scene == b.scene && a.path == b.path && a.camera == b.camera && p[0].machine_class == run.machine_class
        };
        match places.iter_mut().find(same) {
            Some(place) => place.push(run),
            None => places.push(vec![run]),
        }
    }
    places
}
