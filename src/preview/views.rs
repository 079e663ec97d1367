//! Cameras that show a whole scene, and lines drawn over a picture.

use super::Image;
use crate::math::{Aabb, Camera, DVec3, Pose, Projection, View};

/// A perspective bird's-eye view that shows all of `bounds`: from the compass
/// direction `azimuth_rad` (0 = from +x, counter-clockwise), `elevation_rad` above the horizon.
pub fn overview(bounds: &Aabb, azimuth_rad: f64, elevation_rad: f64, aspect: f64) -> View {
    let fov_y_rad = 35f64.to_radians();
    let camera = Camera { projection: Projection::Perspective { fov_y_rad }, aspect, near_m: 0.01, far_m: None };
    let back = DVec3::new(
        libm::cos(azimuth_rad) * libm::cos(elevation_rad),
        libm::sin(azimuth_rad) * libm::cos(elevation_rad),
        libm::sin(elevation_rad),
    );
    let up = if elevation_rad.abs() > 1.5 { DVec3::Y } else { DVec3::Z };
    let size = bounds.size();
    let corners: Vec<DVec3> = (0..8)
        .map(|i| {
            let pick = |bit: u32, s: f64| if i >> bit & 1 == 1 { s * 0.5 } else { -s * 0.5 };
            bounds.centre() + DVec3::new(pick(0, size.x), pick(1, size.y), pick(2, size.z))
        })
        .collect();
    // From far enough, then nearer by turns: move so that the picture of the box is
    // in the middle, and up to where it just fits.
    let mut eye = bounds.centre() + back * (size.length() * 2.0 + 1e-3);
    for _ in 0..12 {
        let view = View::new(&camera, &Pose { eye, forward: -back, up });
        let seen: Vec<DVec3> = corners.iter().map(|c| view.to_camera(*c)).collect();
        let fold = |f: &dyn Fn(&DVec3) -> f64| {
            seen.iter().map(f).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
        };
        let (x, y) = (fold(&|c| c.x / c.z / view.half_width), fold(&|c| c.y / c.z / view.half_height));
        let depth = fold(&|c| c.z).0;
        let fill = ((x.1 - x.0) * 0.5).max((y.1 - y.0) * 0.5) / 0.96;
        let shift =
            view.right * ((x.0 + x.1) * 0.5 * view.half_width) + view.up * ((y.0 + y.1) * 0.5 * view.half_height);
        eye += (shift + view.forward * ((1.0 - fill) * 0.7)) * depth;
    }
    View::new(&camera, &Pose { eye, forward: -back, up })
}

/// An orthographic plan from straight above, +y up the page.
pub fn plan(bounds: &Aabb, aspect: f64) -> View {
    let size = bounds.size();
    let height_m = size.y.max(size.x / aspect).max(1e-3) * 1.03;
    let projection = Projection::Orthographic { height_m };
    let camera = Camera { projection, aspect, near_m: 0.0, far_m: None };
    let eye = bounds.centre() + DVec3::Z * (size.z * 0.5 + 1.0);
    View::new(&camera, &Pose { eye, forward: -DVec3::Z, up: DVec3::Y })
}

/// Draws a polyline over `image`, unhidden by the scene: a walk on its map.
pub fn draw_line(image: &mut Image, view: &View, points: &[DVec3], colour: [u8; 3]) {
    let (w, h) = (f64::from(image.width), f64::from(image.height));
    let pixel = |p: DVec3| {
        let c = view.to_camera(p);
        let weight = if view.is_perspective() { 1.0 / c.z } else { 1.0 };
        let x = (c.x * weight / view.half_width * 0.5 + 0.5) * w;
        let y = (0.5 - c.y * weight / view.half_height * 0.5) * h;
        (c.z > view.camera.near_m).then_some((x, y))
    };
    for pair in points.windows(2) {
        let (Some(a), Some(b)) = (pixel(pair[0]), pixel(pair[1])) else { continue };
        let steps = (b.0 - a.0).abs().max((b.1 - a.1).abs()).ceil().clamp(1.0, w + h);
        for i in 0..=steps as u32 {
            let t = f64::from(i) / steps;
            let (x, y) = (a.0 + (b.0 - a.0) * t, a.1 + (b.1 - a.1) * t);
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                let (x, y) = (x + dx, y + dy);
                if x >= 0.0 && y >= 0.0 && x < w && y < h {
                    let at = (y as usize * image.width as usize + x as usize) * 4;
                    image.rgba[at..at + 3].copy_from_slice(&colour);
                }
            }
        }
    }
}
