//! Mutations: a method with one thing broken must be judged wrong, and the same
//! method whole must be judged right. What is broken is named by its test.

use super::{accuracy, empty, pose};
use crate::common::soup;
use cullmark::culling::{Class, DrawList, Removes, Tally, Test, Verdict, Walk, depth_first::DepthFirst};
use cullmark::hierarchy::{Hierarchy, NONE};
use cullmark::math::{Camera, DVec3, Pose, Vec3, View, predicates};
use cullmark::oracle::volume::{Meets, triangle_meets};
use cullmark::oracle::{Truth, truth, verdict};
use cullmark::record::Judgement;
use cullmark::registry::Spec;
use cullmark::runner::Setup;
use cullmark::scene::Scene;

/// What is wrong with a method.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Broken {
    Nothing,
    FacingSign,
    PlaneSign(usize),
    PlaneMissing(usize),
    /// The mask of one octant of normals has lost its bit.
    MaskBit(u8),
    /// Single precision in world coordinates instead of a guarded test.
    Guard,
    ChildSkipped,
    EntryDropped,
}

/// Keeps exactly the triangles that meet the view volume and face the eye, one by one.
struct ByTriangle {
    broken: Broken,
    scene: Scene,
    view: Option<View>,
}

impl ByTriangle {
    fn keeps(&self, t: u32) -> bool {
        let mut view = self.view.clone().expect("the frame has begun");
        let corners = self.scene.corners(t);
        match self.broken {
            Broken::PlaneSign(k) => {
                view.planes[k].normal = -view.planes[k].normal;
                view.planes[k].offset_m = -view.planes[k].offset_m;
            }
            Broken::PlaneMissing(k) => _ = view.planes.remove(k),
            Broken::Guard => return f32_world_inside(&view, &corners),
            _ => {}
        }
        let [a, b, c] = corners;
        let mut front = predicates::facing(a, b, c, view.eye) == predicates::Facing::Front;
        if self.broken == Broken::FacingSign {
            front = !front;
        }
        let n = self.scene.normal(t);
        let octant = u8::from(n.x > 0.0) | u8::from(n.y > 0.0) << 1 | u8::from(n.z > 0.0) << 2;
        triangle_meets(&view, &corners) != Meets::CertainlyNot && front && self.broken != Broken::MaskBit(octant)
    }
}

/// As a careless engine tests a plane: all corners behind it, in f32 world coordinates.
fn f32_world_inside(view: &View, corners: &[DVec3; 3]) -> bool {
    let single = |p: DVec3| Vec3::new(p.x as f32, p.y as f32, p.z as f32);
    view.planes.iter().all(|plane| {
        let offset = (plane.offset_m - plane.normal.dot(view.eye)) as f32;
        corners.iter().any(|c| single(plane.normal).dot(single(*c)) + offset >= 0.0)
    })
}

impl Test for ByTriangle {
    fn class(&self) -> Class {
        Class::Conservative
    }

    fn removes(&self) -> Removes {
        let back_facing = self.broken != Broken::Guard;
        Removes { outside_frustum: true, back_facing, occluded: false }
    }

    fn prepare(&mut self, scene: &Scene, _: &Hierarchy) -> usize {
        self.scene = scene.clone();
        0
    }

    fn begin(&mut self, view: &View, _: &Hierarchy) {
        self.view = Some(view.clone());
    }

    fn initial_carry(&self) -> u8 {
        1
    }

    fn judge(&mut self, _: &Hierarchy, _: u32, _: u8, _: u8, _: &mut Tally) -> Verdict {
        Verdict { outside: 0, carry: [1; 8] }
    }

    fn filter(&mut self, hierarchy: &Hierarchy, list: &mut DrawList, _: &mut Tally) {
        list.retain(|p| self.keeps(hierarchy.entries[p as usize]));
        if self.broken == Broken::EntryDropped {
            let middle = list.entry_count() as u32 / 2;
            let mut at = 0;
            list.retain(|_| {
                at += 1;
                at - 1 != middle
            });
        }
    }
}

/// Depth first, but one child of the root is forgotten.
struct Forgetful(DepthFirst);

impl Walk for Forgetful {
    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn run(&mut self, view: &View, h: &Hierarchy, tests: &mut [Box<dyn Test>], out: &mut DrawList, tally: &mut Tally) {
        self.0.run(view, h, tests, out, tally);
        let root = h.links[0];
        let links = h.links[root.child[0] as usize];
        let (first, end) = (links.first[1], links.end[1]);
        assert!(root.child[0] != NONE && first < end, "the second child holds something");
        out.retain(|p| !(first..end).contains(&p));
    }
}

struct Bench {
    scene: Scene,
    poses: Vec<Pose>,
    truth: Truth,
}

impl Bench {
    fn new(offset: DVec3) -> Bench {
        let mut scene = soup(77, 1500, 10.0, 1.2);
        scene.positions.iter_mut().for_each(|p| *p += offset);
        scene.anchor();
        let poses = vec![pose(offset + DVec3::new(-7.0, 0.0, 0.0)), pose(offset + DVec3::new(-2.0, -3.0, 1.0))];
        Bench::of(scene, poses)
    }

    fn of(scene: Scene, poses: Vec<Pose>) -> Bench {
        let numbered: Vec<(u32, Pose)> = (0u32..).zip(poses.iter().copied()).collect();
        let truth = truth(&scene, &Camera::default(), &numbered, &accuracy(120, 68, 1));
        Bench { scene, poses, truth }
    }

    fn judge(&self, broken: Broken) -> Judgement {
        let test = ByTriangle { broken, scene: Scene::default(), view: None };
        let structure = cullmark::structure::make(&Spec::parse("octree:depth=3").unwrap()).unwrap().0;
        let walk: Box<dyn Walk> = match broken {
            Broken::ChildSkipped => Box::new(Forgetful(DepthFirst::default())),
            _ => Box::new(DepthFirst::default()),
        };
        let camera = Camera::default();
        let tests: Vec<Box<dyn Test>> = vec![Box::new(test)];
        let (scene, poses) = (self.scene.clone(), self.poses.clone());
        Setup::from_parts(scene, poses, &camera, structure.as_ref(), tests, walk).unwrap().judge(&self.truth)
    }
}

#[test]
fn every_mutation_is_judged_wrong_and_the_whole_method_right() {
    let bench = Bench::new(DVec3::ZERO);
    let whole = bench.judge(Broken::Nothing);
    assert_eq!((whole.wrong, verdict(Class::Exact, &whole.frames)), (None, None));
    let mut mutations = vec![Broken::FacingSign, Broken::ChildSkipped, Broken::EntryDropped];
    mutations.extend((0..5).map(Broken::PlaneSign));
    mutations.extend((0..8).filter(|o| *o != 0b111).map(Broken::MaskBit));
    let mut caught = 0;
    for broken in mutations {
        let judged = bench.judge(broken);
        // The octants of normals that all look away hold nothing to lose.
        if let Broken::MaskBit(octant) = broken {
            let less = judged.frames.iter().zip(&whole.frames).any(|(a, b)| a.submitted < b.submitted);
            assert_eq!(judged.wrong.is_some(), less, "octant {octant}");
            caught += u32::from(less);
            continue;
        }
        assert!(judged.wrong.is_some(), "{broken:?} was not caught");
        assert!(judged.frames.iter().any(|f| f.potential_lost > 0), "{broken:?}");
        caught += 1;
    }
    assert!(caught >= 12, "{caught} mutations bite");
}

#[test]
fn a_dropped_entry_is_caught_though_it_may_be_hidden_from_every_sample() {
    let bench = Bench::new(DVec3::ZERO);
    let judged = bench.judge(Broken::EntryDropped);
    let lost: u64 = judged.frames.iter().map(|f| f.potential_lost).sum();
    assert_eq!(lost, bench.poses.len() as u64, "one a frame, no more and no less");
}

#[test]
fn a_missing_plane_is_no_loss_and_yet_not_exact() {
    let bench = Bench::new(DVec3::ZERO);
    for k in 0..4 {
        let judged = bench.judge(Broken::PlaneMissing(k));
        assert_eq!(judged.wrong, None, "plane {k}: submitting more is conservative");
        assert!(verdict(Class::Exact, &judged.frames).unwrap().contains("the exact set holds"), "plane {k}");
    }
}

#[test]
fn single_precision_without_a_guard_is_caught_far_from_the_origin_and_not_near() {
    // Small triangles along the left border of the view, some millimetres inside.
    let build = |offset: DVec3| {
        let at = Pose { eye: offset, forward: DVec3::X, up: DVec3::Z };
        let view = View::new(&Camera::default(), &at);
        let mut scene = empty();
        for i in 0..400 {
            let depth = 3.0 + f64::from(i) * 0.05;
            let inside = 1e-3 + f64::from(i % 40) * 1e-4;
            let z = f64::from(i % 21 - 10) * 0.02;
            let place = |aside: f64, up: f64| {
                view.forward * depth - view.right * (view.half_width * depth - aside) + view.up * (z + up)
            };
            let corners = [place(inside, 0.0), place(-0.3, 0.1), place(-0.3, -0.1)].map(|p| p + offset);
            super::push(&mut scene, corners, true, true);
        }
        scene.anchor();
        Bench::of(scene, vec![at])
    };
    let near = build(DVec3::ZERO).judge(Broken::Guard);
    assert_eq!(near.wrong, None, "millimetres are far above rounding here");
    let far = build(DVec3::new(3.1e5, -2.7e5, 150.0)).judge(Broken::Guard);
    assert!(far.wrong.is_some(), "a step of f32 is three centimetres here");
    assert!(far.frames[0].potential_lost > 10);
}
