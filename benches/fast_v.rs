//! The walk by frusta: time, triangles and work against `g`, beside the truth's bounds:
//! `cargo bench --no-default-features --bench fast_v [-- SCENE [UP [PATH.csv [FRAMES]]]]`.
//!
//! SCENE is a file or a generator's spec (`rooms`, `arena:map=gold_rush`); without one, two
//! generated scenes. Frames are spread evenly over the path, or over a generated walk.
//! Medians of turns by frame, then means over frames; with one thread, unless
//! `RAYON_NUM_THREADS` says otherwise. V_lo has a sample a pixel of 1280 x 720, V_hi proofs
//! in 256 x 256 cells; for up to 5,000 triangles V* is exact instead.

use cullmark::culling::{DrawList, Tally, cull, make_tests, make_walk};
use cullmark::math::{Camera, Pose, View};
use cullmark::oracle::{clipping, truth};
use cullmark::record::{Accuracy, PathSource, PathSpec, SceneSource, Up, Winding};
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::{Scene, load, walkthrough};
use cullmark::structure;
use std::path::PathBuf;
use std::time::Instant;

const TURNS: usize = 5;

const WALKS: &[&str] = &[
    "depth_first",
    "fast_v:g=1",
    "fast_v:g=4",
    "fast_v:g=16",
    "fast_v:g=64",
    "fast_v:g=256",
    "fast_v:g=1024",
    "fast_v:g=64,depth=plane",
    "fast_v:g=64,grow=1",
    "fast_v:g=1024,subdivision=adaptive",
    "fast_v:g=1024,subdivision=adaptive,limit=16",
];

fn main() {
    if std::env::var_os("RAYON_NUM_THREADS").is_none() {
        rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("nobody asked for threads yet");
    }
    // Cargo hands its own `--bench` on.
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let up = if args.get(1).is_some_and(|a| a == "y") { Up::Y } else { Up::Z };
    let frames = args.get(3).map_or(8, |n| n.parse().expect("FRAMES is a number"));
    match args.first() {
        Some(scene) => measure(scene, up, args.get(2), frames),
        None => ["rooms", "arena:map=gold_rush"].iter().for_each(|s| measure(s, up, None, frames)),
    }
}

fn measure(what: &str, up: Up, path: Option<&String>, count: usize) {
    let file = PathBuf::from(what);
    let source = match file.exists() {
        true => SceneSource::File(file),
        false => SceneSource::Generated(Spec::parse(what).expect("a file or a spec")),
    };
    let spec = load::describe(what, source, Winding::Ccw, Some(up), 1.0, false).expect("a scene");
    let scene = load::load(&spec).expect("a scene");
    let source = match path {
        Some(file) => PathSource::File(PathBuf::from(file)),
        None => PathSource::Generated(Spec::parse("walk:frames=600,seed=7").expect("a spec")),
    };
    let path = PathSpec { name: "path".into(), source, frames: None, stride: 1, fingerprint: String::new() };
    let all = walkthrough::load(&path, &spec, &scene).expect("a path");
    let poses: Vec<Pose> = (0..count.min(all.len())).map(|i| all[i * all.len() / count.min(all.len())]).collect();
    let views: Vec<View> = poses.iter().map(|p| View::new(&Camera::default(), p)).collect();
    let threads = rayon::current_num_threads();
    println!("{what}: {} triangles, {} frames, {TURNS} turns, {threads} thread(s)", scene.len(), views.len());
    println!("{}", bounds(&scene, &poses, &views));
    let hierarchy = structure::make(&Spec::parse("octree:depth=10,leaf_limit=32").expect("a spec"))
        .and_then(|s| s.0.build(&scene))
        .expect("an octree");
    println!(
        "{:<46} {:>10} {:>10} {:>8} {:>8} {:>8} {:>9} {:>10} {:>8}",
        "", "ms", "triangles", "frusta", "tries", "blockers", "facets", "signs", "exact"
    );
    for walk in WALKS {
        let mut tests = make_tests(&parse_sum("frustum").expect("a sum")).expect("a test").0;
        let mut made = make_walk(&Spec::parse(walk).expect("a spec")).expect("a walk").0;
        tests.iter_mut().for_each(|t| {
            t.prepare(&scene, &hierarchy);
        });
        let start = Instant::now();
        let bytes = made.prepare(&scene, &hierarchy);
        let prepared_ms = start.elapsed().as_secs_f64() * 1e3;
        if *walk == "fast_v:g=1" {
            println!("prepared in {prepared_ms:.1} ms, {:.1} MB", bytes as f64 / 1e6);
        }
        let mut out = DrawList::default();
        let (mut ms, mut triangles, mut tallies) = (0.0, 0, Vec::new());
        for view in &views {
            let mut times: Vec<f64> = Vec::new();
            let mut tally = Tally::default();
            for _ in 0..TURNS {
                tally = Tally::default();
                let start = Instant::now();
                cull(view, &hierarchy, &mut tests, made.as_mut(), &mut out, &mut tally);
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
            times.sort_by(f64::total_cmp);
            ms += times[TURNS / 2];
            triangles += out.entry_count();
            tallies.push(tally);
        }
        let n = views.len() as f64;
        let sum: Tally = tallies.into_iter().sum();
        let per = |x: u64| x as f64 / n;
        println!(
            "{walk:<46} {:>10.3} {:>10.0} {:>8.0} {:>8.0} {:>8.0} {:>9.0} {:>10.0} {:>8.1}",
            ms / n,
            per(triangles),
            per(sum.frusta),
            per(sum.blocker_tries),
            per(sum.blockers),
            per(sum.facets),
            per(sum.predicates),
            per(sum.fallbacks_exact)
        );
    }
}

/// The mean size of the truth, or of what holds it.
fn bounds(scene: &Scene, poses: &[Pose], views: &[View]) -> String {
    let n = views.len() as f64;
    if scene.len() <= clipping::MOST_TRIANGLES {
        let exact: u64 = views.iter().map(|v| clipping::visible(scene, v).expect("few triangles").count()).sum();
        return format!("V*: {:.0} triangles", exact as f64 / n);
    }
    let numbered: Vec<(u32, Pose)> = (0u32..).zip(poses.iter().copied()).collect();
    let accuracy =
        Accuracy { frames: 0, width_px: 1280, height_px: 720, samples: 1, witness_rays: 0, hiding_cells: 256 };
    let truth = truth(scene, &Camera::default(), &numbered, &accuracy);
    let (lo, hi) = truth.frames.iter().fold((0, 0), |(a, b), f| (a + f.lo().count(), b + f.hi().count()));
    format!("V_lo: {:.0}, V_hi: {:.0} triangles", lo as f64 / n, hi as f64 / n)
}
