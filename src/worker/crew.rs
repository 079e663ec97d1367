//! What each worker does: take a job, run its child while renewing the lease, store
//! the result, draw the conclusion.

use super::child::{Ended, Request};
use super::lane::Lane;
use super::{Event, Listener, Options, Phase};
use crate::error::Result;
use crate::record::{Judgement, RepeatPolicy, TrialRecord};
use crate::results::RunStatus;
use crate::store::{Accepted, Kind, Lease, Left, Outcome, Pool, Settled, Store, queue};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, watch};

/// A judgement computes ground truth at many samples a pixel, or waits for a
/// cache to fill: its limit is so many times that of a trial.
const JUDGE_TIME: f64 = 10.0;

/// How long an idle worker rests before it looks again.
const REST: Duration = Duration::from_millis(30);

/// How often the jobs left are counted in the database.
const RECOUNT: Duration = Duration::from_secs(2);

/// How often a worker asks whether its lease still holds: a cancelled study lets go of
/// the machine after so long.
const BEAT: Duration = Duration::from_secs(1);

/// So long before it runs out a lease that could not be renewed is given up.
const SLACK: Duration = Duration::from_secs(5);

pub(super) enum Scope {
    Study(i64),
    Every(Pool),
}

/// Workers that share a store and a purpose.
pub(super) struct Crew {
    pub(super) store: Store,
    pub(super) scope: Scope,
    pub(super) options: Options,
    pub(super) tell: Listener,
    phase: watch::Receiver<Phase>,
    pub(super) wake: Arc<Notify>,
    left: Mutex<Left>,
    counted: Mutex<Instant>,
    /// Leases that could not even be given back: while we live, nobody else knows that nobody works.
    owed: Mutex<Vec<Lease>>,
}

impl Crew {
    pub fn new(
        store: &Store,
        scope: Scope,
        options: &Options,
        tell: Listener,
        phase: watch::Receiver<Phase>,
        wake: Arc<Notify>,
    ) -> Crew {
        Crew {
            store: store.clone(),
            scope,
            options: options.clone(),
            tell,
            phase,
            wake,
            left: Mutex::new(Left::default()),
            counted: Mutex::new(Instant::now()),
            owed: Mutex::default(),
        }
    }

    /// Works for one study until nothing of it is left.
    pub async fn labour(&self, worker: usize, kinds: &[Kind], study_id: i64) -> Result<()> {
        let lane = Lane::new(&self.options.lane_file);
        let mut looked = Instant::now();
        while self.phase() == Phase::Work {
            if self.round(worker, kinds, &lane).await? {
                continue;
            }
            if self.phase() != Phase::Work {
                return Ok(());
            }
            // Nothing to take. Others may still work on what will become more jobs, or may have died.
            if !self.store.has_own_job(study_id).await?
                && self.store.jobs_left(study_id).await? == Left::default()
                && self.settle_all(study_id).await? == 0
            {
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

    /// One job of each kind, if there are any; false if there was none.
    pub(super) async fn round(&self, worker: usize, kinds: &[Kind], lane: &Lane) -> Result<bool> {
        self.give_back_owed().await?;
        let mut worked = false;
        for kind in kinds {
            worked |= match kind {
                Kind::Judge => self.one(worker, Kind::Judge).await?,
                // Judgements alone are left: do not take the lane from others.
                Kind::Trial if !self.has_trial().await? => false,
                Kind::Trial => {
                    let _held = tokio::select! {
                        held = lane.hold(|| (self.tell)(Event::LaneBusy)) => held?,
                        () = self.asked(Phase::Drain) => return Ok(false),
                    };
                    self.one(worker, Kind::Trial).await?
                }
            };
        }
        Ok(worked)
    }

    async fn has_trial(&self) -> Result<bool> {
        match &self.scope {
            Scope::Study(id) => self.store.has_queued_trial(*id).await,
            Scope::Every(pool) => self.store.has_trial_for(pool).await,
        }
    }

    fn left(&self) -> MutexGuard<'_, Left> {
        self.left.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub async fn count(&self, study_id: i64) -> Result<()> {
        let left = self.store.jobs_left(study_id).await?;
        *self.left() = left;
        Ok(())
    }

    /// Another process may work on the same study: from time to time its share is taken into account.
    async fn count_again(&self) -> Result<()> {
        let Scope::Study(study_id) = self.scope else { return Ok(()) };
        {
            let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
            if counted.elapsed() < RECOUNT {
                return Ok(());
            }
            *counted = Instant::now();
        }
        self.count(study_id).await
    }

    /// Of a single study; a pool does not count.
    fn count_off(&self, kind: Kind, more: i64) {
        if matches!(self.scope, Scope::Study(_)) {
            let mut left = self.left();
            *match kind {
                Kind::Trial => &mut left.trials,
                Kind::Judge => &mut left.judgements,
            } += more;
        }
    }

    pub fn phase(&self) -> Phase {
        *self.phase.borrow()
    }

    /// Waits until the crew is asked to end: in whatever way for [`Phase::Drain`].
    pub(super) async fn asked(&self, what: Phase) {
        let mut phase = self.phase.clone();
        loop {
            let now = *phase.borrow_and_update();
            if now == Phase::Stop || now == what {
                return;
            }
            if phase.changed().await.is_err() {
                // Nobody is left to ask.
                std::future::pending::<()>().await;
            }
        }
    }

    /// Leases and does one job; false when there is none.
    async fn one(&self, worker: usize, kind: Kind) -> Result<bool> {
        let lease = match &self.scope {
            Scope::Study(id) => self.store.lease(*id, kind).await?,
            Scope::Every(pool) => self.store.lease_any(pool, kind).await?,
        };
        let Some(lease) = lease else { return Ok(false) };
        let done = self.job(worker, &lease).await;
        // Others may take it at once.
        if done.is_err() && self.store.give_back(&lease).await.is_err() {
            self.owed.lock().unwrap_or_else(PoisonError::into_inner).push(lease);
        }
        done.map(|()| true)
    }

    async fn give_back_owed(&self) -> Result<()> {
        loop {
            let owed = self.owed.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let Some(lease) = owed else { return Ok(()) };
            if let Err(e) = self.store.give_back(&lease).await {
                self.owed.lock().unwrap_or_else(PoisonError::into_inner).push(lease);
                return Err(e);
            }
        }
    }

    async fn job(&self, worker: usize, lease: &Lease) -> Result<()> {
        let (kind, study_id) = (lease.job.kind, lease.study_id);
        let run = lease.label.clone();
        (self.tell)(Event::JobStarted {
            worker,
            study_id,
            kind,
            measurement_id: lease.job.target.clone(),
            run: run.clone(),
            repeat: lease.job.repeat,
            take: lease.job.take,
        });
        let start = Instant::now();
        let done = match kind {
            Kind::Trial => self.trial(lease, start).await,
            Kind::Judge => self.judge(lease, start).await,
        };
        // Whatever came of it: a job that always fails must not keep its study next in turn.
        if matches!(self.scope, Scope::Every(_)) {
            self.store.charge(lease, start.elapsed()).await?;
        }
        let (outcome, reason) = done?;
        // Otherwise it is not done and waits again.
        if !matches!(outcome, "returned" | "crashed") {
            self.count_off(kind, -1);
        }
        let concerned = match kind {
            Kind::Trial => vec![(study_id, lease.job.target.clone())],
            Kind::Judge => self.store.waiting_for(study_id, &lease.job.target).await?,
        };
        for (of, id) in concerned {
            if of == study_id {
                self.settle(of, &id, &run, &lease.policy).await?;
            } else {
                let policy = self.store.policy_of(of).await?;
                self.settle(of, &id, &run, &policy).await?;
            }
        }
        self.count_again().await?;
        (self.tell)(Event::JobEnded {
            worker,
            study_id,
            kind,
            measurement_id: lease.job.target.clone(),
            run,
            repeat: lease.job.repeat,
            outcome,
            reason,
            wall_ms: start.elapsed().as_secs_f64() * 1e3,
            left: *self.left(),
        });
        Ok(())
    }

    async fn trial(&self, lease: &Lease, start: Instant) -> Result<(&'static str, Option<String>)> {
        let limit = limit(lease.policy.timeout_s);
        let Some(ended) = self.child::<TrialRecord>(lease, limit, lease.policy.memory_limit_mib).await? else {
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
        let limit = limit(lease.policy.timeout_s * JUDGE_TIME);
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
        let mut beat = tokio::time::interval(BEAT.min(queue::LEASE / 3));
        beat.tick().await;
        let mut held = Instant::now();
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
                () = self.asked(Phase::Stop) => {
                    self.store.give_back(lease).await?;
                    return Ok(None);
                }
                _ = beat.tick() => match self.store.renew(lease).await {
                    Ok(true) => held = Instant::now(),
                    Ok(false) => return Ok(None),
                    // A database that is busy for a while is no reason to throw minutes of work away.
                    Err(_) if held.elapsed() + SLACK < queue::LEASE => {}
                    Err(e) => return Err(e),
                },
            }
        }
    }

    /// Settles what is open and nobody works on; the number of jobs that this added.
    pub async fn settle_all(&self, study_id: i64) -> Result<u32> {
        let mut added = 0;
        let loose = self.store.loose_ends(study_id).await?;
        if loose.is_empty() {
            return Ok(0);
        }
        let policy = self.store.policy_of(study_id).await?;
        for id in loose {
            let run = self.store.label_of(study_id, &id).await?;
            added += self.settle(study_id, &id, &run, &policy).await?.trials_added;
        }
        Ok(added)
    }

    async fn settle(&self, study_id: i64, measurement_id: &str, run: &str, policy: &RepeatPolicy) -> Result<Settled> {
        let settled = self.store.settle(study_id, measurement_id, policy).await?;
        self.count_off(Kind::Trial, i64::from(settled.trials_added) - i64::from(settled.trials_cancelled));
        if settled.news && settled.status != RunStatus::Pending {
            (self.tell)(Event::RunEnded {
                study_id,
                measurement_id: measurement_id.to_string(),
                run: run.to_string(),
                status: settled.status,
                reason: settled.reason.clone(),
            });
        }
        Ok(settled)
    }
}

/// A year is no limit, and no duration overflows.
fn limit(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds.clamp(0.0, 365.0 * 86400.0))
}

fn accepted(how: Accepted) -> &'static str {
    match how {
        Accepted::Yes => "accepted",
        Accepted::Noisy => "noisy",
        Accepted::Fenced => "fenced",
    }
}
