//! The linear build: triangles in Morton order, divided where the highest bit of their
//! codes changes (Lauterbach et al. 2009).
//!
//! The upper 32 bits of a code and the number of its triangle make one word to sort.
//! Ranges that are still too large where those bits end are sorted again by the other
//! 31; where all 63 are equal, the range is halved.

use super::pages;
use super::record::{self, Record, Span};
use super::tree::{Slim, Tree};
use crate::hierarchy::NONE;
use crate::math::DVec3;
use crate::scene::Scene;
use crate::structure::builder::morton::{Lattice, radix_sort};
use crate::structure::builder::scene_bounds;
use rayon::prelude::*;

/// Bits of a code that are sorted at first.
const UPPER_BITS: u32 = 32;
const LOWER_BITS: u32 = 63 - UPPER_BITS;
/// Subtrees with fewer triangles are built by one task.
const TASK: usize = 1 << 12;

struct Linear<'a> {
    leaf_size: usize,
    records: &'a [Record],
    scene: &'a Scene,
    lattice: Lattice,
}

/// Builds over all triangles; `records` are those of the scene, in its order.
pub fn build(scene: &Scene, records: &[Record], leaf_size: usize) -> (Vec<Slim>, Vec<u64>) {
    let mut sealed = pages::zeros(records.len());
    if records.is_empty() {
        return (Vec::new(), sealed);
    }
    let linear = Linear { leaf_size, records, scene, lattice: Lattice::new(&scene_bounds(scene), 21) };
    let keyed = (0..records.len() as u32)
        .into_par_iter()
        .with_min_len(4096)
        .map(|t| (linear.code(t) >> LOWER_BITS) << 32 | u64::from(t))
        .collect();
    let mut sorted: Vec<u64> = radix_sort(keyed, UPPER_BITS, |k| k >> 32);
    let (tree, _) = linear.plant(&mut sorted, &mut sealed, false);
    (tree.join(), sealed)
}

impl Linear<'_> {
    fn code(&self, t: u32) -> u64 {
        let [a, b, c]: [DVec3; 3] = self.scene.corners(t);
        self.lattice.code((a + b + c) / 3.0)
    }

    /// Large nodes here, their subtrees in tasks. `lower` tells which bits are in the keys.
    fn plant(&self, keys: &mut [u64], sealed: &mut [u64], lower: bool) -> (Tree, Span) {
        if keys.len() <= TASK.max(self.leaf_size) || rayon::current_num_threads() == 1 {
            let leaf = self.leaf_size.div_ceil(2);
            let mut out = pages::with_capacity(2 * keys.len().div_ceil(leaf));
            out.push(Slim::UNBORN);
            let span = self.grow(keys, sealed, lower, &mut out, 0);
            return (Tree::Part(out), span);
        }
        let (left, lower) = self.divide(keys, lower);
        let (a, b) = keys.split_at_mut(left);
        let (to_a, to_b) = sealed.split_at_mut(left);
        let ((a, span_a), (b, span_b)) = rayon::join(|| self.plant(a, to_a, lower), || self.plant(b, to_b, lower));
        let span = span_a.union(span_b);
        (Tree::Fork(span.bounds(), Box::new([a, b])), span)
    }

    fn grow(&self, keys: &mut [u64], sealed: &mut [u64], lower: bool, out: &mut Vec<Slim>, slot: usize) -> Span {
        let count = keys.len() as u32;
        if keys.len() <= self.leaf_size {
            let mut span = Record::EMPTY;
            for (k, out) in keys.iter().zip(&mut *sealed) {
                let r = self.records[*k as u32 as usize];
                span = span.union(r.bare());
                *out = r.key();
            }
            record::sort(sealed);
            out[slot] = Slim { bounds: span.bounds(), child: NONE, count };
            return span;
        }
        let (left, lower) = self.divide(keys, lower);
        let child = out.len();
        out.extend([Slim::UNBORN; 2]);
        let (a, b) = keys.split_at_mut(left);
        let (to_a, to_b) = sealed.split_at_mut(left);
        let span_a = self.grow(a, to_a, lower, out, child);
        let span_b = self.grow(b, to_b, lower, out, child + 1);
        let span = span_a.union(span_b);
        out[slot] = Slim { bounds: span.bounds(), child: child as u32, count };
        span
    }

    /// How many keys have the highest differing bit clear.
    fn divide(&self, keys: &mut [u64], lower: bool) -> (usize, bool) {
        let differ = |keys: &[u64]| (keys[0] ^ keys[keys.len() - 1]) >> 32;
        let mut is_lower = lower;
        if differ(keys) == 0 && !lower {
            for k in &mut *keys {
                let t = *k as u32;
                *k = (self.code(t) & ((1 << LOWER_BITS) - 1)) << 32 | u64::from(t);
            }
            keys.sort_unstable();
            is_lower = true;
        }
        let differ = differ(keys);
        if differ == 0 {
            return (keys.len() / 2, is_lower);
        }
        let bit = 32 + differ.ilog2();
        (keys.partition_point(|k| k >> bit & 1 == 0), is_lower)
    }
}
