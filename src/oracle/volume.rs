//! Does a triangle meet the view volume? A three-valued answer in f64.
//!
//! The volume is, by definition, the intersection of the closed half-spaces
//! `normal . (p - eye) + offset >= 0` of [`View::planes`] in exact arithmetic.
//! Vertices are compared with the planes under an error bound; a triangle that
//! this does not decide is clipped (Sutherland & Hodgman 1974) twice: by the
//! planes moved out by more than all rounding (nothing left proves "outside") and
//! by the planes moved in by as much (a point left proves "meets").

use crate::math::{DVec3, Plane, View};

/// Whether a triangle and the view volume have a point in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meets {
    Certainly,
    CertainlyNot,
    /// Closer to the boundary than rounding can tell; never used as a proof.
    Uncertain,
}

/// What a vertex knows of the planes; bit k is plane k.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OutCode {
    pub certainly_out: u8,
    /// Not certainly inside.
    pub maybe_out: u8,
}

/// Distance error over `sum |n_i d_i| + |offset|`: one rounding each for the
/// difference to the eye, the product and three sums, with room to spare.
pub(super) const DISTANCE_ERROR: f64 = 8.0 * f64::EPSILON / 2.0;
/// Slack of clipping over the size of the coordinates. Each of up to six clips
/// moves a vertex by at most 6 units of rounding and tests it with 8 more.
const CLIP_SLACK: f64 = 128.0 * f64::EPSILON / 2.0;

/// `p` is relative to the eye.
pub fn out_code(planes: &[Plane], p: DVec3) -> OutCode {
    let mut code = OutCode::default();
    for (k, plane) in planes.iter().enumerate() {
        let distance = plane.normal.dot(p) + plane.offset_m;
        // The tiny summand covers products that underflow.
        let error = DISTANCE_ERROR * (plane.normal.abs().dot(p.abs()) + plane.offset_m.abs()) + 1e-300;
        code.certainly_out |= u8::from(distance < -error) << k;
        code.maybe_out |= u8::from(distance <= error) << k;
    }
    code
}

/// [`meets`] where the codes of the corners decide.
#[inline]
pub fn by_codes(codes: [OutCode; 3]) -> Option<Meets> {
    if codes[0].certainly_out & codes[1].certainly_out & codes[2].certainly_out != 0 {
        return Some(Meets::CertainlyNot);
    }
    codes.iter().any(|c| c.maybe_out == 0).then_some(Meets::Certainly)
}

/// Corners are relative to the eye; `codes` are theirs.
pub fn meets(planes: &[Plane], corners: &[DVec3; 3], codes: [OutCode; 3]) -> Meets {
    if let Some(known) = by_codes(codes) {
        return known;
    }
    let size = corners.iter().map(|c| c.abs().element_sum()).fold(0.0, f64::max)
        + planes.iter().map(|p| p.offset_m.abs()).fold(0.0, f64::max);
    let slack = CLIP_SLACK * size + 1e-300;
    if clip(planes, corners, slack).is_empty() {
        return Meets::CertainlyNot;
    }
    let kept = clip(planes, corners, -slack);
    let kept = kept.as_slice();
    if kept.is_empty() {
        return Meets::Uncertain;
    }
    // The centroid lies on the triangle within `slack / 4` and normals are units,
    // so three quarters of it remain as margin.
    let witness = kept.iter().sum::<DVec3>() / kept.len() as f64;
    let inside = planes.iter().all(|p| p.normal.dot(witness) + p.offset_m > slack * 0.5);
    if inside { Meets::Certainly } else { Meets::Uncertain }
}

/// [`meets`] for one triangle given in world coordinates.
pub fn triangle_meets(view: &View, corners: &[DVec3; 3]) -> Meets {
    let relative = corners.map(|c| c - view.eye);
    meets(&view.planes, &relative, relative.map(|p| out_code(&view.planes, p)))
}

/// A convex polygon of a triangle clipped by up to six planes; 3 + 6 corners.
struct Polygon {
    corners: [DVec3; 10],
    len: usize,
}

impl Polygon {
    fn push(&mut self, p: DVec3) {
        // A convex polygon gains at most one corner a plane; rounding may add one
        // more in theory, and dropping a repeated corner loses nothing.
        if self.len < self.corners.len() {
            self.corners[self.len] = p;
            self.len += 1;
        }
    }

    fn as_slice(&self) -> &[DVec3] {
        &self.corners[..self.len]
    }

    fn is_empty(&self) -> bool {
        self.len == 0
    }
}

/// The part of the triangle with distance at least `-slack` to every plane.
fn clip(planes: &[Plane], corners: &[DVec3; 3], slack: f64) -> Polygon {
    let mut from = Polygon { corners: [DVec3::ZERO; 10], len: 3 };
    from.corners[..3].copy_from_slice(corners);
    for plane in planes {
        let mut to = Polygon { corners: [DVec3::ZERO; 10], len: 0 };
        let distance = |p: DVec3| plane.normal.dot(p) + plane.offset_m + slack;
        let polygon = from.as_slice();
        for (i, a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (da, db) = (distance(*a), distance(b));
            if da >= 0.0 {
                to.push(*a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                // `t` is in 0..=1 also in floating point, so the point stays on the edge.
                to.push(*a + (b - *a) * (da / (da - db)));
            }
        }
        from = to;
        if from.is_empty() {
            break;
        }
    }
    from
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, Pose, Projection};
    use proptest::prelude::*;

    /// The twin: a linear program, solved by trying every vertex. The largest m
    /// such that some point of the triangle has distance at least m to every
    /// plane; positive iff triangle and open volume meet.
    fn deepest(view: &View, corners: &[DVec3; 3]) -> f64 {
        // Unknowns (s, t, m); rows `a . (s, t, m) + c >= 0`.
        let mut rows = vec![
            (DVec3::new(1.0, 0.0, 0.0), 0.0),
            (DVec3::new(0.0, 1.0, 0.0), 0.0),
            (DVec3::new(-1.0, -1.0, 0.0), 1.0),
        ];
        let [a, b, c] = corners.map(|p| p - view.eye);
        for p in &view.planes {
            let n = p.normal;
            rows.push((DVec3::new(n.dot(b - a), n.dot(c - a), -1.0), n.dot(a) + p.offset_m));
        }
        let mut best = f64::NEG_INFINITY;
        for i in 0..rows.len() {
            for j in i + 1..rows.len() {
                for k in j + 1..rows.len() {
                    let ([p, q, r], d) = ([rows[i].0, rows[j].0, rows[k].0], [rows[i].1, rows[j].1, rows[k].1]);
                    let det = p.dot(q.cross(r));
                    if det.abs() < 1e-12 {
                        continue;
                    }
                    let x = (q.cross(r) * -d[0] + r.cross(p) * -d[1] + p.cross(q) * -d[2]) / det;
                    let size = 1.0 + a.length() + b.length() + c.length();
                    if rows.iter().all(|(n, d)| n.dot(x) + d >= -1e-9 * size) {
                        best = best.max(x.z);
                    }
                }
            }
        }
        best
    }

    fn views() -> Vec<View> {
        let pose = Pose { eye: DVec3::new(3.0, -2.0, 5.0), forward: DVec3::new(1.0, 2.0, -0.3), up: DVec3::Z };
        let ortho = Projection::Orthographic { height_m: 6.0 };
        [
            Camera::default(),
            Camera { far_m: Some(20.0), ..Camera::default() },
            Camera { projection: ortho, far_m: Some(15.0), ..Camera::default() },
        ]
        .map(|c| View::new(&c, &pose))
        .to_vec()
    }

    proptest! {
        #[test]
        fn clipping_agrees_with_a_linear_program(
            c in proptest::array::uniform9(-1.0f64..1.0), size in prop_oneof![Just(1.0), Just(8.0), Just(40.0)],
        ) {
            for view in views() {
                let centre = view.eye + view.forward * 6.0;
                let point = |i: usize| centre + DVec3::new(c[i], c[i + 1], c[i + 2]) * size;
                let corners = [point(0), point(3), point(6)];
                let m = deepest(&view, &corners);
                match triangle_meets(&view, &corners) {
                    Meets::Certainly => prop_assert!(m > -1e-6, "{m}"),
                    Meets::CertainlyNot => prop_assert!(m < 1e-6, "{m}"),
                    Meets::Uncertain => prop_assert!(m.abs() < 1e-6, "{m}"),
                }
            }
        }
    }

    #[test]
    fn a_triangle_around_the_whole_view_is_found_though_no_corner_is_inside() {
        for view in views() {
            let at = |x: f64, y: f64| view.eye + view.forward * 5.0 + view.right * x + view.up * y;
            let huge = [at(-1e4, -1e4), at(1e4, -1e4), at(0.0, 1e4)];
            assert_eq!(triangle_meets(&view, &huge), Meets::Certainly);
            // No single plane has all three corners behind it, and yet it misses.
            let beside = [at(-60.0, 1.0), at(-1.0, 60.0), at(-60.0, 60.0)];
            assert_eq!(triangle_meets(&view, &beside), Meets::CertainlyNot);
        }
    }

    #[test]
    fn touching_the_boundary_is_uncertain_and_a_hair_beside_is_not() {
        let pose = Pose { eye: DVec3::ZERO, forward: DVec3::Y, up: DVec3::Z };
        let view = View::new(&Camera { near_m: 0.5, ..Camera::default() }, &pose);
        let at_depth = |y: f64| [DVec3::new(0.0, y, 0.0), DVec3::new(0.1, y - 0.2, 0.0), DVec3::new(0.0, y - 0.2, 0.1)];
        assert_eq!(triangle_meets(&view, &at_depth(0.5)), Meets::Uncertain);
        assert_eq!(triangle_meets(&view, &at_depth(0.5 + 1e-12)), Meets::Certainly);
        assert_eq!(triangle_meets(&view, &at_depth(0.5 - 1e-12)), Meets::CertainlyNot);
    }
}
