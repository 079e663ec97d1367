//! `f32_relative`: single precision relative to the camera, with the guard that
//! `frustum_planes` proves. The default, and the fastest; class conservative.

use super::frustum_arithmetic::{Ask, PlaneTest};
use super::frustum_planes::{FramePlanes, PlaneMasks, Work};
use super::{Class, Tally};
use crate::hierarchy::{BoundsBlock, Hierarchy};
use crate::math::View;

type BlockKernel = fn(&FramePlanes, &BoundsBlock, u8, bool, &mut PlaneMasks);
type FlatKernel = fn(&FramePlanes, &[BoundsBlock], &[u8], &mut [u8]) -> Work;

/// One instruction set's pair of kernels; all give the same bits.
#[derive(Debug, Clone, Copy)]
pub struct Kernels {
    pub name: &'static str,
    pub block: BlockKernel,
    pub flat: FlatKernel,
}

/// What this processor can run, the widest first, the scalar twin last.
pub fn kernels() -> Vec<Kernels> {
    kernels_of::<true>()
}

/// The same with or without guard: for `f32_relative` or `f32_world`.
pub fn kernels_of<const GUARDED: bool>() -> Vec<Kernels> {
    use super::frustum_scalar as scalar;
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        use super::frustum_x86 as x86;
        if x86::has_avx512() {
            found.push(Kernels {
                name: "avx512",
                block: x86::block_avx2::<GUARDED>,
                flat: x86::flat_avx512::<GUARDED>,
            });
        }
        if x86::has_avx2() {
            found.push(Kernels { name: "avx2", block: x86::block_avx2::<GUARDED>, flat: x86::flat_avx2::<GUARDED> });
        }
    }
    found.push(Kernels { name: "scalar", block: scalar::block::<GUARDED>, flat: scalar::flat::<GUARDED> });
    found
}

/// The planes of the frame and the kernels that read them.
pub struct Relative {
    kernels: Kernels,
    frame: FramePlanes,
}

impl Relative {
    pub fn new(kernels: Kernels) -> Relative {
        Relative { kernels, frame: FramePlanes::default() }
    }
}

impl PlaneTest for Relative {
    const CLASS: Class = Class::Conservative;

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.frame = FramePlanes::new(view, hierarchy.origin);
    }

    fn planes(&self) -> usize {
        self.frame.count
    }

    #[inline]
    fn block(&mut self, hierarchy: &Hierarchy, ask: &Ask, masks: &mut PlaneMasks, _: &mut Tally) {
        (self.kernels.block)(&self.frame, &hierarchy.bounds[ask.block as usize], ask.planes, ask.inside, masks);
    }

    fn flat(&mut self, hierarchy: &Hierarchy, live: &[u8], outside: &mut [u8], _: &mut Tally) -> Work {
        (self.kernels.flat)(&self.frame, &hierarchy.bounds[..outside.len()], live, outside)
    }
}
