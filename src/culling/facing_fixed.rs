//! Facing in camera-relative Q15.16 fixed point: whole numbers only, so the same
//! bits on every machine. Silva (2009) names it as the way for processors without
//! a floating-point unit.
//!
//! Corners and eye are rounded once to whole quanta of 2^-16 m (15 um) from the
//! scene origin; a corner relative to the eye then has to fit Q15.16 in 32 bits,
//! +-32,768 m. Beyond, nothing wraps: the triangle is kept and the run fails with a
//! sentence.
//!
//! # Why it loses nothing
//! Rounding moves a corner or the eye by at most half a quantum and 2^-10 for the
//! f64 product, hence differences `p = v1 - v0`, `r = v2 - v0`, `a = v0 - e` by at
//! most `1 + 2^-9` a coordinate. With `n = p x r` the determinant `n.a` is then off
//! by at most
//!
//! ```text
//! sum_i (|p_j| + |r_k| + |p_k| + |r_j| + 2) (|a_i| + 1) + |n_i|
//! ```
//! times `(1 + 2^-9)^3`, which `+ 1/128` of it covers. A triangle is culled iff the
//! determinant exceeds that. All of it is exact in i128 (at most 105 bits); the
//! normal is exact in i64 where the edges have 21 bits with their sign (16 m).

use crate::hierarchy::Hierarchy;
use crate::math::{DVec3, View};
use crate::scene::Scene;

/// Quanta a metre.
const QUANTA: f64 = 65_536.0;
/// Coordinates beyond this many metres from the scene origin have no fixed-point
/// form: f64 would not round them to half a quantum and 2^-10.
const REACH_M: f64 = (1u64 << 26) as f64;
/// Fraction bits of a direction.
const DIRECTION: f64 = (1u64 << 28) as f64;

/// Corners in quanta from the scene origin; `None` where they have no such form.
pub type Corners = Option<[[i64; 3]; 3]>;

/// What a triangle is to the fixed-point test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fixed {
    /// Proved to turn its back.
    Back,
    /// Anything else.
    Kept,
    /// Out of the range of Q15.16 relative to the eye.
    Overflow,
}

/// Rounds half up: unlike half away from zero, that does not change when a whole
/// number of quanta is added (fact H.2).
fn quanta(metres: DVec3) -> Option<[i64; 3]> {
    let fits = metres.abs().max_element() < REACH_M;
    fits.then(|| metres.to_array().map(|x| libm::floor(x * QUANTA + 0.5) as i64))
}

/// Corners of every entry position.
pub fn corners(scene: &Scene, hierarchy: &Hierarchy) -> Vec<Corners> {
    let of = |t: &u32| {
        let [a, b, c] = scene.corners(*t).map(|p| quanta(p - hierarchy.origin));
        Some([a?, b?, c?])
    };
    hierarchy.entries.iter().map(of).collect()
}

/// The eye, or the direction of parallel rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FixedEye {
    Point([i64; 3]),
    /// With 28 fraction bits.
    Direction([i64; 3]),
    OutOfReach,
}

impl FixedEye {
    pub fn new(view: &View, origin: DVec3) -> FixedEye {
        if view.is_perspective() {
            quanta(view.eye - origin).map_or(FixedEye::OutOfReach, FixedEye::Point)
        } else {
            FixedEye::Direction(view.forward.to_array().map(|x| libm::floor(x * DIRECTION + 0.5) as i64))
        }
    }

    /// Judges a triangle.
    pub fn judge(&self, corners: &Corners) -> Fixed {
        let (Some([v0, v1, v2]), false) = (corners, *self == FixedEye::OutOfReach) else { return Fixed::Overflow };
        let relative = |v: &[i64; 3]| match self {
            FixedEye::Point(e) => minus(v, e),
            _ => Some([0; 3]),
        };
        // Every corner has to fit, though one decides.
        let (Some(a), Some(_), Some(_)) = (relative(v0), relative(v1), relative(v2)) else { return Fixed::Overflow };
        let (Some(p), Some(r)) = (minus(v1, v0), minus(v2, v0)) else { return Fixed::Overflow };
        let a = match self {
            FixedEye::Direction(d) => *d,
            _ => a,
        };
        let (n, value) = determinant(p, r, a);
        // Half of all triangles are settled without a bound.
        if value > 0 && value > bound(p, r, a, n) { Fixed::Back } else { Fixed::Kept }
    }
}

/// The difference if it fits Q15.16.
fn minus(a: &[i64; 3], b: &[i64; 3]) -> Option<[i64; 3]> {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    d.iter().all(|x| i32::try_from(*x).is_ok()).then_some(d)
}

/// `n = p x r` and `n . a`.
fn determinant(p: [i64; 3], r: [i64; 3], a: [i64; 3]) -> ([i128; 3], i128) {
    let axes = [(1, 2), (2, 0), (0, 1)];
    let small = p.iter().chain(&r).fold(0, |m, x| m | x.unsigned_abs()) < 1 << 20;
    if small {
        let n = axes.map(|(j, k)| p[j] * r[k] - p[k] * r[j]);
        let term = |i: usize| i128::from(n[i]) * i128::from(a[i]);
        (n.map(i128::from), term(0) + term(1) + term(2))
    } else {
        let wide = |x: i64, y: i64| i128::from(x) * i128::from(y);
        let n = axes.map(|(j, k)| wide(p[j], r[k]) - wide(p[k], r[j]));
        (n, n[0] * i128::from(a[0]) + n[1] * i128::from(a[1]) + n[2] * i128::from(a[2]))
    }
}

/// The most by which that may be off.
fn bound(p: [i64; 3], r: [i64; 3], a: [i64; 3], n: [i128; 3]) -> i128 {
    let (p, r) = (p.map(i64::abs), r.map(i64::abs));
    let all: i64 = p.iter().chain(&r).sum::<i64>() + 2;
    let off = (0..3).fold(0, |sum, i| {
        let n_off = all - p[i] - r[i];
        sum + i128::from(n_off) * i128::from(a[i].abs() + 1) + n[i].abs()
    });
    off + (off >> 7) + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::predicates::{Facing, facing};
    use proptest::prelude::*;

    fn at(e: DVec3) -> FixedEye {
        FixedEye::Point(quanta(e).unwrap())
    }

    proptest! {
        #[test]
        fn what_is_culled_turns_its_back_exactly(
            m in proptest::array::uniform12(-1.0f64..1.0),
            size in -5i32..14,
            reach in -5i32..14,
            sharp in 0i32..30,
        ) {
            let point = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
            let (size, reach) = (libm::exp2(f64::from(size)), libm::exp2(f64::from(reach)));
            let v0 = point(0) * reach;
            let (v1, v2) = (v0 + point(3) * size, v0 + (point(3) + point(6) * libm::exp2(-f64::from(sharp))) * size);
            // Grazing: the eye a hair's breadth beside the plane.
            let e = v0 + (v1 - v0) * m[9] * 3.0 + (v2 - v0) * m[10] * 3.0 + DVec3::splat(m[11] * libm::exp2(-f64::from(sharp)));
            let corners: Corners = Some([v0, v1, v2].map(|v| quanta(v).unwrap()));
            if at(e).judge(&corners) == Fixed::Back {
                prop_assert_ne!(facing(v0, v1, v2, e), Facing::Front);
            }
        }

        // H.2.
        #[test]
        fn translation_by_whole_quanta_changes_nothing(
            m in proptest::array::uniform12(-100.0f64..100.0),
            shift in proptest::array::uniform3(-1_000_000i32..1_000_000),
        ) {
            // On the grid of 2^-30 m, where adding the shift is exact.
            let shift = DVec3::from_array(shift.map(|s| f64::from(s) / QUANTA));
            let point = |i: usize| (DVec3::new(m[i], m[i + 1], m[i + 2]) * 1073741824.0).round() / 1073741824.0;
            let judge = |by: DVec3| {
                let corners = [point(0), point(3), point(6)].map(|p| quanta(p + by).unwrap());
                at(point(9) + by).judge(&Some(corners))
            };
            prop_assert_eq!(judge(shift), judge(DVec3::ZERO));
        }
    }

    #[test]
    fn the_narrow_and_the_wide_product_agree() {
        let (p, r) = ([1_048_575, -77, 3], [-5, 1_048_575, 1_048_575]);
        let wide = |i: usize, j: usize| i128::from(p[i]) * i128::from(r[j]) - i128::from(p[j]) * i128::from(r[i]);
        let a = [i64::from(i32::MAX), i64::from(i32::MIN), 9];
        let want = wide(1, 2) * i128::from(a[0]) + wide(2, 0) * i128::from(a[1]) + wide(0, 1) * i128::from(a[2]);
        assert_eq!(determinant(p, r, a).1, want);
        let halves = [p, r].map(|v| v.map(|x| x / 2));
        let [n, _] = [determinant(halves[0], halves[1], a).0, [0; 3]];
        assert_eq!(n[2], i128::from(halves[0][0] * halves[1][1] - halves[0][1] * halves[1][0]));
    }

    // H.3: beyond 32,768 m there is an error, never a wrap.
    #[test]
    fn overflow_is_told_and_never_wraps() {
        let triangle = |x: f64| Some([[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]].map(|p| quanta(p.into()).unwrap()));
        assert_eq!(at(DVec3::ZERO).judge(&triangle(32_767.0)), Fixed::Back, "its normal points away, along +x");
        assert_eq!(at(DVec3::ZERO).judge(&triangle(32_769.0)), Fixed::Overflow);
        assert_eq!(at(DVec3::X * 10_000.0).judge(&triangle(32_769.0)), Fixed::Back);
        assert_eq!(at(DVec3::X * -10_000.0).judge(&triangle(30_000.0)), Fixed::Overflow);
        assert_eq!(quanta(DVec3::splat(1e8)), None);
        assert_eq!(at(DVec3::ZERO).judge(&None), Fixed::Overflow);
        assert_eq!(FixedEye::OutOfReach.judge(&triangle(1.0)), Fixed::Overflow);
    }
}
