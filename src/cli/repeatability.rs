//! `cullmark repeatability`: a study measured more than once, compared with itself.

use super::report::{named, put};
use crate::error::Error;
use crate::report::repeatability::of;
use crate::report::repeatability_tables as tables;
use crate::store::{self, Detail};
use std::path::PathBuf;
use std::process::ExitCode;

/// How it is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    #[value(alias = "table")]
    Text,
    /// Every measured number of every pair
    Csv,
    Json,
    #[value(alias = "markdown")]
    Md,
}

#[derive(clap::Args)]
#[command(after_help = "`cullmark run STUDY.toml --series next` measures a study again; results stay side by side.\n\
    Exits with 1 when something that must be identical between series is not.")]
pub struct Args {
    /// Name of a study, or its manifest
    pub study: String,
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Database with the results
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB)]
    pub db: PathBuf,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (study, _) = named(&args.study)?;
    let all = store::read_series(&args.db, &study, Detail::Frames)?;
    if all.len() < 2 {
        return Err(Error::new(format!("`{study}` was measured once: there is nothing to compare"))
            .help(format!("`cullmark run {study}.toml --series next` measures it again beside what is stored"))
            .into());
    }
    let found = of(&all);
    put(&match args.format {
        Format::Text => tables::text(&found),
        Format::Csv => tables::readings(&found).csv(),
        Format::Md => tables::markdown(&found),
        Format::Json => serde_json::to_string_pretty(&tables::json(&found))? + "\n",
    })?;
    Ok(if found.differences.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
