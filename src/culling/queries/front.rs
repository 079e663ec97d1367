//! Nodes waiting to be visited, nearest first, each with what the tests left to ask
//! below it.
//!
//! Distance is that of the box from the eye; for parallel rays, its least depth. Equal
//! distances go by the node's number, so that the order is the same everywhere.

use super::*;
use crate::hierarchy::{LANES, NONE};
use crate::math::{DVec3, Vec3};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A node that no test is outside of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Item {
    /// Distance, as bits that compare like it.
    key: u32,
    pub node: u32,
    /// Where the carries of its block are, or [`NONE`]: no test can say more.
    carries: u32,
}

impl Item {
    pub fn block(self) -> usize {
        self.node as usize / LANES
    }

    pub fn lane(self) -> usize {
        self.node as usize % LANES
    }

    /// Distance of the box from the eye; least depth for parallel rays.
    pub fn distance_m(self, perspective: bool) -> f32 {
        let bits = if self.key >> 31 == 1 { self.key & 0x7fff_ffff } else { !self.key };
        let value = f32::from_bits(bits);
        if perspective { value.sqrt() } else { value }
    }
}

/// Bits that compare as unsigned numbers like the (not NaN) value.
fn ordered(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 0x8000_0000 }
}

/// Where the near plane leaves a box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// Nothing of it is beyond the near plane.
    Behind,
    /// The near plane may cut it.
    Near,
    Beyond,
}

#[derive(Debug, Default)]
pub struct Front {
    heap: BinaryHeap<Reverse<Item>>,
    /// Of each judged block, a row of carries a test.
    carries: Vec<[u8; LANES]>,
    perspective: bool,
    eye: Vec3,
    forward: Vec3,
    /// The same in f64, for the near plane.
    eye_m: DVec3,
    forward_m: DVec3,
    near_m: f64,
}

impl Front {
    pub fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.heap.clear();
        self.carries.clear();
        self.perspective = view.is_perspective();
        (self.eye_m, self.forward_m) = (view.eye - hierarchy.origin, view.forward);
        (self.eye, self.forward) = (self.eye_m.as_vec3(), self.forward_m.as_vec3());
        self.near_m = view.camera.near_m;
    }

    pub fn is_empty(&self) -> bool {
        self.heap.is_empty()
    }

    pub fn pop(&mut self) -> Option<Item> {
        self.heap.pop().map(|Reverse(item)| item)
    }

    /// Judges the nodes of `block` below `from` and puts those in that no test is
    /// outside of; returns how many were judged.
    pub fn enter(
        &mut self,
        hierarchy: &Hierarchy,
        block: u32,
        from: Option<Item>,
        tests: &mut [Box<dyn Test>],
        tally: &mut Tally,
    ) -> u64 {
        let live = hierarchy.links[block as usize].live;
        tally.nodes_visited += u64::from(live.count_ones());
        let mut left = live;
        let row = self.carries.len();
        let mut any = [0u8; LANES];
        if from.is_none_or(|item| item.carries != NONE) {
            for (t, test) in tests.iter_mut().enumerate() {
                let carry = match from {
                    Some(item) => self.carries[item.carries as usize + t][item.lane()],
                    None => test.initial_carry(),
                };
                let mut verdict = Verdict { outside: 0, carry: [0; LANES] };
                if carry != 0 && left != 0 {
                    verdict = test.judge(hierarchy, block, left, carry, tally);
                    left &= !verdict.outside;
                }
                (0..LANES).for_each(|l| any[l] |= verdict.carry[l]);
                self.carries.push(verdict.carry);
            }
        }
        let bounds = &hierarchy.bounds[block as usize];
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let key = ordered(self.distance(&bounds.get(lane)));
            let carries = if any[lane] == 0 { NONE } else { row as u32 };
            self.heap.push(Reverse(Item { key, node: block * LANES as u32 + lane as u32, carries }));
        }
        u64::from(live.count_ones())
    }

    fn distance(&self, b: &Box32) -> f32 {
        if self.perspective {
            let out = (b.lo - self.eye).max(self.eye - b.hi).max(Vec3::ZERO);
            return out.length_squared();
        }
        let (a, c) = ((b.lo - self.eye) * self.forward, (b.hi - self.eye) * self.forward);
        let least = a.min(c);
        least.x + least.y + least.z
    }

    pub fn depth(&self, b: &Box32) -> Depth {
        let a = (b.lo.as_dvec3() - self.eye_m) * self.forward_m;
        let c = (b.hi.as_dvec3() - self.eye_m) * self.forward_m;
        let (least, most) = (a.min(c), a.max(c));
        // More than sums of three products round by.
        let hair = 1e-14 * (least.abs().max(most.abs()).element_sum() + self.near_m);
        if most.element_sum() < self.near_m - hair {
            Depth::Behind
        } else if least.element_sum() > self.near_m + hair {
            Depth::Beyond
        } else {
            Depth::Near
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_compare_like_numbers_and_give_them_back() {
        let values = [f32::NEG_INFINITY, -3.5e9, -1.0, -1e-40, 0.0, 1e-40, 2.0, 7e20, f32::INFINITY];
        assert!(values.windows(2).all(|w| ordered(w[0]) < ordered(w[1])));
        for v in values {
            let item = Item { key: ordered(v), node: 0, carries: NONE };
            assert_eq!(item.distance_m(false), v);
            assert!(v < 0.0 || item.distance_m(true) == v.sqrt());
        }
    }
}
