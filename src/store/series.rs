//! All measurements of one study: `run --series next` stores them under numbers.

use super::Store;
use super::read::Detail;
use crate::error::Result;
use crate::results::Measured;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

impl Store {
    /// Every series of `study` (a name, or `name@series` of any of them), the first first.
    ///
    /// # Errors
    /// When there is no such study, a row cannot be read or the database fails.
    pub async fn all_series(&self, study: &str, detail: Detail) -> Result<Vec<Measured>> {
        let id = self.find(study).await?.id;
        let rows: Vec<(i64, String, i64)> = sqlx::query_as(
            "SELECT id, name, series FROM studies WHERE name = (SELECT name FROM studies WHERE id = $1) ORDER BY series",
        )
        .bind(id)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading the studies", &e))?;
        let mut out = Vec::new();
        for (id, name, series) in rows {
            let results = self.results_with(&format!("{name}@{series}"), detail).await?;
            out.push(Measured { series: series as u32, results, frames_hashes: self.frames_hashes(id).await? });
        }
        Ok(out)
    }

    /// Of each measurement of a study the hashes of what its trials submitted.
    async fn frames_hashes(&self, study_id: i64) -> Result<BTreeMap<String, BTreeSet<String>>> {
        let rows: Vec<(String, String)> = sqlx::query_as(
            "SELECT measurement_id, frames_hash FROM trials WHERE measurement_id IN \
             (SELECT measurement_id FROM study_runs WHERE study_id = $1)",
        )
        .bind(study_id)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading trials", &e))?;
        let mut out: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (id, hash) in rows {
            out.entry(id).or_default().insert(hash);
        }
        Ok(out)
    }
}

/// Every series of `study` in the database at `db`: for synchronous verbs.
///
/// # Errors
/// As [`Store::all_series`], and when there is no such database.
pub fn read_series(db: &Path, study: &str, detail: Detail) -> Result<Vec<Measured>> {
    super::block_on(async {
        let store = Store::open_existing(db).await?;
        let series = store.all_series(study, detail).await;
        store.close().await;
        series
    })
}
