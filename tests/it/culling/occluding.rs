//! What the tests of occluding walks share: scenes, structures, judgement, a naive twin.

use super::portals::{cameras, facing, poses, scene};
use crate::common::soup;
use cullmark::culling::{make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, DVec3, Pose, View};
use cullmark::oracle::{Truth, truth};
use cullmark::record::{Accuracy, Judgement};
use cullmark::registry::{Spec, parse_sum};
use cullmark::runner::Setup;
use cullmark::scene::Scene;
use cullmark::structure::{self, Structure};

pub const SMALL: Accuracy =
    Accuracy { frames: 4, width_px: 96, height_px: 54, samples: 1, witness_rays: 0, hiding_cells: 0 };

/// Scenes with walls to hide behind, and one without; glass and two-sided triangles among
/// them; the last ones far from the origin and full of cracks.
pub fn scenes() -> Vec<Scene> {
    let mut all: Vec<Scene> =
        ["rooms", "blocks", "walls:walls=40,sides=6,slope_deg=5"].iter().map(|s| scene(s)).collect();
    for scene in &mut all {
        for t in (0..scene.len()).step_by(11) {
            scene.two_sided[t] = t % 2 == 0;
            scene.occluder[t] = t % 3 != 0;
        }
    }
    let mut far = scene("rooms");
    far.positions.iter_mut().for_each(|p| *p += DVec3::new(2.0e6, -1.0e6, 3e5));
    far.anchor();
    all.extend([far, soup(51, 900, 10.0, 4.0)]);
    all
}

/// Eyes inside and outside, some of them close to a triangle.
pub fn eyes(scene: &Scene, inside: usize, outside: usize) -> Vec<Pose> {
    let mut all = [
        poses(&format!("random:frames={inside},eyes=inside,aim=any"), scene),
        poses(&format!("random:frames={outside},eyes=outside,aim=scene"), scene),
    ]
    .concat();
    for (i, pose) in all.iter_mut().enumerate().filter(|(i, _)| i % 4 == 2) {
        let t = (i * 7919) as u32 % scene.len() as u32;
        let [a, b, c] = scene.corners(t);
        let eye = (a + b + c) / 3.0 + scene.normal(t).normalize() * 0.06;
        *pose = facing(eye, if i % 8 == 2 { -scene.normal(t) } else { pose.forward });
    }
    all
}

/// Degenerate scenes with views of them.
pub fn degenerate() -> Vec<(Scene, Vec<Pose>, [Camera; 3])> {
    let small = |s: &Scene| s.len() < 1000 && !s.is_empty();
    let with_views = |scene: Scene| {
        let b = scene.bounds();
        let reach = b.size().max_element().max(1.0);
        let around = [DVec3::ZERO, DVec3::new(0.7, -0.6, 0.5), DVec3::new(-0.9, 0.0, 0.0), DVec3::new(0.0, 0.0, 0.4)];
        let looking = |(i, at): (usize, &DVec3)| {
            let eye = b.centre() + *at * reach;
            facing(eye, if i == 0 { DVec3::X } else { b.centre() - eye })
        };
        let poses = around.iter().enumerate().map(looking).collect();
        (scene, poses, cameras(reach))
    };
    crate::structures::scenes().into_iter().filter(small).map(with_views).collect()
}

pub fn truth_of(scene: &Scene, camera: &Camera, poses: &[Pose], accuracy: &Accuracy) -> Truth {
    let numbered: Vec<(u32, Pose)> = (0u32..).zip(poses.iter().copied()).collect();
    truth(scene, camera, &numbered, accuracy)
}

/// Every kind of structure, and some that replicate, split or keep entries at inner nodes.
pub fn structures() -> Vec<String> {
    let more = [
        "octree:policy=E",
        "nested_grid:layout=flat,leaf_limit=5",
        "kd_tree:layout=binary,leaf_size=8",
        "list:leaf_size=1",
    ];
    structure::ALL.iter().map(|e| e.name.to_string()).chain(more.map(String::from)).collect()
}

/// The structure over the scene, unless it does not suit it.
pub fn built(structure: &str, scene: &Scene) -> Option<Hierarchy> {
    structure::make(&Spec::parse(structure).unwrap()).unwrap().0.build(scene).ok()
}

struct Built<'a>(&'a Hierarchy);

impl Structure for Built<'_> {
    fn build(&self, _: &Scene) -> cullmark::Result<Hierarchy> {
        Ok(self.0.clone())
    }
}

pub fn set_up(scene: &Scene, h: &Hierarchy, culling: &str, walk: &str, camera: &Camera, poses: &[Pose]) -> Setup {
    let tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
    let walk = make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
    Setup::from_parts(scene.clone(), poses.to_vec(), camera, &Built(h), tests, walk).unwrap()
}

/// The judgement, which must not be wrong for the class that the method declares.
pub fn judged(setup: &mut Setup, truth: &Truth, what: &str) -> Judgement {
    let judgement = setup.judge(truth);
    assert_eq!(judgement.wrong, None, "{what}");
    judgement
}

/// Whether something hides `p` from the eye, by looking at every triangle; `p` must be
/// behind it by more than a hair. Nothing nearer than the near plane hides.
pub fn is_hidden(scene: &Scene, view: &View, p: DVec3) -> bool {
    let (from, along) = match view.is_perspective() {
        true => (view.eye, p - view.eye),
        false => {
            let depth = (p - view.eye).dot(view.forward);
            (p - view.forward * depth, view.forward * depth)
        }
    };
    (0..scene.len() as u32).filter(|t| scene.occluder[*t as usize]).any(|t| {
        let [a, b, c] = scene.corners(t).map(|q| q - from);
        let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|n| n.dot(along));
        let front = sides.iter().all(|s| *s <= 0.0);
        let back = scene.two_sided[t as usize] && sides.iter().all(|s| *s >= 0.0);
        let normal = (b - a).cross(c - a);
        let at = a.dot(normal) / along.dot(normal);
        (front || back) && at < 1.0 - 1e-9 && at * along.dot(view.forward) >= view.camera.near_m
    })
}
