//! Rectilinear grids: three sorted arrays of planes. A uniform grid finds a cell
//! by arithmetic, an irregular one by three binary searches; both answer to the bit
//! what comparing with the planes says, and neighbours share their plane.

use super::morton::interleave;
use crate::math::{Aabb, DVec3};
use crate::scene::Scene;
use rayon::prelude::*;

/// Cells an axis at most: three axes of nine bits.
pub const CELLS_MAX: u32 = 512;

/// Planes along one axis, ascending and different, the two outer ones included; a
/// flat axis has the same plane twice.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    planes: Vec<f64>,
    /// Cells a metre where the planes are evenly spaced; 0 where they are searched.
    cells_per_m: f64,
}

impl Axis {
    /// `count` cells of one width; fewer where numbers do not tell the planes apart.
    pub fn uniform(lo: f64, hi: f64, count: u32) -> Axis {
        let count = count.clamp(1, CELLS_MAX);
        let size = hi - lo;
        let inner = (1..count).map(|i| (lo + size * (f64::from(i) / f64::from(count))).min(hi));
        let mut axis = Axis::between(lo, hi, inner.collect());
        let cells_per_m = f64::from(count) / size;
        if axis.count() == count && cells_per_m.is_finite() {
            axis.cells_per_m = cells_per_m;
        }
        axis
    }

    /// The planes of `inner` that lie between `lo` and `hi`, in any order.
    pub fn between(lo: f64, hi: f64, mut inner: Vec<f64>) -> Axis {
        inner.retain(|p| lo < *p && *p < hi);
        inner.sort_unstable_by(f64::total_cmp);
        inner.dedup();
        let planes = [lo].into_iter().chain(inner).chain([hi]).collect();
        Axis { planes, cells_per_m: 0.0 }
    }

    pub fn planes(&self) -> &[f64] {
        &self.planes
    }

    pub fn count(&self) -> u32 {
        self.planes.len() as u32 - 1
    }

    /// The cell of a coordinate: the last whose lower plane does not lie above it.
    /// What lies outside belongs to the nearest cell.
    #[inline]
    pub fn locate(&self, x: f64) -> u32 {
        let last = self.planes.len() - 2;
        if self.cells_per_m == 0.0 {
            return self.planes[1..=last].partition_point(|p| *p <= x) as u32;
        }
        // Rounding may miss by a cell where `x` is at a plane.
        let mut i = (((x - self.planes[0]) * self.cells_per_m).max(0.0) as usize).min(last);
        while i > 0 && self.planes[i] > x {
            i -= 1;
        }
        while i < last && self.planes[i + 1] <= x {
            i += 1;
        }
        i as u32
    }

    /// First and last closed cell that an interval touches.
    #[inline]
    pub fn span(&self, lo: f64, hi: f64) -> (u32, u32) {
        let first = self.locate(lo);
        (first - u32::from(first > 0 && self.planes[first as usize] == lo), self.locate(hi))
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    pub axes: [Axis; 3],
    /// Cells are numbered along a Morton curve, so that a run of 8 is compact; else
    /// row by row and layer by layer, x fastest.
    pub morton: bool,
}

impl Grid {
    pub fn uniform(bounds: &Aabb, counts: [u32; 3]) -> Grid {
        let axes = [0, 1, 2].map(|i| Axis::uniform(bounds.lo[i], bounds.hi[i], counts[i]));
        Grid { axes, morton: false }
    }

    pub fn counts(&self) -> [u32; 3] {
        [0, 1, 2].map(|i| self.axes[i].count())
    }

    /// The half-open cell of a point; of points outside, the nearest.
    #[inline]
    pub fn locate(&self, p: DVec3) -> [u32; 3] {
        [self.axes[0].locate(p.x), self.axes[1].locate(p.y), self.axes[2].locate(p.z)]
    }

    /// First and last closed cell on each axis that a box touches.
    pub fn span(&self, b: &Aabb) -> ([u32; 3], [u32; 3]) {
        let s = [0, 1, 2].map(|i| self.axes[i].span(b.lo[i], b.hi[i]));
        (s.map(|s| s.0), s.map(|s| s.1))
    }

    /// The box from cell `first` to cell `last`.
    pub fn range(&self, first: [u32; 3], last: [u32; 3]) -> Aabb {
        let plane = |i: usize, at: u32| self.axes[i].planes[at as usize];
        Aabb {
            lo: DVec3::new(plane(0, first[0]), plane(1, first[1]), plane(2, first[2])),
            hi: DVec3::new(plane(0, last[0] + 1), plane(1, last[1] + 1), plane(2, last[2] + 1)),
        }
    }

    pub fn cell(&self, at: [u32; 3]) -> Aabb {
        self.range(at, at)
    }

    /// Bits that hold every number of a cell.
    pub fn number_bits(&self) -> u32 {
        let [x, y, z] = self.counts();
        u32::BITS - self.number([x - 1, y - 1, z - 1]).leading_zeros()
    }

    #[inline]
    pub fn number(&self, [x, y, z]: [u32; 3]) -> u32 {
        if self.morton {
            return interleave([x, y, z]) as u32;
        }
        (z * self.axes[1].count() + y) * self.axes[0].count() + x
    }

    /// The inverse of [`Grid::number`].
    pub fn at(&self, number: u32) -> [u32; 3] {
        if self.morton {
            let every_third = |from: u32| (0..9).fold(0, |v, bit| v | (number >> (3 * bit + from) & 1) << bit);
            return [every_third(0), every_third(1), every_third(2)];
        }
        let [x, y, _] = self.counts();
        [number % x, number / x % y, number / x / y]
    }
}

/// Cells an axis so that about `cells` of them, nearly cubes, fill a box of this size:
/// `ceil(L_i (cells / V)^(1/3))`, at most [`CELLS_MAX`]. A flat axis gets one layer and
/// counts in no volume: the others share the cells by area, or by length. So does an
/// axis thinner than a cell, or a plate a millimetre thick would get more cells than a flat one.
pub fn resolution(size: DVec3, cells: f64) -> [u32; 3] {
    let mut thick: Vec<usize> = (0..3).filter(|i| size[*i] > 0.0).collect();
    // Roots before products: neither over- nor underflow.
    let root = |x: f64, degree: usize| match degree {
        1 => x,
        2 => x.sqrt(),
        _ => libm::cbrt(x),
    };
    loop {
        let degree = thick.len();
        let per_m = thick.iter().fold(root(cells, degree), |k, i| k / root(size[*i], degree));
        let thinnest = thick.iter().copied().min_by(|a, b| size[*a].total_cmp(&size[*b]));
        match thinnest {
            Some(i) if degree > 1 && size[i] * per_m < 1.0 => thick.retain(|k| *k != i),
            _ => {
                return [0, 1, 2].map(|i| {
                    let wanted = if thick.contains(&i) { (size[i] * per_m).ceil() } else { 1.0 };
                    wanted.clamp(1.0, f64::from(CELLS_MAX)) as u32
                });
            }
        }
    }
}

/// Coordinates strictly inside the bounds in which triangles lie across the axis, all three
/// corners to the bit, with their area there (m2); ascending. `counts` chooses triangles.
pub fn walls_across(scene: &Scene, axis: usize, bounds: &Aabb, counts: impl Fn(u32) -> bool + Sync) -> Vec<(f64, f64)> {
    let (lo, hi) = (bounds.lo[axis], bounds.hi[axis]);
    let in_plane = |t: u32| {
        let [a, b, c] = scene.corners(t).map(|p| p[axis]);
        // Adding 0 makes one of the two zeros.
        (a == b && b == c && lo < a && a < hi && counts(t)).then(|| (a + 0.0, 0.5 * scene.normal(t).length()))
    };
    let mut found: Vec<(f64, f64)> =
        (0..scene.len() as u32).into_par_iter().with_min_len(4096).filter_map(in_plane).collect();
    // Stable: areas are added in the order of the scene.
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.chunk_by(|a, b| a.0 == b.0).map(|wall| (wall[0].0, wall.iter().map(|w| w.1).sum())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The naive twin: a linear scan.
    fn scan(axis: &Axis, x: f64) -> u32 {
        (0..axis.count()).rev().find(|i| axis.planes[*i as usize] <= x).unwrap_or(0)
    }

    /// Closed cells one by one.
    fn touched(axis: &Axis, lo: f64, hi: f64) -> Vec<u32> {
        (0..axis.count()).filter(|i| axis.planes[*i as usize] <= hi && lo <= axis.planes[*i as usize + 1]).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]
        #[test]
        fn locating_agrees_with_a_linear_scan(
            at in prop::sample::select(vec![0.0, -3.0, 1e7, -1e9]), size in prop::sample::select(vec![0.0, 1e-9, 0.7, 8.0, 1e5]),
            count in 1u32..40, inner in prop::collection::vec(0.0..1.0f64, 0..20), x in prop::collection::vec(-0.1..1.1f64, 8),
        ) {
            let (lo, hi) = (at, at + size);
            for axis in [Axis::uniform(lo, hi, count), Axis::between(lo, hi, inner.iter().map(|p| lo + p * size).collect())] {
                prop_assert!(axis.planes.windows(2).all(|w| w[0] < w[1]) || axis.count() == 1);
                let on = axis.planes.iter().flat_map(|p| [*p, p.next_up(), p.next_down()]);
                let inside = |x: &f64| lo <= *x && *x <= hi;
                let all: Vec<f64> = x.iter().map(|x| lo + x * size).chain(on).chain([-1e300, 1e300]).collect();
                for x in &all {
                    prop_assert_eq!(axis.locate(*x), scan(&axis, *x), "{} in {:?}", x, axis);
                }
                for pair in all.windows(2).filter(|w| inside(&w[0]) && inside(&w[1])) {
                    let (a, b) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
                    let (first, last) = axis.span(a, b);
                    prop_assert_eq!((first..=last).collect::<Vec<_>>(), touched(&axis, a, b), "{}..{} in {:?}", a, b, axis);
                }
            }
        }

        #[test]
        fn numbers_of_cells_and_back(counts in prop::array::uniform3(1u32..=512), share in prop::array::uniform3(0.0..1.0f64), morton in any::<bool>()) {
            let grid = Grid { morton, ..Grid::uniform(&Aabb { lo: DVec3::ZERO, hi: DVec3::ONE }, counts) };
            let at = [0, 1, 2].map(|i| (share[i] * f64::from(counts[i])) as u32);
            prop_assert_eq!(grid.at(grid.number(at)), at);
            prop_assert!(u64::from(grid.number(at)) < 1 << grid.number_bits());
        }
    }

    #[test]
    fn the_resolution_is_the_published_one_and_flat_axes_have_one_layer() {
        // 1000 triangles, density 4, in 20 x 10 x 5: (4000 / 1000)^(1/3) cells a metre.
        assert_eq!(resolution(DVec3::new(20.0, 10.0, 5.0), 4000.0), [32, 16, 8]);
        assert_eq!(resolution(DVec3::new(40.0, 10.0, 0.0), 380.0), [39, 10, 1], "by area");
        assert_eq!(resolution(DVec3::new(40.0, 0.0, 0.0), 400.0), [400, 1, 1], "by length");
        assert_eq!(resolution(DVec3::ZERO, 400.0), [1, 1, 1]);
        assert_eq!(resolution(DVec3::new(40.0, 10.0, 1e-9), 380.0), [39, 10, 1], "a plate is flat");
        assert_eq!(resolution(DVec3::new(1e300, 1e300, 1e-300), 1e9), [512, 512, 1]);
        assert_eq!(resolution(DVec3::splat(1e-300), 60.0), [4, 4, 4]);
        assert_eq!(resolution(DVec3::splat(1.0), 1e12), [512; 3]);
    }
}
