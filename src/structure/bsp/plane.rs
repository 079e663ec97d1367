//! Partition planes kept by reference to the three original vertices that span
//! them, and the classification of points against them.
//!
//! Original vertices are classified exactly: a floating-point filter with the
//! error bound of Shewchuk (1997), then his adaptive `orient3d`. A corner made
//! by a split has rounded coordinates, so "exact" would be noise there: it lies
//! in the plane when it is within the rounding of splits. Otherwise the
//! fragments of a plane's own split would be split again by its coplanar
//! neighbours, without end.

use crate::hierarchy::HalfSpace;
use crate::math::{Aabb, DVec3};
use crate::structure::builder::piece::{Piece, rounding_m};
use robust::{Coord3D, orient3d};

/// Factor of the forward error of the 3 x 3 determinant below; Shewchuk's
/// "A" bound is (7 + 56 u) u of the same permanent, `f64::EPSILON` is 2 u.
const FILTER: f64 = 4.0 * f64::EPSILON;

#[derive(Debug, Clone, Copy)]
pub struct SplitPlane {
    vertices: [DVec3; 3],
    /// Towards the front, not normalised.
    normal: DVec3,
    length: f64,
    /// Absolute terms of the normal, for the error bound.
    permanent: DVec3,
    /// An axis-parallel plane: axis, coordinate, sign of the front.
    axis: Option<(usize, f64, f64)>,
}

impl SplitPlane {
    /// Plane of a triangle, from its original vertices; `None` if they span none.
    pub fn of_triangle(vertices: [DVec3; 3]) -> Option<SplitPlane> {
        let [a, b, c] = vertices;
        let (e, f) = (b - a, c - a);
        let normal = e.cross(f);
        let length = normal.length();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let (ea, fa) = (e.abs(), f.abs());
        let permanent = DVec3::new(ea.y * fa.z + ea.z * fa.y, ea.z * fa.x + ea.x * fa.z, ea.x * fa.y + ea.y * fa.x);
        let axis = (0..3).find(|i| a[*i] == b[*i] && a[*i] == c[*i]).map(|i| (i, a[i], normal[i].signum()));
        Some(SplitPlane { vertices, normal, length, permanent, axis })
    }

    /// The plane `p[axis] = at`, front towards plus.
    pub fn across(axis: usize, at: f64) -> SplitPlane {
        let normal = DVec3::AXES[axis];
        let v = normal * at;
        SplitPlane { vertices: [v; 3], normal, length: 1.0, permanent: DVec3::ZERO, axis: Some((axis, at, 1.0)) }
    }

    /// Parallel to two axes.
    pub fn is_axis_aligned(&self) -> bool {
        self.axis.is_some()
    }

    /// Unit normal towards the front.
    pub fn unit_normal(&self) -> DVec3 {
        self.normal / self.length
    }

    pub fn point(&self) -> DVec3 {
        self.vertices[0]
    }

    /// Signed distance, scaled by a constant of the plane; exact in sign for
    /// axis-parallel planes, otherwise only as good as its rounding.
    #[inline]
    fn distance(&self, p: DVec3) -> f64 {
        match self.axis {
            Some((axis, at, sign)) => (p[axis] - at) * sign,
            None => self.normal.dot(p - self.vertices[0]),
        }
    }

    /// 1 in front, -1 behind, 0 in the plane.
    #[inline]
    fn side(&self, p: DVec3, made: bool, rounding_m: f64) -> i8 {
        let d = self.distance(p);
        let sign = i8::from(d > 0.0) - i8::from(d < 0.0);
        if self.axis.is_some() {
            return sign;
        }
        if made && d.abs() <= rounding_m * self.length {
            return 0;
        }
        let bound = FILTER * self.permanent.dot((p - self.vertices[0]).abs());
        if d.abs() > bound { sign } else { self.exact_side(p) }
    }

    /// Shewchuk's sign is positive below the plane, so it is turned around.
    #[cold]
    fn exact_side(&self, p: DVec3) -> i8 {
        let c = |v: DVec3| Coord3D { x: v.x, y: v.y, z: v.z };
        let [v0, v1, v2] = self.vertices.map(c);
        let det = orient3d(v0, v1, v2, c(p));
        i8::from(det < 0.0) - i8::from(det > 0.0)
    }

    /// Sides of the three corners; all 0 for a coplanar piece.
    #[inline]
    pub fn sides(&self, piece: &Piece) -> [i8; 3] {
        let rounding = if piece.made == 0 { 0.0 } else { rounding_m(&piece.corners) };
        let p = &piece.corners;
        [0, 1, 2].map(|i| self.side(p[i], piece.made >> i & 1 == 1, rounding))
    }

    /// Side of a whole piece: 1, -1, or 0 if it spans the plane. A coplanar one
    /// goes to the side it faces.
    #[inline]
    pub fn place(&self, piece: &Piece, sides: [i8; 3]) -> i8 {
        let (front, back) = (sides.contains(&1), sides.contains(&-1));
        match (front, back) {
            (true, true) => 0,
            (true, false) => 1,
            (false, true) => -1,
            (false, false) => {
                if piece.normal().dot(self.normal) >= 0.0 {
                    1
                } else {
                    -1
                }
            }
        }
    }

    pub fn split(&self, piece: &Piece, sides: [i8; 3], front: &mut Vec<Piece>, back: &mut Vec<Piece>) {
        let d = piece.corners.map(|p| self.distance(p));
        let snap = |q: &mut DVec3| {
            if let Some((axis, at, _)) = self.axis {
                q[axis] = at;
            }
        };
        piece.split(sides, d, snap, front, back);
    }

    /// The half-space in front (`sign` 1) or behind (-1), widened so that it
    /// holds every piece within `bounds` that was put there, made corners included.
    pub fn half_space(&self, sign: f64, bounds: &Aabb, origin: DVec3) -> HalfSpace {
        let v = self.vertices[0];
        let reach = (bounds.lo - v).abs().max((bounds.hi - v).abs()).length();
        let size = bounds.lo.abs().max(bounds.hi.abs()).max(v.abs()).max_element();
        // Direction error of the normal, by the plane's conditioning, over the
        // reach; rounding of made corners and of this evaluation over the size.
        let conditioning = self.permanent.length() / self.length + 1.0;
        let slack_m = 8.0 * f64::EPSILON * conditioning * reach + 512.0 * f64::EPSILON * size;
        let normal = self.unit_normal() * sign;
        HalfSpace { normal, offset_m: slack_m - normal.dot(v - origin) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Exact side by integers: coordinates are small whole numbers, moved far
    /// away by a power of two that f64 still holds.
    fn exact(t: [[i64; 3]; 3], p: [i64; 3]) -> i8 {
        let sub = |a: [i64; 3], b: [i64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]].map(i128::from);
        let (e, f, g) = (sub(t[1], t[0]), sub(t[2], t[0]), sub(p, t[0]));
        let det = g[0] * (e[1] * f[2] - e[2] * f[1])
            + g[1] * (e[2] * f[0] - e[0] * f[2])
            + g[2] * (e[0] * f[1] - e[1] * f[0]);
        det.signum() as i8
    }

    proptest! {
        #[test]
        fn original_vertices_are_classified_exactly(
            t in prop::array::uniform3(prop::array::uniform3(-3i64..=3)), p in prop::array::uniform3(-3i64..=3),
            nudge in prop::array::uniform3(-1i64..=1), far in prop::sample::select(vec![0i64, 1 << 30]),
        ) {
            // A large triangle and a point next to its plane, in units of 2^-20.
            let big = t.map(|v| v.map(|x| (x << 20) + far));
            let near = [0, 1, 2].map(|i| (p[i] << 20) + far + nudge[i]);
            let v = |v: [i64; 3]| DVec3::from(v.map(|x| x as f64));
            let Some(plane) = SplitPlane::of_triangle(big.map(v)) else { return Ok(()) };
            prop_assert_eq!(plane.side(v(near), false, 0.0), exact(big, near));
        }
    }

    #[test]
    fn the_front_is_where_the_triangle_faces() {
        let plane = SplitPlane::of_triangle([DVec3::ZERO, DVec3::X, DVec3::new(0.1, 1.0, 0.0)]).unwrap();
        assert_eq!((plane.side(DVec3::Z, false, 0.0), plane.side(-DVec3::Z, false, 0.0)), (1, -1));
        let tilted = SplitPlane::of_triangle([DVec3::ZERO, DVec3::X, DVec3::new(0.0, 1.0, 0.3)]).unwrap();
        assert_eq!((tilted.side(DVec3::Z, false, 0.0), tilted.side(-DVec3::Z, false, 0.0)), (1, -1));
    }
}
