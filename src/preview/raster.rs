//! The z-buffer: clips, projects and fills triangles, band by band.

use super::{Look, Style};
use crate::math::{DVec3, View};
use crate::scene::Scene;
use rayon::prelude::*;

pub(super) const NONE: u32 = u32::MAX;
/// Rows a task rasterises.
const BAND: usize = 32;

/// A triangle on the screen: pixels and, linear in screen space, `q` (reciprocal
/// depth in perspective, minus depth otherwise) and world height times that weight.
#[derive(Clone, Copy)]
struct Projected {
    id: u32,
    x: [f64; 3],
    y: [f64; 3],
    q: [f64; 3],
    height: [f64; 3],
    back: bool,
    ghost: bool,
}

pub(super) struct Buffers {
    /// Larger is nearer.
    pub q: Vec<f32>,
    /// Triangle, or [`NONE`]; the top bit says that its back is seen.
    pub id: Vec<u32>,
}

pub(super) const BACK_BIT: u32 = 1 << 31;

pub(super) fn rasterise(scene: &Scene, view: &View, w: usize, h: usize, style: &Style, looks: &[Look]) -> Buffers {
    let cull = style.cull_back_faces && style.cut_above_m.is_none();
    let cut = style.cut_above_m.unwrap_or(f64::INFINITY);
    let projected: Vec<Projected> = (0..scene.len() as u32)
        .into_par_iter()
        .filter(|t| looks[*t as usize] != Look::Hidden)
        .flat_map_iter(|t| project(scene, view, w, h, t, cull, looks[t as usize] == Look::Ghost))
        .collect();
    let bands = h.div_ceil(BAND);
    let mut bins: Vec<Vec<u32>> = vec![Vec::new(); bands];
    for (i, p) in projected.iter().enumerate() {
        let lo = p.y.iter().copied().fold(f64::INFINITY, f64::min).max(0.0);
        let hi = p.y.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(h as f64 - 1.0);
        if lo <= hi {
            for bin in &mut bins[lo as usize / BAND..=hi as usize / BAND] {
                bin.push(i as u32);
            }
        }
    }
    let mut buffers = Buffers { q: vec![f32::NEG_INFINITY; w * h], id: vec![NONE; w * h] };
    let rows = buffers.q.par_chunks_mut(w * BAND).zip(buffers.id.par_chunks_mut(w * BAND));
    rows.zip(&bins).enumerate().for_each(|(band, ((q, id), bin))| {
        for p in bin {
            fill(&projected[*p as usize], band * BAND, w, q, id, cut, view.is_perspective());
        }
    });
    buffers
}

/// Clips triangle `t` against the near plane and projects what is left.
fn project(scene: &Scene, view: &View, w: usize, h: usize, t: u32, cull: bool, ghost: bool) -> Vec<Projected> {
    let world = scene.corners(t);
    let normal = scene.normal(t);
    let back =
        if view.is_perspective() { normal.dot(view.eye - world[0]) <= 0.0 } else { normal.dot(view.forward) >= 0.0 };
    if back && cull && !scene.two_sided[t as usize] {
        return Vec::new();
    }
    let near = view.camera.near_m;
    let points: Vec<(DVec3, f64)> = world.iter().map(|p| (view.to_camera(*p), p.z)).collect();
    let mut polygon: Vec<(DVec3, f64)> = Vec::with_capacity(4);
    for i in 0..3 {
        let (a, b) = (points[i], points[(i + 1) % 3]);
        if a.0.z >= near {
            polygon.push(a);
        }
        if (a.0.z >= near) != (b.0.z >= near) {
            let s = (near - a.0.z) / (b.0.z - a.0.z);
            polygon.push((a.0 + (b.0 - a.0) * s, a.1 + (b.1 - a.1) * s));
        }
    }
    let screen = |(p, z): (DVec3, f64)| {
        let q = if view.is_perspective() { 1.0 / p.z } else { -p.z };
        let weight = if view.is_perspective() { q } else { 1.0 };
        let x = (p.x * weight / view.half_width * 0.5 + 0.5) * w as f64;
        let y = (0.5 - p.y * weight / view.half_height * 0.5) * h as f64;
        (x, y, q, z * weight)
    };
    let corners: Vec<_> = polygon.into_iter().map(screen).collect();
    (2..corners.len())
        .map(|i| {
            let c = [corners[0], corners[i - 1], corners[i]];
            let (x, y) = (c.map(|c| c.0), c.map(|c| c.1));
            Projected { id: t, x, y, q: c.map(|c| c.2), height: c.map(|c| c.3), back, ghost }
        })
        .collect()
}

fn fill(p: &Projected, top: usize, w: usize, q: &mut [f32], id: &mut [u32], cut: f64, perspective: bool) {
    let rows = q.len() / w;
    let area = (p.x[1] - p.x[0]) * (p.y[2] - p.y[0]) - (p.x[2] - p.x[0]) * (p.y[1] - p.y[0]);
    if area.abs() < 1e-12 {
        return;
    }
    let (lo_x, hi_x) = extent(&p.x, w as f64);
    let y0 = (p.y.iter().copied().fold(f64::INFINITY, f64::min) - 0.5).ceil().max(top as f64);
    let y1 = (p.y.iter().copied().fold(f64::NEG_INFINITY, f64::max) - 0.5).floor().min((top + rows - 1) as f64);
    let (mut y, mark) = (y0, p.id | if p.back { BACK_BIT } else { 0 });
    while y <= y1 {
        for x in lo_x..hi_x {
            let (px, py) = (x as f64 + 0.5, y + 0.5);
            let b1 = ((px - p.x[0]) * (p.y[2] - p.y[0]) - (p.x[2] - p.x[0]) * (py - p.y[0])) / area;
            let b2 = ((p.x[1] - p.x[0]) * (py - p.y[0]) - (px - p.x[0]) * (p.y[1] - p.y[0])) / area;
            let b0 = 1.0 - b1 - b2;
            if b0 < 0.0 || b1 < 0.0 || b2 < 0.0 {
                continue;
            }
            let here = b0 * p.q[0] + b1 * p.q[1] + b2 * p.q[2];
            let at = (y as usize - top) * w + x;
            if (here as f32) <= q[at] || (p.ghost && (x ^ y as usize) & 1 == 1) {
                continue;
            }
            let height = b0 * p.height[0] + b1 * p.height[1] + b2 * p.height[2];
            if (if perspective { height / here } else { height }) > cut {
                continue;
            }
            q[at] = here as f32;
            id[at] = mark;
        }
        y += 1.0;
    }
}

/// Pixel columns whose centres may lie within.
fn extent(x: &[f64; 3], w: f64) -> (usize, usize) {
    let lo = (x.iter().copied().fold(f64::INFINITY, f64::min) - 0.5).ceil().clamp(0.0, w);
    let hi = (x.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 0.5).floor().clamp(0.0, w);
    (lo as usize, hi as usize)
}

pub(super) fn unproject(view: &View, w: usize, h: usize, x: usize, y: usize, q: f64) -> DVec3 {
    let sx = ((x as f64 + 0.5) / w as f64 * 2.0 - 1.0) * view.half_width;
    let sy = (1.0 - (y as f64 + 0.5) / h as f64 * 2.0) * view.half_height;
    if view.is_perspective() {
        view.eye + (view.forward + view.right * sx + view.up * sy) / q
    } else {
        view.eye + view.right * sx + view.up * sy - view.forward * q
    }
}
