//! The occluders of a scene: convex polygons of its triangles, prepared once.

use super::merge::{FLAT, Face, Mesh};
use crate::hierarchy::NONE;
use crate::math::DVec3;
use crate::scene::Scene;
use std::collections::HashMap;

/// A convex polygon that hides what is behind it.
#[derive(Debug, Clone)]
pub struct Polygon {
    /// Its corners in [`Polygons::corners`].
    pub first: u32,
    pub end: u32,
    /// Unit; the polygon is counter-clockwise seen from there.
    pub normal: DVec3,
    pub centroid: DVec3,
    pub area_m2: f64,
    pub radius_m: f64,
    /// Sine of the largest angle between `normal` and that of a triangle of it.
    pub spread: f64,
    /// Its outline may lie outside of the triangles by so much.
    pub slack_m: f64,
    pub two_sided: bool,
}

/// A corner, and what names the edge from it to the next: equal for two polygons if the
/// same vertices lie along it, so that nothing can be seen between them.
#[derive(Debug, Clone, Copy)]
pub struct Corner {
    pub at: DVec3,
    pub edge: u64,
    /// The edge goes from the lower to the higher end, by number.
    pub ascending: bool,
}

/// No other polygon shares the edge.
pub const UNSHARED: u64 = 0;

#[derive(Debug, Default)]
pub struct Polygons {
    pub all: Vec<Polygon>,
    corners: Vec<Corner>,
    /// By triangle its polygon, or [`NONE`].
    pub of_triangle: Vec<u32>,
}

/// More corners give more planes than they hide; every so-many-th is kept then.
const MOST_CORNERS: usize = 12;
/// Triangles with a smaller height over their longest side have no normal to rely on.
const SLIVER: f64 = 1e-6;
/// Sine of a turn below which a corner is none.
const STRAIGHT: f64 = 1e-9;

impl Polygons {
    /// Of all triangles that hide; with `merge`, neighbours in one plane are one polygon.
    pub fn of(scene: &Scene, merge: bool) -> Polygons {
        let magnitude = scene.positions.iter().fold(0.0f64, |m, p| m.max(p.abs().max_element()));
        let hair_m = 4.0 * f64::EPSILON * magnitude;
        let triangles = welded(scene);
        let normals: Vec<DVec3> = (0..scene.len() as u32).map(|t| unit_normal(scene, t)).collect();
        let kinds: Vec<u8> = scene.two_sided.iter().map(|b| u8::from(*b)).collect();
        let mesh = Mesh { points: &scene.positions, triangles: &triangles, normals: &normals, kinds: &kinds, hair_m };
        let mut out = Polygons { of_triangle: vec![NONE; scene.len()], ..Polygons::default() };
        for face in mesh.faces(merge) {
            out.add(&mesh, &face, magnitude);
        }
        out
    }

    pub fn corners(&self, polygon: &Polygon) -> &[Corner] {
        &self.corners[polygon.first as usize..polygon.end as usize]
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.all[..]) + size_of_val(&self.corners[..]) + size_of_val(&self.of_triangle[..])
    }

    fn add(&mut self, mesh: &Mesh, face: &Face, magnitude: f64) {
        let points: Vec<DVec3> = face.around.iter().map(|h| mesh.points[mesh.from(*h) as usize]).collect();
        let n = points.len();
        let anchor = points[0];
        let across = |i: usize| (points[i] - anchor).cross(points[i + 1] - anchor);
        let twice: DVec3 = (1..n - 1).map(across).sum();
        let normal = twice.normalize_or_zero();
        let turn = |i: usize| {
            let [p, v, q] = [i + n - 1, i, i + 1].map(|k| points[k % n]);
            (v - p).normalize_or_zero().cross((q - v).normalize_or_zero()).dot(normal)
        };
        let kept: Vec<usize> = (0..n).filter(|i| turn(*i) > STRAIGHT).collect();
        if normal == DVec3::ZERO || kept.len() < 3 {
            return;
        }
        // How far vertices between the corners lie inside of the outline.
        let slack_m = (0..kept.len()).fold(0.0f64, |most, k| {
            let (a, b) = (kept[k], kept[(k + 1) % kept.len()]);
            let along = (points[b] - points[a]).normalize_or_zero();
            let between = (1..(b + n - a) % n).map(|i| points[(a + i) % n] - points[a]);
            between.fold(most, |m, v| m.max(along.cross(v).dot(normal)))
        });
        let rounding = 4.0 * f64::EPSILON * magnitude;
        if slack_m > 4.0 * rounding {
            return;
        }
        // Out of the plane, too.
        let slack_m = slack_m + if face.triangles.len() > 1 { 2.0 * FLAT * mesh.hair_m } else { 0.0 };
        let first = self.corners.len() as u32;
        let step = kept.len().div_ceil(MOST_CORNERS);
        let chosen: Vec<usize> = kept.iter().step_by(step).copied().collect();
        for (k, a) in chosen.iter().enumerate() {
            let b = chosen[(k + 1) % chosen.len()];
            let chain: Vec<u32> = (0..=(b + n - a) % n).map(|i| mesh.from(face.around[(a + i) % n])).collect();
            let ascending = chain[0] < chain[chain.len() - 1];
            let edge = if step == 1 { name(&chain) } else { UNSHARED };
            self.corners.push(Corner { at: points[*a], edge, ascending });
        }
        let centroid = centroid(&points, normal);
        // Rounding of the normal of the flattest triangle that takes part.
        let height_m = face.triangles.iter().fold(f64::INFINITY, |m, t| m.min(least_height(mesh, *t)));
        let spread = face.triangles.iter().fold(0.0f64, |m, t| m.max(normal.cross(mesh.normals[*t as usize]).length()));
        let number = self.all.len() as u32;
        face.triangles.iter().for_each(|t| self.of_triangle[*t as usize] = number);
        self.all.push(Polygon {
            first,
            end: self.corners.len() as u32,
            normal,
            centroid,
            area_m2: twice.length() * 0.5,
            radius_m: points.iter().fold(0.0, |m, p| m.max(p.distance(centroid))),
            spread: spread + 4.0 * rounding / height_m + 1e-14,
            slack_m,
            two_sided: mesh.kinds[face.triangles[0] as usize] == 1,
        });
    }
}

/// Vertices at one place get one number.
fn welded(scene: &Scene) -> Vec<[u32; 3]> {
    let mut first = HashMap::with_capacity(scene.positions.len());
    // Adding zero makes both zeros one.
    let key = |p: &DVec3| (*p + 0.0).to_array().map(f64::to_bits);
    let number: Vec<u32> = (0u32..).zip(&scene.positions).map(|(i, p)| *first.entry(key(p)).or_insert(i)).collect();
    scene.triangles.iter().map(|t| t.map(|v| number[v as usize])).collect()
}

/// Zero of what hides nothing or has no normal to rely on.
fn unit_normal(scene: &Scene, t: u32) -> DVec3 {
    let [a, b, c] = scene.corners(t);
    let normal = (b - a).cross(c - a);
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let trusted = scene.occluder[t as usize] && normal.length() > SLIVER * longest;
    if trusted { normal.normalize_or_zero() } else { DVec3::ZERO }
}

fn least_height(mesh: &Mesh, t: u32) -> f64 {
    let [a, b, c] = mesh.triangles[t as usize].map(|v| mesh.points[v as usize]);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    (b - a).cross(c - a).length() / longest
}

fn centroid(points: &[DVec3], normal: DVec3) -> DVec3 {
    let anchor = points[0];
    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
    for pair in points[1..].windows(2) {
        let (u, v) = (pair[0] - anchor, pair[1] - anchor);
        let area = u.cross(v).dot(normal);
        (sum, weight) = (sum + (u + v) / 3.0 * area, weight + area);
    }
    anchor + sum / weight
}

/// A number for a chain of vertices, from whichever end: two that differ get the same by
/// a chance of 2^-64 only.
fn name(chain: &[u32]) -> u64 {
    let mix = |h: u64, v: u32| {
        let x = (h ^ u64::from(v)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (x ^ x >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) ^ x >> 32
    };
    let start = chain.len() as u64 + 1;
    let hash = match chain[0] < chain[chain.len() - 1] {
        true => chain.iter().fold(start, |h, v| mix(h, *v)),
        false => chain.iter().rev().fold(start, |h, v| mix(h, *v)),
    };
    hash.max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::Spec;
    use crate::scene::generate;

    #[test]
    fn polygons_of_a_town_are_walls() {
        let scene = generate::make(&Spec::parse("blocks").unwrap()).unwrap().0.generate();
        let [walls, single] = [true, false].map(|merge| Polygons::of(&scene, merge));
        assert_eq!(single.all.len(), scene.len());
        assert!(walls.all.len() * 3 < scene.len() * 2, "{} of {}", walls.all.len(), scene.len());
        let area = |p: &Polygons| p.all.iter().map(|p| p.area_m2).sum::<f64>();
        assert!((area(&walls) / area(&single) - 1.0).abs() < 1e-6, "nothing is gained or lost");
        for p in &walls.all {
            let corners = walls.corners(p);
            assert!((3..=MOST_CORNERS).contains(&corners.len()));
            assert!(corners.iter().all(|c| (c.at - p.centroid).dot(p.normal).abs() <= 1e-3 * p.radius_m));
        }
    }

    #[test]
    fn an_edge_has_one_name_from_both_sides() {
        assert_eq!(name(&[3, 9, 4]), name(&[4, 9, 3]));
        assert_ne!(name(&[3, 4]), name(&[3, 9, 4]));
        assert_ne!(name(&[3, 4]), name(&[4, 5]));
    }
}
