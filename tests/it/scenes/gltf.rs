//! glTF and GLB made by hand: modes, transforms, flags, buffers, and damage of every kind.

use super::{put, read, spec};
use base64::Engine;
use cullmark::error::Error;
use cullmark::math::DVec3;
use cullmark::scene::Scene;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// Bytes of a GLB from its JSON and binary chunk.
fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend_from_slice(&((28 + json.len() + bin.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json[..]), (b"BIN\0", bin)] {
        out.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        out.extend_from_slice(kind);
        out.extend_from_slice(chunk);
    }
    out
}

/// Four corners of a unit square (48 bytes), then u8, u16 and u32 indices of its
/// strip 0 1 3 2 (4 + 8 + 16 bytes), then a sparse replacement: index 3 -> (5, 5, 0).
fn square_bin() -> Vec<u8> {
    let mut bin: Vec<u8> = Vec::new();
    let corners = [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    corners.iter().flatten().for_each(|x| bin.extend(x.to_le_bytes()));
    bin.extend([0u8, 1, 3, 2]);
    [0u16, 1, 3, 2].iter().for_each(|i| bin.extend(i.to_le_bytes()));
    [0u32, 1, 3, 2].iter().for_each(|i| bin.extend(i.to_le_bytes()));
    bin.extend([2u8, 0, 0, 0]);
    [5f32, 5.0, 0.0].iter().for_each(|x| bin.extend(x.to_le_bytes()));
    bin
}

/// A document over [`square_bin`] whose nodes, meshes and materials the test states.
fn square(nodes: Value, meshes: Value, materials: Value) -> Value {
    let roots: Vec<usize> = match nodes.as_array().unwrap().iter().position(|n| n.get("children").is_some()) {
        Some(parent) => vec![parent],
        None => (0..nodes.as_array().unwrap().len()).collect(),
    };
    let view = |offset: u32, length: u32| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    let accessor = |view: u32, kind: u32, shape: &str| json!({ "bufferView": view, "componentType": kind, "count": 4, "type": shape });
    let mut sparse = accessor(0, 5126, "VEC3");
    sparse["sparse"] =
        json!({ "count": 1, "indices": { "bufferView": 4, "componentType": 5121 }, "values": { "bufferView": 5 } });
    let mut positions = accessor(0, 5126, "VEC3");
    for a in [&mut sparse, &mut positions] {
        a["min"] = json!([0, 0, 0]);
        a["max"] = json!([5, 5, 0]);
    }
    json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": roots }],
        "nodes": nodes, "meshes": meshes, "materials": materials,
        "buffers": [{ "byteLength": square_bin().len() }],
        "bufferViews": [view(0, 48), view(48, 4), view(52, 8), view(60, 16), view(76, 4), view(80, 12)],
        "accessors": [positions, accessor(1, 5121, "SCALAR"), accessor(2, 5123, "SCALAR"), accessor(3, 5125, "SCALAR"), sparse],
    })
}

fn primitive(indices: Option<u32>, mode: u32, material: Option<u32>) -> Value {
    let mut p = json!({ "attributes": { "POSITION": 0 }, "mode": mode });
    indices.inspect(|i| p["indices"] = json!(i));
    material.inspect(|m| p["material"] = json!(m));
    p
}

fn read_glb(json: &Value) -> Result<Scene, Error> {
    let folder = tempfile::tempdir().unwrap();
    read(&put(&folder, "a.glb", glb(json, &square_bin())))
}

#[test]
fn gltf_primitives_of_every_mode_and_index_type_become_triangles() {
    let (strip, fan, list) = (5, 6, 4);
    let primitives = json!([
        primitive(Some(1), strip, Some(0)),
        primitive(Some(2), strip, Some(1)),
        primitive(Some(3), strip, Some(2)),
        primitive(None, fan, None),
        primitive(None, list, None),
        primitive(Some(1), 0, None),
        primitive(Some(1), 1, None),
        primitive(Some(1), 2, None),
        primitive(Some(1), 3, None),
    ]);
    let materials = json!([{ "name": "card", "doubleSided": true }, { "name": "leaf", "alphaMode": "MASK" }, { "name": "glass", "alphaMode": "BLEND" }]);
    let s = read_glb(&square(json!([{ "mesh": 0 }]), json!([{ "primitives": primitives }]), materials)).unwrap();
    assert_eq!(s.len(), 9, "three strips and a fan of two, one list of one");
    assert!((0..9).all(|t| s.normal(t) == DVec3::Z), "all face up");
    assert_eq!(s.positions.len(), 4, "one accessor, one set of vertices");
    assert_eq!(s.two_sided, [true, true, false, false, false, false, false, false, false]);
    assert_eq!(s.occluder, [true, true, false, false, false, false, true, true, true]);
    assert_eq!(s.material_names, ["card", "leaf", "glass", "(none)"]);
    assert_eq!(s.material_id, [0, 0, 1, 1, 2, 2, 3, 3, 3]);
    assert_eq!(s.report.points_and_lines, 4 + 2 + 4 + 3, "points, lines, loop, strip");
}

#[test]
fn gltf_transforms_compose_in_file_order_and_mirrors_flip_the_winding() {
    let nodes = json!([
        { "mesh": 0, "translation": [0, 0, 10] },
        { "mesh": 0, "scale": [-1, 1, 1] },
        { "scale": [2, 2, 2], "translation": [100, 0, 0], "children": [1, 0] },
    ]);
    let s = read_glb(&square(nodes, json!([{ "primitives": [primitive(None, 6, None)] }]), json!([]))).unwrap();
    assert_eq!(s.object_id, [0, 0, 1, 1], "one object for each placed mesh, children in order");
    assert!((0..4).all(|t| s.normal(t) == DVec3::Z * 4.0), "mirrored twice is not mirrored");
    assert_eq!(s.corners(0), [DVec3::new(100.0, 0.0, 0.0), DVec3::new(98.0, 2.0, 0.0), DVec3::new(98.0, 0.0, 0.0)]);
    assert_eq!(s.corners(2)[0], DVec3::new(100.0, 0.0, 20.0));
}

#[test]
fn sparse_values_replace_those_of_the_base() {
    let mut p = primitive(None, 6, None);
    p["attributes"]["POSITION"] = json!(4);
    let s = read_glb(&square(json!([{ "mesh": 0 }]), json!([{ "primitives": [p] }]), json!([]))).unwrap();
    assert_eq!(s.corners(0), [DVec3::ZERO, DVec3::X, DVec3::new(5.0, 5.0, 0.0)]);
}

#[test]
fn gltf_buffers_come_from_beside_the_file_or_from_a_data_uri() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = square(json!([{ "mesh": 0 }]), json!([{ "primitives": [primitive(None, 6, None)] }]), json!([]));
    let base64 = base64::engine::general_purpose::STANDARD.encode(square_bin());
    document["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{base64}"));
    let inline = read(&put(&folder, "inline.gltf", document.to_string())).unwrap();
    document["buffers"][0]["uri"] = json!("my%20data.bin");
    let path = put(&folder, "beside.gltf", document.to_string());
    let e = read(&path).unwrap_err();
    assert!(e.message.contains("my data.bin") && e.help.is_some(), "{e}");
    put(&folder, "my data.bin", square_bin());
    let beside = read(&path).unwrap();
    assert_eq!(inline.content_hash(), beside.content_hash());
    let before = spec(&path).unwrap().fingerprint;
    put(&folder, "my data.bin", [square_bin(), vec![1]].concat());
    assert_ne!(spec(&path).unwrap().fingerprint, before, "the buffer is part of the identity");
    put(&folder, "my data.bin", &square_bin()[..50]);
    assert!(read(&path).unwrap_err().message.contains("buffer 0 should have 92 bytes"));
    document["buffers"][0]["uri"] = json!("data:;base64,%%%");
    assert!(read(&put(&folder, "bad.gltf", document.to_string())).unwrap_err().message.contains("damaged data URI"));
    document["buffers"][0]["uri"] = json!("https://example.com/a.bin");
    assert!(read(&put(&folder, "far.gltf", document.to_string())).unwrap_err().message.contains("fetches nothing"));
}

#[test]
fn damaged_gltf_is_refused_with_the_place() {
    let good = || square(json!([{ "mesh": 0 }]), json!([{ "primitives": [primitive(Some(3), 5, None)] }]), json!([]));
    assert_eq!(read_glb(&good()).unwrap().len(), 2);
    let broken = |edit: &dyn Fn(&mut Value)| {
        let mut json = good();
        edit(&mut json);
        read_glb(&json).unwrap_err().to_string()
    };
    let cases: [(&dyn Fn(&mut Value), &str); 13] = [
        (&|j| j["accessors"][0]["count"] = json!(5), "accessor 0`: 5 values of 12 bytes reach beyond buffer view 0"),
        (&|j| j["accessors"][0]["count"] = json!(u64::MAX), "reach beyond buffer view 0"),
        (&|j| j["accessors"][0]["byteOffset"] = json!(u64::MAX), "reach beyond buffer view 0"),
        (&|j| j["bufferViews"][0]["byteOffset"] = json!(u64::MAX), "reach beyond buffer view 0"),
        (&|j| j["accessors"][0]["type"] = json!("VEC2"), "positions must be three floats"),
        (&|j| j["accessors"][3]["componentType"] = json!(5126), "indices must be whole numbers"),
        (&|j| j["bufferViews"][3]["byteOffset"] = json!(0), "is out of range: there are 4 vertices"),
        (&|j| j["nodes"][0]["mesh"] = json!(7), "not a valid glTF"),
        (&|j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(9), "in accessor 9, of 5"),
        (&|j| j["nodes"][0]["children"] = json!([0]), "has two parents or contains itself"),
        (&|j| j["buffers"][0]["byteLength"] = json!(4000), "buffer 0 should have 4000 bytes"),
        (&|j| j["scenes"] = json!([]), "glTF"),
        (&|j| j["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]), "gltf-transform copy"),
    ];
    for (edit, want) in cases {
        let e = broken(edit);
        assert!(e.contains(want) && e.contains("a.glb: "), "wanted {want}: {e}");
    }
    let mut harmless = good();
    harmless["extensionsRequired"] = json!(["KHR_texture_transform"]);
    assert!(read_glb(&harmless).is_ok(), "extensions of appearance do no harm");
    // Cut anywhere, a GLB is refused in words.
    let bytes = glb(&good(), &square_bin());
    let folder = tempfile::tempdir().unwrap();
    for length in 4..bytes.len() {
        let e = read(&put(&folder, "cut.glb", &bytes[..length])).unwrap_err();
        assert!(e.message.contains("bytes, but") && e.help.as_deref().unwrap().contains("cut short"), "{length}: {e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn mutated_glb_never_panics(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        number in (any::<prop::sample::Index>(), prop::sample::select(vec!["0", "-1", "9", "4294967295", "18446744073709551615", "1e9", "null", "[]"])),
    ) {
        let mut json = square(json!([{ "mesh": 0 }, { "mesh": 1, "rotation": [0, 0, 0, 1] }, { "children": [0, 1] }]),
            json!([{ "primitives": [primitive(Some(3), 5, Some(0))] }, { "primitives": [primitive(None, 4, None)] }]),
            json!([{ "name": "m", "doubleSided": true }])).to_string();
        // One digit becomes another value: most such files parse, and are wrong inside.
        let digits: Vec<usize> = json.char_indices().filter(|(_, c)| c.is_ascii_digit()).map(|(i, _)| i).collect();
        let at = digits[number.0.index(digits.len())];
        json.replace_range(at..at + 1, number.1);
        if let Ok(json) = serde_json::from_str(&json) {
            let mut bytes = glb(&json, &square_bin());
            let _ = cullmark::scene::gltf::read(Path::new("a.glb"), &bytes);
            for (at, byte) in edits {
                let i = at.index(bytes.len());
                bytes[i] = byte;
            }
            let _ = cullmark::scene::gltf::read(Path::new("a.glb"), &bytes);
        }
    }
}
