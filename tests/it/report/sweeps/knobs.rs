//! A metric against another, along a knob: points where their numbers are, the knob beside them.

use super::super::fixture;
use cullmark::record::SceneSource;
use cullmark::registry::{Spec, Value};
use cullmark::report::figure::{Figure, Mark};
use cullmark::report::sweeps::chart;
use cullmark::report::{render, sweep_chart, sweep_tables};
use cullmark::results::{RunStatus, StudyResults};
use cullmark::sweep::Sweep;

/// Triangles fall with the knob while the missing pixels grow, from none at 1.
fn turned() -> StudyResults {
    let mut results = fixture::sized(&fixture::SCENES[..1], 20, 2);
    results.runs.clear();
    for (step, knob) in [1.0, 4.0, 16.0, 64.0].into_iter().enumerate() {
        let mut run = fixture::run("boxes", 1e4, "list", "frustum", 20, 2, 5);
        run.spec.scene.source = SceneSource::Generated(Spec::new("boxes").with("knob", Value::Float(knob)));
        run.measurement_id = format!("knob {knob}");
        run.triangles.iter_mut().for_each(|t| *t = 1000.0 / knob);
        run.errors.iter_mut().for_each(|e| e.false_cull_pixels = [0, 1, 10, 100][step]);
        results.runs.push(run);
    }
    results.sweeps = vec![Sweep {
        id: "knob".into(),
        title: "Triangles against missing pixels".into(),
        x: "scene.knob".into(),
        x_unit: "px".into(),
        y: "mean_triangles".into(),
        against: Some("false_cull_ppm".into()),
        by: "culling".into(),
        x_log: true,
        y_log: true,
        expected_slope: None,
        expected_for: None,
        expected_why: String::new(),
    }];
    results
}

fn places(figure: &Figure) -> Vec<(f64, f64)> {
    let of = |tag: &cullmark::report::figure::Tag| {
        figure.marks[tag.marks.clone()].iter().find_map(|m| match m {
            Mark::Circle { x, y, .. } => Some((*x, *y)),
            _ => None,
        })
    };
    figure.tags.iter().map(|t| of(t).expect("a marker")).collect()
}

#[test]
fn points_stand_at_both_metrics_in_the_order_of_the_knob() {
    let mut results = turned();
    let figure = sweep_chart::draw(&chart(&results, &results.sweeps[0]).unwrap());
    let at = places(&figure);
    assert_eq!(at.len(), 4);
    assert!(at.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1), "to the right and down: {at:?}");
    for label in ["1", "4", "16", "64"] {
        let written = |m: &Mark| matches!(m, Mark::Text { text, .. } if text == label);
        assert!(figure.marks.iter().any(written), "the knob {label} is named");
    }
    assert!(figure.caption.contains("scene knob (px)"), "{}", figure.caption);
    render::svg(&figure, true).unwrap();

    // What is wrong has no point, and a row of the table.
    (results.runs[2].status, results.runs[2].reason) = (RunStatus::Wrong, Some("lost 3".into()));
    let c = chart(&results, &results.sweeps[0]).unwrap();
    assert_eq!(places(&sweep_chart::draw(&c)).len(), 3);
    let csv = sweep_tables::points(&c).csv();
    assert!(csv.lines().next().unwrap().contains("false_cull_ppm") && csv.contains("lost 3"), "{csv}");
}

#[test]
fn nothing_lost_anywhere_is_drawn_too() {
    let mut results = turned();
    results.runs.iter_mut().flat_map(|r| &mut r.errors).for_each(|e| e.false_cull_pixels = 0);
    let figure = sweep_chart::draw(&chart(&results, &results.sweeps[0]).unwrap());
    assert_eq!(places(&figure).len(), 4);
    render::svg(&figure, true).unwrap();
    results.sweeps[0].against = Some("false_cull_pmm".into());
    let words = chart(&results, &results.sweeps[0]).err().unwrap();
    assert!(words.contains("did you mean `false_cull_ppm`"), "{words}");
}
