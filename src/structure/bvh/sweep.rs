//! The exact sweep: every plane between two neighbours in the order of centroids, on
//! each axis (Goldsmith & Salmon 1987; Wald 2007 compares his bins with it).
//!
//! Small nodes are divided so, where it is no dearer than bins; a tree that is built so
//! throughout is the twin that bins are measured against. The kernel for few records is in
//! `sweep_x86`.

use super::record::{Record, Span};

/// The best division of a node: its first `left` records in the order of `axis`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    pub axis: usize,
    pub left: usize,
    /// Half areas of the sides times their counts, summed.
    pub cost: f32,
    pub bounds: [Span; 2],
}

/// Orders and areas, kept between nodes.
#[derive(Default)]
pub struct Sweep {
    orders: [Vec<(f32, u32)>; 3],
    suffix: Vec<Span>,
}

impl Sweep {
    /// The least cost, the first of equals by axis, then by count; `None` for one record, or
    /// where no cost is finite. `out` gets the records in the order of the axis.
    pub fn cut(&mut self, records: &[Record], out: &mut [Record]) -> Option<Cut> {
        let best = self.best(records)?;
        for (out, (_, i)) in out.iter_mut().zip(&self.orders[best.axis]) {
            *out = records[*i as usize];
        }
        Some(best)
    }

    fn best(&mut self, records: &[Record]) -> Option<Cut> {
        let n = records.len();
        let mut best: Option<Cut> = None;
        for (axis, order) in self.orders.iter_mut().enumerate() {
            order.clear();
            order.extend(records.iter().zip(0u32..).map(|(r, i)| (r.centre2(axis), i)));
            sort(order);
            self.suffix.clear();
            self.suffix.resize(n, Record::EMPTY);
            let mut span = Record::EMPTY;
            for (out, (_, i)) in self.suffix.iter_mut().zip(&*order).rev() {
                span = span.union(records[*i as usize].bare());
                *out = span;
            }
            let mut span = Record::EMPTY;
            for left in 1..n {
                span = span.union(records[order[left - 1].1 as usize].bare());
                let cost = span.half_area() * left as f32 + self.suffix[left].half_area() * (n - left) as f32;
                if cost < best.map_or(f32::INFINITY, |b| b.cost) {
                    best = Some(Cut { axis, left, cost, bounds: [span, self.suffix[left]] });
                }
            }
        }
        best
    }
}

/// By centre, ties by place.
fn sort(order: &mut [(f32, u32)]) {
    if order.len() > 32 {
        return order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
    for i in 1..order.len() {
        let key = order[i];
        let mut at = i;
        while at > 0 && order[at - 1].0.total_cmp(&key.0).is_gt() {
            order[at] = order[at - 1];
            at -= 1;
        }
        order[at] = key;
    }
}
