//! What skipping saves: `cargo bench --no-default-features --bench skip [-- PART ...]`.
//!
//! Parts: `costs` (a node, a plane, what stands for a box), `whole` (scenes too small to
//! cull), `small` (subtrees too small to enter), `saturation` (masks too full to ask),
//! `still` (a camera that does not move). Modelled frame time is culling + 0.32 ns an index
//! + 430 ns a draw call, as in reports; a draw call is a run of one material.
//!
//! Scenes are `blocks`, world 5, scaled by `triangles`; below its least number every
//! so many of its triangles. The camera walks through world 5 and looks ahead. Methods
//! take turns, whole paths at a time; medians of thread CPU time over turns.

use cullmark::culling::{DrawList, Tally, Test, Walk, cull, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, Pose, View};
use cullmark::record::TimeModel;
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::{Scene, generate, walkthrough};
use cullmark::structure;

const TURNS: usize = 15;
const FRAMES: usize = 240;

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let wants = |part: &str| asked.is_empty() || asked.iter().any(|a| a == part);
    let views = views();
    let parts: [(&str, fn(&[View])); 5] =
        [("costs", costs), ("whole", whole), ("small", small), ("saturation", saturation), ("still", still)];
    parts.iter().filter(|(name, _)| wants(name)).for_each(|(name, part)| {
        println!("\n== {name}");
        part(&views);
    });
}

/// What a method does a frame, on average.
#[derive(Clone, Copy)]
struct Frame {
    cull_ns: f64,
    tally: [f64; 14],
    triangles: f64,
    calls: f64,
    /// Draw calls if all triangles had one material.
    ranges: f64,
}

impl Frame {
    fn modelled_ns(&self) -> f64 {
        let model = TimeModel::default();
        self.cull_ns + model.index_ns * 3.0 * self.triangles + model.draw_call_ns * self.calls
    }

    fn one_material_ns(&self) -> f64 {
        Frame { calls: self.ranges, ..*self }.modelled_ns()
    }

    fn count(&self, name: &str) -> f64 {
        let at = Tally::default().named().iter().position(|(n, ..)| *n == name);
        self.tally[at.expect("a counter")]
    }
}

struct Method<'a> {
    hierarchy: &'a Hierarchy,
    tests: Vec<Box<dyn Test>>,
    walk: Box<dyn Walk>,
}

impl Method<'_> {
    fn pass(&mut self, views: &[View], mut each: impl FnMut(&DrawList, Tally)) {
        let mut out = DrawList::default();
        self.tests.iter_mut().for_each(|t| t.reset());
        self.walk.reset();
        for view in views {
            let mut tally = Tally::default();
            cull(view, self.hierarchy, &mut self.tests, self.walk.as_mut(), &mut out, &mut tally);
            each(&out, tally);
        }
    }
}

/// Structure, culling, walk.
type Name<'a> = (&'a str, &'a str, &'a str);

/// Times methods in turns over one scene.
fn run(scene: &Scene, methods: &[Name], views: &[View]) -> Vec<Frame> {
    let mut built: Vec<(&str, Hierarchy)> = Vec::new();
    for (name, ..) in methods {
        if !built.iter().any(|(n, _)| n == name) {
            built.push((*name, structure::make(&Spec::parse(name).unwrap()).unwrap().0.build(scene).unwrap()));
        }
    }
    let mut made: Vec<Method> = methods
        .iter()
        .map(|(structure, culling, walk)| {
            let hierarchy = &built.iter().find(|(n, _)| n == structure).expect("built above").1;
            let mut tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
            tests.iter_mut().for_each(|t| _ = t.prepare(scene, hierarchy));
            Method { hierarchy, tests, walk: make_walk(&Spec::parse(walk).unwrap()).unwrap().0 }
        })
        .collect();
    let mut ns = vec![Vec::new(); made.len()];
    for _ in 0..TURNS {
        for (method, ns) in made.iter_mut().zip(&mut ns) {
            let start = cpu_ns();
            method.pass(views, |out, _| _ = std::hint::black_box(out));
            ns.push((cpu_ns() - start) / views.len() as f64);
        }
    }
    let counted = |method: &mut Method, ns: &mut Vec<f64>| {
        ns.sort_by(f64::total_cmp);
        let mut frame = Frame { cull_ns: ns[ns.len() / 2], tally: [0.0; 14], triangles: 0.0, calls: 0.0, ranges: 0.0 };
        let (share, h) = (1.0 / views.len() as f64, method.hierarchy);
        method.pass(views, |out, tally| {
            frame.triangles += out.entry_count() as f64 * share;
            frame.calls += out.draw_calls(h) as f64 * share;
            frame.ranges += out.draw_calls_any_material() as f64 * share;
            frame.tally.iter_mut().zip(tally.named()).for_each(|(sum, (.., value))| *sum += value as f64 * share);
        });
        frame
    };
    made.iter_mut().zip(&mut ns).map(|(method, ns)| counted(method, ns)).collect()
}

fn costs(views: &[View]) {
    for n in [10_040, 300_000] {
        let scene = blocks(n);
        println!("blocks, {n} triangles");
        let octree = |culling: &'static str| ("octree:depth=6", culling, "depth_first");
        let methods: Vec<Name> = [
            "frustum",
            "frustum:plane_mask=false",
            "frustum:last_plane=true",
            "frustum:octant=true",
            "frustum:plane_mask=false,octant=true",
            "frustum:primitive=sphere",
            "frustum:primitive=sphere,octant=true",
            "frustum:primitive=point",
            "frustum:sat=true",
        ]
        .map(octree)
        .into_iter()
        .chain(["frustum", "frustum:primitive=sphere", "frustum:primitive=point"].map(|c| ("list", c, "flat")))
        .collect();
        println!(
            "{:<58} {:>8} {:>7} {:>8} {:>8} {:>8} {:>9} {:>8} {:>8}",
            "", "us", "nodes", "planes", "octants", "axes", "triangles", "ns/node", "ns/plane"
        );
        for (name, frame) in methods.iter().zip(run(&scene, &methods, views)) {
            let [nodes, planes, octants, axes] =
                ["nodes_visited", "plane_tests", "octant_tests", "axis_tests"].map(|c| frame.count(c));
            println!(
                "{:<58} {:>8.2} {nodes:>7.0} {planes:>8.0} {octants:>8.0} {axes:>8.0} {:>9.0} {:>8.2} {:>8.2}",
                format!("{} x {}", name.0, name.1),
                frame.cull_ns / 1e3,
                frame.triangles,
                frame.cull_ns / nodes,
                frame.cull_ns / planes
            );
        }
    }
}

/// The number of triangles under which drawing all is as quick as leaving some out.
fn whole(views: &[View]) {
    let sizes = [12, 50, 100, 200, 400, 800, 1_600, 2_548, 5_000, 10_040, 20_000, 40_000, 80_000, 160_000];
    let pairs: [(Name, Name); 3] = [
        (("list", "frustum", "flat"), ("list", "frustum", "flat:whole_below=4294967295")),
        (
            ("octree:depth=4", "frustum", "depth_first"),
            ("octree:depth=4", "frustum", "depth_first:whole_below=4294967295"),
        ),
        (
            ("octree:depth=2", "frustum", "depth_first"),
            ("octree:depth=2", "frustum", "depth_first:whole_below=4294967295"),
        ),
    ];
    for (culled, all) in pairs {
        println!("{} x frustum; modelled us by materials and as if there were one", culled.0);
        println!(
            "{:>9} {:>8} {:>8} {:>7} {:>7} {:>9} {:>9} {:>8} {:>7} {:>9} {:>9} {:>6} {:>6}",
            "triangles",
            "cull ns",
            "kept",
            "calls",
            "ranges",
            "us",
            "us of one",
            "whole ns",
            "calls",
            "us",
            "us of one",
            "wins",
            "of one"
        );
        let mut largest = [0; 2];
        for n in sizes {
            let [part, whole] = run(&blocks(n), &[culled, all], views)[..] else { unreachable!("two methods") };
            let wins = [whole.modelled_ns() <= part.modelled_ns(), whole.one_material_ns() <= part.one_material_ns()];
            largest = [0, 1].map(|i| if wins[i] { n } else { largest[i] });
            let [by_materials, of_one] = wins.map(|w| if w { "whole" } else { "cull" });
            println!(
                "{n:>9} {:>8.0} {:>8.0} {:>7.1} {:>7.1} {:>9.2} {:>9.2} {:>8.1} {:>7.1} {:>9.2} {:>9.2} {by_materials:>6} {of_one:>6}",
                part.cull_ns,
                part.triangles,
                part.calls,
                part.ranges,
                part.modelled_ns() / 1e3,
                part.one_material_ns() / 1e3,
                whole.cull_ns,
                whole.calls,
                whole.modelled_ns() / 1e3,
                whole.one_material_ns() / 1e3,
            );
        }
        println!("drawing whole wins up to {} triangles, and up to {} of one material", largest[0], largest[1]);
    }
}

/// One line a method, with what it gains over the first.
fn table(scene: &Scene, methods: &[Name], views: &[View], counter: &str, label: impl Fn(&Name) -> String) {
    println!(
        "{:<46} {:>8} {:>6} {:>9} {:>9} {:>7} {:>7} {:>9} {:>7} {:>9} {:>7}",
        "", "cull us", "nodes", "skipped", "triangles", "calls", "ranges", "us", "gain", "us of one", "gain"
    );
    let frames = run(scene, methods, views);
    let gain = |of: fn(&Frame) -> f64, frame: &Frame| (1.0 - of(frame) / of(&frames[0])) * 100.0;
    for (name, frame) in methods.iter().zip(&frames) {
        println!(
            "{:<46} {:>8.2} {:>6.0} {:>9.0} {:>9.0} {:>7.1} {:>7.1} {:>9.2} {:>6.1}% {:>9.2} {:>6.1}%",
            label(name),
            frame.cull_ns / 1e3,
            frame.count("nodes_visited"),
            frame.count(counter),
            frame.triangles,
            frame.calls,
            frame.ranges,
            frame.modelled_ns() / 1e3,
            gain(Frame::modelled_ns, frame),
            frame.one_material_ns() / 1e3,
            gain(Frame::one_material_ns, frame)
        );
    }
}

fn small(views: &[View]) {
    let walks: Vec<String> =
        [0, 16, 64, 128, 256, 448, 1_000, 2_000, 4_000, 16_000].map(|n| format!("depth_first:small={n}")).into();
    for (n, structure) in [(10_040, "octree:depth=6"), (100_000, "octree:depth=6"), (1_000_000, "octree:depth=7")] {
        println!("blocks, {n} triangles, {structure} x frustum");
        let methods: Vec<Name> = walks.iter().map(|w| (structure, "frustum", w.as_str())).collect();
        table(&blocks(n), &methods, views, "subtrees_not_entered", |m| m.2.to_string());
    }
}

fn saturation(views: &[View]) {
    let shares = [0.0, 1.0, 0.75, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05];
    for n in [10_040, 100_000] {
        let scene = blocks(n);
        for test in ["normal_mask:cells=4", "normal_mask:cells=4,rays=node", "octant_mask:sectors=8"] {
            println!("blocks, {n} triangles, octree:depth=6 x frustum+{test}");
            let cullings: Vec<String> = shares.map(|s| format!("frustum+{test},saturation={s:?}")).into();
            let mut methods: Vec<Name> =
                cullings.iter().map(|c| ("octree:depth=6", c.as_str(), "depth_first")).collect();
            methods.push(("octree:depth=6", "frustum", "depth_first"));
            table(&scene, &methods, views, "masks_ignored", |m| m.1.to_string());
        }
    }
}

fn still(views: &[View]) {
    // The camera stops at every tenth place for ten frames.
    let resting: Vec<View> = views.iter().step_by(10).flat_map(|v| vec![v.clone(); 10]).collect();
    for n in [10_040, 300_000] {
        println!("blocks, {n} triangles; nine frames of ten like the one before");
        let methods: [Name; 6] = [
            ("octree:depth=6", "frustum", "depth_first"),
            ("octree:depth=6", "frustum", "depth_first:still=true"),
            ("list", "frustum", "flat"),
            ("list", "frustum", "flat:still=true"),
            ("octree:depth=6", "frustum+normal_mask+back_face", "depth_first"),
            ("octree:depth=6", "frustum+normal_mask+back_face", "depth_first:still=true"),
        ];
        let scene = blocks(n);
        for pair in methods.chunks(2) {
            let frames = run(&scene, pair, &resting);
            let moving = run(&scene, pair, views);
            println!(
                "{:<60} {:>9.2} us, still {:>8.3} us; moving all the time {:>9.2} us, still {:>9.2} us",
                format!("{} x {} x {}", pair[0].0, pair[0].1, pair[0].2),
                frames[0].cull_ns / 1e3,
                frames[1].cull_ns / 1e3,
                moving[0].cull_ns / 1e3,
                moving[1].cull_ns / 1e3
            );
        }
    }
}

fn made(spec: &str) -> Scene {
    generate::make(&Spec::parse(spec).unwrap()).unwrap().0.generate()
}

fn blocks(n: usize) -> Scene {
    if n >= 2_400 {
        return made(&format!("blocks:triangles={n}"));
    }
    let all = made("blocks");
    let keep: Vec<usize> = (0..n).map(|i| i * all.len() / n).collect();
    let mut scene = Scene { positions: all.positions.clone(), ..all.clone() };
    scene.triangles = keep.iter().map(|t| all.triangles[*t]).collect();
    scene.source_triangle_id = keep.iter().map(|t| all.source_triangle_id[*t]).collect();
    scene.object_id = keep.iter().map(|t| all.object_id[*t]).collect();
    scene.material_id = keep.iter().map(|t| all.material_id[*t]).collect();
    scene.two_sided = keep.iter().map(|t| all.two_sided[*t]).collect();
    scene.occluder = keep.iter().map(|t| all.occluder[*t]).collect();
    scene
}

fn views() -> Vec<View> {
    let path = Spec::parse(&format!("walk:frames={FRAMES},speed_m=1")).unwrap();
    let poses: Vec<Pose> = walkthrough::generate::make(&path).unwrap().0.walk(&made("blocks")).unwrap();
    poses.iter().map(|p| View::new(&Camera::default(), p)).collect()
}

/// Time that this thread computed, which leaves out what others took of the core.
fn cpu_ns() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the clock exists and the pointer is to a timespec of our own.
    let rc = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
    assert_eq!(rc, 0);
    t.tv_sec as f64 * 1e9 + t.tv_nsec as f64
}
