//! Every structure, culling test and walk before the oracle.

use super::{accuracy, cameras};
use crate::common::{shared, soup};
use cullmark::culling::{Class, WALKS, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, DVec3, Pose};
use cullmark::oracle::image::Grid;
use cullmark::oracle::{Truth, judged_frames, truth};
use cullmark::record::{Accuracy, FrameErrors, PathSource, PathSpec, SceneSource, Up, Winding};
use cullmark::registry::{Spec, parse_sum};
use cullmark::runner::Setup;
use cullmark::scene::{Scene, load, walkthrough};
use cullmark::structure::Structure;

/// Structures in every variant that changes what they submit.
fn structures() -> Vec<String> {
    let mut all = vec!["list".to_string(), "list:leaf_size=7".into(), "octree:depth=4,leaf_limit=16".into()];
    for policy in ["L", "R", "S", "E"] {
        for root in ["aabb", "cube"] {
            all.push(format!("octree:depth=3,policy={policy},root={root}"));
        }
    }
    all.push("octree:depth=2,leaves=facing".into());
    all.extend(["walls", "middle"].map(|planes| format!("portal_octree:depth=3,planes={planes}")));
    all.extend(["wide", "binary"].map(|layout| format!("bsp:min_leaf=40,layout={layout}")));
    let cells = [
        "uniform_grid:density=0.5",
        "uniform_grid:density=0.5,policy=R,layout=rows",
        "irregular_grid:nx=6,ny=6,nz=3,policy=S",
        "irregular_grid:nx=6,ny=6,nz=3,planes=walls,layout=rows",
        "nested_grid:density=0.5,leaf_limit=20",
        "nested_grid:density=0.25,leaf_limit=20,policy=R,layout=flat",
        "kd_tree:leaf_size=24",
        "kd_tree:leaf_size=24,policy=S,layout=binary",
    ];
    all.extend(cells.map(String::from));
    all.extend(["bvh:leaf_size=16".to_string(), "bvh:split=morton,leaf_size=24,layout=binary".into()]);
    all
}

const CULLINGS: [&str; 32] = [
    "none",
    "frustum",
    "frustum:plane_mask=false",
    "frustum:last_plane=true",
    "frustum:node_test=box_plane",
    "normal_mask",
    "octant_mask",
    "frustum+normal_mask",
    "frustum+octant_mask",
    "back_face:arithmetic=f32_world",
    "back_face:arithmetic=f32_world,form=difference",
    "back_face:arithmetic=f32_relative",
    "back_face:arithmetic=f64",
    "back_face:arithmetic=filtered",
    "back_face:arithmetic=exact",
    "back_face:arithmetic=fixed_q16",
    "frustum+normal_cone+back_face",
    "look_at",
    "sector",
    "sector:rule=averted",
    "sector:rule=safe,sectors=16",
    "normal_cone",
    "normal_cone:form=tight",
    "normal_cone:form=apex",
    "normal_mask:rays=node",
    "frustum:primitive=sphere",
    "frustum:primitive=point",
    "frustum:last_plane=true,octant=true,sat=true",
    "normal_mask:saturation=0.5",
    "octant_mask:saturation=0.5",
    "mailbox",
    "frustum+mailbox+back_face",
];

/// Walks that skip what a scene does not need, and tests to be skipped.
const SKIPPING: [&str; 4] =
    ["depth_first:small=60,still=true", "flat:still=true", "depth_first:whole_below=100000", "flat:whole_below=100000"];
const SKIPPED: [&str; 4] =
    ["frustum+normal_mask", "frustum:octant=true+back_face:arithmetic=filtered", "look_at", "frustum+mailbox"];

/// What walks that leave out what is hidden are judged with: their queries are the work, and
/// the tests before them matter little.
const BEFORE_HIDING: [&str; 3] = ["none", "frustum", "frustum+back_face:arithmetic=filtered"];

/// Structures that meet such walks: those walks are slow beside the others, and of variants
/// that differ in shape alone one will do. All tests on the first, one on each of the rest.
const UNDER_HIDING: [&str; 12] = [
    "bvh:leaf_size=16",
    "list:leaf_size=7",
    "octree:depth=4,leaf_limit=16",
    "octree:depth=3,policy=R,root=cube",
    "octree:depth=3,policy=S,root=aabb",
    "octree:depth=3,policy=E,root=aabb",
    "portal_octree:depth=3,planes=walls",
    "bsp:min_leaf=40,layout=wide",
    "uniform_grid:density=0.5,policy=R,layout=rows",
    "irregular_grid:nx=6,ny=6,nz=3,policy=S",
    "nested_grid:density=0.5,leaf_limit=20",
    "kd_tree:leaf_size=24",
];

/// Every culling with every walk over the structure, then the skipping ones, then those
/// that leave out what is hidden, as the registry has them.
fn methods(structure: &str) -> Vec<(&'static str, &'static str)> {
    let all = CULLINGS.into_iter().flat_map(|c| walks(structure).iter().map(move |w| (c, *w)));
    let skipping = SKIPPED.into_iter().flat_map(|c| SKIPPING.map(|w| (c, w)));
    let before = match UNDER_HIDING.iter().position(|s| *s == structure) {
        None => &[],
        Some(0) => &BEFORE_HIDING[..],
        Some(i) => &BEFORE_HIDING[i % 3..][..1],
    };
    let hiding = hiding_walks().into_iter().flat_map(|w| before.iter().map(move |c| (*c, w)));
    all.chain(skipping).chain(hiding).collect()
}

/// Walks entitled to leave out what is hidden, with their defaults, but for `portals`,
/// which one structure alone serves and the cross has already.
fn hiding_walks() -> Vec<&'static str> {
    let hides = |name: &str| make_walk(&Spec::new(name)).unwrap().0.removes().occluded;
    WALKS.iter().map(|w| w.name).filter(|w| *w != "portals" && hides(w)).collect()
}

fn generated(spec: &str) -> Scene {
    let spec = Spec::parse(spec).unwrap();
    cullmark::scene::generate::make(&spec).unwrap().0.generate()
}

/// Views from inside the scene, all around and a little up and down.
fn look_around(scene: &Scene, count: u32) -> Vec<Pose> {
    let b = scene.bounds();
    (0..count)
        .map(|i| {
            let (share, turn) = ((f64::from(i) + 0.5) / f64::from(count), f64::from(i) * 2.4);
            let eye = b.lo + b.size() * DVec3::new(0.2 + 0.6 * share, 0.8 - 0.6 * share, 0.35);
            let forward = DVec3::new(libm::cos(turn), libm::sin(turn), 0.4 * libm::sin(turn * 3.0)).normalize();
            Pose { eye, forward, up: DVec3::Z }
        })
        .collect()
}

/// A structure that is built already: one build serves every method on it.
struct Built(Hierarchy);

impl Structure for Built {
    fn build(&self, _: &Scene) -> cullmark::Result<Hierarchy> {
        Ok(self.0.clone())
    }
}

fn walks(structure: &str) -> &'static [&'static str] {
    let all = &["depth_first", "flat", "portals", "portals:clip=false"];
    if structure.starts_with("portal_octree") { all } else { &all[..2] }
}

/// Judges every pair over `poses`; returns how many were judged or refused. Truth is shared.
fn all_pairs_face_the_oracle(scene: &Scene, camera: &Camera, poses: &[Pose], accuracy: &Accuracy) -> usize {
    let numbered: Vec<(u32, Pose)> = (0u32..).zip(poses.iter().copied()).collect();
    let truth_of = |accuracy: &Accuracy| truth(scene, camera, &numbered, accuracy);
    let truth = truth_of(accuracy);
    let seen: usize = truth.frames.iter().map(|f| f.visible.len()).sum();
    assert!(seen > 20 * poses.len(), "{} shows next to nothing", scene.name);
    // Of walks with samples of their own: one truth for all with the same.
    let mut at_own: Vec<Truth> = Vec::new();
    for (width_px, height_px) in hiding_walks().iter().filter_map(|w| make_walk(&Spec::new(w)).unwrap().0.samples()) {
        let own = Accuracy { width_px, height_px, samples: 1, ..accuracy.clone() };
        if at_own.iter().all(|t| t.frames[0].grid != Grid::of(&own)) {
            at_own.push(truth_of(&own));
        }
    }
    let judged = |structure: &String| -> usize {
        let made = cullmark::structure::make(&Spec::parse(structure).unwrap()).unwrap().0;
        let built = Built(made.build(scene).unwrap());
        let (mut judged, mut refused) = (0, 0);
        for (culling, walk) in methods(structure) {
            let tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
            let walk_made = make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
            let method = format!("{} {structure} {culling} {walk}", scene.name);
            if let Some(why) = walk_made.refuses(&built.0) {
                // A structure may lack what such a walk needs, but never a tree of boxes.
                assert!(walk_made.removes().occluded && !structure.starts_with("bvh"), "{method}: {why}");
                refused += 1;
                continue;
            }
            judged += 1;
            let parts = Setup::from_parts(scene.clone(), poses.to_vec(), camera, &built, tests, walk_made);
            let mut setup = parts.unwrap();
            let own = setup.promised_at(Grid::of(accuracy)).map(|own| {
                at_own.iter().find(|t| t.frames[0].grid == Grid::of(&own)).expect("a truth for all samples")
            });
            let judgement = setup.judge_by(&truth, own);
            assert_eq!(judgement.wrong, None, "{method}");
            let sum = |of: fn(&FrameErrors) -> u64| judgement.frames.iter().map(of).sum::<u64>();
            assert_eq!(judgement.frames.len(), poses.len());
            if judgement.class <= Class::Conservative {
                assert_eq!(sum(|f| f.false_culls + f.potential_lost + f.false_cull_pixels), 0, "{method}");
            } else if sum(|f| f.false_culls) > 0 {
                println!(
                    "{method}: lost {} of {} visible triangles, {} of {} pixels",
                    sum(|f| f.false_culls),
                    sum(|f| f.visible),
                    sum(|f| f.false_cull_pixels),
                    sum(|f| f.covered_pixels)
                );
            }
        }
        judged + refused
    };
    use rayon::prelude::*;
    structures().par_iter().map(judged).sum()
}

#[test]
fn every_structure_x_culling_pair_faces_the_oracle() {
    assert!(UNDER_HIDING.iter().all(|s| structures().iter().any(|known| known == s)));
    let pairs: usize = structures().iter().map(|s| methods(s).len()).sum();
    let around = DVec3::new(2.0e6, -1.0e6, 300.0);
    for (spec, offset) in [("rooms", DVec3::ZERO), ("blocks", around)] {
        let mut scene = generated(spec);
        scene.positions.iter_mut().for_each(|p| *p += offset);
        scene.anchor();
        // A few leaves and panes: two-sided, not hiding.
        for t in (0..scene.len()).step_by(9) {
            scene.two_sided[t] = true;
            scene.occluder[t] = t % 2 == 0;
        }
        let poses = look_around(&scene, 3);
        assert_eq!(all_pairs_face_the_oracle(&scene, &Camera::default(), &poses, &accuracy(160, 90, 1)), pairs);
    }
    let scene = soup(12, 1500, 10.0, 0.6);
    for camera in cameras() {
        let mut poses = look_around(&scene, 2);
        // The camera rests at the last place, and what is reused is judged.
        poses.push(poses[1]);
        assert_eq!(all_pairs_face_the_oracle(&scene, &camera, &poses, &accuracy(96, 54, 1)), pairs);
    }
}

#[test]
fn every_pair_faces_the_oracle_on_a_real_map() {
    let Some(obj) = shared("q3_czest3ctf/q3_czest3ctf.obj") else { return };
    let source = SceneSource::File(obj);
    let spec = load::describe("q3_czest3ctf", source, Winding::Ccw, Some(Up::Z), 0.0254, false).unwrap();
    let scene = load::load(&spec).unwrap();
    let source = PathSource::File(shared("q3_czest3ctf/q3_czest3ctf_path1.csv").unwrap());
    let path = PathSpec { name: "path1".into(), source, frames: None, stride: 1, fingerprint: String::new() };
    let poses = walkthrough::load(&path, &spec, &scene).unwrap();
    let judged: Vec<Pose> =
        judged_frames(poses.len() as u32, &accuracy(1, 1, 1)).into_iter().map(|f| poses[f as usize]).collect();
    all_pairs_face_the_oracle(&scene, &Camera::default(), &judged, &accuracy(160, 90, 1));
}
