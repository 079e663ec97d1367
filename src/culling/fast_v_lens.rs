//! The image plane of [`super::fast_v`], and certain bounds of what boxes and segments
//! show on it.
//!
//! A point `p` shows at `(r.q / f.q, u.q / f.q)` with `q = p - eye` and the view's own f64
//! vectors r, u, f (parallel rays: at `(r.q, u.q)`), by definition and without rounding.
//! Frusta are rectangles of that plane, so that four quarters share their borders and are
//! together their parent, exactly. Depth is compared by a *key* that grows towards the eye
//! and is linear on the plane for every flat surface: 1 / depth, or -depth for parallel rays.
//!
//! Rounding, with `U = 2^-53`: a corner in camera space is wrong by less than `8 U |q|` as a
//! vector (a rounding for the difference, four for a dot product with a unit vector).

use crate::hierarchy::BoundsBlock;
use crate::math::{DVec3, View};

pub const U: f64 = f64::EPSILON / 2.0;

/// A closed rectangle of the image plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    pub lo: [f64; 2],
    pub hi: [f64; 2],
}

impl Rect {
    pub const EMPTY: Rect = Rect { lo: [f64::INFINITY; 2], hi: [f64::NEG_INFINITY; 2] };
    pub const EVERYTHING: Rect = Rect { lo: [f64::NEG_INFINITY; 2], hi: [f64::INFINITY; 2] };

    #[inline]
    pub fn overlaps(&self, o: &Rect) -> bool {
        self.lo[0] <= o.hi[0] && o.lo[0] <= self.hi[0] && self.lo[1] <= o.hi[1] && o.lo[1] <= self.hi[1]
    }

    #[inline]
    pub fn within(&self, o: &Rect) -> bool {
        o.lo[0] <= self.lo[0] && self.hi[0] <= o.hi[0] && o.lo[1] <= self.lo[1] && self.hi[1] <= o.hi[1]
    }

    #[inline]
    pub fn holds(&self, at: [f64; 2]) -> bool {
        self.lo[0] <= at[0] && at[0] <= self.hi[0] && self.lo[1] <= at[1] && at[1] <= self.hi[1]
    }

    #[inline]
    pub fn meet(&self, o: &Rect) -> Rect {
        Rect {
            lo: [self.lo[0].max(o.lo[0]), self.lo[1].max(o.lo[1])],
            hi: [self.hi[0].min(o.hi[0]), self.hi[1].min(o.hi[1])],
        }
    }

    pub fn join(&self, o: &Rect) -> Rect {
        Rect {
            lo: [self.lo[0].min(o.lo[0]), self.lo[1].min(o.lo[1])],
            hi: [self.hi[0].max(o.hi[0]), self.hi[1].max(o.hi[1])],
        }
    }

    pub fn centre(&self) -> [f64; 2] {
        [0.5 * (self.lo[0] + self.hi[0]), 0.5 * (self.lo[1] + self.hi[1])]
    }

    pub fn corners(&self) -> [[f64; 2]; 4] {
        let ([x0, y0], [x1, y1]) = (self.lo, self.hi);
        [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    }

    /// The four rectangles around its centre.
    pub fn quarters(&self) -> [Rect; 4] {
        let c = self.centre();
        let part = |lo: [f64; 2], hi: [f64; 2]| Rect { lo, hi };
        [
            part(self.lo, c),
            part([c[0], self.lo[1]], [self.hi[0], c[1]]),
            part([self.lo[0], c[1]], [c[0], self.hi[1]]),
            part(c, self.hi),
        ]
    }

    /// Largest `|x| + |y| + 1` inside: rounding grows with it.
    pub fn reach(&self) -> f64 {
        self.lo[0].abs().max(self.hi[0].abs()) + self.lo[1].abs().max(self.hi[1].abs()) + 1.0
    }
}

/// A view as frusta need it.
#[derive(Debug, Clone)]
pub struct Lens {
    pub perspective: bool,
    pub eye: DVec3,
    /// right, up, forward.
    pub basis: [DVec3; 3],
    pub near_m: f64,
    /// Keys up to this lie certainly beyond the near plane.
    pub key_clear: f64,
    /// Keys below this lie certainly beyond the far plane.
    pub key_far: f64,
    /// The image, a little wider: the planes of the view volume are rounded.
    pub image: Rect,
    /// From the eye to the origin of the hierarchy.
    to_origin: DVec3,
}

impl Lens {
    pub fn new(view: &View, origin: DVec3) -> Lens {
        let perspective = view.is_perspective();
        let key = |depth_m: f64| if perspective { 1.0 / depth_m } else { -depth_m };
        let wider = |half: f64| half * (1.0 + 1e-9) + 1e-14;
        let (w, h) = (wider(view.half_width), wider(view.half_height));
        let key_near = key(view.camera.near_m);
        let key_far = view.camera.far_m.map_or(if perspective { 0.0 } else { f64::NEG_INFINITY }, |far_m| {
            let k = key(far_m);
            k - 1e-9 * k.abs()
        });
        Lens {
            perspective,
            eye: view.eye,
            basis: [view.right, view.up, view.forward],
            near_m: view.camera.near_m,
            key_clear: key_near - 1e-12 * key_near.abs(),
            key_far,
            image: Rect { lo: [-w, -h], hi: [w, h] },
            to_origin: origin - view.eye,
        }
    }

    /// x right, y up, z depth.
    #[inline]
    pub fn to_camera(&self, p: DVec3) -> DVec3 {
        self.turn(p - self.eye)
    }

    #[inline]
    fn turn(&self, q: DVec3) -> DVec3 {
        DVec3::new(q.dot(self.basis[0]), q.dot(self.basis[1]), q.dot(self.basis[2]))
    }

    /// Bound from above of the key of whatever is at this depth or beyond.
    #[inline]
    pub fn nearest_key(&self, depth_m: f64) -> f64 {
        match self.perspective {
            true if depth_m > 0.0 => (1.0 + 4.0 * U) / depth_m,
            true => f64::INFINITY,
            false => -depth_m,
        }
    }

    /// Bound from below of the key of whatever is at this depth or before it.
    #[inline]
    pub fn farthest_key(&self, depth_m: f64) -> f64 {
        match self.perspective {
            true if depth_m > 0.0 => (1.0 - 4.0 * U) / depth_m,
            true => f64::INFINITY,
            false => -depth_m,
        }
    }

    /// Certainly nearer than the near plane, if no corner is deeper.
    #[inline]
    pub fn is_before_near(&self, deepest_m: f64) -> bool {
        deepest_m < self.near_m - 1e-12 * self.near_m.abs()
    }

    /// What the part of a segment beyond the near plane covers; empty if there is none.
    /// `error`: how far the ends may be from where they are.
    pub fn segment(&self, a: DVec3, b: DVec3, error: f64) -> Rect {
        if !self.perspective {
            let pad = 2.0 * error;
            let (lo, hi) = (a.min(b), a.max(b));
            return Rect { lo: [lo.x - pad, lo.y - pad], hi: [hi.x + pad, hi.y + pad] };
        }
        // Half the near distance leaves room for rounding: nothing nearer is drawn.
        let floor = 0.5 * self.near_m;
        if error > 0.01 * floor {
            return Rect::EVERYTHING;
        }
        let mut out = Rect::EMPTY;
        for c in [a, b] {
            if c.z >= floor {
                out = out.join(&project(c, error));
            }
        }
        if (a.z >= floor) != (b.z >= floor) {
            let at = a + (b - a) * ((floor - a.z) / (b.z - a.z));
            // The way along the segment is wrong by a few U of its length.
            let error = error + 16.0 * U * (a.abs().max_element() + b.abs().max_element());
            out = out.join(&project(DVec3::new(at.x, at.y, floor), error));
        }
        out
    }

    /// What points show that are all deep enough to be projected; `nearest_m` bounds their
    /// depth from below.
    #[inline]
    pub fn beyond<'a>(&self, points: impl IntoIterator<Item = &'a DVec3>, nearest_m: f64, error: f64) -> Option<Rect> {
        if !self.perspective || nearest_m < 0.5 * self.near_m || nearest_m.is_nan() {
            return None;
        }
        let mut plain = Rect::EMPTY;
        for c in points {
            let depth = 1.0 / c.z;
            let at = [c.x * depth, c.y * depth];
            plain = plain.join(&Rect { lo: at, hi: at });
        }
        Some(padded(plain, error, nearest_m))
    }

    /// What the box of a node shows, and the key of its nearest point; nothing if it is
    /// certainly outside of the image or of near and far plane.
    pub fn node(&self, bounds: &BoundsBlock, lane: usize) -> Option<(Rect, f64)> {
        let b = bounds.get(lane);
        let (lo, hi) = (b.lo.as_dvec3(), b.hi.as_dvec3());
        let centre = self.turn(self.to_origin + (lo + hi) * 0.5);
        let half = (hi - lo) * 0.5;
        let arms = [DVec3::X * half.x, DVec3::Y * half.y, DVec3::Z * half.z].map(|arm| self.turn(arm));
        let error = 32.0 * U * (self.to_origin.length() + lo.length() + hi.length());
        let deep = arms[0].z.abs() + arms[1].z.abs() + arms[2].z.abs() + error;
        let key = self.nearest_key(centre.z - deep);
        if self.is_before_near(centre.z + deep) || key < self.key_far {
            return None;
        }
        let corner = |i: usize| {
            let signed = |k: usize| if i >> k & 1 == 1 { arms[k] } else { -arms[k] };
            centre + signed(0) + signed(1) + signed(2)
        };
        let rect = if !self.perspective {
            let wide = arms[0].abs() + arms[1].abs() + arms[2].abs() + DVec3::splat(error);
            Rect { lo: [centre.x - wide.x, centre.y - wide.y], hi: [centre.x + wide.x, centre.y + wide.y] }
        } else if let Some(rect) = self.beyond(&std::array::from_fn::<_, 8, _>(corner), centre.z - deep, error) {
            rect
        } else {
            let edges = (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit))).filter(|(i, j)| i != j);
            edges.fold(Rect::EMPTY, |all, (i, j)| all.join(&self.segment(corner(i), corner(j), error)))
        };
        rect.overlaps(&self.image).then_some((rect, key))
    }
}

/// The image of a point of positive depth that may be `error` away from `c`.
#[inline]
fn project(c: DVec3, error: f64) -> Rect {
    let at = [c.x / c.z, c.y / c.z];
    padded(Rect { lo: at, hi: at }, error, c.z)
}

/// Quotients of numbers that are wrong by `error`, the divisors at least `depth_m`: with
/// `q = x / z`, `(x + dx) / (z + dz) - q = (dx - q dz) / (z + dz)`.
#[inline]
fn padded(r: Rect, error: f64, depth_m: f64) -> Rect {
    let share = 1.3 * error / depth_m + 8.0 * U;
    if share > 0.01 || share.is_nan() {
        return Rect::EVERYTHING;
    }
    let low = |x: f64| x - share * (1.0 + x.abs());
    let high = |x: f64| x + share * (1.0 + x.abs());
    Rect { lo: r.lo.map(low), hi: r.hi.map(high) }
}
