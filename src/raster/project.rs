//! Where points and boxes fall on the image, with bounds that hold all rounding.

use super::Settings;
use crate::math::{Box32, DVec3, View};

/// f64 rounds coordinates of the image by far less than so many pixels.
pub const HAIR_PX: f64 = 1e-6;

/// Pixels `x0..x1` by `y0..y1`, not empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    pub x0: u32,
    pub x1: u32,
    pub y0: u32,
    pub y1: u32,
}

/// Where a box falls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// Nothing of it is on the image.
    Outside,
    /// It reaches in front of the near plane.
    Near,
    /// All pixels that it may touch, and an upper bound of its nearness.
    Rect(Rect, f32),
}

/// A camera about an origin, with an image.
#[derive(Debug, Clone, Default)]
pub struct Screen {
    pub perspective: bool,
    pub near_m: f64,
    pub width_px: f64,
    pub height_px: f64,
    /// Rows of the camera: right, up, forward, the first two in pixels at unit depth
    /// (perspective) or a metre (parallel rays); y points down.
    pub rows: [DVec3; 3],
    /// Eye relative to the origin.
    pub eye: DVec3,
}

impl Screen {
    pub fn new(view: &View, origin: DVec3, settings: Settings) -> Screen {
        let (width_px, height_px) = (f64::from(settings.width_px), f64::from(settings.height_px));
        Screen {
            perspective: view.is_perspective(),
            near_m: view.camera.near_m,
            width_px,
            height_px,
            rows: [
                view.right * (width_px * 0.5 / view.half_width),
                view.up * (-height_px * 0.5 / view.half_height),
                view.forward,
            ],
            eye: view.eye - origin,
        }
    }

    /// Camera coordinates of a point relative to the origin: x and y in pixels from the
    /// image's centre times depth (perspective), z = depth.
    pub fn camera(&self, p: DVec3) -> DVec3 {
        let d = p - self.eye;
        DVec3::new(d.dot(self.rows[0]), d.dot(self.rows[1]), d.dot(self.rows[2]))
    }

    /// Pixel coordinates and nearness of a point in camera coordinates in front of the eye.
    pub fn pixel(&self, c: DVec3) -> DVec3 {
        let (scale, nearness) = if self.perspective { (1.0 / c.z, 1.0 / c.z) } else { (1.0, -c.z) };
        DVec3::new(c.x * scale + self.width_px * 0.5, c.y * scale + self.height_px * 0.5, nearness)
    }

    /// A depth that nothing within the bounds reaches; 0 if they are empty.
    pub fn farthest(&self, lo: DVec3, hi: DVec3) -> f64 {
        if !(lo.x <= hi.x) {
            return 0.0;
        }
        let [_, _, forward] = self.rows;
        let most = forward.max(DVec3::ZERO).dot(hi - self.eye) + forward.min(DVec3::ZERO).dot(lo - self.eye);
        most + 1e-6 * (hi - lo).max_element() + 1.0
    }

    pub fn place(&self, b: &Box32) -> Place {
        if b.is_empty() {
            return Place::Outside;
        }
        let (lo, hi) = (b.lo.as_dvec3(), b.hi.as_dvec3());
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { lo[axis] } else { hi[axis] };
            self.camera(DVec3::new(pick(0), pick(1), pick(2)))
        };
        let corners: [DVec3; 8] = std::array::from_fn(corner);
        let nearest = corners.iter().fold(f64::INFINITY, |m, c| m.min(c.z));
        let farthest = corners.iter().fold(f64::NEG_INFINITY, |m, c| m.max(c.z));
        // Coordinates round by this at most, the eye's own included; `nearest` becomes nearer by
        // twice as much.
        let span = (lo - self.eye).abs().max((hi - self.eye).abs()) + self.eye.abs();
        let hair = span.max_element() * 1e-14;
        if farthest < self.near_m - hair {
            return Place::Outside;
        }
        if !(nearest - 2.0 * hair > self.near_m) {
            return Place::Near;
        }
        let mut x = (f64::INFINITY, f64::NEG_INFINITY);
        let mut y = x;
        let focal = self.rows[0].length().max(self.rows[1].length());
        let reach = 0.5 * self.width_px.max(self.height_px);
        let mut blur = HAIR_PX;
        for c in corners {
            let p = self.pixel(c);
            x = (x.0.min(p.x), x.1.max(p.x));
            y = (y.0.min(p.y), y.1.max(p.y));
            // Where it is off the image it may be off by more.
            blur = blur.max(HAIR_PX + hair * if self.perspective { (focal + reach) / c.z } else { focal });
        }
        let first = |v: f64| (v - blur).floor().max(0.0);
        let end = |v: f64, size: f64| (v + blur).ceil().min(size);
        let (x0, x1, y0, y1) = (first(x.0), end(x.1, self.width_px), first(y.0), end(y.1, self.height_px));
        if !(x0 < x1 && y0 < y1) {
            return Place::Outside;
        }
        let depth = nearest - 2.0 * hair;
        let nearness = if self.perspective { 1.0 / depth } else { -depth };
        let rect = Rect { x0: x0 as u32, x1: x1 as u32, y0: y0 as u32, y1: y1 as u32 };
        Place::Rect(rect, f32_above(nearness))
    }
}

/// The least f32 that is not below `x`, or the next one.
pub fn f32_above(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) >= x { near } else { near.next_up() }
}

/// The greatest f32 that is not above `x`, or the next one.
pub fn f32_below(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) <= x { near } else { near.next_down() }
}
