//! `cullmark query`: results as a table, JSON or CSV.

use super::client::{Server, escape};
use super::remote_table;
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
    #[command(flatten)]
    pub server: Server,
    /// Database with the results, where no server is named
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB)]
    pub db: PathBuf,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if args.server.server.is_some() {
        return remote(&args);
    }
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

/// The same from a server: CSV as it is, everything else put together from pages.
fn remote(args: &Args) -> anyhow::Result<ExitCode> {
    let client = args.server.client()?;
    let mut path = format!("/studies/{}/runs?limit=1000", escape(&args.study));
    for (name, value) in [
        ("where", args.filter.clone().unwrap_or_default()),
        ("sort", args.sort.join(",")),
        ("columns", args.columns.join(",")),
    ] {
        if !value.is_empty() {
            path += &format!("&{name}={}", escape(&value));
        }
    }
    if args.format == Format::Csv && args.limit.is_none() {
        super::report::put(&client.text(&format!("{path}&format=csv"))?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let limit = args.limit.unwrap_or(usize::MAX);
    let (mut table, mut total, mut next) = (None, 0, String::new());
    loop {
        let page = client.get(&format!("{path}{next}"))?;
        total = page["total"].as_u64().unwrap_or(total);
        let table = table.get_or_insert_with(|| remote_table::of(&page));
        remote_table::append(table, &page, limit);
        match page["next"].as_str().filter(|_| table.rows.len() < limit) {
            Some(cursor) => next = format!("&cursor={cursor}"),
            None => break,
        }
    }
    let table = table.expect("at least one page was read");
    super::report::put(&print(&table, args.format)?)?;
    if args.format == Format::Table {
        eprintln!("{} of {total} runs that pass the filter", table.rows.len());
    }
    Ok(ExitCode::SUCCESS)
}
