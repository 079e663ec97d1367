//! Grids: facts A0.3, A1.1, A1.2 and A2.1, planes at walls, grids within cells.

use super::policies::{random, sorted, touches, touches_exactly};
use super::{LOOSE, REPLICATED, SPLIT, build, floor, leaves, nodes, scene_of, scenes};
use crate::common::soup;
use cullmark::culling::{DrawList, Tally, cull, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Aabb, Camera, DVec3, Pose, View};
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::Scene;
use cullmark::structure::builder::axes::Grid;
use cullmark::structure::builder::straddle::Policy;
use cullmark::structure::irregular_grid::IrregularGrid;
use cullmark::structure::nested_grid::NestedGrid;
use cullmark::structure::uniform_grid::UniformGrid;

/// Whole coordinates 0..8, so that triangles touch planes at whole coordinates, and a
/// wall across every axis at each.
fn whole() -> Scene {
    let mut unit = random(31);
    let mut triangles: Vec<[DVec3; 3]> = (0..150)
        .map(|_| {
            let mut v = || DVec3::new(unit() * 8.99, unit() * 8.99, unit() * 8.99).floor();
            [v(), v(), v()]
        })
        .collect();
    for at in 1..8 {
        let [a, b, c] = [[0.0, 0.0], [8.0, 0.0], [8.0, 8.0]].map(|[u, v]| DVec3::new(f64::from(at), u, v));
        triangles.extend([
            [a, b, c],
            [a, b, c].map(|p| DVec3::new(p.y, p.x, p.z)),
            [a, b, c].map(|p| DVec3::new(p.y, p.z, p.x)),
        ]);
    }
    triangles.push([DVec3::ZERO, DVec3::splat(8.0), DVec3::new(8.0, 0.0, 0.0)]);
    scene_of("whole", &triangles)
}

/// What every non-empty cell overlaps, cell by cell: the brute force of A0.3 and A1.1.
fn members(grid: &Grid, scene: &Scene, overlaps: fn(&[DVec3; 3], &Aabb) -> bool) -> Vec<Vec<u32>> {
    let [x, y, z] = grid.counts();
    (0..x * y * z)
        .map(|i| {
            let cell = grid.cell([i % x, i / x % y, i / x / y]);
            (0..scene.len() as u32).filter(|t| overlaps(&scene.corners(*t), &cell)).collect()
        })
        .filter(|list: &Vec<u32>| !list.is_empty())
        .collect()
}

fn leaf_sets(h: &Hierarchy) -> Vec<Vec<u32>> {
    leaves(h).into_iter().map(|(a, b)| sorted(h.entries[a as usize..b as usize].to_vec())).collect()
}

fn irregular(counts: [u32; 3], walls: bool) -> IrregularGrid {
    IrregularGrid { counts, walls, policy: Policy::Replicate, rows: false }
}

// A0.3, A1.1
#[test]
fn a_cell_holds_exactly_the_triangles_that_overlap_it() {
    let whole = whole();
    let density = 500.0 / whole.len() as f64;
    let uniform = |density| UniformGrid { density, policy: Policy::Replicate, rows: false };
    let cases: [(Scene, fn(&[DVec3; 3], &Aabb) -> bool); 2] =
        [(whole, touches_exactly), (soup(32, 500, 10.0, 2.0), touches)];
    for (scene, overlaps) in &cases {
        let density = if scene.name == "whole" { density } else { 1.5 };
        let grid = uniform(density).grid(scene);
        let walls = irregular([4, 5, 4], true);
        let mut all = vec![
            (format!("uniform_grid:policy=R,density={density:?}"), grid),
            ("irregular_grid:policy=R,planes=walls,nx=4,ny=5,nz=4".into(), walls.grid(scene)),
        ];
        if scene.name == "whole" {
            assert_eq!(all[0].1.counts(), [8; 3]);
            assert!(all[1].1.counts().iter().all(|n| *n >= 3), "{:?}", all[1].1);
            let planes = all.iter().flat_map(|(_, grid)| grid.axes.iter().flat_map(|a| a.planes()));
            assert!(planes.into_iter().all(|p| p.fract() == 0.0), "the twin counts in whole numbers");
        } else {
            all.push(("irregular_grid:policy=R,nx=9,ny=3,nz=7".into(), irregular([9, 3, 7], false).grid(scene)));
        }
        for (text, grid) in all {
            let expected = members(&grid, scene, *overlaps);
            for text in [text.clone(), format!("{text},layout=rows")] {
                let h = build(&text, scene);
                let found = leaf_sets(&h);
                assert_eq!(found.len(), expected.len(), "{text} on {}", scene.name);
                for (cell, (found, expected)) in found.iter().zip(&expected).enumerate() {
                    assert_eq!(found, expected, "{text} on {}: cell {cell}", scene.name);
                }
                let counted: usize = expected.iter().map(Vec::len).sum();
                assert!(
                    (h.duplication(scene) * scene.len() as f64 - counted as f64).abs() < 1e-6,
                    "the counts sum to rho N"
                );
            }
        }
    }
}

#[test]
fn no_copy_is_in_a_leaf_that_it_does_not_reach() {
    for scene in [soup(33, 700, 10.0, 2.0), soup(34, 60, 1.0, 3.0)] {
        for text in REPLICATED {
            let h = build(text, &scene);
            let once: usize = leaf_sets(&h).iter().map(|s| s.windows(2).filter(|w| w[0] == w[1]).count()).sum();
            assert_eq!(once, 0, "{text} on {}: two copies in a leaf", scene.name);
            for (block, lane, _) in nodes(&h) {
                let (links, b) = (&h.links[block as usize], h.bounds[block as usize].get(lane));
                let world = Aabb { lo: b.lo.as_dvec3() + h.origin, hi: b.hi.as_dvec3() + h.origin };
                for t in &h.entries[links.first[lane] as usize..links.own_end[lane] as usize] {
                    assert!(touches(&scene.corners(*t), &world), "{text} on {}: triangle {t}", scene.name);
                }
            }
        }
    }
}

/// Nodes visited and entries submitted in a frame under the frustum test.
fn frame(h: &Hierarchy, scene: &Scene, walk: &str, eye: DVec3, forward: DVec3) -> (u64, u64) {
    let mut tests = make_tests(&parse_sum("frustum").unwrap()).unwrap().0;
    tests.iter_mut().for_each(|t| _ = t.prepare(scene, h));
    let mut walk = make_walk(&Spec::new(walk)).unwrap().0;
    let view = View::new(&Camera::default(), &Pose { eye, forward, up: DVec3::Z });
    let (mut out, mut tally) = (DrawList::default(), Tally::default());
    cull(&view, h, &mut tests, walk.as_mut(), &mut out, &mut tally);
    (tally.nodes_visited, out.entry_count())
}

// A1.2
#[test]
fn a_flat_grid_asks_about_every_cell_even_when_all_is_culled() {
    let scene = soup(35, 6000, 10.0, 0.3);
    let away = (DVec3::X * 40.0, DVec3::X);
    let mut cells = Vec::new();
    for density in ["0.02", "0.2", "2"] {
        let flat = build(&format!("uniform_grid:density={density}"), &scene);
        let (visited, submitted) = frame(&flat, &scene, "flat", away.0, away.1);
        assert_eq!((visited, submitted), (flat.stats.leaves, 0), "density {density}");
        cells.push(visited);
        let rows = build(&format!("uniform_grid:density={density},layout=rows"), &scene);
        assert_eq!(rows.stats.leaves, flat.stats.leaves);
        let (visited, submitted) = frame(&rows, &scene, "depth_first", away.0, away.1);
        assert!(visited <= 8 && submitted == 0, "density {density}: {visited} nodes for nothing");
        let (visited, submitted) = frame(&rows, &scene, "depth_first", DVec3::ZERO, DVec3::X);
        assert!(visited < flat.stats.leaves && submitted > 0, "density {density}: {visited} of {}", flat.stats.leaves);
    }
    assert!(cells[1] > 2 * cells[0] && cells[2] > 2 * cells[1], "more cells, more work: {cells:?}");
}

#[test]
fn the_counts_are_layers_rows_and_cells() {
    let scene = soup(36, 4000, 10.0, 0.1);
    let grid = UniformGrid { density: 2.0, policy: Policy::Loose, rows: true }.grid(&scene);
    let mut used = [(); 3].map(|()| std::collections::BTreeSet::new());
    for t in 0..scene.len() as u32 {
        let [a, b, c] = scene.corners(t);
        let [x, y, z] = grid.locate((a + b + c) / 3.0);
        [vec![z], vec![z, y], vec![z, y, x]].into_iter().zip(&mut used).for_each(|(key, set)| _ = set.insert(key));
    }
    let s = build("uniform_grid:density=2,layout=rows", &scene).stats;
    assert_eq!((s.leaves, s.depth), (used[2].len() as u64, 2));
    assert_eq!(s.nodes, used.iter().map(|set| set.len() as u64).sum::<u64>());
}

#[test]
fn a_flat_scene_has_one_layer_of_cells() {
    let plate = |thick: f64| scene_of("plate", &floor(40, |x, y| thick * (x * 7.0 + y).sin()));
    for scene in [plate(0.0), plate(1e-9)] {
        let grid = UniformGrid { density: 4.0, policy: Policy::Loose, rows: false }.grid(&scene);
        let [x, y, z] = grid.counts();
        assert_eq!(z, 1);
        let (cells, wanted) = (f64::from(x * y), 4.0 * scene.len() as f64);
        assert!((0.9..1.1).contains(&(cells / wanted)), "{cells} cells of {wanted}");
    }
}

// A2.1
#[test]
fn layers_between_quantiles_hold_as_many_triangles_to_one() {
    let far = scenes().into_iter().find(|s| s.name == "far").unwrap();
    for scene in [soup(37, 3000, 10.0, 0.3), soup(38, 101, 1.0, 5.0), soup(39, 7, 1.0, 1.0), far] {
        for k in [1, 2, 3, 7, 16, 64, 512] {
            let grid = irregular([k, k, k], false).grid(&scene);
            let share = scene.len() as f64 / f64::from(k);
            for axis in 0..3 {
                let mut held = vec![0u32; grid.counts()[axis] as usize];
                for t in 0..scene.len() as u32 {
                    let [a, b, c] = scene.corners(t);
                    held[grid.locate((a + b + c) / 3.0)[axis] as usize] += 1;
                }
                let what = format!("{} in {k} parts, axis {axis}: {held:?}", scene.name);
                assert!(held.iter().all(|n| (f64::from(*n) - share).abs() < 1.0), "{what}");
                assert_eq!(held.len(), (k as usize).min(scene.len()), "{what}");
            }
        }
    }
}

#[test]
fn planes_go_to_the_heaviest_wall_nearby_and_are_never_equal() {
    let generated = |text: &str| {
        let (generator, _) = cullmark::scene::generate::make(&Spec::parse(text).unwrap()).unwrap();
        generator.generate()
    };
    let scenes = scenes().into_iter().filter(|s| s.len() > 100);
    let mut walls_found = 0;
    for scene in scenes.chain([generated("rooms"), generated("blocks"), whole()]) {
        for counts in [[16, 16, 4], [3, 40, 1]] {
            let (grid, bounds) = (irregular(counts, true).grid(&scene), scene.bounds());
            for axis in 0..3 {
                let planes = grid.axes[axis].planes();
                let what = format!("{}, axis {axis}: {planes:?}", scene.name);
                let is_flat = bounds.lo[axis] == bounds.hi[axis];
                assert!(planes.windows(2).all(|w| w[0] < w[1] || is_flat), "{what}");
                // Twice the area in every plane across the axis.
                let mut walls: Vec<(f64, f64)> = Vec::new();
                let mut middles = Vec::new();
                for t in 0..scene.len() as u32 {
                    let [a, b, c] = scene.corners(t).map(|p| p[axis]);
                    middles.push((a + b + c) / 3.0);
                    if a == b && b == c && bounds.lo[axis] < a && a < bounds.hi[axis] {
                        match walls.iter_mut().find(|w| w.0 == a) {
                            Some(wall) => wall.1 += scene.normal(t).length(),
                            None => walls.push((a, scene.normal(t).length())),
                        }
                    }
                }
                middles.sort_by(f64::total_cmp);
                let (n, k) = (middles.len(), counts[axis] as usize);
                let between = |rank: usize| match middles[rank - 1] + (middles[rank] - middles[rank - 1]) * 0.5 {
                    halfway if halfway > middles[rank - 1] => halfway,
                    _ => middles[rank],
                };
                let mut expected = Vec::new();
                for i in 1..k {
                    let border = |i: usize| between((i * n / k + (i + 1) * n / k).div_ceil(2));
                    let lo = if i > 1 { border(i - 1) } else { f64::NEG_INFINITY };
                    let hi = if i + 1 < k { border(i) } else { f64::INFINITY };
                    let near = walls.iter().filter(|w| lo <= w.0 && w.0 < hi && w.1 > 0.0);
                    let heaviest = near.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.total_cmp(&a.0)));
                    walls_found += usize::from(heaviest.is_some());
                    expected.push(heaviest.map_or_else(|| between(i * n / k), |w| w.0));
                }
                expected.retain(|p| bounds.lo[axis] < *p && *p < bounds.hi[axis]);
                expected.dedup();
                assert_eq!(planes[1..planes.len() - 1], expected, "{what}");
            }
        }
    }
    assert!(walls_found > 100, "{walls_found}");
}

#[test]
fn crowded_cells_hold_grids_and_the_rest_is_counted() {
    let scene = soup(40, 20_000, 10.0, 0.1);
    let limit =
        |text: &str| cullmark::structure::make(&Spec::parse(text).unwrap()).unwrap().1.int("leaf_limit") as usize;
    let nested = LOOSE.iter().chain(REPLICATED).filter(|t| t.starts_with("nested_grid"));
    for text in nested.chain(&["nested_grid:density=0.1,leaf_limit=30"]) {
        let h = build(text, &scene);
        let over = leaf_sets(&h).iter().filter(|l| l.len() > limit(text)).count() as u64;
        assert_eq!(h.stats.oversized_leaves, over, "{text}");
        let levels = ["levels=2", "levels=3"].iter().position(|l| text.contains(l)).map_or(1, |i| i as u64 + 2);
        let outer = if text.contains("flat") { 0 } else { 2 };
        // 4 N^0.6 cells of 13 triangles: none is crowded.
        let nests = *text != "nested_grid";
        assert_eq!(h.stats.depth > outer, nests, "{text}: {:?}", h.stats);
        assert!(h.stats.depth <= outer + levels, "{text}: {:?}", h.stats);
    }
    let [coarse, nested] =
        [8, 1 << 20].map(|limit| build(&format!("nested_grid:density=0.2,leaf_limit={limit}"), &scene));
    assert!(coarse.stats.largest_leaf * 2 < nested.stats.largest_leaf, "{:?} {:?}", coarse.stats, nested.stats);
    // 0.2 N^0.6 cells in a cube.
    let grid = NestedGrid { density: 0.2, leaf_limit: 8, levels: 1, policy: Policy::Loose, rows: true }.grid(&scene);
    assert_eq!(grid.counts(), [5; 3]);
    assert_eq!(nested.stats.leaves, 125);
}

#[test]
fn layouts_hold_the_same_leaves() {
    let scene = soup(41, 3000, 10.0, 0.6);
    for (one, other) in [
        ("uniform_grid:policy=P", "uniform_grid:policy=P,layout=rows"),
        ("irregular_grid:policy=P", "irregular_grid:policy=P,layout=rows"),
        ("nested_grid:policy=P,density=0.5", "nested_grid:policy=P,density=0.5,layout=flat"),
        ("kd_tree:policy=P", "kd_tree:policy=P,layout=binary"),
    ] {
        for policy in ["L", "R", "S"] {
            let [one, other] = [one, other].map(|t| build(&t.replace('P', policy), &scene));
            assert!(one.entries == other.entries && one.fragments == other.fragments);
            assert_eq!(leaves(&one), leaves(&other));
        }
    }
    assert!(SPLIT.iter().any(|t| build(t, &scene).fragments.is_some()));
}
