//! Scenes and paths that users send: written beside, hashed, read by the lab in a child
//! process, and only then kept under their hash. What no reader understands is never kept.

use super::auth::{Admin, Reader, Submitter};
use super::input::{Path, Query};
use super::problem::{Answer, Problem};
use super::state::{App, Shared};
use super::submit::nameless;
use crate::manifest::reach::{Allowed, Reach};
use crate::store::uploads::Upload as Stored;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path as FilePath, PathBuf};
use std::time::Duration;
use tokio::io::AsyncWriteExt;
use utoipa::{IntoParams, ToSchema};

/// Checking a file may take so long.
const CHECK: Duration = Duration::from_secs(300);
/// What the readers of the lab know, by kind.
const SUFFIXES: [(&str, &[&str]); 2] = [("scene", &["obj", "gltf", "glb"]), ("path", &["csv"])];

/// A file that is there.
#[derive(Serialize, ToSchema)]
pub struct Upload {
    /// Hash of the content
    id: String,
    /// `scene` or `path`
    kind: String,
    name: String,
    bytes: u64,
    uploaded: String,
    /// How a manifest names it: `file = "upload:..."`
    reference: String,
    triangles: Option<u64>,
    frames: Option<u64>,
    /// What reading it left out or doubts
    notes: Vec<String>,
}

impl From<Stored> for Upload {
    fn from(u: Stored) -> Upload {
        let Stored { id, kind, name, bytes, uploaded, reference, triangles, frames, notes } = u;
        Upload { id, kind, name, bytes, uploaded, reference, triangles, frames, notes }
    }
}

#[derive(Serialize, ToSchema)]
pub struct Uploads {
    items: Vec<Upload>,
}

/// Where the bytes of an upload lie.
pub fn file_of(app: &App, upload: &Stored) -> PathBuf {
    app.config.upload_dir.join(format!("{}.{}", upload.id, suffix(&upload.name)))
}

fn suffix(name: &str) -> String {
    FilePath::new(name).extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// What manifests may name on this server now.
pub async fn reach(app: &App) -> Answer<Reach> {
    let mut uploads = BTreeMap::new();
    // The latest of a name comes first, and stays.
    for u in app.store.uploads().await? {
        let file = file_of(app, &u);
        uploads.entry(u.name.clone()).or_insert_with(|| file.clone());
        uploads.insert(u.id, file);
    }
    Ok(Reach::Within(Allowed { folders: app.config.folders.clone(), uploads }))
}

/// Files that users sent
#[utoipa::path(get, path = "/uploads", tag = "files", operation_id = "list_uploads",
    responses((status = 200, body = Uploads), Problem))]
pub async fn list(State(app): State<Shared>, _: Reader) -> Answer<axum::Json<Uploads>> {
    let items = app.store.uploads().await?.into_iter().map(Upload::from).collect();
    Ok(axum::Json(Uploads { items }))
}

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Named {
    /// `scene` or `path`
    #[param(inline)]
    kind: FileKind,
    /// Its name, which says what it is: .obj, .gltf, .glb, .csv
    name: String,
}

#[derive(Deserialize, Clone, Copy, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum FileKind {
    Scene,
    Path,
}

/// A file name and nothing else: what is shown, hashed into no path, and typed into manifests.
fn checked_name(kind: &str, name: &str) -> Answer<()> {
    let plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | ' ' | '(' | ')' | '+');
    if name.is_empty() || name.len() > 120 || name.starts_with('.') || !name.chars().all(plain) {
        return Err(Problem::bad("`name` must be a plain file name of at most 120 letters").help("such as hall.glb"));
    }
    let known = SUFFIXES.iter().find(|(k, _)| *k == kind).map_or(&[][..], |(_, s)| *s);
    if known.contains(&suffix(name).as_str()) {
        return Ok(());
    }
    Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, format!("`{name}` is no {kind} by its name"))
        .help(format!("a {kind} ends in .{}", known.join(", ."))))
}

/// Send a scene or a path
#[utoipa::path(post, path = "/uploads", tag = "files", operation_id = "upload", params(Named),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = 201, body = Upload), Problem))]
pub async fn upload(
    State(app): State<Shared>,
    _: Submitter,
    Query(q): Query<Named>,
    request: Request,
) -> Answer<Response> {
    let kind = match q.kind {
        FileKind::Scene => "scene",
        FileKind::Path => "path",
    };
    checked_name(kind, &q.name)?;
    let part = Part::new(&app, &suffix(&q.name)).await?;
    let (id, bytes) = part.receive(request, app.config.max_upload_bytes).await?;
    let found = examine(&app, kind, &part.file).await?;
    let stored = Stored {
        id,
        kind: kind.to_string(),
        name: q.name,
        bytes,
        uploaded: String::new(),
        reference: String::new(),
        triangles: found.triangles,
        frames: found.frames,
        notes: found.notes,
    };
    part.keep(&file_of(&app, &stored)).await?;
    let stored = app.store.add_upload(&stored).await?;
    tracing::info!(kind, name = stored.name, id = stored.id, bytes, "upload kept");
    Ok((StatusCode::CREATED, axum::Json(Upload::from(stored))).into_response())
}

/// Removes what a killed server was still receiving.
pub fn sweep(folder: &FilePath) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with("part-") {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// A file that is being received; gone when it is not kept.
struct Part {
    file: PathBuf,
}

impl Drop for Part {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.file);
    }
}

fn disk(e: &std::io::Error) -> Problem {
    tracing::error!(error = %e, "an upload could not be written");
    Problem::new(StatusCode::INSUFFICIENT_STORAGE, format!("the file cannot be stored: {e}"))
        .help("free some space on the server")
}

impl Part {
    async fn new(app: &App, suffix: &str) -> Answer<Part> {
        static NUMBER: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
        let n = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let dir = &app.config.upload_dir;
        tokio::fs::create_dir_all(dir).await.map_err(|e| disk(&e))?;
        // The suffix tells the readers what it is.
        Ok(Part { file: dir.join(format!("part-{}-{n}.{suffix}", std::process::id())) })
    }

    /// Hash and size of what came in.
    async fn receive(&self, request: Request, limit: u64) -> Answer<(String, u64)> {
        let mut file = tokio::fs::File::create(&self.file).await.map_err(|e| disk(&e))?;
        let mut stream = request.into_body().into_data_stream();
        let (mut hash, mut bytes) = (blake3::Hasher::new(), 0u64);
        while let Some(chunk) = stream.next().await {
            let chunk = chunk.map_err(|e| Problem::bad(format!("the upload broke off: {e}")))?;
            bytes += chunk.len() as u64;
            if bytes > limit {
                return Err(Problem::new(
                    StatusCode::PAYLOAD_TOO_LARGE,
                    format!("the file has more than {} MiB", limit >> 20),
                )
                .help("simplify it, or put it into a folder that the server allows (`serve --scenes DIR`)"));
            }
            hash.update(&chunk);
            file.write_all(&chunk).await.map_err(|e| disk(&e))?;
        }
        if bytes == 0 {
            return Err(Problem::bad("the upload is empty").help("send the file itself as the body"));
        }
        // Without it the error of the last write would be nobody's.
        file.flush().await.map_err(|e| disk(&e))?;
        file.sync_all().await.map_err(|e| disk(&e))?;
        Ok((hash.finalize().to_hex()[..32].to_string(), bytes))
    }

    async fn keep(&self, target: &FilePath) -> Answer<()> {
        tokio::fs::rename(&self.file, target).await.map_err(|e| disk(&e))
    }
}

#[derive(Deserialize, Default)]
struct Examined {
    triangles: Option<u64>,
    frames: Option<u64>,
    #[serde(default)]
    notes: Vec<String>,
}

async fn examine(app: &App, kind: &str, file: &FilePath) -> Answer<Examined> {
    #[derive(Deserialize)]
    struct Reply {
        ok: Option<Examined>,
        error: Option<super::problem::Mistake>,
    }
    let request = json!({ "kind": kind, "file": file, "memory_limit_mib": app.config.memory_limit_mib });
    let out = app.config.launcher.ask("examine", &request, CHECK).await?;
    let unreadable = |detail: String| Problem::new(StatusCode::UNPROCESSABLE_ENTITY, detail);
    match serde_json::from_slice(&out.stdout) {
        Ok(Reply { ok: Some(found), .. }) => Ok(found),
        Ok(Reply { error: Some(mistake), .. }) => {
            let mistake = nameless(app, mistake);
            let line = mistake.line.map_or_else(String::new, |l| format!("line {l}: "));
            // The file in hand has no name yet.
            let own = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let message = mistake.message.replace(&format!("{own}: "), "").replace(&own, "the file");
            let problem = unreadable(format!("the {kind} cannot be read: {line}{message}"));
            Err(match mistake.help {
                Some(help) => problem.help(help),
                None => problem,
            })
        }
        _ => Err(unreadable(format!("the {kind} cannot be read: {}", out.why()))
            .help("it may be too large for this server's memory limit (`serve --memory-limit-mib`)")),
    }
}

/// Delete an upload
#[utoipa::path(delete, path = "/uploads/{id}", tag = "files", operation_id = "delete_upload", params(("id" = String, Path, description = "id of an upload")),
    responses((status = 204), Problem))]
pub async fn delete(State(app): State<Shared>, _: Admin, Path(id): Path<String>) -> Answer<StatusCode> {
    let upload = app.store.remove_upload(&id).await?;
    if let Err(e) = tokio::fs::remove_file(file_of(&app, &upload)).await {
        tracing::warn!(error = %e, id, "the file of a deleted upload was not there");
    }
    app.views.forget(&id);
    Ok(StatusCode::NO_CONTENT)
}
