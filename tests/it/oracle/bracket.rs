//! V_lo <= V* <= V_hi: witness rays and proofs of hiding against the clipping
//! oracle, which shares neither samples nor bounds of rounding with them.

use super::{accuracy, ahead, cameras, empty, pose, push, truth_of, wall};
use crate::common::{shared, soup};
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::oracle::{BitSet, FrameTruth, clipping, truth};
use cullmark::record::{Accuracy, PathSource, PathSpec, SceneSource, Up, Winding};
use cullmark::registry::Spec;
use cullmark::scene::{Scene, generate, load, walkthrough};

fn effort(samples: u32, witness_rays: u32, hiding_cells: u32) -> Accuracy {
    Accuracy { witness_rays, hiding_cells, ..accuracy(48, 27, samples) }
}

fn within(small: &BitSet, large: &BitSet) -> Option<u32> {
    small.iter().find(|t| !large.contains(*t))
}

/// A box with its faces outward: welded by position, each side of two triangles.
fn cuboid(scene: &mut Scene, lo: DVec3, hi: DVec3) {
    let at = |i: usize| {
        let pick = |bit: usize, a: f64, b: f64| if i >> bit & 1 == 1 { b } else { a };
        DVec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z))
    };
    // Corners of each side counter-clockwise from outside.
    for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        push(scene, [at(a), at(b), at(c)], false, true);
        push(scene, [at(a), at(c), at(d)], false, true);
    }
}

/// Boxes in general position before and behind each other.
fn boxes() -> Scene {
    let mut scene = empty();
    for (x, y, z, size) in [
        (4.0, -1.3, -0.9, 1.1),
        (6.2, -0.2, -1.7, 2.3),
        (9.1, -2.9, -1.1, 3.7),
        (13.3, -5.3, -3.1, 7.9),
        (7.7, 1.9, 0.3, 0.7),
        // Behind the second from everywhere that the tests look from.
        (8.8, 0.9, -0.9, 0.3),
    ] {
        let lo = DVec3::new(x, y, z);
        cuboid(&mut scene, lo, lo + DVec3::new(size, size * 1.03, size * 0.97));
    }
    scene.anchor();
    scene
}

fn generated(spec: &str) -> Scene {
    generate::make(&Spec::parse(spec).unwrap()).unwrap().0.generate()
}

#[test]
fn the_bracket_closes_on_small_scenes_and_equals_what_clipping_finds() {
    // G1.2
    for camera in
        [Camera::default(), Camera { projection: Projection::Orthographic { height_m: 9.0 }, ..Camera::default() }]
    {
        for (i, eye) in
            [DVec3::new(0.0, 0.0, 0.0), DVec3::new(-1.1, 0.6, 0.9), DVec3::new(0.7, -1.9, -0.8)].into_iter().enumerate()
        {
            let scene = boxes();
            let view_pose = Pose { eye, forward: DVec3::new(1.0, 0.02, 0.03), up: DVec3::Z };
            let view = View::new(&camera, &view_pose);
            let t = truth_of(&scene, &camera, view_pose, &effort(1, 512, 512));
            let exact = clipping::visible(&scene, &view).unwrap();
            let (lo, hi) = (t.lo(), t.hi());
            assert_eq!(lo.iter().collect::<Vec<_>>(), exact.iter().collect::<Vec<_>>(), "lo of view {i}");
            assert_eq!(hi.iter().collect::<Vec<_>>(), exact.iter().collect::<Vec<_>>(), "hi of view {i}");
            let drawable = t.standings().iter().filter(|s| s.drawable()).count() as u64;
            assert!(exact.count() < drawable, "something is hidden");
        }
    }
}

#[test]
fn random_triangles_keep_the_order_of_the_bracket() {
    let (mut lo_sum, mut exact_sum, mut hi_sum, mut drawable) = (0, 0, 0, 0);
    for seed in 0..9 {
        for (c, camera) in cameras().into_iter().enumerate() {
            // Small far ones, large ones that pass through each other, and the eye among them.
            let (half, edge, count) = [(8.0, 1.0, 150), (6.0, 5.0, 90), (3.0, 4.0, 60)][(seed as usize + c) % 3];
            let mut scene = soup(40 + seed, count, half, edge);
            for t in 0..scene.len() {
                scene.two_sided[t] = t % 4 == 0;
                scene.occluder[t] = t % 9 != 0;
            }
            // Far from the origin everything keeps its relative place.
            let offset = DVec3::splat([0.0, 1e5][seed as usize % 2]);
            scene.positions.iter_mut().for_each(|p| *p += offset);
            scene.anchor();
            let at = pose(offset + DVec3::new(-half, -1.0, 0.5));
            let view = View::new(&camera, &at);
            let t = truth_of(&scene, &camera, at, &effort(2, 64, 64));
            let exact = clipping::visible(&scene, &view).unwrap();
            assert_eq!(within(&t.lo(), &exact), None, "V_lo is visible: seed {seed}, camera {c}");
            assert_eq!(within(&exact, &t.hi()), None, "what is visible is in V_hi: seed {seed}, camera {c}");
            lo_sum += t.lo().count();
            exact_sum += exact.count();
            hi_sum += t.hi().count();
            drawable += t.standings().iter().filter(|s| s.drawable()).count() as u64;
        }
    }
    assert!(lo_sum as f64 >= 0.97 * exact_sum as f64, "rays find most: {lo_sum} of {exact_sum}");
    assert!(hi_sum < drawable, "something is proved hidden: {hi_sum} of {drawable}, {exact_sum} visible");
}

#[test]
fn a_welded_wall_hides_and_one_with_open_seams_leaks() {
    // D7.4: a mesh of 7 x 7 cells before a triangle that spans many of them.
    let wall = |gap: f64| {
        let mut scene = empty();
        for i in 0..7 {
            for j in 0..7 {
                let at = |a: i32, b: i32| {
                    let shrink = |k: i32, side: i32| f64::from(k + side) - 3.5 + gap * (0.5 - f64::from(side));
                    DVec3::new(5.0, shrink(i, a), shrink(j, b))
                };
                let [p, q, r, s] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
                push(&mut scene, [q, p, s], false, true);
                push(&mut scene, [q, s, r], false, true);
            }
        }
        push(
            &mut scene,
            [DVec3::new(8.0, 2.0, -2.0), DVec3::new(8.5, -2.0, -1.9), DVec3::new(8.2, 0.1, 2.0)],
            true,
            true,
        );
        scene.anchor();
        scene
    };
    let behind = 98;
    for (gap, hidden) in [(0.0, true), (1e-6, false)] {
        let scene = wall(gap);
        let view = View::new(&Camera::default(), &ahead());
        for cells in [8, 64, 256] {
            let t = truth_of(&scene, &Camera::default(), ahead(), &effort(1, 0, cells));
            assert_eq!(!t.hi().contains(behind), hidden, "gap {gap}, {cells} cells");
        }
        // The oracle agrees: through the open seams it is visible.
        assert_eq!(!clipping::visible(&scene, &view).unwrap().contains(behind), hidden, "gap {gap}");
    }
}

#[test]
fn what_the_near_plane_cuts_away_proves_nothing_hidden() {
    // A floor that rises through the near plane up to the eye, and walls beyond it.
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    for camera in cameras() {
        let mut scene = empty();
        push(&mut scene, [p(0.05, 0.0, 0.02), p(9.0, -60.0, -20.0), p(9.0, 60.0, -20.0)], true, true);
        push(&mut scene, [p(0.5, -9.0, -9.0), p(0.5, 9.0, -9.0), p(camera.near_m * 1.5, 0.0, 9.0)], true, true);
        (0..9).for_each(|i| wall(&mut scene, 2.5 + 0.6 * f64::from(i), 0.3 * f64::from(i + 1), true, true));
        let view = View::new(&camera, &ahead());
        let exact = clipping::visible(&scene, &view).unwrap();
        for cells in [1, 4, 32] {
            let t = truth_of(&scene, &camera, ahead(), &effort(1, 32, cells));
            assert_eq!(within(&exact, &t.hi()), None, "{cells} cells");
            assert_eq!(within(&t.lo(), &exact), None);
        }
    }
}

#[test]
fn finer_cells_never_prove_less() {
    // D7.2
    let scene = boxes();
    let counts = [1, 4, 16, 64, 256].map(|cells| {
        let t = truth_of(&scene, &Camera::default(), ahead(), &effort(1, 0, cells));
        t.hi().count()
    });
    assert!(counts.windows(2).all(|w| w[1] <= w[0]) && counts[4] < counts[0], "{counts:?}");
}

#[test]
fn a_ray_finds_what_shows_between_the_samples_and_its_loss_is_charged() {
    // A slit of an eighth of a pixel between two walls, and a wall behind.
    let mut scene = empty();
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    for (y0, y1) in [(-9.0, 0.1), (0.12, 9.0)] {
        push(&mut scene, [p(4.0, y1, -9.0), p(4.0, y0, -9.0), p(4.0, y0, 9.0)], false, true);
        push(&mut scene, [p(4.0, y1, -9.0), p(4.0, y0, 9.0), p(4.0, y1, 9.0)], false, true);
    }
    wall(&mut scene, 8.0, 3.0, false, true);
    scene.anchor();
    let view = View::new(&Camera::default(), &ahead());
    let blind = truth_of(&scene, &Camera::default(), ahead(), &effort(1, 0, 64));
    assert_eq!((blind.lo().count(), blind.hi().count()), (4, 6), "no sample sees the wall behind");
    let t = truth_of(&scene, &Camera::default(), ahead(), &effort(1, 512, 64));
    let found: Vec<u32> = t.bracket.witnesses.iter().map(|w| w.triangle).collect();
    assert!(!found.is_empty() && found.iter().all(|t| *t >= 4), "{found:?}");
    let exact = clipping::visible(&scene, &view).unwrap();
    assert_eq!(within(&t.lo(), &exact), None);
    let mut submitted = cullmark::oracle::Submitted { triangles: BitSet::full(6), lost_pieces: vec![] };
    submitted.triangles.remove(found[0]);
    let removes = cullmark::culling::Removes { outside_frustum: true, back_facing: true, occluded: true };
    let errors = cullmark::oracle::judge_frame(&scene, &view, &t, &submitted, removes);
    assert_eq!((errors.false_culls, errors.false_culls_by_ray, errors.false_cull_pixels), (1, 1, 0));
    assert_eq!((errors.visible, errors.lost_ids), (4 + found.len() as u64, vec![found[0]]));
    assert_eq!(errors.samples, 48 * 27);
}

/// Checks V_lo within V_hi where neither knows of the other: rays aim at everything.
fn rays_never_contradict_proofs(name: &str, scene: &Scene, poses: &[Pose]) -> [u64; 4] {
    let mut sums = [0; 4];
    for (frame, pose) in poses.iter().enumerate() {
        let with = |rays, cells| truth_of(scene, &Camera::default(), *pose, &effort(1, rays, cells));
        let (lo, hi) = (with(2, 0), with(0, 32));
        assert_eq!(within(&lo.lo(), &hi.hi()), None, "{name}, frame {frame}");
        // Nor do samples that the proof did not know of.
        let dense = truth_of(scene, &Camera::default(), *pose, &effort(4, 0, 0));
        assert_eq!(within(&dense.lo(), &hi.hi()), None, "{name}, frame {frame}");
        // Together they say the same as apart.
        let both = with(2, 32);
        assert_eq!((both.lo(), both.hi()), (lo.lo(), hi.hi()), "{name}, frame {frame}");
        let drawable = lo.hi().count();
        for (sum, n) in sums.iter_mut().zip([lo.visible.len() as u64, lo.lo().count(), hi.hi().count(), drawable]) {
            *sum += n;
        }
    }
    println!(
        "{name}: samples see {}, with rays {}, not proved hidden {}, exact set {}",
        sums[0], sums[1], sums[2], sums[3]
    );
    sums
}

fn along(scene: &Scene, count: usize) -> Vec<Pose> {
    let walk = walkthrough::generate::make(&Spec::parse("walk:frames=300").unwrap()).unwrap().0;
    let poses = walk.walk(scene).unwrap();
    (0..count).map(|i| poses[i * (poses.len() - 1) / count.max(1)]).collect()
}

#[test]
fn rays_never_contradict_proofs_of_hiding_on_generated_scenes() {
    for spec in ["rooms", "blocks", "arena:map=nucleus"] {
        let scene = generated(spec);
        let [samples, lo, hi, drawable] = rays_never_contradict_proofs(spec, &scene, &along(&scene, 2));
        assert!(samples <= lo && lo <= hi && hi < drawable, "{spec}: {samples} {lo} {hi} {drawable}");
    }
}

#[test]
fn rays_never_contradict_proofs_of_hiding_on_a_real_scene() {
    let Some(obj) = shared("q3_czest3ctf/q3_czest3ctf.obj") else { return };
    let spec =
        load::describe("q3_czest3ctf", SceneSource::File(obj), Winding::Ccw, Some(Up::Z), 0.0254, false).unwrap();
    let scene = load::load(&spec).unwrap();
    let source = PathSource::File(shared("q3_czest3ctf/q3_czest3ctf_path1.csv").unwrap());
    let path = PathSpec { name: "path1".into(), source, frames: None, stride: 1, fingerprint: String::new() };
    let poses = walkthrough::load(&path, &spec, &scene).unwrap();
    let some = [poses[0], poses[poses.len() / 2]];
    let [_, lo, hi, drawable] = rays_never_contradict_proofs("q3_czest3ctf", &scene, &some);
    assert!(lo <= hi && hi < drawable);
}

#[test]
fn the_bracket_is_the_same_at_any_number_of_threads() {
    // D7.5
    let scene = generated("rooms");
    let poses: Vec<(u32, Pose)> = (0u32..).zip(along(&scene, 2)).collect();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| truth(&scene, &Camera::default(), &poses, &effort(1, 4, 32)))
    };
    let frames = |t: cullmark::oracle::Truth| t.frames;
    let one: Vec<FrameTruth> = frames(run(1));
    assert_eq!(one, frames(run(3)));
    assert!(one.iter().all(|f| f.lo().count() <= f.hi().count()));
}
