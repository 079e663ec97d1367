//! Frustum kernels for x86-64: AVX2 (8 boxes at once) and AVX-512 (16).
//!
//! Explicit intrinsics throughout: rustc 1.95 was seen to miscompile plain lane
//! loops when it vectorises them for AVX-512, so none stands in a function that
//! enables it. The operations and their order are those of `frustum_scalar`: with
//! `GUARDED` those of `f32_relative`, without it those of `f32_world`.

use super::frustum_filtered::Signs;
use super::frustum_planes::{FramePlanes, GUARD, PlaneMasks, Work};
use crate::hierarchy::BoundsBlock;
use std::arch::x86_64::*;

pub fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") && is_x86_feature_detected!("popcnt")
}

pub fn has_avx512() -> bool {
    has_avx2() && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq")
}

/// See `frustum_scalar::block`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn block_avx2<const GUARDED: bool>(
    frame: &FramePlanes,
    bounds: &BoundsBlock,
    wanted: u8,
    want_inside: bool,
    out: &mut PlaneMasks,
) {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe { block_256::<GUARDED>(frame, bounds, wanted, want_inside, out) }
}

/// See `frustum_scalar::flat`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn flat_avx2<const GUARDED: bool>(
    frame: &FramePlanes,
    bounds: &[BoundsBlock],
    live: &[u8],
    outside: &mut [u8],
) -> Work {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe {
        match frame.count {
            5 => flat_256::<5, GUARDED>(frame, bounds, live, outside),
            6 => flat_256::<6, GUARDED>(frame, bounds, live, outside),
            count => unreachable!("a view has 5 or 6 planes, not {count}"),
        }
    }
}

/// See `frustum_scalar::flat`.
///
/// # Panics
/// If the processor lacks AVX-512 F and DQ.
pub fn flat_avx512<const GUARDED: bool>(
    frame: &FramePlanes,
    bounds: &[BoundsBlock],
    live: &[u8],
    outside: &mut [u8],
) -> Work {
    assert!(has_avx512());
    // SAFETY: the processor has the features, as just asserted.
    unsafe {
        match frame.count {
            5 if bounds.len() > NEAR => flat_512::<5, true, GUARDED>(frame, bounds, live, outside),
            5 => flat_512::<5, false, GUARDED>(frame, bounds, live, outside),
            6 if bounds.len() > NEAR => flat_512::<6, true, GUARDED>(frame, bounds, live, outside),
            6 => flat_512::<6, false, GUARDED>(frame, bounds, live, outside),
            count => unreachable!("a view has 5 or 6 planes, not {count}"),
        }
    }
}

/// See `frustum_filtered::signs`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn signs_avx2(frame: &FramePlanes, bounds: &BoundsBlock, wanted: u8, want_inside: bool, out: &mut Signs) {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe { signs_256(frame, bounds, wanted, want_inside, out) }
}

/// 8 boxes relative to the eye, and the guard of each. Two of the eight registers are
/// there only so that an index of three bits needs no check.
#[target_feature(enable = "avx2")]
#[inline]
fn relative_256<const GUARDED: bool>(eye: &[__m256; 3], bounds: &BoundsBlock) -> ([__m256; 8], __m256) {
    let positive = _mm256_castsi256_ps(_mm256_set1_epi32(0x7fff_ffff));
    let mut a = [_mm256_setzero_ps(); 8];
    let mut magnitude = [_mm256_setzero_ps(); 3];
    for axis in 0..3 {
        // SAFETY: a row of 8 f32 is 32 bytes, and rows are 32-byte aligned in the 64-byte aligned block.
        let (lo, hi) = unsafe { (_mm256_load_ps(bounds.lo[axis].as_ptr()), _mm256_load_ps(bounds.hi[axis].as_ptr())) };
        if !GUARDED {
            (a[axis], a[axis + 3]) = (lo, hi);
            continue;
        }
        let (lo, hi) = (_mm256_sub_ps(lo, eye[axis]), _mm256_sub_ps(hi, eye[axis]));
        magnitude[axis] = _mm256_add_ps(_mm256_and_ps(lo, positive), _mm256_and_ps(hi, positive));
        (a[axis], a[axis + 3]) = (lo, hi);
    }
    let total = _mm256_add_ps(_mm256_add_ps(magnitude[0], magnitude[1]), magnitude[2]);
    (a, _mm256_mul_ps(total, _mm256_set1_ps(GUARD)))
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn value_256(normal: &[f32; 3], a: &[__m256; 8], corner: &[usize; 3], d: f32) -> __m256 {
    let mut s = _mm256_set1_ps(d);
    for axis in 0..3 {
        s = _mm256_fmadd_ps(_mm256_set1_ps(normal[axis]), a[corner[axis] & 7], s);
    }
    s
}

#[target_feature(enable = "avx2")]
#[inline]
fn negated_256(x: __m256) -> __m256 {
    _mm256_xor_ps(x, _mm256_set1_ps(-0.0))
}

#[target_feature(enable = "avx2,fma,popcnt")]
fn block_256<const GUARDED: bool>(
    frame: &FramePlanes,
    bounds: &BoundsBlock,
    wanted: u8,
    want_inside: bool,
    out: &mut PlaneMasks,
) {
    let eye = frame.eye.map(|e| _mm256_set1_ps(e));
    let (a, guard) = relative_256::<GUARDED>(&eye, bounds);
    let below = negated_256(guard);
    let mut wanted = wanted & frame.all();
    while wanted != 0 {
        let k = wanted.trailing_zeros() as usize;
        wanted &= wanted - 1;
        let plane = &frame.planes[k];
        let s = value_256(&plane.normal, &a, &plane.p, plane.d_out);
        out.outside[k] = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(s, below)) as u8;
        if want_inside {
            let s = value_256(&plane.normal, &a, &plane.n, plane.d_in);
            out.inside[k] = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(s, guard)) as u8;
        }
    }
}

#[target_feature(enable = "avx2,fma,popcnt")]
fn signs_256(frame: &FramePlanes, bounds: &BoundsBlock, wanted: u8, want_inside: bool, out: &mut Signs) {
    let eye = frame.eye.map(|e| _mm256_set1_ps(e));
    let (a, guard) = relative_256::<true>(&eye, bounds);
    let minus = negated_256(guard);
    let mut wanted = wanted & frame.all();
    while wanted != 0 {
        let k = wanted.trailing_zeros() as usize;
        wanted &= wanted - 1;
        let plane = &frame.planes[k];
        let below = |corner| {
            let s = value_256(&plane.normal, &a, corner, plane.d_out);
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(s, minus)) as u8
        };
        let above = |corner| {
            let s = value_256(&plane.normal, &a, corner, plane.d_in);
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(s, guard)) as u8
        };
        (out.p_below[k], out.p_above[k]) = (below(&plane.p), above(&plane.p));
        if want_inside {
            (out.n_below[k], out.n_above[k]) = (below(&plane.n), above(&plane.n));
        }
    }
}

#[target_feature(enable = "avx2,fma,popcnt")]
fn flat_256<const N: usize, const GUARDED: bool>(
    frame: &FramePlanes,
    bounds: &[BoundsBlock],
    live: &[u8],
    outside: &mut [u8],
) -> Work {
    let eye = frame.eye.map(|e| _mm256_set1_ps(e));
    let mut work = Work::default();
    for ((bounds, live), out) in bounds.iter().zip(live).zip(outside) {
        let (a, guard) = relative_256::<GUARDED>(&eye, bounds);
        let below = negated_256(guard);
        let mut left = u32::from(live & !*out);
        work.lanes += u64::from(left.count_ones());
        for plane in &frame.planes[..N] {
            work.planes += u64::from(left.count_ones());
            let s = value_256(&plane.normal, &a, &plane.p, plane.d_out);
            left &= !(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(s, below)) as u32);
        }
        *out = !left as u8;
    }
    work
}

/// Rows `2 i` and `2 i + 1` of two blocks (in memory order: lo x, lo y, lo z, hi x,
/// hi y, hi z), each row of 16 as one register.
#[target_feature(enable = "avx512f,avx512dq")]
#[inline]
fn load_rows(first: &BoundsBlock, second: &BoundsBlock, i: usize) -> (__m512, __m512) {
    const { assert!(size_of::<BoundsBlock>() == 3 * size_of::<__m512>() && align_of::<BoundsBlock>() == 64) };
    // SAFETY: i is below 3, and a block is three 64-byte aligned registers of f32.
    let (a, b) = unsafe {
        debug_assert!(i < 3);
        let row = |block: &BoundsBlock| _mm512_load_ps(std::ptr::from_ref(block).cast::<f32>().add(16 * i));
        (row(first), row(second))
    };
    (_mm512_shuffle_f32x4::<0b01_00_01_00>(a, b), _mm512_shuffle_f32x4::<0b11_10_11_10>(a, b))
}

/// Blocks between the one judged and the one prefetched: 6 KiB.
const AHEAD: usize = 32;

/// Blocks that a second-level cache of 1 MiB surely holds; more are prefetched.
const NEAR: usize = 4096;

#[target_feature(enable = "avx512f,avx512dq,popcnt")]
fn flat_512<const N: usize, const FAR: bool, const GUARDED: bool>(
    frame: &FramePlanes,
    bounds: &[BoundsBlock],
    live: &[u8],
    outside: &mut [u8],
) -> Work {
    let [ex, ey, ez] = frame.eye.map(|e| _mm512_set1_ps(e));
    let minus_guard = _mm512_set1_ps(-GUARD);
    let mut work = Work::default();
    let count = bounds.len().min(live.len()).min(outside.len());
    let mut at = 0;
    while at < count {
        // An odd last block is judged beside itself, with no lane of the copy alive.
        let second = (at + 1).min(count - 1);
        let (blocks, others) = (&bounds[at], &bounds[second]);
        if FAR {
            // The hardware prefetcher stops at page ends; an address past the slice is only a hint.
            let ahead = bounds.as_ptr().wrapping_add(at + AHEAD).cast::<i8>();
            for line in 0..6 {
                _mm_prefetch::<_MM_HINT_T0>(ahead.wrapping_add(64 * line));
            }
        }
        let (lo_x, lo_y) = load_rows(blocks, others, 0);
        let (lo_z, hi_x) = load_rows(blocks, others, 1);
        let (hi_y, hi_z) = load_rows(blocks, others, 2);
        let near = |x, e| if GUARDED { _mm512_sub_ps(x, e) } else { x };
        let (lo_x, lo_y, lo_z) = (near(lo_x, ex), near(lo_y, ey), near(lo_z, ez));
        let (hi_x, hi_y, hi_z) = (near(hi_x, ex), near(hi_y, ey), near(hi_z, ez));
        let size = |lo, hi| _mm512_add_ps(_mm512_abs_ps(lo), _mm512_abs_ps(hi));
        let below = if GUARDED {
            let total = _mm512_add_ps(_mm512_add_ps(size(lo_x, hi_x), size(lo_y, hi_y)), size(lo_z, hi_z));
            _mm512_mul_ps(total, minus_guard)
        } else {
            _mm512_setzero_ps()
        };
        let a = [lo_x, lo_y, lo_z, hi_x, hi_y, hi_z, ex, ex];
        let mut left = u32::from(live[at] & !outside[at]);
        if second > at {
            left |= u32::from(live[second] & !outside[second]) << 8;
        }
        work.lanes += u64::from(left.count_ones());
        for plane in &frame.planes[..N] {
            work.planes += u64::from(left.count_ones());
            let [nx, ny, nz] = plane.normal.map(|n| _mm512_set1_ps(n));
            let s = _mm512_fmadd_ps(nx, a[plane.p[0] & 7], _mm512_set1_ps(plane.d_out));
            let s = _mm512_fmadd_ps(nz, a[plane.p[2] & 7], _mm512_fmadd_ps(ny, a[plane.p[1] & 7], s));
            left &= !u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(s, below));
        }
        outside[at] = !left as u8;
        if second > at {
            outside[second] = (!left >> 8) as u8;
        }
        at += 2;
    }
    work
}
