//! Advice: what is counted on a sample says what the whole will do, and the choice is one
//! of those that were timed.

use crate::common::soup;
use cullmark::advice::probe::{Built, Counts, frames};
use cullmark::advice::{Objective, Question, advise, candidates, sample};
use cullmark::math::{Camera, Pose, View};
use cullmark::record::TimeModel;
use cullmark::registry::Spec;
use cullmark::scene::{Scene, generate, walkthrough};

fn place(scene: &str, path: &str) -> (Scene, Vec<Pose>) {
    let scene = generate::make(&Spec::parse(scene).unwrap()).unwrap().0.generate();
    let poses = walkthrough::generate::make(&Spec::parse(path).unwrap()).unwrap().0.walk(&scene).unwrap();
    (scene, poses)
}

const STRUCTURES: &[&str] = &["list", "octree:depth=3", "octree:depth=5", "bsp"];
const CULLINGS: &[&str] = &["none", "frustum", "frustum+back_face", "frustum+octant_mask"];

fn question<'a>(scene: &'a Scene, poses: &'a [Pose]) -> Question<'a> {
    Question {
        scene,
        poses,
        camera: Camera::default(),
        model: TimeModel::default(),
        objective: Objective::Frame,
        candidates: candidates::product(STRUCTURES, CULLINGS).unwrap(),
        aggressive: false,
        short_list: 3,
        probe_frames: 32,
        turns: 3,
    }
}

#[test]
fn the_choice_is_the_fastest_of_the_short_list_and_the_list_is_the_same_every_time() {
    let (scene, poses) = place("blocks:world=6", "walk:frames=200,seed=3");
    let q = question(&scene, &poses);
    let [a, b] = [advise(&q).unwrap(), advise(&q).unwrap()];
    let predicted = |advice: &cullmark::advice::Advice| -> Vec<(String, Option<f64>)> {
        advice.considered.iter().map(|c| (c.label.clone(), c.predicted_ns)).collect()
    };
    assert_eq!(predicted(&a), predicted(&b), "predictions read no clock");
    let timed: Vec<usize> = (0..a.considered.len()).filter(|i| a.considered[*i].timed.is_some()).collect();
    assert_eq!(timed.len(), 3);
    assert_eq!(timed[0], 0, "the best predicted is timed");
    let structures = |i: &usize| a.considered[*i].combination.structure.kind.clone();
    assert!(timed.iter().any(|i| structures(i) != structures(&0)), "one structure does not take every place");
    let least = |i: &usize| a.considered[*i].timed.as_ref().unwrap().objective_ns;
    assert!(timed.iter().all(|i| least(&a.chosen) <= least(i)));
    assert_eq!(a.why.len(), 3, "its own figures, and those of the two that lost: {:?}", a.why);
    for c in a.considered.iter().filter(|c| c.label.contains("octant_mask")) {
        assert_eq!(c.left_out.as_deref(), Some("may lose visible triangles"), "{}", c.label);
    }
    let whole = a.considered.iter().find(|c| c.label == "list × none").unwrap().predicted.as_ref().unwrap();
    assert_eq!((whole.entries, whole.of("nodes_visited")), (scene.len() as f64, 0.0));
}

#[test]
fn who_wants_culling_alone_is_not_told_to_cull_nothing() {
    let (scene, poses) = place("rooms:world=1", "walk:frames=40,seed=3");
    let a = advise(&Question { objective: Objective::Cull, ..question(&scene, &poses) }).unwrap();
    let chosen = &a.considered[a.chosen];
    assert!(!chosen.combination.culling.is_empty(), "{}", chosen.label);
    let own = chosen.timed.as_ref().unwrap();
    assert_eq!(own.objective_ns, own.cull_ns, "drawing is not asked for");
    assert!(a.why.iter().all(|w| !w.contains("drawing") && !w.contains("modelled")), "{:?}", a.why);
    for c in a.considered.iter().filter(|c| c.combination.culling.is_empty()) {
        assert!(c.left_out.as_deref().unwrap().contains("removes nothing"), "{}", c.label);
    }
}

#[test]
fn counts_on_a_sample_are_about_those_on_the_scene() {
    let (scene, poses) = place("arena:map=gold_rush", "walk:frames=400,seed=5");
    let sample = sample::Sample::of(&scene);
    assert_eq!((sample.scale.one_in, sample.scene.len()), (5, scene.len().div_ceil(5)));
    let views: Vec<View> =
        frames(poses.len(), 32).iter().map(|f| View::new(&Camera::default(), &poses[*f as usize])).collect();
    for c in candidates::product(STRUCTURES, &["frustum", "frustum+back_face"]).unwrap() {
        let whole = Built::new(&scene, &c).unwrap().pass(&views);
        let mut small = c.clone();
        small.structure = sample::scaled(&c.structure, sample.scale.one_in);
        let guess = Built::new(&sample.scene, &small).unwrap().pass(&views).scaled(sample.scale);
        let off = |of: fn(&Counts) -> f64| (of(&guess) / of(&whole)).ln().abs().exp();
        let nodes = |c: &Counts| c.of("nodes_visited") + c.of("nodes_scanned");
        let (entries, nodes) = (off(|c| c.entries), off(nodes));
        println!("{}: entries {entries:.2}, nodes {nodes:.2}, calls {:.2}", c.label(), off(|c| c.draw_calls));
        assert!(entries < 1.25 && nodes < 2.5, "{}: entries {entries:.2}, nodes {nodes:.2}", c.label());
    }
}

#[test]
fn nothing_to_advise_on_is_an_error() {
    let (scene, poses) = place("blocks", "walk:frames=2");
    let empty = Scene::default();
    let message = |q: &Question| advise(q).unwrap_err().to_string();
    assert!(message(&question(&empty, &poses)).contains("the scene has no triangles"));
    assert!(message(&question(&scene, &[])).contains("the path has no frames"));
    let lossy = candidates::product(&["list"], &["look_at"]).unwrap();
    let none = Question { candidates: lossy, ..question(&scene, &poses) };
    assert!(message(&none).contains("may lose visible triangles"));
    assert!(advise(&Question { aggressive: true, ..none }).is_ok());
    let odd = soup(1, 40, 5.0, 1.0);
    assert!(advise(&question(&odd, &poses)).is_ok(), "a handful of triangles");
}
