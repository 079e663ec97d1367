//! What counted work costs: nanoseconds a frame as a sum over counters.
//!
//! The costs are non-negative least squares, relative, over the candidates on several
//! scenes (`cargo bench --no-default-features --bench costs` prints them anew, with the
//! error on the half that was held out). They only rank candidates: what the advice says
//! is timed. Wimmer & Wonka (2003) and Serpa (2019) predict rendering time that way.

use super::probe::Counts;

/// Nanoseconds of one unit of each counter.
pub const COSTS: &[(&str, f64)] = &[
    ("frames", 250.0),
    ("nodes_visited", 4.0),
    ("plane_tests", 0.4),
    ("mask_tests", 1.0),
    ("triangle_tests", 1.2),
    ("ranges", 2.0),
];

/// Culling time of a frame whose mean counts are `counts`.
pub fn cull_ns(counts: &Counts) -> f64 {
    COSTS.iter().map(|(name, ns)| ns * counts.of(name)).sum()
}
