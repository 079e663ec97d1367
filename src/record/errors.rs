//! Errors of an answer as numbers, frame by frame, and the class that they show.

use crate::culling::{Class, Removes};
use serde::{Deserialize, Serialize};

/// Errors of one judged frame. Triangle counts without duplicates.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameErrors {
    pub frame: u32,
    /// |S|, distinct triangles.
    pub submitted: u64,
    /// Entries submitted, replicated or split ones counted each.
    pub submitted_entries: u64,
    /// |V_lo|: seen by a sample or a witness ray.
    pub visible: u64,
    /// |V_hi|: in the exact set of frustum and facing and not proved hidden.
    #[serde(default)]
    pub visible_hi: u64,
    /// |S minus V_lo|: over-submission if V* is V_lo.
    #[serde(default)]
    pub submitted_unseen: u64,
    /// |S minus V_hi|: over-submission that is proved.
    #[serde(default)]
    pub submitted_invisible: u64,
    /// Members of `false_culls` that only a witness ray sees.
    #[serde(default)]
    pub false_culls_by_ray: u64,
    /// Samples that see a triangle which was not submitted, and all samples.
    #[serde(default)]
    pub false_cull_samples: u64,
    #[serde(default)]
    pub samples: u64,
    /// Exact set the method is entitled to reduce to (frustum, facing).
    pub potential: u64,
    /// Proved false culls: members of V_lo, seen by a sample or by a witness ray alone, in
    /// whose place neither they nor an equal surface were submitted.
    pub false_culls: u64,
    /// Members of the exact set lost, seen or hidden (object space).
    pub potential_lost: u64,
    /// Pixels whose triangle was not submitted.
    pub false_cull_pixels: u64,
    /// Pixels that show anything.
    pub covered_pixels: u64,
    pub pixels: u64,
    /// Largest 4-connected region of such pixels.
    pub largest_blob_px: u64,
    /// The first few lost `source_triangle_id`s.
    pub lost_ids: Vec<u32>,
}

impl FrameErrors {
    /// Entries beyond the first of each triangle.
    pub fn duplicates(&self) -> u64 {
        self.submitted_entries.saturating_sub(self.submitted)
    }

    /// |S| / |V_lo|; infinite when nothing is visible but something submitted.
    pub fn over_submission(&self) -> f64 {
        if self.submitted == 0 { 1.0 } else { self.submitted as f64 / self.visible as f64 }
    }
}

/// The strongest class that the judged frames do not refute; `None` without frames.
/// A lower bound on what may go wrong: other frames may refute it still.
///
/// - exact: nothing owed is lost and nothing beyond the set is submitted;
/// - conservative: nothing owed is lost;
/// - sample-conservative: all that is lost is hidden from every sample;
/// - aggressive: visible triangles are lost, though what is submitted belongs to the set;
/// - approximate: visible triangles are lost and others are added.
pub fn observed_class(removes: Removes, frames: &[FrameErrors]) -> Option<Class> {
    let of = |f: &FrameErrors| {
        // A method that removes the hidden is exact when nothing proved invisible is left.
        let adds = if removes.occluded { f.submitted_invisible > 0 } else { f.submitted > f.potential };
        // A ray that no sample stands for refutes what is claimed in object space.
        let by_sample = f.false_culls - f.false_culls_by_ray;
        match (by_sample, f.potential_lost + f.false_culls_by_ray, adds) {
            (0, 0, false) => Class::Exact,
            (0, 0, true) => Class::Conservative,
            (0, ..) => Class::SampleConservative,
            (_, _, false) => Class::Aggressive,
            (_, _, true) => Class::Approximate,
        }
    };
    // Losing in one frame and adding in another is approximate.
    let worst = frames.iter().map(of).max()?;
    let adds_somewhere = frames.iter().any(|f| matches!(of(f), Class::Conservative | Class::Approximate));
    Some(if worst == Class::Aggressive && adds_somewhere { Class::Approximate } else { worst })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_observed_class_is_the_strongest_that_the_frames_do_not_refute() {
        let facing = Removes { outside_frustum: true, back_facing: true, occluded: false };
        let hidden = Removes { occluded: true, ..facing };
        let set = FrameErrors { submitted: 9, potential: 9, submitted_invisible: 3, ..Default::default() };
        let more = FrameErrors { submitted: 12, ..set.clone() };
        let unseen = FrameErrors { potential_lost: 1, submitted: 8, ..set.clone() };
        let ray = FrameErrors { false_culls: 1, false_culls_by_ray: 1, ..set.clone() };
        let lost = FrameErrors { false_culls: 1, submitted: 8, ..set.clone() };
        let both = FrameErrors { false_culls: 1, ..more.clone() };
        let of =
            |frames: &[&FrameErrors]| observed_class(facing, &frames.iter().map(|f| (*f).clone()).collect::<Vec<_>>());
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[&set]), Some(Class::Exact));
        assert_eq!(of(&[&set, &more]), Some(Class::Conservative));
        assert_eq!(of(&[&more, &unseen]), Some(Class::SampleConservative));
        assert_eq!(of(&[&set, &ray]), Some(Class::SampleConservative));
        assert_eq!(of(&[&set, &lost]), Some(Class::Aggressive));
        assert_eq!(of(&[&more, &lost]), Some(Class::Approximate));
        assert_eq!(of(&[&set, &both]), Some(Class::Approximate));
        // Of a method that removes the hidden the exact set is V*.
        assert_eq!(observed_class(hidden, std::slice::from_ref(&set)), Some(Class::Conservative));
        let exact = FrameErrors { submitted_invisible: 0, ..set };
        assert_eq!(observed_class(hidden, &[exact]), Some(Class::Exact));
    }
}
