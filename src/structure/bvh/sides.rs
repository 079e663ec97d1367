//! What the bins of a node say of the two sides of a split: their boxes, and where their
//! centroids may lie. The twins of the kernels in `sides_x86`.

use super::bins::{Bins, Domain, Split, stride};
use super::record::{Record, Span, larger};

/// Boxes of both sides.
pub fn sides(from: &Bins, split: &Split, bins: usize) -> [Span; 2] {
    let spans = &from.spans[split.axis * stride(bins)..][..bins];
    let (left, right) = spans.split_at(split.plane);
    [left, right].map(|side| side.iter().fold(Record::EMPTY, |all, s| all.union(*s)))
}

/// Domains of both sides in `bins_below` bins an axis: centroids lie in the box of the
/// side, and in bins that hold any.
pub fn below(
    from: &Bins,
    domain: &Domain,
    bins: usize,
    split: &Split,
    bounds: &[Span; 2],
    bins_below: usize,
) -> [Domain; 2] {
    [0, 1].map(|side| {
        let (mut lo, mut hi) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let counts = &from.counts[axis * stride(bins)..][..bins];
            let width = (domain.hi[axis] - domain.lo[axis]) / bins as f32;
            let (mut first, mut end) = (0, bins);
            if axis == split.axis {
                if side == 0 { end = split.plane } else { first = split.plane }
            }
            while first < end && counts[first] == 0 {
                first += 1;
            }
            while end > first && counts[end - 1] == 0 {
                end -= 1;
            }
            let at = |i: usize| if i == bins { domain.hi[axis] } else { domain.lo[axis] + i as f32 * width };
            let bounds = &bounds[side].0;
            lo[axis] = larger(-2.0 * bounds[axis], at(first));
            hi[axis] = -larger(-2.0 * bounds[4 + axis], -at(end));
        }
        Domain::over(lo, hi, bins_below)
    })
}
