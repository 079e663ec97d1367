//! kd-tree (Bentley 1975) with planes by the surface area heuristic (MacDonald &
//! Booth 1990), or at medians.
//!
//! A plane costs `C = traversal_cost + triangle_cost (P_L n_L + P_R n_R)`, P being the
//! share of the node's area, less the `empty_bonus` where it cuts off empty space. A
//! node is a leaf if no plane costs less than its n triangles do, if n is at most
//! `leaf_size`, or at depth `8 + 1.3 log2 N` (the custom of ray tracers). Small nodes
//! compare all planes at ends of triangles (Wald & Havran 2006), large ones those
//! between bins (Hunt, Mark & Stoll 2006; Shevtsov, Soupikov & Kapustin 2007).
//!
//! What P and n are depends on what becomes of straddling triangles, the `policy`:
//! - `L`: by centroid. n counts centroids below and above, P is that of the boxes grown
//!   to their triangles, which a walk will ask about, not of the halves of a cell. No
//!   side is empty, so the bonus has nothing to reward; planes lie between centroids.
//! - `R` and `S`: P is that of the two cells, n counts the triangles whose box, cut to
//!   the node's cell, reaches into each. One that lies in the plane goes to the side
//!   where it costs less, to that one alone, and touching a plane from one side is no
//!   reason for a copy on the other. Copies that only their box puts into a cell are
//!   dropped by a separating-axis test; S clips what is left at the leaf's cell.
//!
//! The heuristic minimises what a ray costs, not what culling costs: `median`, halves
//! by number across the widest axis, is the control. Empty leaves are not stored nor
//! counted. Triangles that no plane parts stay together in a counted, oversized leaf.
//!
//! Conservative: a box holds its triangles, or the parts of them in its cell, and each
//! point of a triangle is in a cell that has the triangle.

mod cost;
mod loose;
mod spatial;

use super::Structure;
use super::builder::leaves::{Branch, Leaf, Shape, finish};
use super::builder::straddle::{self, Budget, Policy};
use super::builder::{flatten, triangle_boxes};
use crate::error::Result;
use crate::hierarchy::Hierarchy;
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;
use cost::Cost;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "kd_tree",
    about: "kd-tree with planes by surface area or at medians",
    revision: 1,
    params: &[
        Param {
            name: "split",
            default: Default::Choice(&["sah", "median"]),
            about: "planes by the surface area heuristic, or at medians",
        },
        Param {
            name: "traversal_cost",
            default: Default::Only {
                with: "split",
                is: &["sah"],
                of: &Default::Float { value: 15.0, min: 0.0, max: 1e6 },
            },
            about: "K_T of the heuristic: asking about a node",
        },
        Param {
            name: "triangle_cost",
            default: Default::Only {
                with: "split",
                is: &["sah"],
                of: &Default::Float { value: 20.0, min: 0.001, max: 1e6 },
            },
            about: "K_I of the heuristic: a triangle in a leaf",
        },
        Param {
            name: "empty_bonus",
            default: Default::Only {
                with: "split",
                is: &["sah"],
                of: &Default::Only {
                    with: "policy",
                    is: &["R", "S"],
                    of: &Default::Float { value: 0.2, min: 0.0, max: 1.0 },
                },
            },
            about: "share of the cost that a plane saves by cutting off empty space",
        },
        Param {
            name: "leaf_size",
            default: Default::Int { value: 64, min: 1, max: 1 << 30 },
            about: "a node with at most so many triangles is a leaf",
        },
        straddle::PARAM,
        Param {
            name: "layout",
            default: Default::Choice(&["wide", "binary"]),
            about: "wide: collapsed into groups of 8; binary: two children a node",
        },
    ],
    make: |spec| {
        let cost = Cost {
            traversal: spec.float("traversal_cost"),
            triangle: spec.float("triangle_cost"),
            empty_bonus: spec.float("empty_bonus"),
        };
        Box::new(KdTree {
            cost: (spec.text("split") == "sah").then_some(cost),
            leaf_size: spec.int("leaf_size") as u32,
            policy: Policy::of(spec),
            wide: spec.text("layout") == "wide",
        })
    },
};

/// Nodes with more triangles compare planes between bins alone.
const EXACT: usize = 1 << 10;
/// Nodes with fewer triangles are built by one task.
const TASK: usize = 1 << 11;

#[derive(Debug, Clone, Copy)]
pub struct KdTree {
    /// `None`: medians.
    cost: Option<Cost>,
    leaf_size: u32,
    policy: Policy,
    wide: bool,
}

type Tree = Branch<Leaf<Vec<u32>>>;

impl Structure for KdTree {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        if scene.is_empty() {
            return Ok(flatten(scene, &[], Vec::new(), None));
        }
        let budget = Budget::of(scene);
        let boxes = if self.policy == Policy::Loose { triangle_boxes(scene) } else { Vec::new() };
        let tree = match self.policy {
            Policy::Loose => Some(loose::grow(self, scene, &boxes)),
            _ => spatial::grow(self, scene, &budget),
        };
        let shape = if self.wide { Shape::Collapsed } else { Shape::Joined };
        tree.and_then(|tree| finish(scene, &[tree], self.policy, &boxes, shape, self.leaf_size))
            .ok_or_else(|| budget.error("a kd-tree", scene, "leaf_size", "raise `leaf_size`"))
    }
}

impl KdTree {
    /// Whether `n` triangles at this depth, in a tree of `all`, are a leaf without asking what a plane costs.
    fn is_leaf(&self, n: usize, depth: u32, all: usize) -> bool {
        n <= self.leaf_size as usize || f64::from(depth) >= (8.0 + 1.3 * libm::log2(all as f64)).floor()
    }
}

/// A plane that parts `values` about evenly: between the value of middle rank and the
/// next below, or above if there is none. `None` if all are equal.
fn median(values: &mut [f64]) -> Option<f64> {
    let (below, middle, above) = values.select_nth_unstable_by(values.len() / 2, f64::total_cmp);
    let middle = *middle;
    let lower = below.iter().copied().filter(|v| *v < middle).fold(f64::NEG_INFINITY, f64::max);
    let upper = above.iter().copied().filter(|v| *v > middle).fold(f64::INFINITY, f64::min);
    let between = |a: f64, b: f64| {
        let halfway = a + (b - a) * 0.5;
        if halfway > a { halfway } else { b }
    };
    match (lower.is_finite(), upper.is_finite()) {
        (true, _) => Some(between(lower, middle)),
        (false, true) => Some(between(middle, upper)),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
