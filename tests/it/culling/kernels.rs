//! Every kernel gives the bits of the scalar twin, on any input.

use super::arithmetics::views;
use super::build::{Rng, blocks, camera};
use cullmark::culling::frustum::kernels;
use cullmark::culling::frustum_f64::{self, Planes64};
use cullmark::culling::frustum_filtered::{self, Signs};
use cullmark::culling::frustum_fixed::{self, FixedBlock, FixedPlanes};
use cullmark::culling::frustum_planes::{FramePlanes, PlaneMasks};
use cullmark::culling::frustum_relative::kernels_of;
use cullmark::culling::frustum_scalar::value;
use cullmark::culling::frustum_world;
use cullmark::math::{Box32, Camera, DVec3, Pose, Projection, Vec3, View};

/// Random boxes, then boxes that touch planes, then everything that is not a box.
pub fn nasty_boxes(rng: &mut Rng, count: usize) -> Vec<Box32> {
    let special = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN,
        f32::MIN_POSITIVE,
        1e-45,
        -1e-45,
        1e-40,
        1e30,
        -1e30,
        0.1,
        5.0,
        -5.0,
    ];
    (0..count)
        .map(|i| {
            let centre = rng.cube(30.0).as_vec3();
            let half = (rng.cube(2.0).abs()).as_vec3();
            let mut b = Box32 { lo: centre - half, hi: centre + half };
            match i % 8 {
                0 => b.hi = b.lo,
                1 => std::mem::swap(&mut b.lo, &mut b.hi),
                2 => {
                    // A corner on the side planes of a 90 degree square frustum along +x.
                    let x = rng.range(0.1, 20.0) as f32;
                    b = Box32 { lo: Vec3::new(x - 1.0, x, -x), hi: Vec3::new(x, x + 1.0, x) };
                }
                3 | 4 => {
                    for axis in 0..3 {
                        b.lo[axis] = special[rng.bits() as usize % special.len()];
                        b.hi[axis] = special[rng.bits() as usize % special.len()];
                    }
                }
                5 => b.lo[rng.bits() as usize % 3] = f32::NAN,
                6 => {
                    let scale = (rng.range(-140.0, 126.0)).exp2() as f32;
                    b = Box32 { lo: b.lo * scale, hi: b.hi * scale };
                }
                _ => {}
            }
            b
        })
        .collect()
}

pub fn frames(rng: &mut Rng) -> Vec<FramePlanes> {
    let square = Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z };
    let far = Camera { far_m: Some(12.0), ..camera(70.0, 1.5) };
    let ortho = Camera { projection: Projection::Orthographic { height_m: 10.0 }, ..Camera::default() };
    let mut frames = vec![
        FramePlanes::new(&View::new(&camera(90.0, 1.0), &square), DVec3::ZERO),
        FramePlanes::new(&View::new(&Camera { far_m: Some(1e300), ..camera(90.0, 1.0) }, &square), DVec3::ZERO),
        FramePlanes::new(&View::new(&camera(90.0, 1.0), &square), DVec3::splat(1e300)),
    ];
    for camera in [camera(60.0, 1.7), far, ortho] {
        for _ in 0..5 {
            frames.push(FramePlanes::new(&View::new(&camera, &rng.pose(20.0)), rng.cube(5.0)));
        }
    }
    frames
}

#[test]
fn block_kernels_agree_bit_for_bit_on_random_and_degenerate_boxes() {
    let mut rng = Rng::new(21);
    let (bounds, _) = blocks(&nasty_boxes(&mut rng, 4000));
    let all = kernels();
    let scalar = all.last().unwrap();
    for frame in frames(&mut rng) {
        for (i, block) in bounds.iter().enumerate() {
            let wanted = if i % 3 == 0 { 0xff } else { rng.bits() as u8 };
            let mut want = PlaneMasks::default();
            (scalar.block)(&frame, block, wanted, i % 2 == 0, &mut want);
            for kernel in &all {
                let mut got = PlaneMasks::default();
                (kernel.block)(&frame, block, wanted, i % 2 == 0, &mut got);
                assert_eq!(got, want, "{} on {block:?} against {frame:?}", kernel.name);
            }
        }
    }
}

#[test]
fn flat_kernels_agree_in_verdicts_and_work() {
    let mut rng = Rng::new(22);
    for count in [0, 1, 8, 9, 16, 17, 777, 4000] {
        let (bounds, mut live) = blocks(&nasty_boxes(&mut rng, count));
        let before: Vec<u8> = live.iter().map(|_| (rng.bits() & rng.bits()) as u8).collect();
        live.iter_mut().step_by(5).for_each(|l| *l >>= 3);
        for frame in frames(&mut rng) {
            let results = kernels().into_iter().map(|k| {
                let mut outside = before.clone();
                let work = (k.flat)(&frame, &bounds, &live, &mut outside);
                (outside, work)
            });
            let results: Vec<_> = results.collect();
            assert!(results.windows(2).all(|w| w[0] == w[1]), "{count} boxes");
        }
    }
}

#[test]
fn the_flat_kernel_is_the_block_kernel_over_all_planes() {
    let mut rng = Rng::new(23);
    let (bounds, live) = blocks(&nasty_boxes(&mut rng, 800));
    for frame in frames(&mut rng) {
        for kernel in kernels() {
            let mut outside = vec![0; bounds.len()];
            let work = (kernel.flat)(&frame, &bounds, &live, &mut outside);
            let mut planes = 0;
            for ((block, out), live) in bounds.iter().zip(&outside).zip(&live) {
                let mut masks = PlaneMasks::default();
                (kernel.block)(&frame, block, frame.all(), false, &mut masks);
                let mut left = *live;
                for m in &masks.outside[..frame.count] {
                    planes += u64::from(left.count_ones());
                    left &= !m;
                }
                assert_eq!(*out, !left);
            }
            assert_eq!(work.planes, planes, "a lane rejected by plane k costs k + 1");
        }
    }
}

#[test]
fn a_box_with_any_nan_or_infinite_bound_is_kept() {
    let view = View::new(&Camera::default(), &Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z });
    let frame = FramePlanes::new(&view, DVec3::ZERO);
    // Far behind the eye: certainly outside as it is.
    let sound = Box32 { lo: Vec3::new(-50.0, -1.0, -1.0), hi: Vec3::new(-49.0, 1.0, 1.0) };
    for kernel in kernels() {
        let keeps = |b: Box32| {
            let (bounds, live) = blocks(&[b]);
            let mut outside = [0];
            (kernel.flat)(&frame, &bounds, &live, &mut outside);
            outside[0] & 1 == 0
        };
        assert!(!keeps(sound));
        for axis in 0..3 {
            for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let (mut lo, mut hi) = (sound, sound);
                lo.lo[axis] = bad;
                hi.hi[axis] = bad;
                assert!(keeps(lo) && keeps(hi), "{} axis {axis} {bad}", kernel.name);
            }
        }
    }
}

/// Compares what `kernels` (the last is the twin) say of random blocks and planes.
fn same_bits<K, B, M: Default + PartialEq + std::fmt::Debug>(
    rng: &mut Rng,
    kernels: &[(&str, K)],
    blocks: &[B],
    judge: impl Fn(&K, &B, u8, bool, &mut M) -> u8,
) {
    for (i, block) in blocks.iter().enumerate() {
        let wanted = if i % 3 == 0 { 0b1_1111 } else { rng.bits() as u8 & 0b1_1111 };
        let of = |(_, kernel): &(&str, K)| {
            let mut masks = M::default();
            let told = judge(kernel, block, wanted, i % 2 == 0, &mut masks);
            (masks, told)
        };
        let want = of(kernels.last().unwrap());
        kernels.iter().for_each(|kernel| assert_eq!(of(kernel), want, "{} on block {i}", kernel.0));
    }
}

#[test]
fn the_kernels_of_every_arithmetic_agree_with_their_twins() {
    let mut rng = Rng::new(24);
    let (bounds, _) = blocks(&nasty_boxes(&mut rng, 1600));
    let fixed: Vec<_> = bounds.iter().map(FixedBlock::new).collect();
    for (view, origin) in views(&mut rng) {
        let double = Planes64::new(&view, origin);
        same_bits(
            &mut rng,
            &frustum_f64::kernels(),
            &bounds,
            |kernel, block, planes, inside, masks: &mut PlaneMasks| {
                kernel(&double, block, planes, inside, masks);
                0
            },
        );
        let whole = FixedPlanes::new(&view, origin);
        same_bits(
            &mut rng,
            &frustum_fixed::kernels(),
            &fixed,
            |kernel, block, planes, inside, masks: &mut PlaneMasks| kernel(&whole, block, planes, inside, masks),
        );
        let single = FramePlanes::new(&view, origin);
        same_bits(
            &mut rng,
            &frustum_filtered::kernels(),
            &bounds,
            |kernel, block, planes, inside, signs: &mut Signs| {
                kernel(&single, block, planes, inside, signs);
                0
            },
        );
    }
}

/// `f32_world`: the kernels without a guard against a p-vertex test as one would write it.
#[test]
fn the_unguarded_kernels_are_the_plain_test_in_world_coordinates() {
    let mut rng = Rng::new(25);
    let boxes = nasty_boxes(&mut rng, 1603);
    for (view, origin) in views(&mut rng) {
        let world: Vec<_> = boxes.iter().map(|b| frustum_world::world_box(b, origin)).collect();
        let (bounds, live) = blocks(&world);
        let frame = frustum_world::planes(&view);
        let plain = |b: &Box32| {
            frame.planes[..frame.count].iter().any(|plane| {
                let p = [0, 1, 2].map(|i| if plane.normal[i] >= 0.0 { b.hi[i] } else { b.lo[i] });
                value(plane, &[p[0], p[1], p[2], 0.0, 0.0, 0.0], &[0, 1, 2], plane.d_out) < 0.0
            })
        };
        let want: Vec<bool> = world.iter().map(plain).collect();
        for kernel in kernels_of::<false>() {
            let mut outside = vec![0; bounds.len()];
            (kernel.flat)(&frame, &bounds, &live, &mut outside);
            let mut masks = vec![PlaneMasks::default(); bounds.len()];
            for (block, masks) in bounds.iter().zip(&mut masks) {
                (kernel.block)(&frame, block, frame.all(), true, masks);
            }
            for (i, want) in want.iter().enumerate() {
                let bit = |m: u8| m >> (i % 8) & 1 == 1;
                assert_eq!(bit(outside[i / 8]), *want, "{} {:?}", kernel.name, world[i]);
                assert_eq!(masks[i / 8].outside.iter().any(|m| bit(*m)), *want, "{} {:?}", kernel.name, world[i]);
            }
        }
    }
}
