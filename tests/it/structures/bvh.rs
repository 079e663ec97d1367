//! The BVH: facts A7.1 and A7.2, its limits and its layouts.

use super::{BVHS, build, leaves, nodes, scene_of, scenes};
use crate::common::soup;
use cullmark::hierarchy::{Hierarchy, NONE};
use cullmark::math::DVec3;
use cullmark::registry::Spec;
use cullmark::scene::Scene;
use cullmark::structure::bvh::{Bvh, Kernel, sah_cost};
use cullmark::structure::{self, Structure};

fn leaf_size(text: &str) -> u64 {
    structure::make(&Spec::parse(text).unwrap()).unwrap().1.int("leaf_size") as u64
}

// A7.1
#[test]
fn every_triangle_is_in_one_leaf_and_no_leaf_is_too_large() {
    for scene in scenes() {
        for text in BVHS {
            let h = build(text, &scene);
            let what = format!("{text} on {}: {:?}", scene.name, h.stats);
            let mut entries = h.entries.clone();
            entries.sort_unstable();
            assert_eq!(entries, (0..scene.len() as u32).collect::<Vec<_>>(), "{what}");
            assert!(h.stats.largest_leaf <= leaf_size(text) && h.stats.oversized_leaves == 0, "{what}");
            assert_eq!(h.stats.nodes, (2 * h.stats.leaves).saturating_sub(1), "{what}");
            if text.contains("binary") {
                assert_eq!(h.node_count() as u64, h.stats.nodes, "{what}");
            }
        }
    }
}

#[test]
fn boxes_are_as_tight_as_their_triangles_allow() {
    for scene in scenes() {
        for text in BVHS {
            let h = build(text, &scene);
            for (block, lane, _) in nodes(&h) {
                let links = &h.links[block as usize];
                let own = &h.entries[links.first[lane] as usize..links.end[lane] as usize];
                let tight = own.iter().map(|t| scene.triangle_box(*t)).reduce(|a, b| a.union(b)).unwrap();
                assert_eq!(h.bounds[block as usize].get(lane), tight, "{text} on {}", scene.name);
            }
        }
    }
}

fn generated(spec: &str) -> Scene {
    cullmark::scene::generate::make(&Spec::parse(spec).unwrap()).unwrap().0.generate()
}

// A7.2
#[test]
fn surface_areas_cost_less_than_medians_on_the_bundled_scenes() {
    let maps =
        ["rooms", "rooms:world=3", "blocks", "blocks:world=6", "arena", "arena:map=ravine", "arena:map=gold_rush"];
    for scene in maps.map(generated) {
        for leaf_size in [4, 64] {
            let cost = |split: &str| {
                sah_cost(&build(&format!("bvh:split={split},leaf_size={leaf_size},layout=binary"), &scene))
            };
            let (sah, median, morton) = (cost("sah"), cost("median"), cost("morton"));
            let by_cost = sah_cost(&build("bvh:stop=cost,layout=binary", &scene));
            println!(
                "{} ({} triangles), {leaf_size} a leaf: sah {sah:.1}, median {median:.1}, morton {morton:.1}; stop=cost {by_cost:.1}",
                scene.name,
                scene.len()
            );
            assert!(sah <= median, "{}: {sah} for {median}", scene.name);
            assert!(by_cost <= sah * 1.02, "{}: ends where dividing costs more: {by_cost} for {sah}", scene.name);
        }
    }
}

#[test]
fn stopping_by_cost_leaves_alone_what_is_not_worth_dividing() {
    // Two heaps of coincident triangles: one division pays, none within a heap.
    let at = |x: f64| [DVec3::new(x, 0.0, 0.0), DVec3::new(x + 1.0, 1.0, 0.0), DVec3::new(x, 0.0, 1.0)];
    let heaps: Vec<[DVec3; 3]> = (0..40).map(|i| at(f64::from(i % 2) * 50.0)).collect();
    let h = build("bvh:stop=cost,layout=binary", &scene_of("heaps", &heaps));
    assert_eq!((h.stats.leaves, h.stats.largest_leaf), (2, 20));
    // `leaf_size` stays the most: the heaps are halved.
    let h = build("bvh:stop=cost,layout=binary,leaf_size=10", &scene_of("heaps", &heaps));
    assert_eq!((h.stats.leaves, h.stats.largest_leaf), (4, 10));
}

#[test]
fn a_chain_of_ever_smaller_steps_does_not_make_a_deep_tree() {
    let at = |i: i32| [DVec3::X * libm::exp2(-f64::from(i)); 3].map(|p| p + DVec3::Y * f64::from(i % 2));
    let chain: Vec<[DVec3; 3]> = (0..900).map(at).collect();
    for text in ["bvh:leaf_size=1", "bvh:leaf_size=1,split=median", "bvh:leaf_size=1,split=morton"] {
        let h = build(text, &scene_of("chain", &chain));
        assert!(h.stats.depth < 100 && h.stats.leaves == 900, "{text}: {:?}", h.stats);
    }
}

/// Leaves in order, with their boxes.
fn leaf_boxes(h: &Hierarchy) -> Vec<String> {
    nodes(h)
        .into_iter()
        .filter(|(b, l, _)| h.links[*b as usize].child[*l] == NONE)
        .map(|(b, l, _)| format!("{} {:?}", h.links[b as usize].first[l], h.bounds[b as usize].get(l)))
        .collect()
}

#[test]
fn the_wide_layout_has_the_leaves_of_the_binary_one() {
    let scene = soup(31, 4000, 20.0, 0.4);
    for split in ["sah", "median", "morton"] {
        let [wide, binary] = ["wide", "binary"].map(|l| build(&format!("bvh:split={split},layout={l}"), &scene));
        assert_eq!((&wide.entries, leaves(&wide)), (&binary.entries, leaves(&binary)));
        assert_eq!(leaf_boxes(&wide), leaf_boxes(&binary));
        assert!(wide.node_count() < binary.node_count());
    }
}

#[test]
fn every_kernel_builds_the_same_hierarchy_on_any_number_of_threads() {
    // Large enough that several tasks deal the records of one node.
    let scene = soup(32, 150_000, 100.0, 1.0);
    let build = |kernel, threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bvh { kernel, ..Bvh::default() }.build(&scene)).unwrap()
    };
    let one = build(Kernel::Scalar, 1);
    one.assert_well_formed(&scene);
    for (kernel, threads) in Kernel::all().into_iter().flat_map(|k| [(k, 1), (k, 3)]) {
        let h = build(kernel, threads);
        assert!(h.entries == one.entries && h.bounds == one.bounds && h.links == one.links, "{kernel:?}, {threads}");
    }
}

#[test]
fn mistaken_parameters_are_named() {
    let error = |text: &str| structure::make(&Spec::parse(text).unwrap()).err().unwrap().to_string();
    assert!(error("bvh:split=shah").contains("\"sah\", \"median\", \"morton\""));
    assert!(error("bvh:leafsize=3").contains("did you mean `leaf_size`?"));
    assert!(error("bvh:bins=1").contains("from 2 to 32"));
    assert!(error("bvh:stop=never").contains("\"size\", \"cost\""));
    // What has no effect is no parameter either.
    for split in ["median", "morton"] {
        for (stated, key) in [("bins=32", "bins"), ("stop=cost", "stop")] {
            let message = error(&format!("bvh:split={split},{stated}"));
            assert!(message.contains(&format!("leave `{key}` out")));
            assert!(message.contains(&format!("split={split}")), "{message}");
        }
        // Defaults say nothing, given or filled in.
        let resolved = structure::make(&Spec::parse(&format!("bvh:split={split}")).unwrap()).unwrap().1;
        assert_eq!(structure::make(&resolved).unwrap().1, resolved);
        assert!(structure::make(&Spec::parse(&format!("bvh:split={split},bins=16,stop=size")).unwrap()).is_ok());
    }
    assert!(structure::make(&Spec::parse("bvh:bins=32,stop=cost").unwrap()).is_ok());
}
