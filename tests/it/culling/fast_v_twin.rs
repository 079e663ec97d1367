//! The naive twin of the walk by frusta: every frustum by itself and from its definition, all
//! triangles against all, polygons clipped in floating point, with slack to either side.

use super::build::Rng;
use super::fast_v_facts::Fast;
use super::portals::{build, cameras, facing};
use crate::common::soup;
use crate::structures::scene_of;
use cullmark::math::predicates::{Facing, facing as faces, facing_along};
use cullmark::math::{Camera, DVec3, View};
use cullmark::scene::Scene;
use std::collections::HashMap;

type Key = [u64; 3];

/// Slack widens frusta and lets less hide; negative slack does the opposite.
struct Twin<'a> {
    scene: &'a Scene,
    view: &'a View,
    /// In camera space.
    corners: Vec<[DVec3; 3]>,
    drawn: Vec<bool>,
    /// By edge: triangle and the corner opposite.
    edges: HashMap<(Key, Key), Vec<(usize, usize)>>,
    grow: usize,
    clipped: bool,
    slack: f64,
}

fn key(p: DVec3) -> Key {
    p.to_array().map(|x| (x + 0.0).to_bits())
}

/// The part of a polygon where `inside` is not negative.
fn cut(polygon: &[DVec3], inside: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut out = Vec::new();
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (inside(*a), inside(b));
        if da >= 0.0 {
            out.push(*a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            out.push(*a + (b - *a) * (da / (da - db)));
        }
    }
    out
}

impl<'a> Twin<'a> {
    fn new(scene: &'a Scene, view: &'a View, grow: usize, clipped: bool, slack: f64) -> Twin<'a> {
        let mut edges: HashMap<_, Vec<_>> = HashMap::new();
        for t in 0..scene.len() {
            let c = scene.corners(t as u32).map(key);
            for k in 0..3 {
                let (a, b) = (c[(k + 1) % 3], c[(k + 2) % 3]);
                edges.entry((a.min(b), a.max(b))).or_default().push((t, k));
            }
        }
        let drawn = |t: usize| {
            let [a, b, c] = scene.corners(t as u32);
            let facing = match view.is_perspective() {
                true => faces(a, b, c, view.eye),
                false => facing_along(a, b, c, view.forward),
            };
            scene.two_sided[t] || facing == Facing::Front
        };
        let corners = (0..scene.len() as u32).map(|t| scene.corners(t).map(|p| view.to_camera(p))).collect();
        let drawn = (0..scene.len()).map(drawn).collect();
        Twin { scene, view, corners, drawn, edges, grow, clipped, slack }
    }

    /// A polygon within the pyramid (or the column) over a cell.
    fn within(&self, polygon: &[DVec3], cell: [f64; 4], slack: f64) -> Vec<DVec3> {
        let [x0, y0, x1, y1] = [cell[0] - slack, cell[1] - slack, cell[2] + slack, cell[3] + slack];
        let w = |p: DVec3| if self.view.is_perspective() { p.z } else { 1.0 };
        let p = cut(polygon, |p| p.x - x0 * w(p));
        let p = cut(&p, |p| x1 * w(p) - p.x);
        let p = cut(&p, |p| p.y - y0 * w(p));
        cut(&p, |p| y1 * w(p) - p.y)
    }

    fn beyond_near(&self, t: usize) -> Vec<DVec3> {
        let near = self.view.camera.near_m * if self.slack > 0.0 { 0.5 } else { 1.0 + 1e-9 };
        let p = cut(&self.corners[t], |p| p.z - near);
        match self.view.camera.far_m {
            // Whole triangles are beyond the far plane or not.
            Some(far) if self.slack > 0.0 && p.iter().all(|p| p.z > far * (1.0 + self.slack)) => Vec::new(),
            Some(far) if self.slack < 0.0 => cut(&p, |p| far * (1.0 + self.slack) - p.z),
            _ => p,
        }
    }

    /// Twice the signed area of the image of a triangle, or of what orders it.
    fn orientation(&self, t: usize) -> f64 {
        let [a, b, c] = self.corners[t];
        let flat = |p: DVec3| DVec3::new(p.x, p.y, 1.0);
        if self.view.is_perspective() { a.dot(b.cross(c)) } else { flat(a).dot(flat(b).cross(flat(c))) }
    }

    /// The least and the greatest depth of its plane at the rays of a frustum; endless where
    /// a ray does not come to it.
    fn plane_depths(&self, t: usize, cell: [f64; 4]) -> [f64; 2] {
        let [a, b, c] = self.corners[t];
        let n = (b - a).cross(c - a);
        let at = |x: f64, y: f64| {
            let depth = match self.view.is_perspective() {
                true => n.dot(a) / n.dot(DVec3::new(x, y, 1.0)),
                false => (n.dot(a) - n.x * x - n.y * y) / n.z,
            };
            if depth > 0.0 || !self.view.is_perspective() { depth } else { f64::INFINITY }
        };
        let [x0, y0, x1, y1] = cell;
        let depths = [at(x0, y0), at(x1, y0), at(x1, y1), at(x0, y1)];
        [depths.into_iter().fold(f64::INFINITY, f64::min), depths.into_iter().fold(f64::NEG_INFINITY, f64::max)]
    }

    /// Depth of the farthest point of the blocker around `seed`, if there is one.
    fn blocker(&self, seed: usize, cell: [f64; 4]) -> Option<f64> {
        let (mut set, mut at, mut far) = (vec![seed], 0, f64::NEG_INFINITY);
        while at < set.len() {
            let t = set[at];
            at += 1;
            let part = self.within(&self.corners[t], cell, self.slack);
            let nearest = match self.slack > 0.0 {
                true => {
                    let corners = self.corners[t].iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
                    corners.max(self.plane_depths(t, cell)[0])
                }
                false => part.iter().map(|p| p.z).fold(f64::INFINITY, f64::min),
            };
            if nearest < self.view.camera.near_m * (1.0 + self.slack) {
                return None;
            }
            let deepest = part.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
            far = far.max(if self.clipped { deepest } else { self.plane_depths(t, cell)[1] });
            let c = self.scene.corners(t as u32).map(key);
            for k in 0..3 {
                let ends = [self.corners[t][(k + 1) % 3], self.corners[t][(k + 2) % 3]];
                let segment = cut(&[ends[0], ends[1]], |p| p.z - 0.5 * self.view.camera.near_m);
                if self.within(&segment, cell, self.slack).is_empty() {
                    continue;
                }
                let (a, b) = (c[(k + 1) % 3], c[(k + 2) % 3]);
                let other = self.edges[&(a.min(b), a.max(b))].iter().find(|(n, m)| {
                    let start = key(self.scene.corners(*n as u32)[(m + 1) % 3]);
                    let alike = (self.orientation(*n) > 0.0) == (self.orientation(t) > 0.0);
                    *n != t && self.blocks(*n) && alike != (start == a)
                })?;
                if !set.contains(&other.0) {
                    set.push(other.0);
                }
            }
            if set.len() > self.grow {
                return None;
            }
        }
        Some(far)
    }

    fn blocks(&self, t: usize) -> bool {
        self.drawn[t] && self.scene.occluder[t]
    }

    fn frustum(&self, cell: [f64; 4], seen: &mut [bool]) {
        let parts: Vec<Vec<DVec3>> =
            (0..self.scene.len()).map(|t| self.within(&self.beyond_near(t), cell, self.slack)).collect();
        let hit: Vec<usize> = (0..parts.len()).filter(|t| self.drawn[*t] && !parts[*t].is_empty()).collect();
        let blockers = hit.iter().filter(|t| self.blocks(**t)).filter_map(|t| self.blocker(*t, cell));
        let far = blockers.fold(f64::INFINITY, f64::min);
        for t in hit {
            let least = |p: &[DVec3]| p.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
            let nearest = if self.clipped { least(&parts[t]) } else { least(&self.corners[t]) };
            seen[t] |= nearest <= far * (1.0 + 4.0 * self.slack) || self.slack > 0.0 && nearest < 0.0;
        }
    }

    fn visible(&self, g: usize) -> Vec<bool> {
        let mut seen = vec![false; self.scene.len()];
        let (w, h) = (self.view.half_width, self.view.half_height);
        let line = |i: usize, half: f64| (2.0 * i as f64 / g as f64 - 1.0) * half;
        for k in 0..g * g {
            let (i, j) = (k % g, k / g);
            self.frustum([line(i, w), line(j, h), line(i + 1, w), line(j + 1, h)], &mut seen);
        }
        seen
    }
}

/// Sheets of welded triangles, folded at random, some two-sided, some of glass.
fn sheets(seed: u64) -> Scene {
    let mut rng = Rng::new(seed);
    let mut triangles = Vec::new();
    for _ in 0..5 {
        let (origin, along, across) = (rng.cube(8.0), rng.direction() * 1.5, rng.direction() * 1.5);
        let n = 2 + (rng.unit() * 3.0) as usize;
        let points: Vec<DVec3> = (0..(n + 1) * (n + 1))
            .map(|k| origin + along * (k % (n + 1)) as f64 + across * (k / (n + 1)) as f64 + rng.cube(0.4))
            .collect();
        for k in 0..n * n {
            let at = |i: usize, j: usize| points[(k / n + j) * (n + 1) + k % n + i];
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            let flip = rng.unit() < 0.1;
            triangles.extend([if flip { [a, c, b] } else { [a, b, c] }, [a, c, d]]);
        }
    }
    let mut scene = scene_of(&format!("sheets {seed}"), &triangles);
    for t in 0..scene.len() {
        scene.two_sided[t] = rng.unit() < 0.6;
        scene.occluder[t] = rng.unit() < 0.95;
    }
    scene
}

#[test]
fn it_is_what_the_definition_says_frustum_by_frustum() {
    let (mut kept, mut spared, mut blocked) = (0, 0, 0);
    for seed in 0..24 {
        let scene = if seed % 4 == 3 { soup(seed, 120, 6.0, 6.0) } else { sheets(seed) };
        let h = build(["octree", "list:leaf_size=1", "kd_tree"][seed as usize % 3], &scene);
        let mut rng = Rng::new(seed + 100);
        for camera in cameras(14.0) {
            let eye = rng.direction() * rng.range(3.0, 16.0);
            let view = View::new(&Camera { near_m: 0.5, ..camera }, &facing(eye, rng.cube(3.0) - eye));
            for (g, grow) in [(1, 256), (4, 256), (16, 256), (8, 1), (8, 4)] {
                for (depth, clipped) in [("plane", false), ("clipped", true)] {
                    let walk = format!("fast_v:g={g},grow={grow},depth={depth}");
                    let got = Fast::new(&scene, &h, "none", &walk).triangles(&view);
                    let tight = Twin::new(&scene, &view, grow, clipped, -1e-7).visible(g);
                    let loose = Twin::new(&scene, &view, grow, false, 1e-7).visible(g);
                    for t in 0..scene.len() {
                        assert!(got[t] || !tight[t], "{} {walk} loses {t}", scene.name);
                        // Cut by the near plane, it is taken for what its rectangle holds.
                        let cut = scene.corners(t as u32).iter().any(|p| view.to_camera(*p).z < 0.5);
                        assert!(loose[t] || !got[t] || cut, "{} {walk} keeps {t}", scene.name);
                    }
                    if !clipped {
                        kept += got.iter().filter(|g| **g).count();
                        let whole = |t: u32| scene.corners(t).iter().all(|p| view.to_camera(*p).z >= 0.5);
                        let differs = |t: &u32| loose[*t as usize] && !tight[*t as usize] && whole(*t);
                        spared += (0..scene.len() as u32).filter(differs).count();
                    }
                    blocked += Fast::new(&scene, &h, "none", &walk).frame(&view).1.blockers;
                }
            }
        }
    }
    assert!(blocked > 1000, "{blocked} blockers are too few to compare");
    assert!(spared * 50 < kept, "the two twins are one but for {spared} of {kept}");
}
