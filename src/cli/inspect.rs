//! `cullmark inspect`: one frame of one method: its work, its errors, what it
//! submitted as a list of ids and as a picture.

mod picture;

use super::scene::{SceneOptions, path_file_spec, spec_of};
use crate::culling::{self, Class, DrawList, Removes, Tally};
use crate::error::{Error, Result};
use crate::manifest::axes;
use crate::math::{Arithmetic, Camera, Pose, Projection, View};
use crate::oracle::image::Grid;
use crate::oracle::{FrameTruth, Losses, losses, verdict};
use crate::record::{PathSource, PathSpec, SceneSpec};
use crate::registry::{Spec, format_sum, parse_sum};
use crate::runner::{Setup, submitted};
use crate::scene::{load, walkthrough};
use crate::structure;
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
    /// Order of visit: auto, flat or depth_first
    #[arg(long, value_name = "SPEC", default_value = "auto")]
    walk: String,
    /// Numbers in which tests are evaluated that state none
    #[arg(long, value_name = "NAME", default_value_t, value_parser = Arithmetic::parse)]
    arithmetic: Arithmetic,
    /// Full vertical field of view of a perspective camera, degrees
    #[arg(long, value_name = "DEG", default_value_t = 60.0)]
    fov_y_deg: f64,
    /// Full height of the view volume, metres; makes the camera orthographic
    #[arg(long, value_name = "M")]
    ortho_height_m: Option<f64>,
    /// Width over height, as 16:9 or 1.778
    #[arg(long, default_value = "16:9", value_parser = parse_aspect)]
    aspect: f64,
    #[arg(long, value_name = "M", default_value_t = 0.1)]
    near_m: f64,
    /// Infinite if absent
    #[arg(long, value_name = "M")]
    far_m: Option<f64>,
    /// Pixels in which errors are counted
    #[arg(long, value_name = "PX", default_value_t = 1920, value_parser = clap::value_parser!(u32).range(1..=16384))]
    width: u32,
    /// [default: from width and aspect]
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(1..=16384))]
    height: Option<u32>,
    /// s x s samples a pixel
    #[arg(long, value_name = "S", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=16))]
    samples: u32,
    /// Write the submitted source triangle ids: one a line, ascending, each once, from 0
    #[arg(long, value_name = "FILE")]
    dump_submitted: Option<PathBuf>,
    /// Picture of the frame beside a plan: submitted triangles blue, lost ones red, the rest pale on the plan
    #[arg(long, value_name = "FILE.png")]
    image: Option<PathBuf>,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
}

/// Exit code 1 if the frame is wrong for the method's declared class.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    // What needs no scene is checked first: loading may take a while.
    let camera = camera(&args)?;
    let method = Method::parse(&args)?;
    let scene_spec = spec_of(&args.scene, &args.options)?;
    let path_spec = path_spec(&args.path, &scene_spec)?;
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
    let (walk, _) = culling::make_walk(&method.walk)?;
    let mut setup = Setup::from_parts(scene, poses, &camera, structure.as_ref(), tests, walk)?;

    setup.reset();
    let (mut list, mut tally) = (DrawList::default(), Tally::default());
    for frame in 0..=args.frame as usize {
        tally = Tally::default();
        setup.cull(frame, &mut list, &mut tally);
    }
    let view = setup.views[args.frame as usize].clone();
    let height_px = args.height.unwrap_or_else(|| (f64::from(args.width) / args.aspect).round().max(1.0) as u32);
    let grid = Grid { width_px: args.width, height_px, samples: args.samples };
    let truth = FrameTruth::of(&setup.scene, &view, args.frame, grid);
    let sent = submitted(&setup.scene, &setup.hierarchy, &list);
    let mut losses = losses(&setup.scene, &view, &truth, &sent, setup.removes);
    losses.errors.submitted_entries = list.entry_count();
    let wrong = verdict(setup.class, std::slice::from_ref(&losses.errors));

    if let Some(file) = &args.dump_submitted {
        let ids: Vec<u32> = sent.triangles.iter().map(|t| setup.scene.source_triangle_id[t as usize]).collect();
        write_ids(file, &ids)?;
    }
    if let Some(file) = &args.image {
        picture::write(file, &setup.scene, &view, &sent.triangles, &losses)?;
    }
    let report = Report {
        scene: &scene_spec,
        frame_count,
        method: &method,
        setup: &setup,
        view: &view,
        list: &list,
        tally,
        truth: &truth,
        losses: &losses,
        wrong: wrong.as_deref(),
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

fn camera(args: &Args) -> Result<Camera> {
    let bad = |key: &str, value: f64, want: &str| Err(Error::new(format!("is {value}, but must be {want}")).key(key));
    if !(0.01..180.0).contains(&args.fov_y_deg) {
        return bad("--fov-y-deg", args.fov_y_deg, "from 0.01 to below 180 degrees");
    }
    if !(args.near_m.is_finite() && args.near_m > 0.0) {
        return bad("--near-m", args.near_m, "above 0");
    }
    if let Some(far_m) = args.far_m.filter(|f| !(f.is_finite() && *f > args.near_m)) {
        return bad(
            "--far-m",
            far_m,
            &format!("beyond the near plane at {} m; leave it out for infinite", args.near_m),
        );
    }
    let projection = match args.ortho_height_m {
        None => Projection::Perspective { fov_y_rad: args.fov_y_deg.to_radians() },
        Some(height_m) if height_m.is_finite() && height_m > 0.0 => Projection::Orthographic { height_m },
        Some(height_m) => return bad("--ortho-height-m", height_m, "above 0"),
    };
    Ok(Camera { projection, aspect: args.aspect, near_m: args.near_m, far_m: args.far_m })
}

fn parse_aspect(text: &str) -> Result<f64, String> {
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0);
    let aspect = match text.split_once([':', '/']) {
        Some((w, h)) => number(w).zip(number(h)).map(|(w, h)| w / h),
        None => number(text),
    };
    aspect.filter(|a| (0.01..=100.0).contains(a)).ok_or_else(|| "write 16:9 or a number from 0.01 to 100".to_string())
}

/// A file if it exists or looks like one; otherwise a walk.
fn path_spec(text: &str, scene: &SceneSpec) -> anyhow::Result<PathSpec> {
    let file = Path::new(text);
    if file.exists() || text.contains('/') || text.ends_with(".csv") {
        return path_file_spec(file, scene);
    }
    let source = PathSource::Generated(Spec::parse(text)?);
    let fingerprint = walkthrough::fingerprint(&source, &scene.fingerprint)?;
    Ok(PathSpec { name: text.to_string(), source, frames: None, stride: 1, fingerprint })
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

/// All that is printed.
struct Report<'a> {
    scene: &'a SceneSpec,
    frame_count: usize,
    method: &'a Method,
    setup: &'a Setup,
    view: &'a View,
    list: &'a DrawList,
    tally: Tally,
    truth: &'a FrameTruth,
    losses: &'a Losses,
    wrong: Option<&'a str>,
}

impl Report<'_> {
    fn draw_calls(&self) -> (u64, u64) {
        (self.list.draw_calls(&self.setup.hierarchy), self.list.ranges.len() as u64)
    }

    fn pose(&self) -> Pose {
        Pose { eye: self.view.eye, forward: self.view.forward, up: self.view.up }
    }

    fn text(&self) -> String {
        let (e, n) = (&self.losses.errors, self.setup.scene.len() as u64);
        let (calls, calls_any) = self.draw_calls();
        let dropped = self.setup.scene.report.dropped();
        let pose = self.pose();
        let at = |v: crate::math::DVec3| format!("({:.3}, {:.3}, {:.3})", v.x, v.y, v.z);
        let mut lines = vec![
            format!("scene      {}: {} triangles, {} left out", self.scene.name, group(n), group(dropped)),
            format!(
                "frame      {} of {}: eye {}, forward {}",
                e.frame,
                self.frame_count,
                at(pose.eye),
                at(pose.forward)
            ),
            format!("structure  {}", self.method.structure),
            format!(
                "culling    {}, walk {}: {}",
                format_sum(&self.method.culling),
                self.method.walk,
                class_name(self.setup.class)
            ),
            String::new(),
            format!(
                "submitted  {} triangles ({:.2} % of the scene), {} entries, {} draw calls ({} ignoring materials)",
                group(e.submitted),
                100.0 * e.submitted as f64 / n as f64,
                group(e.submitted_entries),
                group(calls),
                group(calls_any)
            ),
        ];
        let work = self.tally.named().map(|(name, _, value)| format!("{} {}", group(value), name.replace('_', " ")));
        lines.push(format!("work       {}", work.join(", ")));
        lines.push(format!("owed       {} triangles {}", group(e.potential), owed(self.setup.removes)));
        let grid = self.truth.grid;
        lines.push(format!(
            "visible    {} triangles, seen by {}x{} samples in each of {} x {} pixels ({} show anything)",
            group(e.visible),
            grid.samples,
            grid.samples,
            grid.width_px,
            grid.height_px,
            group(e.covered_pixels)
        ));
        if e.visible > 0 {
            lines.push(format!("over       {:.2} submitted a visible triangle", e.over_submission()));
        }
        lines.push(match e.false_culls {
            0 => "lost       nothing that a sample sees".to_string(),
            lost => format!(
                "lost       {} visible triangles in {} pixels, the largest hole {} pixels",
                group(lost),
                group(e.false_cull_pixels),
                group(e.largest_blob_px)
            ),
        });
        if !self.losses.hidden.is_empty() {
            lines.push(format!(
                "           {} owed triangles that no sample sees",
                group(self.losses.hidden.len() as u64)
            ));
        }
        if !e.lost_ids.is_empty() {
            let ids = e.lost_ids.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
            lines.push(format!("           source ids {ids}{}", if self.more_ids() { ", ..." } else { "" }));
        }
        lines.push(match (self.wrong, self.setup.class) {
            (Some(why), class) => format!("verdict    WRONG for a {} method: {why}", class_name(class)),
            (None, Class::Aggressive | Class::Approximate) => {
                format!("verdict    {}: errors are data", class_name(self.setup.class))
            }
            (None, class) => format!("verdict    right for a {} method", class_name(class)),
        });
        lines.extend(self.setup.scene.report.warnings.iter().map(|w| format!("warning    {w}")));
        lines.join("\n") + "\n"
    }

    fn more_ids(&self) -> bool {
        self.losses.seen.len() + self.losses.hidden.len() > self.losses.errors.lost_ids.len()
    }

    fn json(&self) -> serde_json::Value {
        let source = |ids: &[u32]| ids.iter().map(|t| self.setup.scene.source_triangle_id[*t as usize]).collect();
        let (seen, hidden): (Vec<u32>, Vec<u32>) = (source(&self.losses.seen), source(&self.losses.hidden));
        let (calls, calls_any) = self.draw_calls();
        let counters: serde_json::Map<_, _> =
            self.tally.named().iter().map(|(name, _, value)| (name.to_string(), (*value).into())).collect();
        serde_json::json!({
            "scene": self.scene,
            "scene_triangles": self.setup.scene.len(),
            "load": self.setup.scene.report,
            "frame": self.losses.errors.frame,
            "frame_count": self.frame_count,
            "pose": self.pose(),
            "camera": self.view.camera,
            "structure": self.method.structure.to_string(),
            "culling": format_sum(&self.method.culling),
            "walk": self.method.walk.to_string(),
            "class": self.setup.class,
            "removes": self.setup.removes,
            "build": self.setup.hierarchy.stats,
            "draw_calls": calls,
            "draw_calls_any_material": calls_any,
            "counters": counters,
            "samples": self.truth.grid.samples,
            "uncertain_triangles": self.truth.uncertain,
            "errors": self.losses.errors,
            "lost_visible_ids": seen,
            "lost_hidden_ids": hidden,
            "wrong": self.wrong,
        })
    }
}

fn class_name(class: Class) -> String {
    serde_json::to_value(class).ok().and_then(|v| v.as_str().map(|s| s.replace('_', " "))).unwrap_or_default()
}

/// What bounds the set that the method must keep.
fn owed(removes: Removes) -> &'static str {
    match (removes.occluded, removes.back_facing, removes.outside_frustum) {
        (true, ..) => "meet the view volume and face the eye (hidden ones may go)",
        (_, true, _) => "meet the view volume and face the eye",
        (_, _, true) => "meet the view volume",
        _ => "(the whole scene: nothing may be removed)",
    }
}

/// 1234567 as 1,234,567.
fn group(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(d);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aspects_are_ratios_or_numbers() {
        assert_eq!(parse_aspect("16:9"), Ok(16.0 / 9.0));
        assert_eq!(parse_aspect("4/3"), Ok(4.0 / 3.0));
        assert_eq!(parse_aspect("1.5"), Ok(1.5));
        for bad in ["", "16:", "0:9", "-1", "wide", "inf", "1:0", "1e9"] {
            assert!(parse_aspect(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn numbers_are_grouped_by_thousands() {
        assert_eq!([0, 999, 1000, 1234567].map(group), ["0", "999", "1,000", "1,234,567"]);
    }
}
