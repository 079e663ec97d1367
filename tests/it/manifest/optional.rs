//! Scenes and paths that a study can go without, and folders named by variables.

use super::{Folder, HEAD, MATRIX_LINES};

const OPTIONAL: &str = r#"
[[scene]]
name = "far_away"
file = "no/such/scene.obj"
optional = true
[[path]]
name = "there"
scene = "far_away"
file = "no/such/path.csv"
optional = true
"#;

#[test]
fn an_optional_scene_that_is_not_there_is_left_out_with_a_reason() {
    let (manifest, matrix) = Folder::new().read(&format!("{HEAD}{OPTIONAL}{MATRIX_LINES}"), &[]).unwrap();
    assert_eq!(manifest.scenes.len(), 2);
    assert_eq!(manifest.absent.len(), 1);
    let (name, why) = &manifest.absent[0];
    assert!(name == "far_away" && why.contains("does not exist"), "{why}");
    let left = matrix.excluded.iter().find(|e| e.cell == "far_away").expect("the report says it, too");
    assert_eq!((left.count, matrix.runs.len()), (2, 4), "as many runs as another scene has");
}

#[test]
fn an_optional_scene_that_is_there_is_a_scene() {
    let folder = Folder::new();
    folder.write("no/such/scene.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("no/such/path.csv", "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n0,0,0,1,1,0,0,0,0,1\n");
    let (manifest, matrix) = folder.read(&format!("{HEAD}{OPTIONAL}{MATRIX_LINES}"), &[]).unwrap();
    assert!(manifest.absent.is_empty() && manifest.scenes.len() == 3);
    assert_eq!(matrix.runs.iter().filter(|r| r.scene.name == "far_away").count(), 4, "two paths, two structures");
}

#[test]
fn a_study_whose_scenes_are_all_away_says_so() {
    let text = format!("[study]\nname = \"t\"\n{OPTIONAL}{MATRIX_LINES}");
    let errors = Folder::new().read(&text, &[]).unwrap_err();
    assert_eq!(errors.len(), 1, "{errors:?}");
    assert!(errors[0].message.contains("no scene of the study is there: `far_away`"), "{}", errors[0]);
    assert!(errors[0].help.as_deref().unwrap().contains("variable"));
}

#[test]
fn a_variable_that_is_not_set_is_named() {
    let text = format!("{HEAD}{OPTIONAL}{MATRIX_LINES}")
        .replace("no/such/scene.obj", "$CULLMARK_TEST_NOWHERE/scene.obj")
        .replace("optional = true\n[[path]]", "[[path]]");
    let errors = Folder::new().read(&text, &[]).unwrap_err();
    let e = errors.iter().find(|e| e.message.contains("CULLMARK_TEST_NOWHERE is not set")).expect("it is named");
    assert!(e.line.is_some() && e.key.as_deref() == Some("scene.2.file"), "{e}");
    assert!(e.help.as_deref().unwrap().contains("export CULLMARK_TEST_NOWHERE="));
}
