//! What a tree costs by the surface-area heuristic.

use crate::hierarchy::{Hierarchy, LANES, NONE};
use crate::math::Box32;

/// Expected work of a random line that meets the root (Goldsmith & Salmon 1987), a step
/// and a triangle costing 1 each: every node counts by its share of the root's surface,
/// an inner node 1 and a node's own entries 1 each. Without surface every share is 1.
pub fn sah_cost(h: &Hierarchy) -> f64 {
    let area = |b: &Box32| {
        let s = (b.hi - b.lo).as_dvec3();
        s.x * s.y + s.y * s.z + s.z * s.x
    };
    let nodes = || {
        h.links.iter().enumerate().flat_map(|(block, links)| {
            (0..LANES).filter(move |l| links.live >> l & 1 == 1).map(move |lane| (block, links, lane))
        })
    };
    let roots = nodes().filter(|(block, ..)| (*block as u32) < h.root_blocks);
    let whole = roots.fold(Box32::EMPTY, |b, (block, _, lane)| b.union(h.bounds[block].get(lane)));
    if whole.is_empty() {
        return 0.0;
    }
    let whole = area(&whole);
    nodes()
        .map(|(block, links, lane)| {
            let share = if whole > 0.0 { area(&h.bounds[block].get(lane)) / whole } else { 1.0 };
            let own = f64::from(links.own_end[lane] - links.first[lane]);
            share * (own + f64::from(u8::from(links.child[lane] != NONE)))
        })
        .sum()
}
