//! The exact box test (`frustum:sat=true`): separating axes.
//!
//! A box that no plane of the frustum rejects may still miss it, beside an edge or a
//! corner of the view. By the separating axis theorem (Gottschalk, Lin & Manocha 1996)
//! two convex polytopes are disjoint iff their projections are on one of finitely many axes:
//! normals of the faces of either, and cross products of an edge of each. Of a box and a
//! frustum these are 3 + 5 + 3 x 6; with parallel rays the edges are three and the products
//! 9. The frustum's own normals are the planes, which were tested before; where a
//! sphere or a point was tested in place of the box, they are among the axes here.
//! The 3 of the box say that the whole view lies beyond one of its faces.
//!
//! What we changed: no infinity. Whatever the far plane, a point that box and view share is
//! no deeper than the box, so the view is cut off there, box by box: it is finite, and
//! errors scale with the box and its distance alone. An edge of the view then projects
//! to an interval that the depth and two numbers an axis and frame give.
//!
//! Conservative: all is f64 relative to the eye, which is subtracted exactly but for a
//! rounding of the result. A projection is a handful of sums and products of terms no
//! larger than `|axis| (|box| + depth |ray|)` with the sums of absolute coordinates; that is
//! within `2^-48` of itself, and so is the difference between rays and the rounded planes
//! that are the view. Only a gap of more than `2^-42` of it separates. A box with swapped or NaN
//! bounds is kept.

use super::Tally;
use super::frustum_planes::two_diff;
use crate::hierarchy::{BoundsBlock, LANES};
use crate::math::{Box32, DVec3, View};

/// Share of the magnitudes that a gap has to exceed.
const GUARD: f64 = 1.0 / (1u64 << 42) as f64;

/// An axis, and where it sees the view: at depth `z` the corners of the cross-section are
/// between `base[0] + z slope[0]` and `base[1] + z slope[1]`.
#[derive(Debug, Clone, Copy)]
struct Axis {
    direction: DVec3,
    base: [f64; 2],
    slope: [f64; 2],
    /// Sum of absolute coordinates.
    size: f64,
}

/// The axes of a frame.
#[derive(Debug, Clone, Default)]
pub struct SeparatingAxes {
    eye: [f64; 3],
    rest: [f64; 3],
    forward: DVec3,
    near_m: f64,
    far_m: f64,
    /// Magnitude of the cross-section at depth 0, and a metre of depth.
    base: f64,
    slope: f64,
    axes: Vec<Axis>,
}

impl SeparatingAxes {
    /// `with_planes`: boxes were not compared with the planes themselves.
    pub fn new(view: &View, origin: DVec3, with_planes: bool) -> SeparatingAxes {
        let sum = |v: DVec3| v.abs().element_sum();
        let (w, h) = (view.right * view.half_width, view.up * view.half_height);
        let rays = view.corner_rays();
        let (bases, edges) = match view.is_perspective() {
            true => ([DVec3::ZERO; 4], vec![view.right, view.up, rays[0], rays[1], rays[2], rays[3]]),
            false => ([-w - h, w - h, w + h, h - w], vec![view.right, view.up, view.forward]),
        };
        let mut frame = SeparatingAxes {
            forward: view.forward,
            near_m: view.camera.near_m,
            far_m: view.camera.far_m.unwrap_or(f64::INFINITY),
            base: if view.is_perspective() { 0.0 } else { sum(w) + sum(h) },
            slope: if view.is_perspective() { sum(view.forward) + sum(w) + sum(h) } else { sum(view.forward) },
            ..SeparatingAxes::default()
        };
        for axis in 0..3 {
            (frame.eye[axis], frame.rest[axis]) = two_diff(view.eye[axis], origin[axis]);
        }
        let mut add = |direction: DVec3| {
            let span = |points: [DVec3; 4]| {
                let at = points.map(|p| direction.dot(p));
                [at.into_iter().fold(f64::INFINITY, f64::min), at.into_iter().fold(f64::NEG_INFINITY, f64::max)]
            };
            frame.axes.push(Axis { direction, base: span(bases), slope: span(rays), size: sum(direction) });
        };
        DVec3::AXES.into_iter().for_each(&mut add);
        if with_planes {
            view.planes.iter().take(5).for_each(|p| add(p.normal));
        }
        for edge in edges {
            // Parallel edges have no product, and all that it could tell is known from faces.
            let products = DVec3::AXES.map(|a| a.cross(edge));
            let proper = |p: &DVec3| p.length_squared() > 1e-18 * edge.length_squared();
            products.into_iter().filter(proper).for_each(&mut add);
        }
        frame
    }

    /// The lanes of `lanes` that some axis separates from the view.
    #[inline(never)]
    pub fn separated(&self, bounds: &BoundsBlock, lanes: u8, tally: &mut Tally) -> u8 {
        let apart = |lane: usize, tally: &mut Tally| self.separates(&bounds.get(lane), tally);
        (0..LANES).filter(|l| lanes >> l & 1 == 1).fold(0, |m, l| m | u8::from(apart(l, tally)) << l)
    }

    fn separates(&self, b: &Box32, tally: &mut Tally) -> bool {
        if !b.lo.cmple(b.hi).all() {
            return false;
        }
        let near =
            |bound: [f32; 3]| DVec3::from_array([0, 1, 2].map(|i| (f64::from(bound[i]) - self.eye[i]) - self.rest[i]));
        let (lo, hi) = (near(b.lo.to_array()), near(b.hi.to_array()));
        let (centre, half) = ((lo + hi) * 0.5, (hi - lo) * 0.5);
        let extent = (lo.abs() + hi.abs()).element_sum();
        let deepest = self.forward.dot(centre) + self.forward.abs().dot(half) + GUARD * extent;
        // Wholly in front of the near plane.
        if deepest < self.near_m {
            tally.axis_tests += 1;
            return true;
        }
        let far_m = self.far_m.min(deepest);
        let magnitude = GUARD * (extent + self.base + (self.near_m + far_m) * self.slope);
        for axis in &self.axes {
            tally.axis_tests += 1;
            let (middle, reach) = (axis.direction.dot(centre), axis.direction.abs().dot(half));
            let [low, high] = [0, 1].map(|i| {
                let ends = [self.near_m * axis.slope[i], far_m * axis.slope[i]];
                axis.base[i] + if i == 0 { ends[0].min(ends[1]) } else { ends[0].max(ends[1]) }
            });
            let guard = magnitude * axis.size;
            if middle - reach > high + guard || middle + reach < low - guard {
                return true;
            }
        }
        false
    }
}
