//! Frustum kernels in plain Rust: the baseline of every target, and the twin that
//! the vector kernels are compared with, bit for bit. With `GUARDED` bounds are made
//! relative to the eye and compared under the guard (`f32_relative`); without it
//! they are compared as they are (`f32_world`).

use super::frustum_planes::{FramePlanes, GUARD, Plane32, PlaneMasks, Work};
use crate::hierarchy::{BoundsBlock, LANES};

/// Bounds of one lane relative to the eye (`lo x, lo y, lo z, hi x, hi y, hi z`) and the guard.
#[inline]
pub fn relative(frame: &FramePlanes, bounds: &BoundsBlock, lane: usize) -> ([f32; 6], f32) {
    let mut a = [0f32; 6];
    let mut magnitude = [0f32; 3];
    for axis in 0..3 {
        let (lo, hi) = (bounds.lo[axis][lane] - frame.eye[axis], bounds.hi[axis][lane] - frame.eye[axis]);
        magnitude[axis] = lo.abs() + hi.abs();
        (a[axis], a[axis + 3]) = (lo, hi);
    }
    (a, ((magnitude[0] + magnitude[1]) + magnitude[2]) * GUARD)
}

/// The same, or the bounds as they are and no guard.
#[inline]
fn prepared<const GUARDED: bool>(frame: &FramePlanes, bounds: &BoundsBlock, lane: usize) -> ([f32; 6], f32) {
    if GUARDED {
        return relative(frame, bounds, lane);
    }
    let row = |i: usize| if i < 3 { bounds.lo[i][lane] } else { bounds.hi[i - 3][lane] };
    (std::array::from_fn(row), 0.0)
}

/// Signed distance of a corner of the box from a plane, as every kernel computes it.
#[inline]
pub fn value(plane: &Plane32, a: &[f32; 6], corner: &[usize; 3], d: f32) -> f32 {
    let [nx, ny, nz] = plane.normal;
    nz.mul_add(a[corner[2]], ny.mul_add(a[corner[1]], nx.mul_add(a[corner[0]], d)))
}

/// Judges 8 boxes against the planes whose bit is set in `wanted`; entries of
/// other planes are left alone, and `inside` too unless `want_inside`.
pub fn block<const GUARDED: bool>(
    frame: &FramePlanes,
    bounds: &BoundsBlock,
    wanted: u8,
    want_inside: bool,
    out: &mut PlaneMasks,
) {
    let boxes: [([f32; 6], f32); LANES] = std::array::from_fn(|lane| prepared::<GUARDED>(frame, bounds, lane));
    for k in (0..frame.count).filter(|k| wanted >> k & 1 == 1) {
        let plane = &frame.planes[k];
        let mut outside = 0;
        let mut inside = 0;
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

/// Judges the boxes of many blocks against all planes: sets in `outside[b]` the
/// lanes of block `b` that some plane rejects and the lanes that are not in
/// `live[b]`. Lanes already set are not judged.
pub fn flat<const GUARDED: bool>(frame: &FramePlanes, bounds: &[BoundsBlock], live: &[u8], outside: &mut [u8]) -> Work {
    let mut work = Work::default();
    for ((bounds, live), out) in bounds.iter().zip(live).zip(outside) {
        let mut left = live & !*out;
        work.lanes += u64::from(left.count_ones());
        for lane in 0..LANES {
            if left >> lane & 1 == 0 {
                continue;
            }
            let (a, guard) = prepared::<GUARDED>(frame, bounds, lane);
            for plane in &frame.planes[..frame.count] {
                work.planes += 1;
                if value(plane, &a, &plane.p, plane.d_out) < -guard {
                    left &= !(1 << lane);
                    break;
                }
            }
        }
        *out = !left;
    }
    work
}
