//! Jobs are leased, renewed, given back and accepted once. Every lease raises the
//! job's epoch; whoever comes back with an older one is fenced off, so that an
//! attempt may execute twice but counts once.

use super::{Store, blob, now_ms, owner};
use crate::error::{Error, Result};
use crate::record::{Judgement, RunSpec, Series, TrialRecord};
use serde::{Deserialize, Serialize};
use sqlx::{QueryBuilder, Sqlite, Transaction};
use std::collections::BTreeMap;
use std::time::Duration;

/// A lease not renewed for so long is up for grabs.
pub const LEASE: Duration = Duration::from_secs(30);

/// Attempts lost with their worker (killed, machine gone) before a job counts as failed.
const LOST_LIMIT: i64 = 5;

/// Crashes before a job counts as failed: one may be another's fault (the
/// system's memory killer), two are its own.
const CRASH_LIMIT: i64 = 2;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// On the measuring lane, one at a time.
    Trial,
    /// Anywhere else.
    Judge,
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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accepted {
    Yes,
    /// The lease had passed to another, who alone counts.
    Fenced,
}

/// Counted work of a trial: must be equal between trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Work {
    pub counters: BTreeMap<String, f64>,
    /// Hash of each counted series.
    pub series: BTreeMap<String, String>,
    pub frames_hash: String,
}

impl Work {
    pub fn of(record: &TrialRecord) -> Work {
        let hash = |s: &Series| {
            let mut h = blake3::Hasher::new();
            s.values.iter().for_each(|v| {
                h.update(&v.to_bits().to_le_bytes());
            });
            h.finalize().to_hex()[..16].to_string()
        };
        Work {
            counters: record.counters.iter().map(|c| (c.name.clone(), c.value)).collect(),
            series: record.series.iter().filter(|s| !is_time(s)).map(|s| (s.name.clone(), hash(s))).collect(),
            frames_hash: record.frames_hash.clone(),
        }
    }
}

/// Times differ from trial to trial, everything else is counted.
fn is_time(s: &Series) -> bool {
    s.unit == "ns"
}

const CLAIM_TRIAL: &str = "UPDATE jobs SET state = 'leased', owner = $2, epoch = epoch + 1, attempts = attempts + 1, \
    lease_until_ms = $3 WHERE id = (SELECT j.id FROM jobs j WHERE j.kind = 'trial' AND j.state = 'queued' AND EXISTS \
    (SELECT 1 FROM study_runs r WHERE r.measurement_id = j.target AND r.study_id = $1) ORDER BY j.order_key LIMIT 1) \
    RETURNING id, target, repeat_index, take, epoch";

/// While one worker computes a truth, another judgement that needs the same one
/// would compute it twice: it waits until somebody has finished with that truth.
const CLAIM_JUDGE: &str = "UPDATE jobs SET state = 'leased', owner = $2, epoch = epoch + 1, attempts = attempts + 1, \
    lease_until_ms = $3 WHERE id = (SELECT j.id FROM jobs j WHERE j.kind = 'judge' AND j.state = 'queued' AND EXISTS \
    (SELECT 1 FROM study_runs r WHERE r.judgement_id = j.target AND r.study_id = $1) AND NOT (EXISTS \
    (SELECT 1 FROM jobs b WHERE b.kind = 'judge' AND b.group_key = j.group_key AND b.state = 'leased') AND NOT EXISTS \
    (SELECT 1 FROM jobs b WHERE b.kind = 'judge' AND b.group_key = j.group_key AND b.state = 'done')) \
    ORDER BY j.order_key LIMIT 1) RETURNING id, target, repeat_index, take, epoch";

impl Store {
    /// Leases the next job of `kind` in `study_id`, if one waits.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn lease(&self, study_id: i64, kind: Kind) -> Result<Option<Lease>> {
        self.lease_for(study_id, kind, LEASE).await
    }

    /// As [`Store::lease`] with another term.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn lease_for(&self, study_id: i64, kind: Kind, term: Duration) -> Result<Option<Lease>> {
        let explain = |e: sqlx::Error| self.explain("a lease", &e);
        let mut tx = self.begin("a lease").await?;
        reap(&mut tx).await.map_err(explain)?;
        let (now, me) = (now_ms(), owner::this());
        let row: Option<(i64, String, i64, i64, i64)> =
            sqlx::query_as(if kind == Kind::Trial { CLAIM_TRIAL } else { CLAIM_JUDGE })
                .bind(study_id)
                .bind(&me)
                .bind(now + term.as_millis() as i64)
                .fetch_optional(&mut *tx)
                .await
                .map_err(explain)?;
        let Some((id, target, repeat, take, epoch)) = row else {
            tx.commit().await.map_err(explain)?;
            return Ok(None);
        };
        sqlx::query("INSERT INTO attempts (job_id, epoch, owner, started_ms) VALUES ($1, $2, $3, $4)")
            .bind(id)
            .bind(epoch)
            .bind(&me)
            .bind(now)
            .execute(&mut *tx)
            .await
            .map_err(explain)?;
        let (json,): (String,) = sqlx::query_as(match kind {
            Kind::Trial => "SELECT spec_json FROM study_runs WHERE study_id = $1 AND measurement_id = $2 LIMIT 1",
            Kind::Judge => "SELECT spec_json FROM study_runs WHERE study_id = $1 AND judgement_id = $2 LIMIT 1",
        })
        .bind(study_id)
        .bind(&target)
        .fetch_one(&mut *tx)
        .await
        .map_err(explain)?;
        tx.commit().await.map_err(explain)?;
        let spec = self.parse(&json, "a run")?;
        let job = Job { id, kind, target, repeat: repeat as u32, take: take as u32 };
        Ok(Some(Lease { job, epoch, spec }))
    }

    /// Renews a lease. False when it has passed to another: stop the work.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn renew(&self, lease: &Lease) -> Result<bool> {
        let sql = "UPDATE jobs SET lease_until_ms = $3 WHERE id = $1 AND epoch = $2 AND state = 'leased'";
        let done = sqlx::query(sql)
            .bind(lease.job.id)
            .bind(lease.epoch)
            .bind(now_ms() + LEASE.as_millis() as i64)
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
        let mut tx = self.begin("the leases").await?;
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
            sqlx::query_as("SELECT count(*) FROM attempts WHERE job_id = $1 AND outcome = 'crashed'")
                .bind(lease.job.id)
                .fetch_one(&mut *tx)
                .await
                .map_err(explain)?;
        let last = name != "crashed" || crashes + 1 >= CRASH_LIMIT;
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

    /// Stores a trial, once. `wall_ns` is of the whole child process.
    /// It is on the disk when this returns.
    ///
    /// # Errors
    /// When the database fails or is full.
    pub async fn accept_trial(&self, lease: &Lease, record: &TrialRecord, wall_ns: u64) -> Result<Accepted> {
        let explain = |e: sqlx::Error| self.explain("a trial", &e);
        let rows = series_rows(record, lease.job.repeat, lease.job.take);
        self.durable(true).await?;
        let mut tx = self.begin("a trial").await?;
        let held = fence(&mut tx, lease, "done", None).await.map_err(explain)?;
        end_attempt(&mut tx, lease, if held { "accepted" } else { "fenced" }, None).await.map_err(explain)?;
        if held {
            insert_trial(&mut tx, lease, record, wall_ns).await.map_err(explain)?;
            insert_series(&mut tx, &lease.job.target, &rows).await.map_err(explain)?;
            insert_counters(&mut tx, &lease.job.target, record).await.map_err(explain)?;
            let answer_id = answer_of(&mut tx, &lease.job).await.map_err(explain)?;
            claim_frames_hash(&mut tx, &answer_id, &record.frames_hash).await.map_err(explain)?;
        }
        tx.commit().await.map_err(explain)?;
        self.durable(false).await?;
        Ok(if held { Accepted::Yes } else { Accepted::Fenced })
    }

    /// Stores a judgement, once. It is on the disk when this returns.
    ///
    /// # Errors
    /// When the database fails or is full.
    pub async fn accept_judgement(&self, lease: &Lease, judgement: &Judgement, wall_ns: u64) -> Result<Accepted> {
        let explain = |e: sqlx::Error| self.explain("a judgement", &e);
        self.durable(true).await?;
        let mut tx = self.begin("a judgement").await?;
        let held = fence(&mut tx, lease, "done", None).await.map_err(explain)?;
        end_attempt(&mut tx, lease, if held { "accepted" } else { "fenced" }, None).await.map_err(explain)?;
        if held {
            let answer_id = answer_of(&mut tx, &lease.job).await.map_err(explain)?;
            let class = serde_json::to_value(judgement.class).ok().and_then(|v| v.as_str().map(str::to_string));
            sqlx::query(
                "INSERT INTO judgements (judgement_id, answer_id, class, wrong, frames_hash, record_json, accepted_ms, \
                 wall_ns) VALUES ($1, $2, $3, $4, $5, $6, $7, $8) ON CONFLICT DO NOTHING",
            )
            .bind(&lease.job.target)
            .bind(&answer_id)
            .bind(class.unwrap_or_default())
            .bind(&judgement.wrong)
            .bind(&judgement.frames_hash)
            .bind(serde_json::to_string(judgement).expect("a judgement is plain data"))
            .bind(now_ms())
            .bind(wall_ns as i64)
            .execute(&mut *tx)
            .await
            .map_err(explain)?;
            claim_frames_hash(&mut tx, &answer_id, &judgement.frames_hash).await.map_err(explain)?;
        }
        tx.commit().await.map_err(explain)?;
        self.durable(false).await?;
        Ok(if held { Accepted::Yes } else { Accepted::Fenced })
    }

    /// A trial as its child process reported it, every bit of it.
    ///
    /// # Errors
    /// When there is none or the database fails.
    pub async fn trial_record(&self, measurement_id: &str, repeat: u32, take: u32) -> Result<TrialRecord> {
        let explain = |e: sqlx::Error| self.explain("reading a trial", &e);
        let row: Option<(String,)> = sqlx::query_as(
            "SELECT record_json FROM trials WHERE measurement_id = $1 AND repeat_index = $2 AND take = $3",
        )
        .bind(measurement_id)
        .bind(i64::from(repeat))
        .bind(i64::from(take))
        .fetch_optional(&self.readers)
        .await
        .map_err(explain)?;
        let (json,) = row.ok_or_else(|| Error::new(format!("no trial {repeat} is stored")).key(measurement_id))?;
        let mut record: TrialRecord = self.parse(&json, "a trial")?;
        let rows: Vec<(String, String, String, Vec<u8>)> = sqlx::query_as(
            "SELECT role, name, unit, data FROM series WHERE measurement_id = $1 AND ((repeat_index = $2 AND take = $3) \
             OR repeat_index = -1) ORDER BY role, ordinal",
        )
        .bind(measurement_id)
        .bind(i64::from(repeat))
        .bind(i64::from(take))
        .fetch_all(&self.readers)
        .await
        .map_err(explain)?;
        for (role, name, unit, data) in rows {
            let values = blob::decode(&data).map_err(|e| e.in_file(&self.path).key(measurement_id))?;
            match role.as_str() {
                "pass" => record.passes_ns.push(values),
                _ => record.series.push(Series { name, unit, values }),
            }
        }
        // A single pass is the series itself and is not stored twice.
        if record.passes_ns.is_empty()
            && let Some(cull) = record.series.iter().find(|s| s.name == "cull_ns")
        {
            record.passes_ns.push(cull.values.clone());
        }
        Ok(record)
    }

    /// Leases may be lost in a power failure, results may not. `synchronous` is a
    /// property of the one writing connection and is set between transactions.
    async fn durable(&self, on: bool) -> Result<()> {
        let sql = if on { "PRAGMA synchronous = FULL" } else { "PRAGMA synchronous = NORMAL" };
        sqlx::query(sql).execute(&self.writer).await.map_err(|e| self.explain("the database's settings", &e))?;
        Ok(())
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
async fn reap(tx: &mut Transaction<'_, Sqlite>) -> sqlx::Result<u64> {
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
        sqlx::query(
            "UPDATE jobs SET state = CASE WHEN attempts >= $2 THEN 'failed' ELSE 'queued' END, \
             reason = CASE WHEN attempts >= $2 THEN 'its worker was lost ' || attempts || ' times' ELSE reason END, \
             owner = NULL WHERE id = $1",
        )
        .bind(id)
        .bind(LOST_LIMIT)
        .execute(&mut **tx)
        .await?;
    }
    Ok(expired.len() as u64)
}

/// Moves a leased job on, if the lease is still the latest one.
async fn fence(
    tx: &mut Transaction<'_, Sqlite>,
    lease: &Lease,
    state: &str,
    reason: Option<&str>,
) -> sqlx::Result<bool> {
    let sql = "UPDATE jobs SET state = $3, reason = $4, owner = NULL, lease_until_ms = 0 \
               WHERE id = $1 AND epoch = $2 AND state = 'leased'";
    let done =
        sqlx::query(sql).bind(lease.job.id).bind(lease.epoch).bind(state).bind(reason).execute(&mut **tx).await?;
    Ok(done.rows_affected() == 1)
}

async fn end_attempt(
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

/// Read, not hashed again: the spec's text may be older than this program.
async fn answer_of(tx: &mut Transaction<'_, Sqlite>, job: &Job) -> sqlx::Result<String> {
    sqlx::query_scalar(match job.kind {
        Kind::Trial => "SELECT answer_id FROM measurements WHERE measurement_id = $1",
        Kind::Judge => "SELECT answer_id FROM measurements WHERE judgement_id = $1 LIMIT 1",
    })
    .bind(&job.target)
    .fetch_one(&mut **tx)
    .await
}

/// The first to answer fixes the hash of all frames; `settle` compares the others with it.
async fn claim_frames_hash(tx: &mut Transaction<'_, Sqlite>, answer_id: &str, hash: &str) -> sqlx::Result<()> {
    sqlx::query("UPDATE answers SET frames_hash = $2 WHERE answer_id = $1 AND frames_hash IS NULL")
        .bind(answer_id)
        .bind(hash)
        .execute(&mut **tx)
        .await?;
    Ok(())
}

async fn insert_trial(
    tx: &mut Transaction<'_, Sqlite>,
    lease: &Lease,
    record: &TrialRecord,
    wall_ns: u64,
) -> sqlx::Result<()> {
    let environment = serde_json::to_string(&record.environment).expect("an environment is plain data");
    let environment_id = blake3::hash(environment.as_bytes()).to_hex()[..32].to_string();
    sqlx::query("INSERT INTO environments (environment_id, machine_class, environment_json) VALUES ($1, $2, $3) ON CONFLICT DO NOTHING")
        .bind(&environment_id)
        .bind(&record.environment.machine_class)
        .bind(&environment)
        .execute(&mut **tx)
        .await?;
    let total: f64 = record.series.iter().find(|s| s.name == "cull_ns").map_or(0.0, |s| s.values.iter().sum());
    let sentinel_ns = record.sentinel.before_ns.max(record.sentinel.after_ns);
    let slim = TrialRecord { series: Vec::new(), passes_ns: Vec::new(), ..record.clone() };
    sqlx::query(
        "INSERT INTO trials (measurement_id, repeat_index, take, accepted_ms, wall_ns, total_cull_ns, build_ns, \
         prepare_ns, load_ns, peak_rss_bytes, sentinel_ns, switches, noise, noisy, environment_id, machine_class, \
         frames_hash, work_json, record_json) VALUES \
         ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, 1, 0, $13, $14, $15, $16, $17)",
    )
    .bind(&lease.job.target)
    .bind(i64::from(lease.job.repeat))
    .bind(i64::from(lease.job.take))
    .bind(now_ms())
    .bind(wall_ns as i64)
    .bind(total)
    .bind(record.build_ns as i64)
    .bind(record.prepare_ns as i64)
    .bind(record.load_ns as i64)
    .bind(record.peak_rss_bytes as i64)
    .bind(sentinel_ns)
    .bind(record.sentinel.involuntary_switches as i64)
    .bind(&environment_id)
    .bind(&record.environment.machine_class)
    .bind(&record.frames_hash)
    .bind(serde_json::to_string(&Work::of(record)).expect("work is plain data"))
    .bind(serde_json::to_string(&slim).expect("a record is plain data"))
    .execute(&mut **tx)
    .await?;
    Ok(())
}

struct SeriesRow {
    repeat: i64,
    take: i64,
    role: &'static str,
    ordinal: i64,
    name: String,
    unit: String,
    data: Vec<u8>,
}

fn series_rows(record: &TrialRecord, repeat: u32, take: u32) -> Vec<SeriesRow> {
    let row = |time: bool, role, ordinal: usize, name: &str, unit: &str, values: &[f64]| SeriesRow {
        repeat: if time { i64::from(repeat) } else { -1 },
        take: if time { i64::from(take) } else { 0 },
        role,
        ordinal: ordinal as i64,
        name: name.to_string(),
        unit: unit.to_string(),
        data: blob::encode(values),
    };
    let mut rows: Vec<SeriesRow> = record
        .series
        .iter()
        .enumerate()
        .map(|(i, s)| row(is_time(s), "series", i, &s.name, &s.unit, &s.values))
        .collect();
    if record.passes_ns.len() > 1 {
        rows.extend(record.passes_ns.iter().enumerate().map(|(i, v)| row(true, "pass", i, "cull_ns", "ns", v)));
    }
    rows
}

async fn insert_series(tx: &mut Transaction<'_, Sqlite>, measurement_id: &str, rows: &[SeriesRow]) -> sqlx::Result<()> {
    for chunk in rows.chunks(1000) {
        QueryBuilder::<Sqlite>::new(
            "INSERT INTO series (measurement_id, repeat_index, take, role, ordinal, name, unit, data) ",
        )
        .push_values(chunk, |mut q, r| {
            q.push_bind(measurement_id.to_string()).push_bind(r.repeat).push_bind(r.take).push_bind(r.role);
            q.push_bind(r.ordinal).push_bind(r.name.clone()).push_bind(r.unit.clone()).push_bind(r.data.clone());
        })
        .push(" ON CONFLICT DO NOTHING")
        .build()
        .execute(&mut **tx)
        .await?;
    }
    Ok(())
}

/// Counters of the path and figures of the structure, by name, once a measurement.
async fn insert_counters(
    tx: &mut Transaction<'_, Sqlite>,
    measurement_id: &str,
    record: &TrialRecord,
) -> sqlx::Result<()> {
    let b = &record.build;
    let figures = [
        ("nodes", "nodes", b.nodes),
        ("leaves", "leaves", b.leaves),
        ("depth", "levels", b.depth),
        ("largest_leaf", "triangles", b.largest_leaf),
        ("oversized_leaves", "leaves", b.oversized_leaves),
        ("structure_bytes", "bytes", record.structure_bytes),
        ("test_bytes", "bytes", record.test_bytes),
        ("entries", "triangles", record.entries),
        ("scene_triangles", "triangles", record.scene_triangles),
        ("dropped_triangles", "triangles", record.load.dropped()),
    ];
    let mut rows: Vec<(String, String, f64)> =
        figures.iter().map(|(n, u, v)| (n.to_string(), u.to_string(), *v as f64)).collect();
    rows.extend(record.counters.iter().map(|c| (c.name.clone(), c.unit.clone(), c.value)));
    QueryBuilder::<Sqlite>::new("INSERT INTO counters (measurement_id, name, unit, value) ")
        .push_values(&rows, |mut q, (name, unit, value)| {
            q.push_bind(measurement_id.to_string()).push_bind(name.clone()).push_bind(unit.clone()).push_bind(*value);
        })
        .push(" ON CONFLICT DO NOTHING")
        .build()
        .execute(&mut **tx)
        .await?;
    Ok(())
}
