//! The octant test (`frustum:octant=true`), after Assarsson & Möller (2000): of the two
//! planes that bound the view to the left and the right only the one on whose side a box
//! has its centre can reject it, and the same upward and along the view. So most boxes
//! are compared with two or three planes of five or six.
//!
//! What we changed. Assarsson & Möller ask for a symmetric frustum with a far plane and
//! for a bounding sphere that is smaller than the distance from the frustum's centre to its
//! faces. Here a plane is left out iff the centre of the box *certainly* lies on its inner side:
//! then some of the box is inside, so that no test that proves what it says could have
//! rejected it, and the answer is that of the full test, bit for bit, for any box and with no
//! far plane. Their condition on the sphere decides something else: whether the box is also
//! *inside* the plane that was left out, which its children then need not ask about.
//!
//! # Why certainly
//! All of it is f32, unfused, in one order on every target. Twice the centre is
//! `t_i = (lo_i - h_i) + (hi_i - h_i)` with `h` as in [`super::frustum_planes`], and its
//! coordinate along an axis of the view is `v = ((n_x t_x + n_y t_y) + n_z t_z) + D`. With
//! `A = sum_i |lo_i - h_i| + |hi_i - h_i|` and `u = 2^-24`, the rounding of `t` is at most `2uA`,
//! of the axis and the products `uA` each, of the sums `3uA`: `7uA` in all, and `D` errs by
//! `slack`. The guard `g = 16uA + slack` is more than twice that, which leaves `uA` for the
//! comparison with twice a clip distance, and is some `2^25` times what separates the f64
//! normals of the planes from the axes they were made of. A combination of two
//! coordinates, the distance from a side plane, errs by less than `2g`.
//!
//! A box with swapped bounds has no inside, and one with a NaN bound no place: no
//! plane is left out. Nor in `f32_world`, where nothing is certain: the switch saves
//! nothing there.

use super::frustum_arithmetic::bits;
use super::frustum_planes::{GUARD, MAX_PLANES, down, split_eye, up};
use crate::hierarchy::{BoundsBlock, LANES};
use crate::math::{DVec3, View};

pub(super) type Row = [f32; LANES];

/// What needs no comparison: bit per lane, an entry a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Far {
    /// The plane certainly does not reject the lane.
    pub skip: [u8; MAX_PLANES],
    /// Moreover the lane is certainly inside of it.
    pub inside: [u8; MAX_PLANES],
}

impl Far {
    /// Every plane is to be compared.
    pub const NONE: Far = Far { skip: [0; MAX_PLANES], inside: [0; MAX_PLANES] };

    /// The planes of `planes` that some of `lanes` needs.
    #[inline]
    pub fn needed(&self, planes: u8, lanes: u8) -> u8 {
        bits(planes).fold(0, |needed, k| needed | u8::from(lanes & !self.skip[k] != 0) << k)
    }
}

/// The view as the octant test reads it, in twice the coordinates of the camera.
#[derive(Debug, Clone, Default)]
pub struct Halves {
    pub(super) eye: [f32; 3],
    /// To the right, up, forward.
    pub(super) axes: [[f32; 3]; 3],
    pub(super) offset: [f32; 3],
    pub(super) slack: f32,
    pub(super) perspective: bool,
    /// Left and right, bottom and top: the inward normal's parts, across and forward.
    pub(super) side: [[f32; 2]; 2],
    /// Orthographic: twice the half extents of the window, rounded down.
    pub(super) window: [f32; 2],
    pub(super) near: f32,
    pub(super) far: Option<f32>,
}

/// Addend to a diagonal: more than what squares that underflow can hide.
pub(super) const TINY: f32 = 1e-18;

impl Halves {
    pub fn new(view: &View, origin: DVec3) -> Halves {
        let (eye, rest) = split_eye(view.eye, origin);
        let axes = [view.right, view.up, view.forward];
        let offset = axes.map(|n| -2.0 * n.dot(rest));
        let largest = offset.iter().fold(0f64, |m, d| m.max(d.abs()));
        let slack = largest * (-22f64).exp2() + rest.abs().element_sum() * (-46f64).exp2() + (-120f64).exp2();
        let halves = [view.half_width, view.half_height];
        Halves {
            eye,
            axes: axes.map(|n| n.as_vec3().to_array()),
            offset: offset.map(|d| d as f32),
            slack: up(slack),
            perspective: view.is_perspective(),
            side: halves.map(|h| [1.0, h].map(|part| (part / (1.0 + h * h).sqrt()) as f32)),
            window: halves.map(|h| down(2.0 * h)),
            near: up(2.0 * view.camera.near_m),
            far: view.camera.far_m.map(|far_m| down(2.0 * far_m)),
        }
    }

    /// Of 8 boxes by their centres, with the widest instructions there are.
    #[inline]
    pub fn of_boxes(&self, bounds: &BoundsBlock) -> Far {
        #[cfg(target_arch = "x86_64")]
        if super::frustum_x86::has_avx2() {
            return super::frustum_octant_x86::of_boxes_avx2(self, bounds);
        }
        self.of_boxes_plainly(bounds)
    }

    /// The twin of the vector kernels.
    pub fn of_boxes_plainly(&self, bounds: &BoundsBlock) -> Far {
        let (mut twice, mut size, mut across) = ([[0.0; LANES]; 3], [0.0; LANES], [0.0; LANES]);
        let mut sound = [true; LANES];
        for (axis, twice) in twice.iter_mut().enumerate() {
            for lane in 0..LANES {
                let (lo, hi) = (bounds.lo[axis][lane], bounds.hi[axis][lane]);
                let extent = hi - lo;
                across[lane] += extent * extent;
                sound[lane] &= lo <= hi;
                let (lo, hi) = (lo - self.eye[axis], hi - self.eye[axis]);
                twice[lane] = lo + hi;
                size[lane] += lo.abs() + hi.abs();
            }
        }
        // Twice the radius, rounded up.
        let diagonal = across.map(|d| d.sqrt() * (1.0 + GUARD) + TINY);
        let lanes = (0..LANES).fold(0, |m, l| m | u8::from(sound[l]) << l);
        self.judge(&twice, &size, &diagonal, lanes)
    }

    /// Of 8 points, of which nothing is ever inside.
    pub fn of_points(&self, points: &[Row; 3]) -> Far {
        let near: [Row; 3] = std::array::from_fn(|axis| points[axis].map(|p| p - self.eye[axis]));
        let twice = near.map(|row| row.map(|a| a + a));
        let size = std::array::from_fn(|l| (twice[0][l].abs() + twice[1][l].abs()) + twice[2][l].abs());
        Far { inside: [0; MAX_PLANES], ..self.judge(&twice, &size, &[f32::NAN; LANES], 0xff) }
    }

    fn judge(&self, twice: &[Row; 3], size: &Row, diagonal: &Row, lanes: u8) -> Far {
        let guard: Row = std::array::from_fn(|l| size[l] * (2.0 * GUARD) + self.slack);
        let wide: Row = std::array::from_fn(|l| diagonal[l] + 2.0 * guard[l]);
        let along = |i: usize| -> Row {
            let ([x, y, z], d) = (self.axes[i], self.offset[i]);
            std::array::from_fn(|l| ((x * twice[0][l] + y * twice[1][l]) + z * twice[2][l]) + d)
        };
        let above = |v: &Row, bound: &Row| lanes & (0..LANES).fold(0, |m, l| m | u8::from(v[l] > bound[l]) << l);
        let mut far = Far::NONE;
        let depth = along(2);
        let ahead = if self.perspective { above(&depth, &guard) } else { lanes };
        for i in 0..2 {
            let across = along(i);
            // To the right of the middle the left plane rejects nothing.
            for (k, sign) in [(2 * i, 1.0), (2 * i + 1, -1.0)] {
                let inward = across.map(|v| sign * v);
                far.skip[k] = ahead & above(&inward, &guard);
                let distance: Row = match self.perspective {
                    true => std::array::from_fn(|l| self.side[i][0] * inward[l] + self.side[i][1] * depth[l]),
                    false => inward.map(|v| v + self.window[i]),
                };
                far.inside[k] = far.skip[k] & above(&distance, &wide);
            }
        }
        let behind_near = depth.map(|v| v - self.near);
        (far.skip[4], far.inside[4]) = (above(&behind_near, &guard), above(&behind_near, &wide));
        if let Some(limit) = self.far {
            let before_far = depth.map(|v| limit - v);
            (far.skip[5], far.inside[5]) = (above(&before_far, &guard), above(&before_far, &wide));
        }
        far
    }
}
