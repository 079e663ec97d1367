//! The sweep for false culls: every walk that leaves out what is hidden, before the truth,
//! over every generated and shared scene and path, at several thread counts.
//! `cargo bench --no-default-features --bench frames [-- KEY=VALUE ...]`; the shared scenes
//! from `$CULLMARK_SCENES`, else from beside the checkout.
//!
//! Keys: `frames=12` judged of a path, in runs of `burst=4` consecutive ones, spread
//! evenly (walks that remember see both steps and leaps); `size=960x540`, one sample a
//! pixel; `rays=2` at every triangle that no sample sees; `threads=1,2,3`; `scene=` and
//! `walk=` take what contains the text; `structures=bvh;octree:depth=5`.
//!
//! A method is judged for what it declares ([`cullmark::oracle::verdict`]): conservative,
//! and it may lose nothing that a sample or a ray witnesses; sample-conservative, and it
//! may lose nothing that its own samples see. What it submits must be the same at every
//! thread count. A judged frame is one frame of one method, whatever the thread counts.
//! Exit code 1 if anything is lost that was promised, or differs. The line of the walk
//! `depth_first` shows what the frustum alone submits, and is not in the sum. `spoil=1` takes
//! the triangle that most samples see out of every list, to show that the sweep notices.

#[path = "frames/methods.rs"]
mod methods;
#[path = "frames/scenes.rs"]
mod scenes;

use cullmark::culling::{self, Class, DrawList, Removes, Tally, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, Pose, View};
use cullmark::oracle::image::Grid;
use cullmark::oracle::{self, Effort, FrameTruth};
use cullmark::record::{Accuracy, FrameErrors};
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::Scene;
use cullmark::{runner, structure};
use methods::Method;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

struct Wanted {
    frames: usize,
    burst: usize,
    accuracy: Accuracy,
    scene: String,
    walk: String,
    threads: Vec<usize>,
    structures: Vec<String>,
    spoil: bool,
}

impl Wanted {
    fn from_arguments() -> Wanted {
        let mut wanted = Wanted {
            frames: 12,
            burst: 4,
            accuracy: Accuracy { width_px: 960, height_px: 540, witness_rays: 2, ..Accuracy::default() },
            scene: String::new(),
            walk: String::new(),
            threads: vec![1, 2, 3],
            structures: methods::STRUCTURES.iter().map(|s| s.to_string()).collect(),
            spoil: false,
        };
        let number = |v: &str| v.parse::<u32>().unwrap_or_else(|_| panic!("`{v}` is not a whole number"));
        for argument in std::env::args().skip(1) {
            match argument.split_once('=') {
                Some(("frames", v)) => wanted.frames = number(v) as usize,
                Some(("burst", v)) => wanted.burst = number(v).max(1) as usize,
                Some(("size", v)) => {
                    let (w, h) = v.split_once('x').expect("size=WIDTHxHEIGHT");
                    (wanted.accuracy.width_px, wanted.accuracy.height_px) = (number(w), number(h));
                }
                Some(("rays", v)) => wanted.accuracy.witness_rays = number(v),
                Some(("scene", v)) => wanted.scene = v.into(),
                Some(("walk", v)) => wanted.walk = v.into(),
                Some(("threads", v)) => wanted.threads = v.split(',').map(|t| number(t) as usize).collect(),
                Some(("structures", v)) => wanted.structures = v.split(';').map(String::from).collect(),
                Some(("spoil", v)) => wanted.spoil = v != "0",
                Some((key, _)) => panic!("`{key}` is none of the keys at the head of benches/frames.rs"),
                // `cargo bench` passes `--bench`.
                None => {}
            }
        }
        wanted
    }

    /// Frames to judge of so many: bursts, the first at the start, the last at the end.
    fn frames_of(&self, count: usize) -> Vec<usize> {
        let burst = self.burst.min(count);
        let bursts = self.frames.div_ceil(burst.max(1));
        let start = |i: usize| i * (count - burst) / (bursts - 1).max(1);
        let mut frames: Vec<usize> = (0..bursts).flat_map(|i| start(i)..start(i) + burst).collect();
        frames.dedup();
        frames.sort_unstable();
        frames.dedup();
        frames
    }
}

/// The judged frames of one path: poses, and truth by the grid of its samples.
struct Path {
    name: String,
    frames: Vec<usize>,
    views: Vec<View>,
    /// The asked grid first.
    truths: Vec<Vec<FrameTruth>>,
}

/// What one method did, summed over frames.
#[derive(Clone, Default)]
struct Sums {
    class: Option<Class>,
    frames: u64,
    wrong: u64,
    differ: u64,
    lost: u64,
    by_ray: u64,
    pixels: u64,
    submitted: u64,
    visible: u64,
    unseen: u64,
}

impl Sums {
    fn add(&mut self, f: &FrameErrors) {
        self.frames += 1;
        self.by_ray += f.false_culls_by_ray;
        self.pixels += f.false_cull_pixels;
        self.submitted += f.submitted;
        self.visible += f.visible;
        self.unseen += f.submitted_unseen;
    }

    fn merge(&mut self, o: &Sums) {
        self.class = self.class.max(o.class);
        for (a, b) in [
            (&mut self.frames, o.frames),
            (&mut self.wrong, o.wrong),
            (&mut self.differ, o.differ),
            (&mut self.lost, o.lost),
            (&mut self.by_ray, o.by_ray),
            (&mut self.pixels, o.pixels),
            (&mut self.submitted, o.submitted),
            (&mut self.visible, o.visible),
            (&mut self.unseen, o.unseen),
        ] {
            *a += b;
        }
    }
}

fn main() -> ExitCode {
    match sweep(&Wanted::from_arguments()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::from(2)
        }
    }
}

/// Whether every method kept its promise.
fn sweep(wanted: &Wanted) -> cullmark::Result<bool> {
    let start = Instant::now();
    let methods = methods::all(&wanted.walk)?;
    let pools: Vec<rayon::ThreadPool> = (wanted.threads.iter())
        .map(|n| rayon::ThreadPoolBuilder::new().num_threads(*n).build().expect("a pool of threads"))
        .collect();
    // Samples that some walk's promise is about, the asked ones first.
    let mut grids = vec![Grid::of(&wanted.accuracy)];
    for method in &methods {
        let walk = make_walk(&method.walk)?.0;
        let own = walk.samples().filter(|_| walk.class() == Class::SampleConservative);
        let own = own.map(|(width_px, height_px)| Grid { width_px, height_px, samples: 1 });
        grids.extend(own.filter(|g| !grids.contains(g)));
    }
    println!(
        "{} methods, {} x {} samples and {} rays, threads {:?}; samples of their own: {:?}",
        methods.len(),
        wanted.accuracy.width_px,
        wanted.accuracy.height_px,
        wanted.accuracy.witness_rays,
        wanted.threads,
        &grids[1..]
    );
    let mut totals: BTreeMap<String, Sums> = BTreeMap::new();
    for (name, source) in scenes::all().into_iter().filter(|(n, _)| n.contains(&wanted.scene)) {
        let (scene, paths) = scenes::load(&name, &source)?;
        let paths: Vec<Path> = paths.into_iter().map(|p| path(&scene, p, &grids, wanted)).collect();
        let judged: usize = paths.iter().map(|p| p.frames.len()).sum();
        println!(
            "{name}: {} triangles, {} paths, {judged} frames, at {:.0} s",
            scene.len(),
            paths.len(),
            start.elapsed().as_secs_f64()
        );
        let mut served = vec![false; methods.len()];
        for spec in &wanted.structures {
            let hierarchy = match structure::make(&Spec::parse(spec)?)?.0.build(&scene) {
                Ok(hierarchy) => hierarchy,
                Err(e) => {
                    println!("{name}: {spec} cannot be built: {e}");
                    continue;
                }
            };
            let place = format!("{name} {spec}");
            let done = in_turn(methods.len(), |i| {
                let skip = served[i] && !methods[i].everywhere;
                if skip { None } else { judge(&scene, &hierarchy, &paths, &methods[i], &pools, (&place, wanted.spoil)) }
            });
            for (i, sums) in done.into_iter().enumerate() {
                let Some(sums) = sums else { continue };
                served[i] = true;
                totals.entry(format!("{} {spec}", methods[i].name())).or_default().merge(&sums);
            }
        }
    }
    Ok(report(&totals, start.elapsed().as_secs_f64()))
}

/// `work` of every number below `count`, by as many threads as there are cores. Plain ones:
/// a rayon worker that waits for another pool would begin the next method on top.
fn in_turn<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, |n| n.get()) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= count {
                        return;
                    }
                    let made = work(i);
                    done.lock().expect("no method panicked").push((i, made));
                }
            });
        }
    });
    let mut done = done.into_inner().expect("no method panicked");
    done.sort_unstable_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, made)| made).collect()
}

fn path(scene: &Scene, (name, poses): (String, Vec<Pose>), grids: &[Grid], wanted: &Wanted) -> Path {
    let frames = wanted.frames_of(poses.len());
    let camera = Camera::default();
    let views: Vec<View> = frames.iter().map(|f| View::new(&camera, &poses[*f])).collect();
    let effort = Effort::new(scene, &wanted.accuracy);
    let truths = (0..grids.len()).map(|g| {
        let effort = if g == 0 { &effort } else { &Effort::NONE };
        let numbered = frames.par_iter().zip(&views);
        numbered.map(|(f, view)| FrameTruth::with(scene, view, *f as u32, grids[g], effort)).collect()
    });
    let truths: Vec<Vec<FrameTruth>> = truths.collect();
    Path { name, frames, truths, views }
}

/// One method over all paths; `None` if its walk refuses the structure.
fn judge(
    scene: &Scene,
    hierarchy: &Hierarchy,
    paths: &[Path],
    method: &Method,
    pools: &[rayon::ThreadPool],
    (place, spoil): (&str, bool),
) -> Option<Sums> {
    let mut sums = Sums::default();
    // What the first thread count submitted, frame after frame.
    let mut first: Vec<blake3::Hash> = Vec::new();
    for (turn, pool) in pools.iter().enumerate() {
        let mut walk = make_walk(&method.walk).expect("made before").0;
        if walk.refuses(hierarchy).is_some() {
            return None;
        }
        let mut tests = make_tests(&parse_sum(method.culling).expect("a sum")).expect("tests").0;
        let (class, removes) = culling::promise(&tests, walk.as_ref());
        sums.class = Some(class);
        pool.install(|| {
            tests.iter_mut().for_each(|t| _ = t.prepare(scene, hierarchy));
            walk.prepare(scene, hierarchy)
        });
        let promised = walk.samples().filter(|_| class == Class::SampleConservative);
        let (mut list, mut number) = (DrawList::default(), 0);
        for path in paths {
            tests.iter_mut().for_each(|t| t.reset());
            walk.reset();
            for (at, view) in path.views.iter().enumerate() {
                let mut tally = Tally::default();
                pool.install(|| culling::cull(view, hierarchy, &mut tests, walk.as_mut(), &mut list, &mut tally));
                let words = list.ranges.iter().flat_map(|(a, b)| [a.to_le_bytes(), b.to_le_bytes()].concat());
                let hash = blake3::hash(&words.collect::<Vec<u8>>());
                let told = || format!("{place} {} frame {} {}", path.name, path.frames[at], method.name());
                if turn == 0 {
                    first.push(hash);
                    judge_one(
                        scene,
                        (view, path, at),
                        (hierarchy, &list),
                        (class, removes, promised),
                        &mut sums,
                        (told, spoil),
                    );
                } else if first[number] != hash {
                    println!("DIFFERS at another thread count: {}", told());
                    sums.differ += 1;
                }
                number += 1;
            }
        }
        if let Some(why) = tests.iter().find_map(|t| t.failure()) {
            println!("VOID {place} {}: {why}", method.name());
            sums.wrong += 1;
        }
    }
    Some(sums)
}

fn judge_one(
    scene: &Scene,
    (view, path, at): (&View, &Path, usize),
    (hierarchy, list): (&Hierarchy, &DrawList),
    (class, removes, promised): (Class, Removes, Option<(u32, u32)>),
    sums: &mut Sums,
    (told, spoil): (impl Fn() -> String, bool),
) {
    let mut submitted = runner::submitted(scene, hierarchy, list);
    if let Some((most, _)) = path.truths[0][at].visible.iter().max_by_key(|(_, samples)| *samples).filter(|_| spoil) {
        submitted.triangles.remove(*most);
    }
    let judge = |truth: &FrameTruth| oracle::judge_frame(scene, view, truth, &submitted, removes);
    let asked = judge(&path.truths[0][at]);
    sums.add(&asked);
    let own = promised.map(|(columns, rows)| {
        let grid = |t: &&Vec<FrameTruth>| (t[at].grid.columns(), t[at].grid.rows()) == (columns, rows);
        judge(&path.truths.iter().find(grid).expect("a truth for all samples")[at])
    });
    let errors = own.unwrap_or(asked);
    let by_ray = if class == Class::SampleConservative { errors.false_culls_by_ray } else { 0 };
    sums.lost += (errors.false_culls - by_ray).max(errors.potential_lost);
    if let Some(why) = oracle::verdict(class, &[errors]) {
        sums.wrong += 1;
        println!("WRONG {}: {why}", told());
    }
}

fn report(totals: &BTreeMap<String, Sums>, seconds: f64) -> bool {
    println!(
        "{:<20} {:>7} {:>6} {:>6} {:>6} {:>8} {:>8} {:>9} {:>9}  method",
        "class", "frames", "wrong", "differ", "lost", "by rays", "pixels", "S / V_lo", "unseen %"
    );
    let line = |name: &str, s: &Sums| {
        let class = s.class.map_or_else(String::new, |c| format!("{c:?}"));
        let (over, unseen) = (s.submitted as f64 / s.visible as f64, s.unseen as f64 / s.submitted as f64 * 100.0);
        println!(
            "{class:<20} {:>7} {:>6} {:>6} {:>6} {:>8} {:>8} {over:>9.2} {unseen:>9.2}  {name}",
            s.frames, s.wrong, s.differ, s.lost, s.by_ray, s.pixels
        );
    };
    let mut whole = Sums::default();
    for (name, sums) in totals {
        line(name, sums);
        if !name.starts_with("depth_first") {
            whole.merge(sums);
        }
    }
    line("all", &whole);
    println!("{} judged frames in {seconds:.0} s", whole.frames);
    totals.values().all(|s| s.wrong + s.differ == 0)
}
