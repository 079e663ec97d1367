//! Nested grids (Jevans & Wyvill 1989; resolutions of Ize, Shirley & Parker 2007):
//! a coarse uniform grid whose crowded cells hold grids of their own.
//!
//! With `d` levels below it, a grid over N triangles gets `density N^(3 / (3 + 2 d))`
//! cells, which Ize et al. find best for compact triangles: `density N^0.6` for one
//! nested level, and `density N`, a plain grid, for the innermost. A cell with more
//! than `leaf_limit` triangles gets a grid over what it holds of them; the innermost
//! level divides no further, and cells above the limit are counted. They find no gain
//! for scattered primitives.
//!
//! Straddling triangles follow the `policy`, as in [`super::uniform_grid`], in the cells
//! of all levels. Cells of a nested grid lie along a Morton curve, so that the groups
//! of 8 that the layout makes of them are compact. The layout of the outermost grid is
//! `rows` or `flat`; the walk `flat` takes every innermost cell by itself and gains
//! nothing from nesting, `depth_first` asks about the outer cells first.
//!
//! Conservative as a uniform grid is: boxes hold their triangles or parts of them.

use super::Structure;
use super::builder::axes::{Grid, resolution};
use super::builder::cells::Dealer;
use super::builder::leaves::{Shape, finish};
use super::builder::straddle::{self, Budget, Policy};
use super::builder::{flatten, scene_bounds};
use super::uniform_grid::DENSITY;
use crate::error::Result;
use crate::hierarchy::Hierarchy;
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "nested_grid",
    about: "a coarse grid with grids in its crowded cells",
    revision: 1,
    params: &[
        DENSITY,
        Param {
            name: "leaf_limit",
            default: Default::Int { value: 64, min: 1, max: 1 << 30 },
            about: "a cell with more triangles gets a grid of its own",
        },
        Param {
            name: "levels",
            default: Default::Int { value: 1, min: 1, max: 4 },
            about: "levels of grids within cells",
        },
        straddle::PARAM,
        Param {
            name: "layout",
            default: Default::Choice(&["rows", "flat"]),
            about: "of the outermost grid: layers of rows of cells, or every cell a root",
        },
    ],
    make: |spec| {
        Box::new(NestedGrid {
            density: spec.float("density"),
            leaf_limit: spec.int("leaf_limit") as u32,
            levels: spec.int("levels") as u32,
            policy: Policy::of(spec),
            rows: spec.text("layout") == "rows",
        })
    },
};

#[derive(Debug, Clone, Copy)]
pub struct NestedGrid {
    pub density: f64,
    pub leaf_limit: u32,
    pub levels: u32,
    pub policy: Policy,
    pub rows: bool,
}

impl NestedGrid {
    /// Cells wanted for so many triangles with so many levels of grids below.
    fn cells(&self, triangles: usize, levels: u32) -> f64 {
        self.density * libm::pow(triangles as f64, 3.0 / f64::from(3 + 2 * levels))
    }

    /// The outermost grid of a scene with at least one triangle.
    pub fn grid(&self, scene: &Scene) -> Grid {
        let bounds = scene_bounds(scene);
        Grid::uniform(&bounds, resolution(bounds.size(), self.cells(scene.len(), self.levels)))
    }
}

impl Structure for NestedGrid {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        if scene.is_empty() {
            return Ok(flatten(scene, &[], Vec::new(), None));
        }
        let budget = Budget::of(scene);
        let dealer = Dealer {
            scene,
            policy: self.policy,
            budget: &budget,
            leaf_limit: self.leaf_limit as usize,
            levels: self.levels,
            cells: &|triangles, levels| self.cells(triangles, levels),
        };
        let mut boxes = Vec::new();
        let cells = dealer.deal(self.grid(scene), &mut boxes);
        let laid = cells.and_then(|cells| match self.rows {
            true => finish(scene, &cells.rows(), self.policy, &boxes, Shape::Joined, self.leaf_limit),
            false => finish(scene, &cells.flat(), self.policy, &boxes, Shape::Roots, self.leaf_limit),
        });
        laid.ok_or_else(|| budget.error("a nested grid", scene, "density", "lower `density` or raise `leaf_limit`"))
    }
}
