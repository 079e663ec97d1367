//! Runs that are not finished: which of them wait for what, and which lack only a decision.

use super::{Pool, Store};
use crate::error::Result;
use crate::record::RunSpec;

impl Store {
    /// Open measurements that wait for a judgement, each with a study that has it:
    /// `study_id` if it has, since its policy is at hand.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn waiting_for(&self, study_id: i64, judgement_id: &str) -> Result<Vec<(i64, String)>> {
        sqlx::query_as(
            "SELECT coalesce(max(CASE r.study_id WHEN $1 THEN $1 END), min(r.study_id)), m.measurement_id \
             FROM study_runs r JOIN measurements m ON m.measurement_id = r.measurement_id \
             WHERE r.judgement_id = $2 AND m.status = 'pending' GROUP BY m.measurement_id ORDER BY min(r.ordinal)",
        )
        .bind(study_id)
        .bind(judgement_id)
        .fetch_all(&self.writer)
        .await
        .map_err(|e| self.explain("reading the study", &e))
    }

    /// Active studies of the pool that have an open run and no job to do.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn undecided(&self, pool: &Pool) -> Result<Vec<i64>> {
        sqlx::query_scalar(
            "SELECT s.id FROM studies s WHERE s.state = 'active' AND s.machine_class = $1 AND s.build_profile IN ('', $2) \
             AND NOT EXISTS (SELECT 1 FROM jobs j WHERE j.study_id = s.id AND j.kind = 'trial' AND j.state IN ('queued', 'leased')) \
             AND s.id IN (SELECT r.study_id FROM measurements m CROSS JOIN study_runs r \
             WHERE r.measurement_id = m.measurement_id AND m.status = 'pending')",
        )
        .bind(&pool.machine_class)
        .bind(&pool.build_profile)
        .fetch_all(&self.readers)
        .await
        .map_err(|e| self.explain("reading the studies", &e))
    }

    /// Whether a job waits or is under way whose turn comes with this study: at once, where
    /// counting all of them ([`Store::jobs_left`]) takes as long as the study is large.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn has_own_job(&self, study_id: i64) -> Result<bool> {
        sqlx::query_scalar(
            "SELECT EXISTS (SELECT 1 FROM jobs WHERE study_id = $1 AND kind IN ('trial', 'judge') \
             AND state IN ('queued', 'leased'))",
        )
        .bind(study_id)
        .fetch_one(&self.writer)
        .await
        .map_err(|e| self.explain("reading the queue", &e))
    }

    /// Measurements of the study about which something is to be decided: nobody works on
    /// them any more, or what ends them is known. The others are settled as their trials come in.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn loose_ends(&self, study_id: i64) -> Result<Vec<String>> {
        sqlx::query_scalar(
            "SELECT m.measurement_id FROM measurements m JOIN study_runs r ON r.measurement_id = m.measurement_id \
             WHERE r.study_id = $1 AND m.status = 'pending' AND ((NOT EXISTS (SELECT 1 FROM jobs j WHERE \
             j.kind = 'trial' AND j.target = m.measurement_id AND j.state IN ('queued', 'leased')) AND NOT EXISTS \
             (SELECT 1 FROM jobs j WHERE j.kind = 'judge' AND j.target = r.judgement_id AND j.state IN ('queued', 'leased'))) \
             OR EXISTS \
             (SELECT 1 FROM judgements g WHERE g.judgement_id = r.judgement_id AND g.wrong IS NOT NULL) OR EXISTS \
             (SELECT 1 FROM jobs j WHERE j.kind = 'trial' AND j.target = m.measurement_id AND +j.state = 'failed') OR \
             EXISTS (SELECT 1 FROM jobs j WHERE j.kind = 'judge' AND j.target = r.judgement_id AND +j.state = 'failed')) \
             GROUP BY m.measurement_id ORDER BY min(r.ordinal)",
        )
        .bind(study_id)
        .fetch_all(&self.writer)
        .await
        .map_err(|e| self.explain("reading the study", &e))
    }

    /// How the run is called in progress and logs.
    ///
    /// # Errors
    /// When the study has no such run or the database fails.
    pub async fn label_of(&self, study_id: i64, measurement_id: &str) -> Result<String> {
        let (json, structure, culling): (String, String, String) = sqlx::query_as(
            "SELECT spec_json, structure_label, culling_label FROM study_runs WHERE study_id = $1 AND measurement_id = $2 LIMIT 1",
        )
        .bind(study_id)
        .bind(measurement_id)
        .fetch_one(&self.writer)
        .await
        .map_err(|e| self.explain("reading the study", &e))?;
        Ok(super::label(&self.parse::<RunSpec>(&json, "a run")?, &structure, &culling))
    }
}
