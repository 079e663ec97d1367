//! Taking jobs: the next one of a study, or of whichever study's turn it is.

use super::queue::{Job, Kind, LEASE, Lease, reap};
use super::{Store, now_ms, owner};
use crate::error::Result;
use sqlx::{Sqlite, SqliteConnection, Transaction};
use std::time::Duration;

/// While one worker computes a truth, another judgement that needs the same one
/// would compute it twice: it waits until somebody has finished with that truth. The
/// few groups under way are looked up once, not once a job; `coalesce` keeps SQLite from
/// looking for them among all judgements, by the index of groups.
const NOT_IN_THE_WAY: &str = "j.group_key NOT IN (SELECT b.group_key FROM jobs b WHERE coalesce(b.kind, '') = 'judge' AND \
    b.state = 'leased' AND NOT EXISTS (SELECT 1 FROM jobs d WHERE d.kind = 'judge' AND d.group_key = b.group_key \
    AND d.state = 'done'))";

/// The next job of a study: of those that are its turn, or (`shared`) of those that
/// another study has asked for as well and nobody has done yet.
fn claim(kind: Kind, shared: bool) -> String {
    let mine = match (kind, shared) {
        (_, false) => "j.study_id = $1",
        (Kind::Trial, true) => {
            "EXISTS (SELECT 1 FROM study_runs r WHERE r.measurement_id = j.target AND r.study_id = $1)"
        }
        (Kind::Judge, true) => {
            "EXISTS (SELECT 1 FROM study_runs r WHERE r.judgement_id = j.target AND r.study_id = $1)"
        }
    };
    let free = if kind == Kind::Judge { NOT_IN_THE_WAY } else { "1" };
    let kind = kind.word();
    format!(
        "UPDATE jobs SET state = 'leased', owner = $2, epoch = epoch + 1, attempts = attempts + 1, \
         lease_until_ms = $3 WHERE id = (SELECT j.id FROM jobs j WHERE j.kind = '{kind}' AND j.state = 'queued' AND \
         {mine} AND {free} ORDER BY j.order_key LIMIT 1) RETURNING id, target, repeat_index, take, epoch"
    )
}

/// What a study says of the target of a job.
fn cell(kind: Kind) -> &'static str {
    match kind {
        Kind::Trial => {
            "SELECT r.spec_json, s.policy_json, r.structure_label, r.culling_label FROM study_runs r JOIN studies s \
             ON s.id = r.study_id WHERE r.study_id = $1 AND r.measurement_id = $2 LIMIT 1"
        }
        Kind::Judge => {
            "SELECT r.spec_json, s.policy_json, r.structure_label, r.culling_label FROM study_runs r JOIN studies s \
             ON s.id = r.study_id WHERE r.study_id = $1 AND r.judgement_id = $2 LIMIT 1"
        }
    }
}

/// Who may work for whom: trials count only on the class of machine, and from the
/// kind of build, that their study was submitted for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pool {
    pub machine_class: String,
    pub build_profile: String,
}

impl Store {
    /// Leases the next job of `kind` in `study_id`, if one waits.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn lease(&self, study_id: i64, kind: Kind) -> Result<Option<Lease>> {
        self.lease_for(study_id, kind, LEASE).await
    }

    /// As [`Store::lease`] with another term.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn lease_for(&self, study_id: i64, kind: Kind, term: Duration) -> Result<Option<Lease>> {
        let mut tx = self.begin("a lease").await?;
        reap(&mut tx).await.map_err(|e| self.explain("a lease", &e))?;
        let mut lease = self.claim(&mut tx, study_id, kind, false, term).await?;
        if lease.is_none() {
            lease = self.claim(&mut tx, study_id, kind, true, term).await?;
        }
        tx.commit().await.map_err(|e| self.explain("a lease", &e))?;
        Ok(lease)
    }

    /// Leases the next job of `kind` of any active study: by priority, then who had
    /// the least time so far.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn lease_any(&self, pool: &Pool, kind: Kind) -> Result<Option<Lease>> {
        let explain = |e: sqlx::Error| self.explain("a lease", &e);
        // Idle workers only read.
        if self.candidates(&mut *self.queue.acquire().await.map_err(explain)?, pool, kind).await?.is_empty() {
            return Ok(None);
        }
        let mut tx = self.begin("a lease").await?;
        reap(&mut tx).await.map_err(explain)?;
        let mut lease = None;
        for study_id in self.candidates(&mut tx, pool, kind).await? {
            lease = self.claim(&mut tx, study_id, kind, false, LEASE).await?;
            if lease.is_some() {
                break;
            }
        }
        tx.commit().await.map_err(explain)?;
        Ok(lease)
    }

    /// Whether a trial waits that the pool may take.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn has_trial_for(&self, pool: &Pool) -> Result<bool> {
        let mut reader = self.queue.acquire().await.map_err(|e| self.explain("reading the queue", &e))?;
        Ok(!self.candidates(&mut reader, pool, Kind::Trial).await?.is_empty())
    }

    async fn candidates(&self, connection: &mut SqliteConnection, pool: &Pool, kind: Kind) -> Result<Vec<i64>> {
        let used = if kind == Kind::Trial { "lane_ms" } else { "beside_ms" };
        let name = kind.word();
        let sql = format!(
            "SELECT s.id FROM studies s WHERE s.state = 'active' AND s.machine_class = $1 AND s.build_profile IN ('', $2) \
             AND NOT EXISTS (SELECT 1 FROM settings WHERE name = 'pool' AND value = 'paused') \
             AND EXISTS (SELECT 1 FROM jobs j WHERE j.study_id = s.id AND j.kind = '{name}' AND j.state = 'queued') \
             ORDER BY s.priority DESC, s.{used}, s.id"
        );
        sqlx::query_scalar(sqlx::AssertSqlSafe(sql))
            .bind(&pool.machine_class)
            .bind(&pool.build_profile)
            .fetch_all(connection)
            .await
            .map_err(|e| self.explain("reading the queue", &e))
    }

    async fn claim(
        &self,
        tx: &mut Transaction<'_, Sqlite>,
        study_id: i64,
        kind: Kind,
        shared: bool,
        term: Duration,
    ) -> Result<Option<Lease>> {
        let explain = |e: sqlx::Error| self.explain("a lease", &e);
        let (now, me) = (now_ms(), owner::this());
        loop {
            let row: Option<(i64, String, i64, i64, i64)> = sqlx::query_as(sqlx::AssertSqlSafe(claim(kind, shared)))
                .bind(study_id)
                .bind(me)
                .bind(now + term.as_millis() as i64)
                .fetch_optional(&mut **tx)
                .await
                .map_err(explain)?;
            let Some((id, target, repeat, take, epoch)) = row else { return Ok(None) };
            let row: Option<(String, String, String, String)> = sqlx::query_as(cell(kind))
                .bind(study_id)
                .bind(&target)
                .fetch_optional(&mut **tx)
                .await
                .map_err(explain)?;
            let Some((spec, policy, structure, culling)) = row else {
                // Nobody's any more: the study that it was queued for has another matrix now.
                sqlx::query("UPDATE jobs SET state = 'cancelled', owner = NULL, lease_until_ms = 0 WHERE id = $1")
                    .bind(id)
                    .execute(&mut **tx)
                    .await
                    .map_err(explain)?;
                continue;
            };
            sqlx::query("INSERT INTO attempts (job_id, epoch, owner, started_ms) VALUES ($1, $2, $3, $4)")
                .bind(id)
                .bind(epoch)
                .bind(me)
                .bind(now)
                .execute(&mut **tx)
                .await
                .map_err(explain)?;
            let (spec, policy) = (self.parse(&spec, "a run")?, self.parse(&policy, "a policy")?);
            let label = super::label(&spec, &structure, &culling);
            let job = Job { id, kind, target, repeat: repeat as u32, take: take as u32 };
            return Ok(Some(Lease { job, epoch, spec, label, study_id, policy }));
        }
    }

    /// Notes the time that a job took, so that studies get equal shares.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn charge(&self, lease: &Lease, time: Duration) -> Result<()> {
        sqlx::query(match lease.job.kind {
            Kind::Trial => "UPDATE studies SET lane_ms = lane_ms + $2 WHERE id = $1",
            Kind::Judge => "UPDATE studies SET beside_ms = beside_ms + $2 WHERE id = $1",
        })
        .bind(lease.study_id)
        .bind(time.as_millis().max(1) as i64)
        .execute(&self.writer)
        .await
        .map_err(|e| self.explain("the queue", &e))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_looks_at_no_more_jobs_than_it_must() {
        let dir = tempfile::tempdir().unwrap();
        crate::store::block_on(async {
            let store = Store::open(&dir.path().join("x.db")).await?;
            for kind in [Kind::Trial, Kind::Judge] {
                let sql = format!("EXPLAIN QUERY PLAN {}", claim(kind, false));
                let plan: Vec<(i64, i64, i64, String)> =
                    sqlx::query_as(sqlx::AssertSqlSafe(sql)).fetch_all(&store.readers).await.unwrap();
                let steps: Vec<&str> = plan.iter().map(|p| p.3.as_str()).collect();
                assert!(steps.iter().any(|s| s.contains("(study_id=? AND kind=? AND state=?)")), "{steps:?}");
                assert!(!steps.iter().any(|s| s.contains("SCAN j") || s.contains("SCAN b")), "{steps:?}");
                // All judgements of a large study passed by at each claim once, at 9 ms a time.
                assert!(!steps.iter().any(|s| s.ends_with("(kind=?)")), "{steps:?}");
            }
            store.close().await;
            Ok::<_, crate::Error>(())
        })
        .unwrap();
    }
}
