//! Walks and accelerations: same answers, and what they cost.

use super::build::{Rng, camera, list, tree, view_along};
use crate::common::soup;
use cullmark::culling::{DrawList, Tally, Test, cull, make_tests_in, make_walk};
use cullmark::hierarchy::{HalfSpace, Hierarchy, NONE};
use cullmark::math::{Arithmetic, Camera, DVec3, Projection, View};
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::Scene;

/// A composed method over a hierarchy, ready to run frames.
pub struct Method<'a> {
    pub hierarchy: &'a Hierarchy,
    pub tests: Vec<Box<dyn Test>>,
    walk: Box<dyn cullmark::culling::Walk>,
}

impl<'a> Method<'a> {
    pub fn new(scene: &Scene, hierarchy: &'a Hierarchy, culling: &str, walk: &str) -> Method<'a> {
        Method::in_arithmetic(scene, hierarchy, culling, walk, Arithmetic::default())
    }

    pub fn in_arithmetic(
        scene: &Scene,
        hierarchy: &'a Hierarchy,
        culling: &str,
        walk: &str,
        arithmetic: Arithmetic,
    ) -> Method<'a> {
        let (mut tests, _) = make_tests_in(&parse_sum(culling).unwrap(), arithmetic).unwrap();
        for t in &mut tests {
            t.prepare(scene, hierarchy);
        }
        let (mut walk, _) = make_walk(&Spec::parse(walk).unwrap()).unwrap();
        assert_eq!(walk.refuses(hierarchy), None);
        walk.prepare(scene, hierarchy);
        Method { hierarchy, tests, walk }
    }

    pub fn frame(&mut self, view: &View) -> (DrawList, Tally) {
        let (mut out, mut tally) = (DrawList::default(), Tally::default());
        cull(view, self.hierarchy, &mut self.tests, self.walk.as_mut(), &mut out, &mut tally);
        (out, tally)
    }
}

/// Distinct triangles of a draw list.
pub fn triangles(h: &Hierarchy, out: &DrawList) -> Vec<bool> {
    let mut set = vec![false; h.entries.iter().max().map_or(0, |m| *m as usize + 1)];
    out.positions().for_each(|p| set[h.entries[p as usize] as usize] = true);
    set
}

pub fn views(seed: u64, half: f64) -> Vec<View> {
    let mut rng = Rng::new(seed);
    let ortho = Camera { projection: Projection::Orthographic { height_m: half }, ..Camera::default() };
    let far = Camera { far_m: Some(half), ..camera(40.0, 1.0) };
    [camera(60.0, 16.0 / 9.0), camera(10.0, 1.0), camera(120.0, 1.5), far, ortho]
        .iter()
        .flat_map(|c| (0..6).map(|_| View::new(c, &rng.pose(half * 1.5))).collect::<Vec<_>>())
        .collect()
}

#[test]
fn all_accelerations_submit_the_identical_set() {
    let scene = soup(11, 3000, 50.0, 1.0);
    for h in [tree(&scene, 8, 0), tree(&scene, 8, 3)] {
        let mut reference = Method::new(&scene, &h, "frustum:plane_mask=false", "depth_first");
        let mut others: Vec<_> = ["frustum", "frustum:last_plane=true", "frustum:plane_mask=false,last_plane=true"]
            .map(|c| Method::new(&scene, &h, c, "depth_first"))
            .into();
        for view in views(1, 50.0) {
            let (want, slow) = reference.frame(&view);
            for other in &mut others {
                let (got, tally) = other.frame(&view);
                assert_eq!(got, want);
                assert_eq!(tally.nodes_visited, slow.nodes_visited);
                assert!(tally.plane_tests <= slow.plane_tests * 3 / 2);
            }
        }
    }
}

#[test]
fn ranges_ascend_and_touch_no_neighbour() {
    let scene = soup(12, 2000, 50.0, 1.0);
    for (h, walk) in [(tree(&scene, 8, 2), "depth_first"), (tree(&scene, 8, 2), "flat"), (list(&scene, 5), "flat")] {
        let mut method = Method::new(&scene, &h, "frustum", walk);
        for view in views(2, 50.0) {
            let (out, _) = method.frame(&view);
            assert!(out.ranges.iter().all(|(a, b)| a < b));
            assert!(out.ranges.windows(2).all(|w| w[0].1 < w[1].0), "merged and ascending");
        }
    }
}

#[test]
fn a_flat_walk_over_leaves_submits_what_brute_force_over_leaves_does() {
    let scene = soup(13, 2500, 50.0, 1.0);
    for h in [tree(&scene, 8, 0), tree(&scene, 16, 4), list(&scene, 7)] {
        let mut flat = Method::new(&scene, &h, "frustum", "flat");
        let mut deep = Method::new(&scene, &h, "frustum", "depth_first");
        for view in views(3, 50.0) {
            let (flat, _) = flat.frame(&view);
            let (deep, _) = deep.frame(&view);
            // Going down adds the verdicts of ancestors. Their boxes contain the child's, so
            // that exact arithmetic gains nothing: only a guard's width may differ.
            let (flat, deep) = (triangles(&h, &flat), triangles(&h, &deep));
            let extra = flat.iter().zip(&deep).filter(|(f, d)| f != d).count();
            assert!(deep.iter().zip(&flat).all(|(d, f)| !d || *f), "deep is within flat");
            assert!(extra <= 16 * 8, "{extra} triangles differ");
        }
    }
}

#[test]
fn no_triangle_that_meets_the_frustum_is_lost_by_any_walk() {
    let scene = soup(14, 3000, 40.0, 2.0);
    for (h, walk) in [(tree(&scene, 8, 0), "depth_first"), (tree(&scene, 8, 3), "flat"), (list(&scene, 4), "flat")] {
        for culling in ["frustum", "frustum:last_plane=true"] {
            let mut method = Method::new(&scene, &h, culling, walk);
            for view in views(4, 40.0) {
                let (out, _) = method.frame(&view);
                let set = triangles(&h, &out);
                for t in 0..scene.len() as u32 {
                    let corners = scene.corners(t);
                    let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
                    let seen = corners
                        .iter()
                        .chain([&centre])
                        .any(|p| view.planes.iter().all(|pl| pl.normal.dot(*p - view.eye) + pl.offset_m >= 0.0));
                    assert!(!seen || set[t as usize], "{culling} with {walk} loses triangle {t}");
                }
            }
        }
    }
}

#[test]
fn no_test_at_all_submits_everything_as_one_range() {
    let scene = soup(15, 500, 10.0, 1.0);
    let h = tree(&scene, 8, 0);
    for walk in ["depth_first", "flat"] {
        let mut method = Method::new(&scene, &h, "none", walk);
        let (out, tally) = method.frame(&view_along(DVec3::ZERO, DVec3::X, &Camera::default()));
        assert_eq!(out.ranges, [(0, 500)]);
        assert_eq!(tally, Tally::default());
    }
}

#[test]
fn a_fully_inside_subtree_costs_no_plane_tests() {
    // Far ahead and small: the root is inside every plane.
    let scene = soup(16, 4000, 5.0, 0.2);
    let h = tree(&scene, 8, 0);
    let mut method = Method::new(&scene, &h, "frustum", "depth_first");
    let ahead = view_along(DVec3::new(-1000.0, 0.0, 0.0), DVec3::X, &Camera::default());
    let (out, tally) = method.frame(&ahead);
    assert_eq!(out.ranges, [(0, 4000)]);
    assert_eq!((tally.nodes_visited, tally.lane_tests, tally.plane_tests), (1, 1, 5), "the root alone");
    // Only one plane cuts the scene: below the root, no other is tested.
    let edge = view_along(DVec3::new(-1000.0, -1000.0 * ahead.half_width, 0.0), DVec3::X, &Camera::default());
    let (_, tally) = method.frame(&edge);
    assert!(tally.nodes_visited > 50);
    assert_eq!(tally.plane_tests, 5 + (tally.nodes_visited - 1), "one plane a node");
}

#[test]
fn a_still_camera_needs_one_plane_test_a_rejected_node() {
    let scene = soup(17, 6000, 60.0, 0.5);
    let h = list(&scene, 1);
    let rejected = |out: &DrawList| 6000 - out.entry_count();
    for view in views(5, 30.0) {
        let planes = view.planes.len() as u64;
        let mut plain = Method::new(&scene, &h, "frustum", "flat");
        let mut coherent = Method::new(&scene, &h, "frustum:last_plane=true", "flat");
        let (out, cold) = plain.frame(&view);
        coherent.frame(&view);
        let (again, warm) = coherent.frame(&view);
        assert_eq!(again, out);
        let kept = out.entry_count() * planes;
        assert_eq!(warm.plane_tests - kept, rejected(&out), "exactly one a rejected node");
        assert!(cold.plane_tests - kept >= rejected(&out));
    }
}

#[test]
fn after_a_reset_a_pass_does_the_same_work_again() {
    let scene = soup(18, 1500, 30.0, 1.0);
    let h = tree(&scene, 8, 2);
    let mut method = Method::new(&scene, &h, "frustum:last_plane=true", "depth_first");
    let mut pass = || {
        method.tests.iter_mut().for_each(|t| t.reset());
        views(6, 30.0).iter().map(|v| method.frame(v)).collect::<Vec<_>>()
    };
    assert_eq!(pass(), pass());
}

/// Every node's half-space is one face of its box, as partition planes would bound it.
fn with_half_spaces(mut h: Hierarchy, rng: &mut Rng) -> Hierarchy {
    let column = (0..h.links.len() * 8)
        .map(|node| {
            let b = h.bounds[node / 8].get(node % 8);
            let axis = rng.bits() as usize % 3;
            let normal = DVec3::AXES[axis];
            (h.parent[node / 8] != NONE && !b.is_empty()).then(|| match rng.bits() % 2 {
                0 => HalfSpace { normal, offset_m: -f64::from(b.lo[axis]) },
                _ => HalfSpace { normal: -normal, offset_m: f64::from(b.hi[axis]) },
            })
        })
        .collect();
    h.half_spaces = Some(column);
    h
}

#[test]
fn partition_planes_are_conservative_and_tighten_boxes() {
    let scene = soup(19, 3000, 40.0, 1.0);
    let mut rng = Rng::new(19);
    let h = with_half_spaces(tree(&scene, 8, 2), &mut rng);
    let run = |culling: &str| {
        let mut m = Method::new(&scene, &h, culling, "depth_first");
        views(7, 40.0).iter().map(|v| triangles(&h, &m.frame(v).0)).collect::<Vec<_>>()
    };
    let within = |a: &[Vec<bool>], b: &[Vec<bool>]| a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| !a || *b);
    let count = |a: &[Vec<bool>]| a.iter().flatten().filter(|k| **k).count();
    let [boxes, planes, both] = ["box", "plane", "box_plane"].map(|t| run(&format!("frustum:node_test={t}")));
    assert!(within(&both, &boxes) && within(&both, &planes));
    assert!(count(&planes) < scene.len() * planes.len(), "planes cull something");
    assert!(count(&both) <= count(&boxes), "{} {}", count(&both), count(&boxes));
    for (view, planes) in views(7, 40.0).iter().zip(&both) {
        for t in 0..scene.len() as u32 {
            let inside = |p: &DVec3| view.planes.iter().all(|pl| pl.normal.dot(*p - view.eye) + pl.offset_m >= 0.0);
            assert!(planes[t as usize] || !scene.corners(t).iter().any(inside), "triangle {t} is lost");
        }
    }
}

#[test]
fn without_partition_planes_the_box_stands_for_the_node() {
    let scene = soup(20, 1000, 40.0, 1.0);
    let h = tree(&scene, 8, 0);
    for view in views(8, 40.0) {
        let [a, b] = ["plane", "box"]
            .map(|t| Method::new(&scene, &h, &format!("frustum:node_test={t}"), "depth_first").frame(&view));
        assert_eq!(a, b);
    }
}
