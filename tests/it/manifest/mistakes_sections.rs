//! Mistakes in sections, scenes, paths, layers and TOML itself.

use super::mistakes::{MATRIX, check};

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
            (with("[camera]\nfov_y_deg = 180"), 10, 13, "camera.fov_y_deg", "degrees", "179"),
            (with("[camera]\naspect = \"16x9\""), 10, 10, "camera.aspect", "no aspect", "16:9"),
            (with("[camera]\nnear_m = 2\nfar_m = 1"), 11, 9, "camera.far_m", "not beyond near_m", "inf"),
            (with("[camera]\nfar_m = nan"), 10, 9, "camera.far_m", "is `nan`", "inf"),
            (with("[accuracy]\nsamples = 99"), 10, 11, "accuracy.samples", "from 1 to 16", "give"),
            (with("[accuracy]\nhiding_cells = -1"), 10, 16, "accuracy.hiding_cells", "from 0 to 16384", "give"),
            (with("[accuracy]\nwitness_rays = 2.5"), 10, 16, "accuracy.witness_rays", "from 0 to 100000", "give"),
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
