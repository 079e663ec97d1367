//! The two passes before the oracle, and what they remember.

use super::occluding::{SMALL, built, degenerate, eyes, judged, scenes, set_up, structures, truth_of};
use super::portals::{cameras, facing, poses};
use super::walks::{Method, triangles};
use crate::structures::portal_octree::pane;
use crate::structures::scene_of;
use cullmark::culling::{Class, make_walk};
use cullmark::math::{Camera, DVec3, View};
use cullmark::record::Accuracy;
use cullmark::registry::Spec;

const SAMPLES: &str = "hiz_two_pass:width_px=96,height_px=54";
const INNER: &str = "hiz_two_pass:width_px=161,height_px=90,coverage=inner,pyramid=false";

#[test]
fn nothing_that_its_class_owes_is_lost() {
    let mut removed = 0;
    for (i, scene) in scenes().iter().enumerate() {
        // Jumps from frame to frame, then small steps.
        let steps = poses("random:frames=2,eyes=inside,aim=any", scene);
        let step = |k: u32| {
            let mut pose = steps[(k / 5) as usize];
            pose.eye += pose.forward * (0.2 * f64::from(k % 5));
            pose
        };
        let poses = [eyes(scene, 6, 4), (0..10).map(step).collect()].concat();
        for (j, camera) in cameras(12.0).iter().enumerate() {
            let rays = Accuracy { witness_rays: if (i + j) % 3 == 0 { 8 } else { 0 }, ..SMALL };
            let truth = truth_of(scene, camera, &poses, &rays);
            for (k, structure) in structures().iter().enumerate() {
                // One camera for each structure and scene.
                let Some(h) = built(structure, scene).filter(|_| (i + k) % 3 == j) else { continue };
                let (culling, walk) = (["none", "frustum"][(i + j) % 2], [SAMPLES, INNER][(i + k) % 2]);
                let mut setup = set_up(scene, &h, culling, walk, camera, &poses);
                judged(&mut setup, &truth, &format!("{} {structure} {culling} {walk}", scene.name));
                removed += setup.count_pass(|_, _, _| ()).iter().map(|w| w.tally.nodes_occluded).sum::<u64>();
            }
        }
    }
    assert!(removed > 4_000, "{removed} nodes hidden");
}

#[test]
fn nothing_is_lost_of_degenerate_scenes() {
    for (scene, poses, cameras) in degenerate() {
        for camera in &cameras {
            let truth = truth_of(&scene, camera, &poses, &SMALL);
            for structure in ["bvh:leaf_size=2", "octree:policy=E", "list:leaf_size=1"] {
                let Some(h) = built(structure, &scene) else { continue };
                for walk in [SAMPLES, INNER] {
                    let mut setup = set_up(&scene, &h, "none", walk, camera, &poses);
                    judged(&mut setup, &truth, &format!("{} {structure} {walk}", scene.name));
                }
            }
        }
    }
}

#[test]
fn class_and_samples_are_those_of_the_buffer() {
    let made = |text: &str| make_walk(&Spec::parse(text).unwrap()).unwrap().0;
    let (samples, inner) = (made(SAMPLES), made(INNER));
    assert_eq!((samples.class(), samples.samples()), (Class::SampleConservative, Some((96, 54))));
    assert_eq!((inner.class(), inner.samples()), (Class::Conservative, Some((161, 90))));
    assert!(samples.remembers() && samples.removes().occluded);
}

/// A wall at x = 3, a target behind it and one beside it.
#[test]
fn what_was_seen_hides_and_what_appears_is_drawn_at_once() {
    let wall = pane(0, 3.0, [-3.1, -3.0], [3.0, 3.07], false);
    let behind = pane(0, 6.0, [-1.0, -1.0], [1.0, 1.0], false);
    let beside = pane(0, 6.0, [7.0, -1.0], [9.0, 1.0], false);
    let scene = scene_of("wall", &[wall, behind, beside].concat());
    let at = |y: f64, ahead: DVec3| View::new(&Camera::default(), &facing(DVec3::new(-6.0, y, 0.0), ahead));
    let (before, aside) = (at(0.0, DVec3::X), at(-20.0, DVec3::new(12.0, 20.0, 0.0)));
    for structure in ["list:leaf_size=1", "bvh:leaf_size=1", "octree:depth=6,leaf_limit=1"] {
        let h = built(structure, &scene).unwrap();
        let mut method = Method::new(&scene, &h, "frustum", "hiz_two_pass:pyramid=false");
        let mut frame = |view: &View| {
            let (out, tally) = method.frame(view);
            let set = triangles(&h, &out);
            ([set[0], set[2], set[4]], tally.occluders_drawn)
        };
        assert_eq!(frame(&before), ([true, true, true], 0), "{structure}: the first frame knows nothing");
        assert_eq!(frame(&before), ([true, true, true], 6), "all of it is drawn first");
        assert_eq!(frame(&before), ([true, false, true], 4), "and what was hidden then is gone");
        assert_eq!(frame(&before), ([true, false, true], 4));
        // From the side the one appears, drawn in this very frame, and the other is hidden.
        assert_eq!(frame(&aside), ([true, true, true], 4), "{structure}");
        assert_eq!(frame(&aside), ([true, true, false], 4), "{structure}");
        // Out of sight is out of mind.
        frame(&View::new(&Camera::default(), &facing(DVec3::ZERO, DVec3::NEG_X)));
        assert_eq!(frame(&before).1, 0);
    }
}

#[test]
fn every_pass_does_the_same_and_all_are_within_the_frustum() {
    let scene = &scenes()[1];
    let poses = poses("random:frames=30,aim=scene", scene);
    for structure in ["bvh", "list", "nested_grid"] {
        let h = built(structure, scene).unwrap();
        let lists = |walk: &str| {
            let mut setup = set_up(scene, &h, "frustum", walk, &Camera::default(), &poses);
            let mut pass = || {
                let mut sets = Vec::new();
                let work = setup.count_pass(|_, _, list| sets.push(triangles(&h, list)));
                (sets, work.iter().map(|w| w.tally).collect::<Vec<_>>())
            };
            let first = pass();
            assert_eq!(pass(), first, "{structure} {walk}");
            first.0
        };
        let (all, kept) = (lists("depth_first"), lists("hiz_two_pass"));
        let within = all.iter().flatten().zip(kept.iter().flatten()).all(|(a, k)| *a || !k);
        let count = |sets: &[Vec<bool>]| sets.iter().flatten().filter(|s| **s).count();
        assert!(within && count(&kept) < count(&all), "{structure}: {} of {}", count(&kept), count(&all));
    }
}
