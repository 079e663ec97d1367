//! `filtered`: the frustum test in floating-point filters before exact signs;
//! class conservative, and the same signs as `exact` (fact H.4).
//!
//! Single precision decides where its guard lets it (8 boxes at once); what is
//! left goes to double precision with its own guard, and what that leaves open to an
//! exact sign: the filter cascade of Shewchuk (1997) and of Brönnimann, Burnikel and
//! Pion (2001), with the bounds of [`super::frustum_planes`] and [`super::frustum_f64`].
//! `Tally::predicates` counts the signs asked, each lane in order of planes up
//! to the one that rejects it, so that the count knows nothing of vector widths.

use super::frustum_arithmetic::{Ask, PlaneTest, bits};
use super::frustum_exact::ExactPlanes;
use super::frustum_f64::Planes64;
use super::frustum_planes::{FramePlanes, MAX_PLANES, PlaneMasks};
use super::{Class, Tally, frustum_scalar as scalar};
use crate::hierarchy::{BoundsBlock, Hierarchy, LANES};
use crate::math::{Box32, View};
use std::cmp::Ordering;

/// What single precision knows of 8 boxes: bit per lane, an entry a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Signs {
    /// The p-vertex is certainly outside, certainly not.
    pub p_below: [u8; MAX_PLANES],
    pub p_above: [u8; MAX_PLANES],
    /// The same of the n-vertex.
    pub n_below: [u8; MAX_PLANES],
    pub n_above: [u8; MAX_PLANES],
}

/// Kernel of one instruction set: planes of the mask; n-vertices if told so.
pub type SignKernel = fn(&FramePlanes, &BoundsBlock, u8, bool, &mut Signs);

/// The twin of the vector kernels.
pub fn signs(frame: &FramePlanes, bounds: &BoundsBlock, wanted: u8, want_inside: bool, out: &mut Signs) {
    for k in bits(wanted) {
        let plane = &frame.planes[k];
        let mut found = [0u8; 4];
        for lane in 0..LANES {
            let (a, guard) = scalar::relative(frame, bounds, lane);
            let below = |corner| u8::from(scalar::value(plane, &a, corner, plane.d_out) < -guard) << lane;
            let above = |corner| u8::from(scalar::value(plane, &a, corner, plane.d_in) > guard) << lane;
            found[0] |= below(&plane.p);
            found[1] |= above(&plane.p);
            if want_inside {
                found[2] |= below(&plane.n);
                found[3] |= above(&plane.n);
            }
        }
        (out.p_below[k], out.p_above[k]) = (found[0], found[1]);
        if want_inside {
            (out.n_below[k], out.n_above[k]) = (found[2], found[3]);
        }
    }
}

/// What this processor can run, the widest first, the scalar twin last.
pub fn kernels() -> Vec<(&'static str, SignKernel)> {
    let mut found: Vec<(&'static str, SignKernel)> = Vec::new();
    #[cfg(target_arch = "x86_64")]
    if super::frustum_x86::has_avx2() {
        found.push(("avx2", super::frustum_x86::signs_avx2));
    }
    found.push(("scalar", signs));
    found
}

/// The arithmetic `filtered`.
pub struct Filtered {
    kernel: SignKernel,
    single: FramePlanes,
    double: Planes64,
    exact: ExactPlanes,
}

impl Default for Filtered {
    fn default() -> Filtered {
        Filtered {
            kernel: kernels()[0].1,
            single: FramePlanes::default(),
            double: Planes64::default(),
            exact: ExactPlanes::default(),
        }
    }
}

impl Filtered {
    /// Of the lanes that single precision leaves open, those whose corner is below plane `k`.
    #[cold]
    fn below(&self, bounds: &BoundsBlock, k: usize, open: u8, far: bool, tally: &mut Tally) -> u8 {
        let mut below = 0;
        for lane in bits(open) {
            let b: Box32 = bounds.get(lane);
            tally.fallbacks_f64 += 1;
            let sign = self.double.sign(k, &b, far).unwrap_or_else(|| {
                tally.fallbacks_exact += 1;
                self.exact.sign(k, &b, far)
            });
            below |= u8::from(sign == Ordering::Less) << lane;
        }
        below
    }
}

impl PlaneTest for Filtered {
    const CLASS: Class = Class::Conservative;

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.single = FramePlanes::new(view, hierarchy.origin);
        self.double = Planes64::new(view, hierarchy.origin);
        self.exact = ExactPlanes::new(view, hierarchy.origin);
    }

    fn planes(&self) -> usize {
        self.single.count
    }

    fn block(&mut self, hierarchy: &Hierarchy, ask: &Ask, masks: &mut PlaneMasks, tally: &mut Tally) {
        let bounds = &hierarchy.bounds[ask.block as usize];
        let mut signs = Signs::default();
        (self.kernel)(&self.single, bounds, ask.planes, ask.inside, &mut signs);
        let mut alive = ask.lanes;
        // Asked only where a sign is open: such boxes are among those.
        let mut finite = None;
        let mut sound =
            |lanes: u8| if lanes == 0 { 0 } else { lanes & *finite.get_or_insert_with(|| finite_lanes(bounds)) };
        for k in bits(ask.planes) {
            tally.predicates += u64::from(alive.count_ones());
            let open = sound(alive & !(signs.p_below[k] | signs.p_above[k]));
            let mut outside = alive & signs.p_below[k];
            if open != 0 {
                outside |= self.below(bounds, k, open, true, tally);
            }
            masks.outside[k] = outside;
            if ask.inside {
                let asked = alive & !outside;
                tally.predicates += u64::from(asked.count_ones());
                let open = sound(asked & !(signs.n_below[k] | signs.n_above[k]));
                let mut inside = asked & signs.n_above[k];
                if open != 0 {
                    inside |= open & !self.below(bounds, k, open, false, tally);
                }
                masks.inside[k] = inside;
            }
            if ask.until_rejected {
                alive &= !outside;
            }
        }
    }
}

fn finite_lanes(bounds: &BoundsBlock) -> u8 {
    (0..LANES).fold(0, |m, lane| {
        let b = bounds.get(lane);
        m | u8::from(b.lo.is_finite() && b.hi.is_finite()) << lane
    })
}
