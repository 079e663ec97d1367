//! Listening to the tests of a run: every one is wrapped in a shell that hands all
//! questions on and notes the answers about nodes.
//!
//! A second walk of the viewer's own would have to repeat how each walk composes
//! carries, order and lanes, would ask tests with a memory twice a frame, and could go
//! wrong unseen. The notes are of the very walk that fills the draw list.

use crate::culling::{Class, DrawList, Removes, Tally, Test, Verdict};
use crate::hierarchy::Hierarchy;
use crate::math::View;
use crate::scene::Scene;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What one test said of lanes of one block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer {
    pub block: u32,
    /// Place of the test in the sum.
    pub test: u8,
    /// Bit per lane.
    pub asked: u8,
    pub outside: u8,
}

/// What was heard since the last [`Watch::clear`].
#[derive(Debug, Default)]
pub struct Heard {
    /// In order.
    pub answers: Vec<Answer>,
    /// What the walk submitted, before triangles were judged one by one; nothing without tests.
    pub submitted: Option<Vec<(u32, u32)>>,
}

type Notes = Arc<Mutex<Heard>>;

pub struct Watch {
    notes: Notes,
}

impl Watch {
    /// Puts a shell around every test.
    pub fn over(tests: &mut Vec<Box<dyn Test>>) -> Watch {
        let notes = Notes::default();
        let watched = std::mem::take(tests).into_iter().enumerate().map(|(i, inner)| -> Box<dyn Test> {
            // Codes of nodes end at 255; nobody adds up that many tests.
            let number = u8::try_from(i).unwrap_or(u8::MAX);
            Box::new(Watched { inner, number, notes: notes.clone(), before: Vec::new() })
        });
        *tests = watched.collect();
        Watch { notes }
    }

    pub fn clear(&self) {
        *lock(&self.notes) = Heard::default();
    }

    pub fn read<T>(&self, with: impl FnOnce(&Heard) -> T) -> T {
        with(&lock(&self.notes))
    }
}

/// Never contended; a panic of the lab leaves plain data behind.
fn lock(notes: &Notes) -> MutexGuard<'_, Heard> {
    notes.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Watched {
    inner: Box<dyn Test>,
    number: u8,
    notes: Notes,
    /// Lanes that were outside before a flat pass.
    before: Vec<u8>,
}

impl Test for Watched {
    fn class(&self) -> Class {
        self.inner.class()
    }

    fn removes(&self) -> Removes {
        self.inner.removes()
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.inner.prepare(scene, hierarchy)
    }

    fn reset(&mut self) {
        self.inner.reset();
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.inner.begin(view, hierarchy);
    }

    fn initial_carry(&self) -> u8 {
        self.inner.initial_carry()
    }

    fn judge(&mut self, hierarchy: &Hierarchy, block: u32, live: u8, carry: u8, tally: &mut Tally) -> Verdict {
        let verdict = self.inner.judge(hierarchy, block, live, carry, tally);
        lock(&self.notes).answers.push(Answer {
            block,
            test: self.number,
            asked: live,
            outside: verdict.outside & live,
        });
        verdict
    }

    fn judge_flat(&mut self, hierarchy: &Hierarchy, outside: &mut [u8], tally: &mut Tally) {
        self.before.clear();
        self.before.extend_from_slice(outside);
        self.inner.judge_flat(hierarchy, outside, tally);
        let mut notes = lock(&self.notes);
        for (block, (before, after)) in (0u32..).zip(self.before.iter().zip(outside)) {
            // Lanes that are not live may come back set.
            let asked = hierarchy.links[block as usize].live & !before;
            if asked != 0 {
                notes.answers.push(Answer { block, test: self.number, asked, outside: *after & asked });
            }
        }
    }

    fn filter(&mut self, hierarchy: &Hierarchy, list: &mut DrawList, tally: &mut Tally) {
        // The first of them has the list as the walk left it.
        lock(&self.notes).submitted.get_or_insert_with(|| list.ranges.clone());
        self.inner.filter(hierarchy, list, tally);
    }

    fn failure(&self) -> Option<String> {
        self.inner.failure()
    }
}
