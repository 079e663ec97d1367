//! All kernels make the same buffer bit by bit, and none says more than a plain z-buffer.

use super::common::*;
use cullmark::raster::Coverage;

const SIZES: [(u32, u32); 6] = [(1, 1), (31, 7), (33, 9), (160, 90), (257, 131), (640, 360)];

/// No pixel nearer than the truth; returns how many of the plain buffer's are covered, and how many those are.
fn never_nearer(image: &[f32], truth: &[f32], what: &str) -> (usize, usize) {
    for (i, (n, t)) in image.iter().zip(truth).enumerate() {
        assert!(n <= t, "{what}: pixel {i} is at {n}, plain {t}");
    }
    let covered = |image: &[f32]| image.iter().filter(|n| **n > f32::NEG_INFINITY).count();
    (covered(image), covered(truth))
}

#[test]
fn all_kernels_make_the_same_buffer_which_is_never_nearer_than_a_plain_one() {
    let (mut ours, mut plains) = (0, 0);
    for seed in 0..60u64 {
        let (width, height) = SIZES[seed as usize % SIZES.len()];
        let coverage = if seed % 3 == 2 { Coverage::Inner } else { Coverage::Samples };
        let s = settings(width, height, coverage);
        let t = triangles(seed, 400);
        let view = view(seed, seed % 4 != 3, f64::from(width) / f64::from(height));
        let o = occluders(&t);
        let truth = plain(s, &view, &t);
        let images: Vec<Vec<u32>> =
            kernels().map(|k| drawn(s, k, &view, &o).image().into_iter().map(f32::to_bits).collect()).collect();
        for (k, image) in kernels().zip(&images) {
            let differs = image.iter().zip(&images[0]).position(|(a, b)| a != b);
            assert_eq!(differs, None, "{k:?} differs from the scalar twin in seed {seed}");
        }
        let image: Vec<f32> = images[0].iter().map(|b| f32::from_bits(*b)).collect();
        let (a, b) = never_nearer(&image, truth.image(), &format!("seed {seed}, {coverage:?}"));
        if seed % 5 != 0 && coverage == Coverage::Samples {
            (ours, plains) = (ours + a, plains + b);
        }
        println!("{seed} {coverage:?} {a} {b}");
    }
    println!("{ours} of {plains} pixels covered");
    assert!(ours as f64 > 0.998 * plains as f64 && plains > 100_000, "{ours} of {plains}");
}
