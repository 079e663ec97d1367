//! `cullmark plan`.

use super::check;
use crate::matrix::plan::{Known, plan};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// TOML manifest of the study
    manifest: PathBuf,
    /// Lay key=value over the manifest, such as measure.repeats=3 (repeatable)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// List every run on a line of its own
    #[arg(long)]
    list: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (manifest, matrix) = match check::read(&args.manifest, &args.set) {
        Ok(both) => both,
        Err(errors) => {
            check::print_errors(&errors, args.json);
            return Ok(ExitCode::from(2));
        }
    };
    let plan = plan(&manifest, &matrix, |_| Known::default());
    if args.json {
        println!("{}", serde_json::to_string_pretty(&plan)?);
    } else {
        println!("{}\n", manifest.study.title);
        println!("{}", if args.list { plan.list() } else { plan.table() });
        print!("{}", plan.summary());
    }
    Ok(ExitCode::SUCCESS)
}
