//! The house keeps its shape: import directions, file length, complete registries.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

const MAX_LINES: usize = 400;

fn rust_files(dir: &Path) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut pending = vec![dir.to_path_buf()];
    while let Some(dir) = pending.pop() {
        for entry in fs::read_dir(&dir).unwrap().map(Result::unwrap) {
            let path = entry.path();
            if path.is_dir() {
                pending.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                out.push(path);
            }
        }
    }
    out.sort();
    out
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The room of a file: the first component below `src`, without extension.
fn room(path: &Path) -> String {
    let below = path.strip_prefix(root().join("src")).unwrap();
    Path::new(below.components().next().unwrap().as_os_str()).file_stem().unwrap().to_str().unwrap().to_string()
}

/// Source without its unit tests, which may look anywhere.
fn shipped(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    text.split("\n#[cfg(test)]").next().unwrap().to_string()
}

/// Who may name whom: `crate::<room>`.
fn allowed() -> BTreeMap<&'static str, Vec<&'static str>> {
    let plain = ["error", "registry", "record", "math"];
    let with = |more: &[&'static str]| plain.iter().chain(more).copied().collect::<Vec<_>>();
    BTreeMap::from([
        ("error", vec![]),
        ("registry", vec!["error"]),
        ("math", vec!["error"]),
        ("stats", vec![]),
        ("machine", with(&["stats"])),
        // Records carry the plain types of the rooms that fill them.
        ("record", vec!["culling", "hierarchy", "math", "registry", "scene", "error"]),
        ("scene", with(&[])),
        ("hierarchy", with(&["scene"])),
        ("raster", with(&["scene"])),
        ("structure", with(&["scene", "hierarchy"])),
        ("culling", with(&["scene", "hierarchy", "raster"])),
        ("oracle", with(&["scene", "culling"])),
        ("preview", with(&["scene"])),
        ("advice", with(&["scene", "hierarchy", "structure", "culling", "stats"])),
        ("runner", with(&["scene", "hierarchy", "structure", "culling", "oracle", "machine", "stats"])),
        (
            "viewing",
            with(&["scene", "hierarchy", "structure", "culling", "oracle", "machine", "stats", "runner", "preview"]),
        ),
        ("results", with(&["culling", "stats", "sweep"])),
        ("sweep", vec![]),
        ("claim", with(&[])),
        ("manifest", with(&["sweep", "scene", "structure", "culling", "claim"])),
        ("matrix", with(&["manifest", "structure", "culling", "results", "claim"])),
        ("store", with(&["sweep", "results", "claim", "stats", "culling"])),
        ("worker", with(&["store", "results", "stats", "machine", "culling"])),
        ("report", with(&["sweep", "results", "claim", "stats", "culling"])),
        ("intake", with(&["manifest", "matrix", "store", "results", "machine", "stats"])),
        (
            "api",
            with(&[
                "intake", "manifest", "matrix", "store", "worker", "report", "results", "machine", "stats", "claim",
            ]),
        ),
        ("cli", vec!["*"]),
        ("main", vec!["*"]),
        ("lib", vec!["*"]),
    ])
}

/// Every `crate::name` in a text.
fn crate_paths(text: &str) -> Vec<String> {
    let code = text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    code.match_indices("crate::")
        .filter(|(i, _)| *i == 0 || !code.as_bytes()[i - 1].is_ascii_alphanumeric())
        .flat_map(|(i, m)| {
            let rest = &code[i + m.len()..];
            let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
            match rest.strip_prefix('{') {
                // `use crate::{a::x, b::{y, z}}`: names at brace depth one.
                Some(list) => {
                    let mut depth = 1;
                    let mut names = vec![word(list.trim_start())];
                    for (j, c) in list.char_indices() {
                        match c {
                            '{' => depth += 1,
                            '}' => depth -= 1,
                            ',' if depth == 1 => names.push(word(list[j + 1..].trim_start())),
                            _ => {}
                        }
                        if depth == 0 {
                            break;
                        }
                    }
                    names
                }
                None => vec![word(rest)],
            }
        })
        .filter(|w| w.chars().next().is_some_and(char::is_lowercase))
        .collect()
}

#[test]
fn imports_go_only_where_the_house_allows() {
    let allowed = allowed();
    let mut wrong = Vec::new();
    for path in rust_files(&root().join("src")) {
        let here = room(&path);
        let Some(may) = allowed.get(here.as_str()) else {
            wrong.push(format!("{}: room `{here}` is not in the table of tests/it/tidy.rs", path.display()));
            continue;
        };
        for there in crate_paths(&shipped(&path)) {
            if there != here && !may.contains(&"*") && !may.contains(&there.as_str()) {
                wrong.push(format!("{} imports crate::{there}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_oracle_takes_plain_types_only_from_culling() {
    for path in rust_files(&root().join("src/oracle")) {
        for line in shipped(&path).lines().filter(|l| l.contains("culling::")) {
            let rest = line.split("culling::").nth(1).unwrap();
            let names: String = rest.chars().take_while(|c| *c != ';').collect();
            let plain = names
                .split(|c: char| !c.is_alphanumeric())
                .filter(|w| !w.is_empty())
                .all(|w| w == "Class" || w == "Removes" || w.chars().next().is_some_and(char::is_lowercase));
            assert!(plain, "{}: {line}", path.display());
        }
    }
}

#[test]
fn heavy_crates_stay_in_their_rooms() {
    let rooms: [(&str, &[&str]); 7] = [
        ("sqlx::", &["store"]),
        ("tokio::", &["worker", "api", "cli", "store"]),
        ("axum::", &["api"]),
        ("utoipa::", &["api"]),
        ("arrow_", &["api"]),
        ("ureq::", &["cli"]),
        ("plotters::", &["report"]),
    ];
    for path in rust_files(&root().join("src")) {
        let text = shipped(&path);
        for (name, homes) in rooms {
            let used = text.lines().any(|l| !l.trim_start().starts_with("//") && l.contains(name));
            assert!(!used || homes.contains(&room(&path).as_str()), "{} uses {name}", path.display());
        }
    }
}

#[test]
fn files_hold_one_idea_each() {
    let mut long = Vec::new();
    for dir in ["src", "tests", "benches", "examples"] {
        for path in rust_files(&root().join(dir)) {
            let lines = fs::read_to_string(&path).unwrap().lines().count();
            if lines > MAX_LINES {
                long.push(format!("{}: {lines} lines", path.display()));
            }
        }
    }
    assert!(long.is_empty(), "over {MAX_LINES} lines:\n{}", long.join("\n"));
}

#[test]
fn every_file_opens_with_what_it_is_for() {
    for dir in ["src", "tests", "benches", "examples"] {
        for path in rust_files(&root().join(dir)) {
            let text = fs::read_to_string(&path).unwrap();
            assert!(text.starts_with("//!"), "{} has no opening `//!`", path.display());
        }
    }
}

#[test]
fn every_entry_is_in_its_registry_and_registries_are_sorted() {
    for dir in ["src/structure", "src/culling", "src/scene/generate", "src/scene/walkthrough"] {
        let table: String = rust_files(&root().join(dir)).iter().map(|p| fs::read_to_string(p).unwrap()).collect();
        for path in rust_files(&root().join(dir)) {
            let has_entry = shipped(&path).lines().any(|l| {
                let l = l.trim_start();
                (l.starts_with("pub const ENTRY") || l.starts_with("pub static ENTRY")) && l.contains("Entry<")
            });
            let name = path.file_stem().unwrap().to_str().unwrap();
            let name = if name == "mod" { path.parent().unwrap().file_name().unwrap().to_str().unwrap() } else { name };
            assert!(!has_entry || table.contains(&format!("{name}::ENTRY")), "{} is in no registry", path.display());
        }
    }
    let sorted = |what: &str, names: Vec<&str>| {
        assert!(names.windows(2).all(|w| w[0] < w[1]), "{what} is not sorted: {names:?}");
    };
    sorted("structure::ALL", cullmark::structure::ALL.iter().map(|e| e.name).collect());
    sorted("culling::TESTS", cullmark::culling::TESTS.iter().map(|e| e.name).collect());
    sorted("culling::WALKS", cullmark::culling::WALKS.iter().map(|e| e.name).collect());
}

#[test]
fn the_architecture_page_stays_short() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    assert!(text.lines().count() < 150, "{} lines", text.lines().count());
}
