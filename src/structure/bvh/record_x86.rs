//! AVX2 kernel that makes records: corners gathered, folded and rounded outward in f64,
//! three axes at once. The bits are those of [`super::record::make`].

use super::record::Record;
use crate::math::DVec3;
use crate::scene::Scene;
use std::arch::x86_64::*;

/// See `record::make`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn make(scene: &Scene, first: u32, out: &mut [Record]) {
    assert!(is_x86_feature_detected!("avx2"));
    let triangles = &scene.triangles[first as usize..][..out.len()];
    let materials = &scene.material_id[first as usize..][..out.len()];
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { make_256(&scene.positions, triangles, materials, scene.origin, first, out) }
}

#[target_feature(enable = "avx2")]
#[inline]
fn load(p: &DVec3) -> __m256d {
    let three = _mm256_setr_epi64x(-1, -1, -1, 0);
    // SAFETY: three f64, the fourth lane is not read.
    unsafe { _mm256_maskload_pd(std::ptr::from_ref(p).cast(), three) }
}

#[target_feature(enable = "avx2")]
fn make_256(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    materials: &[u32],
    origin: DVec3,
    first: u32,
    out: &mut [Record],
) {
    let sign = _mm256_set1_pd(-0.0);
    let origin = load(&origin);
    let minus_origin = _mm256_xor_pd(origin, sign);
    for (i, ((triangle, material), out)) in triangles.iter().zip(materials).zip(out).enumerate() {
        let [a, b, c] = triangle.map(|v| load(&positions[v as usize]));
        let lo = _mm256_min_pd(_mm256_min_pd(a, b), c);
        let hi = _mm256_max_pd(_mm256_max_pd(a, b), c);
        let below = round_up(_mm256_xor_pd(lo, sign), minus_origin);
        let above = round_up(hi, origin);
        let below = _mm_insert_epi32::<3>(below, (first + i as u32) as i32);
        let above = _mm_insert_epi32::<3>(above, *material as i32);
        // SAFETY: a record is 8 words, 32-byte aligned.
        unsafe { _mm256_store_si256(out.0.as_mut_ptr().cast(), _mm256_set_m128i(above, below)) };
    }
}

/// `p - origin` rounded towards plus infinity to f32; see `math::round_down` for the
/// error term that decides ties. Zeros come out positive.
#[target_feature(enable = "avx2")]
#[inline]
fn round_up(p: __m256d, origin: __m256d) -> __m128i {
    let zero = _mm_setzero_ps();
    let d = _mm256_sub_pd(p, origin);
    let origin_virtual = _mm256_sub_pd(p, d);
    let error =
        _mm256_add_pd(_mm256_sub_pd(p, _mm256_add_pd(d, origin_virtual)), _mm256_sub_pd(origin_virtual, origin));
    // The negative zero would step to the wrong side.
    let r = _mm_add_ps(_mm256_cvtpd_ps(d), zero);
    let back = _mm256_cvtps_pd(r);
    let tie =
        _mm256_and_pd(_mm256_cmp_pd::<_CMP_EQ_OQ>(back, d), _mm256_cmp_pd::<_CMP_LE_OQ>(error, _mm256_setzero_pd()));
    let keep = _mm256_castpd_ps(_mm256_or_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(back, d), tie));
    // The low half of each 64-bit mask.
    let keep = _mm_shuffle_ps::<0b10_00_10_00>(_mm256_castps256_ps128(keep), _mm256_extractf128_ps::<1>(keep));
    let bits = _mm_castps_si128(r);
    // Away from zero for positive numbers, towards it for negative ones.
    let step = _mm_or_si128(_mm_srai_epi32::<31>(bits), _mm_set1_epi32(1));
    let next = _mm_add_epi32(bits, _mm_andnot_si128(_mm_castps_si128(keep), step));
    _mm_castps_si128(_mm_add_ps(_mm_castsi128_ps(next), zero))
}
