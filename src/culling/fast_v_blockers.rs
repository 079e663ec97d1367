//! The blockers of [`super::fast_v`]: triangles that fill a frustum, alone or with those
//! that they are connected to.

use super::fast_v_facet::{Facet, Signs};
use super::fast_v_items::{Frame, Item};
use super::fast_v_lens::Rect;
use crate::hierarchy::NONE;

/// What one task knows of the surface: triangles on the image, set up when first asked for.
#[derive(Default)]
pub struct Surface {
    /// By triangle: where its facet is, or [`NONE`].
    slot: Vec<u32>,
    facets: Vec<Facet>,
    /// By triangle: the last growth that came to it.
    grown: Vec<u32>,
    growths: u32,
    queue: Vec<u32>,
    pub signs: Signs,
}

impl Surface {
    pub fn fit(&mut self, triangles: usize) {
        self.slot.resize(triangles, NONE);
        self.grown.resize(triangles, 0);
        if self.growths > u32::MAX / 2 {
            self.grown.fill(0);
            self.growths = 0;
        }
    }

    /// Forgets the image; returns how many triangles were set up on it.
    pub fn clear(&mut self) -> usize {
        let count = self.facets.len();
        for facet in self.facets.drain(..) {
            self.slot[facet.triangle as usize] = NONE;
        }
        count
    }

    /// The number of the next growth: what is to come is not less.
    pub fn next_growth(&self) -> u32 {
        self.growths + 1
    }

    /// Whether a growth since `first` came to the triangle.
    pub fn is_grown(&self, t: u32, first: u32) -> bool {
        self.grown[t as usize] >= first
    }

    /// Whether it may be a blocker that the ray at a point of the image hits.
    pub fn is_hit(&mut self, frame: &Frame, t: u32, at: [f64; 2]) -> bool {
        let facet = self.facet(frame, t);
        let facet = &self.facets[facet];
        facet.blocks && facet.covers(at, frame.lens, frame.mesh, &mut self.signs)
    }

    /// Whether a piece is in the frustum, borders included, and its part there not behind
    /// the key `far`; only where the latter is in question by its own keys, if `behind`.
    pub fn is_in(&mut self, frame: &Frame, cell: &Rect, item: &Item, far: f64, behind: bool) -> bool {
        let facet = self.facet(frame, frame.mesh.triangle_at(item.id));
        let facet = &self.facets[facet];
        let hidden = behind && facet.key_over(&item.rect.meet(cell))[1] < far;
        !hidden && !facet.avoids(cell, frame.lens, frame.mesh, &mut self.signs)
    }

    fn facet(&mut self, frame: &Frame, t: u32) -> usize {
        let known = self.slot[t as usize];
        if known != NONE {
            return known as usize;
        }
        self.slot[t as usize] = self.facets.len() as u32;
        self.facets.push(Facet::new(frame.lens, frame.mesh, t, &mut self.signs));
        self.facets.len() - 1
    }

    /// The least key of the blocker around `seed`, if there is one.
    pub fn grow(&mut self, frame: &Frame, seed: u32, cell: &Rect) -> Option<f64> {
        let (lens, mesh) = (frame.lens, frame.mesh);
        self.growths += 1;
        self.queue.clear();
        self.queue.push(seed);
        self.grown[seed as usize] = self.growths;
        let mut farthest = f64::INFINITY;
        let mut at = 0;
        while let Some(t) = self.queue.get(at).copied() {
            at += 1;
            let index = self.slot[t as usize] as usize;
            let facet = &self.facets[index];
            if !facet.is_beyond_near(cell, lens) {
                return None;
            }
            let [key, _] = if frame.options.clipped { facet.key_over(cell) } else { facet.plane_key_over(cell) };
            farthest = farthest.min(key);
            let turned = facet.turned;
            for k in 0..3 {
                if !self.facets[index].enters(k, cell, lens, mesh, &mut self.signs) {
                    continue;
                }
                let beyond = mesh.across(t, k).find(|(n, along)| {
                    let n = self.facet(frame, *n);
                    let facet = &self.facets[n];
                    // On the other side of the edge as seen.
                    facet.blocks && (facet.turned == turned) != *along
                });
                let (n, _) = beyond?;
                if self.grown[n as usize] != self.growths {
                    self.grown[n as usize] = self.growths;
                    self.queue.push(n);
                    if self.queue.len() > frame.options.grow {
                        return None;
                    }
                }
            }
        }
        Some(farthest)
    }
}
