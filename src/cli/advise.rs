//! `cullmark advise`: which structure, culling and walk to use for a scene and a path.

use super::camera::CameraOptions;
use super::scene::{SceneArgs, path_of};
use crate::advice::{self, Advice, Considered, Objective, Question, candidates};
use crate::error::Error;
use crate::machine;
use crate::record::TimeModel;
use crate::scene::{load, walkthrough};
use crate::worker::lane::{self, Lane};
use std::io::Write;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// A CSV of poses, or a walk such as `walk:frames=2000,seed=1`
    #[arg(value_name = "PATH|SPEC")]
    path: String,
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

pub fn parse_objective(text: &str) -> Result<Objective, String> {
    match text {
        "frame" => Ok(Objective::Frame),
        "cull" => Ok(Objective::Cull),
        _ => Err("must be frame or cull".into()),
    }
}

/// Times one of a short list in turn; more turns cost little and steady the median.
pub const TURNS: usize = 15;

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    for (key, ns) in [("--index-ns", args.index_ns), ("--draw-call-ns", args.draw_call_ns)] {
        if !(ns.is_finite() && ns >= 0.0) {
            return Err(Error::new(format!("is {ns}, but must be 0 or more nanoseconds")).key(key).into());
        }
    }
    let camera = args.camera.camera()?;
    let spec = args.scene.spec()?;
    let path = path_of(&args.path, &spec)?;
    let names = |given: &[String], usual: &[&str]| -> Vec<String> {
        if given.is_empty() { usual.iter().map(|s| s.to_string()).collect() } else { given.to_vec() }
    };
    let structures = names(&args.structures, candidates::STRUCTURES);
    let cullings = names(&args.cullings, candidates::CULLINGS);
    let texts = |names: &[String]| names.to_vec();
    let (structures, cullings) = (texts(&structures), texts(&cullings));
    let structures: Vec<&str> = structures.iter().map(String::as_str).collect();
    let cullings: Vec<&str> = cullings.iter().map(String::as_str).collect();
    let candidates = candidates::product(&structures, &cullings)?;
    let scene = load::load(&spec)?;
    let poses = walkthrough::load(&path, &spec, &scene)?;
    let question = Question {
        scene: &scene,
        poses: &poses,
        camera,
        model: TimeModel { index_ns: args.index_ns, draw_call_ns: args.draw_call_ns },
        objective: args.objective,
        candidates,
        aggressive: args.aggressive,
        short_list: usize::from(args.short_list),
        probe_frames: args.probe_frames as usize,
        turns: TURNS,
    };
    let advice = on_the_lane(&question)?;
    let text = if args.json {
        format!("{:#}\n", serde_json::to_value(&advice)?)
    } else {
        text(&advice, &spec.name, &path.name, poses.len(), args.all)
    };
    // A closed pipe (`| head`) is no error of ours.
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(ExitCode::SUCCESS)
}

/// Answers alone on the measuring lane, pinned to its core.
pub fn on_the_lane(question: &Question) -> anyhow::Result<Advice> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
    let lane = Lane::new(&lane::default_path());
    let _held = runtime.block_on(lane.hold(|| eprintln!("waiting for the measuring lane of this machine")))?;
    // The pool's threads were made before: builds use every core, timing this one.
    rayon::join(|| (), || ());
    if let Some(core) = machine::measuring_core() {
        machine::pin_to(&[core])?;
    }
    let advice = advice::advise(question);
    machine::pin_to(machine::cores())?;
    Ok(advice?)
}

/// The advice for people.
pub fn text(advice: &Advice, scene: &str, path: &str, frames: usize, all: bool) -> String {
    let f = &advice.features;
    let percent = |x: f64| format!("{:.0} %", 100.0 * x);
    let mut out = format!(
        "{scene}: {} triangles, {path}: {frames} frames, {} of them probed\n\
         {} of the area is axis-aligned, {:.1} front faces behind a pixel, {} of the triangles in view \
         ({} of those face the eye), normals of 64 neighbours fill {} of a mask, {:.2} octree cells a triangle\n",
        f.triangles,
        advice.probe.len(),
        percent(f.axis_aligned),
        f.depth_complexity,
        percent(f.in_view),
        percent(f.facing),
        percent(f.mask_fill),
        f.straddling,
    );
    out += &match advice.one_in {
        1 => "predicted from counts on the scene itself\n\n".to_string(),
        n => format!("predicted from counts on {} triangles, one in {n}\n\n", advice.sample_triangles),
    };
    out += &format!(
        "{:<54} {:>10} {:>10} {:>9} {:>10} {:>7} {:>9} {:>8}\n",
        "combination", "predicted", "timed us", "cull us", "triangles", "calls", "build ms", "MiB"
    );
    let us = |ns: f64| format!("{:.1}", ns / 1e3);
    let shown = if all { advice.considered.len() } else { 12 };
    for (i, c) in advice.considered.iter().enumerate().filter(|(_, c)| c.predicted_ns.is_some()).take(shown) {
        out += &row(c, i == advice.chosen, &us);
    }
    let left: Vec<&Considered> = advice.considered.iter().filter(|c| c.left_out.is_some()).collect();
    if !left.is_empty() {
        out += "\nleft out:\n";
        let mut told: Vec<(String, usize, &str)> = Vec::new();
        for c in left {
            let why = c.left_out.as_deref().unwrap_or_default();
            match told.iter_mut().find(|(_, _, w)| *w == why) {
                Some((_, more, _)) => *more += 1,
                None => told.push((c.label.clone(), 0, why)),
            }
        }
        for (label, more, why) in told {
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            out += &format!("  {label}{more}: {why}\n");
        }
    }
    let chosen = &advice.considered[advice.chosen];
    out += &format!("\nuse {}\n", chosen.label);
    advice.why.iter().for_each(|w| out += &format!("  {w}\n"));
    out
}

fn row(c: &Considered, chosen: bool, us: &dyn Fn(f64) -> String) -> String {
    let mark = if chosen { "*" } else { " " };
    let predicted = c.predicted_ns.map(us).unwrap_or_default();
    let (timed, cull, triangles, calls, build, mib) = match (&c.timed, &c.predicted) {
        (Some(t), _) => (
            us(t.objective_ns),
            us(t.cull_ns),
            format!("{:.0}", t.counts.entries),
            format!("{:.0}", t.counts.draw_calls),
            format!("{:.1}", t.build_ns / 1e6),
            format!("{:.1}", t.bytes as f64 / (1 << 20) as f64),
        ),
        (None, Some(p)) => (
            String::new(),
            String::new(),
            format!("{:.0}", p.entries),
            format!("{:.0}", p.draw_calls),
            String::new(),
            String::new(),
        ),
        (None, None) => Default::default(),
    };
    format!(
        "{mark} {:<52} {predicted:>10} {timed:>10} {cull:>9} {triangles:>10} {calls:>7} {build:>9} {mib:>8}\n",
        c.label
    )
}
