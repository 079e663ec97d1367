//! `cullmark inspect` from outside: what it prints, writes and refuses.

use std::path::Path;
use std::process::{Command, Output};

/// A wall of two triangles ahead and one behind the eye, and a path of two frames.
fn fixture(dir: &Path) {
    let obj = "v 5 -1 -1\nv 5 1 -1\nv 5 1 1\nv 5 -1 1\nv -5 -1 0\nv -5 1 0\nv -5 0 1\n\
               f 2 1 4\nf 2 4 3\nf 5 6 7\n";
    std::fs::write(dir.join("walls.obj"), obj).unwrap();
    let csv = "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n0,0,0,0,1,0,0,0,0,1\n1,0,0,0,-1,0,0,0,0,1\n";
    std::fs::write(dir.join("walls.csv"), csv).unwrap();
}

fn inspect(dir: &Path, more: &[&str]) -> Output {
    let common = ["inspect", "--scene", "walls.obj", "--up", "z", "--path", "walls.csv", "--width", "320"];
    Command::new(env!("CARGO_BIN_EXE_cullmark")).current_dir(dir).args(common).args(more).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn inspect_prints_counts_and_dumps_each_id_once_ascending() {
    let dir = tempfile::tempdir().unwrap();
    fixture(dir.path());
    let method = ["--structure", "octree:depth=2,policy=R", "--culling", "frustum"];
    for (frame, ids) in [("0", "0\n1\n"), ("1", "2\n")] {
        let files = ["--frame", frame, "--dump-submitted", "ids.txt", "--image", "frame.png"];
        let out = inspect(dir.path(), &[&method[..], &files[..]].concat());
        assert!(out.status.success(), "{}", text(&out.stderr));
        assert_eq!(std::fs::read_to_string(dir.path().join("ids.txt")).unwrap(), ids);
        assert!(text(&out.stdout).contains("right for a conservative method"));
        let png = std::fs::read(dir.path().join("frame.png")).unwrap();
        assert!(png.starts_with(b"\x89PNG") && png.len() > 1000);
    }
    let out = inspect(dir.path(), &[&method[..], &["--frame", "0", "--json"]].concat());
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(json["errors"]["submitted"], 2);
    assert_eq!(json["errors"]["visible"], 2);
    assert_eq!(json["class"], "conservative");
    assert!(json["counters"]["plane_tests"].as_u64().unwrap() > 0);
}

#[test]
fn inspect_takes_an_arithmetic_and_a_place() {
    let dir = tempfile::tempdir().unwrap();
    fixture(dir.path());
    let method = ["--structure", "octree:depth=2,policy=R", "--culling", "frustum", "--frame", "0", "--json"];
    let json = |more: &[&str]| -> serde_json::Value {
        let out = inspect(dir.path(), &[&method[..], more].concat());
        assert!(out.status.success(), "{}", text(&out.stderr));
        serde_json::from_slice(&out.stdout).unwrap()
    };
    let far = json(&["--arithmetic", "f64", "--offset-m", "7e3"]);
    assert!(far["culling"].as_str().unwrap().contains("arithmetic=f64"), "{}", far["culling"]);
    assert_eq!(far["pose"]["eye"], serde_json::json!([6000.0, -3000.0, 2000.0]));
    assert_eq!(json(&["--offset-m=-1,2,3"])["pose"]["eye"], serde_json::json!([-1.0, 2.0, 3.0]));
    assert_eq!(far["errors"]["submitted"], 2);
}

#[test]
fn inspect_shows_the_bracket_where_it_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    fixture(dir.path());
    let method = ["--frame", "0", "--structure", "list", "--culling", "none"];
    let plain = text(&inspect(dir.path(), &method).stdout);
    assert!(!plain.contains("bracket"), "{plain}");
    let asked = [&method[..], &["--witness-rays", "8", "--hiding-cells", "16"]].concat();
    let lines = text(&inspect(dir.path(), &asked).stdout);
    assert!(
        lines.contains("bracket    2 to 2 visible: 0 more seen by rays (8 a triangle), 0 proved hidden"),
        "{lines}"
    );
    assert!(lines.contains("in vain    1 to 1 of what is submitted"), "{lines}");
    let out = inspect(dir.path(), &[&asked[..], &["--json"]].concat());
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!((&json["hiding_cells"], &json["errors"]["visible_hi"]), (&16.into(), &2.into()));
    assert_eq!((&json["observed_class"], &json["errors"]["submitted_invisible"]), (&"exact".into(), &1.into()));
}

#[test]
fn inspect_says_what_is_wrong_and_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    fixture(dir.path());
    for (arguments, sentence) in [
        (&["--frame", "2", "--structure", "list"][..], "walls.csv has 2 frames"),
        (&["--frame", "2", "--structure", "list"], "choose a frame from 0 to 1"),
        (&["--frame", "0", "--structure", "octre"], "did you mean `octree`?"),
        (&["--frame", "0", "--structure", "octree:dept=3"], "did you mean `depth`?"),
        (&["--frame", "0", "--structure", "list", "--culling", "frustrum"], "did you mean `frustum`?"),
        (&["--frame", "0", "--structure", "list", "--walk", "flatt"], "did you mean `flat`?"),
        (&["--frame", "0", "--structure", "list", "--near-m", "0"], "--near-m"),
        (&["--frame", "0", "--structure", "list", "--far-m", "0.05"], "beyond the near plane"),
        (&["--frame", "0", "--structure", "list", "--fov-y-deg", "180"], "below 180 degrees"),
        (&["--frame", "0", "--structure", "list", "--aspect", "wide"], "16:9"),
        (&["--frame", "0", "--structure", "list", "--arithmetic", "f63"], "did you mean `f64`?"),
        (&["--frame", "0", "--structure", "list", "--offset-m", "1,2"], "three numbers X,Y,Z"),
        (&["--frame", "0", "--structure", "list", "--dump-submitted", "no/such/folder"], "no/such/folder"),
        (&["--frame", "0", "--structure", "list", "--image", "no/such/folder.png"], "no/such/folder.png"),
        (&["--frame", "0", "--structure", "list", "--scene", "missing.obj"], "cannot be used multiple times"),
    ] {
        let out = inspect(dir.path(), arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {}", text(&out.stdout));
        assert!(text(&out.stderr).contains(sentence), "{arguments:?}: {}", text(&out.stderr));
    }
}
