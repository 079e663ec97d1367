//! Eight workers that lease and finish jobs which take no time.

use super::made;
use super::show::{many, ms, note, one};
use cullmark::machine;
use cullmark::record::Environment;
use cullmark::store::{Accepted, Kind, Pool, Store, block_on};
use std::collections::HashSet;
use std::time::Instant;

const WORKERS: usize = 8;
const JOBS: usize = 2000;

/// Of one job: its number, and how long leasing and finishing it took.
type Done = (i64, f64, f64);

pub fn figure() {
    of("8 tasks, one connection", true);
    of("8 connections of their own", false);
}

async fn work(store: &Store, pool: &Pool, environment: &Environment) -> Vec<Done> {
    let mut done = Vec::new();
    loop {
        let start = Instant::now();
        let Some(lease) = store.lease_any(pool, Kind::Trial).await.expect("a lease") else { return done };
        let leased = ms(start.elapsed());
        let start = Instant::now();
        let accepted = store.accept_trial(&lease, &made::record(&lease.job.target, 20, environment), 1_000_000).await;
        assert_eq!(accepted.expect("a store"), Accepted::Yes, "a job was claimed twice");
        done.push((lease.job.id, leased, ms(start.elapsed())));
    }
}

fn of(what: &str, shared: bool) {
    let dir = tempfile::tempdir().expect("a folder");
    let db = dir.path().join("x.db");
    let environment = machine::environment(None);
    let pool =
        Pool { machine_class: environment.machine_class.clone(), build_profile: machine::build_profile().into() };
    let asked = made::submission(&made::trivial("claims", JOBS, 10));
    block_on(async {
        let store = Store::open(&db).await.expect("a store");
        store.submit(&asked).await.expect("a store");
        store.close().await;
    });
    let start = Instant::now();
    let all: Vec<Done> = if shared {
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().expect("a runtime");
        runtime.block_on(async {
            let store = Store::open(&db).await.expect("a store");
            let tasks: Vec<_> = (0..WORKERS)
                .map(|_| {
                    let (store, pool, environment) = (store.clone(), pool.clone(), environment.clone());
                    tokio::spawn(async move { work(&store, &pool, &environment).await })
                })
                .collect();
            let mut all = Vec::new();
            for task in tasks {
                all.extend(task.await.expect("a worker"));
            }
            all
        })
    } else {
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..WORKERS)
                .map(|_| {
                    scope.spawn(|| {
                        block_on(async {
                            let store = Store::open(&db).await.expect("a store");
                            work(&store, &pool, &environment).await
                        })
                    })
                })
                .collect();
            threads.into_iter().flat_map(|t| t.join().expect("a worker")).collect()
        })
    };
    let took = start.elapsed().as_secs_f64();
    let distinct: HashSet<i64> = all.iter().map(|d| d.0).collect();
    assert!(distinct.len() == JOBS && all.len() == JOBS, "{} jobs, {} done", distinct.len(), all.len());
    one(&format!("{what}: jobs done a second"), JOBS as f64 / took, "1/s", "", "");
    many(&format!("{what}: a lease"), &all.iter().map(|d| d.1).collect::<Vec<_>>(), "ms", "", "");
    many(&format!("{what}: a durable result"), &all.iter().map(|d| d.2).collect::<Vec<_>>(), "ms", "", "");
    note(&format!("{JOBS} jobs, each done once, in {took:.1} s"));
}
