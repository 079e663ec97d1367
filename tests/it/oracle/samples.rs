//! The verdict of a walk that promises to lose nothing at samples of its own.

use super::accuracy;
use crate::common::soup;
use cullmark::culling::{Class, DrawList, Removes, Tally, Test, Walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, DVec3, Pose, View};
use cullmark::oracle::image::Grid;
use cullmark::oracle::{FrameTruth, truth};
use cullmark::record::{Judgement, PathSource, PathSpec, Protocol, RunSpec, SceneSource, TimeModel, Winding};
use cullmark::registry::Spec;
use cullmark::runner::{Setup, judge_setup};
use cullmark::scene::{Scene, load};
use cullmark::structure;

const OWN: (u32, u32) = (64, 36);

/// Submits exactly what its samples see, or all of that but one triangle.
struct SeenBySamples {
    scene: Scene,
    states: Option<(u32, u32)>,
    class: Class,
    forgets_one: bool,
}

impl Walk for SeenBySamples {
    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn prepare(&mut self, scene: &Scene, _: &Hierarchy) -> usize {
        self.scene = scene.clone();
        0
    }

    fn class(&self) -> Class {
        self.class
    }

    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, back_facing: true, occluded: true }
    }

    fn samples(&self) -> Option<(u32, u32)> {
        self.states
    }

    fn run(&mut self, view: &View, hierarchy: &Hierarchy, _: &mut [Box<dyn Test>], out: &mut DrawList, _: &mut Tally) {
        let seen = FrameTruth::of(&self.scene, view, 0, Grid { width_px: OWN.0, height_px: OWN.1, samples: 1 });
        // The one with the most samples, which others see too.
        let most = seen.visible.iter().max_by_key(|(_, samples)| *samples).map(|(t, _)| *t);
        let lo = seen.lo();
        for (position, t) in (0u32..).zip(&hierarchy.entries) {
            if lo.contains(*t) && !(self.forgets_one && most == Some(*t)) {
                out.push(position, position + 1);
            }
        }
    }
}

fn poses() -> Vec<Pose> {
    let ahead = |x: f64| Pose { eye: DVec3::new(x, 0.3, 0.1), forward: DVec3::X, up: DVec3::Z };
    [-9.0, -8.5, -8.0].map(ahead).to_vec()
}

fn setup(scene: Scene, states: Option<(u32, u32)>, class: Class, forgets_one: bool) -> Setup {
    let list = structure::make(&Spec::parse("list").unwrap()).unwrap().0;
    let walk = SeenBySamples { scene: Scene::default(), states, class, forgets_one };
    Setup::from_parts(scene, poses(), &Camera::default(), list.as_ref(), Vec::new(), Box::new(walk)).unwrap()
}

fn seen_losses(judgement: &Judgement) -> u64 {
    judgement.frames.iter().map(|f| f.false_culls).sum()
}

#[test]
fn a_walk_is_held_to_its_own_samples_and_measured_at_those_asked_for() {
    let scene = soup(9, 3000, 10.0, 0.5);
    let asked = accuracy(160, 90, 1);
    let numbered: Vec<(u32, Pose)> = (0u32..).zip(poses()).collect();
    let truth = truth(&scene, &Camera::default(), &numbered, &asked);
    let judge = |states, class, forgets_one| setup(scene.clone(), states, class, forgets_one).judge(&truth);
    let fine = judge(Some(OWN), Class::SampleConservative, false);
    assert_eq!(fine.wrong, None);
    assert!(seen_losses(&fine) > 20, "finer samples see more, and that is reported");
    assert_eq!(fine.frames.len(), 3);
    assert!(fine.frames.iter().all(|f| f.pixels == 160 * 90), "errors are those at the accuracy asked for");
    // One triangle fewer is caught, at the samples that promised it.
    let why = judge(Some(OWN), Class::SampleConservative, true).wrong.expect("a triangle is missing");
    assert!(why.contains("frame 0: lost 1 triangle, id") && why.contains("64 x 36 samples"), "{why}");
    // A promise about no samples in particular, or a stronger one, is held to those asked for.
    for (states, class) in [(None, Class::SampleConservative), (Some(OWN), Class::Conservative)] {
        let other = judge(states, class, false);
        assert!(!other.wrong.expect("finer samples see what it lost").contains("own"));
        assert_eq!(other.frames, fine.frames);
    }
    // What promises nothing is wrong nowhere.
    assert_eq!(judge(Some(OWN), Class::Aggressive, true).wrong, None);
}

#[test]
fn equal_samples_are_one_truth_however_they_are_cut_into_pixels() {
    let setup = setup(soup(9, 60, 10.0, 0.5), Some(OWN), Class::SampleConservative, false);
    let at = |width_px, height_px, samples| setup.promised_at(Grid { width_px, height_px, samples });
    assert_eq!(at(64, 36, 1), None);
    assert_eq!(at(32, 18, 2), None);
    let own = at(64, 36, 2).expect("four times as many");
    assert_eq!((own.width_px, own.height_px, own.samples), (64, 36, 1));
    assert_eq!((own.witness_rays, own.hiding_cells), (0, 0));
}

#[test]
fn both_truths_are_cached_each_under_its_own_id() {
    let dir = tempfile::tempdir().unwrap();
    let generated = Spec::parse("spheres").unwrap();
    let source = SceneSource::Generated(cullmark::scene::generate::make(&generated).unwrap().1);
    let described = load::describe("spheres", source, Winding::Ccw, None, 1.0, false).unwrap();
    let scene = load::load(&described).unwrap();
    let spec = RunSpec {
        scene: described,
        path: PathSpec {
            name: "ahead".into(),
            source: PathSource::Generated(Spec::new("static")),
            frames: None,
            stride: 1,
            fingerprint: "three poses".into(),
        },
        camera: Camera::default(),
        structure: Spec::new("list"),
        culling: Vec::new(),
        walk: Spec::new("seen_by_samples"),
        axes: Default::default(),
        revisions: Default::default(),
        accuracy: accuracy(160, 90, 1),
        protocol: Protocol {
            passes: 1,
            warmup_passes: 0,
            pin_core: None,
            build_profile: String::new(),
            isa: String::new(),
            threads: 1,
        },
        series: 0,
        model: TimeModel::default(),
    };
    let judged = || {
        let mut setup = setup(scene.clone(), Some(OWN), Class::SampleConservative, false);
        judge_setup(&mut setup, &spec, dir.path()).unwrap()
    };
    let stored = || {
        let files = std::fs::read_dir(dir.path().join("truth")).unwrap();
        let mut names: Vec<String> = files.map(|f| f.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    };
    let first = judged();
    assert_eq!(first.wrong, None);
    let own = cullmark::record::Accuracy { width_px: OWN.0, height_px: OWN.1, ..spec.accuracy.clone() };
    let mut ids = [spec.truth_id(), spec.truth_id_at(&own)].map(|id| format!("{id}.bin"));
    ids.sort();
    assert_eq!(stored(), ids);
    assert_eq!(judged(), first, "from the cache");
    assert_eq!(stored(), ids);
}
