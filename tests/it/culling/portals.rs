//! The walk through portals before the oracle (A8.1), and against single rays.

use super::walks::Method;
use crate::common::soup;
use crate::structures::portal_octree::pane;
use cullmark::culling::{Class, make_tests, make_walk};
use cullmark::hierarchy::{Hierarchy, LANES, NONE, Portals, portals::CLOSED};
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::oracle::{Truth, truth};
use cullmark::record::Accuracy;
use cullmark::registry::{Spec, parse_sum};
use cullmark::runner::Setup;
use cullmark::scene::{Scene, generate, walkthrough};
use cullmark::structure::{self, Structure};

pub const WALKS: [&str; 2] = ["portals", "portals:clip=false"];

pub fn scene(spec: &str) -> Scene {
    generate::make(&Spec::parse(spec).unwrap()).unwrap().0.generate()
}

pub fn poses(spec: &str, scene: &Scene) -> Vec<Pose> {
    walkthrough::generate::make(&Spec::parse(spec).unwrap()).unwrap().0.walk(scene).unwrap()
}

pub fn build(spec: &str, scene: &Scene) -> Hierarchy {
    let h = structure::make(&Spec::parse(spec).unwrap()).unwrap().0.build(scene).unwrap();
    h.assert_well_formed(scene);
    h
}

pub fn cameras(height_m: f64) -> [Camera; 3] {
    [
        Camera::default(),
        Camera { near_m: 1.5, far_m: Some(height_m), ..Camera::default() },
        Camera { projection: Projection::Orthographic { height_m }, far_m: Some(4.0 * height_m), ..Camera::default() },
    ]
}

/// Random poses moved to where mistakes would show: onto planes of cells and their
/// edges, and so close to a triangle that the near plane cuts it.
pub fn awkward(h: &Hierarchy, scene: &Scene, poses: &[Pose]) -> Vec<Pose> {
    let cells = h.portals.as_ref().unwrap();
    let moved = |(i, pose): (usize, &Pose)| {
        let mut pose = *pose;
        match i % 4 {
            0 | 1 => {
                for axis in (0..=i % 2).map(|k| (i / 4 + k) % 3) {
                    let at = cells.touching(axis, pose.eye[axis], pose.eye[axis]);
                    pose.eye[axis] = cells.planes[axis][at.start.min(cells.side())];
                }
                // Along the plane, exactly.
                if i % 8 == 1 {
                    let axis = i / 8 % 3;
                    pose.forward = DVec3::AXES[axis] * if i % 16 == 1 { 1.0 } else { -1.0 };
                    pose.up = DVec3::AXES[(axis + 2) % 3];
                }
            }
            2 => {
                let t = (i * 7919) as u32 % scene.len() as u32;
                let [a, b, c] = scene.corners(t);
                let normal = scene.normal(t).normalize();
                pose.eye = (a + b + c) / 3.0 + normal * 0.06;
                let ahead = if i % 8 == 2 { -normal } else { pose.forward };
                pose = facing(pose.eye, ahead);
            }
            _ => {}
        }
        pose
    };
    poses.iter().enumerate().map(moved).collect()
}

pub fn facing(eye: DVec3, forward: DVec3) -> Pose {
    let up = if forward.z.abs() > 0.9 * forward.length() { DVec3::X } else { DVec3::Z };
    Pose { eye, forward: forward.normalize(), up }
}

struct Built(Hierarchy);

impl Structure for Built {
    fn build(&self, _: &Scene) -> cullmark::Result<Hierarchy> {
        Ok(self.0.clone())
    }
}

/// Judges both walks, alone and with the frustum, on every pose.
fn face_the_oracle(scene: &Scene, h: &Hierarchy, camera: &Camera, poses: &[Pose], truth: &Truth, what: &str) {
    for walk in WALKS {
        for culling in ["none", "frustum"] {
            let tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
            let walk_made = make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
            let built = Built(h.clone());
            let mut setup = Setup::from_parts(scene.clone(), poses.to_vec(), camera, &built, tests, walk_made).unwrap();
            assert!(setup.class == Class::Conservative && setup.removes.occluded);
            let judgement = setup.judge(truth);
            for f in &judgement.frames {
                assert_eq!(f.false_culls, 0, "{what} {culling} {walk}: {f:?} at {:?}", poses[f.frame as usize]);
            }
            assert_eq!(judgement.wrong, None, "{what} {culling} {walk}");
        }
    }
}

fn truth_of(scene: &Scene, camera: &Camera, poses: &[Pose], accuracy: &Accuracy) -> Truth {
    let numbered: Vec<(u32, Pose)> = (0u32..).zip(poses.iter().copied()).collect();
    truth(scene, camera, &numbered, accuracy)
}

const SMALL: Accuracy =
    Accuracy { frames: 4, width_px: 96, height_px: 54, samples: 1, witness_rays: 0, hiding_cells: 0 };

pub const STRUCTURES: [&str; 3] =
    ["portal_octree:depth=5", "portal_octree:depth=4,planes=middle", "portal_octree:depth=3,texels=5"];

// A8.1
#[test]
fn nothing_that_is_seen_is_lost() {
    for name in ["rooms", "rooms:world=4", "blocks", "arena:triangles=14000"] {
        let mut scene = scene(name);
        let drawn = [("inside", 16), ("outside", 6)].map(|(eyes, n)| {
            poses(
                &format!("random:frames={n},eyes={eyes},aim={}", if eyes == "inside" { "any" } else { "scene" }),
                &scene,
            )
        });
        // Some walls are glass, some have no back.
        for t in (0..scene.len()).step_by(11) {
            scene.two_sided[t] = t % 2 == 0;
            scene.occluder[t] = t % 3 != 0;
        }
        for (i, structure) in STRUCTURES.into_iter().enumerate() {
            let h = build(structure, &scene);
            let all = [awkward(&h, &scene, &drawn[0]), drawn[1].clone()].concat();
            for (j, camera) in cameras(12.0).into_iter().enumerate() {
                // Rays find what samples miss; they cost more.
                let accuracy = Accuracy { witness_rays: if (i + j) % 3 == 0 { 8 } else { 0 }, ..SMALL };
                let truth = truth_of(&scene, &camera, &all, &accuracy);
                face_the_oracle(&scene, &h, &camera, &all, &truth, &format!("{name} {structure}"));
            }
        }
    }
}

#[test]
fn nothing_is_lost_far_from_the_origin_and_without_walls() {
    let mut far = scene("rooms");
    far.positions.iter_mut().for_each(|p| *p += DVec3::new(2.0e6, -1.0e6, 3e5));
    far.anchor();
    for scene in [far, soup(41, 2500, 20.0, 1.5)] {
        let poses = poses("random:frames=12,aim=any", &scene);
        let h = build("portal_octree", &scene);
        for camera in cameras(12.0) {
            let truth = truth_of(&scene, &camera, &poses, &SMALL);
            face_the_oracle(&scene, &h, &camera, &poses, &truth, &scene.name);
        }
    }
}

#[test]
fn nothing_is_lost_of_degenerate_scenes() {
    for scene in crate::structures::scenes().iter().filter(|s| s.len() < 1000 && !s.is_empty()) {
        let b = scene.bounds();
        let reach = b.size().max_element().max(1.0);
        let around = [DVec3::ZERO, DVec3::new(0.7, -0.6, 0.5), DVec3::new(-0.9, 0.0, 0.0), DVec3::new(0.0, 0.0, 0.4)];
        let looking = |(i, at): (usize, &DVec3)| {
            let eye = b.centre() + *at * reach;
            facing(eye, if i == 0 { DVec3::X } else { b.centre() - eye })
        };
        let poses: Vec<Pose> = around.iter().enumerate().map(looking).collect();
        for structure in STRUCTURES {
            let h = build(structure, scene);
            for camera in cameras(reach) {
                let truth = truth_of(scene, &camera, &poses, &SMALL);
                face_the_oracle(scene, &h, &camera, &poses, &truth, &format!("{} {structure}", scene.name));
            }
        }
    }
}

/// Where one ray goes, cell by cell, until a face is closed to it: nodes it meets.
fn march(h: &Hierarchy, cells: &Portals, view: &View, x: f64, y: f64) -> Vec<u32> {
    let aside = view.right * (x * view.half_width) + view.up * (y * view.half_height);
    let (eye, along) = match view.is_perspective() {
        true => (view.eye, view.forward + aside),
        false => (view.eye + aside, view.forward),
    };
    let at = |t: f64| eye + along * t;
    let near = view.camera.near_m;
    let far = view.camera.far_m.unwrap_or(1e4);
    // Crossings by depth.
    let mut crossings = vec![(near, None), (far, None)];
    for axis in 0..3 {
        for plane in 0..=cells.side() {
            let t = (cells.planes[axis][plane] - eye[axis]) / along[axis];
            if t > near && t < far {
                crossings.push((t, Some((axis, plane))));
            }
        }
    }
    crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut met = Vec::new();
    for pair in crossings.windows(2) {
        if let (t, Some((axis, plane))) = pair[0]
            && plane > 0
            && plane < cells.side()
            && cells.root().contains(at(t))
        {
            let up = along[axis] > 0.0;
            let mut below = [0, 1, 2].map(|a| cells.touching(a, at(t)[a], at(t)[a]).start);
            below[axis] = plane - 1;
            let opening = cells.openings[axis][cells.cell(below)][usize::from(!up)];
            let [lo, hi] = cells.rectangle(axis, below, opening);
            let p = [at(t)[(axis + 1) % 3], at(t)[(axis + 2) % 3]];
            let hair = 1e-9;
            if opening == CLOSED || (0..2).any(|k| p[k] < lo[k] + hair || p[k] > hi[k] - hair) {
                return met;
            }
        }
        let middle = at((pair[0].0 + pair[1].0) * 0.5);
        if !cells.root().contains(middle) {
            continue;
        }
        let node = cells.node[cells.cell([0, 1, 2].map(|a| cells.touching(a, middle[a], middle[a]).start))];
        if node == NONE {
            continue;
        }
        let b = h.bounds[node as usize / LANES].get(node as usize % LANES);
        let [mut from, mut to] = [pair[0].0, pair[1].0];
        for axis in 0..3 {
            let (lo, hi) = (f64::from(b.lo[axis]) + h.origin[axis], f64::from(b.hi[axis]) + h.origin[axis]);
            let [s, t] = [lo, hi].map(|p| (p - eye[axis]) / along[axis]);
            (from, to) = (from.max(s.min(t)), to.min(s.max(t)));
        }
        if from + 1e-9 < to {
            met.push(node);
        }
    }
    met
}

/// The naive twin: single rays, which know no rectangle.
#[test]
fn every_cell_that_a_ray_comes_to_is_submitted() {
    let mut random = crate::structures::policies::random(5);
    let mut walls = Vec::new();
    for _ in 0..150 {
        let axis = (random() * 3.0) as usize;
        let mut number = |n: f64| (random() * n).floor();
        let (at, lo) = (number(17.0), [number(14.0), number(14.0)]);
        let hi = [lo[0] + 1.0 + number(9.0), lo[1] + 1.0 + number(9.0)];
        walls.extend(pane(axis, at, lo, hi.map(|h| h.min(16.0)), number(2.0) > 0.0));
    }
    let maze = crate::structures::scene_of("maze", &walls);
    for scene in [maze, scene("rooms")] {
        for structure in ["portal_octree", "portal_octree:depth=5", "portal_octree:depth=3,planes=middle,texels=6"] {
            let h = build(structure, &scene);
            let cells = h.portals.as_ref().unwrap();
            let mut met = 0;
            let eyes =
                ["inside", "outside"].map(|eyes| poses(&format!("random:frames=40,eyes={eyes},aim=scene"), &scene));
            let eyes = [awkward(&h, &scene, &eyes[0]), eyes[1].clone()].concat();
            for (camera, walk) in cameras(9.0).iter().flat_map(|c| WALKS.map(|w| (c, w))) {
                let mut method = Method::new(&scene, &h, "none", walk);
                for pose in &eyes {
                    let view = View::new(camera, pose);
                    let (out, tally) = method.frame(&view);
                    assert!(out.ranges.is_sorted(), "in order of positions");
                    assert!(tally.cells_reached > 0 || out.ranges.is_empty());
                    let mut drawn = vec![false; h.entries.len()];
                    out.positions().for_each(|p| drawn[p as usize] = true);
                    for _ in 0..60 {
                        for node in march(&h, cells, &view, random() * 2.0 - 1.0, random() * 2.0 - 1.0) {
                            let first = h.links[node as usize / LANES].first[node as usize % LANES];
                            assert!(
                                drawn[first as usize],
                                "{structure} {walk} loses node {node} at {pose:?} {camera:?}"
                            );
                            met += 1;
                        }
                    }
                }
            }
            assert!(met > 20_000, "{} {structure}: {met} cells met", scene.name);
        }
    }
}
