//! The octant test: what it says is so, the answer is the same, and what it saves;
//! with it fact B4, all accelerations in all combinations.

use super::arithmetics::{boxes_for, boxes_only, finite, masks, views};
use super::build::{Rng, camera, list, tree, view_along};
use super::walks::{Method, views as ordinary_views};
use crate::common::soup;
use cullmark::culling::frustum_exact::Exact;
use cullmark::culling::frustum_octant::Halves;
use cullmark::culling::{Tally, Test, make_tests_in};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Arithmetic, Box32, Camera, DVec3, Pose, Vec3, View};
use cullmark::registry::parse_sum;

/// Accelerations, all combinations of them; the first is none.
fn combinations() -> impl Iterator<Item = String> {
    (0..8).map(|i| format!("plane_mask={},last_plane={},octant={}", i & 1 == 1, i >> 1 & 1 == 1, i >> 2 & 1 == 1))
}

/// In exact arithmetic a plane that is left out does not reject the box, and the box
/// is inside where that is said.
#[test]
fn what_the_octant_test_leaves_out_could_not_reject() {
    let mut rng = Rng::new(85);
    let (mut none, mut said, mut asked) = (Tally::default(), [0u32; 2], 0);
    for (view, origin) in views(&mut rng) {
        let boxes = boxes_for(&mut rng, &view, origin, 400);
        let h = boxes_only(&boxes, origin);
        let halves = Halves::new(&view, origin);
        let truth = masks(Exact::default(), &h, &view, &mut none);
        for (block, truth) in truth.iter().enumerate() {
            let far = halves.of_boxes(&h.bounds[block]);
            assert_eq!(far, halves.of_boxes_plainly(&h.bounds[block]), "the twin: {view:?} {origin}");
            let live = h.links[block].live;
            let sound = (0..8).filter(|l| finite(&h.bounds[block].get(*l))).fold(0u8, |m, l| m | 1 << l);
            for k in 0..view.planes.len() {
                assert_eq!(far.skip[k] & live & truth.outside[k], 0, "{view:?} {origin} plane {k}");
                assert_eq!(far.inside[k] & live & !truth.inside[k], 0, "{view:?} {origin} plane {k}");
                assert_eq!(far.skip[k] & live & !sound, 0, "no place, no half");
                said[0] += (far.skip[k] & live).count_ones();
                said[1] += (far.inside[k] & live).count_ones();
                asked += live.count_ones();
            }
        }
    }
    println!("of {asked} comparisons {} are left out, {} of them inside", said[0], said[1]);
    assert!(said[0] * 100 > asked * 15 && said[1] * 2 > said[0], "{said:?} of {asked}");
}

/// Verdicts of one test on all blocks, each asked twice, so that last planes are known.
fn verdicts(culling: &str, arithmetic: Arithmetic, h: &Hierarchy, view: &View) -> Vec<u8> {
    let mut test: Box<dyn Test> = make_tests_in(&parse_sum(culling).unwrap(), arithmetic).unwrap().0.remove(0);
    test.prepare(&Default::default(), h);
    test.begin(view, h);
    let ask = |test: &mut Box<dyn Test>| -> Vec<u8> {
        let carry = test.initial_carry();
        let blocks = (0u32..).zip(&h.links);
        blocks.map(|(b, l)| test.judge(h, b, l.live, carry, &mut Tally::default()).outside).collect()
    };
    let first = ask(&mut test);
    assert_eq!(ask(&mut test), first, "{culling}");
    first
}

/// B4.1 on degenerate boxes and views, where trees cannot go.
#[test]
fn accelerations_reject_the_identical_boxes_of_any_kind_in_any_view() {
    let mut rng = Rng::new(86);
    let mut out = 0;
    for (view, origin) in views(&mut rng) {
        let h = boxes_only(&boxes_for(&mut rng, &view, origin, 160), origin);
        for primitive in ["box", "sphere", "point"] {
            for arithmetic in Arithmetic::ALL.into_iter().take(if primitive == "box" { 6 } else { 1 }) {
                let of = |c: &str| verdicts(&format!("frustum:primitive={primitive},{c}"), arithmetic, &h, &view);
                let all: Vec<_> = combinations().map(|c| of(&c)).collect();
                assert!(all.iter().all(|v| *v == all[0]), "{primitive} {arithmetic} {view:?} {origin}");
                out += all[0].iter().map(|o| o.count_ones()).sum::<u32>();
            }
        }
    }
    assert!(out > 10_000, "{out}");
}

/// B4.1 down trees: also what is wholly inside is the same.
#[test]
fn all_accelerations_together_submit_the_identical_list() {
    let scene = soup(87, 2000, 50.0, 1.0);
    for h in [tree(&scene, 8, 0), tree(&scene, 8, 3), list(&scene, 5)] {
        for part in ["", ",primitive=sphere", ",primitive=point", ",arithmetic=filtered", ",sat=true"] {
            for walk in ["depth_first", "flat"] {
                let method = |c: String| Method::new(&scene, &h, &format!("frustum:{c}{part}"), walk);
                let mut all: Vec<Method> = combinations().map(method).collect();
                for view in ordinary_views(9, 50.0).iter().step_by(3) {
                    let (want, slow) = all[0].frame(view);
                    for (other, name) in all[1..].iter_mut().zip(combinations().skip(1)) {
                        let (got, tally) = other.frame(view);
                        assert_eq!(got, want, "{name}{part} {walk}");
                        assert!(tally.nodes_visited <= slow.nodes_visited, "{name}{part} {walk}");
                        // A stale last plane may be asked for nothing, once a lane.
                        assert!(tally.plane_tests <= slow.plane_tests + slow.lane_tests, "{name}{part} {walk}");
                    }
                }
            }
        }
    }
}

#[test]
fn fewer_planes_are_tested_and_each_is_counted() {
    let scene = soup(88, 6000, 60.0, 0.5);
    let h = tree(&scene, 8, 0);
    let sum = |culling: &str| -> Tally {
        let mut method = Method::new(&scene, &h, culling, "depth_first");
        ordinary_views(10, 50.0).iter().map(|v| method.frame(v).1).sum()
    };
    let [plain, octant] = ["frustum:plane_mask=false", "frustum:plane_mask=false,octant=true"].map(sum);
    let [masked, both] = ["frustum", "frustum:octant=true"].map(sum);
    println!("plane tests: none {}, octant {}", plain.plane_tests, octant.plane_tests);
    println!("with plane masks {}, with both {}", masked.plane_tests, both.plane_tests);
    assert!(octant.plane_tests * 10 < plain.plane_tests * 8 && both.plane_tests < masked.plane_tests);
    assert_eq!((plain.octant_tests, octant.octant_tests), (0, octant.lane_tests), "once a lane");
    // Where nothing is certain, nothing is asked or saved.
    let world = sum("frustum:octant=true,arithmetic=f32_world");
    assert_eq!((world.octant_tests, world.plane_tests), (0, sum("frustum:arithmetic=f32_world").plane_tests));
}

/// Counted by hand: a box ahead to the right and up is compared with the right and the
/// upper plane alone.
#[test]
fn a_box_in_one_quadrant_is_compared_with_its_own_planes() {
    let far = Camera { far_m: Some(100.0), ..camera(90.0, 1.0) };
    for (c, planes) in [(camera(90.0, 1.0), 2), (far, 2)] {
        let view = View::new(&c, &Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z });
        // y points to the left.
        let boxes = [Vec3::new(20.0, -5.0, 5.0), Vec3::new(20.0, -70.0, 5.0), Vec3::new(-20.0, -5.0, 5.0)];
        let h = boxes_only(&boxes.map(|c| Box32 { lo: c - 1.0, hi: c + 1.0 }), DVec3::ZERO);
        let mut test = make_tests_in(&parse_sum("frustum:octant=true").unwrap(), Arithmetic::F32Relative).unwrap().0;
        test[0].prepare(&Default::default(), &h);
        test[0].begin(&view, &h);
        let mut work = |lanes: u8| {
            let mut tally = Tally::default();
            let carry = test[0].initial_carry();
            (test[0].judge(&h, 0, lanes, carry, &mut tally).outside, tally.plane_tests)
        };
        assert_eq!(work(0b001), (0, planes));
        // The right plane is asked first, and rejects it.
        assert_eq!(work(0b010), (0b010, 1));
        // Behind the eye no half excuses the sides: left keeps it, right rejects it... or near does.
        let (outside, tests) = work(0b100);
        assert!(outside == 0b100 && (1..=5).contains(&tests), "{tests}");
    }
}

/// B4.2 with the octant test.
#[test]
fn a_fully_inside_subtree_costs_no_plane_tests_with_octants_either() {
    let scene = soup(89, 4000, 5.0, 0.2);
    let h = tree(&scene, 8, 0);
    let ahead = view_along(DVec3::new(-1000.0, 3.0, 2.0), DVec3::X, &Camera::default());
    for last in [false, true] {
        let culling = format!("frustum:octant=true,last_plane={last}");
        let (out, tally) = Method::new(&scene, &h, &culling, "depth_first").frame(&ahead);
        assert_eq!(out.ranges, [(0, 4000)]);
        assert_eq!((tally.nodes_visited, tally.plane_tests, tally.octant_tests), (1, 2, 1), "the root alone");
    }
}

/// B4.3 with all accelerations.
#[test]
fn a_still_camera_needs_at_most_one_plane_test_a_rejected_node_with_octants() {
    let scene = soup(90, 6000, 60.0, 0.5);
    let h = list(&scene, 1);
    for view in ordinary_views(5, 30.0) {
        let mut coherent = Method::new(&scene, &h, "frustum:last_plane=true,octant=true", "flat");
        let (cold, first) = coherent.frame(&view);
        let (out, warm) = coherent.frame(&view);
        assert_eq!(out, cold);
        let kept = out.entry_count() * view.planes.len() as u64;
        let rejected = 6000 - out.entry_count();
        assert!(warm.plane_tests <= first.plane_tests && warm.plane_tests <= kept + rejected);
        assert!(warm.plane_tests >= rejected, "rejecting needs a plane");
    }
}
