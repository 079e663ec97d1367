//! Normal masks by node (`normal_mask:rays=node`): a cell is averted from a node if
//! its normals are averted from every ray from the eye to the node's box.
//!
//! Zhang & Hoff (1997) judge a cell by the rays of the whole view volume, or of its
//! parts; a node's box bounds far fewer rays. `q.(p - e)` is linear in the corner `q` of
//! the cell and in the point `p` of the box, so the least value over the box, which
//! picks a bound an axis by the sign of `q`, decides for each of the four corners.
//!
//! Conservative: every piece below the node has a point `p` in the box (copies of a
//! triangle may reach out of it), and `n.(p - e) >= 0` for one point of its plane is
//! back-facing or edge-on. The guard is that of the whole view, relative to the
//! farthest point of the box; a fragment of a split triangle lies off its plane by some
//! ulps of world coordinates, for which there is an absolute part.

use super::normal_cone::ULPS;
use super::normal_mask::{Cells, GUARD};
use crate::hierarchy::{BoundsBlock, LANES};
use crate::math::{DVec3, View};

type Lanes = [f64; LANES];

/// Corners of all cells, and the eye of the frame.
pub(super) struct Local {
    /// With their lengths.
    corners: Vec<[(DVec3, f64); 4]>,
    /// From the origin of the hierarchy.
    eye: DVec3,
    /// Error of world coordinates, metres.
    slack_m: f64,
    perspective: bool,
}

impl Local {
    pub fn new(cells: Cells) -> Local {
        let corners = (0..cells.count()).map(|c| cells.corners(c).map(|q| (q, q.length()))).collect();
        Local { corners, eye: DVec3::ZERO, slack_m: 0.0, perspective: true }
    }

    pub fn begin(&mut self, view: &View, origin: DVec3) {
        self.perspective = view.is_perspective();
        self.eye = view.eye - origin;
        self.slack_m = (origin.abs().max_element() + view.eye.abs().max_element()) * ULPS;
    }

    pub fn is_perspective(&self) -> bool {
        self.perspective
    }

    /// The live lanes all of whose cells are averted from their boxes.
    pub fn outside(&self, bounds: &BoundsBlock, masks: &[[u64; LANES]], live: u8) -> u8 {
        let mut lo = [[0.0; LANES]; 3];
        let mut hi = [[0.0; LANES]; 3];
        let mut guard = [self.slack_m; LANES];
        for axis in 0..3 {
            for lane in 0..LANES {
                lo[axis][lane] = f64::from(bounds.lo[axis][lane]) - self.eye[axis];
                hi[axis][lane] = f64::from(bounds.hi[axis][lane]) - self.eye[axis];
                guard[lane] += (GUARD + ULPS) * (lo[axis][lane].abs() + hi[axis][lane].abs());
            }
        }
        // Lanes that have not met a cell that faces the eye.
        let mut left = live;
        for (w, word) in masks.iter().enumerate() {
            let mut rest = (0..LANES).filter(|l| left >> l & 1 == 1).fold(0, |m, l| m | word[l]);
            while rest != 0 {
                let bit = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let having = (0..LANES).fold(0, |m, l| m | ((word[l] >> bit & 1) as u8) << l);
                if having & left != 0 {
                    // The reserved cell has no corners: it always faces the eye.
                    let averted = self.corners.get(w * 64 + bit).map_or(0, |q| averted(q, &lo, &hi, &guard));
                    left &= !having | averted;
                }
                if left == 0 {
                    return 0;
                }
            }
        }
        left
    }
}

/// Lanes whose whole box the cell is averted from.
fn averted(corners: &[(DVec3, f64); 4], lo: &[Lanes; 3], hi: &[Lanes; 3], guard: &Lanes) -> u8 {
    let mut lanes = 0xff;
    for (q, length) in corners {
        let mut least = [0.0; LANES];
        for axis in 0..3 {
            let nearest = if q[axis] >= 0.0 { &lo[axis] } else { &hi[axis] };
            for lane in 0..LANES {
                least[lane] += q[axis] * nearest[lane];
            }
        }
        lanes &= (0..LANES).fold(0, |m, l| m | u8::from(least[l] >= guard[l] * length) << l);
        if lanes == 0 {
            break;
        }
    }
    lanes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Box32, Camera, Pose};
    use glam::Vec3;
    use rand_chacha::rand_core::{RngCore, SeedableRng};

    #[test]
    fn picking_a_bound_by_sign_gives_what_asking_all_eight_corners_gives() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut unit = move || (rng.next_u32() >> 8) as f32 / (1 << 23) as f32 - 1.0;
        let mut vector = move |by: f32| Vec3::new(unit(), unit(), unit()) * by;
        let cells = Cells { per_edge: 3 };
        let mut found = 0;
        for _ in 0..200 {
            let mut bounds = BoundsBlock::EMPTY;
            let mut masks = [[0u64; LANES]; 1];
            for (lane, mask) in masks[0].iter_mut().enumerate() {
                let (centre, half) = (vector(20.0), vector(2.0).abs());
                bounds.set(lane, Box32 { lo: centre - half, hi: centre + half });
                // Some neighbouring cells.
                *mask = 0b1011 << (centre.x.abs() * 2.4) as u32;
            }
            let eye = vector(5.0).as_dvec3();
            let mut local = Local::new(cells);
            local.begin(&View::new(&Camera::default(), &Pose { eye, forward: DVec3::X, up: DVec3::Z }), DVec3::ZERO);
            let outside = local.outside(&bounds, &masks, 0x7f);
            for (lane, mask) in masks[0].iter().enumerate() {
                let b = bounds.get(lane);
                let (lo, hi) = (b.lo.as_dvec3() - eye, b.hi.as_dvec3() - eye);
                let far = (lo.abs() + hi.abs()).element_sum();
                let guard = GUARD * far + (eye.abs().max_element() + far) * ULPS;
                let ray = |i: usize| DVec3::from_array([0, 1, 2].map(|k| if i >> k & 1 == 1 { hi[k] } else { lo[k] }));
                let away = |q: &DVec3| (0..8).all(|i| q.dot(ray(i)) >= guard * q.length());
                let all = (0..64).filter(|c| mask >> c & 1 == 1).all(|c| cells.corners(c).iter().all(away));
                assert_eq!(outside >> lane & 1 == 1, all && lane < 7);
                found += u32::from(all);
            }
        }
        assert!(found > 100, "{found}");
    }
}
