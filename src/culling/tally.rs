//! Counted work: what a frame cost in tests, and what it was spared.

use serde::{Deserialize, Serialize};

/// A struct of counters, its sum, and their names and units: a line a counter.
macro_rules! counters {
    ($($(#[$about:meta])* $name:ident: $unit:literal,)*) => {
        /// Work of one frame. Bit-identical between repeats, threads and instruction sets.
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(default)]
        pub struct Tally {
            $($(#[$about])* pub $name: u64,)*
        }

        impl std::iter::Sum for Tally {
            fn sum<I: Iterator<Item = Tally>>(tallies: I) -> Tally {
                tallies.fold(Tally::default(), |a, b| Tally { $($name: a.$name + b.$name,)* })
            }
        }

        impl Tally {
            /// Name, unit and value of every counter: counters are data.
            pub fn named(&self) -> [(&'static str, &'static str, u64); [$($unit),*].len()] {
                [$((stringify!($name), $unit, self.$name),)*]
            }
        }
    };
}

counters! {
    /// Nodes judged (lanes that were asked about), each once a frame.
    nodes_visited: "nodes",
    /// Lanes handed to a test, summed over tests.
    lane_tests: "lanes",
    /// Planes compared with a box, a lane each.
    plane_tests: "planes",
    /// Normal or octant masks compared.
    mask_tests: "masks",
    /// Triangles judged one by one.
    triangle_tests: "triangles",
    /// Signs asked of a `filtered` predicate.
    predicates: "signs",
    /// Those that single precision could not tell.
    fallbacks_f64: "signs",
    /// Those that double precision could not tell either.
    fallbacks_exact: "signs",
    /// Lanes asked in which half of the frustum their centre lies.
    octant_tests: "lanes",
    /// Axes on which a box and the frustum were compared, a lane each.
    axis_tests: "axes",
    /// Lanes that a mask test did not judge because their masks are nearly full.
    masks_ignored: "lanes",
    /// Frames drawn whole because the scene is small.
    frames_whole: "frames",
    /// Frames whose list is that of the frame before.
    frames_reused: "frames",
    /// Subtrees submitted whole because they are small.
    subtrees_not_entered: "subtrees",
    /// Cells of a portal-octree that were seen into.
    cells_reached: "cells",
    /// Openings between cells that were projected to the screen.
    portals_tested: "portals",
    /// Entries with copies elsewhere, looked up in a mailbox.
    notes_read: "entries",
    /// Those of them whose triangle was drawn already.
    copies_dropped: "entries",
    /// Occlusion queries issued.
    queries: "queries",
    /// Boxes that they asked about, summed.
    boxes_queried: "boxes",
    /// Queries of several nodes at once.
    multiqueries: "queries",
    /// Those that showed something, so that their nodes were asked about one by one.
    multiqueries_failed: "queries",
    /// Triangles drawn so that they hide what comes later.
    occluders_drawn: "triangles",
    /// Nodes found hidden that were not drawn, and the entries at and below them.
    nodes_occluded: "nodes",
    entries_occluded: "entries",
    /// On the virtual clock: waiting for answers, and the whole frame.
    stall_ns: "virtual ns",
    virtual_ns: "virtual ns",
    /// Frames without queries because they did not pay.
    frames_off: "frames",
    /// Polygons whose shadows make an occlusion tree, and the planes that it has.
    occluders_chosen: "polygons",
    shadow_planes: "planes",
    /// Frusta of a subdivided image in which blockers were looked for.
    frusta: "frusta",
    /// Triangles, alone or with their neighbours, that were found to fill a frustum.
    blockers: "blockers",
    /// Triangles tried as such, alone or with their neighbours.
    blocker_tries: "triangles",
    /// Triangles whose edges and plane were set up on the image.
    facets: "triangles",
    /// Triangles of the visible set that was looked up, and by its own estimate the share
    /// of what can be seen that it lacks.
    pvs_members: "triangles",
    pvs_missing_ppm: "ppm",
}

impl Tally {
    /// The first so many counters are part of every record; a later one only where it is
    /// not 0, so that trials stored before it came still count the same things.
    pub const ALWAYS: usize = 8;
    /// Counters that are kept frame by frame where they are not 0: what charts draw
    /// against the frame.
    pub const BY_FRAME: [&str; 6] =
        ["frames_off", "nodes_occluded", "occluders_drawn", "queries", "stall_ns", "virtual_ns"];
}
