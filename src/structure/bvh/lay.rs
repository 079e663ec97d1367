//! The tree written as blocks of the flat layout, straight from its slim nodes: what
//! [`tree::nodes`](super::tree::nodes), `builder::collapse` and `builder::flatten` do
//! together (its twin), without the arrays of full nodes between them.

use super::tree::Slim;
use crate::hierarchy::{BoundsBlock, BuildStats, Hierarchy, LANES, LinkBlock, NONE};
use crate::math::Box32;
use crate::scene::Scene;
use crate::structure::builder::collapse::{Binary, Family};

impl Binary for [Slim] {
    fn children(&self, i: usize) -> std::ops::Range<usize> {
        let first = self[i].first as usize;
        if self[i].count == 0 { first..first + 2 } else { 0..0 }
    }

    fn bounds(&self, i: usize) -> Box32 {
        self[i].bounds
    }
}

/// Blocks of up to `width` siblings, 2 or 8, in depth-first order.
pub fn lay(scene: &Scene, tree: &[Slim], entries: Vec<u32>, width: usize, leaf_limit: u32) -> Hierarchy {
    let mut h = Hierarchy { origin: scene.origin, entries, ..Hierarchy::default() };
    h.number_material_runs(scene);
    if tree.is_empty() {
        return h;
    }
    let ranges = ranges(tree);
    h.stats = stats(tree, leaf_limit);
    h.root_blocks = 1;
    let mut pending = Vec::new();
    let mut write = |family: &[u32], parent: u32, pending: &mut Vec<(u32, u32)>| {
        let block = h.links.len();
        let (mut bounds, mut links) = (BoundsBlock::EMPTY, LinkBlock::EMPTY);
        links.live = ((1u16 << family.len()) - 1) as u8;
        for (lane, i) in family.iter().enumerate() {
            let (node, (first, end)) = (&tree[*i as usize], ranges[*i as usize]);
            bounds.set(lane, node.bounds);
            links.first[lane] = first;
            links.own_end[lane] = if node.count == 0 { first } else { end };
            links.end[lane] = end;
        }
        if parent != NONE {
            h.links[parent as usize / LANES].child[parent as usize % LANES] = block as u32;
        }
        h.bounds.push(bounds);
        h.links.push(links);
        h.parent.push(parent);
        for (lane, i) in family.iter().enumerate().rev().filter(|(_, i)| tree[**i as usize].count == 0) {
            pending.push((*i, (block * LANES + lane) as u32));
        }
    };
    write(&[0], NONE, &mut pending);
    while let Some((i, parent)) = pending.pop() {
        write(Family::of(tree, i as usize, width).members(), parent, &mut pending);
    }
    h
}

/// First entry and end of every subtree.
fn ranges(tree: &[Slim]) -> Vec<(u32, u32)> {
    let mut ranges = vec![(0, 0); tree.len()];
    for (i, s) in tree.iter().enumerate().rev() {
        let child = s.first as usize;
        ranges[i] = match s.count {
            0 => (ranges[child].0, ranges[child + 1].1),
            count => (s.first, s.first + count),
        };
    }
    ranges
}

fn stats(tree: &[Slim], leaf_limit: u32) -> BuildStats {
    let mut levels = vec![0u8; tree.len()];
    let mut s = BuildStats { nodes: tree.len() as u64, ..BuildStats::default() };
    for (i, node) in tree.iter().enumerate() {
        if node.count == 0 {
            let below = levels[i] + 1;
            levels[node.first as usize..][..2].fill(below);
            continue;
        }
        s.leaves += 1;
        s.depth = s.depth.max(u64::from(levels[i]));
        s.largest_leaf = s.largest_leaf.max(u64::from(node.count));
        s.oversized_leaves += u64::from(node.count > leaf_limit);
    }
    s
}
