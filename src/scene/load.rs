//! From a [`SceneSpec`] to a [`Scene`]: read or generate, place, sanitise, weld, probe.

use super::placement::Placement;
use super::{Scene, cache, generate, gltf, mtl, obj, sanitise, winding};
use crate::error::{Error, Result};
use crate::record::{SceneSource, SceneSpec, Up, Winding};
use crate::registry;
use std::path::Path;

/// Raised when the same bytes and options load to a different scene.
pub const REVISION: u32 = 1;

/// Identity of a source and its options: blake3 over the bytes of the file and of
/// what it refers to (buffers, material libraries), or over the generator's
/// resolved parameters and revision. Nothing is decoded.
///
/// # Errors
/// If the file cannot be read or the generator does not know a parameter.
pub fn fingerprint(source: &SceneSource, winding: Winding, up: Up, scale: f64, weld: bool) -> Result<String> {
    let mut h = blake3::Hasher::new();
    h.update(b"cullmark scene fingerprint");
    h.update(&REVISION.to_le_bytes());
    h.update(&[winding as u8, up as u8, u8::from(weld)]);
    h.update(&scale.to_bits().to_le_bytes());
    // Lengths go first, so that no two lists of parts run into the same bytes.
    let mut part = |bytes: &[u8]| {
        h.update(&(bytes.len() as u64).to_le_bytes());
        h.update(bytes);
    };
    match source {
        SceneSource::File(path) => {
            let bytes = read_file(path)?;
            let format = Format::of(path, &bytes)?;
            part(format.name().as_bytes());
            part(&bytes);
            let beside = match format {
                Format::Obj => mtl::libraries(path, &bytes),
                Format::Gltf => gltf::external_files(path, &bytes),
            };
            for file in beside {
                // A missing one is part of the identity too: it changes the scene or fails to load.
                part(read_beside(&file).as_deref().unwrap_or(b"missing"));
            }
        }
        SceneSource::Generated(spec) => {
            let (_, resolved) = generate::make(spec)?;
            let (entry, _) = registry::find("generator", generate::ALL, &resolved)?;
            part(resolved.to_string().as_bytes());
            part(&entry.revision.to_le_bytes());
            if scale != 1.0 {
                // Walks through it are made before it is scaled, which once was otherwise.
                part(b"placed after the walk");
            }
        }
    }
    Ok(h.finalize().to_hex()[..32].to_string())
}

/// The scene of `spec` moved to `offset_m`, with the fingerprint of that place.
pub fn moved(mut spec: SceneSpec, offset_m: [f64; 3]) -> SceneSpec {
    if offset_m != [0.0; 3] {
        let mut h = blake3::Hasher::new();
        h.update(b"cullmark scene moved");
        h.update(spec.fingerprint.as_bytes());
        for x in offset_m {
            h.update(&x.to_bits().to_le_bytes());
        }
        spec.fingerprint = h.finalize().to_hex()[..32].to_string();
        spec.offset_m = offset_m;
    }
    spec
}

/// The scene that walks are made in, and the placement that then takes scene and walk
/// to where `spec` wants them; `None` where that is the scene itself.
///
/// A moved scene is walked where it was, so that at every distance the walk is the
/// same. A scale says what a unit of a file is, and who walks has human size; a
/// generated scene is in metres already, so there the walk is scaled too.
///
/// # Errors
/// Those of [`fingerprint`].
pub fn unplaced(spec: &SceneSpec) -> Result<Option<(SceneSpec, Placement)>> {
    let placement = Placement::of(spec)?;
    let generated = matches!(spec.source, SceneSource::Generated(_));
    let scale = if generated { 1.0 } else { spec.scale };
    if spec.offset_m == [0.0; 3] && scale == spec.scale {
        return Ok(None);
    }
    let base = describe(&spec.name, spec.source.clone(), spec.winding, Some(spec.up), scale, spec.weld)?;
    Ok(Some((base, Placement { up: Up::Z, scale: spec.scale / scale, ..placement })))
}

/// A spec with its fingerprint. `up` defaults to y for files and z for generators.
///
/// # Errors
/// Those of [`fingerprint`].
pub fn describe(
    name: &str,
    source: SceneSource,
    winding: Winding,
    up: Option<Up>,
    scale: f64,
    weld: bool,
) -> Result<SceneSpec> {
    let up = up.unwrap_or(match source {
        SceneSource::File(_) => Up::Y,
        SceneSource::Generated(_) => Up::Z,
    });
    let fingerprint = fingerprint(&source, winding, up, scale, weld)?;
    let name = name.to_string();
    Ok(SceneSpec { name, source, winding, up, scale, weld, offset_m: [0.0; 3], fingerprint })
}

/// Reads or generates a scene: world metres, z up, sanitised, anchored, probed.
///
/// # Errors
/// Unreadable or malformed files, unknown generators, a scale that is not
/// positive, a scene without a usable triangle.
pub fn load(spec: &SceneSpec) -> Result<Scene> {
    let placement = Placement::of(spec)?;
    match &spec.source {
        SceneSource::File(path) => load_bytes(spec, path, &read_file(path)?),
        SceneSource::Generated(source) => {
            let mut scene = generate::make(source)?.0.generate();
            scene.source_triangle_count = scene.source_triangle_count.max(scene.len() as u32);
            scene.report.triangles_in_file = u64::from(scene.source_triangle_count);
            finish(spec, &placement, scene)
        }
    }
}

/// [`load`] of a file whose content is at hand; what it refers to lies beside `path`.
///
/// # Errors
/// Those of [`load`].
pub fn load_bytes(spec: &SceneSpec, path: &Path, bytes: &[u8]) -> Result<Scene> {
    let placement = Placement::of(spec)?;
    let scene = match Format::of(path, bytes)? {
        Format::Obj => obj::read(path, bytes)?,
        Format::Gltf => gltf::read(path, bytes)?,
    };
    finish(spec, &placement, scene).map_err(|e| e.in_file(path))
}

fn finish(spec: &SceneSpec, placement: &Placement, mut scene: Scene) -> Result<Scene> {
    scene.name = spec.name.clone();
    prepare(&mut scene, placement, spec.winding, spec.weld);
    if scene.is_empty() {
        let e = Error::new(match scene.report.triangles_in_file {
            0 => "the scene has no triangles".to_string(),
            n => format!("none of the {n} triangles is usable ({})", scene.report.warnings.join("; ")),
        });
        return Err(
            e.help("a scene needs faces with area and finite coordinates; `cullmark scene info` shows what is there")
        );
    }
    Ok(scene)
}

/// Like [`load`], through `cache_dir/scenes/<fingerprint>.bin`. Damaged or outdated
/// cache files are replaced, and a folder that cannot be written costs only time.
///
/// # Errors
/// Those of [`load`], and a source that changed since the fingerprint was taken.
pub fn load_cached(spec: &SceneSpec, cache_dir: &Path) -> Result<Scene> {
    let file = cache::scene_file(cache_dir, &spec.fingerprint);
    if let Some(mut scene) = cache::fetch_scene(&file) {
        scene.name = spec.name.clone(); // a label, not part of the identity
        return Ok(scene);
    }
    let now = describe(&spec.name, spec.source.clone(), spec.winding, Some(spec.up), spec.scale, spec.weld)?;
    if moved(now, spec.offset_m).fingerprint != spec.fingerprint {
        let mut e = Error::new(format!("scene `{}` is not what it was when the run was planned", spec.name));
        if let SceneSource::File(path) = &spec.source {
            e = e.in_file(path);
        }
        return Err(e.help("the file changed, or another version of cullmark planned it: start the study again"));
    }
    let scene = load(spec)?;
    cache::store_scene(&file, &scene);
    Ok(scene)
}

/// Everything between reading and use.
fn prepare(scene: &mut Scene, placement: &Placement, stated: Winding, weld: bool) {
    scene.positions.iter_mut().for_each(|p| *p = placement.point(*p));
    match stated {
        Winding::Ccw => {}
        Winding::Cw => scene.triangles.iter_mut().for_each(|t| t.swap(1, 2)),
        Winding::TwoSided => scene.two_sided.fill(true),
    }
    sanitise::sanitise(scene);
    if weld {
        sanitise::weld(scene);
    }
    scene.anchor();
    winding::check(scene, stated);
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Format {
    Obj,
    Gltf,
}

impl Format {
    fn of(path: &Path, bytes: &[u8]) -> Result<Format> {
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        match extension.as_deref() {
            _ if bytes.starts_with(b"glTF") => Ok(Format::Gltf),
            Some("obj") => Ok(Format::Obj),
            Some("gltf") => Ok(Format::Gltf),
            Some("glb") => Err(Error::new("not a GLB: it does not begin with `glTF`")
                .in_file(path)
                .help("the file is damaged, or of another kind under this name")),
            _ => Err(Error::new("not a scene file: its name ends in none of .obj, .gltf, .glb")
                .in_file(path)
                .help("convert it with a modelling program, or name a generator such as `arena:seed=1`")),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Format::Obj => "obj",
            Format::Gltf => "gltf",
        }
    }
}

/// What a scene file refers to. The name is the file's, not the user's, so devices
/// and pipes, which may never end, are refused.
pub(super) fn read_beside(path: &Path) -> std::io::Result<Vec<u8>> {
    if std::fs::metadata(path)?.is_file() {
        std::fs::read(path)
    } else {
        Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file"))
    }
}

fn read_file(path: &Path) -> Result<Vec<u8>> {
    if path.is_dir() {
        return Err(Error::new("is a folder, but a scene is a file")
            .in_file(path)
            .help("name the .obj, .gltf or .glb in it"));
    }
    let bytes = std::fs::read(path).map_err(|e| {
        let error = Error::io(path, "cannot read the scene", &e);
        match e.kind() {
            std::io::ErrorKind::NotFound => error.help("check the path; in a manifest it is relative to the manifest"),
            _ => error.help("check that you may read it"),
        }
    })?;
    if bytes.is_empty() {
        return Err(Error::new("the file is empty").in_file(path).help("copy or export it again"));
    }
    Ok(bytes)
}
