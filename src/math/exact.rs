//! Signs of small determinants, and sides of planes, in whole numbers of unbounded length.
//!
//! Every finite f64 is a whole number times a power of two, so a determinant of
//! differences of f64 is one too: no rounding, no underflow, no overflow. Slow,
//! and therefore the last resort of [`super::predicates`] and the twin that its
//! tests compare the quick paths with.

use glam::DVec3;
use std::cmp::Ordering;

/// Sign and magnitude, least significant word first, no leading zero words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Whole {
    negative: bool,
    words: Vec<u32>,
}

impl Whole {
    /// `x / 2^unit`, which the caller knows to be whole.
    pub(crate) fn of(x: f64, unit: i32) -> Whole {
        let (mut mantissa, exponent) = decompose(x);
        let mut shift = 0;
        if exponent >= unit && mantissa != 0 {
            shift = (exponent - unit) as usize;
        } else {
            // The bits that fall off are zeros.
            mantissa = mantissa.checked_shr((unit - exponent) as u32).unwrap_or(0);
        }
        let mut words = vec![0; shift / 32];
        let wide = u128::from(mantissa) << (shift % 32);
        words.extend((0..4).map(|i| (wide >> (32 * i)) as u32));
        Whole { negative: x < 0.0, words }.trimmed()
    }

    fn trimmed(mut self) -> Whole {
        while self.words.last() == Some(&0) {
            self.words.pop();
        }
        self
    }

    pub(crate) fn minus(&self, o: &Whole) -> Whole {
        self.plus(&Whole { negative: !o.negative, words: o.words.clone() })
    }

    pub(crate) fn plus(&self, o: &Whole) -> Whole {
        if self.negative == o.negative {
            return Whole { negative: self.negative, words: add(&self.words, &o.words) };
        }
        match compare(&self.words, &o.words) {
            Ordering::Less => Whole { negative: o.negative, words: subtract(&o.words, &self.words) },
            _ => Whole { negative: self.negative, words: subtract(&self.words, &o.words) },
        }
        .trimmed()
    }

    pub(crate) fn times(&self, o: &Whole) -> Whole {
        let mut words = vec![0u32; self.words.len() + o.words.len()];
        for (i, a) in self.words.iter().enumerate() {
            let mut carry = 0u64;
            for (j, b) in o.words.iter().enumerate() {
                let t = u64::from(*a) * u64::from(*b) + u64::from(words[i + j]) + carry;
                words[i + j] = t as u32;
                carry = t >> 32;
            }
            words[i + o.words.len()] = carry as u32;
        }
        Whole { negative: self.negative != o.negative, words }.trimmed()
    }

    /// Times `2^by`.
    fn shifted(&self, by: usize) -> Whole {
        let mut words = vec![0; by / 32];
        let mut carry = 0;
        for word in &self.words {
            let wide = u64::from(*word) << (by % 32);
            words.push(wide as u32 | carry);
            carry = (wide >> 32) as u32;
        }
        words.push(carry);
        Whole { negative: self.negative, words }.trimmed()
    }

    /// `(m, e)` with the number between `m 2^e` and the next f64 away from zero.
    pub(crate) fn leading(&self) -> (f64, i32) {
        let top = self.words.iter().rev().take(4).fold(0u128, |m, w| m << 32 | u128::from(*w));
        let below = 32 * self.words.len().saturating_sub(4) as i32;
        // Cut to the 53 bits that an f64 holds, so that the cast is exact.
        let spare = (75 - top.leading_zeros() as i32).max(0);
        let m = (top >> spare) as f64;
        (if self.negative { -m } else { m }, below + spare)
    }

    pub(crate) fn sign(&self) -> Ordering {
        match (self.words.is_empty(), self.negative) {
            (true, _) => Ordering::Equal,
            (_, true) => Ordering::Less,
            (_, false) => Ordering::Greater,
        }
    }
}

fn compare(a: &[u32], b: &[u32]) -> Ordering {
    a.len().cmp(&b.len()).then_with(|| a.iter().rev().cmp(b.iter().rev()))
}

fn add(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut carry = 0u64;
    let mut out: Vec<u32> = (0..a.len().max(b.len()))
        .map(|i| {
            let t = u64::from(*a.get(i).unwrap_or(&0)) + u64::from(*b.get(i).unwrap_or(&0)) + carry;
            carry = t >> 32;
            t as u32
        })
        .collect();
    if carry > 0 {
        out.push(carry as u32);
    }
    out
}

/// `a - b` for `a >= b`.
fn subtract(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut borrow = 0i64;
    a.iter()
        .enumerate()
        .map(|(i, x)| {
            let t = i64::from(*x) - i64::from(*b.get(i).unwrap_or(&0)) - borrow;
            borrow = i64::from(t < 0);
            t as u32
        })
        .collect()
}

/// `|x| = mantissa * 2^exponent`, `x` finite.
fn decompose(x: f64) -> (u64, i32) {
    let bits = x.to_bits();
    let (field, fraction) = ((bits >> 52 & 0x7ff) as i32, bits & ((1 << 52) - 1));
    if field == 0 { (fraction, -1074) } else { (fraction | 1 << 52, field - 1075) }
}

/// The largest exponent whose power of two divides `x`; 0 for 0.
pub(crate) fn unit_of(x: f64) -> i32 {
    let (mantissa, exponent) = decompose(x);
    if mantissa == 0 { 0 } else { exponent + mantissa.trailing_zeros() as i32 }
}

/// The sign of `det(v0 - e, v1 - e, v2 - e)`, rows.
pub fn sign_of_differences(v0: DVec3, v1: DVec3, v2: DVec3, e: DVec3) -> Ordering {
    let unit = common_unit(&[v0, v1, v2, e]);
    let from_e = |p: DVec3| [0, 1, 2].map(|k| Whole::of(p[k], unit).minus(&Whole::of(e[k], unit)));
    sign_of_rows(&from_e(v0), &from_e(v1), &from_e(v2))
}

/// The sign of `((v1 - v0) x (v2 - v0)) . direction`.
pub fn sign_along(v0: DVec3, v1: DVec3, v2: DVec3, direction: DVec3) -> Ordering {
    let unit = common_unit(&[v0, v1, v2]);
    let from_v0 = |p: DVec3| [0, 1, 2].map(|k| Whole::of(p[k], unit).minus(&Whole::of(v0[k], unit)));
    let unit = common_unit(&[direction]);
    sign_of_rows(&from_v0(v1), &from_v0(v2), &[0, 1, 2].map(|k| Whole::of(direction[k], unit)))
}

/// The sign of `normal . (origin + offset - eye) + d`: on which side of a plane that
/// is given relative to the eye a point lies that is given relative to an origin.
pub fn sign_of_plane(normal: DVec3, d: f64, origin: DVec3, offset: DVec3, eye: DVec3) -> Ordering {
    let (unit, unit_n) = (common_unit(&[origin, offset, eye]), common_unit(&[normal]));
    // In units of both, of which `d` need not be a multiple.
    let (unit_sum, unit_d) = (unit + unit_n, common_unit(&[DVec3::splat(d)]));
    let common = if d == 0.0 { unit_sum } else { unit_sum.min(unit_d) };
    let mut sum = Whole::of(d, common);
    for k in 0..3 {
        let relative = Whole::of(origin[k], unit).plus(&Whole::of(offset[k], unit)).minus(&Whole::of(eye[k], unit));
        sum = sum.plus(&relative.times(&Whole::of(normal[k], unit_n)).shifted((unit_sum - common) as usize));
    }
    sum.sign()
}

/// On which side of the edge from the image of `ends[0]` to that of `ends[1]` a point lies
/// on the image plane: positive is left of it, where the image's x is to the right and y up.
/// A point `p` shows at the quotients of `(basis[0], basis[1]) . (p - eye)` and
/// `basis[2] . (p - eye)`; without `perspective` at the former two themselves. With ends
/// before and behind the eye, the sign of the triple product.
pub fn sign_on_image(ends: [DVec3; 2], eye: DVec3, basis: &[DVec3; 3], perspective: bool, at: [f64; 2]) -> Ordering {
    // A one must be whole in these units, too.
    let unit_p = common_unit(&[ends[0], ends[1], eye]).min(0);
    let unit_b = common_unit(basis).min(0);
    let along = |p: DVec3, axis: DVec3| {
        let part =
            |k: usize| Whole::of(p[k], unit_p).minus(&Whole::of(eye[k], unit_p)).times(&Whole::of(axis[k], unit_b));
        part(0).plus(&part(1)).plus(&part(2))
    };
    let row = |p: DVec3| {
        let last = if perspective { along(p, basis[2]) } else { Whole::of(1.0, unit_p + unit_b) };
        [along(p, basis[0]), along(p, basis[1]), last]
    };
    let at = DVec3::new(at[0], at[1], 1.0);
    let unit = common_unit(&[at]);
    sign_of_rows(&at.to_array().map(|x| Whole::of(x, unit)), &row(ends[0]), &row(ends[1]))
}

fn common_unit(points: &[DVec3]) -> i32 {
    points.iter().flat_map(|p| p.to_array()).filter(|x| *x != 0.0).map(|x| decompose(x).1).min().unwrap_or(0)
}

fn sign_of_rows(a: &[Whole; 3], b: &[Whole; 3], c: &[Whole; 3]) -> Ordering {
    let minor = |i: usize, j: usize| b[i].times(&c[j]).minus(&b[j].times(&c[i]));
    a[0].times(&minor(1, 2)).plus(&a[1].times(&minor(2, 0))).plus(&a[2].times(&minor(0, 1))).sign()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn whole_number_arithmetic_agrees_with_i128(a in any::<i64>(), b in any::<i64>(), c in any::<i64>()) {
            let whole = |x: i64| Whole {
                negative: x < 0,
                words: vec![x.unsigned_abs() as u32, (x.unsigned_abs() >> 32) as u32],
            }.trimmed();
            let value = |w: &Whole| {
                let m = w.words.iter().rev().fold(0i128, |m, x| m << 32 | i128::from(*x));
                if w.negative { -m } else { m }
            };
            prop_assert_eq!(value(&whole(a).times(&whole(b))), i128::from(a) * i128::from(b));
            prop_assert_eq!(value(&whole(a).plus(&whole(c))), i128::from(a) + i128::from(c));
            prop_assert_eq!(value(&whole(a).times(&whole(b)).minus(&whole(c))), i128::from(a) * i128::from(b) - i128::from(c));
        }

        #[test]
        fn determinants_of_small_whole_numbers_are_right(m in proptest::array::uniform12(-1000i64..1000)) {
            let point = |i: usize| DVec3::new(m[i] as f64, m[i + 1] as f64, m[i + 2] as f64);
            let d = |i: usize, k: usize| i128::from(m[3 * i + k] - m[9 + k]);
            let det = d(0, 0) * (d(1, 1) * d(2, 2) - d(1, 2) * d(2, 1)) - d(0, 1) * (d(1, 0) * d(2, 2) - d(1, 2) * d(2, 0))
                + d(0, 2) * (d(1, 0) * d(2, 1) - d(1, 1) * d(2, 0));
            prop_assert_eq!(sign_of_differences(point(0), point(3), point(6), point(9)), det.cmp(&0));
        }
    }

    proptest! {
        #[test]
        fn the_side_of_a_plane_is_that_of_small_whole_numbers(
            m in proptest::array::uniform12(-1000i64..1000), d in -3_000_000i64..3_000_000, shift in 0usize..70,
        ) {
            // The offset in units far below, and far above, those of the products.
            let point = |i: usize| DVec3::new(m[i] as f64, m[i + 1] as f64, m[i + 2] as f64);
            let dot: i64 = (0..3).map(|k| m[k] * (m[3 + k] + m[6 + k] - m[9 + k])).sum();
            let small = libm::exp2(-(shift as f64));
            let want = ((i128::from(dot) << shift) + i128::from(d)).cmp(&0);
            prop_assert_eq!(sign_of_plane(point(0), d as f64 * small, point(3), point(6), point(9)), want);
            let want = (i128::from(dot) + (i128::from(d) << shift)).cmp(&0);
            prop_assert_eq!(sign_of_plane(point(0), d as f64 / small, point(3), point(6), point(9)), want);
        }
    }

    proptest! {
        #[test]
        fn the_side_on_the_image_is_that_of_small_whole_numbers(
            m in proptest::array::uniform20(-50i64..50), shift in 0i32..60, perspective in any::<bool>(),
        ) {
            // All at once in other units: no sign depends on them.
            let unit = libm::exp2(f64::from(-shift));
            let point = |i: usize, unit: f64| DVec3::new(m[i] as f64, m[i + 1] as f64, m[i + 2] as f64) * unit;
            let basis = [point(9, 1.0), point(12, 1.0), point(15, 1.0)];
            let along = |p: usize, axis: usize| (0..3).map(|k| (m[p + k] - m[6 + k]) * m[axis + k]).sum::<i64>();
            let row = |p: usize| [along(p, 9), along(p, 12), if perspective { along(p, 15) } else { 1 }];
            let ([ax, ay, az], [bx, by, bz]) = (row(0), row(3));
            let want = m[18] * (ay * bz - az * by) + m[19] * (az * bx - ax * bz) + (ax * by - ay * bx);
            let (ends, at) = ([point(0, unit), point(3, unit)], [m[18] as f64, m[19] as f64]);
            // Parallel rays know lengths, so there the image shrinks with the scene.
            let at = if perspective { at } else { at.map(|x| x * unit) };
            prop_assert_eq!(sign_on_image(ends, point(6, unit), &basis, perspective, at), want.cmp(&0));
        }
    }

    #[test]
    fn leading_digits_are_those_of_the_number() {
        for x in [0.0, 1.0, -3.0, 0.1, 1e300, -7e-12, 6.02e23] {
            for unit in [unit_of(x), unit_of(x) - 90] {
                let whole = Whole::of(x, unit);
                let (m, e) = whole.leading();
                assert_eq!(libm::ldexp(m, e + unit), x);
                // Squared it has more digits than an f64, which are cut towards zero.
                let (m, e) = whole.times(&whole).leading();
                let square = libm::ldexp(m, e + 2 * unit);
                assert!(square <= x * x * (1.0 + 3e-16) && square >= x * x * (1.0 - 5e-16), "{x}");
            }
        }
    }

    #[test]
    fn the_widest_range_of_exponents_still_gives_the_sign() {
        let (tiny, huge) = (5e-324, 1.7e308);
        let [v0, v1, v2] = [DVec3::ZERO, DVec3::new(huge, 0.0, 0.0), DVec3::new(0.0, tiny, 0.0)];
        assert_eq!(sign_of_differences(v0, v1, v2, DVec3::new(0.0, 0.0, tiny)), Ordering::Less);
        assert_eq!(sign_of_differences(v0, v1, v2, DVec3::new(1.0, 1.0, 0.0)), Ordering::Equal);
        assert_eq!(sign_along(v0, v1, v2, DVec3::new(huge, huge, -tiny)), Ordering::Less);
    }
}
