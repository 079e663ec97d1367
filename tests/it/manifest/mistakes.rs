//! Every kind of mistake: where it is shown and what it advises.

use super::{Folder, HEAD};
use cullmark::Error;
use proptest::prelude::*;

/// Manifest, line, column, key, part of the message, part of the help.
type Case = (&'static str, u32, u32, &'static str, &'static str, &'static str);

/// Every case is tried before the test fails, so that all wrong ones are seen.
fn check(head: &str, cases: &[Case]) {
    let folder = Folder::new();
    folder.write("notes.txt", "x");
    folder.write("empty_dir.obj/x", "");
    let mut wrong = Vec::new();
    for (rest, line, column, key, message, help) in cases {
        let errors = match folder.read(&format!("{head}{rest}"), &[]) {
            Ok(_) => {
                wrong.push(format!("accepted:\n{rest}"));
                continue;
            }
            Err(errors) => errors,
        };
        let e = &errors[0];
        let right = errors.len() == 1
            && e.file.as_ref().is_some_and(|f| f.ends_with("m.toml"))
            && (e.line, e.column) == (Some(*line), Some(*column))
            && e.key.as_deref().unwrap_or_default() == *key
            && e.message.contains(message)
            && e.help.as_deref().unwrap_or_default().contains(help)
            && e.snippet.as_ref().is_some_and(|s| s.contains('^'));
        if !right {
            let said = errors.iter().map(Error::to_string).collect::<Vec<_>>().join("\n");
            wrong.push(format!("wanted {line}:{column} `{key}` {message:?} {help:?}, got\n{said}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n----\n"));
}

const MATRIX: &str = "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\n";

#[test]
fn mistakes_in_the_matrix_name_place_and_remedy() {
    check(
        HEAD,
        &[
            ("", 1, 1, "matrix", "is missing", "add [matrix]"),
            ("[matrix]\nculling = [\"none\"]", 12, 2, "matrix", "no structure is given", "add structure = ["),
            (
                "[matrix]\nstructure = []\nculling = [\"none\"]",
                13,
                13,
                "matrix.structure",
                "empty list",
                "at least one",
            ),
            (
                "[matrix]\nstructure = [\"octre\"]\nculling = [\"none\"]",
                13,
                15,
                "matrix.structure",
                "unknown structure `octre`",
                "`octree`",
            ),
            (
                "[matrix]\nstructure = [3]\nculling = [\"none\"]",
                13,
                14,
                "matrix.structure",
                "must be a string or a table, not a whole number",
                "write \"",
            ),
            (
                "[matrix]\nstructure = [\"octree:dept=3\"]\nculling = [\"none\"]",
                13,
                22,
                "matrix.structure",
                "no parameter `dept`",
                "`depth`",
            ),
            (
                "[matrix]\nstructure = [\"octree:depth=99\"]\nculling = [\"none\"]",
                13,
                22,
                "matrix.structure",
                "`depth` is 99, but must be",
                "default",
            ),
            (
                "[matrix]\nstructure = [\"octree:depth=[3,4]\"]\nculling = [\"none\"]",
                13,
                28,
                "matrix.structure",
                "single values only",
                "{ kind = \"octree\"",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", depth = [3, 99] }]\nculling = [\"none\"]",
                13,
                45,
                "matrix.structure.depth",
                "is 99",
                "default",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", deepth = 3 }]\nculling = [\"none\"]",
                13,
                33,
                "matrix.structure.deepth",
                "no parameter",
                "`depth`",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octtree\" }]\nculling = [\"none\"]",
                13,
                23,
                "matrix.structure.kind",
                "unknown structure",
                "`octree`",
            ),
            (
                "[matrix]\nstructure = [{ depth = 3 }]\nculling = [\"none\"]",
                13,
                14,
                "matrix.structure",
                "no `kind`",
                "kind =",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", depth = [] }]\nculling = [\"none\"]",
                13,
                41,
                "matrix.structure.depth",
                "empty list",
                "default",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", depth = { from = 3, to = 5 } }]\nculling = [\"none\"]",
                13,
                41,
                "matrix.structure.depth",
                "`steps` or `step`",
                "how many",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", depth = { from = 3, steps = 5 } }]\nculling = [\"none\"]",
                13,
                41,
                "matrix.structure.depth.to",
                "is missing",
                "range is",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", depth = { from = 0, to = 5, steps = 3, scale = \"log\" } }]\nculling = [\"none\"]",
                13,
                41,
                "matrix.structure.depth",
                "logarithmic",
                "linear",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", depth = { from = 5, to = 3, step = 1 } }]\nculling = [\"none\"]",
                13,
                41,
                "matrix.structure.depth",
                "holds no values",
                "larger",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", depth = { from = 1, to = 90, step = 1 } }]\nculling = [\"none\"]",
                13,
                41,
                "matrix.structure.depth",
                "must be a whole number from 0",
                "default",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", root = { from = 1, to = 9, step = 1 } }]\nculling = [\"none\"]",
                13,
                40,
                "matrix.structure.root",
                "no range",
                "list of values",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"octree\", depth = [[3]] }]\nculling = [\"none\"]",
                13,
                42,
                "matrix.structure.depth",
                "a list in a list",
                "flat",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"frustum+none\"]",
                14,
                21,
                "matrix.culling",
                "`none` stands alone",
                "remove",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"frustum+frustum\"]",
                14,
                13,
                "matrix.culling",
                "occurs twice",
                "once",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"frustum+\"]",
                14,
                12,
                "matrix.culling",
                "names nothing",
                "write name",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\nwalk = [\"depthfirst\"]",
                15,
                10,
                "matrix.walk",
                "unknown walk",
                "`depth_first`",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\nscene = [\"c\"]",
                15,
                10,
                "matrix.scene",
                "there is no scene `c`",
                "`a`",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\npath = \"hall\"",
                15,
                8,
                "matrix.path",
                "there is no path",
                "paths: w",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\nstructures = 1",
                15,
                1,
                "matrix.structures",
                "unknown key",
                "`structure`",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\nzip = [[\"structure\", \"cullin\"]]",
                15,
                22,
                "matrix.zip",
                "unknown axis",
                "`culling`",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"none\", \"frustum\"]\nzip = [[\"structure\", \"culling\"]]",
                15,
                8,
                "matrix.zip",
                "structure has 1, culling has 2",
                "equally long",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\nzip = [[\"structure\"]]",
                15,
                8,
                "matrix.zip",
                "at least two",
                "zip = [[",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\nzip = [[\"structure\", \"structure\"]]",
                15,
                22,
                "matrix.zip",
                "zipped twice",
                "one group",
            ),
            (
                "[matrix]\nstructure = [\"list\"]\nculling = [\"frustum:node_test=plane\"]",
                12,
                2,
                "matrix",
                "2 impossible cells",
                "[[exclude]]",
            ),
            (
                "[matrix]\nstructure = [{ kind = \"bsp\", min_leaf = { from = 1, to = 10000, step = 1 } }]\nculling = [{ kind = \"normal_mask\", cells = { from = 1, to = 18, step = 1 } }, { sum = [\"frustum\", { kind = \"normal_mask\", cells = { from = 1, to = 18, step = 1 } }] }, { sum = [\"frustum\", \"octant_mask\", { kind = \"normal_mask\", cells = { from = 1, to = 18, step = 1 } }] }]",
                12,
                2,
                "matrix",
                "1080000 cells",
                "zip axes",
            ),
        ],
    );
}

#[test]
fn rules_that_match_nothing_are_mistakes() {
    let head = format!("{HEAD}{MATRIX}");
    check(
        &head,
        &[
            (
                "[[exclude]]\nstructure = \"octree\"\nwhy = \"x\"",
                15,
                1,
                "exclude.0",
                "selects no cell",
                "`structure` holds list",
            ),
            (
                "[[exclude]]\nstructure = \"list:leaf_size>64\"\nwhy = \"x\"",
                15,
                1,
                "exclude.0",
                "selects no cell",
                "`structure` holds list",
            ),
            ("[[exclude]]\nstructure = \"list\"\n", 15, 1, "exclude.0.why", "is missing", "why ="),
            ("[[exclude]]\nstructure = \"list\"\nwhy = \" \"", 17, 7, "exclude.0.why", "is empty", "why ="),
            ("[[exclude]]\nwhy = \"x\"", 15, 1, "exclude.0", "names no axis", "say which"),
            ("[[exclude]]\nstructure = \"list\"\nwhy = \"x\"", 12, 2, "matrix", "every cell is excluded", "narrow"),
            (
                "[[exclude]]\nstructur = \"list\"\nwhy = \"x\"",
                16,
                1,
                "exclude.0.structur",
                "unknown axis",
                "`structure`",
            ),
            (
                "[[exclude]]\nstructure = \"lst\"\nwhy = \"x\"",
                16,
                13,
                "exclude.0.structure",
                "unknown structure",
                "`list`",
            ),
            (
                "[[exclude]]\nstructure = \"octree:dpth>3\"\nwhy = \"x\"",
                16,
                13,
                "exclude.0.structure",
                "no parameter",
                "`depth`",
            ),
            (
                "[[exclude]]\nstructure = \"octree:depth>\"\nwhy = \"x\"",
                16,
                13,
                "exclude.0.structure",
                "not a condition",
                "key>=value",
            ),
            (
                "[[exclude]]\nstructure = \"octree:root=sphere\"\nwhy = \"x\"",
                16,
                13,
                "exclude.0.structure",
                "is never sphere",
                "aabb, cube",
            ),
            (
                "[[exclude]]\nstructure = { kind = \"octree\", depth = { form = 3 } }\nwhy = \"x\"",
                16,
                42,
                "exclude.0.structure.depth.form",
                "unknown bound",
                "`from`",
            ),
            ("[[exclude]]\nscene = \"z9\"\nwhy = \"x\"", 16, 9, "exclude.0.scene", "there is no scene", "a, b"),
            ("[[include]]\nstructure = \"list\"", 15, 1, "include.0", "adds no cell", "remove"),
            ("[[include]]", 15, 1, "include.0", "fixes no axis", "cells to add"),
            ("[[include]]\nstructre = \"list\"", 16, 1, "include.0.structre", "unknown axis", "`structure`"),
            ("[[include]]\nstructure = \"octree:depht=3\"", 16, 21, "include.0.structure", "no parameter", "`depth`"),
            ("[[includes]]\nstructure = \"octree\"", 15, 3, "includes", "unknown key", "`include`"),
        ],
    );
}

#[test]
fn mistakes_in_claims_name_place_and_remedy() {
    let head = format!(
        "{HEAD}[matrix]\nstructure = [\"list\", \"octree\"]\nculling = [\"none\"]\n[[claim]]\nid = \"c\"\ntext = \"t\"\nsource = \"s\"\n"
    );
    let num = "numerator = { structure = \"list\" }\n";
    let den = "denominator = { structure = \"octree\" }\n";
    let metric = "metric = \"cull_ms\"\n";
    let own = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
    check(
        &head,
        &[
            (own(format!("{metric}{num}{den}")), 15, 1, "claim.0.relation", "is missing", "\"grows\""),
            (own(format!("{metric}{num}{den}relation = \"=\"")), 22, 12, "claim.0.relation", "one of", "\"<\""),
            (
                own(format!("{num}{den}relation = \"<\"\nmetric = \"cul_ms\"")),
                22,
                10,
                "claim.0.metric",
                "unknown metric",
                "\"cull_ms\"",
            ),
            (own(format!("{metric}{num}relation = \"<\"")), 15, 1, "claim.0.denominator", "is missing", "select runs"),
            (
                own(format!("{metric}{num}denominator = \"octree\"\nrelation = \"<\"")),
                21,
                15,
                "claim.0.denominator",
                "table of axes",
                "write {",
            ),
            (
                own(format!("{metric}{num}denominator = {{}}\nrelation = \"<\"")),
                21,
                15,
                "claim.0.denominator",
                "selects everything",
                "structure",
            ),
            (
                own(format!("{metric}{num}denominator = {{ structure = \"bsp\" }}\nrelation = \"<\"")),
                15,
                1,
                "claim.0.denominator",
                "selects no run",
                "[matrix]",
            ),
            (own(format!("{metric}{num}{den}relation = \"ratio\"")), 15, 1, "claim.0.published", "is missing", "3.35"),
            (
                own(format!("{metric}{num}{den}relation = \"ratio\"\npublished = [4, 3]")),
                23,
                13,
                "claim.0.published",
                "must be a ratio",
                "[1.71, 1.79]",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\npublished = {{ a = 3 }}")),
                23,
                13,
                "claim.0.published",
                "no groups",
                "for_each",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\nfor_each = \"scene\"\npublished = {{ q = 3 }}")),
                24,
                15,
                "claim.0.published.q",
                "no scene `q`",
                "`a`",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"grows\"")),
                22,
                12,
                "claim.0.relation",
                "triangle count",
                "for_each",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\nfor_each = \"scenes\"")),
                23,
                12,
                "claim.0.for_each",
                "unknown axis",
                "`scene`",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\nfor_each = \"structure\"")),
                15,
                1,
                "claim.0",
                "compares nothing",
                "for_each",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\ntolerance = -1")),
                23,
                13,
                "claim.0.tolerance",
                "share",
                "0.25",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\nwhy = 1")),
                23,
                1,
                "claim.0.why",
                "unknown key",
                "known here",
            ),
        ],
    );
}

#[test]
fn mistakes_in_sections_scenes_and_paths_name_place_and_remedy() {
    let tail = MATRIX;
    let own = |text: &str| -> &'static str { Box::leak(format!("{text}\n{tail}").into_boxed_str()) };
    let scene = "[study]\nname = \"t\"\n[[path]]\nname = \"w\"\nfile = \"w.csv\"\n";
    let a = "[[scene]]\nname = \"a\"\ngenerate = \"rooms\"\n";
    let with = |text: &str| own(&format!("{scene}{a}{text}"));
    let alone = |text: &str| own(&format!("{scene}{text}"));
    check(
        "",
        &[
            (
                own("[[scene]]\nname = \"a\"\ngenerate = \"rooms\"\n[[path]]\nname = \"w\"\nfile = \"w.csv\""),
                1,
                1,
                "study",
                "is missing",
                "[study]",
            ),
            (
                own(&format!("{}{a}", scene.replace("name = \"t\"", "name = \"t\"\nnam = \"t\""))),
                3,
                1,
                "study.nam",
                "unknown key",
                "`name`",
            ),
            (with("[measure]\nrepats = 5"), 10, 1, "measure.repats", "unknown key", "`repeats`"),
            (
                with("[measure]\nrepeats = 0"),
                10,
                11,
                "measure.repeats",
                "is `0`, but must be a whole number from 1",
                "give",
            ),
            (with("[measure]\nrepeats = \"5\""), 10, 11, "measure.repeats", "whole number", "without quotes: 5"),
            (with("[measure]\nrepeats = 5.0"), 10, 11, "measure.repeats", "whole number", "write 5 without"),
            (with("[measure]\nrelative_ci = 2"), 10, 15, "measure.relative_ci", "share", "0.02"),
            (
                with("[measure]\nrepeats = 6\nmax_repeats = 4"),
                11,
                15,
                "measure.max_repeats",
                "fewer than repeats = 6",
                "at least 6",
            ),
            (with("[measur]\nrepeats = 6"), 9, 2, "measur", "unknown key", "`measure`"),
            (with("[[measure]]\nrepeats = 6"), 9, 1, "measure", "must be a table", "[measure]"),
            (with("[camera]\nprojection = \"fisheye\""), 10, 14, "camera.projection", "is \"fisheye\"", "perspective"),
            (with("[camera]\nprojection = \"orthographic\""), 9, 2, "camera.height_m", "is missing", "height_m"),
            (with("[camera]\nheight_m = 3"), 10, 12, "camera.height_m", "orthographic camera", "fov_y_deg"),
            (with("[camera]\nfov_y_deg = 180"), 10, 13, "camera.fov_y_deg", "degrees", "175"),
            (with("[camera]\naspect = \"16x9\""), 10, 10, "camera.aspect", "no aspect", "16:9"),
            (with("[camera]\nnear_m = 2\nfar_m = 1"), 11, 9, "camera.far_m", "not beyond near_m", "inf"),
            (with("[camera]\nfar_m = nan"), 10, 9, "camera.far_m", "is `nan`", "inf"),
            (with("[accuracy]\nsamples = 99"), 10, 11, "accuracy.samples", "from 1 to 16", "give"),
            (with("[model]\nindex_ns = -1"), 10, 12, "model.index_ns", "nanoseconds", "0 or more"),
            (with("[[scene]]\nname = \"a\"\ngenerate = \"rooms\""), 10, 8, "scene.1.name", "names two scenes", "a_2"),
            (alone(""), 1, 1, "scene", "no scene", "[[scene]]"),
            (alone("[[scene]]\nname = \"a\""), 6, 1, "scene.0.file", "is missing", "generate ="),
            (alone("[[scene]]\ngenerate = \"rooms\""), 6, 1, "scene.0.name", "is missing", "hall"),
            (alone("[[scene]]\nname = \"a b\"\ngenerate = \"rooms\""), 7, 8, "scene.0.name", "is no name", "`a_b`"),
            (
                alone("[[scene]]\nname = \"a\"\nfile = \"x.obj\"\ngenerate = \"rooms\""),
                9,
                12,
                "scene.0.generate",
                "beside `file`",
                "keep one",
            ),
            (alone("[[scene]]\nname = \"a\"\nfile = \"x.obj\""), 8, 8, "scene.0.file", "does not exist", "folder"),
            (alone("[[scene]]\nname = \"a\"\nfile = \"notes.txt\""), 8, 8, "scene.0.file", "no known type", "obj"),
            (alone("[[scene]]\nname = \"a\"\nfile = \"empty_dir.obj\""), 8, 8, "scene.0.file", "is no file", ""),
            (
                alone("[[scene]]\nname = \"a\"\ngenerate = \"roms\""),
                8,
                13,
                "scene.0.generate",
                "unknown generator",
                "`rooms`",
            ),
            (
                alone("[[scene]]\nname = \"a\"\ngenerate = { kind = \"rooms\", world = [1, 2] }"),
                8,
                12,
                "scene.0.generate",
                "means 2",
                "single values",
            ),
            (
                alone("[[scene]]\nname = \"a\"\ngenerate = { kind = \"rooms\", wrld = 1 }"),
                8,
                30,
                "scene.0.generate.wrld",
                "no parameter",
                "`world`",
            ),
            (
                alone("[[scene]]\nname = \"a\"\ngenerate = \"rooms\"\nwinding = \"clockwise\""),
                9,
                11,
                "scene.0.winding",
                "is \"clockwise\"",
                "cw",
            ),
            (
                alone("[[scene]]\nname = \"a\"\ngenerate = \"rooms\"\nscale = 0"),
                9,
                9,
                "scene.0.scale",
                "above 0",
                "give",
            ),
            (with("[[path]]\nname = \"v\"\nfile = \"v.csv\""), 11, 8, "path.1.file", "does not exist", "`w.csv`"),
            (
                with("[[path]]\nname = \"v\"\nfile = \"w.csv\"\nscene = \"q\""),
                12,
                9,
                "path.1.scene",
                "there is no scene `q`",
                "`a`",
            ),
            (with("[[path]]\nname = \"v\"\nfile = \"w.csv\"\nframes = 0"), 12, 10, "path.1.frames", "from 1", "give"),
            (own(&format!("[study]\nname = \"t\"\n{a}")), 3, 1, "path", "has no path", "[[path]]"),
            (own(&format!("extends = \"m.toml\"\n{scene}{a}")), 1, 11, "extends", "extends itself", "circle"),
            (own(&format!("extends = \"q.toml\"\n{scene}{a}")), 1, 11, "extends", "cannot read the preset", "folder"),
            (own(&format!("extends = 3\n{scene}{a}")), 1, 11, "extends", "not a whole number", "presets/base.toml"),
            (with("[model\nindex_ns = 1"), 9, 7, "", "not TOML", ""),
            (with("[model]\nindex_ns = 1\nindex_ns = 2"), 11, 1, "", "not TOML: duplicate key", ""),
        ],
    );
}

#[test]
fn all_mistakes_are_told_at_once_in_the_order_of_the_text() {
    let text = "[study]\nname = \"t\"\ntitel = \"x\"\n[camera]\nfov_y_deg = 0\n[[scene]]\nname = \"a\"\nfile = \"no.obj\"\n[[path]]\nname = \"w\"\nfile = \"w.csv\"\n[matrix]\nstructure = [\"octre\", \"bsp:min_lef=3\", { kind = \"octree\", depth = [99, 98], rot = 1 }]\nculling = [\"frustrum\"]\n[[exclude]]\nculling = \"nrmal_mask\"\n";
    let errors = Folder::new().read(text, &["measure.repeats=many"]).unwrap_err();
    let places: Vec<(Option<u32>, &str)> =
        errors.iter().map(|e| (e.line, e.key.as_deref().unwrap_or_default())).collect();
    assert_eq!(
        places,
        [
            (Some(3), "study.titel"),
            (Some(5), "camera.fov_y_deg"),
            (Some(8), "scene.0.file"),
            (Some(13), "matrix.structure"),
            (Some(13), "matrix.structure"),
            (Some(13), "matrix.structure.depth"),
            (Some(13), "matrix.structure.depth"),
            (Some(13), "matrix.structure.rot"),
            (Some(14), "matrix.culling"),
            (Some(15), "exclude.0.why"),
            (Some(16), "exclude.0.culling"),
            (None, "measure.repeats"),
        ]
    );
}

#[test]
fn a_mistake_in_a_preset_or_a_set_names_that_text() {
    let folder = Folder::new();
    folder.write("presets/base.toml", "[measure]\nrepats = 3\n");
    let text = format!("extends = \"presets/base.toml\"\n{HEAD}{MATRIX}");
    let e = &folder.read(&text, &[]).unwrap_err()[0];
    assert!(e.file.as_ref().unwrap().ends_with("presets/base.toml") && e.line == Some(2), "{e}");
    let mut wrong = Vec::new();
    for (set, message, help) in [
        ("measure.repats=3", "unknown key", "`repeats`"),
        ("measure.repeats", "has no `=`", "write --set key=value"),
        ("measure..repeats=3", "empty key", "write --set"),
        ("measure.repeats=[1", "not a TOML value", "values are TOML"),
        ("measure.repeats=", "not a TOML value", "values are TOML"),
        ("measure.repeats=\"3\"", "whole number", "without quotes"),
        ("scene.7.name=x", "no entry `7`", "0 to 1 or named a, b"),
        ("scene.ab.name=x", "no entry `ab`", "`a`"),
        ("study.name.x=3", "holds no `x`", "as a whole"),
        ("scene.0.file=gone.obj", "beside `file`", "keep one"),
    ] {
        let Err(errors) = folder.read(&format!("{HEAD}{MATRIX}"), &[set]) else {
            wrong.push(format!("accepted {set}"));
            continue;
        };
        let e = &errors[0];
        let named = e.file.as_ref().unwrap().to_str().unwrap().contains(&format!("--set {set}"));
        let right = errors.len() == 1
            && (named || set.contains("file"))
            && e.message.contains(message)
            && e.help.as_deref().unwrap_or_default().contains(help)
            && e.snippet.as_ref().unwrap().contains('^');
        if !right {
            wrong.push(errors.iter().map(Error::to_string).collect::<Vec<_>>().join("\n"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n----\n"));
}

#[test]
fn an_unreadable_manifest_is_an_error_with_its_path() {
    let folder = Folder::new();
    let path = folder.write("m.toml", "").with_file_name("none.toml");
    let e = &cullmark::manifest::Manifest::load(&path, &[]).unwrap_err()[0];
    assert!(e.to_string().contains("none.toml: cannot read the manifest"), "{e}");
}

/// Pieces that manifests are made of, and rubbish.
fn fragment() -> impl Strategy<Value = String> {
    prop_oneof![
        Just("[matrix]\n".to_string()),
        Just("[[exclude]]\n".to_string()),
        Just("[[claim]]\n".to_string()),
        Just("structure = [{ kind = \"octree\", depth = { from = 1, to = 3, steps = 2 } }]\n".to_string()),
        Just("zip = [[\"structure\", \"culling\"]]\n".to_string()),
        Just("published = { a = [1, 2] }\nfor_each = \"scene\"\n".to_string()),
        Just("numerator = { culling = [\"frustum+*\", { kind = \"octree\", depth = [1] }] }\n".to_string()),
        "[a-z_.\\[\\]={}\",:+*0-9 \n]{0,40}",
        ".{0,12}",
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..Default::default() })]

    #[test]
    fn no_text_panics(parts in proptest::collection::vec(fragment(), 0..8), sets in proptest::collection::vec("[a-z.0-9=\\[\\]\"{}é ]{0,20}", 0..2)) {
        let folder = Folder::new();
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        let _ = folder.read(&parts.concat(), &sets);
        let _ = folder.read(&format!("{HEAD}{}", parts.concat()), &sets);
    }

    #[test]
    fn no_damaged_manifest_panics(cut in any::<prop::sample::Index>(), put in "[\\[\\]{}=\",.0-9aé\n-]{0,3}", gone in 0usize..6) {
        let whole = format!(
            "{HEAD}[camera]\nfov_y_deg = 60.5\n[matrix]\nstructure = [\"list\", {{ kind = \"octree\", depth = {{ from = 2, to = 4, steps = 2, scale = \"log\" }} }}]\nculling = [\"none\", \"frustum+normal_mask:cells=4\"]\nzip = [[\"structure\", \"culling\"]]\n[[include]]\nstructure = \"bsp\"\n[[exclude]]\nstructure = \"octree:depth>=4\"\nwhy = \"w\"\n[[claim]]\nid = \"i\"\ntext = \"t\"\nsource = \"s\"\nmetric = \"cull_ms\"\nnumerator = {{ structure = \"list\" }}\ndenominator = {{ structure = \"bsp\" }}\nrelation = \"ratio\"\npublished = {{ a = [1.5, 2] }}\nfor_each = \"scene\"\n"
        );
        let at = cut.index(whole.len());
        let end = (at + gone).min(whole.len());
        let damaged = format!("{}{put}{}", &whole[..at], &whole[end..]);
        let _ = Folder::new().read(&damaged, &[]);
    }
}
