//! A study in one file: every row that belongs to it, so that another database
//! (another machine) answers the same questions about it.
//!
//! `"CULLMARK STUDY\n"`, format version (u32 LE), blake3 of the payload, payload:
//! zstd over postcard. The hash is over the compressed bytes, so that damage is
//! found before anything is decoded.

use super::{Store, now_ms};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use sqlx::{FromRow, Sqlite, Transaction};
use std::path::Path;

const MAGIC: &[u8; 15] = b"CULLMARK STUDY\n";
/// Raised when a row type below changes. Version 1 had no sweeps, version 2 no advice.
const VERSION: u32 = 3;
const LEVEL: i32 = 9;
const HEADER: usize = MAGIC.len() + 4 + blake3::OUT_LEN;

/// Row types: fields in the order of their columns.
macro_rules! rows {
    ($($name:ident = $table:literal { $($field:ident: $type:ty),* $(,)? })*) => {$(
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, FromRow)]
        struct $name { $($field: $type),* }

        impl $name {
            const SELECT: &str = concat!("SELECT ", rows!(@list $($field),*), " FROM ", $table);

            /// Adds the row unless its key is there already.
            async fn insert(&self, tx: &mut Transaction<'_, Sqlite>) -> sqlx::Result<u64> {
                let marks: Vec<String> = (1..=[$(stringify!($field)),*].len()).map(|i| format!("${i}")).collect();
                let sql = format!(
                    "INSERT INTO {} ({}) VALUES ({}) ON CONFLICT DO NOTHING",
                    $table, rows!(@list $($field),*), marks.join(", ")
                );
                let query = sqlx::query(sqlx::AssertSqlSafe(sql));
                $(let query = query.bind(&self.$field);)*
                Ok(query.execute(&mut **tx).await?.rows_affected())
            }
        }
    )*};
    (@list $first:ident $(, $rest:ident)*) => { concat!(stringify!($first) $(, ", ", stringify!($rest))*) };
}

rows! {
    Study = "studies" {
        name: String, series: i64, title: String, manifest_toml: String, claims_json: String, policy_json: String,
        consolidate_frames: i64, machine_class: String, runs_hash: String, created_ms: i64, submitted_ms: i64,
    }
    Run = "study_runs" {
        study_id: i64, ordinal: i64, block: i64, measurement_id: String, judgement_id: String, spec_json: String,
        structure_label: String, culling_label: String, walk_label: String,
    }
    Out = "excluded" { study_id: i64, ordinal: i64, cell: String, why: String, cells: i64 }
    Answer = "answers" { answer_id: String, frames_hash: Option<String>, created_ms: i64 }
    Measurement = "measurements" {
        measurement_id: String, answer_id: String, judgement_id: String, machine_class: String, series: i64,
        protocol_json: String, status: String, reason: Option<String>, stop_reason: Option<String>, repeats: i64,
        relative_ci: Option<f64>, created_ms: i64, finished_ms: Option<i64>,
    }
    Trial = "trials" {
        measurement_id: String, repeat_index: i64, take: i64, accepted_ms: i64, wall_ns: i64, total_cull_ns: f64,
        build_ns: i64, prepare_ns: i64, load_ns: i64, peak_rss_bytes: i64, sentinel_ns: f64, switches: i64, noise: f64,
        noisy: i64, environment_id: String, machine_class: String, frames_hash: String, work_json: String,
        record_json: String,
    }
    Series = "series" {
        measurement_id: String, repeat_index: i64, take: i64, role: String, ordinal: i64, name: String, unit: String,
        data: Vec<u8>,
    }
    Counter = "counters" { measurement_id: String, name: String, unit: String, value: f64 }
    Judged = "judgements" {
        judgement_id: String, answer_id: String, class: String, wrong: Option<String>, frames_hash: String,
        record_json: String, accepted_ms: i64, wall_ns: i64,
    }
    Machine = "environments" { environment_id: String, machine_class: String, environment_json: String }
}

/// All rows of one study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Archive {
    study: Study,
    runs: Vec<Run>,
    excluded: Vec<Out>,
    answers: Vec<Answer>,
    measurements: Vec<Measurement>,
    trials: Vec<Trial>,
    series: Vec<Series>,
    counters: Vec<Counter>,
    judgements: Vec<Judged>,
    environments: Vec<Machine>,
    /// At the end, each later than the one before, so that what was written before they
    /// were is a prefix.
    sweeps_json: String,
    advice_json: String,
}

/// What an import brought.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Imported {
    /// `name@series`.
    pub study: String,
    pub runs: u64,
    /// Measurements that were not here, or not finished.
    pub measurements_added: u64,
    pub trials_added: u64,
}

const OF_STUDY: &str = "measurement_id IN (SELECT measurement_id FROM study_runs WHERE study_id = $1)";

impl Store {
    /// The study (a name or `name@series`) as the bytes of one file.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn export(&self, study: &str) -> Result<Vec<u8>> {
        let id = self.find(study).await?.id;
        // One snapshot, also while another process writes.
        let explain = |e: sqlx::Error| self.explain("reading the study", &e);
        let mut tx = self.readers.begin().await.map_err(explain)?;
        macro_rules! rows {
            ($row:ty, $filter:expr, $order:literal) => {{
                let sql = format!("{} WHERE {} ORDER BY {}", <$row>::SELECT, $filter, $order);
                sqlx::query_as::<_, $row>(sqlx::AssertSqlSafe(sql))
                    .bind(id)
                    .fetch_all(&mut *tx)
                    .await
                    .map_err(explain)?
            }};
        }
        let (sweeps_json, advice_json) = sqlx::query_as("SELECT sweeps_json, advice_json FROM studies WHERE id = $1")
            .bind(id)
            .fetch_one(&mut *tx)
            .await
            .map_err(explain)?;
        let archive = Archive {
            study: rows!(Study, "id = $1", "id").remove(0),
            runs: rows!(Run, "study_id = $1", "ordinal"),
            excluded: rows!(Out, "study_id = $1", "ordinal"),
            answers: rows!(
                Answer,
                format!("answer_id IN (SELECT answer_id FROM measurements WHERE {OF_STUDY})"),
                "answer_id"
            ),
            measurements: rows!(Measurement, OF_STUDY, "measurement_id"),
            trials: rows!(Trial, OF_STUDY, "measurement_id, repeat_index, take"),
            series: rows!(Series, OF_STUDY, "measurement_id, repeat_index, take, role, ordinal"),
            counters: rows!(Counter, OF_STUDY, "measurement_id, name"),
            judgements: rows!(
                Judged,
                "judgement_id IN (SELECT judgement_id FROM study_runs WHERE study_id = $1)",
                "judgement_id"
            ),
            environments: rows!(
                Machine,
                format!("environment_id IN (SELECT environment_id FROM trials WHERE {OF_STUDY})"),
                "environment_id"
            ),
            sweeps_json,
            advice_json,
        };
        let plain = postcard::to_stdvec(&archive).map_err(|e| Error::new(format!("packing the study: {e}")))?;
        let payload = zstd::bulk::compress(&plain, LEVEL).map_err(|e| Error::new(format!("packing the study: {e}")))?;
        let mut out = MAGIC.to_vec();
        out.extend(VERSION.to_le_bytes());
        out.extend(blake3::hash(&payload).as_bytes());
        out.extend(payload);
        Ok(out)
    }

    /// Adds an exported study; `name` renames it. Twice is the same as once.
    ///
    /// # Errors
    /// When the bytes are damaged or of a newer format, another study of that
    /// name is here, a result contradicts one that is here, or the database fails.
    pub async fn import(&self, bytes: &[u8], name: Option<&str>) -> Result<Imported> {
        let mut archive = unpack(bytes)?;
        if let Some(name) = name {
            archive.study.name = name.to_string();
        }
        let explain = |e: sqlx::Error| self.explain("the imported study", &e);
        let mut tx = self.begin("the imported study").await?;
        let label = format!("{}@{}", archive.study.name, archive.study.series);
        let here: Option<String> = sqlx::query_scalar("SELECT runs_hash FROM studies WHERE name = $1 AND series = $2")
            .bind(&archive.study.name)
            .bind(archive.study.series)
            .fetch_optional(&mut *tx)
            .await
            .map_err(explain)?;
        if here.is_some_and(|hash| hash != archive.study.runs_hash) {
            return Err(Error::new(format!("another study `{label}` with other runs is here already"))
                .in_file(&self.path)
                .help("give it another name with --as NAME"));
        }
        let imported = put(&mut tx, archive, label).await.map_err(explain)?;
        tx.commit().await.map_err(explain)?;
        Ok(imported)
    }
}

/// # Errors
/// When the file is no export, of a newer format, cut short or altered.
fn unpack(bytes: &[u8]) -> Result<Archive> {
    if bytes.len() < HEADER || !bytes.starts_with(MAGIC) {
        return Err(Error::new("this is not an exported study (or its head is cut off)")
            .help("exports are written by `cullmark export STUDY --out FILE`"));
    }
    let (head, payload) = bytes.split_at(HEADER);
    let version = u32::from_le_bytes(head[MAGIC.len()..MAGIC.len() + 4].try_into().expect("four bytes"));
    if !(1..=VERSION).contains(&version) {
        return Err(Error::new(format!(
            "its format is version {version}; this cullmark reads up to version {VERSION}"
        ))
        .help("use the cullmark that wrote it"));
    }
    let damaged = || {
        Error::new("the exported study is damaged: its hash does not match its content")
            .help("copy or export it again; nothing was imported")
    };
    if blake3::hash(payload).as_bytes()[..] != head[MAGIC.len() + 4..] {
        return Err(damaged());
    }
    let mut plain = zstd::stream::decode_all(payload).map_err(|_| damaged())?;
    for _ in version..VERSION {
        plain.extend(postcard::to_stdvec("[]").expect("a string is plain data"));
    }
    postcard::from_bytes(&plain).map_err(|_| damaged())
}

async fn put(tx: &mut Transaction<'_, Sqlite>, archive: Archive, label: String) -> sqlx::Result<Imported> {
    let Archive {
        study,
        mut runs,
        mut excluded,
        answers,
        measurements,
        trials,
        series,
        counters,
        judgements,
        environments,
        sweeps_json,
        advice_json,
    } = archive;
    let added = study.insert(tx).await?;
    let study_id: i64 = sqlx::query_scalar("SELECT id FROM studies WHERE name = $1 AND series = $2")
        .bind(&study.name)
        .bind(study.series)
        .fetch_one(&mut **tx)
        .await?;
    if added > 0 {
        // It came as results; whoever wants the rest of it measured submits it.
        sqlx::query("UPDATE studies SET sweeps_json = $1, advice_json = $3, state = 'paused' WHERE id = $2")
            .bind(sweeps_json)
            .bind(study_id)
            .bind(advice_json)
            .execute(&mut **tx)
            .await?;
    }
    for run in &mut runs {
        run.study_id = study_id;
        run.insert(tx).await?;
    }
    for row in &mut excluded {
        row.study_id = study_id;
        row.insert(tx).await?;
    }
    for row in &answers {
        row.insert(tx).await?;
    }
    for row in &environments {
        row.insert(tx).await?;
    }
    for row in &judgements {
        row.insert(tx).await?;
    }
    let mut taken = std::collections::HashSet::new();
    for m in &measurements {
        if take_over(tx, m).await? {
            m.insert(tx).await?;
            taken.insert(m.measurement_id.as_str());
        }
    }
    // Readers that keep results in memory look again, also at what was there before.
    let now = super::changes::tick(tx).await?;
    sqlx::query(
        "UPDATE measurements SET changed = $2 WHERE measurement_id IN (SELECT measurement_id FROM study_runs WHERE \
         study_id = $1) OR measurement_id IN (SELECT r.measurement_id FROM study_runs r WHERE r.judgement_id IN \
         (SELECT judgement_id FROM study_runs WHERE study_id = $1))",
    )
    .bind(study_id)
    .bind(now)
    .execute(&mut **tx)
    .await?;
    sqlx::query(super::compact::FORGET_ATTEMPTS).execute(&mut **tx).await?;
    let mut trials_added = 0;
    for t in trials.iter().filter(|t| taken.contains(t.measurement_id.as_str())) {
        trials_added += t.insert(tx).await?;
        // So that going on with the study here takes only what is missing.
        sqlx::query(
            "INSERT INTO jobs (kind, target, repeat_index, take, group_key, order_key, state, study_id) \
             VALUES ('trial', $1, $2, $3, '', 0, 'done', $4) ON CONFLICT DO NOTHING",
        )
        .bind(&t.measurement_id)
        .bind(t.repeat_index)
        .bind(t.take)
        .bind(study_id)
        .execute(&mut **tx)
        .await?;
    }
    for row in series.iter().filter(|s| taken.contains(s.measurement_id.as_str())) {
        row.insert(tx).await?;
    }
    for row in counters.iter().filter(|c| taken.contains(c.measurement_id.as_str())) {
        row.insert(tx).await?;
    }
    Ok(Imported { study: label, runs: runs.len() as u64, measurements_added: taken.len() as u64, trials_added })
}

/// Whether the archive's measurement is to be taken: it is not here, or it is
/// finished there and not here. What is finished here stays: both were measured,
/// and mixing their trials would belong to neither.
async fn take_over(tx: &mut Transaction<'_, Sqlite>, m: &Measurement) -> sqlx::Result<bool> {
    let here: Option<String> = sqlx::query_scalar("SELECT status FROM measurements WHERE measurement_id = $1")
        .bind(&m.measurement_id)
        .fetch_optional(&mut **tx)
        .await?;
    match here.as_deref() {
        None => Ok(true),
        Some("pending") if m.status != "pending" => {
            for sql in [
                "DELETE FROM measurements WHERE measurement_id = $1",
                "DELETE FROM trials WHERE measurement_id = $1",
                "DELETE FROM series WHERE measurement_id = $1",
                "DELETE FROM counters WHERE measurement_id = $1",
                // A trial in flight here finds its epoch gone and is fenced off.
                "DELETE FROM jobs WHERE kind = 'trial' AND target = $1",
            ] {
                sqlx::query(sql).bind(&m.measurement_id).execute(&mut **tx).await?;
            }
            Ok(true)
        }
        Some(_) => Ok(false),
    }
}

impl Imported {
    /// Nothing was new.
    pub fn is_nothing(&self) -> bool {
        self.measurements_added == 0 && self.trials_added == 0
    }
}

/// Writes `bytes` beside `path` first, so that a full disk leaves no half export.
///
/// # Errors
/// When the file cannot be written; names it.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".{}.part", now_ms()));
    let part = Path::new(&part);
    let failed = |e: &std::io::Error| {
        let _ = std::fs::remove_file(part);
        Error::io(path, "the export cannot be written", e).help("choose another place with --out")
    };
    std::fs::write(part, bytes).map_err(|e| failed(&e))?;
    std::fs::rename(part, path).map_err(|e| failed(&e))
}
