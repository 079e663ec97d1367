//! V_hi: what is left of the exact set when the oracle has proved hidden what it
//! can, by a proof of its own.
//!
//! The image is cut into cells, a quadtree of frusta as in Chandak et al.,
//! "FastV" (2009). In a cell a connected patch of occluders that certainly covers
//! it ([`super::patch`]) hides every triangle that lies certainly behind it
//! wherever it overlaps the cell. What remains goes down to the four quarters; what
//! remains in a cell of the finest level may be visible. A triangle that remains
//! nowhere is proved hidden.
//!
//! Proof: all signs and depths are compared with bounds of their rounding
//! ([`super::outline`]), cells share their borders exactly and together hold the
//! image, and a triangle is left out of a cell only if it certainly avoids it.
//! Behind means by 2^-26 of the depth at least, more than [`super::item_buffer::TIE`]:
//! what a sample sees, ties included, is never hidden.
//!
//! Class: conservative (V* is a subset). Nothing depends on the number of threads.

use super::bits::BitSet;
use super::outline::{Outline, Rect, Screen};
use super::patch::{Adjacency, Faces};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Least share of the depth by which the hidden lies behind what hides it.
const BEHIND: f64 = 1.0 / (1u64 << 26) as f64;
/// Patches that are tried in a cell, nearest first, and those that may succeed.
const TRIES: usize = 8;
const SUCCESSES: usize = 2;
/// Levels that are shared out to threads.
const PARALLEL_LEVELS: u32 = 4;

/// Of `wanted` those triangles that are not proved hidden. `outlines` are all
/// triangles of the exact set that have a part of the image; `cells` is the least
/// number of cells to a side at the finest level.
pub fn not_hidden(
    screen: &Screen,
    outlines: &[Outline],
    adjacency: &Adjacency,
    triangles: usize,
    wanted: &BitSet,
    cells: u32,
) -> BitSet {
    let mut index = vec![u32::MAX; triangles];
    for (i, o) in (0u32..).zip(outlines) {
        index[o.triangle as usize] = i;
    }
    let faces = Faces { screen, outlines, index: &index, adjacency };
    let open = wanted.iter().map(|t| index[t as usize]).filter(|i| *i != u32::MAX);
    let mut undecided = BitSet::new(outlines.len());
    open.for_each(|i| undecided.insert(i));
    let search = Search { faces, undecided, left: (0..triangles.div_ceil(64)).map(|_| AtomicU64::new(0)).collect() };
    let levels = cells.max(1).next_power_of_two().trailing_zeros();
    let all: Vec<u32> = (0..outlines.len() as u32).collect();
    search.cell(&screen.image, &all, levels, PARALLEL_LEVELS.min(levels));
    let mut out = BitSet::new(triangles);
    for (word, bits) in (0u32..).zip(&search.left) {
        let bits = bits.load(Ordering::Relaxed);
        (0..64).filter(|b| bits >> b & 1 == 1).for_each(|b| out.insert(word * 64 + b));
    }
    out
}

struct Search<'a> {
    faces: Faces<'a>,
    /// Of the outlines, those to decide on.
    undecided: BitSet,
    /// By triangle: may be visible. Only ever set, so that no order of threads matters.
    left: Vec<AtomicU64>,
}

impl Search<'_> {
    fn is_open(&self, i: u32) -> bool {
        if !self.undecided.contains(i) {
            return false;
        }
        let t = self.faces.outlines[i as usize].triangle;
        self.left[t as usize / 64].load(Ordering::Relaxed) >> (t % 64) & 1 == 0
    }

    fn cell(&self, cell: &Rect, above: &[u32], levels: u32, parallel: u32) {
        let outlines = self.faces.outlines;
        let mut members: Vec<u32> = above.iter().copied().filter(|i| !outlines[*i as usize].avoids(cell)).collect();
        // Copies of what is open are kept apart: most cells end here.
        if !members.iter().any(|i| self.is_open(*i)) {
            return;
        }
        self.drop_hidden(cell, &mut members);
        let mut open = members.iter().copied().filter(|i| self.is_open(*i)).peekable();
        if open.peek().is_none() {
            return;
        }
        if levels == 0 {
            for i in open {
                let t = outlines[i as usize].triangle;
                self.left[t as usize / 64].fetch_or(1 << (t % 64), Ordering::Relaxed);
            }
            return;
        }
        drop(open);
        let [cx, cy] = cell.centre();
        let ([x0, x1], [y0, y1]) = (cell.x, cell.y);
        let quarters = [[[x0, cx], [y0, cy]], [[cx, x1], [y0, cy]], [[x0, cx], [cy, y1]], [[cx, x1], [cy, y1]]];
        let quarters = quarters.map(|[x, y]| Rect { x, y });
        if parallel > 0 {
            quarters.par_iter().for_each(|q| self.cell(q, &members, levels - 1, parallel - 1));
        } else {
            quarters.iter().for_each(|q| self.cell(q, &members, levels - 1, 0));
        }
    }

    /// Takes out what a patch over the whole cell hides.
    fn drop_hidden(&self, cell: &Rect, members: &mut Vec<u32>) {
        let outlines = self.faces.outlines;
        let centre = cell.centre();
        // Whatever covers the cell covers its centre.
        let mut seeds: Vec<(f64, u32)> = members
            .iter()
            .filter(|i| outlines[**i as usize].occluder && outlines[**i as usize].covers(centre))
            .map(|i| (outlines[*i as usize].key_at(centre)[0], *i))
            .collect();
        seeds.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut known: Vec<u32> = Vec::new();
        let (mut tries, mut successes) = (0, 0);
        for (_, seed) in seeds {
            if known.contains(&seed) {
                continue;
            }
            tries += 1;
            if let Some(patch) = self.faces.grow(seed, cell) {
                successes += 1;
                let blocker = Blocker::new(outlines, &patch, cell);
                members.retain(|i| !blocker.hides(&outlines[*i as usize], cell));
                known.extend(patch);
            }
            if tries == TRIES || successes == SUCCESSES {
                break;
            }
        }
    }
}

/// A patch over a cell, with where and how far each of its triangles lies.
struct Blocker<'a> {
    parts: Vec<(&'a Outline, Rect)>,
    /// The farthest that it gets in the cell.
    key_min: f64,
}

impl<'a> Blocker<'a> {
    fn new(outlines: &'a [Outline], patch: &[u32], cell: &Rect) -> Blocker<'a> {
        let parts: Vec<(&Outline, Rect)> =
            patch.iter().map(|i| &outlines[*i as usize]).map(|o| (o, o.rect.meet(cell))).collect();
        let key_min = parts.iter().map(|(o, r)| o.key_over(r)[0]).fold(f64::INFINITY, f64::min);
        Blocker { parts, key_min }
    }

    /// Whether all that `o` has in the cell lies certainly behind.
    fn hides(&self, o: &Outline, cell: &Rect) -> bool {
        let place = o.rect.meet(cell);
        let nearest = o.key_over(&place)[1];
        if nearest < self.key_min - BEHIND * self.key_min.abs() {
            return true;
        }
        // Part by part: only those that share a place with it can be in front of it.
        self.parts.iter().all(|(part, rect)| {
            let common = place.meet(rect);
            if common.x[0] > common.x[1] || common.y[0] > common.y[1] {
                return true;
            }
            let ([farthest, _], [low, high]) = (part.key_over(&common), o.key_over(&common));
            let size = low.abs().max(high.abs()).max(farthest.abs());
            high < farthest - BEHIND * farthest.abs() || o.lead_over(part, &common) < -BEHIND * size
        })
    }
}
