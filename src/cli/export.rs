//! `cullmark export`: a study with all its results in one file.

use crate::store::{DEFAULT_DB, Store, archive, block_on};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// Name of the study, or name@series
    study: String,
    /// File to write (usually STUDY.cullmark)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Database of results
    #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
    db: PathBuf,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let bytes = block_on(async {
        let store = Store::open_existing(&args.db).await?;
        let bytes = store.export(&args.study).await;
        store.close().await;
        bytes
    })?;
    archive::write_whole(&args.out, &bytes)?;
    println!("{}: {} bytes", args.out.display(), bytes.len());
    Ok(ExitCode::SUCCESS)
}
