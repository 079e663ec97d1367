//! Was the machine quiet during a trial? Its sentinel against what is usual here.

use super::Store;
use crate::error::Result;
use crate::stats;

/// A trial whose sentinel ran so much longer than the machine's usual was disturbed.
const NOISY_SENTINEL: f64 = 1.15;
/// Trials on a machine before its usual sentinel is known.
const SENTINELS_NEEDED: usize = 5;
/// The most recent so many tell what is usual.
const SENTINELS_KEPT: i64 = 501;
/// One frame in so many may be interrupted before a trial counts as disturbed
/// (the smallest of the passes hides single interruptions).
const FRAMES_PER_SWITCH: u64 = 10;
const SWITCHES_FORGIVEN: u64 = 10;

impl Store {
    /// Compares a trial just accepted with what is usual on its machine; marks and reports it if disturbed.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn mark_noise(&self, measurement_id: &str, repeat: u32, take: u32, frames: u64) -> Result<bool> {
        let explain = |e: sqlx::Error| self.explain("a trial's noise", &e);
        let (machine, sentinel_ns, switches): (String, f64, i64) = sqlx::query_as(
            "SELECT machine_class, sentinel_ns, switches FROM trials \
             WHERE measurement_id = $1 AND repeat_index = $2 AND take = $3",
        )
        .bind(measurement_id)
        .bind(i64::from(repeat))
        .bind(i64::from(take))
        .fetch_one(&self.writer)
        .await
        .map_err(explain)?;
        let usual: Vec<f64> = sqlx::query_scalar(
            "SELECT sentinel_ns FROM trials WHERE machine_class = $1 ORDER BY accepted_ms DESC LIMIT $2",
        )
        .bind(&machine)
        .bind(SENTINELS_KEPT)
        .fetch_all(&self.writer)
        .await
        .map_err(explain)?;
        let noise = if usual.len() < SENTINELS_NEEDED { 1.0 } else { sentinel_ns / stats::median(&usual) };
        let interrupted = switches as u64 > SWITCHES_FORGIVEN.max(frames / FRAMES_PER_SWITCH);
        let noisy = noise > NOISY_SENTINEL || interrupted;
        sqlx::query(
            "UPDATE trials SET noise = $4, noisy = $5 WHERE measurement_id = $1 AND repeat_index = $2 AND take = $3",
        )
        .bind(measurement_id)
        .bind(i64::from(repeat))
        .bind(i64::from(take))
        .bind(noise)
        .bind(i64::from(noisy))
        .execute(&self.writer)
        .await
        .map_err(explain)?;
        Ok(noisy)
    }
}
