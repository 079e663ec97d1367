//! The box test against its twins in f64: facts B2 and B3.

use super::build::{Rng, blocks, camera, view_along};
use cullmark::culling::frustum::kernels;
use cullmark::culling::frustum_planes::{FramePlanes, PlaneMasks};
use cullmark::math::{Aabb, Camera, DVec3, View};

/// Centre and half extent against a plane, in f64: `(s + r, s - r)`.
fn centre_form(view: &View, plane: usize, b: &Aabb) -> (f64, f64) {
    let p = &view.planes[plane];
    let s = p.normal.dot(b.centre() - view.eye) + p.offset_m;
    let r = p.normal.abs().dot(b.size() * 0.5);
    (s + r, s - r)
}

#[test]
fn corner_and_centre_forms_agree_outside_the_guard() {
    let mut rng = Rng::new(31);
    let kernel = kernels()[0];
    let (mut outside, mut inside, mut undecided) = (0, 0, 0);
    for _ in 0..40 {
        let view = View::new(&Camera { far_m: Some(60.0), ..camera(70.0, 1.6) }, &rng.pose(20.0));
        let origin = rng.cube(20.0).round();
        let frame = FramePlanes::new(&view, origin);
        let boxes: Vec<Aabb> = (0..256)
            .map(|_| {
                let (c, h) = (rng.cube(60.0), rng.cube(6.0).abs());
                Aabb { lo: c - h, hi: c + h }
            })
            .collect();
        let (bounds, _) = blocks(&boxes.iter().map(|b| b.relative_to(origin)).collect::<Vec<_>>());
        for (i, b) in boxes.iter().enumerate() {
            let mut masks = PlaneMasks::default();
            (kernel.block)(&frame, &bounds[i / 8], frame.all(), true, &mut masks);
            // Far above the guard (8u A) and the outward rounding of bounds at this size.
            let doubt = 1e-4;
            for k in 0..6 {
                let (far, near) = centre_form(&view, k, b);
                let out = masks.outside[k] >> (i % 8) & 1 == 1;
                let inn = masks.inside[k] >> (i % 8) & 1 == 1;
                assert!(!out || far < 0.0, "outside is proved");
                assert!(!inn || near > 0.0, "inside is proved");
                assert!(out || far >= -doubt, "nothing clearly outside is kept");
                assert!(inn || near <= doubt, "nothing clearly inside is missed");
                outside += u32::from(out);
                inside += u32::from(inn);
                undecided += u32::from(!out && !inn);
            }
        }
    }
    assert!(outside > 5000 && inside > 5000 && undecided > 500, "{outside} {inside} {undecided}");
}

/// Exact overlap of a box and a perspective frustum with a far plane: separating axes
/// (3 of the box, 5 of the frustum, 18 cross products), f64.
fn overlaps(view: &View, b: &Aabb) -> bool {
    let rays = view.corner_rays();
    let (near, far) = (view.camera.near_m, view.camera.far_m.unwrap());
    let corners: Vec<DVec3> = rays.iter().flat_map(|r| [*r * near, *r * far]).collect();
    let boxes: Vec<DVec3> = (0..8)
        .map(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { b.hi[axis] } else { b.lo[axis] };
            DVec3::new(pick(0), pick(1), pick(2)) - view.eye
        })
        .collect();
    let edges = [view.right, view.up, rays[0], rays[1], rays[2], rays[3]];
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let normals = view.planes.iter().map(|p| p.normal);
    let crosses = axes.iter().flat_map(|a| edges.iter().map(|e| a.cross(*e)));
    let span = |points: &[DVec3], axis: DVec3| {
        points
            .iter()
            .map(|p| p.dot(axis))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(x), hi.max(x)))
    };
    axes.into_iter().chain(normals).chain(crosses).filter(|a| a.length_squared() > 1e-18).all(|axis| {
        let (a, b) = (span(&corners, axis), span(&boxes, axis));
        a.0 <= b.1 && b.0 <= a.1
    })
}

/// Fact B3.1: the corner test keeps boxes that overlap no plane's outside but the
/// frustum neither; only for boxes as large as the frustum does it matter.
#[test]
fn false_positives_of_the_corner_test_grow_with_the_box() {
    let mut rng = Rng::new(32);
    let kernel = kernels()[0];
    let view = view_along(DVec3::ZERO, DVec3::X, &Camera { far_m: Some(100.0), ..Camera::default() });
    let frame = FramePlanes::new(&view, DVec3::ZERO);
    let mut share = |side: (f64, f64), count: usize| {
        let boxes: Vec<Aabb> = (0..count)
            .map(|_| {
                let c = DVec3::new(rng.range(-80.0, 180.0), rng.range(-150.0, 150.0), rng.range(-110.0, 110.0));
                let h =
                    DVec3::new(rng.range(side.0, side.1), rng.range(side.0, side.1), rng.range(side.0, side.1)) * 0.5;
                Aabb { lo: c - h, hi: c + h }
            })
            .collect();
        let (bounds, live) = blocks(&boxes.iter().map(|b| b.relative_to(DVec3::ZERO)).collect::<Vec<_>>());
        let mut outside = vec![0; bounds.len()];
        (kernel.flat)(&frame, &bounds, &live, &mut outside);
        let kept = |i: usize| outside[i / 8] >> (i % 8) & 1 == 0;
        assert!(boxes.iter().enumerate().all(|(i, b)| kept(i) || !overlaps(&view, b)), "conservative");
        let (mut keeps, mut wrong) = (0, 0);
        for (_, b) in boxes.iter().enumerate().filter(|(i, _)| kept(*i)) {
            keeps += 1;
            wrong += u32::from(!overlaps(&view, b));
        }
        f64::from(wrong) / f64::from(keeps)
    };
    let [small, middle, large] = [share((1.0, 5.0), 8000), share((20.0, 20.0), 8000), share((60.0, 60.0), 8000)];
    println!("false positives among kept boxes: 1-5 m {small:.4}, 20 m {middle:.4}, 60 m {large:.4}");
    assert!(small < 0.01, "{small}");
    assert!((0.01..0.10).contains(&middle), "{middle}");
    assert!((0.04..0.20).contains(&large) && large > middle, "{large}");
}
