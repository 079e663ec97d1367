//! Fixed point for planes and boxes: Q15.16 metres in 32 bits, directions with 28
//! fraction bits, sums in 64 bits without rounding (Silva 2009 proposes whole
//! numbers for processors without a floating-point unit).
//!
//! Only the entry into fixed point rounds, always to a stated side or to nearest
//! with a stated error, and by operations that are exact in IEEE arithmetic
//! (scaling by powers of two, floor, ceil): the bits are the same on every machine
//! (fact H.1). What does not fit is told, never wrapped (H.3).

use super::{DVec3, Plane};

/// Fraction bits of lengths: a quantum is 2^-16 m, 15 µm.
pub const LENGTH_BITS: i32 = 16;
/// Fraction bits of components of unit vectors.
pub const NORMAL_BITS: i32 = 28;
/// What a relative coordinate may be at most: 2^15 m.
pub const REACH_M: f64 = 32768.0;

/// A length rounded down to quanta, or `None` if it does not fit (or is NaN).
pub fn floor(length_m: f32) -> Option<i32> {
    fit((f64::from(length_m) * f64::from(1 << LENGTH_BITS)).floor())
}

/// A length rounded up to quanta.
pub fn ceil(length_m: f32) -> Option<i32> {
    fit((f64::from(length_m) * f64::from(1 << LENGTH_BITS)).ceil())
}

fn fit(quanta: f64) -> Option<i32> {
    // Exact both ways: whole f64 below 2^53.
    (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&quanta).then_some(quanta as i32)
}

/// A point in whole quanta, and the rest that they leave.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FixedPoint {
    /// At most 2^60, beyond every reach, so that differences and sums of a few fit.
    pub quanta: [i64; 3],
    /// Metres, at most half a quantum unless `quanta` was capped.
    pub rest: DVec3,
}

impl FixedPoint {
    /// `high + low` in nearest quanta; `low` is far smaller than `high`'s last bit.
    pub fn new(high: DVec3, low: DVec3) -> FixedPoint {
        let unit = f64::from(1 << LENGTH_BITS);
        let cap = 2f64.powi(60);
        let quanta = high.to_array().map(|x| (x * unit).round().clamp(-cap, cap));
        // Exact: a multiple of `high`'s last bit, below it in size.
        let rest = high - DVec3::from(quanta) / unit;
        FixedPoint { quanta: quanta.map(|q| q as i64), rest: rest + low }
    }
}

/// A plane for corners in quanta relative to a [`FixedPoint`].
///
/// A value is `n.a + d` in units of 2^-44 m: three products of `|n_i| <= 2^28` and
/// `|a_i| <= 2^31`, hence below 1.5 2^60 in sum, and an offset that is capped at 2^61, beyond
/// which it alone decides the sign. So every sum stays below 2^62: exact in i64.
/// A component of the normal is off by at most 2^-29, half a unit, so the value by
/// `sum |a_i| / 2` units ([`guard`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FixedPlane {
    pub normal: [i32; 3],
    /// Offset moved up and down by the error of its f64 evaluation, then to whole units.
    pub d_out: i64,
    pub d_in: i64,
}

impl FixedPlane {
    /// `plane` is relative to a point whose rest is `rest`: `n.(a - rest) + d = n.a + (d - n.rest)`.
    pub fn new(plane: &Plane, rest: DVec3) -> FixedPlane {
        let d = plane.offset_m - plane.normal.dot(rest);
        // The roundings of `d` and of these sums: a few units of 2^-53 each, allowed 2^-50.
        let slack = (d.abs() + plane.offset_m.abs() + rest.abs().element_sum()) * (-50f64).exp2() + (-100f64).exp2();
        let unit = ((LENGTH_BITS + NORMAL_BITS) as f64).exp2();
        let cap = 2f64.powi(61);
        // No number: neither outside nor inside.
        let whole = |x: f64, none: f64| if x.is_nan() { none } else { x.clamp(-cap, cap) } as i64;
        FixedPlane {
            normal: plane.normal.to_array().map(direction),
            d_out: whole(((d + slack) * unit).ceil(), cap),
            d_in: whole(((d - slack) * unit).floor(), -cap),
        }
    }

    /// The value of a corner, without the guard.
    #[inline]
    pub fn value(&self, corner: [i64; 3], d: i64) -> i64 {
        let n = self.normal.map(i64::from);
        n[0] * corner[0] + n[1] * corner[1] + n[2] * corner[2] + d
    }
}

/// Error of a value on account of the normal's rounding, in its units: half the
/// sum of the largest coordinates of the box, rounded up.
#[inline]
pub fn guard(magnitudes: [i64; 3]) -> i64 {
    (magnitudes[0] + magnitudes[1] + magnitudes[2] + 1) >> 1
}

/// A component of a unit vector, to nearest.
fn direction(x: f64) -> i32 {
    (x.clamp(-1.0, 1.0) * f64::from(1 << NORMAL_BITS)).round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exact;
    use proptest::prelude::*;
    use std::cmp::Ordering;

    #[test]
    fn bounds_round_outward_and_what_does_not_fit_is_told() {
        assert_eq!((floor(1.0), ceil(1.0)), (Some(65536), Some(65536)));
        assert_eq!((floor(1e-9), ceil(1e-9), floor(-1e-9), ceil(-1e-9)), (Some(0), Some(1), Some(-1), Some(0)));
        assert_eq!((floor(1e-45), ceil(1e-45)), (Some(0), Some(1)));
        assert_eq!((floor(32767.5), floor(32768.0), floor(-32768.0)), (Some(2_147_450_880), None, Some(i32::MIN)));
        for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -32768.004] {
            assert_eq!((floor(x), ceil(x)), (None, None), "{x}");
        }
    }

    #[test]
    fn the_largest_sum_does_not_overflow() {
        let plane = Plane { normal: DVec3::splat(-1.0), offset_m: -1e300 };
        let fixed = FixedPlane::new(&plane, DVec3::ZERO);
        assert_eq!((fixed.d_out, fixed.d_in), (-(1 << 61), -(1 << 61)));
        let least = fixed.value([i64::from(i32::MAX); 3], fixed.d_in);
        assert!(least < 0 && least > -(1 << 62));
        let fixed = FixedPlane::new(&Plane { normal: DVec3::ONE, offset_m: f64::INFINITY }, DVec3::ZERO);
        let most = fixed.value([i64::from(i32::MAX); 3], fixed.d_out);
        assert!(most > 0 && most < 1 << 62);
    }

    proptest! {
        #[test]
        fn what_fixed_point_proves_is_so_in_exact_arithmetic(
            n in proptest::array::uniform3(-1f64..1.0),
            a in proptest::array::uniform3(any::<i32>()),
            scale in 0u32..31,
            eye in proptest::array::uniform3(-100f64..100.0),
            gap in -3e5f64..3e5,
        ) {
            let normal = DVec3::from(n).normalize();
            prop_assume!(normal.is_finite());
            let point = FixedPoint::new(eye.into(), DVec3::ZERO);
            prop_assert!(point.rest.abs().max_element() <= 2f64.powi(-17));
            let corner = a.map(|x| i64::from(x >> scale));
            let place = DVec3::from([0, 1, 2].map(|i| (corner[i] + point.quanta[i]) as f64 / 65536.0));
            // A plane close to the corner, in units of its own error.
            let offset_m = -normal.dot(place - DVec3::from(eye)) + gap * 2f64.powi(-16 - scale as i32);
            let plane = FixedPlane::new(&Plane { normal, offset_m }, point.rest);
            let guard = guard(corner.map(i64::abs));
            let sign = exact::sign_of_plane(normal, offset_m, DVec3::ZERO, place, eye.into());
            let (high, low) = (plane.value(corner, plane.d_out), plane.value(corner, plane.d_in));
            prop_assert!(high >= -guard || sign == Ordering::Less);
            prop_assert!(low <= guard || sign == Ordering::Greater);
            // And not by never proving anything.
            prop_assert!(high - low < 1 << 20, "{}", high - low);
        }
    }
}
