//! Nodes: the marks of a frame make up exactly what the walk submitted.

use super::{Frame, run_spec};
use cullmark::culling::{DrawList, TESTS, Tally, Test, WALKS, Walk, make_tests, make_walk};
use cullmark::error::Result;
use cullmark::hierarchy::{Hierarchy, NONE};
use cullmark::math::{Camera, Pose, Projection, View};
use cullmark::registry::{Entry, Spec, parse_sum};
use cullmark::runner::Setup;
use cullmark::scene::{Scene, load, walkthrough};
use cullmark::structure::{self, Structure};
use cullmark::viewing::RunView;
use std::collections::BTreeSet;
use std::path::Path;

/// A structure that was built before.
struct Ready(Hierarchy);

impl Structure for Ready {
    fn build(&self, _: &Scene) -> Result<Hierarchy> {
        Ok(self.0.clone())
    }
}

fn view_of(
    scene: &Scene,
    poses: &[Pose],
    camera: &Camera,
    h: &Hierarchy,
    culling: &str,
    walk: Box<dyn Walk>,
) -> RunView {
    let (tests, _) = make_tests(&parse_sum(culling).unwrap()).unwrap();
    let ready = Ready(h.clone());
    let setup = Setup::from_parts(scene.clone(), poses.to_vec(), camera, &ready, tests, walk).unwrap();
    RunView::of(setup, &run_spec("list", culling, "flat", 1), Path::new("/nonexistent"))
}

/// What the marks of nodes say was submitted before triangles are judged one by one.
fn marked(h: &Hierarchy, codes: &[u8]) -> Vec<(u32, u32)> {
    let mut ranges = Vec::new();
    let mut codes = codes.iter();
    for links in &h.links {
        for lane in (0..8).filter(|l| links.live >> l & 1 == 1) {
            let (first, own_end, end) = (links.first[lane], links.own_end[lane], links.end[lane]);
            match codes.next().expect("a code for every node") {
                1 => ranges.push((first, end)),
                2 => {
                    assert_ne!(links.child[lane], NONE, "a leaf does not go on");
                    ranges.push((first, own_end));
                }
                0 | 3 | 16.. => {}
                other => panic!("{other} is no mark of a node"),
            }
        }
    }
    assert!(codes.next().is_none());
    ranges.sort_unstable();
    let mut list = DrawList::default();
    ranges.iter().for_each(|(first, end)| list.push(*first, *end));
    list.ranges
}

/// The walk alone, with tests that nobody watches.
fn walked(view: &View, h: &Hierarchy, tests: &mut [Box<dyn Test>], walk: &mut dyn Walk) -> Vec<(u32, u32)> {
    let mut out = DrawList::default();
    tests.iter_mut().for_each(|t| t.begin(view, h));
    walk.run(view, h, tests, &mut out, &mut Tally::default());
    // In order of positions, whatever the order of drawing.
    out.ranges.sort_unstable();
    let mut list = DrawList::default();
    out.ranges.iter().for_each(|(first, end)| list.push(*first, *end));
    list.ranges
}

fn sums() -> Vec<String> {
    let alone = TESTS.iter().map(|e| e.name.to_string());
    let behind = TESTS.iter().filter(|e| e.name != "frustum").map(|e| format!("frustum+{}", e.name));
    let more = [
        "none",
        "frustum:last_plane=true",
        "frustum:node_test=box_plane",
        "normal_mask:rays=node+frustum",
        "frustum:octant=true,sat=true+octant_mask:saturation=0.3",
        "frustum:primitive=point",
    ];
    let three = "octant_mask+frustum:arithmetic=f64+normal_cone:form=tight";
    alone.chain(behind).chain(more.map(String::from)).chain([three.to_string()]).collect()
}

/// Those with a depth buffer get a small one.
fn walks() -> Vec<String> {
    let small = |e: &Entry<dyn Walk>| match e.params.iter().any(|p| p.name == "width_px") {
        true => format!("{}:width_px=64,height_px=36", e.name),
        false => e.name.to_string(),
    };
    WALKS.iter().map(small).collect()
}

/// Of a leaf such walks submit a part, and the mark says no more than that.
fn judges_triangles(walk: &str) -> bool {
    ["fast_v", "pvs"].contains(&walk)
}

fn within((first, end): (u32, u32), ranges: &[(u32, u32)]) -> bool {
    ranges.iter().any(|(a, b)| *a <= first && end <= *b)
}

#[test]
fn marks_of_nodes_make_up_what_the_walk_submitted_and_jumping_changes_nothing() {
    let spec = run_spec("list", "none", "flat", 5);
    let scene = load::load(&spec.scene).unwrap();
    let poses = walkthrough::load(&spec.path, &spec.scene, &scene).unwrap();
    let ortho = Camera { projection: Projection::Orthographic { height_m: 6.0 }, far_m: Some(20.0), ..spec.camera };
    let policies = ["L", "R", "S", "E"].map(|p| format!("octree:depth=4,policy={p}"));
    let named = structure::ALL.iter().map(|e| e.name.to_string());
    let mut marks = BTreeSet::new();
    for name in named.chain(policies).chain(["octree:depth=0".to_string(), "bsp:min_leaf=100".to_string()]) {
        let h = structure::make(&Spec::parse(&name).unwrap()).unwrap().0.build(&scene).unwrap();
        for (culling, walk) in sums().iter().flat_map(|c| walks().into_iter().map(move |w| (c, w))) {
            let walk = walk.as_str();
            let make = || make_walk(&Spec::parse(walk).unwrap()).unwrap().0;
            // What hides takes its time, and asks tests no other way.
            let hides = make().removes().occluded && walk != "portals";
            if make().refuses(&h).is_some()
                || hides && !["none", "frustum", "frustum+back_face"].contains(&culling.as_str())
            {
                continue;
            }
            for camera in [spec.camera, ortho] {
                let mut tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
                tests.iter_mut().for_each(|t| _ = t.prepare(&scene, &h));
                let mut own = make();
                own.prepare(&scene, &h);
                let mut view = view_of(&scene, &poses, &camera, &h, culling, make());
                let mut frames = Vec::new();
                for (n, pose) in poses.iter().enumerate() {
                    let frame = view.frame(n, false).unwrap();
                    let read = Frame::read(&frame);
                    let want = walked(&View::new(&camera, pose), &h, &mut tests, own.as_mut());
                    let marked = marked(&h, &read.nodes);
                    let what = format!("{name} × {culling} × {walk}, frame {n}");
                    match judges_triangles(walk) {
                        true => assert!(want.iter().all(|w| within(*w, &marked)), "{what}"),
                        false => assert_eq!(marked, want, "{what}"),
                    }
                    marks.extend(read.nodes);
                    frames.push(frame);
                }
                for n in [3, 0, 0, 4, 1] {
                    assert!(view.frame(n, false).unwrap() == frames[n], "{name} × {culling} × {walk}, back to {n}");
                }
            }
        }
    }
    assert_eq!(marks.into_iter().collect::<Vec<_>>(), [0, 1, 2, 3, 16, 17, 18], "every kind of mark occurred");
}

/// Frames that nobody judged are shown as if they had been.
#[test]
fn a_frame_that_a_walk_would_not_judge_shows_its_nodes() {
    let spec = run_spec("list", "none", "flat", 3);
    let scene = load::load(&spec.scene).unwrap();
    let mut poses = walkthrough::load(&spec.path, &spec.scene, &scene).unwrap();
    poses.insert(1, poses[0]);
    let h = structure::make(&Spec::parse("octree:depth=4").unwrap()).unwrap().0.build(&scene).unwrap();
    for (walk, other) in [("depth_first", "still=true"), ("flat", "still=true"), ("depth_first", "small=40")] {
        let walk_of = |text: &str| make_walk(&Spec::parse(text).unwrap()).unwrap().0;
        let view = |walk: Box<dyn Walk>| view_of(&scene, &poses, &spec.camera, &h, "frustum", walk);
        let (mut plain, mut skipping) = (view(walk_of(walk)), view(walk_of(&format!("{walk}:{other}"))));
        for (n, pose) in poses.iter().enumerate() {
            let frame = skipping.frame(n, false).unwrap();
            if other == "still=true" {
                assert!(frame == plain.frame(n, false).unwrap(), "{walk}:{other}, frame {n}");
            }
            let mut tests = make_tests(&parse_sum("frustum").unwrap()).unwrap().0;
            tests.iter_mut().for_each(|t| _ = t.prepare(&scene, &h));
            let view = View::new(&spec.camera, pose);
            let want = walked(&view, &h, &mut tests, walk_of(&format!("{walk}:{other}")).as_mut());
            assert_eq!(marked(&h, &Frame::read(&frame).nodes), want, "{walk}:{other}, frame {n}");
        }
    }
}

/// Draws one more entry every frame.
#[derive(Default)]
struct Growing(u32);

impl Walk for Growing {
    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn reset(&mut self) {
        self.0 = 0;
    }

    fn run(&mut self, _: &View, _: &Hierarchy, _: &mut [Box<dyn Test>], out: &mut DrawList, _: &mut Tally) {
        self.0 += 1;
        out.push(0, self.0);
    }
}

#[test]
fn a_walk_with_a_memory_is_shown_as_in_a_pass() {
    let spec = run_spec("list", "none", "flat", 6);
    let scene = load::load(&spec.scene).unwrap();
    let poses = walkthrough::load(&spec.path, &spec.scene, &scene).unwrap();
    let h = structure::make(&Spec::new("list")).unwrap().0.build(&scene).unwrap();
    let mut view = view_of(&scene, &poses, &spec.camera, &h, "none", Box::new(Growing::default()));
    for n in [2, 3, 5, 5, 1, 0, 4] {
        assert_eq!(Frame::read(&view.frame(n, false).unwrap()).submitted, n as u32 + 1);
    }
}
