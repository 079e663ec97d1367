//! `cullmark parts`: every part that a manifest can name, with its parameters.

use crate::culling::{TESTS, WALKS};
use crate::error::{Error, Result, did_you_mean};
use crate::registry::{Default, Entry, Param};
use crate::scene::generate::ALL as SCENES;
use crate::scene::walkthrough::generate::ALL as PATHS;
use crate::structure::ALL as STRUCTURES;
use serde_json::{Value, json};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "`cullmark parts structure octree` shows one of them.")]
pub struct Args {
    /// structure, culling, walk, scene or path [default: all of them]
    pub kind: Option<String>,
    /// One part of the kind
    pub name: Option<String>,
    #[arg(long)]
    pub json: bool,
}

/// An entry of any registry, without what it makes.
#[derive(Clone, Copy)]
pub struct Part {
    pub name: &'static str,
    pub about: &'static str,
    pub params: &'static [Param],
}

pub struct Kind {
    pub name: &'static str,
    /// Where a manifest names them.
    pub about: &'static str,
    pub parts: Vec<Part>,
}

fn parts<T: ?Sized>(entries: &'static [Entry<T>]) -> Vec<Part> {
    entries.iter().map(|e| Part { name: e.name, about: e.about, params: e.params }).collect()
}

pub fn kinds() -> Vec<Kind> {
    let kind = |name, about, parts| Kind { name, about, parts };
    vec![
        kind("structure", "[matrix] structure = [\"octree:depth=4\"]", parts(STRUCTURES)),
        kind("culling", "[matrix] culling = [\"none\", \"frustum+normal_mask\"]", parts(TESTS)),
        kind("walk", "[matrix] walk = [\"depth_first\"]", parts(WALKS)),
        kind("scene", "[[scene]] generate = \"arena:seed=1\"", parts(SCENES)),
        kind("path", "[[path]] generate = \"walk:frames=2000\"", parts(PATHS)),
    ]
}

/// What is asked for: all kinds, one of them, or one part of one.
///
/// # Errors
/// For unknown names, with a suggestion.
pub fn select(kind: Option<&str>, name: Option<&str>) -> Result<Vec<Kind>> {
    let mut all = kinds();
    let Some(kind) = kind else { return Ok(all) };
    let Some(i) = all.iter().position(|k| k.name == kind) else {
        // Whoever takes a part for a kind is told where it stands.
        let of = all.iter().find(|k| k.parts.iter().any(|p| p.name == kind));
        let known = all.iter().map(|k| k.name);
        let help = of.map(|k| format!("write `cullmark parts {} {kind}`", k.name));
        return Err(unknown("kind of part", kind, known, help));
    };
    let mut found = all.swap_remove(i);
    if let Some(name) = name {
        let known: Vec<&str> = found.parts.iter().map(|p| p.name).collect();
        found.parts.retain(|p| p.name == name);
        if found.parts.is_empty() {
            return Err(unknown(found.name, name, known.into_iter(), None));
        }
    }
    Ok(vec![found])
}

fn unknown(what: &str, word: &str, known: impl Iterator<Item = &'static str> + Clone, help: Option<String>) -> Error {
    let near = || did_you_mean(word, known.clone()).map(|n| format!("did you mean `{n}`?"));
    let all = || format!("known: {}", known.clone().collect::<Vec<_>>().join(", "));
    Error::new(format!("unknown {what} `{word}`")).help(help.or_else(near).unwrap_or_else(all))
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let kinds = select(args.kind.as_deref(), args.name.as_deref())?;
    let out = if args.json { format!("{:#}\n", document(&kinds)) } else { text(&kinds) };
    super::report::put(&out)?;
    Ok(ExitCode::SUCCESS)
}

const COLUMNS: usize = 100;
/// Where what a parameter means begins.
const INDENT: usize = 30;

/// For a terminal of 100 columns.
pub fn text(kinds: &[Kind]) -> String {
    let mut out = String::new();
    for (i, kind) in kinds.iter().enumerate() {
        let gap = if i > 0 { "\n" } else { "" };
        out += &format!("{gap}{}    {}\n", kind.name.to_uppercase(), kind.about);
        for part in &kind.parts {
            out += &format!("\n{}\n", part.name);
            out += &wrapped("", 2, part.about);
            if part.params.is_empty() {
                out += "    no parameters\n";
            }
            for param in part.params {
                let head = format!("    {}={}", param.name, default(param));
                let notes = notes(param).join("; ");
                let about = if param.about.is_empty() { notes } else { format!("{} ({notes})", param.about) };
                out += &wrapped(&head, INDENT, &about);
            }
        }
    }
    out
}

/// Words after `head` from column `indent` on, in lines; a head that is too long has one of its own.
fn wrapped(head: &str, indent: usize, words: &str) -> String {
    let mut out = String::new();
    let mut line = head.to_string();
    if line.chars().count() + 2 > indent && !line.is_empty() {
        out += &format!("{line}\n");
        line.clear();
    }
    let mut empty = true;
    for word in words.split_whitespace() {
        let used = line.chars().count();
        if !empty && used + 1 + word.chars().count() > COLUMNS {
            out += &format!("{line}\n");
            (line, empty) = (String::new(), true);
        }
        if empty {
            line += &" ".repeat(indent.saturating_sub(line.chars().count()));
        } else {
            line.push(' ');
        }
        line += word;
        empty = false;
    }
    out + &line + "\n"
}

fn default(param: &Param) -> String {
    match param.default.plain() {
        Default::Axis(_) => "(the axis)".to_string(),
        plain => plain.value().to_string(),
    }
}

/// What is allowed, and on what condition.
fn notes(param: &Param) -> Vec<String> {
    let range = |kind: &str, min: String, max: String| format!("{kind} from {min} to {max}");
    let allowed = match param.default.plain() {
        Default::Int { min, max, .. } => range("a whole number", min.to_string(), max.to_string()),
        Default::Float { min, max, .. } => range("a number", format!("{min:?}"), format!("{max:?}")),
        Default::Bool(_) => "true or false".to_string(),
        Default::Choice(names) => format!("one of {}", names.join(", ")),
        Default::Axis(names) => {
            format!("one of {}; not given, the value of the axis `{}`", names.join(", "), param.name)
        }
        Default::Later(_) | Default::Only { .. } => unreachable!("`plain` looks into it"),
    };
    let only = |(with, is): (&str, &[&str])| format!("with {with} = {} only", is.join(" or "));
    [allowed].into_iter().chain(param.default.conditions().into_iter().map(only)).collect()
}

/// The same for programs.
pub fn document(kinds: &[Kind]) -> Value {
    let param = |p: &Param| {
        let mut out = json!({ "name": p.name, "about": p.about });
        let (kind, more) = match p.default.plain() {
            Default::Int { min, max, .. } => ("int", json!({ "min": min, "max": max })),
            Default::Float { min, max, .. } => ("float", json!({ "min": min, "max": max })),
            Default::Bool(_) => ("bool", json!({})),
            Default::Choice(names) | Default::Axis(names) => ("choice", json!({ "choices": names })),
            Default::Later(_) | Default::Only { .. } => unreachable!("`plain` looks into it"),
        };
        out["type"] = json!(kind);
        // What comes from an axis has no default of its own.
        out["default"] = match p.default.plain() {
            Default::Axis(_) => Value::Null,
            plain => json!(plain.value()),
        };
        let only: serde_json::Map<String, Value> =
            p.default.conditions().into_iter().map(|(with, is)| (with.to_string(), json!(is))).collect();
        if !only.is_empty() {
            out["only_with"] = Value::Object(only);
        }
        for (key, value) in more.as_object().into_iter().flatten() {
            out[key] = value.clone();
        }
        out
    };
    let part = |p: &Part| json!({ "name": p.name, "about": p.about, "params": p.params.iter().map(param).collect::<Vec<_>>() });
    let all = kinds.iter().map(|k| (k.name.to_string(), json!(k.parts.iter().map(part).collect::<Vec<_>>())));
    Value::Object(all.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_and_parameter_is_printed_in_a_hundred_columns() {
        let all = kinds();
        let counts: Vec<usize> = all.iter().map(|k| k.parts.len()).collect();
        assert_eq!(counts, [STRUCTURES.len(), TESTS.len(), WALKS.len(), SCENES.len(), PATHS.len()]);
        let document = document(&all);
        for kind in &all {
            for part in &kind.parts {
                let one = text(&select(Some(kind.name), Some(part.name)).unwrap());
                assert!(one.lines().all(|l| l.chars().count() <= COLUMNS), "{one}");
                assert!(one.lines().any(|l| l == part.name), "{one}");
                assert!(text(&all).contains(one.split_once("\n\n").unwrap().1), "{} is not among all", part.name);
                let listed = document[kind.name].as_array().unwrap().iter().find(|p| p["name"] == part.name).unwrap();
                assert_eq!(listed["params"].as_array().unwrap().len(), part.params.len());
                let words = one.split_whitespace().collect::<Vec<_>>().join(" ");
                for param in part.params {
                    assert!(one.contains(&format!("\n    {}={}", param.name, default(param))), "{one}");
                    let about = param.about.split_whitespace().collect::<Vec<_>>().join(" ");
                    assert!(
                        words.contains(&about) && words.contains(&notes(param).join("; ")),
                        "{}: {one}",
                        param.name
                    );
                }
            }
        }
    }

    #[test]
    fn ranges_and_choices_stand_beside_their_defaults() {
        let octree = text(&select(Some("structure"), Some("octree")).unwrap());
        let line = octree.lines().find(|l| l.starts_with("    depth=4")).unwrap();
        assert!(line.contains("levels below the root (a whole number from "), "{line}");
        assert!(octree.contains("one of aabb, cube"), "{octree}");
    }

    #[test]
    fn an_unknown_name_gets_a_suggestion() {
        let help = |kind, name| select(Some(kind), name).err().unwrap().help.unwrap();
        assert_eq!(help("structur", None), "did you mean `structure`?");
        assert_eq!(help("octree", None), "write `cullmark parts structure octree`");
        assert_eq!(help("culling", Some("frustrum")), "did you mean `frustum`?");
        assert!(help("walk", Some("xyz")).starts_with("known: chc"));
    }
}
