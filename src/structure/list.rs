//! Flat list of clusters: no hierarchy, every cluster is asked about in every frame.
//!
//! Triangles in Morton order of their centroids (63-bit codes, f64) are cut
//! into clusters of `leaf_size`; a cluster is a root lane with exact bounds,
//! rounded outward. The baseline that a tree has to beat: Assarsson & Möller
//! (2000) and after them every study of culling compare with it. Conservative:
//! a cluster's box contains its triangles.

use super::Structure;
use super::builder::{self, morton};
use crate::error::Result;
use crate::hierarchy::{BoundsBlock, BuildStats, Hierarchy, LANES, LinkBlock, NONE};
use crate::math::{Aabb, Box32, DVec3};
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;
use rayon::prelude::*;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "list",
    about: "flat clusters of triangles in Morton order",
    revision: 1,
    params: &[Param {
        name: "leaf_size",
        default: Default::Int { value: 64, min: 1, max: 65_536 },
        about: "triangles a cluster",
    }],
    make: |spec| Box::new(List { leaf_size: spec.int("leaf_size") as u32 }),
};

#[derive(Debug, Clone, Copy)]
pub struct List {
    pub leaf_size: u32,
}

impl Structure for List {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        let lattice = morton::Lattice::new(&builder::scene_bounds(scene), 21);
        // Boxes in scene order: reading them through the sorted numbers misses
        // one cache line a triangle, its corners would miss four.
        let (keyed, boxes): (Vec<(u64, u32)>, Vec<Box32>) = (0..scene.len() as u32)
            .into_par_iter()
            .with_min_len(4096)
            .map(|t| {
                let [a, b, c] = scene.corners(t);
                let bounds = Aabb { lo: a.min(b).min(c), hi: a.max(b).max(c) };
                ((lattice.code((a + b + c) / 3.0), t), bounds.relative_to(scene.origin))
            })
            .unzip();
        let sorted = morton::radix_sort(keyed, 63, |k| k.0);
        let mut entries: Vec<u32> = sorted.into_iter().map(|k| k.1).collect();
        let size = self.leaf_size as usize;
        let clusters: Vec<Box32> = entries
            .par_chunks_mut(size)
            .with_min_len(64)
            .map(|cluster| {
                let material = |t: &u32| scene.material_id[*t as usize];
                // Stable: Morton order stays inside each material.
                if !cluster.is_sorted_by_key(material) {
                    cluster.sort_by_key(material);
                }
                cluster.iter().fold(Box32::EMPTY, |b, t| b.union(boxes[*t as usize]))
            })
            .collect();
        let mut h = of_clusters(&clusters, size, entries, scene.origin);
        h.number_material_runs(scene);
        Ok(h)
    }
}

/// A list of bare boxes, each its own cluster with one entry, in the order given
/// and relative to the origin `0`: for measuring tests without a scene.
pub fn from_boxes(boxes: &[Box32]) -> Hierarchy {
    let mut h = of_clusters(boxes, 1, (0..boxes.len() as u32).collect(), DVec3::ZERO);
    h.material_run = vec![0; boxes.len()];
    h
}

/// Root blocks over clusters of `size` entries each (the last may have fewer).
fn of_clusters(boxes: &[Box32], size: usize, entries: Vec<u32>, origin: DVec3) -> Hierarchy {
    let mut h = Hierarchy { origin, ..Hierarchy::default() };
    for (block, group) in boxes.chunks(LANES).enumerate() {
        let (mut bounds, mut links) = (BoundsBlock::EMPTY, LinkBlock::EMPTY);
        links.live = ((1u16 << group.len()) - 1) as u8;
        for (lane, b) in group.iter().enumerate() {
            let first = (block * LANES + lane) * size;
            let end = (first + size).min(entries.len()) as u32;
            bounds.set(lane, *b);
            links.first[lane] = first as u32;
            links.own_end[lane] = end;
            links.end[lane] = end;
        }
        h.bounds.push(bounds);
        h.links.push(links);
    }
    h.parent = vec![NONE; h.links.len()];
    h.root_blocks = h.links.len() as u32;
    let clusters = boxes.len() as u64;
    h.stats = BuildStats {
        nodes: clusters,
        leaves: clusters,
        largest_leaf: size.min(entries.len()) as u64,
        ..BuildStats::default()
    };
    h.entries = entries;
    h
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn bare_boxes_keep_their_order_and_their_bounds() {
        let boxes: Vec<Box32> =
            (0..11).map(|i| Box32 { lo: Vec3::splat(i as f32), hi: Vec3::splat(i as f32 + 0.5) }).collect();
        let h = from_boxes(&boxes);
        assert_eq!((h.root_blocks, h.node_count()), (2, 11));
        for (i, b) in boxes.iter().enumerate() {
            assert_eq!(h.bounds[i / LANES].get(i % LANES), *b);
            assert_eq!(
                (h.links[i / LANES].first[i % LANES], h.links[i / LANES].end[i % LANES]),
                (i as u32, i as u32 + 1)
            );
        }
        assert_eq!(h.links[1].live, 0b111);
        assert_eq!(from_boxes(&[]).root_blocks, 0);
    }
}
