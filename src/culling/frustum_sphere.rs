//! Spheres and points for boxes (`frustum:primitive=sphere` and `point`), as Silva (2009)
//! compares them: single precision relative to the camera.
//!
//! The sphere is the one around the middle of a node's box through its corners; a plane
//! is compared with one number, `n.c + d`, where a box needs another for its nearest corner.
//! It is larger than the box, so more is kept; **conservative**. The point is the middle
//! alone: what reaches into the view from outside is lost, and going down a hierarchy all
//! below a node whose middle is out of view, be it the root. **Aggressive**, and a point
//! inside says nothing of what is below its node, so its carry is never 0.
//!
//! # Arithmetic
//! As in [`super::frustum_planes`], `u = 2^-24`: the middle is rounded to f32 once, and the
//! radius is measured from where that came to lie, in f64, and rounded up.
//!
//! ```text
//! a_i = c_i - h_i                                one rounding
//! s   = n^z az + (n^y ay + (n^x ax + D))         fused: three roundings
//! g   = 8u sum_i |a_i|  >=  5u sum_i |a_i|       what s can err by
//! b   = g + R,   R >= (1 + 8u) r
//! ```
//! The rounding of `b` takes away at most `u (g + R)`, which the other `3u` of `g` and the
//! `8u` of `R` make up for. Therefore `s < -b` proves that the whole sphere, and so the
//! box, is outside, and `s > b` that it is inside. A box with a bound that is NaN or
//! infinite has the radius NaN: both comparisons are false, and it is kept.

use super::frustum_arithmetic::{Ask, PlaneTest, bits};
use super::frustum_octant::{Far, Halves};
use super::frustum_planes::{FramePlanes, GUARD, PlaneMasks, Work};
use super::{Class, Tally};
use crate::hierarchy::{BoundsBlock, Hierarchy, LANES};
use crate::math::{Box32, View};

/// Spheres of 8 siblings: two cache lines where their boxes take three.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct SphereBlock {
    pub centre: [[f32; LANES]; 3],
    pub radius_m: [f32; LANES],
}

impl SphereBlock {
    /// Around the boxes, or, with `points`, their middles alone.
    pub fn new(bounds: &BoundsBlock, points: bool) -> SphereBlock {
        let mut block = SphereBlock { centre: [[0.0; LANES]; 3], radius_m: [f32::NAN; LANES] };
        for lane in 0..LANES {
            let b = bounds.get(lane);
            if !b.lo.is_finite() || !b.hi.is_finite() {
                continue;
            }
            let (centre, radius) = sphere(&b);
            (0..3).for_each(|axis| block.centre[axis][lane] = centre[axis]);
            block.radius_m[lane] = if points { 0.0 } else { radius };
        }
        block
    }
}

/// Middle of a box, rounded, and a radius from there that holds the box with `8u` to spare.
fn sphere(b: &Box32) -> ([f32; 3], f32) {
    let (lo, hi) = (b.lo.as_dvec3(), b.hi.as_dvec3());
    let centre = ((lo + hi) * 0.5).as_vec3();
    let c = centre.as_dvec3();
    let reach = (c - lo).abs().max((hi - c).abs()).length() * (1.0 + f64::from(GUARD));
    let radius = reach as f32;
    (centre.to_array(), if f64::from(radius) < reach { radius.next_up() } else { radius })
}

type BlockKernel = fn(&FramePlanes, &SphereBlock, u8, bool, &mut PlaneMasks);
type FlatKernel = fn(&FramePlanes, &[SphereBlock], &[u8], &mut [u8]) -> Work;

/// One instruction set's pair of kernels; all give the same bits.
#[derive(Debug, Clone, Copy)]
pub struct SphereKernels {
    pub name: &'static str,
    pub block: BlockKernel,
    pub flat: FlatKernel,
}

/// What this processor can run, the widest first, the scalar twin last.
pub fn kernels() -> Vec<SphereKernels> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    if super::frustum_x86::has_avx2() {
        use super::frustum_sphere_x86 as x86;
        found.push(SphereKernels { name: "avx2", block: x86::block_avx2, flat: x86::flat_avx2 });
    }
    found.push(SphereKernels { name: "scalar", block, flat });
    found
}

/// Middle of a lane's sphere relative to the eye, and what its distance is compared with.
#[inline]
fn relative(frame: &FramePlanes, spheres: &SphereBlock, lane: usize) -> ([f32; 3], f32) {
    let [x, y, z] = [0, 1, 2].map(|axis| spheres.centre[axis][lane] - frame.eye[axis]);
    ([x, y, z], ((x.abs() + y.abs()) + z.abs()) * GUARD + spheres.radius_m[lane])
}

#[inline]
fn value(normal: &[f32; 3], [x, y, z]: [f32; 3], d: f32) -> f32 {
    normal[2].mul_add(z, normal[1].mul_add(y, normal[0].mul_add(x, d)))
}

/// Judges 8 spheres; see `frustum_scalar::block`.
pub fn block(frame: &FramePlanes, spheres: &SphereBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
    for k in bits(wanted & frame.all()) {
        let plane = &frame.planes[k];
        let (mut outside, mut inside) = (0, 0);
        for lane in 0..LANES {
            let (a, bound) = relative(frame, spheres, lane);
            outside |= u8::from(value(&plane.normal, a, plane.d_out) < -bound) << lane;
            if want_inside {
                inside |= u8::from(value(&plane.normal, a, plane.d_in) > bound) << lane;
            }
        }
        out.outside[k] = outside;
        if want_inside {
            out.inside[k] = inside;
        }
    }
}

/// Judges the spheres of many blocks; see `frustum_scalar::flat`.
pub fn flat(frame: &FramePlanes, spheres: &[SphereBlock], live: &[u8], outside: &mut [u8]) -> Work {
    let mut work = Work::default();
    for ((spheres, live), out) in spheres.iter().zip(live).zip(outside) {
        let mut left = live & !*out;
        work.lanes += u64::from(left.count_ones());
        for lane in bits(left) {
            let (a, bound) = relative(frame, spheres, lane);
            for plane in &frame.planes[..frame.count] {
                work.planes += 1;
                if value(&plane.normal, a, plane.d_out) < -bound {
                    left &= !(1 << lane);
                    break;
                }
            }
        }
        *out = !left;
    }
    work
}

/// The column and the planes of the frame.
struct Column {
    kernels: SphereKernels,
    frame: FramePlanes,
    spheres: Vec<SphereBlock>,
}

impl Column {
    fn new(kernels: SphereKernels) -> Column {
        Column { kernels, frame: FramePlanes::default(), spheres: Vec::new() }
    }

    fn prepare(&mut self, hierarchy: &Hierarchy, points: bool) -> usize {
        self.spheres = hierarchy.bounds.iter().map(|b| SphereBlock::new(b, points)).collect();
        size_of_val(&self.spheres[..])
    }

    #[inline]
    fn judge(&self, ask: &Ask, inside: bool, masks: &mut PlaneMasks) {
        (self.kernels.block)(&self.frame, &self.spheres[ask.block as usize], ask.planes, inside, masks);
    }

    fn flat(&self, live: &[u8], outside: &mut [u8]) -> Work {
        (self.kernels.flat)(&self.frame, &self.spheres[..outside.len()], live, outside)
    }
}

/// `primitive=sphere`, or with `POINT` its centre alone, of which nothing is ever inside.
pub struct Round<const POINT: bool>(Column);

pub type Spheres = Round<false>;
/// `primitive=point`.
pub type Points = Round<true>;

impl<const POINT: bool> Round<POINT> {
    pub fn new(kernels: SphereKernels) -> Round<POINT> {
        Round(Column::new(kernels))
    }
}

impl<const POINT: bool> PlaneTest for Round<POINT> {
    const CLASS: Class = if POINT { Class::Aggressive } else { Class::Conservative };
    const BOXES: bool = false;

    fn prepare(&mut self, hierarchy: &Hierarchy) -> usize {
        self.0.prepare(hierarchy, POINT)
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.0.frame = FramePlanes::new(view, hierarchy.origin);
    }

    fn planes(&self) -> usize {
        self.0.frame.count
    }

    #[inline]
    fn block(&mut self, _: &Hierarchy, ask: &Ask, masks: &mut PlaneMasks, _: &mut Tally) {
        self.0.judge(ask, ask.inside && !POINT, masks);
    }

    fn flat(&mut self, _: &Hierarchy, live: &[u8], outside: &mut [u8], _: &mut Tally) -> Work {
        self.0.flat(live, outside)
    }

    fn far_planes(&self, halves: &Halves, hierarchy: &Hierarchy, block: u32) -> Option<Far> {
        // A point is judged by the centre as it is stored, a sphere holds its box.
        Some(match POINT {
            true => halves.of_points(&self.0.spheres[block as usize].centre),
            false => halves.of_boxes(&hierarchy.bounds[block as usize]),
        })
    }
}
