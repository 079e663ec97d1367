//! What must hold of the database that was left, and of its answers beside the
//! undisturbed one's.

use super::Plan;
use super::lab::{self, Lab};
use cullmark::store::block_on;
use sqlx::{AssertSqlSafe, Connection, SqliteConnection};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

/// Each counts what must not be there.
const NONE_OF: &[(&str, &str)] = &[
    ("runs that are not done", "SELECT count(*) FROM measurements WHERE status <> 'done'"),
    ("jobs that are not done", "SELECT count(*) FROM jobs WHERE state <> 'done'"),
    ("attempts without an end", "SELECT count(*) FROM attempts WHERE outcome IS NULL OR ended_ms IS NULL"),
    (
        "done jobs without exactly one accepted attempt",
        "SELECT count(*) FROM jobs j WHERE j.state = 'done' AND \
      (SELECT count(*) FROM attempts a WHERE a.job_id = j.id AND a.outcome = 'accepted') <> 1",
    ),
    (
        "accepted attempts that are not the last of their job",
        "SELECT count(*) FROM attempts a JOIN jobs j ON \
      j.id = a.job_id WHERE a.outcome = 'accepted' AND a.epoch <> j.epoch",
    ),
    (
        "jobs with more or fewer attempts than leases",
        "SELECT count(*) FROM jobs j WHERE j.epoch <> (SELECT count(*) FROM attempts a WHERE a.job_id = j.id)",
    ),
    ("attempts of no job", "SELECT count(*) FROM attempts WHERE job_id NOT IN (SELECT id FROM jobs)"),
    (
        "done trial jobs without a trial",
        "SELECT count(*) FROM jobs j WHERE j.kind = 'trial' AND NOT EXISTS (SELECT 1 \
      FROM trials t WHERE t.measurement_id = j.target AND t.repeat_index = j.repeat_index AND t.take = j.take)",
    ),
    (
        "trials without a done job",
        "SELECT count(*) FROM trials t WHERE NOT EXISTS (SELECT 1 FROM jobs j WHERE \
      j.kind = 'trial' AND j.state = 'done' AND j.target = t.measurement_id AND j.repeat_index = t.repeat_index AND j.take = t.take)",
    ),
    (
        "judge jobs without a judgement",
        "SELECT count(*) FROM jobs WHERE kind = 'judge' AND target NOT IN \
      (SELECT judgement_id FROM judgements)",
    ),
    (
        "judgements without a job",
        "SELECT count(*) FROM judgements WHERE judgement_id NOT IN \
      (SELECT target FROM jobs WHERE kind = 'judge' AND state = 'done')",
    ),
    (
        "measurements without a judgement",
        "SELECT count(*) FROM measurements WHERE judgement_id NOT IN \
      (SELECT judgement_id FROM judgements)",
    ),
    (
        "runs of no measurement",
        "SELECT count(*) FROM study_runs WHERE measurement_id NOT IN (SELECT measurement_id FROM measurements)",
    ),
    (
        "measurements of no run",
        "SELECT count(*) FROM measurements WHERE measurement_id NOT IN (SELECT measurement_id FROM study_runs)",
    ),
    (
        "trials of no measurement",
        "SELECT count(*) FROM trials WHERE measurement_id NOT IN (SELECT measurement_id FROM measurements)",
    ),
    (
        "series of no trial",
        "SELECT count(*) FROM series s WHERE NOT EXISTS (SELECT 1 FROM trials t WHERE \
      t.measurement_id = s.measurement_id AND (s.repeat_index = -1 OR (t.repeat_index = s.repeat_index AND t.take = s.take)))",
    ),
    (
        "trials without times",
        "SELECT count(*) FROM trials t WHERE NOT EXISTS (SELECT 1 FROM series s WHERE \
      s.measurement_id = t.measurement_id AND s.repeat_index = t.repeat_index AND s.take = t.take AND s.name = 'cull_ns')",
    ),
    (
        "counters of no measurement",
        "SELECT count(*) FROM counters WHERE measurement_id NOT IN (SELECT measurement_id FROM measurements)",
    ),
    (
        "answers of no measurement",
        "SELECT count(*) FROM answers WHERE answer_id NOT IN (SELECT answer_id FROM measurements)",
    ),
    (
        "trials of an unknown environment",
        "SELECT count(*) FROM trials WHERE environment_id NOT IN (SELECT environment_id FROM environments)",
    ),
    (
        "measurements whose trials disagree",
        "SELECT count(*) FROM (SELECT measurement_id FROM trials GROUP BY measurement_id \
      HAVING count(DISTINCT frames_hash) + count(DISTINCT work_json) > 2)",
    ),
    (
        "trials that disagree with the answer",
        "SELECT count(*) FROM trials t JOIN measurements m ON m.measurement_id = t.measurement_id \
      JOIN answers a ON a.answer_id = m.answer_id WHERE a.frames_hash IS NOT t.frames_hash",
    ),
    (
        "judgements that disagree with the answer",
        "SELECT count(*) FROM judgements j JOIN answers a ON a.answer_id = j.answer_id \
      WHERE a.frames_hash IS NOT j.frames_hash",
    ),
    ("broken references", "SELECT count(*) FROM pragma_foreign_key_check"),
];

/// All that is counted and none of what is timed: equal to the undisturbed study's, line by line.
const ANSWERS: &[(&str, &str)] = &[
    (
        "runs",
        "SELECT r.ordinal || ' ' || r.measurement_id || ' ' || r.judgement_id || ' ' || r.spec_json || ' ' || m.status || ' ' || \
      m.repeats || ' ' || m.answer_id || ' ' || m.stop_reason FROM study_runs r JOIN measurements m ON m.measurement_id = r.measurement_id",
    ),
    (
        "trials",
        "SELECT measurement_id || ' ' || repeat_index || ' ' || frames_hash || ' ' || work_json FROM trials WHERE take = 0",
    ),
    ("counters", "SELECT measurement_id || ' ' || name || ' ' || unit || ' ' || value FROM counters"),
    (
        "counted series",
        "SELECT measurement_id || ' ' || ordinal || ' ' || name || ' ' || hex(data) FROM series WHERE repeat_index = -1",
    ),
    (
        "judgements",
        "SELECT judgement_id || ' ' || answer_id || ' ' || class || ' ' || coalesce(wrong, '') || ' ' || frames_hash || ' ' || \
      record_json FROM judgements",
    ),
    ("answers", "SELECT answer_id || ' ' || frames_hash FROM answers"),
];

async fn open(path: &Path) -> SqliteConnection {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(path);
    SqliteConnection::connect_with(&options).await.expect("the database opens")
}

async fn lines(c: &mut SqliteConnection, sql: &str) -> BTreeSet<String> {
    let all: Vec<String> = sqlx::query_scalar(AssertSqlSafe(sql)).fetch_all(c).await.expect(sql);
    all.into_iter().collect()
}

async fn number(c: &mut SqliteConnection, sql: &str) -> i64 {
    sqlx::query_scalar(AssertSqlSafe(sql)).fetch_one(c).await.expect(sql)
}

/// The table of outcomes, and what does not hold.
pub fn all(lab: &Lab, plan: &Plan, reference: &Path, ended: &BTreeSet<(String, String)>) -> (String, Vec<String>) {
    block_on(async {
        let (mut text, mut wrong) = (String::new(), Vec::new());
        let mut c = open(&lab.database()).await;
        for (name, sql) in NONE_OF {
            match number(&mut c, sql).await {
                0 => {}
                n => wrong.push(format!("{n} {name}")),
            }
        }
        let health = lines(&mut c, "SELECT integrity_check FROM pragma_integrity_check").await;
        if !health.iter().eq(["ok"]) {
            wrong.push(format!("integrity_check: {health:?}"));
        }
        let cells = lab::cells(plan);
        let counted = [
            ("SELECT count(*) FROM study_runs", cells),
            ("SELECT count(*) FROM measurements", cells),
            ("SELECT count(*) FROM trials WHERE take = 0", cells * plan.repeats),
        ];
        for (sql, expected) in counted {
            let n = number(&mut c, sql).await;
            if n != expected as i64 {
                wrong.push(format!("{sql}: {n} instead of {expected}"));
            }
        }
        for row in lines(&mut c, "SELECT coalesce(reason, '?') FROM measurements WHERE status <> 'done'").await {
            wrong.push(format!("a run is not done: {row}"));
        }
        said(&mut c, ended, &mut wrong).await;
        compare(&mut c, reference, &mut wrong).await;
        outcomes(&mut c, &mut text).await;
        let _ = writeln!(text, "\nruns that some process said were done, all of them in the database: {}", ended.len());
        c.close().await.expect("closing");
        (text, wrong)
    })
}

/// Nothing that was told as done may be missing.
async fn said(c: &mut SqliteConnection, ended: &BTreeSet<(String, String)>, wrong: &mut Vec<String>) {
    let labels = "SELECT DISTINCT json_extract(r.spec_json, '$.scene.name') || ': ' || r.structure_label || ' × ' || r.culling_label \
                  FROM study_runs r JOIN measurements m ON m.measurement_id = r.measurement_id WHERE m.status = 'done'";
    let done = lines(c, labels).await;
    if ended.is_empty() {
        wrong.push("no process told that a run ended".to_string());
    }
    for (run, status) in ended {
        if status != "Done" {
            wrong.push(format!("told as {status}: {run}"));
        } else if !done.contains(run) {
            wrong.push(format!("told as done, but is not: {run}"));
        }
    }
}

async fn compare(c: &mut SqliteConnection, reference: &Path, wrong: &mut Vec<String>) {
    let mut calm = open(reference).await;
    for (name, sql) in ANSWERS {
        let (here, there) = (lines(c, sql).await, lines(&mut calm, sql).await);
        if here != there {
            let (more, less) = (here.difference(&there).count(), there.difference(&here).count());
            wrong.push(format!("{name} differ from the undisturbed study's: {more} here only, {less} there only"));
        }
    }
    calm.close().await.expect("closing");
}

async fn outcomes(c: &mut SqliteConnection, text: &mut String) {
    *text += "\n| attempts that ended | trials | judgements |\n|---|---|---|\n";
    let sql = "SELECT a.outcome, sum(j.kind = 'trial'), sum(j.kind = 'judge') FROM attempts a JOIN jobs j ON j.id = a.job_id GROUP BY 1";
    let rows: Vec<(Option<String>, i64, i64)> = sqlx::query_as(sql).fetch_all(&mut *c).await.expect(sql);
    for (outcome, trials, judgements) in rows {
        let _ = writeln!(text, "| {} | {trials} | {judgements} |", outcome.as_deref().unwrap_or("never"));
    }
    let retakes = number(c, "SELECT count(*) FROM trials WHERE take = 1").await;
    let most = number(c, "SELECT max(epoch) FROM jobs").await;
    let bytes = number(c, "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size").await;
    let _ = writeln!(
        text,
        "\nmost leases of one job: {most}; second takes of disturbed trials: {retakes}; database: {} KiB",
        bytes >> 10
    );
}
