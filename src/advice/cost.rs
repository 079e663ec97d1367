//! What counted work costs: nanoseconds a frame as a sum over counters.
//!
//! The costs are non-negative least squares, relative, over the candidates on several
//! scenes (`cargo bench --no-default-features --bench costs` prints them anew, with the
//! error on the half that was held out). They only rank candidates: what the advice says
//! is timed. Wimmer & Wonka (2003) and Serpa (2019) predict rendering time that way.

use super::probe::Counts;

/// Nanoseconds of one unit of each counter. Of 490 measurements on five scenes, half of them
/// held out, the median relative error was 15 %. Plane and mask tests got nothing: eight nodes
/// are judged at once, whatever rejects them.
pub const COSTS: &[(&str, f64)] = &[
    ("frames", 9.5),
    ("nodes_visited", 14.6),
    ("nodes_scanned", 1.5),
    ("triangle_tests", 0.39),
    ("ranges", 1.5),
    ("cells_reached", 305.0),
    ("notes_read", 2.4),
];

/// Culling time of a frame whose mean counts are `counts`.
pub fn cull_ns(counts: &Counts) -> f64 {
    COSTS.iter().map(|(name, ns)| ns * counts.of(name)).sum()
}
