//! `mailbox`: what several cells share is drawn once a frame.
//!
//! A structure that replicates (policy R, a portal-octree) submits a triangle again with
//! every cell that it reaches into. Ray tracers leave a note at the triangle to find that
//! out (mailboxes: Amanatides & Woo 1987); here each repeated triangle keeps the number of
//! the last frame that drew it, and a later copy in the same frame is taken out.
//!
//! Removes nothing from the set that is drawn, only copies; **conservative** whatever it is
//! summed with. The pieces of a triangle that a structure split are no copies, and stay.
//! The price is an index list written anew, in the frames that hold a copy.
//!
//! What we changed: notes are dense over the repeated triangles alone, and whole words of
//! positions without any are passed by.

use super::distinct::number_repeated;
use super::triangle_words::WORD;
use super::*;
use crate::hierarchy::NONE;

pub const NAME: &str = "mailbox";

/// Whether a resolved structure puts triangles into several leaves.
pub fn has_copies(structure: &Spec) -> bool {
    structure.kind == "portal_octree" || structure.params.get("policy") == Some(&Value::Text("R".into()))
}

pub const ENTRY: Entry<dyn Test> = Entry {
    name: NAME,
    about: "copies of a triangle that several cells hold are drawn once (replicated structures)",
    revision: 1,
    params: &[],
    make: |_| Box::new(Mailbox::default()),
};

#[derive(Default)]
pub struct Mailbox {
    /// A bit a position: its triangle has other positions.
    repeated: Vec<u64>,
    /// By position, the number of a repeated triangle among the repeated ones.
    number: Vec<u32>,
    /// By number, the frame that drew it last.
    drawn: Vec<u32>,
    frame: u32,
}

impl Test for Mailbox {
    fn class(&self) -> Class {
        Class::Conservative
    }

    fn removes(&self) -> Removes {
        Removes::default()
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        *self = Mailbox::default();
        if hierarchy.fragments.is_some() || hierarchy.entries.len() == scene.len() {
            return 0;
        }
        let (of_triangle, count) = number_repeated(&hierarchy.entries, scene.len());
        self.number = hierarchy.entries.iter().map(|t| of_triangle[*t as usize]).collect();
        let bits = |numbers: &[u32]| (0..numbers.len()).fold(0, |w, i| w | u64::from(numbers[i] != NONE) << i);
        self.repeated = self.number.chunks(WORD).map(bits).collect();
        self.drawn = vec![0; count as usize];
        size_of_val(&self.repeated[..]) + size_of_val(&self.number[..]) + size_of_val(&self.drawn[..])
    }

    fn begin(&mut self, _: &View, _: &Hierarchy) {
        self.frame = self.frame.wrapping_add(1);
        // Notes of four thousand million frames ago.
        if self.frame == 0 {
            self.drawn.fill(0);
            self.frame = 1;
        }
    }

    /// Nodes are none of its business.
    fn initial_carry(&self) -> u8 {
        0
    }

    fn judge(&mut self, _: &Hierarchy, _: u32, _: u8, _: u8, _: &mut Tally) -> Verdict {
        Verdict { outside: 0, carry: [0; 8] }
    }

    fn filter(&mut self, _: &Hierarchy, list: &mut DrawList, tally: &mut Tally) {
        if self.drawn.is_empty() {
            return;
        }
        let compacted = list.compacted;
        let (mut looked_up, mut copies) = (0, 0);
        list.retain_words(|first, words| {
            for (w, word) in words.iter_mut().enumerate() {
                let mut asked = *word & self.repeated[first + w];
                looked_up += u64::from(asked.count_ones());
                while asked != 0 {
                    let bit = asked.trailing_zeros();
                    let note = &mut self.drawn[self.number[(first + w) * WORD + bit as usize] as usize];
                    let copy = *note == self.frame;
                    *note = self.frame;
                    *word &= !(u64::from(copy) << bit);
                    copies += u64::from(copy);
                    asked &= asked - 1;
                }
            }
        });
        list.compacted = compacted || copies > 0;
        tally.notes_read += looked_up;
        tally.copies_dropped += copies;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, DVec3, Pose};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{RngCore, SeedableRng};
    use std::collections::HashSet;

    fn scene(triangles: usize) -> Scene {
        Scene { triangles: vec![[0; 3]; triangles], ..Scene::default() }
    }

    #[test]
    fn the_first_of_every_triangle_stays_and_no_other() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let view = View::new(&Camera::default(), &Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z });
        for (triangles, entries) in [(1usize, 1usize), (1, 200), (40, 40), (40, 41), (300, 2000)] {
            let mut all: Vec<u32> = (0..triangles as u32).collect();
            all.extend((triangles..entries).map(|_| rng.next_u32() % triangles as u32));
            let h = Hierarchy { entries: all.clone(), ..Hierarchy::default() };
            let mut mailbox = Mailbox::default();
            let bytes = mailbox.prepare(&scene(triangles), &h);
            assert_eq!(bytes == 0, triangles == entries);
            mailbox.frame = u32::MAX - 3;
            for round in 0..8 {
                let mut list = DrawList::default();
                let kept = |p: u32| round == 0 || !(p / 7 + round).is_multiple_of(3);
                (0..entries as u32).filter(|p| kept(*p)).for_each(|p| list.push(p, p + 1));
                list.compacted = round % 2 == 1;
                let before = list.clone();
                let mut seen = HashSet::new();
                let plainly: Vec<u32> = before.positions().filter(|p| seen.insert(all[*p as usize])).collect();
                let mut tally = Tally::default();
                mailbox.begin(&view, &h);
                mailbox.filter(&h, &mut list, &mut tally);
                assert_eq!(list.positions().collect::<Vec<_>>(), plainly);
                assert_eq!(tally.copies_dropped, before.entry_count() - plainly.len() as u64);
                assert_eq!(list.compacted, before.compacted || tally.copies_dropped > 0);
                if tally.copies_dropped == 0 {
                    assert_eq!(list, before);
                }
            }
        }
    }

    #[test]
    fn pieces_are_no_copies() {
        let h = Hierarchy { entries: vec![0, 0], fragments: Some(vec![[DVec3::ZERO; 3]; 2]), ..Hierarchy::default() };
        let mut mailbox = Mailbox::default();
        assert_eq!(mailbox.prepare(&scene(1), &h), 0);
        let mut list = DrawList::default();
        list.push(0, 2);
        mailbox.filter(&h, &mut list, &mut Tally::default());
        assert_eq!((list.ranges, list.compacted), (vec![(0, 2)], false));
    }
}
