//! Taking in a study: manifest, matrix, a look at its files in a child process, the queue.

use super::auth::Submitter;
use super::dto::Summary;
use super::input::{self, Path, Query};
use super::problem::{Answer, Mistake, Problem};
use super::state::{App, Shared};
use super::uploads::reach;
use crate::intake::{Wish, planned, series, setting, submission};
use crate::manifest::Manifest;
use crate::manifest::reach::Reach;
use crate::matrix::{self, Matrix};
use crate::record::{PathSource, RepeatPolicy, RunSpec, SceneSource};
use crate::store::Submitted;
use crate::store::control::PRIORITY_LIMIT;
use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::Duration;
use utoipa::{IntoParams, ToSchema};

/// Rows of a plan that are sent; the counts are of all.
const PLAN_ROWS: usize = 2000;
/// Reading all files of a study may take so long.
const PREFLIGHT: Duration = Duration::from_secs(300);

/// What is to be submitted.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// TOML
    manifest: String,
    /// `key=value` laid over it
    #[serde(default)]
    set: Vec<String>,
    /// `next`, or a number; the first if absent
    #[schema(value_type = Option<String>)]
    #[serde(default)]
    series: Option<Value>,
    #[serde(default)]
    #[schema(minimum = -100, maximum = 100)]
    priority: i64,
    #[serde(default)]
    retry_failed: bool,
    #[serde(default)]
    validate_only: bool,
}

/// The same beside a body of TOML.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Beside {
    /// `key=value` pairs joined with `;`, beside a body of TOML
    set: Option<String>,
    series: Option<String>,
    #[param(minimum = -100, maximum = 100)]
    priority: Option<i64>,
    #[serde(default)]
    retry_failed: bool,
    #[serde(default)]
    validate_only: bool,
}

/// A study that was taken in.
#[derive(Serialize, ToSchema)]
pub struct Taken {
    study: Summary,
    #[schema(value_type = Object)]
    submitted: Submitted,
    /// What reading the files left out or doubts
    notes: Vec<String>,
}

/// Submit a study, or only check it
#[utoipa::path(post, path = "/studies", tag = "studies", params(Beside),
    request_body(content((Wanted = "application/json"), (String = "application/toml"))),
    responses((status = 201, body = Taken), (status = 200, description = "`validate_only`: the plan", body = Object),
              Problem))]
pub async fn submit(
    State(app): State<Shared>,
    _: Submitter,
    Query(beside): Query<Beside>,
    request: Request,
) -> Answer<Response> {
    let kind = request.headers().get(header::CONTENT_TYPE).and_then(|h| h.to_str().ok()).unwrap_or_default();
    let toml = kind.starts_with("application/toml") || kind.starts_with("text/x-toml");
    if !toml && !kind.starts_with("application/json") {
        return Err(Problem::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            format!("a body of type `{kind}` is not understood"),
        )
        .help("send application/json with a `manifest`, or the manifest itself as application/toml"));
    }
    let bytes = input::body(request, &app).await?;
    let wanted = if toml {
        Wanted {
            manifest: String::from_utf8(bytes.to_vec()).map_err(|_| Problem::bad("the manifest is not UTF-8"))?,
            set: beside.set.iter().flat_map(|s| s.split(';')).filter(|s| !s.is_empty()).map(str::to_string).collect(),
            series: beside.series.map(Value::String),
            priority: beside.priority.unwrap_or(0),
            retry_failed: beside.retry_failed,
            validate_only: beside.validate_only,
        }
    } else {
        let read: Result<Wanted, _> = serde_json::from_slice(&bytes);
        read.map_err(|e| Problem::bad(format!("the body cannot be read: {e}")).help("its fields are in docs/API.md"))?
    };
    take(&app, wanted).await
}

async fn take(app: &Shared, wanted: Wanted) -> Answer<Response> {
    if wanted.priority.abs() > PRIORITY_LIMIT {
        return Err(Problem::bad(format!("`priority` must be from -{PRIORITY_LIMIT} to {PRIORITY_LIMIT}")));
    }
    let word = match &wanted.series {
        None | Some(Value::Null) => None,
        Some(Value::String(s)) => Some(s.clone()),
        Some(Value::Number(n)) => Some(n.to_string()),
        Some(_) => return Err(Problem::bad("`series` must be a number or \"next\"")),
    };
    let reach = reach(app).await?;
    let (text, sets) = (wanted.manifest, wanted.set);
    let manifest = read(app, text, sets, reach, PathBuf::from("manifest.toml")).await?;
    let study = manifest.study.name.clone();
    let series = series(word.as_deref(), &app.store, &study).await?;
    let (manifest, matrix) = expand(app, manifest, series).await?;
    let notes = preflight(app, &matrix.runs).await?;
    if wanted.validate_only {
        let plan = planned(&manifest, &matrix, Some(&app.store), series).await?;
        return Ok(axum::Json(json!({ "plan": shortened(&plan), "notes": notes })).into_response());
    }
    let wish = Wish { series, retry_failed: wanted.retry_failed, priority: wanted.priority, folder: String::new() };
    let taken = queue(app, &manifest, &matrix, wish, notes).await?;
    Ok((StatusCode::CREATED, axum::Json(taken)).into_response())
}

/// A submitter's run holds the measuring lane no longer, and takes no more memory, than
/// the server allows.
fn bound(app: &App, repeat: &mut RepeatPolicy) -> Answer<()> {
    let (seconds, mib) = (app.config.run_timeout_s, app.config.memory_limit_mib);
    let mut errors = Vec::new();
    if repeat.timeout_s > seconds {
        let message = format!("is {} s, this server gives a run {seconds} s", repeat.timeout_s);
        errors.push(crate::Error::new(message).key("measure.timeout_s").help("`serve --run-timeout-s` sets it"));
    }
    if repeat.memory_limit_mib.is_some_and(|m| m > mib) {
        let message = format!("is {} MiB, this server gives a run {mib} MiB", repeat.memory_limit_mib.unwrap_or(0));
        errors.push(
            crate::Error::new(message).key("measure.memory_limit_mib").help("`serve --memory-limit-mib` sets it"),
        );
    }
    repeat.memory_limit_mib.get_or_insert(mib);
    if errors.is_empty() { Ok(()) } else { Err(mistaken(app, errors)) }
}

async fn read(app: &App, text: String, sets: Vec<String>, reach: Reach, path: PathBuf) -> Answer<Manifest> {
    let read = off_thread(move || Manifest::parse_within(text, &path, &sets, reach)).await?;
    let mut manifest = read.map_err(|errors| mistaken(app, errors))?;
    bound(app, &mut manifest.repeat)?;
    Ok(manifest)
}

async fn off_thread<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Answer<T> {
    tokio::task::spawn_blocking(work).await.map_err(|e| Problem::internal(&e.to_string()))
}

async fn expand(app: &App, manifest: Manifest, series: u32) -> Answer<(Manifest, Matrix)> {
    let limit = app.config.max_cells;
    let pin_core = app.config.launcher.lane_core;
    let cells = matrix::count(&manifest);
    if cells > limit {
        return Err(Problem::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            format!("the matrix has {cells} cells, this server takes {limit}"),
        )
        .help("shorten lists and ranges, or ask whoever runs the server (`serve --max-cells`)"));
    }
    let expanded = off_thread(move || {
        let setting = matrix::Setting { pin_core, ..setting(series) };
        matrix::expand(&manifest, &setting).map(|matrix| (manifest, matrix))
    });
    expanded.await?.map_err(|errors| mistaken(app, errors))
}

/// Reads every file of the study once, in a child: no triangle ever enters this process.
async fn preflight(app: &App, runs: &[RunSpec]) -> Answer<Vec<String>> {
    let from_file =
        |r: &&RunSpec| matches!(r.scene.source, SceneSource::File(_)) || matches!(r.path.source, PathSource::File(_));
    let mut seen = std::collections::HashSet::new();
    let files: Vec<&RunSpec> =
        runs.iter().filter(from_file).filter(|r| seen.insert((&r.scene.fingerprint, &r.path.fingerprint))).collect();
    if files.is_empty() {
        return Ok(Vec::new());
    }
    #[derive(Deserialize)]
    struct Reply {
        ok: Option<Vec<String>>,
        errors: Option<Vec<Mistake>>,
    }
    let request =
        json!({ "runs": files, "cache_dir": app.config.cache_dir, "memory_limit_mib": app.config.memory_limit_mib });
    let out = app.config.launcher.ask("preflight", &request, PREFLIGHT).await?;
    match serde_json::from_slice(&out.stdout) {
        Ok(Reply { ok: Some(notes), .. }) => Ok(notes),
        Ok(Reply { errors: Some(errors), .. }) => {
            Err(Problem::mistakes(errors.into_iter().map(|m| nameless(app, m)).collect()))
        }
        _ => Err(Problem::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            format!("the files of the study could not be read: {}", out.why()),
        )
        .help("a scene may be too large for this server's memory limit (`serve --memory-limit-mib`)")),
    }
}

/// Where the server keeps its files is nobody's business.
pub fn nameless(app: &App, mut mistake: Mistake) -> Mistake {
    mistake.file = mistake.file.and_then(|f| PathBuf::from(f).file_name().map(|n| n.to_string_lossy().into_owned()));
    let config = &app.config;
    for folder in config.folders.iter().chain([&config.upload_dir, &config.cache_dir]) {
        mistake.message = mistake.message.replace(&format!("{}/", folder.display()), "");
    }
    mistake
}

fn mistaken(app: &App, errors: Vec<crate::Error>) -> Problem {
    Problem::mistakes(errors.into_iter().map(|e| nameless(app, e.into())).collect())
}

async fn queue(app: &Shared, manifest: &Manifest, matrix: &Matrix, wish: Wish, notes: Vec<String>) -> Answer<Taken> {
    let asked = submission(manifest, matrix, app.config.pool.machine_class.clone(), wish);
    let submitted = app.store.submit(&asked).await?;
    tracing::info!(
        study = asked.name,
        runs = submitted.runs,
        new = submitted.new,
        jobs = submitted.jobs_added,
        "study submitted"
    );
    app.wake.notify_waiters();
    app.hub.touch(submitted.study_id);
    let study = Summary::from(app.overview(submitted.study_id).await?);
    Ok(Taken { study, submitted, notes })
}

fn shortened(plan: &crate::matrix::plan::Plan) -> Value {
    let mut value = serde_json::to_value(plan).expect("a plan is plain data");
    for (rows, total) in [("rows", "rows_total"), ("excluded", "excluded_total")] {
        if let Some(list) = value.get_mut(rows).and_then(Value::as_array_mut) {
            let n = list.len();
            list.truncate(PLAN_ROWS);
            value[total] = json!(n);
        }
    }
    value
}

/// Measure a study anew, as the next series
#[utoipa::path(post, path = "/studies/{study}/rerun", tag = "studies", operation_id = "rerun_study", params(("study" = String, Path, description = "name or name@series")),
    responses((status = 201, body = Summary), Problem))]
pub async fn rerun(State(app): State<Shared>, _: Submitter, Path(study): Path<String>) -> Answer<Response> {
    let id = app.store.study_id(&study).await?;
    let about = app.store.about(id).await?;
    let before = app.overview(id).await?;
    let path = PathBuf::from(&about.folder).join("manifest.toml");
    let reach = reach(&app).await?;
    let text = about.manifest_toml;
    let manifest = read(&app, text, Vec::new(), reach, path).await?;
    let series = app.store.next_series(&before.name).await?;
    let (manifest, matrix) = expand(&app, manifest, series).await?;
    let notes = preflight(&app, &matrix.runs).await?;
    let wish = Wish { series, priority: before.priority, folder: about.folder, ..Wish::default() };
    let taken = queue(&app, &manifest, &matrix, wish, notes).await?;
    Ok((StatusCode::CREATED, axum::Json(taken.study)).into_response())
}
