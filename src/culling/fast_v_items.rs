//! What the frusta of [`super::fast_v`] hold: nodes, and pieces of triangles, with what they
//! show on the image at most and how near they come.

use super::fast_v_facet::{Signs, is_drawn, place};
use super::fast_v_lens::{Lens, Rect, U};
use super::fast_v_mesh::Mesh;
use crate::hierarchy::{Hierarchy, LANES};
use crate::math::DVec3;
use std::cmp::Ordering;

#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// The finest frusta are 2^levels to a side.
    pub levels: u32,
    /// A frustum with no more triangles is not divided; 0 divides all.
    pub enough: usize,
    /// Most triangles of a blocker.
    pub grow: usize,
    /// Depth is that of what lies in the frustum, not that of planes and whole triangles.
    pub clipped: bool,
}

/// One frame.
pub struct Frame<'a> {
    pub lens: &'a Lens,
    pub mesh: &'a Mesh,
    pub hierarchy: &'a Hierarchy,
    /// By block: lanes that the tests left, as far as they were asked.
    pub kept: &'a [u8],
    /// By block: lanes below which nobody was asked, as all is inside.
    pub settled: &'a [u8],
    pub options: Options,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `id` is a node.
    Node,
    /// `id` is a position.
    Piece,
    /// Opened, or found to be outside.
    Gone,
}

/// A node or a piece of triangle that may be seen in a frustum.
#[derive(Debug, Clone, Copy)]
pub struct Item {
    pub rect: Rect,
    /// Of the nearest point.
    pub key: f64,
    /// Of the farthest point of a piece's triangle.
    pub key_min: f64,
    pub id: u32,
    pub kind: Kind,
    /// Below this node all is kept.
    pub settled: bool,
}

/// Nearest first; then in the order of the list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Next {
    pub key: f64,
    pub at: usize,
}

impl Eq for Next {}

impl PartialOrd for Next {
    fn partial_cmp(&self, o: &Next) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}

impl Ord for Next {
    fn cmp(&self, o: &Next) -> Ordering {
        self.key.total_cmp(&o.key).then(o.at.cmp(&self.at))
    }
}

impl Frame<'_> {
    pub fn roots(&self) -> Vec<Item> {
        let mut items = Vec::new();
        for block in 0..self.hierarchy.root_blocks {
            self.lanes(block, self.kept[block as usize], false, |item| items.push(item));
        }
        items
    }

    /// The nodes of a block that `kept` names and that may be seen at all.
    pub fn lanes(&self, block: u32, kept: u8, settled: bool, mut take: impl FnMut(Item)) {
        let mut rest = kept;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            if let Some((rect, key)) = self.lens.node(&self.hierarchy.bounds[block as usize], lane) {
                let settled = settled || self.settled[block as usize] >> lane & 1 == 1;
                take(Item {
                    rect,
                    key,
                    key_min: f64::NEG_INFINITY,
                    id: block * LANES as u32 + lane as u32,
                    kind: Kind::Node,
                    settled,
                });
            }
        }
    }

    /// What of the piece at `position` may be seen through its node.
    pub fn piece(&self, position: u32, node: &Item, signs: &mut Signs) -> Option<Item> {
        let t = self.mesh.triangle_at(position);
        let corners = self.mesh.corners(t);
        if !is_drawn(self.lens, self.mesh, t, &corners, signs) {
            return None;
        }
        let (rect, [key_min, key]) = match &self.hierarchy.fragments {
            None => place(self.lens, &corners, 0.0)?,
            Some(fragments) => {
                // Corners of fragments were rounded once a cut.
                let piece = &fragments[position as usize];
                let size = |p: &DVec3| p.abs().max_element();
                let error = 4096.0 * U * (piece.iter().map(size).fold(0.0, f64::max) + size(&self.lens.eye));
                place(self.lens, piece, error)?
            }
        };
        let (rect, key) = (rect.meet(&node.rect), key.min(node.key));
        Some(Item { rect, key, key_min, id: position, kind: Kind::Piece, ..*node })
    }
}
