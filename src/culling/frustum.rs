//! `frustum`: view-frustum culling of boxes, in the arithmetic that is asked for.
//!
//! The p-/n-vertex test of Greene (1994) and Haines & Wallace (1991): of the eight
//! corners of a box, the one farthest along a plane's normal decides "outside",
//! the nearest decides "inside". Two accelerations of Assarsson & Möller (2000)
//! are switches, and neither changes the answer: `plane_mask` (a plane that the
//! parent is inside of is not tested again) and `last_plane` (start with the plane
//! that rejected the node last). Silva (2009) tests a BSP's partition plane
//! against the corners of the frustum instead: `node_test`; half-spaces are judged
//! in guarded f64 whatever the arithmetic.
//!
//! What we changed: 8 siblings at once (16 in a list), and a proved guard in place
//! of an epsilon (`frustum_planes`), so the class is conservative for the scene in
//! f64 at any distance from the origin. Boxes with NaN or infinite bounds are kept.
//! The arithmetic is a choice between six [`PlaneTest`]s; of `f32_world` alone the
//! class is aggressive.

use super::frustum_arithmetic::{Ask, PlaneTest, all, bits};
use super::frustum_exact::Exact;
use super::frustum_f64::Double;
use super::frustum_filtered::Filtered;
use super::frustum_fixed::Fixed;
use super::frustum_planes::PlaneMasks;
use super::frustum_relative::Relative;
pub use super::frustum_relative::{Kernels, kernels};
use super::frustum_volume::Volume;
use super::frustum_world::World;
use super::*;
use crate::hierarchy::{HalfSpace, LANES, NONE};
use crate::registry::{Default as Allowed, Param};

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "frustum",
    about: "boxes against the view frustum; by default f32 relative to the camera with a proved error bound",
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
        let options = Options {
            node_test: NodeTest::named(spec.text("node_test")),
            plane_mask: spec.bool("plane_mask"),
            last_plane: spec.bool("last_plane"),
        };
        match arithmetic_of(spec) {
            Arithmetic::F32Relative => Box::new(Frustum::new(options, Relative::new(kernels()[0]))),
            Arithmetic::F32World => Box::new(Frustum::new(options, World::default())),
            Arithmetic::F64 => Box::new(Frustum::new(options, Double::default())),
            Arithmetic::Filtered => Box::new(Frustum::new(options, Filtered::default())),
            Arithmetic::Exact => Box::new(Frustum::new(options, Exact::default())),
            Arithmetic::FixedQ16 => Box::new(Frustum::new(options, Fixed::default())),
        }
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

/// The switches of the test.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    pub node_test: NodeTest,
    pub plane_mask: bool,
    pub last_plane: bool,
}

/// Carry while only half-spaces are tested: they never prove "wholly inside".
const HALF_SPACE: u8 = 0x80;

/// The test. Columns: the live lanes of root blocks, and with `last_plane` one
/// byte a plane and block, whose bits are the lanes that the plane rejected last.
pub struct Frustum<P> {
    options: Options,
    boxes: P,
    volume: Volume,
    /// This frame tests half-spaces, boxes.
    with_planes: bool,
    with_boxes: bool,
    live: Vec<u8>,
    last: Vec<[u8; 6]>,
}

impl<P: PlaneTest> Frustum<P> {
    pub fn new(options: Options, boxes: P) -> Frustum<P> {
        Frustum {
            options,
            boxes,
            volume: Volume::default(),
            with_planes: false,
            with_boxes: true,
            live: Vec::new(),
            last: Vec::new(),
        }
    }

    /// Lanes that no plane rejects, in index order.
    fn in_order(&mut self, hierarchy: &Hierarchy, ask: Ask, masks: &mut PlaneMasks, tally: &mut Tally) -> u8 {
        self.boxes.block(hierarchy, &ask, masks, tally);
        let mut alive = ask.lanes;
        for k in bits(ask.planes) {
            tally.plane_tests += u64::from(alive.count_ones());
            alive &= !masks.outside[k];
        }
        alive
    }

    /// The same, each lane starting with the plane that rejected it last.
    fn last_first(&mut self, hierarchy: &Hierarchy, ask: Ask, masks: &mut PlaneMasks, tally: &mut Tally) -> u8 {
        let last = &mut self.last[ask.block as usize];
        let mut alive = ask.lanes;
        let first = bits(ask.planes).filter(|k| last[*k] & alive != 0).fold(0, |m, k| m | 1 << k);
        if first != 0 {
            // A lane's own last plane need not be the first of these.
            let ask = Ask { planes: first, until_rejected: false, ..ask };
            self.boxes.block(hierarchy, &ask, masks, tally);
            for k in bits(first) {
                tally.plane_tests += u64::from((alive & last[k]).count_ones());
                alive &= !(masks.outside[k] & last[k]);
            }
            if alive == 0 {
                return 0;
            }
        }
        self.boxes.block(hierarchy, &Ask { planes: ask.planes & !first, lanes: alive, ..ask }, masks, tally);
        for k in bits(ask.planes) {
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

impl<P: PlaneTest> Test for Frustum<P> {
    fn class(&self) -> Class {
        P::CLASS
    }

    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, ..Default::default() }
    }

    fn prepare(&mut self, _scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.live = hierarchy.links[..hierarchy.root_blocks as usize].iter().map(|l| l.live).collect();
        self.last = if self.options.last_plane { vec![[0; 6]; hierarchy.links.len()] } else { Vec::new() };
        self.boxes.prepare(hierarchy) + size_of_val(&self.live[..]) + size_of_val(&self.last[..])
    }

    fn reset(&mut self) {
        self.last.fill([0; 6]);
        self.boxes.reset();
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.boxes.begin(view, hierarchy);
        self.with_planes = self.options.node_test != NodeTest::Box && hierarchy.half_spaces.is_some();
        self.with_boxes = self.options.node_test != NodeTest::Plane || !self.with_planes;
        if self.with_planes {
            self.volume = Volume::new(view, hierarchy.origin);
        }
    }

    fn initial_carry(&self) -> u8 {
        if self.with_boxes { all(self.boxes.planes()) } else { HALF_SPACE }
    }

    fn judge(&mut self, hierarchy: &Hierarchy, block: u32, live: u8, carry: u8, tally: &mut Tally) -> Verdict {
        tally.lane_tests += u64::from(live.count_ones());
        let mut alive = live;
        let mut carries = [HALF_SPACE; LANES];
        if self.with_boxes {
            let mut masks = PlaneMasks::default();
            // Nobody inherits what a block of leaves is inside of.
            let inside = hierarchy.links[block as usize].child.iter().any(|c| *c != NONE);
            let ask = Ask { block, lanes: live, planes: carry, inside, until_rejected: true };
            alive = if self.options.last_plane {
                self.last_first(hierarchy, ask, &mut masks, tally)
            } else {
                self.in_order(hierarchy, ask, &mut masks, tally)
            };
            carries = planes_left(&masks, carry, self.options.plane_mask);
        }
        if let (true, Some(column)) = (self.with_planes, &hierarchy.half_spaces) {
            alive = self.half_spaces(column, block, alive, tally);
        }
        Verdict { outside: live & !alive, carry: carries }
    }

    fn judge_flat(&mut self, hierarchy: &Hierarchy, outside: &mut [u8], tally: &mut Tally) {
        if self.options.last_plane || self.with_planes {
            return super::judge_flat_by_block(self, hierarchy, outside, tally);
        }
        let work = self.boxes.flat(hierarchy, &self.live, outside, tally);
        tally.lane_tests += work.lanes;
        tally.plane_tests += work.planes;
    }

    fn failure(&self) -> Option<String> {
        self.boxes.failure()
    }
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
