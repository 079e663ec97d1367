//! `octant_mask`: the back-face masks of Serpa & Rodrigues (2014), who quantise
//! normals to octants of the horizontal circle. **Aggressive**: elevation is
//! dropped and the field of view ignored, so front-facing triangles are lost; the
//! lab measures how many.
//!
//! Our reading, as the paper leaves it open: sector of a normal = its azimuth
//! `atan2(ny, nx)`, sector 0 beginning at +x; node mask = the sectors below it;
//! camera sector `c` = that of the view axis; averted are the sectors *all* of
//! whose azimuths lie within 90 degrees of the axis wherever in `c` it points:
//! `c` and its `sectors / 4 - 1` neighbours on either side (for 8: `c-1, c, c+1`).
//! A node is skipped iff its mask lies within the averted sectors.
//!
//! Normals that have no azimuth (floors and ceilings, exactly vertical; degenerate
//! triangles) and two-sided triangles set every bit, so they are never skipped; the
//! plain `atan2(0, 0) = 0` would lose all floors for a camera that looks along +x.
//! A camera that looks straight up or down averts nothing.

use super::saturation::{SATURATION, Saturation};
use super::*;
use crate::hierarchy::{LANES, NONE};
use crate::math::DVec3;
use crate::registry::{Default as Allowed, Param};
use rayon::prelude::*;
use std::f64::consts::TAU;

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "octant_mask",
    about: "skip nodes whose normals point away by azimuth alone (Serpa & Rodrigues 2014; aggressive)",
    revision: 1,
    params: &[
        SATURATION,
        Param {
            name: "sectors",
            default: Allowed::Choice(&["8", "4", "16"]),
            about: "sectors of the horizontal circle",
        },
    ],
    make: |spec| {
        let test = OctantMask::new(spec.text("sectors").parse().expect("choices are numbers"));
        Box::new(test.with_saturation(spec.float("saturation")))
    },
};

/// Sector of the horizontal part of `v`, or `None` if it has none.
pub fn sector(v: DVec3, sectors: u32) -> Option<u32> {
    if !(v.x != 0.0 || v.y != 0.0) || !v.is_finite() {
        return None;
    }
    let turn = libm::atan2(v.y, v.x) / TAU;
    let turn = if turn < 0.0 { turn + 1.0 } else { turn };
    // A tiny negative angle rounds up to a whole turn, which is the last sector.
    Some(((turn * f64::from(sectors)) as u32).min(sectors - 1))
}

/// Bits of the sectors within 90 degrees of a view axis in sector `camera`.
pub fn averted(camera: Option<u32>, sectors: u32) -> u16 {
    let Some(c) = camera else { return 0 };
    let reach = sectors / 4 - 1;
    (0..=2 * reach).fold(0, |mask, i| mask | 1 << ((c + sectors - reach + i) % sectors))
}

/// The test. Column: a mask a node.
pub struct OctantMask {
    sectors: u32,
    masks: Vec<[u16; LANES]>,
    averted: u16,
    saturation: Option<Saturation>,
}

impl OctantMask {
    pub fn new(sectors: u32) -> OctantMask {
        assert!(matches!(sectors, 4 | 8 | 16), "the registry offers 4, 8 and 16 sectors");
        OctantMask { sectors, masks: Vec::new(), averted: 0, saturation: None }
    }

    /// The same without asking nodes whose masks have at least this share of their bits;
    /// 0 asks all.
    pub fn with_saturation(self, share: f64) -> OctantMask {
        OctantMask { saturation: Saturation::new(share), ..self }
    }

    fn of_triangle(&self, scene: &Scene, t: u32) -> u16 {
        let all = !0 >> (16 - self.sectors);
        if scene.two_sided[t as usize] {
            return all;
        }
        sector(scene.normal(t), self.sectors).map_or(all, |s| 1 << s)
    }
}

impl Test for OctantMask {
    fn class(&self) -> Class {
        Class::Aggressive
    }

    /// As for `normal_mask`: what it skips outside the view is invisible there.
    fn removes(&self) -> Removes {
        Removes { back_facing: true, outside_frustum: true, ..Default::default() }
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        let own_mask: Vec<u16> =
            (0..scene.len() as u32).into_par_iter().with_min_len(4096).map(|t| self.of_triangle(scene, t)).collect();
        let mut masks = vec![[0; LANES]; hierarchy.links.len()];
        super::descent::bottom_up(hierarchy, |block, lane| {
            let links = &hierarchy.links[block];
            let own = &hierarchy.entries[links.first[lane] as usize..links.own_end[lane] as usize];
            let mut mask = own.iter().fold(0, |m, t| m | own_mask[*t as usize]);
            if links.child[lane] != NONE {
                mask |= masks[links.child[lane] as usize].iter().fold(0, |m, b| m | b);
            }
            masks[block][lane] = mask;
        });
        self.masks = masks;
        let share =
            |block: usize, lane: usize| f64::from(self.masks[block][lane].count_ones()) / f64::from(self.sectors);
        let bytes = self.saturation.as_mut().map_or(0, |s| s.prepare(hierarchy, share));
        bytes + size_of_val(&self.masks[..])
    }

    fn begin(&mut self, view: &View, _hierarchy: &Hierarchy) {
        self.averted = averted(sector(view.forward, self.sectors), self.sectors);
    }

    fn initial_carry(&self) -> u8 {
        u8::from(self.averted != 0)
    }

    fn judge(&mut self, _: &Hierarchy, block: u32, live: u8, _carry: u8, tally: &mut Tally) -> Verdict {
        tally.lane_tests += u64::from(live.count_ones());
        let asked = self.saturation.as_ref().map_or(live, |s| s.asked(block, live, tally));
        tally.mask_tests += u64::from(asked.count_ones());
        let mut verdict = Verdict { outside: 0, carry: [0; LANES] };
        for (lane, mask) in self.masks[block as usize].iter().enumerate() {
            verdict.outside |= u8::from(mask & !self.averted == 0) << lane;
            // No averted sector here: none in any subset below.
            verdict.carry[lane] = u8::from(mask & self.averted != 0);
        }
        verdict.outside &= live;
        if let Some(saturation) = &self.saturation {
            saturation.keep_others(block, asked, &mut verdict);
        }
        verdict
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sectors_begin_at_plus_x_and_go_round() {
        let at = |deg: f64| {
            let a = deg.to_radians();
            sector(DVec3::new(libm::cos(a), libm::sin(a), 0.3), 8)
        };
        assert_eq!([10.0, 50.0, 100.0, 350.0].map(at), [Some(0), Some(1), Some(2), Some(7)]);
        assert_eq!(sector(DVec3::new(1.0, -1e-300, 0.0), 8), Some(7), "just below a whole turn");
        assert_eq!(sector(DVec3::Z, 8), None);
        assert_eq!(sector(DVec3::new(f64::NAN, 1.0, 0.0), 8), None);
    }

    #[test]
    fn averted_sectors_lie_within_a_quarter_turn_of_the_axis() {
        for sectors in [4, 8, 16] {
            let width = 360.0 / f64::from(sectors);
            for c in 0..sectors {
                let mask = averted(Some(c), sectors);
                for k in 0..sectors {
                    // Largest angle between an azimuth in sector c and one in sector k.
                    let steps = (k + sectors - c) % sectors;
                    let steps = steps.min(sectors - steps);
                    let widest = (f64::from(steps) + 1.0) * width;
                    assert_eq!(mask >> k & 1 == 1, widest <= 90.0, "{sectors} {c} {k}");
                }
            }
            assert_eq!(averted(None, sectors), 0);
        }
    }
}
