//! `fixed_q16`: the frustum test in whole numbers, after Silva (2009), who names
//! fixed point as the way to processors without a floating-point unit. Class conservative.
//!
//! Bounds are quantised outward once to Q15.16 offsets from the scene's origin. In a
//! frame the eye is split into whole quanta and a rest of at most half a quantum;
//! the rest moves into the planes' offsets, as in [`super::frustum_planes`]. Corners relative to
//! the eye are differences of whole numbers, and plane sums are exact in 64 bits
//! ([`FixedPlane`]). The errors are those of entry into fixed point alone:
//!
//! - bounds: outward, so corners move outward by less than a quantum, 15 µm;
//! - normals: half a unit of 2^-28 a component, at most `sum |a_i| / 2` in units of the
//!   value (0.1 mm at 32 km), which [`fixed::guard`] adds;
//! - offsets: f64 errors and units of 2^-44 m, in `d_out` and `d_in`.
//!
//! Therefore `value(p-vertex, d_out) < -guard` proves "outside" and
//! `value(n-vertex, d_in) > guard` "inside". Each is monotone in the corner, so
//! accelerations change nothing. Only whole numbers are compared, so answers
//! are the same on every machine (H.1), and moving scene and eye by the same whole
//! quanta changes none (H.2).
//!
//! A finite box that reaches farther than 32 km from the eye (or the origin) has no
//! Q15.16 corner: it is kept, and [`PlaneTest::failure`] makes the run fail (H.3). Boxes
//! with a NaN or infinite bound are kept without a word (B5.4).

use super::frustum_arithmetic::{Ask, PlaneTest, bits};
use super::frustum_f64::corners;
use super::frustum_planes::{MAX_PLANES, PlaneMasks, two_diff};
use super::{Class, Tally};
use crate::hierarchy::{BoundsBlock, Hierarchy, LANES};
use crate::math::fixed::{self, FixedPlane, FixedPoint};
use crate::math::{DVec3, View};

/// Bounds of 8 siblings in quanta from the origin, outward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct FixedBlock {
    /// `lo x, lo y, lo z, hi x, hi y, hi z`.
    pub rows: [[i32; LANES]; 6],
    /// Lanes with finite bounds that do not fit.
    pub unfit: u8,
    /// Lanes with a NaN or infinite bound.
    pub unsound: u8,
}

impl FixedBlock {
    pub fn new(bounds: &BoundsBlock) -> FixedBlock {
        let mut out = FixedBlock { rows: [[0; LANES]; 6], unfit: 0, unsound: 0 };
        for lane in 0..LANES {
            let b = bounds.get(lane);
            if !(b.lo.is_finite() && b.hi.is_finite()) {
                out.unsound |= 1 << lane;
                continue;
            }
            for axis in 0..3 {
                match (fixed::floor(b.lo[axis]), fixed::ceil(b.hi[axis])) {
                    (Some(lo), Some(hi)) => (out.rows[axis][lane], out.rows[axis + 3][lane]) = (lo, hi),
                    _ => out.unfit |= 1 << lane,
                }
            }
        }
        out
    }
}

/// All planes of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FixedPlanes {
    /// The eye in quanta from the origin.
    pub eye: [i64; 3],
    pub count: usize,
    pub planes: [FixedPlane; MAX_PLANES],
    /// Rows that are the p-vertex and the n-vertex.
    pub p: [[usize; 3]; MAX_PLANES],
    pub n: [[usize; 3]; MAX_PLANES],
}

impl FixedPlanes {
    pub fn new(view: &View, origin: DVec3) -> FixedPlanes {
        let parts = [0, 1, 2].map(|axis| two_diff(view.eye[axis], origin[axis]));
        let eye = FixedPoint::new(parts.map(|p| p.0).into(), parts.map(|p| p.1).into());
        let mut frame = FixedPlanes { eye: eye.quanta, count: view.planes.len(), ..Default::default() };
        for (k, plane) in view.planes.iter().enumerate() {
            frame.planes[k] = FixedPlane::new(plane, eye.rest);
            // By the rounded normal, whose products are summed: where it is 0, either corner will do.
            (frame.p[k], frame.n[k]) = corners(plane.normal);
        }
        frame
    }
}

/// Judges 8 boxes against the planes of `wanted`, and returns the lanes that reach beyond 32 km
/// from the eye, of which the masks say nothing. The twin of the vector kernels.
pub fn block(frame: &FixedPlanes, bounds: &FixedBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) -> u8 {
    let mut beyond = 0;
    let boxes: [([i64; 6], i64); LANES] = std::array::from_fn(|lane| {
        let a: [i64; 6] = std::array::from_fn(|row| i64::from(bounds.rows[row][lane]) - frame.eye[row % 3]);
        beyond |= u8::from(a.iter().any(|x| i32::try_from(*x).is_err())) << lane;
        (a, fixed::guard([0, 1, 2].map(|axis| a[axis].abs().max(a[axis + 3].abs()))))
    });
    for k in bits(wanted) {
        let plane = &frame.planes[k];
        let (mut outside, mut inside) = (0, 0);
        for lane in bits(!beyond) {
            let (a, guard) = &boxes[lane];
            outside |= u8::from(plane.value(frame.p[k].map(|i| a[i]), plane.d_out) < -guard) << lane;
            inside |= u8::from(want_inside && plane.value(frame.n[k].map(|i| a[i]), plane.d_in) > *guard) << lane;
        }
        out.outside[k] = outside;
        if want_inside {
            out.inside[k] = inside;
        }
    }
    beyond
}

type Kernel = fn(&FixedPlanes, &FixedBlock, u8, bool, &mut PlaneMasks) -> u8;

/// What this processor can run, the widest first, the scalar twin last.
pub fn kernels() -> Vec<(&'static str, Kernel)> {
    let mut found: Vec<(&'static str, Kernel)> = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        use super::frustum_fixed_x86 as x86;
        if x86::has_avx2() {
            found.push(("avx2", x86::block_avx2));
        }
    }
    found.push(("scalar", block));
    found
}

/// The arithmetic `fixed_q16`, with its column of boxes.
pub struct Fixed {
    kernel: Kernel,
    frame: FixedPlanes,
    bounds: Vec<FixedBlock>,
    overflow: Option<Overflow>,
}

/// The first box that did not fit, and how many judgements met one.
#[derive(Debug, Clone, Copy)]
struct Overflow {
    node: u32,
    distance_m: f64,
}

impl Default for Fixed {
    fn default() -> Fixed {
        Fixed { kernel: kernels()[0].1, frame: FixedPlanes::default(), bounds: Vec::new(), overflow: None }
    }
}

impl Fixed {
    #[cold]
    fn report(&mut self, hierarchy: &Hierarchy, block: u32, lanes: u8) {
        self.overflow.get_or_insert_with(|| {
            let lane = lanes.trailing_zeros();
            let b = hierarchy.bounds[block as usize].get(lane as usize);
            let eye = DVec3::from(self.frame.eye.map(|q| q as f64)) / f64::from(1 << fixed::LENGTH_BITS);
            let (lo, hi) = (b.lo.as_dvec3(), b.hi.as_dvec3());
            let reach = [lo - eye, hi - eye, lo, hi].map(|v| v.abs().max_element()).into_iter().fold(0.0, f64::max);
            Overflow { node: block * LANES as u32 + lane, distance_m: reach }
        });
    }
}

impl PlaneTest for Fixed {
    const CLASS: Class = Class::Conservative;

    fn prepare(&mut self, hierarchy: &Hierarchy) -> usize {
        self.bounds = hierarchy.bounds.iter().map(FixedBlock::new).collect();
        size_of_val(&self.bounds[..])
    }

    fn reset(&mut self) {
        self.overflow = None;
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.frame = FixedPlanes::new(view, hierarchy.origin);
    }

    fn planes(&self) -> usize {
        self.frame.count
    }

    fn block(&mut self, hierarchy: &Hierarchy, ask: &Ask, masks: &mut PlaneMasks, _: &mut Tally) {
        let bounds = &self.bounds[ask.block as usize];
        let beyond = (self.kernel)(&self.frame, bounds, ask.planes, ask.inside, masks);
        let (unfit, unsound) = (beyond & !bounds.unsound | bounds.unfit, bounds.unsound);
        if unfit | unsound | beyond != 0 {
            for k in bits(ask.planes) {
                masks.outside[k] &= !(unfit | unsound);
                masks.inside[k] &= !(unfit | unsound);
            }
            if unfit & ask.lanes != 0 {
                self.report(hierarchy, ask.block, unfit & ask.lanes);
            }
        }
    }

    fn failure(&self) -> Option<String> {
        let Overflow { node, distance_m } = self.overflow?;
        Some(format!(
            "fixed_q16 reaches {:.0} m, but the box of node {node} is {distance_m:.0} m away: choose a smaller \
             `scale` for the scene, or another arithmetic for it",
            fixed::REACH_M
        ))
    }
}
