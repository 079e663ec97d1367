//! Terrain as a height grid that map makers knead, triangulated adaptively:
//! right-triangulated irregular network (Evans, Kirkpatrick, Townsend 2001), which
//! has no cracks and spends triangles where the ground is not flat.

use super::builder::{Builder, v3};
use crate::math::{DVec2, DVec3};

/// Heights over the square [-half, half]^2.
pub(super) struct Terrain {
    pub half: f64,
    /// Cells a side, a power of two.
    cells: usize,
    heights: Vec<f64>,
    /// Roads: lines and half widths. Their edges are kept in the triangulation.
    roads: Vec<(Vec<DVec3>, f64)>,
}

impl Terrain {
    pub fn new(half: f64, cells: usize, height: impl Fn(f64, f64) -> f64) -> Terrain {
        assert!(cells.is_power_of_two());
        let mut t = Terrain { half, cells, heights: vec![0.0; (cells + 1) * (cells + 1)], roads: Vec::new() };
        t.shape(|x, y, _| height(x, y));
        t
    }

    /// Replaces every height by `f(x, y, height)`.
    pub fn shape(&mut self, f: impl Fn(f64, f64, f64) -> f64) {
        let n = self.cells + 1;
        for i in 0..n * n {
            let p = self.place(i % n, i / n);
            self.heights[i] = f(p.x, p.y, self.heights[i]);
        }
    }

    fn place(&self, i: usize, j: usize) -> DVec2 {
        let step = 2.0 * self.half / self.cells as f64;
        DVec2::new(i as f64 * step - self.half, j as f64 * step - self.half)
    }

    /// Brings the box between two corners to height `z`, blending out over `blend` metres.
    pub fn flatten(&mut self, a: DVec2, b: DVec2, z: f64, blend: f64) {
        let (lo, hi) = (a.min(b), a.max(b));
        self.shape(|x, y, h| {
            let p = DVec2::new(x, y);
            let d = (p - p.clamp(lo, hi)).length();
            mix(h, z, 1.0 - d / blend)
        });
    }

    /// Brings a band along a polyline to the polyline's own height.
    pub fn lay(&mut self, line: &[DVec3], half_width: f64, blend: f64) {
        self.shape(|x, y, h| {
            let (d, z) = nearest(line, x, y);
            mix(h, z, 1.0 - (d - half_width) / blend)
        });
    }

    /// Makes a band along a polyline a road, for [`Terrain::on_road`].
    pub fn pave(&mut self, line: &[DVec3], half_width: f64) {
        self.roads.push((line.to_vec(), half_width));
    }

    pub fn on_road(&self, p: DVec3) -> bool {
        self.roads.iter().any(|(line, half)| {
            let (d, z) = nearest(line, p.x, p.y);
            d < *half && (z - p.z).abs() < 1.5
        })
    }

    /// Height at a point, between the grid's points.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let scale = self.cells as f64 / (2.0 * self.half);
        let (u, v) = ((x + self.half) * scale, (y + self.half) * scale);
        let top = self.cells as f64 - 1.0;
        let (i, j) = (u.floor().clamp(0.0, top), v.floor().clamp(0.0, top));
        let (s, t) = ((u - i).clamp(0.0, 1.0), (v - j).clamp(0.0, 1.0));
        let n = self.cells + 1;
        let at = |i: usize, j: usize| self.heights[j * n + i];
        let (i, j) = (i as usize, j as usize);
        let low = at(i, j) * (1.0 - s) + at(i + 1, j) * s;
        let high = at(i, j + 1) * (1.0 - s) + at(i + 1, j + 1) * s;
        low * (1.0 - t) + high * t
    }

    /// Largest error of leaving out each grid point, children's included.
    fn errors(&self) -> Vec<f64> {
        let (n, size) = (self.cells, self.cells + 1);
        let mut errors = vec![0.0f64; size * size];
        let step = 2.0 * self.half / n as f64;
        for (line, half) in &self.roads {
            for (i, e) in errors.iter_mut().enumerate() {
                let p = self.place(i % size, i / size);
                if (nearest(line, p.x, p.y).0 - half).abs() < step * 0.8 {
                    // More than any tolerance.
                    *e = 2.0;
                }
            }
        }
        let triangles = 2 * n * n - 2;
        let parents = triangles - n * n;
        for i in (0..triangles).rev() {
            let mut id = i + 2;
            let (mut a, mut b, mut c) = if id & 1 == 1 { ([0, 0], [n, n], [n, 0]) } else { ([n, n], [0, 0], [0, n]) };
            while id / 2 > 1 {
                id /= 2;
                let m = middle(a, b);
                (a, b, c) = if id & 1 == 1 { (c, a, m) } else { (b, c, m) };
            }
            let at = |p: [usize; 2]| p[1] * size + p[0];
            let m = middle(a, b);
            let error = ((self.heights[at(a)] + self.heights[at(b)]) * 0.5 - self.heights[at(m)]).abs();
            let mut worst = errors[at(m)].max(error);
            if i < parents {
                worst = worst.max(errors[at(middle(a, c))]).max(errors[at(middle(b, c))]);
            }
            errors[at(m)] = worst;
        }
        errors
    }

    /// The triangulation with the least tolerance that needs at most `budget`
    /// triangles (or the coarsest tried, if none does).
    fn triangulate(&self, budget: usize) -> Vec<[[usize; 2]; 3]> {
        let errors = self.errors();
        let n = self.cells;
        let mut best = Vec::new();
        for tolerance in [1.2, 0.8, 0.55, 0.4, 0.28, 0.2, 0.14, 0.1, 0.07, 0.05, 0.03] {
            let mut out = Vec::new();
            let mut pending = vec![[[0, 0], [n, n], [n, 0]], [[n, n], [0, 0], [0, n]]];
            while let Some([a, b, c]) = pending.pop() {
                let m = middle(a, b);
                if a[0].abs_diff(c[0]) + a[1].abs_diff(c[1]) > 1 && errors[m[1] * (n + 1) + m[0]] > tolerance {
                    pending.extend([[c, a, m], [b, c, m]]);
                } else {
                    // These run clockwise; the ground faces up.
                    out.push([a, c, b]);
                }
            }
            if !best.is_empty() && out.len() > budget {
                break;
            }
            best = out;
        }
        best
    }

    /// Emits the ground as a closed solid down to `bottom`. `paint` names the
    /// material of a triangle from its centre and unit normal.
    pub fn emit(&self, b: &mut Builder, bottom: f64, budget: usize, paint: impl Fn(DVec3, DVec3) -> &'static str) {
        let n = self.cells;
        let point = |p: [usize; 2]| self.place(p[0], p[1]).extend(self.heights[p[1] * (n + 1) + p[0]]);
        let triangles = self.triangulate(budget);
        for t in &triangles {
            let [p, q, r] = t.map(point);
            b.paint(paint((p + q + r) / 3.0, (q - p).cross(r - p).normalize()));
            b.tri(p, q, r);
        }
        b.paint("rock_underground");
        let low = |p: DVec3| DVec3::new(p.x, p.y, bottom);
        for t in &triangles {
            for k in 0..3 {
                let (p, q) = (t[k], t[(k + 1) % 3]);
                let rim = (0..2).any(|axis| p[axis] == q[axis] && (p[axis] == 0 || p[axis] == n));
                if rim {
                    let (p, q) = (point(p), point(q));
                    b.quad(low(p), low(q), q, p);
                }
            }
        }
        let h = self.half;
        b.quad(v3(-h, h, bottom), v3(h, h, bottom), v3(h, -h, bottom), v3(-h, -h, bottom));
    }
}

fn middle(a: [usize; 2], b: [usize; 2]) -> [usize; 2] {
    [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]
}

/// `a` at weight 0 and below, `b` at 1 and above, smooth between.
pub(super) fn mix(a: f64, b: f64, weight: f64) -> f64 {
    let w = weight.clamp(0.0, 1.0);
    let w = w * w * (3.0 - 2.0 * w);
    a + (b - a) * w
}

/// Distance to a polyline in the plane, and the line's height there.
pub(super) fn nearest(line: &[DVec3], x: f64, y: f64) -> (f64, f64) {
    let p = DVec2::new(x, y);
    let mut best = (f64::INFINITY, 0.0);
    for s in line.windows(2) {
        let (a, d) = (s[0].truncate(), (s[1] - s[0]).truncate());
        let t = ((p - a).dot(d) / d.length_squared().max(1e-12)).clamp(0.0, 1.0);
        let distance = (p - a - d * t).length();
        if distance < best.0 {
            best = (distance, s[0].z + (s[1].z - s[0].z) * t);
        }
    }
    best
}

/// Smooth noise in about [-1, 1] with features of one unit, from an integer hash.
pub(super) fn noise(seed: u64, x: f64, y: f64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let lattice = |di: i64, dj: i64| {
        let mut h = seed ^ (i as i64 + di).wrapping_mul(0x9E37_79B9_7F4A_7C15u64 as i64) as u64;
        h = (h ^ (j as i64 + dj).wrapping_mul(0xC2B2_AE3D_27D4_EB4Fu64 as i64) as u64)
            .wrapping_mul(0xFF51_AFD7_ED55_8CCD);
        h = (h ^ (h >> 32)).wrapping_mul(0xC4CE_B9FE_1A85_EC53);
        (h >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let (s, t) = (x - i, y - j);
    let low = mix(lattice(0, 0), lattice(1, 0), s);
    let high = mix(lattice(0, 1), lattice(1, 1), s);
    mix(low, high, t)
}

/// Four octaves of [`noise`].
pub(super) fn hills(seed: u64, x: f64, y: f64) -> f64 {
    (0..4).map(|o| noise(seed + o, x * f64::from(1 << o), y * f64::from(1 << o)) / f64::from(1 << o)).sum()
}
