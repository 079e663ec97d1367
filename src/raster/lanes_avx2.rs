//! Eight lanes by AVX2. A line of 32 pixels is two registers.

use super::block::{Corner, OFF};
use super::code::Codes;
use super::lanes::{Fetched, Lanes};
use super::vertices::{Batch, BatchView, FAR, SUBPIXELS};
use std::arch::x86_64::*;

#[derive(Debug, Clone, Copy)]
pub struct Avx2;

pub fn present() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
}

macro_rules! lanes {
    ($($name:ident($($arg:ident: $type:ty),*) -> $result:ty = $body:expr;)*) => {
        $(#[inline(always)]
        unsafe fn $name($($arg: $type),*) -> $result {
            // SAFETY: callers have the features, and pointers that are good for eight lanes.
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

impl Lanes for Avx2 {
    const N: usize = 8;
    type F = __m256;
    type I = __m256i;
    type M = __m256;

    lanes! {
        f(x: f32) -> __m256 = _mm256_set1_ps(x);
        i(x: i32) -> __m256i = _mm256_set1_epi32(x);
        load_f(from: *const f32) -> __m256 = _mm256_loadu_ps(from);
        load_i(from: *const i32) -> __m256i = _mm256_loadu_si256(from.cast());
        store_f(to: *mut f32, a: __m256) -> () = _mm256_storeu_ps(to, a);
        store_i(to: *mut i32, a: __m256i) -> () = _mm256_storeu_si256(to.cast(), a);
        add(a: __m256, b: __m256) -> __m256 = _mm256_add_ps(a, b);
        sub(a: __m256, b: __m256) -> __m256 = _mm256_sub_ps(a, b);
        mul(a: __m256, b: __m256) -> __m256 = _mm256_mul_ps(a, b);
        div(a: __m256, b: __m256) -> __m256 = _mm256_div_ps(a, b);
        min(a: __m256, b: __m256) -> __m256 = _mm256_min_ps(a, b);
        max(a: __m256, b: __m256) -> __m256 = _mm256_max_ps(a, b);
        abs(a: __m256) -> __m256 = _mm256_and_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(i32::MAX)));
        gt(a: __m256, b: __m256) -> __m256 = _mm256_cmp_ps::<_CMP_GT_OQ>(a, b);
        ge(a: __m256, b: __m256) -> __m256 = _mm256_cmp_ps::<_CMP_GE_OQ>(a, b);
        pick_f(m: __m256, yes: __m256, no: __m256) -> __m256 = _mm256_blendv_ps(no, yes, m);
        add_i(a: __m256i, b: __m256i) -> __m256i = _mm256_add_epi32(a, b);
        sub_i(a: __m256i, b: __m256i) -> __m256i = _mm256_sub_epi32(a, b);
        and_i(a: __m256i, b: __m256i) -> __m256i = _mm256_and_si256(a, b);
        min_i(a: __m256i, b: __m256i) -> __m256i = _mm256_min_epi32(a, b);
        max_i(a: __m256i, b: __m256i) -> __m256i = _mm256_max_epi32(a, b);
        shr16(a: __m256i) -> __m256i = _mm256_srai_epi32::<16>(a);
        shl16(a: __m256i) -> __m256i = _mm256_slli_epi32::<16>(a);
        gt_i(a: __m256i, b: __m256i) -> __m256 = _mm256_castsi256_ps(_mm256_cmpgt_epi32(a, b));
        eq_i(a: __m256i, b: __m256i) -> __m256 = _mm256_castsi256_ps(_mm256_cmpeq_epi32(a, b));
        pick_i(m: __m256, yes: __m256i, no: __m256i) -> __m256i = _mm256_blendv_epi8(no, yes, _mm256_castps_si256(m));
        truncate(a: __m256) -> __m256i = _mm256_cvttps_epi32(a);
        to_f(a: __m256i) -> __m256 = _mm256_cvtepi32_ps(a);
        bits(m: __m256) -> u32 = _mm256_movemask_ps(m) as u32;
        steps() -> __m256i = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        across() -> __m256i = _mm256_setr_epi32(0, 1, 2, 3, 0, 1, 2, 3);
        down() -> __m256i = _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1);
    }

    #[inline(always)]
    unsafe fn mask(bits: u32) -> __m256 {
        // SAFETY: callers have the features.
        unsafe {
            let bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), bit);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, bit))
        }
    }

    #[inline(always)]
    unsafe fn rows(from: i32, to: i32) -> __m256 {
        // SAFETY: callers have the features.
        unsafe {
            let not_before = _mm256_cmpgt_epi32(Self::steps(), _mm256_set1_epi32(from - 1));
            let before = _mm256_cmpgt_epi32(_mm256_set1_epi32(to), Self::steps());
            _mm256_castsi256_ps(_mm256_and_si256(not_before, before))
        }
    }

    #[inline(always)]
    unsafe fn run(from: __m256i, to: __m256i) -> __m256i {
        // SAFETY: callers have the features. Shifts of 32 and more leave nothing.
        unsafe {
            let (zero, ones) = (_mm256_setzero_si256(), _mm256_set1_epi32(-1));
            let from = _mm256_sllv_epi32(ones, _mm256_max_epi32(from, zero));
            let to = _mm256_sllv_epi32(ones, _mm256_max_epi32(to, zero));
            _mm256_andnot_si256(to, from)
        }
    }

    #[inline(always)]
    unsafe fn to_subtiles(rows: __m256i) -> __m256i {
        // SAFETY: callers have the features.
        unsafe {
            let order = _mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
            _mm256_shuffle_epi8(rows, _mm256_broadcastsi128_si256(order))
        }
    }

    #[inline(always)]
    unsafe fn codes(z: __m256, codes: Codes) -> __m256i {
        // SAFETY: callers have the features.
        unsafe {
            let upper = _mm256_srl_epi32(_mm256_castps_si256(z), _mm_cvtsi32_si128(codes.shift as i32));
            let code = _mm256_sub_epi32(upper, _mm256_set1_epi32(codes.base));
            _mm256_min_epi32(_mm256_max_epi32(code, _mm256_setzero_si256()), _mm256_set1_epi32(65535))
        }
    }

    #[inline(always)]
    unsafe fn least_i(a: __m256i) -> i32 {
        // SAFETY: callers have the features.
        unsafe {
            let m = _mm_min_epi32(_mm256_castsi256_si128(a), _mm256_extracti128_si256::<1>(a));
            let m = _mm_min_epi32(m, _mm_shuffle_epi32::<0b01_00_11_10>(m));
            _mm_cvtsi128_si32(_mm_min_epi32(m, _mm_shuffle_epi32::<0b10_11_00_01>(m)))
        }
    }

    #[inline(always)]
    unsafe fn greatest_i(a: __m256i) -> i32 {
        // SAFETY: callers have the features.
        unsafe {
            let m = _mm_max_epi32(_mm256_castsi256_si128(a), _mm256_extracti128_si256::<1>(a));
            let m = _mm_max_epi32(m, _mm_shuffle_epi32::<0b01_00_11_10>(m));
            _mm_cvtsi128_si32(_mm_max_epi32(m, _mm_shuffle_epi32::<0b10_11_00_01>(m)))
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
            let code = _mm256_set1_epi16(code as i16);
            let half = |i: usize| {
                let at = line.cast::<__m256i>().add(i);
                let old = _mm256_and_si256(_mm256_load_si256(at), wide(known >> (16 * i)));
                let new = _mm256_max_epu16(old, _mm256_and_si256(code, wide(cover >> (16 * i))));
                _mm256_store_si256(at, new);
                new
            };
            let (a, b) = (half(0), half(1));
            if known | cover != !0 {
                return 0;
            }
            least_pixel(a, b)
        }
    }

    #[inline(always)]
    unsafe fn join(line: *mut u16, known: u32, other: *const u16, other_known: u32) -> u16 {
        // SAFETY: as above.
        unsafe {
            let half = |i: usize| {
                let at = line.cast::<__m256i>().add(i);
                let a = _mm256_and_si256(_mm256_load_si256(at), wide(known >> (16 * i)));
                let b = _mm256_load_si256(other.cast::<__m256i>().add(i));
                let new = _mm256_max_epu16(a, _mm256_and_si256(b, wide(other_known >> (16 * i))));
                _mm256_store_si256(at, new);
                new
            };
            let (a, b) = (half(0), half(1));
            least_pixel(a, b)
        }
    }

    #[inline(always)]
    unsafe fn above(line: *const u16, code: u16) -> u32 {
        // SAFETY: as above.
        unsafe {
            let (code, zero) = (_mm256_set1_epi16(code as i16), _mm256_setzero_si256());
            let at = line.cast::<__m256i>();
            let a = _mm256_cmpeq_epi16(_mm256_subs_epu16(_mm256_load_si256(at), code), zero);
            let b = _mm256_cmpeq_epi16(_mm256_subs_epu16(_mm256_load_si256(at.add(1)), code), zero);
            let both = _mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_packs_epi16(a, b));
            !(_mm256_movemask_epi8(both) as u32)
        }
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
            let mut i = 0;
            while i < out.len() {
                let (a, b) = (four(view, batch, i), four(view, batch, i + 4));
                let both = |k: usize| _mm256_set_m128i(b[k], a[k]);
                store_corners(out.as_mut_ptr().add(i), both(0), both(1), both(2), both(3));
                i += 8;
            }
        }
    }

    #[inline(always)]
    unsafe fn bound(at: f64, step: f64, first: f64, limit: f64) -> __m256i {
        // SAFETY: callers have the features.
        unsafe {
            let four = |first: f64| {
                let row = _mm256_add_pd(_mm256_set1_pd(first), _mm256_setr_pd(0.0, 1.0, 2.0, 3.0));
                let x = _mm256_add_pd(_mm256_set1_pd(at), _mm256_mul_pd(_mm256_set1_pd(step), row));
                let x = _mm256_min_pd(_mm256_max_pd(x, _mm256_setzero_pd()), _mm256_set1_pd(limit));
                _mm256_cvttpd_epi32(x)
            };
            _mm256_set_m128i(four(first + 4.0), four(first))
        }
    }
}

#[inline(always)]
unsafe fn least_pixel(a: __m256i, b: __m256i) -> u16 {
    // SAFETY: callers have the features.
    unsafe {
        let m = _mm256_min_epu16(a, b);
        let m = _mm_min_epu16(_mm256_castsi256_si128(m), _mm256_extracti128_si256::<1>(m));
        _mm_extract_epi16::<0>(_mm_minpos_epu16(m)) as u16
    }
}

/// Sixteen bits to sixteen lanes of all ones or zeroes.
#[inline(always)]
unsafe fn wide(bits: u32) -> __m256i {
    // SAFETY: callers have the features.
    unsafe {
        let bit = _mm256_setr_epi16(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, i16::MIN);
        _mm256_cmpeq_epi16(_mm256_and_si256(_mm256_set1_epi16(bits as i16), bit), bit)
    }
}

/// x, y, nearness and code of four vertices.
#[inline(always)]
unsafe fn four(view: &BatchView, batch: &Batch<'_>, i: usize) -> [__m128i; 4] {
    // SAFETY: callers have the features; columns are padded to eight.
    unsafe {
        let set = |x: f64| _mm256_set1_pd(x);
        let load = |column: &[i32]| _mm256_cvtepi32_pd(_mm_loadu_si128(column.as_ptr().add(i).cast()));
        let q = [load(batch.x), load(batch.y), load(batch.z)];
        let m = &view.to_camera;
        let (x, y) = (axis(&m[0], &q, view.offset[0]), axis(&m[1], &q, view.offset[1]));
        let z = axis(&m[2], &q, view.offset[2]);
        let (half_x, half_y, near, zero) = (set(view.half[0]), set(view.half[1]), set(view.near_snap), set(0.0));
        let (scale, n, w, h) = if view.perspective {
            let scale = _mm256_div_pd(set(1.0), z);
            (scale, scale, _mm256_mul_pd(half_x, z), _mm256_mul_pd(half_y, z))
        } else {
            (set(1.0), _mm256_sub_pd(set(view.ahead), z), half_x, half_y)
        };
        let px = _mm256_mul_pd(_mm256_add_pd(_mm256_mul_pd(x, scale), half_x), set(SUBPIXELS));
        let py = _mm256_mul_pd(_mm256_add_pd(_mm256_mul_pd(y, scale), half_y), set(SUBPIXELS));
        let positive = _mm256_castsi256_pd(_mm256_set1_epi64x(i64::MAX));
        let fits = |p: __m256d| _mm256_cmp_pd::<_CMP_LT_OQ>(_mm256_and_pd(p, positive), set(FAR));
        let snapped = _mm256_and_pd(_mm256_cmp_pd::<_CMP_GE_OQ>(z, near), _mm256_and_pd(fits(px), fits(py)));
        // The lower halves of four wide truths.
        let narrow = |m: __m256d| {
            let m = _mm256_castpd_ps(m);
            let (lo, hi) = (_mm256_castps256_ps128(m), _mm256_extractf128_ps::<1>(m));
            _mm_castps_si128(_mm_shuffle_ps::<0b10_00_10_00>(lo, hi))
        };
        let snapped = narrow(snapped);
        let snap = |p: __m256d| _mm_blendv_epi8(_mm_set1_epi32(OFF), _mm256_cvtpd_epi32(p), snapped);
        let bit = |m: __m256d, bit: i32| _mm_and_si128(narrow(m), _mm_set1_epi32(bit));
        let code = bit(_mm256_cmp_pd::<_CMP_LT_OQ>(z, near), 1);
        let code = _mm_or_si128(code, bit(_mm256_cmp_pd::<_CMP_LT_OQ>(x, _mm256_sub_pd(zero, w)), 2));
        let code = _mm_or_si128(code, bit(_mm256_cmp_pd::<_CMP_GT_OQ>(x, w), 4));
        let code = _mm_or_si128(code, bit(_mm256_cmp_pd::<_CMP_LT_OQ>(y, _mm256_sub_pd(zero, h)), 8));
        let code = _mm_or_si128(code, bit(_mm256_cmp_pd::<_CMP_GT_OQ>(y, h), 16));
        [snap(px), snap(py), _mm_castps_si128(_mm256_cvtpd_ps(n)), code]
    }
}

/// Eight corners from their columns.
#[inline(always)]
pub unsafe fn store_corners(to: *mut Corner, x: __m256i, y: __m256i, n: __m256i, code: __m256i) {
    // SAFETY: callers have AVX2 and room for eight.
    unsafe {
        let (a, b) = (_mm256_unpacklo_epi32(x, y), _mm256_unpackhi_epi32(x, y));
        let (c, d) = (_mm256_unpacklo_epi32(n, code), _mm256_unpackhi_epi32(n, code));
        let (v0, v1) = (_mm256_unpacklo_epi64(a, c), _mm256_unpackhi_epi64(a, c));
        let (v2, v3) = (_mm256_unpacklo_epi64(b, d), _mm256_unpackhi_epi64(b, d));
        let to = to.cast::<__m256i>();
        _mm256_storeu_si256(to, _mm256_permute2x128_si256::<0x20>(v0, v1));
        _mm256_storeu_si256(to.add(1), _mm256_permute2x128_si256::<0x20>(v2, v3));
        _mm256_storeu_si256(to.add(2), _mm256_permute2x128_si256::<0x31>(v0, v1));
        _mm256_storeu_si256(to.add(3), _mm256_permute2x128_si256::<0x31>(v2, v3));
    }
}

/// The K-th corners of eight triangles, transposed.
#[inline(always)]
unsafe fn corner<const K: usize>(at: *const Corner, bytes: *const u8) -> Fetched<Avx2> {
    // SAFETY: as for `corners`.
    unsafe {
        let r0 = _mm256_set_m128i(one!(at, bytes, 4, K), one!(at, bytes, 0, K));
        let r1 = _mm256_set_m128i(one!(at, bytes, 5, K), one!(at, bytes, 1, K));
        let r2 = _mm256_set_m128i(one!(at, bytes, 6, K), one!(at, bytes, 2, K));
        let r3 = _mm256_set_m128i(one!(at, bytes, 7, K), one!(at, bytes, 3, K));
        let (a, b) = (_mm256_unpacklo_epi32(r0, r1), _mm256_unpackhi_epi32(r0, r1));
        let (c, d) = (_mm256_unpacklo_epi32(r2, r3), _mm256_unpackhi_epi32(r2, r3));
        Fetched {
            x: _mm256_unpacklo_epi64(a, c),
            y: _mm256_unpackhi_epi64(a, c),
            n: _mm256_castsi256_ps(_mm256_unpacklo_epi64(b, d)),
            code: _mm256_unpackhi_epi64(b, d),
        }
    }
}

/// A camera coordinate of four vertices.
#[inline(always)]
unsafe fn axis(m: &[f64; 3], q: &[__m256d; 3], offset: f64) -> __m256d {
    // SAFETY: callers have the features.
    unsafe {
        let xy = _mm256_add_pd(_mm256_mul_pd(_mm256_set1_pd(m[0]), q[0]), _mm256_mul_pd(_mm256_set1_pd(m[1]), q[1]));
        _mm256_add_pd(_mm256_add_pd(xy, _mm256_mul_pd(_mm256_set1_pd(m[2]), q[2])), _mm256_set1_pd(offset))
    }
}
