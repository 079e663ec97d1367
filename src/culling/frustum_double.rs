//! `frustum` in double precision, filtered and exact: the levels of robustness above
//! the guarded single precision of `frustum_planes`.
//!
//! A box is given by f32 offsets `c` from the scene's origin; the question is the
//! sign of `n.(origin + c - eye) + d` at its p-vertex (outside) and n-vertex (inside)
//! for the f64 planes of the view.
//!
//! # Bound of `f64`
//! With `u = 2^-53`, `e = eye - origin = h + l` (two-sum, exact) and `a = c - h`
//! (one rounding), `s = (d - n.l) + n_x a_x + n_y a_y + n_z a_z`. As `|n_i| <= 1`,
//! every rounding of products and sums is at most `u (|d| + |l| + sum |a_i|)`
//! in size, and there are fewer than 16 of them. `g = 16u (...)` decides.
//!
//! `filtered` asks single precision first (its guard is proved in `frustum_planes`),
//! this second, and whole numbers of unbounded length last. `exact` asks only those.
//! All are conservative; NaN and infinite bounds are kept.

use super::Tally;
use super::frustum_planes::{FramePlanes, PlaneMasks, two_diff};
use super::frustum_scalar::{relative, value};
use crate::hierarchy::{BoundsBlock, LANES};
use crate::math::exact::sign_of_plane;
use crate::math::{DVec3, Plane, View};
use std::cmp::Ordering;

/// The planes of a frame in f64, relative to the eye.
#[derive(Debug, Clone, Default)]
pub struct DoublePlanes {
    planes: Vec<Plane>,
    origin: DVec3,
    eye: DVec3,
    /// `eye - origin` and what rounding leaves of it.
    head: DVec3,
    rest: DVec3,
}

/// What asks for the sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    F64,
    Filtered,
    Exact,
}

/// Sign of a corner's distance: certain, or `None`.
type Sign = Option<Ordering>;

impl DoublePlanes {
    pub fn new(view: &View, origin: DVec3) -> DoublePlanes {
        let mut out = DoublePlanes { planes: view.planes.clone(), origin, eye: view.eye, ..Default::default() };
        for axis in 0..3 {
            (out.head[axis], out.rest[axis]) = two_diff(view.eye[axis], origin[axis]);
        }
        out
    }

    /// Sign by error-bounded double precision.
    fn sign_f64(&self, k: usize, corner: DVec3) -> Sign {
        let plane = &self.planes[k];
        let a = corner - self.head;
        let s = (plane.offset_m - plane.normal.dot(self.rest)) + plane.normal.dot(a);
        let size = plane.offset_m.abs() + self.rest.abs().element_sum() + a.abs().element_sum();
        let bound = 16.0 * 0.5 * f64::EPSILON * size + 1e-300;
        // Written so that NaN is uncertain.
        if s > bound {
            Some(Ordering::Greater)
        } else if s < -bound {
            Some(Ordering::Less)
        } else {
            None
        }
    }

    fn sign_exact(&self, k: usize, corner: DVec3) -> Sign {
        let plane = &self.planes[k];
        corner.is_finite().then(|| sign_of_plane(plane.normal, corner, self.origin, self.eye, plane.offset_m))
    }

    /// As the f32 kernels: outside and inside lanes of the wanted planes.
    pub fn block(
        &self,
        level: Level,
        frame: &FramePlanes,
        bounds: &BoundsBlock,
        wanted: u8,
        lanes: u8,
        out: &mut PlaneMasks,
        tally: &mut Tally,
    ) {
        for k in (0..self.planes.len()).filter(|k| wanted >> k & 1 == 1) {
            (out.outside[k], out.inside[k]) = (0, 0);
            for lane in (0..LANES).filter(|l| lanes >> l & 1 == 1 && is_finite(bounds, *l)) {
                let at = |corner: &[usize; 3]| {
                    let side = |i: usize| f64::from(if i < 3 { bounds.lo[i][lane] } else { bounds.hi[i - 3][lane] });
                    DVec3::new(side(corner[0]), side(corner[1]), side(corner[2]))
                };
                let plane = &frame.planes[k];
                let far = self.ask(level, frame, bounds, lane, k, &plane.p, at(&plane.p), tally);
                if far == Some(Ordering::Less) {
                    out.outside[k] |= 1 << lane;
                    continue;
                }
                let near = self.ask(level, frame, bounds, lane, k, &plane.n, at(&plane.n), tally);
                if near == Some(Ordering::Greater) {
                    out.inside[k] |= 1 << lane;
                }
            }
        }
    }

    fn ask(
        &self,
        level: Level,
        frame: &FramePlanes,
        bounds: &BoundsBlock,
        lane: usize,
        k: usize,
        corner: &[usize; 3],
        point: DVec3,
        tally: &mut Tally,
    ) -> Sign {
        match level {
            Level::F64 => self.sign_f64(k, point),
            Level::Exact => self.sign_exact(k, point),
            Level::Filtered => {
                tally.predicates += 1;
                let (a, guard) = relative(frame, bounds, lane);
                let plane = &frame.planes[k];
                if value(plane, &a, corner, plane.d_out) < -guard {
                    return Some(Ordering::Less);
                }
                if value(plane, &a, corner, plane.d_in) > guard {
                    return Some(Ordering::Greater);
                }
                tally.fallbacks_f64 += 1;
                self.sign_f64(k, point).or_else(|| {
                    tally.fallbacks_exact += 1;
                    self.sign_exact(k, point)
                })
            }
        }
    }
}

/// All six bounds: a box with a NaN or an infinity is kept whatever the others say.
pub fn is_finite(bounds: &BoundsBlock, lane: usize) -> bool {
    (0..3).all(|axis| bounds.lo[axis][lane].is_finite() && bounds.hi[axis][lane].is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, Pose, Projection};
    use proptest::prelude::*;

    /// Corners that lie on a plane as nearly as f32 allows, at any offset.
    fn setting(offset: f64, camera: &Camera) -> (View, DVec3) {
        let eye = DVec3::new(offset + 0.37, -0.77 * offset - 1.5, 0.31 * offset);
        let pose = Pose { eye, forward: DVec3::new(1.0, 0.3, -0.2), up: DVec3::Z };
        (View::new(camera, &pose), eye.round() + DVec3::new(3.0, -8.0, 1.0))
    }

    fn cameras() -> Vec<Camera> {
        let ortho = Projection::Orthographic { height_m: 7.0 };
        let fov = |deg: f64| Camera {
            projection: Projection::Perspective { fov_y_rad: deg.to_radians() },
            ..Camera::default()
        };
        vec![
            Camera::default(),
            fov(0.01),
            fov(179.0),
            Camera { far_m: Some(50.0), ..fov(60.0) },
            Camera { projection: ortho, far_m: Some(90.0), ..Camera::default() },
        ]
    }

    proptest! {
        // H.4: filtered and exact agree on every predicate; f64 and f32 contradict neither.
        #[test]
        fn every_level_agrees_with_the_exact_one(
            c in proptest::array::uniform6(-30.0f32..30.0), power in 0i32..9, near in any::<bool>(), which in 0usize..5,
        ) {
            let (view, origin) = setting(10f64.powi(power), &cameras()[which]);
            let double = DoublePlanes::new(&view, origin);
            let frame = FramePlanes::new(&view, origin);
            let mut bounds = BoundsBlock::EMPTY;
            for axis in 0..3 {
                let (mut a, mut b) = (c[axis], c[axis + 3]);
                if near {
                    // Small boxes about the eye's side planes: hard signs.
                    let on = (view.eye + view.corner_rays()[axis] * f64::from(c[3].abs() + 0.1) - origin)[axis];
                    (a, b) = (on as f32, (on as f32) + c[axis].abs() * 1e-6);
                }
                bounds.lo[axis][0] = a.min(b);
                bounds.hi[axis][0] = a.max(b);
            }
            let ask = |level| {
                let (mut masks, mut tally) = (PlaneMasks::default(), Tally::default());
                double.block(level, &frame, &bounds, frame.all(), 1, &mut masks, &mut tally);
                (masks, tally)
            };
            let (exact, _) = ask(Level::Exact);
            let (filtered, tally) = ask(Level::Filtered);
            prop_assert_eq!(filtered, exact);
            prop_assert!(tally.fallbacks_exact <= tally.fallbacks_f64 && tally.fallbacks_f64 <= tally.predicates);
            let (f64_masks, _) = ask(Level::F64);
            let mut single = PlaneMasks::default();
            super::super::frustum_scalar::block(&frame, &bounds, frame.all(), true, &mut single);
            for k in 0..frame.count {
                for careful in [f64_masks, single] {
                    prop_assert!(careful.outside[k] & 1 & !exact.outside[k] == 0, "a false cull");
                    prop_assert!(careful.inside[k] & 1 & !exact.inside[k] == 0);
                }
            }
        }
    }

    #[test]
    fn boxes_without_finite_bounds_are_kept() {
        // B5.4
        let (view, origin) = setting(1.0, &Camera::default());
        let double = DoublePlanes::new(&view, origin);
        let frame = FramePlanes::new(&view, origin);
        for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for axis in 0..3 {
                let mut bounds = BoundsBlock::EMPTY;
                (0..3).for_each(|i| (bounds.lo[i][0], bounds.hi[i][0]) = (-1e4, -9e3));
                (bounds.lo[axis][0], bounds.hi[axis][0]) = (wrong, wrong);
                for level in [Level::F64, Level::Filtered, Level::Exact] {
                    let (mut masks, mut tally) = (PlaneMasks::default(), Tally::default());
                    double.block(level, &frame, &bounds, frame.all(), 1, &mut masks, &mut tally);
                    assert_eq!(masks, PlaneMasks::default(), "{wrong} {axis} {level:?}");
                }
            }
        }
    }
}
