//! `cullmark plan`.

use super::check;
use crate::error::Error;
use crate::intake::{self, series, setting};
use crate::manifest::Manifest;
use crate::matrix::plan::Plan;
use crate::matrix::{self, Matrix};
use crate::store::{self, Store};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// TOML manifest of the study
    manifest: PathBuf,
    /// Lay key=value over the manifest, such as measure.repeats=3 (repeatable)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Database that tells what is done
    #[arg(long, value_name = "FILE", default_value = store::DEFAULT_DB)]
    db: PathBuf,
    /// Plan for a series measured anew, as `run --series` does
    #[arg(long, value_name = "next|N")]
    series: Option<String>,
    /// List every run on a line of its own
    #[arg(long)]
    list: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let manifest = match Manifest::load(&args.manifest, &args.set) {
        Ok(manifest) => manifest,
        Err(errors) => return Ok(mistakes(&errors, args.json)),
    };
    check::tell_absent(&manifest);
    let plan = match store::block_on(planned(&args, &manifest))? {
        Ok(plan) => plan,
        Err(errors) => return Ok(mistakes(&errors, args.json)),
    };
    if args.json {
        println!("{}", serde_json::to_string_pretty(&plan)?);
    } else {
        println!("{}\n", manifest.study.title);
        println!("{}", if args.list { plan.list() } else { plan.table() });
        print!("{}", plan.summary());
    }
    Ok(ExitCode::SUCCESS)
}

fn mistakes(errors: &[Error], json: bool) -> ExitCode {
    check::print_errors(errors, json);
    ExitCode::from(2)
}

/// Without a database everything is new: planning makes none.
async fn planned(args: &Args, manifest: &Manifest) -> anyhow::Result<Result<Plan, Vec<Error>>> {
    let store = if args.db.is_file() { Some(Store::open_existing(&args.db).await?) } else { None };
    let series = match &store {
        Some(store) => series(args.series.as_deref(), store, &manifest.study.name).await?,
        None => 0,
    };
    let matrix: Matrix = match matrix::expand(manifest, &setting(series)) {
        Ok(matrix) => matrix,
        Err(errors) => return Ok(Err(errors)),
    };
    let plan = intake::planned(manifest, &matrix, store.as_ref(), series).await?;
    if let Some(store) = store {
        store.close().await;
    }
    Ok(Ok(plan))
}
