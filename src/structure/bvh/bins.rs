//! Bins of centroids (Wald 2007), and the scalar kernels over them: the twins of those
//! in `bins_x86`, which give the same bits.

use super::record::{Record, Span, larger};

/// Most bins an axis.
pub const BINS_MAX: usize = 32;

/// Where the centroids of a node may lie, doubled (`lo + hi` of a box), and how that
/// maps to bins. A loose domain costs quality, never correctness: what lies outside
/// belongs to the nearest bin. Lane 3 is not used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    pub lo: [f32; 4],
    pub hi: [f32; 4],
    /// Bins a metre; 0 on a flat axis, which has one bin.
    pub scale: [f32; 4],
}

impl Domain {
    pub fn over(lo: [f32; 3], hi: [f32; 3], bins: usize) -> Domain {
        let mut d = Domain { lo: [0.0; 4], hi: [0.0; 4], scale: [0.0; 4] };
        for axis in 0..3 {
            (d.lo[axis], d.hi[axis]) = (lo[axis], hi[axis]);
            let scale = bins as f32 / (hi[axis] - lo[axis]);
            // Inverted by rounding, empty, or too thin to divide.
            if scale > 0.0 && scale.is_finite() {
                d.scale[axis] = scale;
            }
        }
        d
    }

    /// Axis on which the centroids spread most.
    pub fn longest_axis(&self) -> usize {
        let size = |axis: usize| self.hi[axis] - self.lo[axis];
        let axis = usize::from(size(1) > size(0));
        if size(2) > size(axis) { 2 } else { axis }
    }

    /// Position in bins: 1.5 is the middle of the second.
    #[inline]
    fn place(&self, r: &Record, axis: usize) -> f32 {
        (r.centre2(axis) - self.lo[axis]) * self.scale[axis]
    }

    #[inline]
    fn bin(&self, r: &Record, axis: usize, bins: usize) -> usize {
        // Not a number falls into bin 0.
        let x = larger(self.place(r, axis), 0.0);
        let last = (bins - 1) as f32;
        (if x < last { x } else { last }) as usize
    }
}

/// Boxes and counts by axis and bin; `stride` bins an axis are laid out, `bins` of them used.
#[derive(Debug, Clone, PartialEq)]
#[repr(C, align(64))]
pub struct Bins {
    pub spans: [Span; 3 * BINS_MAX],
    pub counts: [u32; 3 * BINS_MAX],
}

/// Bins an axis rounded up, so that eight planes are judged at once.
pub const fn stride(bins: usize) -> usize {
    bins.next_multiple_of(8)
}

/// Records with `place >= plane` on `axis` belong to the right: bins from `plane` on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Split {
    pub axis: usize,
    /// First bin of the right side.
    pub plane: usize,
    /// Records on the left side.
    pub left: u32,
    /// Half areas of the sides times their counts, summed.
    pub cost: f32,
}

impl Bins {
    pub const ZERO: Bins = Bins { spans: [Record([0.0; 8]); 3 * BINS_MAX], counts: [0; 3 * BINS_MAX] };

    pub fn clear(&mut self, bins: usize) {
        self.spans[..3 * stride(bins)].fill(Record::EMPTY);
        self.counts[..3 * stride(bins)].fill(0);
    }

    /// Takes in what `other` holds.
    pub fn merge(&mut self, other: &Bins, bins: usize) {
        for i in 0..3 * stride(bins) {
            self.spans[i] = self.spans[i].union(other.spans[i]);
            self.counts[i] += other.counts[i];
        }
    }

    #[inline]
    fn add(&mut self, r: &Record, domain: &Domain, bins: usize) {
        for axis in 0..3 {
            let i = axis * stride(bins) + domain.bin(r, axis, bins);
            self.spans[i] = self.spans[i].union(r.bare());
            self.counts[i] += 1;
        }
    }

    /// The least cost of all planes that have records on both sides; the first of equals.
    pub fn best(&self, bins: usize) -> Option<Split> {
        let mut best: Option<Split> = None;
        for axis in 0..3 {
            let base = axis * stride(bins);
            let mut right = [(0u32, 0f32); BINS_MAX];
            let (mut count, mut span) = (0, Record::EMPTY);
            for plane in (1..bins).rev() {
                count += self.counts[base + plane];
                span = span.union(self.spans[base + plane]);
                right[plane] = (count, span.half_area());
            }
            let (mut count, mut span) = (0, Record::EMPTY);
            for (plane, (right_count, right_area)) in right.iter().enumerate().take(bins).skip(1) {
                count += self.counts[base + plane - 1];
                span = span.union(self.spans[base + plane - 1]);
                if count == 0 || *right_count == 0 {
                    continue;
                }
                let cost = span.half_area() * count as f32 + right_area * *right_count as f32;
                if cost < best.map_or(f32::INFINITY, |b| b.cost) {
                    best = Some(Split { axis, plane, left: count, cost });
                }
            }
        }
        best
    }
}

/// Fills `out` with the records.
pub fn fill(records: &[Record], domain: &Domain, bins: usize, out: &mut Bins) {
    out.clear(bins);
    records.iter().for_each(|r| out.add(r, domain, bins));
}

/// How many records go left.
pub fn count_left(records: &[Record], domain: &Domain, split: &Split) -> usize {
    records.iter().filter(|r| !goes_right(r, domain, split)).count()
}

#[inline]
fn goes_right(r: &Record, domain: &Domain, split: &Split) -> bool {
    domain.place(r, split.axis) >= split.plane as f32
}

/// Deals records to the two sides, in their order, and bins each side in the same pass.
///
/// # Panics
/// If the sides are not as large as the split makes them.
pub fn deal(
    records: &[Record],
    sides: [&mut [Record]; 2],
    domain: &Domain,
    split: &Split,
    below: &[Domain; 2],
    bins: usize,
    out: [&mut Bins; 2],
) {
    let mut at = [0; 2];
    out[0].clear(bins);
    out[1].clear(bins);
    for r in records {
        let side = usize::from(goes_right(r, domain, split));
        sides[side][at[side]] = *r;
        at[side] += 1;
        out[side].add(r, &below[side], bins);
    }
    assert_eq!(at, [sides[0].len(), sides[1].len()], "the sides are as large as counted");
}

/// [`deal`] without bins.
pub fn part(records: &[Record], sides: [&mut [Record]; 2], domain: &Domain, split: &Split) {
    let mut at = [0; 2];
    for r in records {
        let side = usize::from(goes_right(r, domain, split));
        sides[side][at[side]] = *r;
        at[side] += 1;
    }
    assert_eq!(at, [sides[0].len(), sides[1].len()], "the sides are as large as counted");
}

/// Box of all records, and the range of their doubled centroids.
pub fn extent(records: &[Record]) -> (Span, [f32; 3], [f32; 3]) {
    let (mut span, mut lo, mut hi) = (Record::EMPTY, [f32::NEG_INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for r in records {
        span = span.union(r.bare());
        for axis in 0..3 {
            let c = r.centre2(axis);
            lo[axis] = larger(lo[axis], 0.0 - c);
            hi[axis] = larger(hi[axis], c);
        }
    }
    (span, lo.map(|x| -x), hi)
}
