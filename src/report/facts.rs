//! What a list needs to know of one run, in few bytes: how it ended and the value of
//! every metric. Computed once from all of its results and kept beside them.

use super::fields::has_interval;
use super::metrics::METRICS;
use crate::culling::Class;
use crate::results::{RunResult, RunStatus};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// Raised when what a metric means changes though its name does not.
const VERSION: u32 = 1;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Facts {
    pub status: RunStatus,
    pub class: Option<Class>,
    pub observed: Option<Class>,
    pub reason: Option<String>,
    /// Number of the metric in [`METRICS`], its value, and the ends of its interval.
    pub numbers: Vec<(u16, f64, Option<(f64, f64)>)>,
}

/// Tells facts of this program from those of one with other metrics.
pub fn revision() -> &'static str {
    static REVISION: OnceLock<String> = OnceLock::new();
    REVISION.get_or_init(|| {
        let mut hash = blake3::Hasher::new();
        hash.update(&VERSION.to_le_bytes());
        METRICS.iter().for_each(|m| {
            hash.update(m.name.as_bytes()).update(b"\n");
        });
        hash.finalize().to_hex()[..16].to_string()
    })
}

impl Facts {
    pub fn of(run: &RunResult) -> Facts {
        let number = |(i, m): (usize, &'static super::metrics::Metric)| {
            if has_interval(m) {
                m.interval(run).map(|(v, low, high)| (i as u16, v, Some((low, high))))
            } else {
                m.value(run).map(|v| (i as u16, v, None))
            }
        };
        Facts {
            status: run.status,
            class: run.class,
            observed: run.observed,
            reason: run.reason.clone(),
            numbers: METRICS.iter().enumerate().filter_map(number).collect(),
        }
    }

    /// # Panics
    /// Never: facts are plain data.
    pub fn encode(&self) -> Vec<u8> {
        postcard::to_stdvec(self).expect("facts are plain data")
    }

    /// None when the bytes are not what [`Facts::encode`] wrote.
    pub fn decode(bytes: &[u8]) -> Option<Facts> {
        postcard::from_bytes(bytes).ok()
    }
}
