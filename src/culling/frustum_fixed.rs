//! `frustum` in fixed point: boxes relative to the camera in Q15.16, normals with 28
//! fraction bits, sums exact in i64. Conservative.
//!
//! # Proof
//! A bound `c - e` is quantised outward, so the quantised box holds the box. With
//! `|n^ - n| <= 2^-29` a component, `n.a` differs from `n^.a` by at most
//! `2^-29 sum |a_i|`: half a quantum of the product for each quantum of place, and
//! that is added to the side that keeps. The offset is rounded up (outside) or down
//! (inside). `|n^| <= 2^28`, `|a| < 2^31`: three products are below 2^61, the offset
//! below 2^59, the slack below 2^33, so nothing overflows in i64.
//!
//! Facts H.1 (whole numbers only after quantisation), H.2 (moving eye and scene by
//! whole quanta changes nothing) and H.3 (a bound out of reach is reported, and its
//! box kept).

use super::frustum_planes::{PlaneMasks, two_diff};
use crate::hierarchy::{BoundsBlock, LANES};
use crate::math::{DVec3, View, fixed};

#[derive(Debug, Clone, Copy, Default)]
struct FixedPlane {
    normal: [i32; 3],
    /// Offset rounded up and down.
    up: i64,
    down: i64,
}

#[derive(Debug, Clone, Default)]
pub struct FixedPlanes {
    /// `None`: the plane's offset is out of reach, so it can say nothing.
    planes: Vec<Option<FixedPlane>>,
    head: DVec3,
    rest: DVec3,
}

impl FixedPlanes {
    pub fn new(view: &View, origin: DVec3) -> FixedPlanes {
        let plane = |p: &crate::math::Plane| {
            let (up, down) = (fixed::product_up(p.offset_m)?, -fixed::product_up(-p.offset_m)?);
            Some(FixedPlane { normal: p.normal.to_array().map(fixed::direction), up, down })
        };
        let mut out = FixedPlanes { planes: view.planes.iter().map(plane).collect(), ..Default::default() };
        for axis in 0..3 {
            (out.head[axis], out.rest[axis]) = two_diff(view.eye[axis], origin[axis]);
        }
        out
    }

    /// Quantised bounds of a lane, lo then hi; `None` out of reach.
    fn quantised(&self, bounds: &BoundsBlock, lane: usize) -> Option<[i32; 6]> {
        let mut out = [0; 6];
        for axis in 0..3 {
            // In reach, f64 is finer than a quantum by 2^-21; its two roundings are
            // outdone by a 2^-20th of a quantum.
            let hair = (-36f64).exp2();
            let lo = (f64::from(bounds.lo[axis][lane]) - self.head[axis]) - self.rest[axis];
            let hi = (f64::from(bounds.hi[axis][lane]) - self.head[axis]) - self.rest[axis];
            out[axis] = fixed::place_down(lo - hair)?;
            out[axis + 3] = fixed::place_up(hi + hair)?;
        }
        Some(out)
    }

    /// As the other kernels. Returns the lanes that do not fit, which are kept.
    pub fn block(&self, bounds: &BoundsBlock, wanted: u8, lanes: u8, out: &mut PlaneMasks) -> u8 {
        let mut unfit = 0;
        let boxes: [Option<[i32; 6]>; LANES] = std::array::from_fn(|lane| match lanes >> lane & 1 {
            1 => self.quantised(bounds, lane).or_else(|| {
                unfit |= 1 << lane;
                None
            }),
            _ => None,
        });
        for (k, plane) in self.planes.iter().enumerate().filter(|(k, _)| wanted >> k & 1 == 1) {
            (out.outside[k], out.inside[k]) = (0, 0);
            let Some(plane) = plane else {
                unfit |= lanes;
                continue;
            };
            for (lane, quantised) in boxes.iter().enumerate() {
                let Some(a) = quantised else { continue };
                let (mut far, mut near) = (plane.up, plane.down);
                for axis in 0..3 {
                    let n = plane.normal[axis];
                    let (p, q) = if n >= 0 { (a[axis + 3], a[axis]) } else { (a[axis], a[axis + 3]) };
                    far += i64::from(n) * i64::from(p) + (i64::from(p.unsigned_abs()) + 1) / 2;
                    near += i64::from(n) * i64::from(q) - (i64::from(q.unsigned_abs()) + 1) / 2;
                }
                out.outside[k] |= u8::from(far < 0) << lane;
                out.inside[k] |= u8::from(near > 0) << lane;
            }
        }
        unfit
    }
}
