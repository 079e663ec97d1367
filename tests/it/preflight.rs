//! What `run` says of scene files and paths before anything runs: the real program on real files.

use std::path::Path;
use std::process::{Command, Output};

/// A floor facing up, 4 m x 4 m, and a camera 3 m above it that looks down.
const FLOOR: &str = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nf 1 2 3\nf 1 3 4\n";
const HEADER: &str = "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n";
const LOOK_DOWN: &str = "0,2,2,3,0,0,-1,0,1,0\n1,2.5,2,3,0,0,-1,0,1,0\n";

fn run(mesh: &str, path: &str, more: &[&str]) -> (tempfile::TempDir, Output) {
    let dir = tempfile::tempdir().unwrap();
    let manifest = "[study]\nname = \"s\"\n[measure]\nrepeats = 1\n[accuracy]\nframes = 1\nwidth_px = 32\n\
        height_px = 18\n[[scene]]\nname = \"floor\"\nfile = \"floor.obj\"\nup = \"z\"\n[[path]]\nname = \"p\"\n\
        file = \"p.csv\"\n[matrix]\nstructure = [\"list\"]\nculling = [\"frustum\"]\n";
    for (name, text) in [("floor.obj", mesh), ("p.csv", path), ("s.toml", manifest)] {
        std::fs::write(dir.path().join(name), text).unwrap();
    }
    let out = again(dir.path(), more);
    (dir, out)
}

fn again(folder: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cullmark"));
    command.current_dir(folder).env("CULLMARK_LANE", folder.join("lane"));
    command.args(["run", "s.toml", "--db", "x.db", "--no-report"]).args(more).output().unwrap()
}

fn said(out: &Output) -> String {
    String::from_utf8_lossy(&out.stderr).into_owned()
}

#[test]
fn a_truncated_mesh_and_an_empty_path_are_mistakes_with_their_line_before_anything_runs() {
    let (dir, out) = run("v 0 0 0\nv 1 0 0\nf 1 2", &[HEADER, LOOK_DOWN].concat(), &[]);
    assert_eq!(out.status.code(), Some(2), "{}", said(&out));
    assert!(said(&out).contains("floor.obj:3: ") && said(&out).contains("nothing was run"), "{}", said(&out));
    drop(dir);
    let (_dir, out) = run(FLOOR, HEADER, &[]);
    assert_eq!(out.status.code(), Some(2), "{}", said(&out));
    assert!(said(&out).contains("p.csv:1: ") && said(&out).contains("no frames"), "{}", said(&out));
}

#[test]
fn faces_that_are_left_out_are_told_each_time() {
    let mesh = format!("{FLOOR}v nan 0 0\nf 1 2 5\nf 1 1 2\n");
    let (dir, out) = run(&mesh, &[HEADER, LOOK_DOWN].concat(), &[]);
    assert_eq!(out.status.code(), Some(0), "{}", said(&out));
    for text in [said(&out), said(&again(dir.path(), &[]))] {
        assert!(text.contains("floor: 1 of 4 faces with NaN or infinite coordinates were left out"), "{text}");
        assert!(text.contains("floor: 1 of 4 faces without area were left out"), "{text}");
    }
}

#[test]
fn a_wrong_winding_is_doubted_from_the_path_and_a_right_one_is_not() {
    let path = [HEADER, LOOK_DOWN].concat();
    let (dir, out) = run(FLOOR, &path, &[]);
    assert!(!said(&out).contains("winding"), "{}", said(&out));
    let out = again(dir.path(), &["--set", "scene.0.winding=\"cw\""]);
    assert!(said(&out).contains("winding looks wrong"), "{}", said(&out));
}
