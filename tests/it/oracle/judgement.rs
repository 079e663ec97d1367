//! Judgements: an ideal method is right, and every mutation of it is caught.

use super::{accuracy, ahead, empty, pose, truth_of, wall};
use crate::common::soup;
use cullmark::culling::{Class, Removes};
use cullmark::math::{Camera, DVec3, Pose, View};
use cullmark::oracle::volume::Meets;
use cullmark::oracle::{BitSet, FrameTruth, Submitted, judge_frame, verdict};
use cullmark::scene::Scene;

const FRUSTUM: Removes = Removes { outside_frustum: true, back_facing: false, occluded: false };
const FACING: Removes = Removes { outside_frustum: true, back_facing: true, occluded: false };
const HIDDEN: Removes = Removes { outside_frustum: true, back_facing: true, occluded: true };

struct Case {
    scene: Scene,
    view: View,
    truth: FrameTruth,
}

fn case() -> Case {
    let scene = soup(8, 3000, 10.0, 1.5);
    let at = pose(DVec3::new(-7.0, 0.0, 0.0));
    let camera = Camera::default();
    let truth = truth_of(&scene, &camera, at, &accuracy(120, 68, 2));
    Case { view: View::new(&camera, &at), scene, truth }
}

impl Case {
    fn judge(&self, triangles: BitSet, removes: Removes) -> cullmark::record::FrameErrors {
        let submitted = Submitted { triangles, lost_pieces: Vec::new() };
        judge_frame(&self.scene, &self.view, &self.truth, &submitted, removes)
    }

    /// Exactly the set to which `removes` entitles.
    fn ideal(&self, removes: Removes) -> BitSet {
        let mut set = BitSet::new(self.scene.len());
        for (t, s) in (0u32..).zip(self.truth.standings()) {
            if s.maybe_potential(removes) {
                set.insert(t);
            }
        }
        set
    }
}

#[test]
fn an_ideal_method_is_right_and_every_dropped_triangle_is_caught() {
    let case = case();
    for removes in [Removes::default(), FRUSTUM, FACING] {
        let ideal = case.ideal(removes);
        let errors = case.judge(ideal.clone(), removes);
        assert_eq!((errors.false_culls, errors.potential_lost, errors.false_cull_pixels), (0, 0, 0));
        assert_eq!(errors.submitted, errors.potential);
        assert_eq!(verdict(Class::Exact, &[errors]), None);
        for dropped in ideal.iter().step_by(17) {
            let mut less = ideal.clone();
            less.remove(dropped);
            let errors = case.judge(less, removes);
            assert_eq!(errors.potential_lost, 1, "triangle {dropped} of {removes:?}");
            assert_eq!(errors.lost_ids, [dropped]);
            let seen = case.truth.visible.iter().any(|(t, _)| *t == dropped);
            assert_eq!(errors.false_culls, u64::from(seen));
            assert_eq!(errors.false_cull_pixels > 0, seen);
            assert!(verdict(Class::Conservative, std::slice::from_ref(&errors)).is_some());
            assert_eq!(verdict(Class::SampleConservative, &[errors]).is_some(), seen);
        }
    }
    // One more than the exact set is no loss, and yet not exact.
    let errors = case.judge(BitSet::full(case.scene.len()), FACING);
    assert_eq!(verdict(Class::Conservative, std::slice::from_ref(&errors)), None);
    assert!(verdict(Class::Exact, &[errors]).unwrap().contains("the exact set holds"));
}

#[test]
fn the_visible_set_alone_satisfies_a_method_that_removes_hidden_triangles() {
    let case = case();
    let mut seen = BitSet::new(case.scene.len());
    case.truth.visible.iter().for_each(|(t, _)| seen.insert(*t));
    let errors = case.judge(seen.clone(), HIDDEN);
    assert_eq!(verdict(Class::Conservative, std::slice::from_ref(&errors)), None);
    assert_eq!(errors.over_submission(), 1.0);
    assert!(case.judge(seen, FACING).potential_lost > 0, "a frustum and facing test owes the hidden ones too");
}

#[test]
fn a_flipped_facing_sign_is_caught() {
    let case = case();
    let mut averted = BitSet::new(case.scene.len());
    for (t, s) in (0u32..).zip(case.truth.standings()) {
        if s.meets != Meets::CertainlyNot && !s.faces {
            averted.insert(t);
        }
    }
    let errors = case.judge(averted, FACING);
    assert_eq!(errors.false_culls, case.truth.visible.len() as u64);
    assert_eq!(errors.false_cull_pixels, errors.covered_pixels);
    assert!(errors.largest_blob_px > 1000);
    assert!(verdict(Class::Conservative, &[errors]).is_some());
}

#[test]
fn of_two_equal_surfaces_either_may_be_drawn_but_not_neither() {
    let mut scene = empty();
    wall(&mut scene, 5.0, 1.0, false, true);
    wall(&mut scene, 5.0, 1.0, false, true);
    let camera = Camera::default();
    let view = View::new(&camera, &ahead());
    let truth = truth_of(&scene, &camera, ahead(), &accuracy(64, 36, 1));
    let judge = |ids: &[u32]| {
        let mut submitted = Submitted::none(scene.len());
        ids.iter().for_each(|t| submitted.triangles.insert(*t));
        judge_frame(&scene, &view, &truth, &submitted, HIDDEN)
    };
    for ids in [[0, 1], [2, 3], [0, 3]] {
        assert_eq!(judge(&ids).false_culls, 0, "{ids:?} draws the wall");
    }
    let half = judge(&[1, 3]);
    assert_eq!((half.false_culls, half.lost_ids), (1, vec![0]));
    assert_eq!(judge(&[]).false_cull_pixels, truth.covered_pixels);
}

#[test]
fn what_does_not_hide_is_seen_and_shows_what_is_behind() {
    let mut scene = empty();
    wall(&mut scene, 8.0, 4.0, false, true);
    wall(&mut scene, 5.0, 1.0, false, false);
    wall(&mut scene, 4.0, 1.0, false, false);
    wall(&mut scene, 9.0, 4.0, false, false);
    let truth = truth_of(&scene, &Camera::default(), ahead(), &accuracy(64, 36, 1));
    let seen: Vec<u32> = truth.visible.iter().map(|(t, _)| *t).collect();
    assert_eq!(seen, [0, 1, 2, 3, 4, 5], "both panes and the wall behind them, not what is behind the wall");
    let count = |t: usize| truth.visible[t].1;
    let both = |t: usize| count(t) + count(t + 1);
    assert!(both(0) > 4 * both(2) && both(4) > both(2), "nothing is cut out of the wall");
}

#[test]
fn a_piece_of_a_split_triangle_is_missed_where_it_would_be_seen() {
    let mut scene = empty();
    wall(&mut scene, 5.0, 1.0, false, true);
    let camera = Camera::default();
    let view = View::new(&camera, &ahead());
    let truth = truth_of(&scene, &camera, ahead(), &accuracy(128, 72, 1));
    let [a, b, c] = scene.corners(0);
    let mid = (b + c) * 0.5;
    let judge = |lost_pieces| {
        let submitted = Submitted { triangles: BitSet::full(2), lost_pieces };
        judge_frame(&scene, &view, &truth, &submitted, FACING)
    };
    assert_eq!(judge(vec![]).false_cull_pixels, 0);
    let half = judge(vec![(0, [a, b, mid])]);
    assert_eq!((half.false_culls, half.potential_lost, half.lost_ids), (1, 1, vec![0]));
    let pixels = f64::from(truth.visible[0].1) / 2.0;
    assert!((half.false_cull_pixels as f64 - pixels).abs() < 0.1 * pixels, "half of the triangle's pixels");
    let outside = [a, b, mid].map(|p| p + DVec3::new(0.0, 50.0, 0.0));
    assert_eq!(judge(vec![(0, outside)]).potential_lost, 0, "a piece outside may go");
}

#[test]
fn what_rounding_alone_puts_inside_the_volume_is_not_owed() {
    // The wall lies 1.4e-17 m short of the near plane, and its inverse depth rounds to the plane's own.
    let mut scene = empty();
    let p = |y: f64, z: f64| DVec3::new(0.125, y, z);
    super::push(&mut scene, [p(-1.0, -1.0), p(1.0, -1.0), p(0.0, 1.0)], true, true);
    let at = Pose { eye: DVec3::new(0.02500000000000001, 0.0, 0.0), ..ahead() };
    let camera = Camera::default();
    let truth = truth_of(&scene, &camera, at, &accuracy(64, 36, 1));
    assert!(!truth.visible.is_empty(), "samples see it");
    assert_eq!(truth.standings()[0].meets, Meets::Uncertain);
    let case = Case { view: View::new(&camera, &at), scene, truth };
    let errors = case.judge(BitSet::new(1), FRUSTUM);
    assert_eq!((errors.false_culls, errors.potential_lost, errors.false_cull_pixels), (0, 0, 0));
    assert_eq!(verdict(Class::Conservative, &[errors]), None);
}
