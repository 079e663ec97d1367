//! Tests: oracle. The item buffer against a ray caster that shares nothing with
//! it, judgements against mutations, truth files against damage.

use crate::common::soup;
use cullmark::culling::{Class, Removes};
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::oracle::image::{ANY, BACKGROUND};
use cullmark::oracle::volume::{Meets, triangle_meets};
use cullmark::oracle::{BitSet, FrameTruth, Submitted, judge_frame, judged_frames, truth, truth_cached, verdict};
use cullmark::record::Accuracy;
use cullmark::scene::Scene;
use std::collections::HashSet;

fn accuracy(width_px: u32, height_px: u32, samples: u32) -> Accuracy {
    Accuracy { frames: 4, width_px, height_px, samples }
}

fn cameras() -> [Camera; 3] {
    let ortho = Projection::Orthographic { height_m: 14.0 };
    [
        Camera::default(),
        Camera { near_m: 2.0, far_m: Some(9.0), ..Camera::default() },
        Camera { projection: ortho, near_m: 1.0, far_m: Some(30.0), ..Camera::default() },
    ]
}

fn pose(at: DVec3) -> Pose {
    Pose { eye: at, forward: DVec3::new(0.9, 0.3, -0.1).normalize(), up: DVec3::Z }
}

fn truth_of(scene: &Scene, camera: &Camera, pose: Pose, accuracy: &Accuracy) -> FrameTruth {
    truth(scene, camera, &[(0, pose)], accuracy).frames.remove(0)
}

/// Adds a triangle that nothing else shares vertices with.
fn push(scene: &mut Scene, corners: [DVec3; 3], two_sided: bool, occluder: bool) {
    let v = scene.positions.len() as u32;
    scene.positions.extend(corners);
    scene.source_triangle_id.push(scene.triangles.len() as u32);
    scene.triangles.push([v, v + 1, v + 2]);
    scene.object_id.push(0);
    scene.material_id.push(0);
    scene.two_sided.push(two_sided);
    scene.occluder.push(occluder);
    scene.source_triangle_count = scene.triangles.len() as u32;
}

fn empty() -> Scene {
    Scene { material_names: vec!["a".into()], ..Scene::default() }
}

/// Square of two triangles facing -x, at depth `x`, with the given half size.
fn wall(scene: &mut Scene, x: f64, half: f64, two_sided: bool, occluder: bool) {
    let p = |y: f64, z: f64| DVec3::new(x, y * half, z * half);
    push(scene, [p(1.0, -1.0), p(-1.0, -1.0), p(-1.0, 1.0)], two_sided, occluder);
    push(scene, [p(1.0, -1.0), p(-1.0, 1.0), p(1.0, 1.0)], two_sided, occluder);
}

/// Looks along +x from the origin.
fn ahead() -> Pose {
    Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z }
}

// --- The twin: one ray, all triangles, in world coordinates -------------------

struct Hit {
    triangle: u32,
    depth: f64,
    /// The ray passes all edges and clip planes by more than rounding.
    certain: bool,
}

/// Every drawable triangle that the ray of sample (x, y) may meet.
fn cast(scene: &Scene, view: &View, grid: [u32; 2], x: u32, y: u32) -> Vec<Hit> {
    let across = (f64::from(x) + 0.5) / f64::from(grid[0]) * 2.0 - 1.0;
    let up = 1.0 - (f64::from(y) + 0.5) / f64::from(grid[1]) * 2.0;
    let aside = view.right * (across * view.half_width) + view.up * (up * view.half_height);
    let (origin, direction) = match view.camera.projection {
        Projection::Perspective { .. } => (view.eye, view.forward + aside),
        Projection::Orthographic { .. } => (view.eye + aside, view.forward),
    };
    let far = view.camera.far_m.unwrap_or(f64::INFINITY);
    let mut hits = Vec::new();
    for t in 0..scene.len() as u32 {
        let [a, b, c] = scene.corners(t).map(|p| p - origin);
        let n = (b - a).cross(c - a);
        // Exact facing has its own tests; in general position a plain sign will do.
        let towards = -n.dot(direction);
        if towards <= 0.0 && !scene.two_sided[t as usize] {
            continue;
        }
        let depth = n.dot(a) / n.dot(direction);
        // Signed volumes of the ray with each edge (Moeller & Trumbore's determinants).
        let signs = [(b, c), (c, a), (a, b)].map(|(p, q)| {
            let size = direction.length() * p.length() * q.length();
            (direction.dot(p.cross(q)) * -towards.signum(), size * 1e-11)
        });
        let near = view.camera.near_m;
        if signs.iter().all(|(s, e)| *s > -e) && depth > near * (1.0 - 1e-9) && depth < far * (1.0 + 1e-9) {
            let inside = depth > near * (1.0 + 1e-9) && depth < far * (1.0 - 1e-9);
            hits.push(Hit { triangle: t, depth, certain: inside && signs.iter().all(|(s, e)| s > e) });
        }
    }
    hits
}

/// Compares every sample; returns how many were compared strictly.
fn agrees_with_rays(scene: &Scene, camera: &Camera, pose: Pose, size: [u32; 2], samples: u32) -> usize {
    let view = View::new(camera, &pose);
    let truth = truth_of(scene, camera, pose, &accuracy(size[0], size[1], samples));
    let grid = [size[0] * samples, size[1] * samples];
    let image = truth.item_image();
    let mut alternates = vec![BACKGROUND; image.len()];
    let mut veils = HashSet::new();
    for (index, tile) in (0u32..).zip(&truth.tiles) {
        tile.for_each(truth.grid.tile(index), |run| {
            for x in run.x..run.x + run.len {
                alternates[(run.y * grid[0] + x) as usize] = run.alternate;
            }
        });
        for v in &tile.veils {
            (v.x..v.x + v.len).for_each(|x| assert!(veils.insert((x, v.y, v.id)), "a veil once"));
        }
    }
    let mut strict = 0;
    for y in 0..grid[1] {
        for x in 0..grid[0] {
            let at = (y * grid[0] + x) as usize;
            let winner = image[at];
            let hits = cast(scene, &view, grid, x, y);
            let hides = |h: &&Hit| scene.occluder[h.triangle as usize];
            let depth = match winner {
                BACKGROUND => f64::INFINITY,
                id => hits.iter().find(|h| h.triangle + 1 == id).expect("the winner is hit").depth,
            };
            let tie = depth * 1e-7;
            for h in hits.iter().filter(hides) {
                assert!(!h.certain || h.depth > depth - tie, "sample {x},{y}: {} hides {winner}", h.triangle + 1);
            }
            let close = hits.iter().filter(hides).filter(|h| (h.depth - depth).abs() <= tie).count();
            if close <= 1 {
                assert_eq!(alternates[at], BACKGROUND, "sample {x},{y}");
                strict += 1;
            } else {
                assert!(alternates[at] == BACKGROUND || alternates[at] == ANY || alternates[at] > winner);
            }
            for h in hits.iter().filter(|h| !hides(h)) {
                let seen = veils.remove(&(x, y, h.triangle + 1));
                let (in_front, behind) = (h.depth < depth - tie, h.depth > depth + tie);
                assert!(seen || !h.certain || !in_front, "sample {x},{y}: veil {} is missing", h.triangle);
                assert!(!seen || !behind, "sample {x},{y}: veil {} is hidden", h.triangle);
            }
        }
    }
    assert!(veils.is_empty(), "veils without a hit: {veils:?}");
    strict
}

#[test]
fn the_item_buffer_agrees_with_rays_on_random_triangles() {
    for (seed, offset) in [(1, 0.0), (2, 0.0), (3, 1e6)] {
        for camera in cameras() {
            let mut scene = soup(seed, 160, 8.0, 3.0);
            for t in 0..scene.len() {
                scene.two_sided[t] = t % 5 == 0;
                scene.occluder[t] = t % 7 != 0;
            }
            scene.positions.iter_mut().for_each(|p| *p += DVec3::splat(offset));
            let eye = pose(DVec3::new(-6.0, -2.0, 1.0) + DVec3::splat(offset));
            let strict = agrees_with_rays(&scene, &camera, eye, [70, 40], 2);
            assert!(strict > 140 * 80 * 9 / 10, "only {strict} samples in general position");
        }
    }
}

#[test]
fn the_item_buffer_agrees_with_rays_when_the_eye_stands_in_the_triangles() {
    // Corners behind the eye and across the near plane on every side.
    let mut scene = soup(9, 60, 3.0, 12.0);
    scene.two_sided.fill(true);
    let camera = Camera { near_m: 0.5, ..Camera::default() };
    assert!(agrees_with_rays(&scene, &camera, pose(DVec3::ZERO), [67, 35], 1) > 2000);
}

#[test]
fn the_item_buffer_agrees_with_rays_on_degenerate_arrangements() {
    for camera in cameras() {
        let mut scene = empty();
        // Edges through sample centres, duplicates, a turned duplicate, a decal
        // on a wall, a pane in front, a sliver, and triangles edge-on to the eye.
        wall(&mut scene, 8.0, 2.0, false, true);
        wall(&mut scene, 8.0, 2.0, false, true);
        wall(&mut scene, 8.0, 1.0, true, false);
        wall(&mut scene, 6.0, 0.5, false, true);
        wall(&mut scene, 4.0, 0.3, true, false);
        let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        push(&mut scene, [at(5.0, 0.5, 0.0), at(5.0, -0.5, 1e-9), at(5.0, 0.0, 2e-9)], true, true);
        push(&mut scene, [at(3.0, 0.0, -1.0), at(7.0, 0.0, -1.0), at(5.0, 0.0, 1.0)], true, true);
        agrees_with_rays(&scene, &camera, ahead(), [64, 36], 1);
        agrees_with_rays(&scene, &camera, ahead(), [33, 17], 3);
    }
}

#[test]
fn a_closed_mesh_has_no_cracks_and_no_overlaps() {
    // A fan around a point straight ahead: every ray through it takes one triangle.
    let mut scene = empty();
    let n = 97;
    let rim = |i: u32| {
        let a = f64::from(i % n) / f64::from(n) * std::f64::consts::TAU;
        DVec3::new(5.0 + (3.0 * a).sin(), -20.0 * a.cos(), 20.0 * a.sin())
    };
    (0..n).for_each(|i| push(&mut scene, [DVec3::new(5.0, 0.0, 0.0), rim(i), rim(i + 1)], true, true));
    for samples in [1, 3] {
        let t = truth_of(&scene, &Camera::default(), ahead(), &accuracy(160, 90, samples));
        assert!(t.item_image().iter().all(|id| *id != BACKGROUND), "no crack");
        assert_eq!(t.covered_pixels, 160 * 90);
        for (index, tile) in (0u32..).zip(&t.tiles) {
            tile.for_each(t.grid.tile(index), |run| assert_eq!(run.alternate, BACKGROUND, "no overlap"));
        }
        assert_eq!(t.visible.len(), n as usize);
    }
}

#[test]
fn more_samples_of_a_nested_grid_never_see_less() {
    // Regular sub-grids nest for odd multiples: 1 in 3 in 9. (1 and 2 do not nest.)
    let scene = soup(4, 3000, 10.0, 0.4);
    let mut last: Vec<u32> = Vec::new();
    for samples in [1, 3, 9] {
        let t = truth_of(&scene, &Camera::default(), pose(DVec3::new(-9.0, -3.0, 1.0)), &accuracy(64, 36, samples));
        let now: Vec<u32> = t.visible.iter().map(|(id, _)| *id).collect();
        assert!(last.iter().all(|id| now.binary_search(id).is_ok()), "{samples} samples lose what fewer saw");
        assert!(now.len() > last.len());
        last = now;
    }
}

#[test]
fn truth_is_the_same_at_any_number_of_threads() {
    let scene = soup(5, 4000, 10.0, 1.0);
    let poses: Vec<(u32, Pose)> = (0..3).map(|i| (i, pose(DVec3::new(-8.0 + f64::from(i), 0.0, 0.0)))).collect();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| truth(&scene, &Camera::default(), &poses, &accuracy(200, 100, 2)))
    };
    let one = run(1);
    assert_eq!(one, run(3));
    assert!(one.frames.iter().all(|f| f.visible.len() > 50));
}

#[test]
fn everything_a_sample_sees_is_in_the_exact_sets() {
    for camera in cameras() {
        let scene = soup(6, 3000, 10.0, 1.5);
        let view = View::new(&camera, &pose(DVec3::new(-7.0, 0.0, 0.0)));
        let t = truth_of(&scene, &camera, pose(DVec3::new(-7.0, 0.0, 0.0)), &accuracy(120, 68, 2));
        let standings = t.standings();
        for (id, _) in &t.visible {
            assert!(standings[*id as usize].drawable());
            assert_eq!(triangle_meets(&view, &scene.corners(*id)), Meets::Certainly, "a sample lies well inside");
        }
        let inside = standings.iter().filter(|s| s.meets == Meets::Certainly).count();
        assert!(inside > t.visible.len() && inside < scene.len());
        assert!(t.predicate_fallbacks as f64 <= 1e-3 * t.predicate_calls as f64, "the filter decides ordinary scenes");
    }
}

#[test]
fn dense_sampling_never_contradicts_the_exact_frustum_set() {
    let scene = soup(7, 1500, 12.0, 6.0);
    for camera in cameras() {
        let view = View::new(&camera, &pose(DVec3::new(-5.0, 0.0, 0.0)));
        let depth = |p: DVec3| {
            view.planes.iter().map(|pl| pl.normal.dot(p - view.eye) + pl.offset_m).fold(f64::INFINITY, f64::min)
        };
        for t in 0..scene.len() as u32 {
            let [a, b, c] = scene.corners(t);
            let n = 24;
            let points = (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j)));
            let deepest = points
                .map(|(i, j)| {
                    depth(a + (b - a) * (f64::from(i) / f64::from(n)) + (c - a) * (f64::from(j) / f64::from(n)))
                })
                .fold(f64::NEG_INFINITY, f64::max);
            match triangle_meets(&view, &[a, b, c]) {
                Meets::Certainly => {}
                Meets::CertainlyNot => assert!(deepest < 1e-9, "triangle {t} has a point {deepest} m inside"),
                Meets::Uncertain => assert!(deepest < 1e-9),
            }
            // The other way: a triangle found inside has a sample not much outside.
            if triangle_meets(&view, &[a, b, c]) == Meets::Certainly {
                let edge = (b - a).length().max((c - a).length()).max((c - b).length());
                assert!(deepest > -edge / f64::from(n), "triangle {t} is {deepest} m outside");
            }
        }
    }
}

// --- Judgement ------------------------------------------------------------------

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

// --- Files ------------------------------------------------------------------------

#[test]
fn damaged_truth_files_are_computed_anew() {
    let scene = soup(10, 500, 8.0, 2.0);
    let poses: Vec<(u32, Pose)> = judged_frames(9, &accuracy(40, 30, 2))
        .into_iter()
        .map(|f| (f, pose(DVec3::new(-7.0 + f64::from(f) * 0.1, 0.0, 0.0))))
        .collect();
    let dir = tempfile::tempdir().unwrap();
    let cached = || truth_cached(&scene, &Camera::default(), &poses, &accuracy(40, 30, 2), dir.path(), "id").unwrap();
    let first = cached();
    assert_eq!(first, truth(&scene, &Camera::default(), &poses, &accuracy(40, 30, 2)));
    let file = dir.path().join("truth/id.bin");
    let good = std::fs::read(&file).unwrap();
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for bad in [&b""[..], b"not truth", &good[..good.len() / 2], &flipped] {
        std::fs::write(&file, bad).unwrap();
        assert_eq!(cached(), first);
        assert_eq!(std::fs::read(&file).unwrap(), good, "the file is whole again");
    }
    assert_eq!(std::fs::read_dir(dir.path().join("truth")).unwrap().count(), 1, "no partial file is left");
    let shorter = truth_cached(&scene, &Camera::default(), &poses[..1], &accuracy(40, 30, 2), dir.path(), "id");
    assert_eq!(shorter.unwrap().frames.len(), 1, "a file of other frames is no answer");
}

#[test]
fn a_cache_that_cannot_be_written_says_so() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let scene = soup(11, 10, 8.0, 2.0);
    let poses = [(0, pose(DVec3::ZERO))];
    let e = truth_cached(&scene, &Camera::default(), &poses, &accuracy(8, 8, 1), file.path(), "id").unwrap_err();
    assert!(e.to_string().contains("cannot store the truth") && e.help.is_some(), "{e}");
}
