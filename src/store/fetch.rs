//! The rows of a study, table by table, grouped by measurement.

use super::Store;
use crate::error::Result;
use crate::record::{Environment, Judgement};
use rayon::prelude::*;
use sqlx::{AssertSqlSafe, FromRow};
use std::collections::{BTreeMap, HashMap};

#[derive(FromRow, Clone)]
pub(super) struct TrialRow {
    pub measurement_id: String,
    pub repeat_index: i64,
    pub take: i64,
    pub total_cull_ns: f64,
    pub build_ns: i64,
    pub prepare_ns: i64,
    pub load_ns: i64,
    pub peak_rss_bytes: i64,
    pub noise: f64,
    pub noisy: i64,
}

#[derive(FromRow)]
pub(super) struct SeriesRow {
    pub measurement_id: String,
    pub repeat_index: i64,
    pub take: i64,
    pub name: String,
    pub data: Vec<u8>,
}

/// Of which measurements rows are read.
#[derive(Clone, Copy)]
pub(super) enum Scope<'a> {
    Study(i64),
    /// A JSON list of measurement ids.
    Runs(&'a str),
}

impl Scope<'_> {
    /// The sub-query that holds their ids; it has one placeholder.
    fn ids(self) -> &'static str {
        match self {
            Scope::Study(_) => "(SELECT measurement_id FROM study_runs WHERE study_id = $1)",
            Scope::Runs(_) => "(SELECT value FROM json_each($1))",
        }
    }
}

/// `$1` of [`Scope::ids`].
macro_rules! bind_scope {
    ($query:expr, $scope:expr) => {
        match $scope {
            Scope::Study(id) => $query.bind(id),
            Scope::Runs(ids) => $query.bind(ids),
        }
    };
}

impl Store {
    pub(super) async fn trials_of(&self, scope: Scope<'_>) -> Result<HashMap<String, Vec<TrialRow>>> {
        let sql = format!(
            "SELECT measurement_id, repeat_index, take, total_cull_ns, build_ns, prepare_ns, load_ns, \
             peak_rss_bytes, noise, noisy FROM trials WHERE measurement_id IN {} \
             ORDER BY measurement_id, repeat_index, take",
            scope.ids()
        );
        let rows: Vec<TrialRow> = bind_scope!(sqlx::query_as(AssertSqlSafe(sql)), scope)
            .fetch_all(&self.readers)
            .await
            .map_err(|e| self.explain("reading trials", &e))?;
        Ok(group(rows, |r| r.measurement_id.clone()))
    }

    pub(super) async fn series_of(&self, scope: Scope<'_>) -> Result<HashMap<String, Vec<SeriesRow>>> {
        let sql = format!(
            "SELECT measurement_id, repeat_index, take, name, data FROM series WHERE role = 'series' AND \
             measurement_id IN {} ORDER BY measurement_id, repeat_index, take, role, ordinal",
            scope.ids()
        );
        let rows: Vec<SeriesRow> = bind_scope!(sqlx::query_as(AssertSqlSafe(sql)), scope)
            .fetch_all(&self.readers)
            .await
            .map_err(|e| self.explain("reading series", &e))?;
        Ok(group(rows, |r| r.measurement_id.clone()))
    }

    pub(super) async fn counters_of(&self, scope: Scope<'_>) -> Result<HashMap<String, BTreeMap<String, f64>>> {
        let sql = format!("SELECT measurement_id, name, value FROM counters WHERE measurement_id IN {}", scope.ids());
        let rows: Vec<(String, String, f64)> = bind_scope!(sqlx::query_as(AssertSqlSafe(sql)), scope)
            .fetch_all(&self.readers)
            .await
            .map_err(|e| self.explain("reading counters", &e))?;
        let mut out: HashMap<String, BTreeMap<String, f64>> = HashMap::new();
        for (id, name, value) in rows {
            out.entry(id).or_default().insert(name, value);
        }
        Ok(out)
    }

    /// By judgement: of a study, or of the judgements in a JSON list of their own ids.
    pub(super) async fn judgements_of(&self, scope: Scope<'_>) -> Result<HashMap<String, Judgement>> {
        let ids = match scope {
            Scope::Study(_) => "(SELECT judgement_id FROM study_runs WHERE study_id = $1)",
            Scope::Runs(_) => scope.ids(),
        };
        let sql = format!("SELECT judgement_id, record_json FROM judgements WHERE judgement_id IN {ids}");
        let rows: Vec<(String, String)> = bind_scope!(sqlx::query_as(AssertSqlSafe(sql)), scope)
            .fetch_all(&self.readers)
            .await
            .map_err(|e| self.explain("reading judgements", &e))?;
        rows.into_par_iter().map(|(id, json)| Ok((id, self.parse(&json, "a judgement")?))).collect()
    }

    pub(super) async fn environments_of(&self, study_id: i64) -> Result<BTreeMap<String, Environment>> {
        let rows: Vec<(String, String)> = sqlx::query_as(
            // CROSS: environments are few, and their first trials are mostly of this study.
            "SELECT e.machine_class, e.environment_json FROM environments e WHERE EXISTS \
             (SELECT 1 FROM trials t CROSS JOIN study_runs r WHERE t.environment_id = e.environment_id \
             AND r.measurement_id = t.measurement_id AND r.study_id = $1)",
        )
        .bind(study_id)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading environments", &e))?;
        rows.into_iter().map(|(class, json)| Ok((class, self.parse(&json, "an environment")?))).collect()
    }
}

fn group<T>(rows: Vec<T>, key: impl Fn(&T) -> String) -> HashMap<String, Vec<T>> {
    let mut out: HashMap<String, Vec<T>> = HashMap::new();
    for row in rows {
        out.entry(key(&row)).or_default().push(row);
    }
    out
}
