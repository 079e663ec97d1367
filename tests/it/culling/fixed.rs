//! Fixed point: facts H.1 (the same bits everywhere), H.2 (whole quanta change
//! nothing) and H.3 (an overflow is told, never wrapped).

use super::arithmetics::{boxes_only, culled, frustum};
use super::build::{Rng, blocks, camera};
use crate::common::soup;
use cullmark::culling::frustum_fixed::{self, FixedBlock, FixedPlanes};
use cullmark::culling::frustum_planes::PlaneMasks;
use cullmark::culling::{Tally, make_tests_in, make_walk};
use cullmark::math::{Arithmetic, Box32, Camera, DVec3, Pose, Vec3, View};
use cullmark::registry::Spec;
use cullmark::runner::Setup;
use cullmark::structure;

/// All that the kernel says of `boxes` in the frames of `views`, as bytes.
fn said(kernel: usize, boxes: &[Box32], views: &[View]) -> Vec<u8> {
    let kernel = frustum_fixed::kernels()[kernel].1;
    let bounds: Vec<_> = blocks(boxes).0.iter().map(FixedBlock::new).collect();
    let mut bytes = Vec::new();
    for view in views {
        let frame = FixedPlanes::new(view, DVec3::ZERO);
        for block in &bounds {
            let mut masks = PlaneMasks::default();
            bytes.push(kernel(&frame, block, 0b1_1111, true, &mut masks));
            bytes.extend(masks.outside.iter().chain(&masks.inside));
        }
    }
    bytes
}

/// Boxes on whole quanta, in eighths of a thousand of them.
fn boxes_on_quanta(rng: &mut Rng, count: usize, shift: [i32; 3]) -> Vec<Box32> {
    (0..count)
        .map(|_| {
            let quanta = [0; 6].map(|_| (rng.bits() % (1 << 21)) as i32 - (1 << 20));
            let point = |q: [i32; 3]| Vec3::from([0, 1, 2].map(|i| (q[i] + shift[i]) as f32 / 65536.0));
            let (a, b) = (point([quanta[0], quanta[1], quanta[2]]), point([quanta[3], quanta[4], quanta[5]]));
            let b = a + (b - a) * 0.125;
            // The eighth may lie between quanta; those are whole again.
            let b = Vec3::from(b.to_array().map(|x| (x * 65536.0).round() / 65536.0));
            Box32 { lo: a.min(b), hi: a.max(b) }
        })
        .collect()
}

fn views_at(rng: &mut Rng, count: usize) -> Vec<View> {
    let far = |c: Camera| Camera { far_m: None, ..c };
    // Eyes with few bits, so that moving them rounds nothing.
    let eye = |rng: &mut Rng| DVec3::from(rng.cube(12.0).to_array().map(|x| (x * 1e6).round() / 1_048_576.0));
    (0..count).map(|_| View::new(&far(camera(70.0, 1.5)), &Pose { eye: eye(rng), ..rng.pose(1.0) })).collect()
}

/// H.1: pinned, so that a machine on which it differs fails.
#[test]
fn fixed_point_says_the_same_on_every_machine() {
    let kernels = frustum_fixed::kernels().len();
    let hash = |kernel| {
        let mut rng = Rng::new(91);
        let boxes = boxes_on_quanta(&mut rng, 2000, [0; 3]);
        let views = views_at(&mut rng, 40);
        digest(&said(kernel, &boxes, &views))
    };
    for kernel in 0..kernels {
        assert_eq!(hash(kernel), "37a3f9795b082a23", "{}", frustum_fixed::kernels()[kernel].0);
    }
}

/// FNV-1a.
fn digest(bytes: &[u8]) -> String {
    let hash =
        bytes.iter().fold(0xcbf2_9ce4_8422_2325u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3));
    format!("{hash:016x}")
}

/// H.2
#[test]
fn moving_boxes_and_eye_by_whole_quanta_changes_nothing() {
    for shift in [[1, 0, 0], [-7, 12345, 3], [1 << 22, -(1 << 22), 99_999]] {
        let boxes = |shift| boxes_on_quanta(&mut Rng::new(92), 4000, shift);
        let views = views_at(&mut Rng::new(93), 30);
        let by = DVec3::from(shift.map(f64::from)) / 65536.0;
        let moved = |v: &View| View { eye: v.eye + by, ..v.clone() };
        let there: Vec<View> = views.iter().map(moved).collect();
        assert!(there.iter().zip(&views).all(|(a, b)| a.eye - by == b.eye), "the eyes move without rounding");
        assert!(said(0, &boxes([0; 3]), &views) == said(0, &boxes(shift), &there), "{shift:?}");
    }
}

/// H.3
#[test]
fn a_box_beyond_reach_is_kept_and_told_and_never_wraps() {
    let at = |x: f32| Box32 { lo: Vec3::new(x - 1.0, -1.0, -1.0), hi: Vec3::new(x + 1.0, 1.0, 1.0) };
    let view =
        |x: f64| View::new(&Camera::default(), &Pose { eye: DVec3::new(x, 0.0, 0.0), forward: DVec3::X, up: DVec3::Z });
    // Behind the eye; the last but one wraps into view if it wraps.
    let h = boxes_only(&[at(-10.0), at(-32_000.0), at(-50_000.0), at(-65_530.0), at(-1e30)], DVec3::ZERO);
    let mut test = frustum(Arithmetic::FixedQ16, &h);
    let seen = |test: &mut dyn cullmark::culling::Test, x| culled(test, &h, &view(x), &mut Tally::default());
    assert_eq!(seen(test.as_mut(), 0.0), [true, true, false, false, false]);
    let why = test.failure().unwrap();
    assert!(why.contains("reaches 32768 m") && why.contains("50001 m away:") && why.contains("scale"), "{why}");
    test.reset();
    assert_eq!(test.failure(), None, "a pass starts anew");
    // Offset and eye fit, their difference does not.
    let near = boxes_only(&[at(-20_000.0), at(20_100.0)], DVec3::ZERO);
    let mut test = frustum(Arithmetic::FixedQ16, &near);
    assert_eq!(culled(test.as_mut(), &near, &view(20_000.0), &mut Tally::default()), [false, false]);
    assert!(test.failure().unwrap().contains("40001 m away"), "{:?}", test.failure());
    test.reset();
    assert_eq!(culled(test.as_mut(), &near, &view(5_000.0), &mut Tally::default()), [true, false]);
    assert_eq!(test.failure(), None);
}

/// H.3, seen from the runner: the pass is void, with a sentence that says what to do.
#[test]
fn a_run_over_a_scene_beyond_reach_fails_with_a_sentence() {
    let setup = |half_m| {
        let (tests, _) = make_tests_in(&[Spec::new("frustum")], Arithmetic::FixedQ16).unwrap();
        let (walk, _) = make_walk(&Spec::new("depth_first")).unwrap();
        let (octree, _) = structure::make(&Spec::new("octree")).unwrap();
        let pose = Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z };
        let scene = soup(94, 500, half_m, 1.0);
        Setup::from_parts(scene, vec![pose; 3], &Camera::default(), octree.as_ref(), tests, walk).unwrap()
    };
    let mut near = setup(20_000.0);
    near.count_pass(|_, _, _| ());
    assert_eq!(near.check(), Ok(()));
    let mut far = setup(60_000.0);
    far.count_pass(|_, _, _| ());
    let why = far.check().unwrap_err().to_string();
    assert!(why.contains("fixed_q16 reaches 32768 m") && why.contains("another arithmetic"), "{why}");
}
