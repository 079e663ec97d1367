//! `sector`: back-face culling of single triangles by the azimuth sector of their
//! normals (Silva 2009, there called conservative). The sector of a triangle is
//! computed once; a frame looks up what becomes of each sector.
//!
//! `rule` says which sectors are discarded:
//! - `equal` (Silva 2009): the one that holds the look-at vector. Elevation is dropped
//!   and the field of view ignored, so it is **aggressive**; it removes little and
//!   is seldom wrong.
//! - `averted` (Serpa & Rodrigues 2014, `octant_mask` by triangle): all sectors whose
//!   azimuths lie within 90 degrees of the axis. **Aggressive**, removes much more and
//!   is wrong much more often.
//! - `safe` (ours): the sectors whose directions are all averted from every ray of the
//!   view volume, by the corner test of Zhang & Hoff (1997). **Conservative**.
//!
//! # The safe rule
//! A sector stands for the directions `(cos p, sin p, t)` with `p` in the sector and
//! `t` between the least and the greatest slope of the scene's normals there; normals
//! steeper than [`STEEP`] would spoil that range for all, so they are kept unasked.
//! The arc lies in the triangle of its two ends and the point where their tangents
//! meet, so the directions lie in the cone over six points, and `q.r >= guard` for
//! these six and the four corner rays decides for all.
//!
//! Two-sided triangles, those without area and those whose normal has no azimuth are kept.

use super::facing_columns::{trusted_normal, unit_normal};
use super::normal_mask::GUARD;
use super::octant_mask::{averted, sector};
use super::*;
use crate::math::DVec3;
use crate::registry::{Default as Allowed, Param};
use rayon::prelude::*;
use std::f64::consts::TAU;

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "sector",
    about: "triangles by the azimuth sector of their normals (Silva 2009; aggressive unless rule=safe)",
    revision: 1,
    params: &[
        Param {
            name: "rule",
            default: Allowed::Choice(&["equal", "averted", "safe"]),
            about: "what is discarded: the view axis' own sector, all within 90 degrees of it, or only what is safe",
        },
        Param {
            name: "sectors",
            default: Allowed::Choice(&["8", "4", "16"]),
            about: "sectors of the horizontal circle",
        },
    ],
    make: |spec| {
        let sectors = spec.text("sectors").parse().expect("choices are numbers");
        Box::new(Sectors::new(Rule::named(spec.text("rule")), sectors, kernels()[0]))
    },
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    Equal,
    Averted,
    Safe,
}

impl Rule {
    fn named(name: &str) -> Rule {
        match name {
            "equal" => Rule::Equal,
            "averted" => Rule::Averted,
            _ => Rule::Safe,
        }
    }
}

/// Byte of a triangle that is kept unasked. Its high bit makes a byte shuffle give 0.
pub const UNASKED: u8 = 0x80;

/// Slope (vertical over horizontal part) from which the safe rule keeps a normal: 20 degrees.
pub const STEEP: f64 = 0.363_970_234_266_202_4;

/// A set high bit of `table[s]` discards sector `s`.
pub type Table = [u8; 16];

/// A kernel: takes out of `keep` the positions whose sector is discarded.
#[derive(Debug, Clone, Copy)]
pub struct Kernel {
    pub name: &'static str,
    pub run: fn(&Table, &[u8], &mut [u64]),
}

/// What this processor can run, the widest first, the scalar twin last.
pub fn kernels() -> Vec<Kernel> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        use super::sector_x86 as x86;
        if x86::has_avx512() {
            found.push(Kernel { name: "avx512", run: x86::look_up_avx512 });
        }
        if x86::has_avx2() {
            found.push(Kernel { name: "avx2", run: x86::look_up_avx2 });
        }
    }
    found.push(Kernel { name: "scalar", run: look_up });
    found
}

/// The scalar twin.
pub fn look_up(table: &Table, sectors: &[u8], keep: &mut [u64]) {
    for (sectors, word) in sectors.chunks_exact(64).zip(keep).filter(|(_, w)| **w != 0) {
        let gone = |s: &u8| *s < 16 && table[*s as usize] & 0x80 != 0;
        *word &= sectors.iter().enumerate().fold(!0, |m, (i, s)| m & !(u64::from(gone(s)) << i));
    }
}

/// The test. Column: a byte a position.
pub struct Sectors {
    rule: Rule,
    sectors: u32,
    bytes: Vec<u8>,
    /// Safe rule: corners of the cone of each sector that occurs.
    cones: Vec<(u32, [DVec3; 6])>,
    table: Table,
    kernel: Kernel,
}

impl Sectors {
    pub fn new(rule: Rule, sectors: u32, kernel: Kernel) -> Sectors {
        assert!(matches!(sectors, 4 | 8 | 16), "the registry offers 4, 8 and 16 sectors");
        Sectors { rule, sectors, bytes: Vec::new(), cones: Vec::new(), table: [0; 16], kernel }
    }

    /// Sector and slope of a triangle, unless it is kept unasked.
    fn of_triangle(&self, scene: &Scene, t: u32) -> Option<(u32, f64)> {
        let n = unit_normal(scene, t)?;
        let slope = n.z / f64::hypot(n.x, n.y);
        // The range of slopes must hold the exact normal: a sliver's may lie elsewhere.
        let safe = slope.abs() < STEEP && trusted_normal(&scene.corners(t)).is_some();
        sector(n, self.sectors).filter(|_| self.rule != Rule::Safe || safe).map(|s| (s, slope))
    }

    /// The six corners of sector `s` with slopes from `lo` to `hi`.
    fn cone(&self, s: u32, lo: f64, hi: f64) -> [DVec3; 6] {
        // Wider by 1e-9 than the sector: the azimuth of a normal is rounded.
        let half = TAU / f64::from(self.sectors) / 2.0 + 1e-9;
        let middle = (f64::from(s) + 0.5) * TAU / f64::from(self.sectors);
        let at = |turn: f64, reach: f64| (libm::cos(middle + turn) * reach, libm::sin(middle + turn) * reach);
        let ends = [at(-half, 1.0), at(half, 1.0), at(0.0, 1.0 / libm::cos(half))];
        let corner = |i: usize| {
            let (x, y) = ends[i % 3];
            DVec3::new(x, y, if i < 3 { lo - 1e-9 } else { hi + 1e-9 })
        };
        std::array::from_fn(corner)
    }
}

impl Test for Sectors {
    fn class(&self) -> Class {
        if self.rule == Rule::Safe { Class::Conservative } else { Class::Aggressive }
    }

    /// The rays of the view volume say nothing of what is outside it (see `normal_mask`).
    fn removes(&self) -> Removes {
        Removes { back_facing: true, outside_frustum: true, ..Default::default() }
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        let found: Vec<Option<(u32, f64)>> =
            hierarchy.entries.par_iter().with_min_len(4096).map(|t| self.of_triangle(scene, *t)).collect();
        let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); self.sectors as usize];
        for (s, slope) in found.iter().flatten() {
            let range = &mut ranges[*s as usize];
            *range = (range.0.min(*slope), range.1.max(*slope));
        }
        let ranges = (0..self.sectors).zip(ranges).filter(|(_, (lo, hi))| lo <= hi);
        self.cones = ranges.map(|(s, (lo, hi))| (s, self.cone(s, lo, hi))).collect();
        self.bytes = found.iter().map(|f| f.map_or(UNASKED, |(s, _)| s as u8)).collect();
        self.bytes.resize(found.len().next_multiple_of(64), UNASKED);
        size_of_val(&self.bytes[..])
    }

    fn begin(&mut self, view: &View, _: &Hierarchy) {
        let camera = sector(view.forward, self.sectors);
        let gone = match self.rule {
            Rule::Equal => camera.map_or(0, |c| 1 << c),
            Rule::Averted => averted(camera, self.sectors),
            Rule::Safe => {
                let rays = view.corner_rays();
                let away = |q: &DVec3| rays.iter().all(|r| q.dot(*r) >= GUARD * (q.length() * r.length()));
                self.cones.iter().fold(0u16, |m, (s, cone)| m | u16::from(cone.iter().all(away)) << s)
            }
        };
        self.table = std::array::from_fn(|s| if gone >> s & 1 == 1 { 0x80 } else { 0 });
    }

    fn initial_carry(&self) -> u8 {
        0
    }

    fn judge(&mut self, _: &Hierarchy, _: u32, _: u8, _: u8, _: &mut Tally) -> Verdict {
        Verdict { outside: 0, carry: [0; 8] }
    }

    fn filter(&mut self, _: &Hierarchy, list: &mut DrawList, tally: &mut Tally) {
        // No sector to discard: the ranges stay as they are.
        if self.table != [0; 16] {
            tally.triangle_tests +=
                list.retain_words(|w, keep| (self.kernel.run)(&self.table, &self.bytes[64 * w..], keep));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cone_of_a_sector_holds_every_direction_of_it() {
        for sectors in [4u32, 8, 16] {
            let test = Sectors::new(Rule::Safe, sectors, kernels()[0]);
            for s in 0..sectors {
                let cone = test.cone(s, -0.2, 0.3);
                for i in 0..=20 {
                    let azimuth = (f64::from(s) + f64::from(i) / 20.0) * TAU / f64::from(sectors);
                    for t in [-0.2, 0.05, 0.3] {
                        let n = DVec3::new(azimuth.cos(), azimuth.sin(), t);
                        // Inside the prism of the six corners: on the inner side of each of its sides.
                        for k in 0..3 {
                            let (a, b) = (cone[k], cone[(k + 1) % 3]);
                            let out = DVec3::new(b.y - a.y, a.x - b.x, 0.0);
                            let inner = out.dot(cone[(k + 2) % 3] - a).signum();
                            assert!(out.dot(n - a) * inner >= -1e-15, "{sectors} {s} {i}");
                        }
                        assert!(cone[0].z < t && t < cone[3].z);
                    }
                }
            }
        }
    }
}
