//! Tests: generated scenes and walks.

mod stress;

use cullmark::math::{DVec3, Pose};
use cullmark::registry::Spec;
use cullmark::scene::walkthrough::generate::{crosses, first_crossing};
use cullmark::scene::{Scene, generate, walkthrough};

fn made(spec: &str) -> Scene {
    generate::make(&Spec::parse(spec).unwrap()).unwrap().0.generate()
}

fn walked(spec: &str, scene: &Scene) -> Vec<Pose> {
    walkthrough::generate::make(&Spec::parse(spec).unwrap()).unwrap().0.walk(scene).unwrap()
}

/// A seeded sequence in [0, 1), good enough to aim rays with.
fn units(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The nearest triangle along a ray, and whether its front is seen: Moeller & Trumbore 1997, without acceleration.
fn first_hit(scene: &Scene, from: DVec3, d: DVec3) -> Option<(u32, bool)> {
    let mut best: Option<(f64, u32, bool)> = None;
    for t in 0..scene.len() as u32 {
        let [a, b, c] = scene.corners(t);
        let (e1, e2) = (b - a, c - a);
        let p = d.cross(e2);
        let det = e1.dot(p);
        if det.abs() < 1e-14 {
            continue;
        }
        let s = from - a;
        let u = s.dot(p) / det;
        let q = s.cross(e1);
        let v = d.dot(q) / det;
        let distance = e2.dot(q) / det;
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 1e-9 && best.is_none_or(|b| distance < b.0) {
            best = Some((distance, t, det > 0.0 || scene.two_sided[t as usize]));
        }
    }
    best.map(|(_, t, front)| (t, front))
}

#[test]
fn the_published_triangle_counts_are_hit_exactly() {
    let published = [
        ("rooms:world=1", 6_199),
        ("rooms:world=2", 102_232),
        ("rooms:world=3", 102_232),
        ("rooms:world=4", 30_199),
        ("blocks:world=5", 2_548),
        ("blocks:world=6", 10_040),
        ("blocks:world=5,distribution=clustered", 2_548),
        ("blocks:world=6,distribution=clustered", 10_040),
        ("arena:map=nucleus", 19_963),
        ("arena:map=coal_town", 25_894),
        ("arena:map=ravine", 33_422),
        ("arena:map=viaduct", 56_600),
        ("arena:map=gorge", 55_514),
        ("arena:map=saw", 60_532),
        ("arena:map=gold_rush", 131_598),
    ];
    for (spec, count) in published {
        assert_eq!(made(spec).len(), count, "{spec}");
    }
}

/// Shares of a scene's triangles in the cells of an n x m plan.
fn plan_shares(scene: &Scene, n: usize, m: usize) -> Vec<f64> {
    let bounds = scene.bounds();
    let mut shares = vec![0.0; n * m];
    for t in 0..scene.len() as u32 {
        let [a, b, c] = scene.corners(t);
        let at = ((a + b + c) / 3.0 - bounds.lo) / bounds.size();
        let cell = |x: f64, count: usize| ((x * count as f64) as usize).min(count - 1);
        shares[cell(at.y, m) * n + cell(at.x, n)] += 1.0 / scene.len() as f64;
    }
    shares
}

#[test]
fn clustered_objects_crowd_where_uniform_ones_are_everywhere() {
    let largest = |shares: &[f64], count: usize| {
        let mut sorted = shares.to_vec();
        sorted.sort_by(|a, b| b.total_cmp(a));
        sorted[..count].iter().sum::<f64>()
    };
    for (uniform, clustered, n, m, crowded) in [
        ("blocks:triangles=60000", "blocks:triangles=60000,distribution=clustered", 3, 3, 2),
        ("rooms:world=2", "rooms:world=3", 10, 4, 12),
    ] {
        let [even, uneven] = [uniform, clustered].map(|spec| largest(&plan_shares(&made(spec), n, m), crowded));
        assert!(even < 0.5 && uneven > 0.65, "{uniform}: {even:.2}, {clustered}: {uneven:.2}");
    }
}

#[test]
fn any_count_from_the_least_allowed_is_hit_exactly() {
    for spec in ["rooms:triangles=5500", "rooms:triangles=7001", "blocks:triangles=2400", "blocks:triangles=40001"] {
        let want: usize = spec.rsplit('=').next().unwrap().parse().unwrap();
        assert_eq!(made(spec).len(), want, "{spec}");
    }
    let least = [
        ("nucleus", 14_000),
        ("coal_town", 16_000),
        ("ravine", 16_000),
        ("viaduct", 24_000),
        ("gorge", 16_000),
        ("saw", 20_000),
        ("gold_rush", 56_000),
    ];
    for (map, count) in least {
        for seed in 3..6 {
            assert_eq!(made(&format!("arena:map={map},triangles={count},seed={seed}")).len(), count, "{map}");
        }
    }
}

#[test]
fn a_count_too_small_for_the_walls_is_refused_with_the_least_one() {
    for (spec, least) in
        [("rooms:triangles=100", "5500"), ("blocks:triangles=1", "2400"), ("arena:triangles=9000", "14000")]
    {
        let e = generate::make(&Spec::parse(spec).unwrap()).map(|_| ()).unwrap_err();
        assert!(e.to_string().contains(least) && e.key.as_deref() == Some("triangles"), "{e}");
    }
    let e = generate::make(&Spec::parse("arena:map=nucleos").unwrap()).map(|_| ()).unwrap_err();
    assert_eq!(e.help.as_deref(), Some("did you mean \"nucleus\"?"));
}

/// If this fails, the generator makes something else than before: raise its
/// `revision` (scenes are cached by it), then put the new hashes here.
#[test]
fn generated_scenes_are_the_same_bytes_as_ever() {
    let pinned = [
        ("rooms", "e76a09b719412627"),
        ("blocks", "2c30f2e68407bc2a"),
        ("arena:map=nucleus", "9b662c64a19d362f"),
        ("arena:map=gold_rush", "e9af5f71c739b8ea"),
    ];
    let found: Vec<(&str, String)> =
        pinned.iter().map(|(spec, _)| (*spec, made(spec).content_hash()[..16].to_string())).collect();
    let want: Vec<(&str, String)> = pinned.iter().map(|(spec, hash)| (*spec, hash.to_string())).collect();
    assert_eq!(found, want, "raise the generator's `revision` and pin the new hashes");
}

#[test]
fn a_seed_decides_everything_and_another_seed_something_else() {
    for spec in ["rooms", "blocks", "arena"] {
        let hash = |seed: u32| made(&format!("{spec}:seed={seed}")).content_hash();
        assert_eq!(hash(7), hash(7), "{spec}");
        assert_ne!(hash(7), hash(8), "{spec}");
    }
}

#[test]
fn no_triangle_is_degenerate_and_ids_are_in_order() {
    for spec in ["rooms:world=4", "blocks:world=6", "arena:map=ravine", "arena:map=viaduct"] {
        let scene = made(spec);
        for t in 0..scene.len() as u32 {
            assert!(scene.normal(t).length() > 1e-9, "{spec}: triangle {t} is {:?}", scene.corners(t));
            let exact = scene.corners(t).iter().all(|p| (*p * 4096.0).fract() == DVec3::ZERO);
            assert!(exact, "{spec}: triangle {t} is off the grid of 2^-12 m");
        }
        assert!(scene.source_triangle_id.iter().enumerate().all(|(i, s)| i as u32 == *s), "{spec}");
        assert!(scene.material_names.len() >= 5, "{spec} has several materials");
        assert!(*scene.object_id.last().unwrap() > 50, "{spec} has many objects");
        let sorted = scene.object_id.windows(2).all(|w| w[0] <= w[1] && w[1] - w[0] <= 1);
        assert!(sorted, "{spec}: objects follow each other");
    }
}

#[test]
fn rays_from_free_space_meet_front_faces() {
    for spec in ["rooms:world=1", "blocks:world=5", "arena:map=nucleus", "arena:map=ravine"] {
        let scene = made(spec);
        let bounds = scene.bounds();
        let mut unit = units(5);
        // Free space: where a walk goes, and above everything.
        let mut eyes: Vec<DVec3> = walked("walk:frames=60,speed_m=4", &scene).iter().map(|p| p.eye).collect();
        for _ in 0..20 {
            let share = DVec3::new(unit(), unit(), 1.0);
            eyes.push(bounds.lo + bounds.size() * share + DVec3::Z);
        }
        let (mut hits, mut fronts) = (0u32, 0u32);
        for eye in eyes {
            for _ in 0..8 {
                let d = DVec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5).normalize();
                if let Some((_, front)) = first_hit(&scene, eye, d) {
                    hits += 1;
                    fronts += u32::from(front);
                }
            }
        }
        assert!(hits > 200, "{spec}: only {hits} rays hit anything");
        assert!(f64::from(fronts) > 0.985 * f64::from(hits), "{spec}: {fronts} fronts of {hits} hits");
    }
}

#[test]
fn a_walk_has_its_frames_keeps_clear_and_turns_gently() {
    for (spec, seed) in [("rooms:world=1", 1), ("rooms:world=1", 2), ("arena:map=nucleus", 1)] {
        let scene = made(spec);
        let poses = walked(&format!("walk:frames=400,seed={seed}"), &scene);
        assert_eq!(poses.len(), 400);
        for (i, pair) in poses.windows(2).enumerate() {
            let step = pair[0].eye.distance(pair[1].eye);
            assert!(step < 0.3 + 1e-9, "step {i} is {step} m");
            let turn = pair[0].forward.dot(pair[1].forward).clamp(-1.0, 1.0).acos().to_degrees();
            assert!(turn < 4.0 + 1e-6, "the view turns {turn} degrees after frame {i}");
            // The naive twin of the walker's own proof: every triangle, no grid.
            let near = (0..scene.len() as u32).find(|t| {
                let b = scene.triangle_aabb(*t);
                let (lo, hi) = (pair[0].eye.min(pair[1].eye), pair[0].eye.max(pair[1].eye));
                b.lo.cmple(hi).all() && lo.cmple(b.hi).all() && crosses(pair[0].eye, pair[1].eye, scene.corners(*t))
            });
            assert_eq!(near, None, "the step after frame {i} crosses a triangle");
        }
        for pose in &poses {
            assert!((pose.forward.length() - 1.0).abs() < 1e-12 && (pose.up.length() - 1.0).abs() < 1e-12);
            assert!(pose.forward.dot(pose.up).abs() < 1e-12 && pose.forward.z.abs() < 0.35, "level-ish");
        }
        let moved = poses.windows(2).filter(|p| p[0].eye != p[1].eye).count();
        assert!(moved > 390, "the walker stands still in {} of 400 frames", 399 - moved);
        for pose in poses.iter().step_by(10) {
            let d = (0..scene.len() as u32).map(|t| distance(pose.eye, scene.corners(t))).fold(f64::INFINITY, f64::min);
            assert!(d >= 0.25, "{d} m from a triangle at {}", pose.eye);
        }
    }
}

/// Distance of a point to a triangle, by sampling none: plane projection or edges.
fn distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let n = (b - a).cross(c - a).normalize();
    let foot = p - n * n.dot(p - a);
    let inside = [(a, b), (b, c), (c, a)].iter().all(|(u, v)| (*v - *u).cross(foot - *u).dot(n) >= 0.0);
    let to_edge = |u: DVec3, v: DVec3| {
        let t = ((p - u).dot(v - u) / (v - u).length_squared()).clamp(0.0, 1.0);
        p.distance(u + (v - u) * t)
    };
    if inside { p.distance(foot) } else { to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a)) }
}

#[test]
fn a_walk_is_decided_by_its_seed_and_sees_both_floors() {
    let scene = made("rooms:world=1");
    let poses = walked("walk:frames=2000", &scene);
    assert_eq!(poses, walked("walk:frames=2000", &scene));
    assert_ne!(poses, walked("walk:frames=2000,seed=2", &scene));
    let high = poses.iter().filter(|p| p.eye.z > 3.4).count();
    assert!(high > 100 && high < 1900, "{high} of 2000 frames are upstairs");
}

#[test]
fn walks_fly_round_a_statuette_and_refuse_an_empty_scene() {
    // A pyramid of 20 cm, with no floor beside it.
    let corners = [(-0.1, -0.1, 0.0), (0.1, -0.1, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.2)];
    let scene = Scene {
        positions: corners.map(DVec3::from).to_vec(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        source_triangle_id: vec![0, 1, 2, 3],
        two_sided: vec![false; 4],
        ..Default::default()
    };
    let poses = walked("walk:frames=100", &scene);
    assert_eq!(poses.len(), 100);
    assert_eq!(first_crossing(&scene, &poses), None);
    let e = walkthrough::generate::make(&Spec::new("walk")).unwrap().0.walk(&Scene::default()).unwrap_err();
    assert!(e.help.is_some(), "{e}");
}

#[test]
fn orbits_stay_outside_and_look_at_the_middle() {
    let scene = made("blocks");
    let (bounds, poses) = (scene.bounds(), walked("orbit:frames=36", &scene));
    assert_eq!(poses.len(), 36);
    for p in &poses {
        assert!(!bounds.contains(p.eye));
        assert!((bounds.centre() - p.eye).normalize().dot(p.forward) > 1.0 - 1e-9);
    }
    assert_eq!(walked("static:frames=3,x_m=1,yaw_deg=90", &scene)[2].eye.x, 1.0);
}

#[test]
fn exact_crossing_counts_touching_and_misses_near_misses() {
    let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let at = |x: f64, y: f64| (DVec3::new(x, y, -1.0), DVec3::new(x, y, 1.0));
    let crosses_at = |x: f64, y: f64| crosses(at(x, y).0, at(x, y).1, t);
    assert!(crosses_at(0.25, 0.25) && crosses_at(0.0, 0.0) && crosses_at(0.5, 0.5));
    assert!(!crosses_at(-1e-300, 0.5) && !crosses_at(0.5, 0.5 + f64::EPSILON));
    assert!(!crosses(DVec3::new(0.2, 0.2, 1e-300), DVec3::new(0.2, 0.2, 1.0), t), "it ends above");
    assert!(crosses(DVec3::new(0.2, 0.2, 0.0), DVec3::new(0.2, 0.2, 1.0), t), "it ends on the triangle");
}

#[test]
fn a_preview_shows_front_faces_and_hides_what_it_is_told_to() {
    use cullmark::preview::{Look, Style, overview, render};
    let scene = made("blocks");
    let view = overview(&scene.bounds(), 0.7, 0.6, 1.5);
    let plain = render(&scene, &view, 60, 40, &Style { shadows: false, ..Style::default() });
    assert_eq!(plain.rgba.len(), 60 * 40 * 4);
    let gone = |_: u32| Look::Hidden;
    let sky = render(&scene, &view, 60, 40, &Style { look: Some(&gone), ..Style::default() });
    let changed = plain.rgba.chunks(4).zip(sky.rgba.chunks(4)).filter(|(a, b)| a != b).count();
    assert!(changed > 600, "the scene covers {changed} of 2400 pixels");
    let lost = |_: u32| Look::Tint([255, 0, 0]);
    let red =
        render(&scene, &view, 60, 40, &Style { look: Some(&lost), shadows: false, samples: 1, ..Style::default() });
    let reds = red.rgba.chunks(4).filter(|p| p[0] > 80 && p[1] == 0 && p[2] == 0).count();
    assert!(reds > 600, "{reds} pixels are tinted");
}
