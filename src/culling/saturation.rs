//! Masks too full to be worth asking (parameter `saturation` of the mask tests).
//!
//! The more bits a node's mask has, the less likely they are all averted; Serpa &
//! Rodrigues (2014) blame the diversity of normals for how little their masks skip. A
//! node whose mask has at least the given share of its bits is not asked. Nothing is lost
//! by that: a node that is not asked is kept. Masks below it may be emptier, so it goes on
//! as long as one of them is, and no farther.

use super::{Tally, Verdict};
use crate::hierarchy::{Hierarchy, NONE};
use crate::registry::{Default as Allowed, Param};

pub(super) const SATURATION: Param = Param {
    name: "saturation",
    default: Allowed::Later(&Allowed::Float { value: 0.0, min: 0.0, max: 1.0 }),
    about: "nodes whose mask has at least this share of its bits set are not asked (1: all bits); 0 asks every node",
};

/// Columns: a bit a node that is asked, and one where some node below is.
#[derive(Debug, Default)]
pub(super) struct Saturation {
    share: f64,
    asked: Vec<u8>,
    below: Vec<u8>,
}

impl Saturation {
    /// None if every node is to be asked.
    pub fn new(share: f64) -> Option<Saturation> {
        (share > 0.0).then(|| Saturation { share, ..Saturation::default() })
    }

    /// `share(block, lane)` is that of the bits set in a node's mask. Returns the bytes.
    pub fn prepare(&mut self, hierarchy: &Hierarchy, share: impl Fn(usize, usize) -> f64) -> usize {
        let blocks = hierarchy.links.len();
        let (mut asked, mut below) = (vec![0u8; blocks], vec![0u8; blocks]);
        super::descent::bottom_up(hierarchy, |block, lane| {
            asked[block] |= u8::from(share(block, lane) < self.share) << lane;
            let child = hierarchy.links[block].child[lane];
            if child != NONE {
                below[block] |= u8::from(asked[child as usize] | below[child as usize] != 0) << lane;
            }
        });
        (self.asked, self.below) = (asked, below);
        size_of_val(&self.asked[..]) + size_of_val(&self.below[..])
    }

    /// The lanes of `live` that are asked.
    pub fn asked(&self, block: u32, live: u8, tally: &mut Tally) -> u8 {
        let asked = live & self.asked[block as usize];
        tally.masks_ignored += u64::from((live & !asked).count_ones());
        asked
    }

    /// Keeps the lanes that were not asked: to go on, if they would, iff something below
    /// is. The carries of masks are 0 and 1.
    pub fn keep_others(&self, block: u32, asked: u8, verdict: &mut Verdict) {
        verdict.outside &= asked;
        let goes_on = asked | self.below[block as usize];
        // Without branches, which would follow no pattern.
        verdict.carry.iter_mut().enumerate().for_each(|(lane, carry)| *carry &= goes_on >> lane & 1);
    }
}
