//! Wavefront OBJ. The survey walks the lines once, keeps what concerns triangles
//! (`v` and `f`) for tobj, and notes objects, groups, materials and libraries
//! itself: tobj would read polylines as faces, forgets the names of materials
//! whose library is missing, and says what is wrong but not where. When tobj
//! refuses, [`locate`] finds the line.

use super::load::read_beside;
use super::mtl;
use super::{LoadReport, Scene};
use crate::error::{Error, Result};
use crate::math::DVec3;
use std::collections::HashMap;
use std::path::Path;

/// Reads an OBJ as it stands: file units and axes, every face, not yet sanitised.
/// `bytes` are the content of `path`; libraries are looked for beside it.
///
/// # Errors
/// Malformed lines and indices out of range, with file and line.
pub fn read(path: &Path, bytes: &[u8]) -> Result<Scene> {
    let survey = Survey::of(bytes);
    let located = |e: tobj::LoadError| locate(bytes, &e).in_file(path);
    if let Some(line) = survey.cut_face {
        return Err(Error::new("a face with fewer than three corners ends the file, without a line break")
            .in_file(path)
            .at(line, None)
            .help("the file was probably cut short: copy or export it again"));
    }
    // One tobj model with corners as they are: polygons are cut up here, where the shape is known.
    let options = tobj::LoadOptions { single_index: false, ..Default::default() };
    let mut reader = &survey.clean[..];
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, |_| Ok(Default::default())).map_err(located)?;
    let mesh = &models.first().expect("tobj always closes its last model").mesh;
    let mut scene = Scene {
        positions: mesh.positions.chunks_exact(3).map(DVec3::from_slice).collect(),
        report: LoadReport { points_and_lines: survey.points_and_lines, ..Default::default() },
        ..Scene::default()
    };
    let crooked = triangulate(&mut scene, mesh, &survey.runs);
    if crooked > 0 {
        scene.report.warnings.push(format!(
            "{crooked} polygons are too concave to fan from any corner; their triangles may overlap (triangulate on export)"
        ));
    }
    if let Some(line) = survey.unterminated {
        scene.report.warnings.push(format!("line {line}, the last one, has no line break: the file may be cut short"));
    }
    if survey.short_faces > 0 {
        scene.report.warnings.push(format!("{} faces have fewer than three corners; left out", survey.short_faces));
    }
    name_materials(&mut scene, path, &survey);
    scene.source_triangle_count = u32::try_from(scene.len()).map_err(|_| {
        Error::new("more than 4,294,967,295 triangles").in_file(path).help("split the scene into several files")
    })?;
    scene.report.triangles_in_file = scene.len() as u64;
    scene.source_triangle_id = (0..scene.source_triangle_count).collect();
    Ok(scene)
}

/// From face number `first_face` on: this object and this material.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Run {
    first_face: usize,
    object: u32,
    material: u32,
}

/// What one walk over the lines finds.
#[derive(Default)]
struct Survey {
    /// The `v` and `f` lines alone, `v` cut to its coordinates.
    clean: Vec<u8>,
    runs: Vec<Run>,
    /// By first use.
    materials: Vec<String>,
    libraries: Vec<(u32, String)>,
    points_and_lines: u64,
    short_faces: u64,
    /// The last line, if no line break ends it and it holds geometry.
    unterminated: Option<u32>,
    cut_face: Option<u32>,
}

impl Survey {
    fn of(bytes: &[u8]) -> Survey {
        let mut s = Survey { clean: Vec::with_capacity(bytes.len()), ..Default::default() };
        let mut names = (HashMap::new(), HashMap::new());
        let (mut object, mut group, mut material) = (String::new(), String::new(), String::new());
        let (mut faces, mut changed) = (0usize, true);
        for (number, line, ended) in lines(bytes) {
            let (keyword, rest) = split_word(&line);
            let text = || String::from_utf8_lossy(rest).trim().to_string();
            match keyword {
                b"v" => {
                    s.clean.extend_from_slice(b"v ");
                    s.clean.extend_from_slice(coordinates(rest));
                    s.clean.push(b'\n');
                }
                b"f" => {
                    let corners = count_words(rest);
                    if corners < 3 {
                        if !ended {
                            s.cut_face = Some(number);
                        }
                        s.points_and_lines += 1;
                        s.short_faces += 1;
                        continue;
                    }
                    if std::mem::take(&mut changed) {
                        let object = number_of(&mut names.0, (object.clone(), group.clone()));
                        let id = number_of(&mut names.1, material.clone());
                        if id as usize == s.materials.len() {
                            s.materials.push(material.clone());
                        }
                        let run = Run { first_face: faces, object, material: id };
                        if s.runs.last().is_none_or(|l| (l.object, l.material) != (run.object, run.material)) {
                            s.runs.push(run);
                        }
                    }
                    faces += 1;
                    s.clean.extend_from_slice(b"f");
                    s.clean.extend_from_slice(rest);
                    s.clean.push(b'\n');
                }
                b"o" => (object, changed) = (text(), true),
                b"g" => (group, changed) = (text(), true),
                b"usemtl" => (material, changed) = (text(), true),
                b"mtllib" => s.libraries.push((number, text())),
                b"l" | b"p" => s.points_and_lines += 1,
                _ => continue,
            }
            s.unterminated = (!ended && matches!(keyword, b"v" | b"f")).then_some(number);
        }
        s
    }
}

fn number_of<K: std::hash::Hash + Eq>(names: &mut HashMap<K, u32>, key: K) -> u32 {
    let next = names.len() as u32;
    *names.entry(key).or_insert(next)
}

/// Lines with their number, from 1, and whether a line break ends them. A backslash
/// at the end joins a line with the next.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (u32, std::borrow::Cow<'_, [u8]>, bool)> {
    let mut raw = bytes.split_inclusive(|b| *b == b'\n');
    let mut number = 0u32;
    std::iter::from_fn(move || {
        let mut line = raw.next()?;
        number = number.saturating_add(1);
        let (at, mut ended) = (number, line.ends_with(b"\n"));
        line = line.trim_ascii();
        if !line.ends_with(b"\\") {
            return Some((at, line.into(), ended));
        }
        let mut joined = Vec::new();
        while let Some(part) = line.strip_suffix(b"\\") {
            joined.extend_from_slice(part);
            joined.push(b' ');
            let Some(next) = raw.next() else {
                return Some((at, joined.into(), ended));
            };
            number = number.saturating_add(1);
            ended = next.ends_with(b"\n");
            line = next.trim_ascii();
        }
        joined.extend_from_slice(line);
        Some((at, joined.into(), ended))
    })
}

/// First word and the rest, the white space included.
pub(super) fn split_word(line: &[u8]) -> (&[u8], &[u8]) {
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    line.split_at(end)
}

fn count_words(text: &[u8]) -> usize {
    let (mut words, mut inside) = (0, false);
    for b in text {
        let blank = b.is_ascii_whitespace();
        words += usize::from(!blank && !inside);
        inside = !blank;
    }
    words
}

/// `x y z`, or `x y z w` if just a weight follows; colours after them are cut off.
fn coordinates(rest: &[u8]) -> &[u8] {
    match count_words(rest) {
        0..=4 => rest,
        _ => {
            let word = |text: &[u8]| {
                let start = text.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(text.len());
                start + split_word(&text[start..]).0.len()
            };
            let end = (0..3).fold(0, |end, _| end + word(&rest[end..]));
            &rest[..end]
        }
    }
}

/// Fans every face from a corner that suits its shape and numbers the triangles
/// by the runs. Returns how many polygons no fan suits.
fn triangulate(scene: &mut Scene, mesh: &tobj::Mesh, runs: &[Run]) -> u64 {
    let all_triangles = mesh.face_arities.is_empty();
    let faces = if all_triangles { mesh.indices.len() / 3 } else { mesh.face_arities.len() };
    let (mut at, mut run, mut crooked) = (0usize, 0usize, 0u64);
    for face in 0..faces {
        let corners = if all_triangles { 3 } else { mesh.face_arities[face] as usize };
        let polygon = &mesh.indices[at..at + corners];
        at += corners;
        while runs.get(run + 1).is_some_and(|r| r.first_face <= face) {
            run += 1;
        }
        let start = if corners == 3 { Some(0) } else { fan_start(&scene.positions, polygon) };
        crooked += u64::from(start.is_none());
        let corner = |k: usize| polygon[(start.unwrap_or(0) + k) % corners];
        for k in 1..corners - 1 {
            scene.triangles.push([corner(0), corner(k), corner(k + 1)]);
            scene.object_id.push(runs[run].object);
            scene.material_id.push(runs[run].material);
        }
    }
    crooked
}

/// The first corner from which a fan folds over nowhere: every triangle faces as
/// the whole polygon does (Newell's normal).
fn fan_start(positions: &[DVec3], polygon: &[u32]) -> Option<usize> {
    let n = polygon.len();
    let p = |k: usize| positions[polygon[k % n] as usize];
    let base = p(0);
    let normal = (0..n).fold(DVec3::ZERO, |sum, k| sum + (p(k) - base).cross(p(k + 1) - base));
    let folds = |s: usize, k: usize| (p(s + k) - p(s)).cross(p(s + k + 1) - p(s)).dot(normal) < 0.0;
    // A polygon of hundreds of corners is a disc or a mistake: quadratic search stops there.
    (0..n.min(64)).find(|s| !(1..n - 1).any(|k| folds(*s, k)))
}

/// Names, and translucency from the libraries; what is missing becomes a warning.
fn name_materials(scene: &mut Scene, path: &Path, survey: &Survey) {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut known = HashMap::new();
    let mut all_read = !survey.libraries.is_empty();
    for (line, name) in &survey.libraries {
        for file in mtl::resolve(folder, name) {
            match read_beside(&file) {
                Ok(text) => known.extend(mtl::parse(&text)),
                Err(e) => {
                    all_read = false;
                    scene.report.warnings.push(format!(
                        "line {line}: material library {} not read ({e}); its materials are taken as opaque",
                        file.display()
                    ));
                }
            }
        }
    }
    let unknown = survey.materials.iter().filter(|m| !m.is_empty() && !known.contains_key(*m)).count();
    if all_read && unknown > 0 {
        scene.report.warnings.push(format!("{unknown} materials are in no library; taken as opaque"));
    }
    let opaque: Vec<bool> = survey.materials.iter().map(|m| known.get(m).is_none_or(|m| m.opaque)).collect();
    scene.occluder = scene.material_id.iter().map(|m| opaque[*m as usize]).collect();
    scene.two_sided = vec![false; scene.len()];
    scene.material_names =
        survey.materials.iter().map(|m| if m.is_empty() { "(none)".to_string() } else { m.clone() }).collect();
}

/// The second pass: the first line that tobj cannot have liked.
fn locate(bytes: &[u8], cause: &tobj::LoadError) -> Error {
    let vertices = lines(bytes).filter(|(_, line, _)| split_word(line).0 == b"v").count() as i64;
    let mut so_far = 0i64;
    for (number, line, ended) in lines(bytes) {
        let (keyword, rest) = split_word(&line);
        let rest = String::from_utf8_lossy(rest);
        let wrong = match keyword {
            b"v" => {
                so_far += 1;
                wrong_vertex(&rest)
            }
            b"f" => rest.split_whitespace().find_map(|corner| wrong_corner(corner, so_far, vertices)),
            _ => None,
        };
        if let Some(message) = wrong {
            let help = if ended {
                "correct the line, or export the file again"
            } else {
                "the file was probably cut short: copy or export it again"
            };
            return Error::new(message).at(number, None).help(help);
        }
    }
    Error::new(format!("not a readable OBJ: {cause}"))
}

fn wrong_vertex(rest: &str) -> Option<String> {
    let words: Vec<&str> = rest.split_whitespace().collect();
    if words.len() < 3 {
        return Some(format!("a vertex needs three coordinates, but has {}", words.len()));
    }
    let used = if words.len() == 4 { 4 } else { 3 };
    if let Some(word) = words[..used].iter().find(|w| w.parse::<f64>().is_err()) {
        return Some(format!("`{}` is not a number", shorten(word)));
    }
    (used == 4 && words[3].parse() == Ok(0.0)).then(|| "the vertex has weight 0, a point at infinity".to_string())
}

fn wrong_corner(corner: &str, so_far: i64, vertices: i64) -> Option<String> {
    let mut parts = corner.split('/');
    let first = parts.next().unwrap_or("");
    let malformed = || Some(format!("`{}` is not a corner of a face (v, v/vt, v//vn or v/vt/vn)", shorten(corner)));
    let rest: Vec<&str> = parts.collect();
    if rest.len() > 2 || rest.iter().any(|p| !p.is_empty() && p.parse::<i64>().is_err()) {
        return malformed();
    }
    match first.parse::<i64>() {
        Ok(0) => Some("vertex 0 does not exist: OBJ counts from 1".to_string()),
        Ok(i) if i > vertices => Some(format!("vertex {i} does not exist: the file has {vertices}")),
        Ok(i) if i < -so_far => Some(format!("vertex {i} does not exist: {so_far} come before this line")),
        Ok(_) => None,
        Err(_) => malformed(),
    }
}

fn shorten(word: &str) -> String {
    if word.chars().count() > 40 { word.chars().take(40).chain(['…']).collect() } else { word.to_string() }
}
