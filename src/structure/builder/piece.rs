//! Pieces of triangles: splitting at a plane, and boxes that hold the true piece
//! although the corners of a split are rounded.

use crate::math::{Aabb, DVec3};
use crate::scene::Scene;

/// A whole triangle, or what planes left of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    pub corners: [DVec3; 3],
    /// Triangle of the scene.
    pub triangle: u32,
    /// Bit per corner that a split made; its coordinates are rounded.
    pub made: u8,
}

/// A corner made by a split leaves its edge by at most 5 u M: 2 u M for the
/// difference of the ends, 2 u M for the product, u M for the sum (u = 2^-53,
/// M the largest coordinate; an error of the parameter slides it along the edge,
/// where the neighbour piece has the same corner). Ends made by earlier splits
/// hand their error on undiminished, so k splits leave at most 5 k u M; trees
/// here split at most 64 times on the way to a leaf.
const ROUNDING: f64 = 256.0 * f64::EPSILON;

/// Largest distance of a made corner from where exact splitting would put it
/// across its edge, for a triangle with coordinates up to `size_m`.
pub fn rounding_m(corners: &[DVec3; 3]) -> f64 {
    ROUNDING * corners.iter().fold(0.0, |m: f64, c| m.max(c.abs().max_element()))
}

impl Piece {
    pub fn whole(scene: &Scene, triangle: u32) -> Piece {
        Piece { corners: scene.corners(triangle), triangle, made: 0 }
    }

    /// A box around the exact piece: the corners' box, grown by the rounding of
    /// split corners, but never beyond the triangle it came from.
    pub fn bounds(&self, scene: &Scene) -> Aabb {
        let bounds = Aabb::of_points(&self.corners);
        if self.made == 0 {
            return bounds;
        }
        let whole = scene.corners(self.triangle);
        let grow = DVec3::splat(rounding_m(&whole));
        let limit = Aabb::of_points(&whole);
        Aabb { lo: (bounds.lo - grow).max(limit.lo), hi: (bounds.hi + grow).min(limit.hi) }
    }

    /// Not normalised: its length is twice the area.
    pub fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// Number of pieces in front and behind that [`Piece::split`] would make.
    pub fn split_counts(sides: [i8; 3]) -> (u32, u32) {
        match (sides.iter().filter(|s| **s > 0).count(), sides.iter().filter(|s| **s < 0).count()) {
            (1, 2) => (1, 2),
            (2, 1) => (2, 1),
            _ => (1, 1),
        }
    }

    /// Splits at a plane whose signed distances (of any common scale) from the
    /// corners are `d`, with `sides` their signs, both signs present. `snap`
    /// moves a new corner exactly into the plane where that is possible.
    /// Pieces keep the winding.
    pub fn split(
        &self,
        sides: [i8; 3],
        d: [f64; 3],
        snap: impl Fn(&mut DVec3),
        front: &mut Vec<Piece>,
        back: &mut Vec<Piece>,
    ) {
        let p = self.corners;
        let made = |i: usize| self.made >> i & 1;
        // From the back end to the front end, so that both triangles at an edge
        // make the same corner to the bit.
        let crossing = |i: usize, j: usize| {
            let (i, j) = if sides[i] < 0 { (i, j) } else { (j, i) };
            let t = (d[i] / (d[i] - d[j])).clamp(0.0, 1.0);
            let mut q = p[i] + (p[j] - p[i]) * t;
            snap(&mut q);
            q.clamp(p[i].min(p[j]), p[i].max(p[j]))
        };
        let mut put = |side: i8, corners: [DVec3; 3], made: u8| {
            let list = if side > 0 { &mut *front } else { &mut *back };
            list.push(Piece { corners, triangle: self.triangle, made });
        };
        if let Some(z) = sides.iter().position(|s| *s == 0) {
            let (i, j) = ((z + 1) % 3, (z + 2) % 3);
            let q = crossing(i, j);
            put(sides[i], [p[z], p[i], q], made(z) | made(i) << 1 | 4);
            put(sides[j], [p[z], q, p[j]], made(z) | 2 | made(j) << 2);
            return;
        }
        let sum: i8 = sides.iter().sum();
        let a = sides.iter().position(|s| *s == -sum).expect("one corner is alone on its side");
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        let (q, r) = (crossing(a, b), crossing(a, c));
        put(sides[a], [p[a], q, r], made(a) | 2 | 4);
        // The shorter diagonal of the quadrilateral q b c r makes fatter pieces.
        if q.distance_squared(p[c]) <= r.distance_squared(p[b]) {
            put(sides[b], [q, p[b], p[c]], 1 | made(b) << 1 | made(c) << 2);
            put(sides[b], [q, p[c], r], 1 | made(c) << 1 | 4);
        } else {
            put(sides[b], [q, p[b], r], 1 | made(b) << 1 | 4);
            put(sides[b], [p[b], p[c], r], made(b) | made(c) << 1 | 4);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        (-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn splitting_keeps_area_winding_and_sides(a in point(), b in point(), c in point(), at in -0.8..0.8f64, on in 0usize..4) {
            let mut corners = [a, b, c];
            if on < 3 { corners[on].x = at; }
            let piece = Piece { corners, triangle: 7, made: 0 };
            let d = corners.map(|p| p.x - at);
            let sides = d.map(|d| i8::from(d > 0.0) - i8::from(d < 0.0));
            prop_assume!(sides.contains(&1) && sides.contains(&-1));
            let (mut front, mut back) = (Vec::new(), Vec::new());
            piece.split(sides, d, |q| q.x = at, &mut front, &mut back);
            prop_assert_eq!((front.len() as u32, back.len() as u32), Piece::split_counts(sides));
            let normal = piece.normal();
            let mut area = 0.0;
            for p in front.iter().chain(&back) {
                prop_assert!(p.normal().dot(normal) >= -1e-15, "winding");
                area += p.normal().length();
            }
            prop_assert!((area - normal.length()).abs() <= 1e-12);
            prop_assert!(front.iter().all(|p| p.corners.iter().all(|c| c.x >= at)));
            prop_assert!(back.iter().all(|p| p.corners.iter().all(|c| c.x <= at)));
            for p in front.iter().chain(&back) {
                for (i, c) in p.corners.iter().enumerate() {
                    prop_assert_eq!(corners.contains(c), p.made >> i & 1 == 0, "made corners are marked");
                }
            }
        }
    }
}
