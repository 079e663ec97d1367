//! What users do to a study that waits or runs: pause, resume, cancel, retry,
//! change its priority, delete.

use super::submit::retry_failed;
use super::{Store, compact, now_ms, turns};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use sqlx::{Sqlite, Transaction};

/// Priorities are from `-LIMIT` to `LIMIT`.
pub const PRIORITY_LIMIT: i64 = 100;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StudyState {
    Active,
    /// Its jobs wait until it is resumed.
    Paused,
    /// Its jobs are dropped; what was measured stays.
    Cancelled,
}

impl StudyState {
    pub fn word(self) -> &'static str {
        match self {
            StudyState::Active => "active",
            StudyState::Paused => "paused",
            StudyState::Cancelled => "cancelled",
        }
    }

    pub(super) fn of(word: &str) -> StudyState {
        match word {
            "paused" => StudyState::Paused,
            "cancelled" => StudyState::Cancelled,
            _ => StudyState::Active,
        }
    }
}

impl Store {
    /// Jobs of the study wait until it is resumed; those under way end.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn pause(&self, study: &str) -> Result<()> {
        let (id, mut tx) = self.controlled(study).await?;
        set_state(&mut tx, id, StudyState::Paused).await.map_err(|e| self.explain("the study", &e))?;
        turns::hand_over(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
        self.commit(tx).await
    }

    /// Goes on with a paused or a cancelled study.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn resume(&self, study: &str) -> Result<()> {
        let (id, mut tx) = self.controlled(study).await?;
        set_state(&mut tx, id, StudyState::Active).await.map_err(|e| self.explain("the study", &e))?;
        turns::take_back(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
        turns::join_the_queue(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
        turns::most_urgent(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
        self.commit(tx).await
    }

    /// Drops what is left to do of the study, what is under way included: whoever
    /// works on it finds its lease gone. Results stay.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn cancel(&self, study: &str) -> Result<()> {
        let (id, mut tx) = self.controlled(study).await?;
        self.drop_jobs(&mut tx, id).await?;
        self.commit(tx).await
    }

    async fn drop_jobs(&self, tx: &mut Transaction<'static, Sqlite>, id: i64) -> Result<()> {
        let explain = |e: sqlx::Error| self.explain("the study", &e);
        set_state(tx, id, StudyState::Cancelled).await.map_err(explain)?;
        turns::hand_over(tx, id).await.map_err(|e| self.explain("the study", &e))?;
        sqlx::query(
            "UPDATE attempts SET outcome = 'cancelled', ended_ms = $2 WHERE outcome IS NULL AND job_id IN \
             (SELECT id FROM jobs WHERE study_id = $1 AND state = 'leased')",
        )
        .bind(id)
        .bind(now_ms())
        .execute(&mut **tx)
        .await
        .map_err(explain)?;
        let all = "UPDATE jobs SET state = 'cancelled', owner = NULL, lease_until_ms = 0 \
                   WHERE study_id = $1 AND state IN ('queued', 'leased')";
        self.run_all(tx, &[all], id).await
    }

    /// What failed waits again with a clean count of attempts.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn retry(&self, study: &str) -> Result<()> {
        let (id, mut tx) = self.controlled(study).await?;
        let explain = |e: sqlx::Error| self.explain("the study", &e);
        retry_failed(&mut tx, id).await.map_err(explain)?;
        set_state(&mut tx, id, StudyState::Active).await.map_err(explain)?;
        turns::take_back(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
        turns::join_the_queue(&mut tx, id).await.map_err(explain)?;
        turns::most_urgent(&mut tx, id).await.map_err(explain)?;
        self.commit(tx).await
    }

    /// # Errors
    /// For a priority out of range; when there is no such study or the database fails.
    pub async fn set_priority(&self, study: &str, priority: i64) -> Result<()> {
        if priority.abs() > PRIORITY_LIMIT {
            return Err(Error::new(format!("is {priority}, but must be from -{PRIORITY_LIMIT} to {PRIORITY_LIMIT}"))
                .key("priority"));
        }
        let (id, mut tx) = self.controlled(study).await?;
        sqlx::query("UPDATE studies SET priority = $2 WHERE id = $1")
            .bind(id)
            .bind(priority)
            .execute(&mut *tx)
            .await
            .map_err(|e| self.explain("the study", &e))?;
        turns::most_urgent(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
        self.commit(tx).await
    }

    /// Removes a study; what it measured stays for others and for submitting it
    /// again, unless `measurements` says that what no other study has may go too.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn delete_study(&self, study: &str, measurements: bool) -> Result<()> {
        let (id, mut tx) = self.controlled(study).await?;
        self.drop_jobs(&mut tx, id).await?;
        let own = "SELECT measurement_id FROM study_runs WHERE study_id = $1 AND measurement_id NOT IN \
                   (SELECT measurement_id FROM study_runs WHERE study_id <> $1)";
        let judged = "SELECT judgement_id FROM study_runs WHERE study_id = $1 AND judgement_id NOT IN \
                      (SELECT judgement_id FROM study_runs WHERE study_id <> $1)";
        let mut statements = Vec::new();
        if measurements {
            for table in ["trials", "series", "counters", "facts"] {
                statements.push(format!("DELETE FROM {table} WHERE measurement_id IN ({own})"));
            }
            statements.push(format!("DELETE FROM jobs WHERE kind = 'trial' AND target IN ({own})"));
            statements.push(format!("DELETE FROM jobs WHERE kind = 'judge' AND target IN ({judged})"));
            statements.push(format!("DELETE FROM measurements WHERE measurement_id IN ({own})"));
            statements.push(format!("DELETE FROM judgements WHERE judgement_id IN ({judged})"));
        }
        for table in ["study_runs", "excluded", "artifacts"] {
            statements.push(format!("DELETE FROM {table} WHERE study_id = $1"));
        }
        statements.push("DELETE FROM studies WHERE id = $1".to_string());
        let statements: Vec<&str> = statements.iter().map(String::as_str).collect();
        self.run_all(&mut tx, &statements, id).await?;
        if measurements {
            sqlx::query(compact::FORGET_ATTEMPTS).execute(&mut *tx).await.map_err(|e| self.explain("the study", &e))?;
        }
        self.commit(tx).await
    }

    /// Whether the pool of this database rests.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn pool_paused(&self) -> Result<bool> {
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM settings WHERE name = 'pool' AND value = 'paused')")
            .fetch_one(&self.readers)
            .await
            .map_err(|e| self.explain("reading the settings", &e))
    }

    /// # Errors
    /// When the database fails.
    pub async fn pause_pool(&self, paused: bool) -> Result<()> {
        let value = if paused { "paused" } else { "open" };
        sqlx::query("INSERT INTO settings (name, value) VALUES ('pool', $1) ON CONFLICT (name) DO UPDATE SET value = excluded.value")
            .bind(value)
            .execute(&self.writer)
            .await
            .map_err(|e| self.explain("the settings", &e))?;
        Ok(())
    }

    async fn controlled(&self, study: &str) -> Result<(i64, Transaction<'static, Sqlite>)> {
        let id = self.find(study).await?.id;
        Ok((id, self.begin("the study").await?))
    }

    async fn run_all(&self, tx: &mut Transaction<'static, Sqlite>, statements: &[&str], study_id: i64) -> Result<()> {
        for sql in statements {
            sqlx::query(sqlx::AssertSqlSafe((*sql).to_string()))
                .bind(study_id)
                .execute(&mut **tx)
                .await
                .map_err(|e| self.explain("the study", &e))?;
        }
        Ok(())
    }

    async fn commit(&self, tx: Transaction<'static, Sqlite>) -> Result<()> {
        tx.commit().await.map_err(|e| self.explain("the study", &e))
    }
}

async fn set_state(tx: &mut Transaction<'_, Sqlite>, id: i64, state: StudyState) -> sqlx::Result<()> {
    sqlx::query("UPDATE studies SET state = $2 WHERE id = $1").bind(id).bind(state.word()).execute(&mut **tx).await?;
    Ok(())
}
