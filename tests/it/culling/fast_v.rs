//! The walk by frusta before the oracle (D7.1): every kind of structure, ordinary and
//! degenerate scenes, cameras where rounding would show.

use super::portals::{cameras, facing, poses, scene};
use crate::common::soup;
use crate::structures::scene_of;
use cullmark::culling::{Class, make_tests, make_walk};
use cullmark::math::{Camera, DVec3, Pose, Projection};
use cullmark::oracle::{Truth, truth};
use cullmark::record::Accuracy;
use cullmark::registry::{Spec, parse_sum};
use cullmark::runner::Setup;
use cullmark::scene::Scene;
use cullmark::structure;

/// One of each kind, with every policy for what straddles.
const STRUCTURES: [&str; 14] = [
    "octree",
    "list",
    "octree:policy=E,depth=5",
    "octree:policy=R,depth=3",
    "octree:policy=S,depth=3",
    "uniform_grid",
    "uniform_grid:policy=R,layout=rows",
    "irregular_grid",
    "nested_grid",
    "kd_tree",
    "bvh",
    "bsp",
    "portal_octree:depth=4",
    "octree:depth=6,leaf_limit=4",
];

const WALKS: [&str; 6] = [
    "fast_v:g=32",
    "fast_v:g=16,depth=plane",
    "fast_v:g=64,subdivision=adaptive,limit=8",
    "fast_v:g=16,grow=1",
    "fast_v:g=1",
    "fast_v:g=8,grow=2000",
];

const SUMS: [&str; 3] = ["none", "frustum", "frustum+normal_mask"];

pub fn truth_of(scene: &Scene, camera: &Camera, poses: &[Pose], witness_rays: u32) -> Truth {
    let accuracy = Accuracy { frames: 4, width_px: 96, height_px: 54, samples: 1, witness_rays, hiding_cells: 0 };
    let numbered: Vec<(u32, Pose)> = (0u32..).zip(poses.iter().copied()).collect();
    truth(scene, camera, &numbered, &accuracy)
}

/// Judges a walk over a structure on every pose of `truth`; triangles submitted in all.
pub fn judged(scene: &Scene, camera: &Camera, poses: &[Pose], truth: &Truth, parts: [&str; 3]) -> u64 {
    let [on, culling, walk] = parts;
    let what = format!("{} over {on}, {culling}, {walk}", scene.name);
    let structure = structure::make(&Spec::parse(on).unwrap()).unwrap().0;
    let tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
    let made = make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
    let mut setup =
        Setup::from_parts(scene.clone(), poses.to_vec(), camera, structure.as_ref(), tests, made).expect(&what);
    assert!(setup.class == Class::Conservative && setup.removes.occluded && setup.removes.back_facing);
    let judgement = setup.judge(truth);
    for f in &judgement.frames {
        assert_eq!(f.false_culls, 0, "{what}: {f:?} at {:?}", poses[f.frame as usize]);
    }
    assert_eq!(judgement.wrong, None, "{what}");
    judgement.frames.iter().map(|f| f.submitted).sum()
}

/// By turns, so that all pairs are met over a few scenes.
fn some(turn: usize) -> impl Iterator<Item = [&'static str; 3]> {
    (0..STRUCTURES.len()).map(move |i| {
        let at = i + turn;
        [STRUCTURES[i], SUMS[(at + at / 3) % SUMS.len()], WALKS[at % WALKS.len()]]
    })
}

// D7.1
#[test]
fn nothing_that_is_seen_is_lost() {
    for (turn, name) in
        ["rooms", "blocks", "arena:triangles=14000", "spheres:spheres=9,level=4"].into_iter().enumerate()
    {
        let mut scene = scene(name);
        let eyes = [("inside", "any", 7), ("outside", "scene", 3)];
        let all: Vec<Pose> = eyes
            .iter()
            .flat_map(|(eyes, aim, n)| poses(&format!("random:frames={n},eyes={eyes},aim={aim}"), &scene))
            .collect();
        // Some walls are glass, some have no back.
        for t in (0..scene.len()).step_by(11) {
            scene.two_sided[t] = t % 2 == 0;
            scene.occluder[t] = t % 3 != 0;
        }
        for (j, camera) in cameras(12.0).into_iter().enumerate() {
            let truth = truth_of(&scene, &camera, &all, if j == 0 { 8 } else { 0 });
            for parts in some(turn + j).skip(j).step_by(3) {
                judged(&scene, &camera, &all, &truth, parts);
            }
        }
    }
}

#[test]
fn nothing_is_lost_of_soups_and_far_from_the_origin() {
    let mut far = scene("rooms");
    far.positions.iter_mut().for_each(|p| *p += DVec3::new(2.0e6, -1.0e6, 3e5));
    far.anchor();
    let mut huge = scene("rooms");
    huge.positions.iter_mut().for_each(|p| *p = *p * 1e5 + DVec3::new(3e8, 1e9, -7e8));
    huge.anchor();
    for (turn, scene) in [far, huge, soup(41, 2500, 20.0, 1.5), soup(42, 300, 6.0, 9.0)].iter().enumerate() {
        let poses = poses("random:frames=8,aim=any", scene);
        for (j, camera) in cameras(12.0).into_iter().enumerate() {
            let truth = truth_of(scene, &camera, &poses, 4);
            for parts in some(turn).skip(j).step_by(3) {
                judged(scene, &camera, &poses, &truth, parts);
            }
        }
    }
}

#[test]
fn nothing_is_lost_of_degenerate_scenes() {
    let made = ["slivers:slivers=200", "coplanar:boxes=30", "coplanar:boxes=30,ulps=1", "degenerate:boxes=30"];
    let scenes = crate::structures::scenes().into_iter().chain(made.map(scene));
    for (turn, scene) in scenes.filter(|s| s.len() < 1500 && !s.is_empty()).enumerate() {
        let b = scene.bounds();
        let reach = b.size().max_element().max(1.0);
        let around = [DVec3::ZERO, DVec3::new(0.7, -0.6, 0.5), DVec3::new(-0.9, 0.0, 0.0), DVec3::new(0.0, 0.0, 0.4)];
        let looking = |(i, at): (usize, &DVec3)| {
            let eye = b.centre() + *at * reach;
            facing(eye, if i == 0 { DVec3::X } else { b.centre() - eye })
        };
        let poses: Vec<Pose> = around.iter().enumerate().map(looking).collect();
        for (j, camera) in cameras(reach).into_iter().enumerate() {
            let truth = truth_of(&scene, &camera, &poses, 4);
            for parts in some(turn + j).skip(j).step_by(3) {
                judged(&scene, &camera, &poses, &truth, parts);
            }
        }
    }
}

/// Eyes in planes of triangles, on edges and corners, looking along them; the near plane
/// through triangles and behind them.
fn awkward(scene: &Scene) -> Vec<Pose> {
    let mut out = Vec::new();
    for i in 0..12 {
        let t = (i * 7919 + 3) as u32 % scene.len() as u32;
        let [a, b, c] = scene.corners(t);
        let normal = scene.normal(t).normalize_or(DVec3::Z);
        let along = (b - a).normalize_or(DVec3::X);
        let (middle, size) = ((a + b + c) / 3.0, (b - a).length());
        out.push(match i % 6 {
            0 => facing(a, along),
            1 => facing((a + b) * 0.5, normal),
            2 => facing(middle + along * 3.0 * size, -along),
            3 => facing(middle + normal * 0.06, -normal),
            4 => facing(a - along * size, along),
            _ => facing(middle + normal * 0.1, (-normal + along * 0.3).normalize()),
        });
    }
    out
}

#[test]
fn nothing_is_lost_from_the_plane_of_a_triangle_from_its_edge_and_through_the_near_plane() {
    let rooms = scene("rooms:triangles=5500");
    let [p, q] = [DVec3::new(0.0, -4.0, -4.0), DVec3::new(0.0, 4.0, 4.0)];
    // A grid of squares: from its axis all edges pass through rays of frusta.
    let square = |x: f64, n: i32| {
        let at = move |i: i32, j: i32| {
            DVec3::new(x, f64::from(i) / f64::from(n) * 8.0, f64::from(j) / f64::from(n) * 8.0) + p
        };
        (0..n * n).flat_map(move |k| {
            let (i, j) = (k % n, k / n);
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, c, b], [a, d, c]]
        })
    };
    let squares: Vec<_> = square(4.0, 8).chain(square(6.0, 5)).chain(square(5.0, 1)).collect();
    let squares = scene_of("squares", &squares);
    assert!(squares.bounds().contains(q + DVec3::X * 5.0));
    for (turn, scene) in [rooms, squares].iter().enumerate() {
        let mut poses = awkward(scene);
        poses.push(facing(DVec3::ZERO, DVec3::X));
        poses.push(facing(DVec3::new(3.95, 0.0, 0.0), DVec3::X));
        poses.push(facing(DVec3::new(4.0, 0.0, 0.0), DVec3::Y));
        let wide = Camera { projection: Projection::Perspective { fov_y_rad: 3.0 }, ..Camera::default() };
        let narrow = Camera { projection: Projection::Perspective { fov_y_rad: 1e-3 }, ..Camera::default() };
        let square =
            Camera { projection: Projection::Perspective { fov_y_rad: 90f64.to_radians() }, aspect: 1.0, ..wide };
        for (j, camera) in cameras(8.0).into_iter().chain([wide, narrow, square]).enumerate() {
            let truth = truth_of(scene, &camera, &poses, 8);
            for parts in some(turn + j).skip(j % 4).step_by(4) {
                judged(scene, &camera, &poses, &truth, parts);
            }
        }
    }
}
