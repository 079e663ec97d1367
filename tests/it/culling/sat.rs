//! Separating axes against linear programs (fact B3): nothing that meets the view is
//! rejected, and everything that clearly does not is.

use super::arithmetics::{boxes_for, boxes_only, finite, views};
use super::build::{Rng, tree, view_along};
use super::primitives::rejected;
use super::walks::{Method, triangles, views as ordinary_views};
use crate::common::soup;
use cullmark::culling::Tally;
use cullmark::math::{Box32, Camera, DVec3, View};

/// The largest margin by which some point of the box is inside all planes (negative: the least
/// by which all points miss one), by trying every corner of the linear program in x, y, z and
/// the margin.
fn margin(view: &View, b: &Box32) -> f64 {
    // Rows `n . x + d >= w t`, relative to the eye; the box is hard, the planes give way.
    let mut rows: Vec<[f64; 5]> = Vec::new();
    for axis in 0..3 {
        let (lo, hi) = (f64::from(b.lo[axis]) - view.eye[axis], f64::from(b.hi[axis]) - view.eye[axis]);
        let n = DVec3::AXES[axis];
        rows.push([n.x, n.y, n.z, -lo, 0.0]);
        rows.push([-n.x, -n.y, -n.z, hi, 0.0]);
    }
    rows.extend(view.planes.iter().map(|p| [p.normal.x, p.normal.y, p.normal.z, p.offset_m, 1.0]));
    let mut best = f64::NEG_INFINITY;
    let count = rows.len();
    for i in 0..count {
        for j in i + 1..count {
            for k in j + 1..count {
                // The last is a plane, or the corner has no margin.
                for l in (k + 1).max(6)..count {
                    let Some([x, y, z, t]) = solve([rows[i], rows[j], rows[k], rows[l]]) else { continue };
                    let holds = |r: &[f64; 5]| r[0] * x + r[1] * y + r[2] * z + r[3] - r[4] * t >= -1e-9;
                    if t > best && rows.iter().all(holds) {
                        best = t;
                    }
                }
            }
        }
    }
    best
}

/// `n . x - w t = -d` for four rows, by elimination with pivots.
fn solve(mut m: [[f64; 5]; 4]) -> Option<[f64; 4]> {
    m.iter_mut().for_each(|r| *r = [r[0], r[1], r[2], -r[4], -r[3]]);
    for c in 0..4 {
        let pivot = (c..4).max_by(|a, b| m[*a][c].abs().total_cmp(&m[*b][c].abs())).unwrap();
        m.swap(c, pivot);
        if m[c][c].abs() < 1e-9 {
            return None;
        }
        for r in (0..4).filter(|r| *r != c) {
            let by = m[r][c] / m[c][c];
            let above = m[c];
            m[r].iter_mut().zip(above).for_each(|(x, y)| *x -= by * y);
        }
    }
    Some([0, 1, 2, 3].map(|i| m[i][4] / m[i][i]))
}

/// Boxes of all sizes around the view, some flat.
fn boxes(rng: &mut Rng, view: &View, count: usize) -> Vec<Box32> {
    (0..count)
        .map(|i| {
            let size = [2.0, 15.0, 60.0][i % 3];
            let c = (view.eye + view.forward * 20.0 + rng.cube(60.0)).as_vec3();
            let mut h = (rng.cube(size).abs()).as_vec3();
            if i % 7 == 0 {
                h[i % 3] = 0.0;
            }
            Box32 { lo: c - h, hi: c + h }
        })
        .collect()
}

#[test]
fn separating_axes_decide_as_a_linear_program_does() {
    let mut rng = Rng::new(91);
    let (mut met, mut corner_test_keeps, mut close) = (0, 0, 0);
    for view in ordinary_views(91, 30.0) {
        let boxes = boxes(&mut rng, &view, 120);
        let h = boxes_only(&boxes, DVec3::ZERO);
        let truth: Vec<f64> = boxes.iter().map(|b| margin(&view, b)).collect();
        let planes = rejected("frustum:arithmetic=f64", &h, &view);
        for culling in [
            "frustum:sat=true,arithmetic=f64",
            "frustum:sat=true,arithmetic=exact",
            "frustum:sat=true,primitive=sphere",
            "frustum:sat=true,octant=true,arithmetic=f64",
        ] {
            for ((out, margin), b) in rejected(culling, &h, &view).into_iter().zip(&truth).zip(&boxes) {
                assert!(!out || *margin < 1e-7, "{culling} loses a box that meets the view by {margin}: {b:?}");
                assert!(out || *margin > -1e-6, "{culling} keeps a box that misses it by {margin}: {b:?} {view:?}");
            }
        }
        let (single, plain) = (rejected("frustum:sat=true", &h, &view), rejected("frustum", &h, &view));
        for (i, margin) in truth.iter().enumerate() {
            assert!(!single[i] || *margin < 1e-7);
            assert!(!plain[i] || single[i], "sat only adds");
            met += u32::from(*margin > 0.0);
            corner_test_keeps += u32::from(*margin < -1e-6 && !planes[i]);
            close += u32::from(margin.abs() < 1e-6);
        }
    }
    println!("meet the view {met}, kept by the planes for nothing {corner_test_keeps}, too close to say {close}");
    assert!(met > 500 && corner_test_keeps > 50 && close < 20, "{met} {corner_test_keeps} {close}");
}

/// In all kinds of views, of degenerate boxes: what is rejected has no point in the view.
#[test]
fn nothing_with_a_point_in_the_view_is_rejected_anywhere() {
    let mut rng = Rng::new(92);
    let mut inside = 0;
    for (view, origin) in views(&mut rng) {
        let boxes: Vec<Box32> = boxes_for(&mut rng, &view, origin, 200).into_iter().filter(finite).collect();
        let h = boxes_only(&boxes, origin);
        let out = rejected("frustum:sat=true,primitive=sphere", &h, &view);
        let eye = view.eye - origin;
        for (b, out) in boxes.iter().zip(out).filter(|(b, _)| b.lo.cmple(b.hi).all()) {
            // Corners, middle, and the point nearest to a place ahead of the eye.
            let (lo, hi) = (b.lo.as_dvec3(), b.hi.as_dvec3());
            let ahead = [0.2, 1.0, 10.0, 100.0].map(|d| (eye + view.forward * d).clamp(lo, hi));
            let corners =
                (0..8).map(|i| DVec3::from_array([0, 1, 2].map(|k| if i >> k & 1 == 1 { hi[k] } else { lo[k] })));
            let sees = |p: DVec3| view.planes.iter().all(|pl| pl.normal.dot(p - eye) + pl.offset_m >= 0.0);
            let seen = corners.chain(ahead).chain([(lo + hi) * 0.5]).any(sees);
            assert!(!(seen && out), "{b:?} {view:?} {origin}");
            inside += u32::from(seen);
        }
    }
    assert!(inside > 500, "{inside}");
}

/// Fact B3.1, and that it is over with separating axes.
#[test]
fn no_false_positives_are_left() {
    let mut rng = Rng::new(32);
    let view = view_along(DVec3::ZERO, DVec3::X, &Camera { far_m: Some(100.0), ..Camera::default() });
    let mut shares = |side: (f64, f64), count: usize| {
        let boxes: Vec<Box32> = (0..count)
            .map(|_| {
                let c = DVec3::new(rng.range(-80.0, 180.0), rng.range(-150.0, 150.0), rng.range(-110.0, 110.0));
                let s = [0, 1, 2].map(|_| rng.range(side.0, side.1) * 0.5);
                let (c, h) = (c.as_vec3(), DVec3::from_array(s).as_vec3());
                Box32 { lo: c - h, hi: c + h }
            })
            .collect();
        let h = boxes_only(&boxes, DVec3::ZERO);
        ["frustum", "frustum:sat=true"].map(|culling| {
            let out = rejected(culling, &h, &view);
            let kept: Vec<&Box32> = boxes.iter().zip(&out).filter(|(_, o)| !**o).map(|(b, _)| b).collect();
            // What is nearer to a plane than the guard of single precision is no matter of axes.
            let wrong = kept.iter().filter(|b| margin(&view, b) < -1e-3).count();
            wrong as f64 / kept.len() as f64
        })
    };
    let all = [shares((1.0, 5.0), 4000), shares((20.0, 20.0), 2500), shares((60.0, 60.0), 2500)];
    println!("false positives among kept boxes, 1-5 m, 20 m, 60 m: planes, separating axes {all:.4?}");
    assert!(all.iter().all(|[_, sat]| *sat == 0.0), "{all:?}");
    let [small, middle, large] = all.map(|[planes, _]| planes);
    assert!(small < 0.01 && (0.01..0.10).contains(&middle) && (0.04..0.20).contains(&large) && large > middle);
}

#[test]
fn down_a_tree_it_submits_less_and_counts_its_axes() {
    let scene = soup(93, 3000, 40.0, 3.0);
    let h = tree(&scene, 8, 1);
    for part in ["", ",primitive=sphere", ",octant=true", ",last_plane=true,plane_mask=false"] {
        let mut plain = Method::new(&scene, &h, &format!("frustum:sat=false{part}"), "depth_first");
        let mut exact = Method::new(&scene, &h, &format!("frustum:sat=true{part}"), "depth_first");
        let mut sums = [Tally::default(), Tally::default()];
        let mut fewer = 0;
        for view in ordinary_views(93, 40.0) {
            let (want, a) = plain.frame(&view);
            let (got, b) = exact.frame(&view);
            sums = [[sums[0], a].into_iter().sum(), [sums[1], b].into_iter().sum()];
            let (want, got) = (triangles(&h, &want), triangles(&h, &got));
            for t in 0..scene.len() {
                assert!(!got[t] || want[t], "it only removes");
                fewer += u32::from(want[t] && !got[t]);
                let corner_seen = scene
                    .corners(t as u32)
                    .iter()
                    .any(|p| view.planes.iter().all(|pl| pl.normal.dot(*p - view.eye) + pl.offset_m >= 0.0));
                assert!(got[t] || !corner_seen, "{part}: triangle {t}");
            }
        }
        assert!(fewer > 100 && sums[0].axis_tests == 0 && sums[1].axis_tests > 1000, "{part} {fewer} {sums:?}");
        assert!(sums[1].nodes_visited <= sums[0].nodes_visited);
    }
}
