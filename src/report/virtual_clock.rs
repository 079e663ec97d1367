//! Frames on the virtual clock: what a machine would take whose graphics queue works
//! beside its processor. Walks that query count that time themselves, stalls included
//! (`virtual_ns`). Of others the processor's part is the nodes of `depth_first` at the same
//! price, or the measured culling time of what does more than visit nodes, and their draw
//! calls; the queue's part is their indices, and the longer counts. Prices are those of the
//! default model for all, whatever model the study states.

use crate::record::TimeModel;
use crate::results::RunResult;

/// For captions.
pub const WORDS: &str = "Of walks that query it is counted, with the stated prices of draws, queries and waiting; what is \
     late of a frame's last answers passes between frames. Of the others it is the longer of culling plus draw calls and \
     of indices; culling is counted nodes for depth_first, else measured";

/// As the walks' own clock has it.
const NODE_NS: f64 = 50.0;

/// One value a frame, in milliseconds; none where the frames are not known.
pub fn frames_ms(run: &RunResult) -> Vec<f64> {
    if let Some(ns) = run.further.get("virtual_ns") {
        return ns.iter().map(|ns| ns / 1e6).collect();
    }
    let (model, drawn) = (TimeModel::default(), run.drawn());
    if drawn.len() != run.draw_calls.len() || drawn.len() != run.cull_ns.len() {
        return Vec::new();
    }
    let counted = run.spec.walk.kind == "depth_first" && run.nodes_visited.len() == drawn.len();
    let cull_ns = |i: usize| if counted { NODE_NS * run.nodes_visited[i] } else { run.cull_ns[i] };
    let of = |i: usize| {
        let processor = cull_ns(i) + model.draw_call_ns * run.draw_calls[i];
        processor.max(model.index_ns * 3.0 * drawn[i]) / 1e6
    };
    (0..drawn.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nodes_price_is_that_of_the_walks() {
        assert_eq!(NODE_NS, crate::culling::queries::clock::NODE_NS);
    }
}
