//! Fixed point, which Silva (2009) proposes for processors without a floating-point
//! unit: places relative to the camera in Q15.16 (whole numbers of 1/65536 m, 15 um,
//! reaching +-32,767 m), directions with 28 fraction bits.
//!
//! Quantising is the only inexact step, and it is directed outward; sums of three
//! products and an offset stay below 2^62 and are exact in i64. The same bits come
//! out on every machine, and moving eye and scene by whole quanta changes none.
//! A place out of reach is `None`, never a wrapped number.

/// Fraction bits of a place.
pub const PLACE_BITS: u32 = 16;
/// Fraction bits of a direction.
pub const DIRECTION_BITS: u32 = 28;
/// Farthest place that fits, metres.
pub const REACH_M: f64 = 32_767.0;

/// `x` metres rounded down to a quantum, or `None` out of reach (or NaN).
pub fn place_down(x: f64) -> Option<i32> {
    (x.abs() <= REACH_M).then(|| (x * f64::from(1u32 << PLACE_BITS)).floor() as i32)
}

/// Rounded up.
pub fn place_up(x: f64) -> Option<i32> {
    place_down(-x).map(|q| -q)
}

/// A component of a unit vector, rounded to nearest: wrong by half a quantum at most.
pub fn direction(x: f64) -> i32 {
    (x * f64::from(1u32 << DIRECTION_BITS)).round() as i32
}

/// `x` metres with the fraction bits of a product, rounded up.
pub fn product_up(x: f64) -> Option<i64> {
    let one = ((PLACE_BITS + DIRECTION_BITS) as f64).exp2();
    (x.abs() <= REACH_M).then(|| (x * one).ceil() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn places_are_enclosed_within_a_quantum(x in -32_767.0f64..32_767.0) {
            let (lo, hi) = (place_down(x).unwrap(), place_up(x).unwrap());
            let quantum = 1.0 / 65_536.0;
            prop_assert!(f64::from(lo) * quantum <= x && x <= f64::from(hi) * quantum && hi - lo <= 1);
        }
    }

    #[test]
    fn what_does_not_fit_is_said_and_never_wraps() {
        // H.3
        for x in [32_768.0, -1e6, f64::NAN, f64::INFINITY] {
            assert_eq!((place_down(x), place_up(x), product_up(x)), (None, None, None), "{x}");
        }
        assert_eq!(place_up(-REACH_M), Some(-(32_767 << 16)));
        assert_eq!((direction(1.0), direction(-1.0)), (1 << 28, -(1 << 28)));
    }
}
