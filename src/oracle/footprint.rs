//! A triangle as the item buffer sees it: three edge functions and a depth key,
//! all linear on the image plane.
//!
//! Edges are homogeneous (Olano & Greer 1997): for corners a, b in camera space
//! the function `(a x b) . (x, y, 1)` tells on which side of the edge a ray
//! passes, also when a corner lies behind the eye, so nothing is clipped.
//! The cross product of (b, a) is that of (a, b) negated bit by bit, and it is
//! evaluated at a sample by the same operations for every triangle: of two
//! triangles that share an edge exactly one takes a sample on it.

use super::image::Grid;
use crate::math::{DVec3, View};

/// A linear function `x * c[0] + (y * c[1] + c[2])` of the image plane.
pub type Linear = [f64; 3];

/// Closed sample bounds x0, x1, y0, y1.
pub type Bounds = [u32; 4];

/// Rounding of a sample coordinate is far below a thousandth of a sample.
pub(super) const BOUND_SLACK: f64 = 1e-3;

/// Coordinates of sample columns and rows on the image plane, unit depth for
/// perspective and metres for orthographic, and the clip range as depth keys.
#[derive(Debug, Clone)]
pub struct Lens {
    pub grid: Grid,
    pub xs: Vec<f64>,
    pub ys: Vec<f64>,
    pub(super) perspective: bool,
    pub(super) near_m: f64,
    /// Samples per unit of `xs` and `ys`.
    pub(super) per_step: [f64; 2],
    /// Depth keys grow towards the eye: `1 / depth` for perspective, `-depth` for
    /// orthographic; both are linear on the image plane.
    pub key_near: f64,
    pub key_far: f64,
}

impl Lens {
    pub fn new(view: &View, grid: Grid) -> Lens {
        let centre = |i: u32, n: u32, half: f64| (f64::from(2 * i + 1) / f64::from(n) - 1.0) * half;
        let (columns, rows) = (grid.columns(), grid.rows());
        let perspective = view.is_perspective();
        let key = |depth_m: f64| if perspective { 1.0 / depth_m } else { -depth_m };
        let step = [2.0 * view.half_width / f64::from(columns), 2.0 * view.half_height / f64::from(rows)];
        Lens {
            grid,
            xs: (0..columns).map(|i| centre(i, columns, view.half_width)).collect(),
            ys: (0..rows).map(|j| -centre(j, rows, view.half_height)).collect(),
            perspective,
            near_m: view.camera.near_m,
            per_step: step.map(|s| 1.0 / s),
            key_near: key(view.camera.near_m),
            key_far: key(view.camera.far_m.unwrap_or(f64::INFINITY)),
        }
    }

    /// The ray of a sample as (origin, direction) in camera coordinates.
    pub fn ray(&self, x: u32, y: u32) -> (DVec3, DVec3) {
        let (x, y) = (self.xs[x as usize], self.ys[y as usize]);
        match self.perspective {
            true => (DVec3::ZERO, DVec3::new(x, y, 1.0)),
            false => (DVec3::new(x, y, 0.0), DVec3::Z),
        }
    }

    /// Edge functions of a triangle in camera coordinates, positive inside if
    /// `flip` is right.
    fn edges(&self, p: &[DVec3; 3]) -> [Linear; 3] {
        // Parallel rays: the same with every corner at unit depth.
        let q = if self.perspective { *p } else { p.map(|c| DVec3::new(c.x, c.y, 1.0)) };
        [q[1].cross(q[2]).to_array(), q[2].cross(q[0]).to_array(), q[0].cross(q[1]).to_array()]
    }

    /// Whether the sample certainly lies inside the triangle (camera coordinates),
    /// by a margin of `1e-12` of the edge functions' size.
    pub fn covers(&self, p: &[DVec3; 3], x: u32, y: u32) -> bool {
        let (x, y) = (self.xs[x as usize], self.ys[y as usize]);
        let values = self.edges(p).map(|[cx, cy, c]| {
            let margin = 1e-12 * ((x * cx).abs() + (y * cy).abs() + c.abs());
            let value = x * cx + (y * cy + c);
            if value > margin {
                1
            } else if value < -margin {
                -1
            } else {
                0
            }
        });
        values == [1; 3] || values == [-1; 3]
    }
}

/// Set up for one frame. Sample bounds are closed and may hold samples outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    /// Triangle + 1.
    pub id: u32,
    pub occluder: bool,
    /// Positive inside.
    pub edges: [Linear; 3],
    /// Bit per edge: a sample exactly on it is inside (the top-left rule).
    pub takes_edge: u8,
    pub key: Linear,
    /// Range of the key over the triangle: rounding of slivers cannot leave it.
    pub key_min: f64,
    pub key_max: f64,
    pub x0: u32,
    pub x1: u32,
    pub y0: u32,
    pub y1: u32,
}

impl Footprint {
    /// `None` if no sample can lie inside. `p`: corners in camera coordinates.
    pub fn new(lens: &Lens, id: u32, occluder: bool, mut p: [DVec3; 3]) -> Option<Footprint> {
        let bounds = sample_bounds(lens, &p)?;
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        // Twice the volume to the eye, or along z: its sign is the orientation.
        let mut scale = if lens.perspective { normal.dot(p[0]) } else { normal.z };
        let mut normal = normal;
        if scale < 0.0 {
            p.swap(1, 2);
            (scale, normal) = (-scale, -normal);
        }
        // Edge-on within rounding: it has no inside.
        if scale.is_nan() || scale <= 0.0 {
            return None;
        }
        let edges = lens.edges(&p);
        // Depth z where the plane meets the ray: normal . (z x, z y, z) = scale, or
        // normal . (x, y, z) = normal . p0.
        let key = match lens.perspective {
            true => (normal / scale).to_array(),
            false => [normal.x / scale, normal.y / scale, -normal.dot(p[0]) / scale],
        };
        if !key.iter().all(|k| k.is_finite()) {
            return None;
        }
        let depths = p.map(|c| c.z);
        let (near, far) = (depths[0].min(depths[1]).min(depths[2]), depths[0].max(depths[1]).max(depths[2]));
        let (key_min, key_max) = match lens.perspective {
            true => (1.0 / far, if near > 0.0 { 1.0 / near } else { f64::INFINITY }),
            false => (-far, -near),
        };
        if key_max < lens.key_far || key_min > lens.key_near {
            return None;
        }
        Some(Footprint::of(id, occluder, edges, key, [key_min, key_max], bounds))
    }

    #[inline(always)]
    pub(super) fn of(
        id: u32,
        occluder: bool,
        edges: [Linear; 3],
        key: Linear,
        [key_min, key_max]: [f64; 2],
        [x0, x1, y0, y1]: Bounds,
    ) -> Footprint {
        let takes = |[cx, cy, c]: Linear| cx > 0.0 || cx == 0.0 && (cy < 0.0 || cy == 0.0 && c > 0.0);
        let takes_edge = (0..3).fold(0, |bits, k| bits | u8::from(takes(edges[k])) << k);
        Footprint { id, occluder, edges, takes_edge, key, key_min, key_max, x0, x1, y0, y1 }
    }

    /// Whether the sample at (x, y) of the image plane is inside.
    #[inline]
    pub fn inside(&self, [x, y]: [f64; 2]) -> bool {
        (0..3).all(|k| self.inside_edge(k, x, y * self.edges[k][1] + self.edges[k][2]))
    }

    /// What an edge function must reach to be inside: nothing, or more than nothing.
    #[inline]
    pub fn threshold(&self, k: usize) -> f64 {
        const ABOVE_ZERO: f64 = f64::from_bits(1);
        if self.takes_edge >> k & 1 == 1 { 0.0 } else { ABOVE_ZERO }
    }

    /// The part of the key that does not depend on x.
    #[inline(always)]
    pub fn key_row(&self, y: f64) -> f64 {
        self.key[1] * y + self.key[2]
    }

    /// The key at a sample, held within the triangle's own range.
    #[inline(always)]
    pub fn key_at(&self, x: f64, row: f64) -> f64 {
        let key = self.key[0] * x + row;
        // Not `clamp`: these compile to one instruction each.
        let key = if key > self.key_min { key } else { self.key_min };
        if key < self.key_max { key } else { self.key_max }
    }

    /// The largest key inside the tile.
    pub fn key_max_in(&self, xs: [f64; 2], ys: [f64; 2]) -> f64 {
        let [kx, ky, k] = self.key;
        let at = kx * if kx > 0.0 { xs[1] } else { xs[0] } + (ky * if ky > 0.0 { ys[1] } else { ys[0] } + k);
        at.min(self.key_max).max(self.key_min)
    }

    /// Whether a sample of this row is inside edge `k`: monotone in x, because
    /// rounding is.
    #[inline]
    fn inside_edge(&self, k: usize, x: f64, row: f64) -> bool {
        let value = self.edges[k][0] * x + row;
        value > 0.0 || value == 0.0 && self.takes_edge >> k & 1 == 1
    }

    /// The samples of row `y` inside the triangle, within columns `x0..x1` (whose
    /// coordinates are `xs`), as a half-open range of indices into `xs`.
    ///
    /// The inside of every edge is a half-line in x also in floating point, so the
    /// range is found by a division and then corrected by asking the edge itself.
    #[inline(always)]
    pub fn span(&self, xs: &[f64], y: f64, per_step: f64) -> (usize, usize) {
        let (mut first, mut end) = (0usize, xs.len());
        for k in 0..3 {
            if first >= end {
                return (0, 0);
            }
            let [cx, cy, c] = self.edges[k];
            let row = y * cy + c;
            if cx == 0.0 {
                if !self.inside_edge(k, 0.0, row) {
                    return (0, 0);
                }
                continue;
            }
            // Saturating casts: an edge that crosses far away, or an overflow, ends at
            // the border, from where the steps below correct it.
            let guess = ((-row / cx - xs[0]) * per_step).ceil() as i64;
            let mut at = guess.clamp(first as i64, end as i64) as usize;
            if cx > 0.0 {
                while at < end && !self.inside_edge(k, xs[at], row) {
                    at += 1;
                }
                while at > first && self.inside_edge(k, xs[at - 1], row) {
                    at -= 1;
                }
                first = at;
            } else {
                while at < end && self.inside_edge(k, xs[at], row) {
                    at += 1;
                }
                while at > first && !self.inside_edge(k, xs[at - 1], row) {
                    at -= 1;
                }
                end = at;
            }
        }
        (first, end)
    }
}

/// Closed sample bounds of the part in front of the near plane, one sample wider
/// than needed for rounding; `None` if it lies beside the image or behind.
fn sample_bounds(lens: &Lens, p: &[DVec3; 3]) -> Option<Bounds> {
    let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut take = |x: f64, y: f64| {
        (lo, hi) = ([lo[0].min(x), lo[1].min(y)], [hi[0].max(x), hi[1].max(y)]);
    };
    if !lens.perspective {
        p.iter().for_each(|c| take(c.x, c.y));
    } else {
        // Half the near distance: the bound may be wide, not narrow.
        let near = 0.5 * lens.near_m;
        for i in 0..3 {
            let (a, b) = (p[i], p[(i + 1) % 3]);
            if a.z >= near {
                let w = 1.0 / a.z;
                take(a.x * w, a.y * w);
            }
            if (a.z >= near) != (b.z >= near) {
                let c = a + (b - a) * ((near - a.z) / (b.z - a.z));
                take(c.x / near, c.y / near);
            }
        }
    }
    let last = [lens.grid.columns() - 1, lens.grid.rows() - 1].map(f64::from);
    // Sample coordinates; the rows run down.
    let x = [lo[0], hi[0]].map(|x| (x - lens.xs[0]) * lens.per_step[0]);
    let y = [hi[1], lo[1]].map(|y| (lens.ys[0] - y) * lens.per_step[1]);
    let ceil = |v: f64| (v - BOUND_SLACK).ceil().max(0.0);
    let floor = |v: f64, last: f64| (v + BOUND_SLACK).floor().min(last);
    let (x0, x1, y0, y1) = (ceil(x[0]), floor(x[1], last[0]), ceil(y[0]), floor(y[1], last[1]));
    (x0 <= x1 && y0 <= y1).then_some([x0 as u32, x1 as u32, y0 as u32, y1 as u32])
}
