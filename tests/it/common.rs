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

/// A town of `n` x `n` boxes as OBJ, z up, and a walk of 20 frames through it as CSV.
pub fn town(n: usize) -> (String, String) {
    let (mut mesh, mut base) = (String::new(), 1);
    for i in 0..n * n {
        let (x, y, h) = ((i / n) as f64 * 4.0, (i % n) as f64 * 4.0, 1.0 + (i % 5) as f64);
        for z in [0.0, h] {
            for (a, b) in [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)] {
                mesh += &format!("v {} {} {z}\n", x + a, y + b);
            }
        }
        for [a, b, c, d] in [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
            .map(|q| q.map(|k| base + k))
        {
            mesh += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
        }
        base += 8;
    }
    let mut walk = "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n".to_string();
    for k in 0..20 {
        let (s, c) = (f64::from(k) * 0.3).sin_cos();
        walk += &format!("{k},{},{},1.6,{},{c},0,0,0,1\n", 10.0 + c * 9.0, 10.0 + s * 9.0, -s);
    }
    (mesh, walk)
}
