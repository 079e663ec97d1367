//! For whoever runs a server: health, metrics, backups, the doctor, and an end that
//! loses nothing.

use super::server::{RUNS, Server, cullmark, shared, shown, study, until};
use cullmark::store::{Store, block_on};
use serde_json::{Value, json};
use std::collections::BTreeSet;

#[test]
fn a_server_says_that_it_is_well_and_what_its_machine_is() {
    let health = shared().send("GET", "/healthz", &[], b"").with(200).json();
    assert_eq!(health["status"], "ok");
    let machine = shared().json("/machine");
    assert!(machine["checks"].as_array().unwrap().len() >= 9);
    let out = cullmark(&shared().dir, &["doctor", "--json", "--db", "x.db"]);
    let doctor: Value = serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("{e}: {}", shown(&out)));
    assert_eq!(out.status.code(), Some(i32::from(doctor["fit"] == false)), "the status says what `fit` says");
    let names =
        |v: &Value| -> Vec<Value> { v["checks"].as_array().unwrap().iter().map(|c| c["name"].clone()).collect() };
    assert_eq!(names(&doctor), names(&machine), "the page and the program check the same");
    let trials = doctor["checks"].as_array().unwrap().iter().find(|c| c["name"] == "earlier trials").unwrap();
    assert!(trials["value"].as_str().unwrap().contains('%'), "the database knows trials: {trials}");
    for example in shared().json("/examples")["items"].as_array().unwrap() {
        let body = json!({ "manifest": example["manifest"], "validate_only": true });
        shared().post("/studies", &body).with(200);
        assert!(!example["title"].as_str().unwrap().is_empty());
    }
}

/// The family of a sample: histograms have three kinds of samples each.
fn family(name: &str) -> &str {
    ["_bucket", "_sum", "_count"].iter().find_map(|s| name.strip_suffix(s)).unwrap_or(name)
}

/// `name{label="value",...} number`
fn sample(line: &str) -> Option<(String, Vec<(String, String)>, f64)> {
    let (head, value) = line.rsplit_once(' ')?;
    let word = |w: &str| !w.is_empty() && w.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let (name, rest) = head.split_at(head.find('{').unwrap_or(head.len()));
    let mut labels = Vec::new();
    let mut rest = rest.strip_prefix('{').map_or(Some(""), |r| r.strip_suffix('}'))?;
    while !rest.is_empty() {
        let (label, after) = rest.split_once("=\"")?;
        let (value, after) = after.split_once('"')?;
        labels.push((word(label).then(|| label.to_string())?, value.to_string()));
        rest = after.strip_prefix(',').unwrap_or(after);
    }
    Some((word(name).then(|| name.to_string())?, labels, value.parse().ok()?))
}

#[test]
fn metrics_are_prometheus_text_and_count_the_requests_just_made() {
    let server = Server::start();
    for _ in 0..3 {
        server.get("/studies").with(200);
    }
    server.get("/studies/nowhere").with(404);
    server.get("/nothing/at/all").with(404);
    let body = json!({ "manifest": study("town"), "set": ["measure.repeats=1"] });
    server.post("/studies", &body).with(201);
    server.finished("town");
    let reply = server.send("GET", "/metrics", &[], b"").with(200);
    assert_eq!(reply.header("content-type"), Some("text/plain; version=0.0.4; charset=utf-8"));
    let text = reply.text();
    let (mut helped, mut typed, mut samples) = (BTreeSet::new(), BTreeSet::new(), Vec::new());
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("# HELP ") {
            assert!(helped.insert(rest.split_once(' ').expect("a text").0.to_string()), "twice: {line}");
        } else if let Some(rest) = line.strip_prefix("# TYPE ") {
            let (name, kind) = rest.split_once(' ').unwrap();
            assert!(["counter", "gauge", "histogram"].contains(&kind) && helped.contains(name), "{line}");
            assert!(typed.insert(name.to_string()), "twice: {line}");
        } else {
            let (name, labels, value) = sample(line).unwrap_or_else(|| panic!("no sample: `{line}`"));
            assert!(typed.contains(&name) || typed.contains(family(&name)), "{line} comes before its type");
            samples.push((name, labels, value));
        }
    }
    assert!(text.ends_with('\n'));
    let value = |name: &str, wanted: &[(&str, &str)]| {
        let fits = |labels: &[(String, String)]| {
            wanted.iter().all(|(k, v)| labels.iter().any(|(l, w)| (l, w) == (&k.to_string(), &v.to_string())))
        };
        samples.iter().filter(|(n, l, _)| n == name && fits(l)).map(|s| s.2).sum::<f64>()
    };
    let requests =
        |route: &str, status: &str| value("cullmark_requests_total", &[("route", route), ("status", status)]);
    assert_eq!(requests("GET /api/v1/studies", "200"), 3.0);
    assert_eq!(requests("GET /api/v1/studies/{study}", "404"), 1.0);
    assert_eq!(requests("POST /api/v1/studies", "201"), 1.0);
    let route = [("route", "GET /api/v1/studies")];
    assert_eq!(value("cullmark_request_seconds_count", &route), 3.0);
    assert_eq!(value("cullmark_request_seconds_bucket", &[route[0], ("le", "+Inf")]), 3.0);
    assert_eq!(value("cullmark_jobs_ended_total", &[("kind", "judge"), ("outcome", "accepted")]), RUNS as f64);
    assert!(value("cullmark_jobs_ended_total", &[("kind", "trial")]) >= RUNS as f64);
    assert_eq!((value("cullmark_jobs", &[]), value("cullmark_workers_busy", &[])), (0.0, 0.0));
    assert!(value("cullmark_resident_bytes", &[]) > 1e6 && value("cullmark_uptime_seconds", &[]) > 0.0);
    // No name of a study and no address that somebody made up becomes a label.
    assert!(!text.contains("nowhere") && !text.contains("nothing"), "{text}");
}

#[test]
fn a_backup_made_while_a_study_runs_is_whole() {
    let server = Server::start();
    let body = json!({ "manifest": study("town"), "set": ["measure.repeats=5"] });
    server.post("/studies", &body).with(201);
    let trials = |s: &Value| s["jobs"]["trials"].as_u64().unwrap();
    until("trials are done", || (trials(&server.json("/studies/town")) < 5 * RUNS - 4).then_some(()));
    let out = cullmark(server.path(), &["backup", "copy.db", "--db", "x.db"]);
    assert!(out.status.success(), "{}", shown(&out));
    let again = cullmark(server.path(), &["backup", "copy.db", "--db", "x.db"]);
    assert!(again.status.code() == Some(2) && shown(&again).contains("never replaces"), "{}", shown(&again));
    let finished = server.finished("town");
    assert_eq!(finished["runs"]["done"], RUNS, "the server went on: {finished}");

    let copies = tempfile::tempdir().unwrap();
    let copy = copies.path().join("copy.db");
    std::fs::rename(server.path().join("copy.db"), &copy).unwrap();
    let (taken, integrity): (i64, String) = block_on(async {
        let pool = sqlx::SqlitePool::connect(copy.to_str().unwrap()).await.unwrap();
        let integrity = sqlx::query_scalar("PRAGMA integrity_check").fetch_one(&pool).await.unwrap();
        let taken = sqlx::query_scalar("SELECT count(*) FROM trials").fetch_one(&pool).await.unwrap();
        pool.close().await;
        (taken, integrity)
    });
    assert_eq!(integrity, "ok");
    assert!(taken >= 4, "{taken}");
    block_on(async {
        let store = Store::open_existing(&copy).await.unwrap();
        let results = store.results("town").await.unwrap();
        assert_eq!(results.runs.len() as u64, RUNS);
        store.close().await;
    });
    // A database like any other: a server goes on with it, at once where the first one is gone.
    let (_files, _) = server.terminate();
    let folder = tempfile::tempdir().unwrap();
    super::server::furnish(folder.path());
    std::fs::copy(&copy, folder.path().join("x.db")).unwrap();
    let other = Server::within(folder, &[]);
    assert_eq!(other.finished("town")["runs"]["done"], RUNS);
}

#[test]
#[cfg(unix)]
fn a_server_asked_to_end_gives_its_leases_back_and_goes_on_when_started_again() {
    for grace in ["10", "0"] {
        let server = Server::with(&["--grace-s", grace]);
        let body = json!({ "manifest": study("town"), "set": ["measure.repeats=4"] });
        server.post("/studies", &body).with(201);
        until("it is under way", || {
            let s = server.json("/studies/town");
            (s["jobs"]["running"].as_u64() > Some(0) && s["jobs"]["trials"].as_u64() < Some(4 * RUNS)).then_some(())
        });
        let (folder, status) = server.terminate();
        assert_eq!(status.code(), Some(0), "{}", std::fs::read_to_string(folder.path().join("log")).unwrap());
        let (leased, open, outcomes): (i64, i64, Vec<Option<String>>) = block_on(async {
            let pool = sqlx::SqlitePool::connect(folder.path().join("x.db").to_str().unwrap()).await.unwrap();
            let one = |sql: &'static str| sqlx::query_scalar(sql).fetch_one(&pool);
            let leased = one("SELECT count(*) FROM jobs WHERE state = 'leased'").await.unwrap();
            let open = one("SELECT count(*) FROM jobs WHERE state = 'queued'").await.unwrap();
            let outcomes = sqlx::query_scalar("SELECT DISTINCT outcome FROM attempts").fetch_all(&pool).await.unwrap();
            pool.close().await;
            (leased, open, outcomes)
        });
        assert!(leased == 0 && open > 0, "{leased} are leased, {open} wait");
        let fine = |o: &Option<String>| matches!(o.as_deref(), Some("accepted" | "returned"));
        assert!(outcomes.iter().all(fine), "no attempt is lost: {outcomes:?}");
        let server = Server::within(folder, &[]);
        assert_eq!(server.finished("town")["runs"]["done"], RUNS);
    }
}

#[test]
#[cfg(unix)]
fn metrics_kept_by_another_program_or_damaged_are_computed_again() {
    let server = Server::start();
    server.post("/studies", &json!({ "manifest": study("town"), "set": ["measure.repeats=1"] })).with(201);
    server.finished("town");
    let path = "/studies/town/runs?columns=status,total_cull_ms,mean_triangles,false_cull_ppm,class";
    let before = server.json(path);
    assert!(before["items"][0]["cells"]["total_cull_ms"]["value"].as_f64() > Some(0.0), "{before}");
    let (mut folder, _) = server.terminate();
    for damage in ["revision = 'another'", "changed = changed - 1", "data = x'00ff'"] {
        let kept: i64 = block_on(async {
            let pool = sqlx::SqlitePool::connect(folder.path().join("x.db").to_str().unwrap()).await.unwrap();
            let sql = format!("UPDATE facts SET {damage}");
            let rows = sqlx::query(sqlx::AssertSqlSafe(sql)).execute(&pool).await.unwrap().rows_affected();
            pool.close().await;
            rows as i64
        });
        assert_eq!(kept, RUNS as i64, "facts are kept");
        let server = Server::within(folder, &["--no-workers"]);
        assert_eq!(server.json(path), before, "{damage}");
        (folder, _) = server.terminate();
    }
}

#[test]
#[cfg(unix)]
fn a_worker_beside_a_server_does_its_work_and_ends_when_asked() {
    let server = Server::with(&["--no-workers"]);
    server.post("/studies", &json!({ "manifest": study("town"), "set": ["measure.repeats=1"] })).with(201);
    let log = std::fs::File::create(server.path().join("worker.log")).unwrap();
    let mut command = super::server::program(server.path());
    let mut worker = command.args(["worker", "--db", "x.db"]).stderr(log).spawn().unwrap();
    // The server did none of it, and yet whoever watches it is told.
    assert!(server.events("town", |event, _| event == "end"));
    let told = std::fs::read_to_string(server.path().join("worker.log")).unwrap();
    std::process::Command::new("kill").args(["-TERM", &worker.id().to_string()]).status().unwrap();
    let status = until("the worker ends", || worker.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_eq!(server.finished("town")["runs"]["done"], RUNS);
    assert!(told.contains("run ended"), "{told}");
}
