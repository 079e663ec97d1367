//! What all walks with queries do: the rooms they keep, a frame's stage, and the
//! parameters, class and switches that they share. What each does in its own order
//! is its [`Order`].
//!
//! Class. Nodes are left out when a test is outside of them, when they lie before the
//! near plane, or when a query found nothing of them: their box then shows at no sample
//! of the depth buffer behind triangles that are drawn in this very frame. So nothing is
//! lost that the same samples see; with inner coverage, nothing visible at all. With
//! `n_vp` above 0 things of that many pixels may be lost.

use super::front::{Depth, Front, Item};
use super::payback::Payback;
use super::*;
use crate::culling::depth_first::DepthFirst;
use crate::hierarchy::NONE;

/// One frame of a walk with queries.
pub trait Order: Send {
    fn run(&mut self, stage: &mut Stage);
    fn reset(&mut self) {}
    /// Whether earlier frames change what is submitted.
    fn remembers(&self) -> bool;
    /// Builds what it keeps of the hierarchy; returns bytes.
    fn prepare(&mut self, hierarchy: &Hierarchy) -> usize;
}

/// A walk that asks queries in some order.
pub struct Occlusion<O> {
    order: O,
    backend: Box<dyn Backend>,
    front: Front,
    settings: Settings,
    /// The depth buffer is of the last frame.
    queried: bool,
    n_vp: u32,
    skipping: Skipping,
    payback: Option<Payback>,
    /// Submits at the end, by position.
    sorted: bool,
    plain: DepthFirst,
    boxes: Vec<Box32>,
}

impl<O: Order> Occlusion<O> {
    /// `n_av` frames pass between questions to a visible leaf.
    pub fn new(spec: &Spec, n_av: u32, order: O) -> Occlusion<O> {
        Occlusion {
            order,
            backend: backend(spec),
            front: Front::default(),
            settings: settings_of(spec),
            queried: true,
            n_vp: spec.int("n_vp") as u32,
            skipping: Skipping::new(spec),
            payback: spec.bool("auto").then(|| Payback::new(n_av)),
            sorted: spec.bool("sorted"),
            plain: DepthFirst::default(),
            boxes: Vec::new(),
        }
    }

    /// A frame without queries.
    fn rest(
        &mut self,
        view: &View,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        let before = tally.nodes_visited;
        self.plain.run(view, hierarchy, tests, out, tally);
        let (prices, mut clock) = (self.backend.prices(), clock::Clock::default());
        clock.work(clock::NODE_NS * (tally.nodes_visited - before) as f64);
        clock.draw(&prices, out.entry_count(), out.draw_calls(hierarchy));
        tally.virtual_ns += clock.times().virtual_ns;
        tally.frames_off += 1;
    }
}

impl<O: Order> Walk for Occlusion<O> {
    fn class(&self) -> Class {
        if self.n_vp > 0 { Class::Aggressive } else { class_of(self.settings.coverage) }
    }

    fn buffer(&mut self) -> Option<&mut crate::raster::DepthBuffer> {
        self.backend.buffer().filter(|_| self.queried)
    }

    fn samples(&self) -> Option<(u32, u32)> {
        Some((self.settings.width_px, self.settings.height_px))
    }

    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, occluded: true, ..Removes::default() }
    }

    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.order.reset();
        self.backend.prepare(scene, hierarchy) + self.order.prepare(hierarchy)
    }

    fn skipping(&mut self) -> Option<&mut Skipping> {
        Some(&mut self.skipping)
    }

    fn reset(&mut self) {
        self.skipping.reset();
        self.backend.reset();
        self.order.reset();
        self.payback.iter_mut().for_each(Payback::reset);
    }

    fn remembers(&self) -> bool {
        self.payback.is_some() || self.order.remembers()
    }

    fn run(
        &mut self,
        view: &View,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        self.queried = !self.payback.as_mut().is_some_and(Payback::rests);
        if !self.queried {
            return self.rest(view, hierarchy, tests, out, tally);
        }
        self.backend.begin(view, hierarchy);
        self.front.begin(view, hierarchy);
        let before = *tally;
        let mut stage = Stage {
            hierarchy,
            tests,
            out,
            tally,
            backend: self.backend.as_mut(),
            front: &mut self.front,
            boxes: &mut self.boxes,
            perspective: view.is_perspective(),
            n_vp: self.n_vp,
            hidden_calls: 0,
            sorted: self.sorted,
        };
        stage.roots();
        self.order.run(&mut stage);
        let hidden_calls = stage.hidden_calls;
        if self.sorted {
            out.sort();
            self.backend.draw(0, 0, out.draw_calls(hierarchy) as u32, 0.0);
        }
        let times = self.backend.times();
        tally.virtual_ns += times.virtual_ns;
        tally.stall_ns += times.stall_ns;
        if let Some(payback) = &mut self.payback {
            let prices = self.backend.prices();
            let since = |of: fn(&Tally) -> u64| of(tally) - of(&before);
            payback.learn(
                prices.draw_ns(since(|t| t.entries_occluded), hidden_calls),
                prices.queries_ns(since(|t| t.queries), since(|t| t.boxes_queried), since(|t| t.occluders_drawn))
                    + times.stall_ns as f64,
            );
        }
    }
}

/// What the order of a frame works with.
pub struct Stage<'a> {
    pub hierarchy: &'a Hierarchy,
    tests: &'a mut [Box<dyn Test>],
    out: &'a mut DrawList,
    pub tally: &'a mut Tally,
    backend: &'a mut dyn Backend,
    front: &'a mut Front,
    boxes: &'a mut Vec<Box32>,
    perspective: bool,
    n_vp: u32,
    hidden_calls: u64,
    sorted: bool,
}

/// A range to be drawn, none of it nearer than so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    pub first: u32,
    pub end: u32,
    pub distance_m: f32,
}

impl Stage<'_> {
    fn roots(&mut self) {
        for root in 0..self.hierarchy.root_blocks {
            self.enter(root, None);
        }
    }

    fn enter(&mut self, block: u32, from: Option<Item>) {
        let judged = self.front.enter(self.hierarchy, block, from, self.tests, self.tally);
        self.backend.work(judged);
    }

    /// The nearest node that is left.
    pub fn pop(&mut self) -> Option<Item> {
        self.front.pop()
    }

    /// No node is left.
    pub fn is_done(&self) -> bool {
        self.front.is_empty()
    }

    pub fn bounds(&self, item: Item) -> Box32 {
        self.hierarchy.bounds[item.block()].get(item.lane())
    }

    pub fn depth(&self, item: Item) -> Depth {
        self.front.depth(&self.bounds(item))
    }

    pub fn is_leaf(&self, item: Item) -> bool {
        self.hierarchy.links[item.block()].child[item.lane()] == NONE
    }

    /// Entries at and below the node.
    pub fn size(&self, item: Item) -> u32 {
        let links = &self.hierarchy.links[item.block()];
        links.end[item.lane()] - links.first[item.lane()]
    }

    /// The node shows: draws its own entries (all of a leaf's) and goes on below it.
    pub fn traverse(&mut self, item: Item) {
        let own = self.open(item);
        self.draw(own);
    }

    /// The same, but who calls draws: returns the node's own entries.
    #[must_use]
    pub fn open(&mut self, item: Item) -> Range {
        let links = &self.hierarchy.links[item.block()];
        let lane = item.lane();
        if links.child[lane] != NONE {
            self.enter(links.child[lane], Some(item));
        }
        Range { first: links.first[lane], end: links.own_end[lane], distance_m: item.distance_m(self.perspective) }
    }

    pub fn draw(&mut self, range: Range) {
        let Range { first, end, distance_m } = range;
        if first == end {
            return;
        }
        self.out.push(first, end);
        let calls = if self.sorted { 0 } else { self.hierarchy.material_runs(first, end) };
        self.tally.occluders_drawn += u64::from(self.backend.draw(first, end, calls, distance_m));
    }

    /// A query of some nodes, each by the boxes that `boxes` appends for it.
    pub fn issue(&mut self, nodes: &[Item], mut boxes: impl FnMut(&Stage, Item, &mut Vec<Box32>)) -> Ticket {
        let mut all = std::mem::take(self.boxes);
        all.clear();
        nodes.iter().for_each(|item| boxes(self, *item, &mut all));
        self.tally.queries += 1;
        self.tally.boxes_queried += all.len() as u64;
        self.tally.multiqueries += u64::from(nodes.len() > 1);
        let ticket = self.backend.issue(&all, self.n_vp > 0);
        *self.boxes = all;
        ticket
    }

    /// A query of one node by its own box.
    pub fn issue_one(&mut self, item: Item) -> Ticket {
        self.issue(&[item], |stage, item, boxes| boxes.push(stage.bounds(item)))
    }

    pub fn is_ready(&self, ticket: Ticket) -> bool {
        self.backend.is_ready(ticket)
    }

    /// Waits for the answer: whether what was asked about shows.
    pub fn take(&mut self, ticket: Ticket) -> bool {
        self.backend.take(ticket) > self.n_vp
    }

    /// The node was found hidden and is not drawn.
    pub fn hide(&mut self, item: Item) {
        let links = &self.hierarchy.links[item.block()];
        let (first, end) = (links.first[item.lane()], links.end[item.lane()]);
        self.tally.nodes_occluded += 1;
        self.tally.entries_occluded += u64::from(end - first);
        self.hidden_calls += u64::from(self.hierarchy.material_runs(first, end));
    }
}
