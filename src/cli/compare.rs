//! `cullmark compare`: two studies or two series side by side.

use super::report::{named, put};
use crate::report::compare::{Change, PAIRED, compare, table};
use crate::report::query::{Format, print};
use crate::store::{self, Detail};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(
    after_help = "Ratios are second over first: below 1 the second is lower. Cells match by scene, path, camera,\n\
    structure, culling, walk and arithmetic with all parameters. Times of different machine classes are not compared."
)]
pub struct Args {
    /// Name of a study, `name@series`, or its manifest
    pub first: String,
    /// The study to set beside it, likewise
    pub second: String,
    /// Metric to compare; by default culling time, paired frame by frame
    #[arg(long, default_value = PAIRED)]
    pub metric: String,
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// Database of the first study, and of the second unless --db-second is given
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB)]
    pub db: PathBuf,
    /// Database of the second study
    #[arg(long, value_name = "FILE")]
    pub db_second: Option<PathBuf>,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (a, b) = (named(&args.first)?.0, named(&args.second)?.0);
    let first = store::read_results(&args.db, &a, Detail::Frames)?;
    let second = store::read_results(args.db_second.as_ref().unwrap_or(&args.db), &b, Detail::Frames)?;
    let pairs = compare(&first, &second, &args.metric)?;
    let names = if a == b { (format!("{a} (first)"), format!("{b} (second)")) } else { (a, b) };
    put(&print(&table(&pairs, &args.metric, (&names.0, &names.1)), args.format)?)?;
    if args.format == Format::Table {
        let count = |c: Change| pairs.iter().filter(|p| p.change == c).count();
        eprintln!(
            "{} lower, {} higher, {} without significant change, {} with a single trial, {} not compared",
            count(Change::Lower),
            count(Change::Higher),
            count(Change::Same),
            count(Change::Unknown),
            count(Change::None)
        );
    }
    Ok(ExitCode::SUCCESS)
}
