//! `cullmark claims`: how the statements of a study fared, for terminals and for scripts.

use super::report::{put, with_claims};
use crate::error::Error;
use crate::report::claims::{Judged, Verdict, judge_all};
use crate::report::query::{Format, print};
use crate::report::tables;
use crate::store;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(
    after_help = "Exit status 0: all reproduced (or in the model only); 1: a claim is contradicted or undecided."
)]
pub struct Args {
    /// Name of a study, `name@series`, or its manifest
    pub study: String,
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// Database with the results
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB)]
    pub db: PathBuf,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (study, results, claims) = with_claims(&args.study, &args.db)?;
    if claims.is_empty() {
        return Err(Error::new(format!("study `{study}` makes no claims"))
            .help("write `[[claim]]` into its manifest and name that (docs/MANIFEST.md)")
            .into());
    }
    let judged = judge_all(&results, &claims);
    if args.format == Format::Table {
        put(&judged.iter().map(sentence).collect::<String>())?;
        put("\n")?;
    }
    put(&print(&tables::claims(&judged), args.format)?)?;
    let held = judged.iter().all(|j| matches!(j.verdict, Verdict::Reproduced | Verdict::ModelOnly));
    Ok(ExitCode::from(u8::from(!held)))
}

fn sentence(j: &Judged) -> String {
    format!("{}: {}\n    {}\n", j.claim.id, j.claim.text, j.summary)
}
