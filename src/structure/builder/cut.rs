//! Octrees whose leaves hold what lies in their cell: copies of triangles
//! (policy R) or pieces of them (policy S).
//!
//! Cells are closed and share their planes to the bit, so a triangle that lies
//! in a face belongs to the cells on both sides under R, and to the upper one
//! under S; none is lost between them. A leaf's box is what its members leave of
//! its cell, not the members' own boxes: a triangle has a copy in every cell it
//! overlaps, and each answers for its part.

pub use super::overlap::triangle_overlaps;
use super::piece::Piece;
use super::{Node, flatten, pull_up_bounds, sort_by_material, stats};
use crate::error::{Error, Result};
use crate::hierarchy::Hierarchy;
use crate::math::{Aabb, DVec3};
use crate::scene::Scene;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Entries past which a build gives up, unless 4 a triangle are more.
const ENTRIES_MAX: u64 = 1 << 24;
/// Nodes with fewer triangles are built by one task.
const TASK_TRIANGLES: usize = 1 << 10;

/// Policy R: a copy in every leaf that the triangle overlaps.
pub fn build_replicated(scene: &Scene, root: &Aabb, depth: u32, leaf_limit: u32) -> Result<Hierarchy> {
    let plan = Plan { depth, leaf_limit, entries_max: entries_max(scene), split: &|cell| cell.bounds.centre() };
    Ok(replicated(scene, root, plan)?.0)
}

/// Policy R over a grid of cells: all leaves at depth `bits`, their planes given. Also
/// where each leaf's cell is, in the order of the leaves' entries.
pub fn build_cells(scene: &Scene, planes: &[Vec<f64>; 3], bits: u32) -> Result<(Hierarchy, Vec<[u32; 3]>)> {
    let end = |of: fn(&Vec<f64>) -> f64| DVec3::from([0, 1, 2].map(|axis| of(&planes[axis])));
    let root = Aabb { lo: end(|p| p[0]), hi: end(|p| p[p.len() - 1]) };
    let middle = |cell: &Cell| {
        let plane = |axis: usize| planes[axis][(2 * cell.at[axis] as usize + 1) << (bits - cell.level - 1)];
        DVec3::new(plane(0), plane(1), plane(2))
    };
    replicated(scene, &root, Plan { depth: bits, leaf_limit: 0, entries_max: entries_max(scene), split: &middle })
}

fn replicated(scene: &Scene, root: &Aabb, plan: Plan) -> Result<(Hierarchy, Vec<[u32; 3]>)> {
    let tree = Tree::grow(scene, root, plan, &|t, _, out: &mut Vec<u32>| out.push(t))?;
    let boxes = tree.boxes(|t, cell| intersection(&scene.triangle_aabb(*t), cell));
    let entries = tree.items().copied().collect();
    let cells = tree.leaves.iter().map(|leaf| leaf.cell.at).collect();
    Ok((tree.finish(scene, plan.leaf_limit, &boxes, entries, None), cells))
}

/// Policy S: in every leaf, what its cell leaves of the triangles that R would
/// copy there. Clipping each triangle once, at its leaf, makes a fraction of the
/// pieces that splitting level by level does, whose diagonals are split again.
pub fn build_split(scene: &Scene, root: &Aabb, depth: u32, leaf_limit: u32) -> Result<Hierarchy> {
    let plan = Plan { depth, leaf_limit, entries_max: entries_max(scene), split: &|cell| cell.bounds.centre() };
    let tree = Tree::grow(scene, root, plan, &|t, cell, out: &mut Vec<Piece>| {
        let inner = |axis: &usize| cell.hi[*axis] < root.hi[*axis];
        out.extend(clip(scene, t, cell, (0..3).filter(inner).fold(0, |faces, axis| faces | 1 << axis)));
    })?;
    let boxes = tree.boxes(|p, _| p.bounds(scene));
    let entries: Vec<u32> = tree.items().map(|p| p.triangle).collect();
    let was_split = tree.items().any(|p| p.made != 0);
    let fragments = was_split.then(|| tree.items().map(|p| p.corners).collect());
    Ok(tree.finish(scene, leaf_limit, &boxes, entries, fragments))
}

pub(super) fn entries_max(scene: &Scene) -> u64 {
    ENTRIES_MAX.max(4 * scene.len() as u64)
}

/// The triangles that overlap each octant.
fn divide(scene: &Scene, triangles: &[u32], octants: &[Aabb; 8]) -> [Vec<u32>; 8] {
    let mut out: [Vec<u32>; 8] = Default::default();
    for t in triangles {
        let corners = scene.corners(*t);
        for (octant, list) in octants.iter().zip(&mut out) {
            if triangle_overlaps(&corners, octant) {
                list.push(*t);
            }
        }
    }
    out
}

/// The part of a triangle in a cell (Sutherland & Hodgman 1974), as a fan of
/// pieces. What lies in an upper face that bit `axis` of `not_ours` names is the
/// upper neighbour's.
pub(super) fn clip(scene: &Scene, triangle: u32, cell: &Aabb, not_ours: u8) -> Vec<Piece> {
    let whole = Piece::whole(scene, triangle);
    let in_plane = |axis: usize, at: f64| whole.corners.iter().all(|p| p[axis] == at);
    if (0..3).any(|axis| not_ours >> axis & 1 == 1 && in_plane(axis, cell.hi[axis])) {
        return Vec::new();
    }
    let mut polygon: Vec<(DVec3, bool)> = whole.corners.iter().map(|p| (*p, false)).collect();
    for (axis, sign, at) in (0..3).flat_map(|a| [(a, 1.0, cell.lo[a]), (a, -1.0, cell.hi[a])]) {
        let depth = |p: DVec3| (p[axis] - at) * sign;
        if polygon.iter().all(|p| depth(p.0) >= 0.0) {
            continue;
        }
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for i in 0..polygon.len() {
            let (p, q) = (polygon[i].0, polygon[(i + 1) % polygon.len()].0);
            let (dp, dq) = (depth(p), depth(q));
            if dp >= 0.0 {
                kept.push(polygon[i]);
            }
            if (dp < 0.0 && dq > 0.0) || (dp > 0.0 && dq < 0.0) {
                let mut x = p + (q - p) * (dp / (dp - dq));
                x[axis] = at;
                kept.push((x.clamp(p.min(q), p.max(q)), true));
            }
        }
        polygon = kept;
    }
    (1..polygon.len().max(2) - 1)
        .map(|i| {
            let corners = [polygon[0], polygon[i], polygon[i + 1]];
            let made = corners.iter().enumerate().map(|(k, c)| u8::from(c.1) << k).sum();
            Piece { corners: corners.map(|c| c.0), triangle, made }
        })
        .collect()
}

/// Octant `i` of a cell around a point: bit 0 upper in x, bit 1 in y, bit 2 in z.
pub fn octants(cell: &Aabb, middle: DVec3) -> [Aabb; 8] {
    [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
        let mut octant = *cell;
        for axis in 0..3 {
            if i >> axis & 1 == 1 { octant.lo[axis] = middle[axis] } else { octant.hi[axis] = middle[axis] }
        }
        octant
    })
}

pub fn intersection(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb { lo: a.lo.max(b.lo), hi: a.hi.min(b.hi) }
}

/// A box that is divided: `at` numbers it among the 2^`level` of each axis.
#[derive(Clone, Copy)]
struct Cell {
    bounds: Aabb,
    at: [u32; 3],
    level: u32,
}

/// How far to divide, and where.
#[derive(Clone, Copy)]
struct Plan<'a> {
    depth: u32,
    leaf_limit: u32,
    entries_max: u64,
    /// The point at which the eight octants of a cell meet.
    split: &'a (dyn Fn(&Cell) -> DVec3 + Sync),
}

/// `Inner` without children is an empty leaf.
enum Branch<T> {
    Leaf(Leaf<T>),
    Inner(Vec<Branch<T>>),
}

struct Leaf<T> {
    node: usize,
    cell: Cell,
    /// Triangles that overlap the cell; under S other than the items cut from them.
    triangles: usize,
    items: Vec<T>,
}

/// The tree as nodes, and its leaves in the order of entries.
struct Tree<T> {
    nodes: Vec<Node>,
    leaves: Vec<Leaf<T>>,
}

/// Adds to a leaf's items what lies of a triangle in its cell.
type Put<'a, T> = &'a (dyn Fn(u32, &Aabb, &mut Vec<T>) + Sync);

struct Growth<'a, T> {
    scene: &'a Scene,
    put: Put<'a, T>,
    plan: Plan<'a>,
    /// Entries of finished leaves. Only grows, so whether it passes the limit
    /// does not depend on the order of tasks.
    entries: AtomicU64,
}

impl<T: Send> Growth<'_, T> {
    /// `None` past the limit of entries.
    fn grow(&self, mut triangles: Vec<u32>, cell: Cell) -> Option<Branch<T>> {
        let Plan { depth, leaf_limit, entries_max, split } = self.plan;
        if cell.level == depth || triangles.len() <= leaf_limit as usize {
            sort_by_material(&mut triangles, self.scene);
            let mut items = Vec::with_capacity(triangles.len());
            triangles.iter().for_each(|t| (self.put)(*t, &cell.bounds, &mut items));
            let size = items.len() as u64;
            let before = self.entries.fetch_add(size, Ordering::Relaxed);
            let leaf = Leaf { node: 0, cell, triangles: triangles.len(), items };
            let branch = if size == 0 { Branch::Inner(Vec::new()) } else { Branch::Leaf(leaf) };
            return (before + size <= entries_max).then_some(branch);
        }
        if self.entries.load(Ordering::Relaxed) > entries_max {
            return None;
        }
        let parallel = triangles.len() >= TASK_TRIANGLES;
        let octants = octants(&cell.bounds, split(&cell));
        let parts = divide(self.scene, &triangles, &octants);
        drop(triangles);
        let octant = |i: usize| Cell {
            bounds: octants[i],
            at: [0, 1, 2].map(|axis| 2 * cell.at[axis] + (i as u32 >> axis & 1)),
            level: cell.level + 1,
        };
        let mut parts: Vec<(Vec<u32>, Cell)> = parts.into_iter().zip((0..8).map(octant)).collect();
        parts.retain(|(part, _)| !part.is_empty());
        let below = |(part, octant)| self.grow(part, octant);
        let children: Option<Vec<Branch<T>>> =
            if parallel { parts.into_par_iter().map(below).collect() } else { parts.into_iter().map(below).collect() };
        let mut children = children?;
        children.retain(|b| !matches!(b, Branch::Inner(c) if c.is_empty()));
        Some(Branch::Inner(children))
    }
}

impl<T: Send + Sync> Tree<T> {
    fn grow(scene: &Scene, root: &Aabb, plan: Plan, put: Put<'_, T>) -> Result<Tree<T>> {
        let mut tree = Tree { nodes: Vec::new(), leaves: Vec::new() };
        if scene.is_empty() {
            return Ok(tree);
        }
        let growth = Growth { scene, put, plan, entries: AtomicU64::new(0) };
        let cell = Cell { bounds: *root, at: [0; 3], level: 0 };
        let branch = growth.grow((0..scene.len() as u32).collect(), cell).ok_or_else(|| {
            Error::new(format!(
                "an octree of depth {} over `{}` has more than {} entries ({} triangles)",
                plan.depth,
                scene.name,
                plan.entries_max,
                scene.len()
            ))
            .key("depth")
            .help("lower `depth`; an `octree` also has `leaf_limit`, and policy \"L\", which holds each triangle once")
        })?;
        tree.nodes.push(Node::new(0, 0, 0));
        tree.lay(branch, 0, 0);
        Ok(tree)
    }

    /// Fills node `index`, whose entries start at `first`; returns their end.
    fn lay(&mut self, branch: Branch<T>, index: usize, first: u32) -> u32 {
        let level = self.nodes[index].level;
        match branch {
            Branch::Leaf(leaf) => {
                let end = first + leaf.items.len() as u32;
                self.nodes[index] = Node::new(first, end, level);
                self.leaves.push(Leaf { node: index, ..leaf });
                end
            }
            Branch::Inner(children) => {
                let child = self.nodes.len();
                let count = children.len();
                self.nodes.extend((0..count).map(|_| Node::new(0, 0, level + 1)));
                let mut end = first;
                for (i, branch) in children.into_iter().enumerate() {
                    end = self.lay(branch, child + i, end);
                }
                let node = &mut self.nodes[index];
                (node.first, node.own_end, node.end) = (first, first, end);
                (node.first_child, node.child_count) = (child as u32, count as u8);
                end
            }
        }
    }

    /// Items of all leaves, in the order of entries.
    fn items(&self) -> impl Iterator<Item = &T> {
        self.leaves.iter().flat_map(|leaf| &leaf.items)
    }

    /// Box of every leaf, from that of each item in the leaf's cell.
    fn boxes(&self, of: impl Fn(&T, &Aabb) -> Aabb + Sync) -> Vec<Aabb> {
        let leaf_box = |leaf: &Leaf<T>| leaf.items.iter().fold(Aabb::EMPTY, |b, i| b.union(of(i, &leaf.cell.bounds)));
        self.leaves.par_iter().with_min_len(16).map(leaf_box).collect()
    }

    fn finish(
        mut self,
        scene: &Scene,
        leaf_limit: u32,
        boxes: &[Aabb],
        entries: Vec<u32>,
        fragments: Option<Vec<[DVec3; 3]>>,
    ) -> Hierarchy {
        for (leaf, b) in self.leaves.iter().zip(boxes) {
            self.nodes[leaf.node].bounds = b.relative_to(scene.origin);
        }
        pull_up_bounds(&mut self.nodes);
        let mut h = flatten(scene, &self.nodes, entries, fragments);
        h.stats = stats(&self.nodes, 0);
        if leaf_limit > 0 {
            h.stats.oversized_leaves = self.leaves.iter().filter(|l| l.triangles > leaf_limit as usize).count() as u64;
        }
        h
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_many_copies_are_an_error_that_names_the_parameter() {
        let corners = vec![DVec3::ZERO, DVec3::new(9.0, 1.0, 2.0), DVec3::new(1.0, 9.0, 3.0)];
        let scene =
            Scene { positions: corners, triangles: vec![[0, 1, 2]; 50], material_id: vec![0; 50], ..Scene::default() };
        let put: Put<'_, u32> = &|t, _, out| out.push(t);
        let plan = |depth| Plan { depth, leaf_limit: 0, entries_max: 3000, split: &|cell| cell.bounds.centre() };
        let e = Tree::grow(&scene, &scene.bounds(), plan(6), put).err().expect("50 large triangles at depth 6");
        assert_eq!(e.key.as_deref(), Some("depth"));
        assert!(e.message.contains("3000") && e.help.is_some(), "{e}");
        assert!(Tree::grow(&scene, &scene.bounds(), plan(1), put).is_ok());
    }
}
