//! Camera paths: read from CSV in the scene's own units and axes, or walked by a
//! generator in the scene's free space; always handed on in world metres, z up.

pub mod csv;
pub mod generate;

use super::placement::Placement;
use super::{Scene, cache, load as scenes};
use crate::error::{Error, Result};
use crate::math::Pose;
use crate::record::{PathSource, PathSpec, SceneSpec};
use crate::registry::{self, Spec};
use std::path::Path;

/// Raised when the same file or walk gives different poses.
pub const REVISION: u32 = 1;

/// Identity of a path before `frames` and `stride`: file bytes, or walk parameters
/// and revision, with the scene that it is walked in (a CSV shares its placement).
///
/// # Errors
/// If the file cannot be read or the generator does not know a parameter.
pub fn fingerprint(source: &PathSource, scene_fingerprint: &str) -> Result<String> {
    let mut h = blake3::Hasher::new();
    h.update(b"cullmark path fingerprint");
    h.update(&REVISION.to_le_bytes());
    h.update(scene_fingerprint.as_bytes());
    match source {
        PathSource::File(path) => {
            h.update(b"\0csv\0");
            h.update(&csv::read_bytes(path)?);
        }
        PathSource::Generated(spec) => {
            let (_, resolved) = generate::make(spec)?;
            let (entry, _) = registry::find("walkthrough generator", generate::ALL, &resolved)?;
            h.update(b"\0walk\0");
            h.update(resolved.to_string().as_bytes());
            h.update(&entry.revision.to_le_bytes());
        }
    }
    Ok(h.finalize().to_hex()[..32].to_string())
}

/// The poses to run: world metres, z up, the first `frames` of them, every `stride`-th.
///
/// # Errors
/// A malformed file (line and column named), a walk that finds no free space, or
/// no frame at all.
pub fn load(path: &PathSpec, scene_spec: &SceneSpec, scene: &Scene) -> Result<Vec<Pose>> {
    select(path, whole(path, scene_spec, scene, None)?)
}

/// Like [`load`]; generated walks are kept in `cache_dir/paths/<fingerprint>.bin`.
///
/// # Errors
/// Those of [`load`], and a source that changed since the fingerprint was taken.
pub fn load_cached(path: &PathSpec, scene_spec: &SceneSpec, scene: &Scene, cache_dir: &Path) -> Result<Vec<Pose>> {
    // A CSV is read anew: that is as fast as the cache.
    let file = cache::path_file(cache_dir, &path.fingerprint);
    let generated = matches!(path.source, PathSource::Generated(_));
    if generated && let Some(poses) = cache::fetch_path(&file) {
        return select(path, poses);
    }
    if fingerprint(&path.source, &scene_spec.fingerprint)? != path.fingerprint {
        let mut e = Error::new(format!("path `{}` is not what it was when the run was planned", path.name));
        if let PathSource::File(path) = &path.source {
            e = e.in_file(path);
        }
        return Err(e.help("the file changed, or another version of cullmark planned it: start the study again"));
    }
    let poses = whole(path, scene_spec, scene, Some(cache_dir))?;
    if generated {
        cache::store_path(&file, &poses);
    }
    select(path, poses)
}

fn whole(path: &PathSpec, scene_spec: &SceneSpec, scene: &Scene, cache_dir: Option<&Path>) -> Result<Vec<Pose>> {
    match &path.source {
        PathSource::File(file) => {
            let placement = Placement::of(scene_spec)?;
            Ok(csv::read(file)?.iter().map(|f| placement.pose(&f.pose)).collect())
        }
        PathSource::Generated(spec) => match scenes::unplaced(scene_spec)? {
            None => generate::make(spec)?.0.walk(scene),
            Some((base, placement)) => {
                let poses = walk_in(&path.source, spec, &base, cache_dir)?;
                Ok(poses.iter().map(|p| placement.pose(p)).collect())
            }
        },
    }
}

/// The walk `spec` in a scene that is yet to be placed; all its places share it.
fn walk_in(source: &PathSource, spec: &Spec, base: &SceneSpec, cache_dir: Option<&Path>) -> Result<Vec<Pose>> {
    let (walker, _) = generate::make(spec)?;
    let Some(cache_dir) = cache_dir else { return walker.walk(&scenes::load(base)?) };
    let file = cache::path_file(cache_dir, &fingerprint(source, &base.fingerprint)?);
    if let Some(poses) = cache::fetch_path(&file) {
        return Ok(poses);
    }
    let poses = walker.walk(&scenes::load_cached(base, cache_dir)?)?;
    cache::store_path(&file, &poses);
    Ok(poses)
}

fn select(path: &PathSpec, poses: Vec<Pose>) -> Result<Vec<Pose>> {
    if path.stride == 0 {
        return Err(Error::new("stride is 0, but must be at least 1").key("stride").help("1 uses every frame"));
    }
    let first = path.frames.map_or(poses.len(), |f| f as usize);
    let chosen: Vec<Pose> = poses.into_iter().take(first).step_by(path.stride as usize).collect();
    if chosen.is_empty() {
        return Err(Error::new(format!("path `{}` has no frames", path.name))
            .key("frames")
            .help("a walkthrough needs at least one frame"));
    }
    Ok(chosen)
}
