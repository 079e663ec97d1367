//! The tree written as blocks of the flat layout, straight from its slim nodes: what
//! [`tree::nodes`](super::tree::nodes), `builder::collapse` and `builder::flatten` do
//! together (its twin), without the arrays of full nodes between them.

use super::pages;
use super::tree::Slim;
use crate::hierarchy::{BoundsBlock, BuildStats, Hierarchy, LANES, LinkBlock, NONE};
use crate::math::Box32;
use crate::scene::Scene;
use crate::structure::builder::collapse::{Binary, Family};

impl Binary for [Slim] {
    fn children(&self, i: usize) -> std::ops::Range<usize> {
        let first = self[i].child as usize;
        if self[i].is_leaf() { 0..0 } else { first..first + 2 }
    }

    fn bounds(&self, i: usize) -> Box32 {
        self[i].bounds
    }
}

/// A family of siblings to write: the node above them, where that was written, and the
/// first entry below it.
struct Pending {
    node: u32,
    parent: u32,
    first: u32,
}

/// Blocks of up to `width` siblings, 2 or 8, in depth-first order. `sealed` are the keys of
/// the records (see `Record::key`), leaf by leaf.
pub fn lay(scene: &Scene, tree: &[Slim], sealed: &[u64], width: usize, leaf_limit: u32) -> Hierarchy {
    let mut h = Hierarchy { origin: scene.origin, ..Hierarchy::default() };
    (h.entries, h.material_run) = entries(sealed);
    if tree.is_empty() {
        return h;
    }
    h.stats = stats(tree, leaf_limit);
    h.root_blocks = 1;
    // A block each for the root and for every inner node that keeps its own.
    let likely = if width == 2 { tree.len() / 2 + 1 } else { tree.len() / 6 + 2 };
    (h.bounds, h.links) = (pages::with_capacity(likely), pages::with_capacity(likely));
    h.parent.reserve(likely);
    let mut pending = Vec::new();
    write(&mut h, tree, &[0], Pending { node: NONE, parent: NONE, first: 0 }, &mut pending);
    while let Some(p) = pending.pop() {
        write(&mut h, tree, Family::of(tree, p.node as usize, width).members(), p, &mut pending);
    }
    h
}

/// Appends the block of a family, and what is to be written below it to `pending`.
fn write(h: &mut Hierarchy, tree: &[Slim], family: &[u32], above: Pending, pending: &mut Vec<Pending>) {
    let block = h.links.len();
    if above.parent != NONE {
        h.links[above.parent as usize / LANES].child[above.parent as usize % LANES] = block as u32;
    }
    h.parent.push(above.parent);
    h.bounds.push(BoundsBlock::EMPTY);
    h.links.push(LinkBlock::EMPTY);
    let (bounds, links) = (&mut h.bounds[block], &mut h.links[block]);
    links.live = ((1u16 << family.len()) - 1) as u8;
    let mut first = above.first;
    for (lane, i) in family.iter().enumerate() {
        let node = &tree[*i as usize];
        let end = first + node.count;
        bounds.set(lane, node.bounds);
        links.first[lane] = first;
        links.own_end[lane] = if node.is_leaf() { end } else { first };
        links.end[lane] = end;
        first = end;
    }
    // The last one first, so that the first one is written next.
    for (lane, i) in family.iter().enumerate().rev().filter(|(_, i)| !tree[**i as usize].is_leaf()) {
        pending.push(Pending { node: *i, parent: (block * LANES + lane) as u32, first: links.first[lane] });
    }
}

/// The triangles of all leaves, and the number of the material run of each.
fn entries(sealed: &[u64]) -> (Vec<u32>, Vec<u32>) {
    let (mut entries, mut runs) = (pages::with_capacity(sealed.len()), pages::with_capacity(sealed.len()));
    entries.extend(sealed.iter().map(|key| *key as u32));
    let mut run = 0;
    let mut last = sealed.first().map_or(0, |key| key >> 32);
    runs.extend(sealed.iter().map(|key| {
        run += u32::from(key >> 32 != last);
        last = key >> 32;
        run
    }));
    (entries, runs)
}

fn stats(tree: &[Slim], leaf_limit: u32) -> BuildStats {
    let mut levels = vec![0u8; tree.len()];
    let mut s = BuildStats { nodes: tree.len() as u64, ..BuildStats::default() };
    for (i, node) in tree.iter().enumerate() {
        if !node.is_leaf() {
            let below = levels[i] + 1;
            levels[node.child as usize..][..2].fill(below);
            continue;
        }
        s.leaves += 1;
        s.depth = s.depth.max(u64::from(levels[i]));
        s.largest_leaf = s.largest_leaf.max(u64::from(node.count));
        s.oversized_leaves += u64::from(node.count > leaf_limit);
    }
    s
}
