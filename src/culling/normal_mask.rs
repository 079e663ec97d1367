//! `normal_mask`: back-face culling of nodes by normal masks (Zhang & Hoff 1997).
//!
//! Normals are quantised to the cells of a cube map, `cells` x `cells` a face. A
//! node's mask has a bit for every cell that a normal below it falls in. Once a
//! frame every cell is marked *front* unless all its normals are averted from
//! every ray of the view volume; a node without a front cell is skipped.
//!
//! What we changed: the test moves from the polygon to the node (as Serpa &
//! Rodrigues 2014 do), and a cell is judged by the exact corner test rather than
//! by a cone around it: `q.r >= guard` for the 4 corners `q` of the cell and the 4
//! corner rays `r` of the screen. As `n.r` is linear in both, 16 signs decide for
//! the whole cell and the whole view volume.
//!
//! # Why it is conservative, and what it removes
//! A triangle with normal `n` is front-facing iff `n.(v - e) < 0` for any, and then
//! for every, point `v` of its plane. Let it meet the view volume in a point `p`.
//! `p - e` is a sum of corner rays with weights >= 0, so if `n` is averted from all
//! of them, `n.(p - e) >= 0`: back-facing or edge-on, not front. (Orthographic: the
//! rays are all `forward`, which is what facing means there.) A triangle that does
//! *not* meet the view volume may be front-facing and still be skipped, as the rays
//! bound nothing outside it. It is invisible, but not for its facing: the test
//! therefore removes back-facing triangles **and** triangles outside the frustum.
//!
//! `rays = "node"` (`normal_mask_local`) takes the rays from the eye to the node's box in
//! place of those of the whole view. `saturation` leaves nodes out whose masks are
//! nearly full; one with the reserved bit, which no view averts, counts as full.
//!
//! The guard of `8 * 2^-24` relative to `|q||r|` exceeds the direction error of an
//! f64 normal by 400 for all but slivers; slivers, degenerate triangles (no normal)
//! and two-sided ones set a reserved bit that is always front.

use super::facing_columns::trusted_normal;
use super::normal_mask_local::Local;
use super::saturation::{SATURATION, Saturation};
use super::*;
use crate::hierarchy::{LANES, NONE};
use crate::math::DVec3;
use crate::registry::{Default as Allowed, Param};
use rayon::prelude::*;

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "normal_mask",
    about: "skip nodes whose normals are all averted from the whole view (Zhang & Hoff 1997)",
    revision: 1,
    params: &[
        Param {
            name: "cells",
            // 6 * 18^2 + 1 cells are the most that two bytes a triangle can name
            // with one byte value reserved, as the original stores them.
            default: Allowed::Int { value: 4, min: 1, max: 18 },
            about: "cells along an edge of each cube-map face; 6 cells^2 in all",
        },
        Param {
            name: "rays",
            default: Allowed::Later(&Allowed::Choice(&["view", "node"])),
            about: "what a cell is averted from: all rays of the view, or only those from the eye to the node's box",
        },
        SATURATION,
    ],
    make: |spec| {
        let local = spec.text("rays") == "node";
        let test = NormalMask::new(spec.int("cells") as usize).with_rays_to_nodes(local);
        Box::new(test.with_saturation(spec.float("saturation")))
    },
};

/// Relative guard of the corner test.
pub(super) const GUARD: f64 = 8.0 / (1u32 << 24) as f64;

/// Cells of the cube map of normals, plus the reserved one that is always front.
#[derive(Debug, Clone, Copy)]
pub struct Cells {
    /// Per face edge.
    pub per_edge: usize,
}

impl Cells {
    /// Cells of the cube map; also the number of the reserved cell.
    pub fn count(self) -> usize {
        6 * self.per_edge * self.per_edge
    }

    /// Cell of a direction of any length, not zero. Faces are +x -x +y -y +z -z.
    pub fn of_direction(self, n: DVec3) -> usize {
        let a = n.abs();
        let axis = if a.x >= a.y && a.x >= a.z {
            0
        } else if a.y >= a.z {
            1
        } else {
            2
        };
        let step = |x: f64| {
            let at = (x / a[axis] + 1.0) * 0.5 * self.per_edge as f64;
            (at as usize).min(self.per_edge - 1)
        };
        let face = 2 * axis + usize::from(n[axis] < 0.0);
        (face * self.per_edge + step(n[(axis + 1) % 3])) * self.per_edge + step(n[(axis + 2) % 3])
    }

    /// Cell of a triangle; the reserved one if it has no trustworthy normal or no back.
    pub fn of_triangle(self, scene: &Scene, t: u32) -> usize {
        match trusted_normal(&scene.corners(t)) {
            Some(n) if !scene.two_sided[t as usize] => self.of_direction(n),
            _ => self.count(),
        }
    }

    /// Corners of a cell on the surface of the cube of half size 1.
    pub fn corners(self, cell: usize) -> [DVec3; 4] {
        let s = self.per_edge;
        let (face, i, j) = (cell / (s * s), cell / s % s, cell % s);
        let axis = face / 2;
        let at = |k: usize| 2.0 * k as f64 / s as f64 - 1.0;
        [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| {
            let mut q = DVec3::ZERO;
            q[axis] = if face % 2 == 0 { 1.0 } else { -1.0 };
            q[(axis + 1) % 3] = at(i);
            q[(axis + 2) % 3] = at(j);
            q
        })
    }

    /// Every normal of the cell is averted from every ray between `rays`.
    pub fn is_averted(self, cell: usize, rays: &[DVec3; 4]) -> bool {
        self.corners(cell).iter().all(|q| rays.iter().all(|r| q.dot(*r) >= GUARD * (q.length() * r.length())))
    }

    fn words(self) -> usize {
        (self.count() + 1).div_ceil(64)
    }

    /// Every corner of the six faces once, `(per_edge + 1)^2` a face in the order
    /// of cells, with its length: up to four cells share one.
    fn lattice(self) -> Vec<(DVec3, f64)> {
        let s = self.per_edge;
        let corner = |face: usize, i: usize, j: usize| {
            let cell = (face * s + i.min(s - 1)) * s + j.min(s - 1);
            self.corners(cell)[[[0, 3], [1, 2]][usize::from(i == s)][usize::from(j == s)]]
        };
        let rows = (0..6).flat_map(|face| (0..=s).map(move |i| (face, i)));
        let all = rows.flat_map(|(face, i)| (0..=s).map(move |j| corner(face, i, j)));
        all.map(|q| (q, q.length())).collect()
    }
}

/// The test. Column: `words` x 8 lanes of mask words a block.
pub struct NormalMask {
    cells: Cells,
    masks: Vec<[u64; LANES]>,
    /// Corners of all cells and their lengths.
    lattice: Vec<(DVec3, f64)>,
    /// By corner: averted from all rays of this frame.
    averted: Vec<bool>,
    /// Bit set: the cell may hold front-facing normals this frame.
    front: Vec<u64>,
    all_front: bool,
    /// Rays to the nodes' boxes decide, not those of the view.
    local: Option<Local>,
    saturation: Option<Saturation>,
}

impl NormalMask {
    pub fn new(cells: usize) -> NormalMask {
        let cells = Cells { per_edge: cells };
        let lattice = cells.lattice();
        let averted = vec![false; lattice.len()];
        NormalMask {
            cells,
            masks: Vec::new(),
            lattice,
            averted,
            front: vec![!0; cells.words()],
            all_front: true,
            local: None,
            saturation: None,
        }
    }

    /// The same with the rays from the eye to each node's box.
    pub fn with_rays_to_nodes(self, yes: bool) -> NormalMask {
        NormalMask { local: yes.then(|| Local::new(self.cells)), ..self }
    }

    /// The same without asking nodes whose masks have at least this share of their bits;
    /// 0 asks all.
    pub fn with_saturation(self, share: f64) -> NormalMask {
        NormalMask { saturation: Saturation::new(share), ..self }
    }

    /// Share of a node's bits; all if one of them is the reserved one.
    fn share(&self, block: usize, lane: usize) -> f64 {
        let (words, cells) = (self.cells.words(), self.cells.count());
        let mask = &self.masks[block * words..][..words];
        let reserved = mask[cells / 64][lane] >> (cells % 64) & 1 == 1;
        let bits: u32 = mask.iter().map(|w| w[lane].count_ones()).sum();
        if reserved { 1.0 } else { f64::from(bits) / cells as f64 }
    }

    fn is_local(&self) -> bool {
        self.local.as_ref().is_some_and(Local::is_perspective)
    }
}

impl Test for NormalMask {
    fn class(&self) -> Class {
        Class::Conservative
    }

    fn removes(&self) -> Removes {
        Removes { back_facing: true, outside_frustum: true, ..Default::default() }
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        let words = self.cells.words();
        let cell: Vec<u16> = (0..scene.len() as u32)
            .into_par_iter()
            .with_min_len(4096)
            .map(|t| self.cells.of_triangle(scene, t) as u16)
            .collect();
        self.masks = vec![[0; LANES]; hierarchy.links.len() * words];
        let masks = &mut self.masks;
        super::descent::bottom_up(hierarchy, |block, lane| {
            let links = &hierarchy.links[block];
            for position in links.first[lane]..links.own_end[lane] {
                let c = usize::from(cell[hierarchy.entries[position as usize] as usize]);
                masks[block * words + c / 64][lane] |= 1 << (c % 64);
            }
            if links.child[lane] != NONE {
                let child = links.child[lane] as usize;
                for w in 0..words {
                    let below = masks[child * words + w].iter().fold(0, |m, b| m | b);
                    masks[block * words + w][lane] |= below;
                }
            }
        });
        let mut saturation = self.saturation.take();
        let bytes = saturation.as_mut().map_or(0, |s| s.prepare(hierarchy, |block, lane| self.share(block, lane)));
        self.saturation = saturation;
        bytes + size_of_val(&self.masks[..])
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        // Parallel rays are the same to every node.
        if let Some(local) = self.local.as_mut() {
            local.begin(view, hierarchy.origin);
        }
        let rays = view.corner_rays().map(|r| (r, r.length()));
        // Each corner once, where `Cells::is_averted`, the naive twin, asks it for
        // every cell around it; most corners fail at the first ray.
        for (averted, (q, length)) in self.averted.iter_mut().zip(&self.lattice) {
            *averted = rays.iter().all(|(r, r_length)| q.dot(*r) >= GUARD * (length * r_length));
        }
        self.front.fill(!0);
        self.all_front = true;
        let s = self.cells.per_edge;
        let faces = self.averted.chunks_exact((s + 1) * (s + 1)).enumerate();
        for (face, corners) in faces.filter(|(_, corners)| corners.contains(&true)) {
            for i in 0..s {
                let (row, next) = (&corners[i * (s + 1)..][..=s], &corners[(i + 1) * (s + 1)..][..=s]);
                for j in (0..s).filter(|j| row[*j] && row[j + 1] && next[*j] && next[j + 1]) {
                    let cell = (face * s + i) * s + j;
                    self.front[cell / 64] &= !(1 << (cell % 64));
                    self.all_front = false;
                }
            }
        }
    }

    fn initial_carry(&self) -> u8 {
        u8::from(!self.all_front || self.is_local())
    }

    fn judge(&mut self, hierarchy: &Hierarchy, block: u32, live: u8, _carry: u8, tally: &mut Tally) -> Verdict {
        tally.lane_tests += u64::from(live.count_ones());
        let asked = self.saturation.as_ref().map_or(live, |s| s.asked(block, live, tally));
        tally.mask_tests += u64::from(asked.count_ones());
        let mut verdict = if asked == 0 {
            Verdict { outside: 0, carry: [1; LANES] }
        } else if let (true, Some(local)) = (self.is_local(), &self.local) {
            let words = self.front.len();
            let masks = &self.masks[block as usize * words..][..words];
            // Smaller boxes below may be averted though this one is not.
            let outside = local.outside(&hierarchy.bounds[block as usize], masks, asked);
            Verdict { outside, carry: [1; LANES] }
        } else {
            self.against_view(block)
        };
        verdict.outside &= live;
        if let Some(saturation) = &self.saturation {
            saturation.keep_others(block, asked, &mut verdict);
        }
        verdict
    }
}

impl NormalMask {
    fn against_view(&self, block: u32) -> Verdict {
        let words = self.front.len();
        let (mut facing, mut averted) = ([0u64; LANES], [0u64; LANES]);
        for (masks, front) in self.masks[block as usize * words..][..words].iter().zip(&self.front) {
            for lane in 0..LANES {
                facing[lane] |= masks[lane] & front;
                averted[lane] |= masks[lane] & !front;
            }
        }
        let mut verdict = Verdict { outside: 0, carry: [0; LANES] };
        for lane in 0..LANES {
            verdict.outside |= u8::from(facing[lane] == 0) << lane;
            // All cells front here: then also in every subset below.
            verdict.carry[lane] = u8::from(averted[lane] != 0);
        }
        verdict
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, Pose, Projection};

    #[test]
    fn asking_each_shared_corner_once_gives_the_cells_that_asking_each_cell_does() {
        let fovs = [1e-4, 0.3, 1.0, 1.6, 3.0];
        for (i, fov_y_rad) in fovs.into_iter().chain([f64::NAN]).enumerate() {
            let projection = match fov_y_rad.is_nan() {
                true => Projection::Orthographic { height_m: 3.0 },
                false => Projection::Perspective { fov_y_rad },
            };
            let camera = Camera { projection, ..Camera::default() };
            // Also axes that lie exactly on corners and edges of cells.
            for forward in [DVec3::X, DVec3::NEG_Y, DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.3, -0.8, 0.2 * i as f64)] {
                let view = View::new(&camera, &Pose { eye: DVec3::ZERO, forward, up: DVec3::new(0.0, 0.1, 1.0) });
                for per_edge in [1, 2, 4, 5, 18] {
                    let mut test = NormalMask::new(per_edge);
                    test.begin(&view, &Hierarchy::default());
                    let front = |cell: usize| test.front[cell / 64] >> (cell % 64) & 1 == 1;
                    for cell in 0..test.cells.count() {
                        assert_eq!(front(cell), !test.cells.is_averted(cell, &view.corner_rays()), "{per_edge} {cell}");
                    }
                    assert!(front(test.cells.count()), "the reserved cell is always front");
                }
            }
        }
    }
}
