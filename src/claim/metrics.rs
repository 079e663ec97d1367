//! What claims and sweeps may name: the manifest's list of metrics. The report's own table
//! (`report/metrics.rs`) knows how to find their values, and a test holds the two together.

/// A number a claim can be about.
#[derive(Debug)]
pub struct Metric {
    pub name: &'static str,
    pub unit: &'static str,
    /// Derived by a model rather than measured: at best "reproduced in the model only".
    pub modelled: bool,
    /// Comes from a clock or from memory (has an interval) rather than counted.
    pub measured: bool,
    pub better: Better,
    pub about: &'static str,
}

/// Which of two values of a metric is the better one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    Less,
    More,
    /// It describes, it does not rank.
    Neither,
}

const fn metric(name: &'static str, unit: &'static str, kind: u8, about: &'static str) -> Metric {
    Metric { name, unit, modelled: kind == 2, measured: kind != 0, better: Better::Less, about }
}

impl Metric {
    const fn better(mut self, better: Better) -> Metric {
        self.better = better;
        self
    }
}

/// Sorted by name. Kind 0: counted, 1: measured, 2: modelled.
pub static METRICS: &[Metric] = &[
    metric("build_ms", "ms", 1, "building the structure, flattening included"),
    metric("cull_ms", "ms", 1, "culling time a frame, mean over the path"),
    metric("duplicates", "entries", 0, "entries beyond the first of each triangle, summed over judged frames"),
    metric("fallbacks_exact_share", "", 0, "signs that needed exact arithmetic, of all asked"),
    metric("fallbacks_f64_share", "", 0, "signs that single precision could not tell, of all asked"),
    metric("false_cull_ppm", "px/M", 0, "pixels whose triangle was not submitted, per million pixels"),
    metric("false_cull_sample_ppm", "smp/M", 0, "samples whose triangle was not submitted, per million samples"),
    metric("false_cull_share", "", 0, "visible triangles not submitted, of all visible ones"),
    metric("false_culls", "triangles", 0, "visible triangles not submitted, summed over judged frames"),
    metric("false_culls_by_ray", "triangles", 0, "of the false culls those that no sample sees"),
    metric("fps_best_model", "fps", 2, "rate of the fastest frame, by modelled time").better(Better::More),
    metric("fps_mean_model", "fps", 2, "frames over total modelled time").better(Better::More),
    metric("fps_spread_model", "", 2, "rate of the fastest frame over that of the slowest").better(Better::Neither),
    metric("fps_worst_model", "fps", 2, "rate of the slowest frame, by modelled time").better(Better::More),
    metric("frame_ms_model", "ms", 2, "modelled time a frame: culling + indices + draw calls, mean over the path"),
    metric("frame_ms_virtual", "ms", 2, "modelled time a frame with stalls of queries, on the virtual clock, mean"),
    metric("largest_blob_px", "px", 0, "largest connected hole in any judged frame"),
    metric("mean_draw_calls", "calls", 0, "draw calls a frame"),
    metric("mean_entries", "triangles", 0, "triangles drawn a frame, copies and pieces each"),
    metric("mean_nodes_visited", "nodes", 0, "nodes judged a frame"),
    metric("mean_queries", "queries", 0, "occlusion queries a frame"),
    metric("mean_stall_us", "µs", 2, "waiting for answers of queries, a frame, on the virtual clock"),
    metric("mean_triangles", "triangles", 0, "triangles submitted a frame"),
    metric(
        "missing_ppm",
        "ppm",
        0,
        "of what a view cell's samples see, the share that its set lacks by their own estimate",
    ),
    metric("over_submission", "", 0, "submitted over visible triangles, mean over judged frames"),
    metric("over_submission_hi", "", 0, "share of what was submitted that is not known to be visible"),
    metric("over_submission_lo", "", 0, "share of what was submitted that is proved invisible"),
    metric("p99_cull_ms", "ms", 1, "99th percentile of culling time a frame"),
    metric("partial_triangles_cull", "", 1, "r of triangles and culling time of a frame, nodes visited held constant")
        .better(Better::Neither),
    metric("peak_rss_mib", "MiB", 1, "peak resident memory of the trial, the scene included"),
    metric("pearson_triangles_cull", "", 1, "r of triangles and culling time over the frames").better(Better::Neither),
    metric("pearson_triangles_frame_model", "", 2, "r of triangles and modelled frame time").better(Better::Neither),
    metric("potential_lost", "triangles", 0, "members of the exact set lost, seen or hidden"),
    metric("potential_lost_share", "", 0, "members of the exact set lost, of all its members"),
    metric("prepare_ms", "ms", 1, "building the per-node columns of the tests"),
    metric("spearman_triangles_cull", "", 1, "rank correlation of triangles and culling time").better(Better::Neither),
    metric("spearman_triangles_frame_model", "", 2, "rank correlation of triangles and modelled frame time")
        .better(Better::Neither),
    metric("structure_mib", "MiB", 0, "bytes of the structure and of the tests' columns"),
    metric("total_cull_ms", "ms", 1, "culling time summed over the path"),
    metric("total_frame_ms_model", "ms", 2, "modelled time summed over the path"),
];
