//! Lines of the image plane with whole coefficients, and convex regions that are
//! lists of lines: exact whatever is cut from whatever, since no corner is computed.
//!
//! A corner is the meeting of two consecutive lines, and on which side of a third
//! it lies is the sign of one determinant of given coefficients. So errors cannot
//! grow from cut to cut (Sugihara & Iri 1989 build solids in this way; Bernstein &
//! Fussell 2009 polyhedra). The determinant is first asked in f64 under an error
//! bound, then in whole numbers of unbounded length.
//!
//! Class: exact. Regions are open: what has no inside is nothing.

use crate::math::exact::Whole;
use std::cmp::Ordering;

/// `x * c[0] + y * c[1] + c[2]`, up to a positive factor.
#[derive(Debug, Clone)]
pub struct Line {
    exact: [Whole; 3],
    /// The same rounded, the largest about 2^53; each wrong by at most 2^-52 of itself.
    rounded: [f64; 3],
}

impl Line {
    pub(super) fn new(exact: [Whole; 3]) -> Line {
        let parts = exact.each_ref().map(Whole::leading);
        let top = parts.iter().filter(|p| p.0 != 0.0).map(|p| p.1).max().unwrap_or(0);
        let rounded = parts.map(|(m, e)| libm::ldexp(m, e - top));
        Line { exact, rounded }
    }
}

/// Each coefficient is cut by 2 u, a product of three by 6 u, and evaluation adds 6 u.
const FILTER: f64 = 16.0 * f64::EPSILON / 2.0;

/// The sign of `det(a, b, c)`: the side of `c` on which the meeting of `a` and `b`
/// lies, where they turn counter-clockwise.
fn side(a: &Line, b: &Line, c: &Line) -> Ordering {
    let ([a0, a1, a2], [b0, b1, b2], [c0, c1, c2]) = (a.rounded, b.rounded, c.rounded);
    let terms = [a1 * b2 * c0, -(a2 * b1 * c0), a2 * b0 * c1, -(a0 * b2 * c1), a0 * b1 * c2, -(a1 * b0 * c2)];
    let value: f64 = terms.iter().sum();
    let size: f64 = terms.iter().map(|t| t.abs()).sum();
    // The second summand covers coefficients that underflowed beside larger ones.
    if value.abs() > FILTER * size + 1e-240 {
        return value.total_cmp(&0.0);
    }
    let minor = |i: usize, j: usize| a.exact[i].times(&b.exact[j]).minus(&a.exact[j].times(&b.exact[i]));
    let [c0, c1, c2] = &c.exact;
    minor(1, 2).times(c0).plus(&minor(2, 0).times(c1)).plus(&minor(0, 1).times(c2)).sign()
}

/// A line of a list and whether its other side is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bound {
    pub line: u32,
    pub turned: bool,
}

/// An open convex region: left of every bound, in counter-clockwise order.
pub type Region = Vec<Bound>;

/// What a line leaves of a region on its positive and on its negative side.
pub struct Halves {
    pub inside: Option<Region>,
    pub outside: Option<Region>,
}

/// The side of `line` on which each corner lies; corner i is where bounds i and i + 1 meet.
pub fn sides(lines: &[Line], region: &Region, line: u32) -> Vec<Ordering> {
    let corner = |i: usize| {
        let (a, b) = (region[i], region[(i + 1) % region.len()]);
        let sign = side(&lines[a.line as usize], &lines[b.line as usize], &lines[line as usize]);
        if a.turned == b.turned { sign } else { sign.reverse() }
    };
    (0..region.len()).map(corner).collect()
}

/// Cuts a region; `sides` are those of its corners.
pub fn cut(region: Region, line: u32, sides: &[Ordering]) -> Halves {
    if !sides.contains(&Ordering::Less) {
        return Halves { inside: Some(region), outside: None };
    }
    if !sides.contains(&Ordering::Greater) {
        return Halves { inside: None, outside: Some(region) };
    }
    let half = |wanted: Ordering, bound: Bound| {
        let mut out = Vec::with_capacity(region.len() + 1);
        for (i, own) in region.iter().enumerate() {
            let (before, after) = (sides[(i + sides.len() - 1) % sides.len()], sides[i]);
            // A side that only touches the line with its end has no length left.
            if before == wanted || after == wanted {
                out.push(*own);
            }
            if before == wanted && after != wanted {
                out.push(bound);
            }
        }
        Some(out)
    };
    Halves {
        inside: half(Ordering::Greater, Bound { line, turned: false }),
        outside: half(Ordering::Less, Bound { line, turned: true }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(c: [i32; 3]) -> Line {
        Line::new(c.map(|x| Whole::of(f64::from(x), 0)))
    }

    /// The square from (0, 0) to (8, 8).
    fn square() -> (Vec<Line>, Region) {
        let lines = vec![line([0, 1, 0]), line([-1, 0, 8]), line([0, -1, 8]), line([1, 0, 0])];
        (lines, (0..4).map(|line| Bound { line, turned: false }).collect())
    }

    fn halve(lines: &mut Vec<Line>, region: &Region, by: [i32; 3]) -> Halves {
        lines.push(line(by));
        let by = lines.len() as u32 - 1;
        let sides = sides(lines, region, by);
        cut(region.clone(), by, &sides)
    }

    #[test]
    fn a_line_cuts_a_square_in_two_or_not_at_all() {
        let (mut lines, square) = square();
        let both = halve(&mut lines, &square, [1, 0, -3]);
        assert_eq!((both.inside.unwrap().len(), both.outside.unwrap().len()), (4, 4));
        // Through two corners: two triangles, and no side without length.
        let both = halve(&mut lines, &square, [1, -1, 0]);
        assert_eq!((both.inside.unwrap().len(), both.outside.unwrap().len()), (3, 3));
        // Along a side, and past a corner.
        for by in [[1, 0, 0], [1, 1, 0]] {
            assert!(halve(&mut lines, &square, by).outside.is_none());
        }
        assert!(halve(&mut lines, &square, [1, 0, -8]).inside.is_none());
    }

    #[test]
    fn cuts_of_cuts_agree_with_points_on_a_fine_grid() {
        use rand_chacha::rand_core::{RngCore, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut small = || (rng.next_u32() % 9) as i32 - 4;
        for _ in 0..300 {
            let (mut lines, mut region) = square();
            let mut kept: Vec<([i32; 3], bool)> = Vec::new();
            for _ in 0..4 {
                let by = [small(), small(), small() * 4];
                if by[0] == 0 && by[1] == 0 {
                    continue;
                }
                let halves = halve(&mut lines, &region, by);
                let side = small() > 0 && halves.inside.is_some() || halves.outside.is_none();
                region = if side { halves.inside } else { halves.outside }.unwrap();
                kept.push((by, side));
            }
            // Points at odd 32nds are never on a corner; a region that is not empty
            // may still be too thin for them, but it must hold all that is inside.
            let inside = |x: f64, y: f64| {
                region.iter().all(|b| {
                    let c = lines[b.line as usize].rounded;
                    (c[0] * x + c[1] * y + c[2] > 0.0) != b.turned
                })
            };
            for i in 0..64 {
                for j in 0..64 {
                    let (x, y) = (f64::from(2 * i + 1) / 16.0, f64::from(2 * j + 1) / 16.0 + 1.0 / 64.0);
                    let value = |c: [i32; 3]| f64::from(c[0]) * x + f64::from(c[1]) * y + f64::from(c[2]);
                    let should = kept.iter().all(|(c, side)| value(*c) != 0.0 && (value(*c) > 0.0) == *side);
                    if y < 8.0 && kept.iter().all(|(c, _)| value(*c) != 0.0) {
                        assert_eq!(inside(x, y), should, "{kept:?} at {x}, {y}");
                    }
                }
            }
        }
    }
}
