//! `depth_first`: the hierarchical walk. A node that every test is outside of is
//! skipped with all below it (Clark 1976); a node that no test can say more about
//! is submitted as one range; anything else is entered.
//!
//! Nodes are visited in ascending order of their entries, so that neighbours in
//! the draw list merge as far as they can.
//!
//! Three switches spare work where judging costs more than drawing (measured in
//! docs/PERFORMANCE.md): `small` submits small subtrees whole, which may only add
//! triangles; `whole_below` and `still` are in `skipping`.

use super::descent::Descent;
use super::skipping::{STILL, Skipping, WHOLE_BELOW};
use super::*;
use crate::hierarchy::NONE;

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "depth_first",
    about: "down the hierarchy: skip what is outside, submit whole what is inside",
    revision: 1,
    params: &[
        Param {
            name: "small",
            default: Allowed::Later(&Allowed::Int { value: 0, min: 0, max: u32::MAX as i64 }),
            about: "subtrees of at most so many entries are submitted whole rather than entered; 0 enters all",
        },
        STILL,
        WHOLE_BELOW,
    ],
    make: |spec| {
        let small = spec.int("small") as u32;
        Box::new(DepthFirst { small, skipping: Skipping::new(spec), ..DepthFirst::default() })
    },
};

#[derive(Default)]
pub struct DepthFirst {
    descent: Descent,
    small: u32,
    skipping: Skipping,
}

impl Walk for DepthFirst {
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
        // Nothing to ask this frame: everything is one range.
        if tests.iter().all(|t| t.initial_carry() == 0) {
            out.push(0, hierarchy.entries.len() as u32);
            return;
        }
        let count = tests.len();
        for root in 0..hierarchy.root_blocks {
            let live = hierarchy.links[root as usize].live;
            self.descent.clear();
            self.descent.enter(hierarchy, root, live, 0, tests, None, tally);
            while let Some(at) = self.descent.next(count) {
                let links = &hierarchy.links[at.block as usize];
                let (first, own_end, end) = (links.first[at.lane], links.own_end[at.lane], links.end[at.lane]);
                let child = links.child[at.lane];
                if child == NONE || self.descent.is_settled(at, count) {
                    out.push(first, end);
                    continue;
                }
                if end - first <= self.small {
                    tally.subtrees_not_entered += 1;
                    out.push(first, end);
                    continue;
                }
                out.push(first, own_end);
                let live = hierarchy.links[child as usize].live;
                self.descent.enter(hierarchy, child, live, 0, tests, Some(at), tally);
                self.descent.expect_children(hierarchy);
            }
        }
    }
}
