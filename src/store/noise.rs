//! Was the machine quiet during a trial? Its sentinel against what is usual
//! here, and what the scheduler may have taken from it.

use super::Store;
use crate::error::Result;
use crate::record::TrialRecord;
use crate::stats;
use sqlx::{Sqlite, Transaction};

/// A trial whose sentinel ran so much longer than is usual here was disturbed.
const NOISY_SENTINEL: f64 = 1.15;
/// What is usual: this quantile, not the median, so that a machine which is
/// busy half of the time does not pass for quiet.
const USUAL: f64 = 0.25;
/// Trials on a machine before its usual sentinel is known.
const SENTINELS_NEEDED: usize = 5;
/// The most recent so many tell what is usual.
const SENTINELS_KEPT: i64 = 101;
/// A thread taken off its core comes back after about one time slice of another.
const SLICE_NS: f64 = 1e6;
/// A trial that probably lost more than this share of its time was disturbed.
const LOST_SHARE: f64 = 0.05;
/// Kernel threads bound to the core interrupt the quietest machine.
const SWITCHES_FORGIVEN: u64 = 2;

/// The trial's sentinel over what is usual on its machine (1 until that is known), and whether it was disturbed.
pub(super) async fn of(tx: &mut Transaction<'_, Sqlite>, record: &TrialRecord) -> sqlx::Result<(f64, bool)> {
    let earlier: Vec<f64> = sqlx::query_scalar(
        "SELECT sentinel_ns FROM trials WHERE machine_class = $1 ORDER BY accepted_ms DESC LIMIT $2",
    )
    .bind(&record.environment.machine_class)
    .bind(SENTINELS_KEPT)
    .fetch_all(&mut **tx)
    .await?;
    let known = earlier.len() >= SENTINELS_NEEDED;
    let noise = if known { sentinel_ns(record) / stats::quantile(&earlier, USUAL) } else { 1.0 };
    Ok((noise, noise > NOISY_SENTINEL || interrupted(record)))
}

/// Trials that tell how quiet a machine is these days.
const RECENT: i64 = 100;

impl Store {
    /// Share of the last trials on a class of machines that were disturbed; none before the first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn recent_noise(&self, machine_class: &str) -> Result<Option<f64>> {
        sqlx::query_scalar(
            "SELECT avg(noisy) FROM (SELECT noisy FROM trials WHERE machine_class = $1 ORDER BY accepted_ms DESC LIMIT $2)",
        )
        .bind(machine_class)
        .bind(RECENT)
        .fetch_one(&self.readers)
        .await
        .map_err(|e| self.explain("reading trials", &e))
    }
}

pub(super) fn sentinel_ns(record: &TrialRecord) -> f64 {
    record.sentinel.before_ns.max(record.sentinel.after_ns)
}

/// `cull_ns` of every frame, the smallest of the passes.
pub(super) fn frame_times(record: &TrialRecord) -> &[f64] {
    record.series.iter().find(|s| s.name == "cull_ns").map_or(&[], |s| &s.values)
}

/// Interruptions are forgiven where the smallest of the passes hides them: a frame
/// is spoiled only if every pass over it was interrupted. Long frames bear more
/// of them than short ones, since a time slice is then a small part of the whole.
fn interrupted(record: &TrialRecord) -> bool {
    let (times, passes) = (frame_times(record), record.passes_ns.len().max(1));
    let (frames, switches) = (times.len() as f64, record.sentinel.involuntary_switches);
    let share = (switches as f64 / (frames * passes as f64)).min(1.0);
    let lost_ns = frames * share.powi(passes as i32) * SLICE_NS;
    switches > SWITCHES_FORGIVEN && lost_ns > LOST_SHARE * times.iter().sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Sentinel, Series};

    fn trial(frames: usize, frame_ns: f64, passes: usize, switches: u64) -> TrialRecord {
        let values = vec![frame_ns; frames];
        TrialRecord {
            load_ns: 0,
            build_ns: 0,
            prepare_ns: 0,
            structure_bytes: 0,
            test_bytes: 0,
            peak_rss_bytes: 0,
            build: Default::default(),
            entries: 0,
            scene_triangles: 0,
            load: Default::default(),
            counters: Vec::new(),
            passes_ns: vec![values.clone(); passes],
            series: vec![Series { name: "cull_ns".into(), unit: "ns".into(), values }],
            frames_hash: String::new(),
            sentinel: Sentinel { before_ns: 1.0, after_ns: 1.0, involuntary_switches: switches },
            environment: Default::default(),
        }
    }

    #[test]
    fn interruptions_count_where_they_spoil_the_total() {
        assert!(!interrupted(&trial(300, 1e4, 2, 2)), "a few are always there");
        assert!(interrupted(&trial(300, 1e4, 1, 5)), "nothing hides them from a single pass");
        assert!(!interrupted(&trial(300, 1e4, 2, 5)), "the other pass over the frame was whole");
        assert!(interrupted(&trial(300, 1e4, 2, 100)), "some frames were hit in both");
        assert!(!interrupted(&trial(2000, 1e7, 1, 200)), "20 s of work lose a fifth of a second");
        assert!(interrupted(&trial(2000, 1e7, 1, 2000)));
    }
}
