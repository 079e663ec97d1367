//! A server of our own: the real program on a free port, and how to speak to it.

pub use super::shared::shared;
use crate::common::town;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Two structures, two methods, one cell left out, one claim.
const STUDY: &str = r#"
[study]
name = "town"
title = "A town"
description = "Boxes in rows."
[measure]
repeats = 3
passes = 1
timeout_s = 120
[accuracy]
frames = 2
width_px = 32
height_px = 18
[[scene]]
name = "town"
file = "town.obj"
up = "z"
[[path]]
name = "walk"
file = "walk.csv"
[matrix]
structure = ["list", "octree:depth=2", "octree:depth=3"]
culling = ["none", "frustum"]
[[exclude]]
structure = "octree:depth=3"
culling = "none"
why = "nothing to see"
[[claim]]
id = "frustum_pays"
text = "The frustum submits fewer triangles than none"
source = "the definition"
metric = "mean_triangles"
numerator = { culling = "frustum" }
denominator = { culling = "none" }
relation = "<"
for_each = "scene"
"#;

/// Runs of [`study`].
pub const RUNS: u64 = 5;

pub fn study(name: &str) -> String {
    STUDY.replacen("\"town\"", &format!("\"{name}\""), 1)
}

/// Puts the town and its manifest into `dir`.
pub fn furnish(dir: &Path) {
    let (mesh, walk) = town(4);
    for (name, text) in [("town.obj", mesh.as_str()), ("walk.csv", &walk), ("town.toml", STUDY)] {
        std::fs::write(dir.join(name), text).unwrap();
    }
}

/// Takes a file away, and what was kept of it.
pub fn forget(dir: &Path, file: &str) {
    std::fs::remove_file(dir.join(file)).unwrap();
    std::fs::remove_dir_all(dir.join("cache")).unwrap();
}

/// Asks until there is an answer; nothing here takes a minute.
pub fn until<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    let late = Instant::now() + Duration::from_secs(60);
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(Instant::now() < late, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// What was answered, whatever the status.
#[derive(Debug)]
pub struct Reply {
    pub status: u16,
    headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Reply {
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(n, _)| n.eq_ignore_ascii_case(name)).map(|(_, v)| v.as_str())
    }

    pub fn kind(&self) -> &str {
        self.header("content-type").unwrap_or_default().split(';').next().unwrap_or_default()
    }

    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|e| panic!("{e} in {}: {}", self.status, self.text()))
    }

    /// Insists on the status.
    pub fn with(self, status: u16) -> Reply {
        assert_eq!(self.status, status, "{}", self.text());
        self
    }

    /// Insists on the status and on a whole problem document.
    pub fn problem(self, status: u16) -> Value {
        let reply = self.with(status);
        assert_eq!(reply.kind(), "application/problem+json", "{}", reply.text());
        let p = reply.json();
        for name in ["type", "title", "detail"] {
            assert!(p[name].as_str().is_some_and(|t| !t.is_empty()), "`{name}` of {p}");
        }
        assert_eq!(p["status"], status, "{p}");
        p
    }
}

/// The program, working in `dir`; its measuring lane is there, too.
pub fn program(dir: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cullmark"));
    command.current_dir(dir).env("CULLMARK_LANE", dir.join("lane"));
    command.env_remove("CULLMARK_TOKEN").env_remove("CULLMARK_SERVER");
    command
}

/// The program run to its end.
pub fn cullmark(dir: &Path, words: &[&str]) -> Output {
    program(dir).args(words).output().unwrap()
}

pub fn shown(out: &Output) -> String {
    format!("{}\n{}{}", out.status, String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr))
}

/// How one speaks to a server.
#[derive(Clone)]
pub struct Client {
    /// `127.0.0.1:PORT`
    pub address: String,
    agent: ureq::Agent,
    token: Option<String>,
}

impl Client {
    pub fn new(address: &str) -> Client {
        let config = ureq::Agent::config_builder().http_status_as_error(false);
        // A server that refuses a body unread closes the connection.
        let config = config.timeout_global(Some(Duration::from_secs(60))).max_idle_connections(0);
        Client { address: address.to_string(), agent: config.build().into(), token: None }
    }

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    pub fn with_token(&self, token: &str) -> Client {
        Client { token: Some(token.to_string()), ..self.clone() }
    }

    /// `path` as written, from the root.
    pub fn send(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Reply {
        let mut request = ureq::http::Request::builder().method(method).uri(format!("{}{path}", self.url()));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        if let Some(token) = &self.token {
            request = request.header("authorization", format!("Bearer {token}"));
        }
        let answer = if body.is_empty() && method != "POST" {
            self.agent.run(request.body(()).unwrap())
        } else {
            self.agent.run(request.body(body.to_vec()).unwrap())
        };
        let mut answer = answer.unwrap_or_else(|e| panic!("{method} {path}: {e}"));
        let headers = answer.headers().iter();
        let headers = headers.map(|(n, v)| (n.to_string(), v.to_str().unwrap().to_string())).collect();
        let status = answer.status().as_u16();
        let body = answer.body_mut().with_config().limit(1 << 28).read_to_vec();
        Reply { status, headers, body: body.unwrap_or_else(|e| panic!("{method} {path}: {e}")) }
    }

    /// Below `/api/v1`.
    pub fn get(&self, path: &str) -> Reply {
        self.send("GET", &format!("/api/v1{path}"), &[], b"")
    }

    pub fn json(&self, path: &str) -> Value {
        self.get(path).with(200).json()
    }

    pub fn post(&self, path: &str, body: &Value) -> Reply {
        let kind = [("content-type", "application/json")];
        self.send("POST", &format!("/api/v1{path}"), &kind, body.to_string().as_bytes())
    }

    pub fn patch(&self, path: &str, body: &Value) -> Reply {
        let kind = [("content-type", "application/json")];
        self.send("PATCH", &format!("/api/v1{path}"), &kind, body.to_string().as_bytes())
    }

    pub fn delete(&self, path: &str) -> Reply {
        self.send("DELETE", &format!("/api/v1{path}"), &[], b"")
    }

    pub fn submit(&self, manifest: &str) -> Value {
        self.post("/studies", &json!({ "manifest": manifest })).with(201).json()
    }

    pub fn upload(&self, kind: &str, name: &str, body: &[u8]) -> Reply {
        let path = format!("/api/v1/uploads?kind={kind}&name={name}");
        self.send("POST", &path, &[("content-type", "application/octet-stream")], body)
    }

    /// Server-sent events until `on` has heard enough; false when the stream ended before.
    pub fn events(&self, study: &str, mut on: impl FnMut(&str, Value) -> bool) -> bool {
        let request = self.agent.get(format!("{}/api/v1/studies/{study}/events", self.url()));
        let response = request.call().unwrap();
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        let (mut event, mut data) = (String::new(), String::new());
        for line in BufReader::new(response.into_body().into_reader()).lines() {
            let Ok(line) = line else { return false };
            if let Some(name) = line.strip_prefix("event: ") {
                event = name.to_string();
            } else if let Some(text) = line.strip_prefix("data: ") {
                data = text.to_string();
            } else if line.is_empty() && !event.is_empty() {
                if on(&event, serde_json::from_str(&data).unwrap()) {
                    return true;
                }
                event.clear();
            }
        }
        false
    }

    /// What the study reads when it is finished.
    pub fn finished(&self, study: &str) -> Value {
        until(&format!("{study} is finished"), || {
            Some(self.json(&format!("/studies/{study}"))).filter(|s| s["finished"] == true)
        })
    }
}

/// Bytes over a plain socket, for what no well-behaved client sends. The request is
/// written while the answer is awaited: a server may refuse before it has read all.
pub fn raw(address: &str, request: &[u8]) -> Reply {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let (mut writer, request) = (stream.try_clone().unwrap(), request.to_vec());
    let sent = std::thread::spawn(move || writer.write_all(&request));
    let (mut answer, mut piece) = (Vec::new(), [0; 4096]);
    while let Ok(n @ 1..) = stream.read(&mut piece) {
        answer.extend_from_slice(&piece[..n]);
    }
    let _ = sent.join().unwrap();
    let end = answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap_or_else(|| panic!("no answer: {answer:?}"));
    let head = String::from_utf8_lossy(&answer[..end]).into_owned();
    let mut lines = head.lines();
    let status = lines.next().and_then(|l| l.split(' ').nth(1)).and_then(|s| s.parse().ok()).unwrap();
    let headers = lines.filter_map(|l| l.split_once(": ")).map(|(n, v)| (n.to_string(), v.to_string())).collect();
    Reply { status, headers, body: answer[end + 4..].to_vec() }
}

pub struct Server {
    folder: tempfile::TempDir,
    child: Child,
    client: Client,
}

impl std::ops::Deref for Server {
    type Target = Client;
    fn deref(&self) -> &Client {
        &self.client
    }
}

/// Of a program whose first line is to come: the address it listens on.
pub fn address_of(child: &mut Child) -> String {
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening on http://");
    address.unwrap_or_else(|| panic!("the server does not listen: `{line}`")).to_string()
}

impl Server {
    pub fn start() -> Server {
        Server::with(&[])
    }

    /// A furnished folder, offered by `--scenes .`, and further flags.
    pub fn with(flags: &[&str]) -> Server {
        let folder = tempfile::tempdir().unwrap();
        furnish(folder.path());
        Server::within(folder, flags)
    }

    pub fn within(folder: tempfile::TempDir, flags: &[&str]) -> Server {
        Server::offering(folder, ".", flags)
    }

    /// Manifests may name what lies below `scenes`, a folder in `folder`.
    pub fn offering(folder: tempfile::TempDir, scenes: &str, flags: &[&str]) -> Server {
        let log = std::fs::File::create(folder.path().join("log")).unwrap();
        let mut command = program(folder.path());
        command.args(["serve", "--listen", "127.0.0.1:0", "--db", "x.db", "--scenes", scenes]).args(flags);
        let mut child = command.stdout(Stdio::piped()).stderr(log).spawn().unwrap();
        let client = Client::new(&address_of(&mut child));
        Server { folder, child, client }
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    pub fn log(&self) -> String {
        std::fs::read_to_string(self.path().join("log")).unwrap()
    }

    /// The program in the folder of the server, with its address at hand.
    pub fn verb(&self, words: &[&str]) -> Output {
        program(self.path()).env("CULLMARK_SERVER", self.url()).args(words).output().unwrap()
    }

    /// Asks it to end, and waits; its folder is left.
    pub fn terminate(mut self) -> (tempfile::TempDir, std::process::ExitStatus) {
        let folder = std::mem::replace(&mut self.folder, tempfile::tempdir().unwrap());
        Command::new("kill").args(["-TERM", &self.child.id().to_string()]).status().unwrap();
        let status = until("the server ends", || self.child.try_wait().unwrap());
        (folder, status)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
