//! What a walk's depth buffer draws of a scene, the pieces of a hierarchy in its order, and
//! the parameters that size and fill it.

use super::{Allowed, Class, Param};
use crate::hierarchy::{Hierarchy, LANES};
use crate::raster::{Coverage, Kind, MOST_PX, Occluders, Settings};
use crate::registry::Spec;
use crate::scene::Scene;

pub(super) const COVERAGE: Param = Param {
    name: "coverage",
    default: Allowed::Choice(&["samples", "inner"]),
    about: "pixels that hide: those whose centre is covered (sample-conservative), or those covered as a whole (conservative)",
};

pub(super) const WIDTH_PX: Param = Param {
    name: "width_px",
    default: Allowed::Int { value: 960, min: 1, max: MOST_PX as i64 },
    about: "columns of the depth buffer",
};

pub(super) const HEIGHT_PX: Param = Param {
    name: "height_px",
    default: Allowed::Int { value: 0, min: 0, max: MOST_PX as i64 },
    about: "rows of the depth buffer; 0: nine for sixteen columns",
};

/// The buffer that a resolved spec asks for.
pub(super) fn settings_of(spec: &Spec) -> Settings {
    let coverage = if spec.text("coverage") == "inner" { Coverage::Inner } else { Coverage::Samples };
    let width_px = spec.int("width_px") as u32;
    let height_px = match spec.int("height_px") as u32 {
        0 => ((width_px * 9 + 8) / 16).max(1),
        rows => rows,
    };
    Settings { width_px, height_px, coverage }
}

/// What hiding by the buffer promises.
pub(super) fn class_of(coverage: Coverage) -> Class {
    match coverage {
        Coverage::Samples => Class::SampleConservative,
        Coverage::Inner => Class::Conservative,
    }
}

pub(super) fn occluders_of(scene: &Scene, hierarchy: &Hierarchy) -> Occluders {
    let kind = |position: u32| Kind::of(scene, hierarchy.entries[position as usize]);
    let mut starts = Vec::new();
    for links in &hierarchy.links {
        let own = |l: &usize| links.live >> l & 1 == 1 && links.own_end[*l] > links.first[*l];
        starts.extend((0..LANES).filter(own).map(|l| links.first[l]));
    }
    starts.sort_unstable();
    let corners = |position: u32| hierarchy.piece(scene, position);
    Occluders::new(hierarchy.entries.len() as u32, hierarchy.origin, corners, kind, &starts)
}
