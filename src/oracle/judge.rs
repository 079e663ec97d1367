//! Judgement: what a method submitted against the truth of the frame.
//!
//! Only what is proved counts as lost: a triangle (or a piece of a split one)
//! certainly in the set that the method owes, or the first hit of a sample or
//! witness ray that no submitted surface at the same depth replaces.

use super::bits::BitSet;
use super::footprint::Lens;
use super::image::{ANY, BACKGROUND, Grid, Run, TileRect};
use super::outline::{Outline, Screen};
use super::volume::{Meets, triangle_meets};
use super::{FrameTruth, Standing};
use crate::culling::Removes;
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
    let lens = Lens::new(view, truth.grid);
    let screen = Screen::new(view);
    let (lens, standings) = (&lens, &standings[..]);
    let judge = SampleJudge { scene, view, truth, standings, lens, screen, submitted, lost_pieces: &lost_pieces };
    let mut found = Findings::new(truth.grid);
    for (index, tile) in (0u32..).zip(&truth.tiles) {
        let rect = truth.grid.tile(index);
        found.lost_here.clear();
        tile.for_each(rect, |run| judge.run(run, rect, &mut found));
        for v in &tile.veils {
            let run = Run { x: v.x, y: v.y, len: v.len, winner: v.id, alternate: BACKGROUND };
            judge.run(run, rect, &mut found);
        }
        found.samples += found.lost_here.count();
    }
    let by_ray = judge.witnesses(&mut found);

    let count = submitted.triangles.count();
    let (lo, hi) = (truth.lo(), truth.hi());
    let beyond = |bound: &BitSet| submitted.triangles.iter().filter(|t| !bound.contains(*t)).count() as u64;
    let image = &found.image;
    let seen: Vec<u32> = found.seen_lost.iter().copied().collect();
    let hidden: Vec<u32> = potential_lost.difference(&found.seen_lost).copied().collect();
    // What is missed in the picture first, then what is missing behind it.
    let named = seen.iter().chain(&hidden).take(NAMED);
    let errors = FrameErrors {
        frame: truth.frame,
        submitted: count,
        submitted_entries: count,
        visible: lo.count(),
        visible_hi: hi.count(),
        submitted_unseen: beyond(&lo) - found.stand_ins(&lo, &submitted.triangles),
        submitted_invisible: beyond(&hi),
        potential,
        false_culls: seen.len() as u64,
        false_culls_by_ray: by_ray,
        potential_lost: potential_lost.len() as u64,
        false_cull_pixels: image.lost.count(),
        false_cull_samples: found.samples,
        samples: u64::from(truth.grid.columns()) * u64::from(truth.grid.rows()),
        covered_pixels: truth.covered_pixels,
        pixels: u64::from(truth.grid.width_px) * u64::from(truth.grid.height_px),
        largest_blob_px: image.largest_blob(),
        lost_ids: named.map(|t| scene.source_triangle_id[*t as usize]).collect(),
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
    truth: &'a FrameTruth,
    standings: &'a [Standing],
    lens: &'a Lens,
    screen: Screen,
    submitted: &'a Submitted,
    lost_pieces: &'a BTreeMap<u32, Vec<[DVec3; 3]>>,
}

/// What the picture of the submitted set lacks.
struct Findings {
    image: LossImage,
    seen_lost: BTreeSet<u32>,
    /// Members of V_lo that were not submitted, and the equal surface drawn in their place.
    replaced: BTreeMap<u32, BTreeSet<u32>>,
    /// Samples of the tile in work that see something else.
    lost_here: BitSet,
    samples: u64,
}

impl Findings {
    fn new(grid: Grid) -> Findings {
        let side = grid.tile_side() as usize;
        Findings {
            image: LossImage::new(grid),
            seen_lost: BTreeSet::new(),
            replaced: BTreeMap::new(),
            lost_here: BitSet::new(side * side),
            samples: 0,
        }
    }

    /// The sample shows something else than `t`.
    fn lose(&mut self, t: u32, x: u32, y: u32, rect: TileRect) {
        self.image.lost.insert(self.image.grid.pixel(x, y) as u32);
        self.lost_here.insert((y - rect.y0) * rect.width() as u32 + x - rect.x0);
        self.seen_lost.insert(t);
    }

    /// `other` is drawn where `t` would be seen.
    fn stands_in(&mut self, submitted: &Submitted, t: u32, other: u32) {
        if !submitted.triangles.contains(t) {
            self.replaced.entry(t).or_default().insert(other);
        }
    }

    /// Submitted triangles outside V_lo that are drawn for an equal one inside it:
    /// one each, since a class of equal surfaces is one thing to see.
    fn stand_ins(&self, lo: &BitSet, submitted: &BitSet) -> u64 {
        let free = |o: &&u32| submitted.contains(**o) && !lo.contains(**o);
        // Where surfaces meet, a sample on the edge may be either's: as many pairs as
        // can be made at all, by augmenting paths (Berge 1957).
        let mut taken: BTreeMap<u32, u32> = BTreeMap::new();
        for member in self.replaced.keys().filter(|m| !self.seen_lost.contains(m)) {
            // Each step: a member that looks for a partner, and who asked it to move.
            let mut asked_by: BTreeMap<u32, (u32, Option<u32>)> = BTreeMap::new();
            let mut waiting = vec![(*member, None)];
            let mut found = None;
            'search: while let Some((seeker, through)) = waiting.pop() {
                for other in self.replaced[&seeker].iter().filter(free) {
                    if asked_by.contains_key(other) {
                        continue;
                    }
                    asked_by.insert(*other, (seeker, through));
                    match taken.get(other) {
                        Some(owner) => waiting.push((*owner, Some(*other))),
                        None => {
                            found = Some(*other);
                            break 'search;
                        }
                    }
                }
            }
            while let Some(other) = found {
                let (seeker, through) = asked_by[&other];
                taken.insert(other, seeker);
                found = through;
            }
        }
        taken.len() as u64
    }
}

impl SampleJudge<'_> {
    fn run(&self, run: Run, rect: TileRect, found: &mut Findings) {
        if run.winner == BACKGROUND {
            return;
        }
        let t = run.winner - 1;
        debug_assert!((t as usize) < self.scene.len());
        if self.drawn_whole(t) || !self.owed(t) {
            return;
        }
        if run.alternate == ANY {
            return self.run_of_many(run, t, rect, found);
        }
        let other = run.alternate.checked_sub(1);
        if let Some(other) = other.filter(|o| self.drawn_whole(*o)) {
            found.stands_in(self.submitted, t, other);
            return;
        }
        for x in run.x..run.x + run.len {
            let hit = |t: u32| self.drawn_at(t, x, run.y);
            if !hit(t) && !other.is_some_and(hit) {
                found.lose(t, x, run.y, rect);
            }
        }
    }

    /// Where three or more surfaces tie: lost if none of them is drawn.
    fn run_of_many(&self, run: Run, t: u32, rect: TileRect, found: &mut Findings) {
        // Without a list of what ties here nothing is proved.
        let Some(ties) = self.truth.bracket.ties_of(t) else { return };
        let drawn: Vec<Outline> = ties
            .iter()
            .filter(|o| self.submitted.triangles.contains(**o))
            .filter_map(|o| {
                let corners = self.scene.corners(*o).map(|p| self.view.to_camera(p));
                Outline::new(&self.screen, *o, true, &corners)
            })
            .collect();
        for x in run.x..run.x + run.len {
            let at = [self.lens.xs[x as usize], self.lens.ys[run.y as usize]];
            // The list is one for all samples of the winner: ask at each who is there.
            let stands = |o: &&Outline| !o.misses(at) && self.drawn_at(o.triangle, x, run.y);
            if self.drawn_at(t, x, run.y) {
                continue;
            }
            match drawn.iter().find(stands) {
                Some(other) => found.stands_in(self.submitted, t, other.triangle),
                None => found.lose(t, x, run.y, rect),
            }
        }
    }

    /// Adds what only rays see to the losses; returns how many those are.
    fn witnesses(&self, found: &mut Findings) -> u64 {
        let drawn = |t: &u32| self.submitted.triangles.contains(*t);
        let mut lost = 0;
        for w in self.truth.bracket.witnesses.iter().filter(|w| !drawn(&w.triangle) && self.owed(w.triangle)) {
            match w.tied.iter().find(|t| drawn(t)) {
                Some(other) => found.stands_in(self.submitted, w.triangle, *other),
                None => lost += u64::from(found.seen_lost.insert(w.triangle)),
            }
        }
        lost
    }

    /// A sample at the very boundary of the volume proves nothing of a triangle that
    /// rounding alone may have put inside it.
    fn owed(&self, t: u32) -> bool {
        self.standings[t as usize].meets == Meets::Certainly
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
}
