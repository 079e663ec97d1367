//! What all requests share.

use super::boards::Boards;
use super::charts::Drawn;
use super::events::Hub;
use super::limits::Rates;
use super::ops::Counts;
use super::problem::Answer;
use super::views::Views;
use crate::error::Result;
use crate::machine::fitness::Check;
use crate::store::{Counted, Overview, Pool, Store};
use crate::worker::child::Launcher;
use crate::worker::{Event, Phase};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, watch};

pub type Shared = Arc<App>;

/// What whoever starts the server decides.
#[derive(Debug, Clone)]
pub struct Config {
    /// Only this machine can reach it.
    pub loopback: bool,
    /// Folders whose files manifests may name.
    pub folders: Vec<PathBuf>,
    pub upload_dir: PathBuf,
    pub cache_dir: PathBuf,
    pub max_upload_bytes: u64,
    pub max_cells: u64,
    /// Requests a second and client; 0 is no limit.
    pub rate: f64,
    /// A request may take so long.
    pub timeout: Duration,
    /// A run of a submitter may take so long.
    pub run_timeout_s: f64,
    /// For children that read and measure scenes.
    pub memory_limit_mib: u64,
    /// Whose trials this machine and build may measure.
    pub pool: Pool,
    pub launcher: Launcher,
}

pub struct App {
    pub store: Store,
    pub config: Config,
    pub boards: Boards,
    pub hub: Hub,
    pub views: Views,
    pub drawn: Drawn,
    pub fitness: tokio::sync::Mutex<Option<(Instant, Vec<Check>)>>,
    pub rates: Rates,
    pub counts: Counts,
    pub workers: Mutex<Vec<Worker>>,
    /// Rouses idle workers when something was submitted.
    pub wake: Arc<Notify>,
    pub phase: watch::Receiver<Phase>,
    counted: tokio::sync::Mutex<Counted>,
    tokens: Mutex<Option<(Instant, bool)>>,
    guarded: AtomicBool,
}

/// What a worker of this server does now.
#[derive(Debug, Clone, Default)]
pub struct Worker {
    pub kind: Option<crate::store::Kind>,
    pub study_id: Option<i64>,
    pub run: Option<String>,
    pub since_ms: i64,
    pub repeat: u32,
}

/// Whether there are tokens is asked again after so long: one may be made beside us.
const TOKENS_AGE: Duration = Duration::from_secs(2);

impl App {
    pub fn new(store: Store, config: Config, workers: usize, wake: Arc<Notify>, phase: watch::Receiver<Phase>) -> App {
        App {
            boards: Boards::default(),
            hub: Hub::default(),
            views: Views::new(config.launcher.clone(), config.cache_dir.clone(), config.memory_limit_mib),
            drawn: Drawn::default(),
            fitness: tokio::sync::Mutex::new(None),
            rates: Rates::new(config.rate),
            counts: Counts::default(),
            workers: Mutex::new(vec![Worker::default(); workers]),
            wake,
            phase,
            counted: tokio::sync::Mutex::default(),
            tokens: Mutex::new(None),
            guarded: AtomicBool::new(false),
            store,
            config,
        }
    }

    /// Whether a token is needed: since there was one, also after the last is removed.
    pub async fn wants_tokens(&self) -> Result<bool> {
        if self.has_tokens().await? {
            self.guarded.store(true, Ordering::Relaxed);
        }
        Ok(self.guarded.load(Ordering::Relaxed))
    }

    pub async fn has_tokens(&self) -> Result<bool> {
        let known = *self.tokens.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, has)) = known.filter(|(at, _)| at.elapsed() < TOKENS_AGE) {
            return Ok(has);
        }
        let has = self.store.has_tokens().await?;
        *self.tokens.lock().unwrap_or_else(PoisonError::into_inner) = Some((Instant::now(), has));
        Ok(has)
    }

    /// Studies at a glance; what has not changed is not counted again.
    pub async fn overviews(&self, ids: &[i64]) -> Answer<Vec<Overview>> {
        let mut counted = self.counted.lock().await;
        Ok(self.store.overviews(ids, &mut counted).await?)
    }

    pub async fn overview(&self, study_id: i64) -> Answer<Overview> {
        let found = self.overviews(&[study_id]).await?.pop();
        found.ok_or_else(|| super::problem::Problem::missing("the study was deleted"))
    }

    /// Takes note of what the pool does, for watchers and for `/metrics`.
    pub fn on(&self, event: &Event) {
        self.counts.on(event);
        match event {
            Event::JobStarted { worker, study_id, kind, run, repeat, .. } => {
                self.set_worker(
                    *worker,
                    Worker {
                        kind: Some(*kind),
                        study_id: Some(*study_id),
                        run: Some(run.clone()),
                        since_ms: super::now_ms(),
                        repeat: *repeat,
                    },
                );
                self.hub.touch(*study_id);
            }
            Event::JobEnded { worker, study_id, run, outcome, reason, .. } => {
                self.set_worker(*worker, Worker::default());
                self.hub.touch(*study_id);
                if let Some(reason) = reason {
                    tracing::warn!(run, outcome, reason, "a trial ended without a result");
                }
            }
            Event::RunEnded { study_id, measurement_id, run, status, reason } => {
                tracing::info!(run, status = ?status, reason, "run ended");
                self.hub.run_ended(*study_id, measurement_id, run, *status, reason.as_deref());
            }
            Event::Trouble { worker, message, again_s } => {
                self.set_worker(*worker, Worker::default());
                tracing::error!(worker, why = message, again_s, "a worker met trouble and tries again");
            }
            Event::LaneBusy => tracing::info!("waiting for the measuring lane: another process holds it"),
        }
    }

    fn set_worker(&self, number: usize, state: Worker) {
        let mut workers = self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(worker) = workers.get_mut(number) {
            *worker = state;
        }
    }
}
