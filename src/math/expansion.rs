//! Sums of f64 without any rounding: expansions (Shewchuk, Adaptive Precision
//! Floating-Point Arithmetic and Fast Robust Geometric Predicates, 1997).
//!
//! An expansion is a list of f64, in order of magnitude, whose bits do not
//! overlap; its value is their exact sum and its sign that of the last one
//! that is not zero. Exact as long as nothing over- or underflows, which is the caller's
//! to know ([`in_range`]); [`super::exact`] has no such limit.

use std::cmp::Ordering;

/// Room for the longest sum that a plane needs.
const MOST: usize = 24;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expansion {
    parts: [f64; MOST],
    len: usize,
}

impl Default for Expansion {
    fn default() -> Expansion {
        Expansion { parts: [0.0; MOST], len: 0 }
    }
}

impl Expansion {
    /// Adds `b` (grow-expansion).
    ///
    /// # Panics
    /// If more was added than there is room for.
    #[inline]
    pub fn add(&mut self, b: f64) {
        let mut q = b;
        for part in &mut self.parts[..self.len] {
            (q, *part) = two_sum(q, *part);
        }
        self.parts[self.len] = q;
        self.len += 1;
    }

    /// Adds `a b`.
    pub fn add_product(&mut self, a: f64, b: f64) {
        let (product, error) = two_product(a, b);
        self.add(error);
        self.add(product);
    }

    /// The same value in as few parts as it takes (compress).
    pub fn compressed(&self) -> Expansion {
        let mut reversed = [0.0; MOST];
        let mut top = 0;
        let mut q = 0.0;
        for part in self.parts[..self.len].iter().rev() {
            let (sum, rest) = two_sum(q, *part);
            if rest == 0.0 {
                q = sum;
            } else {
                reversed[top] = sum;
                top += 1;
                q = rest;
            }
        }
        let mut out = Expansion::default();
        for part in reversed[..top].iter().rev() {
            let (sum, rest) = two_sum(*part, q);
            if rest != 0.0 {
                out.parts[out.len] = rest;
                out.len += 1;
            }
            q = sum;
        }
        if q != 0.0 {
            out.parts[out.len] = q;
            out.len += 1;
        }
        out
    }

    #[inline]
    pub fn sign(&self) -> Ordering {
        let last = self.parts[..self.len].iter().rev().find(|p| **p != 0.0).unwrap_or(&0.0);
        last.partial_cmp(&0.0).expect("in range, so never NaN")
    }

    pub fn parts(&self) -> &[f64] {
        &self.parts[..self.len]
    }
}

/// `a + b` and its rounding error (Knuth).
#[inline]
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let b_virtual = s - a;
    let a_virtual = s - b_virtual;
    (s, (a - a_virtual) + (b - b_virtual))
}

/// `a b` and its rounding error (Dekker, by halves: the portable baseline does not fuse).
#[inline]
pub fn two_product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    (p, a_low * b_low - (((p - a_high * b_high) - a_low * b_high) - a_high * b_low))
}

/// `a` as a sum of two numbers of at most 26 bits (Veltkamp).
#[inline]
pub fn split(a: f64) -> (f64, f64) {
    let c = a * ((1u32 << 27) + 1) as f64;
    let high = c - (c - a);
    (high, a - high)
}

/// Sums of products of two such numbers neither over- nor underflow: their lowest bits are
/// at least 2^-704, products of sums of a few of them below 2^610.
pub fn in_range(x: f64) -> bool {
    x == 0.0 || (2f64.powi(-300)..2f64.powi(300)).contains(&x.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::math::exact;
    use proptest::prelude::*;

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            Just(0.0),
            (-1000i32..1000).prop_map(f64::from),
            (any::<i32>(), -90i32..90).prop_map(|(m, e)| f64::from(m) * 2f64.powi(e)),
            (-1f64..1.0, -60i32..60).prop_map(|(m, e)| m * 2f64.powi(e)),
        ]
    }

    proptest! {
        #[test]
        fn sums_of_products_have_the_sign_of_whole_numbers(
            n in proptest::array::uniform3(number()), p in proptest::array::uniform3(number()), near in -2i32..3,
        ) {
            // An offset that cancels the products all but a few units of rounding.
            let mut d = -(n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
            for _ in 0..near.abs() {
                d = if near > 0 { d.next_up() } else { d.next_down() };
            }
            prop_assume!(n.iter().chain(&p).chain([&d]).all(|x| in_range(*x)));
            let mut sum = Expansion::default();
            sum.add(d);
            (0..3).for_each(|i| sum.add_product(n[i], p[i]));
            let small = sum.compressed();
            let want = exact::sign_of_plane(n.into(), d, DVec3::ZERO, p.into(), DVec3::ZERO);
            prop_assert_eq!((sum.sign(), small.sign()), (want, want));
            prop_assert!(small.parts().len() <= sum.parts().len() && small.parts().iter().all(|x| *x != 0.0));
            // The compressed sum is the same number: nothing is left when it is taken away.
            let mut rest = sum;
            small.parts().iter().for_each(|x| rest.add(-x));
            prop_assert_eq!(rest.sign(), Ordering::Equal);
        }

        #[test]
        fn halves_multiply_without_rounding(a in number(), b in any::<f32>()) {
            let (high, low) = split(a);
            let b = f64::from(b);
            prop_assume!(in_range(a) && b.is_finite());
            prop_assert_eq!(high + low, a);
            prop_assert_eq!(two_product(high, b).1, 0.0);
            prop_assert_eq!(two_product(low, b).1, 0.0);
        }
    }
}
