//! `f32_world`: the frustum test as most engines write it. Class aggressive.
//!
//! Planes come from the rows of a single-precision world-space view-projection
//! matrix (Gribb & Hartmann 2001), boxes are single-precision world coordinates,
//! and the p-vertex is compared with zero, without a guard. The eye, the axes, the
//! translation `-axis . eye`, the product of the matrices and the sums of their
//! rows all round to f32. Far from the world's origin the translation and `n . p`
//! are large and cancel, and each bound was rounded to nearest, not outward: so
//! boxes that can be seen are lost, a decade more a decade farther out (fact B5.2).
//!
//! The projection is the usual right-handed one with depth 0 at the near and 1 at the
//! far plane. An infinite far plane leaves a row without a normal, which is found
//! before normalising and stands for "everything is inside" (B1). The same
//! happens for a far plane that f32 cannot tell from infinity, and up to there the far plane
//! is where its row says, which is not quite where the camera says.
//! Boxes with a NaN or infinite bound are made NaN altogether, hence kept (B5.4).

use super::frustum_arithmetic::{Ask, PlaneTest};
use super::frustum_octant::{Far, Halves};
use super::frustum_planes::{FramePlanes, Plane32, PlaneMasks, Work};
use super::frustum_relative::{Kernels, kernels_of};
use super::{Class, Tally};
use crate::hierarchy::{BoundsBlock, Hierarchy, LANES};
use crate::math::{Box32, DVec3, Vec3, View};

type Row = [f32; 4];

/// Rows of the world-space view-projection matrix, all in f32.
pub fn view_projection(view: &View) -> [Row; 4] {
    let eye = view.eye.as_vec3();
    let row = |axis: Vec3| [axis.x, axis.y, axis.z, -axis.dot(eye)];
    let camera =
        [row(view.right.as_vec3()), row(view.up.as_vec3()), row(-view.forward.as_vec3()), [0.0, 0.0, 0.0, 1.0]];
    let projection = projection(view);
    projection.map(|p| std::array::from_fn(|j| (0..4).map(|i| p[i] * camera[i][j]).sum()))
}

fn projection(view: &View) -> [Row; 4] {
    let (near, far) = (view.camera.near_m as f32, view.camera.far_m.map(|f| f as f32));
    let (x, y) = (1.0 / view.half_width as f32, 1.0 / view.half_height as f32);
    let (depth, w) = match (view.is_perspective(), far) {
        (true, Some(far)) => ([0.0, 0.0, far / (near - far), near * far / (near - far)], [0.0, 0.0, -1.0, 0.0]),
        (true, None) => ([0.0, 0.0, -1.0, -near], [0.0, 0.0, -1.0, 0.0]),
        (false, Some(far)) => ([0.0, 0.0, 1.0 / (near - far), near / (near - far)], [0.0, 0.0, 0.0, 1.0]),
        // No matrix has this volume: its near plane, by the metre, is all there is of depth.
        (false, None) => ([0.0, 0.0, -1.0, -near], [0.0, 0.0, 0.0, 1.0]),
    };
    [[x, 0.0, 0.0, 0.0], [0.0, y, 0.0, 0.0], depth, w]
}

/// The planes in f32 world coordinates, as the kernels read them: an eye of zero,
/// and no slack.
pub fn planes(view: &View) -> FramePlanes {
    let [r0, r1, r2, r3] = view_projection(view);
    let sum = |a: Row, sign: f32, b: Row| std::array::from_fn::<f32, 4, _>(|i| a[i] + sign * b[i]);
    let rows = [sum(r3, 1.0, r0), sum(r3, -1.0, r0), sum(r3, 1.0, r1), sum(r3, -1.0, r1), r2, sum(r3, -1.0, r2)];
    let mut frame = FramePlanes { count: view.planes.len(), ..Default::default() };
    for (plane, row) in frame.planes[..view.planes.len()].iter_mut().zip(rows) {
        *plane = plane_of(row);
    }
    frame
}

fn plane_of([x, y, z, d]: Row) -> Plane32 {
    let normal = Vec3::new(x, y, z);
    let length = normal.length();
    let [normal, d] = if length < 1e-12 * d.abs() {
        return Plane32 { d_out: 1.0, d_in: 1.0, p: [3, 4, 5], n: [0, 1, 2], ..Default::default() };
    } else {
        [normal / length, Vec3::splat(d / length)]
    };
    let p = [0, 1, 2].map(|axis| if normal[axis] >= 0.0 { axis + 3 } else { axis });
    let n = [0, 1, 2].map(|axis| 2 * axis + 3 - p[axis]);
    Plane32 { normal: normal.to_array(), d_out: d.x, d_in: d.x, p, n }
}

/// A box in world coordinates, each bound rounded to nearest; all NaN if one is not finite.
pub fn world_box(b: &Box32, origin: DVec3) -> Box32 {
    let place = |bound: Vec3| (bound.as_dvec3() + origin).as_vec3();
    let (lo, hi) = (place(b.lo), place(b.hi));
    if lo.is_finite() && hi.is_finite() { Box32 { lo, hi } } else { Box32 { lo: Vec3::NAN, hi: Vec3::NAN } }
}

/// The arithmetic `f32_world`, with its column of boxes.
pub struct World {
    kernels: Kernels,
    frame: FramePlanes,
    bounds: Vec<BoundsBlock>,
}

impl Default for World {
    fn default() -> World {
        World { kernels: kernels_of::<false>()[0], frame: FramePlanes::default(), bounds: Vec::new() }
    }
}

impl PlaneTest for World {
    const CLASS: Class = Class::Aggressive;

    fn prepare(&mut self, hierarchy: &Hierarchy) -> usize {
        let block = |local: &BoundsBlock| {
            let mut world = BoundsBlock::EMPTY;
            (0..LANES).for_each(|lane| world.set(lane, world_box(&local.get(lane), hierarchy.origin)));
            world
        };
        self.bounds = hierarchy.bounds.iter().map(block).collect();
        size_of_val(&self.bounds[..])
    }

    fn begin(&mut self, view: &View, _: &Hierarchy) {
        self.frame = planes(view);
    }

    fn planes(&self) -> usize {
        self.frame.count
    }

    fn block(&mut self, _: &Hierarchy, ask: &Ask, masks: &mut PlaneMasks, _: &mut Tally) {
        (self.kernels.block)(&self.frame, &self.bounds[ask.block as usize], ask.planes, ask.inside, masks);
    }

    fn flat(&mut self, _: &Hierarchy, live: &[u8], outside: &mut [u8], _: &mut Tally) -> Work {
        (self.kernels.flat)(&self.frame, &self.bounds[..outside.len()], live, outside)
    }

    /// Planes that err may reject what they must not, also on the far side.
    fn far_planes(&self, _: &Halves, _: &Hierarchy, _: u32) -> Option<Far> {
        None
    }
}
