//! The bracket `V_lo <= V* <= V_hi` of one frame, around what the samples see.
//!
//! V_lo gains what witness rays see ([`super::rays`]), V_hi loses what is proved
//! hidden ([`super::hiding`]). Rays go only at what neither decides: a proof says
//! that they could not succeed.

use super::bits::BitSet;
use super::footprint::Lens;
use super::image::{ANY, BACKGROUND, Grid, TileRuns};
use super::outline::{Outline, Screen};
use super::patch::Adjacency;
use super::rays::{Index, Witness, witnesses};
use super::sets::{Standing, faces_eye};
use super::{hiding, image};
use crate::math::predicates::{Facing, Predicates};
use crate::math::{DVec3, View};
use crate::record::Accuracy;
use crate::scene::Scene;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What frames of one scene share.
pub struct Effort {
    pub witness_rays: u32,
    pub hiding_cells: u32,
    adjacency: Option<Adjacency>,
}

impl Effort {
    /// Samples alone: no rays, no proof of hiding.
    pub const NONE: Effort = Effort { witness_rays: 0, hiding_cells: 0, adjacency: None };

    pub fn new(scene: &Scene, accuracy: &Accuracy) -> Effort {
        let (witness_rays, hiding_cells) = (accuracy.witness_rays, accuracy.hiding_cells);
        Effort { witness_rays, hiding_cells, adjacency: (hiding_cells > 0).then(|| Adjacency::new(scene)) }
    }
}

/// What goes beyond the samples.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Bracket {
    /// Triangles that no sample sees but a ray does, ascending.
    pub witnesses: Vec<Witness>,
    /// Proved hidden, by triangle, run-length coded; empty if no proof was tried.
    hidden: Vec<u8>,
    /// By winner of a sample where three or more surfaces tie: the others, perhaps
    /// more than these, ascending.
    pub ties: Vec<(u32, Vec<u32>)>,
}

impl Bracket {
    pub fn of(
        scene: &Scene,
        view: &View,
        standings: &[Standing],
        (grid, tiles): (Grid, &[TileRuns]),
        seen: &BitSet,
        effort: &Effort,
    ) -> Bracket {
        let any = any_samples(grid, tiles);
        if effort.witness_rays == 0 && effort.hiding_cells == 0 && any.is_empty() {
            return Bracket::default();
        }
        let screen = Screen::new(view);
        let outlines = outlines(scene, view, &screen, standings);
        let mut open = BitSet::new(scene.len());
        outlines.iter().filter(|o| !seen.contains(o.triangle)).for_each(|o| open.insert(o.triangle));
        let mut bracket = Bracket::default();
        if let Some(adjacency) = &effort.adjacency {
            open = hiding::not_hidden(&screen, &outlines, adjacency, scene.len(), &open, effort.hiding_cells);
            // Whatever is drawable without being seen or left is hidden.
            let hidden = (0u32..).zip(standings).map(|(t, s)| s.drawable() && !seen.contains(t) && !open.contains(t));
            bracket.hidden = image::encode_bytes(hidden.map(u8::from));
        }
        if effort.witness_rays == 0 && any.is_empty() {
            return bracket;
        }
        let index = Index::new(&screen, &outlines);
        if effort.witness_rays > 0 {
            let candidates: Vec<(&Outline, [DVec3; 3])> = outlines
                .iter()
                .filter(|o| open.contains(o.triangle))
                .map(|o| (o, scene.corners(o.triangle).map(|p| view.to_camera(p))))
                .collect();
            bracket.witnesses = witnesses(&screen, view, &index, &candidates, effort.witness_rays);
        }
        bracket.ties = ties(&index, &outlines, &Lens::new(view, grid), &any);
        bracket
    }

    /// Whether each triangle is proved hidden.
    pub fn hidden(&self, triangles: usize) -> BitSet {
        let mut set = BitSet::new(triangles);
        let mut at = 0;
        for (byte, count) in image::decode_bytes(&self.hidden) {
            if byte == 1 {
                (at..at + count as u32).for_each(|t| set.insert(t));
            }
            at += count as u32;
        }
        set
    }

    /// Triangles that may stand in for the winner of a sample with alternate [`ANY`];
    /// `None` if nothing is known of them.
    pub fn ties_of(&self, winner: u32) -> Option<&[u32]> {
        let at = self.ties.binary_search_by_key(&winner, |t| t.0).ok()?;
        Some(&self.ties[at].1)
    }

    pub fn bytes(&self) -> usize {
        let lists = self.ties.iter().map(|t| 4 * t.1.len()).sum::<usize>();
        self.hidden.len() + lists + self.witnesses.iter().map(|w| 4 + 4 * w.tied.len()).sum::<usize>()
    }
}

/// The triangles of the exact set that may have a part of the image, ascending.
pub fn outlines(scene: &Scene, view: &View, screen: &Screen, standings: &[Standing]) -> Vec<Outline> {
    const CHUNK: usize = 4096;
    let parts: Vec<Vec<Outline>> = standings
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, standings)| {
            let drawn = standings.iter().enumerate().filter(|(_, s)| s.drawable());
            drawn
                .filter_map(|(i, _)| {
                    let t = (chunk * CHUNK + i) as u32;
                    let corners = scene.corners(t);
                    let camera = corners.map(|p| view.to_camera(p));
                    let outline = Outline::new(screen, t, scene.occluder[t as usize], &camera)?;
                    // Exactly edge-on it has no image; only two-sided ones get here.
                    let edge_on = || faces_eye(view, &corners, &mut Predicates::default()) == Facing::EdgeOn;
                    (outline.solid || !edge_on()).then_some(outline)
                })
                .collect()
        })
        .collect();
    parts.concat()
}

/// Samples at which three or more surfaces tie: winner, column, row.
fn any_samples(grid: Grid, tiles: &[TileRuns]) -> Vec<(u32, u32, u32)> {
    let mut samples = Vec::new();
    for (index, tile) in (0u32..).zip(tiles) {
        tile.for_each(grid.tile(index), |run| {
            if run.alternate == ANY && run.winner != BACKGROUND {
                samples.extend((run.x..run.x + run.len).map(|x| (run.winner - 1, x, run.y)));
            }
        });
    }
    samples
}

/// All that may tie with each winner at any of its samples.
fn ties(index: &Index, outlines: &[Outline], lens: &Lens, samples: &[(u32, u32, u32)]) -> Vec<(u32, Vec<u32>)> {
    let mut of: BTreeMap<u32, Vec<[f64; 2]>> = BTreeMap::new();
    for (winner, x, y) in samples {
        of.entry(*winner).or_default().push([lens.xs[*x as usize], lens.ys[*y as usize]]);
    }
    let of: Vec<(u32, Vec<[f64; 2]>)> = of.into_iter().collect();
    of.into_par_iter()
        .filter_map(|(winner, places)| {
            let at = outlines.binary_search_by_key(&winner, |o| o.triangle).ok()?;
            let (mut tied, mut stack) = (Vec::new(), Vec::new());
            for place in places {
                index.ties(&outlines[at], place, &mut stack, &mut tied);
                tied.sort_unstable();
                tied.dedup();
            }
            Some((winner, tied))
        })
        .collect()
}
