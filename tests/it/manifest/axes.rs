//! The axes `arithmetic` and `camera`: what they multiply, and what they leave alone.

use super::{cells, matrix, whole};
use cullmark::claim::{axis_value, selects};
use cullmark::manifest::Manifest;
use cullmark::math::{Arithmetic, Projection};
use cullmark::matrix::plan::{Known, plan};
use cullmark::matrix::{Matrix, labels};

const ALL: &str = "arithmetic = [\"f32_world\", \"f32_relative\", \"f64\", \"filtered\", \"exact\", \"fixed_q16\"]\n";

fn shown(matrix: &Matrix) -> Vec<String> {
    matrix.runs.iter().map(|r| labels(r).cell()).collect()
}

#[test]
fn a_culling_that_takes_no_arithmetic_runs_once() {
    let m = matrix(&format!(
        "[matrix]\nscene = \"a\"\nstructure = [\"list\"]\nculling = [\"none\", \"frustum\", \"frustum:arithmetic=exact\"]\n{ALL}"
    ));
    assert_eq!(
        shown(&m),
        [
            "list × none",
            "list × frustum × f32_world",
            "list × frustum",
            "list × frustum × f64",
            "list × frustum × filtered",
            "list × frustum × exact",
            "list × frustum × fixed_q16",
            "list × frustum:arithmetic=exact",
        ]
    );
    assert_eq!(m.duplicates, 5 + 5, "what is left out is counted");
    let run = &m.runs[3];
    assert_eq!(run.arithmetic().unwrap(), Arithmetic::F64);
    assert_eq!(run.revisions["arithmetic.f64"], 1);
    assert_eq!(m.runs[7].revisions["arithmetic.exact"], 1, "stated inline, its revision counts too");
    assert!(!m.runs[2].revisions.keys().any(|k| k.starts_with("arithmetic")), "{:?}", m.runs[2].revisions);
}

#[test]
fn rules_and_claims_name_an_arithmetic_the_usual_one_too() {
    let (manifest, m) = whole(
        &format!(
            "[matrix]\nscene = \"a\"\nstructure = [\"list\"]\nculling = [\"none\", \"frustum\"]\n{ALL}[[exclude]]\narithmetic = [\"filtered\", \"exact\", \"fixed_q16\"]\nwhy = \"slow\"\n[[claim]]\nid = \"c\"\ntext = \"t\"\nsource = \"s\"\nmetric = \"cull_ms\"\nnumerator = {{ arithmetic = \"f64\" }}\ndenominator = {{ arithmetic = \"f32_relative\", culling = \"frustum\" }}\nrelation = \">\"\nfor_each = \"arithmetic\"\n"
        )
        .replace("for_each = \"arithmetic\"\n", ""),
        &[],
    );
    assert_eq!(shown(&m), ["list × none", "list × frustum × f32_world", "list × frustum", "list × frustum × f64"]);
    assert_eq!(m.excluded_runs.len(), 3);
    let claim = &manifest.claims()[0];
    let picked = |s| m.runs.iter().filter(|r| selects(s, r)).map(|r| labels(r).cell()).collect::<Vec<_>>();
    assert_eq!(picked(&claim.numerator), ["list × frustum × f64"]);
    assert_eq!(picked(&claim.denominator), ["list × frustum"]);
    assert_eq!(labels(&m.runs[2]).of("arithmetic"), "f32_relative");
    let table = plan(&manifest, &m, |_| Known::default()).table();
    assert!(table.contains("list × frustum × f64"), "{table}");
}

#[test]
fn cameras_are_values_and_take_over_the_section() {
    let m = matrix(
        "[camera]\nnear_m = 0.5\nfov_y_deg = 40\n[matrix]\nscene = \"a\"\nstructure = [\"list\"]\nculling = [\"none\"]\ncamera = [{ kind = \"perspective\", fov_y_deg = { from = 0.01, to = 179, steps = 3, scale = \"log\" } }, \"perspective:fov_y_deg=40\", \"orthographic:height_m=20,far_m=7\", \"perspective\"]",
    );
    assert_eq!(
        shown(&m),
        [
            "list × none × perspective:fov_y_deg=0.01,near_m=0.5",
            "list × none × perspective:fov_y_deg=1.33791,near_m=0.5",
            "list × none × perspective:fov_y_deg=179,near_m=0.5",
            "list × none",
            "list × none × orthographic:far_m=7,near_m=0.5",
        ]
    );
    assert_eq!(labels(&m.runs[1]).of("camera"), "perspective:fov_y_deg=1.33791,near_m=0.5", "as in a claim");
    assert_eq!(m.duplicates, 1, "the section's own camera, written twice");
    let number = |i: usize, name: &str| m.runs[i].number(name);
    assert_eq!((number(0, "camera.fov_y_deg"), number(2, "camera.fov_y_deg")), (Some(0.01), Some(179.0)));
    assert_eq!((number(3, "camera.fov_y_deg"), number(3, "camera.near_m")), (Some(40.0), Some(0.5)));
    assert_eq!((number(4, "camera.height_m"), number(4, "camera.far_m")), (Some(20.0), Some(7.0)));
    assert_eq!((number(3, "camera.far_m"), number(4, "camera.fov_y_deg")), (None, None), "infinite is nowhere");
    assert_eq!(m.runs[4].camera.projection, Projection::Orthographic { height_m: 20.0 });
    assert_eq!(m.runs[4].camera.far_m, Some(7.0));
    let truths: std::collections::HashSet<String> = m.runs.iter().map(|r| r.truth_id()).collect();
    assert_eq!(truths.len(), 5, "every camera has a truth of its own");
    assert_eq!(axis_value(&m.runs[3], "camera")[0].float("fov_y_deg"), 40.0, "the section's camera can be selected");
}

#[test]
fn cameras_are_selected_by_their_numbers() {
    let m = matrix(
        "[matrix]\nscene = \"a\"\nstructure = [\"list\"]\nculling = [\"none\"]\ncamera = [\"perspective\", \"perspective:fov_y_deg=1\", \"orthographic\"]\n[[exclude]]\ncamera = \"perspective:fov_y_deg<10\"\nwhy = \"narrow\"",
    );
    assert_eq!(shown(&m), ["list × none", "list × none × orthographic"]);
    assert_eq!(m.excluded[0].cell, "list × none × perspective:fov_y_deg=1");
}

#[test]
fn further_axes_zip_and_are_included() {
    let m = matrix(
        "[matrix]\nscene = \"a\"\nstructure = [\"list\", \"octree\"]\nculling = [\"frustum\"]\narithmetic = [\"f64\", \"exact\"]\nzip = [[\"structure\", \"arithmetic\"]]\n[[include]]\nstructure = \"bsp\"\narithmetic = \"filtered\"",
    );
    assert_eq!(shown(&m), ["list × frustum × f64", "octree × frustum × exact", "bsp × frustum × filtered"]);
    assert_eq!(cells(&m).len(), 3);
}

#[test]
fn the_merged_text_of_a_study_gives_the_same_runs_again() {
    let text = format!(
        "{}[matrix]\nstructure = [\"list\"]\nculling = [\"frustum\"]\n{ALL}camera = [\"perspective\", {{ kind = \"orthographic\", height_m = [5, 50.5] }}]\n",
        super::HEAD
    );
    let folder = super::Folder::new();
    let (manifest, m) = folder.read(&text, &["scene.a.offset_m=[0, 1e3]", "measure.repeats=2"]).unwrap();
    let path = folder.write("again.toml", &manifest.source_text);
    let again = Manifest::load(&path, &[]).unwrap();
    let again = cullmark::matrix::expand(&again, &cullmark::matrix::Setting::default()).unwrap();
    assert_eq!(again.runs, m.runs);
    assert_eq!(m.runs.len(), 3 * 6 * 3);
}
