//! Judging triangles of a draw list in words of 64 positions.
//!
//! Kernels answer with a bit a position. Asking a closure for every triangle would
//! cost more than judging it, so the list hands out whole words, and runs of equal
//! bits become ranges with a few instructions each.

use super::DrawList;

/// Positions a word.
pub const WORD: usize = 64;

/// Words handed out at once: a list of many words stays in the first-level cache.
const CHUNK: usize = 64;

impl DrawList {
    /// Keeps the positions whose bits `judge` leaves set, and marks the list as
    /// compacted. `judge` gets the number of the first word and words in which the
    /// bits of listed positions are set; bit `b` of word `w` is position `64 w + b`.
    /// Returns how many positions were listed.
    #[inline]
    pub fn retain_words(&mut self, mut judge: impl FnMut(usize, &mut [u64])) -> u64 {
        let before = std::mem::replace(&mut self.ranges, std::mem::take(&mut self.spare));
        self.ranges.clear();
        self.stamp = 0;
        let mut listed = 0;
        let mut words = [0u64; CHUNK];
        for (first, end) in &before {
            listed += u64::from(end - first);
            let (first, end) = (*first as usize, *end as usize);
            let last_word = (end - 1) / WORD;
            let mut run = None;
            for at in (first / WORD..=last_word).step_by(CHUNK) {
                let words = &mut words[..CHUNK.min(last_word + 1 - at)];
                words.fill(!0);
                if at == first / WORD {
                    words[0] &= !0 << (first % WORD);
                }
                if at + words.len() > last_word {
                    words[last_word - at] &= !0 >> (WORD - 1 - (end - 1) % WORD);
                }
                judge(at, words);
                for (i, word) in words.iter().enumerate() {
                    self.push_runs((at + i) * WORD, *word, &mut run);
                }
            }
            if let Some(start) = run {
                self.ranges.push((start, end as u32));
            }
        }
        self.spare = before;
        self.compacted = true;
        listed
    }

    /// Appends the runs of set bits; `run` is the start of one that reaches the end
    /// of the word before, and then of this one. Runs of one listed range do not
    /// touch, nor do listed ranges, so nothing has to be merged.
    #[inline]
    fn push_runs(&mut self, base: usize, word: u64, run: &mut Option<u32>) {
        let before = word << 1 | u64::from(run.is_some());
        let (mut starts, mut ends) = (word & !before, !word & before);
        while ends != 0 {
            let start = run.take().unwrap_or_else(|| {
                let start = base as u32 + starts.trailing_zeros();
                starts &= starts - 1;
                start
            });
            self.ranges.push((start, base as u32 + ends.trailing_zeros()));
            ends &= ends - 1;
        }
        if starts != 0 {
            *run = Some(base as u32 + starts.trailing_zeros());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn words_keep_what_asking_for_each_position_keeps(
            gaps in proptest::collection::vec((1u32..200, 1u32..9000), 0..6),
            words in proptest::collection::vec(prop_oneof![Just(0u64), Just(!0u64), any::<u64>()], 1..40),
        ) {
            let mut list = DrawList::default();
            let mut at = 0;
            for (gap, length) in gaps {
                list.push(at + gap, at + gap + length);
                at += gap + length;
            }
            let word = |w: usize| words[w % words.len()];
            let mut naive = list.clone();
            naive.retain(|p| word(p as usize / WORD) >> (p as usize % WORD) & 1 == 1);
            let count = list.entry_count();
            let listed = list.retain_words(|first, asked| {
                asked.iter_mut().enumerate().for_each(|(i, bits)| *bits &= word(first + i));
            });
            prop_assert_eq!(listed, count);
            prop_assert_eq!(&list.ranges, &naive.ranges);
            prop_assert!(list.compacted);
        }
    }
}
