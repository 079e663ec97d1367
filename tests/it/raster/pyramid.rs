//! Fact D4: the pyramid is right at odd sizes, and its level is never too fine.

use super::common::*;
use cullmark::raster::Coverage;
use cullmark::raster::project::{Rect, Screen};
use cullmark::raster::pyramid::Pyramid;

fn screen(width: u32, height: u32) -> Screen {
    let s = settings(width, height, Coverage::Samples);
    Screen::new(&view(1, true, f64::from(width) / f64::from(height)), ORIGIN, s)
}

/// Every rectangle of small images, against all of its pixels.
#[test]
fn d4_a_rectangle_that_a_pyramid_hides_is_hidden_at_each_of_its_pixels() {
    let mut r = Random::new(4);
    let (mut hidden, mut found) = (0, 0);
    for (width, height) in [(1, 1), (1, 9), (5, 3), (7, 7), (9, 4), (13, 11), (17, 1)] {
        for near in [0.02, 0.3, 0.9] {
            // Mostly at 1, a few pixels open.
            let image: Vec<f32> = (0..width * height).map(|_| if r.unit().abs() < near { 1.0 } else { 0.25 }).collect();
            let pyramid = Pyramid::new(&screen(width, height), &image);
            for (x0, y0) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
                for (x1, y1) in (x0 + 1..=width).flat_map(|x| (y0 + 1..=height).map(move |y| (x, y))) {
                    let rect = Rect { x0, x1, y0, y1 };
                    let shows = (y0..y1).any(|y| (x0..x1).any(|x| 0.5 >= image[(y * width + x) as usize]));
                    assert!(!shows || pyramid.shows_rect(rect, 0.5), "{rect:?} of {width} x {height}");
                    hidden += u32::from(!shows);
                    found += u32::from(!pyramid.shows_rect(rect, 0.5));
                }
            }
        }
    }
    assert!(found > 300 && found * 2 > hidden, "{found} of {hidden}");
}

/// The same over cells of 8 x 4 pixels, as a buffer makes it, at sizes that no cell divides.
#[test]
fn d4_a_pyramid_over_cells_hides_no_pixel_that_is_open() {
    let mut r = Random::new(44);
    let mut found = 0;
    for (width, height) in [(1, 1), (9, 5), (31, 7), (67, 41)] {
        for near in [0.9, 0.99, 0.999] {
            let image: Vec<f32> = (0..width * height).map(|_| if r.unit().abs() < near { 1.0 } else { 0.25 }).collect();
            let at = |x: u32, y: u32| image[(y * width + x) as usize];
            let within = |from: u32, step: u32, size: u32| from * step..size.min((from + 1) * step);
            let farthest = |c: u32, r: u32| {
                let pixels = within(r, 4, height).flat_map(|y| within(c, 8, width).map(move |x| (x, y)));
                pixels.fold(f32::INFINITY, |m, (x, y)| m.min(at(x, y)))
            };
            let cells: Vec<f32> = (0..height.div_ceil(4))
                .flat_map(|r| (0..width.div_ceil(8)).map(move |c| (c, r)))
                .map(|(c, r)| farthest(c, r))
                .collect();
            let pyramid = Pyramid::over(&screen(width, height), [3, 2], &cells);
            for _ in 0..2000 {
                let (x0, y0) = (r.below(width.into()) as u32, r.below(height.into()) as u32);
                let (x1, y1) = (width.min(x0 + 1 + r.below(40) as u32), height.min(y0 + 1 + r.below(30) as u32));
                let shows = (y0..y1).any(|y| (x0..x1).any(|x| 0.5 >= at(x, y)));
                let rect = Rect { x0, x1, y0, y1 };
                assert!(!shows || pyramid.shows_rect(rect, 0.5), "{rect:?} of {width} x {height}");
                found += u32::from(!pyramid.shows_rect(rect, 0.5));
            }
        }
    }
    assert!(found > 300, "{found}");
}

/// The trap of odd sizes: one open pixel in the last row or column, which a 2 x 2 reduction of
/// an odd level drops.
#[test]
fn d4_an_open_pixel_at_the_edge_of_an_odd_size_stays_open_at_every_level() {
    for (width, height) in [(5, 5), (7, 3), (33, 9), (101, 57)] {
        for open in [(width - 1, 0), (0, height - 1), (width - 1, height - 1)] {
            let mut image = vec![1.0; (width * height) as usize];
            image[(open.1 * width + open.0) as usize] = 0.0;
            let pyramid = Pyramid::new(&screen(width, height), &image);
            assert!(pyramid.shows_rect(Rect { x0: 0, x1: width, y0: 0, y1: height }, 0.5), "{open:?}");
            for d in 0..width.min(height) {
                let rect =
                    Rect { x0: open.0.saturating_sub(d), x1: open.0 + 1, y0: open.1.saturating_sub(d), y1: open.1 + 1 };
                assert!(pyramid.shows_rect(rect, 0.5), "{rect:?} of {width} x {height}");
            }
        }
    }
}

/// The trap of a level that is too fine: four texels at the corners of a footprint of three by three.
#[test]
fn d4_an_open_pixel_in_the_middle_is_not_stepped_over() {
    let (width, height) = (64, 64);
    for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
        let mut image = vec![1.0; (width * height) as usize];
        image[(y * width + x) as usize] = 0.0;
        let pyramid = Pyramid::new(&screen(width, height), &image);
        for half in [1, 2, 3, 5, 9, 17] {
            let rect = Rect {
                x0: x.saturating_sub(half),
                x1: width.min(x + half + 1),
                y0: y.saturating_sub(half / 2),
                y1: height.min(y + half / 2 + 1),
            };
            assert!(pyramid.shows_rect(rect, 0.5), "{rect:?} steps over ({x}, {y})");
        }
    }
}

#[test]
fn a_pyramid_over_a_buffer_hides_less_than_the_buffer() {
    let s = settings(201, 113, Coverage::Samples);
    let view = view(3, true, 201.0 / 113.0);
    let mut buffer = drawn(s, kernels().last().unwrap(), &view, &occluders(&triangles(11, 4000)));
    let pyramid = buffer.pyramid();
    let mut r = Random::new(9);
    let mut hidden = 0;
    for _ in 0..3000 {
        let (x0, y0) = (r.below(201) as u32, r.below(113) as u32);
        let rect = Rect { x0, x1: 201.min(x0 + 1 + r.below(20) as u32), y0, y1: 113.min(y0 + 1 + r.below(20) as u32) };
        let nearness = 0.03 * r.unit().abs() as f32;
        let shows = buffer.shows_rect(rect, nearness);
        // A code is coarser than its own value by a step.
        assert!(pyramid.shows_rect(rect, nearness * 1.001) || !shows, "{rect:?} at {nearness}");
        hidden += u32::from(!pyramid.shows_rect(rect, nearness));
    }
    assert!(hidden > 100, "{hidden}");
}
