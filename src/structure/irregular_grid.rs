//! Irregular grid: a rectilinear grid whose planes follow the scene.
//!
//! Silva (2009) measures a "Grid Irregular" and does not define it; his abstract says
//! "non-uniform grids". This is our reading: planes across each axis, chosen
//! - `quantile`: at quantiles of the centroids, so that every layer of cells holds as
//!   many triangles as any other, to one;
//! - `walls`: at those quantiles, each moved to the wall or floor of its neighbourhood
//!   with most area, if there is one: where triangles lie in one plane across the axis
//!   with all their corners. (The heaviest walls of the whole axis lie close together,
//!   or anywhere in a scanned mesh: with them, one cell held 112,000 triangles of Sponza's
//!   279,000.)
//!
//! Two planes of an axis are never equal, so ties and flat axes make fewer layers. A
//! cell is found by three binary searches. Policies and layouts are those of
//! [`super::uniform_grid`], and so is the reason why the grid is conservative.

use super::Structure;
use super::builder::axes::{Axis, Grid, walls_across};
use super::builder::scene_bounds;
use super::builder::straddle::{self, Policy};
use super::uniform_grid::{LAYOUT, build_grid};
use crate::error::Result;
use crate::hierarchy::Hierarchy;
use crate::math::Aabb;
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;
use rayon::prelude::*;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "irregular_grid",
    about: "rectilinear grid with planes at quantiles of the triangles or at walls",
    revision: 1,
    params: &[
        layers("nx", 16, "layers of cells across x"),
        layers("ny", 16, "layers of cells across y"),
        layers("nz", 4, "layers of cells across z"),
        Param {
            name: "planes",
            default: Default::Choice(&["quantile", "walls"]),
            about: "between layers: at quantiles of the centroids, or moved from there to the heaviest wall or floor nearby",
        },
        straddle::PARAM,
        LAYOUT,
    ],
    make: |spec| {
        Box::new(IrregularGrid {
            counts: ["nx", "ny", "nz"].map(|n| spec.int(n) as u32),
            walls: spec.text("planes") == "walls",
            policy: Policy::of(spec),
            rows: spec.text("layout") == "rows",
        })
    },
};

const fn layers(name: &'static str, value: i64, about: &'static str) -> Param {
    Param { name, default: Default::Int { value, min: 1, max: super::builder::axes::CELLS_MAX as i64 }, about }
}

#[derive(Debug, Clone, Copy)]
pub struct IrregularGrid {
    /// Layers of cells across each axis, at most.
    pub counts: [u32; 3],
    /// Quantiles moved to walls.
    pub walls: bool,
    pub policy: Policy,
    pub rows: bool,
}

impl IrregularGrid {
    /// The cells of a scene with at least one triangle.
    pub fn grid(&self, scene: &Scene) -> Grid {
        let bounds = scene_bounds(scene);
        let axis = |axis: usize| {
            let ranks = layer_ranks(scene.len(), self.counts[axis] as usize);
            let planes = match self.walls {
                true => snapped(scene, axis, &bounds, &ranks),
                false => planes_at(centroids(scene, axis), &ranks),
            };
            Axis::between(bounds.lo[axis], bounds.hi[axis], planes)
        };
        let axes: Vec<Axis> = (0..3).into_par_iter().map(axis).collect();
        Grid { axes: axes.try_into().expect("three axes"), morton: false }
    }
}

impl Structure for IrregularGrid {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        let blame = ("an irregular grid", "nx", "lower `nx`, `ny` or `nz`");
        build_grid(scene, self.policy, self.rows, || self.grid(scene), blame)
    }
}

/// Coordinates of all centroids, in the order of triangles.
fn centroids(scene: &Scene, axis: usize) -> Vec<f64> {
    let centroid = |t| {
        let [a, b, c] = scene.corners(t);
        (a[axis] + b[axis] + c[axis]) / 3.0
    };
    (0..scene.len() as u32).into_par_iter().with_min_len(4096).map(centroid).collect()
}

/// Ranks of the first centroid of every layer but the lowest, ascending.
fn layer_ranks(n: usize, layers: usize) -> Vec<usize> {
    let mut ranks: Vec<usize> = (1..layers).map(|i| i * n / layers).filter(|rank| *rank > 0).collect();
    ranks.dedup();
    ranks
}

/// A plane below the centroid of each rank and above the one before, where they do not tie.
fn planes_at(mut centroids: Vec<f64>, ranks: &[usize]) -> Vec<f64> {
    let mut planes = vec![0.0; ranks.len()];
    part(&mut centroids, 0, ranks, &mut planes);
    planes
}

/// For each of the ascending `ranks`, a plane between the values of lower rank and
/// the others; `values[0]` has rank `base`.
fn part(values: &mut [f64], base: usize, ranks: &[usize], planes: &mut [f64]) {
    if ranks.is_empty() {
        return;
    }
    let middle = ranks.len() / 2;
    let at = ranks[middle] - base;
    let (below, upper, _) = values.select_nth_unstable_by(at, f64::total_cmp);
    let upper = *upper;
    // A value of that rank itself may lie in a wall: halfway to the next one below does not.
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let halfway = lower + (upper - lower) * 0.5;
    let (left, right) = values.split_at_mut(at);
    let (left_planes, rest) = planes.split_at_mut(middle);
    let (own, right_planes) = rest.split_first_mut().expect("a plane a rank");
    *own = if halfway > lower { halfway } else { upper };
    rayon::join(
        || part(left, base, &ranks[..middle], left_planes),
        || part(right, base + at, &ranks[middle + 1..], right_planes),
    );
}

/// The planes at the quantiles, each moved to the heaviest wall of its neighbourhood,
/// which ends halfway by rank to the planes beside it.
fn snapped(scene: &Scene, axis: usize, bounds: &Aabb, ranks: &[usize]) -> Vec<f64> {
    let borders: Vec<usize> = ranks.windows(2).map(|w| (w[0] + w[1]).div_ceil(2)).collect();
    let mut all = [ranks, &borders].concat();
    all.sort_unstable();
    all.dedup();
    let found = planes_at(centroids(scene, axis), &all);
    let plane = |rank: &usize| found[all.partition_point(|r| r < rank)];
    let borders: Vec<f64> = borders.iter().map(plane).collect();
    // Heaviest wall so far, and the plane without one.
    let mut planes: Vec<(f64, f64)> = ranks.iter().map(|rank| (0.0, plane(rank))).collect();
    for (at, area) in walls_across(scene, axis, bounds, |_| true) {
        if let Some(plane) = planes.get_mut(borders.partition_point(|b| *b <= at))
            && area > plane.0
        {
            *plane = (area, at);
        }
    }
    planes.into_iter().map(|(_, at)| at).collect()
}
