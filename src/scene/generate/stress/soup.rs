//! The mesh under construction, without the grid of the arenas' builder: slivers
//! of 10^-7 m and duplicates one ulp apart must stay what they are. Files hold
//! them only in f64 (OBJ); a GLB rounds to f32.

use crate::math::DVec3;
use crate::scene::Scene;
use crate::scene::generate::random::Random;
use crate::scene::sanitise::sanitise;

/// Corners of a box as bits of the number: x, y, z.
const BOX_FACES: [[u32; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
];

/// Collects solids; each is an object with vertices of its own.
pub(super) struct Soup {
    pub scene: Scene,
    material: u32,
    object: u32,
}

impl Soup {
    pub fn new(name: &str) -> Soup {
        Soup { scene: Scene { name: name.to_string(), ..Scene::default() }, material: 0, object: 0 }
    }

    /// Everything that follows has this material.
    pub fn paint(&mut self, name: &str) {
        let names = &mut self.scene.material_names;
        let found = names.iter().position(|n| n == name);
        self.material = found.unwrap_or_else(|| {
            names.push(name.to_string());
            names.len() - 1
        }) as u32;
    }

    /// `paint` with one of four colours, so that neighbours differ in pictures.
    pub fn paint_one_of(&mut self, thing: &str, rng: &mut Random) {
        let colour = rng.pick(&["red", "green", "blue", "grey"]);
        self.paint(&format!("{colour}_{thing}"));
    }

    /// A solid of counter-clockwise faces. Returns the number of its first vertex.
    pub fn solid(&mut self, corners: &[DVec3], faces: &[[u32; 3]]) -> u32 {
        if !self.scene.triangles.is_empty() {
            self.object += 1;
        }
        let first = self.vertices(corners);
        faces.iter().for_each(|f| self.face(f.map(|v| v + first)));
        first
    }

    /// The eight corners in the order of [`box_corners`].
    pub fn block(&mut self, corners: &[DVec3; 8]) -> u32 {
        self.solid(corners, &BOX_FACES)
    }

    pub fn vertices(&mut self, corners: &[DVec3]) -> u32 {
        let first = self.scene.positions.len() as u32;
        self.scene.positions.extend_from_slice(corners);
        first
    }

    /// One more face of the last object.
    pub fn face(&mut self, corners: [u32; 3]) {
        let s = &mut self.scene;
        s.source_triangle_id.push(s.triangles.len() as u32);
        s.triangles.push(corners);
        s.object_id.push(self.object);
        s.material_id.push(self.material);
        s.two_sided.push(false);
        s.occluder.push(true);
    }

    /// Through the sanitiser that files go through, so that its counts are in the report.
    pub fn finish(mut self) -> Scene {
        self.scene.source_triangle_count = self.scene.triangles.len() as u32;
        self.scene.report.triangles_in_file = self.scene.triangles.len() as u64;
        sanitise(&mut self.scene);
        self.scene.anchor();
        self.scene
    }
}

/// Corner `i` has the larger x, y, z where bits 0, 1, 2 of `i` are set.
pub(super) fn box_corners(half: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        DVec3::new(half.x * sign(0), half.y * sign(1), half.z * sign(2))
    })
}

/// The nearest multiple of 2^-12 m. Sums with any whole offset up to 10^12 m are
/// exact in f64, so that a moved scene is the same scene, bit by bit, and what
/// changes with the offset is arithmetic alone.
pub(super) fn on_grid(p: DVec3) -> DVec3 {
    const UNITS_PER_M: f64 = 4096.0;
    // Adding zero turns -0 into +0: equal places have equal bits.
    (p * UNITS_PER_M).round() / UNITS_PER_M + DVec3::ZERO
}
