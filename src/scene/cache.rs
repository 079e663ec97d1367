//! Decoded scenes and walked paths on disk, by fingerprint. A cache only saves
//! time: whatever is wrong with a file in it, or with writing one, is as if it
//! were not there.
//!
//! A file is a magic word, the blake3 of the rest, and the rest. Files appear by
//! renaming, so that processes sharing a folder never see half of one.

use super::{LoadReport, Scene};
use crate::math::{DVec3, Pose};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Raised when the layout below changes; older files are then written anew.
const SCENE: &[u8; 8] = b"CMSCENE1";
const PATH: &[u8; 8] = b"CMPATH_1";

pub fn scene_file(cache_dir: &Path, fingerprint: &str) -> PathBuf {
    cache_dir.join("scenes").join(format!("{fingerprint}.bin"))
}

pub fn path_file(cache_dir: &Path, fingerprint: &str) -> PathBuf {
    cache_dir.join("paths").join(format!("{fingerprint}.bin"))
}

/// What precedes the arrays; postcard keeps every bit of the floats.
#[derive(Serialize, Deserialize)]
struct Header {
    name: String,
    origin: DVec3,
    positions: u64,
    triangles: u64,
    material_names: Vec<String>,
    source_triangle_count: u32,
    report: LoadReport,
}

pub fn store_scene(file: &Path, scene: &Scene) {
    let header = Header {
        name: scene.name.clone(),
        origin: scene.origin,
        positions: scene.positions.len() as u64,
        triangles: scene.len() as u64,
        material_names: scene.material_names.clone(),
        source_triangle_count: scene.source_triangle_count,
        report: scene.report.clone(),
    };
    let Ok(header) = postcard::to_stdvec(&header) else { return };
    let mut out = Vec::with_capacity(header.len() + scene.positions.len() * 24 + scene.len() * 25 + 8);
    out.extend_from_slice(&(header.len() as u64).to_le_bytes());
    out.extend_from_slice(&header);
    scene.positions.iter().flat_map(DVec3::to_array).for_each(|x| out.extend_from_slice(&x.to_le_bytes()));
    let mut words = |words: &mut dyn Iterator<Item = u32>| words.for_each(|w| out.extend_from_slice(&w.to_le_bytes()));
    words(&mut scene.triangles.iter().flatten().copied());
    words(&mut scene.source_triangle_id.iter().copied());
    words(&mut scene.object_id.iter().copied());
    words(&mut scene.material_id.iter().copied());
    out.extend(scene.two_sided.iter().zip(&scene.occluder).map(|(t, o)| u8::from(*t) | u8::from(*o) << 1));
    store(file, SCENE, &out);
}

/// `None` if there is no such file, or it is damaged or of another version.
pub fn fetch_scene(file: &Path) -> Option<Scene> {
    let bytes = fetch(file, SCENE)?;
    let mut rest = &bytes[START..];
    let mut take = |n: usize| {
        let (head, tail) = rest.split_at_checked(n)?;
        rest = tail;
        Some(head)
    };
    let length = u64::from_le_bytes(take(8)?.try_into().ok()?);
    let header: Header = postcard::from_bytes(take(usize::try_from(length).ok()?)?).ok()?;
    let (p, n) = (usize::try_from(header.positions).ok()?, usize::try_from(header.triangles).ok()?);
    let real = |b: &[u8]| f64::from_le_bytes(b.try_into().expect("eight bytes"));
    let word = |b: &[u8]| u32::from_le_bytes(b.try_into().expect("four bytes"));
    let words = |bytes: &[u8]| bytes.chunks_exact(4).map(word).collect::<Vec<u32>>();
    let positions = take(p.checked_mul(24)?)?;
    let triangles = take(n.checked_mul(12)?)?;
    let [source, object, material] = [take(n * 4)?, take(n * 4)?, take(n * 4)?];
    let flags = take(n)?;
    Some(Scene {
        name: header.name,
        origin: header.origin,
        positions: positions
            .chunks_exact(24)
            .map(|b| DVec3::new(real(&b[..8]), real(&b[8..16]), real(&b[16..])))
            .collect(),
        triangles: triangles.chunks_exact(12).map(|b| [word(&b[..4]), word(&b[4..8]), word(&b[8..])]).collect(),
        source_triangle_id: words(source),
        object_id: words(object),
        material_id: words(material),
        two_sided: flags.iter().map(|f| f & 1 == 1).collect(),
        occluder: flags.iter().map(|f| f & 2 == 2).collect(),
        material_names: header.material_names,
        source_triangle_count: header.source_triangle_count,
        report: header.report,
    })
}

pub fn store_path(file: &Path, poses: &[Pose]) {
    if let Ok(bytes) = postcard::to_stdvec(poses) {
        store(file, PATH, &bytes);
    }
}

pub fn fetch_path(file: &Path) -> Option<Vec<Pose>> {
    postcard::from_bytes(&fetch(file, PATH)?[START..]).ok()
}

/// Magic and hash.
const START: usize = 8 + 32;

fn store(file: &Path, magic: &[u8; 8], content: &[u8]) {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let Some(folder) = file.parent() else { return };
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let temporary = folder.join(format!(".{}.{number}.tmp", std::process::id()));
    let write = || -> std::io::Result<()> {
        use std::io::Write;
        std::fs::create_dir_all(folder)?;
        let mut out = std::fs::File::create(&temporary)?;
        out.write_all(magic)?;
        out.write_all(blake3::hash(content).as_bytes())?;
        out.write_all(content)?;
        drop(out);
        std::fs::rename(&temporary, file)
    };
    if write().is_err() {
        let _ = std::fs::remove_file(&temporary);
    }
}

fn fetch(file: &Path, magic: &[u8; 8]) -> Option<Vec<u8>> {
    let bytes = std::fs::read(file).ok()?;
    let content = bytes.get(START..)?;
    (bytes.starts_with(magic) && bytes[8..START] == *blake3::hash(content).as_bytes()).then_some(bytes)
}
