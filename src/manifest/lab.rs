//! What the manifest asks of the lab: generators by name, and fingerprints of
//! sources (bytes are hashed, nothing is parsed).

use super::axes::Part;
use crate::error::{Error, Result};
use crate::record::{PathSource, SceneSource, Up, Winding};
use crate::registry::{Default as D, Entry, Param, Spec, find};

static GENERATORS: &[Entry<()>] = &[
    Entry {
        name: "arena",
        about: "",
        revision: 1,
        params: &[Param {
            name: "map",
            default: D::Choice(&["nucleus", "coal_town", "ravine", "viaduct", "gorge", "saw", "gold_rush"]),
            about: "",
        }],
        make: |_| Box::new(()),
    },
    Entry {
        name: "blocks",
        about: "",
        revision: 1,
        params: &[Param { name: "world", default: D::Int { value: 5, min: 5, max: 6 }, about: "" }],
        make: |_| Box::new(()),
    },
    Entry {
        name: "rooms",
        about: "",
        revision: 1,
        params: &[Param { name: "world", default: D::Int { value: 1, min: 1, max: 4 }, about: "" }],
        make: |_| Box::new(()),
    },
];

static WALKERS: &[Entry<()>] = &[Entry {
    name: "walk",
    about: "",
    revision: 1,
    params: &[
        Param { name: "frames", default: D::Int { value: 2000, min: 1, max: 1_000_000 }, about: "" },
        Param { name: "seed", default: D::Int { value: 1, min: 0, max: i64::MAX }, about: "" },
    ],
    make: |_| Box::new(()),
}];

fn parts<T: ?Sized>(entries: &'static [Entry<T>]) -> Vec<Part> {
    entries.iter().map(|e| Part { name: e.name, revision: e.revision, params: e.params }).collect()
}

pub fn generators() -> Vec<Part> {
    parts(GENERATORS)
}

pub fn walkers() -> Vec<Part> {
    parts(WALKERS)
}

pub fn check_generator(spec: &Spec) -> Result<Spec> {
    find("scene generator", GENERATORS, spec).map(|(_, s)| s)
}

pub fn check_walker(spec: &Spec) -> Result<Spec> {
    find("path generator", WALKERS, spec).map(|(_, s)| s)
}

pub fn scene_fingerprint(source: &SceneSource, winding: Winding, up: Up, scale: f64, weld: bool) -> Result<String> {
    let bytes = match source {
        SceneSource::File(path) => std::fs::read(path).map_err(|e| Error::io(path, "cannot read", &e))?,
        SceneSource::Generated(spec) => spec.to_string().into_bytes(),
    };
    let options = format!("{winding:?} {up:?} {scale} {weld}");
    Ok(blake3::hash(&[&bytes, options.as_bytes()].concat()).to_hex().to_string())
}

pub fn path_fingerprint(source: &PathSource, scene: &str) -> Result<String> {
    let bytes = match source {
        PathSource::File(path) => std::fs::read(path).map_err(|e| Error::io(path, "cannot read", &e))?,
        PathSource::Generated(spec) => spec.to_string().into_bytes(),
    };
    Ok(blake3::hash(&[&bytes, scene.as_bytes()].concat()).to_hex().to_string())
}
