//! Facing of single triangles in six arithmetics, and of the tests that judge
//! by less than the plane: `cargo bench --no-default-features --bench facing`.
//!
//! Every method filters one list that names a million triangles in ranges; the
//! naive way asks `n.(e - v) > 0` in f64 of corners in memory, a triangle at a time.
//! All take turns in one process, so that a disturbance meets all of them; medians
//! and the middle half of many turns of thread CPU time are given, and the ratio to
//! the naive way.
//! The kernels of the narrower instruction sets follow. `CULLMARK_SCENES` names a
//! folder of real scenes, of which `city_1m` is used where it is there.

use cullmark::culling::back_face::BackFace;
use cullmark::culling::facing_columns::{Eye32, relative_points, world_planes};
use cullmark::culling::facing_kernels::kernels;
use cullmark::culling::{DrawList, Tally, Test, make_tests};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Arithmetic, Camera, DVec3, Pose, View};
use cullmark::record::{SceneSource, Up, Winding};
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::{Scene, load};
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::hint::black_box;
use std::path::PathBuf;

/// Method, and the class of its answer by its own account.
const METHODS: [&str; 14] = [
    "back_face:arithmetic=f32_world",
    "back_face:arithmetic=f32_world,form=difference",
    "back_face:arithmetic=f32_relative",
    "back_face:arithmetic=f64",
    "back_face:arithmetic=filtered",
    "back_face:arithmetic=exact",
    "back_face:arithmetic=fixed_q16",
    "look_at",
    "sector",
    "sector:rule=averted",
    "sector:rule=safe",
    "normal_mask",
    "normal_mask:rays=node",
    "normal_cone",
];

fn main() {
    let turns = 31;
    compare("soup of 1,000,000", &soup(1_000_000), turns);
    match city() {
        Some(city) => compare("city_1m", &city, turns),
        None => println!("no city_1m: set CULLMARK_SCENES to time it"),
    }
}

fn city() -> Option<Scene> {
    let folder = PathBuf::from(std::env::var_os("CULLMARK_SCENES")?);
    let source = SceneSource::File(folder.join("city_1m/city_1m.glb"));
    let spec = load::describe("city_1m", source, Winding::Ccw, Some(Up::Y), 1.0, false).ok()?;
    load::load(&spec).ok()
}

fn compare(name: &str, scene: &Scene, turns: usize) {
    let list = cullmark::structure::make(&Spec::parse("list").unwrap()).unwrap().0;
    let h = list.build(scene).unwrap();
    let bounds = scene.bounds();
    let eye = bounds.lo + bounds.size() * DVec3::new(0.45, 0.4, 0.6);
    let forward = DVec3::new(0.8, 0.5, -0.1).normalize();
    let view = View::new(&Camera::default(), &Pose { eye, forward, up: DVec3::Z });
    let mut methods: Vec<(String, Box<dyn Test>)> =
        METHODS.iter().map(|m| (m.to_string(), make_tests(&parse_sum(m).unwrap()).unwrap().0.remove(0))).collect();
    for k in kernels().into_iter().skip(1) {
        for a in [Arithmetic::F32World, Arithmetic::F32Relative, Arithmetic::F64] {
            methods.push((format!("back_face:arithmetic={a} ({})", k.name), Box::new(BackFace::new(a, false, k))));
        }
    }
    let bytes: Vec<f64> = methods
        .iter_mut()
        .map(|(_, t)| {
            let bytes = t.prepare(scene, &h);
            t.begin(&view, &h);
            bytes as f64 / scene.len() as f64
        })
        .collect();
    let corners: Vec<[DVec3; 3]> = h.entries.iter().map(|t| scene.corners(*t)).collect();
    let mut times = vec![Vec::with_capacity(turns); methods.len() + 1];
    let mut kept = vec![0; methods.len() + 1];
    let mut out = DrawList::default();
    for _ in 0..turns {
        let start = cpu_ns();
        kept[0] = naive(black_box(&corners), eye, &mut out);
        times[0].push(cpu_ns() - start);
        for (i, (name, test)) in methods.iter_mut().enumerate() {
            let mut tally = Tally::default();
            let start = cpu_ns();
            judge(name, test.as_mut(), &view, &h, &mut out, &mut tally);
            times[i + 1].push(cpu_ns() - start);
            kept[i + 1] = out.entry_count();
        }
    }
    println!("\n{name}: {} triangles, {} kernels", scene.len(), kernels()[0].name);
    kernels_alone(scene, &h, &view, turns);
    println!("{:<48} {:>8} {:>17} {:>8} {:>7} {:>8}", "method", "ns/tri", "[middle half]", "x naive", "B/tri", "kept");
    let base = quartiles(&mut times[0])[1];
    let names = std::iter::once("naive f64, a triangle at a time").chain(methods.iter().map(|m| m.0.as_str()));
    let bytes = std::iter::once(72.0).chain(bytes);
    for (((name, times), kept), bytes) in names.zip(&mut times).zip(&kept).zip(bytes) {
        let [lo, middle, hi] = quartiles(times);
        let n = scene.len() as f64;
        println!(
            "{name:<48} {:>8.3} [{:>7.3}-{:>7.3}] {:>8.1} {bytes:>7.1} {:>7.1}%",
            middle / n,
            lo / n,
            hi / n,
            base / middle,
            *kept as f64 / n * 100.0
        );
    }
}

/// The kernels without the ranges that a filter makes of their bits.
fn kernels_alone(scene: &Scene, h: &Hierarchy, view: &View, turns: usize) {
    let (planes, points) = (world_planes(scene, h), relative_points(scene, h));
    let (world, relative) = (Eye32::world(view), Eye32::relative(view, h.origin));
    let mut keep = vec![0u64; scene.len().div_ceil(64)];
    let mut times = vec![[const { Vec::new() }; 2]; kernels().len()];
    for _ in 0..turns {
        for (k, times) in kernels().iter().zip(&mut times) {
            keep.fill(!0);
            let start = cpu_ns();
            (k.plane)(&world, black_box(&planes), &mut keep);
            times[0].push(cpu_ns() - start);
            keep.fill(!0);
            let start = cpu_ns();
            (k.guarded)(&relative, black_box(&points), &mut keep);
            times[1].push(cpu_ns() - start);
        }
    }
    for (k, times) in kernels().iter().zip(&mut times) {
        let [plane, guarded] = times.each_mut().map(|t| quartiles(t).map(|ns| ns / scene.len() as f64));
        println!("{:<8} kernel alone, ns/tri: plane {plane:.3?}, difference with guard {guarded:.3?}", k.name);
    }
}

/// Tests of triangles filter; those of nodes judge the list's clusters, for comparison.
fn judge(name: &str, test: &mut dyn Test, view: &View, h: &Hierarchy, out: &mut DrawList, tally: &mut Tally) {
    out.clear();
    test.begin(view, h);
    if !name.starts_with("normal") {
        out.push(0, h.entries.len() as u32);
        test.filter(h, out, tally);
        return;
    }
    let mut outside = vec![0; h.links.len()];
    if test.initial_carry() != 0 {
        test.judge_flat(h, &mut outside, tally);
    }
    for (links, outside) in h.links.iter().zip(&outside) {
        (0..8).filter(|l| links.live & !outside >> l & 1 == 1).for_each(|l| out.push(links.first[l], links.end[l]));
    }
}

fn naive(corners: &[[DVec3; 3]], eye: DVec3, out: &mut DrawList) -> u64 {
    out.clear();
    for (i, [a, b, c]) in corners.iter().enumerate() {
        if (*b - *a).cross(*c - *a).dot(eye - *a) > 0.0 {
            out.push(i as u32, i as u32 + 1);
        }
    }
    out.entry_count()
}

/// Triangles of about a metre in a cube of 200 m.
fn soup(count: usize) -> Scene {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut unit = move || (rng.next_u64() >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
    let mut vector = move |by: f64| DVec3::new(unit(), unit(), unit()) * by;
    let mut scene = Scene { name: "soup".into(), material_names: vec!["a".into()], ..Default::default() };
    for t in 0..count as u32 {
        let centre = vector(100.0);
        scene.positions.extend([0; 3].map(|_| centre + vector(0.5)));
        scene.triangles.push([3 * t, 3 * t + 1, 3 * t + 2]);
    }
    scene.source_triangle_id = (0..count as u32).collect();
    (scene.object_id, scene.material_id) = (vec![0; count], vec![0; count]);
    (scene.two_sided, scene.occluder) = (vec![false; count], vec![true; count]);
    scene.source_triangle_count = count as u32;
    scene.anchor();
    scene
}

/// Time that this thread computed, which leaves out what others took of the core.
fn cpu_ns() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the clock exists and the pointer is to a timespec of our own.
    let rc = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
    assert_eq!(rc, 0);
    t.tv_sec as f64 * 1e9 + t.tv_nsec as f64
}

fn quartiles(values: &mut [f64]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|q| values[(values.len() - 1) * q / 4])
}
