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
//! determinant exceeds that. `n` does not depend on the eye and is exact in i64, as
//! edges fit 31 bits; the determinant is exact in i128 (97 bits). The factors in
//! brackets are kept in units of four quanta, rounded up, so that a triangle is one
//! cache line.

use crate::hierarchy::Hierarchy;
use crate::math::{DVec3, View};
use crate::scene::Scene;
use rayon::prelude::*;

/// Quanta a metre.
const QUANTA: f64 = 65_536.0;
/// Coordinates beyond this many metres from the scene origin have no fixed-point
/// form: f64 would not round them to half a quantum and 2^-10.
const REACH_M: f64 = (1u64 << 26) as f64;
/// Fraction bits of a direction.
const DIRECTION: f64 = (1u64 << 28) as f64;

/// A triangle in quanta: everything that does not depend on the eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct FixedTriangle {
    /// First corner, from the scene origin.
    corner: [i64; 3],
    normal: [i64; 3],
    /// Most by which a coordinate of the normal may be off, in units of four.
    normal_off: [u32; 3],
    /// Longest coordinate of an edge from the first corner, or [`OUT_OF_REACH`].
    reach: u32,
}

/// The triangle has no fixed-point form.
const OUT_OF_REACH: u32 = u32::MAX;

const NOWHERE: FixedTriangle =
    FixedTriangle { corner: [0; 3], normal: [0; 3], normal_off: [0; 3], reach: OUT_OF_REACH };

impl FixedTriangle {
    /// From corners relative to the scene origin, metres.
    pub fn new(corners: &[DVec3; 3]) -> FixedTriangle {
        let [Some(v0), Some(v1), Some(v2)] = corners.map(quanta) else { return NOWHERE };
        let minus = |v: [i64; 3]| [0, 1, 2].map(|i| v[i] - v0[i]);
        let (p, r) = (minus(v1), minus(v2));
        let reach = p.iter().chain(&r).fold(0, |m, x| m.max(x.abs()));
        if reach > i64::from(i32::MAX) {
            return NOWHERE;
        }
        let axes = [(1, 2), (2, 0), (0, 1)];
        FixedTriangle {
            corner: v0,
            normal: axes.map(|(j, k)| p[j] * r[k] - p[k] * r[j]),
            normal_off: axes.map(|(j, k)| {
                let off = p[j].abs() + r[k].abs() + p[k].abs() + r[j].abs() + 2;
                // Below 2^33 + 2, so a quarter fits.
                (off as u64).div_ceil(4) as u32
            }),
            reach: reach as u32,
        }
    }
}

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

/// Triangle of every entry position.
pub fn triangles(scene: &Scene, hierarchy: &Hierarchy) -> Vec<FixedTriangle> {
    let of = |t: &u32| FixedTriangle::new(&scene.corners(*t).map(|p| p - hierarchy.origin));
    hierarchy.entries.par_iter().with_min_len(1024).map(of).collect()
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

    /// Judges a triangle. Its first corner has to fit Q15.16 with the rest of it around.
    #[inline]
    pub fn judge(&self, t: &FixedTriangle) -> Fixed {
        let a = match self {
            FixedEye::Point(e) => [0, 1, 2].map(|i| t.corner[i] - e[i]),
            FixedEye::Direction(d) if t.reach != OUT_OF_REACH => *d,
            _ => return Fixed::Overflow,
        };
        let farthest = a.iter().fold(0, |m, x| m.max(x.abs()));
        if matches!(self, FixedEye::Point(_)) && farthest + i64::from(t.reach) > i64::from(i32::MAX) {
            return Fixed::Overflow;
        }
        // No branch on the sign: it is as good as random.
        let (mut value, mut off) = (0i128, 0i128);
        for (i, a) in a.iter().enumerate() {
            value += i128::from(t.normal[i]) * i128::from(*a);
            off += i128::from(4 * i64::from(t.normal_off[i])) * i128::from(a.abs() + 1);
            off += i128::from(t.normal[i].unsigned_abs());
        }
        if value > off + (off >> 7) + 1 { Fixed::Back } else { Fixed::Kept }
    }
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
            if at(e).judge(&FixedTriangle::new(&[v0, v1, v2])) == Fixed::Back {
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
                at(point(9) + by).judge(&FixedTriangle::new(&[point(0), point(3), point(6)].map(|p| p + by)))
            };
            prop_assert_eq!(judge(shift), judge(DVec3::ZERO));
        }
    }

    #[test]
    fn the_widest_triangle_that_fits_does_not_overflow_its_normal() {
        let edge = f64::from(i32::MAX) / QUANTA;
        let corners = [DVec3::ZERO, DVec3::new(edge, -edge, 0.0), DVec3::new(edge, edge, 0.0)];
        let t = FixedTriangle::new(&corners);
        assert_eq!((t.normal[2], t.reach), (2 * i64::from(i32::MAX).pow(2), i32::MAX as u32));
        assert_eq!(FixedEye::Direction([0, 0, 1 << 28]).judge(&t), Fixed::Back, "its normal points along the rays");
        assert_eq!(FixedEye::Direction([0, 0, -1 << 28]).judge(&t), Fixed::Kept);
        assert_eq!(FixedTriangle::new(&corners.map(|c| c * 1.001)), NOWHERE);
    }

    // H.3: beyond 32,768 m there is an error, never a wrap.
    #[test]
    fn overflow_is_told_and_never_wraps() {
        let triangle = |x: f64| FixedTriangle::new(&[[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]].map(DVec3::from));
        assert_eq!(at(DVec3::ZERO).judge(&triangle(32_766.0)), Fixed::Back, "its normal points away, along +x");
        assert_eq!(at(DVec3::ZERO).judge(&triangle(32_769.0)), Fixed::Overflow);
        assert_eq!(at(DVec3::X * 10_000.0).judge(&triangle(32_769.0)), Fixed::Back);
        assert_eq!(at(DVec3::X * -10_000.0).judge(&triangle(30_000.0)), Fixed::Overflow);
        assert_eq!(quanta(DVec3::splat(1e8)), None);
        assert_eq!(at(DVec3::ZERO).judge(&NOWHERE), Fixed::Overflow);
        assert_eq!(FixedEye::OutOfReach.judge(&triangle(1.0)), Fixed::Overflow);
    }
}
