//! Frustum kernels for x86-64: AVX2 (8 boxes at once) and AVX-512 (16).
//!
//! Explicit intrinsics throughout: rustc 1.95 was seen to miscompile plain lane
//! loops when it vectorises them for AVX-512, so none stands in a function that
//! enables it. The operations and their order are those of `frustum_scalar`.

use super::frustum_planes::{FramePlanes, GUARD, PlaneMasks, Work};
use crate::hierarchy::BoundsBlock;
use std::arch::x86_64::*;

pub fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("popcnt")
}

pub fn has_avx512() -> bool {
    has_avx2() && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq")
}

/// See `frustum_scalar::block`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn block_avx2(frame: &FramePlanes, bounds: &BoundsBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe { block_256(frame, bounds, wanted, want_inside, out) }
}

/// See `frustum_scalar::flat`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn flat_avx2(frame: &FramePlanes, bounds: &[BoundsBlock], live: &[u8], outside: &mut [u8]) -> Work {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe {
        match frame.count {
            5 => flat_256::<5>(frame, bounds, live, outside),
            6 => flat_256::<6>(frame, bounds, live, outside),
            count => unreachable!("a view has 5 or 6 planes, not {count}"),
        }
    }
}

/// See `frustum_scalar::flat`.
///
/// # Panics
/// If the processor lacks AVX-512 F and DQ.
pub fn flat_avx512(frame: &FramePlanes, bounds: &[BoundsBlock], live: &[u8], outside: &mut [u8]) -> Work {
    assert!(has_avx512());
    // SAFETY: the processor has the features, as just asserted.
    unsafe {
        match frame.count {
            5 => flat_512::<5>(frame, bounds, live, outside),
            6 => flat_512::<6>(frame, bounds, live, outside),
            count => unreachable!("a view has 5 or 6 planes, not {count}"),
        }
    }
}

/// 8 boxes relative to the eye, and the guard of each. Two of the eight registers are
/// there only so that an index of three bits needs no check.
#[target_feature(enable = "avx2")]
#[inline]
fn relative_256(eye: &[__m256; 3], bounds: &BoundsBlock) -> ([__m256; 8], __m256) {
    let positive = _mm256_castsi256_ps(_mm256_set1_epi32(0x7fff_ffff));
    let mut a = [_mm256_setzero_ps(); 8];
    let mut magnitude = [_mm256_setzero_ps(); 3];
    for axis in 0..3 {
        // SAFETY: a row of 8 f32 is 32 bytes, and rows are 32-byte aligned in the 64-byte aligned block.
        let (lo, hi) = unsafe { (_mm256_load_ps(bounds.lo[axis].as_ptr()), _mm256_load_ps(bounds.hi[axis].as_ptr())) };
        let (lo, hi) = (_mm256_sub_ps(lo, eye[axis]), _mm256_sub_ps(hi, eye[axis]));
        let sum = _mm256_and_ps(_mm256_add_ps(lo, hi), positive);
        let size = _mm256_and_ps(_mm256_sub_ps(hi, lo), positive);
        magnitude[axis] = _mm256_add_ps(sum, size);
        (a[axis], a[axis + 3]) = (lo, hi);
    }
    let total = _mm256_add_ps(_mm256_add_ps(magnitude[0], magnitude[1]), magnitude[2]);
    (a, _mm256_mul_ps(total, _mm256_set1_ps(GUARD)))
}

#[target_feature(enable = "avx2")]
#[inline]
fn value_256(normal: &[f32; 3], a: &[__m256; 8], corner: &[usize; 3], d: f32) -> __m256 {
    let x = _mm256_mul_ps(_mm256_set1_ps(normal[0]), a[corner[0] & 7]);
    let y = _mm256_mul_ps(_mm256_set1_ps(normal[1]), a[corner[1] & 7]);
    let z = _mm256_mul_ps(_mm256_set1_ps(normal[2]), a[corner[2] & 7]);
    _mm256_add_ps(_mm256_add_ps(_mm256_add_ps(x, y), z), _mm256_set1_ps(d))
}

#[target_feature(enable = "avx2")]
#[inline]
fn negated_256(x: __m256) -> __m256 {
    _mm256_xor_ps(x, _mm256_set1_ps(-0.0))
}

#[target_feature(enable = "avx2,popcnt")]
fn block_256(frame: &FramePlanes, bounds: &BoundsBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
    let eye = frame.eye.map(|e| _mm256_set1_ps(e));
    let (a, guard) = relative_256(&eye, bounds);
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

#[target_feature(enable = "avx2,popcnt")]
fn flat_256<const N: usize>(frame: &FramePlanes, bounds: &[BoundsBlock], live: &[u8], outside: &mut [u8]) -> Work {
    let eye = frame.eye.map(|e| _mm256_set1_ps(e));
    let mut work = Work::default();
    for ((bounds, live), out) in bounds.iter().zip(live).zip(outside) {
        let (a, guard) = relative_256(&eye, bounds);
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

/// Two rows of 8 as one register.
#[target_feature(enable = "avx512f,avx512dq")]
#[inline]
fn load_pair(a: &[f32; 8], b: &[f32; 8]) -> __m512 {
    // SAFETY: each row is 32 bytes; unaligned loads ask for no alignment.
    let (a, b) = unsafe { (_mm256_loadu_ps(a.as_ptr()), _mm256_loadu_ps(b.as_ptr())) };
    _mm512_insertf32x8::<1>(_mm512_castps256_ps512(a), b)
}

#[target_feature(enable = "avx512f,avx512dq,popcnt")]
fn flat_512<const N: usize>(frame: &FramePlanes, bounds: &[BoundsBlock], live: &[u8], outside: &mut [u8]) -> Work {
    let eye = frame.eye.map(|e| _mm512_set1_ps(e));
    let mut work = Work::default();
    let count = bounds.len().min(live.len()).min(outside.len());
    let mut at = 0;
    while at < count {
        // An odd last block is judged beside itself, with no lane of the copy alive.
        let second = (at + 1).min(count - 1);
        let (first_block, second_block) = (&bounds[at], &bounds[second]);
        let mut a = [_mm512_setzero_ps(); 8];
        let mut magnitude = [_mm512_setzero_ps(); 3];
        for axis in 0..3 {
            let lo = _mm512_sub_ps(load_pair(&first_block.lo[axis], &second_block.lo[axis]), eye[axis]);
            let hi = _mm512_sub_ps(load_pair(&first_block.hi[axis], &second_block.hi[axis]), eye[axis]);
            let sum = _mm512_abs_ps(_mm512_add_ps(lo, hi));
            magnitude[axis] = _mm512_add_ps(sum, _mm512_abs_ps(_mm512_sub_ps(hi, lo)));
            (a[axis], a[axis + 3]) = (lo, hi);
        }
        let total = _mm512_add_ps(_mm512_add_ps(magnitude[0], magnitude[1]), magnitude[2]);
        let below = _mm512_mul_ps(total, _mm512_set1_ps(-GUARD));
        let mut left = u32::from(live[at] & !outside[at]);
        if second > at {
            left |= u32::from(live[second] & !outside[second]) << 8;
        }
        work.lanes += u64::from(left.count_ones());
        for plane in &frame.planes[..N] {
            work.planes += u64::from(left.count_ones());
            let x = _mm512_mul_ps(_mm512_set1_ps(plane.normal[0]), a[plane.p[0] & 7]);
            let y = _mm512_mul_ps(_mm512_set1_ps(plane.normal[1]), a[plane.p[1] & 7]);
            let z = _mm512_mul_ps(_mm512_set1_ps(plane.normal[2]), a[plane.p[2] & 7]);
            let s = _mm512_add_ps(_mm512_add_ps(_mm512_add_ps(x, y), z), _mm512_set1_ps(plane.d_out));
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
