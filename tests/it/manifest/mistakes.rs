//! Every kind of mistake: where it is shown and what it advises.

use super::{Folder, HEAD};
use cullmark::Error;
use proptest::prelude::*;

/// Manifest, line, column, key, part of the message, part of the help.
pub type Case = (&'static str, u32, u32, &'static str, &'static str, &'static str);

/// Every case is tried before the test fails, so that all wrong ones are seen.
pub fn check(head: &str, cases: &[Case]) {
    let folder = Folder::new();
    folder.write("notes.txt", "x");
    folder.write("empty_dir.obj/x", "");
    let mut wrong = Vec::new();
    for (rest, line, column, key, message, help) in cases {
        let errors = match folder.read(&format!("{head}{rest}"), &[]) {
            Ok(_) => {
                wrong.push(format!("accepted:\n{rest}"));
                continue;
            }
            Err(errors) => errors,
        };
        let e = &errors[0];
        let right = errors.len() == 1
            && e.file.as_ref().is_some_and(|f| f.ends_with("m.toml"))
            && (e.line, e.column) == (Some(*line), Some(*column))
            && e.key.as_deref().unwrap_or_default() == *key
            && e.message.contains(message)
            && e.help.as_deref().unwrap_or_default().contains(help)
            && e.snippet.as_ref().is_some_and(|s| s.contains('^'));
        if !right {
            let said = errors.iter().map(Error::to_string).collect::<Vec<_>>().join("\n");
            wrong.push(format!("wanted {line}:{column} `{key}` {message:?} {help:?}, got\n{said}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n----\n"));
}

pub const MATRIX: &str = "[matrix]\nstructure = [\"list\"]\nculling = [\"none\"]\n";

#[test]
fn all_mistakes_are_told_at_once_in_the_order_of_the_text() {
    let text = "[study]\nname = \"t\"\ntitel = \"x\"\n[camera]\nfov_y_deg = 0\n[[scene]]\nname = \"a\"\nfile = \"no.obj\"\n[[path]]\nname = \"w\"\nfile = \"w.csv\"\n[matrix]\nstructure = [\"octre\", \"bsp:min_lef=3\", { kind = \"octree\", depth = [99, 98], rot = 1 }]\nculling = [\"frustrum\"]\n[[exclude]]\nculling = \"nrmal_mask\"\n";
    let errors = Folder::new().read(text, &["measure.repeats=many"]).unwrap_err();
    let places: Vec<(Option<u32>, &str)> =
        errors.iter().map(|e| (e.line, e.key.as_deref().unwrap_or_default())).collect();
    assert_eq!(
        places,
        [
            (Some(3), "study.titel"),
            (Some(5), "camera.fov_y_deg"),
            (Some(8), "scene.0.file"),
            (Some(13), "matrix.structure"),
            (Some(13), "matrix.structure"),
            (Some(13), "matrix.structure.depth"),
            (Some(13), "matrix.structure.depth"),
            (Some(13), "matrix.structure.rot"),
            (Some(14), "matrix.culling"),
            (Some(15), "exclude.0.why"),
            (Some(16), "exclude.0.culling"),
            (None, "measure.repeats"),
        ]
    );
}

#[test]
fn a_mistake_in_a_preset_or_a_set_names_that_text() {
    let folder = Folder::new();
    folder.write("presets/base.toml", "[measure]\nrepats = 3\n");
    let text = format!("extends = \"presets/base.toml\"\n{HEAD}{MATRIX}");
    let e = &folder.read(&text, &[]).unwrap_err()[0];
    assert!(e.file.as_ref().unwrap().ends_with("presets/base.toml") && e.line == Some(2), "{e}");
    let mut wrong = Vec::new();
    for (set, message, help) in [
        ("measure.repats=3", "unknown key", "`repeats`"),
        ("measure.repeats", "has no `=`", "write --set key=value"),
        ("measure..repeats=3", "empty key", "write --set"),
        ("measure.repeats=[1", "not a TOML value", "values are TOML"),
        ("measure.repeats=", "not a TOML value", "values are TOML"),
        ("measure.repeats=\"3\"", "whole number", "without quotes"),
        ("scene.7.name=x", "no entry `7`", "0 to 1 or named a, b"),
        ("scene.ab.name=x", "no entry `ab`", "`a`"),
        ("study.name.x=3", "holds no `x`", "as a whole"),
        ("scene.0.file=gone.obj", "beside `file`", "keep one"),
    ] {
        let Err(errors) = folder.read(&format!("{HEAD}{MATRIX}"), &[set]) else {
            wrong.push(format!("accepted {set}"));
            continue;
        };
        let e = &errors[0];
        let named = e.file.as_ref().unwrap().to_str().unwrap().contains(&format!("--set {set}"));
        let right = errors.len() == 1
            && (named || set.contains("file"))
            && e.message.contains(message)
            && e.help.as_deref().unwrap_or_default().contains(help)
            && e.snippet.as_ref().unwrap().contains('^');
        if !right {
            wrong.push(errors.iter().map(Error::to_string).collect::<Vec<_>>().join("\n"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n----\n"));
}

#[test]
fn an_unreadable_manifest_is_an_error_with_its_path() {
    let folder = Folder::new();
    let path = folder.write("m.toml", "").with_file_name("none.toml");
    let e = &cullmark::manifest::Manifest::load(&path, &[]).unwrap_err()[0];
    assert!(e.to_string().contains("none.toml: cannot read the manifest"), "{e}");
}

/// Pieces that manifests are made of, and rubbish.
fn fragment() -> impl Strategy<Value = String> {
    prop_oneof![
        Just("[matrix]\n".to_string()),
        Just("[[exclude]]\n".to_string()),
        Just("[[claim]]\n".to_string()),
        Just("structure = [{ kind = \"octree\", depth = { from = 1, to = 3, steps = 2 } }]\n".to_string()),
        Just("zip = [[\"structure\", \"culling\"]]\n".to_string()),
        Just("published = { a = [1, 2] }\nfor_each = \"scene\"\n".to_string()),
        Just("numerator = { culling = [\"frustum+*\", { kind = \"octree\", depth = [1] }] }\n".to_string()),
        "[a-z_.\\[\\]={}\",:+*0-9 \n]{0,40}",
        ".{0,12}",
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..Default::default() })]

    #[test]
    fn no_text_panics(parts in proptest::collection::vec(fragment(), 0..8), sets in proptest::collection::vec("[a-z.0-9=\\[\\]\"{}é ]{0,20}", 0..2)) {
        let folder = Folder::new();
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        let _ = folder.read(&parts.concat(), &sets);
        let _ = folder.read(&format!("{HEAD}{}", parts.concat()), &sets);
    }

    #[test]
    fn no_damaged_manifest_panics(cut in any::<prop::sample::Index>(), put in "[\\[\\]{}=\",.0-9aé\n-]{0,3}", gone in 0usize..6) {
        let whole = format!(
            "{HEAD}[camera]\nfov_y_deg = 60.5\n[matrix]\nstructure = [\"list\", {{ kind = \"octree\", depth = {{ from = 2, to = 4, steps = 2, scale = \"log\" }} }}]\nculling = [\"none\", \"frustum+normal_mask:cells=4\"]\nzip = [[\"structure\", \"culling\"]]\n[[include]]\nstructure = \"bsp\"\n[[exclude]]\nstructure = \"octree:depth>=4\"\nwhy = \"w\"\n[[claim]]\nid = \"i\"\ntext = \"t\"\nsource = \"s\"\nmetric = \"cull_ms\"\nnumerator = {{ structure = \"list\" }}\ndenominator = {{ structure = \"bsp\" }}\nrelation = \"ratio\"\npublished = {{ a = [1.5, 2] }}\nfor_each = \"scene\"\n"
        );
        let at = cut.index(whole.len());
        let end = (at + gone).min(whole.len());
        let damaged = format!("{}{put}{}", &whole[..at], &whole[end..]);
        let _ = Folder::new().read(&damaged, &[]);
    }
}
