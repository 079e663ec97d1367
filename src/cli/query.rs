//! `cullmark query`: results as a table, JSON or CSV.

use super::report::named;
use crate::report::query::{Format, Query, print, query};
use crate::store::{self, Detail};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(
    after_help = "Filters: structure = octree and depth >= 4 and culling in (frustum, none) or scene = nucleus\n\
    Fields are axes (scene, path, structure, culling, walk), parameters (depth, octree.depth), metrics\n\
    (total_cull_ms, false_cull_ppm, ...), status, class, machine_class, series. Ranges: depth = 3..5."
)]
pub struct Args {
    /// Name of a study, `name@series`, or its manifest
    pub study: String,
    /// Keep the runs for which this holds
    #[arg(long = "where", value_name = "FILTER")]
    pub filter: Option<String>,
    /// Columns, joined with commas
    #[arg(long, value_delimiter = ',', value_name = "FIELDS")]
    pub columns: Vec<String>,
    /// Sort by these fields; a leading - turns the order round
    #[arg(long, value_delimiter = ',', value_name = "FIELDS", allow_hyphen_values = true)]
    pub sort: Vec<String>,
    /// At most so many rows
    #[arg(long)]
    pub limit: Option<usize>,
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// Database with the results
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB)]
    pub db: PathBuf,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (study, _) = named(&args.study)?;
    // Statistics over frames (medians, percentiles, the model) need the frames.
    let results = store::read_results(&args.db, &study, Detail::Frames)?;
    let asked = Query { filter: args.filter, columns: args.columns, sort: args.sort, limit: args.limit };
    let table = query(&results, &asked)?;
    super::report::put(&print(&table, args.format)?)?;
    if args.format == Format::Table {
        eprintln!("{} of {} runs", table.rows.len(), results.runs.len());
    }
    Ok(ExitCode::SUCCESS)
}
