//! `cullmark import`: an exported study into a database.

use crate::error::Error;
use crate::store::{DEFAULT_DB, Store, block_on};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// File written by `cullmark export`
    file: PathBuf,
    /// Name for the study here
    #[arg(long = "as", value_name = "NAME")]
    name: Option<String>,
    /// Database of results
    #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
    db: PathBuf,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let bytes = std::fs::read(&args.file).map_err(|e| Error::io(&args.file, "the export cannot be read", &e))?;
    let imported = block_on(async {
        let store = Store::open(&args.db).await?;
        let imported = store.import(&bytes, args.name.as_deref()).await.map_err(|e| e.in_file(&args.file));
        store.close().await;
        imported
    })?;
    if imported.is_nothing() {
        println!("{}: all {} runs were here already", imported.study, imported.runs);
    } else {
        println!(
            "{}: {} runs, {} measurements and {} trials added",
            imported.study, imported.runs, imported.measurements_added, imported.trials_added
        );
    }
    Ok(ExitCode::SUCCESS)
}
