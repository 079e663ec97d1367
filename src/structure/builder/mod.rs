//! What the builders share: a tree of nodes in one array, and its flattening
//! into the 8-wide blocks of [`Hierarchy`].

pub mod axes;
pub mod cells;
pub mod collapse;
pub mod cut;
pub mod facing;
pub mod graft;
pub mod leaves;
pub mod morton;
pub mod openings;
pub mod overlap;
pub mod piece;
pub mod straddle;

use crate::hierarchy::{BoundsBlock, BuildStats, HalfSpace, Hierarchy, LANES, LinkBlock, NONE};
use crate::math::{Aabb, Box32, DVec3};
use crate::scene::Scene;
use rayon::prelude::*;

/// A node while building. Children lie side by side and after their parent, so
/// that one backward sweep over the array goes bottom-up.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// Entries of the subtree; the node's own come first, up to `own_end`.
    pub first: u32,
    pub own_end: u32,
    pub end: u32,
    pub first_child: u32,
    /// 0 for a leaf.
    pub child_count: u8,
    /// Root is 0.
    pub level: u8,
    pub bounds: Box32,
    pub half_space: Option<HalfSpace>,
}

impl Node {
    pub fn new(first: u32, end: u32, level: u8) -> Node {
        let bounds = Box32::EMPTY;
        Node { first, own_end: end, end, first_child: NONE, child_count: 0, level, bounds, half_space: None }
    }

    pub fn is_leaf(&self) -> bool {
        self.child_count == 0
    }

    pub fn children(&self) -> std::ops::Range<usize> {
        let first = if self.is_leaf() { 0 } else { self.first_child as usize };
        first..first + usize::from(self.child_count)
    }
}

/// Boxes of all triangles, in scene order.
pub fn triangle_boxes(scene: &Scene) -> Vec<Box32> {
    (0..scene.len() as u32).into_par_iter().with_min_len(4096).map(|t| scene.triangle_box(t)).collect()
}

/// [`Scene::bounds`] on all threads.
pub fn scene_bounds(scene: &Scene) -> Aabb {
    let chunk_bounds =
        |chunk: &[[u32; 3]]| Aabb::of_points(chunk.iter().flatten().map(|v| &scene.positions[*v as usize]));
    scene.triangles.par_chunks(1 << 14).map(chunk_bounds).reduce(|| Aabb::EMPTY, Aabb::union)
}

/// Runs `f` on every node that owns entries, with its slice of `column`, and
/// stores the box that `f` returns as the node's bounds so far.
pub fn visit_owners<T: Send>(nodes: &mut [Node], column: &mut [T], f: impl Fn(&mut [T]) -> Box32 + Sync + Send) {
    let mut owners: Vec<u32> =
        (0..nodes.len() as u32).filter(|i| nodes[*i as usize].own_end > nodes[*i as usize].first).collect();
    owners.sort_unstable_by_key(|i| nodes[*i as usize].first);
    let mut rest = column;
    let mut at = 0;
    let mut slices = Vec::with_capacity(owners.len());
    for &i in &owners {
        let node = &nodes[i as usize];
        let (_, tail) = rest.split_at_mut((node.first - at) as usize);
        let (own, tail) = tail.split_at_mut((node.own_end - node.first) as usize);
        slices.push(own);
        rest = tail;
        at = node.own_end;
    }
    let boxes: Vec<Box32> = slices.into_par_iter().with_min_len(16).map(f).collect();
    for (i, b) in owners.into_iter().zip(boxes) {
        nodes[i as usize].bounds = b;
    }
}

/// Grows every inner node to its children, bottom-up.
pub fn pull_up_bounds(nodes: &mut [Node]) {
    for i in (0..nodes.len()).rev() {
        let below = nodes[i].children().fold(nodes[i].bounds, |b, c| b.union(nodes[c].bounds));
        nodes[i].bounds = below;
    }
}

/// Sorts triangles by material, ties by number: fewest draw calls, one possible order.
pub fn sort_by_material(triangles: &mut [u32], scene: &Scene) {
    // Fetched once each into words that compare in registers.
    let mut keys: Vec<u64> =
        triangles.iter().map(|t| u64::from(scene.material_id[*t as usize]) << 32 | u64::from(*t)).collect();
    if !keys.is_sorted() {
        keys.sort_unstable();
        triangles.iter_mut().zip(keys).for_each(|(t, key)| *t = key as u32);
    }
}

/// Counts of the tree in the paper's terms.
pub fn stats(nodes: &[Node], leaf_limit: u64) -> BuildStats {
    let mut s = BuildStats { nodes: nodes.len() as u64, ..Default::default() };
    for leaf in nodes.iter().filter(|n| n.is_leaf()) {
        let size = u64::from(leaf.end - leaf.first);
        s.leaves += 1;
        s.depth = s.depth.max(u64::from(leaf.level));
        s.largest_leaf = s.largest_leaf.max(size);
        s.oversized_leaves += u64::from(leaf_limit > 0 && size > leaf_limit);
    }
    s
}

/// [`flatten_forest`] of the tree whose root is `nodes[0]`.
pub fn flatten(scene: &Scene, nodes: &[Node], entries: Vec<u32>, fragments: Option<Vec<[DVec3; 3]>>) -> Hierarchy {
    flatten_forest(scene, nodes, nodes.len().min(1), entries, fragments)
}

/// Writes trees as blocks of siblings. Blocks of roots come first, eight roots each,
/// then all others in depth-first order, the order in which a walk reads them.
/// `nodes[..roots]` are the roots, in the order of their entries; every node has bounds.
pub fn flatten_forest(
    scene: &Scene,
    nodes: &[Node],
    roots: usize,
    entries: Vec<u32>,
    fragments: Option<Vec<[DVec3; 3]>>,
) -> Hierarchy {
    let mut h = Hierarchy { origin: scene.origin, entries, fragments, ..Default::default() };
    h.number_material_runs(scene);
    h.root_blocks = roots.div_ceil(LANES) as u32;
    let with_planes = nodes.iter().any(|n| n.half_space.is_some());
    let mut planes = Vec::new();
    let blocks = h.root_blocks as usize + nodes.iter().filter(|n| !n.is_leaf()).count();
    h.bounds.reserve_exact(blocks);
    h.links.reserve_exact(blocks);
    h.parent.reserve_exact(blocks);
    let groups: Vec<_> = (0..roots).step_by(LANES).map(|i| i..(i + LANES).min(roots)).collect();
    let mut write = |group: std::ops::Range<usize>, parent: u32, pending: &mut Vec<(std::ops::Range<usize>, u32)>| {
        let block = h.links.len();
        let (mut bounds, mut links) = (BoundsBlock::EMPTY, LinkBlock::EMPTY);
        debug_assert!(group.len() <= LANES, "a group is one block");
        links.live = ((1u16 << group.len()) - 1) as u8;
        for (lane, node) in nodes[group.clone()].iter().enumerate() {
            bounds.set(lane, node.bounds);
            links.first[lane] = node.first;
            links.own_end[lane] = node.own_end;
            links.end[lane] = node.end;
        }
        if with_planes {
            planes.extend((0..LANES).map(|lane| nodes[group.clone()].get(lane).and_then(|n| n.half_space)));
        }
        if parent != NONE {
            h.links[parent as usize / LANES].child[parent as usize % LANES] = block as u32;
        }
        h.bounds.push(bounds);
        h.links.push(links);
        h.parent.push(parent);
        // Last child first on the stack, so that the first one is written next.
        for (lane, node) in nodes[group].iter().enumerate().rev() {
            if !node.is_leaf() {
                pending.push((node.children(), (block * LANES + lane) as u32));
            }
        }
    };
    // Node range of a group of siblings, and the flat name of its parent.
    let mut below: Vec<Vec<_>> = Vec::with_capacity(groups.len());
    for group in groups {
        let mut pending = Vec::new();
        write(group, NONE, &mut pending);
        below.push(pending);
    }
    for mut pending in below {
        while let Some((group, parent)) = pending.pop() {
            write(group, parent, &mut pending);
        }
    }
    h.half_spaces = with_planes.then_some(planes);
    h
}
