//! Signs of small determinants in whole numbers of unbounded length.
//!
//! Every finite f64 is a whole number times a power of two, so a determinant of
//! differences of f64 is one too: no rounding, no underflow, no overflow. Slow,
//! and therefore the last resort of [`super::predicates`] and the twin that its
//! tests compare the quick paths with.

use glam::DVec3;
use std::cmp::Ordering;

/// Sign and magnitude, least significant word first, no leading zero words.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Whole {
    negative: bool,
    words: Vec<u32>,
}

impl Whole {
    /// `x / 2^unit`, which the caller knows to be whole.
    fn of(x: f64, unit: i32) -> Whole {
        let (mantissa, exponent) = decompose(x);
        let shift = if mantissa == 0 { 0 } else { (exponent - unit) as usize };
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

    fn minus(&self, o: &Whole) -> Whole {
        self.plus(&Whole { negative: !o.negative, words: o.words.clone() })
    }

    fn plus(&self, o: &Whole) -> Whole {
        if self.negative == o.negative {
            return Whole { negative: self.negative, words: add(&self.words, &o.words) };
        }
        match compare(&self.words, &o.words) {
            Ordering::Less => Whole { negative: o.negative, words: subtract(&o.words, &self.words) },
            _ => Whole { negative: self.negative, words: subtract(&self.words, &o.words) },
        }
        .trimmed()
    }

    fn times(&self, o: &Whole) -> Whole {
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

    fn sign(&self) -> Ordering {
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

/// The sign of `normal . (origin + corner - eye) + offset`.
///
/// # Panics
/// If a number is not finite.
pub fn sign_of_plane(normal: DVec3, corner: DVec3, origin: DVec3, eye: DVec3, offset: f64) -> Ordering {
    let unit = common_unit(&[corner, origin, eye]);
    let normal_unit = common_unit(&[normal]);
    // The product of a whole normal and a whole place has the unit of both, which the
    // offset must be a multiple of too: a finer offset refines the places.
    let offset_unit = if offset == 0.0 { i32::MAX } else { decompose(offset).1 };
    let unit = unit.min(offset_unit.saturating_sub(normal_unit));
    let place = |k: usize| Whole::of(origin[k], unit).plus(&Whole::of(corner[k], unit)).minus(&Whole::of(eye[k], unit));
    let sum = Whole::of(offset, unit + normal_unit);
    (0..3).fold(sum, |sum, k| sum.plus(&Whole::of(normal[k], normal_unit).times(&place(k)))).sign()
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

    #[test]
    fn an_offset_finer_than_all_else_still_decides() {
        for (offset, expected) in [(-1.0, Ordering::Less), (0.0, Ordering::Equal), (5e-324, Ordering::Greater)] {
            assert_eq!(sign_of_plane(DVec3::X, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, offset), expected);
            let far = DVec3::new(1e8, 0.0, 0.0);
            assert_eq!(sign_of_plane(DVec3::new(0.6, 0.0, 0.8), DVec3::ZERO, far, far, offset), expected);
        }
    }

    proptest! {
        #[test]
        fn plane_signs_agree_with_i128(v in proptest::array::uniform12(-(1i64 << 40)..(1i64 << 40)), o in -3i64..3) {
            let unit = (-20f64).exp2();
            let point = |i: usize| DVec3::new(v[i] as f64, v[i + 1] as f64, v[i + 2] as f64) * unit;
            let sum: i128 = (0..3)
                .map(|k| i128::from(v[k]) * (i128::from(v[k + 3]) + i128::from(v[k + 6]) - i128::from(v[k + 9])))
                .sum();
            let found = sign_of_plane(point(0), point(3), point(6), point(9), 0.0);
            prop_assert_eq!(found, sum.cmp(&0));
            // On the plane, and a hair off it.
            let offset = -(sum as f64);
            if offset as i128 == -sum {
                let hair = o as f64 * unit * unit;
                let found = sign_of_plane(point(0), point(3), point(6), point(9), offset * unit * unit);
                prop_assert_eq!(found, Ordering::Equal);
                let beside = offset * unit * unit + hair;
                let exact = (sum + (beside / (unit * unit)) as i128).cmp(&0);
                prop_assert_eq!(sign_of_plane(point(0), point(3), point(6), point(9), beside), exact);
            }
        }
    }

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

    #[test]
    fn the_widest_range_of_exponents_still_gives_the_sign() {
        let (tiny, huge) = (5e-324, 1.7e308);
        let [v0, v1, v2] = [DVec3::ZERO, DVec3::new(huge, 0.0, 0.0), DVec3::new(0.0, tiny, 0.0)];
        assert_eq!(sign_of_differences(v0, v1, v2, DVec3::new(0.0, 0.0, tiny)), Ordering::Less);
        assert_eq!(sign_of_differences(v0, v1, v2, DVec3::new(1.0, 1.0, 0.0)), Ordering::Equal);
        assert_eq!(sign_along(v0, v1, v2, DVec3::new(huge, huge, -tiny)), Ordering::Less);
    }
}
