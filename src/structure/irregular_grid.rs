//! Irregular grid: a rectilinear grid whose planes follow the scene.
//!
//! Silva (2009) measures a "Grid Irregular" and does not define it; his abstract says
//! "non-uniform grids". This is our reading: planes across each axis, chosen
//! - `quantile`: at quantiles of the centroids, so that every layer of cells holds as
//!   many triangles as any other, to one;
//! - `walls`: where most area of triangles lies in one plane across the axis, walls
//!   and floors, heaviest first; quantiles of what is left make up the number.
//!
//! Two planes of an axis are never equal, so ties and flat axes make fewer layers. A
//! cell is found by three binary searches. Policies and layouts are those of
//! [`super::uniform_grid`], and so is the reason why the grid is conservative.

use super::Structure;
use super::builder::axes::{Axis, Grid};
use super::builder::scene_bounds;
use super::builder::straddle::{self, Policy};
use super::uniform_grid::{LAYOUT, build_grid};
use crate::error::Result;
use crate::hierarchy::Hierarchy;
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
            about: "between layers: at quantiles of the centroids, or at the heaviest walls and floors",
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
    /// Planes at walls rather than at quantiles.
    pub walls: bool,
    pub policy: Policy,
    pub rows: bool,
}

impl IrregularGrid {
    /// The cells of a scene with at least one triangle.
    pub fn grid(&self, scene: &Scene) -> Grid {
        let bounds = scene_bounds(scene);
        let axis = |axis: usize| {
            let count = self.counts[axis] as usize;
            let (lo, hi) = (bounds.lo[axis], bounds.hi[axis]);
            let mut planes = if self.walls { heaviest_walls(scene, axis, lo, hi, count - 1) } else { Vec::new() };
            planes.extend(quantiles(scene, axis, count - planes.len()));
            Axis::between(lo, hi, planes)
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

/// Planes that part the centroids into `parts` of one size, to one, unless they tie.
fn quantiles(scene: &Scene, axis: usize, parts: usize) -> Vec<f64> {
    let n = scene.len();
    let mut ranks: Vec<usize> = (1..parts).map(|i| i * n / parts).filter(|rank| *rank > 0).collect();
    ranks.dedup();
    let centroid = |t| {
        let [a, b, c] = scene.corners(t);
        (a[axis] + b[axis] + c[axis]) / 3.0
    };
    let mut values: Vec<f64> = (0..n as u32).into_par_iter().with_min_len(4096).map(centroid).collect();
    let mut planes = vec![0.0; ranks.len()];
    part(&mut values, 0, &ranks, &mut planes);
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

/// Coordinates strictly between `lo` and `hi` in which most area lies across the
/// axis, at most `count`: of triangles whose three corners share it to the bit.
fn heaviest_walls(scene: &Scene, axis: usize, lo: f64, hi: f64, count: usize) -> Vec<f64> {
    let in_plane = |t: u32| {
        let [a, b, c] = scene.corners(t).map(|p| p[axis]);
        let area = scene.normal(t).length();
        (a == b && b == c && lo < a && a < hi && area > 0.0).then_some((a, area))
    };
    let mut found: Vec<(f64, f64)> =
        (0..scene.len() as u32).into_par_iter().with_min_len(4096).filter_map(in_plane).collect();
    // Stable: areas are added in the order of the scene.
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut walls: Vec<(f64, f64)> =
        found.chunk_by(|a, b| a.0 == b.0).map(|wall| (wall[0].0, wall.iter().map(|w| w.1).sum())).collect();
    walls.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.total_cmp(&b.0)));
    walls.truncate(count);
    walls.into_iter().map(|w| w.0).collect()
}
