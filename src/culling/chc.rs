//! `chc`: coherent hierarchical culling (Bittner, Wimmer, Piringer & Purgathofer 2004).
//!
//! What was visible in the frame before is taken to be visible still: it is drawn or
//! entered at once, front to back, while queries are on their way. Asked are only nodes
//! that were invisible, and visible leaves, whether they still are; answers are taken in
//! order when they are there, and waited for only when nothing else is left to do. A node
//! that turns out visible pulls those above it up; an inner node stays visible as long as
//! some child is.
//!
//! Options of later work (Barroso's library; its parameters' names): `n_av`, frames
//! between questions to a visible leaf; `n_vp`; `stall=draw`, which draws the smallest
//! leaf whose answer is awaited rather than wait.
//!
//! What we changed: any number of roots; entries at inner nodes are drawn with the node;
//! a node that the near plane cuts is visible without a query. A node counts as visible
//! only if it was visited in the frame before, so that nothing is believed of what left
//! the frustum. Class and reason: see `queries/stage.rs`; what is drawn on trust is more
//! than is needed, never less.

use super::queries::front::{Depth, Item};
use super::queries::history::History;
use super::queries::{self, Occlusion, Order, Stage, Ticket};
use super::skipping::{STILL, WHOLE_BELOW};
use super::*;
use std::collections::VecDeque;

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "chc",
    about: "queries of what was hidden and of visible leaves, hidden behind drawing what was visible (Bittner et al. 2004)",
    revision: 1,
    params: &[
        queries::AUTO,
        queries::BACKEND,
        queries::COVERAGE,
        queries::HEIGHT_PX,
        queries::LATENCY_US,
        Param {
            name: "n_av",
            default: Allowed::Int { value: 1, min: 1, max: 1000 },
            about: "frames between two questions to a visible leaf",
        },
        queries::N_VP,
        queries::OCCLUDER_PX,
        queries::QUERY_NS,
        queries::SORTED,
        Param {
            name: "stall",
            default: Allowed::Choice(&["wait", "draw"]),
            about: "with nothing left but answers to come: wait, or draw the smallest leaf that is asked about",
        },
        queries::WIDTH_PX,
        STILL,
        WHOLE_BELOW,
    ],
    make: |spec| {
        let n_av = spec.int("n_av") as u32;
        Box::new(Occlusion::new(spec, n_av, Chc { n_av, draws: spec.text("stall") == "draw", ..Chc::default() }))
    },
};

/// A query on its way.
struct Pending {
    ticket: Ticket,
    item: Item,
    /// It was visible before, or was drawn since: an answer only says what is so next.
    drawn: bool,
}

#[derive(Default)]
pub struct Chc {
    history: History,
    pending: VecDeque<Pending>,
    n_av: u32,
    draws: bool,
}

impl Chc {
    /// Takes the oldest answer.
    fn receive(&mut self, stage: &mut Stage) {
        let Some(Pending { ticket, item, drawn }) = self.pending.pop_front() else { return };
        if stage.take(ticket) {
            self.history.pull_up(stage.hierarchy, item.node);
            self.history.ask_in(item.node, self.n_av);
            if !drawn {
                stage.traverse(item);
            }
        } else if !drawn {
            stage.hide(item);
        }
    }

    /// Draws the smallest leaf that is not drawn and awaits its answer.
    fn draw_one(&mut self, stage: &mut Stage) -> bool {
        let leaves = self.pending.iter_mut().filter(|p| !p.drawn && stage.is_leaf(p.item));
        let Some(least) = leaves.min_by_key(|p| (stage.size(p.item), p.item.node)) else { return false };
        least.drawn = true;
        stage.traverse(least.item);
        true
    }

    fn visit(&mut self, stage: &mut Stage, item: Item) {
        let depth = stage.depth(item);
        if depth == Depth::Behind {
            return;
        }
        let was = self.history.visit(item.node);
        // A leaf found visible a short while ago, and what the near plane cuts.
        let trusted = was && stage.is_leaf(item) && !self.history.is_due(item.node);
        if trusted || depth == Depth::Near {
            self.history.pull_up(stage.hierarchy, item.node);
        } else if !was || stage.is_leaf(item) {
            let ticket = stage.issue_one(item);
            self.pending.push_back(Pending { ticket, item, drawn: was });
        }
        if was || depth == Depth::Near {
            stage.traverse(item);
        }
    }
}

impl Order for Chc {
    fn run(&mut self, stage: &mut Stage) {
        self.history.begin(stage.hierarchy);
        loop {
            while let Some(front) = self.pending.front() {
                let waits = !stage.is_ready(front.ticket);
                if waits && (!stage.is_done() || self.draws && self.draw_one(stage)) {
                    break;
                }
                self.receive(stage);
            }
            match stage.pop() {
                Some(item) => self.visit(stage, item),
                None if self.pending.is_empty() => break,
                None => {}
            }
        }
    }

    fn reset(&mut self) {
        self.history.reset();
        self.pending.clear();
    }

    fn remembers(&self) -> bool {
        true
    }

    fn prepare(&mut self, hierarchy: &Hierarchy) -> usize {
        History::bytes(hierarchy)
    }
}
