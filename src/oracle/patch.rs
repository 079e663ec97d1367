//! Connected patches that cover a cell of the image: a blocker need not be one triangle.
//!
//! The idea is that of Chandak et al., "FastV: From-point Visibility Culling on
//! Complex Models" (2009): grow a blocker over shared edges until no edge inside
//! the frustum is left open. Here on the image plane with certain signs.
//!
//! Why a grown patch covers the cell: every triangle faces the eye with the same
//! turn, and every side that may enter the cell is shared by exactly two triangles
//! of the patch that lie on its two sides. So near every point of the cell that
//! the patch reaches, it reaches all points around it (at a corner the triangles
//! close to whole turns). What it covers of the cell is thus open and closed in
//! the cell, and not empty, since the seed holds the centre: it is all of it. No
//! distance is compared, so shared edges leave no crack.

use super::outline::{Outline, Rect, Screen};
use crate::math::DVec3;
use crate::scene::Scene;
use std::collections::HashMap;

/// No neighbour: a free side, or one of three or more triangles.
const NONE: u32 = u32::MAX;
/// Larger patches are given up: a smaller cell needs a smaller patch.
const LARGEST: usize = 256;

/// Neighbours over sides, corners welded by position.
#[derive(Debug, Clone)]
pub struct Adjacency {
    /// By triangle and side (opposite corner k): the neighbour, and whether both
    /// run through the side in the same direction.
    neighbours: Vec<[(u32, bool); 3]>,
}

impl Adjacency {
    pub fn new(scene: &Scene) -> Adjacency {
        let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(scene.positions.len());
        // Adding zero makes one of the two zeros.
        let bits = |p: &DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        let welded: Vec<u32> =
            (0u32..).zip(&scene.positions).map(|(i, p)| *first.entry(bits(p)).or_insert(i)).collect();
        let mut sides: Vec<(u64, u32)> = Vec::with_capacity(3 * scene.len());
        let ends = |t: u32, k: usize| {
            let v = scene.triangles[t as usize].map(|v| welded[v as usize]);
            (v[(k + 1) % 3], v[(k + 2) % 3])
        };
        for t in 0..scene.len() as u32 {
            for k in 0..3 {
                let (a, b) = ends(t, k);
                sides.push((u64::from(a.min(b)) << 32 | u64::from(a.max(b)), 3 * t + k as u32));
            }
        }
        sides.sort_unstable();
        let mut neighbours = vec![[(NONE, false); 3]; scene.len()];
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, s), (_, o)] = group {
                let side = |i: u32| (i / 3, (i % 3) as usize);
                let ((t, k), (u, l)) = (side(*s), side(*o));
                let same = ends(t, k) == ends(u, l);
                // A triangle with two equal corners has no area to cover anything.
                if t != u {
                    neighbours[t as usize][k] = (u, same);
                    neighbours[u as usize][l] = (t, same);
                }
            }
        }
        Adjacency { neighbours }
    }
}

/// Outlines of a frame and where to find that of a triangle.
pub struct Faces<'a> {
    pub screen: &'a Screen,
    pub outlines: &'a [Outline],
    /// By triangle: index into `outlines`, or `u32::MAX`.
    pub index: &'a [u32],
    pub adjacency: &'a Adjacency,
}

impl Faces<'_> {
    /// Grows `seed`, which covers the centre of `cell`, to a patch that certainly
    /// covers all of it, beyond the near plane; indices into `outlines`.
    pub fn grow(&self, seed: u32, cell: &Rect) -> Option<Vec<u32>> {
        let mut patch = vec![seed];
        let mut next = 0;
        while let Some(at) = patch.get(next).copied() {
            next += 1;
            let outline = &self.outlines[at as usize];
            // Over the whole cell, not its rectangle alone: that bounds only what the
            // near plane leaves.
            let beyond_near = outline.key_over(cell)[1] <= self.screen.key_clear();
            if !(outline.solid && outline.occluder && beyond_near) {
                return None;
            }
            for k in (0..3).filter(|k| outline.side_enters(*k, cell)) {
                let (neighbour, same_direction) = self.adjacency.neighbours[outline.triangle as usize][k];
                if neighbour == NONE {
                    return None;
                }
                let other = self.index[neighbour as usize];
                let faces = self.outlines.get(other as usize)?;
                // As seen, they must run through the side in opposite directions.
                if (outline.turned == faces.turned) == same_direction {
                    return None;
                }
                if !patch.contains(&other) {
                    if patch.len() == LARGEST {
                        return None;
                    }
                    patch.push(other);
                }
            }
        }
        Some(patch)
    }
}
