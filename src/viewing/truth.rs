//! The truth of a frame that is looked at: the judgement's own where there is one.

use crate::math::View;
use crate::oracle::cache::truth_stored;
use crate::oracle::image::Grid;
use crate::oracle::{Effort, FrameTruth, Truth, judged_frames};
use crate::record::RunSpec;
use crate::scene::Scene;
use std::path::{Path, PathBuf};

/// Pixels across of a frame that no judgement asked for, and the most that a tall
/// image has down.
const WIDTH_PX: u32 = 960;
const HEIGHT_MAX_PX: u32 = 1920;

pub struct TruthOf {
    spec: RunSpec,
    cache: PathBuf,
    judged: Vec<u32>,
    /// What the judge of the run left in the cache, read when first wanted.
    stored: Option<Option<Truth>>,
    /// What judged frames share, if they must be computed after all.
    effort: Option<Effort>,
}

impl TruthOf {
    pub fn new(spec: &RunSpec, frames: usize, cache: &Path) -> TruthOf {
        TruthOf {
            judged: judged_frames(frames as u32, &spec.accuracy),
            spec: spec.clone(),
            cache: cache.to_path_buf(),
            stored: None,
            effort: None,
        }
    }

    /// Ascending.
    pub fn judged(&self) -> &[u32] {
        &self.judged
    }

    pub fn frame(&mut self, scene: &Scene, view: &View, frame: u32) -> FrameTruth {
        if !self.judged.contains(&frame) {
            let height_px = (f64::from(WIDTH_PX) / view.camera.aspect).round();
            let height_px = (height_px as u32).clamp(1, HEIGHT_MAX_PX);
            return FrameTruth::of(scene, view, frame, Grid { width_px: WIDTH_PX, height_px, samples: 1 });
        }
        let read = || truth_stored(scene.len(), &self.judged, &self.cache, &self.spec.truth_id());
        let stored = self.stored.get_or_insert_with(read);
        if let Some(known) = stored.as_ref().and_then(|truth| truth.frame(frame)) {
            return known.clone();
        }
        let accuracy = &self.spec.accuracy;
        let effort = self.effort.get_or_insert_with(|| Effort::new(scene, accuracy));
        FrameTruth::with(scene, view, frame, Grid::of(accuracy), effort)
    }
}
