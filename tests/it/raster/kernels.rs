//! All kernels make the same buffer bit by bit, and none says more than a plain z-buffer.

use super::common::*;
use cullmark::math::{Camera, DVec3, Pose, View};
use cullmark::raster::{Coverage, DepthBuffer, Kernel, Kind};

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
fn d5_1_all_kernels_make_the_same_buffer_which_is_never_nearer_than_a_plain_one() {
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

/// A wall of two triangles has no open pixel along its diagonal, and one of many quadrilaterals
/// only those along its seams.
#[test]
fn inner_coverage_does_not_leak_along_the_diagonal_of_a_wall() {
    let s = settings(320, 180, Coverage::Inner);
    let camera = Camera { near_m: 0.1, ..Default::default() };
    for tilt in [0.0, 0.3, -0.7] {
        let forward = DVec3::new(tilt, 1.0, 0.1).normalize();
        let view = View::new(&camera, &Pose { eye: ORIGIN, forward, up: DVec3::Z });
        let at = |x: f64, z: f64| ORIGIN + DVec3::new(x * 3.0, 5.0, z * 2.0);
        let (a, b, c, d) = (at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0));
        let wall = [[a, b, c], [a, c, d]].map(|corners| Triangle { corners, kind: Kind::OneSided });
        let whole = drawn(s, Kernel::best(), &view, &occluders(&wall)).image();
        let inside = |x: u32, y: u32| whole[(y * 320 + x) as usize] > f32::NEG_INFINITY;
        let mut covered = 0;
        for y in 0..180 {
            // Covered pixels of a row are one run.
            let row: Vec<u32> = (0..320).filter(|x| inside(*x, y)).collect();
            if let (Some(first), Some(last)) = (row.first(), row.last()) {
                assert_eq!(row.len() as u32, last - first + 1, "row {y} has a gap");
                covered += row.len();
            }
        }
        assert!(covered > 10_000, "{covered}");
        // Drawn half by half the diagonal is open.
        let o = occluders(&wall);
        let mut halves = DepthBuffer::with_kernel(s, Kernel::best());
        halves.begin(&view, ORIGIN);
        halves.draw(&o, 0, 1);
        halves.flush();
        halves.draw(&o, 1, 2);
        let open = halves.image().iter().filter(|n| **n > f32::NEG_INFINITY).count();
        assert!(open + 100 < covered, "{open} of {covered}");
    }
}
