//! `cullmark report`: charts, tables and a page from a stored study.

use crate::claim::Claim;
use crate::error::{Error, Result};
use crate::manifest::Manifest;
use crate::report;
use crate::results::StudyResults;
use crate::store::{self, Detail};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// Name of a study, `name@series`, or its manifest
    pub study: String,
    /// Database with the results
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB)]
    pub db: PathBuf,
    /// Folder of the report (default: beside the database, named as the study)
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (study, results, claims) = with_claims(&args.study, &args.db)?;
    let beside = args.db.parent().unwrap_or(Path::new("")).join(&study);
    let out = args.out.unwrap_or(beside);
    let series = store::read_series(&args.db, &study, Detail::Frames)?;
    let files = report::write_with_series(&results, &claims, &series, &out)?;
    println!(
        "{} ({} charts as SVG and PNG, {} tables as CSV, Markdown and LaTeX)",
        files.page.display(),
        files.charts.len() / 2,
        files.tables.len() / 3
    );
    Ok(ExitCode::SUCCESS)
}

/// A study's name, its results and its claims.
///
/// # Errors
/// When the manifest has mistakes, or the database fails or lacks the study.
pub fn with_claims(study: &str, db: &Path) -> Result<(String, StudyResults, Vec<Claim>)> {
    let (study, manifest) = named(study)?;
    let results = store::read_results(db, &study, Detail::Frames)?;
    let claims = match manifest {
        // Claims may be written or mended after the run: those of the file win.
        Some(manifest) => manifest.claims(),
        None => stored_claims(db, &study)?,
    };
    Ok((study, results, claims))
}

/// A study by its name, or the one a manifest describes.
///
/// # Errors
/// When the manifest has mistakes.
pub fn named(study: &str) -> Result<(String, Option<Manifest>)> {
    let path = Path::new(study);
    if path.extension().is_none_or(|e| e != "toml") {
        return Ok((study.to_string(), None));
    }
    let manifest = Manifest::load(path, &[]).map_err(|mut errors| {
        let rest = errors.len().saturating_sub(1);
        let mut first = if errors.is_empty() { Error::new("the manifest cannot be read") } else { errors.remove(0) };
        if rest > 0 {
            first.help = Some(format!("`cullmark check {study}` lists this and {rest} more"));
        }
        first
    })?;
    Ok((manifest.study.name.clone(), Some(manifest)))
}

fn stored_claims(db: &Path, study: &str) -> Result<Vec<Claim>> {
    let text = store::block_on(async {
        let store = store::Store::open_existing(db).await?;
        let text = store.claims_json(study).await;
        store.close().await;
        text
    })?;
    if text.trim().is_empty() {
        return Ok(Vec::new());
    }
    serde_json::from_str(&text).map_err(|e| {
        Error::new(format!("the stored claims of `{study}` cannot be read: {e}"))
            .in_file(db)
            .help("name the manifest instead of the study, so that its claims are used")
    })
}

/// Prints to standard output; a reader that hangs up early (`| head`) is no error.
///
/// # Errors
/// When standard output cannot be written.
pub fn put(text: &str) -> Result<()> {
    use std::io::Write;
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::io(Path::new("standard output"), "cannot write", &e)
                .help("free some space, or send it elsewhere"))
        }
        _ => Ok(()),
    }
}
