//! How many different triangles a draw list holds, where structures repeat them.
//!
//! Only entries whose triangle has others can be counted twice, so only they are
//! looked at: the pieces of split triangles, copies in several leaves, else none.

use super::DrawList;
use crate::hierarchy::NONE;

#[derive(Debug)]
pub struct Distinct {
    /// Positions of repeated triangles, ascending.
    positions: Vec<u32>,
    /// For each of them its triangle, numbered among the repeated ones.
    numbers: Vec<u32>,
    /// The count in which a repeated triangle was last seen.
    seen: Vec<u64>,
    counts: u64,
}

impl Distinct {
    /// `entries` gives the triangle of every position, below `triangles`.
    pub fn new(entries: &[u32], triangles: usize) -> Distinct {
        let (of_triangle, repeated) = number_repeated(entries, triangles);
        let of = |position: &u32| of_triangle[entries[*position as usize] as usize];
        let positions: Vec<u32> = (0..entries.len() as u32).filter(|p| of(p) != NONE).collect();
        let numbers = positions.iter().map(of).collect();
        Distinct { positions, numbers, seen: vec![0; repeated as usize], counts: 0 }
    }

    /// Different triangles among the entries of `list`.
    pub fn count(&mut self, list: &DrawList) -> u64 {
        let entries = list.entry_count();
        if self.positions.is_empty() {
            return entries;
        }
        self.counts += 1;
        let mut again = 0;
        for (first, end) in &list.ranges {
            let from = self.positions.partition_point(|p| p < first);
            let to = from + self.positions[from..].partition_point(|p| p < end);
            for number in &self.numbers[from..to] {
                let seen = &mut self.seen[*number as usize];
                again += u64::from(*seen == self.counts);
                *seen = self.counts;
            }
        }
        entries - again
    }
}

/// By triangle, its number among those with several positions or [`NONE`]; and how many
/// such triangles there are.
pub(super) fn number_repeated(entries: &[u32], triangles: usize) -> (Vec<u32>, u32) {
    let mut of = vec![0u32; triangles];
    entries.iter().for_each(|t| of[*t as usize] += 1);
    let mut repeated = 0;
    // From here on the number of a triangle, instead of how often it comes.
    for t in &mut of {
        let many = *t > 1;
        *t = if many { repeated } else { NONE };
        repeated += u32::from(many);
    }
    (of, repeated)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{RngCore, SeedableRng};
    use std::collections::HashSet;

    #[test]
    fn counts_are_those_of_a_set() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for (triangles, entries) in [(1, 1), (40, 40), (40, 41), (40, 300), (300, 400)] {
            // All triangles once, then any of them again, in any order.
            let mut all: Vec<u32> =
                (0..triangles).chain((triangles..entries).map(|_| rng.next_u32() % triangles)).collect();
            for i in (1..all.len()).rev() {
                all.swap(i, rng.next_u32() as usize % (i + 1));
            }
            let mut distinct = Distinct::new(&all, triangles as usize);
            for _ in 0..50 {
                let mut list = DrawList::default();
                let mut expected = HashSet::new();
                for position in (0..entries).filter(|_| rng.next_u32() % 3 > 0).collect::<Vec<_>>() {
                    list.push(position, position + 1);
                    expected.insert(all[position as usize]);
                }
                assert_eq!(distinct.count(&list), expected.len() as u64);
            }
        }
    }
}
