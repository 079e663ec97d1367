//! `cullmark worker`: work for every study of a database, without serving it.

use super::serve::{Log, Workers, ended, pool_here, start_log};
use crate::store::{Pool, Store};
use crate::worker::child::Launcher;
use crate::worker::{self, Event, Phase};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Notify, watch};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    workers: Workers,
    /// How log lines on standard error look
    #[arg(long, value_enum, default_value_t = Log::Text)]
    log: Log,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let launcher = Launcher::here()?;
    let pool = pool_here();
    launcher.leave_the_lane();
    start_log(args.log, false);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    runtime.block_on(work(args, launcher, pool))
}

async fn work(args: Args, launcher: Launcher, pool: Pool) -> anyhow::Result<ExitCode> {
    let store = Store::open(&args.workers.db).await?;
    let options = args.workers.options(&launcher)?;
    let (phase, phases) = watch::channel(Phase::Work);
    tracing::info!(machine_class = pool.machine_class, "working");
    let tell: worker::Listener = Arc::new(|event| match event {
        Event::RunEnded { run, status, reason, .. } => tracing::info!(run, ?status, reason, "run ended"),
        Event::JobEnded { run, outcome, reason: Some(reason), .. } => {
            tracing::warn!(run, outcome, reason, "a trial ended without a result")
        }
        // `message` is the name of the sentence itself.
        Event::Trouble { worker, message, again_s } => {
            tracing::error!(worker, why = message, again_s, "a worker met trouble and tries again")
        }
        _ => {}
    });
    let crew = {
        let store = store.clone();
        tokio::spawn(async move {
            worker::pool(&store, pool, &options, tell, phases, Arc::new(Notify::new())).await;
        })
    };
    ended(phase, Duration::from_secs(args.workers.grace_s), crew).await;
    store.close().await;
    Ok(ExitCode::SUCCESS)
}
