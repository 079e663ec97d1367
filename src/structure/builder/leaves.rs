//! From a tree of cells with the triangles of each to the flat layout: what grids
//! and kd-trees share once their cells are chosen.
//!
//! The tree is the paper's, whatever its fan-out. The layout leaves out nodes with
//! one child, whose box a walk would only ask about twice, and joins more than 8
//! siblings in runs of 8 by nodes of its own; the counts are the paper's.

use super::piece::Piece;
use super::straddle::{Budget, Policy};
use super::{Node, collapse, cut, flatten_forest, pull_up_bounds, sort_by_material};
use crate::hierarchy::{BuildStats, Hierarchy, LANES};
use crate::math::{Aabb, Box32, DVec3};
use crate::scene::Scene;
use rayon::prelude::*;

/// A leaf's cell and the triangles that belong or overlap there.
#[derive(Debug, Clone)]
pub struct Leaf<M> {
    pub cell: Aabb,
    /// Bit per axis: triangles in the cell's upper face are the neighbour's (split alone).
    pub not_ours: u8,
    pub triangles: M,
}

#[derive(Debug, Clone)]
pub enum Branch<L> {
    Leaf(L),
    Inner(Vec<Branch<L>>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// The given branches are the roots, all of them.
    Roots,
    /// They are joined until one block holds the roots.
    Joined,
    /// A binary tree, collapsed into groups of up to 8.
    Collapsed,
}

/// What the leaves hold, in the order of entries.
struct Content {
    sizes: Vec<u32>,
    boxes: Vec<Box32>,
    entries: Vec<u32>,
    fragments: Option<Vec<[DVec3; 3]>>,
}

/// Lays out a forest. `boxes` are those of all triangles, for the loose policy;
/// leaves of more than `leaf_limit` triangles (0: no limit) are counted.
/// `None` if splitting makes more pieces than a [`Budget`] has.
pub fn finish<M: AsRef<[u32]> + Sync>(
    scene: &Scene,
    forest: &[Branch<Leaf<M>>],
    policy: Policy,
    boxes: &[Box32],
    shape: Shape,
    leaf_limit: u32,
) -> Option<Hierarchy> {
    let mut leaves = Vec::new();
    forest.iter().for_each(|branch| collect(branch, &mut leaves));
    let content = match policy {
        Policy::Split => split(scene, &leaves)?,
        _ => whole(scene, &leaves, policy, boxes),
    };
    let mut number = 0;
    let forest: Vec<Branch<usize>> = forest.iter().filter_map(|b| prune(b, &content.sizes, &mut number)).collect();
    let mut layout = Layout { content: &content, nodes: Vec::new(), stats: BuildStats::default() };
    let roots = if shape == Shape::Roots { layout.forest(forest) } else { layout.joined(forest) };
    let Layout { mut nodes, mut stats, .. } = layout;
    pull_up_bounds(&mut nodes);
    if shape == Shape::Collapsed && !nodes.is_empty() {
        nodes = collapse::collapse(&nodes);
    }
    let over = |l: &&&Leaf<M>| leaf_limit > 0 && l.triangles.as_ref().len() > leaf_limit as usize;
    stats.oversized_leaves = leaves.iter().filter(over).count() as u64;
    let mut h = flatten_forest(scene, &nodes, roots, content.entries, content.fragments);
    h.stats = stats;
    Some(h)
}

fn collect<'a, L>(branch: &'a Branch<L>, out: &mut Vec<&'a L>) {
    match branch {
        Branch::Leaf(leaf) => out.push(leaf),
        Branch::Inner(children) => children.iter().for_each(|c| collect(c, out)),
    }
}

/// The tree over numbers of leaves, without the empty ones.
fn prune<L>(branch: &Branch<L>, sizes: &[u32], number: &mut usize) -> Option<Branch<usize>> {
    match branch {
        Branch::Leaf(_) => {
            *number += 1;
            (sizes[*number - 1] > 0).then_some(Branch::Leaf(*number - 1))
        }
        Branch::Inner(children) => {
            let children: Vec<_> = children.iter().filter_map(|c| prune(c, sizes, number)).collect();
            (!children.is_empty()).then_some(Branch::Inner(children))
        }
    }
}

/// Triangles by number, by material in every leaf.
fn whole<M: AsRef<[u32]> + Sync>(scene: &Scene, leaves: &[&Leaf<M>], policy: Policy, boxes: &[Box32]) -> Content {
    let sizes: Vec<u32> = leaves.iter().map(|l| l.triangles.as_ref().len() as u32).collect();
    let mut entries = Vec::with_capacity(sizes.iter().map(|s| *s as usize).sum());
    leaves.iter().for_each(|l| entries.extend_from_slice(l.triangles.as_ref()));
    let mut rest = &mut entries[..];
    let mut slices = Vec::with_capacity(leaves.len());
    for size in &sizes {
        let (own, tail) = rest.split_at_mut(*size as usize);
        slices.push(own);
        rest = tail;
    }
    let leaf_boxes = slices.into_par_iter().zip(leaves).with_min_len(16).map(|(own, leaf)| {
        sort_by_material(own, scene);
        if policy == Policy::Loose {
            return own.iter().fold(Box32::EMPTY, |b, t| b.union(boxes[*t as usize]));
        }
        let part = |t: &u32| cut::intersection(&scene.triangle_aabb(*t), &leaf.cell);
        own.iter().fold(Aabb::EMPTY, |b, t| b.union(part(t))).relative_to(scene.origin)
    });
    Content { boxes: leaf_boxes.collect(), sizes, entries, fragments: None }
}

/// What the cells leave of their triangles, each clipped once. `None` past the budget.
fn split<M: AsRef<[u32]> + Sync>(scene: &Scene, leaves: &[&Leaf<M>]) -> Option<Content> {
    let budget = Budget::of(scene);
    let clip = |leaf: &&Leaf<M>| {
        let mut triangles = leaf.triangles.as_ref().to_vec();
        sort_by_material(&mut triangles, scene);
        let pieces: Vec<Piece> =
            triangles.iter().flat_map(|t| cut::clip(scene, *t, &leaf.cell, leaf.not_ours)).collect();
        let bounds = pieces.iter().fold(Aabb::EMPTY, |b, p| b.union(p.bounds(scene)));
        budget.spend(pieces.len())?;
        Some((pieces, bounds.relative_to(scene.origin)))
    };
    let parts: Vec<(Vec<Piece>, Box32)> = leaves.par_iter().with_min_len(16).map(clip).collect::<Option<_>>()?;
    let pieces = || parts.iter().flat_map(|(pieces, _)| pieces);
    let was_split = pieces().any(|p| p.made != 0);
    Some(Content {
        sizes: parts.iter().map(|(pieces, _)| pieces.len() as u32).collect(),
        boxes: parts.iter().map(|(_, b)| *b).collect(),
        entries: pieces().map(|p| p.triangle).collect(),
        fragments: was_split.then(|| pieces().map(|p| p.corners).collect()),
    })
}

struct Layout<'a> {
    content: &'a Content,
    nodes: Vec<Node>,
    stats: BuildStats,
}

impl Layout<'_> {
    /// Every branch a root; returns how many.
    fn forest(&mut self, branches: Vec<Branch<usize>>) -> usize {
        let roots = branches.len();
        self.nodes.resize(roots, Node::new(0, 0, 0));
        let mut end = 0;
        for (i, branch) in branches.into_iter().enumerate() {
            end = self.fill(i, branch, 0, end);
        }
        roots
    }

    /// At most 8 roots over the branches.
    fn joined(&mut self, branches: Vec<Branch<usize>>) -> usize {
        let run = run_length(branches.len());
        let roots = branches.len().div_ceil(run);
        self.nodes.resize(roots, Node::new(0, 0, 0));
        self.runs(branches, run, 0, 0, 0);
        roots
    }

    /// Fills the nodes from `at` on with runs of branches of the paper's `depth`.
    fn runs(&mut self, branches: Vec<Branch<usize>>, run: usize, at: usize, depth: u64, first: u32) -> u32 {
        let mut end = first;
        let mut branches = branches.into_iter();
        for i in at.. {
            let mut part: Vec<_> = branches.by_ref().take(run).collect();
            end = match part.len() {
                0 => break,
                1 => self.fill(i, part.remove(0), depth, end),
                _ => self.family(i, part, depth, end),
            };
        }
        end
    }

    /// Fills node `index` with one branch, whose entries start at `first`; returns their end.
    fn fill(&mut self, index: usize, branch: Branch<usize>, depth: u64, first: u32) -> u32 {
        self.stats.nodes += 1;
        match branch {
            Branch::Leaf(leaf) => {
                let size = self.content.sizes[leaf];
                let level = self.nodes[index].level;
                self.nodes[index] = Node { bounds: self.content.boxes[leaf], ..Node::new(first, first + size, level) };
                self.stats.leaves += 1;
                self.stats.depth = self.stats.depth.max(depth);
                self.stats.largest_leaf = self.stats.largest_leaf.max(u64::from(size));
                first + size
            }
            Branch::Inner(mut children) if children.len() == 1 => {
                self.fill(index, children.remove(0), depth + 1, first)
            }
            Branch::Inner(children) => self.family(index, children, depth + 1, first),
        }
    }

    /// Makes node `index` the parent of `children`, by way of groups if they are many.
    fn family(&mut self, index: usize, children: Vec<Branch<usize>>, depth: u64, first: u32) -> u32 {
        let run = run_length(children.len());
        let (child, count) = (self.nodes.len(), children.len().div_ceil(run));
        let level = self.nodes[index].level + 1;
        self.nodes.resize(child + count, Node::new(0, 0, level));
        let end = self.runs(children, run, child, depth, first);
        let node = &mut self.nodes[index];
        (node.first, node.own_end, node.end) = (first, first, end);
        (node.first_child, node.child_count) = (child as u32, count as u8);
        end
    }
}

/// The smallest power of 8 whose runs are at most 8.
fn run_length(siblings: usize) -> usize {
    let mut run = 1;
    while siblings.div_ceil(run) > LANES {
        run *= LANES;
    }
    run
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A forest of one-triangle leaves, laid out.
    fn laid(forest: Vec<Branch<usize>>, joined: bool) -> (Vec<Node>, usize, BuildStats) {
        let mut leaves = Vec::new();
        forest.iter().for_each(|b| collect(b, &mut leaves));
        let n = leaves.len();
        let unit = Box32 { lo: crate::math::Vec3::ZERO, hi: crate::math::Vec3::ONE };
        let content = Content { sizes: vec![1; n], boxes: vec![unit; n], entries: Vec::new(), fragments: None };
        let mut layout = Layout { content: &content, nodes: Vec::new(), stats: BuildStats::default() };
        let roots = if joined { layout.joined(forest) } else { layout.forest(forest) };
        (layout.nodes, roots, layout.stats)
    }

    fn leaves(count: usize) -> Vec<Branch<usize>> {
        (0..count).map(Branch::Leaf).collect()
    }

    #[test]
    fn many_siblings_are_joined_in_runs_of_eight_and_not_counted() {
        let (nodes, roots, stats) = laid(leaves(75), true);
        // 75 leaves: runs of 64 and 11, below them runs of 8, of 8 and 3.
        assert_eq!((roots, nodes.len()), (2, 75 + 10 + 2));
        assert_eq!(
            nodes[..2].iter().map(|n| (n.first, n.end, n.child_count)).collect::<Vec<_>>(),
            [(0, 64, 8), (64, 75, 2)]
        );
        assert_eq!((stats.nodes, stats.leaves, stats.depth), (75, 75, 0));
        assert!(nodes.iter().all(|n| n.children().len() != 1 && n.children().len() <= LANES));
        let (nodes, roots, stats) = laid(leaves(75), false);
        assert_eq!((roots, nodes.len(), stats.nodes), (75, 75, 75));
    }

    #[test]
    fn an_only_child_is_counted_and_not_laid_out() {
        let chain = Branch::Inner(vec![Branch::Inner(leaves(1))]);
        let (nodes, roots, stats) = laid(vec![chain, Branch::Leaf(1)], true);
        assert_eq!((roots, nodes.len()), (2, 2));
        assert_eq!((stats.nodes, stats.leaves, stats.depth), (4, 2, 2));
    }
}
