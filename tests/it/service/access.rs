//! Who may ask what: tokens and roles, pages of other origins, too many requests, too
//! much at once.

use super::server::{Client, Server, cullmark, furnish, raw, shared, shown, study, until};
use serde_json::{Value, json};
use std::path::Path;

fn token(dir: &Path, role: &str) -> String {
    let out = cullmark(dir, &["token", "add", role, "--role", role, "--db", "x.db"]);
    assert!(out.status.success(), "{}", shown(&out));
    let text = String::from_utf8(out.stdout).unwrap().trim().to_string();
    assert!(text.len() > 60 && text.starts_with("cm_"), "{text}");
    text
}

/// A server that wants tokens, and one of each role: read, submit, admin.
fn guarded(flags: &[&str]) -> (Server, [String; 3]) {
    let folder = tempfile::tempdir().unwrap();
    furnish(folder.path());
    let tokens = ["read", "submit", "admin"].map(|role| token(folder.path(), role));
    (Server::within(folder, flags), tokens)
}

/// One request of each rank, and what it answers to those who may.
const ASKED: [(&str, &str, usize, u16); 12] = [
    ("GET", "/api/v1/studies", 0, 200),
    ("GET", "/api/v1/studies/nowhere/runs", 0, 404),
    ("GET", "/api/v1/me", 0, 200),
    ("GET", "/api/v1/pool", 0, 200),
    ("GET", "/metrics", 0, 200),
    ("POST", "/api/v1/studies", 1, 415),
    ("POST", "/api/v1/studies/nowhere/pause", 1, 404),
    ("PATCH", "/api/v1/studies/nowhere", 1, 415),
    ("POST", "/api/v1/uploads?kind=scene&name=a.txt", 1, 415),
    ("DELETE", "/api/v1/studies/nowhere", 2, 404),
    ("DELETE", "/api/v1/uploads/nothing", 2, 404),
    ("POST", "/api/v1/pool/pause", 2, 200),
];

#[test]
fn without_tokens_anybody_may_do_all() {
    let me = shared().json("/me");
    assert_eq!((&me["role"], &me["tokens"]), (&json!("admin"), &json!(false)));
    for (method, path, _, status) in ASKED.iter().filter(|(_, p, ..)| !p.contains("/pool/")) {
        shared().send(method, path, &[], b"").with(*status);
    }
}

#[test]
fn with_tokens_each_role_may_do_its_own_and_what_is_below_it() {
    let (server, tokens) = guarded(&["--no-workers"]);
    for (method, path, needed, status) in ASKED {
        let refused = server.send(method, path, &[], b"");
        assert_eq!(refused.header("www-authenticate"), Some("Bearer"), "{path}");
        refused.problem(401);
        for wrong in ["cm_0000", "", "Bearer"] {
            server.with_token(wrong).send(method, path, &[], b"").problem(401);
        }
        let basic = format!("Basic {}", tokens[2]);
        server.send(method, path, &[("authorization", &basic)], b"").problem(401);
        for (rank, token) in tokens.iter().enumerate() {
            let answer = server.with_token(token).send(method, path, &[], b"");
            if rank >= needed {
                assert_eq!(answer.status, status, "{method} {path} as {rank}: {}", answer.text());
            } else {
                let problem = answer.problem(403);
                assert!(problem["detail"].as_str().unwrap().contains("role"), "{problem}");
            }
        }
    }
    for (rank, role) in ["read", "submit", "admin"].iter().enumerate() {
        let me = server.with_token(&tokens[rank]).json("/me");
        assert_eq!((&me["role"], &me["tokens"]), (&json!(role), &json!(true)));
    }
    // The page, its health and its description are for everybody; they hold nothing.
    for path in ["/", "/healthz", "/api/v1/openapi.json"] {
        server.send("GET", path, &[], b"").with(200);
    }
    let out = cullmark(server.path(), &["token", "remove", "submit", "--db", "x.db"]);
    assert!(out.status.success(), "{}", shown(&out));
    server.with_token(&tokens[1]).get("/studies").problem(401);
    server.with_token(&tokens[0]).get("/studies").with(200);
    let out = cullmark(server.path(), &["token", "list", "--db", "x.db"]);
    let list = String::from_utf8(out.stdout).unwrap();
    assert!(list.contains("admin") && !list.contains("submit") && !list.contains("used never"), "{list}");
}

#[test]
fn a_token_is_neither_in_the_database_nor_in_the_log() {
    let (server, tokens) = guarded(&["--no-workers", "--verbose", "--log", "json"]);
    let admin = server.with_token(&tokens[2]);
    admin.post("/studies", &json!({ "manifest": study("town") })).with(201);
    admin.get("/studies/town/runs?where=culling%20=%20none").with(200);
    server.with_token("cm_secret_but_wrong").get("/studies").problem(401);
    let log = until("requests are logged", || Some(server.log()).filter(|l| l.contains("\"status\":401")));
    for line in log.lines() {
        let entry: Value = serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"));
        assert!(entry["level"].is_string() && entry["timestamp"].is_string(), "{line}");
    }
    assert!(log.contains("/api/v1/studies/town/runs"), "{log}");
    for secret in tokens.iter().map(String::as_str).chain(["cm_secret_but_wrong"]) {
        assert!(!log.contains(&secret[3..]), "a token is in the log");
    }
    assert!(!log.contains("where="), "a query is in the log");
    let out = cullmark(server.path(), &["token", "list", "--db", "x.db"]);
    assert!(!shown(&out).contains(&tokens[2][3..20]));
    let (folder, _) = server.terminate();
    for file in std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_file()) {
        let bytes = std::fs::read(&file).unwrap();
        for token in &tokens {
            let found = bytes.windows(16).any(|w| w == &token.as_bytes()[3..19]);
            assert!(!found, "{} holds a token", file.display());
        }
    }
}

#[test]
fn a_page_of_another_origin_changes_nothing_and_a_strange_name_is_none_of_ours() {
    let port = shared().address.rsplit_once(':').unwrap().1.to_string();
    let own = format!("http://{}", shared().address);
    let post = |origin: &str| {
        let headers = [("origin", origin), ("content-type", "application/json")];
        shared().send("POST", "/api/v1/studies/nowhere/pause", &headers, b"{}")
    };
    for foreign in ["http://evil.example", "null", "https://localhost.evil.example", "http://127.0.0.1:1"] {
        post(foreign).problem(403);
    }
    post(&own).problem(404);
    shared().send("GET", "/api/v1/studies", &[("origin", "http://evil.example")], b"").with(200);
    let reply = shared().send("GET", "/api/v1/studies", &[("origin", "http://evil.example")], b"");
    assert_eq!(reply.header("access-control-allow-origin"), None, "and cannot read the answer");
    let with_host = |host: &str, path: &str| {
        raw(&shared().address, format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").as_bytes())
    };
    for strange in ["evil.example", "evil.example:80", "localhost.evil.example", "10.0.0.1", "[::2]:1"] {
        for path in ["/", "/api/v1/studies", "/metrics", "/healthz"] {
            let refused = with_host(strange, path);
            assert_eq!((refused.status, refused.kind()), (421, "application/problem+json"), "{strange} {path}");
        }
    }
    for ours in [format!("localhost:{port}"), format!("127.0.0.1:{port}"), "[::1]".to_string()] {
        assert_eq!(with_host(&ours, "/healthz").status, 200, "{ours}");
    }
}

#[test]
fn too_many_requests_are_turned_away_with_the_time_to_wait() {
    let server = Server::with(&["--no-workers", "--rate", "5"]);
    let answers: Vec<_> = (0..60).map(|_| server.get("/me")).collect();
    let refused = answers.into_iter().find(|a| a.status != 200).expect("60 at once are more than 20");
    let wait: u64 = refused.header("retry-after").expect("when to come again").parse().unwrap();
    assert!((1..=2).contains(&wait), "{wait}");
    let problem = refused.problem(429);
    assert!(problem["help"].as_str().unwrap().contains("--rate"), "{problem}");
    // Whoever waits is let in again; health and metrics are always there.
    server.send("GET", "/healthz", &[], b"").with(200);
    until("the bucket fills", || (server.get("/me").status == 200).then_some(()));
}

#[test]
fn a_manifest_of_5_mib_is_too_much() {
    let server = Server::with(&["--no-workers"]);
    for kind in ["application/json", "application/toml"] {
        let head = format!(
            "POST /api/v1/studies HTTP/1.1\r\nHost: {}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
            server.address,
            5 << 20
        );
        let reply = raw(&server.address, &[head.as_bytes(), &vec![b'#'; 5 << 20]].concat());
        assert_eq!((reply.status, reply.kind()), (413, "application/problem+json"), "{kind}: {}", reply.text());
    }
    let fits = format!("#{}\n{}", "#".repeat(3 << 20), study("town"));
    server.submit(&fits);
}

#[test]
fn listening_beyond_this_machine_without_a_token_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let serve = ["serve", "--listen", "0.0.0.0:0", "--db", "x.db", "--no-workers"];
    let out = cullmark(dir.path(), &serve);
    let text = shown(&out);
    assert_eq!(out.status.code(), Some(2), "{text}");
    assert!(text.contains("--listen") && text.contains("token add") && text.contains("--open-to-all"), "{text}");
    token(dir.path(), "read");
    let mut command = super::server::program(dir.path());
    let mut child = command.args(serve).stdout(std::process::Stdio::piped()).spawn().unwrap();
    let address = super::server::address_of(&mut child);
    let port = address.rsplit_once(':').unwrap().1;
    let status = Client::new(&format!("127.0.0.1:{port}")).get("/studies").status;
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(status, 401);
    for listen in ["localhost", "127.0.0.1", "256.0.0.1:80"] {
        let out = cullmark(dir.path(), &["serve", "--listen", listen, "--db", "x.db"]);
        assert_eq!(out.status.code(), Some(2), "{listen}");
    }
    let taken = cullmark(dir.path(), &["serve", "--listen", &shared().address, "--db", "y.db"]);
    assert!(shown(&taken).contains("choose another port"), "{}", shown(&taken));
}
