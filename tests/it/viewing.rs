//! The frame viewer's lab side: what it shows is what the method did.

mod decisions;
mod frames;
mod verbs;

use cullmark::math::Camera;
use cullmark::record::{Accuracy, PathSource, PathSpec, Protocol, RunSpec, SceneSource, SceneSpec, TimeModel, Winding};
use cullmark::registry::{Spec, parse_sum};
use cullmark::scene::{load, walkthrough};

/// A generated scene with floors, walls and doors.
fn rooms() -> SceneSpec {
    let source = SceneSource::Generated(Spec::parse("rooms:world=1,triangles=5500").unwrap());
    load::describe("rooms", source, Winding::Ccw, None, 1.0, false).unwrap()
}

/// A run on it, with `frames` poses looking anywhere from inside.
fn run_spec(structure: &str, culling: &str, walk: &str, frames: u32) -> RunSpec {
    let scene = rooms();
    let source = PathSource::Generated(Spec::parse(&format!("random:frames={frames},seed=3,spread=0.8")).unwrap());
    let fingerprint = walkthrough::fingerprint(&source, &scene.fingerprint).unwrap();
    RunSpec {
        path: PathSpec { name: "random".into(), source, frames: None, stride: 1, fingerprint },
        scene,
        camera: Camera::default(),
        structure: Spec::parse(structure).unwrap(),
        culling: parse_sum(culling).unwrap(),
        walk: Spec::parse(walk).unwrap(),
        axes: Default::default(),
        revisions: Default::default(),
        accuracy: Accuracy { frames: 2, width_px: 160, height_px: 90, samples: 2, witness_rays: 4, hiding_cells: 0 },
        protocol: Protocol {
            passes: 1,
            warmup_passes: 0,
            pin_core: None,
            build_profile: "dev".into(),
            isa: "scalar".into(),
            threads: 1,
        },
        series: 0,
        model: TimeModel::default(),
    }
}

/// A binary form taken apart.
struct Form<'a>(&'a [u8]);

impl<'a> Form<'a> {
    /// After magic and version.
    fn new(bytes: &'a [u8], magic: &[u8; 4]) -> Form<'a> {
        let mut form = Form(bytes.strip_prefix(magic).expect("the magic"));
        assert_eq!(form.word(), 1, "the version");
        form
    }

    fn bytes(&mut self, count: usize) -> &'a [u8] {
        let (head, rest) = self.0.split_at(count);
        self.0 = rest;
        head
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes(4).try_into().unwrap())
    }

    fn words(&mut self, count: u32) -> Vec<u32> {
        (0..count).map(|_| self.word()).collect()
    }

    fn floats(&mut self, count: u32) -> Vec<f32> {
        self.words(count).into_iter().map(f32::from_bits).collect()
    }
}

/// `CMFR`, read by its description.
struct Frame {
    submitted: u32,
    visible: u32,
    lost: u32,
    truth: bool,
    triangles: Vec<u8>,
    nodes: Vec<u8>,
}

impl Frame {
    fn read(bytes: &[u8]) -> Frame {
        let mut form = Form::new(bytes, b"CMFR");
        let [triangles, nodes, submitted, visible, lost, flags]: [u32; 6] = form.words(6).try_into().unwrap();
        assert!(flags <= 1);
        let states = form.bytes(triangles as usize).to_vec();
        assert!(form.bytes((4 - triangles as usize % 4) % 4).iter().all(|b| *b == 0), "zeros up to a multiple of 4");
        let codes = form.bytes(nodes as usize).to_vec();
        assert!(form.0.is_empty(), "nothing follows");
        Frame { submitted, visible, lost, truth: flags == 1, triangles: states, nodes: codes }
    }

    fn count(&self, state: u8) -> u32 {
        self.triangles.iter().filter(|s| **s == state).count() as u32
    }
}
