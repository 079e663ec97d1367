//! `cullmark advise`: which structure, culling and walk to use for a scene and a path.

mod study;
mod text;

use super::camera::CameraOptions;
use super::report::put;
use super::scene::{SceneOptions, path_of, spec_of};
use crate::advice::{self, Advice, Objective, Question, candidates};
use crate::error::Error;
use crate::machine;
use crate::record::TimeModel;
use crate::scene::{load, walkthrough};
use crate::store;
use crate::worker::lane::{self, Lane};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// A .obj, .gltf or .glb file, or a generator such as `arena:seed=1`
    #[arg(value_name = "FILE|SPEC", required_unless_present = "study")]
    scene: Option<String>,
    /// A CSV of poses, or a walk such as `walk:frames=2000,seed=1`
    #[arg(value_name = "PATH|SPEC", required_unless_present = "study")]
    path: Option<String>,
    #[command(flatten)]
    options: SceneOptions,
    /// Advise on every scene and path of a finished study, among its combinations, and keep
    /// the advice with it: its report then tells the regret against the full matrix
    #[arg(long, value_name = "NAME", conflicts_with_all = ["scene", "path",
        "structures", "cullings", "up", "scale", "offset_m", "winding", "weld", "fov_y_deg", "ortho_height_m", "aspect",
        "near_m", "far_m", "index_ns", "draw_call_ns"])]
    study: Option<String>,
    /// Database of that study
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB, requires = "study")]
    db: PathBuf,
    #[command(flatten)]
    camera: CameraOptions,
    /// What is to be least: the modelled frame, or culling time alone
    #[arg(long, default_value = "frame", value_parser = parse_objective, value_name = "frame|cull")]
    objective: Objective,
    /// Price of an index in the modelled frame
    #[arg(long, value_name = "NS", default_value_t = TimeModel::default().index_ns)]
    index_ns: f64,
    /// Price of a draw call in the modelled frame
    #[arg(long, value_name = "NS", default_value_t = TimeModel::default().draw_call_ns)]
    draw_call_ns: f64,
    /// A structure to choose among, instead of the usual ones; again for more
    #[arg(long = "structure", value_name = "SPEC")]
    structures: Vec<String>,
    /// A sum of culling tests to choose among; again for more
    #[arg(long = "culling", value_name = "SUM")]
    cullings: Vec<String>,
    /// Also methods that may lose visible triangles
    #[arg(long)]
    aggressive: bool,
    /// How many are built over the whole scene and timed
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=100))]
    short_list: u8,
    /// Frames they are timed on, spread over the path
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    probe_frames: u32,
    /// Show every combination, not the best twelve
    #[arg(long)]
    all: bool,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
}

fn parse_objective(text: &str) -> Result<Objective, String> {
    match text {
        "frame" => Ok(Objective::Frame),
        "cull" => Ok(Objective::Cull),
        _ => Err("must be frame or cull".into()),
    }
}

/// Times one of a short list in turn; more turns cost little and steady the median.
const TURNS: usize = 5;

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    for (key, ns) in [("--index-ns", args.index_ns), ("--draw-call-ns", args.draw_call_ns)] {
        if !(ns.is_finite() && ns >= 0.0) {
            return Err(Error::new(format!("is {ns}, but must be 0 or more nanoseconds")).key(key).into());
        }
    }
    let model = TimeModel { index_ns: args.index_ns, draw_call_ns: args.draw_call_ns, ..TimeModel::default() };
    if let Some(study) = &args.study {
        return study::run(study, &args);
    }
    let (Some(scene), Some(path)) = (&args.scene, &args.path) else {
        return Err(Error::new("needs a scene and a path").help("or --study NAME").into());
    };
    let camera = args.camera.camera()?;
    let spec = spec_of(scene, &args.options)?;
    let path = path_of(path, &spec)?;
    let named = |given: &'static [&'static str], own: &[String]| -> Vec<String> {
        if own.is_empty() { given.iter().map(ToString::to_string).collect() } else { own.to_vec() }
    };
    let mut candidates = candidates::product(
        &named(candidates::STRUCTURES, &args.structures),
        &named(candidates::CULLINGS, &args.cullings),
    )?;
    if args.cullings.is_empty() {
        candidates.extend(candidates::with_mailboxes(&candidates));
    }
    let scene = load::load(&spec)?;
    let poses = walkthrough::load(&path, &spec, &scene)?;
    let advice = on_the_lane(&Question {
        scene: &scene,
        poses: &poses,
        camera,
        model,
        objective: args.objective,
        candidates,
        aggressive: args.aggressive,
        short_list: usize::from(args.short_list),
        probe_frames: args.probe_frames as usize,
        turns: TURNS,
    })?;
    let text = if args.json {
        let question = serde_json::json!({
            "scene": spec, "path": path, "frames": poses.len(), "camera": camera, "model": model, "advice": advice,
        });
        format!("{question:#}\n")
    } else {
        text::of(&advice, &spec.name, &path.name, poses.len(), args.all)
    };
    put(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Answers alone on the measuring lane, pinned to its core.
fn on_the_lane(question: &Question) -> anyhow::Result<Advice> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
    let lane = Lane::new(&lane::default_path());
    let _held = runtime.block_on(lane.hold(|| eprintln!("waiting for the measuring lane of this machine")))?;
    // Threads stay where they may run when they are made: builds use every core, timing one.
    rayon::join(|| (), || ());
    if let Some(core) = machine::measuring_core() {
        machine::pin_to(&[core])?;
    }
    let advice = advice::advise(question);
    machine::pin_to(machine::cores())?;
    Ok(advice?)
}
