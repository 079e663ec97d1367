//! `chc_pp`: coherent hierarchical culling with batches and multiqueries (CHC++; Mattausch,
//! Bittner & Wimmer 2008).
//!
//! As `chc`, nodes that were visible are drawn or entered at once and only hidden nodes
//! and visible leaves are asked about. What is added, each a switch:
//! - `batch`: hidden nodes gather in a queue (i-queue) and are asked about together when
//!   so many are there, or nothing else is left to visit;
//! - `v_queue`: visible leaves that are due gather in another one, asked about only while
//!   an answer is awaited, the rest at the end of the frame, to be read in the next;
//! - `render_queue`: drawing waits for the next query and is then done by position, so
//!   that neighbours merge into fewer calls;
//! - `multiqueries`: one query for several nodes that will most likely all stay hidden
//!   ([`groups`]); if something of them shows, they are asked about one by one;
//! - `random_start`: a leaf that becomes visible is first asked about after a random
//!   number of frames, then every `n_av`, so that leaves that were revealed together do
//!   not come due together;
//! - `d_max`, `s_max`: an inner node is asked about by the boxes of its descendants up to
//!   so many levels below, as long as their area is at most so many times its own.
//!
//! What we changed. A frame goes on visiting nodes while no answer is there, in place of
//! waiting for it. Multiqueries take nodes by their chance to stay hidden, the most certain
//! first, and a query of a single node is not charged twice when it fails (else fresh
//! nodes would all end in one hopeless query). Frames since a node's state changed count
//! only as long as it is visited in each. The random first question comes 1 to
//! `n_av` frames later, not 0. Random numbers are a hash of seed, node and
//! frame. A node with entries of its own is asked about by its own box. Class and reason:
//! see `queries/stage.rs`.

pub mod groups;

use super::queries::front::{Depth, Item};
use super::queries::history::History;
use super::queries::stage::Range;
use super::queries::{self, Occlusion, Order, Stage, Ticket};
use super::skipping::{STILL, WHOLE_BELOW};
use super::*;
use crate::hierarchy::{LANES, NONE};
use crate::math::Box32;
use std::collections::VecDeque;

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "chc_pp",
    about: "CHC with batched queries, multiqueries, a render queue and tight bounds (CHC++, Mattausch et al. 2008)",
    revision: 1,
    params: &[
        queries::AUTO,
        queries::BACKEND,
        Param {
            name: "batch",
            default: Allowed::Int { value: 50, min: 0, max: 1 << 20 },
            about: "hidden nodes that are gathered before they are asked about; 0 or 1: each at once",
        },
        queries::COVERAGE,
        Param {
            name: "d_max",
            default: Allowed::Int { value: 3, min: 0, max: 16 },
            about: "levels below a hidden node whose boxes are asked about in its place; 0: its own box",
        },
        queries::HEIGHT_PX,
        queries::LATENCY_US,
        Param {
            name: "multiqueries",
            default: Allowed::Bool(true),
            about: "one query for several nodes that are likely to stay hidden",
        },
        Param {
            name: "n_av",
            default: Allowed::Int { value: 5, min: 1, max: 1000 },
            about: "frames between two questions to a visible leaf",
        },
        queries::N_VP,
        queries::OCCLUDER_PX,
        queries::QUERY_NS,
        Param {
            name: "random_start",
            default: Allowed::Bool(true),
            about: "the first question to a leaf that became visible comes after a random number of frames",
        },
        Param {
            name: "render_queue",
            default: Allowed::Bool(true),
            about: "drawing waits for the next query, and is done by position",
        },
        Param {
            name: "s_max",
            default: Allowed::Float { value: 1.4, min: 0.0, max: 1e6 },
            about: "area of the boxes of children over that of their parent, above which it is asked about itself",
        },
        Param {
            name: "seed",
            default: Allowed::Int { value: 1, min: 0, max: i64::MAX },
            about: "of the random numbers of frames",
        },
        queries::SORTED,
        Param {
            name: "v_queue",
            default: Allowed::Bool(true),
            about: "visible leaves are asked about only while an answer is awaited, or at the end of the frame",
        },
        queries::WIDTH_PX,
        STILL,
        WHOLE_BELOW,
    ],
    make: |spec| {
        let n_av = spec.int("n_av") as u32;
        let order = ChcPlus {
            n_av,
            batch: spec.int("batch") as usize,
            defers_visible: spec.bool("v_queue"),
            defers_drawing: spec.bool("render_queue"),
            groups: spec.bool("multiqueries"),
            random: spec.bool("random_start").then(|| spec.int("seed") as u64),
            d_max: spec.int("d_max") as u32,
            s_max: spec.float("s_max"),
            ..ChcPlus::default()
        };
        Box::new(Occlusion::new(spec, n_av, order))
    },
};

/// A query on its way; its nodes are the next so many of [`ChcPlus::asked`].
#[derive(Debug, Clone, Copy)]
struct Pending {
    ticket: Ticket,
    nodes: u32,
    /// A leaf that was visible and is drawn already.
    drawn: bool,
}

#[derive(Default)]
pub struct ChcPlus {
    n_av: u32,
    batch: usize,
    defers_visible: bool,
    defers_drawing: bool,
    groups: bool,
    /// Seed of the first questions.
    random: Option<u64>,
    d_max: u32,
    s_max: f64,
    history: History,
    /// Hidden nodes to be asked about.
    hidden: Vec<Item>,
    /// Visible leaves that are due.
    visible: VecDeque<Item>,
    pending: VecDeque<Pending>,
    asked: VecDeque<Item>,
    /// Ranges to be drawn before the next query.
    deferred: Vec<Range>,
    /// A bit a lane: the node's children stand for it.
    divides: Vec<u8>,
    scratch: Vec<Item>,
}

impl ChcPlus {
    fn draw(&mut self, stage: &mut Stage, range: Range) {
        if self.defers_drawing { self.deferred.push(range) } else { stage.draw(range) }
    }

    /// Draws what is deferred, neighbours as one range.
    fn flush(&mut self, stage: &mut Stage) {
        self.deferred.retain(|r| r.first != r.end);
        self.deferred.sort_unstable_by_key(|r| r.first);
        let mut ranges = self.deferred.drain(..);
        let Some(mut last) = ranges.next() else { return };
        for range in ranges {
            if range.first == last.end {
                last = Range { end: range.end, distance_m: last.distance_m.min(range.distance_m), ..last };
            } else {
                stage.draw(std::mem::replace(&mut last, range));
            }
        }
        stage.draw(last);
    }

    fn traverse(&mut self, stage: &mut Stage, item: Item) {
        let own = stage.open(item);
        self.draw(stage, own);
    }

    fn ask(&mut self, stage: &mut Stage, nodes: &[Item], drawn: bool) {
        let tight = (self.d_max, &self.divides[..]);
        let ticket = stage.issue(nodes, |stage, item, boxes| {
            append_boxes(stage.hierarchy, tight.1, item.node, tight.0, boxes);
        });
        self.pending.push_back(Pending { ticket, nodes: nodes.len() as u32, drawn });
        self.asked.extend(nodes);
    }

    /// Asks about all hidden nodes that were gathered.
    fn ask_hidden(&mut self, stage: &mut Stage) {
        self.flush(stage);
        let mut items = std::mem::take(&mut self.hidden);
        if self.groups {
            // Certainty grows with the frames; those of equal age stay front to back.
            items.sort_by_key(|item| std::cmp::Reverse(self.history.steady(item.node)));
        }
        let mut rest = &items[..];
        while !rest.is_empty() {
            let ages = rest.iter().map(|item| self.history.steady(item.node));
            let (group, more) = rest.split_at(if self.groups { groups::first_group(ages) } else { 1 });
            self.ask(stage, group, false);
            rest = more;
        }
        items.clear();
        self.hidden = items;
    }

    fn ask_visible(&mut self, stage: &mut Stage, item: Item) {
        self.flush(stage);
        self.ask(stage, &[item], true);
    }

    /// Takes the oldest answer.
    fn receive(&mut self, stage: &mut Stage) {
        let Some(Pending { ticket, nodes, drawn }) = self.pending.pop_front() else { return };
        // Whoever waits has first given all work away.
        if !stage.is_ready(ticket) {
            self.flush(stage);
        }
        let shows = stage.take(ticket);
        let mut items = std::mem::take(&mut self.scratch);
        items.clear();
        items.extend(self.asked.drain(..nodes as usize));
        match (shows, &items[..]) {
            (true, [item]) => {
                self.history.pull_up(stage.hierarchy, item.node);
                let first = if drawn { self.n_av } else { self.first_question(item.node) };
                self.history.ask_in(item.node, first);
                if !drawn {
                    self.traverse(stage, *item);
                }
            }
            (true, all) => {
                stage.tally.multiqueries_failed += 1;
                self.flush(stage);
                all.iter().for_each(|item| self.ask(stage, &[*item], false));
            }
            (false, all) if !drawn => all.iter().for_each(|item| stage.hide(*item)),
            (false, _) => {}
        }
        self.scratch = items;
    }

    /// Frames until a leaf that just became visible is asked about: 1 to `n_av`.
    fn first_question(&self, node: u32) -> u32 {
        match self.random {
            Some(seed) => 1 + (mix(seed, node, self.history.frame()) % u64::from(self.n_av)) as u32,
            None => self.n_av,
        }
    }

    fn visit(&mut self, stage: &mut Stage, item: Item) {
        let depth = stage.depth(item);
        if depth == Depth::Behind {
            return;
        }
        let was = self.history.visit(item.node);
        let leaf = stage.is_leaf(item);
        if depth == Depth::Near || was && leaf && !self.history.is_due(item.node) {
            self.history.pull_up(stage.hierarchy, item.node);
        } else if was && leaf {
            if self.defers_visible {
                self.visible.push_back(item);
            } else {
                self.ask_visible(stage, item);
            }
        } else if !was {
            self.hidden.push(item);
            if self.hidden.len() >= self.batch {
                self.ask_hidden(stage);
            }
        }
        if was || depth == Depth::Near {
            self.traverse(stage, item);
        }
    }
}

impl Order for ChcPlus {
    fn run(&mut self, stage: &mut Stage) {
        // Leaves that the frame before asked about at its end.
        while !self.pending.is_empty() {
            self.receive(stage);
        }
        self.history.begin(stage.hierarchy);
        'frame: loop {
            while let Some(front) = self.pending.front() {
                if stage.is_ready(front.ticket) {
                    self.receive(stage);
                } else if let Some(item) = self.visible.pop_front() {
                    self.ask_visible(stage, item);
                } else if !stage.is_done() || !self.hidden.is_empty() {
                    break;
                } else if self.pending.iter().all(|p| p.drawn) {
                    // Answers about what is drawn anyway serve the next frame.
                    break 'frame;
                } else {
                    self.receive(stage);
                }
            }
            match stage.pop() {
                Some(item) => self.visit(stage, item),
                None if !self.hidden.is_empty() => self.ask_hidden(stage),
                None if self.pending.is_empty() => break,
                None => {}
            }
        }
        self.flush(stage);
        while let Some(item) = self.visible.pop_front() {
            self.ask_visible(stage, item);
        }
    }

    fn reset(&mut self) {
        self.history.reset();
        self.pending.clear();
        self.asked.clear();
    }

    fn remembers(&self) -> bool {
        true
    }

    fn prepare(&mut self, hierarchy: &Hierarchy) -> usize {
        self.divides = divides(hierarchy, self.s_max);
        History::bytes(hierarchy) + self.divides.len()
    }
}

/// By block, the lanes whose children's boxes are worth asking about in their place.
fn divides(hierarchy: &Hierarchy, s_max: f64) -> Vec<u8> {
    let area = |block: usize, lane: usize| f64::from(hierarchy.bounds[block].get(lane).half_area());
    let of_block = |block: usize| {
        let links = &hierarchy.links[block];
        let worth = |lane: &usize| {
            let child = links.child[*lane] as usize;
            links.live >> lane & 1 == 1
                && links.child[*lane] != NONE
                && links.own_end[*lane] == links.first[*lane]
                && lanes(hierarchy.links[child].live).map(|l| area(child, l)).sum::<f64>() <= s_max * area(block, *lane)
        };
        (0..LANES).filter(worth).fold(0, |bits, lane| bits | 1 << lane)
    };
    (0..hierarchy.links.len()).map(of_block).collect()
}

fn lanes(live: u8) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |l| live >> l & 1 == 1)
}

fn append_boxes(hierarchy: &Hierarchy, divides: &[u8], node: u32, levels: u32, out: &mut Vec<Box32>) {
    let (block, lane) = (node as usize / LANES, node as usize % LANES);
    if levels == 0 || divides[block] >> lane & 1 == 0 {
        out.push(hierarchy.bounds[block].get(lane));
        return;
    }
    let child = hierarchy.links[block].child[lane];
    for l in lanes(hierarchy.links[child as usize].live) {
        append_boxes(hierarchy, divides, child * LANES as u32 + l as u32, levels - 1, out);
    }
}

/// SplitMix64 (Steele, Lea & Flood 2014) of three numbers.
fn mix(seed: u64, node: u32, frame: u32) -> u64 {
    let mut x = seed.wrapping_add((u64::from(node) << 32 | u64::from(frame)).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ x >> 31
}
