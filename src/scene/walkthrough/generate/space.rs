//! Free space as a grid of cells, and exact segment-against-triangle tests.
//!
//! A cell is free when no triangle touches it grown by the clearance (separating
//! axes of box and triangle, after Akenine-Moeller 2001). A segment whose cells
//! are all free therefore crosses nothing and keeps the clearance.

use crate::error::{Error, Result};
use crate::math::{Aabb, DVec3, Pose};
use crate::scene::Scene;
use rayon::prelude::*;

/// Cells at most; the grid is as fine as this allows, and no finer than useful.
const CELLS_MAX: f64 = 9e6;

/// What a cell is. Band cells are where a walker's eye may be.
pub const BLOCKED: u8 = 1;
/// A front face that can be stood on touches the cell.
const FLOOR: u8 = 2;
/// Free, and at eye height above a floor (or anywhere free, if there are no floors).
pub const BAND: u8 = 4;
/// Something blocked is above: indoors, or under a bridge.
pub const COVERED: u8 = 8;

pub struct Space {
    pub lo: DVec3,
    pub cell: f64,
    pub dims: [usize; 3],
    /// z runs fastest, so that a column is contiguous.
    pub state: Vec<u8>,
    /// Cells from the ideal eye height, for band cells.
    pub off: Vec<u8>,
}

impl Space {
    pub fn new(scene: &Scene, clearance: f64, eye: f64) -> Result<Space> {
        let bounds = scene.bounds();
        let mut space = Space::sample(scene, bounds, clearance, eye * 1.6);
        let standing = space.find_band(clearance, eye);
        if standing < 200 {
            // No floors to speak of: fly around the thing instead.
            space = Space::sample(scene, bounds, clearance, bounds.size().length() * 0.15);
            for s in space.state.iter_mut().filter(|s| **s & BLOCKED == 0) {
                *s |= BAND;
            }
        }
        space.keep_best_component();
        if !space.state.iter().any(|s| s & BAND != 0) {
            return Err(Error::new(format!("no free space was found for a walk with {clearance} m clearance"))
                .help("use a smaller clearance_m or eye_height_m, or check the scene's `scale` and `up`"));
        }
        Ok(space)
    }

    fn sample(scene: &Scene, bounds: Aabb, clearance: f64, pad: f64) -> Space {
        let lo = bounds.lo - DVec3::splat(pad);
        let size = bounds.size() + DVec3::splat(2.0 * pad);
        let cell = (libm::cbrt(size.x * size.y * size.z / CELLS_MAX)).max(clearance * 0.8);
        let dims = [size.x, size.y, size.z].map(|s| (s / cell).ceil().max(1.0) as usize);
        let column = dims[2];
        let mut state = vec![0u8; dims[0] * dims[1] * column];
        let slab = dims[1] * column;
        let boxes: Vec<Aabb> = (0..scene.len() as u32).into_par_iter().map(|t| scene.triangle_aabb(t)).collect();
        let slices = dims[0].div_ceil(16).max(1);
        state.par_chunks_mut(slab * slices).enumerate().for_each(|(chunk, state)| {
            let x0 = chunk * slices;
            let shape = Slab { lo, cell, half: cell * 0.5 + clearance, x0, x1: x0 + state.len() / slab, dims };
            for (t, b) in boxes.iter().enumerate() {
                shape.mark(&scene.corners(t as u32), b, scene.two_sided[t], state);
            }
        });
        Space { lo, cell, dims, off: vec![0; state.len()], state }
    }

    /// Marks the band above floors; returns how many band cells stand on something.
    fn find_band(&mut self, clearance: f64, eye: f64) -> usize {
        let (column, cell) = (self.dims[2], self.cell);
        let count = |(state, off): (&mut [u8], &mut [u8])| {
            let (mut below, mut found) = (None, 0);
            for z in 0..column {
                if state[z] & BLOCKED != 0 {
                    below = Some((z, state[z] & FLOOR != 0));
                } else if let Some((floor, true)) = below {
                    let height = (z - floor) as f64 * cell + clearance;
                    if height >= 0.75 * eye && (height <= 1.3 * eye || (z - floor) as f64 <= 1.5) {
                        state[z] |= BAND;
                        off[z] = ((height - eye).abs() / cell + 0.5) as u8;
                        found += 1;
                    }
                }
            }
            let mut covered = false;
            for s in state.iter_mut().rev() {
                covered |= *s & BLOCKED != 0;
                *s |= if covered && *s & BLOCKED == 0 { COVERED } else { 0 };
            }
            found
        };
        self.state.par_chunks_mut(column).zip(self.off.par_chunks_mut(column)).map(count).sum()
    }

    fn keep_best_component(&mut self) {
        let mut group = vec![0u32; self.state.len()];
        let (mut best, mut best_worth, mut groups) = (0, 0usize, 0);
        let mut pending = Vec::new();
        for start in 0..self.state.len() {
            if self.state[start] & BAND == 0 || group[start] != 0 {
                continue;
            }
            groups += 1;
            let mut worth = 0;
            pending.push(start);
            group[start] = groups;
            while let Some(at) = pending.pop() {
                // What has roofs was made to be walked in: a valley with houses counts
                // for more than the wide plateaus round it.
                worth += if self.state[at] & COVERED != 0 { 9 } else { 1 };
                for next in self.neighbours(at) {
                    if self.state[next] & BAND != 0 && group[next] == 0 {
                        group[next] = groups;
                        pending.push(next);
                    }
                }
            }
            if worth > best_worth {
                (best, best_worth) = (groups, worth);
            }
        }
        for (s, g) in self.state.iter_mut().zip(&group) {
            if *g != best {
                *s &= !BAND;
            }
        }
    }

    /// The six cells that share a face with `at`.
    pub fn neighbours(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let [x, y, z] = self.coordinates(at);
        let [nx, ny, nz] = self.dims;
        let (sx, sy) = (ny * nz, nz);
        [
            (x > 0).then(|| at - sx),
            (x + 1 < nx).then(|| at + sx),
            (y > 0).then(|| at - sy),
            (y + 1 < ny).then(|| at + sy),
            (z > 0).then(|| at - 1),
            (z + 1 < nz).then(|| at + 1),
        ]
        .into_iter()
        .flatten()
    }

    pub fn coordinates(&self, at: usize) -> [usize; 3] {
        let [_, ny, nz] = self.dims;
        [at / (ny * nz), at / nz % ny, at % nz]
    }

    pub fn centre(&self, at: usize) -> DVec3 {
        let [x, y, z] = self.coordinates(at).map(|c| c as f64 + 0.5);
        self.lo + DVec3::new(x, y, z) * self.cell
    }

    /// Whether every cell that the segment touches has all bits of `need` and none of `BLOCKED`.
    pub fn clear(&self, a: DVec3, b: DVec3, need: u8) -> bool {
        // Cells are closed: a margin makes near misses of a border count for both sides.
        let margin = 1e-6;
        let (p, q) = ((a - self.lo) / self.cell, (b - self.lo) / self.cell);
        let steps = ((q - p).abs().max_element().ceil() as usize).max(1);
        let mut from = p;
        for i in 1..=steps {
            let to = p + (q - p) * (i as f64 / steps as f64);
            let (lo, hi) = (from.min(to) - margin, from.max(to) + margin);
            // At most two cells an axis: the box of a piece no longer than a cell holds few others.
            let range = |axis: usize| {
                let l = lo[axis].floor();
                let h = hi[axis].floor();
                (l >= 0.0 && h < self.dims[axis] as f64).then_some((l as usize, h as usize))
            };
            let (Some(x), Some(y), Some(z)) = (range(0), range(1), range(2)) else { return false };
            for cx in x.0..=x.1 {
                for cy in y.0..=y.1 {
                    for cz in z.0..=z.1 {
                        let s = self.state[(cx * self.dims[1] + cy) * self.dims[2] + cz];
                        if s & BLOCKED != 0 || s & need != need {
                            return false;
                        }
                    }
                }
            }
            from = to;
        }
        true
    }
}

/// Some x-slices of the grid, filled by one task.
struct Slab {
    lo: DVec3,
    cell: f64,
    half: f64,
    x0: usize,
    x1: usize,
    dims: [usize; 3],
}

impl Slab {
    fn mark(&self, corners: &[DVec3; 3], bounds: &Aabb, two_sided: bool, state: &mut [u8]) {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let up = if two_sided { normal.z.abs() } else { normal.z };
        let mark = if up > 0.72 * normal.length() { BLOCKED | FLOOR } else { BLOCKED };
        // Cells whose grown box may reach the bounds: centre within half of them.
        let cells = |axis: usize, lo: f64, hi: f64| {
            let first = ((lo - self.half - self.lo[axis]) / self.cell - 0.5).ceil() - 1.0;
            let last = ((hi + self.half - self.lo[axis]) / self.cell - 0.5).floor() + 1.0;
            (first.max(0.0) as usize, (last.max(-1.0) + 1.0).min(self.dims[axis] as f64) as usize)
        };
        let (xa, xb) = cells(0, bounds.lo.x, bounds.hi.x);
        let (ya, yb) = cells(1, bounds.lo.y, bounds.hi.y);
        for x in xa.max(self.x0)..xb.min(self.x1) {
            for y in ya..yb {
                let column = ((x - self.x0) * self.dims[1] + y) * self.dims[2];
                let cx = self.lo.x + (x as f64 + 0.5) * self.cell;
                let cy = self.lo.y + (y as f64 + 0.5) * self.cell;
                let (mut lo, mut hi) = (bounds.lo.z, bounds.hi.z);
                if normal.z.abs() > 1e-6 * normal.length() {
                    // The plane's heights over the column narrow the cells to ask.
                    let d = corners[0] - DVec3::new(cx, cy, 0.0);
                    let middle = d.z + (normal.x * d.x + normal.y * d.y) / normal.z;
                    let spread = (normal.x.abs() + normal.y.abs()) / normal.z.abs() * self.half;
                    lo = lo.max(middle - spread);
                    hi = hi.min(middle + spread);
                }
                let (za, zb) = cells(2, lo, hi);
                for z in za..zb {
                    let s = &mut state[column + z];
                    if *s & mark == mark {
                        continue;
                    }
                    let centre = DVec3::new(cx, cy, self.lo.z + (z as f64 + 0.5) * self.cell);
                    if box_touches(centre, self.half, corners, normal) {
                        *s |= mark;
                    }
                }
            }
        }
    }
}

/// Whether a cube (centre, half edge) and a triangle share a point: thirteen separating axes.
fn box_touches(centre: DVec3, half: f64, corners: &[DVec3; 3], normal: DVec3) -> bool {
    let v = corners.map(|c| c - centre);
    let apart = |axis: DVec3| {
        let p = v.map(|v| v.dot(axis));
        let reach = half * (axis.x.abs() + axis.y.abs() + axis.z.abs());
        // The slack lets rounding only ever block a cell.
        let slack = 1e-9 * reach;
        p[0].min(p[1]).min(p[2]) > reach + slack || p[0].max(p[1]).max(p[2]) < -reach - slack
    };
    if apart(DVec3::X) || apart(DVec3::Y) || apart(DVec3::Z) || apart(normal) {
        return false;
    }
    let edges = [v[1] - v[0], v[2] - v[1], v[0] - v[2]];
    !edges.iter().any(|e| [DVec3::X, DVec3::Y, DVec3::Z].iter().any(|a| apart(a.cross(*e))))
}

/// Whether the closed segment meets the closed triangle, by exact orientations
/// (Shewchuk 1997). A segment in the triangle's plane counts as meeting it.
pub fn crosses(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let side = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| {
        let k = |p: DVec3| robust::Coord3D { x: p.x, y: p.y, z: p.z };
        robust::orient3d(k(a), k(b), k(c), k(d))
    };
    let (from, to) = (side(a, b, c, p), side(a, b, c, q));
    if (from > 0.0 && to > 0.0) || (from < 0.0 && to < 0.0) {
        return false;
    }
    let turns = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
    turns.iter().all(|t| *t >= 0.0) || turns.iter().all(|t| *t <= 0.0)
}

/// The first frame whose step to the next crosses a triangle, and the triangle.
pub fn first_crossing(scene: &Scene, poses: &[Pose]) -> Option<(usize, u32)> {
    let bounds = scene.bounds();
    let side = 96usize;
    let size = bounds.size();
    let at = |p: f64, axis: usize| {
        let share = (p - bounds.lo[axis]) / size[axis].max(1e-12);
        (share * side as f64).clamp(0.0, side as f64 - 1.0) as usize
    };
    // Triangles by the columns of a flat grid that their bounds reach.
    let mut columns: Vec<Vec<u32>> = vec![Vec::new(); side * side];
    for t in 0..scene.len() as u32 {
        let b = scene.triangle_aabb(t);
        for x in at(b.lo.x, 0)..=at(b.hi.x, 0) {
            for y in at(b.lo.y, 1)..=at(b.hi.y, 1) {
                columns[x * side + y].push(t);
            }
        }
    }
    let hit = |i: usize| {
        let (p, q) = (poses[i].eye, poses[i + 1].eye);
        let reach = Aabb::of_points(&[p, q]);
        let (x, y) = ((at(reach.lo.x, 0), at(reach.hi.x, 0)), (at(reach.lo.y, 1), at(reach.hi.y, 1)));
        (x.0..=x.1)
            .flat_map(|cx| (y.0..=y.1).map(move |cy| cx * side + cy))
            .flat_map(|c| columns[c].iter())
            .copied()
            .find(|t| scene.triangle_aabb(*t).overlaps(&reach) && crosses(p, q, scene.corners(*t)))
    };
    (0..poses.len().saturating_sub(1)).into_par_iter().filter_map(|i| Some((i, hit(i)?))).min()
}
