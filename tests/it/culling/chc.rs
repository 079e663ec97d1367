//! Coherent hierarchical culling: facts D1.2 and D1.3 and its traps.

use super::build::{camera, list, tree};
use super::portals::{build, facing, scene};
use super::queries::{ahead, behind_a_wall, pass, setup, small, sum, way};
use super::walks::triangles;
use crate::structures::scene_of;
use cullmark::math::{Camera, DVec3, Pose};

/// A triangle across the view at `x`, of height `z`, that faces the eye.
fn screen(x: f64, lo: f64, hi: f64) -> [DVec3; 3] {
    [DVec3::new(x, 60.0, lo), DVec3::new(x, -60.0, lo), DVec3::new(x, 0.0, hi)]
}

// D1.2: [S3]'s A and B hide each other when each is the other's only occluder so far.
#[test]
fn what_hides_each_other_is_drawn_in_the_first_frame_only() {
    let scene = scene_of("a and b", &[screen(5.0, -50.0, 90.0), screen(20.0, -50.0, 90.0)]);
    let h = list(&scene, 1);
    let mut setup =
        setup(&scene, &h, &camera(40.0, 1.0), &[ahead(); 3], "frustum", "chc:backend=latency,latency_us=1000");
    let (lists, work) = pass(&mut setup);
    // Both queries are on their way before either is drawn.
    assert_eq!(triangles(&h, &lists[0]), [true, true]);
    assert_eq!(work[0].tally.queries, 2);
    for list in &lists[1..] {
        assert!(triangles(&h, list)[0], "the nearer one is never lost");
    }
    assert!(!triangles(&h, &lists[2])[1], "the other is found hidden a frame later");
}

// D1.3
#[test]
fn a_still_camera_settles_in_the_second_frame() {
    for scene in [scene("rooms"), scene("blocks:triangles=4000")] {
        for structure in ["octree:depth=5", "nested_grid", "bvh", "kd_tree", "list"] {
            let h = build(structure, &scene);
            for pose in way(&scene, 5, 0.9) {
                let mut setup = setup(&scene, &h, &Camera::default(), &[pose; 8], "frustum", &small("chc"));
                let (lists, work) = pass(&mut setup);
                let sets: Vec<_> = lists.iter().map(|l| triangles(&h, l)).collect();
                let queries: Vec<u64> = work.iter().map(|w| w.tally.queries).collect();
                let what = format!("{} {structure} {queries:?}", scene.name);
                // A visible inner node all of whose children are hidden is asked about
                // itself every other frame: the count may alternate.
                for n in 2..sets.len() {
                    assert_eq!(sets[n], sets[n - 1], "{what}: frame {n}");
                    assert!(n < 4 || queries[n] == queries[n - 2], "{what}: frame {n}");
                }
            }
        }
    }
}

#[test]
fn state_from_before_a_node_left_the_frustum_is_not_trusted() {
    let scene = behind_a_wall(40);
    let h = build("list:leaf_size=1", &scene);
    let away = facing(DVec3::ZERO, -DVec3::X);
    let poses = [ahead(), ahead(), away, ahead(), ahead()];
    let mut setup = setup(&scene, &h, &camera(60.0, 1.0), &poses, "frustum", "chc");
    let (lists, work) = pass(&mut setup);
    assert_eq!(lists[2].entry_count(), 0);
    let queries: Vec<u64> = work.iter().map(|w| w.tally.queries).collect();
    assert_eq!(queries, [41, 41, 0, 41, 41]);
    // Behind the things themselves nothing is hidden; then the wall comes back between.
    let beyond = facing(DVec3::new(10.0, 0.0, 0.0), DVec3::X);
    let poses = [beyond, beyond, away, ahead()];
    let mut setup = self::setup(&scene, &h, &camera(60.0, 1.0), &poses, "frustum", "chc");
    let (lists, _) = pass(&mut setup);
    assert!(lists[1].entry_count() > 10, "visible from there");
    assert_eq!(triangles(&h, &lists[3]).iter().filter(|t| **t).count(), 1, "and not believed in front of the wall");
}

#[test]
fn boxes_that_the_near_plane_cuts_are_visible_without_a_query() {
    // The eye is in the box of everything; a triangle before it is nearer than the near plane.
    let near = [DVec3::new(0.05, -1.0, -1.0), DVec3::new(0.05, 0.0, 2.0), DVec3::new(0.05, 1.0, -1.0)];
    let long = [DVec3::new(-50.0, 3.0, 0.0), DVec3::new(50.0, 3.0, 0.0), DVec3::new(50.0, 3.0, 1.0)];
    let scene = scene_of("near", &[near, screen(5.0, -50.0, 50.0), long]);
    let h = tree(&scene, 1, 0);
    for walk in ["nested_query", "chc", "chc_pp"] {
        let camera = Camera { near_m: 0.1, ..Camera::default() };
        let mut setup = setup(&scene, &h, &camera, &[ahead(); 3], "frustum", walk);
        let (lists, work) = pass(&mut setup);
        for (list, work) in lists.iter().zip(&work) {
            let drawn = triangles(&h, list);
            assert!(drawn[1] && drawn[2], "{walk}: the screen, and what starts behind the eye");
            assert!(work.tally.queries <= 3, "{walk}");
        }
    }
}

#[test]
fn visible_leaves_are_asked_about_every_n_av_frames() {
    let scene = scene("blocks:triangles=4000");
    let h = build("octree:depth=4", &scene);
    let above = facing(scene.bounds().centre() + DVec3::Z * 60.0, DVec3::new(0.1, 0.0, -1.0));
    let queries = |walk: &str| -> Vec<u64> {
        let mut setup = setup(&scene, &h, &Camera::default(), &[above; 13], "frustum", &small(walk));
        pass(&mut setup).1.iter().map(|w| w.tally.queries).collect()
    };
    let (each, fourth) = (queries("chc"), queries("chc:n_av=4"));
    assert_eq!(each[0], fourth[0]);
    let spared: Vec<bool> = each.iter().zip(&fourth).map(|(e, f)| f < e).collect();
    assert_eq!(
        spared[1..],
        [true, true, true, false, true, true, true, false, true, true, true, false],
        "{each:?} {fourth:?}"
    );
}

#[test]
fn drawing_instead_of_waiting_stalls_less() {
    let scene = scene("rooms");
    let h = build("octree:depth=4", &scene);
    let poses = way(&scene, 20, 0.1);
    let run = |walk: &str| {
        let mut setup = setup(&scene, &h, &Camera::default(), &poses, "frustum", &small(walk));
        let (lists, work) = pass(&mut setup);
        (sum(&work), lists.iter().map(|l| l.entry_count()).sum::<u64>())
    };
    let (wait, fewer) = run("chc:backend=latency");
    let (draw, more) = run("chc:backend=latency,stall=draw");
    println!("stall {} us with {fewer} entries, {} us with {more}", wait.stall_ns / 1000, draw.stall_ns / 1000);
    assert!(draw.stall_ns < wait.stall_ns);
    assert!(more >= fewer);
}

#[test]
fn a_pass_forgets_the_one_before() {
    let scene = scene("rooms");
    let h = build("octree:depth=4", &scene);
    let poses: Vec<Pose> = way(&scene, 10, 0.1);
    for walk in ["chc", "chc_pp", "chc_pp:backend=latency"] {
        let mut setup = setup(&scene, &h, &Camera::default(), &poses, "frustum", &small(walk));
        assert!(setup.walk.remembers());
        let (first, second) = (pass(&mut setup), pass(&mut setup));
        assert_eq!(first.0, second.0, "{walk}");
        assert_eq!(sum(&first.1), sum(&second.1), "{walk}");
    }
}
