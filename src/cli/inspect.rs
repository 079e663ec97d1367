//! `cullmark inspect`: one frame of one method: its work, its errors, what it
//! submitted as a list of ids and as a picture.

mod nodes;
mod picture;
mod text;

use nodes::Nodes;
use text::Report;

use super::camera::CameraOptions;
use super::scene::{SceneOptions, path_of, spec_of};
use crate::culling::{self, DrawList, Tally};
use crate::error::{Error, Result};
use crate::manifest::axes;
use crate::math::Arithmetic;
use crate::oracle::image::Grid;
use crate::oracle::{Effort, FrameTruth, judge_frame, losses, observed_class, verdict};
use crate::preview::{self, write_png};
use crate::record::Accuracy;
use crate::registry::{Spec, parse_sum};
use crate::runner::{Setup, by_own_samples, submitted};
use crate::scene::{load, walkthrough};
use crate::structure;
use crate::viewing::watch::Watch;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// A .obj, .gltf or .glb file, or a generator such as `rooms:world=1`
    #[arg(long, value_name = "FILE|SPEC")]
    scene: String,
    #[command(flatten)]
    options: SceneOptions,
    /// A CSV of poses, or a walk such as `wander:seed=1`
    #[arg(long, value_name = "FILE|SPEC")]
    path: String,
    /// Frame of the path, from 0
    #[arg(long)]
    frame: u32,
    /// Structure with parameters, such as `octree:depth=4`
    #[arg(long, value_name = "SPEC")]
    structure: String,
    /// Sum of culling tests, such as `frustum+normal_mask`
    #[arg(long, value_name = "SUM", default_value = "none")]
    culling: String,
    /// Order of visit: auto, or a walk such as depth_first or chc_pp:batch=50
    #[arg(long, value_name = "SPEC", default_value = "auto")]
    walk: String,
    /// Numbers in which tests are evaluated that state none
    #[arg(long, value_name = "NAME", default_value_t, value_parser = Arithmetic::parse)]
    arithmetic: Arithmetic,
    #[command(flatten)]
    camera: CameraOptions,
    /// Pixels in which errors are counted
    #[arg(long, value_name = "PX", default_value_t = 1920, value_parser = clap::value_parser!(u32).range(1..=16384))]
    width: u32,
    /// [default: from width and aspect]
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(1..=16384))]
    height: Option<u32>,
    /// s x s samples a pixel
    #[arg(long, value_name = "S", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=16))]
    samples: u32,
    /// Rays aimed at every triangle that no sample sees, to prove more of them visible
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    witness_rays: u32,
    /// Prove triangles hidden in at least this many cells to a side of the image; 0 proves none
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=16_384))]
    hiding_cells: u32,
    /// Write the submitted source triangle ids: one a line, ascending, each once, from 0
    #[arg(long, value_name = "FILE")]
    dump_submitted: Option<PathBuf>,
    /// Picture of the frame beside a plan: submitted triangles blue, lost ones red, the rest pale on the plan,
    /// nodes that the walk found hidden framed in orange
    #[arg(long, value_name = "FILE.png")]
    image: Option<PathBuf>,
    /// Picture of the walk's depth buffer after the frame: near is bright, blue is nothing
    #[arg(long, value_name = "FILE.png")]
    depth: Option<PathBuf>,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
}

/// Exit code 1 if the frame is wrong for the method's declared class.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    // What needs no scene is checked first: loading may take a while.
    let camera = args.camera.camera()?;
    let method = Method::parse(&args)?;
    let scene_spec = spec_of(&args.scene, &args.options)?;
    let path_spec = path_of(&args.path, &scene_spec)?;
    let scene = load::load(&scene_spec)?;
    let mut poses = walkthrough::load(&path_spec, &scene_spec, &scene)?;
    let frame_count = poses.len();
    if args.frame as usize >= frame_count {
        return Err(no_such_frame(&args, frame_count).into());
    }
    // Frames before this one may leave state behind; those after it cannot matter.
    poses.truncate(args.frame as usize + 1);
    let (structure, _) = structure::make(&method.structure)?;
    let (tests, _) = culling::make_tests(&method.culling)?;
    let (mut walk, _) = culling::make_walk(&method.walk)?;
    if args.depth.is_some() && walk.buffer().is_none() {
        let e = Error::new(format!("asks for a depth buffer, but `{}` draws no occluders", method.walk));
        let help = "leave it out, or choose a walk that queries occlusion, such as --walk chc_pp";
        return Err(e.key("--depth").help(help).into());
    }
    let mut setup = Setup::from_parts(scene, poses, &camera, structure.as_ref(), tests, walk)?;

    let watch = Watch::over(&mut setup.tests);
    setup.reset();
    let (mut list, mut tally) = (DrawList::default(), Tally::default());
    for frame in 0..=args.frame as usize {
        tally = Tally::default();
        watch.clear();
        setup.cull(frame, &mut list, &mut tally);
    }
    let nodes = Nodes::of(&setup, &watch, &list);
    let view = setup.views[args.frame as usize].clone();
    let height_px = args.height.unwrap_or_else(|| (f64::from(args.width) / args.camera.aspect).round().max(1.0) as u32);
    let grid = Grid { width_px: args.width, height_px, samples: args.samples };
    let (witness_rays, hiding_cells) = (args.witness_rays, args.hiding_cells);
    let effort = Effort::new(&setup.scene, &Accuracy { witness_rays, hiding_cells, ..Accuracy::default() });
    let truth = FrameTruth::with(&setup.scene, &view, args.frame, grid, &effort);
    let sent = submitted(&setup.scene, &setup.hierarchy, &list);
    let mut losses = losses(&setup.scene, &view, &truth, &sent, setup.removes);
    losses.errors.submitted_entries = list.entry_count();
    let wrong = match setup.promised_at(grid) {
        None => verdict(setup.class, std::slice::from_ref(&losses.errors)),
        Some(own) => {
            let own = FrameTruth::of(&setup.scene, &view, args.frame, Grid::of(&own));
            let errors = judge_frame(&setup.scene, &view, &own, &sent, setup.removes);
            verdict(setup.class, &[errors]).map(|why| by_own_samples(&why, own.grid))
        }
    };

    if let Some(file) = &args.dump_submitted {
        let ids: Vec<u32> = sent.triangles.iter().map(|t| setup.scene.source_triangle_id[t as usize]).collect();
        write_ids(file, &ids)?;
    }
    if let Some(file) = &args.depth {
        let buffer = setup.walk.buffer().ok_or_else(|| {
            Error::new(format!(
                "frame {} was culled without queries, as they did not pay; no depth was drawn",
                args.frame
            ))
            .key("--depth")
            .help("inspect another frame, or leave `auto` out")
        })?;
        let size = buffer.settings();
        write_png(file, &preview::depth(size.width_px, size.height_px, &buffer.image()))?;
    }
    if let Some(file) = &args.image {
        picture::write(file, &setup.scene, &view, &sent.triangles, &losses, &nodes.hidden_boxes)?;
    }
    let report = Report {
        scene: &scene_spec,
        frame_count,
        method: &method,
        setup: &setup,
        view: &view,
        list: &list,
        tally,
        nodes: &nodes,
        truth: &truth,
        losses: &losses,
        wrong: wrong.as_deref(),
        observed: observed_class(setup.removes, std::slice::from_ref(&losses.errors)),
        effort: &effort,
    };
    let text = if args.json { format!("{:#}\n", report.json()) } else { report.text() };
    // A closed pipe (`| head`) is no error of ours.
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(if wrong.is_some() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

struct Method {
    structure: Spec,
    culling: Vec<Spec>,
    walk: Spec,
}

impl Method {
    fn parse(args: &Args) -> Result<Method> {
        let structure = structure::make(&Spec::parse(&args.structure)?).map_err(|e| e.key("--structure"))?.1;
        let mut culling = culling::make_tests(&parse_sum(&args.culling)?).map_err(|e| e.key("--culling"))?.1;
        culling.iter_mut().for_each(|part| culling::state_arithmetic(part, args.arithmetic));
        let walk = match (args.walk.trim(), axes::axis("walk").and_then(|a| a.auto)) {
            ("auto", Some(auto)) => auto(&structure),
            (text, _) => Spec::parse(text)?,
        };
        let walk = culling::make_walk(&walk).map_err(|e| e.key("--walk"))?.1;
        Ok(Method { structure, culling, walk })
    }
}

fn no_such_frame(args: &Args, count: usize) -> Error {
    let frames = if count == 1 { "1 frame".to_string() } else { format!("{count} frames") };
    Error::new(format!("is {}, but path {} has {frames}", args.frame, args.path))
        .key("--frame")
        .help(format!("choose a frame from 0 to {}", count - 1))
}

fn write_ids(file: &Path, ids: &[u32]) -> Result<()> {
    let mut text = String::with_capacity(ids.len() * 7);
    ids.iter().for_each(|id| text.extend([&id.to_string(), "\n"]));
    std::fs::write(file, text).map_err(|e| Error::io(file, "cannot write the submitted ids", &e))
}
