//! The kd-tree that parts space: a triangle is in every cell that it reaches into.

use super::cost::{Cost, share};
use super::{EXACT, KdTree, TASK, Tree, median};
use crate::math::Aabb;
use crate::scene::Scene;
use crate::structure::builder::cut::{intersection, triangle_overlaps};
use crate::structure::builder::leaves::{Branch, Leaf};
use crate::structure::builder::scene_bounds;
use crate::structure::builder::straddle::Budget;
use rayon::prelude::*;

/// Bins an axis of a large node.
const BINS: usize = 64;
/// A median that makes more than 3/2 of the triangles there were parts too little.
const GROWTH: (usize, usize) = (3, 2);

/// A triangle and its box, cut to the node's cell.
#[derive(Debug, Clone, Copy)]
pub struct Item {
    pub triangle: u32,
    pub bounds: Aabb,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    pub cost: f64,
    pub axis: usize,
    pub at: f64,
    /// What lies in the plane goes below.
    pub flat_below: bool,
}

/// `None` past the budget.
pub fn grow(params: &KdTree, scene: &Scene, budget: &Budget) -> Option<Tree> {
    let item = |t: u32| Item { triangle: t, bounds: scene.triangle_aabb(t) };
    let items: Vec<Item> = (0..scene.len() as u32).into_par_iter().with_min_len(4096).map(item).collect();
    budget.spend(items.len())?;
    Growth { params, scene, budget }.divide(items, scene_bounds(scene), 0)
}

struct Growth<'a> {
    params: &'a KdTree,
    scene: &'a Scene,
    budget: &'a Budget,
}

impl Growth<'_> {
    fn divide(&self, items: Vec<Item>, cell: Aabb, depth: u32) -> Option<Tree> {
        let n = items.len();
        let parts = match self.params.cost {
            _ if self.params.is_leaf(n, depth, self.scene.len()) => None,
            Some(cost) => best(&cost, &items, &cell)
                .filter(|cut| cut.cost < cost.leaf(n))
                .map(|cut| self.separate(&cut, &items, &cell))
                .filter(|parts| parts.iter().any(|(part, _)| part.len() < n)),
            None => self.at_median(&items, &cell),
        };
        let Some([(below, lower), (above, upper)]) = parts else {
            let triangles = items.iter().map(|i| i.triangle).collect();
            return Some(Branch::Leaf(Leaf { cell, not_ours: 0, triangles }));
        };
        self.budget.spend((below.len() + above.len()).saturating_sub(n))?;
        drop(items);
        let (below, above) = if n < TASK {
            (self.divide(below, lower, depth + 1), self.divide(above, upper, depth + 1))
        } else {
            rayon::join(|| self.divide(below, lower, depth + 1), || self.divide(above, upper, depth + 1))
        };
        Some(Branch::Inner(vec![below?, above?]))
    }

    /// Who is below a plane and who is above, with the cells there.
    fn separate(&self, cut: &Cut, items: &[Item], cell: &Aabb) -> [(Vec<Item>, Aabb); 2] {
        let (mut lower, mut upper) = (*cell, *cell);
        (lower.hi[cut.axis], upper.lo[cut.axis]) = (cut.at, cut.at);
        let (mut below, mut above) = (Vec::new(), Vec::new());
        for item in items {
            let (lo, hi) = (item.bounds.lo[cut.axis], item.bounds.hi[cut.axis]);
            let (mut is_below, mut is_above) = (lo < cut.at, hi > cut.at);
            if is_below && is_above {
                let corners = self.scene.corners(item.triangle);
                is_below = triangle_overlaps(&corners, &lower);
                is_above = triangle_overlaps(&corners, &upper);
            } else if !is_below && !is_above {
                (is_below, is_above) = (cut.flat_below, !cut.flat_below);
            }
            if is_below {
                below.push(Item { bounds: intersection(&item.bounds, &lower), ..*item });
            }
            if is_above {
                above.push(Item { bounds: intersection(&item.bounds, &upper), ..*item });
            }
        }
        [(below, lower), (above, upper)]
    }

    /// Halves by the middles of what the cell leaves of the boxes, the widest axis
    /// first, if both get fewer triangles and not too many in all.
    fn at_median(&self, items: &[Item], cell: &Aabb) -> Option<[(Vec<Item>, Aabb); 2]> {
        let mut axes = [0, 1, 2];
        axes.sort_by(|a, b| cell.size()[*b].total_cmp(&cell.size()[*a]));
        axes.into_iter().find_map(|axis| {
            let at = median(&mut items.iter().map(|i| i.bounds.centre()[axis]).collect::<Vec<_>>())?;
            let cut = Cut { cost: 0.0, axis, at, flat_below: false };
            if !(cell.lo[axis] < at && at < cell.hi[axis]) {
                return None;
            }
            let parts = self.separate(&cut, items, cell);
            let total: usize = parts.iter().map(|(part, _)| part.len()).sum();
            let parted = parts.iter().all(|(part, _)| part.len() < items.len());
            (parted && total * GROWTH.1 <= items.len() * GROWTH.0).then_some(parts)
        })
    }
}

/// The cheapest cut; of equals the first axis and the lowest plane. `None` if none
/// lies inside the cell.
fn best(cost: &Cost, items: &[Item], cell: &Aabb) -> Option<Cut> {
    let coarse = if items.len() > EXACT { binned(cost, items, cell) } else { None };
    // Where bins find nothing worth its cost, a plane between them may be.
    coarse.filter(|cut| cut.cost < cost.leaf(items.len())).or_else(|| sweep(cost, items, cell))
}

/// The cost of a plane across `axis` at `at` with so many triangles below and above.
fn cost_at(cost: &Cost, cell: &Aabb, axis: usize, at: f64, counts: [usize; 2]) -> f64 {
    let size = cell.size();
    let (mut lower, mut upper) = (size, size);
    (lower[axis], upper[axis]) = (at - cell.lo[axis], cell.hi[axis] - at);
    cost.split([share(lower, size), share(upper, size)], counts)
}

/// Every plane at an end of a box, on every axis, with flat boxes on either side.
pub fn sweep(cost: &Cost, items: &[Item], cell: &Aabb) -> Option<Cut> {
    let mut found: Option<Cut> = None;
    for axis in 0..3 {
        let (mut starts, mut ends, mut flats) = (Vec::new(), Vec::new(), Vec::new());
        for i in items {
            let (lo, hi) = (i.bounds.lo[axis], i.bounds.hi[axis]);
            if lo == hi {
                flats.push(lo);
            } else {
                starts.push(lo);
                ends.push(hi);
            }
        }
        for ends in [&mut starts, &mut ends, &mut flats] {
            ends.sort_unstable_by(f64::total_cmp);
        }
        // Starts and flats below the plane; ends and flats not above it.
        let (mut started, mut ended, mut below, mut passed) = (0, 0, 0, 0);
        loop {
            let next = [starts.get(started), ends.get(ended), flats.get(passed)];
            let Some(at) = next.into_iter().flatten().copied().min_by(f64::total_cmp) else { break };
            let skip = |from: usize, v: &[f64]| from + v[from..].iter().take_while(|x| **x == at).count();
            ended = skip(ended, &ends);
            passed = skip(passed, &flats);
            if cell.lo[axis] < at && at < cell.hi[axis] {
                let (under, over, flat) = (started + below, ends.len() - ended + flats.len() - passed, passed - below);
                for (flat_below, counts) in [(true, [under + flat, over]), (false, [under, over + flat])] {
                    let cost = cost_at(cost, cell, axis, at, counts);
                    if found.is_none_or(|f| cost < f.cost) {
                        found = Some(Cut { cost, axis, at, flat_below });
                    }
                }
            }
            started = skip(started, &starts);
            below = passed;
        }
    }
    found
}

/// Planes between bins of equal width over the boxes, and at the boxes' outer ends,
/// where they cut off empty space. Counts are exact but for ends at a border.
fn binned(cost: &Cost, items: &[Item], cell: &Aabb) -> Option<Cut> {
    let bounds = items.iter().fold(Aabb::EMPTY, |b, i| b.union(i.bounds));
    let mut found: Option<Cut> = None;
    for axis in 0..3 {
        let (lo, size) = (bounds.lo[axis], bounds.size()[axis]);
        let per_m = BINS as f64 / size;
        if !per_m.is_finite() {
            continue;
        }
        let bin = |x: f64| (((x - lo) * per_m) as usize).min(BINS - 1);
        let (mut starts, mut ends) = ([0usize; BINS], [0usize; BINS]);
        for i in items {
            starts[bin(i.bounds.lo[axis])] += 1;
            ends[bin(i.bounds.hi[axis])] += 1;
        }
        let (mut below, mut above) = (0, items.len());
        for border in 0..=BINS {
            if border > 0 {
                below += starts[border - 1];
                above -= ends[border - 1];
            }
            let at = if border == BINS { bounds.hi[axis] } else { lo + size * (border as f64 / BINS as f64) };
            if cell.lo[axis] < at && at < cell.hi[axis] {
                let cost = cost_at(cost, cell, axis, at, [below, above]);
                if found.is_none_or(|f| cost < f.cost) {
                    found = Some(Cut { cost, axis, at, flat_below: border == BINS });
                }
            }
        }
    }
    found
}
