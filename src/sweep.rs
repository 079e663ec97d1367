//! Charts that a study asks for: an error (or any metric) against a stressor, one
//! line for every value of an axis. Plain data, as [`crate::claim`].

use serde::{Deserialize, Serialize};

/// Panels are scenes (sweeps of one scene's parameter share a panel), x is a number
/// that some axis carries, y a metric.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// Letters, digits, `_` and `-`: the file name of the chart.
    pub id: String,
    pub title: String,
    /// Where x stands: `scene.offset_m`, `path.angle_rad`, `camera.fov_y_deg`,
    /// `structure.depth`: axis and parameter.
    pub x: String,
    pub x_unit: String,
    /// Name of a metric.
    pub y: String,
    /// Name of the metric to the right instead of x: then x is a knob that moves a run
    /// along its line, and each point is labelled with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against: Option<String>,
    /// Axis whose values are the lines, such as `arithmetic`.
    pub by: String,
    pub x_log: bool,
    /// Logarithmic with a bin for 0.
    pub y_log: bool,
    /// Law to draw beside the lines: y grows as x to this power once it exceeds the
    /// smallest visible error; anchored at the median of the line `expected_for`.
    pub expected_slope: Option<f64>,
    /// Value of `by` whose growth is expected.
    pub expected_for: Option<String>,
    /// Why that law, in a sentence, with its source.
    pub expected_why: String,
}
