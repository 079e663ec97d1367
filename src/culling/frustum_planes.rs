//! The planes of a frame as the frustum kernels read them, and the proof that
//! their guard covers every rounding.
//!
//! # Arithmetic
//! Let `u = 2^-24`, `c` a bound (f32 offset from the scene origin, exact), and
//! `e = eye - origin` (real). `e` is split once a frame into `h = f32(e)` and the
//! rest `l = e - h`, which is known in f64 to its last bits (two-sum). Then
//! `n.(c - e) + d = n.(c - h) + d'` with `d' = d - n.l`, so the rest costs
//! nothing per box: it moves into the offset. A kernel evaluates
//!
//! ```text
//! a_i = c_i - h_i          one rounding:      |error| <= u |a_i|
//! n^  = f32(n)             one rounding:      |error| <= u |n_i| + 2^-150
//! s   = n^z az + (n^y ay + (n^x ax + D))      fused: three roundings in all
//! g   = 8u sum_i (|lo_i| + |hi_i|) >= 8u A,   A = sum_i max(|lo_i|, |hi_i|)
//! ```
//! (in `g`, `lo` and `hi` are relative). As `|n_i| <= 1`, the error of `s` from
//! the coordinates, the normal and the sum is at most `(1 + 1 + 3) u A (1 + O(u))`,
//! five of the eight `u A` in `g`, which its own four roundings cannot use up.
//! What the three roundings make on account of `D`, the f64 errors of `d'` and
//! underflow are in [`FramePlanes::d_out`] and `d_in`, which are `d'` moved
//! outward and rounded in that direction. Therefore
//!
//! - `s(p-vertex) < -g` proves that the box is outside the plane,
//! - `s(n-vertex) >  g` proves that it is inside.
//!
//! The sum of magnitudes in `g` (rather than a maximum) is NaN when any of the six
//! bounds is NaN and infinite when one is infinite, and both comparisons are then
//! false for every plane: such a box is kept (fact B5.4).
//!
//! Every step is an IEEE operation in one stated order, and the multiply-adds are
//! fused on every target (in software where the processor cannot), so scalar,
//! AVX2 and AVX-512 give the same bits.

use crate::hierarchy::LANES;
use crate::math::{DVec3, View};

/// left, right, bottom, top, near, far.
pub const MAX_PLANES: usize = 6;

/// Guard on the sum of magnitudes: 8u.
pub const GUARD: f32 = 8.0 / (1u32 << 24) as f32;

/// One plane in f32, camera-relative, with the corner choice that the sign of its
/// normal fixes for the frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Plane32 {
    pub normal: [f32; 3],
    /// Offset moved up by every error it has to answer for.
    pub d_out: f32,
    /// Offset moved down likewise.
    pub d_in: f32,
    /// Which of `lo x, lo y, lo z, hi x, hi y, hi z` is the p-vertex, per axis.
    pub p: [usize; 3],
    /// Which is the n-vertex.
    pub n: [usize; 3],
}

/// All planes of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FramePlanes {
    /// The eye relative to the origin, rounded: what bounds are made relative to.
    pub eye: [f32; 3],
    /// 5, or 6 with a far plane; the rest of `planes` is unused.
    pub count: usize,
    pub planes: [Plane32; MAX_PLANES],
}

impl FramePlanes {
    pub fn new(view: &View, origin: DVec3) -> FramePlanes {
        let (eye, rest) = split_eye(view.eye, origin);
        let mut frame = FramePlanes { count: view.planes.len(), eye, ..Default::default() };
        for (out, plane) in frame.planes.iter_mut().zip(&view.planes) {
            let d = plane.offset_m - plane.normal.dot(rest);
            // 4u for the three roundings, 2^-48 for f64, 2^-120 for underflow.
            let slack = d.abs() * (-22f64).exp2()
                + (plane.offset_m.abs() + rest.abs().element_sum()) * (-48f64).exp2()
                + (-120f64).exp2();
            out.d_out = up(d + slack);
            out.d_in = down(d - slack);
            for axis in 0..3 {
                let n = plane.normal[axis] as f32;
                out.normal[axis] = n;
                (out.p[axis], out.n[axis]) = if n >= 0.0 { (axis + 3, axis) } else { (axis, axis + 3) };
            }
        }
        frame
    }

    /// Bit per plane.
    pub fn all(&self) -> u8 {
        ((1u16 << self.count) - 1) as u8
    }
}

/// The eye relative to the origin, rounded, and the rest to its last bits.
pub(super) fn split_eye(eye: DVec3, origin: DVec3) -> ([f32; 3], DVec3) {
    let (mut rounded, mut rest) = ([0.0; 3], DVec3::ZERO);
    for axis in 0..3 {
        let (e, error) = two_diff(eye[axis], origin[axis]);
        rounded[axis] = e as f32;
        // Exact: both have at most 53 bits and the difference fewer.
        rest[axis] = (e - f64::from(rounded[axis])) + error;
    }
    (rounded, rest)
}

/// `a - b` and its rounding error (Knuth).
pub(super) fn two_diff(a: f64, b: f64) -> (f64, f64) {
    let d = a - b;
    let b_virtual = a - d;
    let a_virtual = d + b_virtual;
    (d, (a - a_virtual) + (b_virtual - b))
}

pub(super) fn up(x: f64) -> f32 {
    let r = x as f32;
    if f64::from(r) < x { r.next_up() } else { r }
}

pub(super) fn down(x: f64) -> f32 {
    -up(-x)
}

/// What the planes say of 8 boxes: bit per lane, an entry a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlaneMasks {
    pub outside: [u8; MAX_PLANES],
    pub inside: [u8; MAX_PLANES],
}

/// What a flat kernel did: lanes judged, and plane tests if each lane stops at
/// the first plane that rejects it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    pub lanes: u64,
    pub planes: u64,
}

/// Carry of each lane: the wanted planes that it is not inside of. Without
/// `per_plane`, all of them unless it is inside of all.
#[inline]
pub(super) fn planes_left(masks: &PlaneMasks, wanted: u8, per_plane: bool) -> [u8; LANES] {
    // Byte k holds the lanes inside plane k; transposed, byte l holds the planes of lane l.
    let rows = masks.inside.iter().rev().fold(0, |rows, m| rows << 8 | u64::from(*m));
    let left = !transpose(rows) & (u64::from(wanted) * 0x0101_0101_0101_0101);
    let mut carry = left.to_le_bytes();
    if !per_plane {
        carry.iter_mut().filter(|c| **c != 0).for_each(|c| *c = wanted);
    }
    carry
}

/// Transposes an 8 x 8 bit matrix, byte = row (Warren, Hacker's Delight, 7-3).
fn transpose(x: u64) -> u64 {
    let swap = |x: u64, shift: u32, mask: u64| {
        let t = (x ^ (x >> shift)) & mask;
        x ^ t ^ (t << shift)
    };
    let x = swap(x, 7, 0x00aa_00aa_00aa_00aa);
    let x = swap(x, 14, 0x0000_cccc_0000_cccc);
    swap(x, 28, 0x0000_0000_f0f0_f0f0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, Pose};

    #[test]
    fn the_rounded_offsets_enclose_the_exact_one() {
        for x in [0.0, 1.0, -1.0, 0.1, 1e-30, 1e30, 1e300, -1e300] {
            assert!(f64::from(down(x)) <= x && x <= f64::from(up(x)), "{x}");
        }
        let pose = Pose { eye: DVec3::new(1e6 + 0.3, -7.7e5, 12.1), forward: DVec3::X, up: DVec3::Z };
        let camera = Camera { far_m: Some(1e3), ..Default::default() };
        let frame = FramePlanes::new(&View::new(&camera, &pose), DVec3::new(10.0, 20.0, 30.0));
        assert_eq!((frame.count, frame.all()), (6, 0b11_1111));
        assert!(frame.planes.iter().all(|p| p.d_in < p.d_out && p.d_out - p.d_in < 1e-3));
    }

    #[test]
    fn transposing_moves_every_bit_to_its_mirror_place() {
        for row in 0..8 {
            for column in 0..8 {
                assert_eq!(transpose(1 << (row * 8 + column)), 1 << (column * 8 + row));
            }
        }
    }

    #[test]
    fn a_lane_carries_the_planes_that_it_is_not_inside_of() {
        let mut masks = PlaneMasks::default();
        masks.inside[0] = 0b0000_0011;
        masks.inside[4] = 0b0000_0001;
        assert_eq!(planes_left(&masks, 0b10001, true), [0, 0b10000, 0b10001, 17, 17, 17, 17, 17]);
        assert_eq!(planes_left(&masks, 0b10001, false), [0, 17, 17, 17, 17, 17, 17, 17]);
        assert_eq!(super::super::frustum_arithmetic::bits(0b1010_0001).collect::<Vec<_>>(), [0, 5, 7]);
    }
}
