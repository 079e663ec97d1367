//! Nodes by number, and what became of each of them in a frame.
//!
//! Numbers follow the blocks of the hierarchy, in a block its live lanes. They say
//! nothing of kinship; boxes and depths are for drawing.

use super::watch::{Answer, Heard};
use crate::culling::DrawList;
use crate::hierarchy::{Hierarchy, LANES, NONE};

/// Never asked about, nor anything below; what lies there shares the fate of the
/// nearest node above that has one.
pub const NOT_REACHED: u8 = 0;
/// Submitted: a leaf that no test is outside of (by walks that judge triangles, a part of
/// it), or a node of which no test can say more, with all below it as one range.
pub const DRAWN: u8 = 1;
/// Its children were asked. Entries of its own, if it has any, are submitted.
pub const WENT_ON: u8 = 2;
/// The walk passed it by: no opening shows it, or occluders hide it, though no test is outside of it.
pub const HIDDEN: u8 = 3;
/// `CULLED + k`: test `k` was the first to be outside. The walk `flat` asks an inner
/// node about entries of its own alone: then its children may be reached nonetheless.
pub const CULLED: u8 = 16;

/// Set bits, ascending.
pub fn lanes(mask: u8) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |l| mask >> l & 1 == 1)
}

/// Number of the first node of every block; live lanes are the low ones.
pub struct Numbers {
    first: Vec<u32>,
    count: u32,
}

impl Numbers {
    pub fn of(hierarchy: &Hierarchy) -> Numbers {
        let mut count = 0;
        let number = |live: u8| {
            count += live.count_ones();
            count - live.count_ones()
        };
        Numbers { first: hierarchy.links.iter().map(|l| l.live).map(number).collect(), count }
    }

    pub fn count(&self) -> u32 {
        self.count
    }

    pub fn node(&self, block: u32, lane: usize) -> usize {
        self.first[block as usize] as usize + lane
    }

    /// What became of every node in a frame, from what was heard of it; `list` is what it
    /// submitted in the end, and `hides` says that the walk leaves nodes out by itself.
    pub fn of_frame(&self, hierarchy: &Hierarchy, heard: &Heard, list: &DrawList, hides: bool) -> Vec<u8> {
        if !hides {
            return self.decisions(hierarchy, &heard.answers);
        }
        // In order of drawing, which need not be that of positions.
        let mut submitted = heard.submitted.as_ref().unwrap_or(&list.ranges).clone();
        submitted.sort_unstable();
        self.decisions_by_list(hierarchy, &heard.answers, &submitted)
    }

    /// What became of every node, from what the tests answered in one frame: a block
    /// was entered iff something was asked about it or below it.
    pub fn decisions(&self, hierarchy: &Hierarchy, answers: &[Answer]) -> Vec<u8> {
        let mut codes = vec![NOT_REACHED; self.count as usize];
        if answers.is_empty() {
            // No test had anything to ask this frame, so that the walk drew everything.
            for root in 0..hierarchy.root_blocks {
                lanes(hierarchy.links[root as usize].live).for_each(|l| codes[self.node(root, l)] = DRAWN);
            }
            return codes;
        }
        let mut entered = vec![false; hierarchy.links.len()];
        for answer in answers {
            let mut block = answer.block;
            while !std::mem::replace(&mut entered[block as usize], true) {
                match hierarchy.parent[block as usize] {
                    NONE => break,
                    node => block = node / LANES as u32,
                }
            }
            // Tests are asked in their order: the last answer that keeps is overruled by
            // the first that does not, after which nobody asks.
            let culled = CULLED.saturating_add(answer.test);
            for lane in lanes(answer.asked) {
                let outside = answer.outside >> lane & 1 == 1;
                codes[self.node(answer.block, lane)] = if outside { culled } else { DRAWN };
            }
        }
        let parents = hierarchy.parent.iter().zip(&entered).filter(|(parent, entered)| **entered && **parent != NONE);
        for (parent, _) in parents {
            let code = &mut codes[self.node(parent / LANES as u32, *parent as usize % LANES)];
            if *code < CULLED {
                *code = WENT_ON;
            }
        }
        codes
    }

    /// The same under a walk that leaves nodes out by itself: from what it `submitted`.
    pub fn decisions_by_list(&self, hierarchy: &Hierarchy, answers: &[Answer], submitted: &[(u32, u32)]) -> Vec<u8> {
        let mut culled = vec![NOT_REACHED; self.count as usize];
        for answer in answers {
            lanes(answer.outside).for_each(|l| culled[self.node(answer.block, l)] = CULLED.saturating_add(answer.test));
        }
        // Entries submitted before each range, for how many of a node's are.
        let before: Vec<u32> = std::iter::once(0)
            .chain(submitted.iter().scan(0, |sum, (first, end)| {
                *sum += end - first;
                Some(*sum)
            }))
            .collect();
        let up_to = |position: u32| {
            let i = submitted.partition_point(|(first, _)| *first < position);
            let last = i.checked_sub(1).map_or(0, |i| submitted[i].1.saturating_sub(position));
            before[i] - last
        };
        let mut codes = vec![NOT_REACHED; self.count as usize];
        let mut pending: Vec<u32> = (0..hierarchy.root_blocks).collect();
        while let Some(block) = pending.pop() {
            let links = &hierarchy.links[block as usize];
            for lane in lanes(links.live) {
                let (first, end, node) = (links.first[lane], links.end[lane], self.node(block, lane));
                codes[node] = match up_to(end) - up_to(first) {
                    0 if culled[node] != NOT_REACHED => culled[node],
                    0 => HIDDEN,
                    all if all == end - first => DRAWN,
                    // A walk that judges triangles took some of the leaf.
                    _ if links.child[lane] == NONE => DRAWN,
                    _ => {
                        pending.extend(Some(links.child[lane]).filter(|child| *child != NONE));
                        WENT_ON
                    }
                };
            }
        }
        codes
    }
}

/// Levels below the roots, by block. A block may lie before its parent's.
pub fn depths(hierarchy: &Hierarchy) -> Vec<u32> {
    let mut depths = vec![0; hierarchy.links.len()];
    let mut pending: Vec<u32> = (0..hierarchy.root_blocks).collect();
    while let Some(block) = pending.pop() {
        let links = &hierarchy.links[block as usize];
        for child in lanes(links.live).map(|l| links.child[l]).filter(|c| *c != NONE) {
            depths[child as usize] = depths[block as usize] + 1;
            pending.push(child);
        }
    }
    depths
}
