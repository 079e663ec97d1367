//! Tests: scenes that are hard on arithmetic, and random poses in them.

use super::{made, walked};
use cullmark::math::DVec3;
use cullmark::math::predicates::{Facing, facing};
use cullmark::record::{SceneSource, SceneSpec, Winding};
use cullmark::registry::Spec;
use cullmark::scene::{Scene, load};
use std::collections::{HashMap, HashSet};

/// Small ones of every kind.
const ALL: [&str; 7] = [
    "boxes:boxes=60",
    "coplanar:boxes=40",
    "degenerate:boxes=60,share=0.1",
    "grazing:fins=60",
    "slivers:slivers=60",
    "spheres:spheres=8",
    "walls:walls=30",
];

fn loaded(generate: &str, scale: f64) -> Scene {
    let source = SceneSource::Generated(Spec::parse(generate).unwrap());
    let spec: SceneSpec = load::describe("it", source, Winding::Ccw, None, scale, false).unwrap();
    load::load(&spec).unwrap()
}

/// If this fails, see `generated_scenes_are_the_same_bytes_as_ever`.
#[test]
fn stress_scenes_are_the_same_bytes_as_ever() {
    let pinned = [
        "bdba157988981fa9",
        "ae32f6ce6cbe8d08",
        "0215652f7091f285",
        "220dc825ce5633a5",
        "1dedb4562230dada",
        "cb2e62ac6cd3f12f",
        "547ef1db85f08d18",
    ];
    let found: Vec<String> = ALL.iter().map(|spec| made(spec).content_hash()[..16].to_string()).collect();
    assert_eq!(found, pinned, "raise the generator's `revision` and pin the new hashes");
}

/// Every edge of a face has exactly one counterpart, run through the other way.
fn open_edges(scene: &Scene) -> usize {
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for t in &scene.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    edges.values().filter(|n| **n != 0).count()
}

/// Six times the signed volume of each object: positive if its faces look outward.
fn volumes(scene: &Scene) -> Vec<f64> {
    let mut sums = vec![0.0; *scene.object_id.last().unwrap() as usize + 1];
    for t in 0..scene.len() as u32 {
        let [a, b, c] = scene.corners(t);
        // About a point of the object itself, or slivers far away lose their volume to rounding.
        let first = scene.object_id.partition_point(|o| *o < scene.object_id[t as usize]);
        let o = scene.corners(first as u32)[0];
        sums[scene.object_id[t as usize] as usize] += (a - o).dot((b - o).cross(c - o));
    }
    sums
}

#[test]
fn stress_solids_are_closed_and_face_outward() {
    for spec in ALL.iter().filter(|s| !s.starts_with("walls") && !s.starts_with("degenerate")) {
        let scene = made(spec);
        assert_eq!(open_edges(&scene), 0, "{spec}");
        let volumes = volumes(&scene);
        assert!(volumes.len() >= 8 && volumes.iter().all(|v| *v > 0.0), "{spec}: {volumes:?}");
        assert_eq!(scene.report.dropped(), 0, "{spec}: {:?}", scene.report.warnings);
    }
    for shape in ["needle", "prism", "seam"] {
        for aspect in ["1e2", "1e5", "1e8"] {
            let scene = made(&format!("slivers:slivers=20,shape={shape},aspect={aspect}"));
            assert_eq!(open_edges(&scene), 0, "{shape} {aspect}");
            assert!(volumes(&scene).iter().all(|v| *v > 0.0), "{shape} {aspect}: {:?}", volumes(&scene));
            assert_eq!(scene.report.dropped(), 0, "{shape} {aspect}");
        }
    }
}

#[test]
fn free_space_at_the_origin_is_free_and_the_rest_within_reach() {
    for spec in ALL.iter().filter(|s| !s.starts_with("degenerate")) {
        let scene = made(spec);
        let farthest = scene.positions.iter().map(|p| p.length()).fold(0.0, f64::max);
        // The posts that make the bounds of `grazing` symmetric stand outside.
        assert!(farthest < if spec.starts_with("grazing") { 110.0 } else { 60.01 }, "{spec}: {farthest}");
        let nearest = scene.positions.iter().map(|p| p.length()).fold(f64::INFINITY, f64::min);
        assert!(nearest > 7.99, "{spec}: {nearest}");
    }
}

#[test]
fn boxes_move_bit_by_bit_with_any_whole_offset() {
    // B5.2: what changes from offset to offset is arithmetic alone.
    for spec in ["boxes:boxes=60", "spheres:spheres=8", "walls:walls=30"] {
        let scene = made(spec);
        let mut far = scene.clone();
        let offset = DVec3::new(1e8, -1e8, 1e8);
        far.positions.iter_mut().for_each(|p| *p += offset);
        let back = far.positions.iter().zip(&scene.positions).all(|(f, p)| *f - offset == *p);
        assert!(back, "{spec}");
        let path = "random:frames=50,spread=0.2,aim=any";
        for (here, there) in walked(path, &scene).iter().zip(walked(path, &far)) {
            assert_eq!(here.eye + offset, there.eye, "{spec}");
            assert_eq!((here.forward, here.up), (there.forward, there.up), "{spec}");
        }
    }
}

#[test]
fn spheres_have_normals_in_all_directions_alike() {
    // C2.1 and C3.2 speak of isotropic normals: the second moments are a third each.
    let scene = made("spheres:spheres=60,level=2");
    let normals: Vec<DVec3> = (0..scene.len() as u32).map(|t| scene.normal(t).normalize()).collect();
    let n = normals.len() as f64;
    let mean = normals.iter().sum::<DVec3>() / n;
    assert!(mean.length() < 1e-3, "{mean}");
    let square = normals.iter().map(|v| *v * *v).sum::<DVec3>() / n;
    let mixed = normals.iter().map(|v| DVec3::new(v.x * v.y, v.y * v.z, v.z * v.x)).sum::<DVec3>() / n;
    assert!((square - 1.0 / 3.0).abs().max_element() < 0.005, "{square}");
    assert!(mixed.abs().max_element() < 0.005, "{mixed}");
}

#[test]
fn walls_lean_no_more_than_they_may() {
    for slope in [0.0, 20.0] {
        let scene = made(&format!("walls:walls=100,slope_deg={slope:?}"));
        let elevations: Vec<f64> =
            (0..scene.len() as u32).map(|t| scene.normal(t).normalize().z.asin().to_degrees()).collect();
        let most = elevations.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        // The grid of 2^-12 m on walls of half a metre: a twentieth of a degree.
        assert!(most <= slope + 0.06 && most >= slope * 0.9, "{slope}: {most}");
        let signs: HashSet<bool> = elevations.iter().filter(|e| e.abs() > 1.0).map(|e| *e > 0.0).collect();
        assert_eq!(signs.len(), if slope > 0.0 { 2 } else { 0 });
    }
}

#[test]
fn slivers_have_the_aspect_that_was_asked_for() {
    for aspect in [1e2, 1e5, 1e8] {
        for shape in ["needle", "prism", "seam"] {
            let scene = made(&format!("slivers:slivers=30,shape={shape},aspect={aspect:?}"));
            let thinnest = (0..scene.len() as u32)
                .map(|t| {
                    let [a, b, c] = scene.corners(t);
                    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                    longest * longest / scene.normal(t).length()
                })
                .fold(0.0f64, f64::max);
            assert!((0.8..1.7).contains(&(thinnest / aspect)), "{shape}: {thinnest:e} for {aspect:e}");
        }
    }
}

#[test]
fn coplanar_copies_are_as_many_ulps_apart_as_asked() {
    let at = |spec: &str| made(&format!("coplanar:boxes=20,{spec}"));
    let exact = at("copies=3");
    assert_eq!(exact.material_names, ["copy_0", "copy_1", "copy_2"]);
    for place in exact.positions.chunks(24) {
        assert!(place[..8] == place[8..16] && place[..8] == place[16..], "duplicates are exact");
    }
    let single = at("copies=3,ulps=2");
    for place in single.positions.chunks(24) {
        for i in 0..8 {
            let bits = |copy: usize| place[copy * 8 + i].to_array().map(|x| (x as f32).to_bits());
            let (first, up, down) = (bits(0), bits(1), bits(2));
            for axis in 0..3 {
                assert_eq!((up[axis] - first[axis], first[axis] - down[axis]), (2, 2));
            }
        }
    }
    let double = at("copies=2,ulps=1,of=f64");
    for place in double.positions.chunks(16) {
        assert!(
            (0..8).all(|i| place[8 + i].to_array().map(f64::to_bits) == place[i].to_array().map(|x| x.to_bits() + 1))
        );
    }
}

#[test]
fn damage_is_counted_by_kind_and_leaves_the_boxes_alone() {
    let sound = made("boxes:boxes=1");
    assert_eq!(sound.report.dropped(), 0);
    // H: 0.1 to 10 %, out of 1,200 good faces.
    for (share, bad) in [(0.001, 1), (0.01, 12), (0.1, 133)] {
        for kind in ["zero_area", "not_a_number", "infinite", "huge", "subnormal"] {
            // Through the loader: its counts reach the reports.
            let scene = loaded(&format!("degenerate:boxes=100,share={share:?},kind={kind}"), 1.0);
            let r = &scene.report;
            assert_eq!(r.triangles_in_file, 1200 + bad, "{kind} {share}");
            let dropped = match kind {
                "zero_area" => (0, 0, bad),
                "huge" => (0, bad, 0),
                "subnormal" => (0, 0, 0),
                _ => (bad, 0, 0),
            };
            let found = (r.dropped_non_finite, r.dropped_out_of_range, r.dropped_degenerate);
            assert_eq!(found, dropped, "{kind} {share}: {:?}", r.warnings);
            assert_eq!(scene.len() as u64, r.triangles_in_file - r.dropped());
            assert!(scene.positions.iter().all(|p| p.is_finite() && p.length() < 100.0));
        }
    }
    let mixed = loaded("degenerate:boxes=100,share=0.1", 1.0);
    let r = &mixed.report;
    assert!([r.dropped_non_finite, r.dropped_out_of_range, r.dropped_degenerate].iter().all(|n| *n > 20));
    let corners = |s: &Scene| -> Vec<[DVec3; 3]> {
        let kept = (0..s.len() as u32).filter(|t| s.corners(*t).iter().all(|p| !p.z.is_subnormal()));
        kept.map(|t| s.corners(t)).collect()
    };
    let clean = loaded("degenerate:boxes=100,share=0.0", 1.0);
    assert_eq!(corners(&mixed), corners(&clean), "the good faces are those of the scene without damage");
}

#[test]
fn fins_pass_the_centre_at_their_angle_on_both_sides() {
    for angle in [1e-1, 1e-3, 1e-5, 1e-8] {
        let scene = made(&format!("grazing:fins=100,angle_rad={angle:?}"));
        let eye = walked("random:frames=1,spread=0", &scene)[0].eye;
        assert_eq!(eye, DVec3::ZERO, "the bounds are symmetric");
        let (mut front, mut grazing) = (0, 0);
        // After the posts, faces 0 to 3 of each fin are its ends.
        for t in (96..scene.len() as u32).filter(|t| (t - 96) % 12 >= 4) {
            let [a, b, c] = scene.corners(t);
            let sine = scene.normal(t).normalize().dot(eye - a) / a.distance(eye);
            assert!((0.4..1.1).contains(&(sine.abs() / angle)), "{sine:e} for {angle:e}");
            match facing(a, b, c, eye) {
                Facing::Front => front += 1,
                Facing::Back => {}
                Facing::EdgeOn => panic!("triangle {t} is edge-on at {angle:e}"),
            }
            grazing += 1;
        }
        assert_eq!(grazing, 800);
        assert!((300..500).contains(&front), "{front} of 800 are front-facing");
    }
}

#[test]
fn random_poses_go_where_they_are_told() {
    let scene = made("boxes:boxes=200");
    let (bounds, half) = (scene.bounds(), scene.bounds().size().length() * 0.5);
    let poses = walked("random:frames=400", &scene);
    assert_eq!(poses, walked("random:frames=400", &scene));
    assert_ne!(poses, walked("random:frames=400,seed=2", &scene));
    let pitch = |p: &cullmark::math::Pose| p.forward.z.asin().to_degrees();
    assert!(poses.iter().all(|p| bounds.contains(p.eye) && pitch(p).abs() <= 20.0 + 1e-9));
    assert!(poses.iter().any(|p| pitch(p) > 17.0) && poses.iter().any(|p| pitch(p) < -17.0));
    assert!(poses.iter().all(|p| p.forward.cross(p.up).z.abs() < 1e-12), "no roll");
    let small = walked("random:frames=100,spread=0.1", &scene);
    assert!(small.iter().all(|p| ((p.eye - bounds.centre()) / bounds.size()).abs().max_element() <= 0.0501));
    let any = walked("random:frames=2000,aim=any", &scene);
    let mean = any.iter().map(|p| p.forward).sum::<DVec3>() / 2000.0;
    assert!(mean.length() < 0.05, "directions are isotropic: {mean}");
    assert!(any.iter().any(|p| p.up.z < -0.5), "some are upside down");
    let outside = walked("random:frames=200,eyes=outside,aim=scene,distance=3", &scene);
    for p in &outside {
        let away = p.eye.distance(bounds.centre()) / half;
        assert!((0.999..3.001).contains(&away), "{away}");
        // The scene is in front, though not always its centre.
        assert!((bounds.centre() - p.eye).normalize().dot(p.forward) > 0.3);
    }
    for p in any.iter().chain(&outside).chain(&poses) {
        assert!((p.forward.length() - 1.0).abs() < 1e-12 && (p.up.length() - 1.0).abs() < 1e-12);
        assert!(p.forward.dot(p.up).abs() < 1e-12);
    }
}
