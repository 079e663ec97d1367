//! New rows of a submission, many a statement.

use super::submit::{CHUNK, Ids, Submission};
use super::{changes, now_ms};
use sqlx::{QueryBuilder, Sqlite, Transaction};

/// Trials are blocked by scene; within it one repeat of every run comes before
/// the next repeat of any (randomised complete blocks), in an order drawn from
/// the recorded seed by hashing, so that repeats added later need no state.
pub(super) fn trial_order(block: i64, repeat: u32, seed: u64, measurement_id: &str) -> i64 {
    let mut hash = blake3::Hasher::new();
    hash.update(&seed.to_le_bytes()).update(&repeat.to_le_bytes()).update(measurement_id.as_bytes());
    let draw = u32::from_le_bytes(hash.finalize().as_bytes()[..4].try_into().expect("four bytes"));
    (block.min(0x3fff) << 48) | (i64::from(repeat.min(0xffff)) << 32) | i64::from(draw)
}

/// A cancelled job waits again; one that waits for a study that does not want it now
/// (paused, cancelled, deleted) becomes ours.
const TAKE_OVER: &str = " ON CONFLICT (kind, target, repeat_index, take) DO UPDATE SET state = 'queued', \
    study_id = excluded.study_id WHERE jobs.state = 'cancelled' OR (jobs.state = 'queued' AND jobs.study_id NOT IN \
    (SELECT id FROM studies WHERE state = 'active' AND machine_class = \
    (SELECT machine_class FROM studies WHERE id = excluded.study_id)))";

pub(super) async fn insert_measurements(
    tx: &mut Transaction<'_, Sqlite>,
    s: &Submission,
    ids: &[Ids],
    new: &[usize],
) -> sqlx::Result<()> {
    let (now, changed) = (now_ms(), changes::tick(tx).await?);
    for chunk in new.chunks(CHUNK) {
        QueryBuilder::<Sqlite>::new("INSERT INTO answers (answer_id, created_ms) ")
            .push_values(chunk, |mut row, i| {
                row.push_bind(ids[*i].answer.clone()).push_bind(now);
            })
            .push(" ON CONFLICT DO NOTHING")
            .build()
            .execute(&mut **tx)
            .await?;
        QueryBuilder::<Sqlite>::new(
            "INSERT INTO measurements (measurement_id, answer_id, judgement_id, machine_class, series, protocol_json, \
             status, created_ms, changed) ",
        )
        .push_values(chunk, |mut row, i| {
            let (id, spec) = (&ids[*i], &s.cells[*i].spec);
            row.push_bind(id.measurement.clone()).push_bind(id.answer.clone()).push_bind(id.judgement.clone());
            row.push_bind(s.machine_class.clone()).push_bind(i64::from(spec.series));
            row.push_bind(serde_json::to_string(&spec.protocol).expect("a protocol is plain data"));
            row.push_bind("pending").push_bind(now).push_bind(changed);
        })
        .push(" ON CONFLICT DO NOTHING")
        .build()
        .execute(&mut **tx)
        .await?;
    }
    Ok(())
}

pub(super) async fn insert_judge_jobs(
    tx: &mut Transaction<'_, Sqlite>,
    study_id: i64,
    ids: &[Ids],
    blocks: &[i64],
    judge: &[usize],
) -> sqlx::Result<u64> {
    let mut added = 0;
    for chunk in judge.chunks(CHUNK) {
        added += QueryBuilder::<Sqlite>::new(
            "INSERT INTO jobs (kind, target, repeat_index, take, group_key, order_key, state, study_id) ",
        )
        .push_values(chunk, |mut row, i| {
            let id = &ids[*i];
            row.push_bind("judge").push_bind(id.judgement.clone()).push_bind(0i64).push_bind(0i64);
            row.push_bind(id.truth.clone()).push_bind((blocks[*i] << 48) | *i as i64).push_bind("queued");
            row.push_bind(study_id);
        })
        .push(TAKE_OVER)
        .build()
        .execute(&mut **tx)
        .await?
        .rows_affected();
    }
    Ok(added)
}

pub(super) async fn insert_trial_jobs(
    tx: &mut Transaction<'_, Sqlite>,
    study_id: i64,
    s: &Submission,
    ids: &[Ids],
    blocks: &[i64],
    open: &[usize],
) -> sqlx::Result<u64> {
    let mut rows: Vec<(i64, usize, u32)> = open
        .iter()
        .flat_map(|i| (0..s.policy.repeats).map(move |n| (*i, n)))
        .map(|(i, n)| (trial_order(blocks[i], n, s.policy.seed, &ids[i].measurement), i, n))
        .collect();
    rows.sort_unstable();
    let mut added = 0;
    for chunk in rows.chunks(CHUNK) {
        added += QueryBuilder::<Sqlite>::new(
            "INSERT INTO jobs (kind, target, repeat_index, take, group_key, order_key, state, study_id) ",
        )
        .push_values(chunk, |mut row, (order, i, n)| {
            row.push_bind("trial").push_bind(ids[*i].measurement.clone()).push_bind(i64::from(*n)).push_bind(0i64);
            row.push_bind(s.cells[*i].spec.scene.fingerprint.clone()).push_bind(*order).push_bind("queued");
            row.push_bind(study_id);
        })
        .push(TAKE_OVER)
        .build()
        .execute(&mut **tx)
        .await?
        .rows_affected();
    }
    Ok(added)
}
