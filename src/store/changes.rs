//! A clock that ticks with every change of a measurement: readers that keep
//! results in memory ask for what changed since they looked, and for no more.

use super::Store;
use crate::error::Result;
use sqlx::{Sqlite, Transaction};

/// The time of a change that is under way.
pub(super) async fn tick(tx: &mut Transaction<'_, Sqlite>) -> sqlx::Result<i64> {
    sqlx::query_scalar("UPDATE clock SET now = now + 1 RETURNING now").fetch_one(&mut **tx).await
}

/// A judgement changes every run that asked for it, in whatever study.
pub(super) async fn judged(tx: &mut Transaction<'_, Sqlite>, judgement_id: &str) -> sqlx::Result<()> {
    let now = tick(tx).await?;
    sqlx::query(
        "UPDATE measurements SET changed = $2 WHERE measurement_id IN \
         (SELECT measurement_id FROM study_runs WHERE judgement_id = $1)",
    )
    .bind(judgement_id)
    .bind(now)
    .execute(&mut **tx)
    .await?;
    Ok(())
}

impl Store {
    /// Now, by the clock of changes.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn now(&self) -> Result<i64> {
        sqlx::query_scalar("SELECT now FROM clock")
            .fetch_one(&self.readers)
            .await
            .map_err(|e| self.explain("reading the clock", &e))
    }
}
