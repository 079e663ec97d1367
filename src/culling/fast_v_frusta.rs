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
use super::fast_v_blockers::Surface;
use super::fast_v_items::{Frame, Item, Kind, Next};
use super::fast_v_lens::Rect;
use crate::hierarchy::{LANES, NONE};
use rayon::prelude::*;
use std::collections::BinaryHeap;
use std::sync::Mutex;

/// Share of the depth by which what is hidden lies behind its blocker at least: surfaces
/// nearer than that to each other are one, whoever judges.
const BEHIND: f64 = 1.0 / (1u64 << 26) as f64;
/// Nodes with so many triangles in all are opened before a frustum is divided.
const FEW: usize = 256;
/// Levels whose frusta are tasks of their own.
const TASK_LEVELS: u32 = 3;

/// A frustum that waits: what its parent left it, hidden below the key `far`.
struct Task {
    cell: Rect,
    items: Vec<Item>,
    far: f64,
}

/// What tasks write to, kept from frame to frame.
#[derive(Default)]
pub struct Pool(Mutex<Vec<Scratch>>);

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

/// What one task writes to.
#[derive(Default)]
pub struct Scratch {
    /// Positions found so far, as bits and as a list.
    known: Vec<u64>,
    found: Vec<u32>,
    surface: Surface,
    /// Lists of the frusta from the task's own down to the present one.
    items: Vec<Item>,
    heap: BinaryHeap<Next>,
    tally: Tally,
}

impl Scratch {
    fn fit(&mut self, frame: &Frame) {
        self.known.resize(frame.hierarchy.entries.len().div_ceil(64), 0);
        self.surface.fit(frame.mesh.len());
    }

    fn finish(&mut self) -> (Vec<u32>, Tally) {
        self.tally.facets += self.surface.clear() as u64;
        self.found.iter().for_each(|p| self.known[*p as usize / 64] = 0);
        let signs = std::mem::take(&mut self.surface.signs);
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
        let first = self.surface.next_growth();
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
            if self.surface.is_grown(t, first) || !self.surface.is_hit(frame, t, centre) {
                continue;
            }
            self.tally.blocker_tries += 1;
            if let Some(key) = self.surface.grow(frame, t, cell) {
                self.tally.blockers += 1;
                far = far.max(key - BEHIND * key.abs());
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
            if let Some(item) = frame.piece(position, node, &mut self.surface.signs)
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
        !behind && item.rect.within(cell) || self.surface.is_in(frame, cell, item, far, behind)
    }
}
