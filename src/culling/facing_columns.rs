//! What the tests of single triangles keep of each entry position, sixteen
//! positions a block, and the proofs that their guards cover every rounding.
//!
//! # The plane form
//! `n.e + d` with a unit normal and world coordinates in f32, as engines write it.
//! No guard: far from the origin the sum cancels and the sign is noise.
//!
//! # The difference form, guarded
//! Let `u = 2^-24`, `v` the exact offset of a corner from the scene origin, `N` the
//! exact unit normal and `e` the exact offset of the eye, split once a frame into
//! `h = f32(e)` and `l = f32(e - h)`. A kernel evaluates
//!
//! ```text
//! c_i = f32(v_i)             |error| <= u |c_i|
//! a_i = (c_i - h_i) - l_i    |error| <= 2u |a_i| + 3u^2 (|a_i| + |c_i|), beside that of c_i
//! n_i = f32(N_i)             |error| <= u |N_i| + 2^-29, slivers being kept unasked
//! s   = (n_x a_x + n_y a_y) + n_z a_z      three roundings: 3u sum |n_i a_i|
//! g   = 2u (4 sum |a_i| + sum |c_i|) + 2^-120
//! ```
//! As `|n_i| <= 1`, the error of `s` is at most `u (6.04 sum |a_i| + 1.01 sum |c_i|)`,
//! which `g` covers with a quarter of itself to spare for its own five roundings;
//! `2^-120` covers underflow. So `s > g` proves that the triangle turns its back,
//! and `s < -g` that it shows its front. Parallel rays are the same with `a` the
//! direction of view: `scale` is 0 then and takes the corner out.
//!
//! # Double precision
//! `n` is the cross product of the edges, not normalised, with
//! `m = max_i (|ab_j ac_k| + |ab_k ac_j|)`. With `w = 2^-53`, each component is off
//! by at most `4 w m`, the differences by `w |a_i|` and the sum by `3w`: together
//! `8 w m sum |a_i|`, for which the column `bound` holds `12 w m`. Slivers need no
//! exception: their bound is large beside their normal.
//!
//! Multiplications and additions are not fused, so every instruction set gives the
//! same bits and the scalar twins are quick.

use crate::hierarchy::Hierarchy;
use crate::math::{DVec3, View};
use crate::scene::Scene;
use crate::scene::sanitise::has_no_area;
use rayon::prelude::*;

/// Positions a block of f32 columns: one cache line a row.
pub const BLOCK: usize = 16;
/// Positions a block of f64 columns.
pub const BLOCK64: usize = 8;

/// Twice u: unit of the guard of the difference form.
pub const GUARD: f32 = 2.0 / (1u32 << 24) as f32;
/// Absolute part of that guard, for underflow.
pub const TINY: f32 = f32::from_bits(7 << 23);
/// Absolute part of the guard in f64.
pub const TINY64: f64 = 1e-300;

/// A normal shorter than this share of its edges' product is a sliver's: f64 may
/// miss its direction by more than the 2^-29 that guards allow for (1e-9 here).
const SLIVER: f64 = 1e-6;

/// The normal, not normalised, if f64 has its direction within 2^-29: no sliver,
/// with area, finite.
pub fn trusted_normal([a, b, c]: &[DVec3; 3]) -> Option<DVec3> {
    let (ab, ac) = (*b - *a, *c - *a);
    let n = ab.cross(ac);
    let length = n.length();
    // Written so that NaN counts as a sliver.
    (length > 0.0 && length.is_finite() && length >= SLIVER * (ab.length() * ac.length())).then_some(n)
}

/// Plane of each triangle in world coordinates; `d` is NaN where a triangle is kept unasked.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct PlaneBlock {
    pub normal: [[f32; BLOCK]; 3],
    pub d: [f32; BLOCK],
}

/// Normal and a corner of each triangle. Kept unasked: the normal is 0 (guarded), or
/// the corner NaN (not guarded).
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct PointBlock {
    pub normal: [[f32; BLOCK]; 3],
    pub point: [[f32; BLOCK]; 3],
}

/// The same in f64 with the bound of the error, by `sum |a_i|`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct DoubleBlock {
    pub normal: [[f64; BLOCK64]; 3],
    pub point: [[f64; BLOCK64]; 3],
    pub bound: [f64; BLOCK64],
}

/// The eye as the f32 kernels take it. Parallel rays: `eye` is minus their
/// direction and `scale` 0, else `scale` is 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Eye32 {
    pub eye: [f32; 3],
    /// What `eye` leaves out (difference form only).
    pub rest: [f32; 3],
    pub scale: f32,
}

impl Eye32 {
    /// World coordinates, rounded.
    pub fn world(view: &View) -> Eye32 {
        Eye32::split(view, DVec3::ZERO, false)
    }

    /// Relative to the scene origin, in two parts.
    pub fn relative(view: &View, origin: DVec3) -> Eye32 {
        Eye32::split(view, origin, true)
    }

    fn split(view: &View, origin: DVec3, with_rest: bool) -> Eye32 {
        let (e, scale) = if view.is_perspective() { (view.eye - origin, 1.0) } else { (-view.forward, 0.0) };
        let eye = e.as_vec3();
        let rest = if with_rest { (e - eye.as_dvec3()).as_vec3() } else { glam::Vec3::ZERO };
        Eye32 { eye: eye.to_array(), rest: rest.to_array(), scale }
    }
}

/// The eye in f64, likewise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Eye64 {
    pub eye: [f64; 3],
    pub scale: f64,
}

impl Eye64 {
    pub fn new(view: &View) -> Eye64 {
        let (e, scale) = if view.is_perspective() { (view.eye, 1.0) } else { (-view.forward, 0.0) };
        Eye64 { eye: e.to_array(), scale }
    }
}

/// Facing never hides it: two-sided, or without area and so without a front.
pub fn is_kept_unasked(scene: &Scene, t: u32) -> bool {
    let corners = scene.corners(t);
    scene.two_sided[t as usize] || !corners.iter().all(|c| c.is_finite()) || has_no_area(&corners)
}

/// Bit a position, set where [`is_kept_unasked`]; positions past the end are set too.
pub fn kept_unasked(scene: &Scene, hierarchy: &Hierarchy) -> Vec<u64> {
    let entries = &hierarchy.entries;
    entries
        .par_chunks(64)
        .map(|chunk| {
            let past = (!0u64).checked_shl(chunk.len() as u32).unwrap_or(0);
            chunk.iter().enumerate().fold(past, |w, (i, t)| w | u64::from(is_kept_unasked(scene, *t)) << i)
        })
        .collect()
}

/// Unit normal in f64, of any triangle that is not kept unasked. `None` where f64
/// has no direction for it.
pub fn unit_normal(scene: &Scene, t: u32) -> Option<DVec3> {
    if is_kept_unasked(scene, t) { None } else { scene.normal(t).try_normalize() }
}

/// Planes in world coordinates, f32 rounded from f64: what an engine would load.
pub fn world_planes(scene: &Scene, hierarchy: &Hierarchy) -> Vec<PlaneBlock> {
    columns(hierarchy, BLOCK, PlaneBlock { normal: [[0.0; BLOCK]; 3], d: [f32::NAN; BLOCK] }, |block, lane, t| {
        if let Some(n) = unit_normal(scene, t) {
            set(&mut block.normal, lane, n);
            block.d[lane] = -n.dot(scene.corners(t)[0]) as f32;
        }
    })
}

/// Normals alone, in the layout of planes: `d` is 0.
pub fn normals(scene: &Scene, hierarchy: &Hierarchy) -> Vec<PlaneBlock> {
    columns(hierarchy, BLOCK, PlaneBlock { normal: [[0.0; BLOCK]; 3], d: [f32::NAN; BLOCK] }, |block, lane, t| {
        if let Some(n) = unit_normal(scene, t) {
            set(&mut block.normal, lane, n);
            block.d[lane] = 0.0;
        }
    })
}

/// Normals and corners in world coordinates, f32 rounded.
pub fn world_points(scene: &Scene, hierarchy: &Hierarchy) -> Vec<PointBlock> {
    let empty = PointBlock { normal: [[0.0; BLOCK]; 3], point: [[f32::NAN; BLOCK]; 3] };
    columns(hierarchy, BLOCK, empty, |block, lane, t| {
        if let Some(n) = unit_normal(scene, t) {
            set(&mut block.normal, lane, n);
            set(&mut block.point, lane, scene.corners(t)[0]);
        }
    })
}

/// Normals and corners relative to the hierarchy's origin, for the guarded kernel.
pub fn relative_points(scene: &Scene, hierarchy: &Hierarchy) -> Vec<PointBlock> {
    let empty = PointBlock { normal: [[0.0; BLOCK]; 3], point: [[0.0; BLOCK]; 3] };
    columns(hierarchy, BLOCK, empty, |block, lane, t| {
        let corners = scene.corners(t);
        if let (Some(n), false) = (trusted_normal(&corners), scene.two_sided[t as usize]) {
            set(&mut block.normal, lane, n.normalize());
            set(&mut block.point, lane, corners[0] - hierarchy.origin);
        }
    })
}

/// Normals, corners and error bounds in f64.
pub fn double_points(scene: &Scene, hierarchy: &Hierarchy) -> Vec<DoubleBlock> {
    let zero = [[0.0; BLOCK64]; 3];
    columns(hierarchy, BLOCK64, DoubleBlock { normal: zero, point: zero, bound: [0.0; BLOCK64] }, |block, lane, t| {
        let [a, b, c] = scene.corners(t);
        let (ab, ac) = ((b - a).abs(), (c - a).abs());
        let m = (0..3).map(|i| (i + 1) % 3).zip((0..3).map(|i| (i + 2) % 3));
        let m = m.fold(0f64, |m, (j, k)| m.max(ab[j] * ac[k] + ab[k] * ac[j]));
        // Outside, products may have over- or underflowed.
        if is_kept_unasked(scene, t) || !(1e-120..1e120).contains(&m) {
            return;
        }
        let n = (b - a).cross(c - a);
        for axis in 0..3 {
            block.normal[axis][lane] = n[axis];
            block.point[axis][lane] = a[axis];
        }
        block.bound[lane] = 12.0 * (f64::EPSILON / 2.0) * m;
    })
}

fn set(rows: &mut [[f32; BLOCK]; 3], lane: usize, v: DVec3) {
    for axis in 0..3 {
        rows[axis][lane] = v[axis] as f32;
    }
}

/// Blocks for whole words of positions, each lane filled by `fill(block, lane, triangle)`.
fn columns<B: Copy + Send + Sync>(
    hierarchy: &Hierarchy,
    lanes: usize,
    empty: B,
    fill: impl Fn(&mut B, usize, u32) + Sync,
) -> Vec<B> {
    let words = hierarchy.entries.len().div_ceil(64);
    let mut blocks = vec![empty; words * (64 / lanes)];
    blocks.par_iter_mut().zip(hierarchy.entries.par_chunks(lanes)).with_min_len(256).for_each(|(block, entries)| {
        entries.iter().enumerate().for_each(|(lane, t)| fill(block, lane, *t));
    });
    blocks
}
