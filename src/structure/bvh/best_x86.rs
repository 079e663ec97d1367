//! AVX2 kernel that finds the best plane of a node: boxes are swept from both ends, then
//! eight planes are judged at once. Operations and bits are those of `Bins::best`.

use super::bins::{BINS_MAX, Bins, Split, stride};
use super::bins_x86::{bare, has_avx2, load, load_record};
use super::record::{Record, Span};
use std::arch::x86_64::*;

/// See `Bins::best`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn best(all: &Bins, bins: usize) -> Option<Split> {
    assert!(has_avx2() && bins <= BINS_MAX);
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { best_256(all, bins) }
}

/// Edge lengths of a box.
#[target_feature(enable = "avx2")]
#[inline]
pub fn edges(span: __m256) -> __m128 {
    _mm_add_ps(_mm256_extractf128_ps::<1>(span), _mm256_castps256_ps128(span))
}

/// Lanes 0 to 2 of eight rows.
#[target_feature(enable = "avx2")]
#[inline]
pub fn transposed(e: &[[f32; 4]; 8]) -> [__m256; 3] {
    let pair = |i: usize| _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(load(&e[i])), load(&e[i + 4]));
    let (a, b, c, d) = (pair(0), pair(1), pair(2), pair(3));
    let (xy0, xy1) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
    let (z0, z1) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
    let x = _mm256_shuffle_ps::<0b01_00_01_00>(xy0, xy1);
    let y = _mm256_shuffle_ps::<0b11_10_11_10>(xy0, xy1);
    [x, y, _mm256_shuffle_ps::<0b01_00_01_00>(z0, z1)]
}

/// Half areas of eight boxes by their edge lengths.
#[target_feature(enable = "avx2")]
#[inline]
pub fn half_areas(e: &[[f32; 4]; 8]) -> __m256 {
    let [x, y, z] = transposed(e);
    let xy_yz = _mm256_add_ps(_mm256_mul_ps(x, y), _mm256_mul_ps(y, z));
    _mm256_add_ps(xy_yz, _mm256_mul_ps(z, x))
}

/// The least of eight numbers.
#[target_feature(enable = "avx2")]
#[inline]
pub fn least_of(all: __m256) -> f32 {
    let low = _mm_min_ps(_mm256_castps256_ps128(all), _mm256_extractf128_ps::<1>(all));
    let low = _mm_min_ps(low, _mm_movehl_ps(low, low));
    _mm_cvtss_f32(_mm_min_ss(low, _mm_shuffle_ps::<1>(low, low)))
}

/// Sums of all counts before each bin, and of all, in every lane; bins past the last are empty.
#[target_feature(enable = "avx2")]
#[inline]
fn sums(counts: &[u32], before: &mut [u32]) -> __m256i {
    let mut total = _mm256_setzero_si256();
    for (out, counts) in before.as_chunks_mut::<8>().0.iter_mut().zip(counts.as_chunks::<8>().0) {
        // SAFETY: eight counts.
        let counts = unsafe { _mm256_loadu_si256(counts.as_ptr().cast()) };
        let pairs = _mm256_add_epi32(counts, _mm256_slli_si256::<4>(counts));
        let halves = _mm256_add_epi32(pairs, _mm256_slli_si256::<8>(pairs));
        // The sum of the lower half goes to all of the upper one.
        let low = _mm256_shuffle_epi32::<0xff>(_mm256_permute2x128_si256::<0x08>(halves, halves));
        let sums = _mm256_add_epi32(_mm256_add_epi32(halves, low), total);
        // SAFETY: eight counts.
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm256_sub_epi32(sums, counts)) };
        total = _mm256_permutevar8x32_epi32(sums, _mm256_set1_epi32(7));
    }
    total
}

#[target_feature(enable = "avx2")]
fn best_256(all: &Bins, bins: usize) -> Option<Split> {
    let infinite = _mm256_set1_ps(f32::INFINITY);
    let stride = stride(bins);
    let mut costs = [f32::INFINITY; 3 * BINS_MAX];
    let mut least = infinite;
    let (mut left, mut right) = ([[0f32; 4]; BINS_MAX], [[0f32; 4]; BINS_MAX]);
    let mut before = [0u32; 3 * BINS_MAX];
    for axis in 0..3 {
        let spans: &[Span] = &all.spans[axis * stride..][..bins];
        let mut span = load_record(&Record::EMPTY);
        for (out, s) in right.iter_mut().zip(spans).skip(1).rev() {
            span = _mm256_max_ps(span, bare(load_record(s)));
            // SAFETY: four f32.
            unsafe { _mm_storeu_ps(out.as_mut_ptr(), edges(span)) };
        }
        let mut span = load_record(&Record::EMPTY);
        for (i, s) in spans[..bins - 1].iter().enumerate() {
            span = _mm256_max_ps(span, bare(load_record(s)));
            // SAFETY: four f32.
            unsafe { _mm_storeu_ps(left[i + 1].as_mut_ptr(), edges(span)) };
        }
        let counts = &all.counts[axis * stride..][..stride];
        let before = &mut before[axis * stride..][..stride];
        let total = sums(counts, before);
        for group in (0..stride).step_by(8) {
            // SAFETY: eight counts of an array whose length is a multiple of eight.
            let n_left = unsafe { _mm256_loadu_si256(before[group..group + 8].as_ptr().cast()) };
            let n_right = _mm256_sub_epi32(total, n_left);
            let zero = _mm256_setzero_si256();
            let one_sided = _mm256_or_si256(_mm256_cmpeq_epi32(n_left, zero), _mm256_cmpeq_epi32(n_right, zero));
            let rows = |e: &[[f32; 4]]| half_areas(e[group..group + 8].try_into().expect("eight rows"));
            let cost = _mm256_add_ps(
                _mm256_mul_ps(rows(&left), _mm256_cvtepi32_ps(n_left)),
                _mm256_mul_ps(rows(&right), _mm256_cvtepi32_ps(n_right)),
            );
            let cost = _mm256_blendv_ps(cost, infinite, _mm256_castsi256_ps(one_sided));
            // Not a number is never the least.
            least = _mm256_min_ps(cost, least);
            // SAFETY: eight f32 of an array whose length is a multiple of eight.
            unsafe { _mm256_storeu_ps(costs[axis * stride + group..][..8].as_mut_ptr(), cost) };
        }
    }
    let cost = least_of(least);
    if cost == f32::INFINITY {
        return None;
    }
    let wanted = _mm256_set1_ps(cost);
    for group in (0..3 * stride).step_by(8) {
        // SAFETY: eight f32 of an array whose length is a multiple of eight.
        let costs = unsafe { _mm256_loadu_ps(costs[group..group + 8].as_ptr()) };
        let equal = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(costs, wanted));
        if equal != 0 {
            let i = group + equal.trailing_zeros() as usize;
            return Some(Split { axis: i / stride, plane: i % stride, left: before[i], cost });
        }
    }
    unreachable!("one of the costs is the least")
}
