//! Errors against stressors: which runs meet on a line, zeros, what failed, growth.

#[path = "sweeps/knobs.rs"]
mod knobs;

use super::fixture;
use cullmark::math::Projection;
use cullmark::record::SceneSource;
use cullmark::registry::{Spec, Value};
use cullmark::report::sweeps::chart;
use cullmark::report::{self, render, sweep_chart, sweep_tables};
use cullmark::results::{RunResult, RunStatus, StudyResults};
use cullmark::sweep::Sweep;

fn sweep() -> Sweep {
    Sweep {
        id: "offset".into(),
        title: "False culls against the distance from the origin".into(),
        x: "scene.offset_m".into(),
        x_unit: "m".into(),
        y: "false_cull_ppm".into(),
        against: None,
        by: "arithmetic".into(),
        x_log: true,
        y_log: true,
        expected_slope: Some(1.0),
        expected_for: Some("f32_world".into()),
        expected_why: "The error of a distance is five ulps of the offset".into(),
    }
}

/// f32_world grows as the offset from 1000 m on, the default stays at zero, fixed_q16 overflows at 1e5 m.
fn stressed(cullings: &[&str]) -> StudyResults {
    let mut results = fixture::sized(&fixture::SCENES[..1], 20, 2);
    results.runs.clear();
    for culling in cullings {
        for arithmetic in ["f32_world", "f32_relative", "fixed_q16"] {
            for exponent in 0..7 {
                let mut run = fixture::run("boxes", 1e4, "list", culling, 20, 2, 5);
                let offset = 10f64.powi(exponent);
                run.spec.scene.name = format!("boxes_{exponent}");
                run.spec.scene.source =
                    SceneSource::Generated(Spec::new("boxes").with("offset_m", Value::Float(offset)));
                if arithmetic != "f32_relative" {
                    run.spec.axes.insert("arithmetic".into(), Spec::new(arithmetic));
                }
                run.measurement_id = format!("{culling}/{arithmetic}/{exponent}");
                let lost = if arithmetic == "f32_world" && exponent >= 3 { 10u64.pow(exponent as u32 - 3) } else { 0 };
                run.errors.iter_mut().for_each(|e| e.false_cull_pixels = lost);
                if arithmetic == "fixed_q16" && exponent >= 5 {
                    fail(&mut run, RunStatus::Failed, "coordinate out of range of Q15.16");
                }
                results.runs.push(run);
            }
        }
    }
    results.sweeps = vec![sweep()];
    results
}

fn fail(run: &mut RunResult, status: RunStatus, why: &str) {
    (run.status, run.reason) = (status, Some(why.into()));
    run.trials.clear();
    run.errors.clear();
}

#[test]
fn scenes_that_differ_in_the_stressor_alone_share_a_line() {
    let results = stressed(&["frustum"]);
    let c = chart(&results, &results.sweeps[0]).unwrap();
    assert_eq!(c.panels.len(), 1);
    assert_eq!(c.panels[0].title, "");
    let lines = &c.panels[0].lines;
    assert_eq!(lines.iter().map(|l| l.by.as_str()).collect::<Vec<_>>(), ["f32_world", "f32_relative", "fixed_q16"]);
    for line in lines {
        assert_eq!(line.points.len(), 7);
        assert!(line.points.windows(2).all(|w| w[0].x < w[1].x));
    }
    // Measured over the four points above zero.
    let slope = lines[0].slope().unwrap();
    assert!((slope.slope - 1.0).abs() < 1e-9 && slope.points == 4 && (slope.r2 - 1.0).abs() < 1e-9, "{slope:?}");
    assert_eq!((lines[0].zeros(), lines[1].zeros()), (3, 7));
    assert_eq!(lines[1].slope(), None, "a line at zero has no growth");
}

#[test]
fn further_axes_make_panels_and_equal_places_a_median() {
    let mut results = stressed(&["frustum", "frustum+normal_mask"]);
    let mut again = results.runs[4].clone();
    again.spec.series = 1;
    again.errors.iter_mut().for_each(|e| e.false_cull_pixels *= 3);
    results.runs.push(again);
    let c = chart(&results, &results.sweeps[0]).unwrap();
    assert_eq!(c.panels.iter().map(|p| p.title.as_str()).collect::<Vec<_>>(), ["frustum", "frustum+normal_mask"]);
    let p = &c.panels[0].lines[0].points[4];
    let (middle, low, high) = p.value.unwrap();
    assert_eq!(p.runs.len(), 2);
    assert!((high / low - 3.0).abs() < 1e-9 && (middle / low - 2.0).abs() < 1e-9, "{:?}", p.value);
}

#[test]
fn cameras_without_the_stressor_make_panels() {
    let mut results = stressed(&["frustum"]);
    let scene = results.runs[0].spec.scene.clone();
    for (i, run) in results.runs.iter_mut().enumerate() {
        run.spec.camera.projection = Projection::Perspective { fov_y_rad: 0.1 * (1 + i % 7) as f64 };
        run.spec.camera.aspect = if i % 2 == 0 { 4.0 / 3.0 } else { 16.0 / 9.0 };
        run.spec.scene = scene.clone();
    }
    results.sweeps[0].x = "camera.fov_y_deg".into();
    let c = chart(&results, &results.sweeps[0]).unwrap();
    assert_eq!(
        c.panels.iter().map(|p| p.title.as_str()).collect::<Vec<_>>(),
        ["perspective:aspect=1.33333", "perspective"]
    );
}

#[test]
fn failed_and_wrong_runs_are_marks_at_their_x_and_rows_of_the_table() {
    let mut results = stressed(&["frustum"]);
    fail(&mut results.runs[6], RunStatus::Wrong, "frame 3: 2 false culls");
    let c = chart(&results, &results.sweeps[0]).unwrap();
    let figure = sweep_chart::draw(&c);
    assert_eq!(figure.tags.len(), 21, "a mark a run, whatever came of it");
    let of = |id: &str| figure.tags.iter().find(|t| t.data[0].1 == id).unwrap();
    let plot = figure.boxes.iter().find(|(p, _)| *p == report::figure::Part::Plot).unwrap().1;
    for (id, words) in [("frustum/f32_world/6", "wrong (frame 3"), ("frustum/fixed_q16/5", "failed (coordinate out")] {
        let tag = of(id);
        assert!(tag.title.contains(words), "{}", tag.title);
        assert!(!tag.marks.is_empty(), "{id} left a gap");
        for mark in &figure.marks[tag.marks.clone()] {
            if let report::figure::Mark::Polygon { points, .. } = mark {
                assert!(points.iter().all(|p| p.1 > plot.y && p.1 < plot.y + 20.0), "{id} is not at the upper edge");
            }
        }
    }
    let csv = sweep_tables::points(&c).csv();
    assert_eq!(csv.lines().count(), 22);
    assert!(csv.lines().any(|l| l.contains("coordinate out of range") && l.contains(",100000,,,,1,0,1,0,")), "{csv}");
    let growth = sweep_tables::slopes(&c).csv();
    let row = growth.lines().find(|l| l.contains(",f32_world,")).unwrap();
    let slope: f64 = row.split(',').nth(2).unwrap().parse().unwrap();
    assert!((slope - 1.0).abs() < 1e-9 && row.split(',').nth(3) == Some("1"), "{row}");
}

#[test]
fn the_expected_law_is_drawn_and_its_reason_stands_in_the_caption() {
    let mut results = stressed(&["frustum"]);
    results.sweeps[0].expected_slope = None;
    let plain = sweep_chart::draw(&chart(&results, &results.sweeps[0]).unwrap());
    results.sweeps[0].expected_slope = Some(1.0);
    let c = chart(&results, &results.sweeps[0]).unwrap();
    let figure = sweep_chart::draw(&c);
    assert!(figure.marks.len() > plain.marks.len() + 5, "dashes");
    assert!(
        figure.caption.contains("five ulps of the offset. Measured growth of f32_world: x^1"),
        "{}",
        figure.caption
    );
    render::svg(&figure, true).unwrap();
}

#[test]
fn what_cannot_be_drawn_is_said_on_the_page() {
    let mut results = stressed(&["frustum"]);
    let mut other = sweep();
    (other.id, other.y) = ("typo".into(), "false_cull_pmm".into());
    let mut nothing = sweep();
    (nothing.id, nothing.x) = ("none".into(), "scene.ofset_m".into());
    results.sweeps.extend([other, nothing]);
    let dir = tempfile::tempdir().unwrap();
    // One chart alone: PNGs of a debug build are slow.
    results.sweeps.remove(0);
    results.runs.truncate(2);
    let files = report::write(&results, &[], dir.path()).unwrap();
    let page = std::fs::read_to_string(files.page).unwrap();
    assert!(page.contains("did you mean `false_cull_ppm`"), "a typo of a metric");
    assert!(page.contains("no run has the number `scene.ofset_m`"), "a typo of an axis");
}

#[test]
fn numbers_are_found_on_every_axis() {
    let run = fixture::run("nucleus", 1e4, "octree:depth=4", "frustum", 5, 1, 1);
    assert_eq!(run.spec.number("structure.depth"), Some(4.0));
    let fov = run.spec.number("camera.fov_y_deg").unwrap();
    assert!((fov - 60.0).abs() < 1e-9);
    assert_eq!(run.spec.number("camera.near_m"), Some(0.1));
    for name in ["camera.far_m", "scene.name", "path.angle_rad", "culling.cells", "depth", "nothing.at_all"] {
        assert_eq!(run.spec.number(name), None, "{name}");
    }
}

#[test]
fn sweeps_of_only_zeros_or_without_values_do_not_panic() {
    for spoil in [
        |r: &mut RunResult| r.errors.iter_mut().for_each(|e| e.false_cull_pixels = 0),
        |r: &mut RunResult| r.errors.clear(),
    ] {
        let mut results = stressed(&["frustum"]);
        results.runs.iter_mut().for_each(spoil);
        results.runs[0].spec.scene.source =
            SceneSource::Generated(Spec::new("boxes").with("offset_m", Value::Float(0.0)));
        for y_log in [true, false] {
            results.sweeps[0].y_log = y_log;
            let c = chart(&results, &results.sweeps[0]).unwrap();
            render::svg(&sweep_chart::draw(&c), true).unwrap();
        }
    }
}
