//! Frames per second, correlations over frames, their tables and their chart.

use super::{fixture, xml};
use cullmark::report::correlation;
use cullmark::report::labels::Grid;
use cullmark::report::metrics::known;
use cullmark::report::rates;
use cullmark::report::render;
use cullmark::report::table::{Cell, Table};
use cullmark::results::{RunResult, RunStatus};

/// Four frames whose modelled times are 1, 2, 4 and 5 ms in the first trial, twice that in the second.
fn by_hand() -> RunResult {
    let mut run = fixture::run("nucleus", 2e4, "octree:depth=4", "frustum", 4, 2, 1);
    run.spec.model.index_ns = 1.0;
    run.spec.model.draw_call_ns = 10.0;
    run.triangles = vec![100.0, 200.0, 300.0, 500.0];
    run.draw_calls = vec![0.0, 1.0, 2.0, 3.0];
    run.nodes_visited = vec![10.0, 30.0, 20.0, 50.0];
    let drawn: Vec<f64> = run.triangles.iter().zip(&run.draw_calls).map(|(t, d)| 3.0 * t + 10.0 * d).collect();
    let trial = |factor: f64| -> Vec<f64> {
        [1e6, 2e6, 4e6, 5e6].iter().zip(&drawn).map(|(frame, draw)| factor * frame - draw).collect()
    };
    run.trial_cull_ns = vec![trial(1.0), trial(2.0)];
    for (summary, trial) in run.trials.iter_mut().zip(&run.trial_cull_ns) {
        summary.total_cull_ns = trial.iter().sum();
    }
    run
}

#[test]
fn rates_are_those_of_the_modelled_frame_and_the_mean_is_frames_over_time() {
    let run = by_hand();
    let all = |name: &str| known(name).values(&run);
    assert_eq!(all("fps_best_model"), [1000.0, 500.0]);
    assert_eq!(all("fps_worst_model"), [200.0, 100.0]);
    // 4 frames in 12 ms; the mean of the four rates would be 487.5.
    assert!((all("fps_mean_model")[0] - 4.0 / 0.012).abs() < 1e-9, "{:?}", all("fps_mean_model"));
    assert_eq!(all("fps_spread_model"), [5.0, 5.0]);
    let (mean, ms) = (known("fps_mean_model"), known("frame_ms_model"));
    for (fps, ms) in mean.values(&run).iter().zip(ms.values(&run)) {
        assert!((fps - 1000.0 / ms).abs() < 1e-9);
    }
    // A frame in which the clock saw nothing and nothing was drawn has no rate, and is not infinitely fast.
    let mut idle = by_hand();
    idle.trial_cull_ns[0][0] = 0.0;
    idle.triangles[0] = 0.0;
    assert_eq!(known("fps_best_model").values(&idle).len(), 1);
    assert_eq!(known("fps_spread_model").values(&idle).len(), 1);
    assert_eq!(known("fps_worst_model").values(&idle).len(), 2);
}

#[test]
fn correlations_are_over_the_frames_of_every_trial() {
    let mut run = by_hand();
    run.trial_cull_ns = vec![vec![10.0, 20.0, 30.0, 50.0], vec![50.0, 30.0, 20.0, 10.0]];
    let one = |run: &RunResult, name: &str, trial: usize| known(name).values(run)[trial];
    assert!((one(&run, "pearson_triangles_cull", 0) - 1.0).abs() < 1e-12);
    // Triangles -175 -75 25 225, times 22.5 2.5 -7.5 -17.5: -8250 over sqrt(87500 x 875).
    assert!((one(&run, "pearson_triangles_cull", 1) + 8250.0 / 76_562_500f64.sqrt()).abs() < 1e-12);
    assert!((one(&run, "spearman_triangles_cull", 1) + 1.0).abs() < 1e-12);
    let model = known("pearson_triangles_frame_model").values(&run);
    assert!(model.len() == 2 && model.iter().all(|r| *r > 0.99), "indices outweigh culling here: {model:?}");
    let partial = known("partial_triangles_cull").values(&run);
    let r = |x: &[f64], y: &[f64]| cullmark::stats::pearson(x, y).unwrap();
    for (trial, found) in run.trial_cull_ns.iter().zip(&partial) {
        let xy = r(&run.triangles, trial);
        let (xz, yz) = (r(&run.triangles, &run.nodes_visited), r(trial, &run.nodes_visited));
        let textbook = (xy - xz * yz) / ((1.0 - xz * xz) * (1.0 - yz * yz)).sqrt();
        assert!((found - textbook).abs() < 1e-9, "{found} is not {textbook}");
    }

    // What does not vary does not correlate: there is no value, and no NaN.
    run.triangles = vec![300.0; 4];
    for name in ["pearson_triangles_cull", "spearman_triangles_cull", "partial_triangles_cull"] {
        assert_eq!((known(name).values(&run), known(name).interval(&run)), (vec![], None), "{name}");
    }
    run.status = RunStatus::Wrong;
    assert_eq!(known("fps_mean_model").value(&run), None, "rates of a wrong run are withheld");
}

fn texts(table: &Table, row: &[Cell]) -> Vec<String> {
    assert_eq!(table.columns.len(), row.len());
    row.iter().map(Cell::show).collect()
}

#[test]
fn without_a_price_of_the_frame_times_are_shown_and_no_rates() {
    let mut results = fixture::study();
    assert!(results.runs.iter().all(|r| r.spec.model.frame_ns == 0.0));
    let times = rates::all(&Grid::of(&results));
    let head = times.csv().lines().next().unwrap().to_string();
    assert!(head.contains("\"best, modelled (ms)\",\"worst, modelled (ms)\"") && !head.contains("fps"), "{head}");
    assert!(!rates::words(&Grid::of(&results)).contains("Frames per second"));
    let run = &results.runs[1];
    let row = times.rows.iter().find(|r| r[0].show() == "nucleus" && r[1].show() == "list × frustum").unwrap();
    let value = |name: &str| known(name).value(run).unwrap();
    assert_eq!(row[3], Cell::Number(1e3 / value("fps_best_model")));
    assert_eq!(row[4], Cell::Number(1e3 / value("fps_worst_model")));
    let (mean, low, high) = known("frame_ms_model").interval(run).unwrap();
    assert_eq!(row[5], Cell::Interval(mean, low, high));
    let best = rates::best_table(&Grid::of(&results));
    assert!(best.title.starts_with("Frame times") && best.csv().contains("(ms)") && !best.csv().contains("fps"));
    // One run whose model has none is enough: rates and times do not share a column.
    results.runs.iter_mut().skip(1).for_each(|r| r.spec.model.frame_ns = 1e6);
    assert!(!rates::has_rates(&Grid::of(&results)));
}

#[test]
fn every_run_has_its_row_and_the_fastest_of_a_scene_comes_first() {
    let mut results = fixture::study();
    results.runs.iter_mut().for_each(|r| r.spec.model.frame_ns = 1e6);
    let grid = Grid::of(&results);
    let table = rates::all(&grid);
    assert_eq!(table.rows.len(), results.runs.len());
    let csv = table.csv();
    assert!(csv.starts_with("scene,combination,status,\"best, modelled (fps)\""), "{csv}");
    assert!(csv.contains("\"mean, modelled low (fps)\",\"mean, modelled high (fps)\""));
    for place in &grid.places {
        let rows: Vec<&Vec<Cell>> = table.rows.iter().filter(|r| r[0] == Cell::Text(place.clone())).collect();
        let means: Vec<Option<f64>> =
            rows.iter().map(|r| if let Cell::Interval(v, ..) = r[5] { Some(v) } else { None }).collect();
        assert!(means.is_sorted_by(|a, b| a.unwrap_or(-1.0) >= b.unwrap_or(-1.0)), "{means:?}");
        assert!(rows.iter().zip(&means).all(|(r, m)| (r[2] == Cell::Status(RunStatus::Done)) == m.is_some()));
    }
    // Whoever culls nothing submits the same triangles all the time.
    let idle = table.rows.iter().find(|r| r[1].show() == "octree:depth=4 × none").unwrap();
    assert_eq!(texts(&table, idle)[6..10], ["–", "–", "–", "–"]);

    let best = rates::best_table(&grid);
    for (row, place) in best.rows.iter().filter(|r| !r[4].show().starts_with('†')).zip(&grid.places) {
        assert_eq!(row[0], Cell::Text(place.clone()));
        let of_place = |r: &&Vec<Cell>| r[0] == row[0] && !r[10].show().starts_with('†');
        let first = table.rows.iter().find(of_place).unwrap();
        assert_eq!(
            (first[1].show(), first[4].show()),
            (row[2].show(), row[5].show()),
            "the first sound row of {place}"
        );
        assert_eq!(row[3].show(), "depth_first");
    }
    for text in [best.markdown(), best.latex(), best.html(), table.html()] {
        assert!(!text.contains("NaN") && !text.contains("n/a"), "{text}");
    }
}

#[test]
fn the_chart_shows_the_frames_of_the_best_of_every_scene_with_its_r() {
    let results = fixture::study();
    let grid = Grid::of(&results);
    let figure = correlation::draw(&grid).unwrap();
    let texts = xml::texts(&render::svg(&figure, true).unwrap()).unwrap();
    // Sound, and culling something: else the triangles never vary.
    let table = rates::all(&grid);
    for place in &grid.places {
        let fits =
            |r: &&Vec<Cell>| r[0].show() == *place && !r[10].show().starts_with('†') && !r[1].show().ends_with("none");
        let row = table.rows.iter().find(fits).unwrap();
        let words = format!("r = {}, rank r = {}", row[6].show(), row[7].show());
        assert!(texts.contains(place) && texts.contains(&row[1].show()) && texts.contains(&words), "{words}");
        assert!(figure.caption.contains(&words), "{}", figure.caption);
    }
    assert!(
        correlation::draw(&Grid::of(&{
            let mut none = fixture::study();
            none.runs.iter_mut().for_each(|r| r.status = RunStatus::Pending);
            none
        }))
        .is_none()
    );
}
