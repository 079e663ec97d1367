//! Sampled visible sets: what they lose, and that more samples only add (D9.1).

use super::occluding::{SMALL, built, degenerate, eyes, scenes, set_up, structures, truth_of};
use super::portals::{facing, poses};
use super::walks::{Method, triangles};
use crate::structures::portal_octree::pane;
use crate::structures::scene_of;
use cullmark::culling::Class;
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::scene::Scene;

/// A walk in small steps, so that most frames lie between sampled points.
fn steps(scene: &Scene) -> Vec<Pose> {
    let starts = poses("random:frames=4,eyes=inside,aim=any", scene);
    let step = |start: &Pose, k: u32| {
        let mut pose = *start;
        pose.eye += (pose.forward + pose.up * 0.1) * (0.3 * f64::from(k));
        pose
    };
    starts.iter().flat_map(|s| (0..6).map(|k| step(s, k)).collect::<Vec<_>>()).collect()
}

// D9.1
#[test]
fn more_eyes_never_lose_more() {
    for scene in &scenes()[..2] {
        let poses = steps(scene);
        let camera = Camera::default();
        let truth = truth_of(scene, &camera, &poses, &SMALL);
        let h = built("bvh", scene).unwrap();
        let mut before: Option<(Vec<Vec<bool>>, u64, u64)> = None;
        let mut lost = Vec::new();
        for m in [1, 4, 16, 64] {
            let walk = format!("pvs:eyes={m},resolution_px=32,cells=8");
            let mut setup = set_up(scene, &h, "frustum", &walk, &camera, &poses);
            assert!(setup.class == Class::Aggressive && setup.removes.occluded);
            let judgement = setup.judge(&truth);
            assert_eq!(judgement.wrong, None, "errors of an aggressive walk are data");
            let false_culls: u64 = judgement.frames.iter().map(|f| f.false_culls).sum();
            let mut sets = Vec::new();
            let work = setup.count_pass(|s, _, list| sets.push(triangles(&s.hierarchy, list)));
            let missing: u64 = work.iter().map(|w| w.tally.pvs_missing_ppm).sum();
            if let Some((sets_before, culls_before, _)) = &before {
                let grown = sets_before.iter().flatten().zip(sets.iter().flatten()).all(|(a, b)| !a || *b);
                assert!(grown && false_culls <= *culls_before, "{}: {m} eyes lose {false_culls}", scene.name);
            }
            lost.push((false_culls, missing));
            before = Some((sets, false_culls, missing));
        }
        assert!(lost[0].0 > 2 * lost[3].0, "{}: false culls fall: {lost:?}", scene.name);
        assert!(lost[0].1 > lost[3].1 && lost[3].1 > 0, "{}: so does the estimate: {lost:?}", scene.name);
    }
}

#[test]
fn the_set_of_the_nearest_point_loses_more_between_points() {
    let scene = &scenes()[0];
    let (poses, camera) = (steps(scene), Camera::default());
    let truth = truth_of(scene, &camera, &poses, &SMALL);
    let h = built("octree", scene).unwrap();
    let judged = |points: &str| {
        let walk = format!("pvs:points={points},resolution_px=64,cells=8");
        let mut setup = set_up(scene, &h, "frustum", &walk, &camera, &poses);
        let judgement = setup.judge(&truth);
        let sum = |of: &dyn Fn(&cullmark::record::FrameErrors) -> u64| judgement.frames.iter().map(of).sum::<u64>();
        (sum(&|f| f.false_culls), sum(&|f| f.submitted))
    };
    let ((union, union_drawn), (nearest, nearest_drawn)) = (judged("union"), judged("nearest"));
    assert!(nearest > union, "{nearest} lost of the nearest point's set, {union} of the cell's");
    assert!(nearest_drawn < union_drawn, "for that it is smaller: {nearest_drawn} {union_drawn}");
}

#[test]
fn the_set_is_met_with_what_the_tests_keep_on_every_structure() {
    for (i, scene) in [&scenes()[0], &scenes()[4]].into_iter().enumerate() {
        let poses = eyes(scene, 6, 3);
        let mut want: Option<Vec<Vec<bool>>> = None;
        for structure in structures() {
            let Some(h) = built(&structure, scene) else { continue };
            let run = |culling: &str, walk: &str| {
                let mut sets = Vec::new();
                let mut setup = set_up(scene, &h, culling, walk, &Camera::default(), &poses);
                let work = setup.count_pass(|s, _, list| {
                    assert!(list.ranges.is_sorted());
                    sets.push(triangles(&s.hierarchy, list));
                });
                // The second pass samples nothing and counts the same.
                let again = setup.count_pass(|_, _, _| ());
                let counts =
                    |w: &[cullmark::runner::FrameWork]| w.iter().map(|w| (w.tally, w.hash)).collect::<Vec<_>>();
                assert_eq!(counts(&work), counts(&again), "{structure} {walk}");
                (sets, work)
            };
            let pvs = ["pvs:eyes=4,resolution_px=24", "pvs:eyes=4,resolution_px=24,points=nearest"][i];
            let (all, work) = run("none", pvs);
            // Without tests it is the set itself, whatever the structure.
            let members: Vec<u64> = work.iter().map(|w| w.tally.pvs_members).collect();
            let counted: Vec<u64> = all.iter().map(|s| s.iter().filter(|m| **m).count() as u64).collect();
            assert_eq!(members, counted, "{structure}");
            assert_eq!(want.get_or_insert_with(|| all.clone()), &all, "{structure}");
            let (kept, _) = run("frustum", "depth_first");
            let (met, _) = run("frustum", pvs);
            for ((met, kept), all) in met.iter().flatten().zip(kept.iter().flatten()).zip(all.iter().flatten()) {
                assert_eq!(*met, *kept && *all, "{structure}");
            }
        }
    }
}

/// A wall between two rooms' worth of specks: a cell on one side sees its side only.
#[test]
fn a_wall_divides_what_cells_see() {
    let speck = |x: f64| pane(0, x, [-1.0, -1.0], [1.0, 1.0], x > 0.0);
    let mut walls = pane(0, 0.0, [-90.0, -90.0], [90.0, 90.0], true).to_vec();
    walls.extend(pane(0, -0.5, [-90.0, -90.0], [90.0, 90.0], false));
    let scene = scene_of("divided", &[walls, speck(-9.0).to_vec(), speck(8.0).to_vec()].concat());
    // Fronts towards the middle.
    let turned = |t: [u32; 3]| [t[0], t[2], t[1]];
    let mut scene = scene;
    (4..8).for_each(|t| scene.triangles[t] = turned(scene.triangles[t]));
    let h = built("list:leaf_size=1", &scene).unwrap();
    let mut method = Method::new(&scene, &h, "none", "pvs:cells=36");
    let seen = |method: &mut Method, x: f64, camera: &Camera| {
        let view = View::new(camera, &facing(DVec3::new(x, 0.3, 0.2), DVec3::Y));
        let (out, tally) = method.frame(&view);
        let set = triangles(&h, &out);
        ([set[0], set[2], set[4], set[6]], tally.pvs_members, out.compacted)
    };
    let camera = Camera::default();
    assert_eq!(seen(&mut method, 4.0, &camera), ([true, false, false, true], 4, true));
    assert_eq!(seen(&mut method, -5.0, &camera), ([false, true, true, false], 4, true));
    let parallel = Camera { projection: Projection::Orthographic { height_m: 9.0 }, ..camera };
    assert_eq!(seen(&mut method, 4.0, &parallel), ([true; 4], 0, false), "parallel rays have no cell");
}

#[test]
fn degenerate_scenes_have_sets() {
    for (scene, poses, cameras) in degenerate() {
        for structure in ["bvh:leaf_size=2", "list:leaf_size=1"] {
            let Some(h) = built(structure, &scene) else { continue };
            for camera in &cameras {
                let mut setup = set_up(&scene, &h, "none", "pvs:eyes=2,resolution_px=8", camera, &poses);
                let work = setup.count_pass(|_, _, _| ());
                assert!(work.iter().all(|w| w.triangles <= scene.len() as u64));
            }
        }
    }
}
