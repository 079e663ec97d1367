//! The depth buffer: `cargo bench --no-default-features --bench raster [-- triangles | queries | city | threads]`,
//! CPU time of one thread (`threads`: wall time of one and two), medians, 1920 x 1080.
//!
//! `triangles`: rates at 10, 100, 1,000 and 10,000 px a triangle, in random order and front
//! to back, with all that is done from fixed-point vertices on. `queries`: squares, hidden and
//! visible ones. `city`: the three frames of `city_1m` (where `$CULLMARK_SCENES` names it),
//! all of it as occluders, nearest objects first, and which of the objects that a plain
//! z-buffer of the same samples hides are found hidden. `export=DIR` writes the same
//! work for other programs: see `export`. `kernel=NAME` and `repeats=N` choose.

use cullmark::math::{Box32, Camera, DVec3, Pose, View};
use cullmark::raster::plain::Plain;
use cullmark::raster::project::{Place, Rect, Screen};
use cullmark::raster::{Coverage, DepthBuffer, Kernel, Kind, Occluders, Settings};
use cullmark::record::{PathSource, PathSpec, SceneSource, Up, Winding};
use cullmark::scene::{Scene, load, walkthrough};
use cullmark::stats::median;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::path::{Path, PathBuf};
use std::time::Instant;

const SETTINGS: Settings = Settings { width_px: 1920, height_px: 1080, coverage: Coverage::Samples };
const SIZES: [(f64, usize); 4] = [(10.0, 1_000_000), (100.0, 400_000), (1_000.0, 100_000), (10_000.0, 100_000)];

struct Wanted {
    parts: Vec<String>,
    kernels: Vec<Kernel>,
    repeats: usize,
    export: Option<PathBuf>,
}

fn main() -> cullmark::Result<()> {
    let mut wanted = Wanted { parts: vec![], kernels: vec![], repeats: 7, export: None };
    for a in std::env::args().skip(1).filter(|a| !a.starts_with('-')) {
        match a.split_once('=') {
            Some(("kernel", name)) => {
                let named = |k: &Kernel| format!("{k:?}").to_lowercase() == name;
                wanted.kernels.extend(Kernel::ALL.into_iter().filter(named));
            }
            Some(("repeats", n)) => wanted.repeats = n.parse().expect("a number"),
            Some(("export", folder)) => wanted.export = Some(folder.into()),
            _ => wanted.parts.push(a),
        }
    }
    if wanted.kernels.is_empty() {
        wanted.kernels.extend(Kernel::ALL.into_iter().filter(|k| k.present() && *k != Kernel::Scalar));
    }
    let asked = |part: &str| wanted.parts.is_empty() || wanted.parts.iter().any(|p| p == part);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    one.install(|| -> cullmark::Result<()> {
        if asked("triangles") {
            triangles(&wanted);
        }
        if asked("queries") {
            queries(&wanted);
        }
        Ok(())
    })?;
    let Some(city) = City::read()? else { return Ok(()) };
    if asked("city") {
        one.install(|| city.measure(&wanted));
    }
    if asked("threads") {
        city.threads(&wanted);
    }
    Ok(())
}

fn view() -> View {
    View::new(&Camera::default(), &Pose { eye: DVec3::ZERO, forward: DVec3::Y, up: DVec3::Z })
}

fn random(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Triangles of so many pixels all over the image, 10 to 1,000 m away, a little tilted.
fn spread(area_px: f64, count: usize) -> Vec<[DVec3; 3]> {
    let mut rng = ChaCha8Rng::seed_from_u64(area_px as u64);
    let view = view();
    let at = |x: f64, y: f64, depth: f64| {
        let (x, y) = ((x / 960.0 - 1.0) * view.half_width, (1.0 - y / 540.0) * view.half_height);
        (view.forward + view.right * x + view.up * y) * depth
    };
    let radius = (area_px / 1.299_038_1).sqrt();
    let one = |_| {
        let (x, y, turn) = (random(&mut rng) * 1920.0, random(&mut rng) * 1080.0, random(&mut rng) * 2.1);
        let depth = 10.0 + 990.0 * random(&mut rng);
        let corner = |k: f64, tilt: f64| {
            let (s, c) = libm::sincos(turn + k * 2.094_395_1);
            at(x + radius * c, y - radius * s, depth * (1.0 + 0.01 * tilt))
        };
        [corner(0.0, random(&mut rng)), corner(1.0, random(&mut rng)), corner(2.0, random(&mut rng))]
    };
    (0..count).map(one).collect()
}

fn whole(triangles: &[[DVec3; 3]]) -> Occluders {
    Occluders::new(triangles.len() as u32, DVec3::ZERO, |p| triangles[p as usize], |_| Kind::OneSided, &[])
}

fn triangles(wanted: &Wanted) {
    println!("{:>7} {:>9} {:>14} {:>8} {:>9}", "px", "triangles", "order", "kernel", "Mtri/s");
    for (area_px, count) in SIZES {
        let mut soup = spread(area_px, count);
        for order in ["random", "front to back"] {
            if order != "random" {
                soup.sort_by(|a, b| a[0].y.total_cmp(&b[0].y));
            }
            if let Some(folder) = &wanted.export {
                let name = format!("soup_{area_px}_{}", if order == "random" { "random" } else { "f2b" });
                let corners: Vec<DVec3> = soup.iter().flatten().copied().collect();
                let indices: Vec<u32> = (0..corners.len() as u32).collect();
                export::mesh(folder, &name, &Screen::new(&view(), DVec3::ZERO, SETTINGS), &corners, &indices, None);
            }
            let occluders = whole(&soup);
            for kernel in &wanted.kernels {
                let mut buffer = DepthBuffer::with_kernel(SETTINGS, *kernel);
                let times = (0..wanted.repeats).map(|_| {
                    buffer.begin(&view(), DVec3::ZERO);
                    cpu_s(|| buffer.draw(&occluders, 0, count as u32))
                });
                let rate = count as f64 / median(&times.collect::<Vec<_>>()) * 1e-6;
                println!("{area_px:>7} {count:>9} {order:>14} {:>8} {rate:>9.2}", format!("{kernel:?}"));
            }
        }
    }
}

fn queries(wanted: &Wanted) {
    println!("{:>7} {:>8} {:>12} {:>12} {:>12}", "px", "kernel", "hidden, ns", "visible, ns", "boxes, ns");
    let soup = spread(10_000.0, 20_000);
    let occluders = whole(&soup);
    for side in [4u32, 8, 16, 32, 50, 100, 250, 500] {
        let mut rng = ChaCha8Rng::seed_from_u64(u64::from(side));
        let squares: Vec<Rect> = (0..4096)
            .map(|_| {
                let x0 = rng.next_u32() % (1920 - side);
                let y0 = rng.next_u32() % (1080 - side);
                Rect { x0, x1: x0 + side, y0, y1: y0 + side }
            })
            .collect();
        // A cube of this size on the image, at 2,000 m.
        let boxes: Vec<Box32> = squares
            .iter()
            .map(|r| {
                let m = 2000.0 * 2.0 * libm::tan(30f64.to_radians()) / 1080.0;
                let at = |x: f64, y: f64| [(x - 960.0) * m, (540.0 - y) * m];
                let [x0, z1] = at(f64::from(r.x0), f64::from(r.y0));
                let [x1, z0] = at(f64::from(r.x1), f64::from(r.y1));
                Box32 { lo: DVec3::new(x0, 2000.0, z0).as_vec3(), hi: DVec3::new(x1, 2001.0, z1).as_vec3() }
            })
            .collect();
        for kernel in &wanted.kernels {
            let mut buffer = DepthBuffer::with_kernel(SETTINGS, *kernel);
            buffer.begin(&view(), DVec3::ZERO);
            buffer.draw(&occluders, 0, occluders.len() as u32);
            buffer.flush();
            let rounds = (2000 / side).max(4);
            let mut time = |f: &mut dyn FnMut(&mut DepthBuffer) -> usize| {
                let times = (0..wanted.repeats)
                    .map(|_| cpu_s(|| std::hint::black_box((0..rounds).map(|_| f(&mut buffer)).sum::<usize>())));
                median(&times.collect::<Vec<_>>()) / f64::from(rounds * 4096) * 1e9
            };
            let hidden = time(&mut |b| squares.iter().filter(|r| b.shows_rect(**r, 1e-4)).count());
            let visible = time(&mut |b| squares.iter().filter(|r| b.shows_rect(**r, 1.0)).count());
            let boxes = time(&mut |b| boxes.iter().filter(|r| b.shows(r)).count());
            println!("{side:>7} {:>8} {hidden:>12.1} {visible:>12.1} {boxes:>12.1}", format!("{kernel:?}"));
        }
    }
}

/// The city, its triangles by object.
struct City {
    scene: Scene,
    poses: Vec<Pose>,
    order: Vec<u32>,
    /// First position and box of each object; the end of all.
    starts: Vec<u32>,
    boxes: Vec<Box32>,
    occluders: Occluders,
}

impl City {
    fn read() -> cullmark::Result<Option<City>> {
        let Some(folder) = std::env::var_os("CULLMARK_SCENES").map(PathBuf::from) else { return Ok(None) };
        let folder = folder.join("city_1m");
        let source = SceneSource::File(folder.join("city_1m.glb"));
        let spec = load::describe("city_1m", source, Winding::Ccw, Some(Up::Y), 1.0, false)?;
        let scene = load::load(&spec)?;
        let source = PathSource::File(folder.join("city_1m_path1.csv"));
        let fingerprint = walkthrough::fingerprint(&source, &spec.fingerprint)?;
        let path = PathSpec { name: "1".into(), source, frames: None, stride: 1, fingerprint };
        let poses = walkthrough::load(&path, &spec, &scene)?;
        let mut order: Vec<u32> = (0..scene.len() as u32).collect();
        let objects = connected(&scene);
        order.sort_by_key(|t| objects[*t as usize]);
        let (mut starts, mut boxes): (Vec<u32>, Vec<Box32>) = (Vec::new(), Vec::new());
        for (p, t) in order.iter().enumerate() {
            if p == 0 || objects[*t as usize] != objects[order[p - 1] as usize] {
                starts.push(p as u32);
                boxes.push(Box32::EMPTY);
            }
            let b = boxes.last_mut().expect("just pushed");
            *b = b.union(scene.triangle_box(*t));
        }
        starts.push(scene.len() as u32);
        let corners = |p: u32| scene.corners(order[p as usize]);
        let occluders = Occluders::new(scene.len() as u32, scene.origin, corners, |_| Kind::OneSided, &starts);
        println!("{} triangles, {} objects, {} B of occluders", scene.len(), boxes.len(), occluders.bytes());
        Ok(Some(City { scene, poses, order, starts, boxes, occluders }))
    }

    fn view(&self, frame: usize) -> View {
        View::new(&Camera::default(), &self.poses[frame])
    }

    /// Objects, the nearest first.
    fn nearest_first(&self, view: &View) -> Vec<usize> {
        let eye = (view.eye - self.scene.origin).as_vec3();
        let near = |b: &Box32| (b.lo - eye).max(eye - b.hi).max(glam::Vec3::ZERO).length_squared();
        let mut objects: Vec<usize> = (0..self.boxes.len()).collect();
        objects.sort_by(|a, b| near(&self.boxes[*a]).total_cmp(&near(&self.boxes[*b])));
        objects
    }

    fn draw(&self, buffer: &mut DepthBuffer, view: &View, objects: &[usize]) {
        buffer.begin(view, self.scene.origin);
        for o in objects {
            buffer.draw(&self.occluders, self.starts[*o], self.starts[*o + 1]);
        }
        buffer.flush();
    }

    fn measure(&self, wanted: &Wanted) {
        println!(
            "{:>6} {:>8} {:>8} {:>8} {:>22} {:>6}",
            "frame", "kernel", "one call", "by object", "objects culled", "false"
        );
        for frame in 0..self.poses.len() {
            let view = self.view(frame);
            let objects = self.nearest_first(&view);
            let screen = Screen::new(&view, self.scene.origin, SETTINGS);
            let mut plain = Plain::new(SETTINGS);
            for t in 0..self.scene.len() as u32 {
                plain.triangle(&screen, self.scene.corners(t).map(|c| c - self.scene.origin), false);
            }
            let places: Vec<Place> = self.boxes.iter().map(|b| screen.place(b)).collect();
            let exact: Vec<bool> =
                places.iter().map(|p| matches!(p, Place::Rect(r, nearness) if !plain.shows(*r, *nearness))).collect();
            if let Some(folder) = &wanted.export {
                let indices: Vec<u32> = objects
                    .iter()
                    .flat_map(|o| &self.order[self.starts[*o] as usize..self.starts[*o + 1] as usize])
                    .flat_map(|t| self.scene.triangles[*t as usize])
                    .collect();
                let vertices: Vec<DVec3> = self.scene.positions.iter().map(|p| *p - self.scene.origin).collect();
                let judged = Some((&places[..], &exact[..]));
                export::mesh(folder, &format!("city_{frame}"), &screen, &vertices, &indices, judged);
            }
            let sorted: Vec<u32> = objects
                .iter()
                .flat_map(|o| &self.order[self.starts[*o] as usize..self.starts[*o + 1] as usize])
                .copied()
                .collect();
            let corners = |p: u32| self.scene.corners(sorted[p as usize]);
            let whole = Occluders::new(sorted.len() as u32, self.scene.origin, corners, |_| Kind::OneSided, &[]);
            for kernel in &wanted.kernels {
                let mut buffer = DepthBuffer::with_kernel(SETTINGS, *kernel);
                let turn = |_| {
                    buffer.begin(&view, self.scene.origin);
                    let once = cpu_s(|| buffer.draw(&whole, 0, whole.len() as u32));
                    (once, cpu_s(|| self.draw(&mut buffer, &view, &objects)))
                };
                let (once, times): (Vec<f64>, Vec<f64>) = (0..wanted.repeats).map(turn).unzip();
                let culled: Vec<bool> = places
                    .iter()
                    .map(|p| matches!(p, Place::Rect(r, nearness) if !buffer.shows_rect(*r, *nearness)))
                    .collect();
                let found = culled.iter().zip(&exact).filter(|(a, b)| **a && **b).count();
                let wrong = culled.iter().zip(&exact).filter(|(a, b)| **a && !**b).count();
                let all = exact.iter().filter(|e| **e).count();
                let share = format!("{found} of {all}, {:.1} %", found as f64 / all as f64 * 100.0);
                let (name, once, ms) = (format!("{kernel:?}"), median(&once) * 1e3, median(&times) * 1e3);
                println!("{frame:>6} {name:>8} {once:>8.2} {ms:>9.2} {share:>22} {wrong:>6}");
            }
        }
    }

    /// Wall time of a frame on one and two threads, in turns, and CPU time of both together.
    fn threads(&self, wanted: &Wanted) {
        println!("{:>6} {:>8} {:>8} {:>8} {:>7} {:>12}", "frame", "kernel", "1, ms", "2, ms", "times", "CPU of 2, ms");
        let pinned = |n| rayon::ThreadPoolBuilder::new().num_threads(n).start_handler(pin).build().expect("a pool");
        let pools = [1, 2].map(pinned);
        for frame in 0..self.poses.len() {
            let view = self.view(frame);
            let objects = self.nearest_first(&view);
            for kernel in &wanted.kernels {
                let mut buffer = DepthBuffer::with_kernel(SETTINGS, *kernel);
                let mut times = [const { Vec::new() }; 2];
                let mut cpu = [const { Vec::new() }; 2];
                for _ in 0..3 * wanted.repeats {
                    for ((pool, times), cpu) in pools.iter().zip(&mut times).zip(&mut cpu) {
                        let (start, all) = (Instant::now(), clock_s(libc::CLOCK_PROCESS_CPUTIME_ID));
                        pool.install(|| self.draw(&mut buffer, &view, &objects));
                        times.push(start.elapsed().as_secs_f64() * 1e3);
                        cpu.push((clock_s(libc::CLOCK_PROCESS_CPUTIME_ID) - all) * 1e3);
                    }
                }
                // Others use this machine, too: the quickest turns are those of two free cores.
                let least = |t: Vec<f64>| t.into_iter().fold(f64::INFINITY, f64::min);
                let ([one, two], [_, both]) = (times.map(least), cpu.map(least));
                let name = format!("{kernel:?}");
                println!("{frame:>6} {name:>8} {one:>8.2} {two:>8.2} {:>7.2} {both:>12.2}", one / two);
            }
        }
    }
}

/// The file holds one mesh: what hangs together by vertices is an object, called by its first vertex.
fn connected(scene: &Scene) -> Vec<u32> {
    let mut above: Vec<u32> = (0..scene.positions.len() as u32).collect();
    fn top(above: &mut [u32], mut v: u32) -> u32 {
        while above[v as usize] != v {
            above[v as usize] = above[above[v as usize] as usize];
            v = above[v as usize];
        }
        v
    }
    for [a, b, c] in &scene.triangles {
        let tops = [*a, *b, *c].map(|v| top(&mut above, v));
        let first = tops[0].min(tops[1]).min(tops[2]);
        tops.iter().for_each(|t| above[*t as usize] = first);
    }
    scene.triangles.iter().map(|t| top(&mut above, t[0])).collect()
}

/// Keeps a thread on a core of its own.
fn pin(thread: usize) {
    // SAFETY: a set of cores is plain data, and ours.
    unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(thread, &mut set);
        libc::sched_setaffinity(0, size_of_val(&set), &set);
    }
}

/// Seconds of this thread's CPU time.
fn cpu_s<R>(f: impl FnOnce() -> R) -> f64 {
    let start = clock_s(libc::CLOCK_THREAD_CPUTIME_ID);
    std::hint::black_box(f());
    clock_s(libc::CLOCK_THREAD_CPUTIME_ID) - start
}

fn clock_s(clock: libc::clockid_t) -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the clock exists and `t` is ours to write.
    unsafe { libc::clock_gettime(clock, &mut t) };
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

/// The same work for other programs, little-endian: u32 counts of vertices, triangles and
/// rectangles; vertices as f32 x, y, z, w of clip space (z = w - near); three u32 a triangle;
/// rectangles as f32 x0, y0, x1, y1 in -1..1 (y up), f32 least w, u32 whether a plain
/// z-buffer hides it.
mod export {
    use super::*;

    pub fn mesh(
        folder: &Path,
        name: &str,
        s: &Screen,
        vertices: &[DVec3],
        indices: &[u32],
        places: Option<(&[Place], &[bool])>,
    ) {
        let mut rects: Vec<[[u8; 4]; 6]> = Vec::new();
        for (place, exact) in places.into_iter().flat_map(|(p, e)| p.iter().zip(e)) {
            let Place::Rect(r, nearness) = place else { continue };
            let x = |x: u32| ((f64::from(x) / (s.width_px * 0.5) - 1.0) as f32).to_le_bytes();
            let y = |y: u32| ((1.0 - f64::from(y) / (s.height_px * 0.5)) as f32).to_le_bytes();
            let w = (1.0 / nearness).to_le_bytes();
            rects.push([x(r.x0), y(r.y1), x(r.x1), y(r.y0), w, u32::from(*exact).to_le_bytes()]);
        }
        let counts = [vertices.len(), indices.len() / 3, rects.len()].map(|n| (n as u32).to_le_bytes());
        let clip = |c: &DVec3| {
            let c = s.camera(*c);
            let [x, y] = [c.x / (s.width_px * 0.5), -c.y / (s.height_px * 0.5)];
            [x, y, c.z - s.near_m, c.z].map(|v| (v as f32).to_le_bytes()).concat()
        };
        let mut out = counts.concat();
        out.extend(vertices.iter().flat_map(clip));
        out.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
        out.extend(rects.concat().concat());
        std::fs::create_dir_all(folder).expect("a folder");
        std::fs::write(folder.join(format!("{name}.bin")), out).expect("a file");
    }
}
