//! Floating point: fact B5, the error bound and what happens far from the origin.

use super::arithmetics::{boxes_only, culled, frustum};
use super::build::{Rng, blocks, camera, view_along};
use cullmark::culling::frustum::kernels;
use cullmark::culling::frustum_planes::FramePlanes;
use cullmark::culling::frustum_scalar::{relative, value};
use cullmark::culling::{Tally, frustum_world};
use cullmark::hierarchy::BoundsBlock;
use cullmark::math::{Aabb, Arithmetic, Box32, Camera, DVec3, Pose, Projection, Vec3, View};

const U: f64 = 1.0 / (1u32 << 24) as f64;

/// B5.1: the error of a plane value, measured in units of `u S`, stays below 7, and
/// that of the whole test below its guard.
#[test]
fn the_evaluation_error_stays_within_the_proved_bound() {
    let mut rng = Rng::new(41);
    let (mut worst, mut worst_of_guard) = (0f64, 0f64);
    for round in 0..400 {
        let reach = 10f64.powi(round % 7 - 1);
        let view = View::new(&Camera { far_m: Some(reach), ..camera(75.0, 1.7) }, &rng.pose(reach));
        let frame = FramePlanes::new(&view, DVec3::ZERO);
        for _ in 0..50 {
            let (a, b) = (rng.cube(reach).as_vec3(), rng.cube(reach).as_vec3());
            let mut block = BoundsBlock::EMPTY;
            block.set(0, Box32 { lo: a.min(b), hi: a.max(b) });
            let (corners, guard) = relative(&frame, &block, 0);
            for (plane, exact_plane) in frame.planes.iter().zip(&view.planes) {
                let corner = |axis: usize| {
                    let bound = if plane.p[axis] >= 3 { block.hi[axis][0] } else { block.lo[axis][0] };
                    f64::from(bound) - view.eye[axis]
                };
                let p = DVec3::new(corner(0), corner(1), corner(2));
                let exact = exact_plane.normal.dot(p) + exact_plane.offset_m;
                let s = exact_plane.normal.abs().dot(p.abs()) + exact_plane.offset_m.abs();
                let got = f64::from(value(plane, &corners, &plane.p, plane.d_out));
                // The offset is moved outward on purpose: that is no error of evaluation.
                let rest = view.eye - DVec3::from_array(frame.eye.map(f64::from));
                let moved = f64::from(plane.d_out) - (exact_plane.offset_m - exact_plane.normal.dot(rest));
                worst = worst.max((got - exact - moved).abs() / (U * s));
                // Outside is decided by `got < -guard`: `exact <= got + guard` makes that a proof.
                worst_of_guard = worst_of_guard.max((exact - got) / f64::from(guard));
            }
        }
    }
    println!("worst error {worst:.2} u S; worst share of the guard {worst_of_guard:.3}");
    assert!(worst <= 7.0, "{worst} u S");
    assert!(worst_of_guard < 1.0 && worst_of_guard > 0.02, "{worst_of_guard} of the guard");
}

/// A visible box: its centre is in the frustum, in f64. Sides 0.1 to 2 m.
fn visible_boxes(rng: &mut Rng, view: &View, count: usize) -> Vec<Aabb> {
    let mut boxes = Vec::with_capacity(count);
    while boxes.len() < count {
        let depth = rng.range(1.0, 100.0);
        // Near the rim, where boxes are lost.
        let (x, y) = (rng.range(-1.05, 1.05) * view.half_width, rng.range(-1.05, 1.05) * view.half_height);
        let c = view.eye + (view.forward + view.right * x + view.up * y) * depth;
        let h = DVec3::new(rng.range(0.05, 1.0), rng.range(0.05, 1.0), rng.range(0.05, 1.0));
        let b = Aabb { lo: c - h, hi: c + h };
        if nearest_to_outside(view, &b) > 1e-6 {
            boxes.push(b);
        }
    }
    boxes
}

/// Smallest p-vertex distance in f64: positive means that the exact test keeps the box.
fn nearest_to_outside(view: &View, b: &Aabb) -> f64 {
    view.planes
        .iter()
        .map(|p| {
            let corner = DVec3::select(p.normal.cmpge(DVec3::ZERO), b.hi, b.lo);
            p.normal.dot(corner - view.eye) + p.offset_m
        })
        .fold(f64::INFINITY, f64::min)
}

/// Share of `boxes` that f32 world planes cull, with a guard of `guard` u S.
fn naive_culls(planes: &[(Vec3, f32)], boxes: &[Aabb], guard: f32) -> usize {
    let culls = |b: &Aabb| {
        let (lo, hi) = (b.lo.as_vec3(), b.hi.as_vec3());
        planes.iter().any(|(n, d)| {
            let p = Vec3::select(n.cmpge(Vec3::ZERO), hi, lo);
            n.dot(p) + d < -guard * U as f32 * (n.abs().dot(p.abs()) + d.abs())
        })
    };
    boxes.iter().filter(|b| culls(b)).count()
}

fn our_culls(view: &View, origin: DVec3, boxes: &[Aabb]) -> usize {
    let (bounds, live) = blocks(&boxes.iter().map(|b| b.relative_to(origin)).collect::<Vec<_>>());
    let mut outside = vec![0u8; bounds.len()];
    (kernels()[0].flat)(&FramePlanes::new(view, origin), &bounds, &live, &mut outside);
    outside.iter().zip(&live).map(|(o, l)| (o & l).count_ones() as usize).sum()
}

/// B5.2: `f32_world` loses visible boxes, ten times more a decade of offset; the others none.
#[test]
fn world_space_loses_a_decade_more_each_decade_and_the_others_nothing() {
    let mut rng = Rng::new(42);
    let published = [0.0, 0.0, 0.0, 0.0, 2.9e-5, 8.8e-5, 1.4e-3, 1.6e-2, 7.4e-2];
    let (rounds, count) = (250, 160);
    let mut rates = Vec::new();
    for k in 0..=8 {
        let offset = DVec3::new(0.7, -0.6, 0.4) * 10f64.powi(k);
        let mut lost = 0;
        for round in 0..rounds {
            let view = view_along(offset + rng.cube(50.0), rng.direction(), &Camera::default());
            let boxes = visible_boxes(&mut rng, &view, count);
            let lost_by = |arithmetic, origin: DVec3| {
                let h = boxes_only(&boxes.iter().map(|b| b.relative_to(origin)).collect::<Vec<_>>(), origin);
                let culled = culled(frustum(arithmetic, &h).as_mut(), &h, &view, &mut Tally::default());
                culled.into_iter().filter(|c| *c).count()
            };
            lost += lost_by(Arithmetic::F32World, offset.round());
            assert_eq!(lost_by(Arithmetic::F32Relative, offset.round()), 0, "offset 1e{k}");
            if round % 10 == 0 {
                for arithmetic in Arithmetic::ALL.into_iter().filter(|a| *a != Arithmetic::F32World) {
                    // At origins far from the eye fixed point keeps everything.
                    for origin in [offset.round(), DVec3::ZERO, -offset.round()] {
                        assert_eq!(lost_by(arithmetic, origin), 0, "{arithmetic}, offset 1e{k}, origin {origin}");
                    }
                }
            }
        }
        rates.push(lost as f64 / (rounds * count) as f64);
    }
    println!("f32_world, share of visible boxes lost at 10^k: {rates:?} (published {published:?})");
    assert!(rates[..4].iter().all(|r| *r == 0.0), "{rates:?}");
    // One box in 40,000 is 2.5e-5: at 10^4 there is little to see, beyond it a decade a decade.
    assert!(rates[4] < 4e-4, "{rates:?}");
    for k in 5..=8 {
        assert!((published[k] / 5.0 - 5e-5..published[k] * 5.0 + 5e-5).contains(&rates[k]), "10^{k}: {rates:?}");
    }
    assert!(rates[6] > 2.0 * rates[5] && rates[7] > 4.0 * rates[6] && rates[8] > 3.0 * rates[7], "{rates:?}");
}

/// `f32_world` takes its planes from a matrix: near the origin they are the camera's.
#[test]
fn planes_from_a_world_space_matrix_are_those_of_the_view_near_the_origin() {
    let mut rng = Rng::new(44);
    let ortho = |far_m| Camera { projection: Projection::Orthographic { height_m: 8.0 }, far_m, ..Camera::default() };
    let far = Camera { far_m: Some(80.0), ..camera(50.0, 1.4) };
    for camera in [Camera::default(), far, ortho(None), ortho(Some(80.0))] {
        for _ in 0..20 {
            let view = View::new(&camera, &rng.pose(10.0));
            let frame = frustum_world::planes(&view);
            assert_eq!(frame.count, view.planes.len());
            for (got, want) in frame.planes.iter().zip(&view.planes) {
                let n = DVec3::from(got.normal.map(f64::from));
                assert!((n - want.normal).length() < 1e-4, "{got:?} {want:?}");
                let d = want.offset_m - want.normal.dot(view.eye);
                // The far plane is what is left of two nearly equal rows.
                assert!((f64::from(got.d_out) - d).abs() < 1e-5 + want.offset_m.abs() * 1e-3, "{got:?} {d}");
            }
        }
    }
    // B1: single precision cannot tell this far plane from infinity, whose row has no normal.
    let view = View::new(&Camera { far_m: Some(1e9), ..Camera::default() }, &rng.pose(10.0));
    let plane = frustum_world::planes(&view).planes[5];
    assert_eq!((plane.normal, plane.d_out > 0.0), ([0.0; 3], true), "everything is inside");
}

/// B5.3: a guard makes world space safe too, and keeps boxes for nothing.
#[test]
fn a_world_space_guard_is_safe_but_keeps_boxes_for_nothing() {
    let mut rng = Rng::new(43);
    let offset = DVec3::new(0.7, -0.6, 0.4) * 1e6;
    let (mut extra, mut ours, mut kept) = (0, 0, 0);
    for _ in 0..20 {
        let view = view_along(offset + rng.cube(50.0), rng.direction(), &Camera::default());
        let visible = visible_boxes(&mut rng, &view, 500);
        // Planes from f64, so that the guard has to cover evaluation and bounds alone.
        let planes: Vec<_> =
            view.planes.iter().map(|p| (p.normal.as_vec3(), (p.offset_m - p.normal.dot(view.eye)) as f32)).collect();
        assert_eq!(naive_culls(&planes, &visible, 16.0), 0);
        let around: Vec<Aabb> = (0..2000)
            .map(|_| {
                let (c, h) = (view.eye + rng.cube(60.0), DVec3::splat(rng.range(0.05, 1.0)));
                Aabb { lo: c - h, hi: c + h }
            })
            .collect();
        let outside: Vec<Aabb> = around.iter().filter(|b| nearest_to_outside(&view, b) < 0.0).copied().collect();
        kept += around.len() - outside.len();
        extra += outside.len() - naive_culls(&planes, &outside, 16.0);
        ours += outside.len() - our_culls(&view, offset.round(), &outside);
    }
    let (extra, ours) = (extra as f64 / kept as f64, ours as f64 / kept as f64);
    println!("kept for nothing at 10^6: world space with 16 u S {extra:.4}, ours {ours:.6}");
    assert!((0.02..0.5).contains(&extra), "{extra}");
    assert!(ours < 1e-3, "{ours}");
}

/// Boxes that touch a plane from outside within rounding are kept; one step further they are not.
#[test]
fn the_guard_is_small() {
    let view = View::new(&Camera::default(), &Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z });
    for distance in [1e-3, 1.0, 1e3, 1e6] {
        let behind = |gap: f64| {
            let near = view.camera.near_m;
            let c = DVec3::new(near - gap, 0.0, 0.0);
            Aabb { lo: c - DVec3::splat(distance), hi: DVec3::new(c.x, distance, distance) }
        };
        assert_eq!(our_culls(&view, DVec3::ZERO, &[behind(0.0)]), 0, "touching, {distance}");
        let guard = 8.5 * U * (3.0 * distance + 0.3);
        assert_eq!(our_culls(&view, DVec3::ZERO, &[behind(3.0 * guard)]), 1, "clear, {distance}");
    }
}
