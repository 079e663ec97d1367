//! Hybrid: a shallow octree with another tree inside each dense leaf, the future work
//! that Serpa & Rodrigues (2014) name.
//!
//! The octree (policy L: each triangle by its centroid, grown boxes) divides space where
//! the scene is wide; a leaf with more than `dense` triangles is the root of a `bvh`, a
//! `kd_tree` or a `bsp` over its own triangles, which follows what is there. Our reading:
//! the inner tree takes the leaf's place, so that nothing stands twice.
//! Conservative, as both parts are.

use super::Structure;
use super::builder::graft::{Scion, graft};
use super::octree::{Octree, Policy};
use crate::error::Result;
use crate::hierarchy::{Hierarchy, LANES, NONE};
use crate::registry::{Default, Entry, Param, Spec, Value};
use crate::scene::Scene;
use rayon::prelude::*;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "hybrid",
    about: "a shallow octree, and another tree inside each dense leaf",
    revision: 1,
    params: &[
        Param {
            name: "depth",
            default: Default::Int { value: 2, min: 0, max: 8 },
            about: "levels of the octree below its root",
        },
        Param {
            name: "dense",
            default: Default::Int { value: 256, min: 1, max: 1 << 30 },
            about: "leaves of the octree with more triangles hold a tree of their own",
        },
        Param {
            name: "inner",
            default: Default::Choice(&["bvh", "kd_tree", "bsp"]),
            about: "what that tree is, with its own defaults",
        },
        Param {
            name: "leaf_size",
            default: Default::Int { value: 64, min: 1, max: 65_536 },
            about: "triangles in a leaf of the inner tree",
        },
    ],
    make: |spec| {
        let inner = spec.text("inner");
        let size = if inner == "bsp" { "min_leaf" } else { "leaf_size" };
        Box::new(Hybrid {
            depth: spec.int("depth") as u32,
            dense: spec.int("dense") as u32,
            inner: Spec::new(inner).with(size, Value::Int(spec.int("leaf_size"))),
        })
    },
};

#[derive(Debug, Clone)]
pub struct Hybrid {
    pub depth: u32,
    pub dense: u32,
    /// A structure with one root.
    pub inner: Spec,
}

impl Structure for Hybrid {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        let outer = Octree { depth: self.depth, policy: Policy::Loose, cube: false, leaf_limit: 0, by_facing: false };
        let stock = outer.build(scene)?;
        let (inner, _) = super::make(&self.inner)?;
        let scions: Result<Vec<Scion>> = dense_leaves(&stock, self.dense)
            .into_par_iter()
            .map(|leaf| {
                let (links, lane) = (&stock.links[leaf as usize / LANES], leaf as usize % LANES);
                let own = &stock.entries[links.first[lane] as usize..links.end[lane] as usize];
                let mut tree = inner.build(&scene.part(own))?;
                tree.entries.iter_mut().for_each(|t| *t = own[*t as usize]);
                Ok(Scion { leaf, tree })
            })
            .collect();
        Ok(graft(scene, &stock, scions?))
    }
}

/// Leaves with more than `dense` entries, in the order of entries.
fn dense_leaves(h: &Hierarchy, dense: u32) -> Vec<u32> {
    let mut found: Vec<(u32, u32)> = Vec::new();
    for (block, links) in h.links.iter().enumerate() {
        for lane in (0..LANES).filter(|l| links.live >> l & 1 == 1 && links.child[*l] == NONE) {
            if links.end[lane] - links.first[lane] > dense {
                found.push((links.first[lane], (block * LANES + lane) as u32));
            }
        }
    }
    found.sort_unstable();
    found.into_iter().map(|f| f.1).collect()
}
