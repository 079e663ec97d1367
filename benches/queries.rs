//! Walks with occlusion queries: `cargo bench --no-default-features --bench queries [-- SCENE ...]`.
//!
//! A SCENE is a generator (`rooms`, `blocks:triangles=60000`) or the name of a shared scene
//! (`sponza`), whose first path is taken, every so many frames of it. For each structure
//! and walk: thread CPU time of culling a frame, queries, entries, draw calls, modelled
//! frame time (culling + 0.32 ns an index + 430 ns a call), and the virtual time of a frame
//! when answers come at once or 0, 10, 100 and 1000 us late.

use cullmark::culling::{DrawList, Tally, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, Pose};
use cullmark::record::{PathSource, PathSpec, SceneSource, TimeModel, Up, Winding};
use cullmark::registry::{Spec, parse_sum};
use cullmark::runner::Setup;
use cullmark::scene::{Scene, generate, load, walkthrough};
use cullmark::structure::{self, Structure};
use std::path::PathBuf;

const FRAMES: usize = 120;
const STRUCTURES: [&str; 3] = ["octree:depth=5", "nested_grid", "bvh"];
const WALKS: [&str; 4] = ["depth_first", "nested_query", "chc", "chc_pp"];
const SIZES: [&str; 4] = [
    "width_px=1920,height_px=1080",
    "width_px=960,height_px=540",
    "width_px=480,height_px=270",
    "width_px=240,height_px=135",
];

struct Ready(Hierarchy);

impl Structure for Ready {
    fn build(&self, _: &Scene) -> cullmark::Result<Hierarchy> {
        Ok(self.0.clone())
    }
}

#[derive(Debug, Default)]
struct Frame {
    cull_us: f64,
    entries: f64,
    calls: f64,
    tally: Tally,
}

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let asked = if asked.is_empty() { vec!["rooms".to_string(), "blocks".to_string()] } else { asked };
    for name in &asked {
        let (scene, poses) = scene(name);
        println!("\n{name}: {} triangles, {} frames", scene.len(), poses.len());
        for structure in STRUCTURES {
            let h = structure::make(&Spec::parse(structure).unwrap()).unwrap().0.build(&scene).unwrap();
            println!(
                "{structure}\n  {:24} {:>9} {:>8} {:>9} {:>7} {:>9} | virtual us: at once, after 0, 10, 100, 1000 us",
                "", "cull us", "queries", "entries", "calls", "model us"
            );
            for walk in WALKS {
                let at_once = run(&scene, &h, &poses, walk, true);
                let late = |us: u32| {
                    let frame = run(&scene, &h, &poses, &format!("{walk}:backend=latency,latency_us={us}"), false);
                    frame.tally.virtual_ns as f64 / 1e3 / poses.len() as f64
                };
                let late = if walk == "depth_first" { vec![] } else { [0, 10, 100, 1000].map(late).to_vec() };
                line(walk, &at_once, poses.len(), &late);
            }
            for (walk, size) in ["nested_query", "chc", "chc_pp"].iter().flat_map(|w| SIZES.map(|s| (w, s))) {
                let walk = format!("{walk}:{size}");
                line(&walk, &run(&scene, &h, &poses, &walk, true), poses.len(), &[]);
            }
            for more in [
                "chc:occluder_px=2",
                "chc:occluder_px=10",
                "chc_pp:occluder_px=10",
                "chc_pp:batch=0",
                "chc_pp:d_max=0",
                "chc_pp:multiqueries=false",
                "chc:auto=true",
                "chc_pp:sorted=true",
            ] {
                line(more, &run(&scene, &h, &poses, more, true), poses.len(), &[]);
            }
        }
    }
}

fn line(walk: &str, f: &Frame, frames: usize, late: &[f64]) {
    let each = |n: f64| n / frames as f64;
    let model = TimeModel::default().render_ns(each(f.entries), each(f.calls)) / 1e3 + f.cull_us;
    let late = late.iter().map(|us| format!(" {us:.0}")).collect::<String>();
    let name = walk.replace("width_px=", "").replace(",height_px=", "x");
    println!(
        "  {name:24} {:9.1} {:8.1} {:9.0} {:7.1} {model:9.1} | {:.0}{late}",
        f.cull_us,
        each(f.tally.queries as f64),
        each(f.entries),
        each(f.calls),
        each(f.tally.virtual_ns as f64 / 1e3),
    );
}

fn run(scene: &Scene, h: &Hierarchy, poses: &[Pose], walk: &str, timed: bool) -> Frame {
    let tests = make_tests(&parse_sum("frustum").unwrap()).unwrap().0;
    let walk = make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
    let mut setup =
        Setup::from_parts(scene.clone(), poses.to_vec(), &Camera::default(), &Ready(h.clone()), tests, walk).unwrap();
    let mut frame = Frame::default();
    let mut out = DrawList::default();
    let mut best = f64::INFINITY;
    for turn in 0..if timed { 3 } else { 1 } {
        setup.reset();
        let start = cpu_ns();
        let mut tallies = vec![Tally::default(); poses.len()];
        for (n, tally) in tallies.iter_mut().enumerate() {
            setup.cull(n, &mut out, tally);
            if turn == 0 {
                frame.entries += out.entry_count() as f64;
                frame.calls += out.draw_calls(h) as f64;
            }
        }
        frame.tally = tallies.into_iter().sum();
        // The first turn counts, too.
        best = if turn == 0 { best } else { best.min(cpu_ns() - start) };
    }
    Frame { cull_us: best / 1e3 / poses.len() as f64, ..frame }
}

fn scene(name: &str) -> (Scene, Vec<Pose>) {
    let folder = std::env::var_os("CULLMARK_SCENES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes"), PathBuf::from)
        .join(name);
    if !folder.is_dir() {
        let scene = generate::make(&Spec::parse(name).unwrap()).unwrap().0.generate();
        let path = Spec::parse(&format!("walk:frames={FRAMES},speed_m=0.25")).unwrap();
        let poses = walkthrough::generate::make(&path).unwrap().0.walk(&scene).unwrap();
        return (scene, poses);
    }
    let mesh = ["glb", "obj"].map(|e| folder.join(format!("{name}.{e}"))).into_iter().find(|p| p.exists()).unwrap();
    // As the manifest of the shared scenes says.
    let up = if name.starts_with("q3") || name.starts_with("aws") { Up::Z } else { Up::Y };
    let spec = load::describe(name, SceneSource::File(mesh), Winding::TwoSided, Some(up), 1.0, true).unwrap();
    let scene = load::load(&spec).unwrap();
    let source = PathSource::File(folder.join(format!("{name}_path1.csv")));
    let path =
        PathSpec { name: name.into(), source, frames: Some(FRAMES as u32), stride: 1, fingerprint: String::new() };
    let poses = walkthrough::load(&path, &spec, &scene).unwrap();
    (scene, poses)
}

/// Time that this thread computed, which leaves out what others took of the core.
fn cpu_ns() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the clock exists and the pointer is to a timespec of our own.
    let rc = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
    assert_eq!(rc, 0);
    t.tv_sec as f64 * 1e9 + t.tv_nsec as f64
}
