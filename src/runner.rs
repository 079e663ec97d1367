//! One [`RunSpec`] in, one record out: the lab's whole answer to the service.
//!
//! A *trial* times; a *judgement* compares with the truth. They are separate
//! passes over the same frames, tied together by the hash of every frame's
//! submitted ranges. No clock is read inside an algorithm: the clock brackets
//! one frame's `begin` + walk, and nothing else.

mod judging;

use crate::culling::distinct::Distinct;
use crate::culling::{self, Class, DrawList, Removes, Tally, Test, Walk};
use crate::error::{Error, Result};
use crate::hierarchy::Hierarchy;
use crate::machine;
use crate::math::{Camera, Pose, View};
use crate::record::{Counter, RunSpec, Sentinel, Series, TrialRecord};
use crate::scene::{Scene, load, walkthrough};
use crate::structure::{self, Structure};
pub use judging::{by_own_samples, judge, judge_setup, submitted};
use std::path::Path;
use std::time::Instant;

/// A scene with its structure and tests, ready to cull frame by frame.
pub struct Setup {
    pub scene: Scene,
    pub poses: Vec<Pose>,
    pub views: Vec<View>,
    pub hierarchy: Hierarchy,
    pub tests: Vec<Box<dyn Test>>,
    pub walk: Box<dyn Walk>,
    pub class: Class,
    pub removes: Removes,
    pub load_ns: u64,
    pub build_ns: u64,
    pub prepare_ns: u64,
    /// Of the tests' columns and of what the walk keeps.
    pub test_bytes: u64,
}

/// What one frame submitted and how much work that was.
#[derive(Debug, Clone, Default)]
pub struct FrameWork {
    pub tally: Tally,
    /// Distinct triangles.
    pub triangles: u64,
    /// Entries: replicated triangles and fragments counted each.
    pub entries: u64,
    pub draw_calls: u64,
    pub draw_calls_any_material: u64,
    /// Of the submitted ranges, in order.
    pub hash: u64,
}

impl Setup {
    /// Loads through the cache, builds and prepares.
    ///
    /// # Errors
    /// Bad input, an unsuitable structure, or a walk that refuses it.
    pub fn new(spec: &RunSpec, cache: &Path) -> Result<Setup> {
        let start = Instant::now();
        let scene = load::load_cached(&spec.scene, cache)?;
        let poses = walkthrough::load_cached(&spec.path, &spec.scene, &scene, cache)?;
        let load_ns = elapsed_ns(start);
        if poses.is_empty() {
            return Err(Error::new(format!("path `{}` has no frames", spec.path.name)));
        }
        let (structure, _) = structure::make(&spec.structure)?;
        let (tests, _) = culling::make_tests_in(&spec.culling, spec.arithmetic()?)?;
        let (walk, _) = culling::make_walk(&spec.walk)?;
        let setup = Setup::from_parts(scene, poses, &spec.camera, structure.as_ref(), tests, walk)?;
        Ok(Setup { load_ns, ..setup })
    }

    /// The same from parts of one's own: any structure, tests and walk.
    ///
    /// # Errors
    /// When the structure does not suit the scene, or the walk the structure.
    pub fn from_parts(
        scene: Scene,
        poses: Vec<Pose>,
        camera: &Camera,
        structure: &dyn Structure,
        mut tests: Vec<Box<dyn Test>>,
        mut walk: Box<dyn Walk>,
    ) -> Result<Setup> {
        let start = Instant::now();
        let hierarchy = structure.build(&scene)?;
        let build_ns = elapsed_ns(start);
        if let Some(why) = walk.refuses(&hierarchy) {
            return Err(Error::new(format!("the walk cannot run over this structure: {why}")));
        }
        let start = Instant::now();
        let of_tests: usize = tests.iter_mut().map(|t| t.prepare(&scene, &hierarchy)).sum();
        let test_bytes = (of_tests + walk.prepare(&scene, &hierarchy)) as u64;
        let prepare_ns = elapsed_ns(start);
        let (class, removes) = culling::promise(&tests, walk.as_ref());
        let views = poses.iter().map(|p| View::new(camera, p)).collect();
        Ok(Setup {
            scene,
            poses,
            views,
            hierarchy,
            tests,
            walk,
            class,
            removes,
            load_ns: 0,
            build_ns,
            prepare_ns,
            test_bytes,
        })
    }

    /// Before a pass: temporal state starts anew.
    pub fn reset(&mut self) {
        self.tests.iter_mut().for_each(|t| t.reset());
        self.walk.reset();
    }

    /// Culls one frame: the section that trials time.
    #[inline]
    pub fn cull(&mut self, frame: usize, out: &mut DrawList, tally: &mut Tally) {
        let view = &self.views[frame];
        culling::cull(view, &self.hierarchy, &mut self.tests, self.walk.as_mut(), out, tally);
    }

    /// One whole pass without a clock: the work of every frame.
    pub fn count_pass(&mut self, mut each: impl FnMut(&Setup, usize, &DrawList)) -> Vec<FrameWork> {
        self.reset();
        let mut list = DrawList::default();
        let mut distinct = Distinct::new(&self.hierarchy.entries, self.scene.len());
        (0..self.views.len())
            .map(|frame| {
                let mut tally = Tally::default();
                self.cull(frame, &mut list, &mut tally);
                let entries = list.entry_count();
                let triangles = distinct.count(&list);
                each(self, frame, &list);
                FrameWork {
                    tally,
                    triangles,
                    entries,
                    draw_calls: list.draw_calls(&self.hierarchy),
                    draw_calls_any_material: list.draw_calls_any_material(),
                    hash: hash_ranges(&list),
                }
            })
            .collect()
    }

    /// After a pass: an error if some test calls it void.
    ///
    /// # Errors
    /// With the test's own sentence ([`Test::failure`]).
    pub fn check(&self) -> Result<()> {
        match self.tests.iter().find_map(|t| t.failure()) {
            Some(why) => Err(Error::new(why)),
            None => Ok(()),
        }
    }

    fn frames_hash(&self, work: &[FrameWork]) -> String {
        let mut h = blake3::Hasher::new();
        for entry in &self.hierarchy.entries {
            h.update(&entry.to_le_bytes());
        }
        for frame in work {
            h.update(&frame.hash.to_le_bytes());
        }
        h.finalize().to_hex()[..32].to_string()
    }
}

/// Times one repeat in this process, which should do nothing else.
///
/// # Errors
/// As [`Setup::new`]; also when two passes submit different sets, or a test calls a pass void.
pub fn time_trial(spec: &RunSpec, cache: &Path) -> Result<TrialRecord> {
    let protocol = &spec.protocol;
    if protocol.passes == 0 {
        return Err(Error::new("a trial needs at least one timed pass").key("measure.passes"));
    }
    // Before pinning, which would leave one core to count.
    machine::core_count();
    if let Some(core) = protocol.pin_core {
        machine::pin_to(&[core])?;
    }
    // The pool inherits the pinning: with one thread, building is timed on the lane too.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(protocol.threads.max(1) as usize).build_global();
    let mut setup = Setup::new(spec, cache)?;
    let before_ns = machine::sentinel_ns();
    let work = setup.count_pass(|_, _, _| ());
    setup.check()?;
    let frames = setup.views.len();
    let mut list = DrawList::default();
    let mut passes_ns = Vec::new();
    let mut switches = 0;
    for pass in 0..protocol.warmup_passes + protocol.passes {
        setup.reset();
        let mut tally = Tally::default();
        let mut times_ns = Vec::with_capacity(frames);
        let switches_before = machine::involuntary_switches();
        for (frame, counted) in work.iter().enumerate() {
            let start = Instant::now();
            setup.cull(frame, &mut list, &mut tally);
            times_ns.push(elapsed_ns(start) as f64);
            if hash_ranges(&list) != counted.hash {
                return Err(Error::new(format!(
                    "pass {pass} submitted another set than the first pass in frame {frame}"
                ))
                .help("the method reads a clock or keeps state that `reset` forgets to clear"));
            }
        }
        setup.check()?;
        if tally != work.iter().map(|w| w.tally).sum() {
            return Err(Error::new(format!("pass {pass} counted other work than the first pass"))
                .help("the method counts by what it did before: `reset` forgets to clear it"));
        }
        if pass >= protocol.warmup_passes {
            switches += machine::involuntary_switches() - switches_before;
            passes_ns.push(times_ns);
        }
    }
    let sentinel = Sentinel { before_ns, after_ns: machine::sentinel_ns(), involuntary_switches: switches };
    let least = |frame: usize| passes_ns.iter().map(|p| p[frame]).fold(f64::INFINITY, f64::min);
    let cull_ns = (0..frames).map(least).collect();
    Ok(record(spec, &setup, &work, cull_ns, passes_ns, sentinel))
}

fn record(
    spec: &RunSpec,
    setup: &Setup,
    work: &[FrameWork],
    cull_ns: Vec<f64>,
    passes_ns: Vec<Vec<f64>>,
    sentinel: Sentinel,
) -> TrialRecord {
    let column = |name: &str, unit: &str, of: &dyn Fn(&FrameWork) -> u64| Series {
        name: name.to_string(),
        unit: unit.to_string(),
        values: work.iter().map(|w| of(w) as f64).collect(),
    };
    let mut series = vec![Series { name: "cull_ns".into(), unit: "ns".into(), values: cull_ns }];
    series.push(column("triangles", "triangles", &|w| w.triangles));
    series.push(column("entries", "triangles", &|w| w.entries));
    series.push(column("draw_calls", "calls", &|w| w.draw_calls));
    series.push(column("draw_calls_any_material", "calls", &|w| w.draw_calls_any_material));
    series.push(column("nodes_visited", "nodes", &|w| w.tally.nodes_visited));
    let mut counters: Vec<Counter> = series[1..5].iter().map(sum).collect();
    for (i, (name, unit, _)) in Tally::default().named().iter().enumerate() {
        let value = work.iter().map(|w| w.tally.named()[i].2 as f64).sum();
        if i < Tally::ALWAYS || value > 0.0 {
            counters.push(Counter { name: name.to_string(), unit: unit.to_string(), value });
        }
    }
    let by_frame = |(_, (name, _, _)): &(usize, (&str, &str, u64))| Tally::BY_FRAME.contains(name);
    for (i, (name, unit, _)) in Tally::default().named().into_iter().enumerate().filter(by_frame) {
        let further = column(name, unit, &|w| w.tally.named()[i].2);
        series.extend(Some(further).filter(|s| s.values.iter().any(|v| *v != 0.0)));
    }
    let load = &setup.scene.report;
    for (name, value) in [
        ("faces_in_file", load.triangles_in_file),
        ("faces_dropped_non_finite", load.dropped_non_finite),
        ("faces_dropped_out_of_range", load.dropped_out_of_range),
        ("faces_dropped_degenerate", load.dropped_degenerate),
    ] {
        counters.push(Counter { name: name.into(), unit: "faces".into(), value: value as f64 });
    }
    TrialRecord {
        load_ns: setup.load_ns,
        build_ns: setup.build_ns,
        prepare_ns: setup.prepare_ns,
        structure_bytes: setup.hierarchy.bytes() as u64,
        test_bytes: setup.test_bytes,
        peak_rss_bytes: machine::peak_rss_bytes(),
        build: setup.hierarchy.stats,
        entries: setup.hierarchy.entries.len() as u64,
        scene_triangles: setup.scene.len() as u64,
        load: setup.scene.report.clone(),
        counters,
        series,
        passes_ns,
        frames_hash: setup.frames_hash(work),
        sentinel,
        environment: machine::environment(spec.protocol.pin_core),
    }
}

fn sum(series: &Series) -> Counter {
    Counter { name: series.name.clone(), unit: series.unit.clone(), value: series.values.iter().sum() }
}

/// A fast order-dependent mix of the ranges; collisions would need 2^32 frames to be likely.
fn hash_ranges(list: &DrawList) -> u64 {
    list.ranges.iter().fold(0x9E37_79B9_7F4A_7C15, |h, (first, end)| {
        let mixed = (h ^ (u64::from(*first) << 32 | u64::from(*end))).wrapping_mul(0xD6E8_FEB8_6659_FD93);
        mixed ^ mixed >> 32
    })
}

fn elapsed_ns(start: Instant) -> u64 {
    start.elapsed().as_nanos() as u64
}
