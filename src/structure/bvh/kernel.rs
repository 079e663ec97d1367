//! Which kernels a build uses: the fastest that the processor has, or the scalar twins.

use super::bins::{self, Bins, Domain, Split};
use super::record::{self, Record, Span};
use super::sides;
use super::sweep::{Cut, Sweep};
#[cfg(target_arch = "x86_64")]
use super::{best_x86, bins_x86, record_x86, sides_x86, sweep_x86};
use crate::scene::Scene;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Kernel {
    /// All that this processor can run, the fastest last.
    pub fn all() -> Vec<Kernel> {
        #[cfg(target_arch = "x86_64")]
        if bins_x86::has_avx2() {
            return vec![Kernel::Scalar, Kernel::Avx2];
        }
        vec![Kernel::Scalar]
    }

    pub fn fastest() -> Kernel {
        Kernel::all()[Kernel::all().len() - 1]
    }

    pub fn fill(self, records: &[Record], domain: &Domain, bins: usize, out: &mut Bins, spare: &mut Bins) {
        match self {
            Kernel::Scalar => bins::fill(records, domain, bins, out),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => bins_x86::fill(records, domain, bins, out, spare),
        }
        let _ = spare;
    }

    pub fn deal(
        self,
        records: &[Record],
        sides: [&mut [Record]; 2],
        domain: &Domain,
        split: &Split,
        below: &[Domain; 2],
        bins: usize,
        out: [&mut Bins; 2],
        spare: &mut [Bins; 2],
    ) {
        match self {
            Kernel::Scalar => bins::deal(records, sides, domain, split, below, bins, out),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => bins_x86::deal(records, sides, domain, split, below, bins, out, spare),
        }
        let _ = spare;
    }

    pub fn part(self, records: &[Record], sides: [&mut [Record]; 2], domain: &Domain, split: &Split) {
        match self {
            Kernel::Scalar => bins::part(records, sides, domain, split),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => bins_x86::part(records, sides, domain, split),
        }
    }

    pub fn best(self, all: &Bins, bins: usize) -> Option<Split> {
        match self {
            Kernel::Scalar => all.best(bins),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => best_x86::best(all, bins),
        }
    }

    pub fn sides(self, from: &Bins, split: &Split, bins: usize) -> [Span; 2] {
        match self {
            Kernel::Scalar => sides::sides(from, split, bins),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => sides_x86::sides(from, split, bins),
        }
    }

    pub fn below(
        self,
        from: &Bins,
        domain: &Domain,
        bins: usize,
        split: &Split,
        bounds: &[Span; 2],
        bins_below: usize,
    ) -> [Domain; 2] {
        match self {
            Kernel::Scalar => sides::below(from, domain, bins, split, bounds, bins_below),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => sides_x86::below(from, domain, bins, split, bounds, bins_below),
        }
    }

    pub fn cut(self, records: &[Record], out: &mut [Record], sweep: &mut Sweep) -> Option<Cut> {
        match self {
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 if records.len() <= sweep_x86::MOST => sweep_x86::cut(records, out),
            _ => sweep.cut(records, out),
        }
    }

    pub fn extent(self, records: &[Record]) -> (Span, [f32; 3], [f32; 3]) {
        match self {
            Kernel::Scalar => bins::extent(records),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => bins_x86::extent(records),
        }
    }

    pub fn records(self, scene: &Scene, first: u32, out: &mut [Record]) {
        match self {
            Kernel::Scalar => record::make(scene, first, out),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => record_x86::make(scene, first, out),
        }
    }
}
