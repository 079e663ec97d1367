//! The clipping oracle on scenes whose visible set is known, and against dense samples.

use super::{accuracy, ahead, cameras, empty, pose, push, truth_of, wall};
use crate::common::soup;
use cullmark::math::{Camera, DVec3, Projection, View};
use cullmark::oracle::clipping;
use cullmark::scene::Scene;

fn visible(scene: &Scene, camera: &Camera) -> Vec<u32> {
    clipping::visible(scene, &View::new(camera, &ahead())).unwrap().iter().collect()
}

fn both_cameras() -> [Camera; 2] {
    let projection = Projection::Orthographic { height_m: 6.0 };
    [Camera::default(), Camera { projection, ..Camera::default() }]
}

#[test]
fn a_wall_hides_what_is_behind_it_and_touching_borders_show_nothing() {
    for camera in both_cameras() {
        let mut scene = empty();
        wall(&mut scene, 5.0, 2.0, false, true);
        // Behind, and as seen within; through a pane; in front.
        wall(&mut scene, 9.0, 1.0, false, true);
        wall(&mut scene, 4.0, 0.5, false, false);
        assert_eq!(visible(&scene, &camera), [0, 1, 4, 5]);
    }
    // Parallel rays: the image of the wall behind is exactly that in front.
    let mut scene = empty();
    wall(&mut scene, 5.0, 2.0, false, true);
    wall(&mut scene, 9.0, 2.0, false, true);
    assert_eq!(visible(&scene, &both_cameras()[1]), [0, 1], "a border is no area");
}

#[test]
fn a_hole_of_any_size_shows_what_is_behind() {
    for camera in both_cameras() {
        for (gap, count) in [(0.0, 0), (1e-9, 2), (1e-12, 2)] {
            let mut scene = empty();
            let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
            for (y0, y1) in [(-50.0, 0.125), (0.125 + gap, 50.0)] {
                push(&mut scene, [p(4.0, y1, -50.0), p(4.0, y0, -50.0), p(4.0, y0, 50.0)], false, true);
                push(&mut scene, [p(4.0, y1, -50.0), p(4.0, y0, 50.0), p(4.0, y1, 50.0)], false, true);
            }
            wall(&mut scene, 8.0, 3.0, false, true);
            let behind = visible(&scene, &camera).iter().filter(|t| **t >= 4).count();
            // Both triangles of the wall behind cross the slit.
            assert_eq!(behind, count, "gap {gap}");
        }
    }
}

#[test]
fn triangles_that_pass_through_each_other_hide_each_other_in_part() {
    for camera in both_cameras() {
        let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let mut scene = empty();
        push(&mut scene, [p(4.0, -2.0, -1.0), p(8.0, 2.0, -1.0), p(6.0, 0.0, 1.5)], true, true);
        push(&mut scene, [p(8.0, -2.0, -1.0), p(4.0, 2.0, -1.0), p(6.0, 0.0, 1.5)], true, true);
        // Hidden by the one on the left and by the other on the right of the crossing.
        push(&mut scene, [p(6.05, -0.4, -0.5), p(6.05, 0.4, -0.5), p(6.05, 0.0, -0.2)], true, true);
        assert_eq!(visible(&scene, &camera), [0, 1]);
        // Without one of them it shows.
        scene.occluder[1] = false;
        assert_eq!(visible(&scene, &camera), [0, 1, 2]);
    }
}

#[test]
fn what_the_near_plane_cuts_away_hides_nothing() {
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    for camera in both_cameras() {
        let camera = Camera { near_m: 3.0, far_m: Some(20.0), ..camera };
        let mut scene = empty();
        wall(&mut scene, 2.0, 9.0, false, true);
        wall(&mut scene, 5.0, 1.0, false, true);
        wall(&mut scene, 30.0, 90.0, false, true);
        assert_eq!(visible(&scene, &camera), [2, 3]);
        // A ramp from before to behind the near plane hides with its far part alone.
        push(&mut scene, [p(1.0, -40.0, -3.0), p(1.0, 40.0, -3.0), p(4.5, 0.0, 4.0)], true, true);
        assert!(visible(&scene, &camera).contains(&6));
    }
}

#[test]
fn copies_are_visible_together_and_hide_together() {
    for camera in both_cameras() {
        let mut scene = empty();
        (0..3).for_each(|_| wall(&mut scene, 5.0, 2.0, false, true));
        wall(&mut scene, 5.0 + 1e-10, 1.0, false, true);
        wall(&mut scene, 9.0, 1.0, false, true);
        assert_eq!(visible(&scene, &camera), [0, 1, 2, 3, 4, 5, 6, 7], "equal within a tie, and nothing behind");
    }
}

#[test]
fn whatever_dense_samples_see_is_visible() {
    for (seed, camera) in (20..).zip(cameras()) {
        let scene = soup(seed, 250, 8.0, 2.0);
        let at = pose(DVec3::new(-7.0, -2.0, 1.0));
        let exact = clipping::visible(&scene, &View::new(&camera, &at)).unwrap();
        let t = truth_of(&scene, &camera, at, &accuracy(160, 90, 4));
        for (id, _) in &t.visible {
            assert!(exact.contains(*id), "a sample sees {id}");
        }
        // The other way: a triangle of some size is seen.
        assert!(t.visible.len() as u64 >= exact.count() * 9 / 10, "{} of {}", t.visible.len(), exact.count());
    }
}

#[test]
fn large_scenes_are_refused_with_the_number() {
    let scene = soup(1, clipping::MOST_TRIANGLES + 1, 8.0, 1.0);
    let e = clipping::visible(&scene, &View::new(&Camera::default(), &ahead())).unwrap_err();
    assert!(e.to_string().contains("5001 triangles") && e.help.is_some(), "{e}");
}
