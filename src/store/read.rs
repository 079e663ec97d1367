//! Results of a study, put together from rows. Medians over trials are computed
//! here from the stored series, so that nothing derived is stored twice.

use super::fetch::{Scope, SeriesRow, TrialRow};
use super::{Store, blob};
use crate::culling::Tally;
use crate::error::{Error, ErrorKind, Result, did_you_mean};
use crate::record::{Judgement, observed_class};
use crate::results::{Excluded, RunResult, RunStatus, StudyResults, TrialSummary};
use crate::stats;
use rayon::prelude::*;
use sqlx::FromRow;
use std::collections::{BTreeMap, HashMap};

/// How much of each run to read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// Statuses, counters, errors and totals of trials: for tables and filters.
    Summary,
    /// Also the numbers of every frame: for charts.
    Frames,
}

#[derive(FromRow)]
pub(super) struct StudyRow {
    pub id: i64,
    name: String,
    title: String,
    manifest_toml: String,
    claims_json: String,
    sweeps_json: String,
    advice_json: String,
    pub policy_json: String,
    consolidate_frames: i64,
    pub machine_class: String,
    created_ms: i64,
}

#[derive(FromRow)]
struct RunRow {
    measurement_id: String,
    judgement_id: String,
    spec_json: String,
    structure_label: String,
    culling_label: String,
    walk_label: String,
    answer_id: String,
    machine_class: String,
    status: String,
    reason: Option<String>,
    stop_reason: Option<String>,
}

const RUN_ROWS: &str = "SELECT r.measurement_id, r.judgement_id, r.spec_json, r.structure_label, r.culling_label, \
    r.walk_label, m.answer_id, m.machine_class, m.status, m.reason, m.stop_reason FROM study_runs r \
    JOIN measurements m ON m.measurement_id = r.measurement_id WHERE r.study_id = $1";

impl Store {
    /// Everything of `study`: a name (its latest series) or `name@series`.
    ///
    /// # Errors
    /// When there is no such study, a row cannot be read or the database fails.
    pub async fn results(&self, study: &str) -> Result<StudyResults> {
        self.results_with(study, Detail::Frames).await
    }

    /// As [`Store::results`], with or without the numbers of every frame.
    ///
    /// # Errors
    /// As [`Store::results`].
    pub async fn results_with(&self, study: &str, detail: Detail) -> Result<StudyResults> {
        let explain = |e: sqlx::Error| self.explain("reading the study", &e);
        let study = self.find(study).await?;
        let rows: Vec<RunRow> = sqlx::query_as(sqlx::AssertSqlSafe(format!("{RUN_ROWS} ORDER BY r.ordinal")))
            .bind(study.id)
            .fetch_all(&self.readers)
            .await
            .map_err(explain)?;
        let runs = self.runs_of(&rows, Scope::Study(study.id), Scope::Study(study.id), detail).await?;
        self.around(study, runs).await
    }

    /// What belongs to a study besides its runs.
    async fn around(&self, study: StudyRow, runs: Vec<RunResult>) -> Result<StudyResults> {
        let explain = |e: sqlx::Error| self.explain("reading the study", &e);
        let excluded: Vec<(String, String, i64)> =
            sqlx::query_as("SELECT cell, why, cells FROM excluded WHERE study_id = $1 ORDER BY ordinal")
                .bind(study.id)
                .fetch_all(&self.readers)
                .await
                .map_err(explain)?;
        Ok(StudyResults {
            sweeps: self.parse(&study.sweeps_json, "the sweeps")?,
            advice: self.parse(&study.advice_json, "the advice")?,
            name: study.name,
            title: study.title,
            manifest_toml: study.manifest_toml,
            created_utc: utc(study.created_ms),
            runs,
            excluded: excluded
                .into_iter()
                .map(|(cell, why, count)| Excluded { cell, why, count: count as u64 })
                .collect(),
            environments: self.environments_of(study.id).await?,
            consolidate_frames: study.consolidate_frames as u32,
        })
    }

    /// As [`Store::results_with`] of some runs, by their measurements.
    ///
    /// # Errors
    /// As [`Store::results`].
    pub async fn results_of(&self, study: &str, ids: &[String], detail: Detail) -> Result<StudyResults> {
        let row = self.find(study).await?;
        let runs = self.some_results(row.id, ids, detail).await?;
        self.around(row, runs).await
    }

    /// Some runs of a study by their measurements, in the order of the matrix.
    ///
    /// # Errors
    /// When there is no such study, a row cannot be read or the database fails.
    pub async fn some_results(&self, study_id: i64, ids: &[String], detail: Detail) -> Result<Vec<RunResult>> {
        let list = serde_json::to_string(ids).expect("ids are text");
        let sql = format!("{RUN_ROWS} AND r.measurement_id IN (SELECT value FROM json_each($2)) ORDER BY r.ordinal");
        let rows: Vec<RunRow> = sqlx::query_as(sqlx::AssertSqlSafe(sql))
            .bind(study_id)
            .bind(&list)
            .fetch_all(&self.readers)
            .await
            .map_err(|e| self.explain("reading the study", &e))?;
        let judged: Vec<&str> = rows.iter().map(|r| r.judgement_id.as_str()).collect();
        let judged = serde_json::to_string(&judged).expect("ids are text");
        self.runs_of(&rows, Scope::Runs(&list), Scope::Runs(&judged), detail).await
    }

    async fn runs_of(
        &self,
        rows: &[RunRow],
        scope: Scope<'_>,
        judged: Scope<'_>,
        detail: Detail,
    ) -> Result<Vec<RunResult>> {
        let trials = self.trials_of(scope).await?;
        let counters = self.counters_of(scope).await?;
        let judgements = self.judgements_of(judged).await?;
        let series = if detail == Detail::Frames { self.series_of(scope).await? } else { HashMap::new() };
        rows.par_iter()
            .map(|row| {
                let id = row.measurement_id.as_str();
                self.run_of(
                    row,
                    trials.get(id).map_or(&[][..], Vec::as_slice),
                    series.get(id).map_or(&[][..], Vec::as_slice),
                    counters.get(id),
                    judgements.get(&row.judgement_id),
                )
            })
            .collect()
    }

    /// The claims of a study, as the JSON that was submitted.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn claims_json(&self, study: &str) -> Result<String> {
        Ok(self.find(study).await?.claims_json)
    }

    pub(super) async fn find(&self, study: &str) -> Result<StudyRow> {
        let (name, series) = match study.rsplit_once('@') {
            Some((name, n)) if n.parse::<i64>().is_ok() => (name, n.parse::<i64>().ok()),
            _ => (study, None),
        };
        let row: Option<StudyRow> = sqlx::query_as(
            "SELECT id, name, title, manifest_toml, claims_json, sweeps_json, advice_json, policy_json, consolidate_frames, \
             machine_class, created_ms FROM studies WHERE (name = $1 AND $2 IS NULL) OR (name = $3 AND series = $2) \
             ORDER BY series DESC LIMIT 1",
        )
        .bind(study)
        .bind(series)
        .bind(name)
        .fetch_optional(&self.readers)
        .await
        .map_err(|e| self.explain("reading the studies", &e))?;
        if let Some(row) = row {
            return Ok(row);
        }
        let all: Vec<(String, i64)> =
            sqlx::query_as("SELECT name, series FROM studies ORDER BY submitted_ms DESC, id DESC LIMIT 200")
                .fetch_all(&self.readers)
                .await
                .map_err(|e| self.explain("reading the studies", &e))?;
        let names: Vec<String> = all.iter().take(12).map(|(name, series)| format!("{name}@{series}")).collect();
        let near = did_you_mean(name, all.iter().map(|s| s.0.as_str()));
        let help = match near {
            Some(near) if near != name => format!("did you mean `{near}`?"),
            _ if names.is_empty() => "it holds no study yet: `cullmark run experiments/quick.toml`".to_string(),
            _ => {
                let more = if all.len() > names.len() { ", and more" } else { "" };
                format!("it holds: {}{more}", names.join(", "))
            }
        };
        Err(Error::new(format!("there is no study `{study}` in the database"))
            .in_file(&self.path)
            .help(help)
            .kind(ErrorKind::Missing))
    }

    fn run_of(
        &self,
        row: &RunRow,
        trials: &[TrialRow],
        series: &[SeriesRow],
        counters: Option<&BTreeMap<String, f64>>,
        judgement: Option<&Judgement>,
    ) -> Result<RunResult> {
        let mut status = RunStatus::of(&row.status);
        let mut reason = row.reason.clone();
        // Another study may have judged the same answer more strictly, or this one not yet.
        if let Some(wrong) = judgement.and_then(|j| j.wrong.clone()) {
            (status, reason) = (RunStatus::Wrong, Some(wrong));
        } else if status == RunStatus::Done && !row.judgement_id.is_empty() && judgement.is_none() {
            status = RunStatus::Pending;
        }
        let best: Vec<&TrialRow> = trials
            .iter()
            .filter(|t| !trials.iter().any(|o| o.repeat_index == t.repeat_index && o.take > t.take))
            .filter(|_| status == RunStatus::Done)
            .collect();
        let decode = |s: &SeriesRow| blob::decode(&s.data).map_err(|e| e.in_file(&self.path).key(&row.measurement_id));
        let counted = |name: &str| match series.iter().find(|s| s.repeat_index == -1 && s.name == name) {
            Some(s) => decode(s),
            None => Ok(Vec::new()),
        };
        let mut further = BTreeMap::new();
        for name in Tally::BY_FRAME {
            let values = counted(name)?;
            if !values.is_empty() {
                further.insert(name.to_string(), values);
            }
        }
        let mut trial_cull_ns = Vec::new();
        for t in &best {
            let times =
                series.iter().find(|s| s.repeat_index == t.repeat_index && s.take == t.take && s.name == "cull_ns");
            if let Some(times) = times {
                trial_cull_ns.push(decode(times)?);
            }
        }
        Ok(RunResult {
            measurement_id: row.measurement_id.clone(),
            answer_id: row.answer_id.clone(),
            spec: self.parse(&row.spec_json, "a run")?,
            structure: row.structure_label.clone(),
            culling: row.culling_label.clone(),
            walk: row.walk_label.clone(),
            status,
            reason,
            stop_reason: row.stop_reason.clone(),
            class: judgement.map(|j| j.class),
            observed: judgement.and_then(|j| observed_class(j.removes, &j.frames)),
            machine_class: row.machine_class.clone(),
            trials: best.iter().map(|t| summary(t)).collect(),
            cull_ns: median_by_frame(&trial_cull_ns),
            triangles: counted("triangles")?,
            entries: counted("entries")?,
            draw_calls: counted("draw_calls")?,
            nodes_visited: counted("nodes_visited")?,
            further,
            trial_cull_ns,
            counters: counters.cloned().unwrap_or_default(),
            errors: judgement.map_or_else(Vec::new, |j| j.frames.clone()),
        })
    }
}

fn summary(t: &TrialRow) -> TrialSummary {
    TrialSummary {
        repeat: t.repeat_index as u32,
        total_cull_ns: t.total_cull_ns,
        build_ns: t.build_ns as f64,
        prepare_ns: t.prepare_ns as f64,
        load_ns: t.load_ns as f64,
        peak_rss_bytes: t.peak_rss_bytes as f64,
        noise: t.noise,
        noisy: t.noisy != 0,
    }
}

/// Median over trials at each frame; frames that all trials have.
fn median_by_frame(trials: &[Vec<f64>]) -> Vec<f64> {
    let frames = trials.iter().map(Vec::len).min().unwrap_or(0);
    let mut column = Vec::with_capacity(trials.len());
    (0..frames)
        .map(|f| {
            column.clear();
            column.extend(trials.iter().map(|t| t[f]));
            stats::median(&column)
        })
        .collect()
}

/// `2026-11-23T10:42:50Z`.
pub(super) fn utc(ms: i64) -> String {
    match jiff::Timestamp::from_millisecond(ms) {
        Ok(t) => t.strftime("%Y-%m-%dT%H:%M:%SZ").to_string(),
        Err(_) => format!("{ms} ms"),
    }
}
