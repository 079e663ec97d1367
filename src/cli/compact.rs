//! `cullmark compact`: a smaller database.

use crate::store::{DEFAULT_DB, Store, block_on, compact};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// Database of results
    #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
    db: PathBuf,
    /// Also drop the times of single passes; every trial keeps its smallest per frame
    #[arg(long)]
    drop_passes: bool,
    /// Also drop measurements that no study refers to any more
    #[arg(long)]
    drop_orphans: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let drop = compact::Drop { passes: args.drop_passes, orphans: args.drop_orphans };
    let done = block_on(async {
        let store = Store::open_existing(&args.db).await?;
        let done = store.compact(drop).await;
        store.close().await;
        done
    })?;
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!(
        "{}: {:.2} MiB -> {:.2} MiB, {} rows dropped",
        args.db.display(),
        mib(done.before_bytes),
        mib(done.after_bytes),
        done.rows_dropped
    );
    Ok(ExitCode::SUCCESS)
}
