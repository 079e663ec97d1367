//! A judgement: a pass over the path whose submitted sets face the truth.
//!
//! Errors are those at the accuracy that was asked for. The verdict of a walk that
//! promises to lose nothing at samples of its own ([`crate::culling::Walk::samples`]) comes from the
//! truth at those: what lies between them it may lose, and other samples may see it.

use super::Setup;
use crate::culling::{Class, DrawList};
use crate::error::Result;
use crate::hierarchy::Hierarchy;
use crate::machine;
use crate::math::{Camera, Pose};
use crate::oracle::{self, image::Grid};
use crate::record::{Accuracy, FrameErrors, Judgement, RunSpec};
use crate::scene::Scene;
use std::path::Path;

impl Setup {
    /// The frames that `accuracy` asks to judge, with their poses.
    pub fn judged_poses(&self, accuracy: &Accuracy) -> Vec<(u32, Pose)> {
        let judged = oracle::judged_frames(self.views.len() as u32, accuracy);
        judged.iter().map(|f| (*f, self.poses[*f as usize])).collect()
    }

    /// Compares the submitted sets with the truth at the frames that it holds. Where the
    /// walk's promise is about samples of its own, truth is computed there too.
    ///
    /// # Panics
    /// If `truth` is of another scene or path.
    pub fn judge(&mut self, truth: &oracle::Truth) -> Judgement {
        let own = truth.frames.first().and_then(|f| self.promised_at(f.grid)).map(|accuracy| {
            let poses: Vec<(u32, Pose)> =
                truth.frames.iter().map(|f| (f.frame, self.poses[f.frame as usize])).collect();
            let camera = self.views.first().map_or_else(Camera::default, |v| v.camera);
            oracle::truth(&self.scene, &camera, &poses, &accuracy)
        });
        self.judge_by(truth, own.as_ref())
    }

    /// The samples to which the method's promise refers, one a pixel, unless those are
    /// the samples of `grid` or none in particular.
    pub fn promised_at(&self, grid: Grid) -> Option<Accuracy> {
        let (width_px, height_px) = self.walk.samples().filter(|_| self.class == Class::SampleConservative)?;
        let other = (width_px, height_px) != (grid.columns(), grid.rows());
        other.then(|| Accuracy { width_px, height_px, ..Accuracy::default() })
    }

    /// Errors against `truth`; the verdict by `own` ([`Setup::promised_at`]) if it is given.
    pub fn judge_by(&mut self, truth: &oracle::Truth, own: Option<&oracle::Truth>) -> Judgement {
        let (mut frames, mut promised): (Vec<FrameErrors>, Vec<FrameErrors>) = Default::default();
        let removes = self.removes;
        let work = self.count_pass(|setup, frame, list| {
            let at = |truth: &oracle::Truth| {
                let known = truth.frame(frame as u32)?;
                let submitted = submitted(&setup.scene, &setup.hierarchy, list);
                let mut errors = oracle::judge_frame(&setup.scene, &setup.views[frame], known, &submitted, removes);
                errors.submitted_entries = list.entry_count();
                Some(errors)
            };
            frames.extend(at(truth));
            promised.extend(own.and_then(at));
        });
        let wrong = match own.and_then(|own| own.frames.first()) {
            Some(first) => oracle::verdict(self.class, &promised).map(|why| by_own_samples(&why, first.grid)),
            None => oracle::verdict(self.class, &frames),
        };
        Judgement { class: self.class, removes, wrong, frames, frames_hash: self.frames_hash(&work) }
    }
}

/// A verdict that came from truth at the samples of [`Setup::promised_at`].
pub fn by_own_samples(why: &str, grid: Grid) -> String {
    format!("{why}, by the walk's own {} x {} samples", grid.columns(), grid.rows())
}

/// Judges the answer of `spec` against the truth at sampled frames.
///
/// # Errors
/// As [`Setup::new`], or when a test calls its pass void. An answer that is wrong
/// for its class is not an error but a judgement with `wrong` set.
pub fn judge(spec: &RunSpec, cache: &Path) -> Result<Judgement> {
    if let Some(core) = spec.protocol.pin_core {
        let others = machine::auxiliary_cores(Some(core));
        if !others.is_empty() {
            machine::pin_to(&others)?;
        }
    }
    judge_setup(&mut Setup::new(spec, cache)?, spec, cache)
}

/// [`judge`] of a setup of one's own, which stands for what `spec` names; truth is cached.
///
/// # Errors
/// When truth cannot be stored, or a test calls its pass void.
pub fn judge_setup(setup: &mut Setup, spec: &RunSpec, cache: &Path) -> Result<Judgement> {
    let asked = &spec.accuracy;
    let poses = setup.judged_poses(asked);
    let truth_at = |accuracy: &Accuracy| {
        oracle::truth_cached(&setup.scene, &spec.camera, &poses, accuracy, cache, &spec.truth_id_at(accuracy))
    };
    let truth = truth_at(asked)?;
    let own = setup.promised_at(Grid::of(asked)).map(|own| truth_at(&Accuracy { frames: asked.frames, ..own }));
    let judgement = setup.judge_by(&truth, own.transpose()?.as_ref());
    setup.check()?;
    Ok(judgement)
}

/// The submitted set in the oracle's terms, which know no hierarchy.
pub fn submitted(scene: &Scene, hierarchy: &Hierarchy, list: &DrawList) -> oracle::Submitted {
    let mut out = oracle::Submitted::none(scene.len());
    let mut drawn = vec![false; hierarchy.entries.len()];
    for position in list.positions() {
        drawn[position as usize] = true;
        out.triangles.insert(hierarchy.entries[position as usize]);
    }
    if let Some(fragments) = &hierarchy.fragments {
        // A triangle of which a part was submitted may still miss another part.
        for (position, triangle) in hierarchy.entries.iter().enumerate() {
            if !drawn[position] && out.triangles.contains(*triangle) {
                out.lost_pieces.push((*triangle, fragments[position]));
            }
        }
    }
    out
}
