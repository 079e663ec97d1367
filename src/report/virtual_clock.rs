//! Frames on the virtual clock: what a machine would take whose graphics queue works
//! beside its processor. Walks that query count that time themselves, stalls included
//! (`virtual_ns`); of the others the processor's part is the measured culling time and the
//! price of their draw calls, the queue's part that of their indices, and the longer counts.

use crate::results::RunResult;

/// For captions.
pub const WORDS: &str = "Of walks that query it is counted, with the stated prices of draws, queries and waiting; of the \
     others it is the longer of measured culling plus draw calls and of indices.";

/// One value a frame, in milliseconds; none where the frames are not known.
pub fn frames_ms(run: &RunResult) -> Vec<f64> {
    if let Some(ns) = run.further.get("virtual_ns") {
        return ns.iter().map(|ns| ns / 1e6).collect();
    }
    let (model, drawn) = (&run.spec.model, run.drawn());
    if drawn.len() != run.draw_calls.len() || drawn.len() != run.cull_ns.len() {
        return Vec::new();
    }
    let frames = drawn.iter().zip(&run.draw_calls).zip(&run.cull_ns);
    let of = |((triangles, calls), cull): ((&f64, &f64), &f64)| {
        let processor = model.cull_scale * cull + model.draw_call_ns * calls;
        (processor.max(model.index_ns * 3.0 * triangles) + model.frame_ns) / 1e6
    };
    frames.map(of).collect()
}
