//! The kd-tree under the loose policy: each triangle once, by centroid.

use super::cost::{Cost, share};
use super::{EXACT, KdTree, TASK, Tree, median};
use crate::math::{Aabb, Box32, DVec3};
use crate::scene::Scene;
use crate::structure::builder::leaves::{Branch, Leaf};
use rayon::prelude::*;

/// Bins an axis of a large node.
const BINS: usize = 32;
/// Items a task puts into bins.
const CHUNK: usize = 1 << 14;

#[derive(Debug, Clone, Copy)]
pub struct Item {
    pub centroid: DVec3,
    pub bounds: Box32,
    pub triangle: u32,
}

/// What goes below: centroids below a plane, or in bins below one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Below {
    Plane(f64),
    Bin { lo: f64, bins_per_m: f64, bin: usize },
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    pub cost: f64,
    pub axis: usize,
    pub below: Below,
}

impl Cut {
    fn is_below(&self, item: &Item) -> bool {
        let x = item.centroid[self.axis];
        match self.below {
            Below::Plane(at) => x < at,
            Below::Bin { lo, bins_per_m, bin } => bin_of(x, lo, bins_per_m) < bin,
        }
    }
}

fn bin_of(x: f64, lo: f64, bins_per_m: f64) -> usize {
    (((x - lo) * bins_per_m) as usize).min(BINS - 1)
}

pub fn grow(params: &KdTree, scene: &Scene, boxes: &[Box32]) -> Tree {
    let item = |t: u32| {
        let [a, b, c] = scene.corners(t);
        Item { centroid: (a + b + c) / 3.0, bounds: boxes[t as usize], triangle: t }
    };
    let mut items: Vec<Item> = (0..scene.len() as u32).into_par_iter().with_min_len(4096).map(item).collect();
    divide(params, scene.len(), &mut items, 0)
}

fn divide(params: &KdTree, all: usize, items: &mut [Item], depth: u32) -> Tree {
    let n = items.len();
    let cut = match params.cost {
        _ if params.is_leaf(n, depth, all) => None,
        Some(cost) => best(&cost, items).filter(|cut| cut.cost < cost.leaf(n)),
        None => median_cut(items),
    };
    let Some(cut) = cut else {
        let triangles = items.iter().map(|i| i.triangle).collect();
        return Branch::Leaf(Leaf { cell: Aabb::EMPTY, not_ours: 0, triangles });
    };
    let at = partition(items, |i| cut.is_below(i));
    debug_assert!(0 < at && at < n, "a cut parts the centroids");
    let (below, above) = items.split_at_mut(at);
    let (below, above) = if n < TASK {
        (divide(params, all, below, depth + 1), divide(params, all, above, depth + 1))
    } else {
        rayon::join(|| divide(params, all, below, depth + 1), || divide(params, all, above, depth + 1))
    };
    Branch::Inner(vec![below, above])
}

/// Moves what `first` holds of to the front; returns how many.
fn partition(items: &mut [Item], first: impl Fn(&Item) -> bool) -> usize {
    let (mut i, mut j) = (0, items.len());
    while i < j {
        if first(&items[i]) {
            i += 1;
        } else {
            j -= 1;
            items.swap(i, j);
        }
    }
    i
}

/// The widest axis first, of those that the centroids do not share.
fn median_cut(items: &[Item]) -> Option<Cut> {
    let size = Aabb::of_points(items.iter().map(|i| &i.centroid)).size();
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| size[*b].total_cmp(&size[*a]));
    axes.into_iter().find_map(|axis| {
        let at = median(&mut items.iter().map(|i| i.centroid[axis]).collect::<Vec<_>>())?;
        Some(Cut { cost: 0.0, axis, below: Below::Plane(at) })
    })
}

/// The cheapest cut; of equals the first axis and the lowest plane. `None` if all
/// centroids coincide.
fn best(cost: &Cost, items: &[Item]) -> Option<Cut> {
    if items.len() <= EXACT {
        return sweep(cost, items);
    }
    // All centroids but a few in one bin is what bins cannot part.
    binned(cost, items).or_else(|| sweep(cost, items))
}

fn size(b: &Box32) -> DVec3 {
    b.hi.as_dvec3() - b.lo.as_dvec3()
}

fn union<'a>(items: impl IntoIterator<Item = &'a Item>) -> Box32 {
    items.into_iter().fold(Box32::EMPTY, |b, i| b.union(i.bounds))
}

/// Every plane between two centroids, on every axis.
pub fn sweep(cost: &Cost, items: &[Item]) -> Option<Cut> {
    let whole = size(&union(items));
    let n = items.len();
    let mut found: Option<Cut> = None;
    let mut above = vec![0.0; n];
    for axis in 0..3 {
        let mut order: Vec<(f64, u32)> = (0..n as u32).map(|i| (items[i as usize].centroid[axis], i)).collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let bounds = |i: usize| items[order[i].1 as usize].bounds;
        let mut grown = Box32::EMPTY;
        for i in (1..n).rev() {
            grown = grown.union(bounds(i));
            above[i] = share(size(&grown), whole);
        }
        grown = Box32::EMPTY;
        for i in 1..n {
            grown = grown.union(bounds(i - 1));
            if order[i - 1].0 < order[i].0 {
                let cost = cost.split([share(size(&grown), whole), above[i]], [i, n - i]);
                if found.is_none_or(|f| cost < f.cost) {
                    found = Some(Cut { cost, axis, below: Below::Plane(order[i].0) });
                }
            }
        }
    }
    found
}

#[derive(Debug, Clone, Copy)]
struct Bin {
    count: usize,
    bounds: Box32,
}

const NO_BIN: Bin = Bin { count: 0, bounds: Box32::EMPTY };

impl Bin {
    fn with(self, o: &Bin) -> Bin {
        Bin { count: self.count + o.count, bounds: self.bounds.union(o.bounds) }
    }
}

/// Planes between bins of equal width over the centroids.
fn binned(cost: &Cost, items: &[Item]) -> Option<Cut> {
    let of = |chunk: &[Item]| Aabb::of_points(chunk.iter().map(|i| &i.centroid));
    let centroids = items.par_chunks(CHUNK).map(of).reduce(|| Aabb::EMPTY, Aabb::union);
    let per_m = DVec3::splat(BINS as f64) / centroids.size();
    let fill = |chunk: &[Item]| {
        let mut bins = [[NO_BIN; BINS]; 3];
        for item in chunk {
            for (axis, bins) in bins.iter_mut().enumerate().filter(|(axis, _)| per_m[*axis].is_finite()) {
                let bin = &mut bins[bin_of(item.centroid[axis], centroids.lo[axis], per_m[axis])];
                *bin = bin.with(&Bin { count: 1, bounds: item.bounds });
            }
        }
        bins
    };
    let add = |a: [[Bin; BINS]; 3], b: [[Bin; BINS]; 3]| {
        [0, 1, 2].map(|axis| std::array::from_fn(|i| a[axis][i].with(&b[axis][i])))
    };
    let bins = items.par_chunks(CHUNK).map(fill).reduce(|| [[NO_BIN; BINS]; 3], add);
    let whole = size(&bins.iter().flatten().fold(Box32::EMPTY, |b, bin| b.union(bin.bounds)));
    let mut found: Option<Cut> = None;
    for (axis, bins) in bins.iter().enumerate() {
        let mut above = [NO_BIN; BINS];
        let mut sum = NO_BIN;
        for i in (1..BINS).rev() {
            sum = sum.with(&bins[i]);
            above[i] = sum;
        }
        sum = NO_BIN;
        for i in 1..BINS {
            sum = sum.with(&bins[i - 1]);
            if sum.count == 0 || above[i].count == 0 {
                continue;
            }
            let shares = [sum.bounds, above[i].bounds].map(|b| share(size(&b), whole));
            let cost = cost.split(shares, [sum.count, above[i].count]);
            if found.is_none_or(|f| cost < f.cost) {
                let below = Below::Bin { lo: centroids.lo[axis], bins_per_m: per_m[axis], bin: i };
                found = Some(Cut { cost, axis, below });
            }
        }
    }
    found
}
