//! Scenes to files, small: OBJ (f64 as text, exact) and GLB (f32 offsets from the
//! scene's origin). Both are written y up in metres, as both formats expect, so
//! that they load again with the default options.

use super::Scene;
use super::placement::direction_to_file;
use crate::error::{Error, Result};
use crate::math::DVec3;
use crate::record::Up;
use serde_json::json;
use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;

/// Writes by the extension: `.obj` or `.glb`. Returns what the format could not hold, as sentences.
///
/// # Errors
/// Another extension, or a file that cannot be written.
pub fn write(path: &Path, scene: &Scene) -> Result<Vec<String>> {
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let (bytes, notes) = match extension.as_deref() {
        Some("obj") => obj(scene),
        Some("glb") => glb(scene)?,
        _ => {
            return Err(Error::new("cannot tell the format from the name")
                .in_file(path)
                .help("end it in .obj or .glb"));
        }
    };
    std::fs::write(path, bytes).map_err(|e| Error::io(path, "cannot write the scene", &e))?;
    Ok(notes)
}

/// OBJ text: shortest decimals that read back to the same bits.
pub fn obj(scene: &Scene) -> (Vec<u8>, Vec<String>) {
    let mut text = String::with_capacity(scene.positions.len() * 40 + scene.len() * 24);
    let _ = writeln!(text, "# {}: metres, y up, written by cullmark", scene.name.replace(['\n', '\r'], " "));
    for p in &scene.positions {
        let q = direction_to_file(Up::Y, *p);
        let _ = writeln!(text, "v {} {} {}", q.x, q.y, q.z);
    }
    let (mut object, mut material) = (None, None);
    for (i, [a, b, c]) in scene.triangles.iter().enumerate() {
        if object.replace(scene.object_id[i]) != Some(scene.object_id[i]) {
            let _ = writeln!(text, "o object_{}", scene.object_id[i]);
        }
        if material.replace(scene.material_id[i]) != Some(scene.material_id[i]) {
            let _ = writeln!(text, "usemtl {}", material_name(scene, scene.material_id[i]));
        }
        // 64 bits: the last vertex may be number 2^32.
        let _ = writeln!(text, "f {} {} {}", u64::from(*a) + 1, u64::from(*b) + 1, u64::from(*c) + 1);
    }
    let lost = scene.two_sided.iter().zip(&scene.occluder).filter(|(two, occludes)| **two || !**occludes).count();
    let note =
        format!("OBJ has no double-sided or alpha flags: {lost} triangles lost theirs (write .glb to keep them)");
    (text.into_bytes(), if lost > 0 { vec![note] } else { Vec::new() })
}

fn material_name(scene: &Scene, id: u32) -> String {
    let name = scene.material_names.get(id as usize).map_or("", |n| n.trim());
    // A line break would end the statement; a nameless material is none.
    if name.is_empty() { format!("material_{id}") } else { name.replace(['\n', '\r'], " ") }
}

/// Triangles of one primitive: consecutive ones that share object, material and flags.
struct Run {
    first: usize,
    end: usize,
    object: u32,
    look: (u32, bool, bool),
}

fn runs(scene: &Scene) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for i in 0..scene.len() {
        let (object, look) = (scene.object_id[i], (scene.material_id[i], scene.two_sided[i], scene.occluder[i]));
        match runs.last_mut() {
            Some(r) if (r.object, r.look) == (object, look) => r.end = i + 1,
            _ => runs.push(Run { first: i, end: i + 1, object, look }),
        }
    }
    runs
}

/// GLB: a node and mesh for each consecutive object, a primitive for each material
/// in it. Triangle order is kept. Positions are f32 offsets from the origin, which
/// becomes the nodes' translation.
///
/// # Errors
/// More than 4 GiB, which GLB cannot hold.
pub fn glb(scene: &Scene) -> Result<(Vec<u8>, Vec<String>)> {
    let origin = direction_to_file(Up::Y, scene.origin).as_vec3();
    let mut bin: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    let (mut meshes, mut nodes): (Vec<Vec<serde_json::Value>>, Vec<_>) = (Vec::new(), Vec::new());
    let mut material_of = HashMap::new();
    let (mut last_object, mut worst_m) = (None, 0.0f64);
    for run in runs(scene) {
        if last_object.replace(run.object) != Some(run.object) {
            let translation = origin.to_array();
            nodes.push(
                json!({ "mesh": meshes.len(), "name": format!("object_{}", run.object), "translation": translation }),
            );
            meshes.push(Vec::new());
        }
        let material = *material_of.entry(run.look).or_insert_with(|| {
            let (id, two_sided, occluder) = run.look;
            materials.push(json!({
                "name": material_name(scene, id),
                "doubleSided": two_sided,
                "alphaMode": if occluder { "OPAQUE" } else { "BLEND" },
            }));
            materials.len() - 1
        });
        // Vertices of this primitive alone, in order of use.
        let mut local: HashMap<u32, u32> = HashMap::new();
        let mut points: Vec<[f32; 3]> = Vec::new();
        let mut indices: Vec<u8> = Vec::with_capacity((run.end - run.first) * 12);
        for v in scene.triangles[run.first..run.end].iter().flatten() {
            let index = *local.entry(*v).or_insert_with(|| {
                let exact = direction_to_file(Up::Y, scene.positions[*v as usize]) - origin.as_dvec3();
                let rounded = exact.as_vec3();
                worst_m = worst_m.max((rounded.as_dvec3() - exact).abs().max_element());
                points.push(rounded.to_array());
                points.len() as u32 - 1
            });
            indices.extend_from_slice(&index.to_le_bytes());
        }
        let bound = |pick: fn(f32, f32) -> f32| {
            points.iter().fold(points[0], |m, p| [pick(m[0], p[0]), pick(m[1], p[1]), pick(m[2], p[2])])
        };
        let (lo, hi) = (bound(f32::min), bound(f32::max));
        let vertices: Vec<u8> = points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let count = indices.len() / 4;
        for (target, bytes) in [(34962, &vertices), (34963, &indices)] {
            views.push(json!({ "buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len(), "target": target }));
            bin.extend_from_slice(bytes);
        }
        let view = views.len();
        accessors.push(json!({ "bufferView": view - 2, "componentType": 5126, "count": points.len(), "type": "VEC3", "min": lo, "max": hi }));
        accessors.push(json!({ "bufferView": view - 1, "componentType": 5125, "count": count, "type": "SCALAR" }));
        let n = accessors.len();
        let primitive = json!({ "attributes": { "POSITION": n - 2 }, "indices": n - 1, "material": material });
        meshes.last_mut().expect("the first run opened one").push(primitive);
    }
    let meshes: Vec<_> = meshes.into_iter().map(|primitives| json!({ "primitives": primitives })).collect();
    let document = json!({
        "asset": { "version": "2.0", "generator": concat!("cullmark ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes, "meshes": meshes, "materials": materials,
        "buffers": [{ "byteLength": bin.len() }],
        "bufferViews": views, "accessors": accessors,
    });
    let note = format!("GLB holds 32-bit floats: coordinates moved by up to {worst_m:.3e} m");
    Ok((pack(document.to_string().into_bytes(), bin)?, if worst_m > 0.0 { vec![note] } else { Vec::new() }))
}

/// Header and the two chunks, padded to four bytes as the format asks.
fn pack(mut json: Vec<u8>, mut bin: Vec<u8>) -> Result<Vec<u8>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let length = 12 + 8 + json.len() + 8 + bin.len();
    let length = u32::try_from(length)
        .map_err(|_| Error::new("the scene needs more than 4 GiB, which GLB cannot hold").help("write .obj instead"))?;
    let mut out = Vec::with_capacity(length as usize);
    out.extend_from_slice(b"glTF");
    out.extend_from_slice(&2u32.to_le_bytes());
    out.extend_from_slice(&length.to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &bin)] {
        out.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        out.extend_from_slice(kind);
        out.extend_from_slice(chunk);
    }
    Ok(out)
}

/// Greatest distance between the corners of two scenes with as many triangles, in
/// order: what a conversion cost.
pub fn greatest_shift_m(a: &Scene, b: &Scene) -> Option<f64> {
    let far =
        |t: u32| a.corners(t).iter().zip(b.corners(t)).map(|(p, q): (&DVec3, DVec3)| p.distance(q)).fold(0.0, f64::max);
    (a.len() == b.len()).then(|| (0..a.len() as u32).map(far).fold(0.0, f64::max))
}
