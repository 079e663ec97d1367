//! Manifests and their matrices: what is read, what is refused and how it is said.

mod axes;
mod families;
mod ids;
mod mistakes;
mod mistakes_axes;
mod mistakes_matrix;
mod mistakes_rules;
mod mistakes_sections;
mod optional;
mod shapes;
mod sweeps;

use cullmark::Error;
use cullmark::manifest::Manifest;
use cullmark::matrix::{Matrix, Setting, expand};
use std::path::PathBuf;

/// A folder with a two-pose path `w.csv` and manifests.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        folder.write("w.csv", "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n0,0,0,1,1,0,0,0,0,1\n1,1,0,1,1,0,0,0,0,1\n");
        folder
    }

    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        path
    }

    pub fn read(&self, text: &str, sets: &[&str]) -> Result<(Manifest, Matrix), Vec<Error>> {
        let path = self.write("m.toml", text);
        let sets: Vec<String> = sets.iter().map(|s| s.to_string()).collect();
        let manifest = Manifest::load(&path, &sets)?;
        let matrix = expand(&manifest, &Setting::default())?;
        Ok((manifest, matrix))
    }
}

/// Two scenes, one path, nothing else: lines 1 to 10.
pub const HEAD: &str = r#"[study]
name = "t"
[[scene]]
name = "a"
generate = "rooms:world=1"
[[scene]]
name = "b"
generate = "rooms:world=2"
[[path]]
name = "w"
file = "w.csv"
"#;

/// Two structures, one culling.
pub const MATRIX_LINES: &str = "[matrix]\nstructure = [\"list\", \"octree\"]\nculling = [\"frustum\"]\n";

/// The matrix of `HEAD` and `rest`; mistakes fail the test.
pub fn matrix(rest: &str) -> Matrix {
    whole(rest, &[]).1
}

pub fn whole(rest: &str, sets: &[&str]) -> (Manifest, Matrix) {
    let read = Folder::new().read(&format!("{HEAD}{rest}"), sets);
    read.unwrap_or_else(|errors| panic!("{}", errors.iter().map(Error::to_string).collect::<Vec<_>>().join("\n")))
}

/// `scene structure culling walk` of every run, default parameters left out.
pub fn cells(matrix: &Matrix) -> Vec<String> {
    let cell = |r| {
        let l = cullmark::matrix::labels(r);
        format!("{} {} {} {}", l.scene, l.structure, l.culling, l.walk)
    };
    matrix.runs.iter().map(cell).collect()
}
