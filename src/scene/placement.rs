//! Between a file's units and axes and ours: scale and up axis, for mesh and path alike.

use crate::error::{Error, Result};
use crate::math::{DVec3, Pose};
use crate::record::{SceneSpec, Up};

/// A rotation by a quarter turn about x (or none) and a uniform scale: a
/// similarity without mirroring, so that winding keeps its meaning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    pub up: Up,
    /// Metres a unit of the file.
    pub scale: f64,
}

impl Placement {
    /// # Errors
    /// If the scale is not a positive finite number.
    pub fn of(spec: &SceneSpec) -> Result<Placement> {
        if !(spec.scale.is_finite() && spec.scale > 0.0) {
            return Err(Error::new(format!("scale is {}, but must be a positive number", spec.scale))
                .key("scale")
                .help("scale is metres a unit of the file: 1 for metres, 0.01 for centimetres, 0.0254 for inches"));
        }
        Ok(Placement { up: spec.up, scale: spec.scale })
    }

    /// A point of the file in world metres, z up.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.direction(p) * self.scale
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

    /// The inverse of [`Placement::pose`], up to rounding of the scale.
    pub fn pose_to_file(&self, p: &Pose) -> Pose {
        let back = |d| direction_to_file(self.up, d);
        Pose { eye: back(p.eye) / self.scale, forward: back(p.forward), up: back(p.up) }
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
        let p = Placement { up: Up::Y, scale: 0.5 };
        assert_eq!(p.point(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(0.5, -1.5, 1.0));
        let (x, y, z) = (p.direction(DVec3::X), p.direction(DVec3::Y), p.direction(DVec3::Z));
        assert_eq!(x.cross(y), z, "right-handed stays right-handed");
        let pose = Pose { eye: DVec3::new(3.0, 5.0, -7.0), forward: DVec3::X, up: DVec3::Y };
        assert_eq!(p.pose_to_file(&p.pose(&pose)), pose);
        assert!(p.point(DVec3::ZERO).to_array().iter().all(|c| c.is_sign_positive()), "no negative zero");
    }
}
