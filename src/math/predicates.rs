//! Exact predicates: which way a triangle faces.
//!
//! Seen from the eye `e` a triangle is front-facing iff `n . (e - v0) > 0` with
//! `n = (v1 - v0) x (v2 - v0)`; exactly edge-on is not front. In Shewchuk's sign
//! convention (Adaptive Precision Floating-Point Arithmetic and Fast Robust
//! Geometric Predicates, 1997) that is `orient3d(v0, v1, v2, e) < 0`.
//!
//! Three steps, each asked only when the one before cannot tell: an f64
//! determinant with an error bound, the adaptive `orient3d` of crate `robust`,
//! and whole numbers of unbounded length. The last is needed because Shewchuk's
//! expansions presume that nothing underflows: with coordinates such as 5e-324
//! `robust` answers 0. His proof holds for magnitudes in 2^-142 .. 2^201.
//!
//! Exact for all finite input.

use super::exact;
use glam::DVec3;
use std::cmp::Ordering;

/// How a triangle stands to the eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Facing {
    Front,
    /// The plane of the triangle holds the eye (or the triangle has no area): not front.
    EdgeOn,
    Back,
}

/// Exact predicates that count how often the quick filter could not tell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Predicates {
    pub calls: u64,
    /// Calls that the error-bounded f64 determinant left to exact arithmetic.
    pub fallbacks: u64,
}

/// Bound of the f64 determinant's error over its permanent: Shewchuk's
/// `(7 + 56 u) u`, rounded up.
pub(crate) const FILTER: f64 = 8.0 * f64::EPSILON / 2.0;
/// Permanents outside hold products that may have over- or underflowed, where
/// the bound says nothing.
pub(crate) const TRUSTED_PERMANENT: std::ops::Range<f64> = 1e-120..1e120;

impl Predicates {
    /// Facing of `v0 v1 v2` (counter-clockwise from the front) seen from the point `e`.
    pub fn facing(&mut self, v0: DVec3, v1: DVec3, v2: DVec3, e: DVec3) -> Facing {
        self.calls += 1;
        let (det, permanent) = determinant(v0 - e, v1 - e, v2 - e);
        if det.abs() > FILTER * permanent && TRUSTED_PERMANENT.contains(&permanent) {
            return front_if_negative(det.total_cmp(&0.0));
        }
        self.fallbacks += 1;
        if [v0, v1, v2, e].into_iter().all(in_shewchuks_range) {
            let c = |p: DVec3| robust::Coord3D { x: p.x, y: p.y, z: p.z };
            let sign = robust::orient3d(c(v0), c(v1), c(v2), c(e));
            return front_if_negative(sign.partial_cmp(&0.0).expect("finite input gives a finite sign"));
        }
        front_if_negative(exact::sign_of_differences(v0, v1, v2, e))
    }

    /// Facing of `v0 v1 v2` under parallel rays along `direction`: front iff
    /// `n . direction < 0`.
    pub fn facing_along(&mut self, v0: DVec3, v1: DVec3, v2: DVec3, direction: DVec3) -> Facing {
        self.calls += 1;
        // `direction` is exact, so this has one rounding less than the case above.
        let (det, permanent) = determinant(v1 - v0, v2 - v0, direction);
        if det.abs() > FILTER * permanent && TRUSTED_PERMANENT.contains(&permanent) {
            return front_if_negative(det.total_cmp(&0.0));
        }
        self.fallbacks += 1;
        front_if_negative(exact::sign_along(v0, v1, v2, direction))
    }
}

/// [`Predicates::facing`] without the count.
pub fn facing(v0: DVec3, v1: DVec3, v2: DVec3, e: DVec3) -> Facing {
    Predicates::default().facing(v0, v1, v2, e)
}

/// [`Predicates::facing_along`] without the count.
pub fn facing_along(v0: DVec3, v1: DVec3, v2: DVec3, direction: DVec3) -> Facing {
    Predicates::default().facing_along(v0, v1, v2, direction)
}

fn front_if_negative(sign: Ordering) -> Facing {
    match sign {
        Ordering::Less => Facing::Front,
        Ordering::Equal => Facing::EdgeOn,
        Ordering::Greater => Facing::Back,
    }
}

/// `a . (b x c)` and the same with every term made positive, in Shewchuk's order
/// of evaluation, which his bound is for.
fn determinant(a: DVec3, b: DVec3, c: DVec3) -> (f64, f64) {
    let (bxcy, cxby) = (b.x * c.y, c.x * b.y);
    let (cxay, axcy) = (c.x * a.y, a.x * c.y);
    let (axby, bxay) = (a.x * b.y, b.x * a.y);
    let det = a.z * (bxcy - cxby) + b.z * (cxay - axcy) + c.z * (axby - bxay);
    let permanent = (bxcy.abs() + cxby.abs()) * a.z.abs()
        + (cxay.abs() + axcy.abs()) * b.z.abs()
        + (axby.abs() + bxay.abs()) * c.z.abs();
    (det, permanent)
}

fn in_shewchuks_range(p: DVec3) -> bool {
    // 2^-142 and 2^201.
    p.to_array().iter().all(|x| *x == 0.0 || (1.8e-43..3.2e60).contains(&x.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FLOOR: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    fn seen_from(e: DVec3) -> Facing {
        facing(FLOOR[0], FLOOR[1], FLOOR[2], e)
    }

    #[test]
    fn counter_clockwise_is_front_and_edge_on_is_not() {
        // Counter-clockwise from above: the normal is +z.
        assert_eq!(seen_from(DVec3::new(0.2, 0.2, 1.0)), Facing::Front);
        assert_eq!(seen_from(DVec3::new(0.2, 0.2, -1.0)), Facing::Back);
        assert_eq!(seen_from(DVec3::new(9.0, -7.0, 0.0)), Facing::EdgeOn);
        let c = |p: DVec3| robust::Coord3D { x: p.x, y: p.y, z: p.z };
        assert!(robust::orient3d(c(FLOOR[0]), c(FLOOR[1]), c(FLOOR[2]), c(DVec3::Z)) < 0.0, "front is negative");
        let along = |d| facing_along(FLOOR[0], FLOOR[1], FLOOR[2], d);
        assert_eq!(along(DVec3::NEG_Z), Facing::Front, "looking down at the floor");
        assert_eq!(along(DVec3::Z), Facing::Back);
        assert_eq!(along(DVec3::X), Facing::EdgeOn);
    }

    #[test]
    fn underflow_that_blinds_robust_is_seen() {
        let c = |p: DVec3| robust::Coord3D { x: p.x, y: p.y, z: p.z };
        let [v0, v1, v2] = FLOOR.map(|p| p * 1e-160);
        let e = DVec3::new(1e-161, 1e-161, 5e-324);
        assert_eq!(robust::orient3d(c(v0), c(v1), c(v2), c(e)), 0.0, "robust underflows here");
        assert_eq!(facing(v0, v1, v2, e), Facing::Front);
        assert_eq!(facing(v0, v1, v2, e * DVec3::new(1.0, 1.0, -1.0)), Facing::Back);
    }

    #[test]
    fn one_ulp_beside_the_plane_decides() {
        let shift = DVec3::splat(1e6);
        let [v0, v1, v2] = [DVec3::ZERO, DVec3::new(3.0, 0.0, 1.0), DVec3::new(0.0, 3.0, 1.0)].map(|p| p + shift);
        let on = (v0 + DVec3::new(3.0, 3.0, 2.0)) * 1.0;
        let mut p = Predicates::default();
        assert_eq!(p.facing(v0, v1, v2, on), Facing::EdgeOn);
        assert_eq!(p.facing(v0, v1, v2, DVec3::new(on.x, on.y, on.z.next_up())), Facing::Front);
        assert_eq!(p.facing(v0, v1, v2, DVec3::new(on.x, on.y, on.z.next_down())), Facing::Back);
        assert_eq!((p.calls, p.fallbacks), (3, 1), "only the exact zero needs more than the filter");
    }

    fn sign(f: Facing) -> Ordering {
        match f {
            Facing::Front => Ordering::Less,
            Facing::EdgeOn => Ordering::Equal,
            Facing::Back => Ordering::Greater,
        }
    }

    proptest! {
        #[test]
        fn every_path_agrees_with_whole_numbers(
            m in proptest::array::uniform9(-64i32..64),
            weights in proptest::array::uniform2(-8i32..8),
            scale in -300i32..300,
            offset in prop_oneof![Just(0.0), Just(1e4), Just(1e8)],
            off_plane in -2i32..3,
        ) {
            // Points on, and a few ulps beside, the plane of the triangle: the filter's blind spot.
            let unit = libm::exp2(f64::from(scale));
            let point = |i: usize| (DVec3::new(f64::from(m[i]), f64::from(m[i + 1]), f64::from(m[i + 2])) + offset) * unit;
            let [v0, v1, v2] = [point(0), point(3), point(6)];
            let mut e = v0 + (v1 - v0) * f64::from(weights[0]) + (v2 - v0) * f64::from(weights[1]);
            for _ in 0..off_plane.abs() {
                e.z = if off_plane > 0 { e.z.next_up() } else { e.z.next_down() };
            }
            prop_assert_eq!(sign(facing(v0, v1, v2, e)), exact::sign_of_differences(v0, v1, v2, e));
            let d = v1 - v0;
            prop_assert_eq!(sign(facing_along(v0, v1, v2, d)), exact::sign_along(v0, v1, v2, d));
            prop_assert_eq!(sign(facing_along(v0, v1, v2, e)), exact::sign_along(v0, v1, v2, e));
        }
    }
}
