//! One rasteriser, three instruction sets: what is compiled for each, and the choice.

use super::block::{Block, Corner, LANES};
use super::fill;
use super::lanes::Lanes;
use super::lanes_scalar::Scalar;
use super::large;
use super::occluders::Store;
use super::project::Rect;
use super::set_up::set_up;
use super::tiles::{TilesView, between};
use super::vertices::{BatchView, Lens};

/// An instruction set. Buffers and answers do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    Scalar,
    Avx2,
    Avx512,
}

impl Kernel {
    pub const ALL: [Kernel; 3] = [Kernel::Scalar, Kernel::Avx2, Kernel::Avx512];

    /// Whether this processor has it.
    pub fn present(self) -> bool {
        match self {
            Kernel::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => super::lanes_avx2::present(),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx512 => super::lanes_avx2::present() && super::lanes_avx512::present(),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    pub fn best() -> Kernel {
        Kernel::ALL.into_iter().rev().find(|k| k.present()).unwrap_or(Kernel::Scalar)
    }
}

/// Room to set up in.
#[derive(Debug)]
pub struct Scratch {
    corners: [Corner; 256],
    blocks: [Block; 2],
}

impl Default for Scratch {
    fn default() -> Scratch {
        Scratch { corners: [Corner::default(); 256], blocks: [Block::EMPTY; 2] }
    }
}

#[inline(always)]
unsafe fn draw_in<L: Lanes>(lens: &Lens, store: &Store, first: u32, end: u32, scratch: &mut Scratch, t: &TilesView) {
    let Scratch { corners, blocks } = scratch;
    // A block is drawn when the next one is set up: until then the buffer's lines are on their way.
    let (mut current, mut waiting) = (0, 0);
    let (mut p, mut b) = (first, store.batch_of(first));
    // SAFETY: the caller has the features; a batch's words name its corners, and spare ones
    // follow the last.
    unsafe {
        while p < end {
            let (batch, range) = store.batch(b);
            let stop = range.end.min(end);
            let view = BatchView::new(lens, &batch);
            L::project(&view, &batch, &mut corners[..batch.x.len()]);
            while p < stop {
                let (mut small, mut other) = (0, 0);
                let (firsts, paired) =
                    if view.inner { store.pairs(p, (stop - p).min(LANES as u32), first..end) } else { (0, 0) };
                let block = &mut blocks[current];
                let mut lane = 0;
                while lane < LANES && p + (lane as u32) < stop {
                    let live = between(0, (stop - p - lane as u32).min(L::N as u32)) & !(paired >> lane);
                    let words = store.words().as_ptr().add(p as usize + lane);
                    let made = set_up::<L>(&view, corners.as_ptr(), words, live, block, lane);
                    small |= made.small << lane;
                    other |= made.other << lane;
                    lane += L::N;
                }
                other |= firsts;
                if small | other != 0 {
                    prefetch::<L>(t, block, small);
                    draw_block::<L>(t, &blocks[1 - current], waiting);
                    waiting = small;
                    if other != 0 {
                        draw_mixed::<L>(lens, store, &view, b, p, &blocks[current], small, other, firsts, t);
                        waiting = 0;
                    }
                    current = 1 - current;
                }
                p += LANES as u32;
            }
            p = stop;
            b += 1;
        }
        draw_block::<L>(t, &blocks[1 - current], waiting);
    }
}

#[inline(always)]
unsafe fn prefetch<L: Lanes>(t: &TilesView, block: &Block, mut lanes: u32) {
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize & (LANES - 1);
        lanes &= lanes - 1;
        // SAFETY: the caller has the features.
        unsafe { t.prefetch::<L>(block.x0[lane], block.y0[lane]) };
    }
}

#[inline(always)]
unsafe fn draw_block<L: Lanes>(t: &TilesView, block: &Block, mut lanes: u32) {
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        // SAFETY: the lane was set up; the caller has the features.
        unsafe { fill::small::<L>(t, block, lane & (LANES - 1)) };
    }
}

/// The triangles of a block in order, small ones and others; those of `pairs` with their partners.
#[inline(always)]
unsafe fn draw_mixed<L: Lanes>(
    lens: &Lens,
    store: &Store,
    view: &BatchView,
    batch: usize,
    p: u32,
    block: &Block,
    small: u32,
    other: u32,
    pairs: u32,
    t: &TilesView,
) {
    let mut rest = small | other;
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize & (LANES - 1);
        rest &= rest - 1;
        if small >> lane & 1 != 0 {
            // SAFETY: the lane was set up; the caller has the features.
            unsafe { fill::small::<L>(t, block, lane) };
            continue;
        }
        let position = p + lane as u32;
        let two_sided = store.words()[position as usize] >> 24 > 1;
        let pair = if pairs >> lane & 1 != 0 { store.fixed_pair(batch, position) } else { None };
        let large = match pair {
            Some(quad) => large::make(lens, view, &quad, two_sided),
            None => large::make(lens, view, &store.fixed(batch, position), two_sided),
        };
        if let Some(large) = large {
            // SAFETY: it was just made.
            unsafe { fill::large::<L>(t, &large) };
        }
    }
}

/// The same functions for every instruction set, and the choice between them.
macro_rules! kernels {
    ($($(#[$doc:meta])* $name:ident = $body:ident($($arg:ident: $type:ty),*) -> $result:ty;)*) => {
        $($(#[$doc])*
        ///
        /// # Safety
        /// The buffer is of this image, and nobody else reads or writes what is drawn to; rectangles lie in it.
        pub unsafe fn $name(kernel: Kernel, $($arg: $type),*) -> $result {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,popcnt,bmi1,bmi2")]
                unsafe fn avx2($($arg: $type),*) -> $result {
                    // SAFETY: the features are enabled.
                    unsafe { $body::<super::lanes_avx2::Avx2>($($arg),*) }
                }
                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,popcnt,bmi1,bmi2")]
                unsafe fn avx512($($arg: $type),*) -> $result {
                    // SAFETY: the features are enabled.
                    unsafe { $body::<super::lanes_avx512::Avx512>($($arg),*) }
                }
                // SAFETY: a kernel is chosen if the processor has it only.
                unsafe {
                    match kernel {
                        Kernel::Avx512 => return avx512($($arg),*),
                        Kernel::Avx2 => return avx2($($arg),*),
                        Kernel::Scalar => {}
                    }
                }
            }
            let _ = kernel;
            // SAFETY: the twin needs no feature.
            unsafe { $body::<Scalar>($($arg),*) }
        })*
    };
}

#[inline(always)]
unsafe fn count_in<L: Lanes>(tiles: &TilesView, rect: Rect, nearness: f32, any: bool) -> u32 {
    // SAFETY: as the caller promises.
    unsafe { tiles.count::<L>(rect, nearness, any) }
}

#[inline(always)]
unsafe fn join_in<L: Lanes>(tiles: &TilesView, other: &TilesView, strip: usize) {
    // SAFETY: as the caller promises.
    unsafe { tiles.join::<L>(other, strip) }
}

kernels! {
    /// Draws positions `first..end` of a store.
    draw = draw_in(lens: &Lens, store: &Store, first: u32, end: u32, scratch: &mut Scratch, tiles: &TilesView) -> ();
    /// See [`TilesView::join`].
    join = join_in(tiles: &TilesView, other: &TilesView, strip: usize) -> ();
    /// See [`TilesView::count`].
    count = count_in(tiles: &TilesView, rect: Rect, nearness: f32, any: bool) -> u32;
}
