//! `cullmark check`.

use crate::error::Error;
use crate::manifest::Manifest;
use crate::matrix::{Matrix, expand};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// TOML manifest of the study
    manifest: PathBuf,
    /// Lay key=value over the manifest, such as measure.repeats=3 (repeatable)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match read(&args.manifest, &args.set) {
        Ok((manifest, matrix)) => {
            tell_absent(&manifest);
            let (runs, excluded) = (matrix.runs.len(), matrix.excluded_runs.len());
            let (claims, sweeps) = (manifest.claims.len(), manifest.sweeps.len());
            if args.json {
                let value = serde_json::json!({
                    "ok": true, "study": manifest.study.name, "runs": runs, "excluded": excluded,
                    "duplicates": matrix.duplicates, "claims": claims, "sweeps": sweeps, "scenes": manifest.scenes.len(),
                    "absent": manifest.absent,
                });
                println!("{value:#}");
            } else {
                let charts = match sweeps {
                    0 => String::new(),
                    1 => ", 1 sweep".to_string(),
                    n => format!(", {n} sweeps"),
                };
                println!(
                    "ok: {}: {runs} runs, {excluded} excluded, {} duplicates left out, {claims} claims{charts}",
                    manifest.study.name, matrix.duplicates
                );
            }
            Ok(ExitCode::SUCCESS)
        }
        Err(errors) => {
            print_errors(&errors, args.json);
            Ok(ExitCode::from(2))
        }
    }
}

/// Scenes that the study goes without, on standard error.
pub fn tell_absent(manifest: &Manifest) {
    manifest.absent.iter().for_each(|(name, why)| eprintln!("left out: scene {name}: {why}"));
}

/// Manifest and matrix, or every mistake in them.
pub fn read(path: &Path, sets: &[String]) -> Result<(Manifest, Matrix), Vec<Error>> {
    let manifest = Manifest::load(path, sets)?;
    let matrix = expand(&manifest, &crate::intake::setting(0))?;
    Ok((manifest, matrix))
}

/// Mistakes on standard error as text, or on standard output as JSON.
pub fn print_errors(errors: &[Error], json: bool) {
    if json {
        let list: Vec<_> = errors
            .iter()
            .map(|e| {
                serde_json::json!({
                    "message": e.message, "file": e.file, "line": e.line, "column": e.column,
                    "key": e.key, "help": e.help,
                })
            })
            .collect();
        println!("{:#}", serde_json::json!({ "ok": false, "errors": list }));
        return;
    }
    for e in errors {
        eprintln!("error: {e}\n");
    }
    let s = if errors.len() == 1 { "" } else { "s" };
    eprintln!("{} mistake{s}; nothing was run", errors.len());
}
