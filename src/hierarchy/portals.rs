//! Optional column of a hierarchy: its leaves as cells of a rectilinear grid, and
//! through which part of every face between two of them one can look.
//!
//! The cells are closed and fill the root box, 2^`bits` to an axis; those without
//! triangles have no node and are looked through all the same. What is open may
//! differ by direction, because a one-sided triangle hides from one side alone.

use super::{Hierarchy, LANES, NONE};
use crate::math::{Aabb, DVec3};

/// Texels of a face in which it is open: low corner, then the corner beyond the high
/// one. All of them are 0 where it is closed.
pub type Opening = [u8; 4];

pub const CLOSED: Opening = [0; 4];

/// The two axes of a face across `axis`, in the order of an [`Opening`].
pub const fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

/// Line `k` of `texels` + 1 lines that divide `lo..=hi`; the outer two are exact.
#[inline]
pub fn texel_line(lo: f64, hi: f64, k: u32, texels: u32) -> f64 {
    if k >= texels { hi } else { (lo + (hi - lo) * (f64::from(k) / f64::from(texels))).min(hi) }
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Portals {
    /// 2^`bits` cells to an axis.
    pub bits: u32,
    /// Texels to a side of a face.
    pub texels: u32,
    /// World metres, ascending: cell `i` of an axis lies between planes `i` and `i + 1`.
    pub planes: [Vec<f64>; 3],
    /// By cell: its node (`block * 8 + lane`), or [`NONE`] where it is empty.
    pub node: Vec<u32>,
    /// By axis and cell: the face to its upper neighbour, seen upwards and downwards.
    /// Cells without one hold [`CLOSED`].
    pub openings: [Vec<[Opening; 2]>; 3],
}

/// The closed intervals between `lines` that meet `lo..=hi`.
pub fn touching(lines: &[f64], lo: f64, hi: f64) -> std::ops::Range<usize> {
    let first = lines[1..].partition_point(|p| *p < lo);
    first..lines[..lines.len() - 1].partition_point(|p| *p <= hi).max(first)
}

impl Portals {
    /// Cells to an axis.
    pub fn side(&self) -> usize {
        1 << self.bits
    }

    /// Number of the cell at `at`.
    #[inline]
    pub fn cell(&self, at: [usize; 3]) -> usize {
        at[0] | at[1] << self.bits | at[2] << (2 * self.bits)
    }

    /// Where cell `number` is.
    #[inline]
    pub fn at(&self, number: usize) -> [usize; 3] {
        let mask = self.side() - 1;
        [number & mask, number >> self.bits & mask, number >> (2 * self.bits)]
    }

    pub fn bounds(&self, at: [usize; 3]) -> Aabb {
        let plane = |up: usize| DVec3::from([0, 1, 2].map(|axis| self.planes[axis][at[axis] + up]));
        Aabb { lo: plane(0), hi: plane(1) }
    }

    /// The box that all cells fill.
    pub fn root(&self) -> Aabb {
        let end = |of: fn(&Vec<f64>) -> f64| DVec3::from([0, 1, 2].map(|axis| of(&self.planes[axis])));
        Aabb { lo: end(|p| p[0]), hi: end(|p| p[p.len() - 1]) }
    }

    /// The closed cells of `axis` that meet `lo..=hi`; none if all lie beside it.
    pub fn touching(&self, axis: usize, lo: f64, hi: f64) -> std::ops::Range<usize> {
        touching(&self.planes[axis], lo, hi)
    }

    /// An opening of the face above cell `at`, or any rectangle of its texels, as low
    /// and high corner on the two axes [`across`] the face, world metres.
    #[inline]
    pub fn rectangle(&self, axis: usize, at: [usize; 3], texels: Opening) -> [[f64; 2]; 2] {
        let line = |side: usize, k: u8| {
            let along = across(axis)[side];
            let planes = &self.planes[along];
            texel_line(planes[at[along]], planes[at[along] + 1], u32::from(k), self.texels)
        };
        [[line(0, texels[0]), line(1, texels[1])], [line(0, texels[2]), line(1, texels[3])]]
    }

    pub fn bytes(&self) -> usize {
        let planes: usize = self.planes.iter().map(|p| size_of_val(&p[..])).sum();
        planes + size_of_val(&self.node[..]) + self.openings.iter().map(|o| size_of_val(&o[..])).sum::<usize>()
    }

    /// # Panics
    /// With a sentence, if the column does not fit `hierarchy`.
    pub(super) fn assert_fits(&self, hierarchy: &Hierarchy) {
        let (side, cells) = (self.side(), 1usize << (3 * self.bits));
        assert_eq!(self.node.len(), cells, "one node or none a cell");
        assert!((1..=255).contains(&self.texels), "a byte numbers the lines of a face");
        for axis in 0..3 {
            assert_eq!(self.planes[axis].len(), side + 1, "planes end every layer of cells");
            assert!(self.planes[axis].is_sorted() && self.planes[axis].iter().all(|p| p.is_finite()), "planes ascend");
            assert_eq!(self.openings[axis].len(), cells, "two openings an upper face");
            for (number, opening) in self.openings[axis].iter().enumerate() {
                let outer = self.at(number)[axis] + 1 == side;
                for [u0, v0, u1, v1] in *opening {
                    let open = u0 < u1 && v0 < v1 && u32::from(u1.max(v1)) <= self.texels;
                    assert!([u0, v0, u1, v1] == CLOSED || open && !outer, "an opening is part of a face");
                }
            }
        }
        let mut held = 0;
        for (number, node) in self.node.iter().enumerate().filter(|(_, n)| **n != NONE) {
            let (block, lane) = (*node as usize / LANES, *node as usize % LANES);
            let links = &hierarchy.links[block];
            assert!(links.live >> lane & 1 == 1 && links.child[lane] == NONE, "a cell's node is a leaf");
            let cell = self.bounds(self.at(number)).relative_to(hierarchy.origin);
            assert!(cell.contains_box(&hierarchy.bounds[block].get(lane)), "a leaf's box lies in its cell");
            held += u64::from(links.end[lane] - links.first[lane]);
        }
        // With `held` equal and boxes inside, no leaf is without a cell.
        assert_eq!(held, hierarchy.entries.len() as u64, "every entry lies in a leaf that has a cell");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texel_lines_ascend_from_end_to_end() {
        for (lo, hi) in [(0.0, 1.0), (-3.3, 7.1), (1e7, 1e7 + 1e-8), (5.0, 5.0)] {
            let lines: Vec<f64> = (0..=32).map(|k| texel_line(lo, hi, k, 32)).collect();
            assert!(lines.is_sorted() && lines[0] == lo && lines[32] == hi, "{lines:?}");
        }
    }

    #[test]
    fn closed_cells_on_both_sides_of_a_plane_touch_it() {
        let planes = vec![0.0, 1.0, 2.5, 3.0, 4.0];
        let p = Portals { bits: 2, planes: [planes.clone(), planes.clone(), planes], ..Portals::default() };
        assert_eq!(p.touching(0, 1.0, 1.0), 0..2);
        assert_eq!(p.touching(0, 1.1, 2.4), 1..2);
        assert_eq!(p.touching(1, -5.0, 0.0), 0..1);
        assert_eq!(p.touching(1, 4.0, 9.0), 3..4);
        assert_eq!(p.touching(2, -5.0, 9.0), 0..4);
        assert!(p.touching(2, -5.0, -4.0).is_empty() && p.touching(2, 4.5, 5.0).is_empty());
        for number in 0..64 {
            assert_eq!(p.cell(p.at(number)), number);
        }
    }
}
