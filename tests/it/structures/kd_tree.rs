//! The kd-tree: its limits, and fact A6: the heuristic does what it minimises.

use super::{build, leaves, scenes};
use crate::common::soup;
use cullmark::hierarchy::{Hierarchy, LANES, NONE};
use cullmark::registry::Spec;
use cullmark::scene::Scene;

const VARIANTS: [&str; 6] = [
    "kd_tree",
    "kd_tree:layout=binary",
    "kd_tree:split=median",
    "kd_tree:split=median,leaf_size=8,layout=binary",
    "kd_tree:policy=R,split=median,layout=binary",
    "kd_tree:policy=R,leaf_size=16,layout=binary",
];

#[test]
fn depth_is_bounded_and_leaves_above_the_limit_are_counted() {
    for scene in scenes().iter().filter(|s| !s.is_empty()) {
        let deepest = (8.0 + 1.3 * (scene.len() as f64).log2()).floor() as u64;
        for text in VARIANTS {
            let h = build(text, scene);
            let what = format!("{text} on {}: {:?}", scene.name, h.stats);
            let limit = cullmark::structure::make(&Spec::parse(text).unwrap()).unwrap().1.int("leaf_size") as u32;
            let over = leaves(&h).iter().filter(|(a, b)| b - a > limit).count() as u64;
            assert_eq!(h.stats.oversized_leaves, over, "{what}");
            assert!(h.stats.depth <= deepest, "{what}");
            if !text.contains("policy") {
                assert_eq!(h.stats.nodes, 2 * h.stats.leaves - 1, "{what}");
                let can_be_cut = !matches!(scene.name.as_str(), "identical" | "points");
                assert!(!can_be_cut || over == 0 || !text.contains("median"), "{what}");
            }
        }
    }
}

#[test]
fn what_no_plane_parts_is_one_leaf() {
    for scene in scenes().iter().filter(|s| s.name == "identical") {
        for text in
            ["kd_tree", "kd_tree:split=median", "kd_tree:policy=R", "kd_tree:policy=R,split=median", "kd_tree:policy=S"]
        {
            let s = build(text, scene).stats;
            assert_eq!((s.leaves, s.largest_leaf, s.oversized_leaves), (1, 300, 1), "{text}");
        }
    }
}

/// What the tree costs a ray that meets its root, by the surface area heuristic over its boxes.
fn expected_cost(h: &Hierarchy) -> f64 {
    let (mut cost, mut root_area) = (0.0, 0.0);
    for (block, links) in h.links.iter().enumerate() {
        for lane in (0..LANES).filter(|l| links.live >> l & 1 == 1) {
            let b = h.bounds[block].get(lane);
            let s = b.hi.as_dvec3() - b.lo.as_dvec3();
            let area = s.x * s.y + s.y * s.z + s.z * s.x;
            if block == 0 {
                root_area += area;
            }
            let is_leaf = links.child[lane] == NONE;
            cost += area * if is_leaf { 20.0 * f64::from(links.end[lane] - links.first[lane]) } else { 15.0 };
        }
    }
    cost / root_area
}

fn generated(text: &str) -> Scene {
    cullmark::scene::generate::make(&Spec::parse(text).unwrap()).unwrap().0.generate()
}

// A6
#[test]
fn the_heuristic_costs_no_more_than_medians_on_the_bundled_scenes() {
    for name in ["rooms", "blocks", "arena:map=nucleus", "arena:map=ravine", "arena:map=gold_rush"] {
        let scene = generated(name);
        for variant in ["layout=binary", "layout=binary,policy=R", "layout=binary,leaf_size=16"] {
            let [sah, median] = ["sah", "median"].map(|s| build(&format!("kd_tree:split={s},{variant}"), &scene));
            let (sah_cost, median_cost) = (expected_cost(&sah), expected_cost(&median));
            println!(
                "{name} {variant}: {sah_cost:.0} by area, {median_cost:.0} by medians, {} and {} entries a triangle",
                sah.duplication(&scene),
                median.duplication(&scene)
            );
            assert!(sah_cost <= median_cost, "{name} {variant}: {sah_cost} > {median_cost}");
        }
    }
}

#[test]
fn replication_stops_where_it_parts_nothing() {
    // Triangles as large as the scene, through each other.
    let scene = soup(51, 300, 1.0, 20.0);
    for split in ["sah", "median"] {
        let h = build(&format!("kd_tree:policy=R,split={split},leaf_size=4"), &scene);
        println!("{split}: {} entries a triangle, {:?}", h.duplication(&scene), h.stats);
        assert!(h.duplication(&scene) < 64.0, "{split}: {} entries a triangle", h.duplication(&scene));
    }
}
