//! What a frame submits, and what drawing it costs in calls.

use crate::hierarchy::Hierarchy;

/// What a frame submits: ranges of entry positions, merged when contiguous.
#[derive(Debug, Clone, Default)]
pub struct DrawList {
    /// Written by methods, which withdraw the `stamp`; who writes here directly clears
    /// the list first.
    pub ranges: Vec<(u32, u32)>,
    /// Triangles were judged one by one, so what is drawn is an index list written
    /// anew this frame: ranges of one material follow each other in it without a gap.
    pub compacted: bool,
    pub(super) spare: Vec<(u32, u32)>,
    /// Number of the judged frame whose list this is, as long as nobody wrote to it
    /// since; 0 if a walk did not ask for one.
    pub(super) stamp: u64,
}

impl PartialEq for DrawList {
    fn eq(&self, other: &DrawList) -> bool {
        (&self.ranges, self.compacted) == (&other.ranges, other.compacted)
    }
}

impl Eq for DrawList {}

impl DrawList {
    pub fn clear(&mut self) {
        self.ranges.clear();
        self.compacted = false;
        self.stamp = 0;
    }

    /// Keeps the positions that `keep` says yes to and marks the list as compacted.
    #[inline]
    pub fn retain(&mut self, mut keep: impl FnMut(u32) -> bool) {
        let before = std::mem::replace(&mut self.ranges, std::mem::take(&mut self.spare));
        self.ranges.clear();
        self.stamp = 0;
        for (first, end) in &before {
            for position in (*first..*end).filter(|p| keep(*p)) {
                self.push(position, position + 1);
            }
        }
        self.spare = before;
        self.compacted = true;
    }

    #[inline]
    pub fn push(&mut self, first: u32, end: u32) {
        if first == end {
            return;
        }
        self.stamp = 0;
        match self.ranges.last_mut() {
            Some(last) if last.1 == first => last.1 = end,
            _ => self.ranges.push((first, end)),
        }
    }

    /// In order of positions, so that all neighbours merge.
    pub fn sort(&mut self) {
        let mut before = std::mem::replace(&mut self.ranges, std::mem::take(&mut self.spare));
        self.ranges.clear();
        self.stamp = 0;
        before.sort_unstable();
        before.iter().for_each(|(first, end)| self.push(*first, *end));
        self.spare = before;
    }

    /// Entries submitted, duplicates included.
    pub fn entry_count(&self) -> u64 {
        self.ranges.iter().map(|(a, b)| u64::from(b - a)).sum()
    }

    pub fn positions(&self) -> impl Iterator<Item = u32> + '_ {
        self.ranges.iter().flat_map(|(a, b)| *a..*b)
    }

    /// Draw calls: one a material run of each range; of a compacted list, one a
    /// material run that is touched at all.
    pub fn draw_calls(&self, hierarchy: &Hierarchy) -> u64 {
        let runs = |(a, b): &(u32, u32)| u64::from(hierarchy.material_runs(*a, *b));
        let whole: u64 = self.ranges.iter().map(runs).sum();
        if !self.compacted {
            return whole;
        }
        let run = |position: u32| hierarchy.material_run[position as usize];
        let shared = self.ranges.windows(2).filter(|w| run(w[0].1 - 1) == run(w[1].0)).count();
        whole - shared as u64
    }

    /// Draw calls if all triangles had one material.
    pub fn draw_calls_any_material(&self) -> u64 {
        if self.compacted { u64::from(!self.ranges.is_empty()) } else { self.ranges.len() as u64 }
    }
}
