//! The oracle: ground truth of a frame, and the judgement of what was submitted.
//!
//! Lower bounds on what a method must submit. The first and the last carry bounds of
//! their rounding; the item buffer is f64 and as good as that along edges:
//! - the exact sets ([`sets`]): triangles that certainly meet the view volume and
//!   face the eye, seen or hidden;
//! - the item buffer ([`item_buffer`]): triangles that a sample ray hits first;
//! - witness rays ([`rays`]) at what no sample sees. With the samples they make
//!   V_lo, a subset of the visible set V*.
//!
//! An upper bound: V_hi ([`hiding`]), the exact set without what is proved hidden.
//! For small scenes V* itself is found by clipping ([`clipping`]).
//!
//! The oracle imports no hierarchy, no raster kernel and no algorithm that it
//! judges: of `culling` only the plain types that name a promise. Truth is a
//! function of scene, camera, pose and accuracy, computed once ([`cache`]) and
//! shared by every method; it is the same at any number of threads.

pub mod bits;
pub mod bracket;
pub mod cache;
pub mod clipping;
pub mod footprint;
pub mod hiding;
pub mod image;
pub mod item_buffer;
pub mod judge;
pub mod lanes;
pub mod lines;
pub mod outline;
pub mod patch;
pub mod rays;
pub mod set_up;
pub mod sets;
mod sets_lanes;
pub mod tile;
pub mod verdict;
pub mod volume;

pub use crate::record::observed_class;
pub use bits::BitSet;
pub use bracket::{Bracket, Effort};
pub use cache::truth_cached;
pub use judge::{Losses, Submitted, judge_frame, losses};
pub use verdict::verdict;

use crate::math::{Camera, Pose, View};
use crate::record::Accuracy;
use crate::scene::Scene;
use image::{BACKGROUND, Grid, TileRuns};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sets::Standing;

/// Part of every cached file.
pub use crate::record::ORACLE_REVISION as REVISION;

/// Truth of the judged frames of one scene, camera and path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    pub scene_triangles: u32,
    pub frames: Vec<FrameTruth>,
}

impl Truth {
    pub fn frame(&self, frame: u32) -> Option<&FrameTruth> {
        self.frames.iter().find(|f| f.frame == frame)
    }
}

/// Truth of one frame, compact: run-length coded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameTruth {
    pub frame: u32,
    pub grid: Grid,
    /// Exact standing of every triangle; see [`FrameTruth::standings`].
    standings: Vec<u8>,
    /// Triangles that at least one sample sees, ascending, with their sample counts.
    pub visible: Vec<(u32, u32)>,
    /// What V_lo and V_hi know beyond the samples.
    pub bracket: Bracket,
    /// Item image by tile of [`Grid`].
    pub tiles: Vec<TileRuns>,
    /// Pixels of which a sample sees anything.
    pub covered_pixels: u64,
    /// Facing predicates asked, and those that needed exact arithmetic.
    pub predicate_calls: u64,
    pub predicate_fallbacks: u64,
    /// Triangles so close to the boundary of the view volume that rounding hides the answer.
    pub uncertain: u64,
}

impl FrameTruth {
    /// Standing of every triangle in scene order.
    pub fn standings(&self) -> Vec<Standing> {
        let mut all = Vec::new();
        for (byte, count) in image::decode_bytes(&self.standings) {
            let standing = Standing::from_byte(byte).expect("written by `of`");
            all.resize(all.len() + count, standing);
        }
        all
    }

    /// Computes the truth of `view` from samples alone.
    pub fn of(scene: &Scene, view: &View, frame: u32, grid: Grid) -> FrameTruth {
        Self::with(scene, view, frame, grid, &Effort::NONE)
    }

    /// The same with witness rays and proofs of hiding.
    pub fn with(scene: &Scene, view: &View, frame: u32, grid: Grid, effort: &Effort) -> FrameTruth {
        let (standings, predicates) = sets::standings(scene, view);
        let tiles = item_buffer::draw(scene, view, &standings, grid);
        let (counts, covered_pixels) = count_samples(scene.len(), grid, &tiles);
        let visible: Vec<(u32, u32)> = (0u32..).zip(counts).filter(|(_, n)| *n > 0).collect();
        let mut seen = BitSet::new(scene.len());
        visible.iter().for_each(|(t, _)| seen.insert(*t));
        FrameTruth {
            frame,
            grid,
            bracket: Bracket::of(scene, view, &standings, (grid, &tiles), &seen, effort),
            visible,
            tiles,
            covered_pixels,
            predicate_calls: predicates.calls,
            predicate_fallbacks: predicates.fallbacks,
            uncertain: standings.iter().filter(|s| s.meets == volume::Meets::Uncertain).count() as u64,
            standings: image::encode_bytes(standings.iter().map(|s| s.to_byte())),
        }
    }

    /// V_lo: what a sample or a witness ray sees.
    pub fn lo(&self) -> BitSet {
        let len: usize = image::decode_bytes(&self.standings).map(|(_, n)| n).sum();
        let mut set = BitSet::new(len);
        self.visible.iter().for_each(|(t, _)| set.insert(*t));
        self.bracket.witnesses.iter().for_each(|w| set.insert(w.triangle));
        set
    }

    /// V_hi: may be part of an image and is not proved hidden.
    pub fn hi(&self) -> BitSet {
        let standings = self.standings();
        let hidden = self.bracket.hidden(standings.len());
        let mut set = BitSet::new(standings.len());
        let kept = (0u32..).zip(&standings).filter(|(t, s)| s.drawable() && !hidden.contains(*t));
        kept.for_each(|(t, _)| set.insert(t));
        set
    }

    /// Triangle + 1 by sample, row-major from the top left; for tests and pictures.
    pub fn item_image(&self) -> Vec<u32> {
        let mut out = vec![BACKGROUND; self.grid.columns() as usize * self.grid.rows() as usize];
        for (index, tile) in (0u32..).zip(&self.tiles) {
            tile.for_each(self.grid.tile(index), |run| {
                let at = run.y as usize * self.grid.columns() as usize + run.x as usize;
                out[at..at + run.len as usize].fill(run.winner);
            });
        }
        out
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        let tiles = self.tiles.iter().map(TileRuns::bytes).sum::<usize>();
        self.standings.len() + size_of_val(&self.visible[..]) + self.bracket.bytes() + tiles
    }
}

fn count_samples(triangles: usize, grid: Grid, tiles: &[TileRuns]) -> (Vec<u32>, u64) {
    let mut counts = vec![0u32; triangles];
    let mut covered = BitSet::new(grid.width_px as usize * grid.height_px as usize);
    let mut cover = |x: u32, y: u32, len: u32| {
        for px in x / grid.samples..=(x + len - 1) / grid.samples {
            covered.insert(y / grid.samples * grid.width_px + px);
        }
    };
    for (index, tile) in (0u32..).zip(tiles) {
        tile.for_each(grid.tile(index), |run| {
            if run.winner != BACKGROUND {
                counts[run.winner as usize - 1] += run.len;
                cover(run.x, run.y, run.len);
            }
        });
        for veil in &tile.veils {
            counts[veil.id as usize - 1] += veil.len;
            cover(veil.x, veil.y, veil.len);
        }
    }
    (counts, covered.count())
}

/// Truth of `poses` (frame number and pose). Frames run in parallel.
pub fn truth(scene: &Scene, camera: &Camera, poses: &[(u32, Pose)], accuracy: &Accuracy) -> Truth {
    let grid = Grid::of(accuracy);
    let effort = Effort::new(scene, accuracy);
    let frames =
        poses.par_iter().map(|(frame, pose)| FrameTruth::with(scene, &View::new(camera, pose), *frame, grid, &effort));
    Truth { scene_triangles: scene.len() as u32, frames: frames.collect() }
}

/// The frames to judge of a path of `frame_count`: spread evenly, the first and
/// the last among them; all of them if there are no more than asked for.
pub fn judged_frames(frame_count: u32, accuracy: &Accuracy) -> Vec<u32> {
    let wanted = accuracy.frames.min(frame_count);
    match wanted {
        0 => Vec::new(),
        1 => vec![0],
        _ => {
            let (last, steps) = (u64::from(frame_count - 1), u64::from(wanted - 1));
            (0..=steps).map(|i| ((i * last + steps / 2) / steps) as u32).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn judged_frames_are_even_and_hold_both_ends() {
        let judged = |count, frames| {
            judged_frames(count, &Accuracy { frames, width_px: 8, height_px: 8, samples: 1, ..Accuracy::default() })
        };
        assert_eq!(judged(2000, 5), [0, 500, 1000, 1499, 1999]);
        assert_eq!(judged(3, 24), [0, 1, 2]);
        assert_eq!(judged(10, 1), [0]);
        assert_eq!(judged(10, 2), [0, 9]);
        assert_eq!((judged(0, 3), judged(9, 0)), (vec![], vec![]));
        let spread = judged(1999, 24);
        assert!(spread.len() == 24 && spread.windows(2).all(|w| w[1] - w[0] >= 86 && w[1] - w[0] <= 88));
    }
}
