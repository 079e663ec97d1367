//! What is known of runs before they are asked for again: for plans, and for those who
//! go on with a study.

use super::Store;
use crate::error::Result;
use crate::record::{RepeatPolicy, RunSpec};
use crate::results::RunStatus;
use crate::stats;
use rayon::prelude::*;
use std::collections::HashMap;

/// What is known of a measurement: for `plan`.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownRun {
    pub status: RunStatus,
    pub reason: Option<String>,
    pub repeats: u32,
    /// Median wall time of a trial's process; none before the first.
    pub trial_wall_ns: Option<f64>,
}

impl Store {
    /// How a study is repeated, and on which class of machine.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn policy(&self, study: &str) -> Result<(RepeatPolicy, String)> {
        let row = self.find(study).await?;
        Ok((self.parse(&row.policy_json, "a policy")?, row.machine_class))
    }

    /// How a study by its number is repeated.
    ///
    /// # Errors
    /// When there is none or the database fails.
    pub async fn policy_of(&self, study_id: i64) -> Result<RepeatPolicy> {
        let json: String = sqlx::query_scalar("SELECT policy_json FROM studies WHERE id = $1")
            .bind(study_id)
            .fetch_one(&self.readers)
            .await
            .map_err(|e| self.explain("reading the study", &e))?;
        self.parse(&json, "a policy")
    }

    /// What is known of each of `ids`; those never seen are left out. For plans.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn known_runs(&self, ids: &[String]) -> Result<HashMap<String, KnownRun>> {
        let mut out = HashMap::new();
        for chunk in ids.chunks(1000) {
            let mut q = sqlx::QueryBuilder::<sqlx::Sqlite>::new(
                "SELECT m.measurement_id, m.status, m.reason, m.repeats, t.wall_ns FROM measurements m \
                 LEFT JOIN trials t ON t.measurement_id = m.measurement_id WHERE m.measurement_id IN (",
            );
            let mut list = q.separated(", ");
            for id in chunk {
                list.push_bind(id.clone());
            }
            q.push(")");
            type Row = (String, String, Option<String>, i64, Option<i64>);
            let rows: Vec<Row> = q
                .build_query_as()
                .fetch_all(&self.readers)
                .await
                .map_err(|e| self.explain("reading what is done", &e))?;
            let mut walls: HashMap<String, Vec<f64>> = HashMap::new();
            for (id, status, reason, repeats, wall) in rows {
                walls.entry(id.clone()).or_default().extend(wall.map(|w| w as f64));
                let known =
                    KnownRun { status: RunStatus::of(&status), reason, repeats: repeats as u32, trial_wall_ns: None };
                out.insert(id, known);
            }
            for (id, walls) in walls.into_iter().filter(|(_, w)| !w.is_empty()) {
                out.get_mut(&id).expect("inserted above").trial_wall_ns = Some(stats::median(&walls));
            }
        }
        Ok(out)
    }

    /// The cells of a stored study as they were submitted, to tell what changed.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn specs(&self, study: &str) -> Result<Vec<RunSpec>> {
        let study = self.find(study).await?;
        let rows: Vec<String> =
            sqlx::query_scalar("SELECT spec_json FROM study_runs WHERE study_id = $1 ORDER BY ordinal")
                .bind(study.id)
                .fetch_all(&self.readers)
                .await
                .map_err(|e| self.explain("reading the study", &e))?;
        rows.par_iter().map(|json| self.parse(json, "a run")).collect()
    }
}
