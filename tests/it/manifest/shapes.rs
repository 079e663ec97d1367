//! What manifests mean: products, ranges, zips, includes, excludes, layers.

use super::{Folder, HEAD, cells, matrix, whole};
use cullmark::claim::{Relation, selects};
use cullmark::manifest::Manifest;
use cullmark::matrix::plan::{Known, State, plan};
use cullmark::matrix::{Setting, expand};
use cullmark::registry::Value;
use std::time::Instant;

#[test]
fn the_product_is_scene_by_scene_with_fitting_walks() {
    let m = matrix("[matrix]\nstructure = [\"list\", \"octree:depth=3\"]\nculling = [\"none\", \"frustum\"]");
    let expected = [
        "a list none flat",
        "a list frustum flat",
        "a octree:depth=3 none depth_first",
        "a octree:depth=3 frustum depth_first",
        "b list none flat",
        "b list frustum flat",
        "b octree:depth=3 none depth_first",
        "b octree:depth=3 frustum depth_first",
    ];
    assert_eq!(cells(&m), expected);
    let run = &m.runs[3];
    assert_eq!(run.revisions.len(), 3, "{:?}", run.revisions);
    assert!(run.revisions.contains_key("structure.octree") && run.revisions.contains_key("culling.frustum"));
    assert_eq!(run.structure.params["root"], Value::Text("aabb".into()), "defaults are filled in");
    assert_eq!((run.protocol.passes, run.accuracy.width_px), (3, 1920));
    let ids: std::collections::HashSet<String> = m.runs.iter().map(|r| r.answer_id()).collect();
    assert_eq!(ids.len(), 8, "every cell has an answer of its own");
}

#[test]
fn parameters_of_one_structure_do_not_multiply_the_others() {
    let m = matrix(
        "[matrix]\nscene = \"a\"\nculling = \"frustum\"\nstructure = [\"list\", { kind = \"octree\", depth = [3, 4, 5], root = [\"aabb\", \"cube\"] }, { kind = \"bsp\", min_leaf = { from = 50, to = 400, steps = 4, scale = \"log\" } }]",
    );
    assert_eq!(m.runs.len(), 1 + 6 + 4);
    let leaves: Vec<i64> =
        m.runs.iter().filter(|r| r.structure.kind == "bsp").map(|r| r.structure.int("min_leaf")).collect();
    assert_eq!(leaves, [50, 100, 200, 400]);
}

#[test]
fn what_has_an_effect_beside_another_value_alone_may_be_a_list_there() {
    let m = matrix(
        "[matrix]\nscene = [\"a\"]\nculling = [\"none\"]\nstructure = [\"octree\"]\nwalk = [{ kind = \"chc\", backend = \"latency\", latency_us = [0, 10, 100] }]",
    );
    assert_eq!(m.runs.iter().map(|r| r.walk.int("latency_us")).collect::<Vec<_>>(), [0, 10, 100]);
}

#[test]
fn ranges_round_to_whole_numbers_and_repeat_none() {
    let m = matrix(
        "[matrix]\nscene = [\"a\"]\nculling = [\"none\"]\nstructure = [{ kind = \"octree\", depth = [{ from = 2, to = 4, steps = 9 }, 7] }]",
    );
    let depths: Vec<i64> = m.runs.iter().map(|r| r.structure.int("depth")).collect();
    assert_eq!(depths, [2, 3, 4, 7]);
    let m = matrix(
        "[matrix]\nscene = [\"a\"]\nculling = [\"none\"]\nstructure = [{ kind = \"bsp\", split_weight = { from = 0.5, to = 2, step = 0.75 } }]",
    );
    let weights: Vec<f64> = m.runs.iter().map(|r| r.structure.float("split_weight")).collect();
    assert_eq!(weights, [0.5, 1.25, 2.0]);
}

#[test]
fn equal_cells_run_once_and_are_counted() {
    // Depth 4 is the default; `auto` is depth_first for an octree; a list twice.
    let m = matrix(
        "[matrix]\nscene = [\"a\"]\nculling = [\"frustum\"]\nstructure = [\"octree\", \"octree:depth=4\", \"list\", \"list\"]\nwalk = [\"auto\", \"depth_first\"]",
    );
    assert_eq!(cells(&m), ["a octree frustum depth_first", "a list frustum flat", "a list frustum depth_first"]);
    assert_eq!(m.duplicates, 2 + 1);
}

#[test]
fn zipped_axes_advance_together() {
    let m = matrix(
        "[matrix]\nstructure = [{ kind = \"octree\", depth = [2, 3] }, \"list\"]\nculling = [\"none\", \"frustum\", \"normal_mask\"]\nzip = [[\"structure\", \"culling\"]]",
    );
    assert_eq!(
        cells(&m),
        [
            "a octree:depth=2 none depth_first",
            "a octree:depth=3 frustum depth_first",
            "a list normal_mask flat",
            "b octree:depth=2 none depth_first",
            "b octree:depth=3 frustum depth_first",
            "b list normal_mask flat"
        ]
    );
    let m = matrix(
        "[matrix]\nstructure = [\"list\", \"octree\"]\nculling = [\"none\", \"frustum\"]\nzip = [[\"structure\", \"scene\"]]",
    );
    assert_eq!(
        cells(&m),
        ["a list none flat", "a list frustum flat", "b octree none depth_first", "b octree frustum depth_first"]
    );
}

#[test]
fn an_include_takes_what_it_does_not_fix_from_the_matrix() {
    let m = matrix(
        "[matrix]\nstructure = [\"list\"]\nculling = [\"none\", \"frustum\"]\n[[include]]\nscene = \"b\"\nstructure = { kind = \"octree\", depth = [5, 6] }\n[[include]]\nstructure = \"bsp\"\nculling = \"octant_mask\"",
    );
    assert_eq!(m.runs.len(), 4 + 4 + 2);
    assert_eq!(cells(&m).iter().filter(|c| c.starts_with("a ")).count(), 3);
    assert!(cells(&m).contains(&"b octree:depth=6 frustum depth_first".to_string()));
}

#[test]
fn an_include_breaks_open_only_the_zips_it_touches() {
    let m = matrix(
        "[matrix]\nscene = [\"a\"]\nstructure = [\"list\", \"octree\"]\nculling = [\"none\", \"frustum\"]\nzip = [[\"structure\", \"culling\"]]\n[[include]]\nstructure = \"bsp\"",
    );
    assert_eq!(m.runs.len(), 2 + 2);
}

#[test]
fn excluded_cells_are_kept_with_their_reason_and_an_include_brings_one_back() {
    let m = matrix(
        "[matrix]\nstructure = [\"list\", { kind = \"octree\", depth = [3, 4, 5] }]\nculling = [\"none\", \"frustum+octant_mask\"]\n[[exclude]]\nstructure = \"octree:depth>=4\"\nculling = \"octant_mask+*\"\nwhy = \"known to lose walls\"\n[[exclude]]\nscene = \"b\"\nstructure = { kind = \"octree\", depth = { from = 5 } }\nwhy = \"too deep\"\n[[include]]\nscene = \"a\"\nstructure = \"octree:depth=5\"\nculling = \"frustum+octant_mask\"",
    );
    assert_eq!(m.runs.len() + m.excluded_runs.len(), 16);
    let said: Vec<(String, u64, String)> =
        m.excluded.iter().map(|e| (e.cell.clone(), e.count, e.why.clone())).collect();
    assert_eq!(
        said,
        [
            ("octree × frustum+octant_mask".into(), 2, "known to lose walls".into()),
            ("octree:depth=5 × none".to_string(), 1, "too deep".to_string()),
            ("octree:depth=5 × frustum+octant_mask".into(), 1, "known to lose walls".into()),
        ]
    );
    assert!(cells(&m).contains(&"a octree:depth=5 frustum+octant_mask depth_first".to_string()));
}

#[test]
fn sums_in_table_form_multiply_over_their_parts() {
    let m = matrix(
        "[matrix]\nscene = \"a\"\nstructure = [\"list\"]\nculling = [{ sum = [\"frustum\", { kind = \"normal_mask\", cells = [2, 4, 8] }] }, { kind = \"octant_mask\", sectors = [\"8\", 16] }]",
    );
    let labels: Vec<String> = m.runs.iter().map(|r| cullmark::matrix::labels(r).culling).collect();
    assert_eq!(
        labels,
        [
            "frustum+normal_mask:cells=2",
            "frustum+normal_mask",
            "frustum+normal_mask:cells=8",
            "octant_mask",
            "octant_mask:sectors=16"
        ]
    );
}

#[test]
fn presets_lie_under_and_sets_over_the_manifest() {
    let folder = Folder::new();
    folder.write("presets/deep.toml", "[measure]\nrepeats = 9\npasses = 8\nseed = 5\n[camera]\nfov_y_deg = 90");
    folder.write(
        "presets/base.toml",
        "extends = \"deep.toml\"\n[measure]\nrepeats = 7\n[matrix]\nstructure = [\"list\", \"octree\"]\nculling = [\"none\"]",
    );
    let text = format!("extends = [\"presets/base.toml\"]\n{HEAD}[measure]\nseed = 2\n[matrix]\nstructure = [\"bsp\"]");
    let sets = ["measure.passes=4", "matrix.culling=[\"frustum\", \"none\"]", "scene.0.name=hall", "path.w.frames=1"];
    let (manifest, matrix) = folder.read(&text, &sets).unwrap();
    let measured = (manifest.repeat.repeats, manifest.repeat.seed, manifest.timing.passes);
    assert_eq!(measured, (7, 2, 4), "nearer layers win, tables merge");
    assert_eq!(cells(&matrix).len(), 4, "lists replace");
    assert_eq!(matrix.runs[0].scene.name, "hall");
    assert_eq!(matrix.runs[0].path.frames, Some(1));
    assert_eq!(manifest.paths[0][0].name, "w");
    // What is stored with the study is whole, and means the same read again.
    assert!(manifest.source_text.contains("# Merged from"), "{}", manifest.source_text);
    let (_, again) = folder.read(&manifest.source_text, &[]).unwrap();
    assert_eq!(again.runs, matrix.runs);
}

#[test]
fn a_manifest_of_one_layer_is_stored_as_written() {
    let text = format!("# my comment\n{HEAD}[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]");
    assert_eq!(Folder::new().read(&text, &[]).unwrap().0.source_text, text);
}

#[test]
fn paths_belong_to_their_scenes() {
    let text = "[[path]]\nname = \"v\"\nfile = \"w.csv\"\nscene = \"b\"\nstride = 2\n[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\n";
    let m = matrix(text);
    let paths: Vec<(String, String)> = m.runs.iter().map(|r| (r.scene.name.clone(), r.path.name.clone())).collect();
    assert_eq!(paths, [("a".into(), "w".into()), ("b".into(), "w".into()), ("b".to_string(), "v".to_string())]);
    let m = matrix(&format!("{text}scene = \"b\"\npath = \"v\"\n"));
    assert_eq!(m.runs.len(), 1);
    assert_eq!(m.runs[0].path.stride, 2);
}

#[test]
fn a_claim_reads_whole_and_selects_its_runs() {
    let (manifest, matrix) = whole(
        r#"[matrix]
structure = ["octree", "bsp:min_leaf=50", "bsp"]
culling = ["frustum", "normal_mask", "frustum+normal_mask"]
[[claim]]
id = "A4.3"
text = "the frustum culls more"
source = "somebody 2014, fig. 3"
metric = "total_cull_ms"
numerator = { structure = "octree", culling = "normal_mask" }
denominator = { structure = ["octree", { kind = "bsp", min_leaf = 50 }], culling = "frustum" }
relation = "ratio"
published = { a = 3.5, b = [3.8, 4] }
for_each = "scene"
"#,
        &[],
    );
    let claim = &manifest.claims()[0];
    assert_eq!(claim.relation, Relation::Ratio);
    assert_eq!((claim.published_of("a"), claim.published_of("b")), (Some([3.5, 3.5]), Some([3.8, 4.0])));
    let count = |s| matrix.runs.iter().filter(|r| selects(s, r)).count();
    assert_eq!((count(&claim.numerator), count(&claim.denominator)), (2, 4));
}

#[test]
fn a_claim_of_the_best_and_a_value_below_0_read_whole() {
    let (manifest, _) = whole(
        r#"[matrix]
structure = ["octree:depth=4", "octree:depth=5", "bsp"]
culling = ["frustum"]
[[claim]]
id = "depth_5"
text = "five levels are best"
source = "somebody 2009"
metric = "fps_mean_model"
numerator = { structure = "octree:depth=5" }
denominator = { structure = ["octree", "*"] }
relation = "best"
for_each = "scene"
published = { a = 0.8 }
[[claim]]
id = "r"
text = "time falls with triangles"
source = "nobody"
metric = "pearson_triangles_cull"
numerator = { structure = "bsp" }
relation = "value"
published = [-0.9, 0.1]
"#,
        &[],
    );
    let claims = manifest.claims();
    assert_eq!((claims[0].relation, claims[0].published_of("a")), (Relation::Best, Some([0.8, 0.8])));
    assert_eq!(claims[1].published, Some([-0.9, 0.1]));
}

#[test]
fn a_plan_says_what_is_new_done_and_run_again_and_why() {
    let (manifest, matrix) = whole(
        "[matrix]\nstructure = [\"list\", \"octree\", \"bsp\"]\nculling = [\"none\", \"frustum\"]\n[[exclude]]\nstructure = \"bsp\"\nculling = \"none\"\nwhy = \"nobody asks\"",
        &[],
    );
    let plan = plan(&manifest, &matrix, |run| {
        let state = match (run.structure.kind.as_str(), run.culling.is_empty()) {
            ("list", true) => State::Done,
            ("list", false) => State::Rerun { why: "culling.frustum is now revision 2".into() },
            ("octree", true) => State::Partial { trials: 2 },
            _ => State::New,
        };
        Known { state, trial_s: Some(1.0) }
    });
    assert_eq!((plan.new, plan.done, plan.partial, plan.rerun, plan.failed), (4, 2, 2, 2, 0));
    assert_eq!(plan.trials, 4 * 5 + 2 * 3 + 2 * 5);
    assert_eq!(plan.guessed, 0);
    let table = plan.table();
    let marks: Vec<String> = table.lines().map(|l| l.split_whitespace().rev().take(2).collect()).collect();
    assert_eq!(marks, ["ba", "==", "!!", "~~", "++", "++", "--"], "{table}");
    let summary = plan.summary();
    for part in ["10 runs", "2 excluded", "2 runs again: culling.frustum is now revision 2", "2 excluded: nobody asks"]
    {
        assert!(summary.contains(part), "{part} in {summary}");
    }
    assert_eq!(plan.list().lines().count(), 12);
}

#[test]
fn ten_thousand_cells_expand_at_once() {
    let text = format!(
        "{HEAD}[matrix]\nstructure = [{{ kind = \"bsp\", min_leaf = {{ from = 1, to = 500, step = 1 }}, candidates = [8, 16] }}]\nculling = [\"none\", \"frustum\", \"normal_mask\", \"octant_mask\", \"frustum+normal_mask\"]\n[[exclude]]\nstructure = \"bsp:min_leaf<=10\"\nculling = \"none\"\nwhy = \"small\"\n"
    );
    let folder = Folder::new();
    let path = folder.write("m.toml", &text);
    let start = Instant::now();
    let manifest = Manifest::load(&path, &[]).unwrap();
    let matrix = expand(&manifest, &Setting::default()).unwrap();
    let plan = plan(&manifest, &matrix, |_| Known::default());
    let seconds = start.elapsed().as_secs_f64();
    assert_eq!((matrix.runs.len(), matrix.excluded_runs.len()), (10_000 - 40, 40));
    assert_eq!(plan.new, matrix.runs.len());
    // Release takes a tenth of this; the bound is for a busy machine in the dev profile.
    assert!(seconds < 4.0, "{seconds} s");
}

#[test]
fn the_experiments_of_this_repository_are_free_of_mistakes() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments");
    let mut studies = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        let told = |errors: Vec<cullmark::Error>| -> String { errors.iter().map(|e| format!("{e}\n")).collect() };
        let manifest = match Manifest::load(&path, &[]) {
            Ok(manifest) => manifest,
            // A study of files alone may find none of them.
            Err(e) if e.len() == 1 && e[0].message.contains("no scene of the study is there") => continue,
            Err(e) => panic!("{}", told(e)),
        };
        let matrix = expand(&manifest, &Setting::default()).unwrap_or_else(|e| panic!("{}", told(e)));
        studies.push((manifest.study.name, matrix.runs.len(), manifest.claims.len()));
    }
    studies.sort();
    // Three places x three structures x five cullings.
    assert!(studies.contains(&("quick".into(), 3 * 15, 3)), "{studies:?}");
    // Seven maps x (three structures x five cullings + the binary BSP's three).
    assert!(studies.contains(&("serpa-2014".into(), 7 * 18, 11)), "{studies:?}");
}
