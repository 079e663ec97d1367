//! A study from its submission to its end, and all that may happen to it on the way.

use super::server::{RUNS, Server, forget, furnish, study, until};
use serde_json::{Value, json};

/// Enough repeats that it does not end by itself while a test looks.
fn long(name: &str) -> Value {
    json!({ "manifest": study(name), "set": ["measure.repeats=200"] })
}

#[test]
fn checking_a_manifest_plans_it_and_names_every_mistake_with_its_place() {
    let server = Server::with(&["--no-workers"]);
    let ask = |manifest: &str| {
        server.post("/studies", &json!({ "manifest": manifest, "validate_only": true, "set": ["measure.repeats=5"] }))
    };
    let answer = ask(&study("town")).with(200).json();
    let plan = &answer["plan"];
    assert_eq!((&plan["study"], &plan["new"], &plan["trials"]), (&json!("town"), &json!(RUNS), &json!(5 * RUNS)));
    assert_eq!((&plan["rows_total"], &plan["excluded_total"]), (&json!(RUNS), &json!(1)));
    assert_eq!(plan["excluded"][0]["excluded"], "nothing to see");
    assert_eq!(server.json("/studies")["items"], json!([]), "nothing was submitted");

    let bad = study("town").replace("passes = 1", "passes = \"three\"").replace("\"frustum\"]", "\"frustrum\"]");
    let problem = ask(&bad).problem(422);
    let errors = problem["errors"].as_array().unwrap();
    for (key, word, help) in [("measure.passes", "\"three\"", None), ("matrix.culling", "frustrum", Some("frustum"))] {
        let e = errors.iter().find(|e| e["key"].as_str().is_some_and(|k| k.starts_with(key)));
        let e = e.unwrap_or_else(|| panic!("{key} is not named: {problem}"));
        let line = 1 + bad.lines().position(|l| l.contains(word)).unwrap();
        let column = 1 + bad.lines().nth(line - 1).unwrap().find(word).unwrap();
        assert_eq!((&e["line"], &e["column"]), (&json!(line), &json!(column)), "{e}");
        assert!(help.is_none_or(|h| e["help"].as_str().unwrap().contains(h)), "{e}");
    }
    assert_eq!(problem["type"], "urn:cullmark:problem:invalid-manifest");
    let toml = server.send(
        "POST",
        "/api/v1/studies?validate_only=true",
        &[("content-type", "application/toml")],
        bad.as_bytes(),
    );
    assert_eq!(toml.problem(422)["errors"].as_array().unwrap().len(), errors.len(), "the same as TOML");
    // What only reading the files tells.
    std::fs::write(server.path().join("walk.csv"), "frame,px\n0,1\n").unwrap();
    let problem = ask(&study("town")).problem(422);
    assert_eq!(problem["errors"][0]["file"], "walk.csv", "{problem}");
}

#[test]
fn a_submitted_study_tells_its_progress_its_runs_and_its_end() {
    let server = Server::start();
    server.post("/pool/pause", &json!({})).with(200);
    let path = "/api/v1/studies?priority=3&set=measure.repeats%3D1";
    let taken =
        server.send("POST", path, &[("content-type", "application/toml")], study("town").as_bytes()).with(201).json();
    let (s, submitted) = (&taken["study"], &taken["submitted"]);
    assert_eq!(
        (&s["ref"], &s["state"], &s["priority"], &s["finished"]),
        (&json!("town@0"), &json!("active"), &json!(3), &json!(false))
    );
    assert_eq!((&submitted["new"], &submitted["jobs_added"]), (&json!(RUNS), &json!(2 * RUNS)));
    assert_eq!(s["jobs"], json!({ "trials": RUNS, "judgements": RUNS, "running": 0 }));

    let before = server.get("/studies/town/matrix").with(200).header("etag").unwrap().to_string();
    let (mut heard, mut ended) = (Vec::new(), Vec::new());
    let all = server.events("town", |event, data| {
        if heard.is_empty() {
            assert_eq!((event, &data["runs"]["pending"]), ("progress", &json!(RUNS)));
            server.post("/pool/resume", &json!({})).with(200);
        }
        heard.push(event.to_string());
        if event == "run" {
            ended.push(data);
        }
        event == "end"
    });
    assert!(all, "the stream ended before the study: {heard:?}");
    let mut ordinals: Vec<u64> = ended.iter().map(|e| e["ordinal"].as_u64().unwrap()).collect();
    ordinals.sort_unstable();
    assert_eq!(ordinals, (0..RUNS).collect::<Vec<_>>(), "each run is told once: {ended:?}");
    assert!(ended.iter().all(|e| e["status"] == "done" && e["label"].as_str().unwrap().starts_with("town: ")));
    let now = server.json("/studies/town");
    assert_eq!((&now["finished"], &now["runs"]["done"]), (&json!(true), &json!(RUNS)));
    assert_eq!(now["jobs"], json!({ "trials": 0, "judgements": 0, "running": 0 }));
    let known = [("if-none-match", before.as_str())];
    let matrix = server.send("GET", "/api/v1/studies/town/matrix", &known, b"").with(200);
    assert_ne!(matrix.header("etag").unwrap(), before, "new results, new tag");
    // Submitted again it is done at once.
    let again =
        server.post("/studies", &json!({ "manifest": study("town"), "set": ["measure.repeats=1"] })).with(201).json();
    assert_eq!((&again["submitted"]["done"], &again["submitted"]["jobs_added"]), (&json!(RUNS), &json!(0)));
}

#[test]
fn a_paused_study_is_not_worked_on_until_it_is_resumed() {
    let server = Server::start();
    server.post("/studies", &long("town")).with(201);
    let done = |s: &Value| s["jobs"]["trials"].as_u64().unwrap();
    let begun = until("a trial is done", || Some(server.json("/studies/town")).filter(|s| done(s) < 200 * RUNS));
    assert_eq!(begun["state"], "active");
    let paused = server.post("/studies/town/pause", &json!({})).with(200).json();
    assert_eq!(paused["state"], "paused");
    // What was under way ends; a second study then has the workers to itself.
    let other = json!({ "manifest": study("other"), "set": ["measure.passes=2", "measure.repeats=1"] });
    until("nothing runs", || (server.json("/studies/town")["jobs"]["running"] == 0).then_some(()));
    let left = done(&server.json("/studies/town"));
    server.post("/studies", &other).with(201);
    server.finished("other");
    assert_eq!(done(&server.json("/studies/town")), left, "nothing was leased meanwhile");
    assert_eq!(server.post("/studies/town/resume", &json!({})).with(200).json()["state"], "active");
    until("it goes on", || (done(&server.json("/studies/town")) < left).then_some(()));

    let changed = server.patch("/studies/town", &json!({ "priority": -7 })).with(200).json();
    assert_eq!((&changed["priority"], &server.json("/studies/town")["priority"]), (&json!(-7), &json!(-7)));
    // The whole pool rests and says so.
    assert_eq!(server.post("/pool/pause", &json!({})).with(200).json()["paused"], true);
    until("the workers rest", || {
        let pool = server.json("/pool");
        pool["workers"].as_array().unwrap().iter().all(|w| w["kind"].is_null()).then_some(())
    });
    assert_eq!(server.json("/studies/town")["jobs"]["running"], 0);
}

#[test]
fn a_cancelled_study_is_finished_and_a_resumed_one_goes_on_to_its_end() {
    let server = Server::start();
    let body = json!({ "manifest": study("town"), "set": ["measure.repeats=4"] });
    server.post("/studies", &body).with(201);
    until("it is under way", || {
        (server.json("/studies/town")["jobs"]["trials"].as_u64() < Some(4 * RUNS)).then_some(())
    });
    let cancelled = server.post("/studies/town/cancel", &json!({})).with(200).json();
    assert_eq!((&cancelled["state"], &cancelled["finished"]), (&json!("cancelled"), &json!(true)));
    assert_eq!(cancelled["jobs"], json!({ "trials": 0, "judgements": 0, "running": 0 }), "queued jobs end");
    assert!(cancelled["runs"]["pending"].as_u64() > Some(0), "{cancelled}");
    let mut last = Value::Null;
    assert!(server.events("town", |event, data| {
        if event == "progress" {
            last = data;
        }
        event == "end"
    }));
    assert_eq!(last["state"], "cancelled", "whoever watches is told the end");
    let resumed = server.post("/studies/town/resume", &json!({})).with(200).json();
    assert_eq!((&resumed["state"], &resumed["finished"]), (&json!("active"), &json!(false)));
    let end = server.finished("town");
    assert_eq!((&end["state"], &end["runs"]["done"]), (&json!("active"), &json!(RUNS)), "{end}");
    for row in server.json("/studies/town/runs?columns=trials")["items"].as_array().unwrap() {
        assert!(row["cells"]["trials"].as_f64() >= Some(4.0), "{row}");
    }
}

#[test]
fn what_failed_is_retried_and_a_rerun_is_the_next_series() {
    let server = Server::start();
    let body = |retry: bool| json!({ "manifest": study("town"), "set": ["measure.repeats=1"], "retry_failed": retry });
    server.post("/pool/pause", &json!({})).with(200);
    server.post("/studies", &body(false)).with(201);
    forget(server.path(), "town.obj");
    server.post("/pool/resume", &json!({})).with(200);
    assert_eq!(server.finished("town")["runs"]["failed"], RUNS);
    // With its scene at hand again, what failed stays failed until it is asked for.
    furnish(server.path());
    assert_eq!(server.post("/studies", &body(false)).with(201).json()["submitted"]["failed"], RUNS);
    let retried = server.post("/studies/town/retry", &json!({})).with(200).json();
    assert_eq!((&retried["finished"], &retried["runs"]["failed"]), (&json!(false), &json!(0)), "{retried}");
    assert_eq!(server.finished("town")["runs"]["done"], RUNS);
    assert_eq!(server.post("/studies", &body(true)).with(201).json()["submitted"]["done"], RUNS);

    let again = server.post("/studies/town/rerun", &json!({})).with(201).json();
    assert_eq!((&again["ref"], &again["runs"]["pending"]), (&json!("town@1"), &json!(RUNS)), "{again}");
    assert_eq!(server.finished("town@1")["runs"]["done"], RUNS);
    assert_eq!(server.json("/studies/town@0/runs/0")["answer_id"], server.json("/studies/town@1/runs/0")["answer_id"]);
    let next = server.post("/studies", &json!({ "manifest": study("town"), "series": "next" })).with(201).json();
    assert_eq!(next["study"]["series"], 2);
    let named = server.post("/studies", &json!({ "manifest": study("town"), "series": 7 })).with(201).json();
    assert_eq!(named["study"]["ref"], "town@7");
}

#[test]
fn a_deleted_study_leaves_its_measurements_unless_they_are_to_go_too() {
    let server = Server::start();
    let body = json!({ "manifest": study("town"), "set": ["measure.repeats=1"] });
    server.post("/studies", &body).with(201);
    server.finished("town");
    let id = server.json("/studies/town/runs/0")["run"].clone();
    server.delete("/studies/town").with(204);
    server.get("/studies/town").problem(404);
    assert_eq!(server.json("/studies")["items"], json!([]));
    let again = server.post("/studies", &body).with(201).json();
    assert_eq!(
        (&again["submitted"]["done"], &again["study"]["finished"]),
        (&json!(RUNS), &json!(true)),
        "all is still there"
    );
    assert_eq!(server.json("/studies/town/runs/0")["run"], id);

    let mut heard = Vec::new();
    let told = server.events("town", |event, _| {
        if heard.is_empty() {
            server.delete("/studies/town?measurements=true").with(204);
        }
        heard.push(event.to_string());
        event == "deleted"
    });
    assert!(told, "whoever watches is told: {heard:?}");
    let anew = server.post("/studies", &body).with(201).json();
    assert_eq!((&anew["submitted"]["new"], &anew["study"]["runs"]["pending"]), (&json!(RUNS), &json!(RUNS)));
    assert_eq!(server.finished("town")["runs"]["done"], RUNS);
    server.delete("/studies/town").with(204);
    server.delete("/studies/town").problem(404);
}
