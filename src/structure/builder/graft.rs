//! Grafting: leaves of one hierarchy replaced by whole hierarchies over their triangles.

use crate::hierarchy::{Hierarchy, LANES, NONE};
use crate::math::DVec3;
use crate::scene::Scene;

/// A hierarchy to stand in place of a leaf; its entries are triangles of the whole
/// scene, all of the leaf's and no others, and it has one root.
#[derive(Debug)]
pub struct Scion {
    /// `block * 8 + lane` of the leaf.
    pub leaf: u32,
    pub tree: Hierarchy,
}

/// `stock` with every scion in its leaf's place; `scions` in the order of the leaves'
/// entries. Material runs are numbered anew; half-spaces are left out.
pub fn graft(scene: &Scene, stock: &Hierarchy, scions: Vec<Scion>) -> Hierarchy {
    let mut h =
        Hierarchy { origin: stock.origin, root_blocks: stock.root_blocks, stats: stock.stats, ..Default::default() };
    h.bounds.clone_from(&stock.bounds);
    h.links.clone_from(&stock.links);
    h.parent.clone_from(&stock.parent);
    let split = stock.fragments.is_some() || scions.iter().any(|s| s.tree.fragments.is_some());
    let mut fragments: Vec<[DVec3; 3]> = Vec::new();

    // Entries first: where each range of the stock's begins now. Only ends of ranges are
    // looked up, and none lies inside a replaced leaf.
    let mut moved = vec![0u32; stock.entries.len() + 1];
    let mut at = 0usize;
    let keep = |to: usize, at: &mut usize, h: &mut Hierarchy, moved: &mut [u32], fragments: &mut Vec<[DVec3; 3]>| {
        let new = h.entries.len() as u32..;
        moved[*at..to].iter_mut().zip(new).for_each(|(m, new)| *m = new);
        h.entries.extend_from_slice(&stock.entries[*at..to]);
        if split {
            fragments.extend((*at..to).map(|position| stock.piece(scene, position as u32)));
        }
        *at = to;
    };
    for s in &scions {
        let (links, lane) = (&stock.links[s.leaf as usize / LANES], s.leaf as usize % LANES);
        keep(links.first[lane] as usize, &mut at, &mut h, &mut moved, &mut fragments);
        moved[at] = h.entries.len() as u32;
        h.entries.extend_from_slice(&s.tree.entries);
        if split {
            fragments.extend((0..s.tree.entries.len() as u32).map(|p| s.tree.piece(scene, p)));
        }
        at = links.end[lane] as usize;
    }
    keep(stock.entries.len(), &mut at, &mut h, &mut moved, &mut fragments);
    moved[at] = h.entries.len() as u32;
    for links in &mut h.links {
        for column in [&mut links.first, &mut links.own_end, &mut links.end] {
            column.iter_mut().for_each(|p| *p = moved[*p as usize]);
        }
    }

    let stock_levels = stock.stats.depth;
    for Scion { leaf, tree } in scions {
        let (block, lane) = (leaf as usize / LANES, leaf as usize % LANES);
        let base = h.links[block].first[lane];
        // The leaf is the scion's root itself: its block is left out.
        let shift = h.links.len() as u32 - 1;
        let renamed = |child: u32| if child == NONE { NONE } else { child + shift };
        h.links[block].child[lane] = renamed(tree.links[0].child[0]);
        h.links[block].own_end[lane] = base + tree.links[0].own_end[0];
        for (links, parent) in tree.links[1..].iter().zip(&tree.parent[1..]) {
            let mut links = *links;
            links.child.iter_mut().for_each(|c| *c = renamed(*c));
            for column in [&mut links.first, &mut links.own_end, &mut links.end] {
                column.iter_mut().take(links.live.count_ones() as usize).for_each(|p| *p += base);
            }
            h.links.push(links);
            h.parent.push(if *parent == 0 { leaf } else { parent + shift * LANES as u32 });
        }
        h.bounds.extend_from_slice(&tree.bounds[1..]);
        let (all, own) = (&mut h.stats, &tree.stats);
        all.nodes += own.nodes - 1;
        all.leaves += own.leaves - 1;
        all.depth = all.depth.max(stock_levels + own.depth);
        all.oversized_leaves += own.oversized_leaves;
    }
    h.stats.largest_leaf = leaf_sizes(&h).max().unwrap_or(0);
    h.fragments = split.then_some(fragments);
    h.number_material_runs(scene);
    h
}

fn leaf_sizes(h: &Hierarchy) -> impl Iterator<Item = u64> {
    h.links.iter().flat_map(|links| {
        let leaf = move |l: &usize| links.live >> l & 1 == 1 && links.child[*l] == NONE;
        (0..LANES).filter(leaf).map(move |l| u64::from(links.end[l] - links.first[l]))
    })
}
