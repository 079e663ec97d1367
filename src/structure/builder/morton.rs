//! Morton codes (G. M. Morton, 1966) on an f64 lattice, and the stable radix
//! sort that orders by them.
//!
//! Cells are found in f64 relative to the lattice's corner: codes of f32 world
//! coordinates collapse at large offsets.

use crate::math::{Aabb, DVec3};
use rayon::prelude::*;

/// A box divided into `2^bits` cells an axis.
#[derive(Debug, Clone, Copy)]
pub struct Lattice {
    lo: DVec3,
    cells_per_m: DVec3,
    last: DVec3,
}

impl Lattice {
    /// # Panics
    /// If `bits > 21`: three axes must fit 63 bits.
    pub fn new(bounds: &Aabb, bits: u32) -> Lattice {
        assert!(bits <= 21, "63 bits hold 21 an axis");
        let cells = (1u64 << bits) as f64;
        // A flat axis has one layer of cells; so has one too thin to divide.
        let per_m = |s: f64| if s > 0.0 && (cells / s).is_finite() { cells / s } else { 0.0 };
        let size = bounds.size();
        Lattice {
            lo: bounds.lo,
            cells_per_m: DVec3::new(per_m(size.x), per_m(size.y), per_m(size.z)),
            last: DVec3::splat(cells - 1.0),
        }
    }

    /// Cell of a point; points outside belong to the nearest cell.
    #[inline]
    pub fn cell(&self, p: DVec3) -> [u32; 3] {
        let c = ((p - self.lo) * self.cells_per_m).clamp(DVec3::ZERO, self.last);
        [c.x as u32, c.y as u32, c.z as u32]
    }

    #[inline]
    pub fn code(&self, p: DVec3) -> u64 {
        interleave(self.cell(p))
    }
}

/// x in bits 0, 3, 6..., y in 1, 4, 7..., z in 2, 5, 8...; 21 bits each.
#[inline]
pub fn interleave([x, y, z]: [u32; 3]) -> u64 {
    spread(x) | spread(y) << 1 | spread(z) << 2
}

/// Moves bit i to bit 3 i.
#[inline]
fn spread(x: u32) -> u64 {
    let mut v = u64::from(x) & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// Bits that one pass sorts by: 4096 counters stay in the first-level cache.
const DIGIT_BITS: u32 = 12;
/// Items a task scatters; its buffers stay in the second-level cache.
const CHUNK: usize = 1 << 16;
/// Below this the library's stable sort is faster than clearing counters.
const SMALL: usize = 1 << 11;

/// Sorts by the low `bits` bits of `key`, stably: equal keys keep their order,
/// so the result does not depend on the number of threads.
///
/// Most significant digit first. Each chunk is scattered into its own buffer,
/// then every bucket of the output is the concatenation of its part of each
/// buffer: tasks own what they write, with no shared scatter.
pub fn radix_sort<T, K>(mut items: Vec<T>, bits: u32, key: K) -> Vec<T>
where
    T: Copy + Send + Sync,
    K: Fn(&T) -> u64 + Sync,
{
    sort_slice(&mut items, bits, &key);
    items
}

fn sort_slice<T, K>(items: &mut [T], bits: u32, key: &K)
where
    T: Copy + Send + Sync,
    K: Fn(&T) -> u64 + Sync,
{
    if bits == 0 {
        return;
    }
    if items.len() < SMALL {
        let mask = u64::MAX >> (64 - bits);
        items.sort_by_key(|i| key(i) & mask);
        return;
    }
    let digit_bits = bits.min(DIGIT_BITS);
    let shift = bits - digit_bits;
    let buckets = 1usize << digit_bits;
    let digit = |i: &T| (key(i) >> shift) as usize & (buckets - 1);

    let scattered: Vec<(Vec<T>, Vec<u32>)> = items
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut starts = vec![0u32; buckets + 1];
            for i in chunk {
                starts[digit(i) + 1] += 1;
            }
            for b in 0..buckets {
                starts[b + 1] += starts[b];
            }
            let mut cursor = starts.clone();
            let mut out = chunk.to_vec();
            for i in chunk {
                let c = &mut cursor[digit(i)];
                out[*c as usize] = *i;
                *c += 1;
            }
            (out, starts)
        })
        .collect();

    let mut rest = items;
    let mut slices = Vec::new();
    for b in 0..buckets {
        let size: u32 = scattered.iter().map(|(_, starts)| starts[b + 1] - starts[b]).sum();
        if size > 0 {
            let (bucket, tail) = rest.split_at_mut(size as usize);
            slices.push((b, bucket));
            rest = tail;
        }
    }
    slices.into_par_iter().with_min_len(32).for_each(|(b, bucket)| {
        let mut at = 0;
        for (chunk, starts) in &scattered {
            let part = &chunk[starts[b] as usize..starts[b + 1] as usize];
            bucket[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
        sort_slice(bucket, shift, key);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_radix_sort_equals_the_library_sort(seed in any::<u64>(), n in 0usize..9000, bits in 1u32..64, spread in 0u32..64) {
            let mut x = seed | 1;
            let items: Vec<(u64, u32)> = (0..n as u32).map(|i| {
                x ^= x << 13; x ^= x >> 7; x ^= x << 17;
                // Many equal keys for small spreads.
                (x >> spread, i)
            }).collect();
            let mask = u64::MAX >> (64 - bits);
            let mut expected = items.clone();
            expected.sort_by_key(|i| i.0 & mask);
            prop_assert_eq!(radix_sort(items, bits, |i| i.0), expected);
        }

        #[test]
        fn interleaving_puts_each_bit_in_its_place(x in 0u32..1 << 21, y in 0u32..1 << 21, z in 0u32..1 << 21) {
            let bit = |v: u32, i: u32| u64::from(v >> i & 1);
            let naive = (0..21).fold(0, |c, i| c | bit(x, i) << (3 * i) | bit(y, i) << (3 * i + 1) | bit(z, i) << (3 * i + 2));
            prop_assert_eq!(interleave([x, y, z]), naive);
        }
    }

    #[test]
    fn codes_do_not_collapse_far_from_the_origin() {
        let lo = DVec3::splat(1e7);
        let lattice = Lattice::new(&Aabb { lo, hi: lo + 16.0 }, 4);
        assert_eq!(lattice.cell(lo + DVec3::new(0.5, 7.5, 15.5)), [0, 7, 15]);
        assert_eq!(lattice.cell(lo + 16.0), [15; 3], "the far face belongs to the last cell");
    }

    #[test]
    fn a_flat_axis_is_one_layer() {
        let lattice = Lattice::new(&Aabb { lo: DVec3::ZERO, hi: DVec3::new(1.0, 0.0, 1.0) }, 10);
        assert_eq!(lattice.cell(DVec3::new(1.0, 0.0, 0.0)), [1023, 0, 0]);
    }
}
