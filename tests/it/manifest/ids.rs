//! Ids of finished runs stay: what they were before an axis or a key came is pinned.

use super::{Folder, HEAD, matrix};
use cullmark::manifest::Manifest;
use cullmark::matrix::{Setting, expand, labels};
use std::path::Path;

#[test]
fn runs_of_older_manifests_keep_their_ids() {
    let quick = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/quick.toml");
    let matrix = expand(&Manifest::load(&quick, &[]).unwrap(), &Setting::default()).unwrap();
    for (i, cell, answer, truth) in [
        (0, "list × none", "d1ff72f6e9c0fd14ef4a4b4b3bd1902f", "2ff36cc9943a4b8086a06a65d3d79661"),
        (22, "octree × normal_mask", "5d3e764cb5eba5d4b64f1ab171148003", "f42fe1f019e8b64d2591143f3157720f"),
        (44, "bsp × frustum+normal_mask", "96bb64aefd04164a1d61a67615f86ad8", "6b2ef194f3f3278c53e6f90539708c78"),
    ] {
        let run = &matrix.runs[i];
        assert_eq!(labels(run).cell(), cell);
        assert_eq!((run.answer_id().as_str(), run.truth_id().as_str()), (answer, truth), "{cell}");
    }
}

/// A spec as it was stored before there were offsets and further axes reads as it always did.
#[test]
fn what_is_usual_is_not_written() {
    let m = matrix(
        "[matrix]\nstructure = [\"list\"]\nculling = [\"frustum\"]\narithmetic = [\"f32_relative\"]\ncamera = [\"perspective\"]",
    );
    for run in &m.runs {
        let text = serde_json::to_string(run).unwrap();
        for word in ["offset_m", "arithmetic", "axes"] {
            assert!(!text.contains(word), "{word} in {text}");
        }
        assert_eq!(serde_json::from_str::<cullmark::record::RunSpec>(&text).unwrap(), *run);
    }
}

#[test]
fn an_id_tells_arithmetics_cameras_and_places_apart_but_not_their_spelling() {
    let body = "[matrix]\nscene = \"a\"\nstructure = [\"list\"]\nculling = [\"frustum\"]\n";
    let plain = matrix(body).runs[0].answer_id();
    let id = |more: &str| matrix(&format!("{body}{more}")).runs[0].answer_id();
    assert_eq!(id("arithmetic = \"f32_relative\""), plain);
    assert_ne!(id("arithmetic = \"f64\""), plain);
    assert_eq!(id("camera = \"perspective:fov_y_deg=60\""), plain);
    assert_eq!(
        id("camera = \"perspective:fov_y_deg=40\""),
        matrix(&format!("[camera]\nfov_y_deg = 40\n{body}")).runs[0].answer_id(),
        "an axis and the section that say the same are the same work"
    );
    let placed = |key: &str| {
        let text = HEAD.replacen("generate = \"rooms:world=1\"", &format!("generate = \"rooms:world=1\"\n{key}"), 1);
        Folder::new().read(&format!("{text}{body}"), &[]).unwrap().1.runs[0].answer_id()
    };
    assert_eq!(placed("offset_m = 0"), plain);
    assert_ne!(placed("offset_m = 1e3"), plain);
    assert_eq!(placed("offset_m = 7"), placed("offset_m = { x = 6, y = -3, z = 2 }"));
}
