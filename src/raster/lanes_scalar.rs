//! The scalar twin: eight lanes as plain arrays. It runs on every processor.

use super::block::Corner;
use super::code::Codes;
use super::lanes::{Fetched, Lanes};
use super::vertices::{Batch, BatchView};

const N: usize = 8;

#[derive(Debug, Clone, Copy)]
pub struct Scalar;

fn zip<A: Copy, B: Copy, R>(a: [A; N], b: [B; N], f: impl Fn(A, B) -> R) -> [R; N] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

// SAFETY (of all): nothing here needs more than pointers that are good for N lanes, 32 of a line.
impl Lanes for Scalar {
    const N: usize = N;
    type F = [f32; N];
    type I = [i32; N];
    type M = [bool; N];

    unsafe fn f(x: f32) -> Self::F {
        [x; N]
    }
    unsafe fn i(x: i32) -> Self::I {
        [x; N]
    }
    unsafe fn load_f(from: *const f32) -> Self::F {
        // SAFETY: N values are there, as the caller promises.
        unsafe { from.cast::<Self::F>().read_unaligned() }
    }
    unsafe fn store_f(to: *mut f32, a: Self::F) {
        // SAFETY: as above.
        unsafe { to.cast::<Self::F>().write_unaligned(a) }
    }
    unsafe fn load_i(from: *const i32) -> Self::I {
        // SAFETY: as above.
        unsafe { from.cast::<Self::I>().read_unaligned() }
    }
    unsafe fn store_i(to: *mut i32, a: Self::I) {
        // SAFETY: as above.
        unsafe { to.cast::<Self::I>().write_unaligned(a) }
    }

    unsafe fn add(a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| a + b)
    }
    unsafe fn sub(a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| a - b)
    }
    unsafe fn mul(a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| a * b)
    }
    unsafe fn div(a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| a / b)
    }
    unsafe fn min(a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    unsafe fn max(a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    unsafe fn abs(a: Self::F) -> Self::F {
        a.map(f32::abs)
    }
    unsafe fn gt(a: Self::F, b: Self::F) -> Self::M {
        zip(a, b, |a, b| a > b)
    }
    unsafe fn ge(a: Self::F, b: Self::F) -> Self::M {
        zip(a, b, |a, b| a >= b)
    }
    unsafe fn pick_f(m: Self::M, yes: Self::F, no: Self::F) -> Self::F {
        std::array::from_fn(|i| if m[i] { yes[i] } else { no[i] })
    }

    unsafe fn add_i(a: Self::I, b: Self::I) -> Self::I {
        zip(a, b, i32::wrapping_add)
    }
    unsafe fn sub_i(a: Self::I, b: Self::I) -> Self::I {
        zip(a, b, i32::wrapping_sub)
    }
    unsafe fn and_i(a: Self::I, b: Self::I) -> Self::I {
        zip(a, b, |a, b| a & b)
    }
    unsafe fn min_i(a: Self::I, b: Self::I) -> Self::I {
        zip(a, b, i32::min)
    }
    unsafe fn max_i(a: Self::I, b: Self::I) -> Self::I {
        zip(a, b, i32::max)
    }
    unsafe fn shr16(a: Self::I) -> Self::I {
        a.map(|a| a >> 16)
    }
    unsafe fn shl16(a: Self::I) -> Self::I {
        a.map(|a| a << 16)
    }
    unsafe fn gt_i(a: Self::I, b: Self::I) -> Self::M {
        zip(a, b, |a, b| a > b)
    }
    unsafe fn eq_i(a: Self::I, b: Self::I) -> Self::M {
        zip(a, b, |a, b| a == b)
    }
    unsafe fn pick_i(m: Self::M, yes: Self::I, no: Self::I) -> Self::I {
        std::array::from_fn(|i| if m[i] { yes[i] } else { no[i] })
    }
    unsafe fn truncate(a: Self::F) -> Self::I {
        a.map(|a| a as i32)
    }
    unsafe fn to_f(a: Self::I) -> Self::F {
        a.map(|a| a as f32)
    }

    unsafe fn bits(m: Self::M) -> u32 {
        (0..N).map(|i| u32::from(m[i]) << i).sum()
    }
    unsafe fn mask(bits: u32) -> Self::M {
        std::array::from_fn(|i| bits >> i & 1 != 0)
    }

    unsafe fn steps() -> Self::I {
        std::array::from_fn(|i| i as i32)
    }
    unsafe fn across() -> Self::I {
        std::array::from_fn(|i| i as i32 % 4)
    }
    unsafe fn down() -> Self::I {
        std::array::from_fn(|i| i as i32 / 4)
    }
    unsafe fn rows(from: i32, to: i32) -> Self::M {
        std::array::from_fn(|i| (i as i32) >= from && (i as i32) < to)
    }
    unsafe fn run(from: Self::I, to: Self::I) -> Self::I {
        let below = |n: i32| ((1u64 << n.clamp(0, 32)) - 1) as u32;
        zip(from, to, |from, to| (!below(from) & below(to)) as i32)
    }
    unsafe fn to_subtiles(rows: Self::I) -> Self::I {
        let byte =
            |four: usize, row: usize, column: usize| (rows[4 * four + row] as u32 >> (8 * column) & 0xff) << (8 * row);
        std::array::from_fn(|i| (0..4).map(|row| byte(i / 4, row, i % 4)).sum::<u32>() as i32)
    }
    unsafe fn codes(z: Self::F, codes: Codes) -> Self::I {
        z.map(|z| i32::from(codes.of(z)))
    }
    unsafe fn least_i(a: Self::I) -> i32 {
        a.into_iter().fold(i32::MAX, i32::min)
    }
    unsafe fn greatest_i(a: Self::I) -> i32 {
        a.into_iter().fold(i32::MIN, i32::max)
    }

    unsafe fn prefetch<T>(_: *const T) {}
    unsafe fn raise(line: *mut u16, known: u32, cover: u32, code: u16) -> u16 {
        let mut least = u16::MAX;
        for i in 0..32 {
            // SAFETY: a line has 32 pixels.
            let pixel = unsafe { &mut *line.add(i) };
            if known >> i & 1 == 0 {
                *pixel = 0;
            }
            if cover >> i & 1 != 0 {
                *pixel = (*pixel).max(code);
            }
            least = least.min(*pixel);
        }
        least
    }
    unsafe fn join(line: *mut u16, known: u32, other: *const u16, other_known: u32) -> u16 {
        let mut least = u16::MAX;
        for i in 0..32 {
            // SAFETY: lines have 32 pixels.
            let (pixel, other) = unsafe { (&mut *line.add(i), *other.add(i)) };
            let of = |known: u32, pixel: u16| if known >> i & 1 == 0 { 0 } else { pixel };
            *pixel = of(known, *pixel).max(of(other_known, other));
            least = least.min(*pixel);
        }
        least
    }
    unsafe fn above(line: *const u16, code: u16) -> u32 {
        // SAFETY: a line has 32 pixels.
        (0..32).map(|i| u32::from(unsafe { *line.add(i) } > code) << i).sum()
    }

    unsafe fn corners(at: *const Corner, words: *const u32) -> [Fetched<Self>; 3] {
        std::array::from_fn(|k| {
            // SAFETY: words name corners of their batch.
            let corner: [Corner; N] =
                std::array::from_fn(|i| unsafe { *at.add((*words.add(i) >> (8 * k) & 0xff) as usize) });
            Fetched {
                x: corner.map(|c| c.x),
                y: corner.map(|c| c.y),
                n: corner.map(|c| c.n),
                code: corner.map(|c| c.code as i32),
            }
        })
    }

    unsafe fn project(view: &BatchView, batch: &Batch<'_>, out: &mut [Corner]) {
        for (i, corner) in out.iter_mut().enumerate() {
            *corner = view.corner([batch.x[i], batch.y[i], batch.z[i]]);
        }
    }

    unsafe fn bound(at: f64, step: f64, first: f64, limit: f64) -> Self::I {
        std::array::from_fn(|i| {
            let x = at + step * (first + i as f64);
            let x = if x > 0.0 { x } else { 0.0 };
            (if x < limit { x } else { limit }) as i32
        })
    }
}
