//! `exact`: the frustum test in exact signs; class conservative.
//!
//! Judged without any rounding is on which side of a plane of [`View::planes`]
//! (f64, relative to the eye) a corner of the node's box lies, whose place is
//! `origin + offset` with f64 origin and f32 offset: the sign of
//! `n.(origin + offset - eye) + d`. Boxes were rounded outward to f32 once, which
//! is the only thing between this test and the geometry.
//!
//! `n.offset + D` with `D = d - n.(eye - origin)`: `D` is one expansion (Shewchuk 1997,
//! [`Expansion`]) a plane and frame, mostly of three parts. An offset has 24 bits, and a
//! normal is split once into halves of at most 27, so the six products of a corner are
//! exact as they come, and six additions to the expansion give the sign. No filter comes
//! before it: this is the twin that all others are compared with. Planes, eyes
//! and origins of magnitudes that expansions cannot hold go by whole numbers of
//! unbounded length ([`exact::sign_of_plane`]), slow and always right.
//!
//! Boxes with a NaN or infinite bound are neither outside nor inside (B5.4).

use super::frustum_arithmetic::{Ask, PlaneTest, one_by_one};
use super::frustum_f64::corners;
use super::frustum_planes::{MAX_PLANES, PlaneMasks, two_diff};
use super::{Class, Tally};
use crate::hierarchy::Hierarchy;
use crate::math::expansion::{Expansion, in_range, split};
use crate::math::{Box32, DVec3, Plane, Vec3, View, exact};
use std::cmp::Ordering;

/// One plane, ready for offsets from the origin.
#[derive(Debug, Clone, Copy, Default)]
struct ExactPlane {
    /// Halves of the normal.
    high: [f64; 3],
    low: [f64; 3],
    /// The plane's value at the origin.
    constant: Expansion,
    /// Corner choice as in [`super::frustum_planes::Plane32`].
    p: [usize; 3],
    n: [usize; 3],
}

/// All planes of a frame.
#[derive(Debug, Clone, Default)]
pub struct ExactPlanes {
    count: usize,
    planes: [ExactPlane; MAX_PLANES],
    /// Some magnitude is beyond expansions.
    whole_numbers: bool,
    source: Vec<Plane>,
    origin: DVec3,
    eye: DVec3,
}

impl ExactPlanes {
    pub fn new(view: &View, origin: DVec3) -> ExactPlanes {
        let numbers = view.planes.iter().flat_map(|p| p.normal.to_array().into_iter().chain([p.offset_m]));
        let mut frame = ExactPlanes {
            count: view.planes.len(),
            whole_numbers: !numbers.chain(view.eye.to_array()).chain(origin.to_array()).all(in_range),
            source: view.planes.clone(),
            origin,
            eye: view.eye,
            ..Default::default()
        };
        for (out, plane) in frame.planes.iter_mut().zip(&view.planes) {
            (out.p, out.n) = corners(plane.normal);
            if frame.whole_numbers {
                continue;
            }
            let mut constant = Expansion::default();
            constant.add(plane.offset_m);
            for axis in 0..3 {
                let (e, rest) = two_diff(view.eye[axis], origin[axis]);
                constant.add_product(-plane.normal[axis], rest);
                constant.add_product(-plane.normal[axis], e);
                (out.high[axis], out.low[axis]) = split(plane.normal[axis]);
            }
            out.constant = constant.compressed();
        }
        frame
    }

    pub fn count(&self) -> usize {
        self.count
    }

    /// The sign of the distance of the p-vertex (`far`) or n-vertex of a box with finite bounds
    /// from plane `k`.
    #[inline]
    pub fn sign(&self, k: usize, b: &Box32, far: bool) -> Ordering {
        let plane = &self.planes[k];
        let bounds = [b.lo.x, b.lo.y, b.lo.z, b.hi.x, b.hi.y, b.hi.z];
        let corner = if far { plane.p } else { plane.n }.map(|i| bounds[i]);
        if self.whole_numbers {
            let Plane { normal, offset_m } = self.source[k];
            return exact::sign_of_plane(normal, offset_m, self.origin, Vec3::from(corner).as_dvec3(), self.eye);
        }
        let mut sum = plane.constant;
        for ((c, low), high) in corner.into_iter().map(f64::from).zip(plane.low).zip(plane.high) {
            sum.add(c * low);
            sum.add(c * high);
        }
        sum.sign()
    }
}

/// The arithmetic `exact`.
#[derive(Default)]
pub struct Exact {
    frame: ExactPlanes,
}

impl PlaneTest for Exact {
    const CLASS: Class = Class::Conservative;

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.frame = ExactPlanes::new(view, hierarchy.origin);
    }

    fn planes(&self) -> usize {
        self.frame.count
    }

    fn block(&mut self, hierarchy: &Hierarchy, ask: &Ask, masks: &mut PlaneMasks, _: &mut Tally) {
        let bounds = &hierarchy.bounds[ask.block as usize];
        let boxes: [Box32; 8] = std::array::from_fn(|lane| bounds.get(lane));
        let finite = boxes.map(|b| b.lo.is_finite() && b.hi.is_finite());
        one_by_one(
            ask,
            masks,
            |k, lane| finite[lane] && self.frame.sign(k, &boxes[lane], true) == Ordering::Less,
            |k, lane| finite[lane] && self.frame.sign(k, &boxes[lane], false) != Ordering::Less,
        );
    }
}
