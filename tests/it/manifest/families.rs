//! Swept scenes and paths: how they are named, found, placed and selected.

use super::{Folder, cells};
use cullmark::Error;
use cullmark::manifest::Manifest;
use cullmark::matrix::{Matrix, labels};
use cullmark::record::{PathSource, SceneSource};

const STUDY: &str = "[study]\nname = \"t\"\n";
const PATH: &str = "[[path]]\nname = \"w\"\nfile = \"w.csv\"\n";
const MATRIX: &str = "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\n";

fn read(text: &str) -> (Manifest, Matrix) {
    let read = Folder::new().read(&format!("{STUDY}{text}"), &[]);
    read.unwrap_or_else(|errors| panic!("{}", errors.iter().map(Error::to_string).collect::<Vec<_>>().join("\n")))
}

fn scenes(manifest: &Manifest) -> Vec<&str> {
    manifest.scenes.iter().map(|s| s.name.as_str()).collect()
}

fn scene(keys: &str) -> String {
    format!("[[scene]]\nname = \"hall\"\ngenerate = \"rooms:world=1\"\n{keys}\n{PATH}{MATRIX}")
}

#[test]
fn lists_and_ranges_of_a_scene_are_scenes() {
    let (manifest, m) =
        read(&scene("offset_m = [0, { from = 1, to = 1e6, steps = 4, scale = \"log\" }]\nscale = [1, 0.5]"));
    let names = [
        "hall@scale=1@offset_m=0",
        "hall@scale=1@offset_m=1",
        "hall@scale=1@offset_m=100",
        "hall@scale=1@offset_m=1e4",
        "hall@scale=1@offset_m=1e6",
    ];
    assert_eq!(scenes(&manifest)[..5], names);
    assert_eq!(scenes(&manifest)[5], "hall@scale=0.5@offset_m=0");
    let prints: std::collections::HashSet<&str> = manifest.scenes.iter().map(|s| s.fingerprint.as_str()).collect();
    assert_eq!(prints.len(), 10, "every place is a scene of its own");
    let number = |i: usize, name: &str| m.runs[i].number(name);
    assert_eq!([0, 1, 2, 3, 4].map(|i| number(i, "scene.offset_m").unwrap()), [0.0, 1.0, 100.0, 1e4, 1e6]);
    assert_eq!(number(9, "scene.scale"), Some(0.5));
    let [x, y, z] = manifest.scenes[3].offset_m;
    assert_eq!([x, y, z], [6e4 / 7.0, -3e4 / 7.0, 2e4 / 7.0]);
}

#[test]
fn a_vector_moves_as_it_says_and_one_value_is_no_family() {
    let (manifest, m) = read(&scene("offset_m = { x = 3e3, z = -4e3 }"));
    assert_eq!(scenes(&manifest), ["hall"]);
    assert_eq!(manifest.scenes[0].offset_m, [3e3, 0.0, -4e3]);
    assert_eq!(m.runs[0].number("scene.offset_m"), Some(5e3));
    let (manifest, _) = read(&scene("offset_m = [{ y = 1 }, { y = 2 }]"));
    assert_eq!(scenes(&manifest), ["hall@offset_m=0_1_0", "hall@offset_m=0_2_0"]);
    let (manifest, _) = read(&scene("offset_m = [1e3]"));
    assert_eq!(scenes(&manifest), ["hall"]);
}

#[test]
fn parameters_of_generators_are_swept_too() {
    let (manifest, m) = read(&format!(
        "[[scene]]\nname = \"hall\"\ngenerate = {{ kind = \"rooms\", world = [1, 2] }}\n[[path]]\nname = \"v\"\ngenerate = {{ kind = \"static\", frames = 2, yaw_deg = {{ from = 0, to = 90, steps = 3 }} }}\n{MATRIX}"
    ));
    assert_eq!(scenes(&manifest), ["hall@world=1", "hall@world=2"]);
    let paths: Vec<&str> = manifest.paths[1].iter().map(|p| p.name.as_str()).collect();
    assert_eq!(paths, ["v@yaw_deg=0", "v@yaw_deg=45", "v@yaw_deg=90"]);
    assert_eq!(m.runs.len(), 6);
    let run = &m.runs[4];
    assert_eq!((labels(run).scene.as_str(), labels(run).path.as_str()), ("hall@world=2", "v@yaw_deg=45"));
    assert_eq!((run.number("path.yaw_deg"), run.number("scene.world")), (Some(45.0), Some(2.0)));
    assert!(matches!(&run.scene.source, SceneSource::Generated(s) if s.params["world"].to_string() == "2"));
    assert!(matches!(&run.path.source, PathSource::Generated(s) if s.float("yaw_deg") == 45.0));
}

#[test]
fn a_plain_name_selects_its_family() {
    let other = "[[scene]]\nname = \"yard\"\ngenerate = \"rooms:world=2\"\n";
    let hall = "[[scene]]\nname = \"hall\"\ngenerate = \"rooms:world=1\"\noffset_m = [1, 1e3, 1e6]\n";
    let run = |rest: &str| cells(&read(&format!("{hall}{other}{PATH}{rest}")).1).len();
    assert_eq!(run(MATRIX), 4);
    for (scene, count) in [("hall", 3), ("hall@*", 3), ("yard", 1), ("hall@offset_m=1e3", 1), ("*", 4), ("h*", 3)] {
        assert_eq!(run(&format!("{MATRIX}scene = \"{scene}\"\n")), count, "{scene}");
        let rule = format!("{MATRIX}[[include]]\nstructure = \"octree\"\nscene = \"{scene}\"\n");
        assert_eq!(run(&rule), 4 + count, "{scene}");
    }
    let rule = format!("{MATRIX}[[exclude]]\nscene = \"hall\"\nwhy = \"x\"\n");
    assert_eq!(run(&rule), 1);
    let path = "[[path]]\nname = \"u\"\nfile = \"w.csv\"\nscene = \"hall\"\n";
    assert_eq!(run(&format!("{path}{MATRIX}")), 4 + 3);
    assert_eq!(run(&format!("{path}{MATRIX}path = \"u\"\nscene = \"hall\"\n")), 3);
    let path = path.replace("\"hall\"", "[\"hall@offset_m=1\", \"yard\"]");
    assert_eq!(run(&format!("{path}{MATRIX}")), 4 + 2);
}
