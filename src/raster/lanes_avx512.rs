//! Sixteen lanes by AVX-512, explicit intrinsics only. A line of 32 pixels is one register.

use super::block::{Corner, OFF};
use super::code::Codes;
use super::lanes::{Fetched, Lanes};
use super::vertices::{Batch, BatchView, FAR, SUBPIXELS};
use std::arch::x86_64::*;

#[derive(Debug, Clone, Copy)]
pub struct Avx512;

pub fn present() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
}

macro_rules! lanes {
    ($($name:ident($($arg:ident: $type:ty),*) -> $result:ty = $body:expr;)*) => {
        $(#[inline(always)]
        unsafe fn $name($($arg: $type),*) -> $result {
            // SAFETY: callers have the features, and pointers that are good for sixteen lanes.
            unsafe { $body }
        })*
    };
}

/// The corner of triangle T that its word's byte K names.
macro_rules! one {
    ($at:expr, $bytes:expr, $t:expr, $k:expr) => {
        _mm_load_si128($at.add(*$bytes.add(4 * ($t) + $k) as usize).cast())
    };
}

impl Lanes for Avx512 {
    const N: usize = 16;
    type F = __m512;
    type I = __m512i;
    type M = __mmask16;

    lanes! {
        f(x: f32) -> __m512 = _mm512_set1_ps(x);
        i(x: i32) -> __m512i = _mm512_set1_epi32(x);
        load_f(from: *const f32) -> __m512 = _mm512_loadu_ps(from);
        load_i(from: *const i32) -> __m512i = _mm512_loadu_si512(from.cast());
        store_f(to: *mut f32, a: __m512) -> () = _mm512_storeu_ps(to, a);
        store_i(to: *mut i32, a: __m512i) -> () = _mm512_storeu_si512(to.cast(), a);
        add(a: __m512, b: __m512) -> __m512 = _mm512_add_ps(a, b);
        sub(a: __m512, b: __m512) -> __m512 = _mm512_sub_ps(a, b);
        mul(a: __m512, b: __m512) -> __m512 = _mm512_mul_ps(a, b);
        div(a: __m512, b: __m512) -> __m512 = _mm512_div_ps(a, b);
        min(a: __m512, b: __m512) -> __m512 = _mm512_min_ps(a, b);
        max(a: __m512, b: __m512) -> __m512 = _mm512_max_ps(a, b);
        abs(a: __m512) -> __m512 = _mm512_abs_ps(a);
        gt(a: __m512, b: __m512) -> u16 = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(a, b);
        ge(a: __m512, b: __m512) -> u16 = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(a, b);
        pick_f(m: u16, yes: __m512, no: __m512) -> __m512 = _mm512_mask_mov_ps(no, m, yes);
        add_i(a: __m512i, b: __m512i) -> __m512i = _mm512_add_epi32(a, b);
        sub_i(a: __m512i, b: __m512i) -> __m512i = _mm512_sub_epi32(a, b);
        and_i(a: __m512i, b: __m512i) -> __m512i = _mm512_and_si512(a, b);
        min_i(a: __m512i, b: __m512i) -> __m512i = _mm512_min_epi32(a, b);
        max_i(a: __m512i, b: __m512i) -> __m512i = _mm512_max_epi32(a, b);
        shr16(a: __m512i) -> __m512i = _mm512_srai_epi32::<16>(a);
        shl16(a: __m512i) -> __m512i = _mm512_slli_epi32::<16>(a);
        gt_i(a: __m512i, b: __m512i) -> u16 = _mm512_cmpgt_epi32_mask(a, b);
        eq_i(a: __m512i, b: __m512i) -> u16 = _mm512_cmpeq_epi32_mask(a, b);
        pick_i(m: u16, yes: __m512i, no: __m512i) -> __m512i = _mm512_mask_mov_epi32(no, m, yes);
        truncate(a: __m512) -> __m512i = _mm512_cvttps_epi32(a);
        to_f(a: __m512i) -> __m512 = _mm512_cvtepi32_ps(a);
        steps() -> __m512i = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
        across() -> __m512i = _mm512_setr_epi32(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
        down() -> __m512i = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
        least_i(a: __m512i) -> i32 = _mm512_reduce_min_epi32(a);
        greatest_i(a: __m512i) -> i32 = _mm512_reduce_max_epi32(a);
    }

    #[inline(always)]
    unsafe fn bits(m: u16) -> u32 {
        u32::from(m)
    }

    #[inline(always)]
    unsafe fn mask(bits: u32) -> u16 {
        bits as u16
    }

    #[inline(always)]
    unsafe fn rows(from: i32, to: i32) -> u16 {
        super::tiles::between(from.clamp(0, 16) as u32, to.clamp(0, 16) as u32) as u16
    }

    #[inline(always)]
    unsafe fn run(from: __m512i, to: __m512i) -> __m512i {
        // SAFETY: callers have the features. Shifts of 32 and more leave nothing.
        unsafe {
            let (zero, ones) = (_mm512_setzero_si512(), _mm512_set1_epi32(-1));
            let from = _mm512_sllv_epi32(ones, _mm512_max_epi32(from, zero));
            let to = _mm512_sllv_epi32(ones, _mm512_max_epi32(to, zero));
            _mm512_andnot_si512(to, from)
        }
    }

    #[inline(always)]
    unsafe fn to_subtiles(rows: __m512i) -> __m512i {
        // SAFETY: callers have the features.
        unsafe {
            let order = _mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
            _mm512_shuffle_epi8(rows, _mm512_broadcast_i32x4(order))
        }
    }

    #[inline(always)]
    unsafe fn codes(z: __m512, codes: Codes) -> __m512i {
        // SAFETY: callers have the features.
        unsafe {
            let upper = _mm512_srl_epi32(_mm512_castps_si512(z), _mm_cvtsi32_si128(codes.shift as i32));
            let code = _mm512_sub_epi32(upper, _mm512_set1_epi32(codes.base));
            _mm512_min_epi32(_mm512_max_epi32(code, _mm512_setzero_si512()), _mm512_set1_epi32(65535))
        }
    }

    #[inline(always)]
    unsafe fn prefetch<T>(at: *const T) {
        // SAFETY: a prefetch faults nowhere.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast()) }
    }

    #[inline(always)]
    unsafe fn raise(line: *mut u16, known: u32, cover: u32, code: u16) -> u16 {
        // SAFETY: callers have the features; a line is 64 bytes, aligned so.
        unsafe {
            // Volatile, or this becomes a masked load, which waits for stores to the line to retire.
            let old = _mm512_maskz_mov_epi16(known, line.cast::<__m512i>().read_volatile());
            let new = _mm512_mask_max_epu16(old, cover, old, _mm512_set1_epi16(code as i16));
            _mm512_store_si512(line.cast(), new);
            if known | cover != !0 {
                return 0;
            }
            least_pixel(new)
        }
    }

    #[inline(always)]
    unsafe fn join(line: *mut u16, known: u32, other: *const u16, other_known: u32) -> u16 {
        // SAFETY: as above.
        unsafe {
            let a = _mm512_maskz_mov_epi16(known, _mm512_load_si512(line.cast()));
            let b = _mm512_maskz_mov_epi16(other_known, _mm512_load_si512(other.cast()));
            let new = _mm512_max_epu16(a, b);
            _mm512_store_si512(line.cast(), new);
            least_pixel(new)
        }
    }

    #[inline(always)]
    unsafe fn above(line: *const u16, code: u16) -> u32 {
        // SAFETY: as above.
        unsafe { _mm512_cmpgt_epu16_mask(_mm512_load_si512(line.cast()), _mm512_set1_epi16(code as i16)) }
    }

    #[inline(always)]
    unsafe fn corners(at: *const Corner, words: *const u32) -> [Fetched<Self>; 3] {
        // SAFETY: callers have the features; words are as many as lanes and name corners of their batch.
        unsafe { [corner::<0>(at, words.cast()), corner::<1>(at, words.cast()), corner::<2>(at, words.cast())] }
    }

    #[inline(always)]
    unsafe fn project(view: &BatchView, batch: &Batch<'_>, out: &mut [Corner]) {
        // SAFETY: callers have the features; columns and `out` are padded to eight.
        unsafe {
            let set = |x: f64| _mm512_set1_pd(x);
            let (half_x, half_y, near) = (set(view.half[0]), set(view.half[1]), set(view.near_snap));
            let mut i = 0;
            while i < out.len() {
                let load = |column: &[i32]| _mm512_cvtepi32_pd(_mm256_loadu_si256(column.as_ptr().add(i).cast()));
                let q = [load(batch.x), load(batch.y), load(batch.z)];
                let m = &view.to_camera;
                let (x, y) = (axis(&m[0], &q, view.offset[0]), axis(&m[1], &q, view.offset[1]));
                let z = axis(&m[2], &q, view.offset[2]);
                let (scale, n, w, h) = if view.perspective {
                    let scale = _mm512_div_pd(set(1.0), z);
                    (scale, scale, _mm512_mul_pd(half_x, z), _mm512_mul_pd(half_y, z))
                } else {
                    (set(1.0), _mm512_sub_pd(set(view.ahead), z), half_x, half_y)
                };
                let px = _mm512_mul_pd(_mm512_add_pd(_mm512_mul_pd(x, scale), half_x), set(SUBPIXELS));
                let py = _mm512_mul_pd(_mm512_add_pd(_mm512_mul_pd(y, scale), half_y), set(SUBPIXELS));
                let beyond = _mm512_cmp_pd_mask::<_CMP_GE_OQ>(z, near);
                let snapped = beyond
                    & _mm512_cmp_pd_mask::<_CMP_LT_OQ>(_mm512_abs_pd(px), set(FAR))
                    & _mm512_cmp_pd_mask::<_CMP_LT_OQ>(_mm512_abs_pd(py), set(FAR));
                let off = _mm256_set1_epi32(OFF);
                let xi = _mm256_mask_mov_epi32(off, snapped, _mm512_cvtpd_epi32(px));
                let yi = _mm256_mask_mov_epi32(off, snapped, _mm512_cvtpd_epi32(py));
                let zero = _mm512_setzero_pd();
                let code = _mm256_maskz_set1_epi32(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(z, near), 1);
                let mark =
                    |code: __m256i, m: __mmask8, bit: i32| _mm256_mask_or_epi32(code, m, code, _mm256_set1_epi32(bit));
                let code = mark(code, _mm512_cmp_pd_mask::<_CMP_LT_OQ>(x, _mm512_sub_pd(zero, w)), 2);
                let code = mark(code, _mm512_cmp_pd_mask::<_CMP_GT_OQ>(x, w), 4);
                let code = mark(code, _mm512_cmp_pd_mask::<_CMP_LT_OQ>(y, _mm512_sub_pd(zero, h)), 8);
                let code = mark(code, _mm512_cmp_pd_mask::<_CMP_GT_OQ>(y, h), 16);
                let n = _mm256_castps_si256(_mm512_cvtpd_ps(n));
                super::lanes_avx2::store_corners(out.as_mut_ptr().add(i), xi, yi, n, code);
                i += 8;
            }
        }
    }

    #[inline(always)]
    unsafe fn bound(at: f64, step: f64, first: f64, limit: f64) -> __m512i {
        // SAFETY: callers have the features.
        unsafe {
            let eight = |first: f64| {
                let row = _mm512_add_pd(_mm512_set1_pd(first), _mm512_setr_pd(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0));
                let x = _mm512_add_pd(_mm512_set1_pd(at), _mm512_mul_pd(_mm512_set1_pd(step), row));
                let x = _mm512_min_pd(_mm512_max_pd(x, _mm512_setzero_pd()), _mm512_set1_pd(limit));
                _mm512_cvttpd_epi32(x)
            };
            _mm512_inserti64x4::<1>(_mm512_castsi256_si512(eight(first)), eight(first + 8.0))
        }
    }
}

/// The K-th corners of triangles T, T + 4, T + 8, T + 12.
#[inline(always)]
unsafe fn four<const K: usize, const T: usize>(at: *const Corner, bytes: *const u8) -> __m512i {
    // SAFETY: as for `corners`.
    unsafe {
        let lo = _mm256_set_m128i(one!(at, bytes, T + 4, K), one!(at, bytes, T, K));
        let hi = _mm256_set_m128i(one!(at, bytes, T + 12, K), one!(at, bytes, T + 8, K));
        _mm512_inserti64x4::<1>(_mm512_castsi256_si512(lo), hi)
    }
}

/// The K-th corners of sixteen triangles, transposed.
#[inline(always)]
unsafe fn corner<const K: usize>(at: *const Corner, bytes: *const u8) -> Fetched<Avx512> {
    // SAFETY: as for `corners`.
    unsafe {
        let (r0, r1) = (four::<K, 0>(at, bytes), four::<K, 1>(at, bytes));
        let (r2, r3) = (four::<K, 2>(at, bytes), four::<K, 3>(at, bytes));
        let [x, y, n, code] = four_by_four(r0, r1, r2, r3);
        Fetched { x, y, n: _mm512_castsi512_ps(n), code }
    }
}

#[inline(always)]
unsafe fn least_pixel(line: __m512i) -> u16 {
    // SAFETY: callers have the features.
    unsafe {
        let m = _mm256_min_epu16(_mm512_castsi512_si256(line), _mm512_extracti64x4_epi64::<1>(line));
        let m = _mm_min_epu16(_mm256_castsi256_si128(m), _mm256_extracti128_si256::<1>(m));
        _mm_extract_epi16::<0>(_mm_minpos_epu16(m)) as u16
    }
}

/// In each group of four lanes the j-th of the result holds the j-th lanes of the four.
#[inline(always)]
unsafe fn four_by_four(r0: __m512i, r1: __m512i, r2: __m512i, r3: __m512i) -> [__m512i; 4] {
    // SAFETY: callers have the features.
    unsafe {
        let (a, b) = (_mm512_unpacklo_epi32(r0, r1), _mm512_unpackhi_epi32(r0, r1));
        let (c, d) = (_mm512_unpacklo_epi32(r2, r3), _mm512_unpackhi_epi32(r2, r3));
        [
            _mm512_unpacklo_epi64(a, c),
            _mm512_unpackhi_epi64(a, c),
            _mm512_unpacklo_epi64(b, d),
            _mm512_unpackhi_epi64(b, d),
        ]
    }
}

/// A camera coordinate of eight vertices.
#[inline(always)]
unsafe fn axis(m: &[f64; 3], q: &[__m512d; 3], offset: f64) -> __m512d {
    // SAFETY: callers have the features.
    unsafe {
        let xy = _mm512_add_pd(_mm512_mul_pd(_mm512_set1_pd(m[0]), q[0]), _mm512_mul_pd(_mm512_set1_pd(m[1]), q[1]));
        _mm512_add_pd(_mm512_add_pd(xy, _mm512_mul_pd(_mm512_set1_pd(m[2]), q[2])), _mm512_set1_pd(offset))
    }
}
