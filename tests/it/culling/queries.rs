//! Walks with occlusion queries before the oracle at their own samples, on every
//! structure; the virtual clock; the switch `auto`.

use super::build::camera;
use super::portals::{build, cameras, facing, scene};
use super::walks::triangles;
use crate::common::soup;
use crate::structures::{scene_of, scenes};
use cullmark::culling::{Class, DrawList, Tally, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, DVec3, Pose};
use cullmark::oracle::{Truth, truth};
use cullmark::record::Accuracy;
use cullmark::registry::{Spec, parse_sum};
use cullmark::runner::{FrameWork, Setup};
use cullmark::scene::Scene;
use cullmark::structure::{self, Structure};

pub struct Built(pub Hierarchy);

impl Structure for Built {
    fn build(&self, _: &Scene) -> cullmark::Result<Hierarchy> {
        Ok(self.0.clone())
    }
}

/// Walks at the samples of [`ACCURACY`], without and with all that changes their order.
pub const WALKS: [&str; 6] = [
    "nested_query",
    "nested_query:occluder_px=8,coverage=inner,auto=true,sorted=true",
    "chc",
    "chc:coverage=inner,n_av=3",
    "chc:backend=latency,latency_us=20,occluder_px=3",
    "chc:backend=latency,latency_us=1000,stall=draw,auto=true,n_av=2,still=true",
];

pub const ACCURACY: Accuracy =
    Accuracy { frames: 100, width_px: 96, height_px: 54, samples: 1, witness_rays: 0, hiding_cells: 0 };

/// The same walk with a buffer of [`ACCURACY`]'s samples.
pub fn small(walk: &str) -> String {
    let sep = if walk.contains(':') { ',' } else { ':' };
    format!("{walk}{sep}width_px={},height_px={}", ACCURACY.width_px, ACCURACY.height_px)
}

pub fn setup(scene: &Scene, h: &Hierarchy, camera: &Camera, poses: &[Pose], culling: &str, walk: &str) -> Setup {
    let tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
    let walk = make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
    Setup::from_parts(scene.clone(), poses.to_vec(), camera, &Built(h.clone()), tests, walk).unwrap()
}

/// What a pass submits and what that costs.
pub fn pass(setup: &mut Setup) -> (Vec<DrawList>, Vec<FrameWork>) {
    let mut lists = Vec::new();
    let work = setup.count_pass(|_, _, list| lists.push(list.clone()));
    (lists, work)
}

pub fn sum(work: &[FrameWork]) -> Tally {
    work.iter().map(|w| w.tally).sum()
}

/// A way through the middle of the scene, with a look around; straight through walls.
pub fn way(scene: &Scene, frames: u32, step: f64) -> Vec<Pose> {
    let b = scene.bounds();
    let pose = |i: u32| {
        let t = f64::from(i) * step;
        let at = DVec3::new(0.5 + 0.4 * libm::cos(0.31 * t), 0.5 + 0.4 * libm::sin(0.23 * t), 0.3);
        let forward = DVec3::new(libm::cos(t), libm::sin(t), 0.2 * libm::sin(2.0 * t));
        facing(b.lo + b.size() * at, forward)
    };
    (0..frames).map(pose).collect()
}

pub fn truth_of(scene: &Scene, camera: &Camera, poses: &[Pose]) -> Truth {
    let numbered: Vec<(u32, Pose)> = (0u32..).zip(poses.iter().copied()).collect();
    truth(scene, camera, &numbered, &ACCURACY)
}

/// No triangle that a sample sees is lost, and nothing is drawn twice.
pub fn nothing_seen_is_lost(
    scene: &Scene,
    h: &Hierarchy,
    (camera, poses, truth): (&Camera, &[Pose], &Truth),
    (culling, walk): (&str, &str),
) {
    let what = format!("{} {culling} {walk}", scene.name);
    let mut setup = setup(scene, h, camera, poses, culling, &small(walk));
    let inner = walk.contains("inner");
    assert_eq!(setup.class, if inner { Class::Conservative } else { Class::SampleConservative });
    assert_eq!(setup.walk.samples(), Some((ACCURACY.width_px, ACCURACY.height_px)));
    assert!(setup.removes.occluded && setup.removes.outside_frustum);
    let judgement = setup.judge(truth);
    assert_eq!(judgement.wrong, None, "{what}");
    assert!(judgement.frames.iter().all(|f| f.false_culls == 0), "{what}");
    let (lists, work) = pass(&mut setup);
    for list in &lists {
        let mut positions: Vec<u32> = list.positions().collect();
        positions.sort_unstable();
        assert!(positions.windows(2).all(|w| w[0] < w[1]), "{what}: a position is drawn twice");
    }
    let (again, work_again) = pass(&mut setup);
    assert_eq!(again, lists, "{what}: a pass repeats");
    assert!(work.iter().zip(&work_again).all(|(a, b)| a.tally == b.tally), "{what}: counted work repeats");
}

/// Some panes, some walls without a back.
pub fn with_panes(mut scene: Scene) -> Scene {
    for t in (0..scene.len()).step_by(11) {
        scene.two_sided[t] = t % 2 == 0;
        scene.occluder[t] = t % 3 != 0;
    }
    scene
}

fn structures() -> Vec<String> {
    let named = structure::ALL.iter().map(|e| e.name.to_string());
    let more =
        ["octree:policy=E,depth=5", "octree:policy=R", "octree:policy=S", "list:leaf_size=9", "bvh:layout=binary"];
    named.chain(more.map(String::from)).collect()
}

// D1.1
#[test]
fn nothing_that_the_same_samples_see_is_lost_on_any_structure() {
    let worlds = [scene("rooms"), scene("blocks:triangles=3000"), soup(141, 1500, 10.0, 1.5)];
    for (s, scene) in worlds.into_iter().map(with_panes).enumerate() {
        let poses = way(&scene, 8, 0.13);
        for (i, camera) in cameras(9.0).iter().enumerate() {
            let truth = truth_of(&scene, camera, &poses);
            for (j, structure) in structures().iter().enumerate() {
                let h = build(structure, &scene);
                for (k, walk) in WALKS.iter().chain(super::chc_pp::WALKS.iter()).enumerate() {
                    // Every structure with every walk, over the scenes with every camera.
                    if (s + i + j + k) % 3 == 0 {
                        let culling = ["frustum", "none", "frustum+normal_mask+back_face"][(i + 2 * j + k) % 3];
                        nothing_seen_is_lost(&scene, &h, (camera, &poses, &truth), (culling, walk));
                    }
                }
            }
        }
    }
}

#[test]
fn nothing_is_lost_of_degenerate_scenes() {
    for scene in scenes().iter().filter(|s| s.len() < 1000) {
        let b = if scene.is_empty() { soup(1, 3, 1.0, 1.0).bounds() } else { scene.bounds() };
        let reach = b.size().max_element().max(1.0);
        let around = [DVec3::ZERO, DVec3::new(0.7, -0.6, 0.5), DVec3::new(-0.9, 0.0, 0.0), DVec3::new(0.0, 0.0, 0.4)];
        let looking = |(i, at): (usize, &DVec3)| {
            let eye = b.centre() + *at * reach;
            facing(eye, if i == 0 { DVec3::X } else { b.centre() - eye })
        };
        let poses: Vec<Pose> = around.iter().enumerate().map(looking).flat_map(|p| [p, p]).collect();
        for structure in ["octree:policy=E", "list"] {
            let h = structure::make(&Spec::parse(structure).unwrap()).unwrap().0.build(scene).unwrap();
            for camera in cameras(reach) {
                let truth = truth_of(scene, &camera, &poses);
                for walk in WALKS.iter().chain(super::chc_pp::WALKS.iter()) {
                    nothing_seen_is_lost(scene, &h, (&camera, &poses, &truth), ("frustum", walk));
                }
            }
        }
    }
}

/// A wall across the view at x = 5, and behind it `n` small things, each a leaf of a list.
pub fn behind_a_wall(n: u32) -> Scene {
    let wall =
        [[0.0, -40.0, -40.0], [0.0, 40.0, -40.0], [0.0, 0.0, 80.0]].map(|p| DVec3::from_array(p) + DVec3::X * 5.0);
    // Its front faces the eye.
    let mut all = vec![[wall[0], wall[2], wall[1]]];
    all.extend((0..n).map(|i| {
        let at = DVec3::new(20.0 + f64::from(i % 7), f64::from(i % 13) - 6.0, f64::from(i % 5) - 2.0);
        [at, at + DVec3::Y * 0.3, at + DVec3::Z * 0.3]
    }));
    scene_of("behind a wall", &all)
}

pub fn ahead() -> Pose {
    facing(DVec3::ZERO, DVec3::X)
}

#[test]
fn what_a_wall_hides_is_not_drawn() {
    let scene = behind_a_wall(60);
    let h = build("list:leaf_size=1", &scene);
    for walk in ["nested_query", "chc", "chc_pp"] {
        for culling in ["none", "frustum"] {
            let mut setup = setup(&scene, &h, &camera(60.0, 1.5), &[ahead(); 20], culling, walk);
            let (lists, work) = pass(&mut setup);
            for (list, work) in lists.iter().zip(&work).skip(8) {
                assert_eq!(triangles(&h, list).iter().filter(|t| **t).count(), 1, "{walk} {culling}: the wall alone");
                assert_eq!((work.tally.entries_occluded, work.tally.nodes_occluded), (60, 60), "{walk} {culling}");
                assert_eq!(work.tally.occluders_drawn, 1);
            }
        }
    }
}

// D6.1
#[test]
fn asking_every_node_draws_least_and_in_many_calls() {
    for scene in [scene("rooms"), scene("blocks:triangles=6000")] {
        let h = build("nested_grid", &scene);
        let poses = way(&scene, 12, 0.05);
        let measured = |walk: &str| {
            let walk = if walk == "depth_first" { walk.to_string() } else { small(walk) };
            let (_, work) = pass(&mut setup(&scene, &h, &camera(60.0, 1.5), &poses, "frustum", &walk));
            let entries: u64 = work.iter().map(|w| w.entries).sum();
            let calls: u64 = work.iter().map(|w| w.draw_calls).sum();
            (entries, calls, sum(&work))
        };
        let (plain, plain_calls, _) = measured("depth_first");
        let (nested, calls, work) = measured("nested_query");
        let others = ["chc", "chc_pp", "chc:n_av=5"].map(measured);
        println!(
            "{}: {plain} in {plain_calls} calls, {nested} in {calls}, {:?}",
            scene.name,
            others.map(|o| (o.0, o.1))
        );
        assert!(nested < plain, "{nested} of {plain}");
        assert!(others.iter().all(|o| nested <= o.0), "fewest of all");
        let queries = others.map(|o| o.2.queries);
        assert!(work.queries > queries[2] && work.queries > queries[1], "{} {queries:?}", work.queries);
        assert!(calls * plain > plain_calls * nested, "more calls a triangle");
    }
}

#[test]
fn an_answer_at_once_is_no_stall_and_later_ones_are() {
    let scene = scene("rooms");
    let h = build("octree:depth=4", &scene);
    let poses = way(&scene, 12, 0.05);
    for walk in ["nested_query", "chc", "chc_pp"] {
        let run = |backend: &str| {
            let spec = small(&format!("{walk}:{backend}"));
            let mut setup = setup(&scene, &h, &Camera::default(), &poses, "frustum", &spec);
            let (lists, work) = pass(&mut setup);
            (lists, sum(&work))
        };
        let (lists, at_once) = run("backend=immediate");
        assert!(at_once.queries > 0 && at_once.stall_ns == 0 && at_once.virtual_ns > 0, "{walk}");
        let later = [0, 10, 100, 1000].map(|us| run(&format!("backend=latency,latency_us={us}")));
        for pair in later.windows(2) {
            assert!(pair[0].1.stall_ns < pair[1].1.stall_ns, "{walk}");
            assert!(pair[0].1.virtual_ns < pair[1].1.virtual_ns, "{walk}");
        }
        let mut queries = later.iter().map(|l| l.1.queries);
        if walk == "nested_query" {
            assert!(later.iter().all(|l| l.0 == lists), "the same answers");
            assert!(queries.all(|q| q == at_once.queries));
            assert!(later[3].1.stall_ns >= 1_000_000 * at_once.queries, "each is waited for");
        }
        let prints = later.iter().map(|l| l.1.virtual_ns / 1000).collect::<Vec<_>>();
        println!("{walk}: {} us at once, {prints:?} us after 0, 10, 100, 1000 us", at_once.virtual_ns / 1000);
    }
}

#[test]
fn queries_that_do_not_pay_rest_and_those_that_do_go_on() {
    // Nothing hides anything: a floor seen from above.
    let floor = scene_of("floor", &crate::structures::floor(24, |_, _| 0.0));
    let above = facing(floor.bounds().centre() + DVec3::Z * 30.0, DVec3::new(0.01, 0.0, -1.0));
    // A wall hides all but itself.
    let wall = behind_a_wall(3000);
    for walk in ["nested_query", "chc", "chc_pp"] {
        let of = |scene: &Scene, pose: Pose, culling: &str| {
            let h = build("octree:depth=4", scene);
            let spec = small(&format!("{walk}:auto=true"));
            let mut setup = setup(scene, &h, &Camera::default(), &[pose; 80], culling, &spec);
            assert!(setup.walk.remembers());
            let first = pass(&mut setup);
            assert_eq!(first.0, pass(&mut setup).0, "a pass repeats");
            let plain = pass(&mut self::setup(scene, &h, &Camera::default(), &[pose], culling, "depth_first")).0;
            (first, plain)
        };
        let ((lists, work), plain) = of(&floor, above, "frustum");
        let off: Vec<u64> = work.iter().map(|w| w.tally.frames_off).collect();
        // Tried until every leaf was asked about, then off four times as long as that takes.
        let n_av = if walk == "chc_pp" { 5 } else { 1 };
        let expected = |n: usize| u64::from(n % (5 * n_av + 2) > n_av + 1);
        assert_eq!(off, (0..80).map(expected).collect::<Vec<_>>(), "{walk}");
        let resting = work.iter().zip(&lists).filter(|(w, _)| w.tally.frames_off == 1);
        for (w, list) in resting {
            assert_eq!(list, &plain[0], "{walk}: as `depth_first`");
            assert_eq!((w.tally.queries, w.tally.occluders_drawn, w.tally.stall_ns), (0, 0, 0));
            assert!(w.tally.virtual_ns > 0);
        }
        let ((_, work), _) = of(&wall, ahead(), "frustum");
        assert_eq!(sum(&work).frames_off, 0, "{walk}");
    }
}

#[test]
fn a_sorted_list_holds_the_same_in_fewer_calls() {
    let scene = scene("rooms");
    let h = build("octree:depth=4", &scene);
    let poses = way(&scene, 8, 0.1);
    for walk in ["nested_query", "chc", "chc_pp"] {
        let run = |walk: &str| pass(&mut setup(&scene, &h, &Camera::default(), &poses, "frustum", &small(walk)));
        let ((lists, work), (sorted, cheaper)) = (run(walk), run(&format!("{walk}:sorted=true")));
        for (n, (list, sorted)) in lists.iter().zip(&sorted).enumerate() {
            assert_eq!(triangles(&h, list), triangles(&h, sorted), "{walk}");
            assert!(sorted.ranges.windows(2).all(|w| w[0].1 < w[1].0), "{walk}: merged and ascending");
            assert!(cheaper[n].draw_calls <= work[n].draw_calls);
        }
        let calls = |work: &[FrameWork]| work.iter().map(|w| w.draw_calls).sum::<u64>();
        assert!(calls(&cheaper) < calls(&work), "{walk}");
        assert!(sum(&cheaper).virtual_ns < sum(&work).virtual_ns, "{walk}");
    }
    let late = make_walk(&Spec::parse("chc:backend=latency,sorted=true").unwrap()).err().unwrap();
    assert!(late.to_string().contains("no effect with `backend=latency`"), "{late}");
}

#[test]
fn fewer_occluders_lose_nothing_and_a_threshold_is_aggressive() {
    let scene = scene("rooms");
    let h = build("octree:depth=4", &scene);
    let poses = way(&scene, 8, 0.1);
    let run = |walk: &str| {
        let mut setup = setup(&scene, &h, &Camera::default(), &poses, "frustum", &small(walk));
        let class = setup.class;
        let (lists, work) = pass(&mut setup);
        (lists.iter().map(DrawList::entry_count).sum::<u64>(), sum(&work), class)
    };
    for walk in ["nested_query", "chc", "chc_pp"] {
        let (all, work, _) = run(walk);
        let (some, fewer, _) = run(&format!("{walk}:occluder_px=20"));
        let (none, nothing, _) = run(&format!("{walk}:occluder_px=1000000"));
        let occluders = [work, fewer, nothing].map(|t| t.occluders_drawn);
        assert!(occluders[1] * all < occluders[0] * some, "{walk} {occluders:?}: fewer of what is drawn");
        assert!(occluders[2] * some < occluders[1] * none, "{walk} {occluders:?}: what the eye is in");
        assert!(all <= some && some < none, "{walk}: {all} {some} {none}");
        let (lossy, _, class) = run(&format!("{walk}:n_vp=30"));
        assert!(lossy < all && class == Class::Aggressive, "{walk}: {lossy} of {all}");
    }
}
