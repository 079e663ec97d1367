//! The client's verbs: submit, watch, query, cancel. Their exit status is what scripts see.

use super::server::{Server, cullmark, furnish, shared, shown, study};
use serde_json::{Value, json};

/// A verb against the shared server, from its folder.
fn verb(words: &[&str]) -> std::process::Output {
    let mut command = super::server::program(&shared().dir);
    command.env("CULLMARK_SERVER", shared().url()).args(words).output().unwrap()
}

#[test]
fn submit_and_watch_end_with_0_when_all_is_well_and_with_1_when_a_run_fails() {
    let server = Server::start();
    let well = server.verb(&["submit", "town.toml", "--watch", "--set", "measure.repeats=1"]);
    assert_eq!(well.status.code(), Some(0), "{}", shown(&well));
    assert!(
        shown(&well).contains("town@0: 5 runs (5 new)") && shown(&well).contains("5 of 5 runs done"),
        "{}",
        shown(&well)
    );
    let late = ["submit", "town.toml", "--watch", "--json", "--series", "next", "--set", "measure.timeout_s=0.001"];
    let late = server.verb(&late);
    assert_eq!(late.status.code(), Some(1), "{}", shown(&late));
    assert!(server.json("/studies/town@1")["runs"]["failed"].as_u64() > Some(0));
    let lines = String::from_utf8(late.stdout).unwrap();
    let last: Value = serde_json::from_str(lines.lines().last().unwrap()).unwrap();
    assert_eq!(last["event"], "end");
    for (study, code) in [("town@0", 0), ("town@1", 1), ("town", 1)] {
        assert_eq!(server.verb(&["watch", study]).status.code(), Some(code), "{study}");
    }
    let unknown = server.verb(&["watch", "twon"]);
    assert_eq!(unknown.status.code(), Some(2), "{}", shown(&unknown));
    assert!(shown(&unknown).contains("twon") && shown(&unknown).contains("help:"), "{}", shown(&unknown));
}

#[test]
fn submit_with_upload_sends_the_files_that_the_manifest_names() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    let server = Server::offering(folder, "in", &[]);
    let home = tempfile::tempdir().unwrap();
    std::fs::create_dir(home.path().join("files")).unwrap();
    furnish(&home.path().join("files"));
    let text =
        study("town").replace("\"town.obj\"", "\"files/town.obj\"").replace("\"walk.csv\"", "\"files/walk.csv\"");
    std::fs::write(home.path().join("m.toml"), text).unwrap();
    let url = server.url();
    let submit = |more: &[&str]| {
        let words = ["submit", "m.toml", "--server", &url, "--set", "measure.repeats=1"];
        cullmark(home.path(), &[&words[..], more].concat())
    };
    let refused = submit(&[]);
    assert_eq!(refused.status.code(), Some(2), "{}", shown(&refused));
    assert!(shown(&refused).contains("files/town.obj") && shown(&refused).contains("upload"), "{}", shown(&refused));
    let sent = submit(&["--upload", "--watch"]);
    assert_eq!(sent.status.code(), Some(0), "{}", shown(&sent));
    assert_eq!(server.json("/uploads")["items"].as_array().unwrap().len(), 2);
    let manifest = server.get("/studies/town/manifest").with(200).text();
    assert!(manifest.contains("upload:") && !manifest.contains("files/"), "{manifest}");
    let again = submit(&["--upload", "--validate-only"]);
    assert!(shown(&again).contains("5 done"), "{}", shown(&again));
}

#[test]
fn a_file_that_is_too_large_or_of_no_kind_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    let server = Server::offering(folder, "in", &["--no-workers", "--max-upload-mib", "1"]);
    let home = tempfile::tempdir().unwrap();
    furnish(home.path());
    let submit = || cullmark(home.path(), &["submit", "town.toml", "--server", &server.url(), "--upload"]);
    let mesh = std::fs::read_to_string(home.path().join("town.obj")).unwrap();
    std::fs::write(home.path().join("town.obj"), format!("{mesh}{}", "# and so on\n".repeat(1 << 20))).unwrap();
    let out = submit();
    assert_eq!(out.status.code(), Some(2), "{}", shown(&out));
    assert!(shown(&out).contains("more than 1 MiB"), "{}", shown(&out));
    std::fs::write(home.path().join("town.obj"), mesh).unwrap();
    std::fs::write(home.path().join("walk.csv"), "frame,px\n0,1\n").unwrap();
    let out = submit();
    assert!(out.status.code() == Some(2) && shown(&out).contains("walk.csv"), "{}", shown(&out));
}

#[test]
fn validate_only_prints_the_counts_or_every_mistake_with_line_and_column() {
    let good = verb(&["submit", "town.toml", "--validate-only"]);
    assert!(good.status.success() && shown(&good).contains("ok: 5 runs"), "{}", shown(&good));
    let bad = study("town").replace("repeats = 3", "repeats = -3").replace("\"frustum\"]", "\"frustrum\"]");
    let line = |word: &str| 1 + bad.lines().position(|l| l.contains(word)).unwrap();
    std::fs::write(shared().dir.join("bad.toml"), &bad).unwrap();
    let out = verb(&["submit", "bad.toml", "--validate-only"]);
    let text = shown(&out);
    assert_eq!(out.status.code(), Some(2), "{text}");
    for (word, column) in [("repeats = -3", 11), ("frustrum", 21)] {
        assert!(text.contains(&format!("{}:{column}:", line(word))), "{word}: {text}");
    }
    assert!(text.contains("did you mean `frustum`") || text.contains("frustum"), "{text}");
}

#[test]
fn query_prints_the_same_from_a_server_and_from_its_database() {
    for format in ["table", "csv", "json", "markdown"] {
        for more in [
            &[][..],
            &["--where", "culling = frustum", "--sort", "-total_cull_ms"],
            &[
                "--columns",
                "structure,octree.depth,class,total_cull_ms,reason",
                "--sort",
                "octree.depth",
                "--limit",
                "2",
            ],
            &["--where", "octree.depth > 9"],
        ] {
            for study in ["town@0", "late@0"] {
                let words = [&["query", study, "--format", format][..], more].concat();
                let remote = verb(&words);
                let mut local = super::server::program(&shared().dir);
                let local = local.args(&words).args(["--db", "x.db"]).output().unwrap();
                assert!(remote.status.success() && local.status.success(), "{}\n{}", shown(&remote), shown(&local));
                let text = |o: &std::process::Output| String::from_utf8(o.stdout.clone()).unwrap();
                assert_eq!(text(&remote), text(&local), "{words:?}");
            }
        }
    }
    let wrong = verb(&["query", "town@0", "--where", "depht = 3"]);
    assert!(wrong.status.code() == Some(2) && shown(&wrong).contains("depht"), "{}", shown(&wrong));
}

#[test]
fn cancel_pause_and_resume_say_what_the_study_is_now() {
    let server = Server::with(&["--no-workers"]);
    server.post("/studies", &json!({ "manifest": study("town") })).with(201);
    for (words, state) in [
        (&["cancel", "town", "--pause"][..], "paused"),
        (&["cancel", "town", "--resume"], "active"),
        (&["cancel", "town"], "cancelled"),
    ] {
        let out = server.verb(words);
        assert!(out.status.success(), "{}", shown(&out));
        assert!(shown(&out).contains(&format!("town@0 is {state}: 0 of 5 runs done")), "{}", shown(&out));
        assert_eq!(server.json("/studies/town")["state"], state);
    }
    // The same on the database alone.
    let out = cullmark(server.path(), &["cancel", "town", "--resume", "--db", "x.db"]);
    assert!(shown(&out).contains("town@0 is active"), "{}", shown(&out));
    let unknown = server.verb(&["cancel", "twon"]);
    assert!(unknown.status.code() == Some(2) && shown(&unknown).contains("twon"), "{}", shown(&unknown));
}

#[test]
fn a_server_that_is_not_there_or_is_none_is_an_error_with_help() {
    let dir = tempfile::tempdir().unwrap();
    furnish(dir.path());
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let url = format!("http://{free}");
    for (server, says) in
        [(url.as_str(), "cannot be reached"), ("localhost:80", "no address"), ("ftp://x", "no address")]
    {
        let out = cullmark(dir.path(), &["submit", "town.toml", "--server", server]);
        let text = shown(&out);
        assert_eq!(out.status.code(), Some(2), "{text}");
        assert!(text.contains(says) && text.contains("help:"), "{server}: {text}");
    }
    let out = cullmark(dir.path(), &["submit", "town.toml"]);
    assert!(out.status.code() == Some(2) && shown(&out).contains("CULLMARK_SERVER"), "{}", shown(&out));
}
