//! What one arithmetic has to offer to be a frustum test: judging the boxes of a
//! block against the planes of a frame. [`super::frustum`] owns everything else
//! (masks, last planes, half-spaces), so that those are the same in all of them.

use super::frustum_octant::{Far, Halves};
use super::frustum_planes::{MAX_PLANES, PlaneMasks, Work};
use super::{Class, Tally};
use crate::hierarchy::{Hierarchy, LANES};
use crate::math::View;

/// What is asked of a block.
#[derive(Debug, Clone, Copy)]
pub struct Ask {
    pub block: u32,
    /// Bit per lane; the answer for others is not looked at.
    pub lanes: u8,
    /// Bit per plane; entries of other planes are left alone.
    pub planes: u8,
    /// Also, which planes the lanes are inside of.
    pub inside: bool,
    /// A lane that a plane rejected is not asked about later planes.
    pub until_rejected: bool,
}

/// Boxes against planes in one arithmetic.
///
/// `outside` says that the p-vertex lies outside, `inside` that the n-vertex does
/// not. Whatever the arithmetic, two things must hold, or accelerations would change
/// the answer (fact B4.1): a box with a NaN or infinite bound is neither, and a
/// box within one that is inside a plane is not outside it. The latter follows
/// where every step is monotone in the corner's coordinates, as IEEE rounding is.
pub trait PlaneTest: Send {
    const CLASS: Class;
    /// It is boxes that are compared with planes, not what stands for them.
    const BOXES: bool = true;

    /// Builds the columns that this arithmetic reads; returns their bytes.
    fn prepare(&mut self, hierarchy: &Hierarchy) -> usize {
        let _ = hierarchy;
        0
    }
    /// Forgets earlier frames, as [`super::Test::reset`].
    fn reset(&mut self) {}
    fn begin(&mut self, view: &View, hierarchy: &Hierarchy);
    /// How many planes the frame has.
    fn planes(&self) -> usize;
    fn block(&mut self, hierarchy: &Hierarchy, ask: &Ask, masks: &mut PlaneMasks, tally: &mut Tally);

    /// Sets in `outside[b]` the lanes of block `b` that some plane rejects and
    /// those not in `live[b]`; lanes already set are not judged.
    fn flat(&mut self, hierarchy: &Hierarchy, live: &[u8], outside: &mut [u8], tally: &mut Tally) -> Work
    where
        Self: Sized,
    {
        let mut work = Work::default();
        let planes = all(self.planes());
        let mut masks = PlaneMasks::default();
        for (block, (live, out)) in live.iter().zip(outside).enumerate() {
            let mut left = live & !*out;
            if left != 0 {
                let ask = Ask { block: block as u32, lanes: left, planes, inside: false, until_rejected: true };
                self.block(hierarchy, &ask, &mut masks, tally);
                work.lanes += u64::from(left.count_ones());
                for rejected in &masks.outside[..self.planes()] {
                    work.planes += u64::from(left.count_ones());
                    left &= !rejected;
                }
            }
            *out = !left;
        }
        work
    }

    /// The planes that `block` certainly does not have to be asked about (see
    /// [`super::frustum_octant`]), where that can be told.
    fn far_planes(&self, halves: &Halves, hierarchy: &Hierarchy, block: u32) -> Option<Far> {
        Some(halves.of_boxes(&hierarchy.bounds[block as usize]))
    }

    /// As [`super::Test::failure`].
    fn failure(&self) -> Option<String> {
        None
    }
}

/// Bit per plane.
pub fn all(planes: usize) -> u8 {
    debug_assert!(planes <= MAX_PLANES);
    ((1u16 << planes) - 1) as u8
}

/// Indices of the set bits, ascending.
#[inline]
pub fn bits(mask: u8) -> impl Iterator<Item = usize> {
    let mut mask = mask;
    std::iter::from_fn(move || {
        let k = (mask != 0).then_some(mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        k
    })
}

/// Answers an [`Ask`] sign by sign, each asked only where it is needed:
/// `outside(plane, lane)`, and `inside` of what is not outside.
#[inline]
pub fn one_by_one(
    ask: &Ask,
    masks: &mut PlaneMasks,
    mut outside: impl FnMut(usize, usize) -> bool,
    mut inside: impl FnMut(usize, usize) -> bool,
) {
    let mut alive = ask.lanes;
    for k in bits(ask.planes) {
        let (mut out, mut inn) = (0, 0);
        for lane in bits(alive) {
            debug_assert!(lane < LANES);
            if outside(k, lane) {
                out |= 1 << lane;
            } else if ask.inside && inside(k, lane) {
                inn |= 1 << lane;
            }
        }
        masks.outside[k] = out;
        if ask.inside {
            masks.inside[k] = inn;
        }
        if ask.until_rejected {
            alive &= !out;
        }
    }
}
