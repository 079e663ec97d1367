//! The scenes and paths of the sweep: all generators with all generated walks, and the
//! shared scenes with theirs.

use cullmark::math::Pose;
use cullmark::record::{PathSource, PathSpec, SceneSource, Up, Winding};
use cullmark::registry::Spec;
use cullmark::scene::{Scene, generate, load, walkthrough};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Of every generated path.
const FRAMES: u32 = 240;

/// A scene by name, loaded when its turn comes.
pub enum Source {
    Generated(&'static str),
    Shared { folder: PathBuf, entry: Value },
}

/// Folder of the shared scenes, as the tests look for it.
fn shared_folder() -> PathBuf {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    std::env::var_os("CULLMARK_SCENES").map_or_else(beside, PathBuf::from)
}

pub fn all() -> Vec<(String, Source)> {
    let mut all: Vec<(String, Source)> =
        generate::ALL.iter().map(|e| (e.name.to_string(), Source::Generated(e.name))).collect();
    let folder = shared_folder();
    let Ok(manifest) = std::fs::read(folder.join("MANIFEST.json")) else {
        println!("no shared scenes at {}: set CULLMARK_SCENES", folder.display());
        return all;
    };
    let manifest: Value = serde_json::from_slice(&manifest).expect("MANIFEST.json is JSON");
    for entry in manifest["scenes"].as_array().expect("`scenes` is a list") {
        let id = entry["id"].as_str().expect("every scene has an id");
        match entry["mesh"].as_str() {
            Some(_) => all.push((id.into(), Source::Shared { folder: folder.join(id), entry: entry.clone() })),
            None => println!("{id}: skipped, not a mesh (a height map, for which there is no reader)"),
        }
    }
    all
}

/// The scene and its paths by name.
pub fn load(name: &str, source: &Source) -> cullmark::Result<(Scene, Vec<(String, Vec<Pose>)>)> {
    match source {
        Source::Generated(generator) => {
            let scene = generate::make(&Spec::new(generator))?.0.generate();
            let mut paths = Vec::new();
            for walker in walkthrough::generate::ALL {
                let spec = Spec::parse(&format!("{}:frames={FRAMES}", walker.name))?;
                match walkthrough::generate::make(&spec)?.0.walk(&scene) {
                    Ok(poses) => paths.push((walker.name.to_string(), poses)),
                    Err(e) => println!("{name}: no `{}` in it ({e})", walker.name),
                }
            }
            Ok((scene, paths))
        }
        Source::Shared { folder, entry } => read(name, folder, entry),
    }
}

fn read(name: &str, folder: &Path, entry: &Value) -> cullmark::Result<(Scene, Vec<(String, Vec<Pose>)>)> {
    // Metres a unit: game maps are in inches, one atrium is in centimetres.
    let scale = match name {
        "sponza" => 0.01,
        q3 if q3.starts_with("q3_") => 0.0254,
        _ => 1.0,
    };
    let up = if entry["up"] == "z" { Up::Z } else { Up::Y };
    let mesh = folder.join(entry["mesh"].as_str().expect("a mesh"));
    let spec = load::describe(name, SceneSource::File(mesh), Winding::Ccw, Some(up), scale, false)?;
    let scene = load::load(&spec)?;
    let mut paths = Vec::new();
    for path in entry["paths"].as_array().into_iter().flatten() {
        let file = path["file"].as_str().expect("every path has a file");
        let source = PathSource::File(folder.join(file));
        let path = PathSpec { name: file.into(), source, frames: None, stride: 1, fingerprint: String::new() };
        paths.push((file.trim_end_matches(".csv").to_string(), walkthrough::load(&path, &spec, &scene)?));
    }
    Ok((scene, paths))
}
