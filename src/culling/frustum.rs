//! `frustum`: view-frustum culling of boxes, camera-relative and error-bounded.
//!
//! The p-/n-vertex test of Greene (1994) and Haines & Wallace (1991): of the eight
//! corners of a box, the one farthest along a plane's normal decides "outside",
//! the nearest decides "inside". Two accelerations of Assarsson & Möller (2000)
//! are switches, and neither changes the answer: `plane_mask` (a plane that the
//! parent is inside of is not tested again) and `last_plane` (start with the plane
//! that rejected the node last). Silva (2009) tests a BSP's partition plane
//! against the corners of the frustum instead: `node_test`.
//!
//! What we changed: 8 siblings at once (16 in a list), and a proved guard in place
//! of an epsilon (`frustum_planes`), so the class is conservative for the scene in
//! f64 at any distance from the origin. Boxes with NaN or infinite bounds are kept.

use super::frustum_planes::{FramePlanes, PlaneMasks, Work};
use super::frustum_volume::Volume;
use super::*;
use crate::hierarchy::{BoundsBlock, HalfSpace, LANES, NONE};
use crate::registry::{Default as Allowed, Param};

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "frustum",
    about: "boxes against the view frustum, f32 relative to the camera with a proved error bound",
    revision: 1,
    params: &[
        ARITHMETIC,
        Param {
            name: "last_plane",
            default: Allowed::Bool(false),
            about: "test first the plane that rejected the node last (same answer, fewer plane tests)",
        },
        Param {
            name: "node_test",
            default: Allowed::Choice(&["box", "plane", "box_plane"]),
            about: "what stands for a node: its box, its BSP partition plane where it has one, or both",
        },
        Param {
            name: "plane_mask",
            default: Allowed::Bool(true),
            about: "planes that a node is inside of are not tested for its children (same answer)",
        },
    ],
    make: |spec| {
        Box::new(Frustum::new(
            NodeTest::named(spec.text("node_test")),
            spec.bool("plane_mask"),
            spec.bool("last_plane"),
            kernels()[0],
        ))
    },
};

/// What stands for a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NodeTest {
    Box,
    /// The half-space column; the box where the structure has no such column.
    Plane,
    BoxPlane,
}

impl NodeTest {
    fn named(name: &str) -> NodeTest {
        match name {
            "box" => NodeTest::Box,
            "plane" => NodeTest::Plane,
            _ => NodeTest::BoxPlane,
        }
    }
}

type BlockKernel = fn(&FramePlanes, &BoundsBlock, u8, bool, &mut PlaneMasks);
type FlatKernel = fn(&FramePlanes, &[BoundsBlock], &[u8], &mut [u8]) -> Work;

/// One instruction set's pair of kernels; all give the same bits.
#[derive(Debug, Clone, Copy)]
pub struct Kernels {
    pub name: &'static str,
    pub block: BlockKernel,
    pub flat: FlatKernel,
}

/// What this processor can run, the widest first, the scalar twin last.
pub fn kernels() -> Vec<Kernels> {
    use super::frustum_scalar as scalar;
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        use super::frustum_x86 as x86;
        if x86::has_avx512() {
            found.push(Kernels { name: "avx512", block: x86::block_avx2, flat: x86::flat_avx512 });
        }
        if x86::has_avx2() {
            found.push(Kernels { name: "avx2", block: x86::block_avx2, flat: x86::flat_avx2 });
        }
    }
    found.push(Kernels { name: "scalar", block: scalar::block, flat: scalar::flat });
    found
}

/// Carry while only half-spaces are tested: they never prove "wholly inside".
const HALF_SPACE: u8 = 0x80;

/// The test. Columns: the live lanes of root blocks, and with `last_plane` one
/// byte a plane and block, whose bits are the lanes that the plane rejected last.
pub struct Frustum {
    node_test: NodeTest,
    plane_mask: bool,
    last_plane: bool,
    kernels: Kernels,
    frame: FramePlanes,
    volume: Volume,
    /// This frame tests half-spaces, boxes.
    with_planes: bool,
    with_boxes: bool,
    live: Vec<u8>,
    last: Vec<[u8; 6]>,
}

impl Frustum {
    pub fn new(node_test: NodeTest, plane_mask: bool, last_plane: bool, kernels: Kernels) -> Frustum {
        Frustum {
            node_test,
            plane_mask,
            last_plane,
            kernels,
            frame: FramePlanes::default(),
            volume: Volume::default(),
            with_planes: false,
            with_boxes: true,
            live: Vec::new(),
            last: Vec::new(),
        }
    }

    /// Lanes of `alive` that no plane of `wanted` rejects, in index order.
    fn in_order(
        &self,
        bounds: &BoundsBlock,
        wanted: u8,
        alive: u8,
        want_inside: bool,
        masks: &mut PlaneMasks,
        tally: &mut Tally,
    ) -> u8 {
        (self.kernels.block)(&self.frame, bounds, wanted, want_inside, masks);
        let mut alive = alive;
        for k in bits(wanted) {
            tally.plane_tests += u64::from(alive.count_ones());
            alive &= !masks.outside[k];
        }
        alive
    }

    /// The same, each lane starting with the plane that rejected it last.
    fn last_first(
        &mut self,
        bounds: &BoundsBlock,
        block: usize,
        wanted: u8,
        alive: u8,
        want_inside: bool,
        masks: &mut PlaneMasks,
        tally: &mut Tally,
    ) -> u8 {
        let last = &mut self.last[block];
        let first = bits(wanted).filter(|k| last[*k] & alive != 0).fold(0, |m, k| m | 1 << k);
        let mut alive = alive;
        if first != 0 {
            (self.kernels.block)(&self.frame, bounds, first, want_inside, masks);
            for k in bits(first) {
                tally.plane_tests += u64::from((alive & last[k]).count_ones());
                alive &= !(masks.outside[k] & last[k]);
            }
            if alive == 0 {
                return 0;
            }
        }
        (self.kernels.block)(&self.frame, bounds, wanted & !first, want_inside, masks);
        for k in bits(wanted) {
            let tested = alive & !last[k];
            tally.plane_tests += u64::from(tested.count_ones());
            let rejected = tested & masks.outside[k];
            if rejected != 0 {
                alive &= !rejected;
                last.iter_mut().for_each(|l| *l &= !rejected);
                last[k] |= rejected;
            }
        }
        alive
    }

    fn half_spaces(&self, column: &[Option<HalfSpace>], block: u32, alive: u8, tally: &mut Tally) -> u8 {
        let mut left = alive;
        for lane in bits(alive) {
            if let Some(space) = &column[block as usize * LANES + lane] {
                tally.plane_tests += 1;
                if self.volume.misses(space) {
                    left &= !(1 << lane);
                }
            }
        }
        left
    }
}

impl Test for Frustum {
    fn class(&self) -> Class {
        Class::Conservative
    }

    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, ..Default::default() }
    }

    fn prepare(&mut self, _scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.live = hierarchy.links[..hierarchy.root_blocks as usize].iter().map(|l| l.live).collect();
        self.last = if self.last_plane { vec![[0; 6]; hierarchy.links.len()] } else { Vec::new() };
        size_of_val(&self.live[..]) + size_of_val(&self.last[..])
    }

    fn reset(&mut self) {
        self.last.fill([0; 6]);
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.frame = FramePlanes::new(view, hierarchy.origin);
        self.with_planes = self.node_test != NodeTest::Box && hierarchy.half_spaces.is_some();
        self.with_boxes = self.node_test != NodeTest::Plane || !self.with_planes;
        if self.with_planes {
            self.volume = Volume::new(view, hierarchy.origin);
        }
    }

    fn initial_carry(&self) -> u8 {
        if self.with_boxes { self.frame.all() } else { HALF_SPACE }
    }

    fn judge(&mut self, hierarchy: &Hierarchy, block: u32, live: u8, carry: u8, tally: &mut Tally) -> Verdict {
        tally.lane_tests += u64::from(live.count_ones());
        let mut alive = live;
        let mut carries = [HALF_SPACE; LANES];
        if self.with_boxes {
            let mut masks = PlaneMasks::default();
            let bounds = &hierarchy.bounds[block as usize];
            // Nobody inherits what a block of leaves is inside of.
            let want_inside = hierarchy.links[block as usize].child.iter().any(|c| *c != NONE);
            alive = if self.last_plane {
                self.last_first(bounds, block as usize, carry, alive, want_inside, &mut masks, tally)
            } else {
                self.in_order(bounds, carry, alive, want_inside, &mut masks, tally)
            };
            carries = planes_left(&masks, carry, self.plane_mask);
        }
        if let (true, Some(column)) = (self.with_planes, &hierarchy.half_spaces) {
            alive = self.half_spaces(column, block, alive, tally);
        }
        Verdict { outside: live & !alive, carry: carries }
    }

    fn judge_flat(&mut self, hierarchy: &Hierarchy, outside: &mut [u8], tally: &mut Tally) {
        if self.last_plane || self.with_planes {
            return super::judge_flat_by_block(self, hierarchy, outside, tally);
        }
        let bounds = &hierarchy.bounds[..outside.len()];
        let work = (self.kernels.flat)(&self.frame, bounds, &self.live, outside);
        tally.lane_tests += work.lanes;
        tally.plane_tests += work.planes;
    }
}

/// Indices of the set bits, ascending.
fn bits(mask: u8) -> impl Iterator<Item = usize> {
    let mut mask = mask;
    std::iter::from_fn(move || {
        let k = (mask != 0).then_some(mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        k
    })
}

/// Carry of each lane: the wanted planes that it is not inside of. Without
/// `per_plane`, all of them unless it is inside of all.
fn planes_left(masks: &PlaneMasks, wanted: u8, per_plane: bool) -> [u8; LANES] {
    // Byte k holds the lanes inside plane k; transposed, byte l holds the planes of lane l.
    let rows = masks.inside.iter().rev().fold(0, |rows, m| rows << 8 | u64::from(*m));
    let left = !transpose(rows) & (u64::from(wanted) * 0x0101_0101_0101_0101);
    let mut carry = left.to_le_bytes();
    if !per_plane {
        carry.iter_mut().filter(|c| **c != 0).for_each(|c| *c = wanted);
    }
    carry
}

/// Transposes an 8 x 8 bit matrix, byte = row (Warren, Hacker's Delight, 7-3).
fn transpose(x: u64) -> u64 {
    let swap = |x: u64, shift: u32, mask: u64| {
        let t = (x ^ (x >> shift)) & mask;
        x ^ t ^ (t << shift)
    };
    let x = swap(x, 7, 0x00aa_00aa_00aa_00aa);
    let x = swap(x, 14, 0x0000_cccc_0000_cccc);
    swap(x, 28, 0x0000_0000_f0f0_f0f0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposing_moves_every_bit_to_its_mirror_place() {
        for row in 0..8 {
            for column in 0..8 {
                assert_eq!(transpose(1 << (row * 8 + column)), 1 << (column * 8 + row));
            }
        }
    }

    #[test]
    fn a_lane_carries_the_planes_that_it_is_not_inside_of() {
        let mut masks = PlaneMasks::default();
        masks.inside[0] = 0b0000_0011;
        masks.inside[4] = 0b0000_0001;
        assert_eq!(planes_left(&masks, 0b10001, true), [0, 0b10000, 0b10001, 17, 17, 17, 17, 17]);
        assert_eq!(planes_left(&masks, 0b10001, false), [0, 17, 17, 17, 17, 17, 17, 17]);
        assert_eq!(bits(0b1010_0001).collect::<Vec<_>>(), [0, 5, 7]);
    }
}
