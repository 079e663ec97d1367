//! The real program over a tiny study, from the manifest to the report.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

const STUDY: &str = r#"
[study]
name = "tiny"
title = "A tiny study"
[measure]
repeats = 2
passes = 1
[accuracy]
frames = 2
width_px = 64
height_px = 36
[[scene]]
name = "nucleus"
generate = "arena:map=nucleus"
[[path]]
name = "walk"
generate = "walk:frames=20,seed=7"
[matrix]
structure = ["list", "octree:depth=3"]
culling = ["none", "frustum"]
[[claim]]
id = "frustum_pays"
text = "The frustum submits fewer triangles than none"
source = "the definition"
metric = "mean_triangles"
numerator = { culling = "frustum" }
denominator = { culling = "none" }
relation = "<"
for_each = "scene"
"#;

/// Runs the program in `dir` with a measuring lane of its own.
fn cullmark(dir: &Path, line: &str) -> Output {
    let words = line.split_whitespace();
    Command::new(env!("CARGO_BIN_EXE_cullmark")).current_dir(dir).env("TMPDIR", dir).args(words).output().unwrap()
}

/// What it prints when all is well.
fn well(dir: &Path, line: &str) -> String {
    let out = cullmark(dir, line);
    assert!(out.status.success(), "`{line}`: {}\n{}", out.status, String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

fn json(dir: &Path, line: &str) -> Value {
    serde_json::from_str(&well(dir, line)).unwrap()
}

/// The last event of a run in JSON mode, and how many trials ended.
fn run(dir: &Path, more: &str) -> (Value, usize) {
    let text = well(dir, &format!("run m.toml --db x.db --json {more}"));
    let events: Vec<Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let trials = events.iter().filter(|e| e["event"] == "job_ended" && e["kind"] == "trial").count();
    (events.last().unwrap().clone(), trials)
}

#[test]
fn a_study_goes_from_its_manifest_to_a_report_and_into_another_database() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    std::fs::write(dir.join("m.toml"), STUDY).unwrap();

    let counts = |more: &str| {
        let p = json(dir, &format!("plan m.toml --db x.db --json {more}"));
        ["new", "partial", "rerun", "rejudge", "done", "trials"].map(|k| p[k].as_u64().unwrap())
    };
    assert_eq!(counts(""), [4, 0, 0, 0, 0, 8]);
    assert!(!dir.join("x.db").exists(), "planning makes no database");

    let (end, trials) = run(dir, "--out report");
    assert_eq!((&end["done"], &end["failed"], &end["wrong"]), (&4.into(), &0.into(), &0.into()));
    assert!(trials >= 8, "{trials}");
    for file in ["index.html", "charts/total-time.svg", "charts/total-time.png", "tables/times.csv", "tables/claims.md"]
    {
        let bytes = std::fs::metadata(dir.join("report").join(file)).unwrap_or_else(|e| panic!("{file}: {e}")).len();
        assert!(bytes > 100, "{file} has {bytes} bytes");
    }
    assert!(std::fs::read_to_string(dir.join("report/tables/claims.md")).unwrap().contains("reproduced"));
    let told = well(dir, "claims tiny --db x.db");
    assert!(told.contains("frustum_pays: The frustum submits fewer") && told.contains("reproduced"), "{told}");
    std::fs::write(dir.join("false.toml"), STUDY.replace("relation = \"<\"", "relation = \">\"")).unwrap();
    let told = cullmark(dir, "claims false.toml --db x.db --format csv");
    let text = String::from_utf8(told.stdout).unwrap();
    assert!(told.status.code() == Some(1) && text.contains("contradicted"), "{}: {text}", told.status);

    let (end, trials) = run(dir, "--no-report");
    assert_eq!((&end["done"], trials), (&4.into(), 0), "the second time does nothing");
    assert_eq!(counts(""), [0, 0, 0, 0, 4, 0]);
    assert_eq!(counts("--set measure.repeats=3"), [0, 4, 0, 0, 0, 4]);
    assert_eq!(counts("--set measure.passes=2"), [0, 0, 4, 0, 0, 8]);
    assert_eq!(counts("--set accuracy.width_px=80"), [0, 0, 0, 4, 0, 0]);
    assert_eq!(counts("--series next"), [4, 0, 0, 0, 0, 8]);
    let list = well(dir, "plan m.toml --db x.db --list --set measure.passes=2");
    assert!(list.contains("measure.passes was 1, is 2"), "{list}");

    run(dir, "--series next --no-report");
    let compared = well(dir, "compare tiny@0 tiny@1 --db x.db --metric mean_triangles --format csv");
    assert_eq!(compared.lines().count(), 5, "a head and four cells:\n{compared}");

    let query = "query tiny@0 --where structure=octree --format csv --db";
    let rows = well(dir, &format!("{query} x.db"));
    assert_eq!(rows.lines().count(), 3, "{rows}");
    well(dir, "export tiny@0 --db x.db --out t.cullmark");
    well(dir, "import t.cullmark --db y.db");
    assert_eq!(well(dir, &format!("{query} y.db")), rows, "an imported study answers as the first");
}

#[test]
fn a_report_is_written_again_only_when_it_would_differ_or_was_touched() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    std::fs::write(dir.join("m.toml"), STUDY).unwrap();
    let page = dir.join("tiny/index.html");
    // A page that is left alone keeps this time.
    let long_ago = std::time::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000_000);
    let written = |more: &str| {
        let told = run(dir, more).0["report"].as_str().unwrap().to_string();
        assert!(told.ends_with("index.html"), "{told}");
        let file = std::fs::File::options().write(true).open(dir.join(told)).unwrap();
        let new = file.metadata().unwrap().modified().unwrap() != long_ago;
        file.set_modified(long_ago).unwrap();
        new
    };
    assert!(written(""), "the first time");
    assert!(!written(""), "nothing changed");
    assert!(written("--set measure.repeats=3"), "one more trial a cell");
    assert!(!written("--set measure.repeats=3"));
    assert!(written("--set measure.repeats=3 --series 1"), "its own report");
    assert!(written("--set measure.repeats=3"), "another series belongs in it");
    std::fs::write(dir.join("m.toml"), STUDY.replace("A tiny study", "A small study")).unwrap();
    assert!(written("--set measure.repeats=3"), "another title");
    let whole = std::fs::read(&page).unwrap();
    std::fs::write(&page, "scribbled over").unwrap();
    assert!(written("--set measure.repeats=3"), "the page was changed");
    assert_eq!(std::fs::read(&page).unwrap(), whole);
    std::fs::remove_file(dir.join("tiny/charts/total-time.svg")).unwrap();
    assert!(written("--set measure.repeats=3"), "a chart is missing");
    assert!(dir.join("tiny/charts/total-time.svg").exists());
}

#[test]
fn submitted_ids_are_ascending_and_unique_and_all_of_them_are_counted_from_0() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let dump = |culling: &str| {
        let frame = "inspect --scene arena:map=nucleus --path walk:frames=4,seed=7 --frame 2 --width 64";
        let more = format!("--structure bsp:min_leaf=200 --culling {culling} --dump-submitted ids.txt --json");
        let told = json(dir, &format!("{frame} {more}"));
        let text = std::fs::read_to_string(dir.join("ids.txt")).unwrap();
        assert!(text.ends_with('\n'));
        let ids: Vec<u32> = text.lines().map(|l| l.parse().unwrap()).collect();
        assert!(ids.windows(2).all(|w| w[0] < w[1]), "ascending, each once");
        assert_eq!(told["errors"]["submitted"], ids.len());
        (ids, told["scene_triangles"].as_u64().unwrap())
    };
    let (all, triangles) = dump("none");
    assert!(all.iter().copied().eq(0..triangles as u32), "none submits the whole scene");
    let (some, _) = dump("frustum");
    assert!(!some.is_empty() && some.len() < all.len());
}
