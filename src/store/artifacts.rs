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
    /// Records every file below `folder` as made by the study; earlier entries of it are replaced.
    ///
    /// # Errors
    /// When a file cannot be read or the database fails.
    pub async fn record_artifacts(&self, study_id: i64, folder: &Path) -> Result<usize> {
        let mut files = Vec::new();
        for path in files_below(folder)? {
            let bytes = std::fs::read(&path).map_err(|e| Error::io(&path, "it cannot be read back", &e))?;
            files.push((path.display().to_string(), bytes.len() as i64, blake3::hash(&bytes).to_hex().to_string()));
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
        tx.commit().await.map_err(explain)?;
        Ok(files.len())
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

fn files_below(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut out = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let entries = std::fs::read_dir(&folder).map_err(|e| Error::io(&folder, "the folder cannot be read", &e))?;
        for entry in entries {
            let path = entry.map_err(|e| Error::io(&folder, "the folder cannot be read", &e))?.path();
            if path.is_dir() { folders.push(path) } else { out.push(path) }
        }
    }
    out.sort();
    Ok(out)
}
