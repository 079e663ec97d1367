//! What is said of the walk by frusta: D7.2 to D7.5.

use super::build::Rng;
use super::portals::{build, cameras, facing, poses, scene};
use super::walks::triangles;
use crate::common::soup;
use crate::structures::scene_of;
use cullmark::culling::{DrawList, Tally, Test, Walk, cull, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, DVec3, View};
use cullmark::oracle::clipping;
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::Scene;

/// The walk with tests over a hierarchy, prepared.
pub struct Fast<'a> {
    hierarchy: &'a Hierarchy,
    tests: Vec<Box<dyn Test>>,
    walk: Box<dyn Walk>,
}

impl<'a> Fast<'a> {
    pub fn new(scene: &Scene, hierarchy: &'a Hierarchy, culling: &str, walk: &str) -> Fast<'a> {
        let mut tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
        tests.iter_mut().for_each(|t| {
            t.prepare(scene, hierarchy);
        });
        let mut walk = make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
        walk.prepare(scene, hierarchy);
        Fast { hierarchy, tests, walk }
    }

    pub fn frame(&mut self, view: &View) -> (DrawList, Tally) {
        let (mut out, mut tally) = (DrawList::default(), Tally::default());
        cull(view, self.hierarchy, &mut self.tests, self.walk.as_mut(), &mut out, &mut tally);
        (out, tally)
    }

    pub fn triangles(&mut self, view: &View) -> Vec<bool> {
        let (out, _) = self.frame(view);
        assert!(out.compacted && out.ranges.windows(2).all(|w| w[0].1 < w[1].0), "merged and ascending");
        triangles(self.hierarchy, &out)
    }
}

fn count(set: &[bool]) -> usize {
    set.iter().filter(|s| **s).count()
}

fn is_part(part: &[bool], of: &[bool]) -> bool {
    part.iter().zip(of).all(|(p, o)| !p || *o)
}

// D7.2, and that every option that should spare triangles does.
#[test]
fn refinement_never_adds_a_triangle() {
    let scenes =
        [scene("rooms"), scene("arena:triangles=14000"), soup(51, 1500, 10.0, 3.0), scene("spheres:spheres=9,level=3")];
    for scene in scenes {
        for (i, pose) in poses("random:frames=4,aim=any", &scene).iter().enumerate() {
            let view = View::new(&cameras(12.0)[i % 3], pose);
            let h = build(["octree", "bsp"][i % 2], &scene);
            for options in ["depth=clipped", "depth=plane,grow=16"] {
                let mut last = vec![true; scene.len()];
                for level in 0..9 {
                    let walk = format!("fast_v:g={},{options}", 1 << level);
                    let now = Fast::new(&scene, &h, "frustum", &walk).triangles(&view);
                    assert!(is_part(&now, &last), "{} {walk} after half of that", scene.name);
                    last = now;
                }
            }
            let set = |walk: &str| Fast::new(&scene, &h, "frustum", walk).triangles(&view);
            let fine = set("fast_v:g=256");
            let mut last = fine.clone();
            for limit in [1, 8, 64, 512] {
                let now = set(&format!("fast_v:g=256,subdivision=adaptive,limit={limit}"));
                assert!(is_part(&last, &now), "{}: a smaller limit divides more", scene.name);
                last = now;
            }
            assert!(is_part(&fine, &set("fast_v:g=256,depth=plane")), "clipped depth is the better one");
            assert!(is_part(&fine, &set("fast_v:g=256,grow=1")), "growing adds blockers");
            let alone = Fast::new(&scene, &h, "none", "fast_v:g=256").triangles(&view);
            assert!(is_part(&fine, &alone) && count(&alone) - count(&fine) <= 2, "it culls by the view itself");
        }
    }
}

/// A wall of n x n squares across the view at x = 4, and a carpet of small triangles at 8,
/// each square from `corner`; the wall's triangles come first.
fn wall(n: i32, mut corner: impl FnMut(i32, i32, usize) -> [f64; 2]) -> (Scene, usize) {
    let mut out = Vec::new();
    for k in 0..n * n {
        let [a, b, c, d] = [0, 1, 2, 3].map(|c| {
            let [y, z] = corner(k % n, k / n, c);
            DVec3::new(4.0, y * 16.0 / f64::from(n) - 8.0, z * 16.0 / f64::from(n) - 8.0)
        });
        out.extend([[a, c, b], [a, d, c]]);
    }
    let wall = out.len();
    for k in 0..40 * 40 {
        let at = DVec3::new(8.0, f64::from(k % 40) * 0.25 - 5.0, f64::from(k / 40) * 0.25 - 5.0);
        out.push([at, at + DVec3::Z * 0.2, at + DVec3::Y * 0.2]);
    }
    (scene_of("wall", &out), wall)
}

const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

// D7.4
#[test]
fn a_wall_of_loose_squares_leaks_at_every_g_and_the_same_wall_welded_does_not() {
    let plain = |i: i32, j: i32, c: usize| [f64::from(i) + CORNERS[c][0], f64::from(j) + CORNERS[c][1]];
    let mut rng = Rng::new(4);
    // Squares a little too large overlap, so that nothing can be seen between them; and
    // courses of bricks, whose corners are on their neighbours' edges.
    let loose = |i: i32, j: i32, c: usize| {
        let more = 1e-9 * rng.range(0.5, 1.0);
        let (at, side) = (plain(i, j, c), CORNERS[c]);
        [0, 1].map(|k| at[k] + (2.0 * side[k] - 1.0) * more)
    };
    let bricks = |i: i32, j: i32, c: usize| {
        let [y, z] = plain(i, j, c);
        [y + f64::from(j % 2) * 0.5, z]
    };
    let view = View::new(&Camera::default(), &facing(DVec3::new(0.0, 0.1171875, 0.2265625), DVec3::X));
    // From there every seam passes over triangles of the carpet, none between them.
    for (what, (scene, wall), leaks) in
        [("welded", wall(32, plain), false), ("loose", wall(32, loose), true), ("bricks", wall(32, bricks), true)]
    {
        let exact = clipping::visible(&scene, &view).unwrap();
        assert_eq!(exact.iter().filter(|t| *t as usize >= wall).count(), 0, "nothing behind the {what} wall is seen");
        let h = build("octree", &scene);
        let behind = |walk: &str| count(&Fast::new(&scene, &h, "frustum", walk).triangles(&view)[wall..]);
        let by_g: Vec<usize> = (0..=12).map(|level| behind(&format!("fast_v:g={}", 1 << level))).collect();
        eprintln!("{what}: behind the wall at g = 1, 2, 4 ... 4096: {by_g:?}");
        if leaks {
            assert!(by_g.iter().all(|n| *n > 0), "{what} leaks at every g: {by_g:?}");
        } else {
            // More of its triangles are in view than a blocker may have; of a quarter of the
            // view that is not so.
            assert!(by_g[0] > 0 && by_g[1..].iter().all(|n| *n == 0), "{what}: {by_g:?}");
            assert_eq!(behind("fast_v:g=1,grow=2048"), 0);
            assert!(behind("fast_v:g=4096,grow=1") > 0, "single triangles leak along every edge");
        }
    }
}

// D7.3
#[test]
fn on_connected_surfaces_it_comes_near_the_visible_set() {
    for (name, within) in [("spheres:spheres=60,level=2,size_m=16,radius_m=40", 1.1), ("rooms:triangles=5500", 1.25)] {
        let mut scene = scene(name);
        if scene.len() > clipping::MOST_TRIANGLES {
            // Without the last things that stand in the rooms.
            let keep: Vec<u32> = (0..clipping::MOST_TRIANGLES as u32).collect();
            scene = scene.part(&keep);
        }
        let h = build("octree:depth=6,leaf_limit=16", &scene);
        let views: Vec<View> =
            poses("random:frames=5,aim=any", &scene).iter().map(|p| View::new(&Camera::default(), p)).collect();
        let exact: Vec<_> = views.iter().map(|v| clipping::visible(&scene, v).unwrap()).collect();
        let total: u64 = exact.iter().map(|e| e.count()).sum();
        let mut ratios = Vec::new();
        for level in (0..=12).step_by(2) {
            let mut fast = Fast::new(&scene, &h, "frustum", &format!("fast_v:g={}", 1 << level));
            let mut submitted = 0;
            for (view, exact) in views.iter().zip(&exact) {
                let got = fast.triangles(view);
                assert!(exact.iter().all(|t| got[t as usize]), "{name}: V* is part of it");
                submitted += count(&got);
            }
            ratios.push(submitted as f64 / total as f64);
        }
        eprintln!("{name}: {total} visible; submitted over visible at g = 1, 4, 16 ... 4096: {ratios:.3?}");
        assert!(*ratios.last().unwrap() <= within, "{name}: {ratios:?}");
    }
}

// D7.5
#[test]
fn threads_change_neither_the_set_nor_the_work() {
    for (name, walk) in [
        ("arena:triangles=14000", "fast_v:g=128"),
        ("rooms", "fast_v:g=256,subdivision=adaptive,limit=4"),
        ("spheres:spheres=30,level=3", "fast_v:g=512"),
    ] {
        let scene = scene(name);
        let h = build("octree", &scene);
        let views: Vec<View> =
            poses("random:frames=3,aim=any", &scene).iter().map(|p| View::new(&Camera::default(), p)).collect();
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut fast = Fast::new(&scene, &h, "frustum", walk);
                // Twice, as what is kept from frame to frame must not matter.
                let all: Vec<_> = views.iter().chain(&views).map(|v| fast.frame(v)).collect();
                let (first, second) = all.split_at(views.len());
                assert!(first == second, "{name}: the second pass is the first");
                all
            })
        };
        let one = run(1);
        assert!(one.iter().any(|(_, t)| t.blockers > 0));
        for threads in [2, 3] {
            assert!(run(threads) == one, "{name} with {threads} threads");
        }
    }
}

#[test]
fn what_it_is_given_is_checked() {
    let wrong = |spec: &str| format!("{:?}", make_walk(&Spec::parse(spec).unwrap()).err().unwrap());
    assert!(wrong("fast_v:g=48").contains("take 32 or 64"), "{}", wrong("fast_v:g=48"));
    assert!(wrong("fast_v:limit=3").contains("no effect"), "{}", wrong("fast_v:limit=3"));
    assert!(make_walk(&Spec::parse("fast_v:g=32,subdivision=adaptive,limit=3").unwrap()).is_ok());
}
