//! Workers lease jobs, run each in a child process and hand the result back.
//!
//! One worker owns the measuring lane and takes trials only; the others take
//! judgements and stay off the lane's core. With a single core, one worker
//! takes both in turn. A crew works for one study (`work`, until nothing is left) or
//! for every study of a database (`pool`, until it is told to end). Ending cleanly
//! gives leases back; being killed loses at most the trial in flight.

pub mod child;
mod crew;
pub mod lane;
mod serving;

use crate::error::{Error, Result};
use crate::results::RunStatus;
use crate::store::{Kind, Left, Pool, Store};
use child::Launcher;
use crew::{Crew, Scope};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::sync::{Notify, watch};

/// What a crew of workers needs to know besides the store.
#[derive(Debug, Clone)]
pub struct Options {
    pub launcher: Launcher,
    pub cache_dir: PathBuf,
    pub lane_file: PathBuf,
    /// Workers beside the one on the measuring lane.
    pub auxiliary: usize,
}

/// What a crew is to do now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    Work,
    /// End what is under way, take nothing new.
    Drain,
    /// Give back what is under way.
    Stop,
}

/// What happens, for progress and for logs (one JSON object a line).
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// Another process measures on this machine right now.
    LaneBusy,
    JobStarted {
        /// Number of the worker, from 0: the one on the lane.
        worker: usize,
        study_id: i64,
        kind: Kind,
        measurement_id: String,
        run: String,
        repeat: u32,
        /// 1: a disturbed repeat is measured a second time.
        take: u32,
    },
    JobEnded {
        worker: usize,
        study_id: i64,
        kind: Kind,
        measurement_id: String,
        run: String,
        repeat: u32,
        /// `accepted`, `noisy`, `fenced`, `failed` or `crashed`.
        outcome: &'static str,
        reason: Option<String>,
        wall_ms: f64,
        /// Jobs of this study still to do; 0 where a pool works for many.
        left: Left,
    },
    /// A worker of a pool met trouble that is not a run's (a full disk, a locked
    /// database) and tries again after a while.
    Trouble {
        worker: usize,
        message: String,
        again_s: f64,
    },
    RunEnded {
        study_id: i64,
        measurement_id: String,
        run: String,
        status: RunStatus,
        reason: Option<String>,
    },
}

pub type Listener = Arc<dyn Fn(Event) + Send + Sync>;

/// Works until the study has no job left, or `phase` says so. True if it was stopped.
///
/// # Errors
/// When the database fails (full, locked, damaged) or children cannot be
/// started; what was accepted until then is stored.
pub async fn work(
    store: &Store,
    study_id: i64,
    options: &Options,
    tell: Listener,
    phase: watch::Receiver<Phase>,
) -> Result<bool> {
    let crew = Crew::new(store, Scope::Study(study_id), options, tell, phase, Arc::default());
    let crew = Arc::new(crew);
    store.return_orphans().await?;
    // A process may have died between accepting a trial and drawing the conclusion.
    crew.settle_all(study_id).await?;
    crew.count(study_id).await?;
    let mut tasks = tokio::task::JoinSet::new();
    for (worker, kinds) in shifts(options).into_iter().enumerate() {
        let crew = crew.clone();
        tasks.spawn(async move { crew.labour(worker, kinds, study_id).await });
    }
    let mut first_error = None;
    while let Some(ended) = tasks.join_next().await {
        match ended {
            Ok(Ok(())) => {}
            // One worker's trouble (a full disk) is everyone's: the others stop, their leases run back.
            Ok(Err(e)) => {
                first_error.get_or_insert(e);
                tasks.abort_all();
            }
            Err(e) if e.is_cancelled() => {}
            Err(e) => std::panic::resume_unwind(e.into_panic()),
        }
    }
    match first_error {
        Some(e) => Err(e),
        None => Ok(crew.phase() != Phase::Work),
    }
}

/// Works for every active study of this machine's class until `phase` says so.
/// `wake` rouses idle workers at once; otherwise they look from time to time, since
/// other processes may submit, too. Trouble is told, and waited out.
pub async fn pool(
    store: &Store,
    pool: Pool,
    options: &Options,
    tell: Listener,
    phase: watch::Receiver<Phase>,
    wake: Arc<Notify>,
) {
    let crew = Arc::new(Crew::new(store, Scope::Every(pool), options, tell, phase, wake));
    let mut tasks = tokio::task::JoinSet::new();
    for (worker, kinds) in shifts(options).into_iter().enumerate() {
        let crew = crew.clone();
        tasks.spawn(async move { crew.serve(worker, kinds).await });
    }
    let mender = crew.clone();
    tasks.spawn(async move { mender.mend().await });
    while let Some(ended) = tasks.join_next().await {
        if let Err(e) = ended
            && e.is_panic()
        {
            std::panic::resume_unwind(e.into_panic());
        }
    }
}

/// How many workers a crew has.
pub fn crew_size(options: &Options) -> usize {
    shifts(options).len()
}

/// What each worker takes.
fn shifts(options: &Options) -> Vec<&'static [Kind]> {
    if options.launcher.lane_core.is_none() {
        return vec![&[Kind::Judge, Kind::Trial]];
    }
    let auxiliary = std::iter::repeat_n(&[Kind::Judge][..], options.auxiliary.max(1));
    std::iter::once(&[Kind::Trial][..]).chain(auxiliary).collect()
}

/// How many workers beside the measuring one suit this machine.
pub fn auxiliary_workers(asked: Option<usize>, cores: usize) -> Result<usize> {
    match asked {
        Some(0) => Err(Error::new("--workers must be at least 1").help("leave it out for one worker a spare core")),
        Some(n) => Ok(n),
        None => Ok(cores.saturating_sub(1).max(1)),
    }
}
