//! `pvs`: what is potentially visible from the eye's view cell, sampled beforehand (as
//! Airey, Rohlf & Brooks 1990, by item buffers; the from-region column of visibility
//! laboratories).
//!
//! Space is a grid of view cells. From `eyes` points of a cell six faces of an item buffer
//! see triangles ([`Items`](crate::raster::items::Items)); the cell's set is their union,
//! or with `points = nearest` only what the point nearest to the eye saw. A frame submits
//! the members of the set in what the tests of the sum leave, triangle by triangle.
//!
//! **Aggressive**: what no sample saw is lost, be it between pixels or between points. How
//! much that may be, the samples themselves say: `pvs_missing_ppm`, the share of samples
//! whose triangle no other saw, estimates the chance that one more sample sees something
//! new. More eyes only add to a set, as the points of fewer are among them.
//!
//! Parallel rays have no eye point that a cell could hold; then the tests alone cull.
//!
//! A cell is sampled when the eye first comes to it, and kept. A trial's first pass, which
//! is not timed, does that; neither that time nor the sets' memory is in any figure.

use super::descent::Descent;
use super::pvs_cells::{Cell, CellNumber, Sampling, Set, Space, runs};
use super::skipping::{STILL, Skipping, WHOLE_BELOW};
use super::*;
use crate::hierarchy::NONE;
use crate::raster::items::Lens;
use std::collections::HashMap;

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "pvs",
    about: "members of the visible set of the eye's cell, sampled beforehand (aggressive)",
    revision: 1,
    params: &[
        Param {
            name: "cells",
            default: Allowed::Int { value: 16, min: 1, max: 1024 },
            about: "view cells along the longest side of the scene; cells are cubes",
        },
        Param {
            name: "eyes",
            default: Allowed::Int { value: 16, min: 1, max: 4096 },
            about: "points a cell that are looked from, stratified; those of fewer are among those of more",
        },
        Param {
            name: "near_m",
            default: Allowed::Float { value: 0.1, min: 1e-4, max: 1e3 },
            about: "nothing nearer to a point is seen from it or hides anything",
        },
        Param {
            name: "points",
            default: Allowed::Choice(&["union", "nearest"]),
            about: "the set: of all points of the cell, or of the one nearest to the eye",
        },
        Param {
            name: "resolution_px",
            default: Allowed::Int { value: 128, min: 4, max: 4096 },
            about: "pixels along an edge of a point's six faces",
        },
        Param { name: "seed", default: Allowed::Int { value: 1, min: 0, max: i64::MAX }, about: "places the points" },
        STILL,
        WHOLE_BELOW,
    ],
    make: |spec| {
        let lens = Lens { resolution_px: spec.int("resolution_px") as u32, near_m: spec.float("near_m") };
        let sampling = Sampling {
            cells: spec.int("cells") as u32,
            eyes: spec.int("eyes") as u32,
            seed: spec.int("seed") as u64,
            nearest: spec.text("points") == "nearest",
            lens,
        };
        Box::new(Pvs {
            sampling,
            space: Space::default(),
            cells: HashMap::new(),
            descent: Descent::default(),
            skipping: Skipping::new(spec),
        })
    },
};

pub struct Pvs {
    sampling: Sampling,
    space: Space,
    /// Sampled so far; kept over passes.
    cells: HashMap<CellNumber, Cell>,
    descent: Descent,
    skipping: Skipping,
}

impl Walk for Pvs {
    fn class(&self) -> Class {
        Class::Aggressive
    }

    fn removes(&self) -> Removes {
        // Back faces of one-sided triangles are never seen.
        Removes { outside_frustum: false, back_facing: true, occluded: true }
    }

    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        debug_assert!(hierarchy.entries.iter().all(|t| (*t as usize) < scene.len()));
        self.space = Space::new(scene, &self.sampling);
        self.cells.clear();
        self.space.bytes()
    }

    fn skipping(&mut self) -> Option<&mut Skipping> {
        Some(&mut self.skipping)
    }

    fn remembers(&self) -> bool {
        false
    }

    fn run(
        &mut self,
        view: &View,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        let set = view.is_perspective().then(|| {
            let number = self.space.cell_of(view.eye);
            let sample = || self.space.sampled(number, hierarchy, &self.sampling);
            self.cells.entry(number).or_insert_with(sample).set(view.eye)
        });
        if let Some(set) = set {
            tally.pvs_members += set.triangles;
            tally.pvs_missing_ppm += set.missing_ppm;
            out.compacted = true;
        }
        submit(&mut self.descent, set, hierarchy, tests, out, tally);
    }
}

/// Members of the set, or everything, that the tests leave.
fn submit(
    descent: &mut Descent,
    set: Option<&Set>,
    hierarchy: &Hierarchy,
    tests: &mut [Box<dyn Test>],
    out: &mut DrawList,
    tally: &mut Tally,
) {
    let count = tests.len();
    let push = |out: &mut DrawList, first: u32, end: u32| match set {
        Some(set) => runs(&set.members, first, end).for_each(|(a, b)| out.push(a, b)),
        None => out.push(first, end),
    };
    // Lanes without members are as good as none.
    let lanes = |block: u32| {
        let live = hierarchy.links[block as usize].live;
        set.map_or(live, |s| live & s.any[block as usize])
    };
    for root in 0..hierarchy.root_blocks {
        if lanes(root) == 0 {
            continue;
        }
        descent.clear();
        descent.enter(hierarchy, root, lanes(root), 0, tests, None, tally);
        while let Some(at) = descent.next(count) {
            let links = &hierarchy.links[at.block as usize];
            let (first, own_end, end) = (links.first[at.lane], links.own_end[at.lane], links.end[at.lane]);
            let child = links.child[at.lane];
            if child == NONE || descent.is_settled(at, count) {
                push(out, first, end);
                continue;
            }
            push(out, first, own_end);
            if lanes(child) != 0 {
                descent.enter(hierarchy, child, lanes(child), 0, tests, Some(at), tally);
                descent.expect_children(hierarchy);
            }
        }
    }
}
