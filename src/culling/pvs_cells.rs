//! Potentially visible sets of view cells, by sampling: what the walk `pvs` looks up.
//!
//! Cells are boxes of a grid through all of space, as large as the scene's longest side
//! over a number. The eye points of a cell are a digital sequence to base 8 with
//! scrambled digits (Owen 1995): the first 8 lie in the eight octants of the cell, the
//! first 64 in theirs, and so on, and the first `m` points of a longer sequence are the
//! same points. A cell's sets follow from scene, cell and parameters alone, whenever and by
//! however many threads they are sampled.

use super::descent::bottom_up;
use crate::hierarchy::{Hierarchy, NONE};
use crate::math::DVec3;
use crate::raster::Kind;
use crate::raster::items::{Items, Lens};
use crate::scene::Scene;
use rayon::prelude::*;

#[derive(Debug, Clone, Copy)]
pub struct Sampling {
    /// Cells along the longest side of the scene.
    pub cells: u32,
    /// Points a cell.
    pub eyes: u32,
    pub seed: u64,
    pub lens: Lens,
    /// One set a point instead of their union.
    pub nearest: bool,
}

pub type CellNumber = [i64; 3];

/// What is seen from one point or from all of a cell.
#[derive(Debug)]
pub struct Set {
    /// Bit per position.
    pub members: Vec<u64>,
    /// By block, the lanes with members at or below them.
    pub any: Vec<u8>,
    pub triangles: u64,
    /// Of all that samples could see, the share that these did not: the share of samples
    /// that saw what no other did (Good & Turing; Good 1953). Parts in a million.
    pub missing_ppm: u64,
}

#[derive(Debug)]
pub struct Cell {
    points: Vec<DVec3>,
    /// One, or as many as points.
    sets: Vec<Set>,
}

impl Cell {
    /// The set to use from `eye`.
    pub fn set(&self, eye: DVec3) -> &Set {
        if self.sets.len() == 1 {
            return &self.sets[0];
        }
        let away = |i: &usize| self.points[*i].distance_squared(eye);
        let nearest = (0..self.points.len()).min_by(|a, b| away(a).total_cmp(&away(b)));
        &self.sets[nearest.expect("a cell has points")]
    }
}

/// Where the cells are and what can be seen from them.
#[derive(Debug, Default)]
pub struct Space {
    items: Items,
    corner: DVec3,
    size_m: f64,
}

impl Space {
    pub fn new(scene: &Scene, sampling: &Sampling) -> Space {
        let items = Items {
            positions: scene.positions.clone(),
            triangles: scene.triangles.clone(),
            kinds: (0..scene.len() as u32).map(|t| Kind::of(scene, t)).collect(),
        };
        let bounds = scene.bounds();
        let longest_m = if scene.is_empty() { 1.0 } else { bounds.size().max_element().max(1e-3) };
        let corner = if scene.is_empty() { DVec3::ZERO } else { bounds.lo };
        Space { items, corner, size_m: longest_m / f64::from(sampling.cells) }
    }

    pub fn bytes(&self) -> usize {
        self.items.bytes()
    }

    pub fn cell_of(&self, eye: DVec3) -> CellNumber {
        ((eye - self.corner) / self.size_m).floor().to_array().map(|x| x as i64)
    }

    /// Point `index` of the sequence in a cell.
    fn point(&self, cell: CellNumber, index: u32, seed: u64) -> DVec3 {
        let mut place = DVec3::ZERO;
        let mut way = cell.iter().fold(mixed(seed), |h, c| mixed(h ^ *c as u64));
        let (mut rest, mut side) = (index, 1.0);
        for _ in 0..17 {
            // Digits that are scrambled by those before them.
            let octant = u64::from(rest % 8) ^ way >> 61;
            rest /= 8;
            side *= 0.5;
            let bit = |k: u64| (octant >> k & 1) as f64;
            place += DVec3::new(bit(0), bit(1), bit(2)) * side;
            way = mixed(way ^ octant);
        }
        let corner = DVec3::from_array(cell.map(|c| c as f64));
        self.corner + (corner + place) * self.size_m
    }

    /// Samples a cell.
    pub fn sampled(&self, cell: CellNumber, hierarchy: &Hierarchy, sampling: &Sampling) -> Cell {
        let points: Vec<DVec3> = (0..sampling.eyes).map(|i| self.point(cell, i, sampling.seed)).collect();
        let see = |p: &DVec3| self.items.seen_from(*p, sampling.lens);
        let set = |seen: &[u32]| set_of(seen, hierarchy);
        let triangles = self.items.triangles.len();
        let sets = if sampling.nearest {
            points.par_iter().map(|p| set(&added(vec![0; triangles], &see(p)))).collect()
        } else {
            // Sums do not depend on who adds what.
            let seen = points.par_iter().fold(|| vec![0; triangles], |sum, p| added(sum, &see(p)));
            let sum = |a: Vec<u32>, b: Vec<u32>| a.iter().zip(b).map(|(a, b)| a.saturating_add(b)).collect();
            vec![set(&seen.reduce(|| vec![0; triangles], sum))]
        };
        Cell { points, sets }
    }
}

fn added(mut sum: Vec<u32>, seen: &[(u32, u32)]) -> Vec<u32> {
    seen.iter().for_each(|(t, n)| sum[*t as usize] = sum[*t as usize].saturating_add(*n));
    sum
}

/// The set of what at least one sample saw; `seen` is by triangle.
fn set_of(seen: &[u32], hierarchy: &Hierarchy) -> Set {
    let samples: u64 = seen.iter().map(|n| u64::from(*n)).sum();
    let once = seen.iter().filter(|n| **n == 1).count() as u64;
    let mut members = vec![0u64; hierarchy.entries.len().div_ceil(64)];
    for (position, t) in hierarchy.entries.iter().enumerate() {
        members[position / 64] |= u64::from(seen[*t as usize] > 0) << (position % 64);
    }
    let mut any = vec![0u8; hierarchy.links.len()];
    bottom_up(hierarchy, |block, lane| {
        let links = &hierarchy.links[block];
        let below = links.child[lane] != NONE && any[links.child[lane] as usize] != 0;
        let own = || runs(&members, links.first[lane], links.own_end[lane]).next().is_some();
        any[block] |= u8::from(below || own()) << lane;
    });
    Set {
        members,
        any,
        triangles: seen.iter().filter(|n| **n > 0).count() as u64,
        missing_ppm: (once * 1_000_000).checked_div(samples).unwrap_or(0),
    }
}

/// Ranges of set bits among positions `first..end`.
pub fn runs(bits: &[u64], first: u32, end: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
    // The next position at which the bit is `set`, or the end.
    let next = move |from: u32, set: bool| {
        let mut at = from;
        while at < end {
            let word = bits[at as usize / 64];
            let ahead = if set { word } else { !word } >> (at % 64);
            if ahead != 0 {
                return (at + ahead.trailing_zeros()).min(end);
            }
            at = (at / 64 + 1) * 64;
        }
        end
    };
    let mut at = first;
    std::iter::from_fn(move || {
        let from = next(at, true);
        at = next(from, false);
        (from < end).then_some((from, at))
    })
}

/// A finaliser of good avalanche (splitmix64).
fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ x >> 31
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn points_are_stratified_and_nested() {
        let space = Space { size_m: 2.0, corner: DVec3::new(10.0, -4.0, 0.5), ..Space::default() };
        for cell in [[0, 0, 0], [3, -2, 1], [-1, -1, 40]] {
            let corner = space.corner + DVec3::from_array(cell.map(|c| c as f64 * 2.0));
            for (count, side) in [(8u32, 2), (64, 4), (512, 8)] {
                let mut strata: Vec<[u64; 3]> = (0..count)
                    .map(|i| (space.point(cell, i, 7) - corner) / 2.0)
                    .map(|p| p.to_array().map(|x| (x * f64::from(side)).floor() as u64))
                    .collect();
                strata.sort_unstable();
                strata.dedup();
                assert_eq!(strata.len(), count as usize, "one in each of {count} parts");
                assert!(strata.iter().flatten().all(|s| *s < side as u64));
            }
            assert!((0..50).all(|i| space.cell_of(space.point(cell, i, 7)) == cell));
            assert_ne!(space.point(cell, 0, 7), space.point(cell, 0, 8));
        }
    }

    proptest! {
        #[test]
        fn runs_are_those_of_single_bits(words in proptest::collection::vec(any::<u64>(), 1..5), a in 0u32..300, b in 0u32..300) {
            let dense: Vec<u64> = words.iter().map(|w| w | w << 1).collect();
            let top = 64 * words.len() as u32;
            let (first, end) = (a.min(b).min(top), a.max(b).min(top));
            for bits in [words, dense] {
                let set = |p: &u32| bits[*p as usize / 64] >> (p % 64) & 1 == 1;
                let want: Vec<u32> = (first..end).filter(set).collect();
                let got: Vec<(u32, u32)> = runs(&bits, first, end).collect();
                prop_assert!(got.windows(2).all(|w| w[0].1 < w[1].0));
                prop_assert_eq!(got.iter().flat_map(|(a, b)| *a..*b).collect::<Vec<_>>(), want);
            }
        }
    }
}
