//! Judgement: what a method submitted against the truth of the frame.
//!
//! Only what is proved counts as lost: a triangle (or a piece of a split one)
//! certainly in the set that the method owes, or the first hit of a sample ray
//! that no submitted surface at the same depth replaces.

use super::bits::BitSet;
use super::footprint::Lens;
use super::image::{ANY, BACKGROUND, Grid, Run};
use super::volume::triangle_meets;
use super::{FrameTruth, Standing};
use crate::culling::{Class, Removes};
use crate::math::{DVec3, View};
use crate::record::FrameErrors;
use crate::scene::Scene;
use std::collections::{BTreeMap, BTreeSet};

/// What one frame submits.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Submitted {
    /// Triangles of which anything was submitted.
    pub triangles: BitSet,
    /// Pieces of split triangles that were not submitted: triangle and corners.
    pub lost_pieces: Vec<(u32, [DVec3; 3])>,
}

impl Submitted {
    /// Nothing, of a scene of `len` triangles.
    pub fn none(len: usize) -> Submitted {
        Submitted { triangles: BitSet::new(len), lost_pieces: Vec::new() }
    }
}

/// How many lost ids a record names.
const NAMED: usize = 8;

/// A judgement with every lost triangle, ascending.
#[derive(Debug, Clone, PartialEq)]
pub struct Losses {
    pub errors: FrameErrors,
    /// Missing in the picture.
    pub seen: Vec<u32>,
    /// Owed and missing, though hidden from every sample.
    pub hidden: Vec<u32>,
}

/// Judges what was submitted for `view`. `submitted_entries` is the number of
/// distinct triangles; callers that submit duplicates raise it.
///
/// `potential_lost` is judged in object space and therefore 0 for a method that
/// may remove hidden triangles.
///
/// # Panics
/// If `truth` or `submitted` is not of this scene.
pub fn judge_frame(
    scene: &Scene,
    view: &View,
    truth: &FrameTruth,
    submitted: &Submitted,
    removes: Removes,
) -> FrameErrors {
    losses(scene, view, truth, submitted, removes).errors
}

/// [`judge_frame`] with all that was lost.
pub fn losses(scene: &Scene, view: &View, truth: &FrameTruth, submitted: &Submitted, removes: Removes) -> Losses {
    let standings = truth.standings();
    assert_eq!(standings.len(), scene.len(), "truth of this scene");
    assert_eq!(submitted.triangles.len(), scene.len(), "a bit for every triangle");
    let lost_pieces = owed_pieces(view, &standings, submitted, removes);

    // Object space.
    let mut potential = 0;
    let mut potential_lost = BTreeSet::new();
    for (t, standing) in (0u32..).zip(&standings) {
        potential += u64::from(standing.maybe_potential(removes));
        if standing.certainly_potential(removes) && !submitted.triangles.contains(t) {
            potential_lost.insert(t);
        }
    }
    potential_lost.extend(lost_pieces.keys());
    if removes.occluded {
        potential_lost.clear();
    }

    // Image space.
    let mut image = LossImage::new(truth.grid);
    let mut seen_lost = BTreeSet::new();
    let lens = Lens::new(view, truth.grid);
    let judge = SampleJudge { scene, view, lens: &lens, submitted, lost_pieces: &lost_pieces };
    for (index, tile) in (0u32..).zip(&truth.tiles) {
        tile.for_each(truth.grid.tile(index), |run| judge.run(run, &mut image, &mut seen_lost));
        for v in &tile.veils {
            let run = Run { x: v.x, y: v.y, len: v.len, winner: v.id, alternate: BACKGROUND };
            judge.run(run, &mut image, &mut seen_lost);
        }
    }

    let count = submitted.triangles.count();
    let seen: Vec<u32> = seen_lost.iter().copied().collect();
    let hidden: Vec<u32> = potential_lost.difference(&seen_lost).copied().collect();
    // What is missed in the picture first, then what is missing behind it.
    let named = seen.iter().chain(&hidden).take(NAMED);
    let errors = FrameErrors {
        frame: truth.frame,
        submitted: count,
        submitted_entries: count,
        visible: truth.visible.len() as u64,
        potential,
        false_culls: seen.len() as u64,
        potential_lost: potential_lost.len() as u64,
        false_cull_pixels: image.lost.count(),
        covered_pixels: truth.covered_pixels,
        pixels: u64::from(truth.grid.width_px) * u64::from(truth.grid.height_px),
        largest_blob_px: image.largest_blob(),
        visible_hi: standings.iter().filter(|s| s.drawable()).count() as u64,
        lost_ids: named.map(|t| scene.source_triangle_id[*t as usize]).collect(),
        ..FrameErrors::default()
    };
    Losses { errors, seen, hidden }
}

/// Unsubmitted pieces of partly submitted triangles that the method owes.
fn owed_pieces(
    view: &View,
    standings: &[Standing],
    submitted: &Submitted,
    removes: Removes,
) -> BTreeMap<u32, Vec<[DVec3; 3]>> {
    let mut owed: BTreeMap<u32, Vec<[DVec3; 3]>> = BTreeMap::new();
    for (t, corners) in &submitted.lost_pieces {
        let whole = standings[*t as usize];
        // A triangle without any submitted piece is lost as a whole, and a piece of
        // a triangle outside is outside.
        if !submitted.triangles.contains(*t) || !whole.maybe_potential(removes) {
            continue;
        }
        // The corners of a piece are rounded; its facing is that of the whole.
        let piece = Standing { meets: triangle_meets(view, corners), ..whole };
        if piece.certainly_potential(removes) {
            owed.entry(*t).or_default().push(*corners);
        }
    }
    owed
}

struct SampleJudge<'a> {
    scene: &'a Scene,
    view: &'a View,
    lens: &'a Lens,
    submitted: &'a Submitted,
    lost_pieces: &'a BTreeMap<u32, Vec<[DVec3; 3]>>,
}

impl SampleJudge<'_> {
    fn run(&self, run: Run, image: &mut LossImage, seen_lost: &mut BTreeSet<u32>) {
        if run.winner == BACKGROUND || run.alternate == ANY {
            return;
        }
        let t = run.winner - 1;
        debug_assert!((t as usize) < self.scene.len());
        let replaced = run.alternate != BACKGROUND && self.drawn_whole(run.alternate - 1);
        if replaced || self.drawn_whole(t) {
            return;
        }
        for x in run.x..run.x + run.len {
            let hit = |id: u32| id != BACKGROUND && self.drawn_at(id - 1, x, run.y);
            if !hit(run.winner) && !hit(run.alternate) {
                image.lost.insert(image.grid.pixel(x, run.y) as u32);
                seen_lost.insert(t);
            }
        }
    }

    fn drawn_whole(&self, t: u32) -> bool {
        self.submitted.triangles.contains(t) && !self.lost_pieces.contains_key(&t)
    }

    /// Not certainly missing at this sample.
    fn drawn_at(&self, t: u32, x: u32, y: u32) -> bool {
        let camera = |piece: &[DVec3; 3]| piece.map(|p| self.view.to_camera(p));
        self.submitted.triangles.contains(t)
            && !self.lost_pieces.get(&t).is_some_and(|p| p.iter().any(|p| self.lens.covers(&camera(p), x, y)))
    }
}

/// The pixels that show something else than they should.
struct LossImage {
    grid: Grid,
    lost: BitSet,
}

impl LossImage {
    fn new(grid: Grid) -> LossImage {
        LossImage { grid, lost: BitSet::new(grid.width_px as usize * grid.height_px as usize) }
    }

    /// Size of the largest 4-connected region.
    fn largest_blob(&self) -> u64 {
        let (width, mut rest) = (self.grid.width_px, self.lost.clone());
        let mut largest = 0;
        let mut pending = Vec::new();
        for start in self.lost.iter() {
            if !rest.contains(start) {
                continue;
            }
            rest.remove(start);
            pending.push(start);
            let mut size = 0;
            while let Some(pixel) = pending.pop() {
                size += 1;
                let x = pixel % width;
                let neighbours = [
                    (x > 0).then(|| pixel - 1),
                    (x + 1 < width).then(|| pixel + 1),
                    pixel.checked_sub(width),
                    Some(pixel + width).filter(|p| (*p as usize) < rest.len()),
                ];
                for n in neighbours.into_iter().flatten() {
                    if rest.contains(n) {
                        rest.remove(n);
                        pending.push(n);
                    }
                }
            }
            largest = largest.max(size);
        }
        largest
    }
}

/// Why a method is wrong for its declared class, if it is.
///
/// Conservative methods may lose nothing that is proved to be owed, seen or not;
/// sample-conservative ones nothing that a sample sees; exact ones, moreover, may
/// not submit more than the set. Errors of the others are data.
pub fn verdict(class: Class, frames: &[FrameErrors]) -> Option<String> {
    let wrong: Vec<String> = frames.iter().filter_map(|f| reason(class, f)).collect();
    let more = match wrong.len() {
        0 => return None,
        1 => String::new(),
        n => format!("; {} more of {} judged frames are wrong", n - 1, frames.len()),
    };
    Some(format!("{}{more}", wrong[0]))
}

fn reason(class: Class, f: &FrameErrors) -> Option<String> {
    let (seen, owed) = match class {
        Class::Exact | Class::Conservative => (f.false_culls, f.potential_lost),
        Class::SampleConservative => (f.false_culls, 0),
        Class::Aggressive | Class::Approximate => return None,
    };
    let lost = seen.max(owed);
    if lost > 0 {
        let ids = f.lost_ids.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
        let triangles = if lost == 1 { "1 triangle, id".into() } else { format!("{lost} triangles, first ids") };
        let place = match (seen, f.false_cull_pixels) {
            (0, _) => "in the view volume, though hidden from every sample".to_string(),
            (_, 1) => "seen in 1 pixel".to_string(),
            (_, n) => format!("seen in {n} pixels"),
        };
        return Some(format!("frame {}: lost {triangles} {ids} ({place})", f.frame));
    }
    (class == Class::Exact && f.submitted > f.potential).then(|| {
        format!("frame {}: submitted {} triangles, but the exact set holds {}", f.frame, f.submitted, f.potential)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blobs_are_joined_by_sides_not_by_corners() {
        let mut image = LossImage::new(Grid { width_px: 5, height_px: 4, samples: 1 });
        // Row ends are no neighbours: pixel 4 (end of row 0) and 5 (start of row 1).
        for pixel in [0, 1, 4, 5, 7, 12, 13, 16] {
            image.lost.insert(pixel);
        }
        assert_eq!(image.largest_blob(), 3, "0, 1 and 5; likewise 7, 12 and 13");
    }

    #[test]
    fn a_verdict_names_frame_ids_and_pixels() {
        let lost = FrameErrors {
            frame: 12,
            false_culls: 3,
            potential_lost: 3,
            false_cull_pixels: 240,
            lost_ids: vec![17, 20, 33],
            ..Default::default()
        };
        let fine = FrameErrors { frame: 3, submitted: 5, potential: 4, ..Default::default() };
        let frames = [fine.clone(), lost.clone()];
        assert_eq!(
            verdict(Class::Conservative, &frames).unwrap(),
            "frame 12: lost 3 triangles, first ids 17, 20, 33 (seen in 240 pixels)"
        );
        assert_eq!(verdict(Class::Aggressive, &frames), None);
        let hidden = FrameErrors { false_culls: 0, false_cull_pixels: 0, ..lost };
        assert!(
            verdict(Class::Conservative, std::slice::from_ref(&hidden)).unwrap().contains("hidden from every sample")
        );
        assert_eq!(verdict(Class::SampleConservative, &[hidden]), None);
        assert!(verdict(Class::Exact, std::slice::from_ref(&fine)).unwrap().contains("the exact set holds 4"));
        assert_eq!(verdict(Class::Conservative, &[fine]), None);
    }
}
