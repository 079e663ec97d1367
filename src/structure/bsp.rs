//! BSP tree of polygon planes (Fuchs, Kedem & Naylor 1980), with leaves of at
//! most `min_leaf` triangles as in Serpa & Rodrigues 2014.
//!
//! The paper says "at least 200" triangles a leaf and then "a leaf if it has at
//! most 200"; here a node is a leaf iff it has at most `min_leaf`. Planes come
//! from the triangles themselves ([`choose`]), points are classified exactly
//! ([`plane`]), triangles that span a plane are split and their pieces keep the
//! triangle's number. A plane must make progress: leave fewer pieces on both
//! sides than there were, and no side with nearly all. Where no triangle's
//! plane does, the median of the centroids is cut along an axis; where that
//! fails too, the leaf stays oversized and is counted.
//!
//! Conservative: a node's box holds its pieces, widened by the rounding of
//! their split corners. Worst case is quadratic in pieces, so a build stops with
//! an error past 4 pieces a triangle.

mod choose;
mod plane;

use super::Structure;
use super::builder::piece::Piece;
use super::builder::{self, Node};
use crate::error::{Error, Result};
use crate::hierarchy::Hierarchy;
use crate::math::{Aabb, DVec3};
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;
use plane::SplitPlane;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "bsp",
    about: "BSP tree of polygon planes, spanning triangles split",
    revision: 1,
    params: &[
        Param {
            name: "min_leaf",
            default: Default::Int { value: 200, min: 1, max: 1 << 30 },
            about: "a node with at most so many triangles is a leaf",
        },
        Param {
            name: "split_weight",
            default: Default::Float { value: 8.0, min: 0.0, max: 1e6 },
            about: "cost of a split against a triangle of imbalance",
        },
        Param {
            name: "axis_penalty",
            default: Default::Float { value: 16.0, min: 0.0, max: 1e9 },
            about: "cost of a plane that is not parallel to two axes",
        },
        Param {
            name: "candidates",
            default: Default::Int { value: 48, min: 1, max: 4096 },
            about: "planes compared for each node",
        },
        Param {
            name: "sample",
            default: Default::Int { value: 1024, min: 16, max: 1 << 30 },
            about: "pieces on which candidates are compared",
        },
        Param {
            name: "heuristic",
            default: Default::Later(&Default::Choice(&["balance", "surface"])),
            about: "what a plane should do: balance the pieces, or leave little surface around many of them",
        },
        Param {
            name: "layout",
            default: Default::Choice(&["wide", "binary"]),
            about: "wide: collapsed into groups of 8; binary: the paper's tree, with its order from front to back",
        },
    ],
    make: |spec| {
        Box::new(Bsp {
            min_leaf: spec.int("min_leaf") as u32,
            split_weight: spec.float("split_weight"),
            axis_penalty: spec.float("axis_penalty"),
            candidates: spec.int("candidates") as u32,
            sample: spec.int("sample") as u32,
            surface: spec.text("heuristic") == "surface",
            wide: spec.text("layout") == "wide",
        })
    },
};

/// Deeper nodes are leaves, whatever their size.
const DEPTH_MAX: u8 = 64;
/// A plane that leaves more than 15/16 of the pieces on one side is tried only
/// after the median cut: a chain of such planes is a list, not a tree.
const POOR: (usize, usize) = (15, 16);
/// Pieces a triangle past which a build gives up.
const PIECES_A_TRIANGLE: u64 = 4;
/// Scenes so small may exceed that share: the bound is against memory.
const PIECES_ALWAYS: u64 = 4096;
/// Nodes with fewer pieces are built by one task.
const TASK_PIECES: usize = 1 << 11;
/// Pieces a task classifies.
const CHUNK: usize = 1 << 13;

#[derive(Debug, Clone, Copy)]
pub struct Bsp {
    pub min_leaf: u32,
    pub split_weight: f64,
    pub axis_penalty: f64,
    pub candidates: u32,
    pub sample: u32,
    /// Surface areas in place of balance.
    pub surface: bool,
    /// Collapse the binary tree into groups of up to 8.
    pub wide: bool,
}

enum Branch {
    Leaf(Vec<Piece>),
    /// Front, then back.
    Inner(Box<(SplitPlane, Branch, Branch)>),
}

impl Structure for Bsp {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        if scene.is_empty() {
            return Ok(builder::flatten(scene, &[], Vec::new(), None));
        }
        let pieces: Vec<Piece> = (0..scene.len() as u32).into_par_iter().map(|t| Piece::whole(scene, t)).collect();
        let work = Work { params: self, scene, pieces: AtomicU64::new(pieces.len() as u64) };
        let root = work.grow(pieces, 0).ok_or_else(|| too_many(scene))?;
        Ok(self.flatten(scene, root))
    }
}

fn too_many(scene: &Scene) -> Error {
    Error::new(format!(
        "the BSP tree of `{}` has more than {PIECES_A_TRIANGLE} pieces a triangle ({} triangles)",
        scene.name,
        scene.len()
    ))
    .key("split_weight")
    .help("raise `split_weight` (32, say), or `min_leaf`, so that fewer triangles are split")
}

/// What all tasks of one build share.
struct Work<'a> {
    params: &'a Bsp,
    scene: &'a Scene,
    /// Pieces of all nodes in the making. Only grows, so whether it passes the
    /// limit does not depend on the order of tasks.
    pieces: AtomicU64,
}

impl Work<'_> {
    /// `None` past the limit of pieces.
    fn grow(&self, pieces: Vec<Piece>, level: u8) -> Option<Branch> {
        if pieces.len() <= self.params.min_leaf as usize || level >= DEPTH_MAX {
            return Some(Branch::Leaf(pieces));
        }
        let Some((plane, front, back)) = self.partition(&pieces) else {
            return Some(Branch::Leaf(pieces));
        };
        let made = (front.len() + back.len() - pieces.len()) as u64;
        let limit = (PIECES_A_TRIANGLE * self.scene.len() as u64).max(PIECES_ALWAYS);
        if self.pieces.fetch_add(made, Ordering::Relaxed) + made > limit {
            return None;
        }
        let parallel = pieces.len() >= TASK_PIECES;
        drop(pieces);
        let (front, back) = if parallel {
            rayon::join(|| self.grow(front, level + 1), || self.grow(back, level + 1))
        } else {
            (self.grow(front, level + 1), self.grow(back, level + 1))
        };
        Some(Branch::Inner(Box::new((plane, front?, back?))))
    }

    /// The best plane that makes progress, and the pieces on its two sides.
    fn partition(&self, pieces: &[Piece]) -> Option<(SplitPlane, Vec<Piece>, Vec<Piece>)> {
        let enough = pieces.len() * POOR.0 / POOR.1;
        let ranked = choose::ranked_planes(self.params, self.scene, pieces);
        let mut poor: Option<(Classified, SplitPlane)> = None;
        for (plane, expected) in ranked {
            // Counting exactly costs a pass; one poor plane is enough to fall back on.
            if poor.is_some() && expected > enough {
                continue;
            }
            let sorted = Classified::by(&plane, pieces);
            if sorted.larger() <= enough {
                return Some(sorted.separate(plane, pieces));
            }
            if poor.is_none() && sorted.makes_progress(pieces) {
                poor = Some((sorted, plane));
            }
        }
        for plane in median_planes(pieces) {
            let sorted = Classified::by(&plane, pieces);
            if sorted.makes_progress(pieces) && poor.as_ref().is_none_or(|(p, _)| sorted.larger() < p.larger()) {
                return Some(sorted.separate(plane, pieces));
            }
        }
        poor.map(|(sorted, plane)| sorted.separate(plane, pieces))
    }
}

/// Every piece against one plane, and how many pieces that makes.
struct Classified {
    /// `side + 1` of each corner, 2 bits each, then `place + 1`.
    codes: Vec<u8>,
    front: usize,
    back: usize,
}

impl Classified {
    fn by(plane: &SplitPlane, pieces: &[Piece]) -> Classified {
        let classify = |chunk: &[Piece]| {
            let (mut front, mut back) = (0, 0);
            let codes: Vec<u8> = chunk
                .iter()
                .map(|p| {
                    let sides = plane.sides(p);
                    let place = plane.place(p, sides);
                    let (f, b) = match place {
                        1 => (1, 0),
                        -1 => (0, 1),
                        _ => Piece::split_counts(sides),
                    };
                    front += f as usize;
                    back += b as usize;
                    sides.iter().rev().fold((place + 1) as u8, |code, s| code << 2 | (s + 1) as u8)
                })
                .collect();
            Classified { codes, front, back }
        };
        if pieces.len() <= CHUNK {
            return classify(pieces);
        }
        let parts: Vec<Classified> = pieces.par_chunks(CHUNK).map(classify).collect();
        Classified {
            front: parts.iter().map(|p| p.front).sum(),
            back: parts.iter().map(|p| p.back).sum(),
            codes: parts.into_iter().flat_map(|p| p.codes).collect(),
        }
    }

    fn larger(&self) -> usize {
        self.front.max(self.back)
    }

    fn makes_progress(&self, pieces: &[Piece]) -> bool {
        self.front > 0 && self.back > 0 && self.larger() < pieces.len()
    }

    fn separate(self, plane: SplitPlane, pieces: &[Piece]) -> (SplitPlane, Vec<Piece>, Vec<Piece>) {
        let (mut front, mut back) = (Vec::with_capacity(self.front), Vec::with_capacity(self.back));
        for (p, code) in pieces.iter().zip(&self.codes) {
            match code >> 6 {
                2 => front.push(*p),
                0 => back.push(*p),
                _ => {
                    let sides = [0, 2, 4].map(|shift| (code >> shift & 3) as i8 - 1);
                    plane.split(p, sides, &mut front, &mut back);
                }
            }
        }
        (plane, front, back)
    }
}

/// Planes through the median centroid, across the longest axis first.
fn median_planes(pieces: &[Piece]) -> impl Iterator<Item = SplitPlane> + '_ {
    let centroid = |p: &Piece| (p.corners[0] + p.corners[1] + p.corners[2]) / 3.0;
    let size = pieces.iter().fold(Aabb::EMPTY, |b, p| b.with(centroid(p))).size();
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| size[*b].total_cmp(&size[*a]));
    axes.into_iter().filter(move |axis| size[*axis] > 0.0).map(move |axis| {
        let mut at: Vec<f64> = pieces.iter().map(|p| centroid(p)[axis]).collect();
        let middle = at.len() / 2;
        SplitPlane::across(axis, *at.select_nth_unstable_by(middle, f64::total_cmp).1)
    })
}

impl Bsp {
    fn flatten(&self, scene: &Scene, root: Branch) -> Hierarchy {
        let mut tree = Tree { nodes: vec![Node::new(0, 0, 0)], planes: vec![None], leaves: Vec::new() };
        tree.lay(root, 0, 0);
        let Tree { mut nodes, planes, mut leaves } = tree;
        let boxes: Vec<Aabb> = leaves
            .par_iter_mut()
            .map(|(_, pieces)| {
                pieces.sort_by_key(|p| (scene.material_id[p.triangle as usize], p.triangle));
                pieces.iter().fold(Aabb::EMPTY, |b, p| b.union(p.bounds(scene)))
            })
            .collect();
        for ((node, _), b) in leaves.iter().zip(&boxes) {
            nodes[*node].bounds = b.relative_to(scene.origin);
        }
        builder::pull_up_bounds(&mut nodes);
        for i in 0..nodes.len() {
            let Some(plane) = planes[i] else { continue };
            let b = nodes[i].bounds;
            let world = Aabb { lo: b.lo.as_dvec3() + scene.origin, hi: b.hi.as_dvec3() + scene.origin };
            for (child, sign) in nodes[i].children().zip([1.0, -1.0]) {
                nodes[child].half_space = Some(plane.half_space(sign, &world, scene.origin));
            }
        }
        let stats = builder::stats(&nodes, u64::from(self.min_leaf));
        if self.wide {
            nodes = builder::collapse::collapse(&nodes);
        }
        let pieces = || leaves.iter().flat_map(|(_, pieces)| pieces);
        let entries = pieces().map(|p| p.triangle).collect();
        let was_split = pieces().any(|p| p.made != 0);
        let fragments: Option<Vec<[DVec3; 3]>> = was_split.then(|| pieces().map(|p| p.corners).collect());
        let mut h = builder::flatten(scene, &nodes, entries, fragments);
        h.stats = stats;
        h
    }
}

/// The branches as an array of nodes, pairs of children side by side.
struct Tree {
    nodes: Vec<Node>,
    planes: Vec<Option<SplitPlane>>,
    /// Node and pieces, in the order of entries.
    leaves: Vec<(usize, Vec<Piece>)>,
}

impl Tree {
    /// Fills node `index`, whose entries start at `first`; returns their end.
    fn lay(&mut self, branch: Branch, index: usize, first: u32) -> u32 {
        let level = self.nodes[index].level;
        let end = match branch {
            Branch::Leaf(pieces) => {
                let end = first + pieces.len() as u32;
                self.nodes[index] = Node::new(first, end, level);
                self.leaves.push((index, pieces));
                return end;
            }
            Branch::Inner(inner) => {
                let (plane, front, back) = *inner;
                let child = self.nodes.len();
                self.nodes.extend([Node::new(0, 0, level + 1); 2]);
                self.planes.extend([None; 2]);
                self.planes[index] = Some(plane);
                let middle = self.lay(front, child, first);
                let end = self.lay(back, child + 1, middle);
                self.nodes[index].first_child = child as u32;
                self.nodes[index].child_count = 2;
                end
            }
        };
        let node = &mut self.nodes[index];
        (node.first, node.own_end, node.end) = (first, first, end);
        end
    }
}
