//! The few operations on lanes that the kernels are written in.
//!
//! The rasteriser is written once, over this trait; a kernel is an implementation: plain
//! arrays (the scalar twin), AVX2 or AVX-512 by explicit intrinsics. All of them round each
//! operation once, in the same order, so their buffers are equal bit by bit.

use super::block::Corner;
use super::code::Codes;
use super::vertices::{Batch, BatchView};

/// One row of samples for each lane; every four lanes are a row of four subtiles as well.
pub trait Lanes: Copy {
    const N: usize;
    /// f32, i32 and truth in lanes.
    type F: Copy;
    type I: Copy;
    type M: Copy;

    unsafe fn f(x: f32) -> Self::F;
    unsafe fn i(x: i32) -> Self::I;
    unsafe fn load_f(from: *const f32) -> Self::F;
    unsafe fn store_f(to: *mut f32, a: Self::F);
    unsafe fn load_i(from: *const i32) -> Self::I;
    unsafe fn store_i(to: *mut i32, a: Self::I);

    unsafe fn add(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn sub(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn mul(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn div(a: Self::F, b: Self::F) -> Self::F;
    /// `if a < b { a } else { b }`, and the like with `>`: what the x86 instructions do.
    unsafe fn min(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn max(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn abs(a: Self::F) -> Self::F;
    unsafe fn gt(a: Self::F, b: Self::F) -> Self::M;
    unsafe fn ge(a: Self::F, b: Self::F) -> Self::M;
    unsafe fn pick_f(m: Self::M, yes: Self::F, no: Self::F) -> Self::F;

    unsafe fn add_i(a: Self::I, b: Self::I) -> Self::I;
    unsafe fn sub_i(a: Self::I, b: Self::I) -> Self::I;
    unsafe fn and_i(a: Self::I, b: Self::I) -> Self::I;
    unsafe fn min_i(a: Self::I, b: Self::I) -> Self::I;
    unsafe fn max_i(a: Self::I, b: Self::I) -> Self::I;
    unsafe fn shr16(a: Self::I) -> Self::I;
    unsafe fn shl16(a: Self::I) -> Self::I;
    unsafe fn gt_i(a: Self::I, b: Self::I) -> Self::M;
    unsafe fn eq_i(a: Self::I, b: Self::I) -> Self::M;
    unsafe fn pick_i(m: Self::M, yes: Self::I, no: Self::I) -> Self::I;
    /// Towards zero, of values that fit.
    unsafe fn truncate(a: Self::F) -> Self::I;
    unsafe fn to_f(a: Self::I) -> Self::F;

    unsafe fn bits(m: Self::M) -> u32;
    unsafe fn mask(bits: u32) -> Self::M;

    /// 0, 1, 2, ...; column and row of subtiles: 0, 1, 2, 3, 0, ... and 0, 0, 0, 0, 1, ...
    unsafe fn steps() -> Self::I;
    unsafe fn across() -> Self::I;
    unsafe fn down() -> Self::I;
    /// Lanes `from..to`, which may lie outside.
    unsafe fn rows(from: i32, to: i32) -> Self::M;
    /// Bits `from..to` of each lane, `from` and `to` clamped to 0..=32.
    unsafe fn run(from: Self::I, to: Self::I) -> Self::I;
    /// Rows of 32 pixels to subtiles of 8 x 4: in each four lanes the bytes are transposed.
    unsafe fn to_subtiles(rows: Self::I) -> Self::I;
    /// [`Codes::of`].
    unsafe fn codes(z: Self::F, codes: Codes) -> Self::I;
    /// Least and greatest lane.
    unsafe fn least_i(a: Self::I) -> i32;
    unsafe fn greatest_i(a: Self::I) -> i32;

    /// Says that what is there will be wanted soon.
    unsafe fn prefetch<T>(at: *const T);
    /// Raises the line at the pixels of `cover` to `code`; those outside of `known` were 0.
    /// Returns the least of the line if `cover` and `known` are all pixels.
    unsafe fn raise(line: *mut u16, known: u32, cover: u32, code: u16) -> u16;
    /// Raises each pixel of a line to that of the other line; the least if all are known then.
    unsafe fn join(line: *mut u16, known: u32, other: *const u16, other_known: u32) -> u16;
    /// Pixels of the line above `code`.
    unsafe fn above(line: *const u16, code: u16) -> u32;

    /// The corners of `N` triangles; the k-th byte of a word is its k-th corner.
    unsafe fn corners(at: *const Corner, words: *const u32) -> [Fetched<Self>; 3];
    /// Projects all vertices of a batch (see `vertices`).
    unsafe fn project(view: &BatchView, batch: &Batch<'_>, out: &mut [Corner]);
    /// Ends of runs for N rows of a half-plane's bound `at + step * row`, rows from `first`.
    unsafe fn bound(at: f64, step: f64, first: f64, limit: f64) -> Self::I;
}

/// A corner of N triangles.
pub struct Fetched<L: Lanes> {
    pub x: L::I,
    pub y: L::I,
    pub n: L::F,
    pub code: L::I,
}

impl<L: Lanes> Clone for Fetched<L> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<L: Lanes> Copy for Fetched<L> {}

impl<L: Lanes> Fetched<L> {
    #[inline(always)]
    pub unsafe fn pick(m: L::M, yes: &Self, no: &Self) -> Self {
        // SAFETY: as the caller promises.
        unsafe {
            Fetched {
                x: L::pick_i(m, yes.x, no.x),
                y: L::pick_i(m, yes.y, no.y),
                n: L::pick_f(m, yes.n, no.n),
                code: no.code,
            }
        }
    }
}
