//! How V_lo grows with the samples, and what a triangle's size says of being missed.
//! `cargo test --release --test it oracle::figures -- --ignored --nocapture` prints
//! the curves of docs/PERFORMANCE.md.

use super::{accuracy, ahead, empty, pose, push, truth_of};
use crate::common::soup;
use cullmark::math::{Camera, DVec3, Pose, Projection};
use cullmark::oracle::truth;
use cullmark::record::Accuracy;
use cullmark::registry::Spec;
use cullmark::scene::{Scene, generate, walkthrough};
use std::time::Instant;

/// Share of compact triangles of `area_px` pixels that s x s samples miss.
fn missed(area_px: f64, samples: u32) -> f64 {
    // Parallel rays: one metre is one pixel.
    let (across, down) = (120u32, 120u32);
    let projection = Projection::Orthographic { height_m: f64::from(down) };
    let camera = Camera { projection, aspect: 1.0, near_m: 1.0, far_m: None };
    let mut scene = empty();
    // An equilateral triangle of that area, turned at random, in the middle of a cell of its own.
    let radius = (area_px * 4.0 / (3.0 * 3f64.sqrt())).sqrt();
    let jitter = soup(91, 3600, 1.0, 0.0);
    for i in 0..60 {
        for j in 0..60 {
            let r = jitter.positions[3 * (i * 60 + j)];
            let centre = DVec3::new(5.0, 2.0 * i as f64 - 59.0 + 0.5 * r.x, 2.0 * j as f64 - 59.0 + 0.5 * r.y);
            let corner = |k: f64| {
                let angle = r.z * 3.0 + k * std::f64::consts::TAU / 3.0;
                centre + DVec3::new(0.0, angle.cos(), angle.sin()) * radius
            };
            push(&mut scene, [corner(0.0), corner(1.0), corner(2.0)], true, true);
        }
    }
    let t = truth_of(&scene, &camera, ahead(), &accuracy(across, down, samples));
    1.0 - t.visible.len() as f64 / scene.len() as f64
}

#[test]
fn a_compact_triangle_is_missed_as_its_area_says() {
    // G1.1. Exact while no two samples fit inside; then some are seen twice and the share is larger.
    for (area_px, samples) in [(0.1, 1), (0.25, 1), (0.05, 2), (0.1, 2), (0.02, 4)] {
        let (found, expected) = (missed(area_px, samples), 1.0 - area_px * f64::from(samples * samples));
        // 3600 triangles: a standard deviation is below 0.0084.
        assert!((found - expected).abs() < 0.035, "{area_px} px at {samples}: {found:.3}, expected {expected:.3}");
    }
    assert_eq!(missed(0.75, 4), 0.0, "12 samples a triangle find it");
}

#[test]
fn more_samples_see_more_on_average() {
    // G1.1: the grids of 1, 2, 4 and 8 do not nest, so a single triangle may be lost.
    let scene = soup(4, 6000, 10.0, 0.3);
    let count = |samples| {
        let poses: Vec<(u32, Pose)> = (0..3).map(|i| (i, pose(DVec3::new(-9.0 + f64::from(i), -3.0, 1.0)))).collect();
        let t = truth(&scene, &Camera::default(), &poses, &accuracy(64, 36, samples));
        t.frames.iter().map(|f| f.visible.len()).sum::<usize>()
    };
    let counts = [1, 2, 4, 8].map(count);
    assert!(counts.windows(2).all(|w| w[1] > w[0]), "{counts:?}");
}

#[test]
#[ignore = "prints figures for docs/PERFORMANCE.md"]
fn curve_of_visible_triangles_against_samples() {
    for spec in ["arena:map=gold_rush", "rooms:world=2"] {
        let scene = generate::make(&Spec::parse(spec).unwrap()).unwrap().0.generate();
        let walk = walkthrough::generate::make(&Spec::parse("walk:frames=300").unwrap()).unwrap().0;
        let poses = walk.walk(&scene).unwrap();
        for samples in [1, 2, 4, 8] {
            row(spec, &scene, &poses, &Accuracy { frames: 5, ..accuracy(480, 270, samples) });
        }
        for (witness_rays, hiding_cells) in [(16, 0), (256, 0), (0, 64), (0, 256), (0, 1024), (256, 256)] {
            let accuracy = Accuracy { frames: 5, witness_rays, hiding_cells, ..accuracy(480, 270, 2) };
            row(spec, &scene, &poses, &accuracy);
        }
    }
    for (area_px, samples) in [(0.1, 1), (0.25, 1), (0.5, 1), (1.0, 1), (2.0, 1), (0.1, 2), (0.25, 2)] {
        let law = (1.0 - area_px * f64::from(samples * samples)).max(0.0);
        println!("area {area_px} px, s = {samples}: missed {:.3}, law {law:.3}", missed(area_px, samples));
    }
}

fn row(name: &str, scene: &Scene, poses: &[Pose], accuracy: &Accuracy) {
    let judged = cullmark::oracle::judged_frames(poses.len() as u32, accuracy);
    let numbered: Vec<(u32, Pose)> = judged.iter().map(|f| (*f, poses[*f as usize])).collect();
    let start = Instant::now();
    let t = truth(scene, &Camera::default(), &numbered, accuracy);
    let ms = start.elapsed().as_secs_f64() * 1e3 / judged.len() as f64;
    let mean = |of: &dyn Fn(&cullmark::oracle::FrameTruth) -> u64| {
        t.frames.iter().map(of).sum::<u64>() as f64 / t.frames.len() as f64
    };
    println!(
        "{name} s={} rays={} cells={}: |V_lo| {:.0}, |V_hi| {:.0}, {ms:.0} ms a frame",
        accuracy.samples,
        accuracy.witness_rays,
        accuracy.hiding_cells,
        mean(&|f| f.lo().count()),
        mean(&|f| f.hi().count())
    );
}
