//! `cullmark scene`: info, generate, convert.

use crate::math::DVec3;
use crate::preview;
use crate::record::{PathSource, PathSpec, SceneSource, SceneSpec, Up, Winding};
use crate::registry::Spec;
use crate::scene::placement::along;
use crate::scene::{Scene, load, walkthrough, winding, write};
use anyhow::Context;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

#[derive(clap::Subcommand)]
pub enum Verb {
    /// Counts, bounds, materials and what loading found
    Info(InfoArgs),
    /// Write a generated scene to a file
    Generate(GenerateArgs),
    /// Read a scene and write it as OBJ or GLB: world metres, y up
    Convert(ConvertArgs),
}

/// A scene and how to read it; shared with other verbs.
#[derive(clap::Args, Clone)]
pub struct SceneArgs {
    /// A .obj, .gltf or .glb file, or a generator such as `arena:seed=1`
    #[arg(value_name = "FILE|SPEC")]
    pub scene: String,
    #[command(flatten)]
    pub options: SceneOptions,
}

#[derive(clap::Args, Clone)]
pub struct SceneOptions {
    /// Up axis of the file [default: y for files, z for generators]
    #[arg(long, value_parser = parse_up, value_name = "y|z")]
    pub up: Option<Up>,
    /// Metres a unit of the file
    #[arg(long, default_value_t = 1.0)]
    pub scale: f64,
    /// Move scene and path: metres along (6, -3, 2) / 7, or X,Y,Z
    #[arg(long, value_parser = parse_offset, default_value = "0", value_name = "M|X,Y,Z", allow_hyphen_values = true)]
    pub offset_m: [f64; 3],
    /// Which side of a face is its front
    #[arg(long, value_parser = parse_winding, default_value = "ccw", value_name = "ccw|cw|two_sided")]
    pub winding: Winding,
    /// Join vertices at exactly the same place
    #[arg(long)]
    pub weld: bool,
}

#[derive(clap::Args)]
pub struct InfoArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Probe the winding from the eyes of this camera path
    #[arg(long, value_name = "FILE.csv")]
    pub path: Option<PathBuf>,
    /// Draw it from above into this image
    #[arg(long, value_name = "FILE.png")]
    pub preview: Option<PathBuf>,
    #[arg(long)]
    pub json: bool,
}

#[derive(clap::Args)]
pub struct GenerateArgs {
    /// Generator with parameters, such as `arena:seed=1`
    pub spec: String,
    /// .obj (exact) or .glb (32-bit floats)
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Also draw it from above into this image
    #[arg(long, value_name = "FILE.png")]
    pub preview: Option<PathBuf>,
}

#[derive(clap::Args)]
pub struct ConvertArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// .obj (exact) or .glb (32-bit floats)
    pub out: PathBuf,
}

pub fn run(verb: Verb) -> anyhow::Result<ExitCode> {
    match verb {
        Verb::Info(a) => info(&a),
        Verb::Generate(a) => {
            let plain = SceneOptions { up: None, scale: 1.0, offset_m: [0.0; 3], winding: Winding::Ccw, weld: false };
            let spec = spec_of(&a.spec, &plain)?;
            if matches!(spec.source, SceneSource::File(_)) {
                anyhow::bail!("`{}` is a file, not a generator\n  help: use `cullmark scene convert`", a.spec);
            }
            let scene = load::load(&spec)?;
            a.preview.as_deref().map_or(Ok(()), |png| draw(&scene, png))?;
            save(&scene, &a.out)
        }
        Verb::Convert(a) => save(&load::load(&a.scene.spec()?)?, &a.out),
    }
}

impl SceneArgs {
    /// # Errors
    /// A file that cannot be read, an unknown generator or parameter.
    pub fn spec(&self) -> anyhow::Result<SceneSpec> {
        spec_of(&self.scene, &self.options)
    }
}

/// A file if it exists or looks like a path; otherwise a generator.
pub fn spec_of(text: &str, o: &SceneOptions) -> anyhow::Result<SceneSpec> {
    let path = Path::new(text);
    let is_file = path.exists() || text.contains('/') || path.extension().is_some_and(|_| !text.contains(':'));
    let (name, source) = if is_file {
        let stem = path.file_stem().map_or(text.into(), |s| s.to_string_lossy());
        (stem.into_owned(), SceneSource::File(path.to_path_buf()))
    } else {
        (text.to_string(), SceneSource::Generated(Spec::parse(text)?))
    };
    Ok(load::moved(load::describe(&name, source, o.winding, o.up, o.scale, o.weld)?, o.offset_m))
}

pub fn parse_offset(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|t| t.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    match numbers.as_deref() {
        Some([distance_m]) if *distance_m >= 0.0 => Ok(along(*distance_m)),
        Some([x, y, z]) => Ok([*x, *y, *z]),
        _ => Err("must be metres from 0, such as 1e4, or three numbers X,Y,Z".to_string()),
    }
}

pub fn parse_up(text: &str) -> Result<Up, String> {
    match text {
        "y" => Ok(Up::Y),
        "z" => Ok(Up::Z),
        _ => Err("must be y or z".to_string()),
    }
}

pub fn parse_winding(text: &str) -> Result<Winding, String> {
    match text {
        "ccw" => Ok(Winding::Ccw),
        "cw" => Ok(Winding::Cw),
        "two_sided" => Ok(Winding::TwoSided),
        _ => Err("must be ccw, cw or two_sided".to_string()),
    }
}

/// A CSV path for a scene, with its fingerprint.
pub fn path_file_spec(file: &Path, scene: &SceneSpec) -> anyhow::Result<PathSpec> {
    let source = PathSource::File(file.to_path_buf());
    let fingerprint = walkthrough::fingerprint(&source, &scene.fingerprint)?;
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(PathSpec { name, source, frames: None, stride: 1, fingerprint })
}

/// A file if it exists or looks like one; otherwise a walk.
pub fn path_of(text: &str, scene: &SceneSpec) -> anyhow::Result<PathSpec> {
    let file = Path::new(text);
    if file.exists() || text.contains('/') || text.ends_with(".csv") {
        return path_file_spec(file, scene);
    }
    let source = PathSource::Generated(Spec::parse(text)?);
    let fingerprint = walkthrough::fingerprint(&source, &scene.fingerprint)?;
    Ok(PathSpec { name: text.to_string(), source, frames: None, stride: 1, fingerprint })
}

fn save(scene: &Scene, out: &Path) -> anyhow::Result<ExitCode> {
    let notes = write::write(out, scene)?;
    let bytes = std::fs::metadata(out).with_context(|| out.display().to_string())?.len();
    println!("{}: {} triangles, {} vertices, {:.1} MiB", out.display(), scene.len(), scene.positions.len(), mib(bytes));
    scene.report.warnings.iter().chain(&notes).for_each(|w| eprintln!("warning: {w}"));
    Ok(ExitCode::SUCCESS)
}

/// A bird's-eye picture, three quarters from above.
fn draw(scene: &Scene, png: &Path) -> anyhow::Result<()> {
    let (width, height) = (1600, 900);
    let view = preview::overview(&scene.bounds(), 0.9, 0.7, f64::from(width) / f64::from(height));
    Ok(preview::write_png(png, &preview::render(scene, &view, width, height, &preview::Style::default()))?)
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// Bytes of the arrays of a scene.
fn memory(s: &Scene) -> u64 {
    let vectors = size_of_val(&s.positions[..]) + size_of_val(&s.triangles[..]);
    let ids = size_of_val(&s.source_triangle_id[..]) + size_of_val(&s.object_id[..]) + size_of_val(&s.material_id[..]);
    (vectors + ids + s.two_sided.len() + s.occluder.len()) as u64
}

fn info(a: &InfoArgs) -> anyhow::Result<ExitCode> {
    let spec = a.scene.spec()?;
    let start = Instant::now();
    let scene = load::load(&spec)?;
    let load_ms = start.elapsed().as_secs_f64() * 1e3;
    a.preview.as_deref().map_or(Ok(()), |png| draw(&scene, png))?;
    let (bounds, report) = (scene.bounds(), &scene.report);
    let mut objects = scene.object_id.clone();
    objects.sort_unstable();
    objects.dedup();
    let mut per_material = vec![0u64; scene.material_names.len()];
    scene.material_id.iter().filter_map(|m| per_material.get_mut(*m as usize).map(|n| *n += 1)).count();
    let from_path = match &a.path {
        Some(file) => {
            let poses = walkthrough::load(&path_file_spec(file, &spec)?, &spec, &scene)?;
            let eyes: Vec<DVec3> = poses.iter().map(|p| p.eye).collect();
            Some((winding::probe_from(&scene, &eyes), winding::warning_from(&scene, &eyes, spec.winding)))
        }
        None => None,
    };
    let count = |flags: &[bool]| flags.iter().filter(|f| **f).count();
    let (two_sided, see_through) = (count(&scene.two_sided), scene.len() - count(&scene.occluder));
    if a.json {
        let json = serde_json::json!({
            "name": scene.name, "fingerprint": spec.fingerprint, "content_hash": scene.content_hash(),
            "triangles": scene.len(), "source_triangles": scene.source_triangle_count, "vertices": scene.positions.len(),
            "objects": objects.len(), "materials": scene.material_names, "triangles_by_material": per_material,
            "two_sided": two_sided, "see_through": see_through,
            "bounds_m": [bounds.lo.to_array(), bounds.hi.to_array()], "origin_m": scene.origin.to_array(),
            "memory_bytes": memory(&scene), "load_ms": load_ms, "report": report,
            "front_hit_share_from_path": from_path.as_ref().and_then(|p| p.0.share()),
        });
        println!("{}", serde_json::to_string_pretty(&json)?);
        return Ok(ExitCode::SUCCESS);
    }
    let size = bounds.size();
    let vector = |v: DVec3| format!("{:.3} {:.3} {:.3}", v.x, v.y, v.z);
    println!("{}", scene.name);
    println!("  triangles    {} of {} in the source", scene.len(), scene.source_triangle_count);
    println!("  vertices     {} ({} welded)", scene.positions.len(), report.vertices_welded);
    println!("  objects      {}", objects.len());
    println!("  two-sided    {two_sided} triangles; see-through {see_through}");
    println!("  bounds       {} to {} m", vector(bounds.lo), vector(bounds.hi));
    println!("  size         {} m, z up, origin {}", vector(size), vector(scene.origin));
    println!("  memory       {:.1} MiB", mib(memory(&scene)));
    println!("  loaded in    {load_ms:.1} ms");
    println!("  fingerprint  {}", spec.fingerprint);
    println!("  content      {}", &scene.content_hash()[..32]);
    println!(
        "  dropped      {} ({} not finite, {} out of range, {} without area); points and lines {}",
        report.dropped(),
        report.dropped_non_finite,
        report.dropped_out_of_range,
        report.dropped_degenerate,
        report.points_and_lines
    );
    let share = |s: Option<f64>| s.map_or("not probed".to_string(), |s| format!("{s:.3}"));
    println!("  front hits   {} (blind probe)", share(report.front_hit_share));
    if let Some((probe, _)) = &from_path {
        println!("               {} (from the path, {} hits)", share(probe.share()), probe.hits);
    }
    println!("  materials    {}", scene.material_names.len());
    let mut order: Vec<usize> = (0..per_material.len()).collect();
    order.sort_by_key(|m| std::cmp::Reverse(per_material[*m]));
    for m in order.iter().take(10) {
        println!("    {:>9}  {}", per_material[*m], scene.material_names[*m]);
    }
    if order.len() > 10 {
        println!("    … and {} more (--json lists all)", order.len() - 10);
    }
    // The path knows better than the blind probe where free space is.
    let decided = from_path.as_ref().is_some_and(|p| p.0.share().is_some());
    let late = from_path.and_then(|p| p.1);
    report
        .warnings
        .iter()
        .filter(|w| !(decided && w.starts_with("winding")))
        .chain(&late)
        .for_each(|w| eprintln!("warning: {w}"));
    Ok(ExitCode::SUCCESS)
}
