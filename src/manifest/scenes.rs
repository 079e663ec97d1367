//! `[[scene]]` and `[[path]]`: sources checked and fingerprinted.

use super::axes::Part;
use super::entries::{self, expand_part};
use super::families::{self, MAX_MEMBERS, SCALE, Word};
use super::fields::Fields;
use super::lab;
use super::source::Place;
use super::tree::{Data, Node, get};
use crate::claim::{FAMILY, Selector};
use crate::error::{Error, Result, did_you_mean};
use crate::record::{PathSource, PathSpec, SceneSource, SceneSpec, Up, Winding};
use crate::registry::Spec;
use std::path::{Path, PathBuf};

pub struct Scenes {
    pub scenes: Vec<SceneSpec>,
    /// Of every scene, in the order of the file.
    pub paths: Vec<Vec<PathSpec>>,
    pub names: Names,
    /// Optional scenes whose files are not there: name and reason.
    pub absent: Vec<(String, String)>,
}

/// Names that selections may use, also of scenes that have mistakes of their own.
#[derive(Default)]
pub struct Names {
    /// Those that are here, by number; then the optional ones that are not.
    pub scenes: Vec<String>,
    pub here: usize,
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
    let mut absent = Vec::new();
    let whole = top.place.clone();
    let tables = top.tables("scene");
    if tables.is_empty() && !top.has("scene") {
        let e = Error::new("the study has no scene");
        top.note(&whole, "scene", e.help("add [[scene]] with a name and a file, or generate = \"arena:map=nucleus\""));
    }
    for mut f in tables {
        let name = f.name("name", "name the scene, such as name = \"hall\"");
        unique(&mut f, "scene", name.as_deref(), &names.scenes);
        if let (Some(why), Some(name)) = (missing(&mut f), &name) {
            absent.push((name.clone(), why));
            continue;
        }
        let place = f.place.clone();
        let members = scene(f, name.as_deref());
        // A scene with mistakes keeps its name, so that rules about it are not mistakes too.
        names.scenes.extend(if members.is_empty() { Vec::from_iter(name) } else { member_names(&members) });
        scenes.extend(members.into_iter().map(|s| (s, place.clone())));
    }
    names.here = names.scenes.len();
    names.scenes.extend(absent.iter().map(|(name, _)| name.clone()));
    let mut paths: Vec<Vec<PathSpec>> = vec![Vec::new(); scenes.len()];
    for mut f in top.tables("path") {
        let name = f.name("name", "name the path, such as name = \"walk\"");
        unique(&mut f, "path", name.as_deref(), &names.paths);
        if let (Some(_), Some(name)) = (missing(&mut f), &name) {
            names.paths.push(name.clone());
            continue;
        }
        let members = path(f, name.as_deref(), &scenes, &names, &mut paths);
        names.paths.extend(if members.is_empty() { Vec::from_iter(name) } else { members });
    }
    if let ([], [(name, why), ..]) = (&scenes[..], &absent[..])
        && top.mistakes.is_empty()
    {
        let e = Error::new(format!("no scene of the study is there: `{name}`, for one: {why}"));
        top.note(&whole, "scene", e.help("put the files in their place, or set the variable that names their folder"));
    }
    for ((scene, place), paths) in scenes.iter().zip(&paths) {
        if paths.is_empty() && top.mistakes.is_empty() {
            let e = Error::new(format!("the scene `{}` has no path", scene.name));
            top.note(place, "path", e.help("add [[path]] with a file, or generate = \"walk:frames=2000\""));
        }
    }
    Scenes { scenes: scenes.into_iter().map(|(s, _)| s).collect(), paths, names, absent }
}

fn member_names(members: &[SceneSpec]) -> Vec<String> {
    members.iter().map(|s| s.name.clone()).collect()
}

/// `hall` of `hall@offset_m=1e4`.
fn family(name: &str) -> &str {
    name.split(FAMILY).next().unwrap_or(name)
}

fn unique(f: &mut Fields, what: &str, name: Option<&str>, before: &[String]) {
    if let Some(name) = name.filter(|name| before.iter().any(|n| family(n) == *name))
        && let Some(node) = f.get("name")
    {
        let e = Error::new(format!("`{name}` names two {what}s"));
        f.note(&node.place, "name", e.help(format!("rename one, such as \"{name}_2\"")));
    }
}

/// Why an entry with `optional = true` is left out: its file is not there.
fn missing(f: &mut Fields) -> Option<String> {
    let optional = f.bool("optional").unwrap_or(false);
    let node = f.get("file").filter(|_| optional)?;
    let path = f.mistakes.sources.resolve(&node.place, node.text()?);
    path.and_then(|p| readable(&p)).err().map(|e| e.message)
}

/// Every scene that an entry means; none if it has mistakes.
fn scene(mut f: Fields, name: Option<&str>) -> Vec<SceneSpec> {
    let source = source(&mut f, "scene generator", &lab::generators(), lab::check_generator, &["obj", "gltf", "glb"]);
    let windings = [("ccw", Winding::Ccw), ("cw", Winding::Cw), ("two_sided", Winding::TwoSided)];
    let winding = f.choice("winding", &windings).unwrap_or_default();
    let generated = matches!(&source, Some((Source::Generated(_), _)));
    let up = f.choice("up", &[("y", Up::Y), ("z", Up::Z)]).unwrap_or(if generated { Up::Z } else { Up::Y });
    let mut scales = families::numbers(&mut f, &SCALE, "metres a unit, above 0", |x| x > 0.0 && x.is_finite());
    if scales.is_empty() {
        scales.push((Word::Number(1.0), 1.0));
    }
    let mut offsets = families::offsets(&mut f);
    if offsets.is_empty() {
        offsets.push((Word::Number(0.0), [0.0; 3]));
    }
    let weld = f.bool("weld").unwrap_or(false);
    let (place, mistakes, key) = (f.place.clone(), f.mistakes, f.path.clone());
    f.finish();
    let (Some((source, source_place)), Some(name)) = (source, name) else { return Vec::new() };
    let sources = match source {
        Source::File(path) => vec![(String::new(), SceneSource::File(path))],
        Source::Generated(specs) => named(specs, SceneSource::Generated),
    };
    let count = sources.len() * scales.len() * offsets.len();
    if count > MAX_MEMBERS {
        mistakes.note(&place, &key, too_many(count, "scenes"));
        return Vec::new();
    }
    let mut out = Vec::new();
    for (of_source, source) in &sources {
        for (of_scale, (_, scale)) in families::suffixes("scale", &scales).iter().zip(&scales) {
            let fingerprint = match lab::scene_fingerprint(source, winding, up, *scale, weld) {
                Ok(fingerprint) => fingerprint,
                Err(e) => {
                    mistakes.note(if source_place.span.is_empty() { &place } else { &source_place }, &key, plain(e));
                    return Vec::new();
                }
            };
            for (of_offset, (_, offset_m)) in families::suffixes("offset_m", &offsets).iter().zip(&offsets) {
                let name = format!("{name}{of_source}{of_scale}{of_offset}");
                let (source, fingerprint) = (source.clone(), fingerprint.clone());
                let still =
                    SceneSpec { name, source, winding, up, scale: *scale, weld, offset_m: [0.0; 3], fingerprint };
                out.push(lab::moved(still, *offset_m));
            }
        }
    }
    out
}

fn named<T>(specs: Vec<Spec>, make: fn(Spec) -> T) -> Vec<(String, T)> {
    families::spec_suffixes(&specs).into_iter().zip(specs.into_iter().map(make)).collect()
}

fn too_many(count: usize, what: &str) -> Error {
    Error::new(format!("means {count} {what}, more than {MAX_MEMBERS}")).help("shorten its lists and ranges")
}

/// Adds the paths of an entry to the scenes that they apply to; returns their names.
fn path(
    mut f: Fields,
    name: Option<&str>,
    scenes: &[(SceneSpec, Place)],
    names: &Names,
    paths: &mut [Vec<PathSpec>],
) -> Vec<String> {
    let source = source(&mut f, "path generator", &lab::walkers(), lab::check_walker, &["csv"]);
    let frames = f.u32("frames", 1..=10_000_000);
    let stride = f.u32("stride", 1..=1_000_000).unwrap_or(1);
    let mut applies: Vec<Selector> = Vec::new();
    let nodes = f.one_or_more("scene");
    for node in nodes.unwrap_or_default() {
        let Some(text) = node.text() else {
            let e = Error::new(format!("must be the name of a scene, not {}", node.noun()));
            f.note(&node.place, "scene", e.help("write scene = \"hall\" or scene = [\"hall\", \"yard\"]"));
            continue;
        };
        match Selector::parse(text).ok().filter(|s| names.scenes.iter().any(|n| s.matches(&[Spec::new(n)]))) {
            Some(selector) => applies.push(selector),
            None => f.note(&node.place, "scene", unknown_name("scene", text, &names.scenes)),
        }
    }
    if nodes.is_some_and(<[Node]>::is_empty) {
        let place = f.get("scene").map_or(f.place.clone(), |n| n.place.clone());
        f.note(&place, "scene", Error::new("is an empty list").help("remove the key to walk through every scene"));
    }
    let everywhere = nodes.is_none();
    let (whole, mistakes, key) = (f.place.clone(), f.mistakes, f.path.clone());
    f.finish();
    let (Some((source, place)), Some(name)) = (source, name) else { return Vec::new() };
    let sources = match source {
        Source::File(path) => vec![(String::new(), PathSource::File(path))],
        Source::Generated(specs) => named(specs, PathSource::Generated),
    };
    if sources.len() > MAX_MEMBERS {
        mistakes.note(&whole, &key, too_many(sources.len(), "paths"));
        return Vec::new();
    }
    let mut out = Vec::new();
    for (suffix, source) in &sources {
        let name = format!("{name}{suffix}");
        for ((scene, _), list) in scenes.iter().zip(paths.iter_mut()) {
            if !everywhere && !applies.iter().any(|s| s.matches(&[Spec::new(&scene.name)])) {
                continue;
            }
            match lab::path_fingerprint(source, &scene.fingerprint) {
                Ok(fingerprint) => {
                    list.push(PathSpec { name: name.clone(), source: source.clone(), frames, stride, fingerprint });
                }
                Err(e) => mistakes.note(&place, &key, plain(e)),
            }
        }
        out.push(name);
    }
    out
}

/// Members of a family are suggested by its name.
pub fn unknown_name(what: &str, name: &str, known: &[String]) -> Error {
    let mut e = Error::new(format!("there is no {what} `{name}`"));
    let mut families: Vec<&str> = known.iter().map(|n| family(n)).collect();
    families.dedup();
    let all = known.iter().map(String::as_str).filter(|_| name.contains(FAMILY)).chain(families.iter().copied());
    e.help = Some(match did_you_mean(name, all.collect::<Vec<_>>()) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => format!("the manifest names no {what}"),
        None => format!("{what}s: {}", families.join(", ")),
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
    /// One spec, or those of a family.
    Generated(Vec<Spec>),
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
            let path = match f.mistakes.sources.resolve(&node.place, text) {
                Ok(path) => path,
                Err(e) => {
                    f.note(&node.place, "file", e);
                    return None;
                }
            };
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
                Data::Text(text) => match entries::read_single(check, parts, text) {
                    Ok(spec) => vec![spec],
                    Err((word, e)) => {
                        f.mistakes.note(&entries::within(f.mistakes, node, word.as_deref()), &key, e);
                        Vec::new()
                    }
                },
                Data::Table(table) if get(table, "kind").is_some() => {
                    let (kind, part) = entries::read_kind(f.mistakes, &key, what, parts, node)?;
                    expand_part(f.mistakes, &key, node, &kind, part.params, check)
                }
                _ => {
                    let e = Error::new(format!("must name a {what}"));
                    let example = parts.first().map_or("...", |p| p.name);
                    f.note(&node.place, "generate", e.help(format!("write generate = \"{example}\"")));
                    Vec::new()
                }
            };
            (!specs.is_empty()).then(|| (Source::Generated(families::tidied(specs)), node.place.clone()))
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
