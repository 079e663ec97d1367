//! How long the queue takes: a test with few cells, figures with many.

use super::fixture::*;
use cullmark::store::{Detail, Kind};
use std::time::{Duration, Instant};

#[test]
fn finished_cells_are_submitted_again_at_once() {
    figures(100);
}

#[test]
#[ignore = "figures: cargo test --release --test it figures -- --ignored --nocapture"]
fn figures_of_a_thousand_cells() {
    figures(1000);
}

fn figures(n: i64) {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let cells = |n| (0..n).map(|d| spec(["p", "q", "r"][d as usize % 3], d)).collect();
        let (s, large) = (study("a", cells(n), 1), study("large", cells(10 * n), 5));
        let start = Instant::now();
        let id = store.submit(&s).await.unwrap().study_id;
        println!("{n} new cells: {:?}", start.elapsed());
        let (start, mut claims) = (Instant::now(), 0);
        while let Some(l) = store.lease(id, Kind::Judge).await.unwrap() {
            store.accept_judgement(&l, &judgement(None, "h"), 1).await.unwrap();
            claims += 1;
        }
        println!("{claims} judgements leased and accepted: {:?}", start.elapsed());
        finish(&store, id, &s.policy, |_| record(1.0, "h")).await;
        println!("and {n} trials settled: {:?}", start.elapsed());
        let start = Instant::now();
        let again = store.submit(&s).await.unwrap();
        let elapsed = start.elapsed();
        println!("{n} finished cells again: {elapsed:?}");
        assert_eq!((again.done, again.jobs_added), (n as u64, 0));
        // 0.2 s in a release build on an idle machine; far more here is a scan where an index should be.
        assert!(elapsed < Duration::from_secs(5), "{elapsed:?}");
        for detail in [Detail::Summary, Detail::Frames] {
            let start = Instant::now();
            assert_eq!(store.results_with("a", detail).await.unwrap().runs.len() as i64, n);
            println!("{n} results, {detail:?}: {:?}", start.elapsed());
        }
        let start = Instant::now();
        let id = store.submit(&large).await.unwrap().study_id;
        println!("{} cells, {} trials: {:?}", 10 * n, 50 * n, start.elapsed());
        let start = Instant::now();
        for _ in 0..n {
            lease(&store, id, Kind::Trial).await;
        }
        println!("{n} leases: {:?}", start.elapsed());
    });
}
