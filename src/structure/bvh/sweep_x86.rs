//! AVX2 kernel of the exact sweep for up to 8 records: nothing is sorted; every record
//! counts those that come before it, on each axis, and that is its place. Fewer records
//! are filled up with empty ones behind them, so that nothing branches on their number.
//! Bits are those of `sweep::Sweep`.

use super::best_x86::{edges, half_areas, least_of, transposed};
use super::bins_x86::{bare, centre2, has_avx2, load_record, store_record};
use super::record::{Record, Span};
use super::sweep::Cut;
use std::arch::x86_64::*;

/// Most records.
pub const MOST: usize = 8;

/// See `Sweep::cut`.
///
/// # Panics
/// If the processor lacks AVX2, if there are more than [`MOST`] records or if `out` has no
/// room for them.
pub fn cut(records: &[Record], out: &mut [Record]) -> Option<Cut> {
    assert!(has_avx2() && records.len() <= MOST && out.len() >= records.len());
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { cut_256(records, out) }
}

/// Boxes, filled up, and the doubled centroids by axis, as whole numbers that compare as
/// `f32::total_cmp` does; nothing is larger than those that fill up.
#[target_feature(enable = "avx2")]
#[inline]
fn boxes(records: &[Record]) -> ([Span; MOST], [__m256i; 3]) {
    let mut boxes = [Record::EMPTY; MOST];
    let mut rows = [[f32::from_bits(i32::MAX as u32); 4]; MOST];
    for ((row, out), r) in rows.iter_mut().zip(&mut boxes).zip(records) {
        let r = bare(load_record(r));
        store_record(out, r);
        let bits = _mm_castps_si128(centre2(r));
        let key = _mm_xor_si128(bits, _mm_srli_epi32::<1>(_mm_srai_epi32::<31>(bits)));
        // One less than a key must be less, too: no difference of numbers has the bits of
        // the least of all.
        let key = _mm_max_epi32(key, _mm_set1_epi32(i32::MIN + 1));
        // SAFETY: four words.
        unsafe { _mm_storeu_si128(row.as_mut_ptr().cast(), key) };
    }
    let [x, y, z] = transposed(&rows);
    (boxes, [_mm256_castps_si256(x), _mm256_castps_si256(y), _mm256_castps_si256(z)])
}

/// The place of each record in the order of one axis, ties by number: a byte a record. Not
/// by way of memory, where a word waits for the whole register to be written.
#[target_feature(enable = "avx2")]
#[inline]
fn places(keys: __m256i) -> u64 {
    let lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let mut before = _mm256_setzero_si256();
    for j in 0..MOST as i32 {
        let key = _mm256_permutevar8x32_epi32(keys, _mm256_set1_epi32(j));
        // Later ones count an equal key, which is more than one less.
        let after = _mm256_cmpgt_epi32(lane, _mm256_set1_epi32(j));
        before = _mm256_sub_epi32(before, _mm256_cmpgt_epi32(keys, _mm256_add_epi32(key, after)));
    }
    let half = _mm_packs_epi32(_mm256_castsi256_si128(before), _mm256_extracti128_si256::<1>(before));
    _mm_cvtsi128_si64(_mm_packus_epi16(half, half)) as u64
}

fn place(places: u64, i: usize) -> usize {
    (places >> (8 * i)) as usize % MOST
}

/// Costs of the planes before each place in the order of one axis; none before the first,
/// and none behind all records.
#[target_feature(enable = "avx2")]
#[inline]
fn costs(boxes: &[Span; MOST], places: u64, n: usize) -> __m256 {
    let mut sorted = [Record::EMPTY; MOST];
    for (i, r) in boxes.iter().enumerate() {
        store_record(&mut sorted[place(places, i)], load_record(r));
    }
    let (mut left, mut right) = ([[0f32; 4]; MOST], [[0f32; 4]; MOST]);
    let (mut lower, mut upper) = (load_record(&Record::EMPTY), load_record(&Record::EMPTY));
    for i in 1..MOST {
        lower = _mm256_max_ps(lower, load_record(&sorted[i - 1]));
        upper = _mm256_max_ps(upper, load_record(&sorted[MOST - i]));
        // SAFETY: four f32 each.
        unsafe {
            _mm_storeu_ps(left[i].as_mut_ptr(), edges(lower));
            _mm_storeu_ps(right[MOST - i].as_mut_ptr(), edges(upper));
        }
    }
    let before = _mm256_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
    let total = _mm256_set1_ps(n as f32);
    let cost = _mm256_add_ps(
        _mm256_mul_ps(half_areas(&left), before),
        _mm256_mul_ps(half_areas(&right), _mm256_sub_ps(total, before)),
    );
    let one_sided = _mm256_or_ps(
        _mm256_cmp_ps::<_CMP_EQ_OQ>(before, _mm256_setzero_ps()),
        _mm256_cmp_ps::<_CMP_GE_OQ>(before, total),
    );
    _mm256_blendv_ps(cost, _mm256_set1_ps(f32::INFINITY), one_sided)
}

#[target_feature(enable = "avx2")]
fn cut_256(records: &[Record], out: &mut [Record]) -> Option<Cut> {
    let (boxes, keys) = boxes(records);
    let places = [places(keys[0]), places(keys[1]), places(keys[2])];
    let n = records.len();
    let costs = [costs(&boxes, places[0], n), costs(&boxes, places[1], n), costs(&boxes, places[2], n)];
    let mut least = _mm256_set1_ps(f32::INFINITY);
    for cost in costs {
        // Not a number is never the least.
        least = _mm256_min_ps(cost, least);
    }
    let cost = least_of(least);
    if cost == f32::INFINITY {
        return None;
    }
    let wanted = _mm256_set1_ps(cost);
    for (axis, (costs, places)) in costs.iter().zip(&places).enumerate() {
        let equal = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(*costs, wanted));
        if equal != 0 {
            let left = equal.trailing_zeros() as usize;
            let bounds = arrange(records, *places, left, out);
            return Some(Cut { axis, left, cost, bounds });
        }
    }
    unreachable!("one of the costs is the least")
}

/// Writes the records to their places; the boxes of the first `left` and of the others.
#[target_feature(enable = "avx2")]
#[inline]
fn arrange(records: &[Record], places: u64, left: usize, out: &mut [Record]) -> [Span; 2] {
    let out = &mut out[..records.len()];
    for (i, r) in records.iter().enumerate() {
        store_record(&mut out[place(places, i)], load_record(r));
    }
    let mut bounds = [Record::EMPTY; 2];
    let mut span = load_record(&Record::EMPTY);
    for r in &out[..left] {
        span = _mm256_max_ps(span, bare(load_record(r)));
    }
    store_record(&mut bounds[0], span);
    let mut span = load_record(&Record::EMPTY);
    // From the end, as the sweep went.
    for r in out[left..].iter().rev() {
        span = _mm256_max_ps(span, bare(load_record(r)));
    }
    store_record(&mut bounds[1], span);
    bounds
}
