//! Queries say what the pixels say, on every kernel and any number of threads; facts D5.1-D5.3.

use super::common::*;
use cullmark::math::{Box32, Vec3};
use cullmark::raster::project::{Place, Rect, Screen};
use cullmark::raster::{Coverage, DepthBuffer, Kind};

fn boxes(seed: u64, count: usize) -> Vec<Box32> {
    let mut r = Random::new(seed ^ 0xb0c5);
    let one = |r: &mut Random| {
        let (centre, size) = (r.vector() * 45.0, [0.1, 1.0, 4.0, 15.0][r.below(4) as usize]);
        let half = r.vector().abs() * size;
        Box32 { lo: (centre - half).as_vec3(), hi: (centre + half).as_vec3() }
    };
    let mut all: Vec<Box32> = (0..count).map(|_| one(&mut r)).collect();
    all.push(Box32::EMPTY);
    all.push(Box32 { lo: Vec3::splat(1.0), hi: Vec3::splat(1.0) });
    all.push(Box32 { lo: Vec3::splat(-1e30), hi: Vec3::splat(1e30) });
    all
}

fn rects(r: &mut Random, width: u32, height: u32, count: usize) -> Vec<Rect> {
    let span = |r: &mut Random, size: u32| {
        let (a, b) = (r.below(u64::from(size)) as u32, r.below(u64::from(size)) as u32);
        (a.min(b), a.max(b) + 1)
    };
    (0..count)
        .map(|_| {
            let ((x0, x1), (y0, y1)) = (span(r, width), span(r, height));
            Rect { x0, x1, y0, y1 }
        })
        .collect()
}

#[test]
fn queries_count_the_pixels_of_the_image() {
    let mut hidden = 0;
    for seed in 0..24u64 {
        let (width, height) = [(1, 1), (31, 7), (33, 9), (200, 120)][seed as usize % 4];
        let s = settings(width, height, Coverage::Samples);
        let view = view(seed, seed % 3 != 2, f64::from(width) / f64::from(height));
        let o = occluders(&triangles(5 * seed + 101, 600));
        for kernel in kernels() {
            let mut buffer = drawn(s, kernel, &view, &o);
            let image = buffer.image();
            let mut r = Random::new(seed);
            for rect in rects(&mut r, width, height, 60) {
                // Of one of its pixels, a little nearer or farther, or from anywhere.
                let pixel = image[(rect.y0 * width + rect.x0) as usize];
                let nearness = match r.below(4) {
                    0 => pixel.next_down(),
                    1 => pixel,
                    2 => pixel.next_up(),
                    _ => (r.unit() * if seed % 3 == 2 { 100.0 } else { 1.0 }) as f32,
                };
                let pixels = (rect.y0..rect.y1).flat_map(|y| (rect.x0..rect.x1).map(move |x| (y * width + x) as usize));
                let least = pixels.clone().filter(|i| nearness >= image[*i]).count() as u32;
                // Codes of 16 bits decide to one step: 2^-11, or what that is of the depths' span.
                let step = if seed % 3 == 2 { 0.5 } else { nearness.abs().min(1e30) / 1024.0 };
                let most = pixels.filter(|i| nearness + step >= image[*i]).count() as u32;
                let counted = buffer.pixels_of_rect(rect, nearness);
                assert!(
                    (least..=most).contains(&counted),
                    "{kernel:?} {seed} {rect:?}: {least} <= {counted} <= {most}"
                );
                assert_eq!(buffer.shows_rect(rect, nearness), counted != 0);
                hidden += u32::from(counted == 0);
            }
            assert_eq!(buffer.pixels_of_rect(Rect { x0: 0, x1: 1, y0: 0, y1: 1 }, f32::NAN), 1);
        }
    }
    assert!(hidden > 200, "{hidden} hidden rectangles");
}

#[test]
fn answers_do_not_depend_on_kernel_threads_or_pieces() {
    // Enough to be shared, and among them walls of two triangles each, in a leaf or across two.
    let mut t = triangles(7, 40_000);
    let mut r = Random::new(70);
    for i in (0..t.len() - 1).step_by(5) {
        let mut at = |size: f64| ORIGIN + (r.vector() * size).round();
        let (a, u, v) = (at(40.0), at(8.0) - ORIGIN, at(8.0) - ORIGIN);
        (t[i].corners, t[i + 1].corners) = ([a, a + u, a + u + v], [a, a + u + v, a + v]);
        (t[i].kind, t[i + 1].kind) = (Kind::TwoSided, Kind::TwoSided);
    }
    let o = occluders(&t);
    let count = o.len() as u32;
    for (seed, coverage) in [(1, Coverage::Samples), (2, Coverage::Inner), (3, Coverage::Samples)] {
        let s = settings(321, 203, coverage);
        let view = view(seed, seed != 3, 321.0 / 203.0);
        let boxes = boxes(seed, 300);
        let mut expected: Option<(Vec<u32>, Vec<u32>)> = None;
        for kernel in kernels() {
            for threads in [1, 2, 5] {
                for piece in [count, 43 * 23] {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                    let found = pool.install(|| {
                        let mut buffer = DepthBuffer::with_kernel(s, kernel);
                        buffer.begin(&view, ORIGIN);
                        let drawn: u32 = (0..count)
                            .step_by(piece as usize)
                            .map(|first| buffer.draw(&o, first, count.min(first + piece)))
                            .sum();
                        assert_eq!(drawn, o.hiding(0, count));
                        let image = buffer.image().into_iter().map(f32::to_bits).collect();
                        (image, boxes.iter().map(|b| buffer.pixels(b)).collect())
                    });
                    let expected = expected.get_or_insert_with(|| found.clone());
                    assert!(found == *expected, "{kernel:?}, {threads} threads, pieces of {piece}, {coverage:?}");
                }
            }
        }
    }
}

/// Fact D5.2: nearly all that full resolution hides. Fact D5.3: the order of drawing changes
/// what is found, never whether it is true.
#[test]
fn d5_2_and_d5_3_most_is_found_in_any_order_and_nothing_else() {
    let (mut hidden, mut found) = (0, [0, 0]);
    for seed in 0..12u64 {
        let s = settings(320, 180, Coverage::Samples);
        let view = view(seed, seed % 4 != 3, 320.0 / 180.0);
        let mut t = triangles(1000 + 5 * seed + 1, 3000);
        let truth = plain(s, &view, &t);
        let screen = Screen::new(&view, ORIGIN, s);
        let boxes = boxes(seed, 400);
        for (order, found) in found.iter_mut().enumerate() {
            if order == 1 {
                t.reverse();
            }
            let mut buffer = drawn(s, kernels().last().unwrap(), &view, &occluders(&t));
            for b in &boxes {
                let Place::Rect(rect, nearness) = screen.place(b) else { continue };
                let exact = truth.pixels(rect, nearness);
                let ours = buffer.pixels(b);
                assert!(ours >= exact, "seed {seed}: {exact} pixels show of {b:?}, not {ours}");
                assert_eq!(buffer.shows(b), ours != 0);
                hidden += u32::from(exact == 0 && order == 0);
                *found += u32::from(ours == 0);
            }
        }
    }
    println!("{found:?} of {hidden} found");
    assert!(hidden > 100 && found.iter().all(|f| f64::from(*f) > 0.95 * f64::from(hidden)), "{found:?} of {hidden}");
}
