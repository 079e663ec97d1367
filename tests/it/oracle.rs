//! Tests: oracle. Here the item buffer against a ray caster that shares nothing
//! with it; below, judgements, truth files, every method, and `inspect`.

mod bracket;
mod clipping;
mod extremes;
mod figures;
mod files;
#[cfg(feature = "service")]
mod inspect;
mod judgement;
mod mutations;
mod pairs;
mod pvs;
mod samples;
mod ties;

use crate::common::soup;
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::oracle::image::{ANY, BACKGROUND};
use cullmark::oracle::volume::{Meets, triangle_meets};
use cullmark::oracle::{FrameTruth, truth};
use cullmark::record::Accuracy;
use cullmark::scene::Scene;
use std::collections::HashSet;

fn accuracy(width_px: u32, height_px: u32, samples: u32) -> Accuracy {
    Accuracy { frames: 4, width_px, height_px, samples, ..Accuracy::default() }
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
fn the_item_buffer_agrees_with_rays_at_every_number_of_samples() {
    // Near planes through the soup, parallel rays, and triangles around the eye.
    for samples in [1, 2, 4] {
        for (seed, camera) in (30..).zip(cameras()) {
            let mut scene = soup(seed, 70, 5.0, 4.0);
            (0..scene.len()).for_each(|t| scene.two_sided[t] = t % 3 == 0);
            let size = [68 / samples, 36 / samples];
            let strict = agrees_with_rays(&scene, &camera, pose(DVec3::new(-1.0, 0.5, 0.0)), size, samples);
            assert!(strict > 68 * 36 * 8 / 10, "only {strict} samples in general position");
        }
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

#[test]
fn a_sample_exactly_on_shared_edges_and_corners_belongs_to_one_triangle() {
    // Every coordinate is a multiple of 1/64, so that all edge functions are exact:
    // corners, sides and diagonals of the mesh run through sample centres.
    let camera =
        Camera { projection: Projection::Orthographic { height_m: 2.0 }, aspect: 1.0, near_m: 1.0, far_m: None };
    let at = |i: u32, j: u32| {
        let centre = |k: u32| f64::from(2 * k + 1) / 64.0 - 1.0;
        DVec3::new(4.0, centre(i), centre(j))
    };
    let mut scene = empty();
    for i in (4..60).step_by(8) {
        for j in (4..60).step_by(8) {
            let [a, b, c, d] = [at(i, j), at(i + 8, j), at(i + 8, j + 8), at(i, j + 8)];
            push(&mut scene, [a, c, b], true, true);
            push(&mut scene, [a, d, c], true, true);
        }
    }
    let t = truth_of(&scene, &camera, ahead(), &accuracy(64, 64, 1));
    for (index, tile) in (0u32..).zip(&t.tiles) {
        tile.for_each(t.grid.tile(index), |run| assert_eq!(run.alternate, BACKGROUND, "covered twice: {run:?}"));
    }
    // 7 cells of 8 samples a side: of the two border lines exactly one counts.
    assert_eq!(t.covered_pixels, 56 * 56);
    let areas: Vec<u32> = t.visible.iter().map(|(_, n)| *n).collect();
    assert_eq!(areas.iter().sum::<u32>(), 56 * 56);
    assert!(areas.len() == 98 && areas.iter().all(|n| *n == 28 || *n == 36), "a diagonal goes to one side: {areas:?}");
}
