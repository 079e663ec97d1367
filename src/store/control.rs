//! What users do to a study that waits or runs: pause, resume, cancel, retry,
//! change its priority, delete. And whose turn it is: a study that joins the queue
//! starts level with those in it, so that it neither waits for all of them nor
//! they for it (start-time fair queueing: Goyal, Vin and Cheng, 1996; one weight).

use super::submit::retry_failed;
use super::{Store, compact, now_ms};
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

/// Jobs of `$1` that wait go to another active study that wants them too, if there is one.
const HAND_OVER: [&str; 2] = [
    "UPDATE jobs SET study_id = coalesce((SELECT r.study_id FROM study_runs r JOIN studies s ON s.id = r.study_id \
     WHERE r.measurement_id = jobs.target AND s.state = 'active' AND s.id <> $1 \
     ORDER BY s.priority DESC LIMIT 1), study_id) \
     WHERE study_id = $1 AND kind = 'trial' AND state IN ('queued', 'leased')",
    "UPDATE jobs SET study_id = coalesce((SELECT r.study_id FROM study_runs r JOIN studies s ON s.id = r.study_id \
     WHERE r.judgement_id = jobs.target AND s.state = 'active' AND s.id <> $1 \
     AND s.machine_class = (SELECT machine_class FROM studies WHERE id = $1) \
     ORDER BY s.priority DESC LIMIT 1), study_id) \
     WHERE study_id = $1 AND kind = 'judge' AND state IN ('queued', 'leased')",
];

/// Jobs of `$1` that its matrix does not hold any more go to another study, or end.
const LET_GO: [&str; 3] = [
    "UPDATE jobs SET study_id = coalesce((SELECT r.study_id FROM study_runs r JOIN studies s ON s.id = r.study_id \
     WHERE r.measurement_id = jobs.target AND s.state = 'active' \
     ORDER BY s.priority DESC LIMIT 1), study_id) \
     WHERE study_id = $1 AND kind = 'trial' AND state IN ('queued', 'leased') AND target NOT IN \
     (SELECT measurement_id FROM study_runs WHERE study_id = $1)",
    "UPDATE jobs SET study_id = coalesce((SELECT r.study_id FROM study_runs r JOIN studies s ON s.id = r.study_id \
     WHERE r.judgement_id = jobs.target AND s.state = 'active' \
     AND s.machine_class = (SELECT machine_class FROM studies WHERE id = $1) \
     ORDER BY s.priority DESC LIMIT 1), study_id) \
     WHERE study_id = $1 AND kind = 'judge' AND state IN ('queued', 'leased') AND target NOT IN \
     (SELECT judgement_id FROM study_runs WHERE study_id = $1)",
    "UPDATE jobs SET state = 'cancelled' WHERE study_id = $1 AND state = 'queued' AND kind IN ('trial', 'judge') \
     AND target NOT IN (SELECT measurement_id FROM study_runs WHERE study_id = $1) \
     AND target NOT IN (SELECT judgement_id FROM study_runs WHERE study_id = $1)",
];

/// Jobs that `$1` wants and that wait for a study that does not want them now. Cancelled
/// ones of measurements that are still open wait again.
const TAKE_BACK: [&str; 2] = [
    "UPDATE jobs SET study_id = $1, state = 'queued' WHERE kind = 'trial' AND state IN ('queued', 'cancelled') \
     AND target IN (SELECT r.measurement_id FROM study_runs r JOIN measurements m ON m.measurement_id = r.measurement_id \
     WHERE r.study_id = $1 AND m.status = 'pending') \
     AND (state = 'cancelled' OR study_id NOT IN (SELECT id FROM studies WHERE state = 'active'))",
    "UPDATE jobs SET study_id = $1, state = 'queued' WHERE kind = 'judge' AND state IN ('queued', 'cancelled') \
     AND target IN (SELECT judgement_id FROM study_runs WHERE study_id = $1) \
     AND (state = 'cancelled' OR study_id NOT IN (SELECT id FROM studies WHERE state = 'active' \
     AND machine_class = (SELECT machine_class FROM studies WHERE id = $1)))",
];

/// Jobs that `$1` shares with others wait for the most urgent one that wants them, and for
/// the one they have waited for among equals.
const MOST_URGENT: [&str; 2] = [
    "UPDATE jobs SET study_id = coalesce((SELECT r.study_id FROM study_runs r JOIN studies s ON s.id = r.study_id \
     WHERE r.measurement_id = jobs.target AND s.state = 'active' \
     AND s.build_profile = (SELECT build_profile FROM studies WHERE id = jobs.study_id) \
     AND s.priority > (SELECT priority FROM studies WHERE id = jobs.study_id) ORDER BY s.priority DESC LIMIT 1), study_id) \
     WHERE (SELECT count(DISTINCT priority) FROM studies WHERE state = 'active') > 1 \
     AND kind = 'trial' AND state = 'queued' AND target IN (SELECT measurement_id FROM study_runs WHERE study_id = $1)",
    "UPDATE jobs SET study_id = coalesce((SELECT r.study_id FROM study_runs r JOIN studies s ON s.id = r.study_id \
     WHERE r.judgement_id = jobs.target AND s.state = 'active' \
     AND s.machine_class = (SELECT machine_class FROM studies WHERE id = jobs.study_id) \
     AND s.priority > (SELECT priority FROM studies WHERE id = jobs.study_id) ORDER BY s.priority DESC LIMIT 1), study_id) \
     WHERE (SELECT count(DISTINCT priority) FROM studies WHERE state = 'active') > 1 \
     AND kind = 'judge' AND state = 'queued' AND target IN (SELECT judgement_id FROM study_runs WHERE study_id = $1)",
];

impl Store {
    /// Jobs of the study wait until it is resumed; those under way end.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn pause(&self, study: &str) -> Result<()> {
        let (id, mut tx) = self.controlled(study).await?;
        set_state(&mut tx, id, StudyState::Paused).await.map_err(|e| self.explain("the study", &e))?;
        self.run_all(&mut tx, &HAND_OVER, id).await?;
        self.commit(tx).await
    }

    /// Goes on with a paused or a cancelled study.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn resume(&self, study: &str) -> Result<()> {
        let (id, mut tx) = self.controlled(study).await?;
        set_state(&mut tx, id, StudyState::Active).await.map_err(|e| self.explain("the study", &e))?;
        self.run_all(&mut tx, &TAKE_BACK, id).await?;
        join_the_queue(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
        most_urgent(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
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
        self.run_all(tx, &HAND_OVER, id).await?;
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
        self.run_all(&mut tx, &TAKE_BACK, id).await?;
        join_the_queue(&mut tx, id).await.map_err(explain)?;
        most_urgent(&mut tx, id).await.map_err(explain)?;
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
        most_urgent(&mut tx, id).await.map_err(|e| self.explain("the study", &e))?;
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

/// After a matrix was replaced.
pub(super) async fn let_go(tx: &mut Transaction<'_, Sqlite>, id: i64) -> sqlx::Result<()> {
    for sql in LET_GO {
        sqlx::query(sql).bind(id).execute(&mut **tx).await?;
    }
    Ok(())
}

/// After priorities, or who wants what, have changed.
pub(super) async fn most_urgent(tx: &mut Transaction<'_, Sqlite>, id: i64) -> sqlx::Result<()> {
    for sql in MOST_URGENT {
        sqlx::query(sql).bind(id).execute(&mut **tx).await?;
    }
    Ok(())
}

/// Level with the least served of those that wait.
pub(super) async fn join_the_queue(tx: &mut Transaction<'_, Sqlite>, id: i64) -> sqlx::Result<()> {
    for (column, kind) in [("lane_ms", "trial"), ("beside_ms", "judge")] {
        let sql = format!(
            "UPDATE studies SET {column} = max({column}, coalesce((SELECT min(s.{column}) FROM studies s \
             WHERE s.id <> $1 AND s.state = 'active' \
             AND s.machine_class = (SELECT machine_class FROM studies WHERE id = $1) AND EXISTS (SELECT 1 FROM jobs j WHERE j.study_id = s.id \
             AND j.kind = '{kind}' AND j.state = 'queued')), 0)) WHERE id = $1"
        );
        sqlx::query(sqlx::AssertSqlSafe(sql)).bind(id).execute(&mut **tx).await?;
    }
    Ok(())
}
