//! Whose turn it is. A job that several studies want waits for one of them, and goes to
//! another when that one does not want it any more, or wants it less. A study that joins
//! the queue starts level with those in it, so that it neither waits for all of them nor
//! they for it (start-time fair queueing: Goyal, Vin and Cheng, 1996; one weight).

use super::queue::Kind;
use sqlx::{Sqlite, Transaction};

const KINDS: [Kind; 2] = [Kind::Trial, Kind::Judge];

/// What a job is about, in the matrix of a study.
fn target(kind: Kind) -> &'static str {
    match kind {
        Kind::Trial => "measurement_id",
        Kind::Judge => "judgement_id",
    }
}

/// Jobs that are `which` go to the most urgent active study that wants them and is `who`, if
/// there is one. A trial is of one class of machine by its name, a judgement is not.
fn give(kind: Kind, who: &str, which: &str) -> String {
    let (word, target) = (kind.word(), target(kind));
    let same = |what: &str| format!("AND s.{what} = (SELECT {what} FROM studies WHERE id = jobs.study_id)");
    let machine = if kind == Kind::Judge { same("machine_class") } else { String::new() };
    format!(
        "UPDATE jobs SET study_id = coalesce((SELECT r.study_id FROM study_runs r JOIN studies s ON s.id = r.study_id \
         WHERE r.{target} = jobs.target AND s.state = 'active' {machine} {who} ORDER BY s.priority DESC LIMIT 1), study_id) \
         WHERE kind = '{word}' AND {which}"
    )
}

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

async fn run(tx: &mut Transaction<'_, Sqlite>, sql: impl Into<String>, id: i64) -> sqlx::Result<()> {
    sqlx::query(sqlx::AssertSqlSafe(sql.into())).bind(id).execute(&mut **tx).await?;
    Ok(())
}

/// Jobs of a study that wait go to another one that wants them too, if there is one.
pub(super) async fn hand_over(tx: &mut Transaction<'_, Sqlite>, id: i64) -> sqlx::Result<()> {
    for kind in KINDS {
        run(tx, give(kind, "AND s.id <> $1", "study_id = $1 AND state IN ('queued', 'leased')"), id).await?;
    }
    Ok(())
}

pub(super) async fn take_back(tx: &mut Transaction<'_, Sqlite>, id: i64) -> sqlx::Result<()> {
    for sql in TAKE_BACK {
        run(tx, sql, id).await?;
    }
    Ok(())
}

/// After a matrix was replaced: jobs that it does not hold any more go to another study, or end.
pub(super) async fn let_go(tx: &mut Transaction<'_, Sqlite>, id: i64) -> sqlx::Result<()> {
    for kind in KINDS {
        let target = target(kind);
        let which = format!(
            "study_id = $1 AND state IN ('queued', 'leased') \
             AND target NOT IN (SELECT {target} FROM study_runs WHERE study_id = $1)"
        );
        run(tx, give(kind, "", &which), id).await?;
    }
    let rest = "UPDATE jobs SET state = 'cancelled' WHERE study_id = $1 AND state = 'queued' AND kind IN ('trial', 'judge') \
        AND target NOT IN (SELECT measurement_id FROM study_runs WHERE study_id = $1) \
        AND target NOT IN (SELECT judgement_id FROM study_runs WHERE study_id = $1)";
    run(tx, rest, id).await
}

/// After priorities, or who wants what, have changed: jobs that a study shares with others
/// wait for the most urgent one, and for the one they have waited for among equals. They are
/// done by the same builds of the program as before.
pub(super) async fn most_urgent(tx: &mut Transaction<'_, Sqlite>, id: i64) -> sqlx::Result<()> {
    let who = "AND s.build_profile = (SELECT build_profile FROM studies WHERE id = jobs.study_id) \
        AND s.priority > (SELECT priority FROM studies WHERE id = jobs.study_id)";
    for kind in KINDS {
        let target = target(kind);
        let which = format!(
            "(SELECT count(DISTINCT priority) FROM studies WHERE state = 'active') > 1 \
             AND state = 'queued' AND target IN (SELECT {target} FROM study_runs WHERE study_id = $1)"
        );
        run(tx, give(kind, who, &which), id).await?;
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
