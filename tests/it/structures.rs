//! Structures: every triangle kept, bounds that hold, counts in the paper's terms.

mod bsp;
mod bvh;
mod grids;
mod kd_tree;
pub mod policies;
pub mod portal_octree;

use crate::common::soup;
use cullmark::hierarchy::{Hierarchy, LANES, NONE};
use cullmark::math::{Camera, DVec3, Pose, View};
use cullmark::registry::Spec;
use cullmark::scene::Scene;
use cullmark::structure;

fn build(text: &str, scene: &Scene) -> Hierarchy {
    let (s, _) = structure::make(&Spec::parse(text).unwrap()).unwrap();
    let h = s.build(scene).unwrap_or_else(|e| panic!("{text} on {}: {e}", scene.name));
    h.assert_well_formed(scene);
    h
}

/// A scene of the given triangles, three materials by turns.
pub fn scene_of(name: &str, triangles: &[[DVec3; 3]]) -> Scene {
    let n = triangles.len() as u32;
    let mut scene = Scene {
        name: name.to_string(),
        positions: triangles.iter().flatten().copied().collect(),
        triangles: (0..n).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        source_triangle_id: (0..n).collect(),
        object_id: vec![0; n as usize],
        material_id: (0..n).map(|t| t % 3).collect(),
        two_sided: vec![false; n as usize],
        occluder: vec![true; n as usize],
        material_names: vec!["a".into(), "b".into(), "c".into()],
        source_triangle_count: n,
        ..Default::default()
    };
    scene.anchor();
    scene
}

/// Two triangles for each unit square of an n x n floor.
pub fn floor(n: u32, height: impl Fn(f64, f64) -> f64) -> Vec<[DVec3; 3]> {
    let corner = |i: u32, j: u32| DVec3::new(f64::from(i), f64::from(j), height(f64::from(i), f64::from(j)));
    let square = |i, j| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..n * n).flat_map(|k| square(k % n, k / n)).collect()
}

/// Ordinary and degenerate scenes that every structure must take.
pub fn scenes() -> Vec<Scene> {
    let one = [DVec3::ZERO, DVec3::X, DVec3::new(0.0, 1.0, 0.5)];
    let mut far = soup(5, 600, 20.0, 2.0);
    far.positions.iter_mut().for_each(|p| *p += DVec3::new(1e7, -1e7, 1e7));
    far.name = "far".into();
    far.anchor();
    let sliver = |i: u32| {
        let a = DVec3::new(f64::from(i % 17), f64::from(i % 13), f64::from(i % 7));
        let along = DVec3::new(5.0, f64::from(i % 3) - 1.0, 2.0);
        [a, a + along, a + along * 0.5 + DVec3::new(0.0, 1e-9, 1e-7)]
    };
    let line = |i: u32| [0, 1, 2].map(|k| DVec3::X * f64::from(i + k));
    vec![
        soup(1, 3000, 10.0, 0.3),
        soup(2, 400, 10.0, 8.0),
        far,
        scene_of("one", &[one]),
        scene_of("nothing", &[]),
        scene_of("identical", &[one; 300]),
        scene_of("coplanar", &floor(20, |_, _| 0.0)),
        scene_of("sloped", &floor(20, |x, y| x * 0.3 + y * 0.7)),
        scene_of("hills", &floor(30, |x, y| (x * 0.7).sin() * 3.0 + (y * 0.4).cos() * 2.0)),
        scene_of("slivers", &(0..300).map(sliver).collect::<Vec<_>>()),
        scene_of("lines", &(0..50).map(line).collect::<Vec<_>>()),
        scene_of("points", &[[DVec3::ONE; 3]; 9]),
    ]
}

const LISTS: &[&str] = &["list", "list:leaf_size=1", "list:leaf_size=100"];

/// Every triangle once.
const OCTREES: &[&str] = &[
    "octree",
    "octree:depth=0",
    "octree:depth=6,root=cube",
    "octree:depth=10,leaf_limit=20",
    "octree:policy=E",
    "octree:policy=E,depth=10",
    "octree:policy=E,depth=7,leaf_limit=5,root=cube",
    "octree:depth=3,leaves=facing",
    "octree:policy=E,depth=2,leaves=facing",
];

/// Every triangle once, too.
const LOOSE: &[&str] = &[
    "uniform_grid",
    "uniform_grid:layout=rows",
    "uniform_grid:density=60,layout=rows",
    "irregular_grid",
    "irregular_grid:planes=walls,nx=40,ny=3,nz=1,layout=rows",
    "nested_grid",
    "nested_grid:layout=flat,leaf_limit=5",
    "nested_grid:density=1,leaf_limit=8,levels=3",
    "kd_tree",
    "kd_tree:layout=binary,leaf_size=8",
    "kd_tree:split=median,leaf_size=20",
];

const PORTAL_OCTREES: &[&str] = &["portal_octree", "portal_octree:depth=3,planes=middle,texels=7"];

const REPLICATED: &[&str] = &[
    "octree:policy=R",
    "octree:policy=R,depth=2,root=cube",
    "octree:policy=R,depth=5,leaf_limit=40",
    "uniform_grid:policy=R",
    "uniform_grid:policy=R,density=0.5,layout=rows",
    "irregular_grid:policy=R",
    "irregular_grid:policy=R,planes=walls,layout=rows",
    "nested_grid:policy=R,density=0.5",
    "nested_grid:policy=R,density=0.25,layout=flat,levels=2,leaf_limit=20",
    "kd_tree:policy=R",
    "kd_tree:policy=R,split=median,layout=binary",
];

const SPLIT: &[&str] = &[
    "octree:policy=S",
    "octree:policy=S,depth=3,root=cube",
    "octree:policy=S,depth=5,leaf_limit=40",
    "uniform_grid:policy=S",
    "uniform_grid:policy=S,density=0.5,layout=rows",
    "irregular_grid:policy=S",
    "irregular_grid:policy=S,planes=walls,layout=rows",
    "nested_grid:policy=S,density=0.5",
    "nested_grid:policy=S,density=0.25,layout=flat,levels=2,leaf_limit=20",
    "kd_tree:policy=S",
    "kd_tree:policy=S,split=median,layout=binary",
];

const BSPS: &[&str] = &[
    "bsp",
    "bsp:layout=binary",
    "bsp:min_leaf=60,layout=binary",
    "bsp:min_leaf=60",
    "bsp:min_leaf=60,heuristic=surface",
    "bsp:min_leaf=80,split_weight=0,candidates=3",
    "bsp:min_leaf=80,split_weight=100,axis_penalty=0,sample=64,layout=binary",
];

const HYBRIDS: &[&str] = &[
    "hybrid:inner=bsp,leaf_size=200,dense=300,depth=1",
    "hybrid",
    "hybrid:inner=kd_tree,dense=70",
    "hybrid:depth=0,dense=20,leaf_size=4",
];

const BVHS: &[&str] = &[
    "bvh",
    "bvh:layout=binary",
    "bvh:leaf_size=1",
    "bvh:leaf_size=20,bins=5",
    "bvh:leaf_size=20,stop=cost,layout=binary",
    "bvh:leaf_size=4,bins=32,layout=binary",
    "bvh:split=median,leaf_size=10",
    "bvh:split=morton",
    "bvh:split=morton,leaf_size=1,layout=binary",
];

fn all() -> impl Iterator<Item = &'static str> {
    [LISTS, OCTREES, LOOSE, REPLICATED, PORTAL_OCTREES, SPLIT, BSPS, BVHS, HYBRIDS].into_iter().flatten().copied()
}

/// Large triangles through each other: small leaves need more pieces than a BSP may make.
fn bsp_gives_up(text: &str, scene: &Scene) -> bool {
    scene.name == "soup 2" && text.contains("bsp:min_leaf=")
}

/// Block, lane and level of every node, in the order of entries.
fn nodes(h: &Hierarchy) -> Vec<(u32, usize, u32)> {
    let mut out = Vec::new();
    let mut pending: Vec<(u32, u32)> = (0..h.root_blocks).rev().map(|b| (b, 0)).collect();
    while let Some((block, level)) = pending.pop() {
        let links = &h.links[block as usize];
        for lane in (0..LANES).filter(|l| links.live >> l & 1 == 1) {
            out.push((block, lane, level));
            if links.child[lane] != NONE {
                pending.push((links.child[lane], level + 1));
            }
        }
    }
    out.sort_by_key(|(b, l, level)| (h.links[*b as usize].first[*l], *level));
    out
}

/// Entry ranges of the leaves, in order.
fn leaves(h: &Hierarchy) -> Vec<(u32, u32)> {
    nodes(h)
        .into_iter()
        .filter(|(b, l, _)| h.links[*b as usize].child[*l] == NONE)
        .map(|(b, l, _)| (h.links[b as usize].first[l], h.links[b as usize].end[l]))
        .collect()
}

#[test]
fn every_structure_is_well_formed_on_every_scene() {
    for scene in scenes() {
        for text in all().filter(|t| !bsp_gives_up(t, &scene)) {
            let h = build(text, &scene);
            assert!(h.stats.leaves as usize <= h.node_count(), "{text} on {}", scene.name);
            assert_eq!(h.stats.leaves as usize, leaves(&h).len(), "{text} on {}", scene.name);
        }
    }
}

#[test]
fn a_leaf_has_one_run_for_each_of_its_materials() {
    for scene in scenes() {
        for text in all().filter(|t| !bsp_gives_up(t, &scene)) {
            let h = build(text, &scene);
            for (first, end) in leaves(&h) {
                let mut materials: Vec<u32> =
                    h.entries[first as usize..end as usize].iter().map(|t| scene.material_id[*t as usize]).collect();
                assert!(materials.is_sorted(), "{text} on {}", scene.name);
                materials.dedup();
                assert_eq!(h.material_runs(first, end) as usize, materials.len(), "{text} on {}", scene.name);
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let large = soup(3, 150_000, 100.0, 1.0);
    let small = soup(4, 12_000, 40.0, 1.0);
    for text in all() {
        let fast = [LISTS, OCTREES, LOOSE, BVHS].iter().any(|all| all.contains(&text));
        let scene = if fast { &large } else { &small };
        let (s, _) = structure::make(&Spec::parse(text).unwrap()).unwrap();
        let [a, b] = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| s.build(scene)).unwrap()
        });
        assert!(a.entries == b.entries && a.fragments == b.fragments && a.material_run == b.material_run, "{text}");
        assert!(a.bounds == b.bounds && a.links == b.links && a.parent == b.parent && a.stats == b.stats, "{text}");
        assert!(a.half_spaces == b.half_spaces && a.portals == b.portals, "{text}");
    }
}

/// Entries and nodes that a plain walk in f64 visits: no box wholly beyond a plane.
fn submitted(h: &Hierarchy, view: &View) -> (u64, u64) {
    let (mut entries, mut visited) = (0, 0);
    let mut pending: Vec<u32> = (0..h.root_blocks).collect();
    while let Some(block) = pending.pop() {
        let links = &h.links[block as usize];
        for lane in (0..LANES).filter(|l| links.live >> l & 1 == 1) {
            visited += 1;
            let b = h.bounds[block as usize].get(lane);
            let (lo, hi) = (b.lo.as_dvec3() + h.origin, b.hi.as_dvec3() + h.origin);
            let outside = view.planes.iter().any(|p| {
                let farthest = DVec3::select(p.normal.cmpge(DVec3::ZERO), hi, lo);
                p.normal.dot(farthest - view.eye) + p.offset_m < 0.0
            });
            if !outside {
                entries += u64::from(links.own_end[lane] - links.first[lane]);
                if links.child[lane] != NONE {
                    pending.push(links.child[lane]);
                }
            }
        }
    }
    (entries, visited)
}

// A4.2
#[test]
fn a_deeper_octree_submits_fewer_triangles_and_asks_more_nodes() {
    let scene = soup(6, 20_000, 50.0, 0.5);
    let trees: Vec<Hierarchy> = (0..=6).map(|d| build(&format!("octree:depth={d}"), &scene)).collect();
    let mut totals = vec![0; trees.len()];
    for turn in 0..12 {
        let angle = f64::from(turn) * 0.55;
        let forward = DVec3::new(angle.cos(), angle.sin(), 0.1 * f64::from(turn % 3) - 0.1);
        let eye = DVec3::new(f64::from(turn) - 6.0, 3.0, 1.0);
        let view = View::new(&Camera::default(), &Pose { eye, forward, up: DVec3::Z });
        let frames: Vec<(u64, u64)> = trees.iter().map(|h| submitted(h, &view)).collect();
        for pair in frames.windows(2) {
            assert!(pair[1].0 <= pair[0].0 && pair[1].1 >= pair[0].1, "{frames:?}");
        }
        totals.iter_mut().zip(&frames).for_each(|(t, f)| *t += f.0);
    }
    assert!(totals.windows(2).all(|w| w[1] < w[0]), "{totals:?}");
    assert!(totals[4] * 2 < totals[0], "depth 4 culls more than half: {totals:?}");
}

#[test]
fn unknown_and_impossible_parameters_are_named() {
    let error = |text: &str| structure::make(&Spec::parse(text).unwrap()).err().unwrap().to_string();
    assert!(error("octre").contains("did you mean `octree`?"));
    assert!(error("octree:depth=11").contains("from 0 to 10"));
    assert!(error("octree:policy=Q").contains("\"L\", \"R\", \"S\", \"E\""));
    assert!(error("bsp:minleaf=3").contains("did you mean `min_leaf`?"));
    assert!(error("octree:policy=R,leaves=facing").contains("has no effect with `policy=R`"));
    assert!(error("kd_tree:empty_bonus=0.5").contains("has no effect with `policy=L`"));
    assert!(error("kd_tree:split=median,triangle_cost=3").contains("has no effect with `split=median`"));
    assert!(error("list:leaf_size=0").contains("from 1 to"));
    assert!(error("uniform_grid:density=0").contains("from 0.01 to"));
    assert!(error("nested_grid:levels=5").contains("from 1 to 4"));
    assert!(error("irregular_grid:planes=wall").contains("did you mean \"walls\"?"));
    assert!(error("kd_tree:split=sa").contains("\"sah\", \"median\""));
}
