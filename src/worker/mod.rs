//! Workers lease jobs, run each in a child process and hand the result back.
//!
//! One worker owns the measuring lane and takes trials only; the others take
//! judgements and stay off the lane's core. With a single core, one worker
//! takes both in turn. Ending cleanly (Ctrl-C) kills the children and gives
//! their leases back; being killed loses at most the trial in flight.

pub mod child;
pub mod lane;

use crate::error::{Error, Result};
use crate::record::{Judgement, RepeatPolicy, TrialRecord};
use crate::results::RunStatus;
use crate::store::{self, Accepted, Kind, Lease, Left, Outcome, Settled, Store, queue};
use child::{Ended, Launcher, Request};
use lane::Lane;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// A judgement computes ground truth at many samples a pixel, or waits for a
/// cache to fill: its limit is so many times that of a trial.
const JUDGE_TIME: f64 = 10.0;

/// How long an idle worker rests before it looks again.
const REST: Duration = Duration::from_millis(30);

/// How often the jobs left are counted in the database.
const RECOUNT: Duration = Duration::from_secs(2);

/// What a crew of workers needs to know besides the store.
#[derive(Debug, Clone)]
pub struct Options {
    pub launcher: Launcher,
    pub cache_dir: PathBuf,
    pub lane_file: PathBuf,
    /// Workers beside the one on the measuring lane.
    pub auxiliary: usize,
}

/// What happens, for progress and for logs (one JSON object a line).
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// Another process measures on this machine right now.
    LaneBusy,
    JobStarted {
        kind: Kind,
        measurement_id: String,
        run: String,
        repeat: u32,
        /// 1: a disturbed repeat is measured a second time.
        take: u32,
    },
    JobEnded {
        kind: Kind,
        measurement_id: String,
        run: String,
        repeat: u32,
        /// `accepted`, `noisy`, `fenced`, `failed` or `crashed`.
        outcome: &'static str,
        reason: Option<String>,
        wall_ms: f64,
        /// Jobs of this study still to do.
        left: Left,
    },
    RunEnded {
        measurement_id: String,
        run: String,
        status: RunStatus,
        reason: Option<String>,
    },
}

pub type Listener = Arc<dyn Fn(Event) + Send + Sync>;

/// A study being worked on by this process.
struct Crew {
    store: Store,
    study_id: i64,
    policy: RepeatPolicy,
    options: Options,
    tell: Listener,
    stop: watch::Receiver<bool>,
    left: Mutex<Left>,
    counted: Mutex<Instant>,
}

/// Works until the study has no job left, or `stop` turns true. True if it was stopped.
///
/// # Errors
/// When the database fails (full, locked, damaged) or children cannot be
/// started; what was accepted until then is stored.
pub async fn work(
    store: &Store,
    study_id: i64,
    policy: &RepeatPolicy,
    options: &Options,
    tell: Listener,
    stop: watch::Receiver<bool>,
) -> Result<bool> {
    let crew = Arc::new(Crew {
        store: store.clone(),
        study_id,
        policy: policy.clone(),
        options: options.clone(),
        tell,
        stop,
        left: Mutex::new(Left::default()),
        counted: Mutex::new(Instant::now()),
    });
    store.return_orphans().await?;
    // A process may have died between accepting a trial and drawing the conclusion.
    crew.settle_all().await?;
    *crew.left() = store.jobs_left(study_id).await?;
    let mut tasks = tokio::task::JoinSet::new();
    let single = options.launcher.lane_core.is_none();
    let kinds: Vec<&'static [Kind]> = if single {
        vec![&[Kind::Judge, Kind::Trial]]
    } else {
        let auxiliary = std::iter::repeat_n(&[Kind::Judge][..], options.auxiliary.max(1));
        std::iter::once(&[Kind::Trial][..]).chain(auxiliary).collect()
    };
    for kinds in kinds {
        let crew = crew.clone();
        tasks.spawn(async move { crew.labour(kinds).await });
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
        None => Ok(*crew.stop.borrow()),
    }
}

impl Crew {
    async fn labour(&self, kinds: &[Kind]) -> Result<()> {
        let lane = Lane::new(&self.options.lane_file);
        let mut looked = Instant::now();
        while !self.stopped() {
            let mut worked = false;
            for kind in kinds {
                worked |= match kind {
                    Kind::Judge => self.one(Kind::Judge).await?,
                    // Judgements alone are left: do not take the lane from others.
                    Kind::Trial if !self.store.has_queued_trial(self.study_id).await? => false,
                    Kind::Trial => {
                        let _held = tokio::select! {
                            held = lane.hold(|| (self.tell)(Event::LaneBusy)) => held?,
                            () = self.stop_asked() => return Ok(()),
                        };
                        self.one(Kind::Trial).await?
                    }
                };
            }
            if worked {
                continue;
            }
            // Nothing to take. Others may still work on what will become more jobs, or may have died.
            if self.store.jobs_left(self.study_id).await? == Left::default() && self.settle_all().await? == 0 {
                return Ok(());
            }
            if looked.elapsed() > Duration::from_secs(1) {
                self.store.return_orphans().await?;
                looked = Instant::now();
            }
            tokio::time::sleep(REST).await;
        }
        Ok(())
    }

    fn left(&self) -> MutexGuard<'_, Left> {
        self.left.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Another process may work on the same study: from time to time its share is taken into account.
    async fn count_again(&self) -> Result<()> {
        {
            let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
            if counted.elapsed() < RECOUNT {
                return Ok(());
            }
            *counted = Instant::now();
        }
        let left = self.store.jobs_left(self.study_id).await?;
        *self.left() = left;
        Ok(())
    }

    fn stopped(&self) -> bool {
        *self.stop.borrow()
    }

    async fn stop_asked(&self) {
        let mut stop = self.stop.clone();
        while !*stop.borrow_and_update() {
            if stop.changed().await.is_err() {
                // Nobody is left to ask.
                std::future::pending::<()>().await;
            }
        }
    }

    /// Leases and does one job; false when there is none.
    async fn one(&self, kind: Kind) -> Result<bool> {
        let Some(lease) = self.store.lease(self.study_id, kind).await? else { return Ok(false) };
        let run = store::label(&lease.spec);
        (self.tell)(Event::JobStarted {
            kind,
            measurement_id: lease.job.target.clone(),
            run: run.clone(),
            repeat: lease.job.repeat,
            take: lease.job.take,
        });
        let start = Instant::now();
        let (outcome, reason) = match kind {
            Kind::Trial => self.trial(&lease, start).await?,
            Kind::Judge => self.judge(&lease, start).await?,
        };
        if matches!(outcome, "returned" | "crashed") {
            // Not done: it waits again.
        } else {
            match kind {
                Kind::Trial => self.left().trials -= 1,
                Kind::Judge => self.left().judgements -= 1,
            }
        }
        let concerned = match kind {
            Kind::Trial => vec![lease.job.target.clone()],
            Kind::Judge => self.store.unsettled(self.study_id, Some(&lease.job.target)).await?,
        };
        for id in concerned {
            self.settle(&id, &run).await?;
        }
        self.count_again().await?;
        (self.tell)(Event::JobEnded {
            kind,
            measurement_id: lease.job.target.clone(),
            run,
            repeat: lease.job.repeat,
            outcome,
            reason,
            wall_ms: start.elapsed().as_secs_f64() * 1e3,
            left: *self.left(),
        });
        Ok(true)
    }

    async fn trial(&self, lease: &Lease, start: Instant) -> Result<(&'static str, Option<String>)> {
        let limit = Duration::from_secs_f64(self.policy.timeout_s);
        let Some(ended) = self.child::<TrialRecord>(lease, limit, self.policy.memory_limit_mib).await? else {
            return Ok(("returned", None));
        };
        let record = match ended {
            Ended::Answered(record) => record,
            other => return self.failed(lease, other).await,
        };
        let wall_ns = start.elapsed().as_nanos() as u64;
        Ok((accepted(self.store.accept_trial(lease, &record, wall_ns).await?), None))
    }

    async fn judge(&self, lease: &Lease, start: Instant) -> Result<(&'static str, Option<String>)> {
        let limit = Duration::from_secs_f64(self.policy.timeout_s * JUDGE_TIME);
        // The memory limit is on the method under test, not on our ground truth.
        let Some(ended) = self.child::<Judgement>(lease, limit, None).await? else {
            return Ok(("returned", None));
        };
        let judgement = match ended {
            Ended::Answered(judgement) => judgement,
            other => return self.failed(lease, other).await,
        };
        let wall_ns = start.elapsed().as_nanos() as u64;
        Ok((accepted(self.store.accept_judgement(lease, &judgement, wall_ns).await?), None))
    }

    async fn failed<T>(&self, lease: &Lease, ended: Ended<T>) -> Result<(&'static str, Option<String>)> {
        let outcome = match ended {
            Ended::Answered(_) => unreachable!("an answer is no failure"),
            Ended::Refused(r) => Outcome::Refused(r),
            Ended::TimedOut(r) => Outcome::TimedOut(r),
            Ended::Crashed(r) => Outcome::Crashed(r),
        };
        let last = self.store.fail(lease, &outcome).await?;
        let (Outcome::Refused(reason) | Outcome::TimedOut(reason) | Outcome::Crashed(reason)) = outcome;
        Ok((if last { "failed" } else { "crashed" }, Some(reason)))
    }

    /// Runs the child while renewing its lease. `None`: the job was given back, or lost to another.
    async fn child<T: for<'a> serde::Deserialize<'a>>(
        &self,
        lease: &Lease,
        limit: Duration,
        memory_limit_mib: Option<u64>,
    ) -> Result<Option<Ended<T>>> {
        let request =
            Request { job: lease.job.kind, spec: &lease.spec, cache_dir: &self.options.cache_dir, memory_limit_mib };
        let mut beat = tokio::time::interval(queue::LEASE / 3);
        beat.tick().await;
        let child = self.options.launcher.run::<T>(&request, limit);
        tokio::pin!(child);
        loop {
            tokio::select! {
                ended = &mut child => {
                    return match ended {
                        Ok(ended) => Ok(Some(ended)),
                        Err(e) => {
                            self.store.give_back(lease).await?;
                            Err(e)
                        }
                    };
                }
                // Leaving drops the future, and that kills the child with all it started.
                () = self.stop_asked() => {
                    self.store.give_back(lease).await?;
                    return Ok(None);
                }
                _ = beat.tick() => {
                    if !self.store.renew(lease).await? {
                        return Ok(None);
                    }
                }
            }
        }
    }

    /// Settles what is open and nobody works on; the number of jobs that this added.
    async fn settle_all(&self) -> Result<u32> {
        let mut added = 0;
        for id in self.store.loose_ends(self.study_id).await? {
            let run = self.store.label_of(self.study_id, &id).await?;
            added += self.settle(&id, &run).await?.trials_added;
        }
        Ok(added)
    }

    async fn settle(&self, measurement_id: &str, run: &str) -> Result<Settled> {
        let settled = self.store.settle(self.study_id, measurement_id, &self.policy).await?;
        self.left().trials += i64::from(settled.trials_added) - i64::from(settled.trials_cancelled);
        if settled.status != RunStatus::Pending {
            (self.tell)(Event::RunEnded {
                measurement_id: measurement_id.to_string(),
                run: run.to_string(),
                status: settled.status,
                reason: settled.reason.clone(),
            });
        }
        Ok(settled)
    }
}

fn accepted(how: Accepted) -> &'static str {
    match how {
        Accepted::Yes => "accepted",
        Accepted::Noisy => "noisy",
        Accepted::Fenced => "fenced",
    }
}

/// How many workers beside the measuring one suit this machine.
pub fn auxiliary_workers(asked: Option<usize>, cores: usize) -> Result<usize> {
    match asked {
        Some(0) => Err(Error::new("--workers must be at least 1").help("leave it out for one worker a spare core")),
        Some(n) => Ok(n),
        None => Ok(cores.saturating_sub(1).max(1)),
    }
}
