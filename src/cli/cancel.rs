//! `cullmark cancel`: drop what is left to do of a study, on a server or in a database.

use super::client::{Server, escape};
use crate::store::{DEFAULT_DB, Store, block_on};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {
    /// `name@series`, or the name of a study (its latest series)
    study: String,
    #[command(flatten)]
    server: Server,
    /// Database, where no server is named
    #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
    db: PathBuf,
    /// Let it wait instead; `--resume` goes on
    #[arg(long, conflicts_with = "resume")]
    pause: bool,
    /// Go on with a paused or cancelled study
    #[arg(long)]
    resume: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let action = match (args.pause, args.resume) {
        (true, _) => "pause",
        (_, true) => "resume",
        _ => "cancel",
    };
    let study: Value = if args.server.server.is_some() {
        args.server.client()?.post(&format!("/studies/{}/{action}", escape(&args.study)), &json!({}))?
    } else {
        let overview = block_on(async {
            let store = Store::open_existing(&args.db).await?;
            match action {
                "pause" => store.pause(&args.study).await?,
                "resume" => store.resume(&args.study).await?,
                _ => store.cancel(&args.study).await?,
            }
            let overview = store.overview(&args.study).await;
            store.close().await;
            overview
        })?;
        serde_json::to_value(overview)?
    };
    let (name, state) = (study["ref"].as_str().unwrap_or_default(), study["state"].as_str().unwrap_or_default());
    println!("{name} is {state}: {} of {} runs done", study["runs"]["done"], study["runs"]["total"]);
    Ok(ExitCode::SUCCESS)
}
