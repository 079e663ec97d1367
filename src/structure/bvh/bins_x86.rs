//! AVX2 kernels of `bins`: a record is one register, a box grows by one `max`, and the
//! side of a record selects addresses instead of branches, which would be guessed wrong
//! half of the time. A bin is counted in a word of its box: a record costs one store a
//! bin, not two. The operations are those of the twins, and so are the bits.

use super::bins::{BINS_MAX, Bins, Domain, Split, stride};
use super::record::{Record, Span};
use std::arch::x86_64::*;

pub fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

/// See `bins::fill`; `spare` is overwritten.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn fill(records: &[Record], domain: &Domain, bins: usize, out: &mut Bins, spare: &mut Bins) {
    assert!(has_avx2() && bins <= BINS_MAX);
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { fill_256(records, domain, bins, out, spare) }
}

/// See `bins::deal`; `spare` is overwritten.
///
/// # Panics
/// If the processor lacks AVX2, or if the sides are not as large as the split makes them.
pub fn deal(
    records: &[Record],
    sides: [&mut [Record]; 2],
    domain: &Domain,
    split: &Split,
    below: &[Domain; 2],
    bins: usize,
    out: [&mut Bins; 2],
    spare: &mut [Bins; 2],
) {
    assert!(has_avx2() && bins <= BINS_MAX && split.axis < 3);
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { deal_256(records, sides, domain, split, below, bins, out, spare) }
}

/// See `bins::part`.
///
/// # Panics
/// If the processor lacks AVX2, or if the sides are not as large as the split makes them.
pub fn part(records: &[Record], sides: [&mut [Record]; 2], domain: &Domain, split: &Split) {
    assert!(has_avx2() && split.axis < 3);
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { part_256(records, sides, domain, split) }
}

/// See `bins::extent`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn extent(records: &[Record]) -> (Span, [f32; 3], [f32; 3]) {
    assert!(has_avx2());
    // SAFETY: the processor has the feature, as just asserted.
    unsafe { extent_256(records) }
}

#[target_feature(enable = "avx2")]
#[inline]
pub fn load(v: &[f32; 4]) -> __m128 {
    // SAFETY: four f32.
    unsafe { _mm_loadu_ps(v.as_ptr()) }
}

#[target_feature(enable = "avx2")]
#[inline]
pub fn load_record(r: &Record) -> __m256 {
    // SAFETY: a record is 8 f32, 32-byte aligned.
    unsafe { _mm256_load_ps(r.0.as_ptr()) }
}

#[target_feature(enable = "avx2")]
#[inline]
pub fn store_record(r: &mut Record, v: __m256) {
    // SAFETY: a record is 8 f32, 32-byte aligned.
    unsafe { _mm256_store_ps(r.0.as_mut_ptr(), v) }
}

/// The box alone. As numbers, the two words are subnormal, and arithmetic with those is slow.
#[target_feature(enable = "avx2")]
#[inline]
pub fn bare(r: __m256) -> __m256 {
    _mm256_blend_ps::<0b1000_1000>(r, _mm256_setzero_ps())
}

/// Doubled centroid in lanes 0 to 2.
#[target_feature(enable = "avx2")]
#[inline]
pub fn centre2(r: __m256) -> __m128 {
    _mm_sub_ps(_mm256_extractf128_ps::<1>(r), _mm256_castps256_ps128(r))
}

/// What maps a doubled centroid to a place among the bins of three axes.
#[derive(Clone, Copy)]
struct Grid {
    lo: __m128,
    scale: __m128,
}

/// Last bin, and where each axis begins.
#[derive(Clone, Copy)]
struct Rows {
    last: __m128,
    base: __m128i,
}

#[target_feature(enable = "avx2")]
#[inline]
fn grid(d: &Domain) -> Grid {
    Grid { lo: load(&d.lo), scale: load(&d.scale) }
}

#[target_feature(enable = "avx2")]
#[inline]
fn rows(bins: usize) -> Rows {
    let s = stride(bins) as i32;
    Rows { last: _mm_set1_ps((bins - 1) as f32), base: _mm_setr_epi32(0, s, 2 * s, 0) }
}

#[target_feature(enable = "avx2")]
#[inline]
fn place(centre2: __m128, g: &Grid) -> __m128 {
    _mm_mul_ps(_mm_sub_ps(centre2, g.lo), g.scale)
}

/// Adds the record to the bin of each axis; [`count`] or [`merge`] come after the last.
#[target_feature(enable = "avx2")]
#[inline]
fn add(into: &mut Bins, r: __m256, place: __m128, rows: &Rows) {
    // Not a number: `max` gives its second operand.
    let x = _mm_min_ps(_mm_max_ps(place, _mm_setzero_ps()), rows.last);
    let i = _mm_add_epi32(_mm_cvttps_epi32(x), rows.base);
    let xy = _mm_cvtsi128_si64(i) as u64;
    let z = _mm_extract_epi32::<2>(i) as u32 as usize;
    for i in [(xy as u32) as usize, (xy >> 32) as usize, z] {
        debug_assert!(i < 3 * BINS_MAX);
        // SAFETY: a bin is at most `bins - 1 < BINS_MAX` and an axis begins at most at
        // `2 * stride(bins) <= 2 * BINS_MAX`.
        unsafe {
            let span = into.spans.get_unchecked_mut(i);
            let old = load_record(span);
            let counted = _mm256_add_epi32(_mm256_castps_si256(old), _mm256_setr_epi32(0, 0, 0, 1, 0, 0, 0, 0));
            let grown = _mm256_max_ps(old, r);
            store_record(span, _mm256_blend_ps::<0b1000_1000>(grown, _mm256_castsi256_ps(counted)));
        }
    }
}

#[target_feature(enable = "avx2")]
fn fill_256(records: &[Record], domain: &Domain, bins: usize, out: &mut Bins, spare: &mut Bins) {
    let (grid, rows) = (grid(domain), rows(bins));
    out.clear(bins);
    spare.clear(bins);
    // Two sets in turn: neighbours fall into one bin, and each would wait for the last.
    let (pairs, rest) = records.as_chunks::<2>();
    for [a, b] in pairs {
        let (a, b) = (bare(load_record(a)), bare(load_record(b)));
        add(out, a, place(centre2(a), &grid), &rows);
        add(spare, b, place(centre2(b), &grid), &rows);
    }
    for r in rest {
        let r = bare(load_record(r));
        add(out, r, place(centre2(r), &grid), &rows);
    }
    merge(out, spare, bins);
}

/// Word of a box in which its bin is counted.
const COUNT: usize = 3;

/// Takes the counts out of the boxes, whose words then mean nothing.
#[target_feature(enable = "avx2")]
#[inline]
fn count(out: &mut Bins, bins: usize) {
    let used = 3 * stride(bins);
    for (count, span) in out.counts[..used].iter_mut().zip(&out.spans[..used]) {
        *count = span.0[COUNT].to_bits();
    }
}

/// [`count`] of two sets in one.
#[target_feature(enable = "avx2")]
fn merge(out: &mut Bins, other: &Bins, bins: usize) {
    for i in 0..3 * stride(bins) {
        out.counts[i] = out.spans[i].0[COUNT].to_bits() + other.spans[i].0[COUNT].to_bits();
        let grown = _mm256_max_ps(load_record(&out.spans[i]), load_record(&other.spans[i]));
        store_record(&mut out.spans[i], grown);
    }
}

/// The axis of a split alone, in every lane, and the side of its plane.
struct Plane {
    lane: __m128i,
    grid: Grid,
    at: __m128,
}

#[target_feature(enable = "avx2")]
#[inline]
fn plane(domain: &Domain, split: &Split) -> Plane {
    let axis = split.axis;
    Plane {
        lane: _mm_set1_epi32(axis as i32),
        grid: Grid { lo: _mm_set1_ps(domain.lo[axis]), scale: _mm_set1_ps(domain.scale[axis]) },
        at: _mm_set1_ps(split.plane as f32),
    }
}

/// All ones for a record that goes right.
#[target_feature(enable = "avx2")]
#[inline]
fn goes_right(centre2: __m128, plane: &Plane) -> __m128 {
    _mm_cmpge_ps(place(_mm_permutevar_ps(centre2, plane.lane), &plane.grid), plane.at)
}

/// Fewer records are binned into one set: clearing and merging another costs more.
const FEW: usize = 128;

/// Two slices that are filled from their beginnings.
struct Sides {
    start: [*mut Record; 2],
    size: [usize; 2],
    at: [usize; 2],
}

impl Sides {
    fn of(sides: [&mut [Record]; 2]) -> Sides {
        let [left, right] = sides;
        let size = [left.len(), right.len()];
        Sides { start: [left.as_mut_ptr(), right.as_mut_ptr()], size, at: [0; 2] }
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn push(&mut self, side: usize, r: __m256) {
        let at = self.at[side];
        assert!(at < self.size[side], "the sides are as large as counted");
        // SAFETY: inside the slice that was borrowed for as long as this lives, and aligned.
        unsafe { _mm256_store_ps(self.start[side].add(at).cast(), r) };
        self.at[side] = at + 1;
    }
}

#[target_feature(enable = "avx2")]
fn deal_256(
    records: &[Record],
    sides: [&mut [Record]; 2],
    domain: &Domain,
    split: &Split,
    below: &[Domain; 2],
    bins: usize,
    out: [&mut Bins; 2],
    spare: &mut [Bins; 2],
) {
    let (rows, plane) = (rows(bins), plane(domain, split));
    let [left, right] = [grid(&below[0]), grid(&below[1])];
    let [a, b] = out;
    let [c, d] = spare;
    // By turn and side: neighbours fall into one bin, and each would wait for the last.
    let mut sets = [[a, b], [c, d]];
    let turns = if records.len() >= FEW { 2 } else { 1 };
    sets[..turns].iter_mut().flatten().for_each(|s| s.clear(bins));
    let mut to = Sides::of(sides);
    let mut turn = 0;
    for r in records {
        let whole = load_record(r);
        let r = bare(whole);
        let c = centre2(r);
        let right_mask = goes_right(c, &plane);
        let side = (_mm_movemask_ps(right_mask) & 1) as usize;
        to.push(side, whole);
        let grid = Grid {
            lo: _mm_blendv_ps(left.lo, right.lo, right_mask),
            scale: _mm_blendv_ps(left.scale, right.scale, right_mask),
        };
        add(sets[turn][side], r, place(c, &grid), &rows);
        turn ^= turns - 1;
    }
    assert_eq!(to.at, to.size, "the sides are as large as counted");
    let [[a, b], [c, d]] = sets;
    if turns == 2 {
        merge(a, c, bins);
        merge(b, d, bins);
    } else {
        count(a, bins);
        count(b, bins);
    }
}

#[target_feature(enable = "avx2")]
fn part_256(records: &[Record], sides: [&mut [Record]; 2], domain: &Domain, split: &Split) {
    let plane = plane(domain, split);
    let mut to = Sides::of(sides);
    for r in records {
        let r = load_record(r);
        to.push((_mm_movemask_ps(goes_right(centre2(bare(r)), &plane)) & 1) as usize, r);
    }
    assert_eq!(to.at, to.size, "the sides are as large as counted");
}

#[target_feature(enable = "avx2")]
fn extent_256(records: &[Record]) -> (Span, [f32; 3], [f32; 3]) {
    let mut span = load_record(&Record::EMPTY);
    let (mut lo, mut hi) = (_mm_set1_ps(f32::NEG_INFINITY), _mm_set1_ps(f32::NEG_INFINITY));
    for r in records {
        let r = bare(load_record(r));
        let c = centre2(r);
        span = _mm256_max_ps(span, r);
        lo = _mm_max_ps(lo, _mm_sub_ps(_mm_setzero_ps(), c));
        hi = _mm_max_ps(hi, c);
    }
    let mut out = Record::EMPTY;
    store_record(&mut out, span);
    let three = |v: __m128| {
        let mut a = [0f32; 4];
        // SAFETY: four f32.
        unsafe { _mm_storeu_ps(a.as_mut_ptr(), v) };
        [a[0], a[1], a[2]]
    };
    (out, three(lo).map(|x| -x), three(hi))
}
