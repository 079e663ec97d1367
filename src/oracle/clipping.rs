//! V* itself, for small scenes: what is left of every triangle when all nearer ones
//! are cut out of its image.
//!
//! Hidden-surface removal in object space after Weiler & Atherton (1977), but with
//! regions that are lists of lines ([`super::lines`]), so that every answer is
//! exact. Of a triangle, an occluder takes the region within its three sides,
//! beyond the near plane, and where it is the nearer one; the last is a line too,
//! so that triangles that pass through each other need no splitting.
//!
//! Exact with respect to this: corners in camera space are rounded once to a grid
//! of 2^-50 of the scene's size, so that welded corners stay welded; the image is
//! that of the view's half extents, near and far plane. Surfaces within
//! [`TIE`] of each other's depth do not hide each other, as in the item buffer.
//! A remainder counts if it has an inside: points and stretches are nothing.
//!
//! Class: exact. Independent of samples, rays and proofs of hiding, which its
//! tests hold against it; of the oracle it shares facing ([`super::sets`]) alone.

use super::bits::BitSet;
use super::item_buffer::TIE;
use super::lines::{Bound, Line, Region, cut, sides};
use super::sets::standings;
use crate::error::{Error, Result};
use crate::math::exact::{Whole, unit_of};
use crate::math::{DVec3, View};
use crate::scene::Scene;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Scenes with more triangles are refused: every pair may be compared.
pub const MOST_TRIANGLES: usize = 5000;

/// The triangles that are visible, exactly.
///
/// # Errors
/// If the scene is too large.
pub fn visible(scene: &Scene, view: &View) -> Result<BitSet> {
    if scene.len() > MOST_TRIANGLES {
        return Err(Error::new(format!("the scene has {} triangles, too many to clip", scene.len()))
            .help(format!("clipping takes at most {MOST_TRIANGLES}; use samples, rays and proofs of hiding")));
    }
    let frame = Frame::new(scene, view);
    let seen: Vec<u32> =
        (0..frame.faces.len()).into_par_iter().filter(|i| frame.remains(*i)).map(|i| frame.faces[i].triangle).collect();
    let mut set = BitSet::new(scene.len());
    seen.into_iter().for_each(|t| set.insert(t));
    Ok(set)
}

/// A drawable triangle, oriented towards the eye.
struct Face {
    triangle: u32,
    occluder: bool,
    /// Positive inside.
    edges: [Line; 3],
    /// Depth is `scale / along` for perspective, `along / scale` for parallel rays;
    /// `along` is linear on the image plane, `scale` is positive.
    along: [Whole; 3],
    scale: Whole,
    /// Positive beyond the near and before the far plane.
    clips: Vec<Line>,
    depths: [f64; 2],
    /// Certain bounds of the image: x and y, low and high.
    bounds: [f64; 4],
}

struct Frame {
    perspective: bool,
    near_m: f64,
    image: [Line; 4],
    faces: Vec<Face>,
}

impl Frame {
    fn new(scene: &Scene, view: &View) -> Frame {
        let camera: Vec<DVec3> = scene.positions.iter().map(|p| view.to_camera(*p)).collect();
        let size = camera.iter().map(|p| p.abs().max_element()).fold(view.camera.near_m, f64::max);
        // Dividing by a power of two is exact.
        let grid = libm::exp2(libm::floor(libm::log2(size)) - 50.0);
        let camera: Vec<DVec3> = camera.iter().map(|p| (*p / grid).round() * grid).collect();
        let far_m = view.camera.far_m.unwrap_or(1.0);
        let own = DVec3::new(view.camera.near_m, far_m, 1.0);
        let unit = [grid, own.x, own.y, own.z].map(unit_of).into_iter().fold(i32::MAX, i32::min);
        let setting = Setting { perspective: view.is_perspective(), unit, view };
        let standings = standings(scene, view).0;
        let faces = (0..scene.len() as u32).filter(|t| standings[*t as usize].drawable()).filter_map(|t| {
            let corners = scene.triangles[t as usize].map(|v| camera[v as usize]);
            setting.face(t, scene.occluder[t as usize], corners)
        });
        let line = |x: f64, y: f64, half: f64| {
            let unit = unit_of(half).min(0);
            Line::new([x, y, half].map(|c| Whole::of(c, unit)))
        };
        let (w, h) = (view.half_width, view.half_height);
        Frame {
            perspective: setting.perspective,
            near_m: view.camera.near_m,
            // Counter-clockwise: bottom, right, top, left.
            image: [line(0.0, 1.0, h), line(-1.0, 0.0, w), line(0.0, -1.0, h), line(1.0, 0.0, w)],
            faces: faces.collect(),
        }
    }

    /// Whether anything of face `i` is left.
    fn remains(&self, i: usize) -> bool {
        let face = &self.faces[i];
        let mut lines: Vec<Line> = self.image.to_vec();
        let mut region: Region = (0..4).map(|line| Bound { line, turned: false }).collect();
        for own in face.edges.iter().chain(&face.clips) {
            lines.push(own.clone());
            let line = lines.len() as u32 - 1;
            let at = sides(&lines, &region, line);
            match cut(region, line, &at).inside {
                Some(inside) => region = inside,
                None => return false,
            }
        }
        // Nearest first: most of what is hidden goes at once.
        let mut others: Vec<usize> = (0..self.faces.len()).filter(|j| *j != i && self.may_hide(*j, i)).collect();
        others.sort_by(|a, b| self.faces[*a].depths[0].total_cmp(&self.faces[*b].depths[0]).then(a.cmp(b)));
        let holes: Vec<Vec<u32>> = others.iter().map(|j| self.hole(*j, i, &mut lines)).collect();

        // Depth first: the first region that survives all others decides.
        let mut pending = vec![(region, 0)];
        while let Some((mut region, next)) = pending.pop() {
            let Some(hole) = holes.get(next) else { return true };
            let at: Vec<Vec<Ordering>> = hole.iter().map(|line| sides(&lines, &region, *line)).collect();
            if at.iter().any(|s| !s.contains(&Ordering::Greater)) {
                pending.push((region, next + 1));
                continue;
            }
            for line in hole {
                let at = sides(&lines, &region, *line);
                let halves = cut(region, *line, &at);
                pending.extend(halves.outside.map(|o| (o, next + 1)));
                match halves.inside {
                    Some(inside) => region = inside,
                    None => break,
                }
                // What is left after the last line is hidden.
            }
        }
        false
    }

    fn may_hide(&self, j: usize, i: usize) -> bool {
        let (o, t) = (&self.faces[j], &self.faces[i]);
        let [ax, bx, ay, by] = o.bounds;
        let [cx, dx, cy, dy] = t.bounds;
        o.occluder && o.depths[0] < t.depths[1] && ax <= dx && cx <= bx && ay <= dy && cy <= by
    }

    /// The lines within which face `j` hides face `i`; numbers into `lines`.
    fn hole(&self, j: usize, i: usize, lines: &mut Vec<Line>) -> Vec<u32> {
        let (o, t) = (&self.faces[j], &self.faces[i]);
        let first = lines.len() as u32;
        lines.extend(o.edges.iter().cloned());
        if o.depths[0] < self.near_m {
            lines.push(o.clips[0].clone());
        }
        if o.depths[1] >= t.depths[0] * (1.0 - 2.0 * TIE) {
            lines.push(self.nearer(o, t));
        }
        (first..lines.len() as u32).collect()
    }

    /// Positive where `o` is nearer than `t` by more than a tie.
    fn nearer(&self, o: &Face, t: &Face) -> Line {
        let ties = 1.0 / TIE;
        let times = |line: &[Whole; 3], scale: &Whole, factor: f64| {
            let factor = scale.times(&Whole::of(factor, 0));
            line.each_ref().map(|c| c.times(&factor))
        };
        // Perspective: 1/z_o > (1 + TIE) / z_t. Parallel: z_o < (1 - TIE) z_t.
        let (plus, minus) = match self.perspective {
            true => (times(&o.along, &t.scale, ties), times(&t.along, &o.scale, ties + 1.0)),
            false => (times(&t.along, &o.scale, ties - 1.0), times(&o.along, &t.scale, ties)),
        };
        Line::new([0, 1, 2].map(|k| plus[k].minus(&minus[k])))
    }
}

/// In which units faces are set up.
struct Setting<'a> {
    perspective: bool,
    unit: i32,
    view: &'a View,
}

impl Setting<'_> {
    /// `None` if it is exactly edge-on.
    fn face(&self, triangle: u32, occluder: bool, corners: [DVec3; 3]) -> Option<Face> {
        let whole = |x: f64| Whole::of(x, self.unit);
        let p = corners.map(|c| c.to_array().map(whole));
        let from = |i: usize| [0, 1, 2].map(|k| p[i][k].minus(&p[0][k]));
        let normal = cross(&from(1), &from(2));
        let volume = dot(&normal, &p[0]);
        let scale = if self.perspective { &volume } else { &normal[2] };
        let flip = match scale.sign() {
            Ordering::Equal => return None,
            Ordering::Less => whole_one(-1.0),
            Ordering::Greater => whole_one(1.0),
        };
        let one = whole(1.0);
        let q = match self.perspective {
            true => p.clone(),
            false => p.clone().map(|[x, y, _]| [x, y, one.clone()]),
        };
        let edge = |a: usize, b: usize| Line::new(cross(&q[a], &q[b]).map(|c| c.times(&flip)));
        let scale = scale.times(&flip);
        let along = match self.perspective {
            true => normal.map(|c| c.times(&flip)),
            // z = (volume - x n_x - y n_y) / n_z, with x and y in metres.
            false => {
                let [x, y, _] = normal.map(|c| c.times(&one).times(&flip));
                let zero = whole_one(0.0);
                [zero.minus(&x), zero.minus(&y), volume.times(&flip)]
            }
        };
        let camera = &self.view.camera;
        let mut clips = vec![self.beyond(&along, &scale, &whole(camera.near_m), 1.0)];
        clips.extend(camera.far_m.map(|far_m| self.beyond(&along, &scale, &whole(far_m), -1.0)));
        let z = corners.map(|c| c.z);
        Some(Face {
            triangle,
            occluder,
            edges: [edge(1, 2), edge(2, 0), edge(0, 1)],
            along,
            scale,
            clips,
            depths: [z[0].min(z[1]).min(z[2]), z[0].max(z[1]).max(z[2])],
            bounds: self.bounds(&corners),
        })
    }

    /// Positive where the depth exceeds `depth`; `sign` -1 turns it round.
    fn beyond(&self, along: &[Whole; 3], scale: &Whole, depth: &Whole, sign: f64) -> Line {
        let (sign, zero) = (whole_one(sign), whole_one(0.0));
        // scale - depth * along > 0, or along - depth * scale > 0.
        let line = match self.perspective {
            true => {
                let [x, y, c] = along.each_ref().map(|c| c.times(depth));
                [zero.minus(&x), zero.minus(&y), scale.minus(&c)]
            }
            false => [along[0].clone(), along[1].clone(), along[2].minus(&scale.times(depth))],
        };
        Line::new(line.map(|c| c.times(&sign)))
    }

    /// A triangle that reaches before the near plane may be anywhere.
    fn bounds(&self, corners: &[DVec3; 3]) -> [f64; 4] {
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY];
        if self.perspective && corners.iter().any(|c| c.z < 0.5 * self.view.camera.near_m) {
            return everywhere;
        }
        let of = |along: fn(&DVec3) -> f64| {
            let at = corners.each_ref().map(|c| along(c) / if self.perspective { c.z } else { 1.0 });
            let (low, high) = (at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2]));
            // One rounding of a quotient is far less.
            [low - 1e-12 * low.abs(), high + 1e-12 * high.abs()]
        };
        let ([ax, bx], [ay, by]) = (of(|c| c.x), of(|c| c.y));
        [ax, bx, ay, by]
    }
}

fn whole_one(x: f64) -> Whole {
    Whole::of(x, 0)
}

fn cross(a: &[Whole; 3], b: &[Whole; 3]) -> [Whole; 3] {
    let minor = |i: usize, j: usize| a[i].times(&b[j]).minus(&a[j].times(&b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

fn dot(a: &[Whole; 3], b: &[Whole; 3]) -> Whole {
    a[0].times(&b[0]).plus(&a[1].times(&b[1])).plus(&a[2].times(&b[2]))
}
