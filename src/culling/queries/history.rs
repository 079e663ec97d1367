//! What walks with queries remember of a node from frame to frame.

use super::*;
use crate::hierarchy::{LANES, NONE};

#[derive(Debug, Clone, Copy, Default)]
struct Memory {
    /// Frame of the last visit; 0 never.
    visited: u32,
    /// Frame in which what was known of it last changed, or began.
    since: u32,
    /// A leaf found visible is not asked again before this frame.
    due: u32,
    visible: bool,
    /// `was` at the last visit.
    was: bool,
}

/// Of every node, by number.
#[derive(Debug, Default)]
pub struct History {
    nodes: Vec<Memory>,
    frame: u32,
}

impl History {
    pub fn reset(&mut self) {
        self.nodes.clear();
        self.frame = 0;
    }

    pub fn begin(&mut self, hierarchy: &Hierarchy) {
        self.nodes.resize(hierarchy.links.len() * LANES, Memory::default());
        self.frame += 1;
        // Stamps of four thousand million frames ago.
        if self.frame == u32::MAX {
            self.nodes.fill(Memory::default());
            self.frame = 1;
        }
    }

    /// Visits a node: whether it was visible in the frame before, in which it was visited,
    /// too. From here on it is not, until it is found to be.
    pub fn visit(&mut self, node: u32) -> bool {
        let m = &mut self.nodes[node as usize];
        let known = m.visited != 0 && m.visited == self.frame - 1;
        let was = m.visible && known;
        if !known || was != m.was {
            m.since = self.frame;
        }
        *m = Memory { visited: self.frame, visible: false, was, ..*m };
        was
    }

    /// Frames since the node was first found as it is now, without a frame in between in
    /// which it was not visited.
    pub fn steady(&self, node: u32) -> u32 {
        self.frame - self.nodes[node as usize].since
    }

    /// The node and those above it are visible.
    pub fn pull_up(&mut self, hierarchy: &Hierarchy, mut node: u32) {
        while node != NONE && !std::mem::replace(&mut self.nodes[node as usize].visible, true) {
            node = hierarchy.parent[node as usize / LANES];
        }
    }

    pub fn is_due(&self, node: u32) -> bool {
        self.nodes[node as usize].due <= self.frame
    }

    /// The next question to a visible leaf is due `frames` from now.
    pub fn ask_in(&mut self, node: u32, frames: u32) {
        self.nodes[node as usize].due = self.frame.saturating_add(frames);
    }

    pub fn frame(&self) -> u32 {
        self.frame
    }

    pub fn bytes(hierarchy: &Hierarchy) -> usize {
        hierarchy.links.len() * LANES * size_of::<Memory>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::LinkBlock;

    /// Three blocks in a row, each below lane 1 of the one before.
    fn chain() -> Hierarchy {
        let links = vec![LinkBlock { live: 0b11, ..LinkBlock::EMPTY }; 3];
        Hierarchy { links, parent: vec![NONE, 1, 9], root_blocks: 1, ..Hierarchy::default() }
    }

    #[test]
    fn what_is_visible_pulls_up_those_above_it() {
        let h = chain();
        let mut history = History::default();
        history.begin(&h);
        for node in [0, 1, 8, 9, 16, 17] {
            assert!(!history.visit(node), "nothing was visible before the first frame");
        }
        history.pull_up(&h, 17);
        history.begin(&h);
        assert_eq!([0, 1, 8, 9, 16, 17].map(|n| history.visit(n)), [false, true, false, true, false, true]);
        history.begin(&h);
        assert!(!history.visit(1), "visiting forgets until it is found again");
    }

    #[test]
    fn who_was_away_is_a_stranger() {
        let h = chain();
        let mut history = History::default();
        history.begin(&h);
        history.visit(1);
        history.pull_up(&h, 1);
        history.begin(&h);
        history.begin(&h);
        assert!(!history.visit(1), "visible, but not visited in the frame before");
        assert_eq!(history.steady(1), 0);
        for i in 1..5 {
            history.begin(&h);
            assert!(!history.visit(1));
            assert_eq!(history.steady(1), i);
        }
        history.pull_up(&h, 1);
        history.begin(&h);
        assert!(history.visit(1));
        assert_eq!(history.steady(1), 0, "it changed");
        history.begin(&h);
        assert!(!history.visit(1));
        assert_eq!(history.steady(1), 0, "and again");
        history.begin(&h);
        history.begin(&h);
        history.visit(1);
        assert_eq!(history.steady(1), 0, "away for a frame");
    }
}
