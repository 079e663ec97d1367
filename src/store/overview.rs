//! Studies at a glance, for lists and for progress: counts alone, no results.

use super::Store;
use super::control::StudyState;
use super::read::utc;
use crate::error::{Error, ErrorKind, Result};
use serde::Serialize;
use sqlx::FromRow;
use std::collections::{HashMap, HashSet};

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct RunCounts {
    pub total: u64,
    pub pending: u64,
    pub done: u64,
    pub failed: u64,
    pub wrong: u64,
}

/// Jobs whose turn comes with this study; what it shares with an earlier one counts there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct JobCounts {
    pub trials: u64,
    pub judgements: u64,
    pub running: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Overview {
    #[serde(skip)]
    pub id: i64,
    /// `name@series`.
    #[serde(rename = "ref")]
    pub reference: String,
    pub name: String,
    pub series: u32,
    pub title: String,
    pub state: StudyState,
    pub priority: i64,
    pub machine_class: String,
    pub created: String,
    pub submitted: String,
    pub runs: RunCounts,
    pub excluded: u64,
    pub jobs: JobCounts,
    /// Nothing is left to do, or nothing will be done.
    pub finished: bool,
}

/// Counts of runs by study, kept between calls of [`Store::overviews`].
pub type Counted = HashMap<i64, Counts>;

#[derive(Debug, Clone, Copy)]
pub struct Counts {
    /// By the clock of changes.
    at: i64,
    submitted_ms: i64,
    runs: RunCounts,
}

#[derive(FromRow)]
struct Row {
    id: i64,
    name: String,
    series: i64,
    title: String,
    state: String,
    priority: i64,
    machine_class: String,
    created_ms: i64,
    submitted_ms: i64,
    excluded: i64,
}

const ROW: &str = "SELECT s.id, s.name, s.series, s.title, s.state, s.priority, s.machine_class, s.created_ms, \
    s.submitted_ms, (SELECT coalesce(sum(e.cells), 0) FROM excluded e WHERE e.study_id = s.id) AS excluded FROM studies s";

impl Store {
    /// The numbers and times of all studies, the latest submission first: for paging.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn study_ids(&self) -> Result<Vec<(i64, i64)>> {
        sqlx::query_as("SELECT submitted_ms, id FROM studies ORDER BY submitted_ms DESC, id DESC")
            .fetch_all(&self.readers)
            .await
            .map_err(|e| self.explain("reading the studies", &e))
    }

    /// The number of a study: a name (its latest series) or `name@series`.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn study_id(&self, study: &str) -> Result<i64> {
        Ok(self.find(study).await?.id)
    }

    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn overview(&self, study: &str) -> Result<Overview> {
        let id = self.find(study).await?.id;
        let mut found = self.overviews(&[id], &mut Counted::new()).await?;
        Ok(found.remove(0))
    }

    /// Studies by their numbers, in that order; those that are gone are left out. `counted`
    /// keeps the counts of runs between calls: what has not changed is not counted again.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn overviews(&self, ids: &[i64], counted: &mut Counted) -> Result<Vec<Overview>> {
        let explain = |e: sqlx::Error| self.explain("reading the studies", &e);
        let list = serde_json::to_string(ids).expect("numbers");
        let now = self.now().await?;
        // Those asked for alone: of a study that nobody looks at everything is new.
        let known = ids.iter().filter_map(|id| counted.get(id));
        let changed = match known.map(|c| c.at).min() {
            Some(at) if at < now => self.changed_since(at).await?,
            _ => HashSet::new(),
        };
        let sql = format!("{ROW} WHERE s.id IN (SELECT value FROM json_each($1))");
        let rows: Vec<Row> =
            sqlx::query_as(sqlx::AssertSqlSafe(sql)).bind(&list).fetch_all(&self.readers).await.map_err(explain)?;
        let jobs = self.job_counts(&list).await?;
        let mut found = HashMap::new();
        for row in rows {
            let runs = match counted.get(&row.id) {
                Some(c) if c.submitted_ms == row.submitted_ms && !changed.contains(&row.id) => c.runs,
                _ => self.run_counts(row.id).await?,
            };
            counted.insert(row.id, Counts { at: now, submitted_ms: row.submitted_ms, runs });
            let state = StudyState::of(&row.state);
            let left = jobs.get(&row.id).copied().unwrap_or_default();
            let overview = Overview {
                id: row.id,
                reference: format!("{}@{}", row.name, row.series),
                name: row.name,
                series: row.series as u32,
                title: row.title,
                state,
                priority: row.priority,
                machine_class: row.machine_class,
                created: utc(row.created_ms),
                submitted: utc(row.submitted_ms),
                runs,
                excluded: row.excluded as u64,
                jobs: left,
                finished: state == StudyState::Cancelled || (runs.pending == 0 && left.trials + left.judgements == 0),
            };
            found.insert(overview.id, overview);
        }
        Ok(ids.iter().filter_map(|id| found.remove(id)).collect())
    }

    /// Studies that hold a measurement which changed after `at`, or were submitted anew.
    async fn changed_since(&self, at: i64) -> Result<HashSet<i64>> {
        let ids: Vec<i64> = sqlx::query_scalar(
            // CROSS: from what changed, which is little, to its studies.
            "SELECT DISTINCT r.study_id FROM measurements m CROSS JOIN study_runs r \
             WHERE r.measurement_id = m.measurement_id AND m.changed > $1",
        )
        .bind(at)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading the studies", &e))?;
        Ok(ids.into_iter().collect())
    }

    async fn run_counts(&self, study_id: i64) -> Result<RunCounts> {
        let rows: Vec<(String, i64)> = sqlx::query_as(
            "SELECT m.status, count(*) FROM study_runs r JOIN measurements m ON m.measurement_id = r.measurement_id \
             WHERE r.study_id = $1 GROUP BY m.status",
        )
        .bind(study_id)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading the study", &e))?;
        let mut out = RunCounts::default();
        for (status, n) in rows {
            let n = n as u64;
            out.total += n;
            *match status.as_str() {
                "done" => &mut out.done,
                "failed" => &mut out.failed,
                "wrong" => &mut out.wrong,
                _ => &mut out.pending,
            } += n;
        }
        Ok(out)
    }

    /// Jobs that wait or are under way: kind, state, how many.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn queue_counts(&self) -> Result<Vec<(String, String, i64)>> {
        sqlx::query_as(
            "SELECT kind, state, count(*) FROM jobs WHERE kind IN ('trial', 'judge') AND state IN ('queued', 'leased') \
             GROUP BY kind, state",
        )
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading the queue", &e))
    }

    async fn job_counts(&self, ids: &str) -> Result<HashMap<i64, JobCounts>> {
        let rows: Vec<(i64, String, String, i64)> = sqlx::query_as(
            "SELECT study_id, kind, state, count(*) FROM jobs WHERE study_id IN (SELECT value FROM json_each($1)) \
             AND kind IN ('trial', 'judge') AND state IN ('queued', 'leased') GROUP BY study_id, kind, state",
        )
        .bind(ids)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading the queue", &e))?;
        let mut out: HashMap<i64, JobCounts> = HashMap::new();
        for (study, kind, state, n) in rows {
            let counts = out.entry(study).or_default();
            *if kind == "judge" { &mut counts.judgements } else { &mut counts.trials } += n as u64;
            if state == "leased" {
                counts.running += n as u64;
            }
        }
        Ok(out)
    }
}

/// What a study is about, besides its runs.
#[derive(Debug, Clone)]
pub struct About {
    pub manifest_toml: String,
    pub claims_json: String,
    pub policy_json: String,
    pub folder: String,
    pub excluded: Vec<crate::results::Excluded>,
    pub environments: std::collections::BTreeMap<String, crate::record::Environment>,
}

impl Store {
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn about(&self, study_id: i64) -> Result<About> {
        let explain = |e: sqlx::Error| self.explain("reading the study", &e);
        let row: Option<(String, String, String, String)> =
            sqlx::query_as("SELECT manifest_toml, claims_json, policy_json, folder FROM studies WHERE id = $1")
                .bind(study_id)
                .fetch_optional(&self.readers)
                .await
                .map_err(explain)?;
        let (manifest_toml, claims_json, policy_json, folder) =
            row.ok_or_else(|| Error::new("the study was deleted").kind(ErrorKind::Missing))?;
        let cells: Vec<(String, String, i64)> =
            sqlx::query_as("SELECT cell, why, cells FROM excluded WHERE study_id = $1 ORDER BY ordinal")
                .bind(study_id)
                .fetch_all(&self.readers)
                .await
                .map_err(explain)?;
        let excluded = cells
            .into_iter()
            .map(|(cell, why, count)| crate::results::Excluded { cell, why, count: count as u64 })
            .collect();
        let environments = self.environments_of(study_id).await?;
        Ok(About { manifest_toml, claims_json, policy_json, folder, excluded, environments })
    }

    /// Where a measurement stands in the matrix of a study.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn ordinal_of(&self, study_id: i64, measurement_id: &str) -> Result<Option<i64>> {
        sqlx::query_scalar("SELECT min(ordinal) FROM study_runs WHERE study_id = $1 AND measurement_id = $2")
            .bind(study_id)
            .bind(measurement_id)
            .fetch_one(&self.readers)
            .await
            .map_err(|e| self.explain("reading the study", &e))
    }
}
