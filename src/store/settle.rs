//! What accepted trials and the judgement make of a measurement: is it done, is
//! it wrong, did it fail, or does it need another trial? Pure in what is stored,
//! so that it can be asked again after any interruption.

use super::accept::Work;
use super::{Store, changes, now_ms, rows};
use crate::error::Result;
use crate::record::RepeatPolicy;
use crate::results::RunStatus;
use crate::stats;
use sqlx::{Sqlite, Transaction};

/// Disturbed repeats taken a second time, a run.
const RETAKES: usize = 3;

/// State of a measurement after looking at all there is.
#[derive(Debug, Clone, PartialEq)]
pub struct Settled {
    pub status: RunStatus,
    pub reason: Option<String>,
    pub stop_reason: Option<String>,
    /// Repeats accepted.
    pub repeats: u32,
    /// Trials queued because the interval is still wide or a repeat was disturbed.
    pub trials_added: u32,
    /// The status is another than before: of several who decide at once, one tells.
    pub news: bool,
    /// Trials no longer needed because the run failed or is wrong.
    pub trials_cancelled: u32,
}

impl Settled {
    const PENDING: Settled = Settled {
        status: RunStatus::Pending,
        reason: None,
        stop_reason: None,
        repeats: 0,
        trials_added: 0,
        news: false,
        trials_cancelled: 0,
    };
}

struct Trial {
    repeat: i64,
    take: i64,
    total_ns: f64,
    work: Work,
    noisy: bool,
}

type TrialRow = (i64, i64, f64, String, i64, f64, i64);

impl Store {
    /// Decides about one measurement and stores the decision.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn settle(&self, study_id: i64, measurement_id: &str, policy: &RepeatPolicy) -> Result<Settled> {
        let explain = |e: sqlx::Error| self.explain("a decision", &e);
        let mut tx = self.begin("a decision").await?;
        let policy = self.strictest(&mut tx, measurement_id, policy).await?;
        let mut settled = self.decide(&mut tx, study_id, measurement_id, &policy).await?;
        let before: Option<String> = sqlx::query_scalar("SELECT status FROM measurements WHERE measurement_id = $1")
            .bind(measurement_id)
            .fetch_optional(&mut *tx)
            .await
            .map_err(explain)?;
        settled.news = before.is_some_and(|status| status != settled.status.word());
        settled.trials_cancelled = write(&mut tx, measurement_id, &settled).await.map_err(explain)?;
        tx.commit().await.map_err(explain)?;
        Ok(settled)
    }

    /// A shared measurement goes on until it suits every active study that has it.
    async fn strictest(
        &self,
        tx: &mut Transaction<'_, Sqlite>,
        measurement_id: &str,
        policy: &RepeatPolicy,
    ) -> Result<RepeatPolicy> {
        let others: Vec<String> = sqlx::query_scalar(
            "SELECT DISTINCT s.policy_json FROM study_runs r JOIN studies s ON s.id = r.study_id \
             WHERE r.measurement_id = $1 AND s.state = 'active'",
        )
        .bind(measurement_id)
        .fetch_all(&mut **tx)
        .await
        .map_err(|e| self.explain("a decision", &e))?;
        let mut out = policy.clone();
        if others.len() < 2 {
            return Ok(out);
        }
        // Who asks for no width stops at the repeats asked for.
        let most = |p: &RepeatPolicy| if p.relative_ci.is_some() { p.max_repeats } else { p.repeats };
        out.max_repeats = most(&out);
        for json in others {
            let other: RepeatPolicy = self.parse(&json, "a policy")?;
            out.repeats = out.repeats.max(other.repeats);
            out.max_repeats = out.max_repeats.max(most(&other));
            out.relative_ci = match (out.relative_ci, other.relative_ci) {
                (Some(a), Some(b)) => Some(a.min(b)),
                (a, b) => a.or(b),
            };
        }
        Ok(out)
    }

    async fn decide(
        &self,
        tx: &mut Transaction<'_, Sqlite>,
        study_id: i64,
        measurement_id: &str,
        policy: &RepeatPolicy,
    ) -> Result<Settled> {
        let explain = |e: sqlx::Error| self.explain("a decision", &e);
        // The judgement that this study asked for; another may ask for another.
        let known: Option<(String, String)> = sqlx::query_as(
            "SELECT m.answer_id, coalesce((SELECT r.judgement_id FROM study_runs r WHERE r.measurement_id = $1 AND \
             r.study_id = $2 LIMIT 1), m.judgement_id) FROM measurements m WHERE m.measurement_id = $1",
        )
        .bind(measurement_id)
        .bind(study_id)
        .fetch_optional(&mut **tx)
        .await
        .map_err(explain)?;
        // Deleted while somebody worked on it: nothing is left to decide.
        let Some((answer_id, judgement_id)) = known else { return Ok(Settled::PENDING) };
        let rows: Vec<TrialRow> = sqlx::query_as(
            "SELECT repeat_index, take, total_cull_ns, work_json, noisy, noise, wall_ns FROM trials \
             WHERE measurement_id = $1 ORDER BY repeat_index, take",
        )
        .bind(measurement_id)
        .fetch_all(&mut **tx)
        .await
        .map_err(explain)?;
        let mut trials = Vec::with_capacity(rows.len());
        for (repeat, take, total_ns, work, noisy, ..) in rows {
            trials.push(Trial { repeat, take, total_ns, work: self.parse(&work, "a trial")?, noisy: noisy != 0 });
        }
        let repeats = trials.iter().filter(|t| t.take == 0).count() as u32;
        let pending = Settled { repeats, ..Settled::PENDING };
        let end = |status, reason: String| Settled { status, reason: Some(reason), ..pending.clone() };

        let judgement: Option<(Option<String>, String)> =
            sqlx::query_as("SELECT wrong, frames_hash FROM judgements WHERE judgement_id = $1")
                .bind(&judgement_id)
                .fetch_optional(&mut **tx)
                .await
                .map_err(explain)?;
        if let Some((Some(wrong), _)) = &judgement {
            return Ok(end(RunStatus::Wrong, wrong.clone()));
        }
        if let Some(reason) = failed_job(tx, measurement_id, &judgement_id).await.map_err(explain)? {
            return Ok(end(RunStatus::Failed, reason));
        }
        if let Some(reason) = difference(&trials) {
            return Ok(end(RunStatus::Failed, reason));
        }
        let (frames_hash,): (Option<String>,) = sqlx::query_as("SELECT frames_hash FROM answers WHERE answer_id = $1")
            .bind(&answer_id)
            .fetch_one(&mut **tx)
            .await
            .map_err(explain)?;
        let judged_hash = judgement.as_ref().map(|(_, hash)| hash);
        for (whose, hash) in [("the judgement", judged_hash), ("an earlier measurement", frames_hash.as_ref())] {
            if let (Some(hash), Some(t)) = (hash, trials.first())
                && *hash != t.work.frames_hash
            {
                let reason = format!(
                    "counters differ between trial {} and {whose}: the hash of the submitted sets is {} and {hash}",
                    t.repeat, t.work.frames_hash
                );
                return Ok(end(RunStatus::Failed, reason));
            }
        }
        if repeats < policy.repeats {
            return Ok(pending);
        }
        if self.waits(tx, measurement_id).await? {
            return Ok(pending);
        }
        let added = self.retakes(tx, study_id, measurement_id, policy, &trials).await?;
        if added > 0 {
            return Ok(Settled { trials_added: added, ..pending });
        }
        let totals: Vec<f64> = best_takes(&trials).iter().map(|t| t.total_ns).collect();
        let relative_ci = relative_ci(&totals);
        let stop_reason = match policy.relative_ci {
            None => format!("{repeats} repeats as asked"),
            Some(asked) if relative_ci <= asked => {
                format!(
                    "95 % interval {:.2} % of the median after {repeats} repeats (asked: {:.2} %)",
                    relative_ci * 100.0,
                    asked * 100.0
                )
            }
            Some(asked) if repeats >= policy.max_repeats => format!(
                "max_repeats {repeats} reached with a 95 % interval of {:.2} % of the median (asked: {:.2} %)",
                relative_ci * 100.0,
                asked * 100.0
            ),
            Some(_) => {
                self.queue_trial(tx, study_id, measurement_id, policy, repeats, 0).await?;
                return Ok(Settled { trials_added: 1, ..pending });
            }
        };
        sqlx::query("UPDATE measurements SET relative_ci = $2 WHERE measurement_id = $1")
            .bind(measurement_id)
            .bind(relative_ci.is_finite().then_some(relative_ci))
            .execute(&mut **tx)
            .await
            .map_err(explain)?;
        if !judgement_id.is_empty() && judgement.is_none() {
            return Ok(Settled { stop_reason: Some(stop_reason), ..pending });
        }
        let noisy = best_takes(&trials).iter().filter(|t| t.noisy).count();
        let reason = (noisy > 0).then(|| format!("noisy machine: {noisy} of {repeats} trials were disturbed"));
        Ok(Settled { status: RunStatus::Done, reason, stop_reason: Some(stop_reason), ..pending })
    }

    /// Trials queued or under way.
    async fn waits(&self, tx: &mut Transaction<'_, Sqlite>, measurement_id: &str) -> Result<bool> {
        let (n,): (i64,) = sqlx::query_as(
            "SELECT count(*) FROM jobs WHERE kind = 'trial' AND target = $1 AND state IN ('queued', 'leased')",
        )
        .bind(measurement_id)
        .fetch_one(&mut **tx)
        .await
        .map_err(|e| self.explain("a decision", &e))?;
        Ok(n > 0)
    }

    /// Queues a second take of each disturbed repeat, up to the limit. Both takes stay on record.
    async fn retakes(
        &self,
        tx: &mut Transaction<'_, Sqlite>,
        study_id: i64,
        measurement_id: &str,
        policy: &RepeatPolicy,
        trials: &[Trial],
    ) -> Result<u32> {
        let taken: Vec<i64> = trials.iter().filter(|t| t.take > 0).map(|t| t.repeat).collect();
        let again = trials.iter().filter(|t| t.take == 0 && t.noisy && !taken.contains(&t.repeat));
        let mut added = 0;
        for trial in again.take(RETAKES.saturating_sub(taken.len())) {
            self.queue_trial(tx, study_id, measurement_id, policy, trial.repeat as u32, 1).await?;
            added += 1;
        }
        Ok(added)
    }

    async fn queue_trial(
        &self,
        tx: &mut Transaction<'_, Sqlite>,
        study_id: i64,
        measurement_id: &str,
        policy: &RepeatPolicy,
        repeat: u32,
        take: u32,
    ) -> Result<()> {
        let explain = |e: sqlx::Error| self.explain("another trial", &e);
        let block: Option<i64> =
            sqlx::query_scalar("SELECT block FROM study_runs WHERE study_id = $1 AND measurement_id = $2 LIMIT 1")
                .bind(study_id)
                .bind(measurement_id)
                .fetch_optional(&mut **tx)
                .await
                .map_err(explain)?;
        // The study was deleted meanwhile: nobody asks for more.
        let Some(block) = block else { return Ok(()) };
        // A second take comes when the block's other repeats are through: the disturbance may have passed.
        let round = if take == 0 { repeat } else { 0xffff };
        sqlx::query(
            "INSERT INTO jobs (kind, target, repeat_index, take, group_key, order_key, state, study_id) \
             VALUES ('trial', $1, $2, $3, '', $4, 'queued', coalesce((SELECT s.id FROM study_runs r JOIN studies s ON \
             s.id = r.study_id WHERE r.measurement_id = $1 AND s.state = 'active' ORDER BY s.id <> $5 LIMIT 1), $5)) ON CONFLICT (kind, target, repeat_index, take) \
             DO UPDATE SET state = 'queued', study_id = excluded.study_id, order_key = excluded.order_key, attempts = 0 \
             WHERE jobs.state = 'cancelled'",
        )
        .bind(measurement_id)
        .bind(i64::from(repeat))
        .bind(i64::from(take))
        .bind(rows::trial_order(block, round, policy.seed, measurement_id))
        .bind(study_id)
        .execute(&mut **tx)
        .await
        .map_err(explain)?;
        Ok(())
    }
}

/// The second take of a repeat replaces the first.
fn best_takes(trials: &[Trial]) -> Vec<&Trial> {
    let later = |t: &Trial| trials.iter().any(|o| o.repeat == t.repeat && o.take > t.take);
    trials.iter().filter(|t| !later(t)).collect()
}

/// Width of the 95 % bootstrap interval of the median total over that median.
/// Fewer than three trials say nothing.
fn relative_ci(totals: &[f64]) -> f64 {
    if totals.len() < 3 {
        return f64::INFINITY;
    }
    let (low, high) = stats::median_ci(totals);
    (high - low) / stats::median(totals)
}

/// The first disagreement between trials, in words.
fn difference(trials: &[Trial]) -> Option<String> {
    let (first, rest) = trials.split_first()?;
    let other = rest.iter().find(|t| t.work != first.work)?;
    let (a, b) = (&first.work, &other.work);
    let counter = a.counters.iter().find(|(name, v)| b.counters.get(*name) != Some(v));
    let series = a.series.iter().find(|(name, v)| b.series.get(*name) != Some(v));
    let what = match (counter, series) {
        (Some((name, v)), _) => match b.counters.get(name) {
            Some(w) => format!("{name} is {v} and {w}"),
            None => format!("{name} is {v} and absent"),
        },
        (None, Some((name, _))) => format!("`{name}` differs at some frame though its sum does not"),
        (None, None) if a.frames_hash != b.frames_hash => {
            format!("the hash of the submitted sets is {} and {}", a.frames_hash, b.frames_hash)
        }
        (None, None) => "one of them counted more things".to_string(),
    };
    Some(format!("counters differ between trials {} and {}: {what}", first.repeat, other.repeat))
}

async fn failed_job(
    tx: &mut Transaction<'_, Sqlite>,
    measurement_id: &str,
    judgement_id: &str,
) -> sqlx::Result<Option<String>> {
    let row: Option<(String, i64, Option<String>)> = sqlx::query_as(
        "SELECT kind, repeat_index, reason FROM jobs WHERE +state = 'failed' AND ((kind = 'trial' AND target = $1) OR \
         (kind = 'judge' AND target = $2)) ORDER BY kind, repeat_index LIMIT 1",
    )
    .bind(measurement_id)
    .bind(judgement_id)
    .fetch_optional(&mut **tx)
    .await?;
    Ok(row.map(|(kind, repeat, reason)| {
        let what = if kind == "judge" { "judging".to_string() } else { format!("trial {repeat}") };
        format!("{what}: {}", reason.unwrap_or_else(|| "no reason is known".to_string()))
    }))
}

async fn write(tx: &mut Transaction<'_, Sqlite>, measurement_id: &str, s: &Settled) -> sqlx::Result<u32> {
    let status = s.status.word();
    let finished = (s.status != RunStatus::Pending).then(now_ms);
    // What stays open looks to readers as it did.
    let changed = if s.status == RunStatus::Pending { None } else { Some(changes::tick(tx).await?) };
    sqlx::query(
        "UPDATE measurements SET status = $2, reason = $3, stop_reason = $4, repeats = $5, finished_ms = $6, \
         changed = coalesce($7, changed) WHERE measurement_id = $1",
    )
    .bind(measurement_id)
    .bind(status)
    .bind(&s.reason)
    .bind(&s.stop_reason)
    .bind(i64::from(s.repeats))
    .bind(finished)
    .bind(changed)
    .execute(&mut **tx)
    .await?;
    if matches!(s.status, RunStatus::Failed | RunStatus::Wrong) {
        // Times of a run that is not right would be withheld: do not measure them.
        let cancelled = sqlx::query(
            "UPDATE jobs SET state = 'cancelled' WHERE kind = 'trial' AND target = $1 AND state = 'queued'",
        )
        .bind(measurement_id)
        .execute(&mut **tx)
        .await?;
        return Ok(cancelled.rows_affected() as u32);
    }
    Ok(0)
}
