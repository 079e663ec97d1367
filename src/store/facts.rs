//! What a reader needs of runs that it keeps in memory: their place in the matrix,
//! how they ended, and the numbers that were computed of them, which are kept here
//! as opaque bytes so that a restarted program need not compute them again.

use super::Store;
use crate::error::{Error, ErrorKind, Result};
use sqlx::{FromRow, QueryBuilder, Sqlite};

/// A run as a list shows it.
#[derive(Debug, Clone, FromRow)]
pub struct RunLine {
    pub ordinal: i64,
    pub measurement_id: String,
    pub judgement_id: String,
    pub answer_id: String,
    /// Only where [`Store::run_lines`] was asked for it.
    pub spec_json: Option<String>,
    pub structure_label: String,
    pub culling_label: String,
    pub walk_label: String,
    pub machine_class: String,
    pub changed: i64,
    /// Computed at `facts_changed` by `facts_revision`.
    pub facts: Option<Vec<u8>>,
    pub facts_changed: Option<i64>,
    pub facts_revision: Option<String>,
}

impl RunLine {
    /// The stored facts, unless the run or the program changed since.
    pub fn fresh_facts(&self, revision: &str) -> Option<&[u8]> {
        let fresh = self.facts_changed == Some(self.changed) && self.facts_revision.as_deref() == Some(revision);
        self.facts.as_deref().filter(|_| fresh)
    }
}

/// Facts to be kept.
#[derive(Debug, Clone)]
pub struct Fact {
    pub measurement_id: String,
    pub judgement_id: String,
    pub changed: i64,
    pub data: Vec<u8>,
}

impl Store {
    /// What changes when a study is submitted anew.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn stamp(&self, study_id: i64) -> Result<String> {
        let row: Option<(String, i64)> = sqlx::query_as("SELECT runs_hash, submitted_ms FROM studies WHERE id = $1")
            .bind(study_id)
            .fetch_optional(&self.readers)
            .await
            .map_err(|e| self.explain("reading the study", &e))?;
        let (hash, at) = row.ok_or_else(|| Error::new("the study was deleted").kind(ErrorKind::Missing))?;
        Ok(format!("{study_id}-{}-{at}", &hash[..hash.len().min(12)]))
    }

    /// The runs of a study that changed after `since` by the clock, in the order of the
    /// matrix; with their specs and only ordinals of `slice` if it is given.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn run_lines(&self, study_id: i64, since: i64, slice: Option<(i64, i64)>) -> Result<Vec<RunLine>> {
        let (spec, join, place) = match slice {
            Some(_) => ("r.spec_json", "study_runs r CROSS JOIN measurements m", "r.ordinal"),
            // From what changed, which is little; the sum keeps SQLite from walking all places of each.
            None => ("NULL", "measurements m CROSS JOIN study_runs r", "r.ordinal + 0"),
        };
        let (from, to) = slice.unwrap_or((0, i64::MAX));
        let sql = format!(
            "SELECT r.ordinal, r.measurement_id, r.judgement_id, m.answer_id, {spec} AS spec_json, r.structure_label, \
             r.culling_label, r.walk_label, m.machine_class, m.changed, f.data AS facts, f.changed AS facts_changed, \
             f.revision AS facts_revision FROM {join} \
             LEFT JOIN facts f ON f.measurement_id = r.measurement_id AND f.judgement_id = r.judgement_id \
             WHERE m.measurement_id = r.measurement_id AND r.study_id = $1 AND m.changed > $2 \
             AND {place} >= $3 AND {place} < $4 ORDER BY r.ordinal"
        );
        sqlx::query_as(sqlx::AssertSqlSafe(sql))
            .bind(study_id)
            .bind(since)
            .bind(from)
            .bind(to)
            .fetch_all(&self.readers)
            .await
            .map_err(|e| self.explain("reading the study", &e))
    }

    /// Keeps facts; older ones of the same runs are replaced.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn put_facts(&self, revision: &str, facts: &[Fact]) -> Result<()> {
        let explain = |e: sqlx::Error| self.explain("computed metrics", &e);
        for chunk in facts.chunks(1000) {
            let mut tx = self.begin("computed metrics").await?;
            QueryBuilder::<Sqlite>::new("INSERT INTO facts (measurement_id, judgement_id, changed, revision, data) ")
                .push_values(chunk, |mut row, f| {
                    row.push_bind(f.measurement_id.clone()).push_bind(f.judgement_id.clone());
                    row.push_bind(f.changed).push_bind(revision.to_string()).push_bind(f.data.clone());
                })
                .push(
                    " ON CONFLICT (measurement_id, judgement_id) DO UPDATE SET changed = excluded.changed, \
                     revision = excluded.revision, data = excluded.data",
                )
                .build()
                .execute(&mut *tx)
                .await
                .map_err(explain)?;
            tx.commit().await.map_err(explain)?;
        }
        Ok(())
    }
}
