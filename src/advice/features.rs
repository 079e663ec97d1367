//! What a scene and a path are like: the figures that explain an advice.

use crate::culling::normal_mask::Cells;
use crate::math::{DVec3, View};
use crate::registry::Spec;
use crate::scene::Scene;
use rayon::prelude::*;
use serde::Serialize;

/// Triangles looked at in every view.
const SAMPLE: usize = 8192;
/// Cells of the cube map of normals, as `normal_mask` has by default.
const MASK: Cells = Cells { per_edge: 4 };
/// Depth of the octree that straddling is counted in.
const DEPTH: u32 = 4;

/// Means over the views of the probe where a view matters.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Features {
    pub triangles: usize,
    /// Share of the area that is parallel to two axes.
    pub axis_aligned: f64,
    /// Front faces behind a pixel: their area on the screen over the screen.
    pub depth_complexity: f64,
    /// Share of the triangles that are in view, if only in part.
    pub in_view: f64,
    /// Share of those that face the eye.
    pub facing: f64,
    /// Cells of the cube map that the normals of 64 neighbours fall in, of 96.
    pub mask_fill: f64,
    /// Cells of an octree of depth 4 that a triangle's box reaches.
    pub straddling: f64,
}

impl Features {
    pub fn of(scene: &Scene, views: &[View]) -> Features {
        let step = scene.len().div_ceil(SAMPLE).max(1);
        let sample: Vec<u32> = (0..scene.len() as u32).step_by(step).collect();
        let seen: Vec<[f64; 3]> = views.par_iter().map(|view| in_view(scene, &sample, view, step as f64)).collect();
        let mean = |k: usize| seen.iter().map(|s| s[k]).sum::<f64>() / views.len().max(1) as f64;
        Features {
            triangles: scene.len(),
            axis_aligned: axis_aligned(scene),
            depth_complexity: mean(0),
            in_view: mean(1),
            facing: mean(2),
            mask_fill: mask_fill(scene),
            straddling: straddling(scene, &sample),
        }
    }
}

fn axis_aligned(scene: &Scene) -> f64 {
    let (mut aligned, mut all) = (0.0, 0.0);
    for t in 0..scene.len() as u32 {
        let n = scene.normal(t);
        let area = n.length();
        all += area;
        aligned += if n.abs().max_element() > 0.9999 * area { area } else { 0.0 };
    }
    if all > 0.0 { aligned / all } else { 0.0 }
}

/// Depth complexity, share in view, share of those facing the eye.
fn in_view(scene: &Scene, sample: &[u32], view: &View, weight: f64) -> [f64; 3] {
    let (mut area, mut inside, mut facing) = (0.0, 0u32, 0u32);
    for t in sample {
        let corners = scene.corners(*t);
        let polygon = clipped(corners.map(|p| view.to_camera(p)).to_vec(), view);
        if polygon.len() < 3 {
            continue;
        }
        inside += 1;
        let n = scene.normal(*t);
        let towards = if view.is_perspective() { view.eye - corners[0] } else { -view.forward };
        if scene.two_sided[*t as usize] || n.dot(towards) > 0.0 {
            facing += 1;
            area += screen_area(&polygon, view);
        }
    }
    let screen = 4.0 * view.half_width * view.half_height;
    let share = |part: u32, of: f64| if of > 0.0 { f64::from(part) / of } else { 0.0 };
    [area * weight / screen, share(inside, sample.len() as f64), share(facing, f64::from(inside))]
}

/// A polygon in camera space cut by the sides and the near plane (Sutherland & Hodgman 1974).
fn clipped(mut polygon: Vec<DVec3>, view: &View) -> Vec<DVec3> {
    let slope = if view.is_perspective() { 1.0 } else { 0.0 };
    let side = |half: f64, x: f64, z: f64| half * (if slope > 0.0 { z } else { 1.0 }) - x;
    let planes: [&dyn Fn(DVec3) -> f64; 5] = [
        &|p| p.z - view.camera.near_m,
        &|p| side(view.half_width, p.x, p.z),
        &|p| side(view.half_width, -p.x, p.z),
        &|p| side(view.half_height, p.y, p.z),
        &|p| side(view.half_height, -p.y, p.z),
    ];
    for depth in planes {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for i in 0..polygon.len() {
            let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            let (a, b) = (depth(p), depth(q));
            if a >= 0.0 {
                kept.push(p);
            }
            if (a < 0.0) != (b < 0.0) {
                kept.push(p + (q - p) * (a / (a - b)));
            }
        }
        polygon = kept;
    }
    polygon
}

/// In units of the window at unit distance.
fn screen_area(polygon: &[DVec3], view: &View) -> f64 {
    let at = |p: DVec3| if view.is_perspective() { [p.x / p.z, p.y / p.z] } else { [p.x, p.y] };
    let twice: f64 = (0..polygon.len())
        .map(|i| {
            let ([x0, y0], [x1, y1]) = (at(polygon[i]), at(polygon[(i + 1) % polygon.len()]));
            x0 * y1 - x1 * y0
        })
        .sum();
    twice.abs() / 2.0
}

/// Over the clusters of a list: neighbours in Morton order.
fn mask_fill(scene: &Scene) -> f64 {
    let list = crate::structure::make(&Spec::new("list")).and_then(|(list, _)| list.build(scene));
    let Ok(list) = list else { return 0.0 };
    let fill = |cluster: &[u32]| {
        let bits = cluster.iter().fold(0u128, |m, t| m | 1 << MASK.of_triangle(scene, *t));
        f64::from(bits.count_ones()) / MASK.count() as f64
    };
    let fills: Vec<f64> = list.entries.par_chunks(64).map(fill).collect();
    fills.iter().sum::<f64>() / fills.len().max(1) as f64
}

fn straddling(scene: &Scene, sample: &[u32]) -> f64 {
    let cell = (scene.bounds().size() / f64::from(1 << DEPTH)).max(DVec3::splat(f64::MIN_POSITIVE));
    let lo = scene.bounds().lo;
    let reach = |t: &u32| {
        let b = scene.triangle_aabb(*t);
        let (from, to) = (((b.lo - lo) / cell).floor(), ((b.hi - lo) / cell).floor());
        ((to - from) + 1.0).min(DVec3::splat(f64::from(1 << DEPTH))).element_product()
    };
    sample.iter().map(reach).sum::<f64>() / sample.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, Pose};

    #[test]
    fn a_wall_that_fills_the_view_is_seen_once_a_layer() {
        let mut scene = Scene::default();
        for layer in 0..3u32 {
            let x = 5.0 + f64::from(layer);
            let base = scene.positions.len() as u32;
            for (y, z) in [(-50.0, -50.0), (-50.0, 50.0), (50.0, 50.0), (50.0, -50.0)] {
                scene.positions.push(DVec3::new(x, y, z));
            }
            scene.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
            scene.two_sided.extend([false; 2]);
            scene.material_id.extend([0; 2]);
        }
        let facing = |forward: DVec3| {
            let view = View::new(&Camera::default(), &Pose { eye: DVec3::ZERO, forward, up: DVec3::Z });
            Features::of(&scene, &[view])
        };
        let towards = facing(DVec3::X);
        assert!((towards.depth_complexity - 3.0).abs() < 1e-9, "{towards:?}");
        assert_eq!((towards.axis_aligned, towards.in_view, towards.facing), (1.0, 1.0, 1.0));
        let away = facing(-DVec3::X);
        assert_eq!((away.depth_complexity, away.in_view), (0.0, 0.0));
    }
}
