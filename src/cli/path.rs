//! `cullmark path`: generate camera paths, check camera paths.

use super::scene::{SceneOptions, path_file_spec, spec_of};
use crate::record::{PathSource, PathSpec};
use crate::registry::{Spec, Value};
use crate::report::format::count;
use crate::scene::placement::Placement;
use crate::scene::walkthrough::{self, csv, generate};
use crate::scene::{load, winding};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Subcommand)]
pub enum Verb {
    /// Walk through the free space of a scene and write the poses as CSV
    Generate(GenerateArgs),
    /// Check a path file: frames, length, speed; with a scene also where it runs
    Info(InfoArgs),
}

#[derive(clap::Args)]
pub struct GenerateArgs {
    /// A .obj, .gltf or .glb file, or a generator such as `arena:seed=1`
    #[arg(long, value_name = "FILE|SPEC")]
    pub scene: String,
    #[command(flatten)]
    pub options: SceneOptions,
    /// Kind of walk with parameters, as in a manifest [default: the first one known]
    #[arg(long, value_name = "SPEC")]
    pub walk: Option<String>,
    /// Number of frames, where the walk takes it
    #[arg(long)]
    pub frames: Option<u32>,
    /// Seed, where the walk takes it
    #[arg(long)]
    pub seed: Option<u64>,
    #[arg(long, value_name = "FILE.csv")]
    pub out: PathBuf,
}

#[derive(clap::Args)]
pub struct InfoArgs {
    #[arg(value_name = "FILE.csv")]
    pub path: PathBuf,
    /// The scene that the path belongs to
    #[arg(long, value_name = "FILE|SPEC")]
    pub scene: Option<String>,
    #[command(flatten)]
    pub options: SceneOptions,
}

pub fn run(verb: Verb) -> anyhow::Result<ExitCode> {
    match verb {
        Verb::Generate(a) => generate(&a),
        Verb::Info(a) => info(&a),
    }
}

fn generate(a: &GenerateArgs) -> anyhow::Result<ExitCode> {
    let mut walk = match (&a.walk, generate::ALL.first()) {
        (Some(text), _) => Spec::parse(text)?,
        (None, Some(first)) => Spec::new(first.name),
        (None, None) => anyhow::bail!("no walkthrough generator is built in"),
    };
    let given = [("frames", a.frames.map(i64::from)), ("seed", a.seed.map(|s| s as i64))];
    for (key, value) in given {
        if let Some(value) = value {
            walk = walk.with(key, Value::Int(value));
        }
    }
    let (_, walk) = generate::make(&walk)?;
    let scene_spec = spec_of(&a.scene, &a.options)?;
    let scene = load::load(&scene_spec)?;
    let source = PathSource::Generated(walk.clone());
    let fingerprint = walkthrough::fingerprint(&source, &scene_spec.fingerprint)?;
    let path = PathSpec { name: walk.to_string(), source, frames: None, stride: 1, fingerprint };
    let poses = walkthrough::load(&path, &scene_spec, &scene)?;
    // The file shares units and axes with the scene's.
    let placement = Placement::of(&scene_spec)?;
    let frame = |(n, p)| csv::Frame { number: n, pose: placement.pose_to_file(p) };
    let frames: Vec<csv::Frame> = (0u64..).zip(&poses).map(frame).collect();
    csv::write(&a.out, &frames)?;
    let n = count(frames.len() as u64, "frame", "frames");
    println!("{}: {n} of {walk} through {}", a.out.display(), scene_spec.name);
    Ok(ExitCode::SUCCESS)
}

fn info(a: &InfoArgs) -> anyhow::Result<ExitCode> {
    let frames = csv::read(&a.path)?;
    let steps: Vec<f64> = frames.windows(2).map(|w| w[0].pose.eye.distance(w[1].pose.eye)).collect();
    let turns =
        frames.windows(2).map(|w| w[0].pose.forward.dot(w[1].pose.forward).clamp(-1.0, 1.0).acos().to_degrees());
    let gaps = frames.windows(2).filter(|w| w[1].number != w[0].number + 1).count();
    let longest = steps.iter().copied().fold(0.0, f64::max);
    println!("{}", a.path.display());
    println!(
        "  frames       {} (numbers {} to {}, {gaps} gaps)",
        frames.len(),
        frames[0].number,
        frames[frames.len() - 1].number
    );
    println!("  length       {:.3} units; longest step {longest:.4}", steps.iter().sum::<f64>());
    println!("  largest turn {:.2} degrees a frame", turns.fold(0.0, f64::max));
    let Some(text) = &a.scene else { return Ok(ExitCode::SUCCESS) };
    let spec = spec_of(text, &a.options)?;
    let scene = load::load(&spec)?;
    let poses = walkthrough::load(&path_file_spec(&a.path, &spec)?, &spec, &scene)?;
    let eyes: Vec<_> = poses.iter().map(|p| p.eye).collect();
    let bounds = scene.bounds();
    let outside = eyes.iter().filter(|e| !bounds.contains(**e)).count();
    println!("  in {}: {outside} of {} eyes are outside the bounds", spec.name, eyes.len());
    if let Some(share) = winding::probe_from(&scene, &eyes).share() {
        println!("  front hits   {share:.3} of first hits seen from these eyes");
    }
    // Orbits run outside; what is many sizes away has other units or axes.
    let reach = bounds.size().length() * 4.0;
    if eyes.iter().filter(|e| e.distance(bounds.centre()) > reach).count() * 2 > eyes.len() {
        eprintln!("warning: most eyes are far from the scene: do path and scene share units and axes (--up, --scale)?");
    }
    if let Some(w) = winding::warning_from(&scene, &eyes, spec.winding) {
        eprintln!("warning: {w}");
    }
    Ok(ExitCode::SUCCESS)
}
