//! Dealing triangles to the cells of a [`Grid`], and grids within crowded cells.
//!
//! Non-empty cells alone are kept, as compressed rows (numbers, starts, members):
//! a stable radix sort by the cell's number is a counting sort that needs no
//! counter for an empty cell, and gives the same order at any thread count.
//! Cells are closed where triangles are replicated or split, half-open for centroids.

use super::axes::{Grid, resolution};
use super::cut;
use super::leaves::{Branch, Leaf};
use super::morton::radix_sort;
use super::straddle::{Budget, Policy};
use crate::math::{Aabb, Box32, DVec3};
use crate::scene::Scene;
use rayon::prelude::*;

/// Ranges of so many cells are tested one by one, larger ones by halves first.
const RANGE: u32 = 16;
/// Triangles a task deals.
const CHUNK: usize = 1 << 12;

/// A grid with the members of its non-empty cells, ascending.
pub struct Cells {
    grid: Grid,
    numbers: Vec<u32>,
    /// Cell `i` holds `triangles[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
    triangles: Vec<u32>,
    /// Grids within cells, by index of the cell, ascending.
    below: Vec<(usize, Cells)>,
    /// Outer upper faces whose triangles are another grid's, as [`Leaf::not_ours`].
    not_ours: u8,
}

/// What all grids of one build share.
pub struct Dealer<'a> {
    pub scene: &'a Scene,
    pub policy: Policy,
    pub budget: &'a Budget,
    /// A cell with more triangles gets a grid of its own.
    pub leaf_limit: usize,
    /// Levels of such grids.
    pub levels: u32,
    /// Cells wanted for so many triangles with so many levels below.
    pub cells: &'a (dyn Fn(usize, u32) -> f64 + Sync),
}

impl Dealer<'_> {
    /// All triangles of the scene; `boxes` come back filled for the loose policy. `None` past the budget.
    pub fn deal(&self, grid: Grid, boxes: &mut Vec<Box32>) -> Option<Cells> {
        let all = 0..self.scene.len() as u32;
        let keys = if self.policy == Policy::Loose {
            // Both at once: reading the corners is most of the work.
            let place = |t| {
                let corners = self.scene.corners(t);
                (key(&grid, &corners, t), Aabb::of_points(&corners).relative_to(self.scene.origin))
            };
            let (keys, all_boxes) = all.into_par_iter().with_min_len(CHUNK).map(place).unzip();
            *boxes = all_boxes;
            keys
        } else {
            let all: Vec<u32> = all.collect();
            self.overlapped(&grid, &all)?
        };
        self.sort(grid, keys, self.levels, 0)
    }

    fn within(&self, grid: Grid, triangles: &[u32], levels: u32, not_ours: u8) -> Option<Cells> {
        let keys = match self.policy {
            Policy::Loose => triangles.iter().map(|t| key(&grid, &self.scene.corners(*t), *t)).collect(),
            _ => self.overlapped(&grid, triangles)?,
        };
        self.sort(grid, keys, levels, not_ours)
    }

    /// A key for every cell that each triangle overlaps.
    fn overlapped(&self, grid: &Grid, triangles: &[u32]) -> Option<Vec<u64>> {
        let deal = |chunk: &[u32]| {
            let mut keys = Vec::with_capacity(2 * chunk.len());
            let mut spent = 0;
            for t in chunk {
                let corners = self.scene.corners(*t);
                let (first, last) = grid.span(&Aabb::of_points(&corners));
                overlapped_cells(grid, &corners, first, last, &mut |at| {
                    keys.push(u64::from(grid.number(at)) << 32 | u64::from(*t));
                });
                self.budget.spend(keys.len() - spent)?;
                spent = keys.len();
            }
            Some(keys)
        };
        let parts: Option<Vec<Vec<u64>>> = triangles.par_chunks(CHUNK).map(deal).collect();
        Some(parts?.concat())
    }

    fn sort(&self, grid: Grid, keys: Vec<u64>, levels: u32, not_ours: u8) -> Option<Cells> {
        let sorted = radix_sort(keys, grid.number_bits(), |k| k >> 32);
        let (mut numbers, mut starts) = (Vec::new(), Vec::new());
        for (i, key) in sorted.iter().enumerate() {
            let number = (key >> 32) as u32;
            if numbers.last() != Some(&number) {
                numbers.push(number);
                starts.push(i as u32);
            }
        }
        starts.push(sorted.len() as u32);
        let triangles = sorted.into_iter().map(|k| k as u32).collect();
        let mut cells = Cells { grid, numbers, starts, triangles, below: Vec::new(), not_ours };
        if levels > 0 {
            let crowded = |i: &usize| cells.members(*i).len() > self.leaf_limit;
            let crowded: Vec<usize> = (0..cells.numbers.len()).filter(crowded).collect();
            let below = |i| Some((i, self.nest(&cells, i, levels)?));
            let below: Vec<(usize, Option<Cells>)> = crowded.into_par_iter().map(below).collect::<Option<_>>()?;
            cells.below = below.into_iter().filter_map(|(i, c)| Some((i, c?))).collect();
        }
        Some(cells)
    }

    /// The grid within cell `i`, if it has more than one cell. `None` past the budget.
    fn nest(&self, cells: &Cells, i: usize, levels: u32) -> Option<Option<Cells>> {
        let (members, cell) = (cells.members(i), cells.grid.cell(cells.at(i)));
        let bounds = members.iter().fold(Aabb::EMPTY, |b, t| match self.policy {
            Policy::Loose => b.with(centroid(&self.scene.corners(*t))),
            _ => b.union(cut::intersection(&self.scene.triangle_aabb(*t), &cell)),
        });
        let counts = resolution(bounds.size(), (self.cells)(members.len(), levels - 1));
        let grid = Grid { morton: true, ..Grid::uniform(&bounds, counts) };
        if grid.counts() == [1; 3] {
            return Some(None);
        }
        // Where the members' box ends before the cell's face, nobody is beyond.
        let at_face = (0..3).filter(|axis| bounds.hi[*axis] == cell.hi[*axis]).fold(0, |faces, axis| faces | 1 << axis);
        self.within(grid, members, levels - 1, cells.not_ours(i) & at_face).map(Some)
    }
}

/// Where a triangle belongs under the loose policy, with the triangle's number below.
fn key(grid: &Grid, corners: &[DVec3; 3], triangle: u32) -> u64 {
    u64::from(grid.number(grid.locate(centroid(corners)))) << 32 | u64::from(triangle)
}

fn centroid([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (*a + *b + *c) / 3.0
}

/// The closed cells of `first..=last`, all that the triangle's box touches, that the
/// triangle overlaps. Halving asks about few cells beside those: a large triangle
/// overlaps a surface of cells out of a volume.
fn overlapped_cells(grid: &Grid, corners: &[DVec3; 3], first: [u32; 3], last: [u32; 3], put: &mut dyn FnMut([u32; 3])) {
    let counts = [0, 1, 2].map(|i| last[i] - first[i] + 1);
    let volume = counts.iter().product::<u32>();
    // A row of cells between the ends of the triangle's box is crossed cell by cell.
    let is_row = counts.iter().filter(|n| **n > 1).count() <= 1;
    let all = is_row && corners.iter().all(|p| grid.range(first, last).contains(*p));
    if volume <= RANGE || all {
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    if all || cut::triangle_overlaps(corners, &grid.cell([x, y, z])) {
                        put([x, y, z]);
                    }
                }
            }
        }
        return;
    }
    let longest = (0..3).max_by_key(|i| counts[*i]).expect("three axes");
    let middle = first[longest] + counts[longest] / 2;
    let (mut lower, mut upper) = (last, first);
    (lower[longest], upper[longest]) = (middle - 1, middle);
    for (first, last) in [(first, lower), (upper, last)] {
        if cut::triangle_overlaps(corners, &grid.range(first, last)) {
            overlapped_cells(grid, corners, first, last, put);
        }
    }
}

impl Cells {
    fn members(&self, i: usize) -> &[u32] {
        &self.triangles[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    fn at(&self, i: usize) -> [u32; 3] {
        self.grid.at(self.numbers[i])
    }

    /// As [`Leaf::not_ours`]: all upper faces but the grid's own outer ones.
    fn not_ours(&self, i: usize) -> u8 {
        let (at, counts) = (self.at(i), self.grid.counts());
        let inner = (0..3).filter(|axis| at[*axis] + 1 < counts[*axis]).fold(0, |faces, axis| faces | 1 << axis);
        inner | self.not_ours
    }

    fn leaf(&self, i: usize) -> Branch<Leaf<&[u32]>> {
        Branch::Leaf(Leaf { cell: self.grid.cell(self.at(i)), not_ours: self.not_ours(i), triangles: self.members(i) })
    }

    /// The cells side by side, each with the grids below it.
    pub fn flat(&self) -> Vec<Branch<Leaf<&[u32]>>> {
        let mut below = self.below.iter().peekable();
        (0..self.numbers.len())
            .map(|i| match below.next_if(|(at, _)| *at == i) {
                Some((_, cells)) => Branch::Inner(cells.flat()),
                None => self.leaf(i),
            })
            .collect()
    }

    /// The cells as rows along x, rows as layers in z.
    pub fn rows(&self) -> Vec<Branch<Leaf<&[u32]>>> {
        let mut layers: Vec<(u32, Vec<(u32, Vec<_>)>)> = Vec::new();
        for (i, cell) in self.flat().into_iter().enumerate() {
            let [_, y, z] = self.at(i);
            if layers.last().is_none_or(|l| l.0 != z) {
                layers.push((z, Vec::new()));
            }
            let rows = &mut layers.last_mut().expect("just pushed").1;
            if rows.last().is_none_or(|r| r.0 != y) {
                rows.push((y, Vec::new()));
            }
            rows.last_mut().expect("just pushed").1.push(cell);
        }
        let row = |(_, cells)| Branch::Inner(cells);
        layers.into_iter().map(|(_, rows)| Branch::Inner(rows.into_iter().map(row).collect())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]
        #[test]
        fn halving_finds_the_cells_that_one_by_one_tests_find(
            p in prop::array::uniform3(prop::array::uniform3(-3.0..12.0f64)), counts in prop::array::uniform3(1u32..12), round in any::<bool>(), flat in any::<bool>(),
        ) {
            // Corners outside of the grid, too: members of a crowded cell reach out of it.
            let corners = p.map(|v| DVec3::from(v.map(|x| if round { x.round() } else { x })));
            let bounds = Aabb { lo: DVec3::ZERO, hi: DVec3::new(9.0, 9.0, if flat { 0.0 } else { 9.0 }) };
            let grid = Grid::uniform(&bounds, counts);
            let [x, y, z] = grid.counts();
            let all = (0..x * y * z).map(|i| grid.at(i));
            let naive: Vec<[u32; 3]> = all.filter(|at| cut::triangle_overlaps(&corners, &grid.cell(*at))).collect();
            let (first, last) = grid.span(&Aabb::of_points(&corners));
            let mut found = Vec::new();
            if Aabb::of_points(&corners).overlaps(&bounds) {
                overlapped_cells(&grid, &corners, first, last, &mut |at| found.push(at));
            }
            found.sort_by_key(|at| grid.number(*at));
            prop_assert_eq!(found, naive);
        }
    }

    #[test]
    fn too_many_copies_are_an_error_that_names_the_parameter() {
        let corners = vec![DVec3::ZERO, DVec3::new(9.0, 1.0, 2.0), DVec3::new(1.0, 9.0, 3.0)];
        let scene =
            Scene { positions: corners, triangles: vec![[0, 1, 2]; 50], material_id: vec![0; 50], ..Scene::default() };
        let deal = |limit: u64, counts: u32| {
            let budget = Budget::new(limit);
            let dealer = Dealer {
                scene: &scene,
                policy: Policy::Replicate,
                budget: &budget,
                leaf_limit: 0,
                levels: 0,
                cells: &|_, _| 0.0,
            };
            let cells = dealer.deal(Grid::uniform(&scene.bounds(), [counts; 3]), &mut Vec::new());
            cells.ok_or_else(|| budget.error("a grid", &scene, "density", "lower `density`"))
        };
        let e = deal(3000, 40).err().expect("50 large triangles in 64000 cells");
        assert_eq!(e.key.as_deref(), Some("density"));
        assert!(e.message.contains("3000") && e.help.unwrap().contains("lower `density`"));
        assert!(deal(3000, 2).is_ok());
    }
}
