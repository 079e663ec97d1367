//! What the manifest asks of the lab: generators by name, and fingerprints of
//! sources (bytes are hashed, nothing is parsed or generated).

use super::axes::{Part, parts};
use crate::error::Result;
use crate::record::{PathSource, SceneSource, SceneSpec, Up, Winding};
use crate::registry::Spec;
use crate::scene::{generate, load, walkthrough};

pub fn generators() -> Vec<Part> {
    parts(generate::ALL)
}

pub fn walkers() -> Vec<Part> {
    parts(walkthrough::generate::ALL)
}

/// `make` rather than a look-up: a generator may refuse a combination of parameters.
pub fn check_generator(spec: &Spec) -> Result<Spec> {
    generate::make(spec).map(|(_, resolved)| resolved)
}

pub fn check_walker(spec: &Spec) -> Result<Spec> {
    walkthrough::generate::make(spec).map(|(_, resolved)| resolved)
}

pub fn scene_fingerprint(source: &SceneSource, winding: Winding, up: Up, scale: f64, weld: bool) -> Result<String> {
    load::fingerprint(source, winding, up, scale, weld)
}

pub fn moved(scene: SceneSpec, offset_m: [f64; 3]) -> SceneSpec {
    load::moved(scene, offset_m)
}

pub fn path_fingerprint(source: &PathSource, scene: &str) -> Result<String> {
    walkthrough::fingerprint(source, scene)
}
