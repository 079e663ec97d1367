//! The occlusion tree before the oracle, against single rays, and fusing (D6.2).

use super::build::Rng;
use super::occluding::{SMALL, built, degenerate, eyes, is_hidden, judged, scenes, set_up, structures, truth_of};
use super::portals::{cameras, facing};
use super::walks::{Method, triangles};
use crate::structures::portal_octree::pane;
use crate::structures::scene_of;
use cullmark::culling::Class;
use cullmark::math::{Camera, DVec3, Projection, View};
use cullmark::record::Accuracy;
use cullmark::scene::Scene;

const WALKS: [&str; 3] = ["occlusion_tree", "occlusion_tree:merge=false,occluders=8", "occlusion_tree:occluders=128"];

// D6.2
#[test]
fn nothing_that_is_seen_is_lost() {
    let mut removed = 0;
    for (i, scene) in scenes().iter().enumerate() {
        let poses = eyes(scene, 12, 6);
        for (j, camera) in cameras(12.0).iter().enumerate() {
            let accuracy = Accuracy { witness_rays: if (i + j) % 3 == 0 { 8 } else { 0 }, ..SMALL };
            let truth = truth_of(scene, camera, &poses, &accuracy);
            for (k, structure) in structures().iter().enumerate() {
                let Some(h) = built(structure, scene) else { continue };
                let (culling, walk) = (["none", "frustum"][(j + k) % 2], WALKS[(i + j + k) % 3]);
                let mut setup = set_up(scene, &h, culling, walk, camera, &poses);
                assert!(setup.class == Class::Conservative && setup.removes.occluded);
                judged(&mut setup, &truth, &format!("{} {structure} {culling} {walk}", scene.name));
                removed += setup.count_pass(|_, _, _| ()).iter().map(|w| w.tally.nodes_occluded).sum::<u64>();
            }
        }
    }
    assert!(removed > 10_000, "{removed} nodes hidden");
}

#[test]
fn nothing_is_lost_of_degenerate_scenes() {
    for (scene, poses, cameras) in degenerate() {
        for camera in &cameras {
            let truth = truth_of(&scene, camera, &poses, &Accuracy { witness_rays: 4, ..SMALL });
            for structure in ["bvh:leaf_size=2", "octree", "list:leaf_size=1"] {
                let Some(h) = built(structure, &scene) else { continue };
                for walk in WALKS {
                    let mut setup = set_up(&scene, &h, "none", walk, camera, &poses);
                    judged(&mut setup, &truth, &format!("{} {structure} {walk}", scene.name));
                }
            }
        }
    }
}

/// Random panes, some joined edge to edge, and specks to be hidden.
fn panes_and_specks(rng: &mut Rng, specks: usize) -> Scene {
    let mut all = Vec::new();
    for _ in 0..24 {
        let axis = (rng.bits() % 3) as usize;
        let mut whole = |n: f64| rng.range(0.0, n).floor();
        let (at, lo) = (whole(13.0) - 6.0, [whole(12.0) - 6.0, whole(12.0) - 6.0]);
        let (w, h) = (1.0 + whole(4.0), 1.0 + whole(4.0));
        let up = whole(2.0) > 0.0;
        all.extend(pane(axis, at, lo, [lo[0] + w, lo[1] + h], up));
        // A neighbour in the same plane, and one around the corner.
        all.extend(pane(axis, at, [lo[0] + w, lo[1]], [lo[0] + w + 2.0, lo[1] + h], up));
    }
    // Turned and skewed, so that nothing is whole.
    let [x, y, z] = [DVec3::new(0.8, 0.36, -0.48), DVec3::new(-0.6, 0.48, -0.64), DVec3::new(0.1, 0.8, 0.6)];
    let turn = |p: DVec3| x * p.x + y * p.y + z * p.z + DVec3::new(3.3, 170.1, -2.7);
    let mut all: Vec<[DVec3; 3]> = all.iter().map(|t| t.map(turn)).collect();
    let walls = all.len();
    for _ in 0..specks {
        let at = turn(rng.cube(9.0));
        all.push([at, at + rng.cube(0.3), at + rng.cube(0.3)]);
    }
    let mut scene = scene_of("panes", &all);
    (0..walls).for_each(|t| scene.two_sided[t] = t % 10 < 4);
    scene.occluder[walls..].fill(false);
    scene
}

/// The naive twin: a speck is left out only if each of its points is hidden or out of view.
#[test]
fn every_speck_that_is_left_out_is_hidden_at_all_its_points() {
    let mut rng = Rng::new(77);
    let (mut hidden, mut left_out) = (0, 0);
    for round in 0..6 {
        let scene = panes_and_specks(&mut rng, 400);
        let h = built("list:leaf_size=1", &scene).unwrap();
        for camera in [cameras(9.0)[0], cameras(9.0)[1], cameras(9.0)[2]] {
            let mut method = Method::new(&scene, &h, "none", WALKS[round % 3]);
            for _ in 0..12 {
                let eye = scene.bounds().centre() + rng.cube(14.0);
                let view = View::new(&camera, &facing(eye, scene.bounds().centre() + rng.cube(4.0) - eye));
                let (out, _) = method.frame(&view);
                let set = triangles(&h, &out);
                let inside = |p: DVec3| view.planes.iter().all(|pl| pl.normal.dot(p - view.eye) + pl.offset_m >= 1e-9);
                for t in (0..scene.len() as u32).filter(|t| !scene.occluder[*t as usize]) {
                    let c = scene.corners(t);
                    let points = [c[0], c[1], c[2], (c[0] + c[1]) * 0.5, (c[0] + c[1] + c[2]) / 3.0];
                    let shows = points.iter().any(|p| inside(*p) && !is_hidden(&scene, &view, *p));
                    assert!(set[t as usize] || !shows, "speck {t} is lost at {:?}", view.eye);
                    let in_view = points.iter().all(|p| inside(*p));
                    hidden += u32::from(!shows && in_view);
                    left_out += u32::from(!set[t as usize] && in_view);
                }
            }
        }
    }
    assert!(left_out * 2 > hidden, "{left_out} of {hidden} hidden specks are found");
}

/// A target behind panes; the scene's first triangles are the panes.
fn before_a_target(panes: &[[[DVec3; 3]; 2]]) -> Scene {
    let target = pane(0, 5.0, [-1.0, -1.0], [1.0, 1.0], false);
    scene_of("fusing", &[panes.concat(), target.to_vec()].concat())
}

// D6.2
#[test]
fn two_occluders_side_by_side_hide_what_neither_hides_alone() {
    let view = View::new(&Camera::default(), &facing(DVec3::ZERO, DVec3::X));
    let flat = |eye_m: f64| Camera {
        projection: Projection::Orthographic { height_m: 8.0 },
        near_m: eye_m,
        ..Camera::default()
    };
    let parallel = View::new(&flat(0.1), &facing(DVec3::ZERO, DVec3::X));
    let wide = |x: f64, from: f64, to: f64| pane(0, x, [from, -3.0], [to, 3.0], false);
    // Edge to edge in one plane; overlapping, one behind the other; around a corner.
    let corner = |to: DVec3| {
        let [a, b, c, d] = [DVec3::new(3.0, 0.0, -3.0), to.with_z(-3.0), to.with_z(3.0), DVec3::new(3.0, 0.0, 3.0)];
        if to.y > 0.0 { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] }
    };
    let pairs = [
        [wide(3.0, -3.0, 0.0), wide(3.0, 0.0, 3.0)],
        [wide(3.0, -3.0, 0.2), wide(2.5, 0.1, 3.0)],
        [corner(DVec3::new(2.0, -4.0, 0.0)), corner(DVec3::new(2.2, 4.0, 0.0))],
        [corner(DVec3::new(4.0, -4.0, 0.0)), corner(DVec3::new(4.2, 4.0, 0.0))],
    ];
    let shows = |panes: &[[[DVec3; 3]; 2]], walk: &str, view: &View| {
        let scene = before_a_target(panes);
        let h = built("list:leaf_size=1", &scene).unwrap();
        let set = triangles(&h, &Method::new(&scene, &h, "none", walk).frame(view).0);
        assert!(set[..2 * panes.len()].iter().all(|s| *s), "the panes themselves are seen");
        set[2 * panes.len()..].contains(&true)
    };
    for (i, [a, b]) in pairs.into_iter().enumerate() {
        for walk in ["occlusion_tree", "occlusion_tree:merge=false"] {
            for view in [&view, &parallel] {
                assert!(shows(&[a], walk, view) && shows(&[b], walk, view), "pair {i}: neither alone");
                assert!(!shows(&[a, b], walk, view), "pair {i} {walk}: both hide");
            }
        }
    }
    // A gap of a tenth of a millimetre stays open.
    let gap = [wide(3.0, -3.0, 0.0), wide(3.0, 1e-4, 3.0)];
    assert!(shows(&gap, "occlusion_tree", &view));
}

#[test]
fn what_cannot_hide_does_not() {
    let view = View::new(&Camera::default(), &facing(DVec3::ZERO, DVec3::X));
    let shows = |wall: [[DVec3; 3]; 2], change: &dyn Fn(&mut Scene), view: &View| {
        let mut scene = before_a_target(&[wall]);
        change(&mut scene);
        let h = built("list:leaf_size=1", &scene).unwrap();
        triangles(&h, &Method::new(&scene, &h, "none", "occlusion_tree").frame(view).0)[2]
    };
    let wall = |up: bool| pane(0, 3.0, [-3.0, -3.0], [3.0, 3.0], up);
    let as_it_is = |_: &mut Scene| ();
    assert!(!shows(wall(false), &as_it_is, &view), "a wall hides");
    assert!(shows(wall(true), &as_it_is, &view), "its back does not");
    assert!(!shows(wall(true), &|s| s.two_sided.fill(true), &view), "but that of a two-sided one");
    assert!(shows(wall(false), &|s| s.occluder.fill(false), &view), "nor glass");
    let near = View::new(&Camera { near_m: 3.5, ..Camera::default() }, &facing(DVec3::ZERO, DVec3::X));
    assert!(shows(wall(false), &as_it_is, &near), "nor what is nearer than near");
    // A wall in the target's own plane, or behind it.
    for x in [5.0, 6.0] {
        assert!(shows(pane(0, x, [-30.0, -30.0], [30.0, 30.0], false), &as_it_is, &view));
    }
}

#[test]
fn merged_walls_hide_more_and_more_occluders_too() {
    let scene = &scenes()[1];
    let h = built("bvh", scene).unwrap();
    let poses = eyes(scene, 40, 1);
    let count = |walk: &str| {
        let mut setup = set_up(scene, &h, "frustum", walk, &Camera::default(), &poses);
        let work = setup.count_pass(|_, _, _| ());
        work.iter().map(|w| w.entries).sum::<u64>()
    };
    let all = count("depth_first");
    let [walls, single, many] = ["", ":merge=false", ":occluders=128"].map(|p| count(&format!("occlusion_tree{p}")));
    assert!(walls < single && single < all, "{walls} {single} of {all}");
    assert!(many <= walls && walls * 10 < all * 9, "{many} {walls} of {all}");
}
