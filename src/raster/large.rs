//! Polygons that are large, near or far off the image, one by one in f64.
//!
//! No corner is divided: a side is the plane through it and the eye (Olano & Greer 1997,
//! "Triangle Scan Conversion using 2D Homogeneous Coordinates"), and the near plane is one
//! side more, so nothing is clipped. With corners a, b and a ray r through the image a side
//! is `(a x b) . r`; a point is inside if all of them are on the polygon's side by
//! more than corners that are a little off could change them.

use super::project::f32_below;
use super::vertices::{BatchView, Lens};
use crate::math::DVec3;

pub const MOST_CORNERS: usize = 8;

/// Runs of rows `y0..y1` within `x0..x1`: bounds at row 0 and their steps, with half a
/// pixel added; nearness as in a block.
#[derive(Debug, Clone, Copy)]
pub struct Large {
    pub left: [[f64; 2]; MOST_CORNERS + 1],
    pub lefts: usize,
    pub right: [[f64; 2]; MOST_CORNERS + 1],
    pub rights: usize,
    pub x0: i32,
    pub x1: i32,
    pub y0: i32,
    pub y1: i32,
    pub near: f32,
    pub near_across: f32,
    pub near_down: f32,
    pub least: f32,
}

/// Of a convex polygon with these corners in fixed point, counter-clockwise seen from the
/// front. `None` if nothing of it is surely seen.
pub fn make(lens: &Lens, v: &BatchView, corners: &[[i32; 3]], two_sided: bool) -> Option<Large> {
    let n = corners.len();
    let mut camera = [DVec3::ZERO; MOST_CORNERS];
    corners.iter().zip(&mut camera).for_each(|(q, c)| *c = DVec3::from_array(v.camera(*q)));
    let camera = &camera[..n];
    let farthest = camera.iter().fold(f64::NEG_INFINITY, |m, c| m.max(c.z));
    let nearest = camera.iter().fold(f64::INFINITY, |m, c| m.min(c.z));
    if !(farthest >= v.near) {
        return None;
    }
    let mut g = Large {
        left: Default::default(),
        lefts: 0,
        right: Default::default(),
        rights: 0,
        x0: 0,
        x1: v.width,
        y0: 0,
        y1: v.height,
        near: 0.0,
        near_across: 0.0,
        near_down: 0.0,
        least: 0.0,
    };
    if nearest >= v.near {
        g.bound_by(v, camera);
    }
    if g.x0 >= g.x1 || g.y0 >= g.y1 {
        return None;
    }

    // Homogeneous corners, what stands for nearness at each, and how far off both are.
    let half = DVec3::new(v.half[0], v.half[1], 1.0);
    let mut h = [DVec3::ZERO; MOST_CORNERS];
    camera.iter().zip(&mut h).for_each(|(c, h)| *h = if v.perspective { *c } else { DVec3::new(c.x, c.y, 1.0) });
    let h = &h[..n];
    let key = |i: usize| if v.perspective { 1.0 } else { v.ahead - camera[i].z };
    let (off, key_off) = if v.perspective {
        (DVec3::new(lens.focal, lens.focal, 1.0) * v.off_m, 0.0)
    } else {
        (DVec3::new(lens.focal, lens.focal, 0.0) * v.off_m, v.off_m)
    };
    // |x x y| for all x, y that are a little off: at most this, product by product.
    let wobble = |a: DVec3, b: DVec3| {
        let (a, b) = (a.abs(), b.abs());
        products(off, b) + products(a, off) + products(off, off)
    };

    // The plane of nearness, of the fan's largest triangle.
    let det = |i: usize| h[0].dot(h[i].cross(h[i + 1]));
    let i = (1..n - 1).max_by(|i, j| det(*i).abs().total_cmp(&det(*j).abs()))?;
    let (a, b, c) = (h[0], h[i], h[i + 1]);
    let d = det(i);
    let wide = |x: DVec3| x.abs() + off;
    let d_off = off.dot(products(wide(a), wide(b)) + products(wide(b), wide(c)) + products(wide(c), wide(a)));
    if !(d.abs() > 2.0 * d_off) || (d > 0.0 && !two_sided) {
        return None;
    }
    let side = d.signum();
    let sides = [(b, c, key(0)), (c, a, key(i)), (a, b, key(i + 1))];
    let plane = sides.iter().fold(DVec3::ZERO, |sum, (a, b, key)| sum + a.cross(*b) * *key);
    let plane_off: f64 = sides
        .iter()
        .map(|(a, b, key)| half.dot(wobble(*a, *b) * key.abs() + (a.cross(*b).abs() + wobble(*a, *b)) * key_off))
        .sum::<f64>()
        + 1e-15 * sides.iter().map(|(a, b, key)| half.dot(products(a.abs(), b.abs())) * key.abs()).sum::<f64>();
    let limit = if v.perspective { 1.0 / v.near } else { v.ahead - v.near };

    for i in 0..n {
        let (a, b) = (h[i], h[(i + 1) % n]);
        g.cut(v, a.cross(b) * side, half.dot(wobble(a, b)))?;
    }
    if !(nearest > v.near + 2.0 * v.off_m) {
        let inside = DVec3::new(0.0, 0.0, d.abs() * limit) - plane * side;
        g.cut(v, inside, plane_off + limit.abs() * d_off + 1e-15 * d.abs() * limit.abs())?;
    }
    if g.x0 >= g.x1 || g.y0 >= g.y1 {
        return None;
    }
    g.set_nearness(v, plane / d, farthest, nearest, limit, |n_most| {
        1.01 * (plane_off + n_most * d_off) / (d.abs() - d_off)
    })?;
    Some(g)
}

impl Large {
    /// Narrows to the corners' bounds, all of them beyond the near plane.
    fn bound_by(&mut self, v: &BatchView, camera: &[DVec3]) {
        let place = |c: &DVec3, axis: usize| c[axis] / if v.perspective { c.z } else { 1.0 } + v.half[axis];
        let least = |axis| camera.iter().fold(f64::INFINITY, |m: f64, c| m.min(place(c, axis)));
        let most = |axis| camera.iter().fold(f64::NEG_INFINITY, |m: f64, c| m.max(place(c, axis)));
        // A pixel to spare; casts saturate.
        self.x0 = ((least(0) - 1.0) as i32).max(0);
        self.y0 = ((least(1) - 1.0) as i32).max(0);
        self.x1 = ((most(0) + 2.0) as i32).min(v.width);
        self.y1 = ((most(1) + 2.0) as i32).min(v.height);
    }

    /// Only where `side . (x, y, 1) > off`, from the image's centre, at samples or over all of a pixel.
    fn cut(&mut self, v: &BatchView, side: DVec3, off: f64) -> Option<()> {
        let [mut a, b] = [side.x, side.y];
        let (w, h) = (2.0 * v.half[0], 2.0 * v.half[1]);
        let whole = if v.inner { 0.5 * (a.abs() + b.abs()) } else { 0.0 };
        // f64 rounds the bounds below by much less.
        let round = 1e-13 * (a.abs() * w + b.abs() * h + side.z.abs());
        let mut c = side.z - off - whole - round;
        if !(c.is_finite() && a.is_finite() && b.is_finite()) {
            return None;
        }
        if a.abs() <= 1e-12 * b.abs() || a.abs() < 1e-200 {
            c -= a.abs() * w;
            a = 0.0;
        }
        if a == 0.0 {
            let at = (v.half[1] - c / b + 0.5).floor();
            if b > 0.0 {
                self.y0 = self.y0.max(at as i32);
            } else if b < 0.0 {
                self.y1 = self.y1.min(at as i32);
            } else if !(c > 0.0) {
                return None;
            }
            return Some(());
        }
        // From the image's first row, so that rows that come off later change nothing.
        let bound = [v.half[0] - (b * (0.5 - v.half[1]) + c) / a + 0.5, -b / a];
        if !(bound[0].is_finite() && bound[1].is_finite()) {
            return None;
        }
        if a > 0.0 {
            self.left[self.lefts] = bound;
            self.lefts += 1;
        } else {
            self.right[self.rights] = bound;
            self.rights += 1;
        }
        Some(())
    }

    fn set_nearness(
        &mut self,
        v: &BatchView,
        plane: DVec3,
        farthest: f64,
        nearest: f64,
        limit: f64,
        doubt: impl Fn(f64) -> f64,
    ) -> Option<()> {
        let reaches = if v.perspective { 1.0 / (farthest + v.off_m) } else { v.ahead - farthest - v.off_m };
        let most = if v.perspective { 1.0 / nearest } else { v.ahead - nearest };
        let most = if nearest > v.near { most.abs().max(reaches.abs()) } else { limit.abs().max(reaches.abs()) };
        let (lo, right, bottom) = if v.inner { (0.0, 8.0, 4.0) } else { (0.5, 7.5, 3.5) };
        let x = f64::from(self.x0 & !31) + if plane.x < 0.0 { right } else { lo } - v.half[0];
        let y = f64::from(self.y0 & !3) + if plane.y < 0.0 { bottom } else { lo } - v.half[1];
        let value = plane.x * x + plane.y * y + plane.z;
        // f32 adds up: two products and two sums.
        let (w, h) = (f64::from(self.x1 - self.x0) + 48.0, f64::from(self.y1 - self.y0) + 16.0);
        let sums = 5e-7 * (plane.x.abs() * w + plane.y.abs() * h + value.abs());
        let value = value - doubt(most) - sums;
        if !(value.abs() < 1e30 && plane.x.abs() < 1e30 && plane.y.abs() < 1e30) {
            return None;
        }
        self.near = f32_below(value);
        self.near_across = (plane.x * 8.0) as f32;
        self.near_down = (plane.y * 4.0) as f32;
        self.least = f32_below(reaches - 1e-12 * reaches.abs());
        Some(())
    }
}

/// Products of all components but the same, as a cross product adds them, all positive.
fn products(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
}
