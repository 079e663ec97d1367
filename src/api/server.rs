//! The server itself: who you are to it, its workers, its machine, examples to start from.

use super::auth::{Admin, Reader};
use super::problem::{Answer, Problem};
use super::state::Shared;
use crate::machine::fitness;
use crate::worker::lane::{self, Lane};
use axum::extract::State;
use serde::Serialize;
use std::sync::PoisonError;
use std::time::{Duration, Instant};
use utoipa::ToSchema;

/// What the machine is like is looked at again after so long.
const FITNESS_AGE: Duration = Duration::from_secs(10);

#[derive(Serialize, ToSchema)]
pub struct Me {
    version: &'static str,
    commit: &'static str,
    /// `read`, `submit` or `admin`
    role: &'static str,
    /// Whether the server has any tokens
    tokens: bool,
}

/// What you may do here
#[utoipa::path(get, path = "/me", tag = "server",
    responses((status = 200, body = Me), Problem))]
pub async fn me(State(app): State<Shared>, Reader(role): Reader) -> Answer<axum::Json<Me>> {
    let tokens = app.has_tokens().await?;
    let (version, commit) = (env!("CARGO_PKG_VERSION"), env!("CULLMARK_COMMIT"));
    Ok(axum::Json(Me { version, commit, role: role.word(), tokens }))
}

#[derive(Serialize, ToSchema)]
pub struct WorkerLine {
    id: usize,
    /// `trial`, `judge`, or none while it rests
    kind: Option<String>,
    study: Option<String>,
    run: Option<String>,
    since: Option<String>,
}

#[derive(Serialize, ToSchema)]
pub struct PoolState {
    paused: bool,
    workers: Vec<WorkerLine>,
}

/// The workers of this server
#[utoipa::path(get, path = "/pool", tag = "server",
    responses((status = 200, body = PoolState), Problem))]
pub async fn pool(State(app): State<Shared>, _: Reader) -> Answer<axum::Json<PoolState>> {
    state(&app).await
}

async fn state(app: &Shared) -> Answer<axum::Json<PoolState>> {
    let workers = app.workers.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let mut ids: Vec<i64> = workers.iter().filter_map(|w| w.study_id).collect();
    ids.sort_unstable();
    ids.dedup();
    let studies = app.overviews(&ids).await?;
    let name = |id: i64| studies.iter().find(|s| s.id == id).map(|s| s.reference.clone());
    let line = |(id, w): (usize, super::state::Worker)| WorkerLine {
        id,
        kind: w.kind.map(|k| k.word().to_string()),
        study: w.study_id.and_then(name),
        since: w.kind.map(|_| super::utc(w.since_ms)),
        run: w.run,
    };
    let workers = workers.into_iter().enumerate().map(line).collect();
    Ok(axum::Json(PoolState { paused: app.store.pool_paused().await?, workers }))
}

/// Let all jobs wait
#[utoipa::path(post, path = "/pool/pause", tag = "server", operation_id = "pause_pool",
    responses((status = 200, body = PoolState), Problem))]
pub async fn pause(State(app): State<Shared>, _: Admin) -> Answer<axum::Json<PoolState>> {
    app.store.pause_pool(true).await?;
    state(&app).await
}

/// Go on with jobs
#[utoipa::path(post, path = "/pool/resume", tag = "server", operation_id = "resume_pool",
    responses((status = 200, body = PoolState), Problem))]
pub async fn resume(State(app): State<Shared>, _: Admin) -> Answer<axum::Json<PoolState>> {
    app.store.pause_pool(false).await?;
    app.wake.notify_waiters();
    state(&app).await
}

#[derive(Serialize, ToSchema)]
pub struct CheckLine {
    name: &'static str,
    /// `good`, `warn`, `bad` or `unknown`
    verdict: &'static str,
    value: String,
    advice: String,
}

/// Whether this machine is fit to measure.
#[derive(Serialize, ToSchema)]
pub struct Machine {
    fit: bool,
    checks: Vec<CheckLine>,
}

/// Is this machine fit to measure?
#[utoipa::path(get, path = "/machine", tag = "server",
    responses((status = 200, body = Machine), Problem))]
pub async fn machine(State(app): State<Shared>, _: Reader) -> Answer<axum::Json<Machine>> {
    // One look serves all who ask within some seconds.
    let mut known = app.fitness.lock().await;
    let checks = match known.as_ref().filter(|(at, _)| at.elapsed() < FITNESS_AGE) {
        Some((_, checks)) => checks.clone(),
        None => {
            let folder = app.store.path().parent().map(std::path::Path::to_path_buf).unwrap_or_default();
            let noise = app.store.recent_noise(&app.config.pool.machine_class).await?;
            let core = app.config.launcher.lane_core;
            // Held meanwhile: the probe must disturb no trial.
            let held = Lane::new(&lane::default_path()).try_hold()?;
            let look = move || fitness::checks(&folder, core, noise, held.is_some());
            let checks = tokio::task::spawn_blocking(look).await.map_err(|e| Problem::internal(&e.to_string()))?;
            *known = Some((Instant::now(), checks.clone()));
            checks
        }
    };
    let line =
        |c: fitness::Check| CheckLine { name: c.name, verdict: c.verdict.word(), value: c.value, advice: c.advice };
    Ok(axum::Json(Machine { fit: fitness::fit(&checks), checks: checks.into_iter().map(line).collect() }))
}

#[derive(Serialize, ToSchema)]
pub struct Example {
    name: &'static str,
    title: String,
    manifest: &'static str,
}

#[derive(Serialize, ToSchema)]
pub struct Examples {
    items: Vec<Example>,
}

/// Manifests that need no file.
const EXAMPLES: &[(&str, &str)] = &[
    ("tiny", include_str!("../../experiments/tiny.toml")),
    ("quick", include_str!("../../experiments/quick.toml")),
    ("near_far", include_str!("../../experiments/stress/near_far.toml")),
    ("facing", include_str!("../../experiments/stress/facing.toml")),
];

/// Manifests to start from
#[utoipa::path(get, path = "/examples", tag = "server",
    responses((status = 200, body = Examples), Problem))]
pub async fn examples(_: Reader) -> axum::Json<Examples> {
    let title = |text: &str| {
        let table = text.parse::<toml::Table>().ok();
        let study = table.as_ref().and_then(|t| t.get("study"));
        study.and_then(|s| s.get("title")).and_then(|t| t.as_str()).unwrap_or_default().to_string()
    };
    let items = EXAMPLES.iter().map(|(name, manifest)| Example { name, title: title(manifest), manifest }).collect();
    axum::Json(Examples { items })
}
