//! A run to look at: the scene, the structure, and frame by frame what the method
//! did with every node and every triangle, as compact binary forms for a viewer.
//!
//! What is shown is what happened: a frame is culled by the run's own walk and
//! tests, and the tests are watched while they answer ([`watch`]). Nothing here
//! repeats how a walk composes its tests.
//!
//! - A triangle's state comes from the draw list, as the judge reads it
//!   ([`crate::runner::submitted`]); "seen" and "lost" come from the oracle's judgement.
//! - Truth of a judged frame is that of the run's judgement, at its resolution and
//!   with its witness rays, so that `lost` is the recorded number of false culls. Other
//!   frames are judged at 960 pixels across, one sample a pixel: quick, and the same for
//!   every run.
//! - Nodes are numbered by blocks, in them by lanes, live lanes only ([`nodes::Numbers`]).

mod about;
pub mod forms;
pub mod nodes;
mod truth;
pub mod watch;

pub use about::{About, CameraAbout};

use crate::culling::{DrawList, TESTS, Tally};
use crate::error::{Error, Result};
use crate::math::Camera;
use crate::oracle::losses;
use crate::preview::{depth, encode_png};
use crate::record::{RunSpec, SceneSpec};
use crate::registry::{Spec, find};
use crate::runner::{Setup, submitted};
use crate::scene::{Scene, load};
use forms::{Counts, State};
use nodes::Numbers;
use std::collections::VecDeque;
use std::path::Path;
use truth::TruthOf;
use watch::Watch;

/// Frames with truth that are kept ready, a byte a triangle each: who looks for a
/// loss goes back and forth.
const KEPT_FRAMES: usize = 16;

/// A run, ready to show any of its frames.
pub struct RunView {
    spec: RunSpec,
    setup: Setup,
    watch: Watch,
    numbers: Numbers,
    /// What the frame in `shown` submitted.
    list: DrawList,
    shown: Option<usize>,
    truth: TruthOf,
    /// The walk has a depth buffer to show.
    depth: bool,
    /// Finished frames with truth, the last used at the end.
    kept: VecDeque<(usize, Vec<u8>)>,
}

impl RunView {
    /// Loads and builds as a trial does.
    ///
    /// # Errors
    /// Those of [`Setup::new`].
    pub fn open(spec: &RunSpec, cache: &Path) -> Result<RunView> {
        Ok(RunView::of(Setup::new(spec, cache)?, spec, cache))
    }

    /// The same of parts of one's own; `spec` says how they are called, placed and judged.
    pub fn of(mut setup: Setup, spec: &RunSpec, cache: &Path) -> RunView {
        let watch = Watch::over(&mut setup.tests);
        setup.reset();
        RunView {
            numbers: Numbers::of(&setup.hierarchy),
            truth: TruthOf::new(spec, setup.views.len(), cache),
            depth: setup.walk.buffer().is_some(),
            spec: spec.clone(),
            setup,
            watch,
            list: DrawList::default(),
            shown: None,
            kept: VecDeque::new(),
        }
    }

    pub fn about(&self) -> About {
        let mut about = About::of(&self.setup.scene, &self.spec.scene, &self.spec.camera);
        about.nodes = self.numbers.count();
        about.frames = self.setup.views.len() as u32;
        about.poses = self.setup.views.iter().map(|v| about::pose(v, self.setup.scene.origin)).collect();
        about.tests = self.spec.culling.iter().map(test_name).collect();
        about.judged = self.truth.judged().to_vec();
        about.depth = self.depth;
        about
    }

    /// Form `CMSH`.
    pub fn mesh(&self) -> Vec<u8> {
        forms::mesh(&self.setup.scene)
    }

    /// Form `CMND`.
    pub fn nodes(&self) -> Vec<u8> {
        forms::nodes(&self.setup.hierarchy)
    }

    /// Form `CMFR`. Without `truth` nothing is seen or lost: states are 0 and 1.
    ///
    /// # Errors
    /// When the path has no frame `n`.
    pub fn frame(&mut self, n: usize, truth: bool) -> Result<Vec<u8>> {
        self.check(n)?;
        if truth && let Some(at) = self.kept.iter().position(|(frame, _)| *frame == n) {
            let ready = self.kept.remove(at).expect("just found");
            self.kept.push_back(ready.clone());
            return Ok(ready.1);
        }
        self.go_to(n);
        let Setup { scene, hierarchy, views, removes, .. } = &self.setup;
        let hides = self.setup.walk.removes().occluded;
        let decisions = self.watch.read(|heard| self.numbers.of_frame(hierarchy, heard, &self.list, hides));
        let sent = submitted(scene, hierarchy, &self.list);
        let mut states = vec![State::NOT_SUBMITTED; scene.len()];
        sent.triangles.iter().for_each(|t| states[t as usize] = State::UNSEEN);
        let mut counts = Counts { submitted: sent.triangles.count() as u32, ..Counts::default() };
        if !truth {
            return Ok(forms::frame(&states, &decisions, counts));
        }
        let known = self.truth.frame(scene, &views[n], n as u32);
        let judged = losses(scene, &views[n], &known, &sent, *removes);
        let seen = known.lo();
        seen.iter().filter(|t| sent.triangles.contains(*t)).for_each(|t| states[t as usize] = State::SEEN);
        // Last: of a split triangle a piece may be lost though others were submitted.
        judged.seen.iter().for_each(|t| states[*t as usize] = State::LOST);
        counts.visible = judged.errors.visible as u32;
        counts.lost = judged.seen.len() as u32;
        counts.truth = true;
        let bytes = forms::frame(&states, &decisions, counts);
        if self.kept.len() == KEPT_FRAMES {
            self.kept.pop_front();
        }
        self.kept.push_back((n, bytes.clone()));
        Ok(bytes)
    }

    /// What hides in frame `n`, as a PNG of the walk's depth buffer.
    ///
    /// # Errors
    /// When the path has no frame `n`, or the walk has no such buffer.
    pub fn depth(&mut self, n: usize) -> Result<Vec<u8>> {
        self.check(n)?;
        if self.depth {
            self.go_to(n);
        }
        let (depth_at_all, none) = (self.depth, "this walk draws no occluders, so there is no depth to show");
        let buffer = self.setup.walk.buffer().ok_or_else(|| match depth_at_all {
            true => {
                Error::new(format!("frame {n} was culled without queries, as they did not pay; no depth was drawn"))
                    .key("frame")
                    .help("look at another frame")
            }
            false => Error::new(none).key("ask").help("look at a run whose walk queries occlusion, such as `chc_pp`"),
        })?;
        let size = buffer.settings();
        encode_png(&depth(size.width_px, size.height_px, &buffer.image()))
    }

    fn check(&self, n: usize) -> Result<()> {
        let frames = self.setup.views.len();
        if n < frames {
            return Ok(());
        }
        Err(Error::new(format!("frame {n} is not one of the path's {frames}"))
            .key("frame")
            .help(format!("ask for a frame from 0 to {}", frames - 1)))
    }

    /// Culls frame `n` in the state that a pass has there. Tests learn nothing that
    /// changes a verdict ([`crate::culling::Test::judge`]); a walk may, and says so.
    fn go_to(&mut self, n: usize) {
        if self.shown == Some(n) {
            return;
        }
        let next = self.shown.map_or(0, |s| s + 1);
        let from = match (self.setup.walk.remembers(), next <= n) {
            (false, _) => {
                // A list that is reused would leave no answers to show.
                self.setup.walk.reset();
                n
            }
            (true, true) => next,
            (true, false) => {
                self.setup.reset();
                0
            }
        };
        for frame in from..=n {
            self.watch.clear();
            self.setup.cull(frame, &mut self.list, &mut Tally::default());
        }
        self.shown = Some(n);
    }
}

/// A scene alone to look at.
pub struct SceneView {
    spec: SceneSpec,
    scene: Scene,
}

impl SceneView {
    /// A scene without a fingerprint is taken as it is now.
    ///
    /// # Errors
    /// Those of [`load::load_cached`].
    pub fn open(spec: &SceneSpec, cache: &Path) -> Result<SceneView> {
        let mut spec = spec.clone();
        if spec.fingerprint.is_empty() {
            spec = load::describe(&spec.name, spec.source, spec.winding, Some(spec.up), spec.scale, spec.weld)?;
        }
        Ok(SceneView { scene: load::load_cached(&spec, cache)?, spec })
    }

    /// Without frames, nodes and tests; the camera is the default one.
    pub fn about(&self) -> About {
        About::of(&self.scene, &self.spec, &Camera::default())
    }

    /// Form `CMSH`.
    pub fn mesh(&self) -> Vec<u8> {
        forms::mesh(&self.scene)
    }
}

/// A part of the sum without parameters that have their default.
fn test_name(part: &Spec) -> String {
    find("culling test", TESTS, part).map_or_else(|_| part.to_string(), |(entry, own)| own.label(entry.params))
}
