//! Sphere kernel for x86-64: AVX2, 8 spheres at once. Explicit intrinsics, in the
//! operations and the order of `frustum_sphere::block`, its twin.

use super::frustum_planes::{FramePlanes, GUARD, PlaneMasks};
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

#[target_feature(enable = "avx2,fma")]
fn block_256(frame: &FramePlanes, spheres: &SphereBlock, wanted: u8, want_inside: bool, out: &mut PlaneMasks) {
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
    let bound = _mm256_add_ps(_mm256_mul_ps(total, _mm256_set1_ps(GUARD)), radius);
    let below = _mm256_xor_ps(bound, _mm256_set1_ps(-0.0));
    let mut wanted = wanted & frame.all();
    while wanted != 0 {
        let k = wanted.trailing_zeros() as usize;
        wanted &= wanted - 1;
        let plane = &frame.planes[k];
        let [nx, ny, nz] = plane.normal.map(|n| _mm256_set1_ps(n));
        let value = |d: f32| {
            let s = _mm256_fmadd_ps(ny, a[1], _mm256_fmadd_ps(nx, a[0], _mm256_set1_ps(d)));
            _mm256_fmadd_ps(nz, a[2], s)
        };
        out.outside[k] = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(value(plane.d_out), below)) as u8;
        if want_inside {
            out.inside[k] = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(value(plane.d_in), bound)) as u8;
        }
    }
}
