//! Sweeps against their naive twins, and leaves against the cells they answer for.

use super::cost::{Cost, share};
use super::{KdTree, Tree, loose, median, spatial};
use crate::math::{Aabb, Box32, DVec3};
use crate::scene::Scene;
use crate::structure::builder::cut::{intersection, triangle_overlaps};
use crate::structure::builder::leaves::{Branch, Leaf};
use crate::structure::builder::straddle::{Budget, Policy};
use proptest::prelude::*;

const COST: Cost = Cost { traversal: 15.0, triangle: 20.0, empty_bonus: 0.2 };

fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
    // Whole coordinates make ties, flat boxes and boxes at the cell's faces.
    let point = || prop::array::uniform3(-1.0..9.0f64);
    (prop::collection::vec((point(), point()), 1..24), any::<bool>()).prop_map(|(pairs, round)| {
        let at = |p: [f64; 3]| {
            let p = DVec3::from(p);
            (if round { p.round() } else { p }).clamp(DVec3::ZERO, DVec3::splat(8.0))
        };
        pairs.into_iter().map(|(a, b)| Aabb::of_points(&[at(a), at(b)])).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]
    #[test]
    fn the_sweep_of_ends_finds_what_counting_finds(boxes in boxes(), flat in any::<bool>()) {
        let cell = Aabb { lo: DVec3::ZERO, hi: DVec3::new(8.0, 8.0, if flat { 0.0 } else { 8.0 }) };
        let bounds: Vec<Aabb> =
            boxes.iter().map(|b| Aabb { lo: b.lo.min(cell.hi), hi: b.hi.min(cell.hi) }).collect();
        let items: Vec<spatial::Item> = bounds.iter().map(|b| spatial::Item { triangle: 0, bounds: *b }).collect();
        let mut naive: Option<spatial::Cut> = None;
        for axis in 0..3 {
            let mut ends: Vec<f64> = bounds.iter().flat_map(|b| [b.lo[axis], b.hi[axis]]).collect();
            ends.sort_by(f64::total_cmp);
            for at in ends.into_iter().filter(|at| cell.lo[axis] < *at && *at < cell.hi[axis]) {
                let (mut lower, mut upper) = (cell, cell);
                (lower.hi[axis], upper.lo[axis]) = (at, at);
                for flat_below in [true, false] {
                    let in_plane = |b: &&Aabb| b.lo[axis] == at && b.hi[axis] == at;
                    let in_plane = bounds.iter().filter(in_plane).count();
                    let below = bounds.iter().filter(|b| b.lo[axis] < at).count() + if flat_below { in_plane } else { 0 };
                    let above = bounds.iter().filter(|b| b.hi[axis] > at).count() + if flat_below { 0 } else { in_plane };
                    let shares = [lower, upper].map(|c| share(c.size(), cell.size()));
                    let cost = COST.split(shares, [below, above]);
                    if naive.is_none_or(|n| cost < n.cost) {
                        naive = Some(spatial::Cut { cost, axis, at, flat_below });
                    }
                }
            }
        }
        prop_assert_eq!(spatial::sweep(&COST, &items, &cell), naive);
    }

    #[test]
    fn the_sweep_of_centroids_finds_what_boxing_finds(boxes in boxes()) {
        let items: Vec<loose::Item> = boxes.iter().map(|b| loose::Item {
            centroid: b.centre(),
            bounds: Box32 { lo: b.lo.as_vec3(), hi: b.hi.as_vec3() },
            triangle: 0,
        }).collect();
        let union = |keep: &dyn Fn(&loose::Item) -> bool| {
            let kept: Vec<&loose::Item> = items.iter().filter(|i| keep(i)).collect();
            let b = kept.iter().fold(Box32::EMPTY, |b, i| b.union(i.bounds));
            (b.hi.as_dvec3() - b.lo.as_dvec3(), kept.len())
        };
        let mut naive: Option<loose::Cut> = None;
        for axis in 0..3 {
            let mut planes: Vec<f64> = items.iter().map(|i| i.centroid[axis]).collect();
            planes.sort_by(f64::total_cmp);
            for at in planes {
                let (below, above) = (union(&|i| i.centroid[axis] < at), union(&|i| i.centroid[axis] >= at));
                let whole = union(&|_| true).0;
                let cost = COST.split([share(below.0, whole), share(above.0, whole)], [below.1, above.1]);
                if below.1 > 0 && naive.is_none_or(|n| cost < n.cost) {
                    naive = Some(loose::Cut { cost, axis, below: loose::Below::Plane(at) });
                }
            }
        }
        prop_assert_eq!(loose::sweep(&COST, &items), naive);
    }

    #[test]
    fn a_median_has_values_on_both_sides(values in prop::collection::vec((-4i32..4).prop_map(f64::from), 1..30)) {
        let plane = median(&mut values.clone());
        prop_assert_eq!(plane.is_none(), values.iter().all(|v| *v == values[0]));
        if let Some(at) = plane {
            let below = values.iter().filter(|v| **v < at).count();
            prop_assert!(0 < below && below < values.len());
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            prop_assert!(below <= values.len() / 2 || sorted[0] == sorted[values.len() / 2]);
        }
    }
}

#[test]
fn shares_of_flat_and_of_empty_boxes() {
    let v = DVec3::new;
    assert_eq!(share(v(1.0, 2.0, 2.0), v(2.0, 2.0, 2.0)), 8.0 / 12.0);
    assert_eq!(share(v(1.0, 2.0, 0.0), v(2.0, 2.0, 0.0)), 0.5, "by area");
    assert_eq!(share(v(0.5, 0.0, 0.0), v(2.0, 0.0, 0.0)), 0.25, "by length");
    assert_eq!(share(DVec3::ZERO, DVec3::ZERO), 1.0);
}

fn leaves(tree: &Tree) -> Vec<&Leaf<Vec<u32>>> {
    match tree {
        Branch::Leaf(leaf) => vec![leaf],
        Branch::Inner(children) => children.iter().flat_map(leaves).collect(),
    }
}

/// Small triangles with whole coordinates in 0..=8, many of them across an axis.
fn blocks(seed: u32, count: u32) -> Scene {
    let mut state = seed;
    let mut digit = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) % 9.0
    };
    let mut scene = Scene::default();
    for t in 0..count {
        let (axis, corner) = (t as usize % 4, DVec3::new(digit(), digit(), digit()));
        for _ in 0..3 {
            let mut p = (corner + DVec3::new(digit(), digit(), digit()) * 0.25).floor().min(DVec3::splat(8.0));
            if axis < 3 {
                p[axis] = corner[axis];
            }
            scene.positions.push(p);
        }
        scene.triangles.push([3 * t, 3 * t + 1, 3 * t + 2]);
        scene.material_id.push(0);
    }
    scene
}

// A0.3: in every leaf, what reaches into the cell; in some leaf, what lies in a plane.
#[test]
fn a_leaf_has_every_triangle_that_reaches_into_its_cell_and_none_that_is_apart() {
    for (seed, count) in [(1, 40), (2, 300), (3, 2500)] {
        let scene = blocks(seed, count);
        for cost in [Some(COST), None] {
            let params = KdTree { cost, leaf_size: 6, policy: Policy::Replicate, wide: false };
            let tree = spatial::grow(&params, &scene, &Budget::of(&scene)).unwrap();
            let (leaves, bounds) = (leaves(&tree), scene.bounds());
            let volume = |b: &Aabb| b.size().element_product();
            let sum: f64 = leaves.iter().map(|l| volume(&l.cell)).sum();
            assert!((sum - volume(&bounds)).abs() < 1e-6 * sum, "cells fill the scene's box");
            assert!(leaves.len() > 8, "{} leaves", leaves.len());
            let mut held = vec![false; scene.len()];
            for leaf in leaves {
                for t in 0..count {
                    let corners = scene.corners(t);
                    let has = leaf.triangles.contains(&t);
                    held[t as usize] |= has;
                    // Away from the faces by a hair, whatever the test's rounding.
                    let inner = Aabb { lo: leaf.cell.lo + 1e-9, hi: leaf.cell.hi - 1e-9 };
                    assert!(
                        has || inner.is_empty() || !triangle_overlaps(&corners, &inner),
                        "{t} reaches into {:?}",
                        leaf.cell
                    );
                    assert!(!has || triangle_overlaps(&corners, &leaf.cell), "{t} is apart from {:?}", leaf.cell);
                    assert!(!has || !intersection(&scene.triangle_aabb(t), &leaf.cell).is_empty());
                }
            }
            assert!(held.iter().all(|h| *h));
        }
    }
}
