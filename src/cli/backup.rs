//! `cullmark backup`: a copy of the database while others work with it.

use crate::store::{DEFAULT_DB, Store, block_on};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// The new file; it must not exist
    out: PathBuf,
    /// Database of results
    #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
    db: PathBuf,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let bytes = block_on(async {
        let store = Store::open_existing(&args.db).await?;
        let bytes = store.backup(&args.out).await;
        store.close().await;
        bytes
    })?;
    println!(
        "{} ({:.1} MiB): a database like any other; uploads lie beside the original",
        args.out.display(),
        bytes as f64 / f64::from(1 << 20)
    );
    Ok(ExitCode::SUCCESS)
}
