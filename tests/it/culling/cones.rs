//! `normal_cone` (fact C5) and normal masks by node (facts C3.1 and C3.4).

use super::build::{Rng, camera, list, tree};
use super::masks::{is_front, meets};
use super::walks::{Method, triangles};
use crate::common::soup;
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, DVec3, Projection, View};
use cullmark::scene::Scene;

const CONES: [&str; 3] = ["normal_cone", "normal_cone:form=tight", "normal_cone:form=apex"];

/// Closed balls whose neighbouring triangles have neighbouring normals.
fn balls(seed: u64, count: usize) -> Scene {
    let mut rng = Rng::new(seed);
    let (rings, sides) = (16, 24);
    let mut scene = soup(seed, count * rings * sides * 2, 1.0, 1.0);
    let mut next = 0;
    for _ in 0..count {
        let (centre, radius) = (rng.cube(40.0), rng.range(1.0, 6.0));
        let at = |i: usize, j: usize| {
            let (a, b) =
                (i as f64 * std::f64::consts::PI / rings as f64, j as f64 * std::f64::consts::TAU / sides as f64);
            centre + DVec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos()) * radius
        };
        for (i, j) in (0..rings).flat_map(|i| (0..sides).map(move |j| (i, j))) {
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            for corners in [[p, q, r], [p, r, s]] {
                for (v, c) in scene.triangles[next].into_iter().zip(corners) {
                    scene.positions[v as usize] = c;
                }
                next += 1;
            }
        }
    }
    scene.anchor();
    scene
}

/// Soup, slivers and degenerate triangles among it, whose normals agree by place or not at all.
fn mixed(seed: u64, offset: DVec3) -> Scene {
    let mut scene = soup(seed, 1500, 20.0, 1.0);
    for t in 0..scene.len() {
        let along = scene.corners(t as u32)[0].as_ivec3() / 8;
        let wanted = DVec3::new(f64::from(along.x), f64::from(along.y), 0.7);
        if scene.normal(t as u32).dot(wanted) < 0.0 {
            scene.triangles[t].swap(1, 2);
        }
        let [a, b, c] = scene.triangles[t].map(|v| v as usize);
        match t % 40 {
            0 => scene.positions[c] = scene.positions[b],
            1 => scene.positions[c] = (scene.positions[a] + scene.positions[b]) * 0.5 + DVec3::splat(1e-9),
            2 => scene.two_sided[t] = true,
            _ => {}
        }
    }
    scene.positions.iter_mut().for_each(|p| *p += offset);
    scene.anchor();
    scene
}

/// Edges of buildings: four triangles of two walls whose normals are 100 to 150 degrees apart.
fn edges(seed: u64, count: usize) -> Scene {
    let mut rng = Rng::new(seed);
    let mut scene = soup(seed, count * 4, 1.0, 1.0);
    for edge in 0..count {
        let (centre, along) = (rng.cube(40.0), rng.direction());
        let a = along.any_orthonormal_vector();
        let (sin, cos) = rng.range(30.0, 80.0f64).to_radians().sin_cos();
        for (wall, side) in [a * cos + along.cross(a) * sin, a * cos - along.cross(a) * sin].into_iter().enumerate() {
            let p = |s: f64, t: f64| centre + (along * s + side * t) * 0.5;
            let mut quad = [[p(-1.0, 0.0), p(1.0, 0.0), p(1.0, 2.0)], [p(-1.0, 0.0), p(1.0, 2.0), p(-1.0, 2.0)]];
            if wall == 1 {
                quad.iter_mut().for_each(|t| t.swap(1, 2));
            }
            for (i, corners) in quad.into_iter().enumerate() {
                for (v, c) in scene.triangles[edge * 4 + wall * 2 + i].into_iter().zip(corners) {
                    scene.positions[v as usize] = c;
                }
            }
        }
    }
    scene.anchor();
    scene
}

/// Skipped over all views, of which wrongly: the front shows (in the view, for tests by view).
fn skipped(scene: &Scene, h: &Hierarchy, culling: &str, views: &[View]) -> (u64, u64) {
    let mut method = Method::new(scene, h, culling, "depth_first");
    let (mut all, mut wrong) = (0, 0);
    for view in views {
        let kept = triangles(h, &method.frame(view).0);
        for t in (0..scene.len() as u32).filter(|t| !kept[*t as usize]) {
            all += 1;
            let front = scene.two_sided[t as usize] || is_front(view, scene.corners(t));
            // What is culled by the node's own rays turns its back even outside the view.
            let by_node =
                culling.contains("rays=node") || !culling.starts_with("normal_mask") || meets(view, scene.corners(t));
            wrong += u64::from(front && by_node);
        }
    }
    (all, wrong)
}

// C5.1, C3.1.
#[test]
fn cones_and_masks_by_node_skip_no_front_face() {
    let mut rng = Rng::new(111);
    let parallel = Camera { projection: Projection::Orthographic { height_m: 30.0 }, ..Camera::default() };
    let scenes = [balls(111, 3), mixed(112, DVec3::ZERO), mixed(113, DVec3::new(3e6, -2e6, 500.0))];
    for scene in &scenes {
        for camera in [camera(60.0, 1.5), camera(170.0, 1.0), parallel] {
            let views: Vec<View> = (0..10)
                .map(|i| {
                    let mut pose = rng.pose(35.0);
                    pose.eye += scene.origin;
                    if i % 2 == 0 {
                        // Close to a surface, inside nodes.
                        let t = (rng.bits() % scene.len() as u64) as u32;
                        pose.eye = scene.corners(t)[0] + rng.cube(10f64.powi(-(i / 2)));
                    }
                    View::new(&camera, &pose)
                })
                .collect();
            for h in [tree(scene, 4, 2), tree(scene, 16, 0), list(scene, 3)] {
                for culling in CONES.into_iter().chain(["normal_mask:rays=node", "normal_mask:cells=12,rays=node"]) {
                    let (all, wrong) = skipped(scene, &h, culling, &views);
                    assert_eq!(wrong, 0, "{culling} in {} skips {all}", scene.name);
                    assert!(all > 0, "{culling} skips something");
                }
            }
        }
    }
}

/// The rounded axis is no unit vector: what is left of L^2 - (d.axis)^2 close to it is rounding.
#[test]
fn an_eye_on_the_axis_of_a_cone_sees_all_its_fronts() {
    let a = [
        [87.70848625391216, 464.8293908280583, -162.01808189663137],
        [85.10807770123179, 466.71470087217403, -157.93354013571093],
        [82.5884231906232, 465.6502406489592, -162.35148825450582],
    ]
    .map(DVec3::from_array);
    let b = [
        [-2.144575448880367, 0.7517110736157339, 1.0419820564016697],
        [1.9164719814158477, 1.592399925131716, -0.20346405797712852],
        [0.22810346746452037, -2.3441109987474493, -0.8385179984245413],
    ]
    .map(DVec3::from_array);
    let mut scene = soup(1, 3, 1.0, 1.0);
    for (t, corners) in [a, a.map(|c| -c), b].into_iter().enumerate() {
        for (v, c) in scene.triangles[t].into_iter().zip(corners) {
            scene.positions[v as usize] = c;
        }
    }
    let found = DVec3::new(625.090309814735, 693.5646175163832, 786.1873675930701);
    let mut rng = Rng::new(115);
    let mut views = Vec::new();
    for i in 0..4000 {
        // Around the eye that was lost once, and around the axis: all that is close to either.
        let mut pose = rng.pose(1.0);
        pose.eye = found * rng.range(0.5, 2.0) + rng.cube(10f64.powi(-(i % 9)));
        if i == 0 {
            pose.eye = found;
        }
        views.push(View::new(&camera(60.0, 1.5), &pose));
    }
    for h in [list(&scene, 3), list(&scene, 1)] {
        for culling in CONES {
            assert_eq!(skipped(&scene, &h, culling, &views).1, 0, "{culling}");
        }
    }
}

/// C5.2 and C3.4: what masks of the whole view, masks by node and cones skip.
#[test]
fn cones_are_best_on_coherent_clusters_and_rays_to_nodes_far_better_than_those_of_the_view() {
    let mut rng = Rng::new(114);
    let views: Vec<View> = (0..12).map(|_| View::new(&camera(60.0, 16.0 / 9.0), &rng.pose(50.0))).collect();
    let methods = [
        "normal_mask",
        "normal_mask:cells=12,rays=node",
        "normal_cone",
        "normal_cone:form=tight",
        "normal_cone:form=apex",
        "back_face",
    ];
    let share = |scene: &Scene, h: Hierarchy| {
        methods.map(|m| skipped(scene, &h, m, &views).0 as f64 / (views.len() * scene.len()) as f64)
    };
    let ball = balls(114, 6);
    let coherent = share(&ball, tree(&ball, 12, 0));
    let edge = edges(115, 700);
    let spread = share(&edge, list(&edge, 4));
    println!("skipped share by {methods:?}: coherent clusters {coherent:.3?}, edges of walls {spread:.3?}");
    let [view, node, sphere, tight, _, all] = coherent;
    assert!(node > 1.5 * view, "C3.4: {coherent:?}");
    assert!(tight >= sphere && sphere >= node && tight <= all, "C5.2: {coherent:?}");
    let [view, node, _, tight, apex, _] = spread;
    assert!(node > 1.5 * view, "C3.4: {spread:?}");
    assert!(node > tight.max(apex), "C5.2: a cone holds what lies between its normals: {spread:?}");
}
