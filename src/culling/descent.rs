//! What the walks share: going down a hierarchy in ascending order of positions
//! with the carries of all tests, without recursion and without allocating anew.

use super::{Tally, Test, Verdict};
use crate::hierarchy::{Hierarchy, LANES, NONE};

/// A block on the way down: the lanes still to be visited, each once, ascending.
struct Frame {
    block: u32,
    rest: u8,
    /// Lanes that were judged and are not outside.
    kept: u8,
}

/// A lane of a judged block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Visit {
    pub block: u32,
    pub lane: usize,
}

/// Stack of judged blocks. Carries of depth `d`, test `t`, lane `l` are at
/// `(d * tests + t) * 8 + l`.
#[derive(Default)]
pub(super) struct Descent {
    frames: Vec<Frame>,
    carries: Vec<[u8; LANES]>,
}

impl Descent {
    pub fn clear(&mut self) {
        self.frames.clear();
        self.carries.clear();
    }

    /// Judges `lanes` of `block` with every test whose carry is not 0, and puts
    /// what is not outside, together with `also`, on the stack.
    /// `carry(t)` is what test `t` inherits.
    pub fn enter(
        &mut self,
        hierarchy: &Hierarchy,
        block: u32,
        lanes: u8,
        also: u8,
        tests: &mut [Box<dyn Test>],
        from: Option<Visit>,
        tally: &mut Tally,
    ) {
        let inherited = self.carries.len().wrapping_sub(tests.len());
        let mut left = lanes;
        tally.nodes_visited += u64::from(lanes.count_ones());
        for (t, test) in tests.iter_mut().enumerate() {
            let carry = match from {
                Some(at) => self.carries[inherited + t][at.lane],
                None => test.initial_carry(),
            };
            let mut verdict = Verdict { outside: 0, carry: [0; LANES] };
            if carry != 0 && left != 0 {
                verdict = test.judge(hierarchy, block, left, carry, tally);
                left &= !verdict.outside;
            }
            self.carries.push(verdict.carry);
        }
        self.frames.push(Frame { block, rest: left | also, kept: left });
    }

    /// Asks for the blocks below the lanes on top of the stack: they lie anywhere in
    /// memory, and arrive while their elder siblings are judged.
    pub fn expect_children(&self, hierarchy: &Hierarchy) {
        #[cfg(target_arch = "x86_64")]
        if let Some(top) = self.frames.last() {
            let mut rest = top.rest;
            while rest != 0 {
                let child = hierarchy.links[top.block as usize].child[rest.trailing_zeros() as usize];
                rest &= rest - 1;
                if child != NONE {
                    super::prefetch_x86::prefetch(&hierarchy.bounds[child as usize]);
                    super::prefetch_x86::prefetch(&hierarchy.links[child as usize]);
                }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = hierarchy;
    }

    /// The next lane in order of positions, if one is left.
    pub fn next(&mut self, test_count: usize) -> Option<Visit> {
        loop {
            let top = self.frames.last_mut()?;
            if top.rest != 0 {
                let lane = top.rest.trailing_zeros() as usize;
                top.rest &= top.rest - 1;
                return Some(Visit { block: top.block, lane });
            }
            self.frames.pop();
            self.carries.truncate(self.frames.len() * test_count);
        }
    }

    /// Judged blocks on the way to the visited lane, its own included.
    pub fn depth(&self) -> usize {
        self.frames.len()
    }

    /// The visited lane was judged and is not outside (it may be there only to be entered).
    pub fn is_kept(&self, at: Visit) -> bool {
        self.frames.last().is_some_and(|f| f.kept >> at.lane & 1 == 1)
    }

    /// No test has anything left to do below the visited lane.
    pub fn is_settled(&self, at: Visit, test_count: usize) -> bool {
        self.carries[self.carries.len() - test_count..].iter().all(|c| c[at.lane] == 0)
    }
}

/// Calls `visit(block, lane)` for every live lane, children before their parent.
pub(super) fn bottom_up(hierarchy: &Hierarchy, mut visit: impl FnMut(usize, usize)) {
    // Parents before children, by any order; then backwards.
    let mut order: Vec<u32> = (0..hierarchy.root_blocks).collect();
    let mut at = 0;
    while at < order.len() {
        let links = &hierarchy.links[order[at] as usize];
        order
            .extend((0..LANES).filter(|l| links.live >> l & 1 == 1 && links.child[*l] != NONE).map(|l| links.child[l]));
        at += 1;
    }
    for block in order.into_iter().rev() {
        let live = hierarchy.links[block as usize].live;
        (0..LANES).filter(|l| live >> l & 1 == 1).for_each(|l| visit(block as usize, l));
    }
}
