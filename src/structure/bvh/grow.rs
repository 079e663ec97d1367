//! The top-down build: binned surface-area heuristic and object median.
//!
//! Records move between two arrays, dealt stably to the sides of a split, so that a
//! node is a slice of one of them and its triangles keep the order of the scene. The
//! box of a child is the union of its bins, known before the records move; so the pass
//! that moves them also fills the bins of both children. One pass a level. Small nodes
//! go on in [`small`].

use super::bins::{Bins, Domain, Split, count_left};
use super::kernel::Kernel;
use super::pages::{self, Arena};
use super::record::{self, Record, Span};
use super::small;
use super::sweep::Sweep;
use super::tree::{Slim, Tree};
use crate::hierarchy::NONE;
use rayon::prelude::*;

/// Deeper nodes are halved: greedy splits can cut off a record at a time.
pub const GREEDY_LEVELS: u8 = 64;
/// Halving 2^32 records ends within as many levels again.
const LEVELS: usize = GREEDY_LEVELS as usize + 34;
/// Nodes with more records are dealt by several tasks.
const WIDE: usize = 1 << 16;
/// Records that a task deals.
const CHUNK: usize = 1 << 14;
/// Subtrees with fewer records are grown by one task.
const TASK: usize = 1 << 12;

/// Nodes of up to so many records have at most so many bins an axis.
const FEW: usize = 64;
const BINS_OF_FEW: usize = 8;

#[derive(Debug, Clone, Copy)]
pub struct Grow {
    pub leaf_size: usize,
    pub bins: usize,
    /// Halve every node instead of asking the heuristic.
    pub median: bool,
    /// Nodes of up to `leaf_size` are divided while that lowers the cost.
    pub by_cost: bool,
    /// Nodes of up to so many triangles are divided by the exact sweep.
    pub sweep: usize,
    pub kernel: Kernel,
}

/// A node in the making.
struct Job<'a> {
    here: &'a mut [Record],
    there: &'a mut [Record],
    sealed: &'a mut [u64],
    level: u8,
    bounds: Span,
    domain: Domain,
    /// Bins an axis.
    bins: usize,
    /// Whether bounds, domain and bins are known.
    binned: bool,
}

/// Working memory of a task.
struct Scratch {
    kernel_sets: [Bins; 2],
    own: Bins,
    sweep: Sweep,
    /// Bins of children, a pair for each level that a task is within.
    free: Vec<Box<[Bins; 2]>>,
}

impl Scratch {
    fn new() -> Box<Scratch> {
        Box::new(Scratch { kernel_sets: [Bins::ZERO; 2], own: Bins::ZERO, sweep: Sweep::default(), free: Vec::new() })
    }

    fn pair(&mut self) -> Box<[Bins; 2]> {
        self.free.pop().unwrap_or_else(|| Box::new([Bins::ZERO; 2]))
    }
}

impl Grow {
    /// Builds over `records`; their keys (see [`Record::key`]) come out leaf by leaf.
    pub fn run(&self, mut records: Arena) -> (Vec<Slim>, Vec<u64>) {
        let mut sealed = pages::zeros(records.len());
        if records.is_empty() {
            return (Vec::new(), sealed);
        }
        let mut there = Arena::zeroed(records.len());
        let job = Job {
            here: &mut records,
            there: &mut there,
            sealed: &mut sealed,
            level: 0,
            bounds: Record::EMPTY,
            domain: Domain::over([0.0; 3], [0.0; 3], self.bins),
            bins: self.bins,
            binned: false,
        };
        let tree = self.plant(job, &Bins::ZERO, &mut Scratch::new());
        (tree.join(), sealed)
    }

    /// Grows large nodes here and their subtrees in tasks.
    fn plant(&self, mut job: Job, bins: &Bins, scratch: &mut Scratch) -> Tree {
        if job.here.len() <= TASK.max(self.sweep) || rayon::current_num_threads() == 1 {
            let mut out = pages::with_capacity(self.likely_nodes(job.here.len()));
            out.push(Slim::UNBORN);
            self.grow(job, bins, scratch, &mut out, 0);
            return Tree::Part(out);
        }
        let mut pair = scratch.pair();
        let Some(split) = self.divide(&mut job, bins, &mut pair, scratch) else {
            return Tree::Part(vec![seal(self.kernel, job.here, job.sealed, &job.bounds)]);
        };
        let bounds = job.bounds.bounds();
        let [left, right] = job.sides(split);
        let (left, right) =
            rayon::join(|| self.plant(left, &pair[0], scratch), || self.plant(right, &pair[1], &mut Scratch::new()));
        Tree::Fork(bounds, Box::new([left, right]))
    }

    /// Room for the nodes over so many records: growing the array copies it, and room
    /// that is not used costs nothing.
    fn likely_nodes(&self, records: usize) -> usize {
        let leaf = if self.by_cost { 2 } else { self.leaf_size.div_ceil(2) };
        2 * records.div_ceil(leaf)
    }

    fn grow(&self, mut job: Job, bins: &Bins, scratch: &mut Scratch, out: &mut Vec<Slim>, slot: usize) {
        if job.here.len() <= self.sweep && !self.median {
            let Job { here, there, sealed, level, bounds, .. } = job;
            return small::grow(self, [here, there], sealed, level, bounds, &mut scratch.sweep, out, slot);
        }
        let mut pair = scratch.pair();
        if let Some(split) = self.divide(&mut job, bins, &mut pair, scratch) {
            let child = out.len();
            out[slot] = Slim { bounds: job.bounds.bounds(), child: child as u32, count: job.here.len() as u32 };
            out.extend([Slim::UNBORN; 2]);
            let [left, right] = job.sides(split);
            self.grow(left, &pair[0], scratch, out, child);
            self.grow(right, &pair[1], scratch, out, child + 1);
        } else {
            out[slot] = seal(self.kernel, job.here, job.sealed, &job.bounds);
        }
        scratch.free.push(pair);
    }

    /// Deals the records of a node to its children, and fills the children's bins; nothing
    /// for a leaf.
    fn divide(&self, job: &mut Job, bins: &Bins, pair: &mut [Bins; 2], scratch: &mut Scratch) -> Option<Divided> {
        let n = job.here.len();
        if n == 1 || (n <= self.leaf_size && (!self.by_cost || self.median)) {
            return None;
        }
        if self.median || job.level >= GREEDY_LEVELS {
            return Some(self.halve(job));
        }
        let mut split = if job.binned { self.kernel.best(bins, job.bins) } else { None };
        let mut from = bins;
        if split.is_none_or(|s| s.cost == 0.0) {
            // All in one bin: the domain may be loose.
            self.measure(job);
            self.fill(job, scratch);
            from = &scratch.own;
            split = self.kernel.best(from, job.bins);
        }
        let cost = split.map_or(f32::INFINITY, |s| s.cost);
        if n <= self.leaf_size && !small::pays(&job.bounds, n, cost) {
            return None;
        }
        // Without area every plane is as good: halve.
        let Some(split) = split.filter(|s| s.cost > 0.0) else { return Some(self.halve(job)) };
        let bounds = self.kernel.sides(from, &split, job.bins);
        let left = split.left as usize;
        let larger = left.max(n - left);
        let bins_below = self.bins_for(larger);
        let below = self.kernel.below(from, &job.domain, job.bins, &split, &bounds, bins_below);
        let unbinned = if self.by_cost { 1 } else { self.leaf_size }.max(self.sweep);
        let d = Divided { left, bounds, domains: below, bins: bins_below, binned: larger > unbinned, moved: true };
        self.deal(job, &split, &d, pair, scratch);
        Some(d)
    }

    /// Small nodes have more bins than they need.
    fn bins_for(&self, records: usize) -> usize {
        if records <= FEW { self.bins.min(BINS_OF_FEW) } else { self.bins }
    }

    fn fill(&self, job: &Job, scratch: &mut Scratch) {
        let (records, domain, bins) = (&*job.here, &job.domain, job.bins);
        if records.len() < WIDE || rayon::current_num_threads() == 1 {
            let [spare, _] = &mut scratch.kernel_sets;
            return self.kernel.fill(records, domain, bins, &mut scratch.own, spare);
        }
        let parts: Vec<Box<[Bins; 2]>> = records
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut sets = Box::new([Bins::ZERO; 2]);
                let [own, spare] = &mut *sets;
                self.kernel.fill(chunk, domain, bins, own, spare);
                sets
            })
            .collect();
        scratch.own.clear(bins);
        parts.iter().for_each(|p| scratch.own.merge(&p[0], bins));
    }

    fn deal(&self, job: &mut Job, split: &Split, to: &Divided, pair: &mut [Bins; 2], scratch: &mut Scratch) {
        let (records, domain, below, bins) = (&*job.here, &job.domain, &to.domains, to.bins);
        let (left, right) = job.there.split_at_mut(to.left);
        if !to.binned {
            return self.kernel.part(records, [left, right], domain, split);
        }
        if records.len() < WIDE || rayon::current_num_threads() == 1 {
            let sets = &mut scratch.kernel_sets;
            return self.kernel.deal(records, [left, right], domain, split, below, bins, pair.each_mut(), sets);
        }
        // Each task writes to its own part of each side: the order is that of one pass.
        let counts: Vec<usize> = records.par_chunks(CHUNK).map(|c| count_left(c, domain, split)).collect();
        let mut rest = (left, right);
        let mut tasks = Vec::with_capacity(counts.len());
        for (chunk, count) in records.chunks(CHUNK).zip(counts) {
            let (a, left) = rest.0.split_at_mut(count);
            let (b, right) = rest.1.split_at_mut(chunk.len() - count);
            rest = (left, right);
            tasks.push((chunk, [a, b]));
        }
        let parts: Vec<Box<[[Bins; 2]; 2]>> = tasks
            .into_par_iter()
            .map(|(chunk, sides)| {
                let mut sets = Box::new([const { [Bins::ZERO; 2] }; 2]);
                let [out, spare] = &mut *sets;
                self.kernel.deal(chunk, sides, domain, split, below, bins, out.each_mut(), spare);
                sets
            })
            .collect();
        pair.iter_mut().for_each(|p| p.clear(bins));
        for part in parts {
            pair[0].merge(&part[0][0], bins);
            pair[1].merge(&part[0][1], bins);
        }
    }

    /// Bounds and domain from the records themselves.
    fn measure(&self, job: &mut Job) {
        let (span, lo, hi) = self.kernel.extent(job.here);
        job.bounds = span;
        job.bins = self.bins_for(job.here.len());
        job.domain = Domain::over(lo, hi, job.bins);
    }

    fn halve(&self, job: &mut Job) -> Divided {
        let left;
        (left, job.bounds) = halve(self.kernel, job.here);
        let unknown = [Record::EMPTY; 2];
        Divided { left, bounds: unknown, domains: [job.domain; 2], bins: job.bins, binned: false, moved: false }
    }
}

/// Object median along the longest axis of the centroids; ties by triangle.
pub fn halve(kernel: Kernel, records: &mut [Record]) -> (usize, Span) {
    let (span, lo, hi) = kernel.extent(records);
    let axis = Domain::over(lo, hi, 1).longest_axis();
    let left = records.len() / 2;
    let by_centre =
        |a: &Record, b: &Record| a.centre2(axis).total_cmp(&b.centre2(axis)).then(a.triangle().cmp(&b.triangle()));
    records.select_nth_unstable_by(left, by_centre);
    (left, span)
}

/// What became of a node's records.
struct Divided {
    left: usize,
    bounds: [Span; 2],
    domains: [Domain; 2],
    bins: usize,
    binned: bool,
    /// Whether they are in the other array now.
    moved: bool,
}

impl<'a> Job<'a> {
    fn sides(self, d: Divided) -> [Job<'a>; 2] {
        let (here, there) = if d.moved { (self.there, self.here) } else { (self.here, self.there) };
        let (here, there) = (here.split_at_mut(d.left), there.split_at_mut(d.left));
        let sealed = self.sealed.split_at_mut(d.left);
        let level = self.level + 1;
        debug_assert!(usize::from(level) < LEVELS);
        let job = |here, there, sealed, side: usize| Job {
            here,
            there,
            sealed,
            level,
            bounds: d.bounds[side],
            domain: d.domains[side],
            bins: d.bins,
            binned: d.binned,
        };
        [job(here.0, there.0, sealed.0, 0), job(here.1, there.1, sealed.1, 1)]
    }
}

/// The leaf of all of `records`; `bounds` may be unknown.
pub fn seal(kernel: Kernel, records: &[Record], sealed: &mut [u64], bounds: &Span) -> Slim {
    record::seal(records, sealed);
    let bounds = if bounds.is_empty() { kernel.extent(records).0 } else { *bounds };
    Slim { bounds: bounds.bounds(), child: NONE, count: records.len() as u32 }
}
