//! The octant test for x86-64: AVX2, 8 boxes at once. Explicit intrinsics, unfused, in the
//! operations and the order of `Halves::of_boxes_plainly`, its twin.

use super::frustum_octant::{Far, Halves, TINY};
use super::frustum_planes::GUARD;
use super::frustum_x86::has_avx2;
use crate::hierarchy::BoundsBlock;
use std::arch::x86_64::*;

/// See `Halves::of_boxes_plainly`.
///
/// # Panics
/// If the processor lacks AVX2.
#[inline]
pub fn of_boxes_avx2(halves: &Halves, bounds: &BoundsBlock) -> Far {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe { of_boxes_256(halves, bounds) }
}

#[target_feature(enable = "avx2")]
fn of_boxes_256(halves: &Halves, bounds: &BoundsBlock) -> Far {
    let positive = _mm256_castsi256_ps(_mm256_set1_epi32(0x7fff_ffff));
    let zero = _mm256_setzero_ps();
    let (mut twice, mut size, mut across) = ([zero; 3], zero, zero);
    let mut lanes = 0xff;
    for (axis, twice) in twice.iter_mut().enumerate() {
        // SAFETY: a row of 8 f32 is 32 bytes, and rows are 32-byte aligned in the 64-byte aligned block.
        let (lo, hi) = unsafe { (_mm256_load_ps(bounds.lo[axis].as_ptr()), _mm256_load_ps(bounds.hi[axis].as_ptr())) };
        let extent = _mm256_sub_ps(hi, lo);
        across = _mm256_add_ps(across, _mm256_mul_ps(extent, extent));
        lanes &= _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(lo, hi)) as u8;
        let eye = _mm256_set1_ps(halves.eye[axis]);
        let (lo, hi) = (_mm256_sub_ps(lo, eye), _mm256_sub_ps(hi, eye));
        *twice = _mm256_add_ps(lo, hi);
        size = _mm256_add_ps(size, _mm256_add_ps(_mm256_and_ps(lo, positive), _mm256_and_ps(hi, positive)));
    }
    let diagonal = _mm256_mul_ps(_mm256_sqrt_ps(across), _mm256_set1_ps(1.0 + GUARD));
    let diagonal = _mm256_add_ps(diagonal, _mm256_set1_ps(TINY));
    let guard = _mm256_add_ps(_mm256_mul_ps(size, _mm256_set1_ps(2.0 * GUARD)), _mm256_set1_ps(halves.slack));
    let wide = _mm256_add_ps(diagonal, _mm256_mul_ps(_mm256_set1_ps(2.0), guard));
    let along = |i: usize| {
        let [x, y, z] = halves.axes[i].map(|n| _mm256_set1_ps(n));
        let sum = _mm256_add_ps(_mm256_mul_ps(x, twice[0]), _mm256_mul_ps(y, twice[1]));
        _mm256_add_ps(_mm256_add_ps(sum, _mm256_mul_ps(z, twice[2])), _mm256_set1_ps(halves.offset[i]))
    };
    let above = |v, bound| lanes & _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(v, bound)) as u8;
    let mut far = Far::NONE;
    let depth = along(2);
    let ahead = if halves.perspective { above(depth, guard) } else { lanes };
    for i in 0..2 {
        let across = along(i);
        let [sideways, forward] = halves.side[i].map(|n| _mm256_set1_ps(n));
        for (k, inward) in [(2 * i, across), (2 * i + 1, _mm256_xor_ps(across, _mm256_set1_ps(-0.0)))] {
            far.skip[k] = ahead & above(inward, guard);
            let distance = if halves.perspective {
                _mm256_add_ps(_mm256_mul_ps(sideways, inward), _mm256_mul_ps(forward, depth))
            } else {
                _mm256_add_ps(inward, _mm256_set1_ps(halves.window[i]))
            };
            far.inside[k] = far.skip[k] & above(distance, wide);
        }
    }
    let behind_near = _mm256_sub_ps(depth, _mm256_set1_ps(halves.near));
    (far.skip[4], far.inside[4]) = (above(behind_near, guard), above(behind_near, wide));
    if let Some(limit) = halves.far {
        let before_far = _mm256_sub_ps(_mm256_set1_ps(limit), depth);
        (far.skip[5], far.inside[5]) = (above(before_far, guard), above(before_far, wide));
    }
    far
}
