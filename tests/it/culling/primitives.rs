//! Spheres and points in place of boxes: kernels and their twin, and what they promise.

use super::arithmetics::{boxes_for, boxes_only, culled, finite, masks, views};
use super::build::{Rng, blocks, tree};
use super::kernels::{frames, nasty_boxes};
use super::walks::{Method, triangles};
use crate::common::soup;
use cullmark::culling::frustum_exact::Exact;
use cullmark::culling::frustum_planes::PlaneMasks;
use cullmark::culling::frustum_sphere::{Points, SphereBlock, Spheres, kernels};
use cullmark::culling::{Class, Tally, find_test, knows_arithmetic, make_tests, make_tests_in};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Arithmetic, Box32, DVec3, Vec3, View};
use cullmark::registry::{Spec, parse_sum};

/// Which boxes the frustum test `culling` rejects, one by one.
pub fn rejected(culling: &str, h: &Hierarchy, view: &View) -> Vec<bool> {
    let mut tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
    tests[0].prepare(&Default::default(), h);
    culled(tests[0].as_mut(), h, view, &mut Tally::default())
}

#[test]
fn sphere_kernels_agree_bit_for_bit_on_random_and_degenerate_boxes() {
    let mut rng = Rng::new(81);
    let (bounds, _) = blocks(&nasty_boxes(&mut rng, 4000));
    let all = kernels();
    let twin = all.last().unwrap();
    let mut said = [0u32; 2];
    for frame in frames(&mut rng) {
        for (i, block) in bounds.iter().enumerate() {
            let spheres = SphereBlock::new(block, i % 5 == 0);
            let (planes, inside) = (if i % 3 == 0 { 0xff } else { rng.bits() as u8 }, i % 2 == 0);
            let mut want = PlaneMasks::default();
            (twin.block)(&frame, &spheres, planes, inside, &mut want);
            for kernel in &all {
                let mut got = PlaneMasks::default();
                (kernel.block)(&frame, &spheres, planes, inside, &mut got);
                assert_eq!(got, want, "{} on {spheres:?} against {frame:?}", kernel.name);
            }
            said[0] += want.outside.iter().map(|m| m.count_ones()).sum::<u32>();
            said[1] += want.inside.iter().map(|m| m.count_ones()).sum::<u32>();
        }
    }
    assert!(said.iter().all(|n| *n > 10_000), "{said:?}");
}

#[test]
fn flat_sphere_kernels_are_the_block_kernel_over_all_planes() {
    let mut rng = Rng::new(80);
    for count in [0, 1, 9, 800] {
        let (bounds, live) = blocks(&nasty_boxes(&mut rng, count));
        let spheres: Vec<SphereBlock> = bounds.iter().map(|b| SphereBlock::new(b, false)).collect();
        let before: Vec<u8> = live.iter().map(|_| (rng.bits() & rng.bits()) as u8).collect();
        for frame in frames(&mut rng) {
            for kernel in kernels() {
                let mut outside = before.clone();
                let work = (kernel.flat)(&frame, &spheres, &live, &mut outside);
                let (mut planes, mut lanes) = (0, 0);
                for (i, block) in spheres.iter().enumerate() {
                    let mut masks = PlaneMasks::default();
                    (kernel.block)(&frame, block, frame.all(), false, &mut masks);
                    let mut left = live[i] & !before[i];
                    lanes += u64::from(left.count_ones());
                    for m in &masks.outside[..frame.count] {
                        planes += u64::from(left.count_ones());
                        left &= !m;
                    }
                    assert_eq!(outside[i], !left, "{}", kernel.name);
                }
                assert_eq!((work.planes, work.lanes), (planes, lanes), "{}", kernel.name);
            }
        }
    }
}

/// What spheres say of boxes is so in exact arithmetic, and a point is never inside.
#[test]
fn spheres_say_nothing_that_is_not_so() {
    let mut rng = Rng::new(82);
    let (mut none, mut said) = (Tally::default(), [0u32; 2]);
    let kernel = kernels()[0];
    for (view, origin) in views(&mut rng) {
        let boxes: Vec<Box32> = boxes_for(&mut rng, &view, origin, 400).into_iter().filter(finite).collect();
        let h = boxes_only(&boxes, origin);
        let truth = masks(Exact::default(), &h, &view, &mut none);
        let spheres = masks(Spheres::new(kernel), &h, &view, &mut none);
        for (s, t) in spheres.iter().zip(&truth) {
            for k in 0..6 {
                assert_eq!(s.outside[k] & !t.outside[k], 0, "{view:?} {origin}");
                // A box with swapped bounds can be both.
                assert_eq!(s.inside[k] & !t.inside[k] & !t.outside[k], 0, "{view:?} {origin}");
                said[0] += s.outside[k].count_ones();
                said[1] += s.inside[k].count_ones();
            }
        }
        let points = masks(Points::new(kernel), &h, &view, &mut none);
        assert!(points.iter().all(|m| m.inside == [0; 6]));
    }
    assert!(said.iter().all(|n| *n > 10_000), "{said:?}");
}

/// Against the plain forms in f64, far outside the guard.
#[test]
fn spheres_and_points_are_the_plain_tests_outside_the_guard() {
    let mut rng = Rng::new(83);
    let (mut spheres, mut points, mut boxes_kept) = (0, 0, 0);
    for view in super::walks::views(83, 30.0) {
        let boxes: Vec<Box32> = (0..1600)
            .map(|_| {
                let (c, h) = (rng.cube(60.0).as_vec3(), rng.cube(6.0).abs().as_vec3());
                Box32 { lo: c - h, hi: c + h }
            })
            .collect();
        let h = boxes_only(&boxes, DVec3::ZERO);
        let by = |primitive: &str| rejected(&format!("frustum:primitive={primitive}"), &h, &view);
        let [sphere, point, whole] = ["sphere", "point", "box"].map(by);
        for (i, b) in boxes.iter().enumerate() {
            let (lo, hi) = (b.lo.as_dvec3(), b.hi.as_dvec3());
            let (c, r) = ((lo + hi) * 0.5 - view.eye, ((hi - lo) * 0.5).length());
            let least = view.planes.iter().map(|p| p.normal.dot(c) + p.offset_m).fold(f64::INFINITY, f64::min);
            assert!(!sphere[i] || least + r < 0.0, "outside is proved");
            assert!(sphere[i] || least + r > -1e-3, "nothing clearly outside is kept");
            assert!(!point[i] || least < 1e-4);
            assert!(point[i] || least > -1e-3);
            assert!(!sphere[i] || whole[i], "the sphere holds the box");
            assert!(!whole[i] || point[i], "the box holds its middle");
            spheres += u32::from(!sphere[i] && whole[i]);
            points += u32::from(point[i] && !whole[i]);
            boxes_kept += u32::from(!whole[i]);
        }
    }
    println!("boxes kept {boxes_kept}; spheres keep {spheres} more, points lose {points} of them");
    assert!(spheres > 200 && points > 500 && points < boxes_kept);
}

#[test]
fn what_is_not_finite_is_kept_whatever_stands_for_it() {
    let sound = Box32 { lo: Vec3::new(-50.0, -1.0, -1.0), hi: Vec3::new(-49.0, 1.0, 1.0) };
    let mut boxes = vec![sound];
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut lo, mut hi) = (sound, sound);
            (lo.lo[axis], hi.hi[axis]) = (bad, bad);
            boxes.extend([lo, hi]);
        }
    }
    let h = boxes_only(&boxes, DVec3::ZERO);
    let view = super::build::view_along(DVec3::ZERO, DVec3::X, &Default::default());
    for extra in ["", ",octant=true", ",sat=true", ",octant=true,sat=true,last_plane=true"] {
        for primitive in ["box", "sphere", "point"] {
            let out = rejected(&format!("frustum:primitive={primitive}{extra}"), &h, &view);
            assert!(out[0] && out[1..].iter().all(|o| !o), "{primitive}{extra}: {out:?}");
        }
    }
}

/// Down a tree: spheres lose nothing that meets the view, points lose some.
#[test]
fn spheres_keep_what_boxes_keep_and_points_lose_some() {
    let scene = soup(84, 3000, 40.0, 2.0);
    let h = tree(&scene, 8, 2);
    let [mut boxes, mut spheres, mut points] =
        ["box", "sphere", "point"].map(|p| Method::new(&scene, &h, &format!("frustum:primitive={p}"), "depth_first"));
    let (mut more, mut fewer) = (0, 0);
    for view in super::walks::views(84, 40.0) {
        let [b, s, p] = [&mut boxes, &mut spheres, &mut points].map(|m| triangles(&h, &m.frame(&view).0));
        for t in 0..scene.len() {
            assert!(!b[t] || s[t]);
            more += u32::from(s[t] && !b[t]);
            fewer += u32::from(b[t] && !p[t]);
        }
    }
    assert!(more > 100 && fewer > 100, "{more} {fewer}");
}

#[test]
fn spheres_and_points_have_one_arithmetic_and_say_so() {
    let class = |text: &str| make_tests_in(&parse_sum(text).unwrap(), Arithmetic::F64).unwrap().0[0].class();
    assert_eq!(class("frustum:primitive=sphere"), Class::Conservative);
    assert_eq!(class("frustum:primitive=point"), Class::Aggressive);
    for (text, knows) in [("frustum", true), ("frustum:primitive=box", true), ("frustum:primitive=sphere", false)] {
        assert_eq!(knows_arithmetic(&Spec::parse(text).unwrap()), knows, "{text}");
    }
    for text in ["frustum:primitive=sphere,arithmetic=f32_relative", "frustum:primitive=box,arithmetic=exact"] {
        find_test(&Spec::parse(text).unwrap()).unwrap();
    }
    let e = find_test(&Spec::parse("frustum:primitive=point,arithmetic=f64").unwrap()).err().unwrap();
    assert_eq!(e.key.as_deref(), Some("arithmetic"), "{e}");
    assert!(e.to_string().contains("f32_relative") && e.help.unwrap().contains("primitive=box"));
    // Parameters that came later are in no older id.
    let plain = find_test(&Spec::new("frustum")).unwrap().1.to_string();
    assert_eq!(plain, "frustum:last_plane=false,node_test=box,plane_mask=true");
}
