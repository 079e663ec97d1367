//! The hidden verbs that a server drives, as real child processes.

use super::{Form, Frame, rooms, run_spec};
use cullmark::record::{PathSource, RunSpec, SceneSource};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

fn start(verb: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_cullmark"))
        .arg(verb)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// One document in, one out, and the exit code.
fn once(verb: &str, input: &str) -> (Value, i32) {
    let mut child = start(verb);
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let out = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&out.stderr);
    let text = String::from_utf8(out.stdout).unwrap();
    (serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}{told}")), out.status.code().unwrap())
}

/// A conversation with `cullmark view`.
struct Talk {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: BufReader<ChildStdout>,
}

impl Talk {
    fn open(first: &Value) -> (Talk, Result<Vec<u8>, Value>) {
        let mut child = start("view");
        let stdin = child.stdin.take();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        let mut talk = Talk { child, stdin, stdout };
        let reply = talk.say(first.to_string().as_bytes());
        (talk, reply)
    }

    fn say(&mut self, line: &[u8]) -> Result<Vec<u8>, Value> {
        let stdin = self.stdin.as_mut().unwrap();
        stdin.write_all(line).unwrap();
        stdin.write_all(b"\n").unwrap();
        let mut head = String::new();
        self.stdout.read_line(&mut head).unwrap();
        let head: Value = serde_json::from_str(&head).unwrap();
        if head["error"].is_object() {
            return Err(head["error"].clone());
        }
        let mut body = vec![0; head["bytes"].as_u64().unwrap() as usize];
        self.stdout.read_exact(&mut body).unwrap();
        Ok(body)
    }

    fn ask(&mut self, request: Value) -> Result<Vec<u8>, Value> {
        self.say(request.to_string().as_bytes())
    }

    /// What it ends with when nothing more is asked.
    fn end(mut self) -> i32 {
        drop(self.stdin.take());
        let mut rest = Vec::new();
        self.stdout.read_to_end(&mut rest).unwrap();
        assert!(rest.is_empty(), "nothing follows the last reply");
        self.child.wait().unwrap().code().unwrap()
    }
}

fn opening(spec: Option<&RunSpec>, cache: &Path) -> Value {
    json!({ "spec": spec, "scene": null, "cache_dir": cache, "memory_limit_mib": 4096 })
}

#[test]
fn a_run_is_shown_until_nothing_more_is_asked_and_mistaken_requests_end_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let spec = run_spec("octree:depth=3", "frustum+octant_mask", "depth_first", 4);
    let (mut talk, opened) = Talk::open(&opening(Some(&spec), folder.path()));
    assert!(opened.unwrap().is_empty());

    let about: Value = serde_json::from_slice(&talk.ask(json!({ "ask": "about" })).unwrap()).unwrap();
    assert_eq!((&about["frames"], &about["tests"]), (&4.into(), &json!(["frustum", "octant_mask"])));
    let mesh = talk.ask(json!({ "ask": "mesh" })).unwrap();
    assert_eq!(u64::from(Form::new(&mesh, b"CMSH").words(2)[1]), about["triangles"].as_u64().unwrap());
    let nodes = talk.ask(json!({ "ask": "nodes" })).unwrap();
    assert_eq!(u64::from(Form::new(&nodes, b"CMND").word()), about["nodes"].as_u64().unwrap());

    let first = talk.ask(json!({ "ask": "frame", "frame": 0, "truth": false })).unwrap();
    for (line, said) in [
        (&b"{\"ask\": \"frame\", \"frame\": 4}"[..], "from 0 to 3"),
        (b"{\"ask\": \"frame\", \"frame\": 18446744073709551615}", "from 0 to 3"),
        (b"{\"ask\": \"frame\", \"frame\": -1}", "cannot be read"),
        (b"{\"ask\": \"frame\"}", "say which frame"),
        (b"{\"ask\": \"frames\", \"frame\": 1}", "did you mean `frame`?"),
        (b"{\"ask\": \"world\"}", "about, mesh, nodes, frame"),
        (b"{\"ask\": \"about\", \"truht\": true}", "truht"),
        (b"{\"ask\": ", "cannot be read"),
        (b"[]", "cannot be read"),
        (b"\xff\xfe\x00", "cannot be read"),
    ] {
        let e = talk.say(line).unwrap_err();
        assert!(format!("{} {}", e["message"], e["help"]).contains(said), "{e}");
    }
    assert!(talk.say(b"\n{\"ask\": \"frame\", \"frame\": 0}").unwrap() == first, "blank lines are nothing");
    let judged = Frame::read(&talk.ask(json!({ "ask": "frame", "frame": 3, "truth": true })).unwrap());
    assert!(judged.truth && judged.visible > 0);
    assert_eq!(talk.end(), 0);
}

#[test]
fn a_scene_alone_is_shown_without_frames() {
    let folder = tempfile::tempdir().unwrap();
    let (mut talk, opened) = Talk::open(&json!({ "scene": rooms(), "cache_dir": folder.path() }));
    assert!(opened.unwrap().is_empty());
    let about: Value = serde_json::from_slice(&talk.ask(json!({ "ask": "about" })).unwrap()).unwrap();
    assert_eq!((&about["frames"], &about["camera"]["near_m"]), (&0.into(), &0.1.into()));
    assert!(talk.ask(json!({ "ask": "mesh" })).unwrap().starts_with(b"CMSH"));
    for ask in ["nodes", "frame"] {
        let e = talk.ask(json!({ "ask": ask, "frame": 0 })).unwrap_err();
        assert!(e["message"].as_str().unwrap().contains("a scene alone"), "{e}");
    }
    assert_eq!(talk.end(), 0);
}

#[test]
fn what_cannot_be_opened_is_an_error_with_exit_code_1() {
    let folder = tempfile::tempdir().unwrap();
    let mut gone = run_spec("octree:depth=3", "frustum", "depth_first", 1);
    gone.scene.source = SceneSource::File(folder.path().join("gone.obj"));
    gone.scene.fingerprint = "0".repeat(32);
    let good = run_spec("list", "none", "flat", 1);
    let both = json!({ "spec": good, "scene": good.scene, "cache_dir": folder.path() });
    for (first, said) in [
        (opening(Some(&gone), folder.path()), "gone.obj"),
        (opening(None, folder.path()), "one of `spec` and `scene`"),
        (both, "one of `spec` and `scene`"),
        (json!({ "spec": { "scene": 1 }, "cache_dir": "x" }), "cannot be read"),
        (json!("open"), "cannot be read"),
    ] {
        let (talk, opened) = Talk::open(&first);
        let e = opened.unwrap_err();
        assert!(format!("{} {}", e["message"], e["help"]).contains(said), "{e}");
        assert_eq!(talk.end(), 1);
    }
}

#[test]
fn uploads_are_counted_doubted_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let examine = |kind: &str, name: &str, text: &str| {
        let file = folder.path().join(name);
        std::fs::write(&file, text).unwrap();
        once("examine", &json!({ "kind": kind, "file": file, "memory_limit_mib": 2048 }).to_string())
    };
    const QUAD: &str = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nf 1 2 3\nf 1 3 4\n";
    let (told, code) = examine("scene", "a.obj", &format!("{QUAD}f 1 1 2\nv nan 0 0\nf 1 2 5\n"));
    assert_eq!((code, &told["ok"]["triangles"], &told["ok"]["frames"]), (0, &2.into(), &Value::Null));
    let notes = told["ok"]["notes"].to_string();
    assert!(notes.contains("1 of 4 faces without area were left out") && notes.contains("NaN"), "{notes}");
    assert!(!notes.contains("dropped faces"), "said once: {notes}");

    let csv = "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n0,2,2,3,0,0,-1,0,1,0\n1,2.5,2,3,0,0,-1,0,1,0\n";
    let (told, code) = examine("path", "p.csv", csv);
    assert_eq!((code, told), (0, json!({ "ok": { "triangles": null, "frames": 2, "notes": [] } })));

    let glued = r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"../../etc/passwd","byteLength":36}]}"#;
    for (kind, name, text, said) in [
        ("scene", "b.obj", "v 0 0 0\nv 1 0 0\nf 1 2", "b.obj:3"),
        ("scene", "c.obj", "v 0 0 0\n", "no triangles"),
        ("scene", "d.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "none of the 1 triangles"),
        ("scene", "e.txt", QUAD, ".obj, .gltf, .glb"),
        ("scene", "f.glb", "glTF nonsense", "f.glb"),
        ("scene", "g.gltf", glued, "export it as .glb"),
        ("scene", "h.obj", &format!("mtllib /etc/hosts\n{QUAD}"), "in another folder"),
        ("path", "q.csv", "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n", "no frames"),
        ("path", "r.csv", "0,1,2\n", "r.csv:1"),
        ("world", "s.csv", csv, "cannot be read"),
    ] {
        let (told, code) = examine(kind, name, text);
        let said_it = format!("{} {}", told["error"]["message"], told["error"]["help"]).contains(said);
        assert!(code == 1 && said_it, "{name}: {code} {told}");
    }
    let (told, code) = once("examine", "not json");
    assert!(code == 1 && told["error"]["help"].is_string(), "{told}");
}

#[test]
fn preflight_lists_every_mistake_by_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let request = |runs: &[RunSpec]| json!({ "runs": runs, "cache_dir": folder.path() }).to_string();
    let good = run_spec("list", "none", "flat", 1);
    assert_eq!(once("preflight", &request(std::slice::from_ref(&good))), (json!({ "ok": [] }), 0));

    let path = folder.path().join("p.csv");
    std::fs::write(&path, "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n0,1,2,3,0,0,x,0,1,0\n").unwrap();
    let mut bad = good.clone();
    bad.path.source = PathSource::File(path);
    bad.path.fingerprint = cullmark::scene::walkthrough::fingerprint(&bad.path.source, &bad.scene.fingerprint).unwrap();
    let mut gone = good.clone();
    gone.scene.source = SceneSource::File(folder.path().join("gone.obj"));
    gone.scene.fingerprint = "1".repeat(32);
    let (told, code) = once("preflight", &request(&[good, bad, gone]));
    let errors = told["errors"].as_array().unwrap();
    assert_eq!((code, errors.len()), (1, 2), "{told}");
    assert!(errors[0]["file"].as_str().unwrap().ends_with("p.csv") && errors[0]["line"] == 2, "{told}");
    assert!(errors[0]["column"].is_u64() && errors[0].as_object().unwrap().contains_key("help"), "{told}");
    assert!(errors[1]["file"].as_str().unwrap().ends_with("gone.obj"), "{told}");
    let (told, code) = once("preflight", "{}");
    assert!(code == 1 && told["errors"][0]["message"].as_str().unwrap().contains("runs"), "{told}");
}
