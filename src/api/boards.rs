//! Studies that somebody looks at, kept in memory as columns and brought up to date with
//! what changed since. What was computed of a run is stored, so that a restarted server
//! reads it instead of computing it again.

use super::problem::{Answer, Problem};
use super::state::App;
use crate::error::{Error, ErrorKind, Result};
use crate::record::RunSpec;
use crate::report::columns::{Columns, Line};
use crate::report::facts::{self, Facts};
use crate::report::fields::Fields;
use crate::store::facts::{Fact, RunLine};
use crate::store::{Detail, Store};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::Instant;

/// Runs kept in memory over all studies; the least recently asked for go first.
const ROWS: usize = 400_000;
/// Runs whose frames are in memory at once while their metrics are computed.
const CHUNK: usize = 256;
/// Runs whose specs are in memory at once while a study is loaded.
const LOAD: i64 = 4096;

/// A study in memory.
#[derive(Debug, Default)]
pub struct Board {
    pub columns: Columns,
    pub fields: Fields,
    /// Submission and clock of changes that it shows: the version of every answer made of it.
    stamp: String,
    seen: i64,
    /// When something of it changed last.
    changed: i64,
    /// Of the facts: they depend on the model of the renderer, too.
    revision: String,
}

impl Board {
    pub fn version(&self) -> String {
        format!("{}-{}", self.stamp, self.changed)
    }
}

pub struct Slot {
    board: RwLock<Board>,
    /// Of the board, for those who must not wait for it.
    rows: AtomicUsize,
    /// One at a time brings it up to date; by the clock of changes, when that was done last.
    refresh: tokio::sync::Mutex<Option<i64>>,
    used: Mutex<Instant>,
}

#[derive(Default)]
pub struct Boards {
    slots: Mutex<HashMap<i64, Arc<Slot>>>,
}

impl Boards {
    fn slot(&self, study_id: i64) -> Arc<Slot> {
        let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
        let slot = slots.entry(study_id).or_insert_with(|| {
            Arc::new(Slot {
                board: RwLock::default(),
                rows: AtomicUsize::new(0),
                refresh: tokio::sync::Mutex::new(None),
                used: Mutex::new(Instant::now()),
            })
        });
        *slot.used.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
        slot.clone()
    }

    /// Drops what has not been asked for longest while too much is held.
    fn trim(&self) {
        let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
        let rows = |s: &Slot| s.rows.load(Ordering::Relaxed);
        let mut total: usize = slots.values().map(|s| rows(s)).sum();
        while total > ROWS && slots.len() > 1 {
            let used = |s: &Slot| *s.used.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(oldest) = slots.iter().min_by_key(|(_, s)| used(s)).map(|(id, _)| *id) else { return };
            total -= slots.remove(&oldest).map_or(0, |s| rows(&s));
        }
    }

    pub fn forget(&self, study_id: i64) {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner).remove(&study_id);
    }
}

/// Answers a question from a study's columns, off the threads that serve requests.
pub async fn ask<T: Send + 'static>(
    app: &Arc<App>,
    study_id: i64,
    question: impl FnOnce(&Board) -> Result<T> + Send + 'static,
) -> Answer<T> {
    let slot = app.boards.slot(study_id);
    refresh(&app.store, study_id, &slot).await?;
    app.boards.trim();
    let task = tokio::task::spawn_blocking(move || {
        let board = slot.board.read().unwrap_or_else(PoisonError::into_inner);
        question(&board)
    });
    task.await.map_err(|e| Problem::internal(&e.to_string()))?.map_err(Problem::from)
}

async fn refresh(store: &Store, study_id: i64, slot: &Slot) -> Result<()> {
    let mut done = slot.refresh.lock().await;
    // Submitting, and every decision about a run, moves the clock.
    let now = store.now().await?;
    if *done == Some(now) {
        return Ok(());
    }
    let stamp = store.stamp(study_id).await?;
    let (known, seen, revision) = {
        let board = slot.board.read().unwrap_or_else(PoisonError::into_inner);
        (board.stamp == stamp, board.seen, board.revision.clone())
    };
    // Questions may hold it for a while: the other threads go on meanwhile.
    let write = || tokio::task::block_in_place(|| slot.board.write().unwrap_or_else(PoisonError::into_inner));
    if !known {
        let board = load(store, study_id, stamp, now).await?;
        slot.rows.store(board.columns.len(), Ordering::Relaxed);
        *write() = board;
    } else if seen < now {
        let lines = store.run_lines(study_id, seen, None).await?;
        let facts = facts_of(store, study_id, &lines, &revision).await?;
        let mut board = write();
        for (line, facts) in lines.iter().zip(&facts) {
            if let Ok(row) = board.columns.ordinals.binary_search(&(line.ordinal as u32)) {
                board.columns.set(row, facts);
            }
        }
        board.seen = now;
        if !lines.is_empty() {
            board.changed = now;
        }
    }
    *done = Some(now);
    Ok(())
}

async fn load(store: &Store, study_id: i64, stamp: String, now: i64) -> Result<Board> {
    let mut builder = Columns::builder();
    let (mut from, mut revision) = (0, String::new());
    loop {
        let lines = store.run_lines(study_id, 0, Some((from, from + LOAD))).await?;
        let Some(last) = lines.last() else { break };
        from = last.ordinal + 1;
        // Much work at once: the other threads of the runtime take over what waits here.
        let parse = || {
            lines
                .par_iter()
                .map(|l| {
                    serde_json::from_str(l.spec_json.as_deref().unwrap_or_default()).map_err(|e| {
                        Error::new(format!("a run in the database cannot be read: {e}")).kind(ErrorKind::Unavailable)
                    })
                })
                .collect::<Result<Vec<RunSpec>>>()
        };
        let specs = tokio::task::block_in_place(parse)?;
        if let Some(spec) = specs.first().filter(|_| revision.is_empty()) {
            revision = revision_for(spec);
        }
        let facts = facts_of(store, study_id, &lines, &revision).await?;
        for ((line, spec), facts) in lines.iter().zip(&specs).zip(&facts) {
            builder.push(&Line {
                ordinal: line.ordinal as u32,
                measurement_id: &line.measurement_id,
                answer_id: &line.answer_id,
                machine_class: &line.machine_class,
                structure: &line.structure_label,
                culling: &line.culling_label,
                walk: &line.walk_label,
                spec,
                facts,
            });
        }
    }
    let columns = builder.finish();
    Ok(Board { fields: columns.fields(), columns, stamp, seen: now, changed: now, revision })
}

/// A study has one model of the renderer; another with another makes other numbers of the
/// same measurements.
fn revision_for(spec: &RunSpec) -> String {
    let model = serde_json::to_vec(&spec.model).expect("a model is plain data");
    format!("{}-{}", facts::revision(), &blake3::hash(&model).to_hex()[..8])
}

/// What is known of each line: stored, or computed now and stored.
async fn facts_of(store: &Store, study_id: i64, lines: &[RunLine], revision: &str) -> Result<Vec<Facts>> {
    let mut out: Vec<Option<Facts>> =
        lines.par_iter().map(|l| l.fresh_facts(revision).and_then(Facts::decode)).collect();
    let stale: Vec<usize> = (0..lines.len()).filter(|i| out[*i].is_none()).collect();
    for chunk in stale.chunks(CHUNK) {
        let ids: Vec<String> = chunk.iter().map(|i| lines[*i].measurement_id.clone()).collect();
        let runs = store.some_results(study_id, &ids, Detail::Frames).await?;
        let found: HashMap<&str, Facts> = tokio::task::block_in_place(|| {
            runs.par_iter().map(|r| (r.measurement_id.as_str(), Facts::of(r))).collect()
        });
        let mut fresh = Vec::new();
        for i in chunk {
            let line = &lines[*i];
            let Some(facts) = found.get(line.measurement_id.as_str()) else { continue };
            fresh.push(Fact {
                measurement_id: line.measurement_id.clone(),
                judgement_id: line.judgement_id.clone(),
                changed: line.changed,
                data: facts.encode(),
            });
            out[*i] = Some(facts.clone());
        }
        // A cache: who cannot write it reads on.
        if let Err(e) = store.put_facts(revision, &fresh).await {
            tracing::warn!(error = %e, "computed metrics were not kept");
        }
    }
    let gone = || Error::new("the study changed while it was read").kind(ErrorKind::Unavailable).help("ask again");
    out.into_iter().map(|f| f.ok_or_else(gone)).collect()
}
