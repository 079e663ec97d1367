//! `[[scene]]` and `[[path]]`: sources checked and fingerprinted.

use super::axes::{self, Part, expand_part};
use super::fields::Fields;
use super::lab;
use super::source::Place;
use super::tree::{Data, Node, get};
use crate::error::{Error, Result, did_you_mean};
use crate::record::{PathSource, PathSpec, SceneSource, SceneSpec, Up, Winding};
use crate::registry::Spec;
use std::path::{Path, PathBuf};

pub struct Scenes {
    pub scenes: Vec<SceneSpec>,
    /// Of every scene, in the order of the file.
    pub paths: Vec<Vec<PathSpec>>,
    pub names: Names,
}

/// Names that selections may use, also of scenes that have mistakes of their own.
#[derive(Default)]
pub struct Names {
    pub scenes: Vec<String>,
    pub paths: Vec<String>,
}

impl Names {
    pub fn of(&self, axis: &str) -> Option<&[String]> {
        match axis {
            "scene" => Some(&self.scenes),
            "path" => Some(&self.paths),
            _ => None,
        }
    }
}

pub fn read(top: &mut Fields) -> Scenes {
    let mut names = Names::default();
    let mut scenes: Vec<(SceneSpec, Place)> = Vec::new();
    let whole = top.place.clone();
    let tables = top.tables("scene");
    if tables.is_empty() && !top.has("scene") {
        let e = Error::new("the study has no scene");
        top.note(&whole, "scene", e.help("add [[scene]] with a name and a file, or generate = \"arena:map=nucleus\""));
    }
    for mut f in tables {
        let name = f.name("name", "name the scene, such as name = \"hall\"");
        if let Some(name) = &name {
            unique(&mut f, "scene", name, &names.scenes);
            names.scenes.push(name.clone());
        }
        let place = f.place.clone();
        if let Some(scene) = scene(f, name) {
            scenes.push((scene, place));
        }
    }
    let mut paths: Vec<Vec<PathSpec>> = vec![Vec::new(); scenes.len()];
    for mut f in top.tables("path") {
        let name = f.name("name", "name the path, such as name = \"walk\"");
        if let Some(name) = &name {
            unique(&mut f, "path", name, &names.paths);
            names.paths.push(name.clone());
        }
        path(f, name, &scenes, &names, &mut paths);
    }
    for ((scene, place), paths) in scenes.iter().zip(&paths) {
        if paths.is_empty() && top.mistakes.is_empty() {
            let e = Error::new(format!("the scene `{}` has no path", scene.name));
            top.note(place, "path", e.help("add [[path]] with a file, or generate = \"walk:frames=2000\""));
        }
    }
    Scenes { scenes: scenes.into_iter().map(|(s, _)| s).collect(), paths, names }
}

fn unique(f: &mut Fields, what: &str, name: &str, before: &[String]) {
    if before.iter().any(|n| n == name)
        && let Some(node) = f.get("name")
    {
        let e = Error::new(format!("`{name}` names two {what}s"));
        f.note(&node.place, "name", e.help(format!("rename one, such as \"{name}_2\"")));
    }
}

fn scene(mut f: Fields, name: Option<String>) -> Option<SceneSpec> {
    let source = source(&mut f, "scene generator", &lab::generators(), lab::check_generator, &["obj", "gltf", "glb"]);
    let windings = [("ccw", Winding::Ccw), ("cw", Winding::Cw), ("two_sided", Winding::TwoSided)];
    let winding = f.choice("winding", &windings).unwrap_or_default();
    let generated = matches!(source, Some((Source::Generated(_), _)));
    let up = f.choice("up", &[("y", Up::Y), ("z", Up::Z)]).unwrap_or(if generated { Up::Z } else { Up::Y });
    let scale = f.number("scale", "metres a unit, above 0", |x| x > 0.0 && x.is_finite()).unwrap_or(1.0);
    let weld = f.bool("weld").unwrap_or(false);
    let place = f.place.clone();
    let mistakes = f.mistakes;
    let key = f.path.clone();
    f.finish();
    let (source, source_place) = source?;
    let source = match source {
        Source::File(path) => SceneSource::File(path),
        Source::Generated(spec) => SceneSource::Generated(spec),
    };
    match lab::scene_fingerprint(&source, winding, up, scale, weld) {
        Ok(fingerprint) => Some(SceneSpec { name: name?, source, winding, up, scale, weld, fingerprint }),
        Err(e) => {
            mistakes.note(if source_place.span.is_empty() { &place } else { &source_place }, &key, plain(e));
            None
        }
    }
}

fn path(
    mut f: Fields,
    name: Option<String>,
    scenes: &[(SceneSpec, Place)],
    names: &Names,
    paths: &mut [Vec<PathSpec>],
) -> Option<()> {
    let source = source(&mut f, "path generator", &lab::walkers(), lab::check_walker, &["csv"]);
    let frames = f.u32("frames", 1..=10_000_000);
    let stride = f.u32("stride", 1..=1_000_000).unwrap_or(1);
    let mut applies: Vec<&str> = Vec::new();
    let nodes = f.one_or_more("scene");
    for node in nodes.unwrap_or_default() {
        match node.text() {
            Some(scene) if names.scenes.iter().any(|n| n == scene) => applies.push(scene),
            Some(scene) => f.note(&node.place, "scene", unknown_name("scene", scene, &names.scenes)),
            None => {
                let e = Error::new(format!("must be the name of a scene, not {}", node.noun()));
                f.note(&node.place, "scene", e.help("write scene = \"hall\" or scene = [\"hall\", \"yard\"]"));
            }
        }
    }
    if nodes.is_some_and(<[Node]>::is_empty) {
        let place = f.get("scene").map_or(f.place.clone(), |n| n.place.clone());
        f.note(&place, "scene", Error::new("is an empty list").help("remove the key to walk through every scene"));
    }
    let everywhere = nodes.is_none();
    let mistakes = f.mistakes;
    let key = f.path.clone();
    f.finish();
    let (source, place) = source?;
    let source = match source {
        Source::File(path) => PathSource::File(path),
        Source::Generated(spec) => PathSource::Generated(spec),
    };
    let name = name?;
    for ((scene, _), list) in scenes.iter().zip(paths) {
        if !everywhere && !applies.contains(&scene.name.as_str()) {
            continue;
        }
        match lab::path_fingerprint(&source, &scene.fingerprint) {
            Ok(fingerprint) => {
                list.push(PathSpec { name: name.clone(), source: source.clone(), frames, stride, fingerprint });
            }
            Err(e) => mistakes.note(&place, &key, plain(e)),
        }
    }
    Some(())
}

pub fn unknown_name(what: &str, name: &str, known: &[String]) -> Error {
    let mut e = Error::new(format!("there is no {what} `{name}`"));
    e.help = Some(match did_you_mean(name, known.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => format!("the manifest names no {what}"),
        None => format!("{what}s: {}", known.join(", ")),
    });
    e
}

/// The lab's error without its own place: the manifest has a better one. What
/// the file is stays in the sentence.
fn plain(mut e: Error) -> Error {
    if let Some(file) = e.file.take() {
        e.message = format!("{}: {}", file.display(), e.message);
    }
    e.line = None;
    e.column = None;
    e
}

enum Source {
    File(PathBuf),
    Generated(Spec),
}

/// `file = "..."` or `generate = ...`, exactly one of them.
fn source(
    f: &mut Fields,
    what: &'static str,
    parts: &[Part],
    check: fn(&Spec) -> Result<Spec>,
    extensions: &[&str],
) -> Option<(Source, Place)> {
    let file = f.get("file");
    let generate = f.get("generate");
    match (file, generate) {
        (Some(_), Some(node)) => {
            let e = Error::new("stands beside `file`");
            f.note(&node.place, "generate", e.help("keep one of `file` and `generate`"));
            None
        }
        (None, None) => {
            let example = parts.first().map_or("...", |p| p.name);
            f.missing("file", format!("give a file ({}), or generate = \"{example}\"", extensions.join(", ")));
            None
        }
        (Some(node), None) => {
            let text = f.text("file")?;
            let path = f.mistakes.sources.folder(&node.place).join(text);
            let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
            if !extensions.contains(&extension.as_str()) {
                let e = Error::new(format!("`{text}` is of no known type"));
                f.note(&node.place, "file", e.help(format!("known: {}", extensions.join(", "))));
                return None;
            }
            if let Err(e) = readable(&path) {
                f.note(&node.place, "file", e);
                return None;
            }
            Some((Source::File(path), node.place.clone()))
        }
        (None, Some(node)) => {
            let key = f.key("generate");
            let specs = match &node.data {
                Data::Text(text) => match axes::read_single(check, parts, text) {
                    Ok(spec) => vec![spec],
                    Err((word, e)) => {
                        f.mistakes.note(&axes::within(f.mistakes, node, word.as_deref()), &key, e);
                        Vec::new()
                    }
                },
                Data::Table(table) if get(table, "kind").is_some() => {
                    let (kind, part) = axes::read_kind(f.mistakes, &key, what, parts, node)?;
                    expand_part(f.mistakes, &key, node, &kind, part.params, check)
                }
                _ => {
                    let e = Error::new(format!("must name a {what}"));
                    let example = parts.first().map_or("...", |p| p.name);
                    f.note(&node.place, "generate", e.help(format!("write generate = \"{example}\"")));
                    Vec::new()
                }
            };
            if specs.len() > 1 {
                let e = Error::new(format!("means {} scenes or paths at once", specs.len()));
                f.note(&node.place, "generate", e.help("give single values, and an entry for each"));
                return None;
            }
            specs.into_iter().next().map(|spec| (Source::Generated(spec), node.place.clone()))
        }
    }
}

fn readable(path: &Path) -> Result<()> {
    let problem = match std::fs::File::open(path).and_then(|f| f.metadata()) {
        Ok(meta) if meta.is_file() => return Ok(()),
        Ok(_) => "is no file".to_string(),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => "does not exist".to_string(),
        Err(e) => format!("cannot be read: {e}"),
    };
    let mut error = Error::new(format!("{} {problem}", path.display()));
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let wanted = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let beside: Vec<String> = std::fs::read_dir(if folder.as_os_str().is_empty() { Path::new(".") } else { &folder })
        .map(|dir| dir.flatten().map(|e| e.file_name().to_string_lossy().into_owned()).collect())
        .unwrap_or_default();
    error.help = Some(match did_you_mean(&wanted, beside.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => "files start from the folder of the manifest that names them".to_string(),
    });
    Err(error)
}
