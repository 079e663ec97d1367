//! `frustum` as engines write it: everything in single precision, in world
//! coordinates, without a guard. **Aggressive**: far from the origin it loses boxes
//! that are visible, and the lab measures how many.
//!
//! Planes are rows of an f32 view-projection matrix (Gribb & Hartmann 2001, read from
//! public code), boxes the nearest f32 to `origin + offset`, and a box is outside when
//! its p-vertex has `n.p + d < 0`. The eye cancels in `d` only as well as f32 allows:
//! the distance error grows as the offset (about `5u |offset|`).

use super::frustum_planes::PlaneMasks;
use crate::hierarchy::{BoundsBlock, Hierarchy, LANES};
use crate::math::{DVec3, Vec3, View};

/// `n.p + d >= 0` inside.
#[derive(Debug, Clone, Copy, Default)]
struct WorldPlane {
    normal: Vec3,
    d: f32,
}

#[derive(Debug, Clone, Default)]
pub struct WorldPlanes {
    /// left, right, bottom, top, near, far; `None` where a row has no normal.
    planes: Vec<Option<WorldPlane>>,
}

impl WorldPlanes {
    pub fn new(view: &View) -> WorldPlanes {
        let (eye, right, up) = (view.eye.as_vec3(), view.right.as_vec3(), view.up.as_vec3());
        let forward = view.forward.as_vec3();
        // Rows of the view matrix: (axis, -axis . eye), all in f32.
        let row = |axis: Vec3, sign: f32| -> [f32; 4] {
            let a = axis * sign;
            [a.x, a.y, a.z, -a.dot(eye)]
        };
        let (x, y, z) = (row(right, 1.0), row(up, 1.0), row(forward, 1.0));
        let scale = |r: [f32; 4], s: f32| r.map(|v| v * s);
        let add = |a: [f32; 4], b: [f32; 4]| [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]];
        let one = [0.0, 0.0, 0.0, 1.0];
        let near = view.camera.near_m as f32;
        // Clip rows: w is the depth (perspective) or 1 (orthographic).
        let w = if view.is_perspective() { z } else { one };
        let (cx, cy) = (scale(x, 1.0 / view.half_width as f32), scale(y, 1.0 / view.half_height as f32));
        let mut rows =
            vec![add(w, cx), add(w, scale(cx, -1.0)), add(w, cy), add(w, scale(cy, -1.0)), add(z, scale(one, -near))];
        if let Some(far_m) = view.camera.far_m {
            rows.push(add(scale(z, -1.0), scale(one, far_m as f32)));
        }
        let planes = rows.into_iter().map(|[a, b, c, d]| {
            let normal = Vec3::new(a, b, c);
            let length = normal.length();
            // B1: an infinite far plane gives a row without a normal.
            (length > 1e-12 * d.abs() && length.is_finite())
                .then(|| WorldPlane { normal: normal / length, d: d / length })
        });
        WorldPlanes { planes: planes.collect() }
    }

    /// As the guarded kernels: outside and inside lanes of the wanted planes.
    pub fn block(&self, boxes: &BoundsBlock, wanted: u8, out: &mut PlaneMasks) {
        for (k, plane) in self.planes.iter().enumerate().filter(|(k, _)| wanted >> k & 1 == 1) {
            (out.outside[k], out.inside[k]) = (0, 0);
            let Some(plane) = plane else { continue };
            for lane in 0..LANES {
                let mut far = plane.d;
                let mut near = plane.d;
                for axis in 0..3 {
                    let n = plane.normal[axis];
                    let (lo, hi) = (boxes.lo[axis][lane], boxes.hi[axis][lane]);
                    let (p, q) = if n >= 0.0 { (hi, lo) } else { (lo, hi) };
                    far += n * p;
                    near += n * q;
                }
                // NaN is neither.
                out.outside[k] |= u8::from(far < 0.0) << lane;
                out.inside[k] |= u8::from(near >= 0.0) << lane;
            }
        }
    }
}

/// World-space boxes of a hierarchy, rounded to nearest.
pub fn column(hierarchy: &Hierarchy) -> Vec<BoundsBlock> {
    let world = |offset: f32, axis: usize, origin: DVec3| (origin[axis] + f64::from(offset)) as f32;
    let block = |b: &BoundsBlock| {
        let mut out = *b;
        for axis in 0..3 {
            for lane in 0..LANES {
                out.lo[axis][lane] = world(b.lo[axis][lane], axis, hierarchy.origin);
                out.hi[axis][lane] = world(b.hi[axis][lane], axis, hierarchy.origin);
            }
        }
        out
    };
    hierarchy.bounds.iter().map(block).collect()
}
