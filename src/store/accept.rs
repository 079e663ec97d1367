//! Accepting results: once, whole, and on the disk before the next trial starts.

use super::queue::{Accepted, Job, Kind, Lease, end_attempt, fence};
use super::{Store, blob, changes, noise, now_ms};
use crate::error::{Error, Result};
use crate::record::{Judgement, Series, TrialRecord};
use serde::{Deserialize, Serialize};
use sqlx::pool::PoolConnection;
use sqlx::{Connection, QueryBuilder, Sqlite, Transaction};
use std::collections::BTreeMap;

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

impl Store {
    /// Stores a trial, once, and whether it was disturbed. `wall_ns` is of the whole
    /// child process. It is on the disk when this returns.
    ///
    /// # Errors
    /// When the database fails or is full.
    pub async fn accept_trial(&self, lease: &Lease, record: &TrialRecord, wall_ns: u64) -> Result<Accepted> {
        let explain = |e: sqlx::Error| self.explain("a trial", &e);
        let rows = series_rows(record, lease.job.repeat, lease.job.take);
        let mut connection = self.durable().await?;
        let mut tx = connection.begin_with("BEGIN IMMEDIATE").await.map_err(explain)?;
        let held = fence(&mut tx, lease, "done", None).await.map_err(explain)?;
        end_attempt(&mut tx, lease, if held { "accepted" } else { "fenced" }, None).await.map_err(explain)?;
        let mut accepted = if held { Accepted::Yes } else { Accepted::Fenced };
        if held {
            // In the same transaction: a trial whose noise nobody weighed would pass for a quiet one.
            let (noise, noisy) = noise::of(&mut tx, record).await.map_err(explain)?;
            if noisy {
                accepted = Accepted::Noisy;
            }
            insert_trial(&mut tx, lease, record, wall_ns, (noise, noisy)).await.map_err(explain)?;
            insert_series(&mut tx, &lease.job.target, &rows).await.map_err(explain)?;
            insert_counters(&mut tx, &lease.job.target, record).await.map_err(explain)?;
            let answer_id = answer_of(&mut tx, &lease.job).await.map_err(explain)?;
            claim_frames_hash(&mut tx, &answer_id, &record.frames_hash).await.map_err(explain)?;
        }
        tx.commit().await.map_err(explain)?;
        self.relax(connection).await?;
        Ok(accepted)
    }

    /// Stores a judgement, once. It is on the disk when this returns.
    ///
    /// # Errors
    /// When the database fails or is full.
    pub async fn accept_judgement(&self, lease: &Lease, judgement: &Judgement, wall_ns: u64) -> Result<Accepted> {
        let explain = |e: sqlx::Error| self.explain("a judgement", &e);
        let mut connection = self.durable().await?;
        let mut tx = connection.begin_with("BEGIN IMMEDIATE").await.map_err(explain)?;
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
            changes::judged(&mut tx, &lease.job.target).await.map_err(explain)?;
        }
        tx.commit().await.map_err(explain)?;
        self.relax(connection).await?;
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

    /// The writing connection, set to reach the disk at every commit: leases may be
    /// lost in a power failure, results may not. It is held from here to [`Store::relax`],
    /// or another task of this process would set it back between the two.
    async fn durable(&self) -> Result<PoolConnection<Sqlite>> {
        let explain = |e: sqlx::Error| self.explain("the database's settings", &e);
        let mut connection = self.writer.acquire().await.map_err(explain)?;
        sqlx::query("PRAGMA synchronous = FULL").execute(&mut *connection).await.map_err(explain)?;
        Ok(connection)
    }

    /// Whoever fails to come here leaves a connection that is safe, only slower.
    async fn relax(&self, mut connection: PoolConnection<Sqlite>) -> Result<()> {
        let done = sqlx::query("PRAGMA synchronous = NORMAL").execute(&mut *connection).await;
        done.map(|_| ()).map_err(|e| self.explain("the database's settings", &e))
    }
}

/// Read, not hashed again: the spec's text may be older than this program.
async fn answer_of(tx: &mut Transaction<'_, Sqlite>, job: &Job) -> sqlx::Result<String> {
    sqlx::query_scalar(match job.kind {
        Kind::Trial => "SELECT answer_id FROM measurements WHERE measurement_id = $1",
        // By the cell: another study may have asked for another judgement of the measurement since.
        Kind::Judge => {
            "SELECT m.answer_id FROM study_runs r JOIN measurements m ON m.measurement_id = r.measurement_id \
             WHERE r.judgement_id = $1 UNION ALL SELECT answer_id FROM measurements WHERE judgement_id = $1 LIMIT 1"
        }
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
    (noise, noisy): (f64, bool),
) -> sqlx::Result<()> {
    let environment = serde_json::to_string(&record.environment).expect("an environment is plain data");
    let environment_id = blake3::hash(environment.as_bytes()).to_hex()[..32].to_string();
    sqlx::query("INSERT INTO environments (environment_id, machine_class, environment_json) VALUES ($1, $2, $3) ON CONFLICT DO NOTHING")
        .bind(&environment_id)
        .bind(&record.environment.machine_class)
        .bind(&environment)
        .execute(&mut **tx)
        .await?;
    let total: f64 = noise::frame_times(record).iter().sum();
    let sentinel_ns = noise::sentinel_ns(record);
    let slim = TrialRecord { series: Vec::new(), passes_ns: Vec::new(), ..record.clone() };
    sqlx::query(
        "INSERT INTO trials (measurement_id, repeat_index, take, accepted_ms, wall_ns, total_cull_ns, build_ns, \
         prepare_ns, load_ns, peak_rss_bytes, sentinel_ns, switches, noise, noisy, environment_id, machine_class, \
         frames_hash, work_json, record_json) VALUES \
         ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17, $18, $19)",
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
    .bind(noise)
    .bind(i64::from(noisy))
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
