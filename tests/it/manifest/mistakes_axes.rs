//! Mistakes in arithmetics, cameras, places, families and sweeps.

use super::HEAD;
use super::mistakes::{MATRIX, check};

#[test]
fn mistakes_in_further_axes_name_place_and_remedy() {
    let head = format!("{HEAD}{MATRIX}");
    check(
        &head,
        &[
            ("arithmetic = [\"f32_wrld\"]", 15, 16, "matrix.arithmetic", "unknown arithmetic", "`f32_world`"),
            ("arithmetic = [\"f64:bits=3\"]", 15, 20, "matrix.arithmetic", "no parameter", "no parameters"),
            ("arithmetic = []", 15, 14, "matrix.arithmetic", "empty list", "at least one"),
            ("arithmetic = 64", 15, 14, "matrix.arithmetic", "not a whole number", "f32_world"),
            ("arithmetics = [\"f64\"]", 15, 1, "matrix.arithmetics", "unknown key", "`arithmetic`"),
            ("camera = [\"fisheye\"]", 15, 12, "matrix.camera", "unknown camera", "orthographic, perspective"),
            ("camera = [\"perspective:fov=3\"]", 15, 24, "matrix.camera", "no parameter `fov`", "fov_y_deg"),
            ("camera = [\"perspective:fov_y_deg=180\"]", 15, 24, "matrix.camera", "from 0.01 to 179", "correct it"),
            ("camera = [\"perspective:near_m=2,far_m=1\"]", 15, 11, "matrix.camera", "not beyond", "raise far_m"),
            (
                "camera = [{ kind = \"perspective\", height_m = 3 }]",
                15,
                35,
                "matrix.camera.height_m",
                "no parameter `height_m`",
                "fov_y_deg",
            ),
            (
                "[[exclude]]\narithmetic = \"f63\"\nwhy = \"x\"",
                16,
                14,
                "exclude.0.arithmetic",
                "unknown arithmetic",
                "`f64`",
            ),
            (
                "[[exclude]]\narithmetic = \"f64\"\nwhy = \"x\"",
                15,
                1,
                "exclude.0",
                "selects no cell",
                "`arithmetic` holds f32_relative",
            ),
            (
                "[[exclude]]\ncamera = \"perspective:fov_y_deg<10\"\nwhy = \"x\"",
                15,
                1,
                "exclude.0",
                "selects no cell",
                "`camera` holds perspective",
            ),
        ],
    );
}

#[test]
fn mistakes_in_places_and_families_name_place_and_remedy() {
    let own = |text: &str| -> &'static str {
        let path = "[[path]]\nname = \"w\"\nfile = \"w.csv\"\n";
        let scene = "[[scene]]\nname = \"a\"\ngenerate = \"rooms\"\n";
        let text = match text.strip_prefix("PATH ") {
            Some(rest) => format!("{scene}offset_m = [1, 2]\n{rest}\n{path}{MATRIX}"),
            None => format!("{scene}{text}\n{path}{MATRIX}"),
        };
        Box::leak(text.into_boxed_str())
    };
    check(
        "[study]\nname = \"t\"\n",
        &[
            (own("offset_m = -1"), 6, 12, "scene.0.offset_m", "is `-1`", "from 0 to 1e12"),
            (own("offset_m = \"far\""), 6, 12, "scene.0.offset_m", "but must be metres", "{ x = 1e4"),
            (own("offset_m = [1, -5]"), 6, 16, "scene.0.offset_m", "is `-5`", "from 0 to 1e12"),
            (own("offset_m = []"), 6, 12, "scene.0.offset_m", "empty list", "remove the key"),
            (own("offset_m = [[1, 2, 3]]"), 6, 13, "scene.0.offset_m", "list in a list", "{ x = 1e4"),
            (own("offset_m = { x = 1, w = 2 }"), 6, 21, "scene.0.offset_m.w", "unknown key", "did you mean `x`"),
            (own("offset_m = { x = \"1\" }"), 6, 18, "scene.0.offset_m.x", "metres", "1e12"),
            (own("offset_m = { from = 1, to = 5 }"), 6, 12, "scene.0.offset_m", "either `steps`", "steps ="),
            (
                own("offset_m = { from = 0, to = 5, steps = 3, scale = \"log\" }"),
                6,
                12,
                "scene.0.offset_m",
                "above 0",
                "raise `from`",
            ),
            (own("offsetm = 1"), 6, 1, "scene.0.offsetm", "unknown key", "`offset_m`"),
            (own("scale = [1, 0]"), 6, 13, "scene.0.scale", "holds 0", "above 0"),
            (own("scale = { from = -1, to = 1, steps = 3 }"), 6, 9, "scene.0.scale", "holds -1.0", "above 0"),
            (own("offset_m = { from = 0, to = 5000, step = 1 }"), 3, 1, "scene.0", "means 5001 scenes", "shorten"),
            (
                own("PATH [[path]]\nname = \"v\"\nfile = \"w.csv\"\nscene = \"a@offset_m=3\""),
                10,
                9,
                "path.0.scene",
                "there is no scene",
                "`a@offset_m=",
            ),
            (own("PATH [[path]]\nname = \"v@w\"\nfile = \"w.csv\""), 8, 8, "path.0.name", "is no name", "`v_w`"),
            (
                own("PATH [[scene]]\nname = \"a\"\ngenerate = \"rooms\""),
                8,
                8,
                "scene.1.name",
                "names two scenes",
                "a_2",
            ),
            (
                own("PATH [[path]]\nname = \"v\"\ngenerate = { kind = \"static\", yaw_deg = [1, 400] }"),
                9,
                45,
                "path.0.generate.yaw_deg",
                "from -360",
                "correct it",
            ),
        ],
    );
}

#[test]
fn mistakes_in_sweeps_name_place_and_remedy() {
    let head = format!(
        "{HEAD}[matrix]\nstructure = [\"list\"]\nculling = [\"frustum\"]\narithmetic = [\"f64\", \"f32_world\"]\ncamera = [\"perspective\", \"perspective:fov_y_deg=1\"]\n[[sweep]]\n"
    );
    let own = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
    let (id, x, y) = ("id = \"s\"\n", "x = \"camera.fov_y_deg\"\n", "y = \"over_submission\"\n");
    let with = |text: &str| own(format!("{id}{x}{y}{text}"));
    check(
        &head,
        &[
            (own(format!("{x}{y}")), 17, 1, "sweep.0.id", "is missing", "id ="),
            (own(format!("{id}{y}")), 17, 1, "sweep.0.x", "is missing", "scene.offset_m"),
            (own(format!("{id}{x}")), 17, 1, "sweep.0.y", "is missing", "y ="),
            (own(format!("{id}{x}y = \"oversubmission\"")), 20, 5, "sweep.0.y", "unknown metric", "over_submission"),
            (
                own(format!("{id}{y}x = \"fov_y_deg\"")),
                20,
                5,
                "sweep.0.x",
                "no axis with a parameter",
                "scene.offset_m",
            ),
            (own(format!("{id}{y}x = \"camra.fov_y_deg\"")), 20, 5, "sweep.0.x", "unknown axis", "`camera`"),
            (
                own(format!("{id}{y}x = \"camera.fov_deg\"")),
                20,
                5,
                "sweep.0.x",
                "no run has the number",
                "camera.fov_y_deg",
            ),
            (own(format!("{id}{y}x = \"walk.q\"")), 20, 5, "sweep.0.x", "no run has the number", "has no numbers"),
            (
                own(format!("{id}{y}x = \"camera.near_m\"")),
                20,
                5,
                "sweep.0.x",
                "is 0.1 in every run",
                "give `near_m` of the camera",
            ),
            (with("by = \"arithmetics\""), 21, 6, "sweep.0.by", "unknown axis", "`arithmetic`"),
            (with("x_scale = \"logarithmic\""), 21, 11, "sweep.0.x_scale", "one of", "log"),
            (with("scale = \"log\""), 21, 1, "sweep.0.scale", "unknown key", "x_scale"),
            (with("expected = 1"), 21, 12, "sweep.0.expected", "a table", "table"),
            (
                with("expected = { of = \"f64\", why = \"w\" }"),
                21,
                1,
                "sweep.0.expected.slope",
                "is missing",
                "slope =",
            ),
            (with("expected = { slope = 1, why = \"w\" }"), 21, 1, "sweep.0.expected.of", "is missing", "f32_world"),
            (with("expected = { slope = 1, of = \"f64\" }"), 21, 1, "sweep.0.expected.why", "is missing", "source"),
            (
                with("expected = { slope = 1, of = \"f32_wrld\", why = \"w\" }"),
                21,
                12,
                "sweep.0.expected.of",
                "no line is `f32_wrld`",
                "f32_world",
            ),
            (
                with("expected = { slope = 1, of = \"exact\", why = \"w\" }"),
                21,
                12,
                "sweep.0.expected.of",
                "no line is `exact`",
                "f64, f32_world",
            ),
            (own(format!("{id}{x}{y}[[sweep]]\n{id}{x}{y}")), 22, 6, "sweep.1.id", "names two sweeps", "s_2"),
        ],
    );
}

#[test]
fn a_logarithmic_axis_needs_two_values_above_0() {
    let head = HEAD.replacen("generate = \"rooms:world=1\"", "generate = \"rooms:world=1\"\noffset_m = [0, 5]", 1);
    check(
        &format!("{head}{MATRIX}[[sweep]]\nid = \"s\"\ny = \"over_submission\"\n"),
        &[("x = \"scene.offset_m\"", 19, 5, "sweep.0.x", "no two values above 0", "x_scale = \"linear\"")],
    );
}
