//! One server that many tests read from.

use super::server::{Client, address_of, forget, furnish, study};
use crate::common::town;
use serde_json::json;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::LazyLock;

/// One server for all tests that only read: `town@0` and its rerun `town@1`, both
/// finished; `late@0`, whose runs all failed; `held@0`, paused before it began; a scene
/// `town.obj` and a path `walk.csv` as uploads. It ends with this process.
pub struct Shared {
    pub client: Client,
    pub dir: PathBuf,
    /// Of the uploaded scene.
    pub scene: String,
    _alive: std::process::ChildStdin,
}

pub fn shared() -> &'static Shared {
    static SHARED: LazyLock<Shared> = LazyLock::new(Shared::new);
    &SHARED
}

impl Shared {
    fn new() -> Shared {
        let dir = tempfile::tempdir().unwrap().keep();
        furnish(&dir);
        // Statics are never dropped: a shell waits for the end of our side of a pipe.
        let script = "\"$@\" & server=$!; cat > /dev/null; kill -9 $server; wait $server; rm -rf \"$HERE\"";
        let mut shell = Command::new("sh");
        shell.current_dir(&dir).env("HERE", &dir).env("CULLMARK_LANE", dir.join("lane")).args(["-c", script, "sh"]);
        shell.args([env!("CARGO_BIN_EXE_cullmark"), "serve", "--listen", "127.0.0.1:0", "--db", "x.db"]);
        shell.args(["--scenes", ".", "--rate", "0"]).stdin(Stdio::piped()).stdout(Stdio::piped());
        shell.stderr(std::fs::File::create(dir.join("log")).unwrap());
        let mut shell = shell.spawn().unwrap();
        let client = Client::new(&address_of(&mut shell));

        let scene = client.upload("scene", "town.obj", &std::fs::read(dir.join("town.obj")).unwrap()).with(201).json();
        client.upload("path", "walk.csv", &std::fs::read(dir.join("walk.csv")).unwrap()).with(201);
        client.submit(&study("town"));
        client.finished("town@0");
        client.post("/studies/town/rerun", &json!({})).with(201);
        client.finished("town@1");
        client.post("/pool/pause", &json!({})).with(200);
        // Its scene is there when it is submitted, and gone when it is to be measured.
        std::fs::write(dir.join("late.obj"), town(3).0).unwrap();
        client.submit(&study("late").replace("\"town.obj\"", "\"late.obj\""));
        forget(&dir, "late.obj");
        client.post("/pool/resume", &json!({})).with(200);
        client.finished("late@0");
        client.post("/pool/pause", &json!({})).with(200);
        let held = ["measure.passes=3", "accuracy.frames=1"];
        client.post("/studies", &json!({ "manifest": study("held"), "set": held })).with(201);
        client.post("/studies/held/pause", &json!({})).with(200);
        client.post("/pool/resume", &json!({})).with(200);
        Shared { client, dir, scene: scene["id"].as_str().unwrap().to_string(), _alive: shell.stdin.take().unwrap() }
    }
}

impl std::ops::Deref for Shared {
    type Target = Client;
    fn deref(&self) -> &Client {
        &self.client
    }
}
