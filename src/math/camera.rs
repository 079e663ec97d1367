//! Cameras, poses and view volumes, all in f64. A path file holds poses; the
//! manifest holds the projection.

use glam::DVec3;
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Projection {
    Perspective {
        fov_y_rad: f64,
    },
    /// `height_m`: full height of the view volume.
    Orthographic {
        height_m: f64,
    },
}

/// Projection and clip distances; `far_m = None` is infinite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    pub projection: Projection,
    /// Width over height.
    pub aspect: f64,
    pub near_m: f64,
    pub far_m: Option<f64>,
}

impl Default for Camera {
    fn default() -> Self {
        Camera {
            projection: Projection::Perspective { fov_y_rad: 60f64.to_radians() },
            aspect: 16.0 / 9.0,
            near_m: 0.1,
            far_m: None,
        }
    }
}

/// Where the camera is: position, unit forward and unit up (right-handed, z up, metres).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub eye: DVec3,
    pub forward: DVec3,
    pub up: DVec3,
}

/// `normal . (p - eye) + offset >= 0` is inside. Unit normal, pointing inward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    pub normal: DVec3,
    pub offset_m: f64,
}

/// A camera at a pose: an orthonormal basis and the planes of the view volume
/// **relative to the eye**. This f64 set of planes *is* the view volume: exact
/// judgements are exact with respect to it.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    pub camera: Camera,
    pub eye: DVec3,
    pub forward: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    /// Half extents at unit distance (perspective) or in metres (orthographic).
    pub half_width: f64,
    pub half_height: f64,
    /// left, right, bottom, top, near, then far if finite.
    pub planes: Vec<Plane>,
}

impl View {
    /// # Panics
    /// If `forward` and `up` are parallel or zero: loaders reject such poses.
    pub fn new(camera: &Camera, pose: &Pose) -> View {
        let forward = pose.forward.normalize();
        let right = forward.cross(pose.up).normalize();
        assert!(right.is_finite(), "pose with parallel forward and up");
        let up = right.cross(forward);
        let (half_height, perspective) = match camera.projection {
            Projection::Perspective { fov_y_rad } => (libm::tan(fov_y_rad * 0.5), true),
            Projection::Orthographic { height_m } => (height_m * 0.5, false),
        };
        let half_width = half_height * camera.aspect;
        let mut planes = Vec::with_capacity(6);
        let mut side = |axis: DVec3, half: f64| {
            planes.push(if perspective {
                Plane { normal: (axis + forward * half).normalize(), offset_m: 0.0 }
            } else {
                Plane { normal: axis, offset_m: half }
            });
        };
        side(right, half_width);
        side(-right, half_width);
        side(up, half_height);
        side(-up, half_height);
        planes.push(Plane { normal: forward, offset_m: -camera.near_m });
        if let Some(far_m) = camera.far_m {
            planes.push(Plane { normal: -forward, offset_m: far_m });
        }
        View { camera: *camera, eye: pose.eye, forward, right, up, half_width, half_height, planes }
    }

    pub fn is_perspective(&self) -> bool {
        matches!(self.camera.projection, Projection::Perspective { .. })
    }

    /// Directions of the four corner rays (perspective: not normalised, unit
    /// depth along `forward`; orthographic: all `forward`), in order
    /// bottom-left, bottom-right, top-right, top-left.
    pub fn corner_rays(&self) -> [DVec3; 4] {
        if !self.is_perspective() {
            return [self.forward; 4];
        }
        let (w, h) = (self.right * self.half_width, self.up * self.half_height);
        [self.forward - w - h, self.forward + w - h, self.forward + w + h, self.forward - w + h]
    }

    /// Camera-space coordinates of a world point: x right, y up, z = depth along forward.
    pub fn to_camera(&self, p: DVec3) -> DVec3 {
        let d = p - self.eye;
        DVec3::new(d.dot(self.right), d.dot(self.up), d.dot(self.forward))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Pose {
        Pose { eye: DVec3::new(1.0, 2.0, 3.0), forward: DVec3::Y, up: DVec3::Z }
    }

    fn inside(v: &View, p: DVec3) -> bool {
        v.planes.iter().all(|pl| pl.normal.dot(p - v.eye) + pl.offset_m >= 0.0)
    }

    #[test]
    fn the_planes_enclose_what_the_projection_shows() {
        let v = View::new(&Camera { far_m: Some(50.0), ..Camera::default() }, &pose());
        assert!((v.right - DVec3::X).length() < 1e-15);
        let at = |x: f64, y: f64, z: f64| v.eye + v.right * x + v.up * y + v.forward * z;
        assert!(inside(&v, at(0.0, 0.0, 1.0)));
        assert!(!inside(&v, at(0.0, 0.0, 0.05)), "nearer than near");
        assert!(!inside(&v, at(0.0, 0.0, 51.0)), "beyond far");
        let edge = v.half_width * 10.0;
        assert!(inside(&v, at(edge * 0.999, 0.0, 10.0)));
        assert!(!inside(&v, at(edge * 1.001, 0.0, 10.0)));
        assert!(!inside(&v, at(0.0, -v.half_height * 10.01, 10.0)));
    }

    #[test]
    fn an_orthographic_volume_has_parallel_sides() {
        let camera = Camera { projection: Projection::Orthographic { height_m: 4.0 }, ..Camera::default() };
        let v = View::new(&camera, &pose());
        for depth in [0.2, 1e3, 1e6] {
            assert!(inside(&v, v.eye + v.forward * depth + v.up * 1.99));
            assert!(!inside(&v, v.eye + v.forward * depth + v.up * 2.01));
        }
    }
}
