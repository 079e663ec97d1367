//! A triangle on the image plane with bounds of all rounding: what proofs of
//! hiding and witness rays are made of.
//!
//! As in [`super::footprint`] edges and depth key are linear on the image plane
//! (Olano & Greer 1997), but here every number comes with a bound of its error
//! against exact arithmetic on the scene's own coordinates. With u = 2^-53:
//!
//! - A corner in camera space is wrong by at most 8 u |p|: one rounding for the
//!   difference to the eye, three for each dot product with a unit vector.
//! - An edge function `(a x b) . (x, y, 1)` is therefore wrong by at most
//!   16 u (|p_a||q_b| + |q_a||p_b| + |q_a||q_b|) (|x| + |y| + 1), where q is what
//!   is multiplied (p, or (x, y, 1) for parallel rays): 8 for each corner's own
//!   error and fewer than 10 for products, sums and the evaluation.
//! - The normal of the plane is wrong by at most 24 u D (l1 + l2), D the largest
//!   |p| and l the lengths of two sides; the key follows by division.
//!
//! Class: bounds, proved; a triangle too near to edge-on is not `solid` and only
//! its rectangle and range of depth are used.

use super::footprint::Linear;
use crate::math::{DVec3, View};

const U: f64 = f64::EPSILON / 2.0;

/// A closed rectangle of the image plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    pub x: [f64; 2],
    pub y: [f64; 2],
}

impl Rect {
    pub const EVERYTHING: Rect = Rect { x: [f64::NEG_INFINITY, f64::INFINITY], y: [f64::NEG_INFINITY, f64::INFINITY] };

    pub fn overlaps(&self, o: &Rect) -> bool {
        self.x[0] <= o.x[1] && o.x[0] <= self.x[1] && self.y[0] <= o.y[1] && o.y[0] <= self.y[1]
    }

    pub fn meet(&self, o: &Rect) -> Rect {
        Rect { x: [self.x[0].max(o.x[0]), self.x[1].min(o.x[1])], y: [self.y[0].max(o.y[0]), self.y[1].min(o.y[1])] }
    }

    pub fn join(&self, o: &Rect) -> Rect {
        Rect { x: [self.x[0].min(o.x[0]), self.x[1].max(o.x[1])], y: [self.y[0].min(o.y[0]), self.y[1].max(o.y[1])] }
    }

    pub fn holds(&self, at: [f64; 2]) -> bool {
        self.x[0] <= at[0] && at[0] <= self.x[1] && self.y[0] <= at[1] && at[1] <= self.y[1]
    }

    pub fn corners(&self) -> [[f64; 2]; 4] {
        let ([x0, x1], [y0, y1]) = (self.x, self.y);
        [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    }

    pub fn centre(&self) -> [f64; 2] {
        [0.5 * (self.x[0] + self.x[1]), 0.5 * (self.y[0] + self.y[1])]
    }

    /// Largest `|x| + |y| + 1` inside: error bounds are multiples of it.
    pub fn reach(&self) -> f64 {
        self.x[0].abs().max(self.x[1].abs()) + self.y[0].abs().max(self.y[1].abs()) + 1.0
    }
}

/// The part of a view that proofs need.
#[derive(Debug, Clone)]
pub struct Screen {
    pub perspective: bool,
    pub near_m: f64,
    pub key_near: f64,
    pub key_far: f64,
    /// The image, wider by 1e-9: the planes of the view volume are rounded.
    pub image: Rect,
}

impl Screen {
    pub fn new(view: &View) -> Screen {
        let perspective = view.is_perspective();
        let key = |depth_m: f64| if perspective { 1.0 / depth_m } else { -depth_m };
        let (w, h) = (view.half_width * (1.0 + 1e-9), view.half_height * (1.0 + 1e-9));
        Screen {
            perspective,
            near_m: view.camera.near_m,
            key_near: key(view.camera.near_m),
            key_far: key(view.camera.far_m.unwrap_or(f64::INFINITY)),
            image: Rect { x: [-w, w], y: [-h, h] },
        }
    }

    /// Keys up to this lie certainly beyond the near plane.
    pub fn key_clear(&self) -> f64 {
        self.key_near - 1e-12 * self.key_near.abs()
    }
}

/// See the head of the file.
#[derive(Debug, Clone)]
pub struct Outline {
    pub triangle: u32,
    pub occluder: bool,
    /// Orientation is certain: edges and key may be used.
    pub solid: bool,
    /// Orientation as seen: of two that face the eye alike, both are turned or neither.
    pub turned: bool,
    /// Function k belongs to the side opposite corner k; positive inside.
    edges: [Linear; 3],
    edge_errors: [f64; 3],
    key: Linear,
    key_error: f64,
    /// Certain bounds of the key over the whole triangle.
    pub key_min: f64,
    pub key_max: f64,
    /// Certain bounds of its image.
    pub rect: Rect,
    /// The same of each side.
    pub side_rects: [Rect; 3],
}

impl Outline {
    /// `None` if it certainly has no part of the image. `p`: corners in camera space.
    pub fn new(screen: &Screen, triangle: u32, occluder: bool, p: &[DVec3; 3]) -> Option<Outline> {
        let size = p.map(|c| c.length());
        let farthest = (0..3).map(|i| p[i].z + 8.0 * U * size[i]).fold(f64::NEG_INFINITY, f64::max);
        let nearest = (0..3).map(|i| p[i].z - 8.0 * U * size[i]).fold(f64::INFINITY, f64::min);
        if farthest < screen.near_m * (1.0 - 1e-12) {
            return None;
        }
        let (key_min, key_max) = match screen.perspective {
            true => (1.0 / farthest, if nearest > 0.0 { 1.0 / nearest } else { f64::INFINITY }),
            false => (-farthest, -nearest),
        };
        let (key_min, key_max) = (key_min - 4.0 * U * key_min.abs(), key_max + 4.0 * U * key_max.abs());
        let side_rects = [(1, 2), (2, 0), (0, 1)].map(|(a, b)| side_rect(screen, p[a], p[b]));
        let rect = side_rects.iter().flatten().fold(None, |all: Option<Rect>, r| Some(all.map_or(*r, |a| a.join(r))));
        let rect = rect.filter(|r| r.overlaps(&screen.image))?;
        // A side without a visible part is nowhere.
        let nowhere = Rect { x: [f64::INFINITY, f64::NEG_INFINITY], y: [f64::INFINITY, f64::NEG_INFINITY] };
        let mut outline = Outline {
            triangle,
            occluder,
            solid: false,
            turned: false,
            edges: [[0.0; 3]; 3],
            edge_errors: [0.0; 3],
            key: [0.0; 3],
            key_error: 0.0,
            key_min,
            key_max,
            rect,
            side_rects: side_rects.map(|r| r.unwrap_or(nowhere)),
        };
        outline.set_up(screen, p, size);
        Some(outline)
    }

    fn set_up(&mut self, screen: &Screen, p: &[DVec3; 3], size: [f64; 3]) {
        let q = if screen.perspective { *p } else { p.map(|c| DVec3::new(c.x, c.y, 1.0)) };
        let (l1, l2) = ((p[1] - p[0]).length(), (p[2] - p[0]).length());
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        let normal_error = 24.0 * U * size[0].max(size[1]).max(size[2]) * (l1 + l2);
        let volume = normal.dot(p[0]);
        let volume_error = 1.01 * size[0] * (normal_error + 12.0 * U * normal.length());
        // Key = numerator / scale; errors are multiples of the reach.
        let (scale, scale_error, numerator, numerator_error) = match screen.perspective {
            true => (volume, volume_error, normal, normal_error),
            false => {
                let numerator = DVec3::new(normal.x, normal.y, -volume);
                (normal.z, normal_error, numerator, normal_error + volume_error)
            }
        };
        self.turned = scale < 0.0;
        let sign = if self.turned { -1.0 } else { 1.0 };
        let bulk = scale.abs();
        // The tiny summand covers products that underflow.
        self.solid = bulk > 4.0 * scale_error + 1e-280 && bulk.is_finite();
        if !self.solid {
            return;
        }
        for (k, (a, b)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            self.edges[k] = (q[a].cross(q[b]) * sign).to_array();
            let (qa, qb) = (q[a].length(), q[b].length());
            self.edge_errors[k] = 16.0 * U * (size[a] * qb + qa * size[b] + qa * qb) + 1e-290;
        }
        let coefficients = numerator.abs().element_sum();
        self.key = (numerator * sign / bulk).to_array();
        self.key_error =
            1.01 * (1.4 * numerator_error + (1.4 * scale_error / bulk + 6.0 * U) * coefficients) / bulk + 1e-290;
        self.solid = self.key_error.is_finite() && self.key.iter().all(|k| k.is_finite());
    }

    /// Side of edge k on which the point lies: positive is inside, 0 is uncertain.
    pub fn side(&self, k: usize, at: [f64; 2]) -> i8 {
        let [cx, cy, c] = self.edges[k];
        let value = cx * at[0] + (cy * at[1] + c);
        let error = self.edge_errors[k] * (at[0].abs() + at[1].abs() + 1.0);
        i8::from(value > error) - i8::from(value < -error)
    }

    /// Certainly inside.
    pub fn covers(&self, at: [f64; 2]) -> bool {
        self.solid && (0..3).all(|k| self.side(k, at) > 0)
    }

    /// Certainly outside.
    pub fn misses(&self, at: [f64; 2]) -> bool {
        !self.rect.holds(at) || self.solid && (0..3).any(|k| self.side(k, at) < 0)
    }

    /// Certainly disjoint from the cell.
    pub fn avoids(&self, cell: &Rect) -> bool {
        let beyond = |k: usize| cell.corners().iter().all(|c| self.side(k, *c) < 0);
        !self.rect.overlaps(cell) || self.solid && (0..3).any(beyond)
    }

    /// Whether side k may have a point in the cell.
    pub fn side_enters(&self, k: usize, cell: &Rect) -> bool {
        if !self.side_rects[k].overlaps(cell) {
            return false;
        }
        let sides = cell.corners().map(|c| self.side(k, c));
        !(sides.iter().all(|s| *s > 0) || sides.iter().all(|s| *s < 0))
    }

    /// Bounds of the key at a point.
    pub fn key_at(&self, at: [f64; 2]) -> [f64; 2] {
        self.key_over(&Rect { x: [at[0]; 2], y: [at[1]; 2] })
    }

    /// Bounds of the key over the part of a rectangle that it covers.
    pub fn key_over(&self, r: &Rect) -> [f64; 2] {
        if !self.solid {
            return [self.key_min, self.key_max];
        }
        let error = self.key_error * r.reach();
        let values = r.corners().map(|c| self.plain_key(c));
        let lo = values.iter().copied().fold(f64::INFINITY, f64::min) - error;
        let hi = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + error;
        // Bounds of the plane and of the corners hold both.
        [lo.max(self.key_min), hi.min(self.key_max)]
    }

    /// Bound from above of how much nearer it is than `o` anywhere in the rectangle.
    pub fn lead_over(&self, o: &Outline, r: &Rect) -> f64 {
        if !self.solid || !o.solid {
            return f64::INFINITY;
        }
        let lead = r.corners().map(|c| self.plain_key(c) - o.plain_key(c));
        let size = r.corners().map(|c| self.plain_key(c).abs().max(o.plain_key(c).abs()));
        let most = |v: [f64; 4]| v.into_iter().fold(f64::NEG_INFINITY, f64::max);
        most(lead) + (self.key_error + o.key_error) * r.reach() + 4.0 * U * most(size)
    }

    fn plain_key(&self, at: [f64; 2]) -> f64 {
        let [kx, ky, k] = self.key;
        kx * at[0] + (ky * at[1] + k)
    }
}

/// Certain bounds of the image of the segment's part beyond the near plane;
/// `None` if there is none.
fn side_rect(screen: &Screen, a: DVec3, b: DVec3) -> Option<Rect> {
    let point = |c: DVec3, pad: f64| Rect { x: [c.x - pad, c.x + pad], y: [c.y - pad, c.y + pad] };
    if !screen.perspective {
        let at = |c: DVec3| point(c, 16.0 * U * c.length());
        return Some(at(a).join(&at(b)));
    }
    // Half the near distance leaves room for rounding: nothing nearer is visible.
    let floor = 0.5 * screen.near_m;
    let longest = a.length().max(b.length());
    let project = |c: DVec3, size: f64, stretch: f64| {
        let (x, y) = (c.x / c.z, c.y / c.z);
        let share = 32.0 * U * stretch * size / c.z;
        if share > 0.01 { Rect::EVERYTHING } else { point(DVec3::new(x, y, 1.0), share * (1.0 + x.abs() + y.abs())) }
    };
    let mut rect: Option<Rect> = None;
    let mut take = |r: Rect| rect = Some(rect.map_or(r, |all| all.join(&r)));
    for c in [a, b] {
        if c.z >= floor {
            take(project(c, c.length(), 1.0));
        }
    }
    if (a.z >= floor) != (b.z >= floor) {
        let crossing = a + (b - a) * ((floor - a.z) / (b.z - a.z));
        // A side that visibly passes the near plane climbs by half of it at least,
        // so the crossing moves no more than length over that times the corners do.
        let crossing = DVec3::new(crossing.x, crossing.y, floor);
        take(project(crossing, longest, 1.0 + 2.0 * longest / floor));
    }
    rect
}
