//! A culling test of one's own: nothing farther than a radius. The oracle says what it loses.

use cullmark::culling::{Class, Removes, Tally, Test, Verdict, make_tests, make_walk};
use cullmark::hierarchy::{Hierarchy, LANES};
use cullmark::math::{Camera, Vec3, View};
use cullmark::record::Accuracy;
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::{Scene, generate, walkthrough};
use cullmark::{Result, oracle, runner::Setup, structure};

struct Radius {
    radius_m: f32,
    eye: Vec3,
}

impl Test for Radius {
    fn class(&self) -> Class {
        Class::Aggressive
    }
    fn removes(&self) -> Removes {
        Removes::default()
    }
    fn prepare(&mut self, _: &Scene, _: &Hierarchy) -> usize {
        0
    }
    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.eye = (view.eye - hierarchy.origin).as_vec3();
    }
    fn initial_carry(&self) -> u8 {
        1
    }
    fn judge(&mut self, hierarchy: &Hierarchy, block: u32, live: u8, _: u8, tally: &mut Tally) -> Verdict {
        tally.lane_tests += u64::from(live.count_ones());
        let far = |lane: &usize| {
            let b = hierarchy.bounds[block as usize].get(*lane);
            self.eye.clamp(b.lo, b.hi).distance(self.eye) > self.radius_m
        };
        let outside = (0..LANES).filter(|l| live >> l & 1 == 1 && far(l)).fold(0, |m, l| m | 1 << l);
        Verdict { outside, carry: [1; LANES] }
    }
}

fn main() -> Result<()> {
    let accuracy = Accuracy { frames: 5, width_px: 320, height_px: 180, samples: 1, ..Accuracy::default() };
    for radius_m in [5.0, 20.0, 80.0] {
        let scene = generate::make(&Spec::parse("rooms:world=1")?)?.0.generate();
        let poses = walkthrough::generate::make(&Spec::parse("walk:frames=60")?)?.0.walk(&scene)?;
        let (mut tests, _) = make_tests(&parse_sum("frustum")?)?;
        tests.push(Box::new(Radius { radius_m, eye: Vec3::ZERO }));
        let (octree, _) = structure::make(&Spec::parse("octree:depth=4")?)?;
        let (walk, _) = make_walk(&Spec::parse("depth_first")?)?;
        let mut setup = Setup::from_parts(scene, poses, &Camera::default(), octree.as_ref(), tests, walk)?;
        let truth = oracle::truth(&setup.scene, &Camera::default(), &setup.judged_poses(&accuracy), &accuracy);
        let frames = setup.judge(&truth).frames;
        let lost: u64 = frames.iter().map(|f| f.false_cull_pixels).sum();
        println!("radius {radius_m} m: {lost} pixels lost in {} frames", frames.len());
    }
    Ok(())
}
