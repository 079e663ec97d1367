//! A set of triangles as one bit each.

/// A subset of `0..len`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BitSet {
    words: Vec<u64>,
    len: usize,
}

impl BitSet {
    pub fn new(len: usize) -> BitSet {
        BitSet { words: vec![0; len.div_ceil(64)], len }
    }

    /// All of `0..len`.
    pub fn full(len: usize) -> BitSet {
        let mut set = BitSet::new(len);
        (0..len as u32).for_each(|i| set.insert(i));
        set
    }

    /// Size of the universe.
    pub fn len(&self) -> usize {
        self.len
    }

    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|w| *w == 0)
    }

    #[inline]
    pub fn insert(&mut self, i: u32) {
        debug_assert!((i as usize) < self.len);
        self.words[i as usize / 64] |= 1 << (i % 64);
    }

    pub fn remove(&mut self, i: u32) {
        self.words[i as usize / 64] &= !(1 << (i % 64));
    }

    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    #[inline]
    pub fn contains(&self, i: u32) -> bool {
        self.words[i as usize / 64] >> (i % 64) & 1 == 1
    }

    pub fn count(&self) -> u64 {
        self.words.iter().map(|w| u64::from(w.count_ones())).sum()
    }

    /// Members in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.words.iter().enumerate().flat_map(|(i, word)| {
            let mut rest = *word;
            std::iter::from_fn(move || {
                (rest != 0).then(|| {
                    let bit = rest.trailing_zeros();
                    rest &= rest - 1;
                    i as u32 * 64 + bit
                })
            })
        })
    }
}

impl FromIterator<u32> for BitSet {
    /// The universe ends after the largest member.
    fn from_iter<I: IntoIterator<Item = u32>>(items: I) -> BitSet {
        let items: Vec<u32> = items.into_iter().collect();
        let mut set = BitSet::new(items.iter().max().map_or(0, |m| *m as usize + 1));
        items.into_iter().for_each(|i| set.insert(i));
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_come_back_in_order_and_can_leave() {
        let mut set: BitSet = [190, 3, 64, 63].into_iter().collect();
        assert_eq!(set.iter().collect::<Vec<_>>(), [3, 63, 64, 190]);
        set.remove(64);
        assert!(!set.contains(64) && set.contains(63) && set.count() == 3);
        assert_eq!(BitSet::full(70).iter().collect::<Vec<_>>(), (0..70).collect::<Vec<_>>());
    }
}
