//! Who draws when: at once on one thread; on several, what was asked for waits until
//! somebody asks for the answer, and is shared if that is worth it.
//!
//! What a pixel hides is the greatest of all that was drawn there, whatever the order (a
//! floor is the greatest of what covered a subtile as a whole, or the least of
//! its line, which says no more than the line did). So every thread draws the next piece that
//! nobody has begun into a buffer of its own, and strip by strip the buffers are joined by the
//! greater: the answers do not depend on who drew what.

use super::kernel::{self, Kernel, Scratch};
use super::occluders::{Occluders, Store};
use super::tiles::Tiles;
use super::vertices::Lens;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Positions of a piece, and how many are worth sharing: joining goes over whole buffers.
const PIECE: u32 = 2048;
const WORTH: u32 = 16 * PIECE;
const MOST_WAITING: u32 = 1 << 24;

#[derive(Debug, Default)]
pub struct Queue {
    waiting: Vec<(Arc<Store>, u32, u32)>,
    positions: u32,
    scratch: Scratch,
    /// Of the other threads.
    others: Vec<(Tiles, Scratch)>,
}

impl Queue {
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.positions = 0;
    }

    pub fn bytes(&self) -> usize {
        self.others.iter().map(|(tiles, _)| tiles.bytes() + size_of::<Scratch>()).sum()
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
        self.positions = self.positions.saturating_add(end - first);
        if self.positions >= MOST_WAITING {
            self.flush(kernel, lens, tiles);
        }
    }

    pub fn flush(&mut self, kernel: Kernel, lens: &Lens, tiles: &mut Tiles) {
        if self.positions == 0 {
            return;
        }
        if self.positions < WORTH || rayon::current_num_threads() < 2 {
            for (store, first, end) in &self.waiting {
                at_once(kernel, lens, tiles, &mut self.scratch, store, *first, *end);
            }
        } else {
            self.share(kernel, lens, tiles);
        }
        self.clear();
    }

    fn share(&mut self, kernel: Kernel, lens: &Lens, tiles: &mut Tiles) {
        let others = rayon::current_num_threads() - 1;
        let empty = || (Tiles::new(tiles.width, tiles.height), Scratch::default());
        self.others.resize_with(others.max(self.others.len()), empty);
        let others = &mut self.others[..others];
        let (pieces, next) = (pieces(&self.waiting), AtomicUsize::new(0));
        let work = |tiles: &mut Tiles, scratch: &mut Scratch| {
            while let Some(piece) = pieces.get(next.fetch_add(1, Ordering::Relaxed)) {
                for (store, first, end) in piece {
                    at_once(kernel, lens, tiles, scratch, store, *first, *end);
                }
            }
        };
        let scratch = &mut self.scratch;
        rayon::join(
            || work(tiles, scratch),
            || {
                others.par_iter_mut().with_max_len(1).for_each(|(tiles, scratch)| {
                    tiles.clear();
                    work(tiles, scratch);
                });
            },
        );
        let strips = tiles.strips;
        let all = tiles.view(lens.codes);
        let others: Vec<_> = others.iter_mut().map(|(tiles, _)| tiles.view(lens.codes)).collect();
        (0..strips).into_par_iter().for_each(|strip| {
            for other in &others {
                // SAFETY: each task has a strip of its own.
                unsafe { kernel::join(kernel, &all, other, strip) }
            }
        });
    }
}

/// Ranges that are drawn together.
type Piece<'a> = Vec<(&'a Arc<Store>, u32, u32)>;

/// What waits, in lists of ranges of about a piece's size.
fn pieces(waiting: &[(Arc<Store>, u32, u32)]) -> Vec<Piece<'_>> {
    let mut pieces = vec![Vec::new()];
    let mut room = PIECE;
    for (store, first, end) in waiting {
        let mut p = *first;
        while p < *end {
            // To the end of a batch: pairs lie in one.
            let last = (*end).min(p.saturating_add(room)) - 1;
            let stop = store.batch(store.batch_of(last)).1.end.min(*end);
            pieces.last_mut().expect("one at least").push((store, p, stop));
            room = room.saturating_sub(stop - p);
            p = stop;
            if room == 0 {
                pieces.push(Vec::new());
                room = PIECE;
            }
        }
    }
    pieces
}

fn at_once(kernel: Kernel, lens: &Lens, tiles: &mut Tiles, scratch: &mut Scratch, store: &Store, first: u32, end: u32) {
    let view = tiles.view(lens.codes);
    // SAFETY: the buffer is ours alone meanwhile, and was made for the lens's image.
    unsafe { kernel::draw(kernel, lens, store, first, end, scratch, &view) }
}
