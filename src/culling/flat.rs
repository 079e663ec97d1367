//! `flat`: no hierarchy. Every leaf (and every node with entries of its own) is
//! judged by itself, as if the structure were a list of its leaves. A structure
//! that is a list is judged by the tests' wide kernels. Frames that need no judging at
//! all are `skipping`'s.

use super::descent::Descent;
use super::skipping::{STILL, Skipping, WHOLE_BELOW};
use super::*;
use crate::hierarchy::{LinkBlock, NONE};

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "flat",
    about: "every leaf by itself, without the hierarchy above it",
    revision: 1,
    params: &[STILL, WHOLE_BELOW],
    make: |spec| Box::new(Flat { skipping: Skipping::new(spec), ..Flat::default() }),
};

#[derive(Default)]
pub struct Flat {
    descent: Descent,
    outside: Vec<u8>,
    skipping: Skipping,
}

impl Walk for Flat {
    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn skipping(&mut self) -> Option<&mut Skipping> {
        Some(&mut self.skipping)
    }

    fn remembers(&self) -> bool {
        false
    }

    fn run(
        &mut self,
        _view: &View,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        if tests.iter().all(|t| t.initial_carry() == 0) {
            out.push(0, hierarchy.entries.len() as u32);
        } else if hierarchy.links.len() == hierarchy.root_blocks as usize {
            self.list(hierarchy, tests, out, tally);
        } else {
            self.leaves(hierarchy, tests, out, tally);
        }
    }
}

impl Flat {
    /// All blocks are roots: one call a test for all of them.
    fn list(&mut self, hierarchy: &Hierarchy, tests: &mut [Box<dyn Test>], out: &mut DrawList, tally: &mut Tally) {
        self.outside.clear();
        self.outside.resize(hierarchy.root_blocks as usize, 0);
        let before = tally.lane_tests;
        for (i, test) in tests.iter_mut().filter(|t| t.initial_carry() != 0).enumerate() {
            test.judge_flat(hierarchy, &mut self.outside, tally);
            if i == 0 {
                // The first test is asked about every lane once.
                tally.nodes_visited += tally.lane_tests - before;
            }
        }
        // Eight blocks a step: most are wholly outside.
        for (i, blocks) in self.outside.chunks(8).enumerate() {
            if blocks.iter().all(|b| *b == 0xff) {
                continue;
            }
            for (j, outside) in blocks.iter().enumerate().filter(|(_, o)| **o != 0xff) {
                submit_lanes(&hierarchy.links[i * 8 + j], !outside, out);
            }
        }
    }

    fn leaves(&mut self, hierarchy: &Hierarchy, tests: &mut [Box<dyn Test>], out: &mut DrawList, tally: &mut Tally) {
        for root in 0..hierarchy.root_blocks {
            self.descent.clear();
            self.enter(hierarchy, root, tests, tally);
            while let Some(at) = self.descent.next(tests.len()) {
                let links = &hierarchy.links[at.block as usize];
                let child = links.child[at.lane];
                if self.descent.is_kept(at) {
                    out.push(links.first[at.lane], links.own_end[at.lane]);
                }
                if child != NONE {
                    self.enter(hierarchy, child, tests, tally);
                }
            }
        }
    }

    fn enter(&mut self, hierarchy: &Hierarchy, block: u32, tests: &mut [Box<dyn Test>], tally: &mut Tally) {
        let links = &hierarchy.links[block as usize];
        let lanes = |wanted: &dyn Fn(usize) -> bool| {
            (0..8).filter(|l| links.live >> l & 1 == 1 && wanted(*l)).fold(0u8, |m, l| m | 1 << l)
        };
        let with_entries = lanes(&|l| links.own_end[l] > links.first[l]);
        let internal = lanes(&|l| links.child[l] != NONE);
        self.descent.enter(hierarchy, block, with_entries, internal, tests, None, tally);
    }
}

/// Submits the set lanes of a block of leaves; neighbours are one range, as lanes
/// tile the entries.
fn submit_lanes(links: &LinkBlock, kept: u8, out: &mut DrawList) {
    let mut kept = u32::from(kept & links.live);
    while kept != 0 {
        let first = kept.trailing_zeros() as usize;
        let last = first + (kept >> first).trailing_ones() as usize - 1;
        out.push(links.first[first], links.end[last]);
        kept &= !0 << last << 1;
    }
}
