//! AVX2 kernels of `sides`: three axes at once. Operations and bits are those of the twins.

use super::bins::{BINS_MAX, Bins, Domain, Split, stride};
use super::bins_x86::{bare, has_avx2, load, load_record, store_record};
use super::record::{Record, Span};
use std::arch::x86_64::*;

/// See `sides::sides`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn sides(from: &Bins, split: &Split, bins: usize) -> [Span; 2] {
    assert!(has_avx2());
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { sides_256(from, split, bins) }
}

/// See `sides::below`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn below(
    from: &Bins,
    domain: &Domain,
    bins: usize,
    split: &Split,
    bounds: &[Span; 2],
    bins_below: usize,
) -> [Domain; 2] {
    assert!(has_avx2() && bins <= BINS_MAX);
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { below_256(from, domain, bins, split, bounds, bins_below) }
}

#[target_feature(enable = "avx2")]
fn sides_256(from: &Bins, split: &Split, bins: usize) -> [Span; 2] {
    let spans = &from.spans[split.axis * stride(bins)..][..bins];
    let (left, right) = spans.split_at(split.plane);
    [union(left), union(right)]
}

#[target_feature(enable = "avx2")]
#[inline]
fn union(spans: &[Span]) -> Span {
    let mut all = load_record(&Record::EMPTY);
    for s in spans {
        all = _mm256_max_ps(all, load_record(s));
    }
    let mut out = Record::EMPTY;
    store_record(&mut out, bare(all));
    out
}

/// Bit per bin of an axis that holds any.
#[target_feature(enable = "avx2")]
#[inline]
fn used(counts: &[u32]) -> u32 {
    let mut used = 0;
    for (group, counts) in counts.as_chunks::<8>().0.iter().enumerate() {
        // SAFETY: eight counts.
        let counts = unsafe { _mm256_loadu_si256(counts.as_ptr().cast()) };
        let none = _mm256_cmpeq_epi32(counts, _mm256_setzero_si256());
        let none = _mm256_movemask_ps(_mm256_castsi256_ps(none)) as u32;
        used |= (!none & 0xff) << (8 * group);
    }
    used
}

#[target_feature(enable = "avx2")]
fn below_256(
    from: &Bins,
    domain: &Domain,
    bins: usize,
    split: &Split,
    bounds: &[Span; 2],
    bins_below: usize,
) -> [Domain; 2] {
    let stride = stride(bins);
    let (lo, hi) = (load(&domain.lo), load(&domain.hi));
    let all = _mm_set1_ps(bins as f32);
    let width = _mm_div_ps(_mm_sub_ps(hi, lo), all);
    let three = _mm_castsi128_ps(_mm_setr_epi32(-1, -1, -1, 0));
    let used = [0, 1, 2].map(|axis| used(&from.counts[axis * stride..][..stride]));
    let (sign, minus_two) = (_mm_set1_ps(-0.0), _mm_set1_ps(-2.0));
    let left_bins = (1u32 << split.plane) - 1;
    let mut out = [Domain { lo: [0.0; 4], hi: [0.0; 4], scale: [0.0; 4] }; 2];
    for ((out, bounds), side_bins) in out.iter_mut().zip(bounds).zip([left_bins, !left_bins]) {
        let mut used = used;
        used[split.axis] &= side_bins;
        let first = |m: u32| m.trailing_zeros() as i32;
        let end = |m: u32| 32 - m.leading_zeros() as i32;
        let firsts = _mm_cvtepi32_ps(_mm_setr_epi32(first(used[0]), first(used[1]), first(used[2]), 0));
        let ends = _mm_cvtepi32_ps(_mm_setr_epi32(end(used[0]), end(used[1]), end(used[2]), 0));
        let from = _mm_add_ps(lo, _mm_mul_ps(firsts, width));
        let to = _mm_blendv_ps(_mm_add_ps(lo, _mm_mul_ps(ends, width)), hi, _mm_cmpeq_ps(ends, all));
        let span = load_record(bounds);
        let low = _mm_max_ps(_mm_mul_ps(minus_two, _mm256_castps256_ps128(span)), from);
        let high = _mm_max_ps(_mm_mul_ps(minus_two, _mm256_extractf128_ps::<1>(span)), _mm_xor_ps(to, sign));
        let high = _mm_xor_ps(high, sign);
        let scale = _mm_div_ps(_mm_set1_ps(bins_below as f32), _mm_sub_ps(high, low));
        // Inverted by rounding, empty, or too thin to divide.
        let positive = _mm_cmpgt_ps(scale, _mm_setzero_ps());
        let finite = _mm_cmplt_ps(scale, _mm_set1_ps(f32::INFINITY));
        let scale = _mm_and_ps(scale, _mm_and_ps(positive, finite));
        for (out, v) in [(&mut out.lo, low), (&mut out.hi, high), (&mut out.scale, scale)] {
            // SAFETY: four f32.
            unsafe { _mm_storeu_ps(out.as_mut_ptr(), _mm_and_ps(v, three)) };
        }
    }
    out
}
