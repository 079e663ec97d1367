//! From a checked manifest to what a store takes in or a plan shows: what the command
//! line and the service share.

mod known;

use crate::error::{Error, Result};
use crate::machine;
use crate::manifest::Manifest;
use crate::matrix::plan::{Known, Plan, plan};
use crate::matrix::{self, Matrix, Setting};
use crate::record::RunSpec;
use crate::store::{Cell, Store, Submission};
pub use known::known;

/// The part of every run that the machine decides. `plan` needs the same for the same ids.
pub fn setting(series: u32) -> Setting {
    Setting {
        pin_core: machine::measuring_core(),
        build_profile: machine::build_profile().to_string(),
        isa: machine::isa().to_string(),
        threads: 1,
        series,
    }
}

/// Which of the measurements of one study: `next`, or a number; the first without a word.
///
/// # Errors
/// For another word, or when the database fails.
pub async fn series(asked: Option<&str>, store: &Store, study: &str) -> Result<u32> {
    Ok(match asked {
        None => 0,
        Some("next") => store.next_series(study).await?,
        Some(text) => text.parse().map_err(|_| {
            Error::new(format!("`{text}` is neither `next` nor a number"))
                .key("series")
                .help("`next` measures the whole study again beside what is stored")
        })?,
    })
}

/// What the user decides beside the manifest.
#[derive(Debug, Clone, Default)]
pub struct Wish {
    pub series: u32,
    pub retry_failed: bool,
    pub priority: i64,
    /// Where files that the manifest names start from.
    pub folder: String,
}

/// The matrix of a manifest as the store takes it.
pub fn submission(manifest: &Manifest, matrix: &Matrix, machine_class: String, wish: Wish) -> Submission {
    let cell = |spec: &RunSpec| {
        let labels = matrix::labels(spec);
        Cell { spec: spec.clone(), structure: labels.structure, culling: labels.culling, walk: labels.walk }
    };
    Submission {
        name: manifest.study.name.clone(),
        title: manifest.study.title.clone(),
        manifest_toml: manifest.source_text.clone(),
        claims_json: serde_json::to_string(&manifest.claims()).expect("claims are plain data"),
        sweeps_json: serde_json::to_string(&manifest.sweeps()).expect("sweeps are plain data"),
        consolidate_frames: manifest.timing.consolidate_frames,
        policy: manifest.repeat.clone(),
        machine_class,
        series: wish.series,
        cells: matrix.runs.iter().map(cell).collect(),
        excluded: matrix.excluded.clone(),
        retry_failed: wish.retry_failed,
        priority: wish.priority,
        folder: wish.folder,
    }
}

/// The plan of a matrix, against what the store knows of its runs; without a store all is new.
///
/// # Errors
/// When the database fails.
pub async fn planned(manifest: &Manifest, matrix: &Matrix, store: Option<&Store>, series: u32) -> Result<Plan> {
    let known = match store {
        Some(store) => {
            let study = format!("{}@{series}", manifest.study.name);
            known(store, &study, matrix, &manifest.repeat).await?
        }
        None => vec![Known::default(); matrix.runs.len()],
    };
    // `plan` asks for the runs in their order.
    let next = std::cell::Cell::new(0);
    let answer = |_: &RunSpec| known[next.replace(next.get() + 1)].clone();
    Ok(plan(manifest, matrix, answer))
}
