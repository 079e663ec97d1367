//! Scenes: triangles in f64 metres with what every method needs to know of them,
//! and how they come to be (files, generators) or are walked through (camera paths).

pub mod cache;
pub mod generate;
pub mod gltf;
pub mod load;
pub mod mtl;
pub mod obj;
pub mod placement;
pub mod sanitise;
pub mod walkthrough;
pub mod winding;
pub mod write;

use crate::math::{Aabb, Box32, DVec3};
use serde::{Deserialize, Serialize};

/// Triangle soup with shared vertices. Every array `*_id`, `two_sided` and
/// `occluder` has one entry a triangle; the triangle index into them is the
/// *item* of every structure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    pub name: String,
    /// Anchor of all f32 data; integer metres, near the centre of the bounds.
    pub origin: DVec3,
    /// World positions, metres, z up.
    pub positions: Vec<DVec3>,
    /// Vertex indices, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    /// File order, before welding or dropping. Ascending, each once.
    pub source_triangle_id: Vec<u32>,
    pub object_id: Vec<u32>,
    pub material_id: Vec<u32>,
    /// Has no back: facing never hides it.
    pub two_sided: Vec<bool>,
    /// Hides what is behind it; false for alpha MASK and BLEND.
    pub occluder: Vec<bool>,
    pub material_names: Vec<String>,
    /// Triangles in the source, also those that were left out.
    pub source_triangle_count: u32,
    pub report: LoadReport,
}

/// What loading found and did; stored with every run on the scene.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LoadReport {
    pub triangles_in_file: u64,
    /// Faces left out, by reason.
    pub dropped_non_finite: u64,
    pub dropped_out_of_range: u64,
    /// Two equal vertices or exactly zero area.
    pub dropped_degenerate: u64,
    /// glTF points and lines: counted and left out.
    pub points_and_lines: u64,
    pub vertices_welded: u64,
    /// Share of first hits of random rays seen from the front, where probed
    /// ([`winding::probe_blind`]).
    pub front_hit_share: Option<f64>,
    /// Sentences for the user.
    pub warnings: Vec<String>,
}

impl LoadReport {
    pub fn dropped(&self) -> u64 {
        self.dropped_non_finite + self.dropped_out_of_range + self.dropped_degenerate
    }
}

impl Scene {
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Corner positions of triangle `t`, metres.
    pub fn corners(&self, t: u32) -> [DVec3; 3] {
        self.triangles[t as usize].map(|v| self.positions[v as usize])
    }

    pub fn triangle_aabb(&self, t: u32) -> Aabb {
        Aabb::of_points(&self.corners(t))
    }

    /// Bounds of triangle `t` as f32 offsets from `origin`, rounded outward.
    pub fn triangle_box(&self, t: u32) -> Box32 {
        self.triangle_aabb(t).relative_to(self.origin)
    }

    /// Outward normal, not normalised, computed in f64; length is twice the area.
    pub fn normal(&self, t: u32) -> DVec3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(c - a)
    }

    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(self.triangles.iter().flatten().map(|v| &self.positions[*v as usize]))
    }

    /// The triangles `chosen` as a scene of their own, about the same origin.
    pub fn part(&self, chosen: &[u32]) -> Scene {
        let pick = |column: &[u32]| chosen.iter().map(|t| column[*t as usize]).collect();
        let flag = |column: &[bool]| chosen.iter().map(|t| column[*t as usize]).collect();
        Scene {
            name: self.name.clone(),
            origin: self.origin,
            positions: chosen.iter().flat_map(|t| self.corners(*t)).collect(),
            triangles: (0..chosen.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            source_triangle_id: pick(&self.source_triangle_id),
            object_id: pick(&self.object_id),
            material_id: pick(&self.material_id),
            two_sided: flag(&self.two_sided),
            occluder: flag(&self.occluder),
            material_names: self.material_names.clone(),
            source_triangle_count: self.source_triangle_count,
            ..Scene::default()
        }
    }

    /// Sets `origin` to the centre of the bounds, rounded to whole metres.
    pub fn anchor(&mut self) {
        let bounds = self.bounds();
        self.origin = if bounds.is_empty() { DVec3::ZERO } else { bounds.centre().round() };
    }

    /// blake3 over everything that a culling method can see. Part of `answer_id`.
    pub fn content_hash(&self) -> String {
        let mut h = blake3::Hasher::new();
        h.update(b"cullmark scene 1");
        for p in &self.positions {
            for x in p.to_array() {
                h.update(&x.to_bits().to_le_bytes());
            }
        }
        let mut words = |tag: &[u8], v: &mut dyn Iterator<Item = u32>| {
            h.update(tag);
            for w in v {
                h.update(&w.to_le_bytes());
            }
        };
        words(b"t", &mut self.triangles.iter().flatten().copied());
        words(b"s", &mut self.source_triangle_id.iter().copied());
        words(b"o", &mut self.object_id.iter().copied());
        words(b"m", &mut self.material_id.iter().copied());
        words(b"2", &mut self.two_sided.iter().map(|b| u32::from(*b)));
        words(b"c", &mut self.occluder.iter().map(|b| u32::from(*b)));
        h.finalize().to_hex().to_string()
    }
}
