//! A manifest from its layers: presets under it (`extends`), `--set` over it.

use super::source::{Mistakes, Place};
use super::tree::{self, Data, Key, Node, Table, get};
use crate::error::{Error, did_you_mean};
use std::path::{Path, PathBuf};

/// The text of the manifest itself.
pub fn text(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(|e| {
        Error::io(path, "cannot read the manifest", &e)
            .help("give the path of a TOML manifest, such as experiments/quick.toml")
    })
}

/// Merges `text`, the content of `path`, with its presets and lays `sets` over it.
/// `None` when nothing could be read; mistakes are noted either way.
pub fn read(mistakes: &mut Mistakes, text: String, path: &Path, sets: &[String]) -> Option<Table> {
    let source = mistakes.sources.add(path, text, true);
    let mut stack = vec![identity(path)];
    let mut table = layer(mistakes, source, &mut stack);
    for set in sets {
        let source = mistakes.sources.add(format!("--set {set}"), set.clone(), false);
        let whole = Place { source, span: 0..set.len() };
        if let Some(table) = &mut table
            && let Err((place, e)) = apply(mistakes, table, source, set)
        {
            mistakes.note(&place.unwrap_or(whole), "", e);
        }
    }
    table
}

/// So that `a.toml` and `./b/../a.toml` are one file when looking for cycles.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

/// Text `source` merged over the presets it names.
fn layer(mistakes: &mut Mistakes, source: usize, stack: &mut Vec<PathBuf>) -> Option<Table> {
    let mut own = tree::parse(mistakes, source)?;
    let Some(at) = own.iter().position(|(k, _)| k.name == "extends") else { return Some(own) };
    let (_, node) = own.remove(at);
    let mut base = Table::new();
    for preset in node.array().unwrap_or(std::slice::from_ref(&node)) {
        let Some(file) = preset.text() else {
            let e = Error::new(format!("must be the path of a preset, not {}", preset.noun()));
            mistakes.note(
                &preset.place,
                "extends",
                e.help("write extends = \"presets/base.toml\" or a list of such paths"),
            );
            continue;
        };
        if let Some(text) = mistakes.sources.reach.preset(file) {
            let source = mistakes.sources.add(file, text, true);
            // Those of ours extend nothing, so there is no circle to watch for.
            if let Some(table) = layer(mistakes, source, stack) {
                merge(&mut base, table);
            }
            continue;
        }
        let path = match mistakes.sources.resolve(&preset.place, file) {
            Ok(path) => path,
            Err(e) => {
                mistakes.note(&preset.place, "extends", e);
                continue;
            }
        };
        let id = identity(&path);
        if stack.contains(&id) {
            let e = Error::new(format!("{} extends itself", path.display()));
            mistakes.note(&preset.place, "extends", e.help("remove one `extends` of the circle"));
            continue;
        }
        match std::fs::read_to_string(&path) {
            Err(e) => {
                let e = Error::new(format!("cannot read the preset {}: {e}", path.display()));
                mistakes.note(
                    &preset.place,
                    "extends",
                    e.help("paths start from the folder of the file that names them"),
                );
            }
            Ok(text) => {
                let source = mistakes.sources.add(&path, text, true);
                stack.push(id);
                if let Some(table) = layer(mistakes, source, stack) {
                    merge(&mut base, table);
                }
                stack.pop();
            }
        }
    }
    merge(&mut base, own);
    Some(base)
}

/// Tables merge key by key, everything else is replaced.
fn merge(base: &mut Table, over: Table) {
    for (key, node) in over {
        match base.iter_mut().find(|(k, _)| k.name == key.name) {
            None => base.push((key, node)),
            Some((old_key, old)) => match (&mut old.data, node.data) {
                // A `kind` names what the other keys belong to: such tables are values, not sections.
                (Data::Table(a), Data::Table(b)) if get(a, "kind").is_none() && get(&b, "kind").is_none() => {
                    merge(a, b);
                    old.place = node.place;
                    *old_key = key;
                }
                (_, data) => {
                    *old = Node { data, place: node.place };
                    *old_key = key;
                }
            },
        }
    }
}

type Misplaced = (Option<Place>, Error);

/// Lays one `key=value` over `table`; keys are dotted, list entries are named by
/// number or by their `name` or `id` (`scene.0.file`, `scene.hall.file`).
fn apply(mistakes: &Mistakes, table: &mut Table, source: usize, set: &str) -> Result<(), Misplaced> {
    let form = "write --set key=value, such as --set measure.repeats=3";
    let Some(equals) = set.find('=') else { return Err((None, Error::new("has no `=`").help(form))) };
    let value = tree::parse_value(mistakes, source, equals + 1).map_err(|e| {
        let place = Place { source, span: equals + 1..set.len() };
        (Some(place), e.help("values are TOML: 3, 0.5, true, \"text\", [\"a\", \"b\"], { kind = \"octree\" }"))
    })?;
    let mut segments = Vec::new();
    let mut start = 0;
    for part in set[..equals].split('.') {
        let lead = part.len() - part.trim_start().len();
        let name = part.trim();
        if name.is_empty() {
            return Err((None, Error::new("has an empty key").help(form)));
        }
        let at = start + lead;
        segments.push(Key { name: name.to_string(), place: Place { source, span: at..at + name.len() } });
        start += part.len() + 1;
    }
    put(table, &segments, value)
}

fn put(table: &mut Table, segments: &[Key], value: Node) -> Result<(), Misplaced> {
    let (first, rest) = segments.split_first().expect("a key has a segment");
    let at = match table.iter().position(|(k, _)| k.name == first.name) {
        Some(at) => at,
        None => {
            let data = Data::Table(Table::new());
            table.push((first.clone(), Node { data, place: first.place.clone() }));
            table.len() - 1
        }
    };
    let (key, node) = &mut table[at];
    *key = first.clone();
    put_node(node, first, rest, value)
}

fn put_node(node: &mut Node, named: &Key, rest: &[Key], value: Node) -> Result<(), Misplaced> {
    let Some((next, after)) = rest.split_first() else {
        *node = value;
        return Ok(());
    };
    let noun = node.noun();
    match &mut node.data {
        Data::Table(table) => put(table, rest, value),
        Data::Array(items) => {
            let at = element(items, next).ok_or_else(|| {
                let mut e = Error::new(format!("`{}` has no entry `{}`", named.name, next.name));
                let names: Vec<&str> = items.iter().filter_map(name_of).collect();
                let number = next.name.bytes().all(|b| b.is_ascii_digit());
                let near = did_you_mean(&next.name, names.iter().copied()).filter(|_| !number);
                e.help = Some(match near {
                    Some(near) => format!("did you mean `{near}`?"),
                    None if items.is_empty() => "the list is empty".to_string(),
                    None if names.is_empty() => format!("entries are numbered 0 to {}", items.len() - 1),
                    None => format!("entries are numbered 0 to {} or named {}", items.len() - 1, names.join(", ")),
                });
                (Some(next.place.clone()), e)
            })?;
            put_node(&mut items[at], next, after, value)
        }
        _ => {
            let e = Error::new(format!("`{}` is {noun} and holds no `{}`", named.name, next.name));
            Err((Some(next.place.clone()), e.help(format!("set `{}` as a whole", named.name))))
        }
    }
}

fn element(items: &[Node], key: &Key) -> Option<usize> {
    match key.name.parse::<usize>() {
        Ok(i) => (i < items.len()).then_some(i),
        Err(_) => items.iter().position(|n| name_of(n) == Some(&key.name)),
    }
}

fn name_of(node: &Node) -> Option<&str> {
    let table = node.table()?;
    get(table, "name").or_else(|| get(table, "id"))?.text()
}
