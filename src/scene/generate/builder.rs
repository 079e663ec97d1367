//! The mesh under construction: painted triangles in nested frames.
//!
//! Every vertex is snapped to a multiple of 2^-12 m (a quarter of a
//! millimetre): such numbers are exact in f32 up to 4 km, so a generated scene
//! survives a GLB or OBJ file bit for bit, and equal corners are equal.

use crate::math::{DVec2, DVec3};
use crate::scene::Scene;
use std::collections::HashMap;

const UNITS_PER_M: f64 = 4096.0;

/// A turn about z followed by a shift: all that placing things in a map needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub origin: DVec3,
    cos: f64,
    sin: f64,
}

impl Frame {
    pub const IDENTITY: Frame = Frame { origin: DVec3::ZERO, cos: 1.0, sin: 0.0 };

    pub fn at(origin: DVec3) -> Frame {
        Frame { origin, ..Frame::IDENTITY }
    }

    /// `quarters` quarter turns counter-clockwise: exact, unlike an angle.
    pub fn quarter(origin: DVec3, quarters: i32) -> Frame {
        let (cos, sin) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarters.rem_euclid(4) as usize];
        Frame { origin, cos, sin }
    }

    pub fn turned(origin: DVec3, angle_rad: f64) -> Frame {
        Frame { origin, cos: libm::cos(angle_rad), sin: libm::sin(angle_rad) }
    }

    pub fn apply(&self, p: DVec3) -> DVec3 {
        self.origin + DVec3::new(self.cos * p.x - self.sin * p.y, self.sin * p.x + self.cos * p.y, p.z)
    }

    /// `inner` seen from where `self` is seen.
    pub fn then(&self, inner: &Frame) -> Frame {
        Frame {
            origin: self.apply(inner.origin),
            cos: self.cos * inner.cos - self.sin * inner.sin,
            sin: self.sin * inner.cos + self.cos * inner.sin,
        }
    }
}

/// Collects triangles; winding is the caller's, counter-clockwise from the front.
pub(super) struct Builder {
    scene: Scene,
    frame: Frame,
    /// Vertices of the current object by snapped position; only ever looked up.
    corners: HashMap<[i64; 3], u32>,
    material: u32,
    object: u32,
    two_sided: bool,
}

impl Builder {
    pub fn new(name: &str) -> Builder {
        Builder {
            scene: Scene { name: name.to_string(), ..Scene::default() },
            frame: Frame::IDENTITY,
            corners: HashMap::new(),
            material: 0,
            object: 0,
            two_sided: false,
        }
    }

    /// Triangles so far.
    pub fn len(&self) -> usize {
        self.scene.triangles.len()
    }

    /// Everything that follows has this material.
    pub fn paint(&mut self, name: &str) {
        let names = &mut self.scene.material_names;
        self.material = match names.iter().position(|n| n == name) {
            Some(i) => i as u32,
            None => {
                names.push(name.to_string());
                names.len() as u32 - 1
            }
        };
    }

    /// Everything that follows is a new object, if the last one has anything.
    pub fn object(&mut self) {
        if self.scene.object_id.last() == Some(&self.object) {
            self.object += 1;
            self.corners.clear();
        }
    }

    /// Runs `f` with `frame` nested into the current one.
    pub fn within<R>(&mut self, frame: Frame, f: impl FnOnce(&mut Builder) -> R) -> R {
        let outer = self.frame;
        self.frame = outer.then(&frame);
        let result = f(self);
        self.frame = outer;
        result
    }

    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// Nests `frame` until the frame returned is given back to [`Builder::leave`].
    pub fn enter(&mut self, frame: Frame) -> Frame {
        let inner = self.frame.then(&frame);
        std::mem::replace(&mut self.frame, inner)
    }

    pub fn leave(&mut self, outer: Frame) {
        self.frame = outer;
    }

    /// Runs `f` making triangles that have no back.
    pub fn two_sided(&mut self, f: impl FnOnce(&mut Builder)) {
        self.two_sided = true;
        f(self);
        self.two_sided = false;
    }

    fn vertex(&mut self, p: DVec3) -> u32 {
        let key = (self.frame.apply(p) * UNITS_PER_M).round();
        let key = [key.x as i64, key.y as i64, key.z as i64];
        *self.corners.entry(key).or_insert_with(|| {
            let [x, y, z] = key.map(|k| k as f64 / UNITS_PER_M);
            self.scene.positions.push(DVec3::new(x, y, z));
            self.scene.positions.len() as u32 - 1
        })
    }

    /// A triangle, left out if snapping made it degenerate.
    pub fn tri(&mut self, a: DVec3, b: DVec3, c: DVec3) {
        let t = [self.vertex(a), self.vertex(b), self.vertex(c)];
        let [a, b, c] = t.map(|v| self.scene.positions[v as usize]);
        if (b - a).cross(c - a) == DVec3::ZERO {
            return;
        }
        let s = &mut self.scene;
        s.triangles.push(t);
        s.source_triangle_id.push(s.triangles.len() as u32 - 1);
        s.object_id.push(self.object);
        s.material_id.push(self.material);
        s.two_sided.push(self.two_sided);
        s.occluder.push(true);
    }

    /// A quad as two triangles, counter-clockwise from the front.
    pub fn quad(&mut self, a: DVec3, b: DVec3, c: DVec3, d: DVec3) {
        self.tri(a, b, c);
        self.tri(a, c, d);
    }

    pub fn finish(mut self) -> Scene {
        self.scene.source_triangle_count = self.scene.triangles.len() as u32;
        self.scene.report.triangles_in_file = self.scene.triangles.len() as u64;
        self.drop_unused_vertices();
        self.scene.anchor();
        self.scene
    }

    /// Degenerate triangles may have left corners that nobody uses.
    fn drop_unused_vertices(&mut self) {
        let s = &mut self.scene;
        let mut number = vec![u32::MAX; s.positions.len()];
        let mut kept = Vec::with_capacity(s.positions.len());
        for v in s.triangles.iter_mut().flatten() {
            let n = &mut number[*v as usize];
            if *n == u32::MAX {
                *n = kept.len() as u32;
                kept.push(s.positions[*v as usize]);
            }
            *v = *n;
        }
        s.positions = kept;
    }
}

pub(super) fn v3(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

pub(super) fn v2(x: f64, y: f64) -> DVec2 {
    DVec2::new(x, y)
}
