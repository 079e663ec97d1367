//! What the store gives back of a study, and what reports, queries and
//! comparisons read. Plain data: no SQL, no charts.

use crate::culling::Class;
use crate::record::{Environment, FrameErrors, RunSpec};
use crate::sweep::Sweep;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StudyResults {
    pub name: String,
    pub title: String,
    pub manifest_toml: String,
    pub created_utc: String,
    /// In the order of the matrix.
    pub runs: Vec<RunResult>,
    pub excluded: Vec<Excluded>,
    /// Environments seen, by machine class.
    pub environments: BTreeMap<String, Environment>,
    /// Frames a point when curves are consolidated.
    pub consolidate_frames: u32,
    /// Charts of an error against a stressor that the manifest asks for.
    #[serde(default)]
    pub sweeps: Vec<Sweep>,
    /// What an adviser chose, place by place.
    #[serde(default)]
    pub advice: Vec<Advised>,
}

/// The choice of an adviser who timed a few frames, to be held against the whole study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advised {
    pub scene: String,
    pub path: String,
    /// Name of the metric that was to be least.
    pub metric: String,
    /// Of the chosen run.
    pub measurement_id: String,
    /// All that was chosen among, the short list that was timed first.
    pub candidates: Vec<String>,
    pub short_list: u32,
    pub probe_frames: u32,
}

/// One of several measurements of the same study (`run --series next`).
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Measured {
    pub series: u32,
    pub results: StudyResults,
    /// By measurement: the hashes of what its trials submitted; one, when all is well.
    pub frames_hashes: BTreeMap<String, BTreeSet<String>>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Excluded {
    pub cell: String,
    pub why: String,
    pub count: u64,
}

/// Missing, skipped, failed and invalid stay distinct in every table and chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunStatus {
    /// Not started, or trials still missing.
    Pending,
    /// Right for its class, all trials accepted.
    Done,
    /// Crashed, timed out, ran out of memory, or counters differed.
    Failed,
    /// Ran, but wrong for its declared class: times withheld.
    Wrong,
}

impl RunStatus {
    pub const ALL: [RunStatus; 4] = [RunStatus::Pending, RunStatus::Done, RunStatus::Failed, RunStatus::Wrong];

    pub fn word(self) -> &'static str {
        match self {
            RunStatus::Pending => "pending",
            RunStatus::Done => "done",
            RunStatus::Failed => "failed",
            RunStatus::Wrong => "wrong",
        }
    }

    /// A word that is none of these is of an open run.
    pub fn of(word: &str) -> RunStatus {
        RunStatus::ALL.into_iter().find(|s| s.word() == word).unwrap_or(RunStatus::Pending)
    }
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RunResult {
    pub measurement_id: String,
    pub answer_id: String,
    pub spec: RunSpec,
    /// Short labels without default parameters.
    pub structure: String,
    pub culling: String,
    pub walk: String,
    pub status: RunStatus,
    /// Why it failed or is wrong; or marks such as "noisy machine".
    pub reason: Option<String>,
    pub stop_reason: Option<String>,
    pub class: Option<Class>,
    /// The strongest class that the judged frames do not refute.
    #[serde(default)]
    pub observed: Option<Class>,
    pub machine_class: String,
    /// Accepted trials, in order. Empty when times are withheld.
    pub trials: Vec<TrialSummary>,
    /// Median over trials, frame by frame; empty when withheld.
    pub cull_ns: Vec<f64>,
    /// Identical between trials. Triangles are distinct ones.
    pub triangles: Vec<f64>,
    /// What is drawn: triangles that a structure replicates or splits count each time.
    #[serde(default)]
    pub entries: Vec<f64>,
    pub draw_calls: Vec<f64>,
    pub nodes_visited: Vec<f64>,
    /// What only some methods count frame by frame: `queries`, `virtual_ns`, ...
    #[serde(default)]
    pub further: BTreeMap<String, Vec<f64>>,
    /// Per-trial `cull_ns`, for bands and the bootstrap.
    pub trial_cull_ns: Vec<Vec<f64>>,
    /// Sums over the path and structure figures (`nodes`, `leaves`, `structure_bytes`, ...).
    pub counters: BTreeMap<String, f64>,
    pub errors: Vec<FrameErrors>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TrialSummary {
    pub repeat: u32,
    pub total_cull_ns: f64,
    pub build_ns: f64,
    pub prepare_ns: f64,
    pub load_ns: f64,
    pub peak_rss_bytes: f64,
    /// Sentinel over the median sentinel of the study on this machine.
    pub noise: f64,
    pub noisy: bool,
}

impl RunResult {
    /// Triangles that are drawn frame by frame, copies and pieces each counted.
    pub fn drawn(&self) -> &[f64] {
        if self.entries.len() == self.triangles.len() { &self.entries } else { &self.triangles }
    }

    pub fn scene(&self) -> &str {
        &self.spec.scene.name
    }

    /// `octree:depth=4 × frustum+normal_mask`, further axes only where they are not the usual ones.
    pub fn label(&self) -> String {
        let further: String = self.spec.further().iter().map(|l| format!(" × {l}")).collect();
        format!("{} × {}{further}", self.structure, self.culling)
    }
}
