//! The BSP tree: facts A5.1 to A5.3, and its limits.

use super::policies::assert_area_is_kept;
use super::{BSPS, bsp_gives_up, build, leaves, nodes, scene_of, scenes};
use crate::common::soup;
use cullmark::hierarchy::{Hierarchy, LANES, NONE};
use cullmark::math::DVec3;
use cullmark::registry::Spec;
use cullmark::scene::Scene;
use cullmark::structure;

fn min_leaf(text: &str) -> u64 {
    structure::make(&Spec::parse(text).unwrap()).unwrap().1.int("min_leaf") as u64
}

// A5.1
#[test]
fn leaves_keep_their_limit_or_are_counted_and_nodes_are_twice_the_leaves_less_one() {
    for scene in scenes().iter().filter(|s| !s.is_empty()) {
        for text in BSPS.iter().filter(|t| !bsp_gives_up(t, scene)) {
            let h = build(text, scene);
            let what = format!("{text} on {}: {:?}", scene.name, h.stats);
            assert_eq!(h.stats.nodes, 2 * h.stats.leaves - 1, "{what}");
            let over = leaves(&h).iter().filter(|(a, b)| u64::from(b - a) > min_leaf(text)).count() as u64;
            assert_eq!(over, h.stats.oversized_leaves, "{what}");
            if text.contains("binary") {
                assert_eq!(h.node_count() as u64, h.stats.nodes, "{what}");
            }
            let can_be_cut = !matches!(scene.name.as_str(), "identical" | "points");
            assert!(!can_be_cut || over == 0, "{what}");
        }
    }
}

// A5.2
#[test]
fn splitting_at_polygon_planes_keeps_the_area_of_every_triangle() {
    for scene in scenes() {
        for text in BSPS.iter().filter(|t| !bsp_gives_up(t, &scene)) {
            assert_area_is_kept(&build(text, &scene), &scene, &format!("{text} on {}", scene.name));
        }
    }
}

/// Which side of its parent's plane a point is on: distance to the half-space of a node.
fn depth(h: &Hierarchy, block: u32, lane: usize, p: DVec3) -> f64 {
    let half = h.half_spaces.as_ref().unwrap()[block as usize * LANES + lane].expect("children have half-spaces");
    half.normal.dot(p - h.origin) + half.offset_m
}

#[test]
fn half_spaces_hold_the_pieces_of_their_nodes() {
    for scene in scenes() {
        for text in BSPS.iter().filter(|t| !bsp_gives_up(t, &scene)) {
            let h = build(text, &scene);
            if h.half_spaces.is_none() {
                assert_eq!(h.node_count().min(1), h.node_count(), "only a lone root has no plane");
                continue;
            }
            for (block, lane, level) in nodes(&h).into_iter().filter(|n| n.2 > 0) {
                let links = &h.links[block as usize];
                for position in links.first[lane]..links.end[lane] {
                    let worst =
                        h.piece(&scene, position).iter().map(|p| depth(&h, block, lane, *p)).fold(0.0, f64::min);
                    assert!(worst >= 0.0, "{text} on {}: {worst} m outside at level {level}", scene.name);
                }
            }
        }
    }
}

/// The leaves from front to back: at every plane the eye's side first.
fn front_to_back(h: &Hierarchy, eye: DVec3) -> Vec<(u32, u32)> {
    let mut out = Vec::new();
    let mut pending = vec![(0u32, 0usize)];
    while let Some((block, lane)) = pending.pop() {
        let links = &h.links[block as usize];
        let child = links.child[lane];
        if child == NONE {
            out.push((links.first[lane], links.end[lane]));
            continue;
        }
        let near = usize::from(depth(h, child, 0, eye) < depth(h, child, 1, eye));
        pending.push((child, 1 - near));
        pending.push((child, near));
    }
    out
}

// A5.3
#[test]
fn a_point_descends_to_the_one_leaf_that_holds_its_piece() {
    for scene in scenes().iter().filter(|s| !s.is_empty()) {
        for text in ["bsp:layout=binary", "bsp:min_leaf=80,layout=binary"].iter().filter(|t| !bsp_gives_up(t, scene)) {
            let h = build(text, scene);
            let mut checked = 0;
            for (first, end) in leaves(&h) {
                for position in first..end {
                    let [a, b, c] = h.piece(scene, position);
                    let p = (a + b + c) / 3.0;
                    let (mut block, mut lane) = (0, 0);
                    // A piece in a plane of the tree is on neither side: no verdict.
                    let mut clear = true;
                    while h.links[block as usize].child[lane] != NONE {
                        block = h.links[block as usize].child[lane];
                        let sides = [depth(&h, block, 0, p), depth(&h, block, 1, p)];
                        clear &= (sides[0] - sides[1]).abs() > 1e-6;
                        lane = usize::from(sides[0] < sides[1]);
                    }
                    if clear {
                        let links = &h.links[block as usize];
                        assert_eq!((links.first[lane], links.end[lane]), (first, end), "{text} on {}", scene.name);
                        checked += 1;
                    }
                }
            }
            if scene.name.starts_with("soup") || scene.name == "hills" {
                assert!(checked * 10 >= scene.len() * 9, "{text} on {}: {checked}", scene.name);
            }
        }
    }
}

/// Distance along the ray at which it crosses the triangle, if it does.
fn hit(eye: DVec3, ray: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let n = (b - a).cross(c - a);
    let t = n.dot(a - eye) / n.dot(ray);
    let p = eye + ray * t;
    let inside = [(a, b), (b, c), (c, a)].iter().all(|(u, v)| n.dot((*v - *u).cross(p - *u)) >= 0.0);
    (t > 0.0 && inside).then_some(t)
}

// A5.3
#[test]
fn drawing_leaves_by_plane_side_is_a_painters_order() {
    let scene: Scene = soup(21, 1500, 10.0, 1.5);
    let h = build("bsp:min_leaf=30,layout=binary", &scene);
    assert!(h.stats.leaves > 50 && h.fragments.is_some(), "{:?}", h.stats);
    let mut crossings = 0;
    for k in 0..40 {
        let angle = f64::from(k) * 2.4;
        let eye = DVec3::new(angle.cos(), angle.sin(), (f64::from(k) * 0.7).sin()) * f64::from(k % 5) * 4.0;
        let order = front_to_back(&h, eye);
        assert_eq!(order.len() as u64, h.stats.leaves);
        for j in 0..40 {
            let a = f64::from(j) * 1.7 + angle;
            let ray = DVec3::new(a.cos(), a.sin(), (f64::from(j) * 0.9).cos() * 0.8).normalize();
            let mut hits: Vec<(f64, usize)> = Vec::new();
            for (rank, (first, end)) in order.iter().enumerate() {
                hits.extend((*first..*end).filter_map(|p| hit(eye, ray, h.piece(&scene, p))).map(|t| (t, rank)));
            }
            hits.sort_by(|a, b| a.0.total_cmp(&b.0));
            for pair in hits.windows(2).filter(|w| w[1].0 - w[0].0 > 1e-9) {
                assert!(pair[0].1 <= pair[1].1, "leaf {} is drawn before {} and hidden by it", pair[1].1, pair[0].1);
                crossings += usize::from(pair[0].1 != pair[1].1);
            }
        }
    }
    assert!(crossings > 500, "the rays cross many leaves: {crossings}");
}

#[test]
fn wide_and_binary_layouts_hold_the_same_pieces_in_the_same_order() {
    let scene = soup(22, 4000, 10.0, 0.8);
    let [wide, binary] = ["bsp:min_leaf=50", "bsp:min_leaf=50,layout=binary"].map(|t| build(t, &scene));
    assert!(wide.entries == binary.entries && wide.fragments == binary.fragments && wide.stats == binary.stats);
    assert_eq!(leaves(&wide), leaves(&binary));
    assert!(wide.links.len() * 3 < binary.links.len(), "blocks of 8 against blocks of 2");
}

#[test]
fn a_tree_that_splits_without_end_says_which_parameter_to_change() {
    // Large triangles that pass through each other.
    let scene = soup(2, 400, 10.0, 8.0);
    let (s, _) = structure::make(&Spec::parse("bsp:min_leaf=20").unwrap()).unwrap();
    let e = s.build(&scene).expect_err("thousands of mutual intersections");
    assert_eq!(e.key.as_deref(), Some("split_weight"));
    assert!(e.to_string().contains("min_leaf") && e.message.contains("4 pieces a triangle"), "{e}");
}

#[test]
fn stacked_coplanar_squares_do_not_breed() {
    // Ten copies of a sloped floor: every plane is shared by thousands of pieces,
    // and rounded corners lie beside it by a few roundings.
    let mut triangles = Vec::new();
    for copy in 0..10 {
        let shift = DVec3::new(f64::from(copy) * 0.37, f64::from(copy) * 0.21, 0.0);
        let lift = |p: DVec3| DVec3::new(p.x, p.y, p.x * 0.3 + p.y * 0.7);
        triangles.extend(super::floor(12, |_, _| 0.0).into_iter().map(|t| t.map(|p| lift(p + shift))));
    }
    let scene = scene_of("stacked", &triangles);
    let h = build("bsp:min_leaf=400", &scene);
    assert!(h.duplication(&scene) < 2.5, "{}", h.duplication(&scene));
    assert_area_is_kept(&h, &scene, "stacked");
}
