//! `cullmark examine`: is an uploaded file a scene or a camera path that runs could
//! use? Read by the real readers, in a process of its own.

use super::{pipe, preflight};
use crate::error::{Error, Result};
use crate::machine;
use crate::record::{SceneSource, SceneSpec, Up, Winding};
use crate::scene::{gltf, load, mtl, walkthrough};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    pub kind: Kind,
    pub file: PathBuf,
    #[serde(default)]
    pub memory_limit_mib: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    Scene,
    Path,
}

pub fn run(_args: Args) -> anyhow::Result<ExitCode> {
    pipe::answer(pipe::read().and_then(|request| examine(&request)))
}

fn examine(request: &Request) -> Result<Value> {
    if let Some(mib) = request.memory_limit_mib {
        machine::limit_memory(mib)?;
    }
    match request.kind {
        Kind::Scene => scene(&request.file),
        Kind::Path => {
            // Without a frame it is an error of the reader.
            let frames = walkthrough::csv::read(&request.file)?.len();
            Ok(json!({ "triangles": null, "frames": frames, "notes": [] }))
        }
    }
}

/// As its file stands: the options of a manifest can turn and scale it, but make no
/// triangle of what is none.
fn scene(file: &Path) -> Result<Value> {
    stands_alone(file)?;
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let scene = load::load(&SceneSpec {
        name: name.into_owned(),
        source: SceneSource::File(file.to_path_buf()),
        winding: Winding::Ccw,
        up: Up::Y,
        scale: 1.0,
        weld: false,
        offset_m: [0.0; 3],
        // Nothing is cached under it.
        fingerprint: String::new(),
    })?;
    Ok(json!({ "triangles": scene.len(), "frames": null, "notes": preflight::left_out(&scene.report) }))
}

/// The names in an uploaded file are a stranger's: they must not make us read other
/// files of this machine.
fn stands_alone(file: &Path) -> Result<()> {
    // What cannot be read is the loader's to say.
    let Ok(bytes) = std::fs::read(file) else { return Ok(()) };
    if let Some(buffer) = gltf::external_files(file, &bytes).first() {
        let name = buffer.file_name().unwrap_or_default().to_string_lossy();
        return Err(Error::new(format!("the file keeps its geometry in another one, `{name}`"))
            .in_file(file)
            .help("export it as .glb, which holds everything in one file"));
    }
    // One that is there beside it is another's upload.
    let outside = |library: &&PathBuf| library.parent() != file.parent() || library.exists();
    if let Some(library) = mtl::libraries(file, &bytes).iter().find(outside) {
        return Err(Error::new(format!(
            "the material library {} is in another folder, or another file of this one",
            library.display()
        ))
        .in_file(file)
        .help("name it without a folder, or take the `mtllib` line out: materials are then opaque"));
    }
    Ok(())
}
