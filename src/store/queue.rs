//! Jobs are leased, renewed, given back and accepted once. Every lease raises the
//! job's epoch; whoever comes back with an older one is fenced off, so that an
//! attempt may execute twice but counts once.

use super::{Store, now_ms, owner};
use crate::error::{Error, Result};
use crate::record::{RepeatPolicy, RunSpec};
use serde::{Deserialize, Serialize};
use sqlx::{Sqlite, Transaction};
use std::time::Duration;

/// A lease not renewed for so long is up for grabs.
pub const LEASE: Duration = Duration::from_secs(30);

/// Attempts lost with their worker (killed, machine gone) before a job counts as failed.
const LOST_LIMIT: i64 = 5;

/// Crashes before a job counts as failed: one may be another's fault (the
/// system's memory killer), two are its own.
const CRASH_LIMIT: i64 = 2;

/// The same where somebody killed it: an operator, or the system's memory killer, who may
/// have taken it for another's hunger more than once.
const KILLED_LIMIT: i64 = 4;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// On the measuring lane, one at a time.
    Trial,
    /// Anywhere else.
    Judge,
}

impl Kind {
    pub fn word(self) -> &'static str {
        match self {
            Kind::Trial => "trial",
            Kind::Judge => "judge",
        }
    }
}

/// What is to be done: identity within the queue.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Job {
    pub id: i64,
    pub kind: Kind,
    /// A measurement (trial) or a judgement (judge).
    pub target: String,
    pub repeat: u32,
    /// 1 for the second take of a noisy repeat.
    pub take: u32,
}

/// The right to do a job until it runs out or is renewed.
#[derive(Debug, Clone, PartialEq)]
pub struct Lease {
    pub job: Job,
    pub epoch: i64,
    pub spec: RunSpec,
    /// How progress and logs call the run.
    pub label: String,
    /// On whose behalf it is done, and how that study repeats and limits its trials.
    pub study_id: i64,
    pub policy: RepeatPolicy,
}

/// How an attempt ended without a result.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The program named an error: trying again would only repeat it.
    Refused(String),
    TimedOut(String),
    /// Died without a word; tried once more.
    Crashed(String),
}

/// Jobs that wait or are under way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Left {
    pub trials: i64,
    pub judgements: i64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accepted {
    Yes,
    /// Stored and marked: the machine was disturbed meanwhile.
    Noisy,
    /// The lease had passed to another, who alone counts.
    Fenced,
}

/// Since the job was last queued anew: `attempts` then began at nought, epochs never do.
const CRASHES: &str = "SELECT count(*) FROM attempts a JOIN jobs j ON j.id = a.job_id \
    WHERE a.job_id = $1 AND a.outcome = 'crashed' AND a.epoch > j.epoch - j.attempts";

/// The same of attempts lost: a crash of the child is none.
const LOSSES: &str = "SELECT count(*) FROM attempts a JOIN jobs j ON j.id = a.job_id \
    WHERE a.job_id = $1 AND a.outcome = 'lost' AND a.epoch > j.epoch - j.attempts";

impl Store {
    /// Renews a lease. False when it has passed to another: stop the work.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn renew(&self, lease: &Lease) -> Result<bool> {
        let sql =
            "UPDATE jobs SET lease_until_ms = $3 WHERE id = $1 AND epoch = $2 AND state = 'leased' AND target = $4";
        let done = sqlx::query(sql)
            .bind(lease.job.id)
            .bind(lease.epoch)
            .bind(now_ms() + LEASE.as_millis() as i64)
            .bind(&lease.job.target)
            .execute(&self.writer)
            .await
            .map_err(|e| self.explain("a lease", &e))?;
        Ok(done.rows_affected() == 1)
    }

    /// Gives a job back undone, as if it had not been taken.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn give_back(&self, lease: &Lease) -> Result<()> {
        let explain = |e: sqlx::Error| self.explain("a lease", &e);
        let mut tx = self.begin("a lease").await?;
        if fence(&mut tx, lease, "queued", None).await.map_err(explain)? {
            sqlx::query("UPDATE jobs SET attempts = attempts - 1 WHERE id = $1")
                .bind(lease.job.id)
                .execute(&mut *tx)
                .await
                .map_err(explain)?;
            end_attempt(&mut tx, lease, "returned", None).await.map_err(explain)?;
        }
        tx.commit().await.map_err(explain)
    }

    /// Returns leases whose holder is known to be dead, and those run out, to the queue.
    /// The number of jobs returned.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn return_orphans(&self) -> Result<u64> {
        let explain = |e: sqlx::Error| self.explain("the leases", &e);
        let mut tx = self.begin("a lease").await?;
        let leased: Vec<(i64, String)> = sqlx::query_as("SELECT id, owner FROM jobs WHERE state = 'leased'")
            .fetch_all(&mut *tx)
            .await
            .map_err(explain)?;
        for (id, owner) in leased {
            if owner::is_dead(&owner) {
                sqlx::query("UPDATE jobs SET lease_until_ms = 0 WHERE id = $1")
                    .bind(id)
                    .execute(&mut *tx)
                    .await
                    .map_err(explain)?;
            }
        }
        let returned = reap(&mut tx).await.map_err(explain)?;
        tx.commit().await.map_err(explain)?;
        Ok(returned)
    }

    /// Ends a lease without a result. True when the job is now failed for good.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn fail(&self, lease: &Lease, outcome: &Outcome) -> Result<bool> {
        let explain = |e: sqlx::Error| self.explain("a failure", &e);
        let (name, reason) = match outcome {
            Outcome::Refused(r) => ("refused", r),
            Outcome::TimedOut(r) => ("timed_out", r),
            Outcome::Crashed(r) => ("crashed", r),
        };
        let mut tx = self.begin("a failure").await?;
        let (crashes,): (i64,) =
            sqlx::query_as(CRASHES).bind(lease.job.id).fetch_one(&mut *tx).await.map_err(explain)?;
        let limit = if reason.contains("SIGKILL") { KILLED_LIMIT } else { CRASH_LIMIT };
        let last = name != "crashed" || crashes + 1 >= limit;
        let reason = if name == "crashed" && last {
            format!("{reason} (attempt {} of it)", crashes + 1)
        } else {
            reason.clone()
        };
        let held =
            fence(&mut tx, lease, if last { "failed" } else { "queued" }, Some(&reason)).await.map_err(explain)?;
        end_attempt(&mut tx, lease, if held { name } else { "fenced" }, Some(&reason)).await.map_err(explain)?;
        tx.commit().await.map_err(explain)?;
        Ok(held && last)
    }

    /// Jobs of the study that wait or are under way.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn jobs_left(&self, study_id: i64) -> Result<Left> {
        let (trials, judgements): (i64, i64) = sqlx::query_as(
            "SELECT coalesce(sum(j.kind = 'trial'), 0), coalesce(sum(j.kind = 'judge'), 0) FROM jobs j \
             WHERE j.state IN ('queued', 'leased') AND \
             ((j.kind = 'trial' AND j.target IN (SELECT measurement_id FROM study_runs WHERE study_id = $1)) OR \
             (j.kind = 'judge' AND j.target IN (SELECT judgement_id FROM study_runs WHERE study_id = $1)))",
        )
        .bind(study_id)
        .fetch_one(&self.writer)
        .await
        .map_err(|e| self.explain("reading the queue", &e))?;
        Ok(Left { trials, judgements })
    }

    /// Whether a trial of the study waits.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn has_queued_trial(&self, study_id: i64) -> Result<bool> {
        sqlx::query_scalar(
            "SELECT EXISTS (SELECT 1 FROM jobs j WHERE j.kind = 'trial' AND j.state = 'queued' AND EXISTS \
             (SELECT 1 FROM study_runs r WHERE r.measurement_id = j.target AND r.study_id = $1))",
        )
        .bind(study_id)
        .fetch_one(&self.writer)
        .await
        .map_err(|e| self.explain("reading the queue", &e))
    }

    pub(super) fn parse<T: for<'a> Deserialize<'a>>(&self, json: &str, what: &str) -> Result<T> {
        serde_json::from_str(json).map_err(|e| {
            Error::new(format!("{what} in the database cannot be read: {e}"))
                .in_file(&self.path)
                .help("another version of cullmark may have written it; use that one, or another file with --db")
        })
    }
}

/// Leases that ran out go back to the queue, or fail when lost too often.
pub(super) async fn reap(tx: &mut Transaction<'_, Sqlite>) -> sqlx::Result<u64> {
    let expired: Vec<(i64, i64)> =
        sqlx::query_as("SELECT id, epoch FROM jobs WHERE state = 'leased' AND lease_until_ms < $1")
            .bind(now_ms())
            .fetch_all(&mut **tx)
            .await?;
    for (id, epoch) in &expired {
        sqlx::query(
            "UPDATE attempts SET outcome = 'lost', ended_ms = $3 WHERE job_id = $1 AND epoch = $2 AND outcome IS NULL",
        )
        .bind(id)
        .bind(epoch)
        .bind(now_ms())
        .execute(&mut **tx)
        .await?;
        let lost: i64 = sqlx::query_scalar(LOSSES).bind(id).fetch_one(&mut **tx).await?;
        sqlx::query(
            "UPDATE jobs SET state = CASE WHEN $3 >= $2 THEN 'failed' ELSE 'queued' END, \
             reason = CASE WHEN $3 >= $2 THEN 'its worker was lost ' || $3 || ' times' ELSE reason END, \
             owner = NULL WHERE id = $1",
        )
        .bind(id)
        .bind(LOST_LIMIT)
        .bind(lost)
        .execute(&mut **tx)
        .await?;
    }
    Ok(expired.len() as u64)
}

/// Moves a leased job on, if the lease is still the latest one.
pub(super) async fn fence(
    tx: &mut Transaction<'_, Sqlite>,
    lease: &Lease,
    state: &str,
    reason: Option<&str>,
) -> sqlx::Result<bool> {
    // The target too: SQLite may have given the number of a deleted job to another one.
    let sql = "UPDATE jobs SET state = $3, reason = $4, owner = NULL, lease_until_ms = 0 \
               WHERE id = $1 AND epoch = $2 AND state = 'leased' AND target = $5";
    let done = sqlx::query(sql)
        .bind(lease.job.id)
        .bind(lease.epoch)
        .bind(state)
        .bind(reason)
        .bind(&lease.job.target)
        .execute(&mut **tx)
        .await?;
    Ok(done.rows_affected() == 1)
}

pub(super) async fn end_attempt(
    tx: &mut Transaction<'_, Sqlite>,
    lease: &Lease,
    outcome: &str,
    detail: Option<&str>,
) -> sqlx::Result<()> {
    sqlx::query("UPDATE attempts SET ended_ms = $3, outcome = $4, detail = $5 WHERE job_id = $1 AND epoch = $2")
        .bind(lease.job.id)
        .bind(lease.epoch)
        .bind(now_ms())
        .bind(outcome)
        .bind(detail)
        .execute(&mut **tx)
        .await?;
    Ok(())
}
