//! Making the file small again. Nothing measured is lost unless asked.

use super::Store;
use crate::error::Result;
use serde::Serialize;

/// What may be left out on request.
#[derive(Debug, Clone, Copy, Default)]
pub struct Drop {
    /// Times of single passes; each trial keeps its smallest per frame.
    pub passes: bool,
    /// Measurements that no stored study refers to any more.
    pub orphans: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Compacted {
    pub before_bytes: u64,
    pub after_bytes: u64,
    pub rows_dropped: u64,
}

const ORPHANED: &str = "measurement_id NOT IN (SELECT measurement_id FROM study_runs)";

/// After jobs were deleted: their numbers are given to new jobs, whose attempts would collide.
pub(super) const FORGET_ATTEMPTS: &str = "DELETE FROM attempts WHERE job_id NOT IN (SELECT id FROM jobs)";

impl Store {
    /// Drops what `drop` names and queue rows that tell nothing more, then rewrites the file.
    ///
    /// # Errors
    /// When the database fails; SQLite needs as much free space again for a moment.
    pub async fn compact(&self, drop: Drop) -> Result<Compacted> {
        let before_bytes = self.size();
        let explain = |e: sqlx::Error| self.explain("compacting", &e);
        let mut statements = Vec::new();
        if drop.passes {
            statements.push("DELETE FROM series WHERE role = 'pass'".to_string());
        }
        if drop.orphans {
            for table in ["trials", "series", "counters", "facts"] {
                statements.push(format!("DELETE FROM {table} WHERE {ORPHANED}"));
            }
            statements.push(format!("DELETE FROM measurements WHERE {ORPHANED}"));
            statements.push(
                "DELETE FROM judgements WHERE judgement_id NOT IN (SELECT judgement_id FROM study_runs)".to_string(),
            );
            statements
                .push("DELETE FROM answers WHERE answer_id NOT IN (SELECT answer_id FROM measurements)".to_string());
            statements.push(
                "DELETE FROM jobs WHERE (kind = 'trial' AND target NOT IN (SELECT measurement_id FROM measurements)) \
                 OR (kind = 'judge' AND target NOT IN (SELECT judgement_id FROM study_runs))"
                    .to_string(),
            );
        }
        statements.push(FORGET_ATTEMPTS.to_string());
        // Accepted attempts repeat what the trial says; failed ones are evidence and stay.
        statements.push("DELETE FROM attempts WHERE outcome IN ('accepted', 'returned')".to_string());
        let mut rows_dropped = 0;
        let mut tx = self.begin("compacting").await?;
        for sql in statements {
            rows_dropped +=
                sqlx::query(sqlx::AssertSqlSafe(sql)).execute(&mut *tx).await.map_err(explain)?.rows_affected();
        }
        tx.commit().await.map_err(explain)?;
        for sql in ["VACUUM", "PRAGMA wal_checkpoint(TRUNCATE)", "PRAGMA optimize"] {
            sqlx::query(sql).execute(&self.writer).await.map_err(explain)?;
        }
        Ok(Compacted { before_bytes, after_bytes: self.size(), rows_dropped })
    }

    /// Bytes of the file and its write-ahead log.
    fn size(&self) -> u64 {
        let mut log = self.path.as_os_str().to_owned();
        log.push("-wal");
        let bytes = |path: &std::path::Path| std::fs::metadata(path).map_or(0, |m| m.len());
        bytes(&self.path) + bytes(std::path::Path::new(&log))
    }
}
