//! The frames of the probe, counting work on them and timing it.

use super::sample::Scale;
use super::{Combination, Considered, Question};
use crate::culling::{self, Class, DrawList, Tally, Test, Walk, cull};
use crate::error::{Error, Result};
use crate::hierarchy::Hierarchy;
use crate::math::View;
use crate::record::TimeModel;
use crate::scene::Scene;
use crate::stats;
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Instant;

/// So many times the frames of the probe does the short list cull: where frames differ
/// much, which of them a probe holds decides between near rivals.
pub const TIMED: usize = 4;

/// Frames in a row: methods may remember the frame before. More of them would leave fewer
/// places to look at, and rooms of a house differ much.
const BURST: usize = 2;

/// About `count` frames of `0..frames` in bursts of neighbours, evenly spread.
pub fn frames(frames: usize, count: usize) -> Vec<u32> {
    if frames <= count {
        return (0..frames as u32).collect();
    }
    let bursts = count.div_ceil(BURST).max(1);
    let start = |i: usize| if bursts == 1 { 0 } else { i * (frames - BURST.min(frames)) / (bursts - 1) };
    let mut all: Vec<u32> = (0..bursts).flat_map(|i| (start(i)..start(i) + BURST).map(|f| f as u32)).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Mean work of a frame, by the names of counters, and what is submitted.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Counts {
    pub work: BTreeMap<&'static str, f64>,
    pub entries: f64,
    pub draw_calls: f64,
}

impl Counts {
    pub fn of(&self, name: &str) -> f64 {
        match name {
            "frames" => 1.0,
            _ => self.work.get(name).copied().unwrap_or(0.0),
        }
    }

    /// Of a sample to the whole: what goes with triangles or materials grows, nodes stay.
    pub fn scaled(mut self, scale: Scale) -> Counts {
        let one_in = f64::from(scale.one_in);
        self.entries *= one_in;
        let ranges = self.of("ranges").min(self.draw_calls);
        self.draw_calls = ranges + (self.draw_calls - ranges) * scale.material_changes;
        for name in ["triangle_tests", "predicates", "notes_read", "copies_dropped"] {
            if let Some(x) = self.work.get_mut(name) {
                *x *= one_in;
            }
        }
        self
    }

    pub fn draw_ns(&self, model: &TimeModel) -> f64 {
        model.render_ns(self.entries, self.draw_calls)
    }
}

/// What timing the probe gave, a frame's mean.
#[derive(Debug, Clone, Serialize)]
pub struct Timing {
    /// Median over turns, with its 95 % interval in `low_ns` and `high_ns` of the objective.
    pub cull_ns: f64,
    pub draw_ns: f64,
    pub objective_ns: f64,
    pub low_ns: f64,
    pub high_ns: f64,
    pub counts: Counts,
    /// Modelled drawing by bursts of neighbouring frames: how much places differ.
    #[serde(skip)]
    pub draw_ns_by_burst: Vec<f64>,
    pub build_ns: f64,
    /// Structure and columns of tests.
    pub bytes: usize,
}

/// A structure over a scene, with the tests and the walk of one combination.
pub struct Built {
    hierarchy: Hierarchy,
    tests: Vec<Box<dyn Test>>,
    walk: Box<dyn Walk>,
    build_ns: f64,
    test_bytes: usize,
    list: DrawList,
    prepared: Option<Combination>,
}

impl Built {
    /// # Errors
    /// When the structure does not suit the scene, or the walk the structure.
    pub fn new(scene: &Scene, combination: &Combination) -> Result<Built> {
        let start = Instant::now();
        let hierarchy = crate::structure::make(&combination.structure)?.0.build(scene)?;
        let mut built = Built {
            hierarchy,
            tests: Vec::new(),
            walk: culling::make_walk(&combination.walk)?.0,
            build_ns: 0.0,
            test_bytes: 0,
            list: DrawList::default(),
            prepared: None,
        };
        built.take(scene, combination)?;
        built.build_ns = start.elapsed().as_nanos() as f64;
        Ok(built)
    }

    /// Other tests and another walk over the same structure.
    fn take(&mut self, scene: &Scene, combination: &Combination) -> Result<()> {
        if self.prepared.as_ref().is_some_and(|p| (&p.culling, &p.walk) == (&combination.culling, &combination.walk)) {
            return Ok(());
        }
        self.tests = culling::make_tests(&combination.culling)?.0;
        self.walk = culling::make_walk(&combination.walk)?.0;
        if let Some(why) = self.walk.refuses(&self.hierarchy) {
            return Err(Error::new(format!("the walk cannot run over this structure: {why}")));
        }
        let of_tests: usize = self.tests.iter_mut().map(|t| t.prepare(scene, &self.hierarchy)).sum();
        self.test_bytes = of_tests + self.walk.prepare(scene, &self.hierarchy);
        self.prepared = Some(combination.clone());
        Ok(())
    }

    /// Class and mean counts of `combination`, whose structure this is, over `views`.
    pub fn count(&mut self, scene: &Scene, combination: &Combination, views: &[View]) -> Result<(Class, Counts)> {
        self.take(scene, combination)?;
        let (class, _) = culling::promise(&self.tests, self.walk.as_ref());
        Ok((class, self.pass(views)))
    }

    /// One pass over `views` from a fresh start.
    pub fn pass(&mut self, views: &[View]) -> Counts {
        self.pass_with(views, &mut |_, _| ())
    }

    /// The same; `each` gets entries and draw calls of every frame.
    fn pass_with(&mut self, views: &[View], each: &mut dyn FnMut(u64, u64)) -> Counts {
        self.reset();
        let (mut tally, mut counts) = (Tally::default(), Counts::default());
        let (mut entries, mut calls, mut ranges) = (0, 0, 0);
        for view in views {
            self.cull(view, &mut tally);
            let of_frame = (self.list.entry_count(), self.list.draw_calls(&self.hierarchy));
            each(of_frame.0, of_frame.1);
            entries += of_frame.0;
            calls += of_frame.1;
            ranges += self.list.ranges.len() as u64;
        }
        let mean = |sum: u64| sum as f64 / views.len() as f64;
        counts.work = tally.named().iter().map(|(name, _, sum)| (*name, mean(*sum))).collect();
        counts.work.insert("ranges", mean(ranges));
        // A list is scanned by wide kernels, at a tenth of what a node of a tree costs.
        if self.hierarchy.links.len() == self.hierarchy.root_blocks as usize {
            let scanned = counts.work.insert("nodes_visited", 0.0).unwrap_or_default();
            counts.work.insert("nodes_scanned", scanned);
        }
        (counts.entries, counts.draw_calls) = (mean(entries), mean(calls));
        counts
    }

    fn reset(&mut self) {
        self.tests.iter_mut().for_each(|t| t.reset());
        self.walk.reset();
    }

    fn cull(&mut self, view: &View, tally: &mut Tally) {
        cull(view, &self.hierarchy, &mut self.tests, self.walk.as_mut(), &mut self.list, tally);
    }

    /// Mean nanoseconds of a frame in one pass.
    pub fn time(&mut self, views: &[View]) -> f64 {
        self.reset();
        let mut tally = Tally::default();
        let start = Instant::now();
        for view in views {
            self.cull(view, &mut tally);
        }
        start.elapsed().as_nanos() as f64 / views.len() as f64
    }
}

/// Times all of `built` (each with its index in `considered`), taking turns.
pub fn time(built: &mut [(usize, Built)], views: &[View], question: &Question, considered: &mut [Considered]) {
    let mut counted = Vec::new();
    for (_, b) in built.iter_mut() {
        let mut drawn = Vec::new();
        let counts = b.pass_with(views, &mut |entries, calls| {
            drawn.push(question.model.render_ns(entries as f64, calls as f64));
        });
        let bursts = drawn.chunks(BURST).map(|b| b.iter().sum::<f64>() / b.len() as f64).collect::<Vec<f64>>();
        counted.push((counts, bursts));
    }
    let mut turns: Vec<Vec<f64>> = vec![Vec::new(); built.len()];
    for turn in 0..question.turns.max(1) + 1 {
        for ((_, b), turns) in built.iter_mut().zip(&mut turns) {
            let ns = b.time(views);
            // The first turn warms the caches.
            if turn > 0 {
                turns.push(ns);
            }
        }
    }
    for (((i, b), turns), (counts, draw_ns_by_burst)) in built.iter().zip(turns).zip(counted) {
        let draw_ns = counts.draw_ns(&question.model);
        let (scale, drawn) = question.parts(draw_ns);
        let (low, high) = stats::median_ci(&turns);
        let cull_ns = stats::median(&turns);
        considered[*i].timed = Some(Timing {
            cull_ns,
            draw_ns,
            objective_ns: scale * cull_ns + drawn,
            low_ns: scale * low + drawn,
            high_ns: scale * high + drawn,
            counts,
            draw_ns_by_burst,
            build_ns: b.build_ns,
            bytes: b.hierarchy.bytes() + b.test_bytes,
        });
    }
}

/// Twice the standard error of the mean difference of two rivals' drawing over the bursts.
pub fn spread_ns(a: &Timing, b: &Timing) -> f64 {
    let pairs = a.draw_ns_by_burst.iter().zip(&b.draw_ns_by_burst);
    let differences: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let squares: f64 = differences.iter().map(|d| (d - mean) * (d - mean)).sum();
    if n < 2.0 { 0.0 } else { 2.0 * (squares / (n - 1.0) / n).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_probe_is_bursts_from_the_first_frame_to_the_last() {
        assert_eq!(frames(5, 64), [0, 1, 2, 3, 4]);
        let probe = frames(2000, 64);
        assert_eq!((probe.len(), probe[0], probe[63]), (64, 0, 1999));
        assert_eq!(probe[..4], [0, 1, 64, 65]);
        let dense = frames(70, 64);
        assert!(dense.windows(2).all(|w| w[0] < w[1]) && *dense.last().unwrap() == 69, "{dense:?}");
        assert_eq!(frames(1, 1), [0]);
    }
}
