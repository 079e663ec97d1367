//! Databases of every version that was ever released are brought up to date, and nothing
//! in them is lost.

use super::fixture::*;
use cullmark::results::RunStatus;
use cullmark::store::{Kind, Pool, Store};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};
use std::path::{Path, PathBuf};

/// Migrations as they were after the first, the second and the third.
const RELEASED: [&[&str]; 3] = [
    &["0001_first.sql"],
    &["0001_first.sql", "0002_sweeps.sql"],
    &["0001_first.sql", "0002_sweeps.sql", "0003_service.sql"],
];

fn migrations() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("migrations")
}

async fn raw(path: &Path) -> SqlitePool {
    let options = SqliteConnectOptions::new().filename(path).create_if_missing(true);
    // One connection: what it attaches, all statements see.
    sqlx::sqlite::SqlitePoolOptions::new().max_connections(1).connect_with(options).await.unwrap()
}

async fn run(pool: &SqlitePool, sql: String) {
    sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(pool).await.unwrap();
}

async fn words(pool: &SqlitePool, sql: String) -> Vec<String> {
    sqlx::query_scalar(sqlx::AssertSqlSafe(sql)).fetch_all(pool).await.unwrap()
}

/// Tables of a study, sorted.
async fn tables(pool: &SqlitePool) -> Vec<String> {
    let sql = "SELECT name FROM main.sqlite_master WHERE type = 'table' AND name NOT LIKE '\\_sqlx%' ESCAPE '\\' \
               AND name NOT LIKE 'sqlite%' ORDER BY name";
    words(pool, sql.into()).await
}

/// A study with a finished run, a failed one, and one that is half done; every table has rows.
async fn fill(path: &Path) -> String {
    let store = Store::open(path).await.unwrap();
    let s = study("a", (1..=3).map(|d| spec("one", d)).collect(), 2);
    let id = store.submit(&s).await.unwrap().study_id;
    let depth = |l: &cullmark::store::Lease| l.spec.structure.int("depth");
    let mut left = Vec::new();
    while let Some(l) = store.lease(id, Kind::Trial).await.unwrap() {
        match depth(&l) {
            1 => drop(store.accept_trial(&l, &record(100.0, "h"), 7).await.unwrap()),
            2 => drop(store.fail(&l, &cullmark::store::Outcome::Refused("no".into())).await.unwrap()),
            _ if l.job.repeat == 0 => drop(store.accept_trial(&l, &record(300.0, "h"), 9).await.unwrap()),
            _ => left.push(l),
        }
    }
    for l in left {
        store.give_back(&l).await.unwrap();
    }
    let mut left = Vec::new();
    while let Some(l) = store.lease(id, Kind::Judge).await.unwrap() {
        match depth(&l) {
            3 => left.push(l),
            _ => drop(store.accept_judgement(&l, &judgement(None, "h"), 8).await.unwrap()),
        }
    }
    for l in left {
        store.give_back(&l).await.unwrap();
    }
    for run in store.loose_ends(id).await.unwrap() {
        store.settle(id, &run, &s.policy).await.unwrap();
    }
    let page = path.parent().unwrap().join("index.html");
    std::fs::write(&page, "x").unwrap();
    store.record_artifacts(id, &[page], "k").await.unwrap();
    let results = format!("{:?}", store.results("a").await.unwrap().runs);
    store.close().await;
    results
}

/// The same data as a program of `released` migrations left them.
async fn as_of(released: &[&str], from: &Path, to: &Path) {
    let folder = tempfile::tempdir().unwrap();
    for file in released {
        std::fs::copy(migrations().join(file), folder.path().join(file)).unwrap();
    }
    let pool = raw(to).await;
    sqlx::migrate::Migrator::new(folder.path()).await.unwrap().run(&pool).await.unwrap();
    run(&pool, format!("PRAGMA application_id = 1129663565; ATTACH '{}' AS new", from.display())).await;
    for table in tables(&pool).await {
        let columns = words(&pool, format!("SELECT name FROM pragma_table_info('{table}')")).await.join(", ");
        run(&pool, format!("INSERT OR REPLACE INTO main.{table} ({columns}) SELECT {columns} FROM new.{table}")).await;
        let count = words(&pool, format!("SELECT '' || count(*) FROM main.{table}")).await;
        // What the third version added is of servers, or made anew when it is asked for.
        assert!(count != ["0"] || released.len() > 2, "{table} has rows");
    }
    pool.close().await;
}

/// Every row of the columns that the first version knew, as text.
async fn content(path: &Path, columns: &[(String, Vec<String>)]) -> Vec<Vec<String>> {
    let pool = raw(path).await;
    let mut out = Vec::new();
    for (table, columns) in columns {
        let list: Vec<String> = columns.iter().map(|c| format!("quote({c})")).collect();
        out.push(words(&pool, format!("SELECT {} FROM {table} ORDER BY 1", list.join(" || ','  || "))).await);
    }
    pool.close().await;
    out
}

async fn shape(path: &Path) -> Vec<(String, Vec<String>)> {
    let pool = raw(path).await;
    let mut out = Vec::new();
    for table in tables(&pool).await {
        out.push((table.clone(), words(&pool, format!("SELECT name FROM pragma_table_info('{table}')")).await));
    }
    pool.close().await;
    out
}

#[test]
fn a_database_of_every_released_version_keeps_all_it_has_and_goes_on() {
    for released in RELEASED {
        let dir = tempfile::tempdir().unwrap();
        let (new, old) = (dir.path().join("new.db"), dir.path().join("old.db"));
        wait(async {
            let results = fill(&new).await;
            as_of(released, &new, &old).await;
            let shape = shape(&old).await;
            let before = content(&old, &shape).await;

            let store = Store::open_existing(&old).await.unwrap();
            assert_eq!(format!("{:?}", store.results("a").await.unwrap().runs), results, "{released:?}");
            let overview = store.overview("a").await.unwrap();
            let (r, j) = (overview.runs, overview.jobs);
            assert_eq!(
                (r.done, r.failed, r.pending, j.trials, j.judgements),
                (1, 1, 1, 1, 1),
                "jobs found their study"
            );
            assert_eq!((overview.priority, overview.state.word(), overview.finished), (0, "active", false));
            assert!(!store.has_tokens().await.unwrap() && store.uploads().await.unwrap().is_empty());
            assert!(!store.pool_paused().await.unwrap());
            let lines = store.run_lines(overview.id, 0, Some((0, 9))).await.unwrap();
            assert_eq!(lines.len(), 3, "readers that ask for what changed see all of it once");
            store.close().await;
            assert_eq!(content(&old, &shape).await, before, "{released:?}: nothing was lost or changed");

            // Of an older program nobody knows the build: any of this machine may go on.
            let store = Store::open_existing(&old).await.unwrap();
            let known = released.len() > 2;
            let build_profile = if known { "release" } else { "whatever" }.to_string();
            let pool = Pool { machine_class: "test".into(), build_profile };
            let judge = store.lease_any(&pool, Kind::Judge).await.unwrap().expect("a judgement waits");
            store.accept_judgement(&judge, &judgement(None, "h"), 1).await.unwrap();
            let trial = store.lease_any(&pool, Kind::Trial).await.unwrap().expect("a trial waits");
            assert_eq!((trial.study_id, trial.job.repeat), (overview.id, 1));
            store.accept_trial(&trial, &record(310.0, "h"), 1).await.unwrap();
            store.settle(trial.study_id, &trial.job.target, &trial.policy).await.unwrap();
            assert!(store.lease_any(&pool, Kind::Trial).await.unwrap().is_none());
            let status: Vec<RunStatus> = store.results("a").await.unwrap().runs.iter().map(|r| r.status).collect();
            assert_eq!(status, [RunStatus::Done, RunStatus::Failed, RunStatus::Done]);
            let changed = store.run_lines(overview.id, lines[0].changed, None).await.unwrap();
            // The third version knew when each of them changed; of the others all is one.
            assert!(changed.len() == 1 || known && changed.len() < 3, "and then only what is new");
            store.retry("a").await.unwrap();
            assert_eq!(store.overview("a").await.unwrap().jobs.trials, 2, "what failed waits again");
            store.close().await;
        });
    }
}

#[test]
fn what_was_released_is_never_edited() {
    // A changed text has another checksum, and databases made with the old one are refused.
    let mut files: Vec<String> =
        std::fs::read_dir(migrations()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    assert_eq!(files[..2], ["0001_first.sql", "0002_sweeps.sql"]);
    for (file, hash) in [("0001_first.sql", "735c126e66d79a96"), ("0002_sweeps.sql", "d41913a043234504")] {
        let text = std::fs::read(migrations().join(file)).unwrap();
        assert_eq!(blake3::hash(&text).to_hex()[..16], *hash, "{file}");
    }
}
