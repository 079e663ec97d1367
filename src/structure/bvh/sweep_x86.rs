//! AVX2 kernel of the exact sweep for up to 16 records: nothing is sorted; every record
//! counts those that come before it, on each axis, and that is its place. Bits are those
//! of `sweep::Sweep`.

use super::best_x86::{edges, half_areas, transposed};
use super::bins_x86::{bare, centre2, has_avx2, load_record, store_record};
use super::record::{Record, Span};
use super::sweep::Cut;
use std::arch::x86_64::*;

/// Most records.
pub const MOST: usize = 16;

/// See `Sweep::cut`.
///
/// # Panics
/// If the processor lacks AVX2, if there are more than [`MOST`] records or if `out` has no
/// room for them.
pub fn cut(records: &[Record], out: &mut [Record]) -> Option<Cut> {
    assert!(has_avx2() && records.len() <= MOST && out.len() >= records.len());
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { if records.len() <= 8 { cut_256::<1>(records, out) } else { cut_256::<2>(records, out) } }
}

/// `MOST - 1 - j` lanes on from the start, lane `i` is all ones iff `i > j`.
static AFTER: [i32; 2 * MOST] = {
    let mut after = [0; 2 * MOST];
    let mut i = MOST;
    while i < 2 * MOST {
        after[i] = -1;
        i += 1;
    }
    after
};

/// Doubled centroids as whole numbers that compare as `f32::total_cmp` does, by axis; past
/// the last record nothing is larger.
#[target_feature(enable = "avx2")]
#[inline]
fn keys<const GROUPS: usize>(records: &[Record]) -> [[i32; MOST]; 3] {
    let mut rows = [[f32::from_bits(i32::MAX as u32); 4]; MOST];
    for (row, r) in rows.iter_mut().zip(records) {
        let bits = _mm_castps_si128(centre2(bare(load_record(r))));
        let key = _mm_xor_si128(bits, _mm_srli_epi32::<1>(_mm_srai_epi32::<31>(bits)));
        // One less than a key must be less, too: no difference of numbers has the bits of
        // the least of all.
        let key = _mm_max_epi32(key, _mm_set1_epi32(i32::MIN + 1));
        // SAFETY: four words.
        unsafe { _mm_storeu_si128(row.as_mut_ptr().cast(), key) };
    }
    let mut keys = [[i32::MAX; MOST]; 3];
    for group in 0..GROUPS {
        let rows: &[[f32; 4]; 8] = rows[8 * group..][..8].try_into().expect("eight rows");
        for (keys, v) in keys.iter_mut().zip(transposed(rows)) {
            // SAFETY: eight words.
            unsafe { _mm256_storeu_ps(keys[8 * group..][..8].as_mut_ptr().cast(), v) };
        }
    }
    keys
}

/// The records in the order of one axis, ties by place.
#[target_feature(enable = "avx2")]
#[inline]
fn order<const GROUPS: usize>(keys: &[i32; MOST], n: usize) -> [u8; MOST] {
    let mut own = [_mm256_setzero_si256(); GROUPS];
    let mut before = [_mm256_setzero_si256(); GROUPS];
    for (group, own) in own.iter_mut().enumerate() {
        // SAFETY: eight words.
        *own = unsafe { _mm256_loadu_si256(keys[8 * group..][..8].as_ptr().cast()) };
    }
    for (j, key) in keys.iter().enumerate().take(n) {
        let after = &AFTER[MOST - 1 - j..][..MOST];
        let key = _mm256_set1_epi32(*key);
        for group in 0..GROUPS {
            // SAFETY: eight words.
            let after = unsafe { _mm256_loadu_si256(after[8 * group..][..8].as_ptr().cast()) };
            // Later ones count an equal key, which is more than one less.
            let counts = _mm256_cmpgt_epi32(own[group], _mm256_add_epi32(key, after));
            before[group] = _mm256_sub_epi32(before[group], counts);
        }
    }
    let mut places = [0u32; MOST];
    for (group, before) in before.iter().enumerate() {
        // SAFETY: eight words.
        unsafe { _mm256_storeu_si256(places[8 * group..][..8].as_mut_ptr().cast(), *before) };
    }
    let mut order = [0; MOST];
    for (i, place) in places.iter().enumerate().take(n) {
        order[*place as usize % MOST] = i as u8;
    }
    order
}

#[target_feature(enable = "avx2")]
fn cut_256<const GROUPS: usize>(records: &[Record], out: &mut [Record]) -> Option<Cut> {
    let n = records.len();
    let infinite = _mm256_set1_ps(f32::INFINITY);
    let keys = keys::<GROUPS>(records);
    let mut orders = [[0; MOST]; 3];
    let mut costs = [[f32::INFINITY; MOST]; 3];
    let mut least = infinite;
    for axis in 0..3 {
        orders[axis] = order::<GROUPS>(&keys[axis], n);
        let (mut left, mut right) = ([[0f32; 4]; MOST], [[0f32; 4]; MOST]);
        let at = |i: usize| bare(load_record(&records[usize::from(orders[axis][i])]));
        let (mut before, mut after) = (load_record(&Record::EMPTY), load_record(&Record::EMPTY));
        for i in 1..n {
            before = _mm256_max_ps(before, at(i - 1));
            after = _mm256_max_ps(after, at(n - i));
            // SAFETY: four f32 each.
            unsafe {
                _mm_storeu_ps(left[i].as_mut_ptr(), edges(before));
                _mm_storeu_ps(right[n - i].as_mut_ptr(), edges(after));
            }
        }
        for group in 0..GROUPS {
            let lane = _mm256_add_ps(
                _mm256_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
                _mm256_set1_ps(8.0 * group as f32),
            );
            let total = _mm256_set1_ps(n as f32);
            let rows = |e: &[[f32; 4]]| half_areas(e[8 * group..][..8].try_into().expect("eight rows"));
            let cost = _mm256_add_ps(
                _mm256_mul_ps(rows(&left), lane),
                _mm256_mul_ps(rows(&right), _mm256_sub_ps(total, lane)),
            );
            let one_sided = _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_EQ_OQ>(lane, _mm256_setzero_ps()),
                _mm256_cmp_ps::<_CMP_GE_OQ>(lane, total),
            );
            let cost = _mm256_blendv_ps(cost, infinite, one_sided);
            // Not a number is never the least.
            least = _mm256_min_ps(cost, least);
            // SAFETY: eight f32.
            unsafe { _mm256_storeu_ps(costs[axis][8 * group..][..8].as_mut_ptr(), cost) };
        }
    }
    let low = _mm_min_ps(_mm256_castps256_ps128(least), _mm256_extractf128_ps::<1>(least));
    let low = _mm_min_ps(low, _mm_movehl_ps(low, low));
    let cost = _mm_cvtss_f32(_mm_min_ss(low, _mm_shuffle_ps::<1>(low, low)));
    if cost == f32::INFINITY {
        return None;
    }
    let wanted = _mm256_set1_ps(cost);
    for (axis, order) in orders.iter().enumerate() {
        for group in 0..GROUPS {
            // SAFETY: eight f32.
            let costs = unsafe { _mm256_loadu_ps(costs[axis][8 * group..][..8].as_ptr()) };
            let equal = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(costs, wanted));
            if equal != 0 {
                let left = 8 * group + equal.trailing_zeros() as usize;
                let bounds = arrange(records, order, left, out);
                return Some(Cut { axis, left, cost, bounds });
            }
        }
    }
    unreachable!("one of the costs is the least")
}

/// Writes the records in `order`; the boxes of the first `left` and of the others.
#[target_feature(enable = "avx2")]
#[inline]
fn arrange(records: &[Record], order: &[u8; MOST], left: usize, out: &mut [Record]) -> [Span; 2] {
    let n = records.len();
    for (out, i) in out.iter_mut().zip(&order[..n]) {
        store_record(out, load_record(&records[usize::from(*i)]));
    }
    let mut bounds = [Record::EMPTY; 2];
    let mut span = load_record(&Record::EMPTY);
    for r in &out[..left] {
        span = _mm256_max_ps(span, bare(load_record(r)));
    }
    store_record(&mut bounds[0], span);
    let mut span = load_record(&Record::EMPTY);
    // From the end, as the sweep went.
    for r in out[left..n].iter().rev() {
        span = _mm256_max_ps(span, bare(load_record(r)));
    }
    store_record(&mut bounds[1], span);
    bounds
}
