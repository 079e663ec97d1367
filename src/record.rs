//! The plain types in which the two halves meet: what to run, and what came of it.
//! Serde only; ids are stable content hashes (see `ARCHITECTURE.md`).

mod errors;

pub use errors::{FrameErrors, observed_class};

use crate::culling::{Class, Removes};
use crate::error::Result;
use crate::hierarchy::BuildStats;
use crate::math::{Arithmetic, Camera};
use crate::registry::Spec;
use crate::scene::LoadReport;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

pub mod cameras;
pub mod numbers;

/// Where triangles come from and how they are read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneSpec {
    pub name: String,
    pub source: SceneSource,
    pub winding: Winding,
    pub up: Up,
    /// Metres a unit of the file; applied to mesh and path together.
    pub scale: f64,
    /// Join vertices at the same position (exact equality after scaling).
    pub weld: bool,
    /// Moves mesh and path together, after the scale.
    #[serde(default, skip_serializing_if = "is_nowhere")]
    pub offset_m: [f64; 3],
    /// Identity of source and options ([`crate::scene::load::fingerprint`]):
    /// equal fingerprints mean equal scenes.
    pub fingerprint: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SceneSource {
    File(PathBuf),
    /// A generator with resolved parameters.
    Generated(Spec),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Winding {
    #[default]
    Ccw,
    Cw,
    TwoSided,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Up {
    Y,
    Z,
}

impl SceneSpec {
    /// How far the scene was moved.
    pub fn distance_m(&self) -> f64 {
        let [x, y, z] = self.offset_m;
        numbers::tidy(libm::hypot(libm::hypot(x, y), z))
    }
}

/// A walkthrough: camera poses frame by frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathSpec {
    pub name: String,
    pub source: PathSource,
    /// Use only the first so many frames, then every `stride`-th of them.
    pub frames: Option<u32>,
    pub stride: u32,
    pub fingerprint: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PathSource {
    /// CSV `frame,px,py,pz,fx,fy,fz,ux,uy,uz` in the scene's own units and axes.
    File(PathBuf),
    /// Walked in the scene's free space: kind and parameters of the generator.
    Generated(Spec),
}

/// How a trial is measured. Part of `measurement_id`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Protocol {
    /// Passes over the path that are timed; per frame the least disturbed
    /// (smallest) is a trial's value.
    pub passes: u32,
    pub warmup_passes: u32,
    /// Core to pin the trial to; `None` leaves it to the system.
    pub pin_core: Option<u32>,
    /// `release`, `dist`, `dev`: as this binary was built.
    pub build_profile: String,
    pub isa: String,
    pub threads: u32,
}

/// How often and how long: policy of the queue, not part of any id.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RepeatPolicy {
    pub repeats: u32,
    /// Go on until the 95 % interval is narrower than this share of the median.
    pub relative_ci: Option<f64>,
    pub max_repeats: u32,
    pub timeout_s: f64,
    pub memory_limit_mib: Option<u64>,
    /// Seed of the shuffle of trials.
    pub seed: u64,
}

/// How answers are judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// Frames judged, spread evenly over the path; 0 judges none.
    pub frames: u32,
    pub width_px: u32,
    pub height_px: u32,
    /// s x s samples a pixel.
    pub samples: u32,
    /// Rays aimed at every triangle of the exact set that no sample sees, to find a
    /// witness that it is visible after all.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub witness_rays: u32,
    /// Bracket V* from above: the oracle proves hidden what it can, with cells of
    /// at least this many to a side of the image; 0 leaves frustum and facing alone.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub hiding_cells: u32,
}

impl Default for Accuracy {
    fn default() -> Self {
        Accuracy { frames: 10, width_px: 1920, height_px: 1080, samples: 1, witness_rays: 0, hiding_cells: 0 }
    }
}

fn is_zero(x: &u32) -> bool {
    *x == 0
}

fn is_nowhere(offset_m: &[f64; 3]) -> bool {
    *offset_m == [0.0; 3]
}

/// Derived, always labelled as modelled:
/// `frame_ms_model = frame_ns + cull_scale * culling + index_ns * indices + draw_call_ns * calls`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimeModel {
    pub index_ns: f64,
    pub draw_call_ns: f64,
    /// Of every frame, whatever it shows.
    #[serde(default, skip_serializing_if = "is_nothing")]
    pub frame_ns: f64,
    /// How many times as long the modelled machine culls as the one that was measured.
    #[serde(default = "as_measured", skip_serializing_if = "is_as_measured")]
    pub cull_scale: f64,
}

fn is_nothing(x: &f64) -> bool {
    *x == 0.0
}

fn as_measured() -> f64 {
    1.0
}

fn is_as_measured(x: &f64) -> bool {
    *x == 1.0
}

impl Default for TimeModel {
    /// Non-negative least squares on the eight rows of table 1 of Serpa (2018-19).
    fn default() -> Self {
        TimeModel { index_ns: 0.32, draw_call_ns: 430.0, frame_ns: 0.0, cull_scale: 1.0 }
    }
}

impl TimeModel {
    /// What a frame takes beside culling.
    pub fn render_ns(&self, triangles: f64, draw_calls: f64) -> f64 {
        self.frame_ns + self.index_ns * 3.0 * triangles + self.draw_call_ns * draw_calls
    }
}

/// One cell of the matrix, resolved: every parameter present.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunSpec {
    pub scene: SceneSpec,
    pub path: PathSpec,
    pub camera: Camera,
    pub structure: Spec,
    /// Parts of the sum; empty is `none`.
    pub culling: Vec<Spec>,
    pub walk: Spec,
    /// Other axes by name, where their value is not the usual one: `arithmetic`, and
    /// `camera` where it is not that of the manifest's section.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub axes: BTreeMap<String, Spec>,
    /// Revision of each algorithm used (`structure.octree` -> 1).
    pub revisions: BTreeMap<String, u32>,
    pub accuracy: Accuracy,
    pub protocol: Protocol,
    pub series: u32,
    pub model: TimeModel,
}

/// Raised when truth or its judgement changes: what older ones said is asked again.
pub const ORACLE_REVISION: u32 = 3;

impl RunSpec {
    /// Hash of all that determines the submitted sets.
    pub fn answer_id(&self) -> String {
        #[derive(Serialize)]
        struct Key<'a> {
            scene: &'a str,
            path: (&'a str, Option<u32>, u32),
            camera: &'a Camera,
            structure: String,
            culling: Vec<String>,
            walk: String,
            axes: Vec<(String, String)>,
            revisions: &'a BTreeMap<String, u32>,
        }
        hash_json(&Key {
            scene: &self.scene.fingerprint,
            path: (&self.path.fingerprint, self.path.frames, self.path.stride),
            camera: &self.camera,
            structure: self.structure.to_string(),
            culling: self.culling.iter().map(Spec::to_string).collect(),
            walk: self.walk.to_string(),
            // The camera stands above: however a manifest names it, it is the same.
            axes: self
                .axes
                .iter()
                .filter(|(k, _)| *k != cameras::AXIS)
                .map(|(k, v)| (k.clone(), v.to_string()))
                .collect(),
            revisions: &self.revisions,
        })
    }

    /// `answer_id` + machine class, protocol and series.
    pub fn measurement_id(&self, machine_class: &str) -> String {
        hash_json(&(self.answer_id(), machine_class, &self.protocol, self.series))
    }

    /// Identity of a judgement: the answer, the accuracy asked of it, and who judges.
    pub fn judgement_id(&self) -> String {
        hash_json(&(self.answer_id(), &self.accuracy, ORACLE_REVISION))
    }

    /// Truth is shared by all methods on the same scene, path and camera.
    pub fn truth_id(&self) -> String {
        self.truth_id_at(&self.accuracy)
    }

    /// The same at another accuracy than the one asked for.
    pub fn truth_id_at(&self, accuracy: &Accuracy) -> String {
        hash_json(&(
            &self.scene.fingerprint,
            (&self.path.fingerprint, self.path.frames, self.path.stride),
            &self.camera,
            accuracy,
        ))
    }

    /// The arithmetic that tests take which name none: the axis' value, or the default.
    ///
    /// # Errors
    /// If the axis holds no known name.
    pub fn arithmetic(&self) -> Result<Arithmetic> {
        let Some(spec) = self.axes.get(crate::math::arithmetic::NAME) else { return Ok(Arithmetic::default()) };
        Arithmetic::parse(&spec.kind)
    }

    pub fn culling_label(&self) -> String {
        crate::registry::format_sum(&self.culling)
    }
}

fn hash_json<T: Serialize>(value: &T) -> String {
    let json = serde_json::to_vec(value).expect("ids are made of plain data");
    blake3::hash(&json).to_hex()[..32].to_string()
}

/// A named number: counters are data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Counter {
    pub name: String,
    pub unit: String,
    pub value: f64,
}

/// Per-frame numbers of one trial. Times are nanoseconds of the culling call.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Series {
    pub name: String,
    pub unit: String,
    pub values: Vec<f64>,
}

/// What one trial (one child process) found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialRecord {
    pub load_ns: u64,
    /// Structure, flattening included.
    pub build_ns: u64,
    /// Per-node columns of the tests.
    pub prepare_ns: u64,
    pub structure_bytes: u64,
    pub test_bytes: u64,
    /// Peak resident set of the child, the scene included.
    pub peak_rss_bytes: u64,
    pub build: BuildStats,
    pub entries: u64,
    pub scene_triangles: u64,
    pub load: LoadReport,
    /// Sums over the frames of the path; identical between trials.
    pub counters: Vec<Counter>,
    /// `cull_ns` (the smallest of the passes) and, identical between trials,
    /// `triangles`, `entries`, `draw_calls`, `draw_calls_any_material`, `nodes_visited`, and
    /// what else is counted by frame ([`crate::culling::Tally::BY_FRAME`]).
    pub series: Vec<Series>,
    /// `cull_ns` of every pass, frame by frame.
    pub passes_ns: Vec<Vec<f64>>,
    /// blake3 over every frame's submitted ranges and the structure's entries.
    pub frames_hash: String,
    /// Sentinel kernel before and after: its time over the best one seen in this process's life.
    pub sentinel: Sentinel,
    pub environment: Environment,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Sentinel {
    pub before_ns: f64,
    pub after_ns: f64,
    /// Involuntary context switches during the timed passes.
    pub involuntary_switches: u64,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    pub cpu: String,
    pub cores: u32,
    pub memory_mib: u64,
    pub kernel: String,
    pub os: String,
    pub compiler: String,
    pub cullmark: String,
    pub commit: String,
    pub build_profile: String,
    pub isa: String,
    pub governor: String,
    /// Times are compared only within one machine class.
    pub machine_class: String,
    pub pinned_core: Option<u32>,
}

/// Judgement of an answer against the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judgement {
    pub class: Class,
    pub removes: Removes,
    /// Wrong for the declared class: a reason with frame and ids. Times are withheld.
    pub wrong: Option<String>,
    pub frames: Vec<FrameErrors>,
    /// Must equal the trials' hash.
    pub frames_hash: String,
}
