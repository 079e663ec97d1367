//! Truth on disk: one file a scene, camera, path and accuracy, shared by all
//! methods. A file that is damaged, foreign or of an older oracle is computed anew.

use super::{REVISION, Truth, truth};
use crate::error::{Error, ErrorKind, Result};
use crate::math::{Camera, Pose};
use crate::record::Accuracy;
use crate::scene::Scene;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

const MAGIC: &[u8; 16] = b"cullmark truth\0\0";
const FOLDER: &str = "truth";

/// [`truth`], read from `cache_dir/truth/<id>.bin` if it is there; `id` must
/// determine all other arguments ([`crate::record::RunSpec::truth_id`]).
///
/// # Errors
/// When the file cannot be written.
pub fn truth_cached(
    scene: &Scene,
    camera: &Camera,
    poses: &[(u32, Pose)],
    accuracy: &Accuracy,
    cache_dir: &Path,
    id: &str,
) -> Result<Truth> {
    let frames: Vec<u32> = poses.iter().map(|(frame, _)| *frame).collect();
    if let Some(truth) = truth_stored(scene.len(), &frames, cache_dir, id) {
        return Ok(truth);
    }
    let (folder, path) = (cache_dir.join(FOLDER), file(cache_dir, id));
    let truth = truth(scene, camera, poses, accuracy);
    fs::create_dir_all(&folder).map_err(|e| cannot_write(&folder, &e))?;
    // Other processes may compute the same truth: each writes its own file, and
    // whole files change places.
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let unique = COUNT.fetch_add(1, Ordering::Relaxed);
    let partial = folder.join(format!("{id}.{}.{unique}.partial", std::process::id()));
    let written = fs::write(&partial, encode(&truth)).and_then(|()| fs::rename(&partial, &path));
    if let Err(e) = written {
        // Leave no half file behind on a full disk.
        let _ = fs::remove_file(&partial);
        return Err(cannot_write(&path, &e));
    }
    Ok(truth)
}

/// What [`truth_cached`] would read, if it is there and of this scene and these frames.
pub fn truth_stored(triangles: usize, frames: &[u32], cache_dir: &Path, id: &str) -> Option<Truth> {
    let truth = decode(&fs::read(file(cache_dir, id)).ok()?)?;
    let fits = truth.scene_triangles as usize == triangles && truth.frames.iter().map(|f| &f.frame).eq(frames);
    fits.then_some(truth)
}

fn file(cache_dir: &Path, id: &str) -> PathBuf {
    cache_dir.join(FOLDER).join(format!("{id}.bin"))
}

fn cannot_write(path: &Path, e: &std::io::Error) -> Error {
    Error::io(path, "cannot store the truth", e)
        .kind(ErrorKind::Unavailable)
        .help("free some space or choose another cache folder")
}

fn encode(truth: &Truth) -> Vec<u8> {
    let body = postcard::to_stdvec(truth).expect("truth is plain data");
    let mut bytes = MAGIC.to_vec();
    bytes.extend(REVISION.to_le_bytes());
    bytes.extend(blake3::hash(&body).as_bytes());
    bytes.extend(body);
    bytes
}

fn decode(bytes: &[u8]) -> Option<Truth> {
    let rest = bytes.strip_prefix(MAGIC)?.strip_prefix(&REVISION.to_le_bytes())?;
    let (hash, body) = rest.split_at_checked(32)?;
    // Postcard would read many damaged files as some other truth.
    (blake3::hash(body).as_bytes() == hash).then(|| postcard::from_bytes(body).ok())?
}
