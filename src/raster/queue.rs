//! Who draws when: at once on one thread; on several, what was asked for waits until it is
//! worth sharing, or until somebody asks for the answer.
//!
//! Shared work goes in rounds of two phases. Chunks of positions are set up side by
//! side, each into bins of its own, one for each group of strips. Then groups are drawn side by
//! side, each going through the bins of all chunks in order, while the next round is set up. A
//! subtile thus sees the same triangles in the same order as on one thread.

use super::kernel::{self, Chunk, Kernel, Scratch, Sink};
use super::occluders::{Occluders, Store};
use super::tiles::Tiles;
use super::vertices::Lens;
use rayon::prelude::*;
use std::sync::Arc;

/// Positions of a chunk, chunks of a round, and how many positions are worth sharing.
const CHUNK: u32 = 1024;
const ROUND: usize = 8;
const WORTH: u32 = 4 * CHUNK;
const MOST_WAITING: u32 = 1 << 24;
/// Strips of a group.
const GROUP: usize = 8;

#[derive(Debug, Default)]
pub struct Queue {
    waiting: Vec<(Arc<Store>, u32, u32)>,
    positions: u32,
    /// Of two rounds.
    chunks: [Vec<(Chunk, Scratch)>; 2],
    scratch: Scratch,
}

impl Queue {
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.positions = 0;
    }

    pub fn bytes(&self) -> usize {
        let of = |c: &Chunk| {
            size_of_val(&c.smalls[..]) + size_of_val(&c.larges[..]) + c.bins.iter().map(|b| 4 * b.len()).sum::<usize>()
        };
        self.chunks.iter().flatten().map(|(c, _)| of(c) + size_of::<Scratch>()).sum()
    }

    pub fn draw(&mut self, kernel: Kernel, lens: &Lens, tiles: &mut Tiles, what: &Occluders, first: u32, end: u32) {
        if rayon::current_num_threads() < 2 {
            self.flush(kernel, lens, tiles);
            at_once(kernel, lens, tiles, &mut self.scratch, what.store(), first, end);
            return;
        }
        match self.waiting.last_mut() {
            Some((store, _, last)) if *last == first && Arc::ptr_eq(store, what.store()) => *last = end,
            _ => self.waiting.push((what.store().clone(), first, end)),
        }
        self.positions += end - first;
        if self.positions >= MOST_WAITING {
            self.flush(kernel, lens, tiles);
        }
    }

    pub fn flush(&mut self, kernel: Kernel, lens: &Lens, tiles: &mut Tiles) {
        if self.positions == 0 {
            return;
        }
        if self.positions < WORTH || rayon::current_num_threads() < 2 {
            for (store, first, end) in self.waiting.drain(..) {
                at_once(kernel, lens, tiles, &mut self.scratch, &store, first, end);
            }
        } else {
            // Within the pool, so that rounds do not each wait for a thread outside of it.
            let (chunks, pieces) = (&mut self.chunks, pieces(&self.waiting));
            rayon::join(|| share(chunks, kernel, lens, tiles, &pieces), || ());
        }
        self.clear();
    }
}

/// Ranges that are set up together.
type Piece<'a> = Vec<(&'a Arc<Store>, u32, u32)>;

/// What waits, in lists of ranges of about a chunk's size.
fn pieces(waiting: &[(Arc<Store>, u32, u32)]) -> Vec<Piece<'_>> {
    let mut pieces = vec![Vec::new()];
    let mut room = CHUNK;
    for (store, first, end) in waiting {
        let mut p = *first;
        while p < *end {
            let stop = end.min(&p.saturating_add(room)).to_owned();
            pieces.last_mut().expect("one at least").push((store, p, stop));
            room -= stop - p;
            p = stop;
            if room == 0 {
                pieces.push(Vec::new());
                room = CHUNK;
            }
        }
    }
    pieces
}

fn at_once(kernel: Kernel, lens: &Lens, tiles: &mut Tiles, scratch: &mut Scratch, store: &Store, first: u32, end: u32) {
    let view = tiles.view(lens.codes);
    // SAFETY: the buffer is ours alone meanwhile, and was made for the lens's image.
    unsafe { kernel::draw(kernel, lens, store, first, end, scratch, &mut Sink::Tiles(&view)) }
}

fn share(
    chunks: &mut [Vec<(Chunk, Scratch)>; 2],
    kernel: Kernel,
    lens: &Lens,
    tiles: &mut Tiles,
    pieces: &[Piece<'_>],
) {
    let groups = tiles.strips.div_ceil(GROUP);
    let all = tiles.view(lens.codes);
    let [mut ready, mut next] = chunks.each_mut();
    let mut rounds = pieces.chunks(ROUND);
    set_up(next, kernel, lens, rounds.next().unwrap_or(&[]), groups);
    loop {
        (ready, next) = (next, ready);
        let round = rounds.next();
        let draw = |g: usize| {
            let mut view = all;
            (view.first, view.end) = ((g * GROUP) as i32, all.end.min((g * GROUP + GROUP) as i32));
            for (chunk, _) in &*ready {
                // SAFETY: each group has strips of its own, and only these are drawn to.
                unsafe { kernel::replay(kernel, &view, chunk, g) }
            }
        };
        rayon::join(
            || (0..groups).into_par_iter().with_max_len(1).for_each(draw),
            || set_up(next, kernel, lens, round.unwrap_or(&[]), groups),
        );
        if round.is_none() {
            return;
        }
    }
}

/// Sets up a piece in each chunk.
fn set_up(chunks: &mut Vec<(Chunk, Scratch)>, kernel: Kernel, lens: &Lens, pieces: &[Piece<'_>], groups: usize) {
    chunks.resize_with(pieces.len().max(chunks.len()), Default::default);
    chunks.iter_mut().for_each(|(chunk, _)| chunk.clear(groups));
    chunks.par_iter_mut().zip(pieces).with_max_len(1).for_each(|((chunk, scratch), piece)| {
        for (store, first, end) in piece {
            let mut sink = Sink::Chunk(chunk, 32 * GROUP as i32);
            // SAFETY: nothing is drawn here.
            unsafe { kernel::draw(kernel, lens, store, *first, *end, scratch, &mut sink) }
        }
    });
}
