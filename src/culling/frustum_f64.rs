//! `f64`: the frustum test in double precision relative to the camera, with a
//! proved bound; class conservative.
//!
//! # The bound
//! Let `u = 2^-53`, `c` a bound (f32 offset from the origin, exact in f64) and
//! `e = eye - origin`, which two-sum gives exactly as `h + l`. As in
//! [`super::frustum_planes`], `l` moves into the offset: `d' = d - n.l`. Then
//!
//! ```text
//! a_i = c_i - h_i                                one rounding
//! s   = ((nx ax + D) + ny ay) + nz az            a rounding a product and a sum
//! g   = 8u sum_i (|lo_i| + |hi_i|) >= 8u A,      A = sum_i max(|lo_i|, |hi_i|)
//! ```
//! The normal is used as it is. A term goes through the rounding of its
//! difference, its product and at most three sums, so that with `|n_i| <= 1` the
//! error of `s` from the coordinates is at most `5uA (1 + O(u))`, within `g`. From `D` it is
//! at most `3u|D| (1 + O(u))`; `d'` itself was computed with at most
//! `u|d'| + 4u sum |l_i|`. Slack of `8u` (2^-50) of each, and 2^-1000 for
//! products that underflow, moves `D` outward: [`Plane64::d_out`], `d_in`.
//! Multiply and add are not fused, which is quicker than fusing in software and gives
//! the same bits on every target. NaN and infinite bounds make `g` NaN or infinite
//! and every comparison false.

use super::frustum_arithmetic::{Ask, PlaneTest, bits};
use super::frustum_planes::{MAX_PLANES, PlaneMasks, two_diff};
use super::{Class, Tally};
use crate::hierarchy::{BoundsBlock, Hierarchy, LANES};
use crate::math::{Box32, DVec3, View};
use std::cmp::Ordering;

/// Guard on the sum of magnitudes: 8u.
pub const GUARD: f64 = 8.0 / (1u64 << 53) as f64;

/// One plane, camera-relative; corners as in [`super::frustum_planes::Plane32`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Plane64 {
    pub normal: [f64; 3],
    pub d_out: f64,
    pub d_in: f64,
    pub p: [usize; 3],
    pub n: [usize; 3],
}

/// All planes of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Planes64 {
    /// The eye relative to the origin, rounded.
    pub eye: [f64; 3],
    pub count: usize,
    pub planes: [Plane64; MAX_PLANES],
}

impl Planes64 {
    pub fn new(view: &View, origin: DVec3) -> Planes64 {
        let mut frame = Planes64 { count: view.planes.len(), ..Default::default() };
        let mut rest = DVec3::ZERO;
        for axis in 0..3 {
            (frame.eye[axis], rest[axis]) = two_diff(view.eye[axis], origin[axis]);
        }
        for (out, plane) in frame.planes.iter_mut().zip(&view.planes) {
            let d = plane.offset_m - plane.normal.dot(rest);
            let slack = (d.abs() + rest.abs().element_sum()) * (-50f64).exp2() + (-1000f64).exp2();
            (out.d_out, out.d_in) = (d + slack, d - slack);
            out.normal = plane.normal.to_array();
            (out.p, out.n) = corners(plane.normal);
        }
        frame
    }

    /// The sign of a corner's distance from plane `k`, p-vertex or n-vertex, where the
    /// bound lets it be told.
    pub fn sign(&self, k: usize, b: &Box32, far: bool) -> Option<Ordering> {
        let (a, guard) = relative(self, b);
        let plane = &self.planes[k];
        let corner = if far { &plane.p } else { &plane.n };
        if value(plane, &a, corner, plane.d_out) < -guard {
            Some(Ordering::Less)
        } else if value(plane, &a, corner, plane.d_in) > guard {
            Some(Ordering::Greater)
        } else {
            None
        }
    }
}

/// Which of `lo x, lo y, lo z, hi x, hi y, hi z` are the p-vertex and the n-vertex.
pub fn corners(normal: DVec3) -> ([usize; 3], [usize; 3]) {
    let far = [0, 1, 2].map(|axis| if normal[axis] >= 0.0 { axis + 3 } else { axis });
    (far, [0, 1, 2].map(|axis| 2 * axis + 3 - far[axis]))
}

fn relative(frame: &Planes64, b: &Box32) -> ([f64; 6], f64) {
    let mut a = [0f64; 6];
    let mut magnitude = [0f64; 3];
    for axis in 0..3 {
        let (lo, hi) = (f64::from(b.lo[axis]) - frame.eye[axis], f64::from(b.hi[axis]) - frame.eye[axis]);
        magnitude[axis] = lo.abs() + hi.abs();
        (a[axis], a[axis + 3]) = (lo, hi);
    }
    (a, ((magnitude[0] + magnitude[1]) + magnitude[2]) * GUARD)
}

fn value(plane: &Plane64, a: &[f64; 6], corner: &[usize; 3], d: f64) -> f64 {
    let [nx, ny, nz] = plane.normal;
    ((nx * a[corner[0]] + d) + ny * a[corner[1]]) + nz * a[corner[2]]
}

/// Judges 8 boxes; see `frustum_scalar::block`. The twin of the vector kernels.
pub fn block(frame: &Planes64, bounds: &BoundsBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
    let boxes: [([f64; 6], f64); LANES] = std::array::from_fn(|lane| relative(frame, &bounds.get(lane)));
    for k in bits(wanted) {
        let plane = &frame.planes[k];
        let (mut outside, mut inside) = (0, 0);
        for (lane, (a, guard)) in boxes.iter().enumerate() {
            outside |= u8::from(value(plane, a, &plane.p, plane.d_out) < -guard) << lane;
            if want_inside {
                inside |= u8::from(value(plane, a, &plane.n, plane.d_in) > *guard) << lane;
            }
        }
        out.outside[k] = outside;
        if want_inside {
            out.inside[k] = inside;
        }
    }
}

type Kernel = fn(&Planes64, &BoundsBlock, u8, bool, &mut PlaneMasks);

/// What this processor can run, the widest first, the scalar twin last.
pub fn kernels() -> Vec<(&'static str, Kernel)> {
    let mut found: Vec<(&'static str, Kernel)> = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        use super::frustum_f64_x86 as x86;
        if x86::has_avx2() {
            found.push(("avx2", x86::block_avx2));
        }
    }
    found.push(("scalar", block));
    found
}

/// The arithmetic `f64`.
pub struct Double {
    kernel: Kernel,
    frame: Planes64,
}

impl Default for Double {
    fn default() -> Double {
        Double { kernel: kernels()[0].1, frame: Planes64::default() }
    }
}

impl PlaneTest for Double {
    const CLASS: Class = Class::Conservative;

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.frame = Planes64::new(view, hierarchy.origin);
    }

    fn planes(&self) -> usize {
        self.frame.count
    }

    fn block(&mut self, hierarchy: &Hierarchy, ask: &Ask, masks: &mut PlaneMasks, _: &mut Tally) {
        (self.kernel)(&self.frame, &hierarchy.bounds[ask.block as usize], ask.planes, ask.inside, masks);
    }
}
