//! Between a file's units and axes and ours: up axis, scale and offset, for mesh and path alike.

use crate::error::{Error, Result};
use crate::math::{DVec3, Pose};
use crate::record::{SceneSpec, Up};

/// A rotation by a quarter turn about x (or none), a uniform scale and a translation:
/// a similarity without mirroring, so that winding keeps its meaning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    pub up: Up,
    /// Metres a unit of the file.
    pub scale: f64,
    /// Where the file's origin goes.
    pub offset_m: DVec3,
}

/// Where a scene goes that is moved by `distance_m` and no direction is said: along
/// (6, -3, 2) / 7, a unit vector in rational numbers, so that all coordinates become
/// large, none of them equal, and the distance is what was written.
pub fn along(distance_m: f64) -> [f64; 3] {
    [6.0, -3.0, 2.0].map(|part| part * distance_m / 7.0)
}

impl Placement {
    /// # Errors
    /// If the scale is not a positive finite number or the offset not finite.
    pub fn of(spec: &SceneSpec) -> Result<Placement> {
        if !(spec.scale.is_finite() && spec.scale > 0.0) {
            return Err(Error::new(format!("scale is {}, but must be a positive number", spec.scale))
                .key("scale")
                .help("scale is metres a unit of the file: 1 for metres, 0.01 for centimetres, 0.0254 for inches"));
        }
        let offset_m = DVec3::from_array(spec.offset_m);
        if !offset_m.is_finite() {
            return Err(Error::new(format!("offset_m is {:?}, but must be finite", spec.offset_m))
                .key("offset_m")
                .help("give metres, such as 1e4"));
        }
        Ok(Placement { up: spec.up, scale: spec.scale, offset_m })
    }

    /// A point of the file in world metres, z up: scale x point + offset, rounded once.
    pub fn point(&self, p: DVec3) -> DVec3 {
        let turned = self.direction(p);
        if self.offset_m == DVec3::ZERO {
            return turned * self.scale;
        }
        // A fused operation is the same bits with and without hardware for it.
        let moved = |k: usize| turned[k].mul_add(self.scale, self.offset_m[k]);
        DVec3::ZERO + DVec3::new(moved(0), moved(1), moved(2))
    }

    /// A direction of the file in world axes; its length stays.
    pub fn direction(&self, d: DVec3) -> DVec3 {
        // Adding zero turns -0 into +0, so that equal places have equal bits (hashes, welding).
        DVec3::ZERO
            + match self.up {
                Up::Z => d,
                Up::Y => DVec3::new(d.x, -d.z, d.y),
            }
    }

    pub fn pose(&self, p: &Pose) -> Pose {
        Pose { eye: self.point(p.eye), forward: self.direction(p.forward), up: self.direction(p.up) }
    }

    /// The inverse of [`Placement::pose`], up to rounding.
    pub fn pose_to_file(&self, p: &Pose) -> Pose {
        let back = |d| direction_to_file(self.up, d);
        Pose { eye: back(p.eye - self.offset_m) / self.scale, forward: back(p.forward), up: back(p.up) }
    }
}

/// The inverse of [`Placement::direction`], exact.
pub fn direction_to_file(up: Up, d: DVec3) -> DVec3 {
    DVec3::ZERO
        + match up {
            Up::Z => d,
            Up::Y => DVec3::new(d.x, d.z, -d.y),
        }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn y_up_becomes_z_up_without_mirroring_and_comes_back() {
        let p = Placement { up: Up::Y, scale: 0.5, offset_m: DVec3::ZERO };
        assert_eq!(p.point(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(0.5, -1.5, 1.0));
        let (x, y, z) = (p.direction(DVec3::X), p.direction(DVec3::Y), p.direction(DVec3::Z));
        assert_eq!(x.cross(y), z, "right-handed stays right-handed");
        let pose = Pose { eye: DVec3::new(3.0, 5.0, -7.0), forward: DVec3::X, up: DVec3::Y };
        assert_eq!(p.pose_to_file(&p.pose(&pose)), pose);
        assert!(p.point(DVec3::ZERO).to_array().iter().all(|c| c.is_sign_positive()), "no negative zero");
    }

    #[test]
    fn a_moved_point_is_scaled_and_moved_with_one_rounding() {
        let p = Placement { up: Up::Z, scale: 0.1, offset_m: DVec3::new(1e9, 0.0, -1e9) };
        // The exact product goes into the sum: two roundings would differ in the last bit.
        assert_eq!(p.point(DVec3::new(3.0, 3.0, 3.0)), DVec3::new(1e9 + 0.3, 0.1 * 3.0, -1e9 + 0.3));
        let far = DVec3::splat(1e17 + 16.0);
        let exact = 0.1f64.mul_add(1e17 + 16.0, 1e9);
        assert_eq!(p.point(far).x, exact);
        let pose = Pose { eye: DVec3::new(1.0, 2.0, 3.0), forward: DVec3::X, up: DVec3::Z };
        assert!((p.pose_to_file(&p.pose(&pose)).eye - pose.eye).length() < 1e-5);
    }

    #[test]
    fn a_distance_is_the_length_of_its_offset() {
        for d in [0.0, 1.0, 7.0, 1e3, 1e6, 1.234e-5, 1e12] {
            let v = DVec3::from_array(along(d));
            assert!((v.length() - d).abs() <= d * 4.0 * f64::EPSILON, "{d}");
        }
        assert_eq!(along(7.0), [6.0, -3.0, 2.0]);
    }
}
