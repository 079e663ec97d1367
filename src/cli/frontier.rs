//! `cullmark frontier`: who is on the Pareto front of run time against error, scene by scene.

use super::report::{named, put};
use crate::report::fields::Fields;
use crate::report::filter::Filter;
use crate::report::frontier::{coordinate, fronts};
use crate::report::frontier_table::{X, Y, only, table, text};
use crate::report::labels::Grid;
use crate::report::query::{Format, print};
use crate::store::{self, Detail};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(
    after_help = "Both metrics are better the smaller they are. A run is dominated when another beats it beyond the 95 %\n\
    intervals; within noise of the front when the intervals cannot tell. A conservative method with an error is a bug\n\
    and no point: it is named below the table. Metrics are those of `query`."
)]
pub struct Args {
    /// Name of a study, `name@series`, or its manifest
    pub study: String,
    /// This scene alone
    #[arg(long)]
    pub scene: Option<String>,
    /// Metric of the cost
    #[arg(long, value_name = "METRIC", default_value = X)]
    pub x: String,
    /// Metric of the error
    #[arg(long, value_name = "METRIC", default_value = Y)]
    pub y: String,
    /// Keep the runs for which this holds, as in `query`
    #[arg(long = "where", value_name = "FILTER")]
    pub filter: Option<String>,
    /// Also what is dominated, and by whom
    #[arg(long)]
    pub all: bool,
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// Database with the results
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB)]
    pub db: PathBuf,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (study, _) = named(&args.study)?;
    let x = coordinate(&args.x).map_err(|e| e.key("--x"))?;
    let y = coordinate(&args.y).map_err(|e| e.key("--y"))?;
    let results = store::read_results(&args.db, &study, Detail::Frames)?;
    let fields = Fields::of(&results);
    let filter = args.filter.as_deref().map(|f| Filter::parse(f, &fields)).transpose()?;
    let grid = Grid::of(&results);
    let mut found = fronts(&grid, x, y, &|run| filter.as_ref().is_none_or(|f| f.matches(run, &fields)));
    if let Some(scene) = &args.scene {
        found = only(found, scene)?;
    }
    if args.format == Format::Table {
        put(&text(&grid, &found, (x, y), args.all))?;
        if x.name == X && !found.is_empty() {
            put(
                "\nThe time is that of culling alone, so what culls little is fast; --x frame_ms_model adds drawing.\n",
            )?;
        }
    } else {
        put(&print(&table(&grid, &found, (x, y), args.all), args.format)?)?;
    }
    Ok(ExitCode::SUCCESS)
}
