//! Neighbouring triangles that lie in one plane, merged to convex polygons, so that a
//! wall is one occluder.
//!
//! Polygons merge across all edges that they share, the longest first: two triangles to
//! a quad, quads to a row, rows to a wall. Only edges between exactly two triangles of
//! one kind that turn the same way round are merged across, so no crack can lie inside.

use crate::hierarchy::NONE;
use crate::math::DVec3;

/// Half-edge `3 t + k` goes from corner `k` of triangle `t` to the next.
pub struct Mesh<'a> {
    pub points: &'a [DVec3],
    /// Numbers of points; equal ones stand for equal points.
    pub triangles: &'a [[u32; 3]],
    /// Unit normals; zero of triangles that take no part.
    pub normals: &'a [DVec3],
    /// What must be alike.
    pub kinds: &'a [u8],
    /// Rounding of a coordinate.
    pub hair_m: f64,
}

/// A face: half-edges around it, and its triangles.
#[derive(Debug, Default, Clone)]
pub struct Face {
    pub around: Vec<u32>,
    pub triangles: Vec<u32>,
}

/// Normals of one face differ by less (cosine): half a milliradian from the first.
const ONE_PLANE: f64 = 1.0 - 1.25e-7;
/// Vertices of one face are as near to the plane of its first triangle, in roundings of a coordinate.
pub const FLAT: f64 = 8.0;
/// Half-edges around a face: a limit to the work of one merge.
const MOST_AROUND: usize = 256;
const MOST_ROUNDS: usize = 16;

impl Mesh<'_> {
    pub fn from(&self, half_edge: u32) -> u32 {
        self.triangles[half_edge as usize / 3][half_edge as usize % 3]
    }

    pub fn to(&self, half_edge: u32) -> u32 {
        self.triangles[half_edge as usize / 3][(half_edge as usize + 1) % 3]
    }

    fn point(&self, half_edge: u32) -> DVec3 {
        self.points[self.from(half_edge) as usize]
    }

    /// Faces of all triangles that take part, one each or, with `merge`, as few as greed finds.
    pub fn faces(&self, merge: bool) -> Vec<Face> {
        let part = |t: &u32| self.normals[*t as usize] != DVec3::ZERO;
        let single = |t: u32| Face { around: vec![3 * t, 3 * t + 1, 3 * t + 2], triangles: vec![t] };
        let count = self.triangles.len() as u32;
        if !merge {
            return (0..count).filter(part).map(single).collect();
        }
        let twins = self.twins();
        let mut faces: Vec<Face> = (0..count).map(|t| if part(&t) { single(t) } else { Face::default() }).collect();
        let mut owner: Vec<u32> = (0..count).collect();
        // Only what has a partner at all.
        let mut open: Vec<u32> = (0..count).filter(|t| (0..3).any(|k| twins[(3 * t + k) as usize] != NONE)).collect();
        for _ in 0..MOST_ROUNDS {
            let mut merged = false;
            for face in &open {
                while let Some((other, joined)) = self.partner(*face, &faces, &twins, &owner) {
                    let triangles = std::mem::take(&mut faces[other as usize]).triangles;
                    triangles.iter().for_each(|t| owner[*t as usize] = *face);
                    faces[*face as usize].triangles.extend(triangles);
                    faces[*face as usize].around = joined;
                    merged = true;
                }
            }
            if !merged {
                break;
            }
            open.retain(|f| !faces[*f as usize].triangles.is_empty());
        }
        faces.retain(|f| !f.triangles.is_empty());
        faces
    }

    /// By half-edge, the one on the other side, if they may merge.
    fn twins(&self) -> Vec<u32> {
        let mut edges: Vec<(u32, u32, u32)> = (0..3 * self.triangles.len() as u32)
            .map(|h| (self.from(h), self.to(h), h))
            .map(|(a, b, h)| (a.min(b), a.max(b), h))
            .collect();
        edges.sort_unstable();
        let mut twins = vec![NONE; edges.len()];
        for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let [(.., g), (.., h)] = *same else { continue };
            let [s, t] = [g, h].map(|e| e as usize / 3);
            if self.from(g) == self.to(h)
                && self.kinds[s] == self.kinds[t]
                && self.normals[s].dot(self.normals[t]) >= ONE_PLANE
            {
                (twins[g as usize], twins[h as usize]) = (h, g);
            }
        }
        twins
    }

    /// The best face to merge `face` with, and what is then around both.
    fn partner(&self, face: u32, faces: &[Face], twins: &[u32], owner: &[u32]) -> Option<(u32, Vec<u32>)> {
        let around = &faces[face as usize].around;
        let beyond = |h: &u32| match twins[*h as usize] {
            NONE => NONE,
            twin => owner[twin as usize / 3],
        };
        // Neighbours by the length of what is shared with them.
        let mut shared: Vec<(f64, u32)> = Vec::new();
        for h in around {
            let other = beyond(h);
            if other == NONE || other == face {
                continue;
            }
            let length = self.points[self.from(*h) as usize].distance(self.points[self.to(*h) as usize]);
            match shared.iter_mut().find(|(_, o)| *o == other) {
                Some((sum, _)) => *sum += length,
                None => shared.push((length, other)),
            }
        }
        shared.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let normal = self.normals[face as usize];
        let height = normal.dot(self.point(3 * face));
        let flat =
            |t: &u32| (3 * t..3 * t + 3).all(|h| (normal.dot(self.point(h)) - height).abs() <= FLAT * self.hair_m);
        let fits = |other: u32| {
            let more = &faces[other as usize].around;
            // One plane for all of both, or what hides would not lie where it seems to.
            if !faces[other as usize].triangles.iter().all(flat) {
                return None;
            }
            if self.normals[other as usize].dot(normal) < ONE_PLANE || around.len() + more.len() > MOST_AROUND {
                return None;
            }
            let mine = rest(around, |h| beyond(h) == other)?;
            let theirs = rest(more, |h| beyond(h) == face)?;
            // One line of edges, the same from both sides.
            let ends = |own: &[u32]| (self.from(own[0]), self.to(own[own.len() - 1]));
            let ((a, b), (c, d)) = (ends(&mine), ends(&theirs));
            let alike = around.len() - mine.len() == more.len() - theirs.len();
            let joined = [mine, theirs].concat();
            let seam = around.len() + more.len() - joined.len();
            let corner = |h: usize| {
                let n = joined.len();
                let [p, v, q] = [h + n - 1, h, h + 1].map(|i| self.point(joined[i % n]));
                self.turns_left(p, v, q, normal)
            };
            let first_of_theirs = around.len() - seam / 2;
            (alike && a == d && b == c && corner(0) && corner(first_of_theirs)).then_some((other, joined))
        };
        shared.iter().find_map(|(_, other)| fits(*other))
    }

    /// Left, or straight on as far as rounding can tell; never back.
    fn turns_left(&self, p: DVec3, v: DVec3, q: DVec3, normal: DVec3) -> bool {
        let (a, b) = (v - p, q - v);
        let turn = a.cross(b).dot(normal);
        let straight = self.hair_m * (a.length() + b.length());
        turn > straight || (turn >= -straight && a.dot(b) > 0.0)
    }
}

/// What is left of a loop without the one run that `shared` is true of, starting after it.
fn rest(around: &[u32], shared: impl Fn(&u32) -> bool) -> Option<Vec<u32>> {
    let n = around.len();
    let starts = |i: usize| !shared(&around[i]) && shared(&around[(i + n - 1) % n]);
    let mut found = (0..n).filter(|i| starts(*i));
    let (start, None) = (found.next()?, found.next()) else { return None };
    Some((0..n).map(|i| around[(start + i) % n]).take_while(|h| !shared(h)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of `n` x `n` quads in the plane z = 0, each two triangles.
    fn grid(n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let points = (0..=n).flat_map(|y| (0..=n).map(move |x| DVec3::new(f64::from(x), f64::from(y), 0.0))).collect();
        let at = |x: u32, y: u32| y * (n + 1) + x;
        let quad = |x: u32, y: u32| {
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            [[a, b, c], [a, c, d]]
        };
        (points, (0..n).flat_map(|y| (0..n).flat_map(move |x| quad(x, y))).collect())
    }

    fn faces(points: &[DVec3], triangles: &[[u32; 3]], kinds: &[u8]) -> Vec<Face> {
        let normal = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|p| points[p as usize]);
            (b - a).cross(c - a).normalize()
        };
        let normals: Vec<DVec3> = triangles.iter().map(normal).collect();
        Mesh { points, triangles, normals: &normals, kinds, hair_m: 1e-14 }.faces(true)
    }

    #[test]
    fn a_wall_of_many_quads_is_one_face() {
        for n in [1, 2, 5, 8] {
            let (points, triangles) = grid(n);
            let found = faces(&points, &triangles, &vec![0; triangles.len()]);
            assert_eq!(found.len(), 1, "{n}");
            assert_eq!(found[0].around.len() as u32, 4 * n);
            assert_eq!(found[0].triangles.len(), triangles.len());
        }
    }

    #[test]
    fn faces_stay_convex_in_one_plane_and_of_one_kind() {
        let (mut points, triangles) = grid(4);
        let other: Vec<u8> = (0..32).map(|t| u8::from(t < 8)).collect();
        assert_eq!(faces(&points, &triangles, &other).len(), 2, "two kinds");
        // A quad less: no convex face can go around the hole.
        let holed: Vec<[u32; 3]> = triangles.iter().enumerate().filter(|(t, _)| t / 2 != 5).map(|(_, t)| *t).collect();
        let found = faces(&points, &holed, &[0; 30]);
        assert!(found.len() > 1);
        for f in &found {
            let at = |h: &u32| points[holed[*h as usize / 3][*h as usize % 3] as usize];
            let n = f.around.len();
            for i in 0..n {
                let [p, v, q] = [i, i + 1, i + 2].map(|k| at(&f.around[k % n]));
                assert!((v - p).cross(q - v).z >= 0.0);
            }
        }
        // A fold.
        points.iter_mut().filter(|p| p.x > 2.0).for_each(|p| p.z = 0.1 * (p.x - 2.0));
        assert_eq!(faces(&points, &triangles, &[0; 32]).len(), 2);
        // However slight: what lies in the crease is in plain sight.
        points.iter_mut().filter(|p| p.x > 2.0).for_each(|p| p.z = 2e-4 * (p.x - 2.0));
        assert_eq!(faces(&points, &triangles, &[0; 32]).len(), 2);
    }
}
