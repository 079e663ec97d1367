//! Truth on disk.

use super::{accuracy, pose};
use crate::common::soup;
use cullmark::math::{Camera, DVec3, Pose};
use cullmark::oracle::{judged_frames, truth, truth_cached};

#[test]
fn damaged_truth_files_are_computed_anew() {
    let scene = soup(10, 500, 8.0, 2.0);
    let poses: Vec<(u32, Pose)> = judged_frames(9, &accuracy(40, 30, 2))
        .into_iter()
        .map(|f| (f, pose(DVec3::new(-7.0 + f64::from(f) * 0.1, 0.0, 0.0))))
        .collect();
    let dir = tempfile::tempdir().unwrap();
    let cached = || truth_cached(&scene, &Camera::default(), &poses, &accuracy(40, 30, 2), dir.path(), "id").unwrap();
    let first = cached();
    assert_eq!(first, truth(&scene, &Camera::default(), &poses, &accuracy(40, 30, 2)));
    let file = dir.path().join("truth/id.bin");
    let good = std::fs::read(&file).unwrap();
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for bad in [&b""[..], b"not truth", &good[..good.len() / 2], &flipped] {
        std::fs::write(&file, bad).unwrap();
        assert_eq!(cached(), first);
        assert_eq!(std::fs::read(&file).unwrap(), good, "the file is whole again");
    }
    assert_eq!(std::fs::read_dir(dir.path().join("truth")).unwrap().count(), 1, "no partial file is left");
    let shorter = truth_cached(&scene, &Camera::default(), &poses[..1], &accuracy(40, 30, 2), dir.path(), "id");
    assert_eq!(shorter.unwrap().frames.len(), 1, "a file of other frames is no answer");
}

#[test]
fn a_cache_that_cannot_be_written_says_so() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let scene = soup(11, 10, 8.0, 2.0);
    let poses = [(0, pose(DVec3::ZERO))];
    let e = truth_cached(&scene, &Camera::default(), &poses, &accuracy(8, 8, 1), file.path(), "id").unwrap_err();
    assert!(e.to_string().contains("cannot store the truth") && e.help.is_some(), "{e}");
}
