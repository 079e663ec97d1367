//! `fixed_q16` frustum kernel for x86-64: AVX2, 4 boxes a register.
//! Whole numbers throughout, so the order of sums is free; the answers are those of
//! `frustum_fixed::block`.
//!
//! The low halves of 64-bit lanes are multiplied (`mul_epi32`), which is exact for what
//! fits in 32 bits; lanes beyond are found first, and their masks cleared.

use super::frustum_fixed::{FixedBlock, FixedPlanes};
use super::frustum_planes::PlaneMasks;
pub use super::frustum_x86::has_avx2;
use std::arch::x86_64::*;

/// See `frustum_fixed::block`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn block_avx2(frame: &FixedPlanes, bounds: &FixedBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) -> u8 {
    assert!(has_avx2());
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { block_256(frame, bounds, wanted, want_inside, out) }
}

/// Four boxes: relative rows (two registers pad the index), guards, and lanes beyond reach.
struct Half {
    a: [__m256i; 8],
    guard: __m256i,
    beyond: u8,
}

#[target_feature(enable = "avx2")]
#[inline]
fn half_256(frame: &FixedPlanes, bounds: &FixedBlock, first: usize) -> Half {
    let zero = _mm256_setzero_si256();
    let (most, least) = (_mm256_set1_epi64x(i64::from(i32::MAX)), _mm256_set1_epi64x(i64::from(i32::MIN)));
    let mut a = [zero; 8];
    let mut beyond = zero;
    for (row, a) in a.iter_mut().enumerate().take(6) {
        // SAFETY: `first` is 0 or 4, so four of the row's eight i32 follow; 16-byte aligned in the block.
        let narrow = unsafe { _mm_load_si128(bounds.rows[row].as_ptr().add(first & 4).cast()) };
        let x = _mm256_sub_epi64(_mm256_cvtepi32_epi64(narrow), _mm256_set1_epi64x(frame.eye[row % 3]));
        beyond = _mm256_or_si256(beyond, _mm256_cmpgt_epi64(x, most));
        beyond = _mm256_or_si256(beyond, _mm256_cmpgt_epi64(least, x));
        *a = x;
    }
    let size = |x| {
        let negative = _mm256_cmpgt_epi64(zero, x);
        _mm256_sub_epi64(_mm256_xor_si256(x, negative), negative)
    };
    let mut sum = _mm256_set1_epi64x(1);
    for axis in 0..3 {
        let (lo, hi) = (size(a[axis]), size(a[axis + 3]));
        sum = _mm256_add_epi64(sum, _mm256_blendv_epi8(lo, hi, _mm256_cmpgt_epi64(hi, lo)));
    }
    // The sum is positive, so a logical shift halves it.
    let beyond = _mm256_movemask_pd(_mm256_castsi256_pd(beyond)) as u8;
    Half { a, guard: _mm256_srli_epi64::<1>(sum), beyond }
}

#[target_feature(enable = "avx2")]
#[inline]
fn value_256(normal: &[i32; 3], a: &[__m256i; 8], corner: &[usize; 3], d: i64) -> __m256i {
    let product = |axis: usize| _mm256_mul_epi32(_mm256_set1_epi64x(i64::from(normal[axis])), a[corner[axis] & 7]);
    let (s, t) = (_mm256_add_epi64(product(0), _mm256_set1_epi64x(d)), _mm256_add_epi64(product(1), product(2)));
    _mm256_add_epi64(s, t)
}

#[target_feature(enable = "avx2")]
fn block_256(frame: &FixedPlanes, bounds: &FixedBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) -> u8 {
    let halves = [half_256(frame, bounds, 0), half_256(frame, bounds, 4)];
    let beyond = halves[0].beyond | halves[1].beyond << 4;
    let mut wanted = wanted;
    while wanted != 0 {
        let k = wanted.trailing_zeros() as usize;
        wanted &= wanted - 1;
        let plane = &frame.planes[k];
        let lanes = |x| _mm256_movemask_pd(_mm256_castsi256_pd(x)) as u8;
        let outside = |half: &Half| {
            let minus = _mm256_sub_epi64(_mm256_setzero_si256(), half.guard);
            lanes(_mm256_cmpgt_epi64(minus, value_256(&plane.normal, &half.a, &frame.p[k], plane.d_out)))
        };
        let inside = |half: &Half| {
            lanes(_mm256_cmpgt_epi64(value_256(&plane.normal, &half.a, &frame.n[k], plane.d_in), half.guard))
        };
        out.outside[k] = (outside(&halves[0]) | outside(&halves[1]) << 4) & !beyond;
        if want_inside {
            out.inside[k] = (inside(&halves[0]) | inside(&halves[1]) << 4) & !beyond;
        }
    }
    beyond
}
