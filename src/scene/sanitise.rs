//! What may not reach a culling method is dropped on load, counted by reason and
//! reported: faces with NaN or infinite corners, corners out of range, and faces
//! without area. `source_triangle_id` keeps the numbers of the file.

use super::Scene;
use crate::math::DVec3;
use glam::DVec2;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::hash::{BuildHasherDefault, Hasher};

/// Largest coordinate, metres: six times the distance to the sun. Beyond, squares
/// of products in f64 lose millimetres and f32 offsets lose kilometres.
pub const MAX_COORDINATE_M: f64 = 1e12;

/// Drops what must not be used and then the vertices that nothing uses.
/// The counts go to `scene.report`, with a sentence if anything was dropped.
pub fn sanitise(scene: &mut Scene) {
    let (mut non_finite, mut out_of_range, mut degenerate) = (0u64, 0u64, 0u64);
    let keep: Vec<bool> = scene
        .triangles
        .iter()
        .map(|t| {
            let corners = t.map(|v| scene.positions[v as usize]);
            let largest = corners.iter().fold(0.0f64, |m, p| m.max(p.abs().max_element()));
            if !corners.iter().all(|p| p.is_finite()) {
                non_finite += 1;
            } else if largest > MAX_COORDINATE_M {
                out_of_range += 1;
            } else if has_no_area(&corners) {
                degenerate += 1;
            } else {
                return true;
            }
            false
        })
        .collect();
    let report = &mut scene.report;
    report.dropped_non_finite += non_finite;
    report.dropped_out_of_range += out_of_range;
    report.dropped_degenerate += degenerate;
    if non_finite + out_of_range + degenerate > 0 {
        let parts = [
            (non_finite, "with NaN or infinite coordinates"),
            (out_of_range, "farther than 1e12 m from the origin"),
            (degenerate, "without area"),
        ];
        let parts: Vec<_> = parts.iter().filter(|p| p.0 > 0).map(|(n, why)| format!("{n} {why}")).collect();
        report.warnings.push(format!("dropped faces: {}", parts.join(", ")));
        retain(&mut scene.triangles, &keep);
        retain(&mut scene.source_triangle_id, &keep);
        retain(&mut scene.object_id, &keep);
        retain(&mut scene.material_id, &keep);
        retain(&mut scene.two_sided, &keep);
        retain(&mut scene.occluder, &keep);
    }
    drop_unused_vertices(scene);
}

fn retain<T: Copy>(values: &mut Vec<T>, keep: &[bool]) {
    let mut flags = keep.iter();
    values.retain(|_| *flags.next().expect("one flag a face"));
}

/// Exactly zero area: three collinear or coinciding points. Decided by the signs
/// of three exact 2-D orientations (Shewchuk 1997), one for each projection;
/// all are zero iff the exact cross product is the zero vector.
pub fn has_no_area([a, b, c]: &[DVec3; 3]) -> bool {
    let flat = |p: DVec2, q: DVec2, r: DVec2| {
        let coord = |v: DVec2| robust::Coord { x: v.x, y: v.y };
        robust::orient2d(coord(p), coord(q), coord(r)) == 0.0
    };
    let project = |f: fn(&DVec3) -> DVec2| flat(f(a), f(b), f(c));
    project(|p| DVec2::new(p.x, p.y)) && project(|p| DVec2::new(p.y, p.z)) && project(|p| DVec2::new(p.x, p.z))
}

fn drop_unused_vertices(scene: &mut Scene) {
    let mut used = vec![false; scene.positions.len()];
    scene.triangles.iter().flatten().for_each(|v| used[*v as usize] = true);
    if used.iter().all(|u| *u) {
        return;
    }
    let mut next = 0;
    let new_index: Vec<u32> = used
        .iter()
        .map(|u| {
            next += u32::from(*u);
            next.wrapping_sub(1)
        })
        .collect();
    scene.triangles.iter_mut().flatten().for_each(|v| *v = new_index[*v as usize]);
    retain(&mut scene.positions, &used);
}

/// Joins vertices at exactly the same place. The first of them, in file order,
/// stays; faces and their order do not change.
pub fn weld(scene: &mut Scene) {
    let mut first_at: HashMap<[u64; 3], u32, BuildHasherDefault<BitsHasher>> = HashMap::default();
    first_at.reserve(scene.positions.len());
    let mut kept = 0u32;
    let new_index: Vec<u32> = (0..scene.positions.len())
        .map(|i| {
            let p = scene.positions[i];
            // -0 and +0 are one place.
            match first_at.entry((p + DVec3::ZERO).to_array().map(f64::to_bits)) {
                Entry::Occupied(e) => *e.get(),
                Entry::Vacant(e) => {
                    scene.positions[kept as usize] = p;
                    kept += 1;
                    *e.insert(kept - 1)
                }
            }
        })
        .collect();
    scene.report.vertices_welded += (scene.positions.len() - kept as usize) as u64;
    scene.positions.truncate(kept as usize);
    scene.triangles.iter_mut().flatten().for_each(|v| *v = new_index[*v as usize]);
}

/// Multiply-and-rotate over words: positions are trusted data of some millions, where SipHash shows.
#[derive(Default)]
struct BitsHasher(u64);

impl Hasher for BitsHasher {
    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 29)
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.write_u64(u64::from(*b)));
    }

    fn write_u64(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(23) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Scene {
        let n = triangles.len();
        Scene {
            positions: positions.iter().map(|p| DVec3::from_array(*p)).collect(),
            triangles: triangles.to_vec(),
            source_triangle_id: (0..n as u32).collect(),
            object_id: vec![0; n],
            material_id: vec![0; n],
            two_sided: vec![false; n],
            occluder: vec![true; n],
            ..Scene::default()
        }
    }

    #[test]
    fn each_bad_face_is_dropped_under_its_reason_and_ids_stay() {
        let corners = [
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [f64::NAN, 0.0, 0.0],
            [f64::INFINITY, 0.0, 0.0],
            [2e12, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
        ];
        let faces = [[0, 1, 3], [0, 1, 2], [0, 1, 4], [0, 1, 5], [0, 1, 1], [0, 1, 6], [1, 7, 2], [0, 2, 7]];
        let mut s = scene(&corners, &faces);
        sanitise(&mut s);
        assert_eq!(s.source_triangle_id, [1, 7]);
        let r = &s.report;
        assert_eq!((r.dropped_non_finite, r.dropped_out_of_range, r.dropped_degenerate), (2, 1, 3));
        assert_eq!(r.warnings.len(), 1);
        assert_eq!(s.positions.len(), 4, "unused vertices are gone: {:?}", s.positions);
        assert_eq!(s.triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn zero_area_is_decided_exactly() {
        // Collinear only in exact arithmetic: thirds of representable points are not representable.
        let at = |k: f64| DVec3::new(0.1, 0.7, -0.3) * k;
        assert!(has_no_area(&[at(1.0), at(2.0), at(4.0)]), "multiples by powers of two are exact");
        let mut off = at(4.0);
        off.z = off.z.next_up();
        assert!(!has_no_area(&[at(1.0), at(2.0), off]), "one ulp off the line has area");
    }

    #[test]
    fn welding_joins_equal_places_and_keeps_the_first() {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 0.0, 0.0]];
        let mut s = scene(&corners, &[[0, 1, 2], [5, 4, 3]]);
        weld(&mut s);
        assert_eq!(s.triangles, [[0, 1, 2], [3, 2, 0]]);
        assert_eq!((s.positions.len(), s.report.vertices_welded), (4, 2));
    }
}
