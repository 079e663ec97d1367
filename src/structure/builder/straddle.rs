//! What grids and kd-trees do with a triangle that straddles cells, as a parameter.
//! No study says what it did, although it changes every count.

use super::cut;
use crate::error::Error;
use crate::registry::{Default, Param, Spec};
use crate::scene::Scene;
use std::sync::atomic::{AtomicU64, Ordering};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Policy {
    /// By centroid; boxes grow to their triangles.
    Loose,
    /// A copy in every cell that the triangle overlaps.
    Replicate,
    /// A copy of its part in every cell.
    Split,
}

pub const PARAM: Param = Param {
    name: "policy",
    default: Default::Choice(&["L", "R", "S"]),
    about: "straddling triangles: L by centroid with grown boxes, R replicated, S split",
};

impl Policy {
    pub fn of(spec: &Spec) -> Policy {
        match spec.text("policy") {
            "R" => Policy::Replicate,
            "S" => Policy::Split,
            _ => Policy::Loose,
        }
    }
}

/// Entries that all tasks of one build may make together. What is spent only grows,
/// so whether it passes the limit does not depend on the order of tasks.
pub struct Budget {
    spent: AtomicU64,
    limit: u64,
}

impl Budget {
    pub fn new(limit: u64) -> Budget {
        Budget { spent: AtomicU64::new(0), limit }
    }

    pub fn of(scene: &Scene) -> Budget {
        Budget::new(cut::entries_max(scene))
    }

    /// `None` past the limit.
    pub fn spend(&self, entries: usize) -> Option<()> {
        let before = self.spent.fetch_add(entries as u64, Ordering::Relaxed);
        (before + entries as u64 <= self.limit).then_some(())
    }

    /// What to say past the limit, of which parameter.
    pub fn error(&self, what: &str, scene: &Scene, key: &str, help: &str) -> Error {
        let (limit, triangles) = (self.limit, scene.len());
        Error::new(format!("{what} over `{}` has more than {limit} entries ({triangles} triangles)", scene.name))
            .key(key)
            .help(format!("{help}, or take policy \"L\", which holds each triangle once"))
    }
}
