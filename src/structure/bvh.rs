//! Bounding volume hierarchy: a binary tree over the triangles themselves, each in one
//! leaf, whose boxes may overlap. The modern measure for every claim about octrees and BSPs.
//!
//! How a node is divided is `split`:
//! - `sah`: by the surface-area heuristic (Goldsmith & Salmon 1987) over bins of centroids
//!   (Wald 2007; of the boxes, here and under `median`), 16 an axis, the costs of a step and of a triangle both 1. Our bins span
//!   what the parent's bins leave of the node's box instead of the exact range of its
//!   centroids; so the pass that divides a node fills the bins of its children ([`grow`]).
//!   Nodes of up to eight triangles are divided by the exact sweep ([`sweep`]).
//! - `median`: at the median centroid of the longest axis.
//! - `morton`: where the highest bit of the Morton codes changes (Lauterbach et al. 2009),
//!   63-bit codes on an f64 lattice ([`linear`]).
//!
//! With `stop=size` a node is a leaf iff it has at most `leaf_size` triangles; with
//! `stop=cost` such a node is still divided while that lowers its cost. Nodes that no
//! plane divides (coincident centroids, boxes without surface) or that lie below 64
//! greedy levels are halved by count.
//!
//! Conservative: a node's box is the union of its triangles' boxes, f32 offsets rounded
//! outward. The tree does not depend on threads or kernels.

#[cfg(target_arch = "x86_64")]
mod best_x86;
mod bins;
#[cfg(target_arch = "x86_64")]
mod bins_x86;
mod cost;
mod grow;
mod kernel;
mod lay;
mod linear;
mod pages;
mod record;
#[cfg(target_arch = "x86_64")]
mod record_x86;
mod sides;
#[cfg(target_arch = "x86_64")]
mod sides_x86;
mod small;
mod sweep;
#[cfg(target_arch = "x86_64")]
mod sweep_x86;
#[cfg(test)]
mod tests;
mod tree;

use super::Structure;
use crate::error::Result;
use crate::hierarchy::{Hierarchy, LANES};
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;
pub use cost::sah_cost;
use grow::Grow;
pub use kernel::Kernel;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "bvh",
    about: "bounding volume hierarchy, each triangle once, boxes may overlap",
    revision: 1,
    params: &[
        Param {
            name: "split",
            default: Default::Choice(&["sah", "median", "morton"]),
            about: "planes: sah by binned surface areas; median of the centroids; morton by the highest bit of their codes",
        },
        Param {
            name: "leaf_size",
            default: Default::Int { value: 64, min: 1, max: 65_536 },
            about: "a node with more triangles is divided",
        },
        Param {
            name: "stop",
            default: Default::Only { with: "split", is: &["sah"], of: &Default::Choice(&["size", "cost"]) },
            about: "smaller nodes are leaves at once (size), or where dividing them costs more than their triangles",
        },
        Param {
            name: "bins",
            default: Default::Only {
                with: "split",
                is: &["sah"],
                of: &Default::Int { value: 16, min: 2, max: bins::BINS_MAX as i64 },
            },
            about: "bins of centroids an axis; small nodes take fewer, and those of up to 8 triangles try every place",
        },
        Param {
            name: "layout",
            default: Default::Choice(&["wide", "binary"]),
            about: "wide: collapsed into groups of 8; binary: two children a node",
        },
    ],
    make: |spec| {
        Box::new(Bvh {
            split: match spec.text("split") {
                "median" => Split::Median,
                "morton" => Split::Morton,
                _ => Split::Sah,
            },
            leaf_size: spec.int("leaf_size") as u32,
            by_cost: spec.text("stop") == "cost",
            bins: spec.int("bins") as u32,
            wide: spec.text("layout") == "wide",
            kernel: Kernel::fastest(),
        })
    },
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    Sah,
    Median,
    Morton,
}

#[derive(Debug, Clone, Copy)]
pub struct Bvh {
    pub split: Split,
    pub leaf_size: u32,
    /// Divide smaller nodes, too, while that lowers the cost.
    pub by_cost: bool,
    pub bins: u32,
    /// Collapse the binary tree into groups of up to 8.
    pub wide: bool,
    pub kernel: Kernel,
}

impl std::default::Default for Bvh {
    fn default() -> Bvh {
        let kernel = Kernel::fastest();
        Bvh { split: Split::Sah, leaf_size: 64, by_cost: false, bins: 16, wide: true, kernel }
    }
}

/// Nodes of up to so many triangles are divided by the exact sweep, which costs no more
/// there than bins.
const SWEEP: usize = 8;

impl Structure for Bvh {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        let records = record::records(scene, self.kernel);
        let (tree, sealed) = match self.split {
            Split::Morton => linear::build(scene, &records, self.leaf_size as usize),
            split => {
                let grow = Grow {
                    leaf_size: self.leaf_size as usize,
                    bins: self.bins as usize,
                    median: split == Split::Median,
                    by_cost: self.by_cost,
                    sweep: SWEEP,
                    kernel: self.kernel,
                };
                grow.run(records)
            }
        };
        Ok(lay::lay(scene, &tree, &sealed, if self.wide { LANES } else { 2 }, self.leaf_size))
    }
}
