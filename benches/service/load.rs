//! 500 runs of 10 parameters, 10 metrics and 100 points: what MLflow was asked to store.

use super::http::Connection;
use super::server::Server;
use super::show::{note, one};
use cullmark::machine;
use cullmark::record::{Series, TrialRecord};
use cullmark::registry::{Spec, Value};
use cullmark::store::{Cell, Kind, Store, Submission, block_on};
use std::time::Instant;

const RUNS: usize = 500;
const POINTS: u32 = 100;

fn submission() -> Submission {
    let like = super::made::submission(&super::made::trivial("load", 2, 10));
    let cell = |n: usize| {
        let mut cell = like.cells[0].clone();
        let structure =
            (0..10).fold(Spec::new("list"), |s, p| s.with(&format!("p{p}"), Value::Int((n * 10 + p) as i64)));
        Cell {
            structure: structure.to_string(),
            spec: {
                cell.spec.structure = structure;
                cell.spec
            },
            ..cell
        }
    };
    Submission { name: "load".into(), cells: (0..RUNS).map(cell).collect(), ..like }
}

fn record(id: &str, environment: &cullmark::record::Environment) -> TrialRecord {
    let made = super::made::record(id, POINTS, environment);
    let more = (made.series.len()..10).map(|i| Series { name: format!("m{i}"), ..made.series[1].clone() });
    TrialRecord { series: made.series.iter().cloned().chain(more).collect(), ..made }
}

pub fn figure() {
    let dir = tempfile::tempdir().expect("a folder");
    let db = dir.path().join("x.db");
    let environment = machine::environment(None);
    let asked = submission();
    let mut longest = 0.0_f64;
    let start = Instant::now();
    block_on(async {
        let store = Store::open(&db).await.expect("a store");
        let study = store.submit(&asked).await.expect("a store").study_id;
        while let Some(lease) = store.lease(study, Kind::Trial).await.expect("a store") {
            let from = Instant::now();
            store.accept_trial(&lease, &record(&lease.job.target, &environment), 1_000_000).await.expect("a store");
            store.settle(study, &lease.job.target, &lease.policy).await.expect("a store");
            longest = longest.max(super::show::ms(from.elapsed()));
        }
        store.close().await;
    });
    let took = start.elapsed().as_secs_f64();
    let bytes = std::fs::metadata(&db).map_or(0, |m| m.len());
    one("500 runs x (10 parameters, 10 x 100 points)", took, "s", "< 5", "MLflow 45.0 / 93.2");
    note(&format!(
        "submit, lease, accept (durable), settle; longest run {longest:.1} ms; {:.1} MiB on the disk",
        bytes as f64 / 1048576.0
    ));
    let server = Server::start(&db, &[]);
    let mut connection = server.connect();
    let rest = server.rss_mib().0;
    for _ in 0..5 {
        visit(&mut connection);
    }
    let (now, most) = server.rss_mib();
    one("server RSS after that load and 40 requests", now, "MiB", "< 60", "MLflow 555 / 3,122");
    note(&format!("{rest:.0} MiB when started, at most {most:.0}"));
}

/// What somebody looks at.
fn visit(connection: &mut Connection) {
    for path in [
        "/api/v1/studies",
        "/api/v1/studies/load",
        "/api/v1/studies/load/runs?limit=1000",
        "/api/v1/studies/load/runs?where=total_cull_ms%20%3E%202&sort=-total_cull_ms",
        "/api/v1/studies/load/matrix",
        "/api/v1/studies/load/runs/7",
        "/api/v1/studies/load/runs/7/series",
        "/metrics",
    ] {
        let reply = connection.get(path);
        assert_eq!(reply.status, 200, "{path}: {}", String::from_utf8_lossy(&reply.body));
    }
}
