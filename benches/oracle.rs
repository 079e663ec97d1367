//! What ground truth costs: `cargo bench --no-default-features --bench oracle`,
//! CPU time of the exact sets and of the item buffer, frame by frame, over the real
//! scenes where `$CULLMARK_SCENES` names them, else over generated ones.
//! After `--`: `scene=NAME frames=0,2 samples=1,2 threads=1 repeats=9`.

use cullmark::math::{Camera, Pose, View};
use cullmark::oracle::image::Grid;
use cullmark::oracle::{self, FrameTruth, item_buffer, sets};
use cullmark::record::{Accuracy, PathSource, PathSpec, SceneSource, Up, Winding};
use cullmark::registry::Spec;
use cullmark::scene::{Scene, generate, load, walkthrough};
use cullmark::stats::{median, quantile};
use std::path::{Path, PathBuf};
use std::time::Instant;

struct Wanted {
    scene: Option<String>,
    frames: Option<Vec<u32>>,
    samples: Vec<u32>,
    threads: usize,
    repeats: usize,
}

fn main() -> cullmark::Result<()> {
    let wanted = Wanted::from_arguments();
    rayon::ThreadPoolBuilder::new().num_threads(wanted.threads).build_global().expect("the first pool");
    println!("1920 x 1080, {} threads; ms of CPU: median [least .. most] of {}", wanted.threads, wanted.repeats);
    println!("{:<18} {:>6} {:>7}  exact sets | item buffer | whole truth | wall of it", "scene", "frame", "samples");
    let is_wanted = |name: &str| wanted.scene.as_ref().is_none_or(|s| s == name);
    if let Some(folder) = std::env::var_os("CULLMARK_SCENES").map(PathBuf::from) {
        let real = [
            ("q3_ons_reborn", "q3_ons_reborn.obj", Up::Z, 0.0254),
            ("stk_candela_city", "stk_candela_city.glb", Up::Y, 1.0),
            ("city_1m", "city_1m.glb", Up::Y, 1.0),
        ];
        for (name, file, up, scale) in real.into_iter().filter(|r| is_wanted(r.0)) {
            let (scene, poses) = read(&folder.join(name), name, file, up, scale)?;
            measure(name, &scene, &poses, &wanted);
        }
        return Ok(());
    }
    for spec in ["arena:map=gold_rush", "rooms:world=2"].into_iter().filter(|s| is_wanted(s)) {
        let scene = generate::make(&Spec::parse(spec)?)?.0.generate();
        let poses = walkthrough::generate::make(&Spec::parse("walk:frames=300")?)?.0.walk(&scene)?;
        measure(spec, &scene, &poses, &wanted);
    }
    Ok(())
}

impl Wanted {
    fn from_arguments() -> Wanted {
        let mut wanted = Wanted { scene: None, frames: None, samples: vec![1, 2], threads: 1, repeats: 9 };
        let numbers = |v: &str| v.split(',').map(|n| n.parse().expect("numbers with commas")).collect();
        for argument in std::env::args().skip(1) {
            match argument.split_once('=') {
                Some(("scene", v)) => wanted.scene = Some(v.into()),
                Some(("frames", v)) => wanted.frames = Some(numbers(v)),
                Some(("samples", v)) => wanted.samples = numbers(v),
                Some(("threads", v)) => wanted.threads = v.parse().expect("a number"),
                Some(("repeats", v)) => wanted.repeats = v.parse().expect("a number"),
                // `cargo bench` passes `--bench`.
                _ => {}
            }
        }
        wanted
    }
}

fn read(folder: &Path, name: &str, file: &str, up: Up, scale: f64) -> cullmark::Result<(Scene, Vec<Pose>)> {
    let spec = load::describe(name, SceneSource::File(folder.join(file)), Winding::Ccw, Some(up), scale, false)?;
    let scene = load::load(&spec)?;
    let source = PathSource::File(folder.join(format!("{name}_path1.csv")));
    let fingerprint = walkthrough::fingerprint(&source, &spec.fingerprint)?;
    let path = PathSpec { name: name.into(), source, frames: None, stride: 1, fingerprint };
    let poses = walkthrough::load(&path, &spec, &scene)?;
    Ok((scene, poses))
}

fn measure(name: &str, scene: &Scene, poses: &[Pose], wanted: &Wanted) {
    let evenly = Accuracy { frames: 6, ..Accuracy::default() };
    let evenly = oracle::judged_frames(poses.len() as u32, &evenly);
    let frames = wanted.frames.as_ref().unwrap_or(&evenly);
    for samples in &wanted.samples {
        let grid = Grid { width_px: 1920, height_px: 1080, samples: *samples };
        for frame in frames.iter().filter(|f| (**f as usize) < poses.len()) {
            let view = View::new(&Camera::default(), &poses[*frame as usize]);
            let mut times: [Vec<f64>; 4] = Default::default();
            for _ in 0..wanted.repeats {
                let (standings, ms, _) = timed(|| sets::standings(scene, &view).0);
                times[0].push(ms);
                times[1].push(timed(|| item_buffer::draw(scene, &view, &standings, grid)).1);
                let (_, ms, wall_ms) = timed(|| FrameTruth::of(scene, &view, *frame, grid));
                times[2].push(ms);
                times[3].push(wall_ms);
            }
            let text =
                times.map(|t| format!("{:.1} [{:.1} .. {:.1}]", median(&t), quantile(&t, 0.0), quantile(&t, 1.0)));
            println!("{name:<18} {frame:>6} {samples:>5}^2  {}", text.join(" | "));
        }
    }
}

/// What `work` made, its CPU time over all threads, and its wall time, in ms.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64, f64) {
    let (start, cpu) = (Instant::now(), cpu_ms());
    let made = std::hint::black_box(work());
    (made, cpu_ms() - cpu, start.elapsed().as_secs_f64() * 1e3)
}

fn cpu_ms() -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the pointer is to a timespec of ours.
    unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) };
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}
