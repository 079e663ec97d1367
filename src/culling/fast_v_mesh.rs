//! The surface that [`super::fast_v`] grows its blockers over: triangles welded by exact
//! position, and for every side the next triangle around the same edge.
//!
//! Files and generators repeat vertices (a normal or a texture coordinate differs), so
//! indices say nothing of what is connected; equal coordinates do, bit by bit but for the
//! sign of zero. Nothing is moved: what is not welded exactly stays apart.
//!
//! Triangles and corners are numbered in the order in which the structure has them, so that
//! what lies together in space does so in memory.

use crate::hierarchy::NONE;
use crate::math::DVec3;
use crate::scene::Scene;
use rayon::prelude::*;

const TWO_SIDED: u8 = 1;
const OCCLUDER: u8 = 2;

#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// By position in the structure: the triangle, numbered by first position.
    of: Vec<u32>,
    /// Each place once.
    points: Vec<DVec3>,
    corners: Vec<[u32; 3]>,
    /// By side `3 t + k` (opposite corner `k`): the next side at the same edge, round and
    /// round; itself at a free edge.
    ring: Vec<u32>,
    flags: Vec<u8>,
}

impl Mesh {
    /// `entries`: by position in the structure, the triangle of the scene.
    pub fn new(scene: &Scene, entries: &[u32]) -> Mesh {
        let mut mesh = Mesh::default();
        let welded = weld(&scene.positions);
        let mut numbers = [vec![NONE; scene.len()], vec![NONE; scene.positions.len()]];
        for t in entries {
            let (number, next) = (&mut numbers[0][*t as usize], mesh.corners.len() as u32);
            if *number == NONE {
                *number = next;
                let corners = scene.triangles[*t as usize].map(|v| {
                    let first = welded[v as usize] as usize;
                    if numbers[1][first] == NONE {
                        numbers[1][first] = mesh.points.len() as u32;
                        mesh.points.push(scene.positions[first]);
                    }
                    numbers[1][first]
                });
                mesh.corners.push(corners);
                let flag = |on: bool, bit: u8| if on { bit } else { 0 };
                let (two_sided, occluder) = (scene.two_sided[*t as usize], scene.occluder[*t as usize]);
                mesh.flags.push(flag(two_sided, TWO_SIDED) | flag(occluder, OCCLUDER));
            }
            mesh.of.push(numbers[0][*t as usize]);
        }
        mesh.ring = rings(&mesh.corners);
        mesh
    }

    pub fn len(&self) -> usize {
        self.corners.len()
    }

    #[inline]
    pub fn triangle_at(&self, position: u32) -> u32 {
        self.of[position as usize]
    }

    #[inline]
    pub fn corners(&self, t: u32) -> [DVec3; 3] {
        self.corners[t as usize].map(|v| self.points[v as usize])
    }

    pub fn is_two_sided(&self, t: u32) -> bool {
        self.flags[t as usize] & TWO_SIDED != 0
    }

    pub fn is_occluder(&self, t: u32) -> bool {
        self.flags[t as usize] & OCCLUDER != 0
    }

    /// The other triangles at side `k` of `t`, and whether each runs along the edge in the
    /// same direction (as it does not where neighbours are wound alike).
    pub fn across(&self, t: u32, k: usize) -> impl Iterator<Item = (u32, bool)> + '_ {
        let from = 3 * t + k as u32;
        let start = self.start(from);
        let next = move |side: &u32| Some(self.ring[*side as usize]).filter(|s| *s != from);
        std::iter::successors(next(&from), next).map(move |side| (side / 3, self.start(side) == start))
    }

    fn start(&self, side: u32) -> u32 {
        self.corners[side as usize / 3][(side as usize + 1) % 3]
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.of[..])
            + size_of_val(&self.points[..])
            + size_of_val(&self.corners[..])
            + size_of_val(&self.ring[..])
            + size_of_val(&self.flags[..])
    }
}

/// For every position the first that equals it.
fn weld(positions: &[DVec3]) -> Vec<u32> {
    // Adding zero makes the negative zero positive.
    let bits = |v: u32| positions[v as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|v| (bits(*v), *v));
    let mut welded = vec![0; positions.len()];
    let mut first = 0;
    for (i, v) in order.iter().enumerate() {
        if i == 0 || bits(*v) != bits(first) {
            first = *v;
        }
        welded[*v as usize] = first;
    }
    welded
}

fn rings(corners: &[[u32; 3]]) -> Vec<u32> {
    let edge = |side: u32| {
        let t = corners[side as usize / 3];
        let (a, b) = (t[(side as usize + 1) % 3], t[(side as usize + 2) % 3]);
        (a.min(b), a.max(b), side)
    };
    let mut sides: Vec<(u32, u32, u32)> = (0..3 * corners.len() as u32).map(edge).collect();
    sides.par_sort_unstable();
    let mut ring: Vec<u32> = (0..sides.len() as u32).collect();
    for group in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        // A side between equal corners is no edge.
        if group[0].0 != group[0].1 {
            for (i, (_, _, side)) in group.iter().enumerate() {
                ring[*side as usize] = group[(i + 1) % group.len()].2;
            }
        }
    }
    ring
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Scene {
        // Two triangles of a square with six vertices of their own, wound alike, and a
        // third one at the diagonal.
        let [a, b, c, d] = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        Scene {
            positions: vec![a, b, c, DVec3::new(-0.0, 0.0, -0.0), c, d, a, c, DVec3::Z],
            triangles: vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]],
            two_sided: vec![false; 3],
            occluder: vec![true; 3],
            ..Scene::default()
        }
    }

    #[test]
    fn equal_positions_are_one_corner_and_edges_know_who_meets_there() {
        let mesh = Mesh::new(&square(), &[0, 1, 2, 1]);
        // a-c is opposite corner 1 of the first, opposite 2 of the others.
        let mut met: Vec<_> = mesh.across(0, 1).collect();
        met.sort_unstable();
        assert_eq!(met, [(1, false), (2, false)], "both run from a to c, the first from c to a");
        assert_eq!((mesh.triangle_at(3), mesh.len(), mesh.points.len()), (1, 3, 5));
        assert_eq!(mesh.across(1, 2).find(|(t, _)| *t == 2), Some((2, true)));
        assert_eq!(mesh.across(0, 0).count() + mesh.across(0, 2).count(), 0, "free edges");
    }

    #[test]
    fn one_ulp_apart_is_not_connected() {
        let mut scene = square();
        scene.positions[4].x = scene.positions[4].x.next_up();
        scene.positions.truncate(6);
        scene.triangles.truncate(2);
        let mesh = Mesh::new(&scene, &[0, 1]);
        assert!((0..3).all(|k| mesh.across(0, k).count() == 0));
    }

    #[test]
    fn a_triangle_with_equal_corners_has_no_neighbour_there() {
        let mut scene = square();
        scene.triangles = vec![[0, 0, 1], [0, 0, 2]];
        let mesh = Mesh::new(&scene, &[0, 1]);
        assert_eq!(mesh.across(0, 2).count(), 0);
    }
}
