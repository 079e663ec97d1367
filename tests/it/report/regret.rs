//! What following an adviser costs, as a table.

use super::fixture;
use cullmark::report::labels::Grid;
use cullmark::report::metrics::known;
use cullmark::report::regret::table;
use cullmark::report::table::Cell;
use cullmark::results::{Advised, RunStatus, StudyResults};

const METRIC: &str = "total_frame_ms_model";

/// Of each scene the run that is `rank`-th by the metric was advised.
fn advised(results: &mut StudyResults, rank: usize) -> Vec<f64> {
    let mut ratios = Vec::new();
    for scene in ["nucleus", "coal_town", "ravine"] {
        let mut runs: Vec<(f64, String)> = results
            .runs
            .iter()
            .filter(|r| r.scene() == scene && r.status == RunStatus::Done)
            .filter_map(|r| Some((known(METRIC).value(r)?, r.measurement_id.clone())))
            .collect();
        assert!(runs.len() > 6, "{scene}");
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        ratios.push(runs[rank].0 / runs[0].0);
        results.advice.push(Advised {
            scene: scene.into(),
            path: "walk".into(),
            metric: METRIC.into(),
            measurement_id: runs[rank].1.clone(),
            candidates: runs.into_iter().map(|r| r.1).collect(),
            short_list: 3,
            probe_frames: 64,
        });
    }
    ratios
}

#[test]
fn regret_is_how_much_more_the_choice_takes_than_the_best_of_the_matrix() {
    let mut results = fixture::study();
    assert!(table(&Grid::of(&results)).rows.is_empty(), "no advice, no table");
    let ratios = advised(&mut results, 2);
    // One whose run is gone says nothing.
    let gone = Advised { measurement_id: "gone".into(), ..results.advice[0].clone() };
    results.advice.push(gone);
    let found = table(&Grid::of(&results));
    assert_eq!(found.rows.len(), 3 + 3, "three places; the adviser, the best and the worst fixed choice");
    for (row, ratio) in found.rows.iter().zip(&ratios) {
        let Cell::Interval(regret, low, high) = row[4] else { panic!("{row:?}") };
        assert!((regret - 100.0 * (ratio - 1.0)).abs() < 1e-9 && low <= regret && regret <= high, "{row:?}");
        let Cell::Text(within) = &row[7] else { panic!() };
        assert_eq!(within == "yes", *ratio <= 1.1);
    }
    let mean = |row: usize| match found.rows[row][4] {
        Cell::Interval(x, ..) => x,
        _ => panic!("{:?}", found.rows[row]),
    };
    let geometric = ratios.iter().map(|r| r.ln()).sum::<f64>() / 3.0;
    assert!((mean(3) - 100.0 * (geometric.exp() - 1.0)).abs() < 1e-9);
    assert!(mean(4) <= mean(5), "the best fixed choice is no worse than the worst");
}

#[test]
fn the_best_choice_has_no_regret() {
    let mut results = fixture::study();
    advised(&mut results, 0);
    for row in &table(&Grid::of(&results)).rows[..3] {
        assert!(matches!(row[4], Cell::Interval(0.0, 0.0, 0.0)), "{row:?}");
    }
}
