//! Frames that a walk need not judge: a scene so small that drawing it whole is
//! cheaper than asking what to leave out, and a camera that has not moved.
//!
//! Both are switches of the walks, off by default, and neither loses anything: a
//! whole scene is more than any test keeps, and with the same view every test gives
//! the same answer (what tests learn from frame to frame never changes a verdict), so
//! that the list of the frame before, triangles judged one by one included, is right.

use super::{DrawList, Tally};
use crate::hierarchy::Hierarchy;
use crate::math::{Camera, DVec3, View};
use crate::registry::{Default as Allowed, Param, Spec};
use std::sync::atomic::{AtomicU64, Ordering};

pub(super) const STILL: Param = Param {
    name: "still",
    default: Allowed::Later(&Allowed::Bool(false)),
    about: "while the camera does not move, the list of the frame before is reused (same answer)",
};

pub(super) const WHOLE_BELOW: Param = Param {
    name: "whole_below",
    default: Allowed::Later(&Allowed::Int { value: 0, min: 0, max: u32::MAX as i64 }),
    about: "scenes with at most so many entries are drawn whole, and nothing is judged; 0 judges all",
};

/// What decides what is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    camera: Camera,
    axes: [DVec3; 4],
}

impl Seen {
    fn of(view: &View) -> Seen {
        Seen { camera: view.camera, axes: [view.eye, view.forward, view.right, view.up] }
    }
}

/// The switches of a walk, and the frame before.
#[derive(Debug, Default)]
pub struct Skipping {
    whole_below: u32,
    still: bool,
    last: Option<(Seen, u64)>,
}

impl Skipping {
    pub(super) fn new(spec: &Spec) -> Skipping {
        Skipping { whole_below: spec.int("whole_below") as u32, still: spec.bool("still"), last: None }
    }

    pub(super) fn reset(&mut self) {
        self.last = None;
    }

    /// Before anything of a frame: whether it can be told what to draw although nothing is
    /// judged. That is then in `out`, what the last frame left there or not.
    pub(super) fn skips(&self, view: &View, hierarchy: &Hierarchy, out: &mut DrawList, tally: &mut Tally) -> bool {
        let count = hierarchy.entries.len();
        if count <= self.whole_below as usize {
            out.clear();
            out.push(0, count as u32);
            tally.frames_whole += u64::from(count != 0);
            return count != 0;
        }
        // The list may be another one than last time, or have been written to since.
        let same = |(seen, stamp): &(Seen, u64)| *stamp == out.stamp && *seen == Seen::of(view);
        let reused = self.last.as_ref().is_some_and(same);
        tally.frames_reused += u64::from(reused);
        reused
    }

    /// After a frame that was judged, tests of triangles included. Between two resets a walk
    /// serves one hierarchy and one sum of tests.
    pub(super) fn keep(&mut self, view: &View, out: &mut DrawList) {
        if self.still {
            // One number a judged frame of the process: no two lists share one by chance.
            static JUDGED: AtomicU64 = AtomicU64::new(1);
            out.stamp = JUDGED.fetch_add(1, Ordering::Relaxed);
            self.last = Some((Seen::of(view), out.stamp));
        }
    }
}
