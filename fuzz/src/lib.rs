//! What one execution does, for each format that cullmark reads: read the bytes,
//! and if they are accepted, check what must hold of anything that was.
//!
//! The libFuzzer targets call these without end; the ordinary tests call them on
//! the seeds and on some thousand mutations of them.

use cullmark::error::Error;
use cullmark::manifest::Manifest;
use cullmark::matrix::{Setting, expand};
use cullmark::record::{SceneSource, SceneSpec, Up, Winding};
use cullmark::scene::walkthrough::csv as path_csv;
use cullmark::scene::{Scene, gltf, load, mtl};
use std::path::Path;

/// Nothing lies beside this file.
const FOLDER: &str = "/nonexistent/cullmark-fuzz";

/// A Wavefront OBJ, from the text to a scene ready for use.
pub fn obj(data: &[u8]) {
    let path = Path::new(FOLDER).join("a.obj");
    mtl::libraries(&path, data);
    mtl::parse(data);
    scene(&path, data);
}

/// A glTF text; or a GLB; or, so that mutations need not keep three lengths
/// right, JSON and binary chunk with a zero byte between them.
pub fn glb(data: &[u8]) {
    let path = Path::new(FOLDER).join("a.gltf");
    gltf::external_files(&path, data);
    match data.iter().position(|b| *b == 0).filter(|_| data.starts_with(b"{")) {
        Some(zero) => scene(&path, &packed(&data[..zero], &data[zero + 1..])),
        None => scene(&path, data),
    }
}

/// A GLB around `json` and `bin`.
pub fn packed(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend_from_slice(&((28 + json.len() + bin.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", bin)] {
        out.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        out.extend_from_slice(kind);
        out.extend_from_slice(chunk);
    }
    out
}

/// A camera path.
pub fn csv(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    match path_csv::parse(&text) {
        Err(e) => printable(&e),
        Ok(frames) => {
            for f in &frames {
                assert!(f.pose.eye.is_finite());
                // Loading makes a view of every pose, which refuses parallel directions.
                cullmark::math::View::new(&Default::default(), &f.pose);
            }
            let again = path_csv::parse(&path_csv::format(&frames)).expect("what was written can be read");
            assert_eq!(again, frames, "and is the same to the last bit");
        }
    }
}

/// A manifest, from the text to its runs.
pub fn toml(data: &[u8]) {
    let path = Path::new(FOLDER).join("a.toml");
    let Ok(text) = std::str::from_utf8(data) else { return };
    let manifest = match Manifest::parse(text.to_string(), &path, &[]) {
        Ok(manifest) => manifest,
        Err(errors) => {
            assert!(!errors.is_empty());
            return errors.iter().for_each(printable);
        }
    };
    assert_eq!(manifest.source_text, text);
    let cells = manifest.axes.iter().map(|a| a.values.len() as u64).fold(1, u64::saturating_mul);
    // A million cells are allowed and take a second: here they would only cost executions.
    if cells.saturating_mul(manifest.scenes.len() as u64) > 500 {
        return;
    }
    match expand(&manifest, &Setting::default()) {
        Ok(matrix) => {
            let mut ids: Vec<String> = matrix.runs.iter().map(|r| r.measurement_id("any")).collect();
            ids.sort();
            assert!(ids.windows(2).all(|w| w[0] != w[1]), "two runs have one id");
        }
        Err(errors) => errors.iter().for_each(printable),
    }
}

fn scene(path: &Path, data: &[u8]) {
    // Options follow from the length, so that all of them are tried on everything.
    let n = data.len();
    let spec = SceneSpec {
        winding: [Winding::Ccw, Winding::Cw, Winding::TwoSided][n % 3],
        up: if n.is_multiple_of(2) { Up::Y } else { Up::Z },
        scale: [1.0, 0.01, 1e6][n / 2 % 3],
        weld: n % 4 < 2,
        ..plain(path)
    };
    match load::load_bytes(&spec, path, data) {
        Ok(scene) => sound(&scene),
        Err(e) => printable(&e),
    }
}

fn plain(path: &Path) -> SceneSpec {
    SceneSpec {
        name: "fuzz".to_string(),
        source: SceneSource::File(path.to_path_buf()),
        winding: Winding::Ccw,
        up: Up::Z,
        scale: 1.0,
        offset_m: [0.0; 3],
        weld: false,
        fingerprint: String::new(),
    }
}

/// What every structure and test takes for granted.
fn sound(scene: &Scene) {
    let n = scene.len();
    assert!(n > 0 && scene.origin.is_finite());
    assert!(scene.positions.iter().all(|p| p.is_finite()));
    let per_triangle = [
        scene.source_triangle_id.len(),
        scene.object_id.len(),
        scene.material_id.len(),
        scene.two_sided.len(),
        scene.occluder.len(),
    ];
    assert_eq!(per_triangle, [n; 5]);
    assert!(scene.triangles.iter().flatten().all(|v| (*v as usize) < scene.positions.len()));
    assert!(scene.source_triangle_id.windows(2).all(|w| w[0] < w[1]));
    assert!(*scene.source_triangle_id.last().unwrap() < scene.source_triangle_count);
    assert_eq!(u64::from(scene.source_triangle_count), scene.report.triangles_in_file);
    assert_eq!(n as u64 + scene.report.dropped(), scene.report.triangles_in_file);
    assert!(scene.material_id.iter().all(|m| (*m as usize) < scene.material_names.len()));
    assert!((0..n as u32).all(|t| !scene.triangle_box(t).is_empty()));
    assert_eq!(scene.content_hash().len(), 64);
}

/// Errors are for people: making their text must not fail either.
fn printable(e: &Error) {
    assert!(!e.message.is_empty());
    let _ = e.to_string();
}
