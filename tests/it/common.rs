//! Helpers shared by the areas.
#![allow(dead_code)]

use cullmark::math::DVec3;
use cullmark::scene::Scene;
use std::path::PathBuf;

/// Folder of the real scenes, if this machine has it: `$CULLMARK_SCENES`, or
/// `shared/scenes` beside the checkout. Tests that want it skip with a word otherwise.
pub fn shared_scenes() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    let path = std::env::var_os("CULLMARK_SCENES").map_or(beside, PathBuf::from);
    if path.join("MANIFEST.json").exists() {
        Some(path)
    } else {
        eprintln!("skipped: no shared scenes at {} (set CULLMARK_SCENES)", path.display());
        None
    }
}

/// Path of a file below the shared scenes.
pub fn shared(file: &str) -> Option<PathBuf> {
    shared_scenes().map(|s| s.join(file))
}

/// A seeded soup of small triangles in a box of the given half size, for tests of layouts.
pub fn soup(seed: u64, count: usize, half_m: f64, edge_m: f64) -> Scene {
    use rand_chacha::rand_core::{RngCore, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut unit = move || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0;
    let mut vector = move || DVec3::new(unit(), unit(), unit());
    let mut scene = Scene { name: format!("soup {seed}"), ..Default::default() };
    for t in 0..count as u32 {
        let centre = vector() * half_m;
        for _ in 0..3 {
            scene.positions.push(centre + vector() * edge_m);
        }
        scene.triangles.push([3 * t, 3 * t + 1, 3 * t + 2]);
        scene.source_triangle_id.push(t);
        scene.object_id.push(0);
        scene.material_id.push(t % 3);
        scene.two_sided.push(false);
        scene.occluder.push(true);
    }
    scene.material_names = vec!["a".into(), "b".into(), "c".into()];
    scene.source_triangle_count = count as u32;
    scene.anchor();
    scene
}
