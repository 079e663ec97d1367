//! Scenes from files and camera paths: what loads, what is refused and how, and
//! that what is written reads back.

mod gltf;
mod placement;

use crate::common::{shared, shared_scenes, soup};
use cullmark::error::Error;
use cullmark::math::{DVec3, Pose};
use cullmark::record::{PathSource, PathSpec, SceneSource, SceneSpec, Up, Winding};
use cullmark::scene::walkthrough::{self, csv};
use cullmark::scene::{Scene, cache, load, write};
use proptest::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn spec(path: &Path) -> Result<SceneSpec, Error> {
    load::describe("test", SceneSource::File(path.to_path_buf()), Winding::Ccw, Some(Up::Z), 1.0, false)
}

fn read(path: &Path) -> Result<Scene, Error> {
    load::load(&spec(path)?)
}

fn put(folder: &TempDir, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn obj(text: &str) -> Result<Scene, Error> {
    let folder = tempfile::tempdir().unwrap();
    read(&put(&folder, "a.obj", text))
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn obj_polygons_objects_and_materials_come_in_file_order() {
    let text = format!(
        "# first\nmtllib gone.mtl\n{SQUARE}v 0 0 1\nvt 0 0\nvn 0 0 1\no wall\nusemtl brick\nf 1/1/1 2/1/1 3/1/1 4/1/1\n\
         g sill\nf -5 -4 \\\n -1\nl 1 2 3\np 1\nusemtl paint\nf 1//1 3//1 5//1\n"
    );
    let s = obj(&text).unwrap();
    assert_eq!(s.len(), 4);
    assert_eq!(s.source_triangle_id, [0, 1, 2, 3]);
    assert_eq!(s.object_id, [0, 0, 1, 1]);
    assert_eq!(s.material_id, [0, 0, 0, 1]);
    assert_eq!(s.material_names, ["brick", "paint"], "names survive a missing library");
    assert_eq!(s.positions.len(), 5, "vertices are shared across objects");
    assert_eq!(s.corners(2), [DVec3::ZERO, DVec3::X, DVec3::Z], "negative indices and joined lines");
    assert_eq!(s.report.points_and_lines, 2, "a polyline is not a face");
    assert!(s.report.warnings.iter().any(|w| w.contains("gone.mtl") && w.starts_with("line 2")), "{:?}", s.report);
}

#[test]
fn obj_see_through_materials_do_not_occlude() {
    let folder = tempfile::tempdir().unwrap();
    put(&folder, "my lib.mtl", "newmtl glass\nd 0.3\nnewmtl wall\nKd 1 1\n");
    let text = format!("mtllib my lib.mtl\n{SQUARE}usemtl glass\nf 1 2 3\nusemtl wall\nf 1 3 4\n");
    let path = put(&folder, "a.obj", text);
    let before = spec(&path).unwrap();
    let s = load::load(&before).unwrap();
    assert_eq!(s.occluder, [false, true]);
    assert!(s.report.warnings.is_empty(), "{:?}", s.report.warnings);
    put(&folder, "my lib.mtl", "newmtl glass\nd 1\nnewmtl wall\n");
    assert_ne!(spec(&path).unwrap().fingerprint, before.fingerprint, "the library is part of the identity");
}

#[test]
fn concave_polygons_are_fanned_from_a_corner_that_covers_them() {
    // An arrowhead whose notch is corner 2: fans from 1 or 3 would fold over.
    let s = obj("v 2 0 0\nv 0 1 0\nv 0.5 0 0\nv 0 -1 0\nf 2 3 4 1\n").unwrap();
    let area: f64 = (0..2).map(|t| s.normal(t).z / 2.0).sum();
    assert!((0..2).all(|t| s.normal(t).z > 0.0), "no triangle is folded over");
    assert!((area - 1.5).abs() < 1e-12, "{area}");
}

#[test]
fn obj_mistakes_name_the_line() {
    let cases = [
        (format!("{SQUARE}f 1 2 9\n"), ":5: vertex 9 does not exist: the file has 4"),
        (format!("{SQUARE}f 1 0 2\n"), ":5: vertex 0 does not exist"),
        (format!("v 0 0 0\nf -2 -1 -1\n{SQUARE}"), ":2: vertex -2 does not exist"),
        (format!("{SQUARE}# fine\nf 1 2 x\n"), ":6: `x` is not a corner"),
        (format!("{SQUARE}f 1 2 3/1/1/1\n"), ":5: `3/1/1/1` is not a corner"),
        (format!("{SQUARE}f 1 2 99999999999999999999\n"), ":5: `99999999999999999999` is not a corner"),
        (format!("{SQUARE}f 1 2 -9223372036854775808\n"), ":5: vertex -9223372036854775808 does not exist"),
        ("v 0 0 0\nv 1 zero 0\nf 1 2 1\n".to_string(), ":2: `zero` is not a number"),
        ("v 0 0 0\nv 1 0".to_string(), ":2: a vertex needs three coordinates, but has 2"),
        ("v 0 0 0 0\nf 1 1 1\n".to_string(), ":1: the vertex has weight 0"),
        (format!("{SQUARE}f 1 2 3\nf 1 3"), ":6: a face with fewer than three corners ends the file"),
    ];
    for (text, want) in cases {
        let e = obj(&text).unwrap_err();
        assert!(e.to_string().contains(&format!("a.obj{want}")), "{text:?}: {e}");
        assert!(e.help.is_some(), "{e}");
    }
    let cut = obj(&format!("{SQUARE}f 1 2 3\nf 1 3 4")).unwrap();
    assert!(cut.report.warnings[0].contains("line 6"), "{:?}", cut.report.warnings);
}

#[test]
fn bad_faces_are_dropped_counted_and_reported() {
    let s = obj(&format!("{SQUARE}v nan 0 0\nv 0 inf 0\nv 1e13 0 0\nf 1 2 5\nf 1 2 6\nf 1 2 7\nf 1 2 2\nf 1 2 3\n"))
        .unwrap();
    let r = &s.report;
    assert_eq!((r.dropped_non_finite, r.dropped_out_of_range, r.dropped_degenerate), (2, 1, 1));
    assert_eq!((s.source_triangle_id.as_slice(), s.source_triangle_count, s.len()), (&[4][..], 5, 1));
    assert!(r.warnings[0].contains("dropped faces: 2 with NaN"), "{:?}", r.warnings);
    let e = obj("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap_err();
    assert!(e.to_string().contains("none of the 1 triangles is usable"), "{e}");
    let e = obj("# nothing\n").unwrap_err();
    assert!(e.to_string().contains("the scene has no triangles"), "{e}");
}

#[test]
fn files_that_are_not_scenes_are_refused_with_a_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (folder.path().join("absent.obj"), "cannot read the scene"),
        (folder.path().to_path_buf(), "is a folder"),
        (put(&folder, "empty.glb", ""), "the file is empty"),
        (put(&folder, "scene.fbx", "FBX"), "its name ends in none of .obj, .gltf, .glb"),
        (put(&folder, "scene.glb", "not one"), "does not begin with `glTF`"),
    ];
    for (path, want) in cases {
        let e = read(&path).unwrap_err();
        assert!(e.message.contains(want) && e.help.is_some() && e.file.as_deref() == Some(&path), "{e}");
    }
    let mut s = spec(&put(&folder, "a.obj", format!("{SQUARE}f 1 2 3\n"))).unwrap();
    s.scale = -1.0;
    assert_eq!(load::load(&s).unwrap_err().key.as_deref(), Some("scale"));
    let e = load::fingerprint(
        &SceneSource::Generated(cullmark::registry::Spec::new("aren")),
        Winding::Ccw,
        Up::Z,
        1.0,
        false,
    );
    assert!(e.unwrap_err().message.contains("unknown generator `aren`"));
}

#[test]
fn up_scale_winding_and_weld_do_what_they_say_to_mesh_and_path() {
    let folder = tempfile::tempdir().unwrap();
    let path = put(&folder, "a.obj", "v 0 0 0\nv 2 0 0\nv 0 4 0\nv 0 4 0\nv 2 0 0\nv 0 0 6\nf 1 2 3\nf 4 5 6\n");
    let make =
        |winding, up, scale, weld| load::describe("t", SceneSource::File(path.clone()), winding, Some(up), scale, weld);
    let y = make(Winding::Cw, Up::Y, 0.5, true).unwrap();
    let s = load::load(&y).unwrap();
    assert_eq!(s.positions, [DVec3::ZERO, DVec3::X, DVec3::Z * 2.0, DVec3::Y * -3.0]);
    assert_eq!(s.triangles, [[0, 2, 1], [2, 3, 1]], "cw is turned into ccw");
    assert_eq!((s.report.vertices_welded, s.origin), (2, DVec3::new(1.0, -2.0, 1.0)));
    let plain = load::load(&make(Winding::TwoSided, Up::Z, 1.0, false).unwrap()).unwrap();
    assert_eq!((plain.positions.len(), plain.report.vertices_welded), (6, 0));
    assert_eq!((plain.two_sided, plain.report.front_hit_share), (vec![true; 2], None));

    let csv = put(&folder, "p.csv", "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n0,2,4,6,0,0,1,0,1,0\n5,0,0,0,1,0,0,0,1,0\n");
    let pose = walkthrough::load(&path_spec(&csv, &y, None, 1), &y, &s).unwrap()[0];
    assert_eq!(pose, Pose { eye: DVec3::new(1.0, -3.0, 2.0), forward: -DVec3::Y, up: DVec3::Z });
    let prints: Vec<String> = [
        (Winding::Ccw, Up::Y, 1.0, false),
        (Winding::Cw, Up::Y, 1.0, false),
        (Winding::Ccw, Up::Z, 1.0, false),
        (Winding::Ccw, Up::Y, 2.0, false),
        (Winding::Ccw, Up::Y, 1.0, true),
    ]
    .map(|(w, u, s, d)| make(w, u, s, d).unwrap().fingerprint)
    .into();
    assert!((1..5).all(|i| !prints[..i].contains(&prints[i])), "every option is part of the identity");
}

fn path_spec(csv: &Path, scene: &SceneSpec, frames: Option<u32>, stride: u32) -> PathSpec {
    let source = PathSource::File(csv.to_path_buf());
    let fingerprint = walkthrough::fingerprint(&source, &scene.fingerprint).unwrap();
    PathSpec { name: "p".to_string(), source, frames, stride, fingerprint }
}

#[test]
fn frames_come_before_stride_and_none_left_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let scene_spec = spec(&put(&folder, "a.obj", format!("{SQUARE}f 1 2 3\n"))).unwrap();
    let scene = load::load(&scene_spec).unwrap();
    let frame =
        |n: u64| csv::Frame { number: n, pose: Pose { eye: DVec3::X * n as f64, forward: DVec3::Y, up: DVec3::Z } };
    let file = folder.path().join("p.csv");
    csv::write(&file, &(0..10).map(frame).collect::<Vec<_>>()).unwrap();
    let eyes = |frames, stride| {
        let poses = walkthrough::load_cached(
            &path_spec(&file, &scene_spec, frames, stride),
            &scene_spec,
            &scene,
            folder.path(),
        );
        poses.map(|p| p.iter().map(|p| p.eye.x).collect::<Vec<_>>())
    };
    assert_eq!(eyes(None, 1).unwrap().len(), 10);
    assert_eq!(eyes(Some(7), 3).unwrap(), [0.0, 3.0, 6.0]);
    assert_eq!(eyes(Some(0), 1).unwrap_err().key.as_deref(), Some("frames"));
    assert_eq!(eyes(None, 0).unwrap_err().key.as_deref(), Some("stride"));
    let planned = path_spec(&file, &scene_spec, None, 1);
    csv::write(&file, &[frame(0)]).unwrap();
    let e = walkthrough::load_cached(&planned, &scene_spec, &scene, folder.path()).unwrap_err();
    assert!(e.message.contains("not what it was"), "{e}");
    put(&folder, "p.csv", "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n");
    let e = walkthrough::load(&planned, &scene_spec, &scene).unwrap_err();
    assert!(e.to_string().contains("p.csv:1: the camera path has a header but no frames"), "{e}");
}

#[test]
fn scenes_written_as_obj_and_glb_read_back_to_the_same_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = soup(7, 500, 30.0, 2.0);
    scene.positions.iter_mut().for_each(|p| *p += DVec3::new(1e5, -3e4, 77.0));
    scene.object_id = (0..500).map(|t| t / 40).collect();
    scene.two_sided = (0..500).map(|t| t % 3 == 0).collect();
    scene.occluder = (0..500).map(|t| t % 3 != 1).collect();
    scene.anchor();
    let open = |name: &str| {
        let path = folder.path().join(name);
        let notes = write::write(&path, &scene).unwrap();
        let spec = load::describe("back", SceneSource::File(path), Winding::Ccw, None, 1.0, false).unwrap();
        (load::load(&spec).unwrap(), notes)
    };
    let (obj, notes) = open("a.obj");
    assert_eq!(write::greatest_shift_m(&scene, &obj), Some(0.0), "text keeps every bit");
    assert_eq!((obj.object_id.clone(), obj.origin), (scene.object_id.clone(), scene.origin));
    assert_eq!(obj.material_names, scene.material_names);
    assert!(notes[0].contains("lost theirs"), "{notes:?}");
    let (glb, notes) = open("a.glb");
    assert_eq!(glb.object_id, scene.object_id);
    assert_eq!((glb.two_sided.clone(), glb.occluder.clone()), (scene.two_sided.clone(), scene.occluder.clone()));
    let name = |s: &Scene, t: usize| s.material_names[s.material_id[t] as usize].clone();
    assert!((0..500).all(|t| name(&glb, t) == name(&scene, t)));
    let shift = write::greatest_shift_m(&scene, &glb).unwrap();
    assert!(shift > 0.0 && shift < 1e-5, "offsets from the origin keep f32 fine: {shift}");
    assert!(notes[0].contains("32-bit floats"), "{notes:?}");
    let e = write::write(&folder.path().join("a.ply"), &scene).unwrap_err();
    assert!(e.help.unwrap().contains(".obj or .glb"));
}

#[test]
fn the_cache_gives_the_same_scene_and_survives_damage() {
    let folder = tempfile::tempdir().unwrap();
    let path = put(&folder, "a.obj", format!("{SQUARE}v nan 0 0\nf 1 2 3\nf 1 2 5\nf 1 3 4\n"));
    let spec = spec(&path).unwrap();
    let fresh = load::load_cached(&spec, folder.path()).unwrap();
    let file = cache::scene_file(folder.path(), &spec.fingerprint);
    assert!(file.exists());
    assert_eq!(fresh, load::load(&spec).unwrap());
    let good = std::fs::read(&file).unwrap();
    assert_eq!(load::load_cached(&spec, folder.path()).unwrap(), fresh);
    for damage in
        [vec![], b"old".to_vec(), good[..good.len() - 1].to_vec(), [&good[..60], &[good[60] ^ 1], &good[61..]].concat()]
    {
        std::fs::write(&file, damage).unwrap();
        assert!(cache::fetch_scene(&file).is_none());
        assert_eq!(load::load_cached(&spec, folder.path()).unwrap(), fresh);
        assert_eq!(std::fs::read(&file).unwrap(), good, "written anew");
    }
    // The cache answers for the file as it was when planned; without it, a changed file is an error.
    put(&folder, "a.obj", format!("{SQUARE}f 1 2 3\n"));
    assert_eq!(load::load_cached(&spec, folder.path()).unwrap(), fresh);
    std::fs::remove_file(&file).unwrap();
    assert!(load::load_cached(&spec, folder.path()).unwrap_err().message.contains("not what it was"));
    let left = std::fs::read_dir(folder.path().join("scenes")).unwrap().count();
    assert_eq!(left, 0, "no temporary files stay behind");
    let elsewhere = put(&folder, "a file", "");
    put(&folder, "a.obj", format!("{SQUARE}v nan 0 0\nf 1 2 3\nf 1 2 5\nf 1 3 4\n"));
    assert_eq!(load::load_cached(&spec, &elsewhere).unwrap(), fresh, "a cache that cannot be written costs only time");
}

#[test]
fn the_content_hash_of_a_scene_is_the_same_everywhere() {
    let s = obj(&format!("{SQUARE}usemtl a\nf 1 2 3 4\n")).unwrap();
    // Stored with results: change it only together with a revision.
    assert_eq!(&s.content_hash()[..16], "df4c3e7aa1327d9f");
}

#[test]
fn shared_scenes_load_as_their_manifest_states() {
    let Some(root) = shared_scenes() else { return };
    let manifest: Value = serde_json::from_slice(&std::fs::read(root.join("MANIFEST.json")).unwrap()).unwrap();
    let small = ["bunny", "q3_accident", "q3_czest3ctf", "aws_small_house", "mc_little_china", "sponza"];
    for stated in manifest["scenes"].as_array().unwrap() {
        let id = stated["id"].as_str().unwrap();
        // The large ones take the dev profile too long: `--release` reads them all.
        let Some(mesh) = stated["mesh"].as_str().filter(|_| small.contains(&id) || !cfg!(debug_assertions)) else {
            continue;
        };
        let up = if stated["up"] == "y" { Up::Y } else { Up::Z };
        let path = shared(&format!("{id}/{mesh}")).unwrap();
        let spec = load::describe(id, SceneSource::File(path), Winding::Ccw, Some(up), 1.0, false).unwrap();
        let s = load::load(&spec).unwrap();
        assert_eq!(s.len() as u64, stated["triangles"].as_u64().unwrap(), "{id}");
        assert_eq!(s.report.dropped(), 0, "{id}: {:?}", s.report);
        let corner = |i: usize| {
            let c = |a: usize| stated["aabb"][i][a].as_f64().unwrap();
            let p = DVec3::new(c(0), c(1), c(2));
            if up == Up::Y { DVec3::new(p.x, -p.z, p.y) } else { p }
        };
        let (b, size) = (s.bounds(), s.bounds().size().length());
        let (lo, hi) = (corner(0).min(corner(1)), corner(0).max(corner(1)));
        assert!(b.lo.distance(lo) + b.hi.distance(hi) < 1e-6 * size, "{id}: {b:?}, stated {lo} to {hi}");
        assert!(!s.report.warnings.iter().any(|w| w.contains("winding")), "{id}: {:?}", s.report);
        let csv = shared(&format!("{id}/{id}_path1.csv")).unwrap();
        let poses = walkthrough::load(&path_spec(&csv, &spec, None, 1), &spec, &s).unwrap();
        let stated_frames = stated["paths"][0]["frames"].as_u64();
        assert!(stated_frames.is_none_or(|f| f == poses.len() as u64), "{id}");
        let eyes: Vec<DVec3> = poses.iter().map(|p| p.eye).collect();
        let share = cullmark::scene::winding::probe_from(&s, &eyes).share().unwrap();
        assert!(share > 0.9, "{id}: the manifest of the scenes says 0.946 or more, the probe {share}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn mutated_obj_and_random_bytes_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in any::<prop::sample::Index>(),
        noise in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let mut bytes = format!("mtllib a b.mtl\n{SQUARE}v 1 2 3 1\nv 1 2 3 1 1 1\no a\nf 1/1 2/1 3/1 4/1 -1/1\nusemtl m\nf 1 2 \\\n3\nl 1 2 3\nf -3 -2 -1\n").into_bytes();
        for (at, byte) in edits {
            let i = at.index(bytes.len());
            bytes[i] = byte;
        }
        let _ = cullmark::scene::obj::read(Path::new("a.obj"), &bytes);
        let _ = cullmark::scene::obj::read(Path::new("a.obj"), &bytes[..cut.index(bytes.len())]);
        let _ = cullmark::scene::obj::read(Path::new("a.obj"), &noise);
        let _ = cullmark::scene::gltf::read(Path::new("a.glb"), &noise);
        let _ = csv::parse(&String::from_utf8_lossy(&noise));
    }
}
