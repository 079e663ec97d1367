//! A triangle on the image plane of [`super::fast_v_lens`]: on which side of it a ray
//! passes, exactly, and between which depths it lies, certainly.
//!
//! With the eye as origin the side of a ray to an edge is one triple product (the moments of
//! the Pluecker coordinates vanish), linear on the image plane. The sign of the rounded one
//! counts where a bound proves it; whole numbers of unbounded length decide the rest.
//! Bounds as functions of the corners' own error `8 U |q|`:
//! - an edge function `(q_a x q_b) . (x, y, 1)` is wrong by at most
//!   `16 U (|a||q_b| + |q_a||b| + |q_a||q_b|) (|x| + |y| + 1)`, q being what is multiplied
//!   (the corner, or (x, y, 1) for parallel rays);
//! - the normal by `24 U D (l1 + l2)`, D the largest distance of a corner, l two sides; the
//!   key, a quotient of normal and volume, follows.

use super::fast_v_lens::{Lens, Rect, U};
use super::fast_v_mesh::Mesh;
use crate::math::predicates::{Facing, Predicates};
use crate::math::{DVec3, exact};
use std::cmp::Ordering;

/// Signs asked, and those that took whole numbers.
#[derive(Debug, Clone, Copy, Default)]
pub struct Signs {
    pub asked: u64,
    pub exact: u64,
}

/// Whether the triangle is drawn at all: from the front, or it has no back.
#[inline]
pub fn is_drawn(lens: &Lens, mesh: &Mesh, t: u32, corners: &[DVec3; 3], signs: &mut Signs) -> bool {
    if mesh.is_two_sided(t) {
        return true;
    }
    let mut predicates = Predicates::default();
    let [a, b, c] = *corners;
    let facing = match lens.perspective {
        true => predicates.facing(a, b, c, lens.eye),
        false => predicates.facing_along(a, b, c, lens.basis[2]),
    };
    signs.asked += predicates.calls;
    signs.exact += predicates.fallbacks;
    facing == Facing::Front
}

/// Where a triangle shows at most, and the keys of its farthest and nearest point; nothing
/// if certainly nowhere in the view volume. `off_m`: how far the corners may be from where
/// they belong.
#[inline]
pub fn place(lens: &Lens, corners: &[DVec3; 3], off_m: f64) -> Option<(Rect, [f64; 2])> {
    let p = corners.map(|c| lens.to_camera(c));
    // The sum of coordinates is no less than the length.
    let size = (p[0].abs() + p[1].abs() + p[2].abs()).element_sum();
    let error = 8.0 * U * size + 2.0 * off_m;
    let (nearest, deepest) = (p[0].z.min(p[1].z).min(p[2].z) - error, p[0].z.max(p[1].z).max(p[2].z) + error);
    let keys = [lens.farthest_key(deepest), lens.nearest_key(nearest)];
    if lens.is_before_near(deepest) || keys[1] < lens.key_far {
        return None;
    }
    let rect = match lens.beyond(&p, nearest, error) {
        Some(rect) => rect,
        None => sides(lens, &p, error).iter().fold(Rect::EMPTY, |all, r| all.join(r)),
    };
    rect.overlaps(&lens.image).then_some((rect, keys))
}

fn sides(lens: &Lens, p: &[DVec3; 3], error: f64) -> [Rect; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(a, b)| lens.segment(p[a], p[b], error))
}

#[derive(Debug, Clone)]
pub struct Facet {
    pub triangle: u32,
    /// It is drawn, hides what is behind it, and is not too near to edge-on.
    pub blocks: bool,
    /// Clockwise as seen.
    pub turned: bool,
    /// Orientation is certain: sides and key may be asked.
    solid: bool,
    /// Function k belongs to the side opposite corner k; positive inside.
    edges: [[f64; 3]; 3],
    edge_bounds: [f64; 3],
    key: [f64; 3],
    key_bound: f64,
    /// Certain bounds of the key over the whole triangle.
    key_min: f64,
    key_max: f64,
    pub rect: Rect,
    sides: [Rect; 3],
}

impl Facet {
    pub fn new(lens: &Lens, mesh: &Mesh, t: u32, signs: &mut Signs) -> Facet {
        let corners = mesh.corners(t);
        let p = corners.map(|c| lens.to_camera(c));
        let size = p.map(DVec3::length);
        let error = 8.0 * U * (size[0] + size[1] + size[2]);
        let sides = sides(lens, &p, error);
        let mut facet = Facet {
            triangle: t,
            blocks: false,
            turned: false,
            solid: false,
            edges: [[0.0; 3]; 3],
            edge_bounds: [0.0; 3],
            key: [0.0; 3],
            key_bound: 0.0,
            key_min: lens.farthest_key(p[0].z.max(p[1].z).max(p[2].z) + error),
            key_max: lens.nearest_key(p[0].z.min(p[1].z).min(p[2].z) - error),
            rect: sides.iter().fold(Rect::EMPTY, |all, r| all.join(r)),
            sides,
        };
        facet.set_up(lens, &p, size);
        facet.blocks = facet.solid && mesh.is_occluder(t) && is_drawn(lens, mesh, t, &corners, signs);
        facet
    }

    fn set_up(&mut self, lens: &Lens, p: &[DVec3; 3], size: [f64; 3]) {
        let flat = |c: DVec3| if lens.perspective { c } else { DVec3::new(c.x, c.y, 1.0) };
        let q = p.map(flat);
        let (l1, l2) = (p[1] - p[0], p[2] - p[0]);
        let normal = l1.cross(l2);
        let normal_bound = 24.0 * U * size[0].max(size[1]).max(size[2]) * (l1.length() + l2.length());
        let volume = normal.dot(p[0]);
        let volume_bound = 1.01 * size[0] * (normal_bound + 12.0 * U * normal.length());
        // The key is a linear numerator over a constant.
        let (scale, scale_bound, numerator, numerator_bound) = match lens.perspective {
            true => (volume, volume_bound, normal, normal_bound),
            false => (normal.z, normal_bound, DVec3::new(normal.x, normal.y, -volume), normal_bound + volume_bound),
        };
        let (bulk, sign) = (scale.abs(), if scale < 0.0 { -1.0 } else { 1.0 });
        self.turned = scale < 0.0;
        // The tiny summand covers products that underflow.
        if !(bulk > 4.0 * scale_bound + 1e-280 && bulk.is_finite()) {
            return;
        }
        for (k, (a, b)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            self.edges[k] = (q[a].cross(q[b]) * sign).to_array();
            let (qa, qb) = (q[a].length(), q[b].length());
            self.edge_bounds[k] = 16.0 * U * (size[a] * qb + qa * size[b] + qa * qb) + 1e-290;
        }
        self.key = (numerator * sign / bulk).to_array();
        let coefficients = numerator.abs().element_sum();
        self.key_bound =
            1.01 * (1.4 * numerator_bound + (1.4 * scale_bound / bulk + 8.0 * U) * coefficients) / bulk + 1e-290;
        self.solid = self.key_bound.is_finite() && self.key.iter().all(|k| k.is_finite());
    }

    /// On which side of side `k` the ray at a point of the image passes: positive is inside.
    pub fn side(&self, k: usize, at: [f64; 2], lens: &Lens, mesh: &Mesh, signs: &mut Signs) -> i8 {
        signs.asked += 1;
        let [cx, cy, c] = self.edges[k];
        let value = cx * at[0] + (cy * at[1] + c);
        let bound = self.edge_bounds[k] * (at[0].abs() + at[1].abs() + 1.0);
        if value > bound {
            return 1;
        }
        if value < -bound {
            return -1;
        }
        signs.exact += 1;
        let corners = mesh.corners(self.triangle);
        let ends = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
        let sign = exact::sign_on_image(ends, lens.eye, &lens.basis, lens.perspective, at);
        match (sign, self.turned) {
            (Ordering::Equal, _) => 0,
            (Ordering::Greater, false) | (Ordering::Less, true) => 1,
            _ => -1,
        }
    }

    /// Holds the point of the image, borders included.
    pub fn covers(&self, at: [f64; 2], lens: &Lens, mesh: &Mesh, signs: &mut Signs) -> bool {
        self.solid && self.rect.holds(at) && (0..3).all(|k| self.side(k, at, lens, mesh, signs) >= 0)
    }

    /// Has no point in the frustum, borders included.
    pub fn avoids(&self, cell: &Rect, lens: &Lens, mesh: &Mesh, signs: &mut Signs) -> bool {
        if !self.rect.overlaps(cell) {
            return true;
        }
        let corners = cell.corners();
        let mut beyond = |k: usize| corners.iter().all(|at| self.side(k, *at, lens, mesh, signs) < 0);
        self.solid && !self.rect.within(cell) && (0..3).any(&mut beyond)
    }

    /// Whether side `k` may have a point within the frustum, borders excluded: its line
    /// passes between the four rays, and the segment is there.
    pub fn enters(&self, k: usize, cell: &Rect, lens: &Lens, mesh: &Mesh, signs: &mut Signs) -> bool {
        if !self.sides[k].overlaps(cell) {
            return false;
        }
        let (mut inside, mut outside) = (false, false);
        for at in cell.corners() {
            let side = self.side(k, at, lens, mesh, signs);
            inside |= side > 0;
            outside |= side < 0;
            if inside && outside {
                return true;
            }
        }
        false
    }

    /// Of its part in the frustum nothing is nearer than the near plane, where it would hide
    /// nothing. ([`Facet::rect`] leaves out that part, so the plane is asked, not the clip.)
    pub fn is_beyond_near(&self, cell: &Rect, lens: &Lens) -> bool {
        self.key_max <= lens.key_clear || self.plane_key_over(cell)[1] <= lens.key_clear
    }

    /// Bounds of the key over the part of a rectangle that it covers, beyond the near plane.
    pub fn key_over(&self, r: &Rect) -> [f64; 2] {
        if !self.solid {
            return [self.key_min, self.key_max];
        }
        let [lo, hi] = self.plane_key_over(&r.meet(&self.rect));
        [lo.max(self.key_min), hi.min(self.key_max)]
    }

    /// Bounds of the key of its plane over a rectangle.
    pub fn plane_key_over(&self, r: &Rect) -> [f64; 2] {
        let [kx, ky, k] = self.key;
        let ([ax, bx], [ay, by]) = ([kx * r.lo[0], kx * r.hi[0]], [ky * r.lo[1], ky * r.hi[1]]);
        let bound = self.key_bound * r.reach();
        [ax.min(bx) + (ay.min(by) + k) - bound, ax.max(bx) + (ay.max(by) + k) + bound]
    }
}
