//! Frames to look at. A child process loads the scene, builds the structure and then
//! answers frame after frame, so that scrubbing costs one culling call a frame; it ends
//! when nobody has asked for a while, and triangles never enter this process.

use super::auth::Reader;
use super::caching;
use super::input::{Path, Query};
use super::problem::{Answer, Problem};
use super::run::{locate, result};
use super::state::{App, Shared};
use super::uploads::file_of;
use crate::record::{RunSpec, SceneSpec};
use crate::store::Detail;
use crate::worker::child::Launcher;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::process::{Child, ChildStdin, ChildStdout};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use utoipa::IntoParams;

/// Scenes open at once: each costs its memory.
const OPEN: usize = 3;
/// Nobody asked for so long: the child ends.
const IDLE: Duration = Duration::from_secs(120);
/// Loading and building may take so long, and so may one answer.
const LIMIT: Duration = Duration::from_secs(300);
/// No answer is longer: 30 million triangles would be.
const BYTES: usize = 1 << 30;

/// A child that has a scene open.
struct Session {
    child: Option<Talk>,
}

/// Dropping it ends the child.
struct Talk {
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    _child: Child,
    _permit: OwnedSemaphorePermit,
}

type Held = tokio::sync::OwnedMutexGuard<Session>;

struct Slot {
    session: Arc<tokio::sync::Mutex<Session>>,
    used: Mutex<Instant>,
}

pub struct Views {
    launcher: Launcher,
    cache_dir: PathBuf,
    memory_limit_mib: u64,
    open: Mutex<HashMap<String, Arc<Slot>>>,
    /// One a child, however many ask.
    permits: Arc<Semaphore>,
}

/// What is to be looked at.
pub enum Subject {
    Run(Box<RunSpec>),
    Scene(Box<SceneSpec>),
}

#[derive(Deserialize)]
struct Reply {
    bytes: Option<usize>,
    error: Option<ReplyError>,
}

#[derive(Deserialize)]
struct ReplyError {
    message: String,
    help: Option<String>,
}

impl Views {
    pub fn new(launcher: Launcher, cache_dir: PathBuf, memory_limit_mib: u64) -> Views {
        Views { launcher, cache_dir, memory_limit_mib, open: Mutex::default(), permits: Arc::new(Semaphore::new(OPEN)) }
    }

    fn slots(&self) -> std::sync::MutexGuard<'_, HashMap<String, Arc<Slot>>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn forget(&self, key: &str) {
        self.slots().remove(key);
    }

    /// Ends children that nobody asks any more, and the oldest ones beyond the limit.
    /// A slot that is in use keeps its child until it is done.
    pub fn tidy(&self) {
        let mut slots = self.slots();
        let used = |s: &Slot| *s.used.lock().unwrap_or_else(PoisonError::into_inner);
        slots.retain(|_, s| used(s).elapsed() < IDLE);
        while slots.len() > OPEN {
            let Some(oldest) = slots.iter().min_by_key(|(_, s)| used(s)).map(|(k, _)| k.clone()) else { return };
            slots.remove(&oldest);
        }
    }

    fn slot(&self, key: &str) -> Arc<Slot> {
        let slot = {
            let mut slots = self.slots();
            let make = || {
                let session = Arc::new(tokio::sync::Mutex::new(Session { child: None }));
                Arc::new(Slot { session, used: Mutex::new(Instant::now()) })
            };
            slots.entry(key.to_string()).or_insert_with(make).clone()
        };
        *slot.used.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
        self.tidy();
        slot
    }

    /// One answer of the child that has `subject` open; starts it if there is none.
    pub async fn ask(app: &Shared, key: &str, subject: Subject, request: Value) -> Answer<Vec<u8>> {
        // Who goes away while waiting asks nothing. Once asked, the answer is read to its end
        // whoever is gone: what is left of it would be taken for the next one's.
        let session = app.views.slot(key).session.clone().lock_owned().await;
        let app = app.clone();
        let whole = tokio::spawn(async move { app.views.exchanged(session, subject, &request).await });
        whole.await.map_err(|e| Problem::internal(&format!("the scene cannot be shown: {e}")))?
    }

    async fn exchanged(&self, mut session: Held, subject: Subject, request: &Value) -> Answer<Vec<u8>> {
        let work = async {
            if session.child.is_none() {
                session.child = Some(self.start(subject).await?);
            }
            let child = session.child.as_mut().expect("just started");
            exchange(&mut child.stdin, &mut child.stdout, request).await
        };
        let answer = tokio::time::timeout(LIMIT, work).await;
        let answer = answer.unwrap_or_else(|_| Err(Broken::Died("it took too long".into())));
        match answer {
            Ok(bytes) => Ok(bytes),
            Err(Broken::Refused(problem)) => Err(problem),
            Err(Broken::Died(why)) => {
                session.child = None;
                tracing::warn!(why, "a viewing process ended");
                Err(Problem::new(StatusCode::SERVICE_UNAVAILABLE, format!("the scene cannot be shown: {why}"))
                    .help("it may be too large for this server's memory limit (`serve --memory-limit-mib`)"))
            }
        }
    }

    /// Room for one more: whoever has been idle longest goes.
    async fn permit(&self) -> Result<OwnedSemaphorePermit, Broken> {
        if let Ok(permit) = self.permits.clone().try_acquire_owned() {
            return Ok(permit);
        }
        {
            let slots = self.slots();
            let used = |s: &Slot| *s.used.lock().unwrap_or_else(PoisonError::into_inner);
            let mut by_age: Vec<&Arc<Slot>> = slots.values().collect();
            by_age.sort_by_key(|s| used(s));
            for slot in by_age {
                if let Ok(mut session) = slot.session.try_lock()
                    && session.child.take().is_some()
                {
                    break;
                }
            }
        }
        let permit = self.permits.clone().acquire_owned().await;
        permit.map_err(|_| Broken::Died("the server is ending".into()))
    }

    async fn start(&self, subject: Subject) -> Result<Talk, Broken> {
        let permit = self.permit().await?;
        let mut child = self.launcher.beside("view").map_err(|e| Broken::Refused(e.into()))?;
        let mut stdin = child.stdin.take().expect("piped");
        let mut stdout = BufReader::new(child.stdout.take().expect("piped"));
        // What it complains about must not fill the pipe.
        let mut stderr = child.stderr.take().expect("piped");
        tokio::spawn(async move { tokio::io::copy(&mut stderr, &mut tokio::io::sink()).await });
        let (spec, scene) = match subject {
            Subject::Run(spec) => (Some(spec), None),
            Subject::Scene(scene) => (None, Some(scene)),
        };
        let request = json!({ "spec": spec, "scene": scene, "cache_dir": self.cache_dir, "memory_limit_mib": self.memory_limit_mib });
        exchange(&mut stdin, &mut stdout, &request).await?;
        Ok(Talk { _child: child, stdin, stdout, _permit: permit })
    }
}

enum Broken {
    /// It answered with an error of its own and goes on.
    Refused(Problem),
    Died(String),
}

async fn exchange(
    stdin: &mut ChildStdin,
    stdout: &mut BufReader<ChildStdout>,
    request: &Value,
) -> Result<Vec<u8>, Broken> {
    let died = |e: std::io::Error| Broken::Died(format!("its process ended ({e})"));
    stdin.write_all(format!("{request}\n").as_bytes()).await.map_err(died)?;
    stdin.flush().await.map_err(died)?;
    let mut line = String::new();
    if stdout.read_line(&mut line).await.map_err(died)? == 0 {
        return Err(Broken::Died("its process ended".into()));
    }
    let reply: Reply =
        serde_json::from_str(&line).map_err(|e| Broken::Died(format!("its answer cannot be read: {e}")))?;
    match reply {
        Reply { error: Some(e), .. } => {
            let problem = Problem::new(StatusCode::UNPROCESSABLE_ENTITY, e.message);
            Err(Broken::Refused(match e.help {
                Some(help) => problem.help(help),
                None => problem,
            }))
        }
        Reply { bytes: Some(n), .. } if n <= BYTES => {
            let mut bytes = vec![0; n];
            stdout.read_exact(&mut bytes).await.map_err(died)?;
            Ok(bytes)
        }
        _ => Err(Broken::Died("its answer makes no sense".into())),
    }
}

async fn of_run(app: &Shared, study: &str, run: &str, request: Value, headers: &HeaderMap) -> Answer<Response> {
    let (id, measurement, ..) = locate(app, study, run).await?;
    let found = result(app, id, &measurement, Detail::Summary).await?;
    let key = format!("{}:{}", found.answer_id, serde_json::to_string(&found.spec.accuracy).unwrap_or_default());
    respond(app, &key, Subject::Run(Box::new(found.spec)), request, headers).await
}

async fn of_upload(app: &Shared, id: &str, request: Value, headers: &HeaderMap) -> Answer<Response> {
    let upload = app.store.upload(id).await?;
    if upload.kind != "scene" {
        return Err(Problem::bad(format!("`{}` is a {}, no scene", upload.name, upload.kind)));
    }
    let scene = scene_of(app, &upload);
    respond(app, id, Subject::Scene(Box::new(scene)), request, headers).await
}

/// As a manifest reads it that says nothing but its name.
fn scene_of(app: &App, upload: &crate::store::uploads::Upload) -> SceneSpec {
    use crate::record::{SceneSource, Up, Winding};
    SceneSpec {
        name: upload.name.clone(),
        source: SceneSource::File(file_of(app, upload)),
        winding: Winding::Ccw,
        up: Up::Y,
        scale: 1.0,
        weld: false,
        offset_m: [0.0; 3],
        // Its content is its name already; whoever opens it takes the fingerprint.
        fingerprint: String::new(),
    }
}

/// What a frame looks like depends on the answer and the program alone.
async fn respond(app: &Shared, key: &str, subject: Subject, request: Value, headers: &HeaderMap) -> Answer<Response> {
    let tag = caching::tag(key, &request.to_string());
    if caching::fresh(headers, &tag) {
        return Ok(caching::not_modified(&tag));
    }
    let kind = match request["ask"].as_str() {
        Some("about") => "application/json",
        Some("depth") => "image/png",
        _ => "application/octet-stream",
    };
    let bytes = Views::ask(app, key, subject, request).await?;
    Ok(caching::tagged(([(header::CONTENT_TYPE, kind)], bytes).into_response(), &tag))
}

/// What can be looked at in a run
#[utoipa::path(get, path = "/studies/{study}/runs/{run}/view", tag = "frames",
    params(("study" = String, Path, description = "name or name@series"), ("run" = String, Path, description = "ordinal or measurement_id")),
    responses((status = 200, body = Object), (status = 304), Problem))]
pub async fn about(
    State(app): State<Shared>,
    _: Reader,
    Path((study, run)): Path<(String, String)>,
    headers: HeaderMap,
) -> Answer<Response> {
    of_run(&app, &study, &run, json!({ "ask": "about" }), &headers).await
}

/// The scene's triangles (CMSH)
#[utoipa::path(get, path = "/studies/{study}/runs/{run}/view/mesh", tag = "frames",
    params(("study" = String, Path, description = "name or name@series"), ("run" = String, Path, description = "ordinal or measurement_id")),
    responses((status = 200, body = Vec<u8>, content_type = "application/octet-stream"), (status = 304), Problem))]
pub async fn mesh(
    State(app): State<Shared>,
    _: Reader,
    Path((study, run)): Path<(String, String)>,
    headers: HeaderMap,
) -> Answer<Response> {
    of_run(&app, &study, &run, json!({ "ask": "mesh" }), &headers).await
}

/// The structure's nodes (CMND)
#[utoipa::path(get, path = "/studies/{study}/runs/{run}/view/nodes", tag = "frames",
    params(("study" = String, Path, description = "name or name@series"), ("run" = String, Path, description = "ordinal or measurement_id")),
    responses((status = 200, body = Vec<u8>, content_type = "application/octet-stream"), (status = 304), Problem))]
pub async fn nodes(
    State(app): State<Shared>,
    _: Reader,
    Path((study, run)): Path<(String, String)>,
    headers: HeaderMap,
) -> Answer<Response> {
    of_run(&app, &study, &run, json!({ "ask": "nodes" }), &headers).await
}

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct FrameWanted {
    /// Also what is visible: costs an item buffer
    #[serde(default)]
    truth: bool,
}

/// What a frame submitted, triangle by triangle (CMFR)
#[utoipa::path(get, path = "/studies/{study}/runs/{run}/view/frames/{frame}", tag = "frames",
    params(("study" = String, Path, description = "name or name@series"), ("run" = String, Path, description = "ordinal or measurement_id"), ("frame" = u32, Path, description = "from 0"), FrameWanted),
    responses((status = 200, body = Vec<u8>, content_type = "application/octet-stream"), (status = 304), Problem))]
pub async fn frame(
    State(app): State<Shared>,
    _: Reader,
    Path((study, run, frame)): Path<(String, String, u32)>,
    Query(q): Query<FrameWanted>,
    headers: HeaderMap,
) -> Answer<Response> {
    of_run(&app, &study, &run, json!({ "ask": "frame", "frame": frame, "truth": q.truth }), &headers).await
}

/// What the walk's depth buffer holds after a frame (PNG)
#[utoipa::path(get, path = "/studies/{study}/runs/{run}/view/frames/{frame}/depth", tag = "frames", operation_id = "view_depth",
    params(("study" = String, Path, description = "name or name@series"), ("run" = String, Path, description = "ordinal or measurement_id"), ("frame" = u32, Path, description = "from 0")),
    responses((status = 200, body = Vec<u8>, content_type = "image/png"), (status = 304), Problem))]
pub async fn depth(
    State(app): State<Shared>,
    _: Reader,
    Path((study, run, frame)): Path<(String, String, u32)>,
    headers: HeaderMap,
) -> Answer<Response> {
    of_run(&app, &study, &run, json!({ "ask": "depth", "frame": frame }), &headers).await
}

/// An uploaded scene to look at
#[utoipa::path(get, path = "/uploads/{id}/view", tag = "frames", operation_id = "view_upload", params(("id" = String, Path, description = "id of an upload")),
    responses((status = 200, body = Object), (status = 304), Problem))]
pub async fn upload_about(
    State(app): State<Shared>,
    _: Reader,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Answer<Response> {
    of_upload(&app, &id, json!({ "ask": "about" }), &headers).await
}

/// Its triangles (CMSH)
#[utoipa::path(get, path = "/uploads/{id}/view/mesh", tag = "frames", operation_id = "view_upload_mesh", params(("id" = String, Path, description = "id of an upload")),
    responses((status = 200, body = Vec<u8>, content_type = "application/octet-stream"), (status = 304), Problem))]
pub async fn upload_mesh(
    State(app): State<Shared>,
    _: Reader,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Answer<Response> {
    of_upload(&app, &id, json!({ "ask": "mesh" }), &headers).await
}
