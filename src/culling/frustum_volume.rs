//! The view frustum as points and directions, in f64, for tests that ask on which
//! side of a node's plane it lies (Silva 2009: partition plane against corners).

use crate::hierarchy::HalfSpace;
use crate::math::{DVec3, View};

/// Convex hull of `points` plus the cone of `directions`: near corners and, with
/// a finite far plane, far corners; otherwise the corner rays.
#[derive(Debug, Clone, Default)]
pub struct Volume {
    /// Relative to the eye; with each what its coordinates were added up from, which
    /// may be far larger than they are.
    points: Vec<[DVec3; 2]>,
    directions: Vec<[DVec3; 2]>,
    /// Eye relative to the scene's origin.
    eye: DVec3,
}

impl Volume {
    pub fn new(view: &View, origin: DVec3) -> Volume {
        let rays = view.corner_rays();
        let (w, h) = (view.right * view.half_width, view.up * view.half_height);
        let window = [-w - h, w - h, w + h, h - w];
        let beside = w.abs() + h.abs();
        let corner = |i: usize, depth: f64| match view.is_perspective() {
            true => [rays[i] * depth, (view.forward.abs() + beside) * depth],
            false => [window[i] + view.forward * depth, view.forward.abs() * depth + beside],
        };
        let mut volume = Volume { eye: view.eye - origin, ..Default::default() };
        for (i, ray) in rays.iter().enumerate() {
            volume.points.push(corner(i, view.camera.near_m));
            match view.camera.far_m {
                Some(far_m) => volume.points.push(corner(i, far_m)),
                None if view.is_perspective() => volume.directions.push([*ray, view.forward.abs() + beside]),
                None => volume.directions.push([*ray; 2]),
            }
        }
        volume
    }

    /// True if no point of the volume lies in the half-space. Errs towards false,
    /// by more than f64 rounding can add up to.
    pub fn misses(&self, space: &HalfSpace) -> bool {
        const GUARD: f64 = 64.0 * f64::EPSILON;
        let at_eye = space.normal.dot(self.eye) + space.offset_m;
        let scale = space.normal.abs().dot(self.eye.abs()) + space.offset_m.abs();
        let below = |[p, parts]: &[DVec3; 2], at_eye: f64, scale: f64| {
            space.normal.dot(*p) + at_eye < -GUARD * (space.normal.abs().dot(parts.abs()) + scale)
        };
        self.points.iter().all(|p| below(p, at_eye, scale)) && self.directions.iter().all(|r| below(r, 0.0, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, Pose};

    #[test]
    fn a_half_space_behind_the_eye_is_missed_and_one_ahead_is_not() {
        let pose = Pose { eye: DVec3::new(5.0, 0.0, 0.0), forward: DVec3::X, up: DVec3::Z };
        for far_m in [None, Some(100.0)] {
            let view = View::new(&Camera { far_m, ..Default::default() }, &pose);
            let volume = Volume::new(&view, DVec3::ZERO);
            let space = |normal, offset_m| HalfSpace { normal, offset_m };
            assert!(volume.misses(&space(-DVec3::X, 5.0)), "x <= 5");
            assert!(!volume.misses(&space(-DVec3::X, 6.0)), "x <= 6");
            assert!(!volume.misses(&space(DVec3::X, -50.0)), "x >= 50");
            assert_eq!(volume.misses(&space(DVec3::X, -200.0)), far_m.is_some(), "x >= 200");
            assert!(!volume.misses(&space(DVec3::Z, -40.0)), "z >= 40: the cone gets there");
        }
    }
}
