//! `nested_query`: every node is asked about, and every answer is waited for.
//!
//! Serpa (2018-19) measures his own method against a grid whose cells and subcells get an
//! occlusion query each, front to back, without history, and cites Bittner, Havran &
//! Slavik (1998) for it; their method is another one (`occlusion_tree`). This is what he
//! describes and measures: fewest triangles of all, many calls, and a CPU that waits. Over
//! any hierarchy: nodes by distance, a node that shows is drawn or entered, its children
//! are asked in turn.
//!
//! What we changed: a node that the near plane cuts counts as visible without a query.
//! Class and reason: see `queries/stage.rs`.

use super::queries::front::Depth;
use super::queries::{self, Occlusion, Order, Stage};
use super::skipping::{STILL, WHOLE_BELOW};
use super::*;

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "nested_query",
    about: "front to back, an occlusion query a node, waited for (Serpa 2018's nested grid baseline)",
    revision: 1,
    params: &[
        queries::AUTO,
        queries::BACKEND,
        queries::COVERAGE,
        queries::HEIGHT_PX,
        queries::LATENCY_US,
        queries::N_VP,
        queries::OCCLUDER_PX,
        queries::QUERY_NS,
        queries::SORTED,
        queries::WIDTH_PX,
        STILL,
        WHOLE_BELOW,
    ],
    make: |spec| Box::new(Occlusion::new(spec, 1, Nested)),
};

struct Nested;

impl Order for Nested {
    fn run(&mut self, stage: &mut Stage) {
        while let Some(item) = stage.pop() {
            match stage.depth(item) {
                Depth::Behind => continue,
                Depth::Near => {}
                Depth::Beyond => {
                    let ticket = stage.issue_one(item);
                    if !stage.take(ticket) {
                        stage.hide(item);
                        continue;
                    }
                }
            }
            stage.traverse(item);
        }
    }

    fn remembers(&self) -> bool {
        false
    }

    fn prepare(&mut self, _: &Hierarchy) -> usize {
        0
    }
}
