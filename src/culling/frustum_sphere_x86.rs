//! Sphere kernels for x86-64: AVX2, 8 spheres at once. Explicit intrinsics, in the
//! operations and the order of `frustum_sphere`, their twins.

use super::frustum_planes::{FramePlanes, GUARD, PlaneMasks, Work};
use super::frustum_sphere::SphereBlock;
use super::frustum_x86::has_avx2;
use std::arch::x86_64::*;

/// See `frustum_sphere::block`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn block_avx2(frame: &FramePlanes, spheres: &SphereBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe { block_256(frame, spheres, wanted, want_inside, out) }
}

/// See `frustum_sphere::flat`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn flat_avx2(frame: &FramePlanes, spheres: &[SphereBlock], live: &[u8], outside: &mut [u8]) -> Work {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe { flat_256(frame, spheres, live, outside) }
}

/// Middles relative to the eye, and what their distances are compared with.
#[target_feature(enable = "avx2")]
#[inline]
fn relative_256(frame: &FramePlanes, spheres: &SphereBlock) -> ([__m256; 3], __m256) {
    let positive = _mm256_castsi256_ps(_mm256_set1_epi32(0x7fff_ffff));
    let mut a = [_mm256_setzero_ps(); 3];
    let mut size = [_mm256_setzero_ps(); 3];
    for axis in 0..3 {
        // SAFETY: a row of 8 f32 is 32 bytes, and rows are 32-byte aligned in the 64-byte aligned block.
        let centre = unsafe { _mm256_load_ps(spheres.centre[axis].as_ptr()) };
        a[axis] = _mm256_sub_ps(centre, _mm256_set1_ps(frame.eye[axis]));
        size[axis] = _mm256_and_ps(a[axis], positive);
    }
    // SAFETY: as above.
    let radius = unsafe { _mm256_load_ps(spheres.radius_m.as_ptr()) };
    let total = _mm256_add_ps(_mm256_add_ps(size[0], size[1]), size[2]);
    (a, _mm256_add_ps(_mm256_mul_ps(total, _mm256_set1_ps(GUARD)), radius))
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn value_256(normal: &[f32; 3], a: &[__m256; 3], d: f32) -> __m256 {
    let [nx, ny, nz] = normal.map(|n| _mm256_set1_ps(n));
    let s = _mm256_fmadd_ps(ny, a[1], _mm256_fmadd_ps(nx, a[0], _mm256_set1_ps(d)));
    _mm256_fmadd_ps(nz, a[2], s)
}

#[target_feature(enable = "avx2,fma")]
fn block_256(frame: &FramePlanes, spheres: &SphereBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
    let (a, bound) = relative_256(frame, spheres);
    let below = _mm256_xor_ps(bound, _mm256_set1_ps(-0.0));
    let mut wanted = wanted & frame.all();
    while wanted != 0 {
        let k = wanted.trailing_zeros() as usize;
        wanted &= wanted - 1;
        let plane = &frame.planes[k];
        let s = value_256(&plane.normal, &a, plane.d_out);
        out.outside[k] = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(s, below)) as u8;
        if want_inside {
            let s = value_256(&plane.normal, &a, plane.d_in);
            out.inside[k] = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(s, bound)) as u8;
        }
    }
}

#[target_feature(enable = "avx2,fma,popcnt")]
fn flat_256(frame: &FramePlanes, spheres: &[SphereBlock], live: &[u8], outside: &mut [u8]) -> Work {
    let mut work = Work::default();
    for ((spheres, live), out) in spheres.iter().zip(live).zip(outside) {
        let (a, bound) = relative_256(frame, spheres);
        let below = _mm256_xor_ps(bound, _mm256_set1_ps(-0.0));
        let mut left = u32::from(live & !*out);
        work.lanes += u64::from(left.count_ones());
        for plane in &frame.planes[..frame.count] {
            work.planes += u64::from(left.count_ones());
            let s = value_256(&plane.normal, &a, plane.d_out);
            left &= !(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(s, below)) as u32);
        }
        *out = !left as u8;
    }
    work
}
