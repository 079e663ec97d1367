//! Run time against error: fronts, what is withheld, points that name their runs.

use super::fixture;
use cullmark::culling::Class;
use cullmark::record::FrameErrors;
use cullmark::report::frontier::{Standing, fronts, over_submission};
use cullmark::report::frontier_table::{X, Y, only, report, table, text};
use cullmark::report::labels::Grid;
use cullmark::report::metrics::known;
use cullmark::report::{charts, render};
use cullmark::results::{RunStatus, StudyResults};

fn all(results: &StudyResults) -> String {
    let grid = Grid::of(results);
    let axes = (known(X), known(Y));
    text(&grid, &fronts(&grid, axes.0, axes.1, &|_| true), axes, true)
}

#[test]
fn the_text_names_front_and_dominated_and_what_is_no_point() {
    let out = all(&fixture::study());
    let lines: Vec<&str> = out.lines().collect();
    // Golden structure: a head a scene, column names, rule, points, what is none.
    let heads: Vec<&&str> = lines.iter().filter(|l| l.contains(" against ")).collect();
    assert_eq!(heads.len(), 3, "{out}");
    assert!(heads[0].starts_with("nucleus: median_frame_us (µs) against false_cull_ppm (px/M); of 7 points "), "{out}");
    let columns: Vec<&str> = lines[1].split("  ").map(str::trim).filter(|c| !c.is_empty()).collect();
    assert_eq!(
        columns,
        [
            "combination",
            "median_frame_us (µs)",
            "false_cull_ppm (px/M)",
            "class",
            "observed",
            "standing",
            "dominated_by",
            "measurement_id"
        ]
    );
    let listed = |from: &str| lines.iter().filter(|l| l.starts_with(from)).count();
    assert_eq!(listed("list × frustum "), 3);
    assert_eq!(listed("no point: list × none, octree:depth=4 × none, bsp:min_leaf=200 × none: does no culling"), 3);
    assert!(out.contains("bsp:min_leaf=200 × normal_mask: wrong for its class, a bug and no point: withheld"), "{out}");
    assert!(out.contains("octree:depth=4 × normal_mask: failed: timed out after 30 s in trial 2"), "{out}");
    assert!(out.contains("pending"), "{out}");
    // Whoever is dominated says by whom, and it is a combination of the study.
    let dominated: Vec<&&str> = lines.iter().filter(|l| l.contains("  dominated  ")).collect();
    assert!(!dominated.is_empty() && dominated.iter().all(|l| l.matches(" × ").count() == 2), "{dominated:?}");
}

#[test]
fn without_all_only_the_front_and_its_noise_are_listed() {
    let results = fixture::study();
    let grid = Grid::of(&results);
    let axes = (known(X), known(Y));
    let found = fronts(&grid, axes.0, axes.1, &|_| true);
    let short = table(&grid, &found, axes, false);
    let long = table(&grid, &found, axes, true);
    let near = found.iter().flat_map(|f| &f.points).filter(|p| p.standing != Standing::Dominated).count();
    assert_eq!(short.rows.len(), near);
    assert_eq!(long.rows.len(), found.iter().map(|f| f.points.len()).sum::<usize>());
    assert!(near < long.rows.len());
    for front in &found {
        assert!(front.on_front().next().is_some());
        for p in &front.points {
            assert!(p.x.1 <= p.x.0 && p.x.0 <= p.x.2);
            assert_eq!(p.by.is_none(), p.standing.on_front());
        }
    }
}

#[test]
fn a_conservative_run_above_zero_is_a_bug_and_no_point() {
    let mut results = fixture::study();
    let run = results.runs.iter_mut().find(|r| r.structure == "list" && r.culling == "frustum").unwrap();
    assert_eq!((run.class, run.status), (Some(Class::Conservative), RunStatus::Done));
    run.errors[3].false_cull_pixels = 5;
    let id = run.measurement_id.clone();
    let out = all(&results);
    assert!(out.contains("no point: list × frustum: declared conservative, yet it lost 5 pixels: a bug"), "{out}");
    // Neither on the chart nor by any other metric.
    let grid = Grid::of(&results);
    for figure in charts::all(&grid, &[]).iter().filter(|f| f.id.starts_with("time-against")) {
        assert!(!figure.tags.is_empty() && figure.tags.iter().all(|t| t.data[0].1 != id), "{}", figure.id);
    }
}

#[test]
fn every_point_of_the_chart_leads_to_its_row_of_the_table() {
    let results = fixture::study();
    let grid = Grid::of(&results);
    let csv = report(&grid).csv();
    assert_eq!(csv.lines().count(), 1 + results.runs.len(), "every run has its row");
    let figures = charts::all(&grid, &[]);
    let figure = figures.iter().find(|f| f.id == "time-against-error").unwrap();
    let svg = render::svg(figure, true).unwrap();
    let ids: Vec<&str> =
        svg.split("data-measurement-id=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    // 35 runs less 3 withheld and 8 that cull nothing (the ninth failed cells are not of them).
    assert_eq!(ids.len(), 35 - 3 - 9);
    for id in ids {
        assert!(csv.lines().any(|l| l.ends_with(&format!(",{id}"))), "{id} has no row");
    }
    assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
    assert!(svg.contains("<title>list × frustum: "), "a pointer on a point names its run");
    assert!(
        csv.contains(",\"no point: wrong for its class") || csv.contains(",no point: wrong for its class"),
        "{csv}"
    );
}

#[test]
fn zeros_stand_in_a_bin_of_their_own_below_the_break() {
    let results = fixture::study();
    let grid = Grid::of(&results);
    let figures = charts::all(&grid, &[]);
    let figure = figures.iter().find(|f| f.id == "time-against-error").unwrap();
    let plot = figure.boxes.iter().find(|(p, _)| *p == cullmark::report::figure::Part::Plot).unwrap().1;
    let height = |label: &str| {
        let tag = figure.tags.iter().find(|t| t.data[0].1 == format!("nucleus/{label}")).unwrap();
        figure.marks[tag.marks.clone()].iter().find_map(|m| match m {
            cullmark::report::figure::Mark::Polygon { points, .. } => Some(points[0].1),
            cullmark::report::figure::Mark::Circle { y, .. } => Some(*y),
            _ => None,
        })
    };
    let (zero, lossy) = (height("list/frustum").unwrap(), height("list/frustum+octant_mask").unwrap());
    assert!(lossy < zero && zero < plot.bottom(), "{lossy} is above {zero}");
}

#[test]
fn over_submission_is_bracketed_where_hiding_was() {
    let mut results = fixture::study();
    for run in &mut results.runs {
        for e in &mut run.errors {
            e.visible_hi = 2 * e.visible;
        }
        // A frame that shows nothing has no upper bound, and counts in neither.
        let nothing = FrameErrors { frame: 99, submitted: 1000, visible_hi: 5, ..Default::default() };
        run.errors.push(nothing);
        run.spec.accuracy.hiding_cells = 64;
    }
    let grid = Grid::of(&results);
    let axes = (known(X), known("over_submission"));
    let t = table(&grid, &fronts(&grid, axes.0, axes.1, &|_| true), axes, true);
    let at = |name: &str| t.columns.iter().position(|c| c.name == name).unwrap();
    let number = |cell: &cullmark::report::table::Cell| match cell {
        cullmark::report::table::Cell::Number(x) => *x,
        other => panic!("{other:?}"),
    };
    for row in &t.rows {
        let (most, least) = (number(&row[at("over_submission")]), number(&row[at("over_submission at least")]));
        assert!((most / least - 2.0).abs() < 1e-9, "{most} and {least}");
    }
    for run in &mut results.runs {
        run.spec.accuracy.hiding_cells = 0;
    }
    let bounds: Vec<_> = results.runs.iter().filter_map(over_submission).collect();
    assert!(bounds.len() > 10 && bounds.iter().all(|b| b.0.is_none()), "nothing was proved hidden");
}

#[test]
fn an_unknown_scene_gets_a_suggestion() {
    let results = fixture::study();
    let grid = Grid::of(&results);
    let found = || fronts(&grid, known(X), known(Y), &|_| true);
    let e = only(found(), "nuclues").err().unwrap();
    assert!(e.to_string().contains("did you mean `nucleus`"), "{e}");
    let e = only(found(), "somewhere else").err().unwrap();
    assert!(e.to_string().contains("scenes: nucleus, coal_town, ravine"), "{e}");
    assert_eq!(only(found(), "ravine").unwrap().len(), 1);
}

#[test]
fn studies_without_points_have_fronts_without_points() {
    let mut empty = fixture::study();
    empty.runs.clear();
    assert_eq!(all(&empty), "");
    let mut unjudged = fixture::study();
    unjudged.runs.iter_mut().for_each(|r| r.errors.clear());
    assert!(all(&unjudged).contains("not judged"));
    let mut withheld = fixture::study();
    withheld.runs.iter_mut().for_each(|r| r.status = RunStatus::Wrong);
    assert!(all(&withheld).contains("nucleus: median_frame_us (µs) against false_cull_ppm (px/M); of 0 points"));
    for results in [empty, unjudged, withheld] {
        let grid = Grid::of(&results);
        for figure in charts::all(&grid, &[]) {
            render::svg(&figure, false).unwrap();
        }
    }
}
