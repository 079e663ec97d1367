//! Further axes and numbers of runs in labels, queries and claims.

use super::fixture;
use cullmark::claim::{Claim, Relation};
use cullmark::record::{SceneSource, cameras};
use cullmark::registry::{Spec, Value};
use cullmark::report::claims::judge;
use cullmark::report::labels::Grid;
use cullmark::report::query::{Format, Query, print, query};
use cullmark::results::{RunResult, StudyResults};

/// `none` once, `frustum` in three arithmetics, in scenes ever farther away.
fn study() -> StudyResults {
    let mut results = fixture::sized(&fixture::SCENES[..1], 20, 3);
    results.runs.clear();
    for (i, offset_m) in [0.0, 1e3, 1e6].into_iter().enumerate() {
        let cell = |culling: &str, arithmetic: &str| -> RunResult {
            let mut run = fixture::run("hall", 5e3, "list", culling, 20, 3, i as u64);
            run.spec.scene.name = format!("hall@offset_m={offset_m}");
            run.spec.scene.offset_m = cullmark::scene::placement::along(offset_m);
            run.spec.scene.source = SceneSource::Generated(Spec::new("slivers").with("aspect", Value::Float(12.5)));
            if arithmetic != "f32_relative" {
                run.spec.axes.insert("arithmetic".into(), Spec::new(arithmetic));
            }
            run
        };
        results.runs.push(cell("none", "f32_relative"));
        results.runs.extend(["f32_world", "f32_relative", "f64"].map(|a| cell("frustum", a)));
    }
    let narrow = Spec::parse("perspective:fov_y_deg=2.5,aspect=1.5,near_m=0.1,far_m=0").unwrap();
    let run = results.runs.last_mut().unwrap();
    run.spec.camera = cameras::camera_of(&narrow).unwrap();
    run.spec.axes.insert("camera".into(), cameras::spec_of(&run.spec.camera));
    results
}

#[test]
fn labels_name_an_arithmetic_where_it_varies_or_is_not_usual() {
    let results = study();
    let grid = Grid::of(&results);
    assert_eq!(
        grid.combinations,
        [
            "list × none",
            "list × frustum × f32_world",
            "list × frustum × f32_relative",
            "list × frustum × f64",
            "list × frustum × f64 × perspective:aspect=1.5,fov_y_deg=2.5",
        ]
    );
    let mut usual = results.clone();
    usual.runs.retain(|r| r.spec.axes.is_empty());
    assert_eq!(Grid::of(&usual).combinations, ["list × none", "list × frustum"]);
}

#[test]
fn runs_are_filtered_and_sorted_by_their_numbers() {
    let results = study();
    let ask = |filter: &str, sort: &str| -> Vec<String> {
        let columns = ["scene.offset_m", "arithmetic", "camera"].map(String::from).to_vec();
        let sort = Vec::from_iter((!sort.is_empty()).then(|| sort.to_string()));
        let q = Query { filter: Some(filter.into()), columns, sort, limit: None };
        print(&query(&results, &q).unwrap_or_else(|e| panic!("{filter}: {e}")), Format::Csv)
            .unwrap()
            .lines()
            .skip(1)
            .map(String::from)
            .collect()
    };
    assert_eq!(ask("scene.offset_m>=1e3", "").len(), 8);
    assert_eq!(ask("scene.offset_m>=1e3 and arithmetic = f64", "-scene.offset_m").len(), 2);
    assert_eq!(ask("arithmetic = f32_relative and culling = none", "").len(), 3);
    assert_eq!(ask("scene = hall", "").len(), 12, "the name of the family");
    assert_eq!(ask("scene.aspect in 12..13", "").len(), 12);
    let first = &ask("arithmetic != f64", "-scene.offset_m")[0];
    assert!(first.starts_with("1000000") && first.contains("f32_relative,perspective"), "{first}");
    assert_eq!(ask("camera.fov_y_deg < 10", "").len(), 1);
    let q = |filter: &str| Query { filter: Some(filter.into()), ..Query::default() };
    let e = query(&results, &q("scene.ofset_m > 1")).unwrap_err();
    assert!(e.to_string().contains("did you mean `scene.offset_m`"), "{e}");
    let e = query(&results, &q("scene.offset_m > far")).unwrap_err();
    assert!(e.to_string().contains("is a number, and `far` is none"), "{e}");
}

#[test]
fn rows_that_differ_in_the_walk_alone_differ_in_a_query_without_columns() {
    let mut results = fixture::sized(&fixture::SCENES[..1], 20, 3);
    results.runs.truncate(1);
    let mut other = results.runs[0].clone();
    other.walk = "flat".into();
    other.spec.walk = Spec::new("flat");
    results.runs.push(other);
    let text = print(&query(&results, &Query::default()).unwrap(), Format::Table).unwrap();
    let rows: Vec<&str> = text.lines().skip(2).collect();
    assert!(rows.len() == 2 && rows[0] != rows[1], "{text}");
    assert!(rows[0].contains("depth_first") && rows[1].contains(" flat "), "{text}");
}

#[test]
fn a_claim_pairs_what_takes_no_arithmetic_with_every_arithmetic() {
    let mut results = study();
    results.runs.pop();
    let mut claim = fixture::claim("x", Relation::Less);
    claim.metric = "mean_triangles".into();
    claim.numerator = fixture::select(&[("culling", "frustum")]);
    claim.denominator = fixture::select(&[("culling", "none")]);
    claim.for_each = Some("arithmetic".into());
    let judged = judge(&results, &claim);
    let names: Vec<&str> = judged.groups.iter().map(|g| g.name.as_str()).collect();
    assert_eq!(names, ["f32_world", "f32_relative", "f64"]);
    assert!(judged.groups.iter().all(|g| g.ratio.is_some()));
    claim.for_each = Some("scene".into());
    // Between arithmetics, runs of one scene are compared.
    claim.numerator = fixture::select(&[("arithmetic", "f32_world")]);
    claim.denominator = fixture::select(&[("arithmetic", "f32_relative"), ("culling", "frustum")]);
    assert_eq!(judge(&results, &claim).groups.len(), 3);
    // Cameras go by the labels that the plan prints.
    claim.for_each = Some("camera".into());
    claim.numerator = fixture::select(&[("arithmetic", "f64")]);
    claim.denominator.clear();
    claim.relation = Relation::Value;
    claim.published = Some([0.0, 1e9]);
    let names: Vec<String> = judge(&study(), &claim).groups.into_iter().map(|g| g.name).collect();
    assert_eq!(names, ["perspective", "perspective:aspect=1.5,fov_y_deg=2.5"]);
}

/// Two scenes named on both sides are a part of the study, not a comparison of scenes.
#[test]
fn what_both_sides_select_alike_is_paired() {
    let results = fixture::study();
    let whole = fixture::claim("x", Relation::Less);
    let mut part = whole.clone();
    let scenes: Vec<String> = [0, 2].map(|i| fixture::SCENES[i].0.to_string()).into();
    part.numerator.insert("scene".into(), scenes.clone());
    part.denominator.insert("scene".into(), scenes.clone());
    let of = |claim: &Claim| -> Vec<(String, Option<f64>)> {
        judge(&results, claim).groups.into_iter().map(|g| (g.name, g.ratio.map(|r| r.0))).collect()
    };
    let expected: Vec<_> = of(&whole).into_iter().filter(|(name, _)| scenes.contains(name)).collect();
    assert_eq!(of(&part), expected);
    assert!(expected.len() == 2 && expected[0].1.is_some() && expected[0].1 != expected[1].1, "{expected:?}");
}
