//! Closed solids, outward and counter-clockwise: whatever union they form, a ray
//! from free space meets a front face first.

use super::builder::{Builder, v3};
use crate::math::{DVec2, DVec3};

/// Direction of an extrusion, and what its section's (u, v) mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Along {
    /// Section in (y, z).
    X,
    /// Section in (x, z).
    Y,
    /// Section in (x, y).
    Z,
}

impl Along {
    fn point(self, u: f64, v: f64, w: f64) -> DVec3 {
        match self {
            Along::X => v3(w, u, v),
            Along::Y => v3(u, w, v),
            Along::Z => v3(u, v, w),
        }
    }

    /// (x, z, y) is left-handed, so sections along y turn round.
    fn mirrored(self) -> bool {
        self == Along::Y
    }
}

/// `[u0, v0, u1, v1]`.
pub(super) type Rect = [f64; 4];

impl Builder {
    fn face(&mut self, along: Along, corners: [[f64; 3]; 4]) {
        let [a, b, c, d] = corners.map(|[u, v, w]| along.point(u, v, w));
        if along.mirrored() { self.quad(a, d, c, b) } else { self.quad(a, b, c, d) }
    }

    /// An axis-aligned box of the frame. 12 triangles.
    pub fn block(&mut self, lo: DVec3, hi: DVec3) {
        self.panel(Along::Z, [lo.x, lo.y, hi.x, hi.y], &[], lo.z, hi.z);
    }

    /// A box given by the centre of its base and its size.
    pub fn block_on(&mut self, base: DVec3, size: DVec3) {
        let half = v3(size.x * 0.5, size.y * 0.5, 0.0);
        self.block(base - half, base + half + v3(0.0, 0.0, size.z));
    }

    /// A slab with rectangular holes right through it: a wall with doors and
    /// windows, a floor with a stairwell. Columns between the holes' edges keep
    /// the triangles few; neighbouring columns may meet in T-junctions on a common line.
    pub fn panel(&mut self, along: Along, rect: Rect, holes: &[Rect], w0: f64, w1: f64) {
        let [u0, v0, u1, v1] = rect;
        let mut cuts: Vec<f64> = vec![u0, u1];
        cuts.extend(holes.iter().flat_map(|h| [h[0], h[2]]).filter(|u| *u > u0 && *u < u1));
        cuts.sort_by(f64::total_cmp);
        cuts.dedup();
        let mut columns: Vec<(f64, f64, Vec<[f64; 2]>)> = Vec::new();
        for pair in cuts.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let mut spans = vec![[v0, v1]];
            for h in holes.iter().filter(|h| h[0] < b && h[2] > a) {
                spans = subtract(&spans, &[[h[1], h[3]]]);
            }
            match columns.last_mut() {
                Some(last) if last.2 == spans => last.1 = b,
                _ => columns.push((a, b, spans)),
            }
        }
        let nothing: Vec<[f64; 2]> = Vec::new();
        for (i, (a, b, spans)) in columns.iter().enumerate() {
            let (a, b) = (*a, *b);
            for [p, q] in spans.iter().copied() {
                self.face(along, [[a, p, w1], [b, p, w1], [b, q, w1], [a, q, w1]]);
                self.face(along, [[a, p, w0], [a, q, w0], [b, q, w0], [b, p, w0]]);
                self.face(along, [[a, p, w0], [b, p, w0], [b, p, w1], [a, p, w1]]);
                self.face(along, [[a, q, w1], [b, q, w1], [b, q, w0], [a, q, w0]]);
            }
            let left = if i == 0 { &nothing } else { &columns[i - 1].2 };
            for [p, q] in subtract(spans, left) {
                self.face(along, [[a, p, w0], [a, p, w1], [a, q, w1], [a, q, w0]]);
            }
            let right = columns.get(i + 1).map_or(&nothing, |c| &c.2);
            for [p, q] in subtract(spans, right) {
                self.face(along, [[b, p, w1], [b, p, w0], [b, q, w0], [b, q, w1]]);
            }
        }
    }

    /// A simple polygon (counter-clockwise in its section) drawn out from `w0` to `w1`.
    pub fn extrude(&mut self, along: Along, section: &[DVec2], w0: f64, w1: f64) {
        let flip = along.mirrored();
        let put = |b: &mut Builder, p: [(DVec2, f64); 3]| {
            let [a, c, d] = p.map(|(s, w)| along.point(s.x, s.y, w));
            if flip { b.tri(a, d, c) } else { b.tri(a, c, d) }
        };
        for [i, j, k] in ears(section) {
            let (a, b, c) = (section[i], section[j], section[k]);
            put(self, [(a, w1), (b, w1), (c, w1)]);
            put(self, [(a, w0), (c, w0), (b, w0)]);
        }
        for (i, a) in section.iter().enumerate() {
            let b = section[(i + 1) % section.len()];
            put(self, [(*a, w0), (b, w0), (b, w1)]);
            put(self, [(*a, w0), (b, w1), (*a, w1)]);
        }
    }

    /// A solid of revolution about z: `profile` holds (radius, z) from the bottom
    /// up, `scale` squeezes x and y. A radius of 0 at an end is a tip; other ends are capped.
    pub fn lathe(&mut self, profile: &[(f64, f64)], sides: usize, scale: (f64, f64)) {
        self.lathe_with(profile, sides, |c, s, (r, z), _, _| v3(c * r * scale.0, s * r * scale.1, z));
    }

    /// A lathe whose point at (ring, side) is the caller's to place; the rings must
    /// stay nested in order so that the surface does not cross itself.
    pub fn lathe_with(
        &mut self,
        profile: &[(f64, f64)],
        sides: usize,
        place: impl Fn(f64, f64, (f64, f64), usize, usize) -> DVec3,
    ) {
        let ring = |i: usize| -> Vec<DVec3> {
            (0..sides)
                .map(|s| {
                    let angle = std::f64::consts::TAU * s as f64 / sides as f64;
                    // A tip is one point whatever the side.
                    let side = if profile[i].0 == 0.0 { 0 } else { s };
                    place(libm::cos(angle), libm::sin(angle), profile[i], i, side)
                })
                .collect()
        };
        let mut below = ring(0);
        for s in 1..sides - 1 {
            self.tri(below[0], below[s + 1], below[s]);
        }
        for i in 1..profile.len() {
            let above = ring(i);
            for s in 0..sides {
                let n = (s + 1) % sides;
                if profile[i - 1].0 == 0.0 {
                    self.tri(below[s], above[n], above[s]);
                } else if profile[i].0 == 0.0 {
                    self.tri(below[s], below[n], above[s]);
                } else {
                    self.quad(below[s], below[n], above[n], above[s]);
                }
            }
            below = above;
        }
        for s in 1..sides - 1 {
            self.tri(below[0], below[s], below[s + 1]);
        }
    }

    /// An upright cylinder or, with different radii, a cone's piece.
    pub fn column(&mut self, base: DVec3, r0: f64, r1: f64, height: f64, sides: usize) {
        self.within(super::builder::Frame::at(base), |b| b.lathe(&[(r0, 0.0), (r1, height)], sides, (1.0, 1.0)));
    }

    /// A round bar between two points, capped.
    pub fn tube(&mut self, from: DVec3, to: DVec3, radius: f64, sides: usize) {
        let w = (to - from).normalize();
        let helper = if w.z.abs() < 0.9 { DVec3::Z } else { DVec3::X };
        let u = helper.cross(w).normalize();
        let v = w.cross(u);
        let length = (to - from).length();
        self.lathe_with(&[(radius, 0.0), (radius, length)], sides, |c, s, (r, z), _, _| {
            from + u * (c * r) + v * (s * r) + w * z
        });
    }

    /// A square beam between two points, one pair of its faces upright.
    pub fn beam(&mut self, from: DVec3, to: DVec3, width: f64, height: f64) {
        let w = (to - from).normalize();
        let u = if w.z.abs() < 0.99 { w.cross(DVec3::Z).normalize() } else { DVec3::X };
        let v = u.cross(w);
        let (u, v) = (u * (width * 0.5), v * (height * 0.5));
        // u x v points back along the beam, so a section in this order faces `to` when seen from ahead.
        let ring = |p: DVec3| [p - u - v, p - u + v, p + u + v, p + u - v];
        let (a, b) = (ring(from), ring(to));
        self.hexahedron([a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]);
    }

    /// Six-sided solid: base 0..4 counter-clockwise seen from the top, top 4..8 above it.
    pub fn hexahedron(&mut self, c: [DVec3; 8]) {
        self.quad(c[3], c[2], c[1], c[0]);
        self.quad(c[4], c[5], c[6], c[7]);
        for i in 0..4 {
            let j = (i + 1) % 4;
            self.quad(c[i], c[j], c[j + 4], c[i + 4]);
        }
    }

    /// A flight of slabs rather than a solid: one can pass under it.
    pub fn open_stairs(&mut self, lo: DVec3, hi: DVec3, steps: usize, thickness: f64) {
        let (run, rise) = ((hi.x - lo.x) / steps as f64, (hi.z - lo.z) / steps as f64);
        let mut section = vec![
            DVec2::new(lo.x, lo.z),
            DVec2::new(lo.x + run * 0.8, lo.z),
            DVec2::new(hi.x, hi.z - rise - thickness),
            DVec2::new(hi.x, hi.z),
        ];
        for s in (1..=steps).rev() {
            let x = lo.x + run * (s - 1) as f64;
            section.push(DVec2::new(x, lo.z + rise * s as f64));
            if s > 1 {
                section.push(DVec2::new(x, lo.z + rise * (s - 1) as f64));
            }
        }
        self.extrude(Along::Y, &section, lo.y, hi.y);
    }
}

/// `spans` without `holes`; both are lists of intervals.
fn subtract(spans: &[[f64; 2]], holes: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut left = spans.to_vec();
    for [h0, h1] in holes.iter().copied() {
        left = left.into_iter().flat_map(|[a, b]| [[a, b.min(h0)], [a.max(h1), b]]).filter(|[a, b]| b > a).collect();
    }
    left
}

/// Triangles of a simple counter-clockwise polygon by cutting ears: quadratic,
/// and our sections are small.
fn ears(polygon: &[DVec2]) -> Vec<[usize; 3]> {
    let cross = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - a);
    let mut rest: Vec<usize> = (0..polygon.len()).collect();
    let mut out = Vec::with_capacity(polygon.len());
    while rest.len() > 3 {
        let n = rest.len();
        let ear = (0..n).find(|&i| {
            let [a, b, c] = [rest[(i + n - 1) % n], rest[i], rest[(i + 1) % n]].map(|i| polygon[i]);
            // A point on the border of an ear would leave a sliver behind, so borders count.
            cross(a, b, c) > 1e-12
                && rest
                    .iter()
                    .map(|i| polygon[*i])
                    .filter(|p| *p != a && *p != b && *p != c)
                    .all(|p| !(cross(a, b, p) >= -1e-12 && cross(b, c, p) >= -1e-12 && cross(c, a, p) >= -1e-12))
        });
        let i = ear.expect("sections are simple and counter-clockwise");
        out.push([rest[(i + n - 1) % n], rest[i], rest[(i + 1) % n]]);
        rest.remove(i);
    }
    out.push([rest[0], rest[1], rest[2]]);
    out
}
