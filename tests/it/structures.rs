//! Structures: every triangle kept, bounds that hold, counts in the paper's terms.

use crate::common::soup;
use cullmark::hierarchy::Hierarchy;
use cullmark::math::DVec3;
use cullmark::registry::Spec;
use cullmark::scene::Scene;
use cullmark::structure;

pub fn build(text: &str, scene: &Scene) -> Hierarchy {
    let (s, _) = structure::make(&Spec::parse(text).unwrap()).unwrap();
    let h = s.build(scene).unwrap_or_else(|e| panic!("{text}: {e}"));
    h.assert_well_formed(scene);
    h
}

/// A scene of the given triangles, one material in three by turns.
fn scene_of(name: &str, triangles: &[[DVec3; 3]]) -> Scene {
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

/// Ordinary and degenerate scenes that every structure must take.
fn scenes() -> Vec<Scene> {
    let t = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| [a, b, c].map(DVec3::from);
    let one = t([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]);
    let mut flat = Vec::new();
    for i in 0..20 {
        for j in 0..20 {
            let (x, y) = (f64::from(i), f64::from(j));
            flat.push(t([x, y, 0.0], [x + 1.0, y, 0.0], [x + 1.0, y + 1.0, 0.0]));
            flat.push(t([x, y, 0.0], [x + 1.0, y + 1.0, 0.0], [x, y + 1.0, 0.0]));
        }
    }
    let sloped = flat.iter().map(|t| t.map(|p| DVec3::new(p.x, p.y, p.x * 0.3 + p.y * 0.7))).collect::<Vec<_>>();
    let mut far = soup(5, 600, 20.0, 2.0);
    far.positions.iter_mut().for_each(|p| *p += DVec3::new(1e7, -1e7, 1e7));
    far.name = "far".into();
    far.anchor();
    let slivers: Vec<[DVec3; 3]> = (0..300)
        .map(|i| {
            let a = DVec3::new(f64::from(i % 17), f64::from(i % 13), f64::from(i % 7));
            let along = DVec3::new(5.0, f64::from(i % 3) - 1.0, 2.0);
            [a, a + along, a + along * 0.5 + DVec3::new(0.0, 1e-9, 1e-7)]
        })
        .collect();
    let lines: Vec<[DVec3; 3]> =
        (0..50).map(|i| [DVec3::X * f64::from(i), DVec3::X * f64::from(i + 1), DVec3::X * f64::from(i + 2)]).collect();
    vec![
        soup(1, 3000, 10.0, 0.3),
        soup(2, 400, 10.0, 8.0),
        far,
        scene_of("one", &[one]),
        scene_of("nothing", &[]),
        scene_of("identical", &[one; 500]),
        scene_of("coplanar", &flat),
        scene_of("sloped", &sloped),
        scene_of("slivers", &slivers),
        scene_of("lines", &lines),
        scene_of("points", &[[DVec3::ONE; 3]; 9]),
    ]
}

fn sorted(mut v: Vec<u32>) -> Vec<u32> {
    v.sort_unstable();
    v
}

const OCTREES: &[&str] = &[
    "octree",
    "octree:depth=0",
    "octree:depth=6,root=cube",
    "octree:depth=10,leaf_limit=20",
    "octree:policy=E",
    "octree:policy=E,depth=10",
    "octree:policy=E,depth=7,leaf_limit=5,root=cube",
];

const CUT: &[&str] = &[
    "octree:policy=R",
    "octree:policy=S",
    "octree:policy=R,depth=2,root=cube",
    "octree:policy=S,depth=3,root=cube",
    "octree:policy=R,depth=5,leaf_limit=40",
    "octree:policy=S,depth=5,leaf_limit=40",
];

const BSPS: &[&str] = &[
    "bsp",
    "bsp:layout=binary",
    "bsp:min_leaf=20,layout=binary",
    "bsp:min_leaf=20",
    "bsp:min_leaf=40,split_weight=0,candidates=3",
    "bsp:min_leaf=40,split_weight=100,axis_penalty=0,sample=64",
];

#[test]
fn every_structure_is_well_formed_on_every_scene() {
    for scene in scenes() {
        for text in ["list", "list:leaf_size=1", "list:leaf_size=100"].iter().chain(OCTREES).chain(CUT).chain(BSPS) {
            // Large triangles through each other: small leaves take more pieces than a BSP may make.
            if scene.name == "soup 2" && text.contains("bsp:min_leaf=") {
                continue;
            }
            let started = std::time::Instant::now();
            let h = build(text, &scene);
            eprintln!("{} {text}: {:?} {} ms", scene.name, h.stats, started.elapsed().as_millis());
        }
    }
}

#[test]
fn loose_and_enclosing_octrees_hold_every_triangle_once() {
    for scene in scenes() {
        for text in OCTREES {
            let h = build(text, &scene);
            assert_eq!(sorted(h.entries), (0..scene.len() as u32).collect::<Vec<_>>(), "{text} on {}", scene.name);
        }
    }
}
