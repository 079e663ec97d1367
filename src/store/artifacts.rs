//! Files that a study produced, with their hashes: which report belongs to which results.

use super::{Store, now_ms};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// A file of a study, as it was when it was recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Artifact {
    pub path: String,
    pub bytes: u64,
    pub blake3: String,
}

impl Store {
    /// A hash of everything that the report of a study in `folder` is made of: the program,
    /// all series of the study, and when a measurement of theirs changed last.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn report_key(&self, study_id: i64, folder: &Path) -> Result<String> {
        type Series = (i64, i64, String, String, String, String, String, String, i64, Option<i64>);
        let series: Vec<Series> = sqlx::query_as(
            "SELECT s.id, s.series, s.title, s.manifest_toml, s.claims_json, s.sweeps_json, s.advice_json, s.runs_hash, \
             s.consolidate_frames, (SELECT max(m.changed) FROM study_runs r JOIN measurements m \
             ON m.measurement_id = r.measurement_id WHERE r.study_id = s.id) FROM studies s \
             WHERE s.name = (SELECT name FROM studies WHERE id = $1) ORDER BY s.series",
        )
        .bind(study_id)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading the studies", &e))?;
        let made_of = serde_json::to_vec(&(program(), study_id, absolute(folder)?, series)).expect("plain data");
        Ok(blake3::hash(&made_of).to_hex().to_string())
    }

    /// Whether the recorded files are those of `key`, and still as they were written.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn report_stands(&self, study_id: i64, key: &str) -> Result<bool> {
        let kept: Option<String> = sqlx::query_scalar("SELECT report_key FROM studies WHERE id = $1")
            .bind(study_id)
            .fetch_optional(&self.readers)
            .await
            .map_err(|e| self.explain("reading the study", &e))?;
        if kept.is_none_or(|kept| kept != key) {
            return Ok(false);
        }
        let files = self.artifacts(study_id).await?;
        let same = |f: &Artifact| std::fs::read(&f.path).is_ok_and(|b| *blake3::hash(&b).to_hex() == *f.blake3);
        Ok(!files.is_empty() && files.iter().all(same))
    }

    /// Records files as made by the study; earlier entries of it are replaced. `key` is the
    /// [`Store::report_key`] of before they were written.
    ///
    /// # Errors
    /// When a file cannot be read or the database fails.
    pub async fn record_artifacts(&self, study_id: i64, paths: &[PathBuf], key: &str) -> Result<()> {
        let mut files = Vec::new();
        for path in paths {
            let bytes = std::fs::read(path).map_err(|e| Error::io(path, "it cannot be read back", &e))?;
            let hash = blake3::hash(&bytes).to_hex().to_string();
            files.push((absolute(path)?.display().to_string(), bytes.len() as i64, hash));
        }
        let explain = |e: sqlx::Error| self.explain("the list of files", &e);
        let mut tx = self.begin("the list of files").await?;
        sqlx::query("DELETE FROM artifacts WHERE study_id = $1")
            .bind(study_id)
            .execute(&mut *tx)
            .await
            .map_err(explain)?;
        for (path, bytes, hash) in &files {
            sqlx::query(
                "INSERT INTO artifacts (study_id, path, bytes, blake3, created_ms) VALUES ($1, $2, $3, $4, $5)",
            )
            .bind(study_id)
            .bind(path)
            .bind(bytes)
            .bind(hash)
            .bind(now_ms())
            .execute(&mut *tx)
            .await
            .map_err(explain)?;
        }
        sqlx::query("UPDATE studies SET report_key = $2 WHERE id = $1")
            .bind(study_id)
            .bind(key)
            .execute(&mut *tx)
            .await
            .map_err(explain)?;
        tx.commit().await.map_err(explain)
    }

    /// The files recorded for a study, by path.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn artifacts(&self, study_id: i64) -> Result<Vec<Artifact>> {
        let rows: Vec<(String, i64, String)> =
            sqlx::query_as("SELECT path, bytes, blake3 FROM artifacts WHERE study_id = $1 ORDER BY path")
                .bind(study_id)
                .fetch_all(&self.readers)
                .await
                .map_err(|e| self.explain("the list of files", &e))?;
        Ok(rows.into_iter().map(|(path, bytes, blake3)| Artifact { path, bytes: bytes as u64, blake3 }).collect())
    }
}

/// Tells one build of the program from another: what draws a report may have been changed.
fn program() -> Option<(PathBuf, u64, std::time::SystemTime)> {
    let exe = std::env::current_exe().ok()?;
    let about = exe.metadata().ok()?;
    let modified = about.modified().ok()?;
    Some((exe, about.len(), modified))
}

/// Wherever a later run is started from.
fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(|e| Error::io(path, "it cannot be named", &e))
}
