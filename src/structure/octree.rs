//! Octree of fixed depth (Serpa & Rodrigues 2014; Meagher 1982 for the idea).
//!
//! Every non-empty node is divided down to `depth`, counted from root 0: depth
//! 4 has at most 4096 leaves and 4681 nodes. Empty subtrees are pruned.
//! What happens to a triangle that straddles cells is the `policy`, which the
//! paper does not state although it changes every count:
//! - `L`: by centroid, bounds grown to the members (loose boxes, each triangle once);
//! - `E`: in the smallest node whose cell encloses it (each triangle once);
//! - `R`: a copy in every leaf it overlaps, by a separating-axis test (see [`cut`]);
//! - `S`: split at the planes of the cells (see [`cut`]).
//!
//! L and E sort Morton codes, so that the descendants of every node are
//! contiguous (Lauterbach et al. 2009 build BVHs that way). All four are
//! conservative: a box contains its own entries and children; under R, the
//! parts of its triangles that lie in its cell, which together are the triangle.

use super::Structure;
use super::builder::morton::{Lattice, interleave, radix_sort};
use super::builder::{self, Node, cut, facing};
use crate::error::Result;
use crate::hierarchy::Hierarchy;
use crate::math::{Aabb, Box32, DVec3};
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;
use rayon::prelude::*;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "octree",
    about: "octree of fixed depth",
    revision: 1,
    params: &[
        Param {
            name: "depth",
            default: Default::Int { value: 4, min: 0, max: MAX_DEPTH },
            about: "levels below the root",
        },
        Param {
            name: "policy",
            default: Default::Choice(&["L", "R", "S", "E"]),
            about: "straddling triangles: L by centroid with grown boxes, R replicated, S split, E in the smallest enclosing node",
        },
        Param {
            name: "root",
            default: Default::Choice(&["aabb", "cube"]),
            about: "root cell: the scene's box, or a cube around it",
        },
        Param {
            name: "leaf_limit",
            default: Default::Int { value: 0, min: 0, max: 1 << 30 },
            about: "nodes with at most so many triangles are not divided; 0 always divides down to the depth",
        },
        Param {
            name: "leaves",
            // Leaves of whole triangles, each in one of them.
            default: Default::Only {
                with: "policy",
                is: &["L", "E"],
                of: &Default::Later(&Default::Choice(&["whole", "facing"])),
            },
            about: "facing: divided once more, by where their triangles face (policies L and E)",
        },
    ],
    make: |spec| {
        let policy = match spec.text("policy") {
            "R" => Policy::Replicate,
            "S" => Policy::Split,
            "E" => Policy::Enclose,
            _ => Policy::Loose,
        };
        Box::new(Octree {
            depth: spec.int("depth") as u32,
            policy,
            cube: spec.text("root") == "cube",
            leaf_limit: spec.int("leaf_limit") as u32,
            by_facing: spec.text("leaves") == "facing",
        })
    },
};

/// 3 bits a level and 4 bits for the level itself fit a key beside the triangle.
const MAX_DEPTH: i64 = 10;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Policy {
    Loose,
    Replicate,
    Split,
    Enclose,
}

#[derive(Debug, Clone, Copy)]
pub struct Octree {
    pub depth: u32,
    pub policy: Policy,
    /// Root cell is a cube with the centre of the scene's box.
    pub cube: bool,
    /// 0: divide down to `depth`.
    pub leaf_limit: u32,
    /// Leaves are divided once more, by facing (see [`facing`]).
    pub by_facing: bool,
}

impl Structure for Octree {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        let root = self.root_cell(scene);
        match self.policy {
            Policy::Loose => Ok(self.build_loose(scene, &root)),
            Policy::Enclose => Ok(self.build_enclosing(scene, &root)),
            Policy::Replicate => cut::build_replicated(scene, &root, self.depth, self.leaf_limit),
            Policy::Split => cut::build_split(scene, &root, self.depth, self.leaf_limit),
        }
    }
}

impl Octree {
    /// The root cell. A flat axis gets the thickness of the largest one, so that
    /// a scene in a plane lies in one layer of cells and not in every layer.
    pub fn root_cell(&self, scene: &Scene) -> Aabb {
        let mut cell = builder::scene_bounds(scene);
        if cell.is_empty() {
            return Aabb { lo: DVec3::ZERO, hi: DVec3::ONE };
        }
        let side = cell.size().max_element();
        if self.cube {
            let centre = cell.centre();
            let half = DVec3::splat(side * 0.5);
            // Rounding of the centre must not leave a corner of the scene outside.
            cell = cell.union(Aabb { lo: centre - half, hi: centre + half });
        }
        let side = if side > 0.0 { side } else { 1.0 };
        for axis in 0..3 {
            if cell.hi[axis] <= cell.lo[axis] {
                cell.hi[axis] = cell.lo[axis] + side;
            }
        }
        cell
    }

    fn build_loose(&self, scene: &Scene, root: &Aabb) -> Hierarchy {
        let lattice = Lattice::new(root, self.depth);
        // Code and triangle in one word: half the memory traffic of a pair.
        let (keyed, boxes): (Vec<u64>, Vec<Box32>) = (0..scene.len() as u32)
            .into_par_iter()
            .with_min_len(4096)
            .map(|t| {
                let [a, b, c] = scene.corners(t);
                let code = lattice.code((a + b + c) / 3.0);
                (code << 32 | u64::from(t), Aabb { lo: a.min(b).min(c), hi: a.max(b).max(c) }.relative_to(scene.origin))
            })
            .unzip();
        let sorted = radix_sort(keyed, 3 * self.depth, |k| k >> 32);
        let nodes = self.divide(sorted.len(), |i| (sorted[i] >> 32, self.depth));
        self.finish(scene, nodes, sorted.iter().map(|k| *k as u32).collect(), &boxes)
    }

    fn build_enclosing(&self, scene: &Scene, root: &Aabb) -> Hierarchy {
        let lattice = Lattice::new(root, self.depth);
        let boxes = builder::triangle_boxes(scene);
        let keyed: Vec<(u64, u32)> = (0..scene.len() as u32)
            .into_par_iter()
            .with_min_len(4096)
            .map(|t| {
                let aabb = scene.triangle_aabb(t);
                let (lo, hi) = (lattice.cell(aabb.lo), lattice.cell(aabb.hi));
                // Highest bit in which the two corner cells differ, over all axes.
                let differ = (lo[0] ^ hi[0]) | (lo[1] ^ hi[1]) | (lo[2] ^ hi[2]);
                let up = 32 - differ.leading_zeros();
                let code = interleave(lo) >> (3 * up) << (3 * up);
                // The level in the low bits puts a node's own entries before its children's.
                (code << 4 | u64::from(self.depth - up), t)
            })
            .collect();
        let sorted = radix_sort(keyed, 3 * self.depth + 4, |k| k.0);
        let nodes = self.divide(sorted.len(), |i| (sorted[i].0 >> 4, sorted[i].0 as u32 & 15));
        self.finish(scene, nodes, sorted.iter().map(|k| k.1).collect(), &boxes)
    }

    /// Nodes over `count` sorted entries; `key(i)` is the Morton code at full
    /// depth and the level at which entry `i` wants to stay.
    fn divide(&self, count: usize, key: impl Fn(usize) -> (u64, u32)) -> Vec<Node> {
        let mut nodes = Vec::new();
        if count == 0 {
            return nodes;
        }
        nodes.push(Node::new(0, count as u32, 0));
        let mut at = 0;
        // The array is its own queue: breadth-first, children side by side.
        while at < nodes.len() {
            let Node { first, end, level, .. } = nodes[at];
            let level = u32::from(level);
            if level < self.depth && end - first > self.leaf_limit {
                let own_end = upper(first, end, |i| key(i).1 <= level);
                let shift = 3 * (self.depth - level - 1);
                let first_child = nodes.len();
                let mut from = own_end;
                while from < end {
                    let octant = key(from as usize).0 >> shift;
                    let to = upper(from, end, |i| key(i).0 >> shift == octant);
                    nodes.push(Node::new(from, to, level as u8 + 1));
                    from = to;
                }
                let count = (nodes.len() - first_child) as u8;
                let node = &mut nodes[at];
                node.own_end = own_end;
                node.child_count = count;
                node.first_child = first_child as u32;
            }
            at += 1;
        }
        nodes
    }

    fn finish(&self, scene: &Scene, mut nodes: Vec<Node>, mut entries: Vec<u32>, boxes: &[Box32]) -> Hierarchy {
        let limit = if self.by_facing { 0 } else { u64::from(self.leaf_limit) };
        if self.by_facing {
            facing::split_leaves(scene, &mut nodes, &mut entries);
        }
        builder::visit_owners(&mut nodes, &mut entries, |own| {
            builder::sort_by_material(own, scene);
            own.iter().fold(Box32::EMPTY, |b, t| b.union(boxes[*t as usize]))
        });
        builder::pull_up_bounds(&mut nodes);
        let mut h = builder::flatten(scene, &nodes, entries, None);
        h.stats = builder::stats(&nodes, limit);
        h
    }
}

/// First index of `first..end` for which `below` fails; `below` holds on a prefix.
fn upper(first: u32, end: u32, below: impl Fn(usize) -> bool) -> u32 {
    let (mut lo, mut hi) = (first, end);
    while lo < hi {
        let mid = lo + (hi - lo) / 2;
        if below(mid as usize) { lo = mid + 1 } else { hi = mid }
    }
    lo
}
