//! One rasteriser, three instruction sets: what is compiled for each, and the choice.

use super::block::{Alone, Block, Corner, LANES, Lane, SetUp};
use super::fill;
use super::lanes::Lanes;
use super::lanes_scalar::Scalar;
use super::large::{self, Large};
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

/// What is set up of some positions, to be drawn strip by strip.
#[derive(Debug, Default)]
pub struct Chunk {
    pub smalls: Vec<Alone>,
    pub larges: Vec<Large>,
    /// Triangles in the order of positions, for each group of strips: `LARGE` marks large ones.
    pub bins: Vec<Vec<u32>>,
}

const LARGE: u32 = 1 << 31;
/// So many triangles before it is drawn, one's part of the buffer is fetched.
const AHEAD: usize = 8;

impl Chunk {
    pub fn clear(&mut self, groups: usize) {
        self.smalls.clear();
        self.larges.clear();
        self.bins.resize_with(groups, Vec::new);
        self.bins.iter_mut().for_each(Vec::clear);
    }

    /// The small triangles of a block; returns the place of the first.
    ///
    /// # Safety
    /// The kernel's features are there.
    #[inline(always)]
    unsafe fn add<L: Lanes>(&mut self, block: &Block, small: u32) -> u32 {
        let first = self.smalls.len();
        self.smalls.reserve(LANES);
        // SAFETY: there is room for all lanes, and those that are kept were written.
        unsafe {
            L::records(block, small, self.smalls.as_mut_ptr().add(first));
            self.smalls.set_len(first + small.count_ones() as usize);
        }
        first as u32
    }

    fn push(&mut self, item: u32, x0: i32, x1: i32, group_px: i32) {
        for g in x0 / group_px..=(x1 - 1) / group_px {
            self.bins[g as usize].push(item);
        }
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

/// Where triangles go that are set up.
pub enum Sink<'a> {
    /// To the buffer, at once.
    Tiles(&'a TilesView),
    /// To a chunk, for groups of strips of so many pixels.
    Chunk(&'a mut Chunk, i32),
}

#[inline(always)]
unsafe fn draw_in<L: Lanes>(lens: &Lens, store: &Store, first: u32, end: u32, scratch: &mut Scratch, sink: &mut Sink) {
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
                    if let Sink::Tiles(t) = sink {
                        prefetch::<L>(t, block, small);
                        draw_block::<L>(t, &blocks[1 - current], waiting);
                        (waiting, current) = (small, 1 - current);
                    }
                    if other != 0 || matches!(sink, Sink::Chunk(..)) {
                        let block = if let Sink::Tiles(_) = sink { 1 - current } else { current };
                        emit::<L>(lens, store, &view, b, p, &blocks[block], small, other, firsts, sink);
                        waiting = 0;
                    }
                }
                p += LANES as u32;
            }
            p = stop;
            b += 1;
        }
        if let Sink::Tiles(t) = sink {
            draw_block::<L>(t, &blocks[1 - current], waiting);
        }
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
        unsafe { fill::small::<L>(t, &Lane(block, lane)) };
    }
}

/// The triangles of a block in order, small ones and others; those of `pairs` with their partners.
#[inline(always)]
unsafe fn emit<L: Lanes>(
    lens: &Lens,
    store: &Store,
    view: &BatchView,
    batch: usize,
    p: u32,
    block: &Block,
    small: u32,
    other: u32,
    pairs: u32,
    sink: &mut Sink,
) {
    // SAFETY: the caller has the features.
    let first = if let Sink::Chunk(chunk, _) = sink { unsafe { chunk.add::<L>(block, small) } } else { 0 };
    let mut rest = small | other;
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize & (LANES - 1);
        rest &= rest - 1;
        if small >> lane & 1 != 0 {
            match sink {
                // SAFETY: the lane was just set up.
                Sink::Tiles(t) => unsafe { fill::small::<L>(t, &Lane(block, lane)) },
                Sink::Chunk(chunk, group_px) => {
                    let before = (small & between(0, lane as u32)).count_ones();
                    chunk.push(first + before, block.x0[lane], block.x1[lane], *group_px);
                }
            }
            continue;
        }
        let position = p + lane as u32;
        let two_sided = store.words()[position as usize] >> 24 > 1;
        let pair = if pairs >> lane & 1 != 0 { store.fixed_pair(batch, position) } else { None };
        let large = match pair {
            Some(quad) => large::make(lens, view, &quad, two_sided),
            None => large::make(lens, view, &store.fixed(batch, position), two_sided),
        };
        let Some(large) = large else { continue };
        match sink {
            // SAFETY: it was just made.
            Sink::Tiles(t) => unsafe { fill::large::<L>(t, &large) },
            Sink::Chunk(chunk, group_px) => {
                chunk.larges.push(large);
                chunk.push(LARGE | (chunk.larges.len() as u32 - 1), large.x0, large.x1, *group_px);
            }
        }
    }
}

#[inline(always)]
unsafe fn replay_in<L: Lanes>(tiles: &TilesView, chunk: &Chunk, group: usize) {
    let bin = &chunk.bins[group];
    for (i, item) in bin.iter().enumerate() {
        // SAFETY: as for `emit`.
        unsafe {
            if let Some(item) = bin.get(i + AHEAD)
                && item & LARGE == 0
            {
                let [x0, _, y0, _] = chunk.smalls[*item as usize].rect();
                tiles.prefetch::<L>(x0.max(tiles.first * 32), y0);
            }
            if item & LARGE != 0 {
                fill::large::<L>(tiles, &chunk.larges[(item & !LARGE) as usize]);
            } else {
                fill::small::<L>(tiles, &chunk.smalls[*item as usize]);
            }
        }
    }
}

/// The same functions for every instruction set, and the choice between them.
macro_rules! kernels {
    ($($(#[$doc:meta])* $name:ident = $body:ident($($arg:ident: $type:ty),*) -> $result:ty;)*) => {
        $($(#[$doc])*
        ///
        /// # Safety
        /// The view's strips are of this image and nobody else's; rectangles lie in it.
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

kernels! {
    /// Sets up positions `first..end` of a store, in order, into the sink.
    draw = draw_in(lens: &Lens, store: &Store, first: u32, end: u32, scratch: &mut Scratch, sink: &mut Sink) -> ();
    /// Draws what a chunk holds for a group of strips.
    replay = replay_in(tiles: &TilesView, chunk: &Chunk, group: usize) -> ();
    /// See [`TilesView::count`].
    count = count_in(tiles: &TilesView, rect: Rect, nearness: f32, any: bool) -> u32;
}
