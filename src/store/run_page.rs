//! All that is stored of one run, for whoever looks at it alone.

use super::read::utc;
use super::{Store, blob};
use crate::error::Result;
use crate::record::Environment;
use serde::Serialize;

/// A trial in numbers.
#[derive(Debug, Clone, Serialize)]
pub struct TrialLine {
    pub repeat: u32,
    pub take: u32,
    pub accepted: String,
    /// Times are none where they are withheld.
    pub total_cull_ms: Option<f64>,
    pub build_ms: Option<f64>,
    pub prepare_ms: Option<f64>,
    pub load_ms: Option<f64>,
    pub peak_rss_mib: Option<f64>,
    pub noise: f64,
    pub noisy: bool,
}

/// An attempt at a job, however it ended.
#[derive(Debug, Clone, Serialize)]
pub struct Attempt {
    pub kind: String,
    pub repeat: u32,
    pub take: u32,
    pub epoch: i64,
    pub owner: String,
    pub started: String,
    pub ended: Option<String>,
    pub outcome: Option<String>,
    pub detail: Option<String>,
}

/// One number a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameSeries {
    pub name: String,
    pub unit: String,
    /// None where all trials have the same.
    pub trial: Option<u32>,
    pub values: Vec<f64>,
}

impl Store {
    /// Trials, attempts, and the environment of the latest trial. Times of a run that is
    /// not done stay here: the caller decides whether to show them.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn run_history(
        &self,
        study_id: i64,
        measurement_id: &str,
    ) -> Result<(Vec<TrialLine>, Vec<Attempt>, Option<Environment>)> {
        let explain = |e: sqlx::Error| self.explain("reading the run", &e);
        type Trial = (i64, i64, i64, f64, i64, i64, i64, i64, f64, i64);
        let trials: Vec<Trial> = sqlx::query_as(
            "SELECT repeat_index, take, accepted_ms, total_cull_ns, build_ns, prepare_ns, load_ns, peak_rss_bytes, noise, \
             noisy FROM trials WHERE measurement_id = $1 ORDER BY repeat_index, take",
        )
        .bind(measurement_id)
        .fetch_all(&self.readers)
        .await
        .map_err(explain)?;
        let line = |(repeat, take, at, total, build, prepare, load, rss, noise, noisy): Trial| TrialLine {
            repeat: repeat as u32,
            take: take as u32,
            accepted: utc(at),
            total_cull_ms: Some(total / 1e6),
            build_ms: Some(build as f64 / 1e6),
            prepare_ms: Some(prepare as f64 / 1e6),
            load_ms: Some(load as f64 / 1e6),
            peak_rss_mib: Some(rss as f64 / f64::from(1 << 20)),
            noise,
            noisy: noisy != 0,
        };
        type Row = (String, i64, i64, i64, String, i64, Option<i64>, Option<String>, Option<String>);
        let attempts: Vec<Row> = sqlx::query_as(
            "SELECT j.kind, j.repeat_index, j.take, a.epoch, a.owner, a.started_ms, a.ended_ms, a.outcome, a.detail \
             FROM attempts a JOIN jobs j ON j.id = a.job_id WHERE (j.kind = 'trial' AND j.target = $1) OR \
             (j.kind = 'judge' AND j.target IN (SELECT judgement_id FROM study_runs WHERE study_id = $2 AND measurement_id = $1)) \
             ORDER BY a.started_ms, a.epoch LIMIT 500",
        )
        .bind(measurement_id)
        .bind(study_id)
        .fetch_all(&self.readers)
        .await
        .map_err(explain)?;
        let attempt = |(kind, repeat, take, epoch, owner, started, ended, outcome, detail): Row| Attempt {
            kind,
            repeat: repeat as u32,
            take: take as u32,
            epoch,
            // The machine's name and boot tell nothing here; the process does.
            owner: owner.rsplit(':').nth(1).map_or_else(String::new, |pid| format!("process {pid}")),
            started: utc(started),
            ended: ended.map(utc),
            outcome,
            detail,
        };
        let environment: Option<String> = sqlx::query_scalar(
            "SELECT e.environment_json FROM environments e JOIN trials t ON t.environment_id = e.environment_id \
             WHERE t.measurement_id = $1 ORDER BY t.accepted_ms DESC LIMIT 1",
        )
        .bind(measurement_id)
        .fetch_optional(&self.readers)
        .await
        .map_err(explain)?;
        Ok((
            trials.into_iter().map(line).collect(),
            attempts.into_iter().map(attempt).collect(),
            environment.map(|json| self.parse(&json, "an environment")).transpose()?,
        ))
    }

    /// Bytes of the stored series of some runs: what reading their frames costs.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn series_bytes(&self, ids: &[String]) -> Result<u64> {
        let list = serde_json::to_string(ids).expect("ids are text");
        let bytes: i64 = sqlx::query_scalar(
            "SELECT coalesce(sum(length(data)), 0) FROM series WHERE role = 'series' AND measurement_id IN \
             (SELECT value FROM json_each($1))",
        )
        .bind(&list)
        .fetch_one(&self.readers)
        .await
        .map_err(|e| self.explain("reading series", &e))?;
        Ok(bytes as u64)
    }

    /// Every series of a run: the best take of each trial, counted ones once.
    ///
    /// # Errors
    /// When the database fails or a series is damaged.
    pub async fn frame_series(&self, measurement_id: &str) -> Result<Vec<FrameSeries>> {
        let rows: Vec<(i64, i64, String, String, Vec<u8>)> = sqlx::query_as(
            "SELECT repeat_index, take, name, unit, data FROM series WHERE measurement_id = $1 AND role = 'series' \
             ORDER BY ordinal, repeat_index, take",
        )
        .bind(measurement_id)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading series", &e))?;
        let replaced = |repeat: i64, take: i64| rows.iter().any(|r| r.0 == repeat && r.1 > take);
        rows.iter()
            .filter(|r| !replaced(r.0, r.1))
            .map(|(repeat, _, name, unit, data)| {
                let values = blob::decode(data).map_err(|e| e.in_file(&self.path).key(measurement_id))?;
                let trial = u32::try_from(*repeat).ok();
                Ok(FrameSeries { name: name.clone(), unit: unit.clone(), trial, values })
            })
            .collect()
    }
}
