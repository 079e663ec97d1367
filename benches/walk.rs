//! Culling whole frames on a large map: an octree walked, a list scanned, every
//! triangle tested: `cargo bench --no-default-features --bench walk [-- SCENE.glb|.obj [UP]]`.
//!
//! Without a scene it takes the largest one of the shared scenes, where the
//! machine has them, else a generated map. Cameras stand at seeded places and
//! heights inside the bounds and look at seeded directions near the horizon. The
//! methods take turns; medians over turns, then means over frames.

use cullmark::culling::{DrawList, Tally, Test, Walk, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Aabb, Camera, DVec3, Pose, View};
use cullmark::record::{SceneSource, Up, Winding};
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::{Scene, load};
use cullmark::structure;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

const TURNS: usize = 15;
const FRAMES: usize = 64;

const METHODS: &[(&str, &str, &str)] = &[
    ("list", "frustum", "flat"),
    ("list:leaf_size=16", "frustum", "flat"),
    ("octree:depth=4", "frustum", "depth_first"),
    ("octree:depth=5", "frustum", "depth_first"),
    ("octree:depth=6", "frustum", "depth_first"),
    ("octree:depth=6", "frustum:last_plane=true", "depth_first"),
    ("octree:depth=6", "frustum:plane_mask=false", "depth_first"),
    ("octree:depth=6", "frustum", "flat"),
    ("octree:depth=6", "frustum+normal_mask", "depth_first"),
    ("octree:depth=6", "none", "depth_first"),
];

struct Method {
    hierarchy: Hierarchy,
    tests: Vec<Box<dyn Test>>,
    walk: Box<dyn Walk>,
}

fn main() {
    let scene = scene();
    let views = views(&scene);
    println!("{}: {} triangles, {FRAMES} frames, median of {TURNS} turns", scene.name, scene.len());
    let mut methods: Vec<Method> = METHODS.iter().map(|m| method(&scene, m)).collect();
    let boxes: Vec<Aabb> = (0..scene.len() as u32).map(|t| scene.triangle_aabb(t)).collect();
    let mut visible = vec![false; boxes.len()];
    let mut ns = vec![vec![vec![0.0; TURNS]; FRAMES]; methods.len() + 1];
    let mut sums = vec![(Tally::default(), 0u64, 0usize); methods.len()];
    let mut out = DrawList::default();
    for turn in 0..TURNS {
        // A method runs a whole path, as in a trial: its own data are in the caches.
        for (i, m) in methods.iter_mut().enumerate() {
            m.tests.iter_mut().for_each(|t| t.reset());
            let (tally, entries, ranges) = &mut sums[i];
            for (frame, view) in views.iter().enumerate() {
                let start = Instant::now();
                out.clear();
                m.tests.iter_mut().for_each(|t| t.begin(view, &m.hierarchy));
                m.walk.run(view, &m.hierarchy, &mut m.tests, &mut out, tally);
                ns[i][frame][turn] = start.elapsed().as_nanos() as f64;
                *entries += out.entry_count();
                *ranges += out.ranges.len();
            }
        }
        // Brute force is slow and steady: a fifth of the turns will do.
        if turn % 5 == 0 {
            for (frame, view) in views.iter().enumerate() {
                let start = Instant::now();
                brute_force(view, &boxes, black_box(&mut visible));
                let times = &mut ns[METHODS.len()][frame];
                times[turn..(turn + 5).min(TURNS)].fill(start.elapsed().as_nanos() as f64);
            }
        }
    }
    println!("{:<58} {:>10} {:>9} {:>9} {:>8} {:>10}", "", "us a frame", "nodes", "planes", "ranges", "triangles");
    let mean_us = |frames: &[Vec<f64>]| frames.iter().map(|f| median(f.clone())).sum::<f64>() / FRAMES as f64 / 1e3;
    let runs = (TURNS * FRAMES) as f64;
    for ((name, ns), (tally, entries, ranges)) in METHODS.iter().zip(&ns).zip(&sums) {
        let label = format!("{} x {} x {}", name.0, name.1, name.2);
        let per = |x: u64| x as f64 / runs;
        println!(
            "{label:<58} {:>10.2} {:>9.0} {:>9.0} {:>8.0} {:>10.0}",
            mean_us(ns),
            per(tally.nodes_visited),
            per(tally.plane_tests),
            per(*ranges as u64),
            per(*entries)
        );
    }
    let kept: usize = views
        .iter()
        .map(|v| {
            brute_force(v, &boxes, &mut visible);
            visible.iter().filter(|v| **v).count()
        })
        .sum();
    let (label, us) = ("brute force, every triangle in f64", mean_us(&ns[METHODS.len()]));
    println!("{label:<58} {us:>10.2} {:>9} {:>9} {:>8} {:>10}", "", "", "", kept / FRAMES);
}

fn method(scene: &Scene, (structure, culling, walk): &(&str, &str, &str)) -> Method {
    let build = || -> cullmark::Result<Method> {
        let hierarchy = structure::make(&Spec::parse(structure)?)?.0.build(scene)?;
        let mut tests = make_tests(&parse_sum(culling)?)?.0;
        tests.iter_mut().for_each(|t| {
            t.prepare(scene, &hierarchy);
        });
        Ok(Method { hierarchy, tests, walk: make_walk(&Spec::parse(walk)?)?.0 })
    };
    build().unwrap_or_else(|e| panic!("{structure} x {culling} x {walk}: {e}"))
}

fn scene() -> Scene {
    // Cargo hands its own `--bench` on.
    let mut args = std::env::args().skip(1).filter(|a| !a.starts_with("--"));
    let shared = std::env::var_os("CULLMARK_SCENES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes"), PathBuf::from)
        .join("city_1m/city_1m.glb");
    let file = args.next().map(PathBuf::from).or_else(|| shared.exists().then_some(shared));
    let up = match args.next().as_deref() {
        Some("y") => Up::Y,
        _ => Up::Z,
    };
    let (name, source) = match file {
        Some(f) => (f.file_stem().unwrap_or_default().to_string_lossy().into_owned(), SceneSource::File(f)),
        // The largest of the seven maps of Serpa & Rodrigues (2014).
        None => ("arena".into(), SceneSource::Generated(Spec::parse("arena:triangles=131598").expect("a spec"))),
    };
    let spec = load::describe(&name, source, Winding::Ccw, Some(up), 1.0, false);
    spec.and_then(|s| load::load(&s)).unwrap_or_else(|e| panic!("{e}"))
}

fn views(scene: &Scene) -> Vec<View> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let mut unit = move || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let bounds = scene.bounds();
    (0..FRAMES)
        .map(|_| {
            let inset = DVec3::new(0.1 + 0.8 * unit(), 0.1 + 0.8 * unit(), 0.05 + 0.4 * unit());
            let eye = bounds.lo + bounds.size() * inset;
            let (yaw, pitch) = (unit() * std::f64::consts::TAU, (unit() - 0.5) * 0.6);
            let forward =
                DVec3::new(libm::cos(yaw) * libm::cos(pitch), libm::sin(yaw) * libm::cos(pitch), libm::sin(pitch));
            View::new(&Camera::default(), &Pose { eye, forward, up: DVec3::Z })
        })
        .collect()
}

/// What culling by single triangles costs when written plainly.
fn brute_force(view: &View, boxes: &[Aabb], visible: &mut [bool]) {
    for (b, v) in boxes.iter().zip(visible) {
        *v = view.planes.iter().all(|p| {
            let corner = DVec3::select(p.normal.cmpge(DVec3::ZERO), b.hi, b.lo);
            p.normal.dot(corner - view.eye) + p.offset_m >= 0.0
        });
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
