//! Wavefront material libraries, as far as culling sees them: which names exist
//! and which of them let something through.

use super::obj;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Material {
    /// False with `d` below 1, `Tr` above 0 or a dissolve map.
    pub opaque: bool,
}

/// The files that a `mtllib` line names. A name may hold spaces, and a line may
/// hold several names: what exists decides.
pub fn resolve(folder: &Path, names: &str) -> Vec<PathBuf> {
    let whole = folder.join(names);
    if whole.is_file() || !names.contains(char::is_whitespace) {
        return vec![whole];
    }
    names.split_whitespace().map(|n| folder.join(n)).collect()
}

/// Materials by name; statements that culling does not need are passed over.
pub fn parse(bytes: &[u8]) -> HashMap<String, Material> {
    let text = String::from_utf8_lossy(bytes);
    let mut materials = HashMap::new();
    let mut current: Option<String> = None;
    for line in text.lines().map(str::trim) {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        // `d -halo 0.5` puts an option before the number, so the last word counts.
        let number = || rest.split_whitespace().last().and_then(|w| w.parse::<f64>().ok());
        let lets_through = match keyword {
            "newmtl" => {
                let name = rest.trim().to_string();
                materials.insert(name.clone(), Material { opaque: true });
                current = Some(name);
                false
            }
            "d" => number().is_some_and(|d| d < 1.0),
            "Tr" => number().is_some_and(|t| t > 0.0),
            "map_d" => true,
            _ => false,
        };
        if lets_through && let Some(material) = current.as_ref().and_then(|n| materials.get_mut(n)) {
            material.opaque = false;
        }
    }
    materials
}

/// Library files that an OBJ names, without reading more of it than its keywords.
pub fn libraries(path: &Path, bytes: &[u8]) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    // The reader's own lines and words: what it would read is what is named here.
    obj::lines(bytes)
        .filter(|(_, line, _)| obj::split_word(line).0 == b"mtllib")
        .flat_map(|(_, line, _)| resolve(folder, String::from_utf8_lossy(obj::split_word(&line).1).trim()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_are_those_that_the_reader_would_open_however_the_line_is_broken() {
        let named = |text: &str| libraries(Path::new("x/a.obj"), text.as_bytes());
        assert_eq!(named("mtllib a.mtl\nv 0 0 0\n mtllib  b.mtl"), [Path::new("x/a.mtl"), Path::new("x/b.mtl")]);
        assert_eq!(named("mtllib a \\\n../../etc/passwd \\\nb\n").len(), 3, "a backslash goes on with the line");
        assert!(named("mtllibrary a.mtl\nv 0 0 0").is_empty());
    }

    #[test]
    fn dissolve_transparency_and_maps_make_a_material_see_through() {
        let m = parse(
            b"newmtl wall\nKd 1\nnewmtl glass\nd 0.5\nnewmtl halo\nd -halo 0.2\nnewmtl leaf\nmap_d leaf.png\n\
            newmtl smoke\nTr 0.4\nnewmtl solid paint\nd 1.0\nTr 0\n",
        );
        let opaque: Vec<_> = ["wall", "glass", "halo", "leaf", "smoke", "solid paint"].map(|n| m[n].opaque).into();
        assert_eq!(opaque, [true, false, false, false, false, true]);
        assert!(parse(b"d 0.5\n\xff\xfe newmtl").is_empty(), "statements before a name change nothing");
    }
}
