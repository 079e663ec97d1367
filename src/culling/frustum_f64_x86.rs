//! `f64` frustum kernel for x86-64: AVX2, 4 boxes a register. Explicit intrinsics; the operations and their order are those of `frustum_f64::block`.

use super::frustum_f64::{GUARD, Planes64};
use super::frustum_planes::PlaneMasks;
pub use super::frustum_x86::has_avx2;
use crate::hierarchy::BoundsBlock;
use std::arch::x86_64::*;

/// See `frustum_f64::block`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn block_avx2(frame: &Planes64, bounds: &BoundsBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
    assert!(has_avx2());
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { block_256(frame, bounds, wanted, want_inside, out) }
}

#[target_feature(enable = "avx2")]
fn block_256(frame: &Planes64, bounds: &BoundsBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
    let mut wanted_left = wanted;
    // Two halves of four lanes; the second is merged into what the first left.
    let first = half_256(frame, bounds, 0);
    let second = half_256(frame, bounds, 4);
    while wanted_left != 0 {
        let k = wanted_left.trailing_zeros() as usize;
        wanted_left &= wanted_left - 1;
        let plane = &frame.planes[k];
        let outside = |(a, guard): &([__m256d; 8], __m256d)| {
            let s = value_256(&plane.normal, a, &plane.p, plane.d_out);
            let minus = _mm256_xor_pd(*guard, _mm256_set1_pd(-0.0));
            _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(s, minus)) as u8
        };
        let inside = |(a, guard): &([__m256d; 8], __m256d)| {
            let s = value_256(&plane.normal, a, &plane.n, plane.d_in);
            _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(s, *guard)) as u8
        };
        out.outside[k] = outside(&first) | outside(&second) << 4;
        if want_inside {
            out.inside[k] = inside(&first) | inside(&second) << 4;
        }
    }
}

/// Four boxes relative to the eye, and their guards. Two of the eight registers are there only
/// so that an index of three bits needs no check.
#[target_feature(enable = "avx2")]
#[inline]
fn half_256(frame: &Planes64, bounds: &BoundsBlock, first: usize) -> ([__m256d; 8], __m256d) {
    let positive = _mm256_castsi256_pd(_mm256_set1_epi64x(i64::MAX));
    let mut a = [_mm256_setzero_pd(); 8];
    let mut magnitude = [_mm256_setzero_pd(); 3];
    for axis in 0..3 {
        let eye = _mm256_set1_pd(frame.eye[axis]);
        // SAFETY: `first` is 0 or 4, so four of the row's eight f32 follow; 16-byte aligned in the block.
        let row = |row: &[f32; 8]| unsafe { _mm256_cvtps_pd(_mm_load_ps(row.as_ptr().add(first & 4))) };
        let (lo, hi) = (_mm256_sub_pd(row(&bounds.lo[axis]), eye), _mm256_sub_pd(row(&bounds.hi[axis]), eye));
        magnitude[axis] = _mm256_add_pd(_mm256_and_pd(lo, positive), _mm256_and_pd(hi, positive));
        (a[axis], a[axis + 3]) = (lo, hi);
    }
    let total = _mm256_add_pd(_mm256_add_pd(magnitude[0], magnitude[1]), magnitude[2]);
    (a, _mm256_mul_pd(total, _mm256_set1_pd(GUARD)))
}

#[target_feature(enable = "avx2")]
#[inline]
fn value_256(normal: &[f64; 3], a: &[__m256d; 8], corner: &[usize; 3], d: f64) -> __m256d {
    let product = |axis: usize| _mm256_mul_pd(_mm256_set1_pd(normal[axis]), a[corner[axis] & 7]);
    let s = _mm256_add_pd(product(0), _mm256_set1_pd(d));
    _mm256_add_pd(_mm256_add_pd(s, product(1)), product(2))
}
