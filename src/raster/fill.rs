//! From what is set up to pixels: runs of rows, cut into subtiles.

use super::block::*;
use super::lanes::Lanes;
use super::large::Large;
use super::tiles::TilesView;

/// Draws a small triangle.
///
/// # Safety
/// The lane was set up for this image; the kernel's features are there.
#[inline(always)]
pub unsafe fn small<L: Lanes>(t: &TilesView, b: &Block, lane: usize) {
    // SAFETY: as the caller promises.
    unsafe {
        let (x0, x1, y0, y1) = (b.x0[lane], b.x1[lane], b.y0[lane], b.y1[lane]);
        let (first, last) = (x0 >> 5, (x1 - 1) >> 5);
        let of = |column: usize| L::f(b.f[column][lane]);
        let (left, left_step, left2, left2_step) = (of(LEFT), of(LEFT_STEP), of(LEFT2), of(LEFT2_STEP));
        let (right, right_step, right2, right2_step) = (of(RIGHT), of(RIGHT_STEP), of(RIGHT2), of(RIGHT2_STEP));
        let (across, zero) = (of(ACROSS), L::f(0.0));
        let (near, near_across, near_down, least) = (of(NEAR), of(NEAR_ACROSS), of(NEAR_DOWN), of(LEAST));
        let top = y0 & !3;
        let mut y = top;
        while y < y1 {
            let row = L::to_f(L::add_i(L::steps(), L::i(y - top)));
            let line = |at: L::F, step: L::F| L::add(at, L::mul(step, row));
            let from = L::max(line(left, left_step), line(left2, left2_step));
            let to = L::min(line(right, right_step), line(right2, right2_step));
            let from = L::truncate(L::min(L::max(from, zero), across));
            let to = L::truncate(L::max(L::min(to, across), zero));
            let to = L::pick_i(L::rows(y0 - y, y1 - y), to, L::i(-4096));
            let nearness = L::add(near, L::mul(near_down, L::to_f(L::add_i(L::down(), L::i((y - top) >> 2)))));
            let mut column = L::add(L::to_f(L::across()), L::f(((first - (x0 >> 5)) * 4) as f32));
            for strip in first..=last {
                let z = L::max(L::add(nearness, L::mul(near_across, column)), least);
                column = L::add(column, L::f(4.0));
                t.raise::<L>(strip, y, from, to, strip * 32 - x0, z);
            }
            y += L::N as i32;
        }
    }
}

/// Draws a large polygon.
///
/// # Safety
/// It was made for this image; the kernel's features are there.
#[inline(always)]
pub unsafe fn large<L: Lanes>(t: &TilesView, g: &Large) {
    // SAFETY: as the caller promises.
    unsafe {
        let (near, near_across, near_down, least) =
            (L::f(g.near), L::f(g.near_across), L::f(g.near_down), L::f(g.least));
        let limit = f64::from(g.x1);
        let top = g.y0 & !3;
        let mut y = top;
        while y < g.y1 {
            let first = f64::from(y);
            let (mut from, mut to) = (L::i(g.x0), L::i(g.x1));
            for [at, step] in &g.left[..g.lefts] {
                from = L::max_i(from, L::bound(*at, *step, first, limit));
            }
            for [at, step] in &g.right[..g.rights] {
                to = L::min_i(to, L::bound(*at, *step, first, limit));
            }
            let inside = L::rows(g.y0 - y, g.y1 - y);
            let (from, to) = (L::pick_i(inside, from, L::i(g.x1)), L::pick_i(inside, to, L::i(-4096)));
            let nearness = L::add(near, L::mul(near_down, L::to_f(L::add_i(L::down(), L::i((y - top) >> 2)))));
            let first = L::least_i(from) >> 5;
            let last = (L::greatest_i(to) - 1) >> 5;
            let mut column = L::add(L::to_f(L::across()), L::f(((first - (g.x0 >> 5)) * 4) as f32));
            for strip in first..=last {
                let z = L::max(L::add(nearness, L::mul(near_across, column)), least);
                column = L::add(column, L::f(4.0));
                t.raise::<L>(strip, y, from, to, strip * 32, z);
            }
            y += L::N as i32;
        }
    }
}
