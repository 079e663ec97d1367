//! Sets up small triangles, N at a time: the bounds of their runs of pixels and the plane of
//! their nearness, in f32 on exact differences. What f32 rounds is bounded here.

use super::block::*;
use super::lanes::{Fetched, Lanes};
use super::vertices::{BatchView, SMALL_PX};

/// Lanes that were set up, and lanes that only `large` can judge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Made {
    pub small: u32,
    pub other: u32,
}

pub const KIND_SHIFT: u32 = 24;
const NOWHERE: f32 = 1e9;

/// Sets up those of N triangles that are `live` into lanes `lane..lane + N` of the block.
///
/// # Safety
/// `words` are N, and name corners of `at`; the kernel's features are there.
#[inline(always)]
pub unsafe fn set_up<L: Lanes>(
    v: &BatchView,
    at: *const Corner,
    words: *const u32,
    live: u32,
    block: &mut Block,
    lane: usize,
) -> Made {
    // SAFETY: as the caller promises; `lane + N` is at most the width of a block.
    unsafe {
        let [a, b, c] = L::corners(at, words);
        let kind = L::and_i(L::load_i(words.cast()), L::i(3 << KIND_SHIFT));
        let live = live & !L::bits(L::eq_i(kind, L::i(0)));
        let one_sided = L::bits(L::eq_i(kind, L::i(1 << KIND_SHIFT)));
        let far = live & (off::<L>(a.x) | off::<L>(b.x) | off::<L>(c.x));
        let near = live & !far;
        let beside = L::and_i(L::and_i(a.code, b.code), c.code);
        let mut other = if far == 0 { 0 } else { far & L::bits(L::eq_i(beside, L::i(0))) };
        if near == 0 {
            return Made { small: 0, other };
        }

        // Rows and columns whose samples lie inside of the corners' bounds.
        let (n_lo, n_hi) = (L::min(L::min(a.n, b.n), c.n), L::max(L::max(a.n, b.n), c.n));
        let n_abs = L::max(L::abs(n_lo), L::abs(n_hi));
        let inset = L::add(L::f(v.inset), L::mul(L::f(v.inset_per_n), n_abs));
        let inset = L::min(inset, L::f(16000.0));
        let inset_sub = L::add_i(L::truncate(L::mul(inset, L::f(65536.0))), L::i(2));
        let (x_lo, x_hi) = (L::min_i(L::min_i(a.x, b.x), c.x), L::max_i(L::max_i(a.x, b.x), c.x));
        let (y_lo, y_hi) = (L::min_i(L::min_i(a.y, b.y), c.y), L::max_i(L::max_i(a.y, b.y), c.y));
        let (x0, x1) = samples::<L>(L::add_i(x_lo, inset_sub), L::sub_i(x_hi, inset_sub), v.width);
        let (y0, y1) = samples::<L>(L::add_i(y_lo, inset_sub), L::sub_i(y_hi, inset_sub), v.height);
        let seen = near & L::bits(L::gt_i(x1, x0)) & L::bits(L::gt_i(y1, y0));
        let (w_sub, h_sub) = (L::sub_i(x_hi, x_lo), L::sub_i(y_hi, y_lo));
        let limit = L::i(SMALL_PX << 16);
        let small = seen & L::bits(L::gt_i(limit, w_sub)) & L::bits(L::gt_i(limit, h_sub));

        // Twice the area, and the side that is seen: fronts turn against the clock, which
        // is negative where y points down. Products round by 3 / 2^24 in all.
        let (dx1, dy1) = (px::<L>(L::sub_i(b.x, a.x)), px::<L>(L::sub_i(b.y, a.y)));
        let (dx2, dy2) = (px::<L>(L::sub_i(c.x, a.x)), px::<L>(L::sub_i(c.y, a.y)));
        let (p, q) = (L::mul(dx1, dy2), L::mul(dy1, dx2));
        let cross = L::sub(p, q);
        let blur = L::mul(L::add(L::abs(p), L::abs(q)), L::f(2.4e-7));
        let sure = L::bits(L::gt(L::abs(cross), blur));
        let turned = L::gt(L::f(0.0), cross);
        let back = one_sided & !L::bits(turned);
        other |= seen & !small & !(back & sure);
        let small = small & sure & !back;
        if small == 0 {
            return Made { small, other };
        }

        // Clockwise, from the topmost corner on: a to b goes down on the right, a to c on the left.
        let (b, c) = (Fetched::<L>::pick(turned, &c, &b), Fetched::<L>::pick(turned, &b, &c));
        let b_top = L::mask(L::bits(L::gt_i(a.y, b.y)) & !L::bits(L::gt_i(b.y, c.y)));
        let c_top = L::mask(L::bits(L::gt_i(a.y, c.y)) & L::bits(L::gt_i(b.y, c.y)));
        let (a, b, c) = (
            Fetched::<L>::pick(b_top, &b, &Fetched::<L>::pick(c_top, &c, &a)),
            Fetched::<L>::pick(b_top, &c, &Fetched::<L>::pick(c_top, &a, &b)),
            Fetched::<L>::pick(b_top, &a, &Fetched::<L>::pick(c_top, &b, &c)),
        );

        // Relative to the first pixel and the middle of the first subtile row's first row; all
        // differences are below 2^24 subpixels and exact.
        let top = L::and_i(y0, L::i(!3));
        let (x_zero, y_zero) = (L::shl16(x0), L::add_i(L::shl16(top), L::i(32768)));
        let (ax, ay) = (px::<L>(L::sub_i(a.x, x_zero)), px::<L>(L::sub_i(a.y, y_zero)));
        let (bx, by) = (px::<L>(L::sub_i(b.x, x_zero)), px::<L>(L::sub_i(b.y, y_zero)));
        let (cx, cy) = (px::<L>(L::sub_i(c.x, x_zero)), px::<L>(L::sub_i(c.y, y_zero)));
        let (w, h) = (px::<L>(w_sub), px::<L>(h_sub));

        // A bound at its row 0, and its step. It moves inward by `inset` along the normal, and
        // by what f32 rounds: relative to the width, and to the height times the slope.
        let round = L::f(1.0 / 2_097_152.0);
        let flat_room = L::add(L::mul(inset, L::f(1.00001)), L::mul(round, L::add(w, L::f(2.0))));
        let steep_room = L::add(L::mul(inset, L::f(1.00001)), L::mul(round, L::add(h, L::f(6.0))));
        let half = L::f(0.5);
        let (dx1, dy1, dx2, dy2) = (L::sub(bx, ax), L::sub(by, ay), L::sub(cx, ax), L::sub(cy, ay));
        let dy3 = L::sub(cy, by);
        let columns = block.f.as_mut_ptr().cast::<f32>();
        macro_rules! put {
            ($column:expr, $value:expr) => {
                L::store_f(columns.add($column * LANES + lane), $value)
            };
        }
        let zero = L::f(0.0);
        let (at1, step1, room1) = side::<L>(dx1, dy1, ax, ay, flat_room, steep_room);
        let used = L::gt(dy1, zero);
        put!(RIGHT, L::pick_f(used, L::sub(at1, room1), L::f(NOWHERE)));
        put!(RIGHT_STEP, L::pick_f(used, step1, zero));
        let (at2, step2, room2) = side::<L>(dx2, dy2, ax, ay, flat_room, steep_room);
        let used = L::gt(dy2, zero);
        put!(LEFT, L::pick_f(used, L::add(at2, room2), L::f(-NOWHERE)));
        put!(LEFT_STEP, L::pick_f(used, step2, zero));
        let (at3, step3, room3) = side::<L>(L::sub(cx, bx), dy3, bx, by, flat_room, steep_room);
        let used = L::gt(dy3, zero);
        put!(RIGHT2, L::pick_f(used, L::sub(at3, room3), L::f(NOWHERE)));
        put!(RIGHT2_STEP, L::pick_f(used, step3, zero));
        let used = L::gt(zero, dy3);
        put!(LEFT2, L::pick_f(used, L::add(at3, room3), L::f(-NOWHERE)));
        put!(LEFT2_STEP, L::pick_f(used, step3, zero));
        put!(ACROSS, L::to_f(L::sub_i(x1, x0)));

        // Nearness is linear on the image.
        let (dn1, dn2) = (L::sub(b.n, a.n), L::sub(c.n, a.n));
        let area = L::sub(L::mul(dx1, dy2), L::mul(dy1, dx2));
        let inverse = L::div(L::f(1.0), area);
        let gx = L::mul(L::sub(L::mul(dn1, dy2), L::mul(dn2, dy1)), inverse);
        let gy = L::mul(L::sub(L::mul(dn2, dx1), L::mul(dn1, dx2)), inverse);
        let (gx_abs, gy_abs) = (L::abs(gx), L::abs(gy));
        // A corner's nearness is off by `corner`, and by the slope times what its place is off:
        // twice that bounds it within the triangle, as long as this is at least eight
        // times as thick as that. The slopes round by less than 2^-19 of the range of nearness
        // over the box, times the box's area over the triangle's, squared; the rest is
        // for adding up. `thin` ones are flat, at the least corner.
        let corner = L::add(L::f(v.doubt[0]), L::mul(n_abs, L::add(L::f(v.doubt[1]), L::mul(L::f(v.doubt[2]), n_abs))));
        let place = L::add(L::sub(inset, L::f(if v.inner { 0.5 } else { 0.0 })), L::f(1e-7));
        let shape = L::mul(L::mul(w, h), inverse);
        let moved = L::add(corner, L::mul(place, L::add(gx_abs, gy_abs)));
        let slopes = L::mul(L::mul(L::sub(n_hi, n_lo), L::f(4e-6)), L::mul(shape, shape));
        let reach = L::add(L::mul(gx_abs, L::add(w, L::f(48.0))), L::mul(gy_abs, L::add(h, L::f(16.0))));
        let sums = L::mul(L::add(reach, n_abs), L::f(5e-7));
        let doubt = L::add(L::add(L::add(moved, moved), slopes), sums);
        let thickness = L::mul(L::mul(place, L::mul(L::add(w, h), L::f(8.0))), inverse);
        let thick = L::mask(L::bits(L::ge(L::f(64.0), shape)) & L::bits(L::ge(L::f(1.0), thickness)));
        let least = L::sub(n_lo, L::mul(corner, L::f(1.01)));
        // The farthest corner of a subtile's samples, or of its pixels.
        let (lo, right, bottom) = if v.inner { (0.0, 8.0, 4.0) } else { (0.5, 7.5, 3.5) };
        let skipped = L::to_f(L::and_i(x0, L::i(31)));
        let to_x = L::sub(L::sub(L::pick_f(L::gt(zero, gx), L::f(right), L::f(lo)), skipped), ax);
        let to_y = L::sub(L::pick_f(L::gt(zero, gy), L::f(bottom), L::f(lo)), L::add(ay, half));
        let value = L::sub(L::add(L::add(a.n, L::mul(gx, to_x)), L::mul(gy, to_y)), doubt);
        put!(NEAR, L::pick_f(thick, value, least));
        put!(NEAR_ACROSS, L::pick_f(thick, L::mul(gx, L::f(8.0)), zero));
        put!(NEAR_DOWN, L::pick_f(thick, L::mul(gy, L::f(4.0)), zero));
        put!(LEAST, least);
        L::store_i(block.x0.as_mut_ptr().add(lane), x0);
        L::store_i(block.x1.as_mut_ptr().add(lane), x1);
        L::store_i(block.y0.as_mut_ptr().add(lane), y0);
        L::store_i(block.y1.as_mut_ptr().add(lane), y1);
        Made { small, other }
    }
}

#[inline(always)]
unsafe fn off<L: Lanes>(x: L::I) -> u32 {
    // SAFETY: the caller has the kernel's features; so for all that follow.
    unsafe { L::bits(L::eq_i(x, L::i(OFF))) }
}

/// Pixels of 0..size whose samples lie in `lo..=hi` subpixels.
#[inline(always)]
unsafe fn samples<L: Lanes>(lo: L::I, hi: L::I, size: i32) -> (L::I, L::I) {
    // SAFETY: as above.
    unsafe {
        let first = L::max_i(L::shr16(L::add_i(lo, L::i(32767))), L::i(0));
        (first, L::min_i(L::shr16(L::add_i(hi, L::i(32768))), L::i(size)))
    }
}

/// Subpixels to pixels: exact for differences of a small triangle.
#[inline(always)]
unsafe fn px<L: Lanes>(d: L::I) -> L::F {
    // SAFETY: as above.
    unsafe { L::mul(L::to_f(d), L::f(1.0 / 65536.0)) }
}

/// The bound of a side through (x, y) at row 0, half a pixel added, its step, and by how
/// much it moves inward.
#[inline(always)]
unsafe fn side<L: Lanes>(dx: L::F, dy: L::F, x: L::F, y: L::F, flat: L::F, steep: L::F) -> (L::F, L::F, L::F) {
    // SAFETY: as above.
    unsafe {
        let level = L::ge(L::f(0.0), L::abs(dy));
        let step = L::div(dx, L::pick_f(level, L::f(1.0), dy));
        let room = L::add(flat, L::mul(L::abs(step), steep));
        (L::add(L::sub(x, L::mul(step, y)), L::f(0.5)), step, room)
    }
}
