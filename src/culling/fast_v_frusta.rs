//! The frusta of [`super::fast_v`]: a quadtree over the image, each frustum with the nodes
//! and triangles that its parent left it.
//!
//! A frustum looks for blockers first. Whatever fills it is hit by its central ray, so only
//! nodes that this ray may hit are opened, nearest first, and only triangles that it does hit
//! are tried. What is left in front of the farthest point of the nearest blocker goes to the
//! four quarters; at the end of the subdivision all nodes are opened and their triangles
//! judged one by one.
//!
//! The first levels are tasks of their own, then each frustum of the third level with all
//! below it. What a task does depends on nothing but its list, so that neither answer nor
//! counted work know how many threads there are.

use super::Tally;
use super::fast_v_facet::{Facet, Signs, is_drawn, place};
use super::fast_v_lens::{Lens, Rect, U};
use super::fast_v_mesh::Mesh;
use crate::hierarchy::{Hierarchy, LANES, NONE};
use crate::math::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::sync::Mutex;

/// Share of the depth by which what is hidden lies behind its blocker at least: surfaces
/// nearer than that to each other are one, whoever judges.
const BEHIND: f64 = 1.0 / (1u64 << 26) as f64;
/// Nodes with so many triangles in all are opened before a frustum is divided.
const FEW: usize = 256;
/// Levels whose frusta are tasks of their own.
const TASK_LEVELS: u32 = 3;

#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// The finest frusta are 2^levels to a side.
    pub levels: u32,
    /// A frustum with no more triangles is not divided; 0 divides all.
    pub enough: usize,
    /// Most triangles of a blocker.
    pub grow: usize,
    /// Depth is that of what lies in the frustum, not that of planes and whole triangles.
    pub clipped: bool,
}

/// One frame.
pub struct Frame<'a> {
    pub lens: &'a Lens,
    pub mesh: &'a Mesh,
    pub hierarchy: &'a Hierarchy,
    /// By block: lanes that the tests left, as far as they were asked.
    pub kept: &'a [u8],
    /// By block: lanes below which nobody was asked, as all is inside.
    pub settled: &'a [u8],
    pub options: Options,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// `id` is a node.
    Node,
    /// `id` is a position.
    Piece,
    /// Opened, or found to be outside.
    Gone,
}

/// A node or a piece of triangle that may be seen in a frustum.
#[derive(Debug, Clone, Copy)]
struct Item {
    rect: Rect,
    /// Of the nearest point.
    key: f64,
    /// Of the farthest point of a piece's triangle.
    key_min: f64,
    id: u32,
    kind: Kind,
    /// Below this node all is kept.
    settled: bool,
}

/// Nearest first; then in the order of the list.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Next {
    key: f64,
    at: usize,
}

impl Eq for Next {}

impl PartialOrd for Next {
    fn partial_cmp(&self, o: &Next) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}

impl Ord for Next {
    fn cmp(&self, o: &Next) -> Ordering {
        self.key.total_cmp(&o.key).then(o.at.cmp(&self.at))
    }
}

/// A frustum that waits: what its parent left it, hidden below the key `far`.
struct Task {
    cell: Rect,
    items: Vec<Item>,
    far: f64,
}

/// What tasks write to, kept from frame to frame.
#[derive(Default)]
pub struct Pool(Mutex<Vec<Box<Scratch>>>);

impl Pool {
    fn with<T>(&self, frame: &Frame, work: impl FnOnce(&mut Scratch) -> T) -> (T, Vec<u32>, Tally) {
        let spare = self.0.lock().expect("no task panicked").pop();
        let mut scratch = spare.unwrap_or_default();
        scratch.fit(frame);
        let out = work(&mut scratch);
        let (found, tally) = scratch.finish();
        self.0.lock().expect("no task panicked").push(scratch);
        (out, found, tally)
    }
}

/// Positions that are seen in any frustum, in no order, maybe more than once; and the work.
pub fn visible(frame: &Frame, pool: &Pool) -> (Vec<Vec<u32>>, Tally) {
    let mut tasks = vec![Task { cell: frame.lens.image, items: frame.roots(), far: frame.lens.key_far }];
    let (mut found, mut tallies) = (Vec::new(), Vec::new());
    let levels = frame.options.levels;
    for level in 0..TASK_LEVELS.min(levels) {
        let step = |task: &Task| pool.with(frame, |s| s.divide(frame, task, levels - level));
        let steps: Vec<_> = tasks.par_iter().map(step).collect();
        tasks.clear();
        for (children, seen, tally) in steps {
            tasks.extend(children);
            found.push(seen);
            tallies.push(tally);
        }
    }
    let rest = levels.saturating_sub(TASK_LEVELS);
    let whole = |task: &Task| pool.with(frame, |s| s.whole(frame, task, rest));
    let last: Vec<_> = tasks.par_iter().map(whole).collect();
    for ((), seen, tally) in last {
        found.push(seen);
        tallies.push(tally);
    }
    (found, tallies.into_iter().sum())
}

impl Frame<'_> {
    fn roots(&self) -> Vec<Item> {
        let mut items = Vec::new();
        for block in 0..self.hierarchy.root_blocks {
            self.lanes(block, self.kept[block as usize], false, |item| items.push(item));
        }
        items
    }

    fn lanes(&self, block: u32, kept: u8, settled: bool, mut take: impl FnMut(Item)) {
        let mut rest = kept;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            if let Some((rect, key)) = self.lens.node(&self.hierarchy.bounds[block as usize], lane) {
                let settled = settled || self.settled[block as usize] >> lane & 1 == 1;
                take(Item {
                    rect,
                    key,
                    key_min: f64::NEG_INFINITY,
                    id: block * LANES as u32 + lane as u32,
                    kind: Kind::Node,
                    settled,
                });
            }
        }
    }

    /// What of the piece at `position` may be seen through its node.
    fn piece(&self, position: u32, node: &Item, signs: &mut Signs) -> Option<Item> {
        let t = self.mesh.triangle_at(position);
        let corners = self.mesh.corners(t);
        if !is_drawn(self.lens, self.mesh, t, &corners, signs) {
            return None;
        }
        let (rect, [key_min, key]) = match &self.hierarchy.fragments {
            None => place(self.lens, &corners, 0.0)?,
            Some(fragments) => {
                // Corners of fragments were rounded once a cut.
                let piece = &fragments[position as usize];
                let size = |p: &DVec3| p.abs().max_element();
                let error = 4096.0 * U * (piece.iter().map(size).fold(0.0, f64::max) + size(&self.lens.eye));
                place(self.lens, piece, error)?
            }
        };
        let (rect, key) = (rect.meet(&node.rect), key.min(node.key));
        Some(Item { rect, key, key_min, id: position, kind: Kind::Piece, ..*node })
    }
}

/// What one task writes to.
#[derive(Default)]
pub struct Scratch {
    /// Positions found so far, as bits and as a list.
    known: Vec<u64>,
    found: Vec<u32>,
    /// By triangle: where its facet is, or [`NONE`].
    slot: Vec<u32>,
    facets: Vec<Facet>,
    /// By triangle: the last growth that came to it.
    grown: Vec<u32>,
    growths: u32,
    queue: Vec<u32>,
    /// Lists of the frusta from the task's own down to the present one.
    items: Vec<Item>,
    heap: BinaryHeap<Next>,
    signs: Signs,
    tally: Tally,
}

impl Scratch {
    fn fit(&mut self, frame: &Frame) {
        self.known.resize(frame.hierarchy.entries.len().div_ceil(64), 0);
        self.slot.resize(frame.mesh.len(), NONE);
        self.grown.resize(frame.mesh.len(), 0);
        if self.growths > u32::MAX / 2 {
            self.grown.fill(0);
            self.growths = 0;
        }
    }

    fn finish(&mut self) -> (Vec<u32>, Tally) {
        for facet in self.facets.drain(..) {
            self.slot[facet.triangle as usize] = NONE;
        }
        self.found.iter().for_each(|p| self.known[*p as usize / 64] = 0);
        let signs = std::mem::take(&mut self.signs);
        let tally = std::mem::take(&mut self.tally);
        let counted = Tally { predicates: signs.asked, fallbacks_exact: signs.exact, ..tally };
        (std::mem::take(&mut self.found), counted)
    }

    /// Processes one frustum and leaves its quarters to others.
    fn divide(&mut self, frame: &Frame, task: &Task, levels: u32) -> Vec<Task> {
        self.items.clear();
        self.items.extend_from_slice(&task.items);
        let far = self.block(frame, &task.cell, 0, task.far);
        if self.is_enough(frame, &task.cell, 0, far, levels) {
            return Vec::new();
        }
        let quarter = |cell: Rect| {
            let items = self.items.iter().filter(|i| i.rect.overlaps(&cell)).copied().collect();
            Task { cell, items, far }
        };
        task.cell.quarters().map(quarter).into()
    }

    /// Processes one frustum and all below it.
    fn whole(&mut self, frame: &Frame, task: &Task, levels: u32) {
        self.items.clear();
        self.items.extend_from_slice(&task.items);
        self.frustum(frame, &task.cell, 0, task.far, levels);
    }

    /// The items from `start` on are those of the frustum.
    fn frustum(&mut self, frame: &Frame, cell: &Rect, start: usize, far: f64, levels: u32) {
        if self.nothing_is_open(start) {
            return;
        }
        let far = self.block(frame, cell, start, far);
        if levels > 0 {
            self.thin(frame, cell, start, far);
            if self.nothing_is_open(start) {
                return;
            }
        }
        if self.is_enough(frame, cell, start, far, levels) {
            return;
        }
        let end = self.items.len();
        for quarter in cell.quarters() {
            for i in start..end {
                if self.items[i].rect.overlaps(&quarter) {
                    self.items.push(self.items[i]);
                }
            }
            self.frustum(frame, &quarter, end, far, levels - 1);
            self.items.truncate(end);
        }
    }

    fn is_known(&self, position: u32) -> bool {
        self.known[position as usize / 64] >> (position % 64) & 1 == 1
    }

    /// All there is was found in other frusta.
    fn nothing_is_open(&self, start: usize) -> bool {
        self.items[start..].iter().all(|i| i.kind == Kind::Piece && self.is_known(i.id))
    }

    /// Looks for blockers; returns the key below which they hide everything, and leaves what
    /// is not below.
    fn block(&mut self, frame: &Frame, cell: &Rect, start: usize, far: f64) -> f64 {
        self.tally.frusta += 1;
        let centre = cell.centre();
        let first = self.growths + 1;
        let mut far = far;
        self.heap.clear();
        self.expect(centre, start);
        while let Some(next) = self.heap.pop() {
            if next.key < far {
                break;
            }
            let item = self.items[next.at];
            if item.kind == Kind::Node {
                let from = self.items.len();
                self.items[next.at].kind = Kind::Gone;
                self.open(frame, cell, &item, far, true);
                self.expect(centre, from);
                continue;
            }
            let t = frame.mesh.triangle_at(item.id);
            // Grown over already, in vain or not.
            if self.grown[t as usize] >= first {
                continue;
            }
            let facet = self.facet(frame, t);
            let seed = &self.facets[facet];
            if seed.blocks && seed.covers(centre, frame.lens, frame.mesh, &mut self.signs) {
                self.tally.blocker_tries += 1;
                if let Some(key) = self.grow(frame, t, cell) {
                    self.tally.blockers += 1;
                    far = far.max(key - BEHIND * key.abs());
                }
            }
        }
        self.tidy(start, far);
        far
    }

    /// Where few triangles are left, looks at each: if all that are seen were found in other
    /// frusta, there is no need to divide this one.
    fn thin(&mut self, frame: &Frame, cell: &Rect, start: usize, far: f64) {
        let entries = |item: &Item| {
            let links = &frame.hierarchy.links[item.id as usize / LANES];
            (links.end[item.id as usize % LANES] - links.first[item.id as usize % LANES]) as usize
        };
        let nodes = self.items[start..].iter().filter(|i| i.kind == Kind::Node);
        if nodes.map(entries).sum::<usize>() > FEW {
            return;
        }
        let mut at = start;
        while at < self.items.len() {
            let item = self.items[at];
            let stays = match item.kind {
                Kind::Node => {
                    self.open(frame, cell, &item, far, true);
                    false
                }
                _ => self.is_known(item.id) || self.is_seen(frame, cell, &item, far),
            };
            if !stays {
                self.items[at].kind = Kind::Gone;
            }
            at += 1;
        }
        self.tidy(start, far);
    }

    /// Puts the items from `from` on that the central ray may hit in line.
    fn expect(&mut self, centre: [f64; 2], from: usize) {
        for (at, item) in self.items.iter().enumerate().skip(from) {
            if item.rect.holds(centre) {
                self.heap.push(Next { key: item.key, at });
            }
        }
    }

    /// Takes out what is gone or hidden.
    fn tidy(&mut self, start: usize, far: f64) {
        let mut to = start;
        for i in start..self.items.len() {
            if self.items[i].kind != Kind::Gone && self.items[i].key >= far {
                self.items[to] = self.items[i];
                to += 1;
            }
        }
        self.items.truncate(to);
    }

    /// Appends what is directly below a node; pieces that were found already only if they
    /// are `wanted` nevertheless.
    fn open(&mut self, frame: &Frame, cell: &Rect, node: &Item, far: f64, wanted: bool) {
        let (block, lane) = (node.id as usize / LANES, node.id as usize % LANES);
        let links = &frame.hierarchy.links[block];
        for position in links.first[lane]..links.own_end[lane] {
            if !wanted && self.is_known(position) {
                continue;
            }
            if let Some(item) = frame.piece(position, node, &mut self.signs)
                && item.rect.overlaps(cell)
                && item.key >= far
            {
                self.items.push(item);
            }
        }
        let child = links.child[lane];
        if child != NONE {
            let below = frame.hierarchy.links[child as usize].live;
            let kept = if node.settled { below } else { frame.kept[child as usize] };
            let items = &mut self.items;
            frame.lanes(child, kept, node.settled, |item| {
                let item = Item { rect: item.rect.meet(&node.rect), key: item.key.min(node.key), ..item };
                if item.rect.overlaps(cell) && item.key >= far {
                    items.push(item);
                }
            });
        }
    }

    /// Submits what is seen in the frustum, unless that must be divided first.
    fn is_enough(&mut self, frame: &Frame, cell: &Rect, start: usize, far: f64, levels: u32) -> bool {
        let most = match (levels, frame.options.enough) {
            (0, _) => usize::MAX,
            (_, 0) => return false,
            (_, enough) => enough,
        };
        let (mut at, mut count) = (start, 0);
        while at < self.items.len() {
            let item = self.items[at];
            let open = match item.kind {
                Kind::Gone => false,
                Kind::Node => {
                    self.open(frame, cell, &item, far, levels > 0);
                    false
                }
                // At the end of the subdivision nobody counts.
                Kind::Piece => levels == 0 && self.is_known(item.id) || self.is_seen(frame, cell, &item, far),
            };
            if !open {
                self.items[at].kind = Kind::Gone;
            } else {
                count += 1;
                if count > most {
                    self.tidy(start, far);
                    return false;
                }
            }
            at += 1;
        }
        for at in start..self.items.len() {
            let Item { id, kind, .. } = self.items[at];
            if kind == Kind::Piece && !self.is_known(id) {
                self.known[id as usize / 64] |= 1 << (id % 64);
                self.found.push(id);
            }
        }
        true
    }

    /// A piece that overlaps the frustum and is not behind it as a whole: is it in it, and
    /// in front of what fills it?
    fn is_seen(&mut self, frame: &Frame, cell: &Rect, item: &Item, far: f64) -> bool {
        self.tally.triangle_tests += 1;
        let behind = frame.options.clipped && item.key_min < far;
        if !behind && item.rect.within(cell) {
            return true;
        }
        let facet = self.facet(frame, frame.mesh.triangle_at(item.id));
        let facet = &self.facets[facet];
        !facet.avoids(cell, frame.lens, frame.mesh, &mut self.signs)
            && !(behind && facet.key_over(&item.rect.meet(cell))[1] < far)
    }

    fn facet(&mut self, frame: &Frame, t: u32) -> usize {
        let known = self.slot[t as usize];
        if known != NONE {
            return known as usize;
        }
        self.tally.facets += 1;
        self.slot[t as usize] = self.facets.len() as u32;
        self.facets.push(Facet::new(frame.lens, frame.mesh, t, &mut self.signs));
        self.facets.len() - 1
    }

    /// The least key of the blocker around `seed`, if there is one.
    fn grow(&mut self, frame: &Frame, seed: u32, cell: &Rect) -> Option<f64> {
        let (lens, mesh) = (frame.lens, frame.mesh);
        self.growths += 1;
        self.queue.clear();
        self.queue.push(seed);
        self.grown[seed as usize] = self.growths;
        let mut farthest = f64::INFINITY;
        let mut at = 0;
        while let Some(t) = self.queue.get(at).copied() {
            at += 1;
            let index = self.slot[t as usize] as usize;
            let facet = &self.facets[index];
            if !facet.is_beyond_near(cell, lens) {
                return None;
            }
            let [key, _] = if frame.options.clipped { facet.key_over(cell) } else { facet.plane_key_over(cell) };
            farthest = farthest.min(key);
            let turned = facet.turned;
            for k in 0..3 {
                if !self.facets[index].enters(k, cell, lens, mesh, &mut self.signs) {
                    continue;
                }
                let beyond = mesh.across(t, k).find(|(n, along)| {
                    let n = self.facet(frame, *n);
                    let facet = &self.facets[n];
                    // On the other side of the edge as seen.
                    facet.blocks && (facet.turned == turned) != *along
                });
                let (n, _) = beyond?;
                if self.grown[n as usize] != self.growths {
                    self.grown[n as usize] = self.growths;
                    self.queue.push(n);
                    if self.queue.len() > frame.options.grow {
                        return None;
                    }
                }
            }
        }
        Some(farthest)
    }
}
