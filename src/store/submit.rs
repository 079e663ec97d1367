//! A study's matrix becomes rows: idempotently, in one transaction, with
//! multi-row inserts. What is finished is skipped, also across studies.

use super::rows::{insert_judge_jobs, insert_measurements, insert_trial_jobs};
use super::{Store, changes, now_ms, turns};
use crate::error::Result;
use crate::record::{RepeatPolicy, RunSpec};
use crate::results::Excluded;
use rayon::prelude::*;
use sqlx::{QueryBuilder, Sqlite, Transaction};
use std::collections::{BTreeMap, HashMap, HashSet};

/// SQLite takes 32,766 placeholders a statement; our widest row has nine.
pub(super) const CHUNK: usize = 1000;

/// One cell of the matrix with its short labels (parameters that have their default left out).
#[derive(Debug, Clone)]
pub struct Cell {
    pub spec: RunSpec,
    pub structure: String,
    pub culling: String,
    pub walk: String,
}

/// All of a study that the store keeps. Every cell's `spec.series` is `series`.
#[derive(Debug, Clone)]
pub struct Submission {
    pub name: String,
    pub title: String,
    pub manifest_toml: String,
    /// The manifest's claims as JSON, kept for the report.
    pub claims_json: String,
    /// Its sweeps as JSON, likewise.
    pub sweeps_json: String,
    pub consolidate_frames: u32,
    pub policy: RepeatPolicy,
    pub machine_class: String,
    pub series: u32,
    pub cells: Vec<Cell>,
    pub excluded: Vec<Excluded>,
    /// Queue again what failed before.
    pub retry_failed: bool,
    /// Higher first, where a pool has the choice.
    pub priority: i64,
    /// Where files that the manifest names start from.
    pub folder: String,
}

/// What a submission found and added. Counts are of runs; a cell that occurs twice counts twice.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Submitted {
    pub study_id: i64,
    pub runs: u64,
    pub done: u64,
    pub failed: u64,
    pub wrong: u64,
    /// Begun earlier, or finished for fewer repeats or another accuracy than is asked now.
    pub resumed: u64,
    pub new: u64,
    pub jobs_added: u64,
}

pub(super) struct Ids {
    pub answer: String,
    pub measurement: String,
    /// Empty when nothing is judged.
    pub judgement: String,
    pub truth: String,
    pub spec_json: String,
}

struct Known {
    status: String,
    repeats: i64,
    relative_ci: Option<f64>,
    judgement: String,
}

impl Store {
    /// The series that `run --series next` measures: one more than any stored.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn next_series(&self, name: &str) -> Result<u32> {
        let last: Option<i64> = sqlx::query_scalar("SELECT max(series) FROM studies WHERE name = $1")
            .bind(name)
            .fetch_one(&self.readers)
            .await
            .map_err(|e| self.explain("reading the studies", &e))?;
        Ok(last.map_or(0, |s| s as u32 + 1))
    }

    /// Stores the study and queues what is not finished. Submitting twice changes nothing.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn submit(&self, s: &Submission) -> Result<Submitted> {
        let ids: Vec<Ids> = s.cells.par_iter().map(|c| ids_of(&c.spec, &s.machine_class)).collect();
        let mut tx = self.begin("the study").await?;
        let out = submit(&mut tx, s, &ids).await.map_err(|e| self.explain("the study", &e))?;
        tx.commit().await.map_err(|e| self.explain("the study", &e))?;
        Ok(out)
    }
}

fn ids_of(spec: &RunSpec, machine_class: &str) -> Ids {
    Ids {
        answer: spec.answer_id(),
        measurement: spec.measurement_id(machine_class),
        judgement: if spec.accuracy.frames == 0 { String::new() } else { spec.judgement_id() },
        truth: spec.truth_id(),
        spec_json: serde_json::to_string(spec).expect("a spec is plain data"),
    }
}

async fn submit(tx: &mut Transaction<'_, Sqlite>, s: &Submission, ids: &[Ids]) -> sqlx::Result<Submitted> {
    let blocks = blocks(&s.cells);
    let study_id = put_study(tx, s, ids, &blocks).await?;
    turns::let_go(tx, study_id).await?;
    if s.retry_failed {
        retry_failed(tx, study_id).await?;
    }
    let known = known(tx, ids).await?;
    let changed = changes::tick(tx).await?;
    let judged: HashSet<String> =
        select_ids(tx, "SELECT judgement_id FROM judgements WHERE judgement_id IN (", ids, |i| &i.judgement).await?;

    let mut out = Submitted { study_id, runs: ids.len() as u64, ..Submitted::default() };
    let mut new = Vec::new();
    let mut open = Vec::new();
    let mut judge = Vec::new();
    let mut seen = HashMap::new();
    for (i, id) in ids.iter().enumerate() {
        let needs_judge = !id.judgement.is_empty() && !judged.contains(&id.judgement);
        let class = match known.get(&id.measurement) {
            None => "new",
            Some(k) => match k.status.as_str() {
                "failed" => "failed",
                "wrong" => "wrong",
                "done" if !needs_judge && !falls_short(k, &s.policy) => "done",
                _ => "resumed",
            },
        };
        match class {
            "new" => out.new += 1,
            "failed" => out.failed += 1,
            "wrong" => out.wrong += 1,
            "done" => out.done += 1,
            _ => out.resumed += 1,
        }
        let first = seen.insert(&id.measurement, i).is_none();
        if !first || matches!(class, "failed" | "wrong" | "done") {
            continue;
        }
        if class == "new" {
            new.push(i);
        } else if let Some(k) = known.get(&id.measurement)
            && (k.status == "done" || (!id.judgement.is_empty() && k.judgement != id.judgement))
        {
            sqlx::query("UPDATE measurements SET status = 'pending', judgement_id = CASE $2 WHEN '' THEN judgement_id ELSE $2 END, changed = $3 WHERE measurement_id = $1")
                .bind(&id.measurement)
                .bind(&id.judgement)
                .bind(changed)
                .execute(&mut **tx)
                .await?;
        }
        open.push(i);
        if needs_judge {
            judge.push(i);
        }
    }
    insert_measurements(tx, s, ids, &new).await?;
    out.jobs_added += insert_judge_jobs(tx, study_id, ids, &blocks, &judge).await?;
    out.jobs_added += insert_trial_jobs(tx, study_id, s, ids, &blocks, &open).await?;
    turns::most_urgent(tx, study_id).await?;
    Ok(out)
}

/// A finished measurement that does not reach what is asked of it now.
fn falls_short(k: &Known, policy: &RepeatPolicy) -> bool {
    let repeats = k.repeats as u32;
    let wide = match (policy.relative_ci, k.relative_ci) {
        (Some(asked), Some(reached)) => reached > asked,
        (Some(_), None) => true,
        (None, _) => false,
    };
    repeats < policy.repeats || (wide && repeats < policy.max_repeats)
}

/// Rank of each cell's scene in order of first appearance.
fn blocks(cells: &[Cell]) -> Vec<i64> {
    let mut ranks = BTreeMap::new();
    cells
        .iter()
        .map(|c| {
            let next = ranks.len() as i64;
            *ranks.entry(c.spec.scene.fingerprint.as_str()).or_insert(next)
        })
        .collect()
}

async fn put_study(tx: &mut Transaction<'_, Sqlite>, s: &Submission, ids: &[Ids], blocks: &[i64]) -> sqlx::Result<i64> {
    let mut hash = blake3::Hasher::new();
    for (id, c) in ids.iter().zip(&s.cells) {
        for text in [&id.measurement, &id.judgement, &id.spec_json, &c.structure, &c.culling, &c.walk] {
            hash.update(text.as_bytes()).update(b"\n");
        }
    }
    for e in &s.excluded {
        hash.update(format!("{}\n{}\n{}\n", e.cell, e.why, e.count).as_bytes());
    }
    let runs_hash = hash.finalize().to_hex()[..32].to_string();
    let before: Option<(i64, String)> =
        sqlx::query_as("SELECT id, runs_hash FROM studies WHERE name = $1 AND series = $2")
            .bind(&s.name)
            .bind(i64::from(s.series))
            .fetch_optional(&mut **tx)
            .await?;
    let (study_id,): (i64,) = sqlx::query_as(
        "INSERT INTO studies (name, series, title, manifest_toml, claims_json, policy_json, consolidate_frames, \
         machine_class, runs_hash, created_ms, submitted_ms, sweeps_json, priority, folder, build_profile) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $10, $11, $12, $13, $14) \
         ON CONFLICT (name, series) DO UPDATE SET title = excluded.title, manifest_toml = excluded.manifest_toml, \
         claims_json = excluded.claims_json, policy_json = excluded.policy_json, \
         consolidate_frames = excluded.consolidate_frames, machine_class = excluded.machine_class, \
         runs_hash = excluded.runs_hash, submitted_ms = excluded.submitted_ms, sweeps_json = excluded.sweeps_json, \
         priority = excluded.priority, folder = excluded.folder, build_profile = excluded.build_profile, \
         state = 'active' RETURNING id",
    )
    .bind(&s.name)
    .bind(i64::from(s.series))
    .bind(&s.title)
    .bind(&s.manifest_toml)
    .bind(&s.claims_json)
    .bind(serde_json::to_string(&s.policy).expect("a policy is plain data"))
    .bind(i64::from(s.consolidate_frames))
    .bind(&s.machine_class)
    .bind(&runs_hash)
    .bind(now_ms())
    .bind(&s.sweeps_json)
    .bind(s.priority)
    .bind(&s.folder)
    .bind(s.cells.first().map_or("", |c| c.spec.protocol.build_profile.as_str()))
    .fetch_one(&mut **tx)
    .await?;
    turns::join_the_queue(tx, study_id).await?;
    if before.is_some_and(|(_, hash)| hash == runs_hash) {
        return Ok(study_id);
    }
    for table in ["DELETE FROM study_runs WHERE study_id = $1", "DELETE FROM excluded WHERE study_id = $1"] {
        sqlx::query(table).bind(study_id).execute(&mut **tx).await?;
    }
    let rows: Vec<usize> = (0..ids.len()).collect();
    for chunk in rows.chunks(CHUNK) {
        QueryBuilder::<Sqlite>::new(
            "INSERT INTO study_runs (study_id, ordinal, block, measurement_id, judgement_id, spec_json, \
             structure_label, culling_label, walk_label) ",
        )
        .push_values(chunk, |mut row, i| {
            let (id, cell) = (&ids[*i], &s.cells[*i]);
            row.push_bind(study_id).push_bind(*i as i64).push_bind(blocks[*i]);
            row.push_bind(id.measurement.clone()).push_bind(id.judgement.clone()).push_bind(id.spec_json.clone());
            row.push_bind(cell.structure.clone()).push_bind(cell.culling.clone()).push_bind(cell.walk.clone());
        })
        .build()
        .execute(&mut **tx)
        .await?;
    }
    for (i, e) in s.excluded.iter().enumerate() {
        sqlx::query("INSERT INTO excluded (study_id, ordinal, cell, why, cells) VALUES ($1, $2, $3, $4, $5)")
            .bind(study_id)
            .bind(i as i64)
            .bind(&e.cell)
            .bind(&e.why)
            .bind(e.count as i64)
            .execute(&mut **tx)
            .await?;
    }
    Ok(study_id)
}

/// Failed and cancelled jobs of the study's failed measurements wait again, with a clean count of
/// attempts. Trials already accepted stay, unless they are what disagreed: then all are taken anew.
pub(super) async fn retry_failed(tx: &mut Transaction<'_, Sqlite>, study_id: i64) -> sqlx::Result<()> {
    changes::tick(tx).await?;
    let failed = "SELECT m.measurement_id FROM measurements m JOIN study_runs r ON r.measurement_id = m.measurement_id \
                  WHERE r.study_id = $1 AND m.status = 'failed'";
    let disagreed = format!("{failed} AND m.reason LIKE 'counters differ%'");
    let judged = failed.replace("m.measurement_id FROM", "m.judgement_id FROM");
    for sql in [
        format!("DELETE FROM series WHERE measurement_id IN ({disagreed})"),
        format!("DELETE FROM counters WHERE measurement_id IN ({disagreed})"),
        format!("DELETE FROM trials WHERE measurement_id IN ({disagreed})"),
        format!(
            "DELETE FROM judgements WHERE judgement_id IN ({})",
            disagreed.replace("m.measurement_id FROM", "m.judgement_id FROM")
        ),
        format!(
            "UPDATE answers SET frames_hash = NULL WHERE answer_id IN ({})",
            disagreed.replace("m.measurement_id FROM", "m.answer_id FROM")
        ),
        format!(
            "UPDATE jobs SET state = 'queued', study_id = $1, attempts = 0, reason = NULL WHERE kind = 'trial' AND target IN ({disagreed})"
        ),
        format!(
            "UPDATE jobs SET state = 'queued', study_id = $1, attempts = 0, reason = NULL WHERE kind = 'judge' AND state = 'done' AND target IN ({judged}) \
                 AND NOT EXISTS (SELECT 1 FROM judgements j WHERE j.judgement_id = jobs.target)"
        ),
        format!(
            "UPDATE jobs SET state = 'queued', study_id = $1, attempts = 0, reason = NULL WHERE kind = 'trial' AND state IN ('failed', 'cancelled') AND target IN ({failed})"
        ),
        format!(
            "UPDATE jobs SET state = 'queued', study_id = $1, attempts = 0, reason = NULL WHERE kind = 'judge' AND state IN ('failed', 'cancelled') AND target IN ({judged})"
        ),
        format!(
            "UPDATE measurements SET status = 'pending', reason = NULL, stop_reason = NULL, finished_ms = NULL, \
                 changed = (SELECT now FROM clock) WHERE measurement_id IN ({failed})"
        ),
    ] {
        sqlx::query(sqlx::AssertSqlSafe(sql)).bind(study_id).execute(&mut **tx).await?;
    }
    Ok(())
}

async fn known(tx: &mut Transaction<'_, Sqlite>, ids: &[Ids]) -> sqlx::Result<HashMap<String, Known>> {
    let mut out = HashMap::with_capacity(ids.len());
    for chunk in ids.chunks(CHUNK) {
        let mut q = QueryBuilder::<Sqlite>::new(
            "SELECT measurement_id, status, repeats, relative_ci, judgement_id FROM measurements WHERE measurement_id IN (",
        );
        let mut list = q.separated(", ");
        for id in chunk {
            list.push_bind(id.measurement.clone());
        }
        q.push(")");
        type Row = (String, String, i64, Option<f64>, String);
        for (id, status, repeats, relative_ci, judgement) in q.build_query_as::<Row>().fetch_all(&mut **tx).await? {
            out.insert(id, Known { status, repeats, relative_ci, judgement });
        }
    }
    Ok(out)
}

async fn select_ids(
    tx: &mut Transaction<'_, Sqlite>,
    sql: &'static str,
    ids: &[Ids],
    field: fn(&Ids) -> &String,
) -> sqlx::Result<HashSet<String>> {
    let mut out = HashSet::with_capacity(ids.len());
    for chunk in ids.chunks(CHUNK) {
        let mut q = QueryBuilder::<Sqlite>::new(sql);
        let mut list = q.separated(", ");
        for id in chunk {
            list.push_bind(field(id).clone());
        }
        q.push(")");
        out.extend(q.build_query_scalar::<String>().fetch_all(&mut **tx).await?);
    }
    Ok(out)
}
