//! Build rates of the structures, in millions of triangles a second.
//!
//! `cargo bench --no-default-features --bench build [-- FILTER]`; a filter keeps
//! the lines whose scene or structure contains it. Each line is the median of
//! 5 builds with the spread of all of them: on one thread by its CPU time, which
//! a busy machine inflates little, and on all threads by the clock. The twins are
//! a pointer octree of the same depth and policy, built the obvious way, and the BVH
//! with scalar kernels. With `CULLMARK_SCENES` the shared city is among the scenes.

use cullmark::math::{Box32, DVec3};
use cullmark::record::{SceneSource, Up, Winding};
use cullmark::registry::Spec;
use cullmark::scene::{Scene, load};
use cullmark::stats;
use cullmark::structure::bvh::{Bvh, Kernel};
use cullmark::structure::{self, Structure};
use std::hint::black_box;
use std::time::Instant;

const REPEATS: usize = 5;
const STRUCTURES: &[&str] = &[
    "list",
    "octree",
    "octree:depth=6",
    "octree:policy=E",
    "octree:policy=R",
    "octree:policy=S",
    "bsp",
    "bsp:layout=binary",
    "bsp:sample=1000000000",
    "uniform_grid",
    "uniform_grid:layout=rows",
    "uniform_grid:policy=R",
    "uniform_grid:policy=S",
    "irregular_grid",
    "irregular_grid:planes=walls",
    "nested_grid",
    "kd_tree",
    "kd_tree:split=median",
    "kd_tree:policy=R",
    "bvh",
    "bvh:leaf_size=4",
    "bvh:leaf_size=4,stop=cost",
    "bvh:split=median",
    "bvh:split=morton",
    "bvh:split=morton,leaf_size=4",
];

fn main() {
    let filters: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let keep =
        |scene: &str, what: &str| filters.iter().all(|f| scene.contains(f.as_str()) || what.contains(f.as_str()));
    let all = rayon::current_num_threads();
    println!(
        "{:<14} {:<28} {:>34} {:>34}",
        "scene",
        "structure",
        "1 thread (CPU time), Mtri/s",
        format!("{all} threads (wall), Mtri/s")
    );
    let made = [soup(1_000_000), city(1_000_000), city(130_000)];
    for scene in shared_city().into_iter().chain(made) {
        for what in STRUCTURES.iter().filter(|w| keep(&scene.name, w)) {
            // Whole scenes score in minutes: one small scene says what sampling saves.
            if what.contains("sample") && scene.len() > 200_000 {
                continue;
            }
            let (s, _) = structure::make(&Spec::parse(what).expect("a spec")).expect("a structure");
            let build = || black_box(s.build(&scene).map(|h| h.entries.len()).unwrap_or(0));
            report(&scene, what, all, &build);
        }
        if keep(&scene.name, "twin: scalar bvh") {
            let twin = Bvh { kernel: Kernel::Scalar, ..Bvh::default() };
            let build = || black_box(twin.build(&scene).map(|h| h.entries.len()).unwrap_or(0));
            report(&scene, "twin: scalar bvh", all, &build);
        }
        if keep(&scene.name, "twin: pointer octree") {
            report(&scene, "twin: pointer octree", 1, &|| black_box(Pointer::build(&scene, 4)));
        }
    }
}

/// The city of a million triangles, where `CULLMARK_SCENES` says that it is.
fn shared_city() -> Option<Scene> {
    let file = std::path::PathBuf::from(std::env::var_os("CULLMARK_SCENES")?).join("city_1m/city_1m.glb");
    let spec = load::describe("city_1m", SceneSource::File(file), Winding::Ccw, Some(Up::Z), 1.0, false);
    Some(spec.and_then(|s| load::load(&s)).unwrap_or_else(|e| panic!("{e}")))
}

fn report(scene: &Scene, what: &str, all: usize, build: &(dyn Fn() -> usize + Sync)) {
    let mut columns = Vec::new();
    let mut entries = 0;
    for threads in if all > 1 { vec![1, all] } else { vec![1] } {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        let rates: Vec<f64> = pool.install(|| {
            entries = build();
            (0..REPEATS)
                .map(|_| {
                    let (started, cpu) = (Instant::now(), thread_cpu_s());
                    build();
                    let wall = started.elapsed().as_secs_f64();
                    let cpu = cpu.and_then(|before| Some(thread_cpu_s()? - before));
                    scene.len() as f64 / if threads == 1 { cpu.unwrap_or(wall) } else { wall } / 1e6
                })
                .collect()
        });
        let (lo, hi) = rates.iter().fold((f64::INFINITY, 0f64), |(lo, hi), r| (lo.min(*r), hi.max(*r)));
        columns.push(format!("{:>8.2} [{lo:.2} .. {hi:.2}]", stats::median(&rates)));
    }
    let duplication = entries as f64 / scene.len() as f64;
    columns.resize(2, String::new());
    println!("{:<14} {what:<28} {:>34} {:>34}   x{duplication:.2} entries", scene.name, columns[0], columns[1]);
}

/// Seconds that this thread has run, where Linux tells (to a few milliseconds).
fn thread_cpu_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}

/// SplitMix64 (Steele, Lea & Flood 2014), as numbers in 0..1.
fn random(mut state: u64) -> impl FnMut() -> f64 {
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn scene(name: String, positions: Vec<DVec3>, triangles: Vec<[u32; 3]>, materials: u32) -> Scene {
    let n = triangles.len();
    let mut scene = Scene {
        name,
        positions,
        triangles,
        source_triangle_id: (0..n as u32).collect(),
        object_id: vec![0; n],
        material_id: (0..n as u32).map(|t| t / 12 % materials).collect(),
        two_sided: vec![false; n],
        occluder: vec![true; n],
        material_names: (0..materials).map(|m| m.to_string()).collect(),
        source_triangle_count: n as u32,
        ..Scene::default()
    };
    scene.anchor();
    scene
}

/// Small triangles anywhere in a cube, in no order at all.
fn soup(count: usize) -> Scene {
    let mut unit = random(1);
    let mut vector = move |scale: f64| DVec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5) * scale;
    let positions = (0..count)
        .flat_map(|_| {
            let centre = vector(1000.0);
            [(); 3].map(|()| centre + vector(4.0))
        })
        .collect();
    scene(
        format!("soup {}k", count / 1000),
        positions,
        (0..count as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        3,
    )
}

/// Blocks of turned houses on a plain, vertices shared within a house.
fn city(count: usize) -> Scene {
    let side = ((count / 12) as f64).sqrt() as usize;
    let mut unit = random(2);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..side * side {
        let centre = DVec3::new((i % side) as f64 * 20.0, (i / side) as f64 * 20.0, 0.0);
        let (turn, width, depth, height) =
            (unit() * 0.3, 4.0 + unit() * 6.0, 4.0 + unit() * 6.0, 4.0 + 40.0 * unit() * unit());
        let first = positions.len() as u32;
        for corner in 0..8u32 {
            let pick = |bit: u32, size: f64| if corner >> bit & 1 == 1 { size } else { -size };
            let (x, y) = (pick(0, width), pick(1, depth));
            let (sin, cos) = turn.sin_cos();
            positions
                .push(centre + DVec3::new(x * cos - y * sin, x * sin + y * cos, if corner > 3 { height } else { 0.0 }));
        }
        const FACES: [[u32; 4]; 6] =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
        for [a, b, c, d] in FACES.map(|f| f.map(|v| v + first)) {
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    scene(format!("city {}k", count / 1000), positions, triangles, 8)
}

/// The obvious octree: lists of triangles dealt to eight children, boxed nodes.
#[derive(Default)]
struct Pointer {
    children: [Option<Box<Pointer>>; 8],
    triangles: Vec<u32>,
    bounds: Option<Box32>,
}

impl Pointer {
    fn build(scene: &Scene, depth: u32) -> usize {
        let all = (0..scene.len() as u32).collect();
        let cell = scene.bounds();
        let root = Pointer::divide(scene, all, cell.lo, cell.hi, depth);
        root.count()
    }

    fn divide(scene: &Scene, triangles: Vec<u32>, lo: DVec3, hi: DVec3, depth: u32) -> Pointer {
        let bounds = triangles.iter().map(|t| scene.triangle_box(*t)).reduce(Box32::union);
        let mut node = Pointer { bounds, ..Pointer::default() };
        if depth == 0 {
            node.triangles = triangles;
            return node;
        }
        let middle = (lo + hi) * 0.5;
        let mut parts: [Vec<u32>; 8] = Default::default();
        for t in triangles {
            let [a, b, c] = scene.corners(t);
            let above = ((a + b + c) / 3.0).cmpge(middle);
            parts[above.bitmask() as usize].push(t);
        }
        for (i, part) in parts.into_iter().enumerate().filter(|(_, p)| !p.is_empty()) {
            let pick =
                |axis: usize| if i >> axis & 1 == 1 { (middle[axis], hi[axis]) } else { (lo[axis], middle[axis]) };
            let ((x0, x1), (y0, y1), (z0, z1)) = (pick(0), pick(1), pick(2));
            let child = Pointer::divide(scene, part, DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1), depth - 1);
            node.children[i] = Some(Box::new(child));
        }
        node
    }

    /// Entries reachable from here, so that nothing of the build is dead code.
    fn count(&self) -> usize {
        assert!(self.bounds.is_some());
        self.triangles.len() + self.children.iter().flatten().map(|c| c.count()).sum::<usize>()
    }
}
