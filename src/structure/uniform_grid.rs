//! Uniform grid (Franklin 1984 for visible surfaces; Cleary & Wyvill 1988 for its
//! resolution): cells of one size, about `density` of them a triangle.
//!
//! `n_i = ceil(L_i (density N / V)^(1/3))` cells an axis, at most 512; a flat axis has
//! one layer (see [`resolution`]). Empty cells are not stored. Straddling triangles
//! follow the `policy`: by centroid with grown boxes (L), a copy in every closed cell
//! that they overlap (R), or their part in each cell (S).
//!
//! As `flat`, every cell is a root and a frame asks about each of them, which is what
//! a plain grid costs even when all is culled. As `rows`, cells form rows along x and
//! rows layers in z, and what holds of a layer holds of its rows and cells; more than
//! 8 siblings are joined by nodes of our own, which the counts leave out.
//!
//! Conservative: a box holds its triangles; under R, the parts of its triangles that
//! lie in its cell, which over all cells are the triangle.

use super::Structure;
use super::builder::axes::{Grid, resolution};
use super::builder::cells::Dealer;
use super::builder::leaves::{Shape, finish};
use super::builder::straddle::{self, Budget, Policy};
use super::builder::{flatten, scene_bounds};
use crate::error::Result;
use crate::hierarchy::Hierarchy;
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "uniform_grid",
    about: "cells of one size",
    revision: 1,
    params: &[DENSITY, straddle::PARAM, LAYOUT],
    make: |spec| {
        Box::new(UniformGrid {
            density: spec.float("density"),
            policy: Policy::of(spec),
            rows: spec.text("layout") == "rows",
        })
    },
};

pub(super) const DENSITY: Param = Param {
    name: "density",
    default: Default::Float { value: 4.0, min: 0.01, max: 1000.0 },
    about: "cells a triangle, empty ones included",
};

pub(super) const LAYOUT: Param = Param {
    name: "layout",
    default: Default::Choice(&["flat", "rows"]),
    about: "flat: every cell is asked about; rows: layers of rows of cells, from the outside in",
};

#[derive(Debug, Clone, Copy)]
pub struct UniformGrid {
    pub density: f64,
    pub policy: Policy,
    pub rows: bool,
}

impl UniformGrid {
    /// The cells of a scene with at least one triangle.
    pub fn grid(&self, scene: &Scene) -> Grid {
        let bounds = scene_bounds(scene);
        Grid::uniform(&bounds, resolution(bounds.size(), self.density * scene.len() as f64))
    }
}

impl Structure for UniformGrid {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        build_grid(scene, self.policy, self.rows, || self.grid(scene), ("a uniform grid", "density", "lower `density`"))
    }
}

/// The structure of a single grid. `blame`: what it is, and the parameter to change
/// in which way where it has too many entries.
pub(super) fn build_grid(
    scene: &Scene,
    policy: Policy,
    rows: bool,
    grid: impl FnOnce() -> Grid,
    blame: (&str, &str, &str),
) -> Result<Hierarchy> {
    if scene.is_empty() {
        return Ok(flatten(scene, &[], Vec::new(), None));
    }
    let budget = Budget::of(scene);
    let dealer = Dealer { scene, policy, budget: &budget, leaf_limit: 0, levels: 0, cells: &|_, _| 0.0 };
    let mut boxes = Vec::new();
    let cells = dealer.deal(grid(), &mut boxes);
    let laid = cells.and_then(|cells| match rows {
        true => finish(scene, &cells.rows(), policy, &boxes, Shape::Joined, 0),
        false => finish(scene, &cells.flat(), policy, &boxes, Shape::Roots, 0),
    });
    laid.ok_or_else(|| budget.error(blame.0, scene, blame.1, blame.2))
}
