//! Which triangles are seen from a point, all around: an item buffer on the six faces of a
//! cube, by samples at the centres of pixels.
//!
//! A lower bound of what is visible, for visibility that is sampled beforehand. Scalar; a
//! vertex is placed once for all faces, and a triangle looks at the faces that it may meet.

use super::Kind;
use crate::math::DVec3;

/// The triangles of a scene.
#[derive(Debug, Clone, Default)]
pub struct Items {
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    pub kinds: Vec<Kind>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Pixels along an edge of the cube.
    pub resolution_px: u32,
    /// Nothing nearer is seen or hides, by depth on the face.
    pub near_m: f64,
}

/// By face, its axes across and along: numbers of axes, and the sign of the one along.
const FACES: [([usize; 3], f32); 6] =
    [([1, 2, 0], 1.0), ([1, 2, 0], -1.0), ([2, 0, 1], 1.0), ([2, 0, 1], -1.0), ([0, 1, 2], 1.0), ([0, 1, 2], -1.0)];

/// The six diagonal planes that bound the faces: bit `i` says that the point is below
/// plane `i`. By face, what all of a triangle's points must be below, and above, for it
/// to miss the face.
const MISSES: [(u8, u8); 6] = [
    (0b00_1111, 0),
    (0, 0b00_1111),
    (0b11_0010, 0b00_0001),
    (0b00_0001, 0b11_0010),
    (0b10_1000, 0b01_0100),
    (0b01_0100, 0b10_1000),
];

fn below(p: [f32; 3]) -> u8 {
    let [x, y, z] = p;
    [x - y, x + y, x - z, x + z, y - z, y + z].iter().enumerate().fold(0, |m, (i, d)| m | u8::from(*d < 0.0) << i)
}

/// A corner on a face: pixels across, and 1 / depth.
type Corner = [f32; 3];

const NOTHING: u32 = u32::MAX;

struct Face {
    size: usize,
    /// 1 / depth of what is nearest, 0 of nothing.
    nearness: Vec<f32>,
    items: Vec<u32>,
}

impl Items {
    pub fn bytes(&self) -> usize {
        size_of_val(&self.positions[..]) + size_of_val(&self.triangles[..]) + self.kinds.len()
    }

    /// Triangles that samples around `eye` see, ascending, and how many samples each.
    pub fn seen_from(&self, eye: DVec3, lens: Lens) -> Vec<(u32, u32)> {
        let points: Vec<([f32; 3], u8)> =
            self.positions.iter().map(|p| (*p - eye).as_vec3().to_array()).map(|p| (p, below(p))).collect();
        let size = lens.resolution_px as usize;
        let empty = || Face { size, nearness: vec![0.0; size * size], items: vec![NOTHING; size * size] };
        let mut faces: [Face; 6] = std::array::from_fn(|_| empty());
        let near = lens.near_m as f32;
        let mut clear = Vec::new();
        for (t, corners) in (0u32..).zip(&self.triangles) {
            let kind = self.kinds[t as usize];
            if kind == Kind::Clear {
                clear.push(t);
                continue;
            }
            self.each_face(&points, *corners, kind == Kind::OneSided, near, size, |face, fan| {
                faces[face].fill(fan, |nearness, item, at| {
                    if at > *nearness {
                        (*nearness, *item) = (at, t);
                    }
                });
            });
        }
        let mut seen: Vec<u32> = faces.iter().flat_map(|f| f.items.iter().copied()).filter(|t| *t != NOTHING).collect();
        // What is seen through hides nothing; both its sides are drawn.
        for t in clear {
            self.each_face(&points, self.triangles[t as usize], false, near, size, |face, fan| {
                faces[face].fill(fan, |nearness, _, at| {
                    if at >= *nearness {
                        seen.push(t);
                    }
                });
            });
        }
        seen.sort_unstable();
        seen.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as u32)).collect()
    }

    /// Calls `draw` with the fan of the triangle on every face that it may meet.
    fn each_face(
        &self,
        points: &[([f32; 3], u8)],
        corners: [u32; 3],
        one_sided: bool,
        near: f32,
        size: usize,
        mut draw: impl FnMut(usize, &[Corner]),
    ) {
        let c = corners.map(|v| points[v as usize]);
        let [p, q, r] = c.map(|c| c.0);
        if one_sided {
            // Front faces have the eye, which is the origin, on the side of their normal.
            let cross = [q[1] * r[2] - q[2] * r[1], q[2] * r[0] - q[0] * r[2], q[0] * r[1] - q[1] * r[0]];
            if p[0] * cross[0] + p[1] * cross[1] + p[2] * cross[2] >= 0.0 {
                return;
            }
        }
        let (all, none) = (c[0].1 & c[1].1 & c[2].1, !(c[0].1 | c[1].1 | c[2].1));
        for (face, (if_all, if_none)) in MISSES.iter().enumerate() {
            if all & if_all != 0 || none & if_none != 0 {
                continue;
            }
            let ([u, v, w], sign) = FACES[face];
            let turned = [p, q, r].map(|p| [p[u], p[v], p[w] * sign]);
            let mut fan = [[0.0; 3]; 4];
            let mut count = 0;
            let half = size as f32 * 0.5;
            let mut put = |p: [f32; 3]| {
                let scale = 1.0 / p[2];
                fan[count] = [p[0] * scale * half + half, p[1] * scale * half + half, scale];
                count += 1;
            };
            for i in 0..3 {
                let (a, b) = (turned[i], turned[(i + 1) % 3]);
                if a[2] >= near {
                    put(a);
                }
                if (a[2] >= near) != (b[2] >= near) {
                    let part = (near - a[2]) / (b[2] - a[2]);
                    put([a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part, near]);
                }
            }
            if count >= 3 {
                draw(face, &fan[..count]);
            }
        }
    }
}

impl Face {
    /// Calls `sample` with nearness and item of each pixel whose centre is in the fan, and
    /// the fan's nearness there.
    fn fill(&mut self, fan: &[Corner], mut sample: impl FnMut(&mut f32, &mut u32, f32)) {
        for i in 1..fan.len() - 1 {
            self.fill_triangle([fan[0], fan[i], fan[i + 1]], &mut sample);
        }
    }

    #[inline]
    fn fill_triangle(&mut self, [a, mut b, mut c]: [Corner; 3], sample: &mut impl FnMut(&mut f32, &mut u32, f32)) {
        // In f64, so that neighbours leave no gap to speak of.
        let area = |a: Corner, b: Corner, c: Corner| {
            let d = |p: Corner, k: usize| f64::from(p[k]) - f64::from(a[k]);
            d(b, 0) * d(c, 1) - d(b, 1) * d(c, 0)
        };
        let mut twice = area(a, b, c);
        if twice < 0.0 {
            std::mem::swap(&mut b, &mut c);
            twice = -twice;
        }
        let size = self.size as f32;
        let least = |k: usize| (a[k].min(b[k]).min(c[k]) - 0.5).ceil().clamp(0.0, size) as usize;
        let end = |k: usize| ((a[k].max(b[k]).max(c[k]) - 0.5).floor() + 1.0).clamp(0.0, size) as usize;
        let (columns, rows) = (least(0)..end(0), least(1)..end(1));
        if columns.is_empty() || rows.is_empty() || twice == 0.0 || !twice.is_finite() {
            return;
        }
        // Weight of the corner opposite to each edge, at the first sample, and its steps.
        let edge = |p: Corner, q: Corner| {
            let (dx, dy) = (f64::from(q[0]) - f64::from(p[0]), f64::from(q[1]) - f64::from(p[1]));
            let at = |x: f64, y: f64| dx * (y - f64::from(p[1])) - dy * (x - f64::from(p[0]));
            [at(columns.start as f64 + 0.5, rows.start as f64 + 0.5), -dy, dx]
        };
        let edges = [edge(b, c), edge(c, a), edge(a, b)];
        let nearness = [a, b, c].map(|p| f64::from(p[2]) / twice);
        let slope = |k: usize| (0..3).map(|i| edges[i][k] * nearness[i]).sum::<f64>();
        let (first, across, down) = (slope(0), slope(1), slope(2));
        for (j, y) in rows.enumerate() {
            let row = edges.map(|e| e[0] + e[2] * j as f64);
            let near = first + down * j as f64;
            let from = y * self.size;
            for (i, x) in columns.clone().enumerate() {
                let i = i as f64;
                if (0..3).all(|k| row[k] + edges[k][1] * i >= 0.0) {
                    sample(&mut self.nearness[from + x], &mut self.items[from + x], (near + across * i) as f32);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::Spec;
    use crate::scene::{Scene, generate};

    fn items(scene: &Scene) -> Items {
        Items {
            positions: scene.positions.clone(),
            triangles: scene.triangles.clone(),
            kinds: (0..scene.len() as u32).map(|t| Kind::of(scene, t)).collect(),
        }
    }

    /// The naive twin: a ray for each sample, against every triangle.
    #[test]
    fn samples_see_what_single_rays_see() {
        let mut scene = generate::make(&Spec::parse("walls:walls=30,sides=5,radius_m=20,slope_deg=30").unwrap())
            .unwrap()
            .0
            .generate();
        for t in 0..scene.len() {
            scene.two_sided[t] = t % 5 == 0;
            scene.occluder[t] = t % 7 != 0;
        }
        let items = items(&scene);
        let lens = Lens { resolution_px: 12, near_m: 0.1 };
        for k in 0..6 {
            let eye = scene.bounds().centre() + DVec3::new(0.31, 0.17, -0.23) * f64::from(k) * 3.0;
            let mut want = vec![0u32; scene.len()];
            let mut total = 0;
            for (axes, sign) in FACES {
                for (i, j) in (0..144).map(|n| (n % 12, n / 12)) {
                    let mut ray = DVec3::ZERO;
                    let at = |n: i32| (f64::from(n) + 0.5) / 6.0 - 1.0;
                    (ray[axes[0]], ray[axes[1]], ray[axes[2]]) = (at(i), at(j), f64::from(sign));
                    let depth = |t: u32| {
                        let [a, b, c] = scene.corners(t).map(|p| p - eye);
                        let s = [a.cross(b).dot(ray), b.cross(c).dot(ray), c.cross(a).dot(ray)];
                        let (front, back) = (s.iter().all(|s| *s <= 0.0), s.iter().all(|s| *s >= 0.0));
                        let kind = items.kinds[t as usize];
                        let normal = (b - a).cross(c - a);
                        let depth = a.dot(normal) / ray.dot(normal);
                        ((front || back && kind != Kind::OneSided) && depth >= 0.1).then_some(depth)
                    };
                    let hits: Vec<(u32, f64)> =
                        (0..scene.len() as u32).filter_map(|t| depth(t).map(|d| (t, d))).collect();
                    let solid = hits.iter().filter(|(t, _)| scene.occluder[*t as usize]);
                    let nearest = solid.min_by(|a, b| a.1.total_cmp(&b.1));
                    let seen = |(t, d): &&(u32, f64)| !scene.occluder[*t as usize] && nearest.is_none_or(|n| *d <= n.1);
                    hits.iter().filter(seen).chain(nearest).for_each(|(t, _)| {
                        want[*t as usize] += 1;
                        total += 1;
                    });
                }
            }
            let mut got = vec![0u32; scene.len()];
            items.seen_from(eye, lens).iter().for_each(|(t, n)| got[*t as usize] = *n);
            let differ: u32 = want.iter().zip(&got).map(|(a, b)| a.abs_diff(*b)).sum();
            // f32 places corners a little beside where they are.
            assert!(differ * 200 <= total, "{differ} of {total} samples differ");
        }
    }

    #[test]
    fn nothing_is_seen_of_nothing_and_from_within_flat_things() {
        let lens = Lens { resolution_px: 8, near_m: 0.1 };
        assert!(Items::default().seen_from(DVec3::ZERO, lens).is_empty());
        let flat = Items {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X * 2.0, DVec3::NAN],
            triangles: vec![[0, 1, 2], [0, 1, 3], [0, 0, 0], [0, 1, 4]],
            kinds: vec![Kind::TwoSided; 4],
        };
        assert!(flat.seen_from(DVec3::ZERO, lens).is_empty(), "edge-on, without area, nowhere");
        let above = flat.seen_from(DVec3::new(0.2, 0.2, 0.5), lens);
        assert!(above.len() == 1 && above[0].0 == 0 && above[0].1 > 5, "{above:?}");
    }
}
