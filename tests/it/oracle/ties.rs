//! Copies of a surface: any one of a class stands for all, and none of them is an error.

use super::{accuracy, ahead, cameras, empty, push, truth_of, wall};
use cullmark::culling::Removes;
use cullmark::math::{Camera, DVec3, View};
use cullmark::oracle::{FrameTruth, Submitted, judge_frame};
use cullmark::record::{Accuracy, FrameErrors};
use cullmark::scene::Scene;

const HIDDEN: Removes = Removes { outside_frustum: true, back_facing: true, occluded: true };

struct Case {
    scene: Scene,
    view: View,
    truth: FrameTruth,
}

impl Case {
    fn new(scene: Scene, camera: Camera, accuracy: &Accuracy) -> Case {
        let truth = truth_of(&scene, &camera, ahead(), accuracy);
        Case { view: View::new(&camera, &ahead()), scene, truth }
    }

    fn judge(&self, ids: &[u32]) -> FrameErrors {
        let mut submitted = Submitted::none(self.scene.len());
        ids.iter().for_each(|t| submitted.triangles.insert(*t));
        judge_frame(&self.scene, &self.view, &self.truth, &submitted, HIDDEN)
    }
}

/// Copies of a wall of two triangles: copy c is 2 c and 2 c + 1.
fn copies(count: u32) -> Scene {
    let mut scene = empty();
    (0..count).for_each(|_| wall(&mut scene, 5.0, 1.0, false, true));
    scene
}

#[test]
fn any_member_of_a_class_of_copies_stands_for_it_and_none_is_an_error() {
    for camera in cameras() {
        for count in [1, 2, 3, 5] {
            let case = Case::new(copies(count), camera, &accuracy(64, 36, 2));
            assert_eq!(case.truth.visible.len(), 2, "one for each class");
            for a in 0..count {
                for b in 0..count {
                    let e = case.judge(&[2 * a, 2 * b + 1]);
                    let found = (e.false_culls, e.false_cull_pixels, e.submitted_unseen, e.submitted_invisible);
                    assert_eq!(found, (0, 0, 0, 0), "copies {a} and {b} of {count}");
                }
            }
            let all: Vec<u32> = (0..2 * count).collect();
            // More than one of a class is in vain, though not proved invisible.
            let e = case.judge(&all);
            assert_eq!((e.false_culls, e.submitted_unseen, e.submitted_invisible), (0, 2 * u64::from(count) - 2, 0));
            let last_two: Vec<u32> = all.iter().copied().skip(2 * count as usize - 4.min(2 * count as usize)).collect();
            assert_eq!(case.judge(&last_two).submitted_unseen, last_two.len() as u64 - 2);
            let half = case.judge(&[2 * (count - 1)]);
            assert_eq!((half.false_culls, half.lost_ids), (1, vec![1]), "no copy of the other half");
            let none = case.judge(&[]);
            assert_eq!((none.false_culls, none.false_cull_pixels), (2, case.truth.covered_pixels));
            assert!(none.false_cull_samples >= none.false_cull_pixels && none.samples == 64 * 36 * 4);
        }
    }
}

#[test]
fn a_copy_that_a_larger_coplanar_surface_holds_may_stand_for_it_too() {
    // Three surfaces in one plane, turned and shifted: not copies of each other.
    let mut scene = copies(2);
    let p = |y: f64, z: f64| DVec3::new(5.0, y, z);
    push(&mut scene, [p(4.0, -4.0), p(-4.0, -4.0), p(0.0, 6.0)], false, true);
    let case = Case::new(scene, Camera::default(), &accuracy(64, 36, 1));
    assert_eq!(case.judge(&[4]).false_culls, 0, "it covers both walls");
    assert_eq!(case.judge(&[0, 1]).false_culls, 1, "what it shows around them is lost");
    assert_eq!(case.judge(&[]).false_cull_pixels, case.truth.covered_pixels);
}

#[test]
fn copies_that_only_rays_see_are_a_class_as_well() {
    // Far smaller than a sample's distance, beside the samples' places.
    let mut scene = empty();
    let p = |y: f64, z: f64| DVec3::new(5.0, 0.03 + y, 0.03 + z);
    (0..3).for_each(|_| push(&mut scene, [p(1e-3, 0.0), p(0.0, 0.0), p(0.0, 1e-3)], false, true));
    let case = Case::new(scene, Camera::default(), &Accuracy { witness_rays: 16, ..accuracy(16, 9, 1) });
    assert!(case.truth.visible.is_empty());
    assert_eq!(case.truth.bracket.witnesses.len(), 1);
    for t in 0..3 {
        let e = case.judge(&[t]);
        assert_eq!((e.false_culls, e.submitted_unseen), (0, 0), "copy {t}");
    }
    let e = case.judge(&[]);
    assert_eq!((e.false_culls, e.false_culls_by_ray), (1, 1));
}
