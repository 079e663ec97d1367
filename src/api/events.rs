//! Live progress as server-sent events. Each study that somebody watches has one
//! publisher: it makes every message once, whoever and how many receive it.

use super::auth::Reader;
use super::dto::Summary;
use super::input::Path;
use super::problem::{Answer, Problem};
use super::state::{App, Shared};
use crate::results::RunStatus;
use crate::worker::Phase;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::Response;
use serde::Serialize;
use serde_json::json;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, broadcast};

/// Messages that a slow watcher may be behind before it loses some; it then gets the latest state.
const BACKLOG: usize = 256;
/// Changes are joined so long into one message.
const JOIN: Duration = Duration::from_millis(150);
/// Other processes may work on the study, too: so often the database is asked.
const LOOK: Duration = Duration::from_secs(1);
/// Either is at least so many times as long as counting takes: a large study must not keep us busy.
const EASE: u32 = 5;
/// A word through every proxy that would close a silent connection.
const BEAT: Duration = Duration::from_secs(15);

struct Channel {
    sender: broadcast::Sender<Bytes>,
    changed: Arc<Notify>,
    ended: Arc<Mutex<Vec<Ended>>>,
}

/// A run that ended, until it is told.
struct Ended {
    measurement_id: String,
    label: String,
    status: RunStatus,
    reason: Option<String>,
}

#[derive(Default)]
pub struct Hub {
    channels: Mutex<HashMap<i64, Channel>>,
}

impl Hub {
    pub fn touch(&self, study_id: i64) {
        let channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(channel) = channels.get(&study_id) {
            channel.changed.notify_one();
        }
    }

    pub fn run_ended(&self, study_id: i64, measurement_id: &str, label: &str, status: RunStatus, reason: Option<&str>) {
        let channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(channel) = channels.get(&study_id) else { return };
        channel.ended.lock().unwrap_or_else(PoisonError::into_inner).push(Ended {
            measurement_id: measurement_id.to_string(),
            label: label.to_string(),
            status,
            reason: reason.map(str::to_string),
        });
        channel.changed.notify_one();
    }

    /// How many connections watch.
    pub fn watchers(&self) -> usize {
        let channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        channels.values().map(|c| c.sender.receiver_count()).sum()
    }

    fn subscribe(&self, app: &Shared, study_id: i64) -> broadcast::Receiver<Bytes> {
        let mut channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(channel) = channels.get(&study_id) {
            return channel.sender.subscribe();
        }
        let (sender, receiver) = broadcast::channel(BACKLOG);
        let channel = Channel { sender: sender.clone(), changed: Arc::default(), ended: Arc::default() };
        tokio::spawn(publish(app.clone(), study_id, sender, channel.changed.clone(), channel.ended.clone()));
        channels.insert(study_id, channel);
        receiver
    }

    fn remove(&self, study_id: i64) {
        self.channels.lock().unwrap_or_else(PoisonError::into_inner).remove(&study_id);
    }

    /// Ends the publisher if nobody watches any more; false if somebody came meanwhile.
    fn close(&self, study_id: i64) -> bool {
        let mut channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        let idle = channels.get(&study_id).is_none_or(|c| c.sender.receiver_count() == 0);
        if idle {
            channels.remove(&study_id);
        }
        idle
    }
}

/// What is told of a study that changed.
#[derive(Serialize)]
struct Progress {
    #[serde(flatten)]
    summary: Summary,
    running: Vec<Running>,
}

#[derive(Serialize)]
struct Running {
    run: String,
    kind: crate::store::Kind,
    repeat: u32,
}

fn message(event: &str, data: &impl Serialize) -> Bytes {
    let data = serde_json::to_string(data).expect("events are plain data");
    Bytes::from(format!("event: {event}\ndata: {data}\n\n"))
}

async fn progress(app: &App, study_id: i64) -> Answer<(Bytes, bool)> {
    let summary = Summary::from(app.overview(study_id).await?);
    let finished = summary.finished;
    let workers = app.workers.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let running = workers
        .into_iter()
        .filter(|w| w.study_id == Some(study_id))
        .filter_map(|w| Some(Running { run: w.run?, kind: w.kind?, repeat: w.repeat }));
    let progress = Progress { summary, running: running.collect() };
    Ok((message("progress", &progress), finished))
}

async fn stopping(phase: &mut tokio::sync::watch::Receiver<Phase>) {
    // What it answers is a guard that must not outlive the question.
    let _ = phase.wait_for(|p| *p != Phase::Work).await;
}

/// The runs that ended since the last look.
async fn tell_runs(app: &App, study_id: i64, sender: &broadcast::Sender<Bytes>, ended: &Mutex<Vec<Ended>>) {
    let told: Vec<Ended> = std::mem::take(&mut *ended.lock().unwrap_or_else(PoisonError::into_inner));
    for run in told {
        let ordinal = app.store.ordinal_of(study_id, &run.measurement_id).await.ok().flatten();
        let data = json!({ "ordinal": ordinal, "run": run.measurement_id, "label": run.label,
                           "status": run.status, "reason": run.reason });
        let _ = sender.send(message("run", &data));
    }
}

async fn publish(
    app: Shared,
    study_id: i64,
    sender: broadcast::Sender<Bytes>,
    changed: Arc<Notify>,
    ended: Arc<Mutex<Vec<Ended>>>,
) {
    let mut last = Bytes::new();
    // A study that is finished already is told so twice: better than never, had it ended just now.
    let mut was_finished = false;
    let mut phase = app.phase.clone();
    let mut took = Duration::ZERO;
    loop {
        tokio::select! {
            () = changed.notified() => tokio::time::sleep((took * EASE).clamp(JOIN, 2 * LOOK)).await,
            () = tokio::time::sleep((took * EASE).clamp(LOOK, 2 * LOOK)) => {}
            () = stopping(&mut phase) => {
                let _ = sender.send(message("shutdown", &json!({})));
                app.hub.remove(study_id);
                return;
            }
        }
        tell_runs(&app, study_id, &sender, &ended).await;
        let start = Instant::now();
        let state = progress(&app, study_id).await;
        took = start.elapsed();
        match state {
            Ok((now, finished)) => {
                if now != last {
                    let _ = sender.send(now.clone());
                    last = now;
                }
                if finished && !was_finished {
                    // Who settled the last run is about to say so.
                    tokio::time::sleep(JOIN).await;
                    tell_runs(&app, study_id, &sender, &ended).await;
                    let _ = sender.send(message("end", &json!({})));
                }
                was_finished = finished;
            }
            Err(problem) if problem.status == 404 => {
                let _ = sender.send(message("deleted", &json!({})));
                // Whoever still listens hears of the end; the number may be another study's soon.
                app.hub.remove(study_id);
                return;
            }
            // A locked database, say: the next look tells.
            Err(_) => {}
        }
        if sender.receiver_count() == 0 && app.hub.close(study_id) {
            return;
        }
    }
}

/// Watch a study
#[utoipa::path(get, path = "/studies/{study}/events", tag = "studies", params(("study" = String, Path, description = "name or name@series")),
    responses((status = 200, description = "events `progress`, `run`, `end`", content_type = "text/event-stream", body = String),
              Problem))]
pub async fn events(State(app): State<Shared>, _: Reader, Path(study): Path<String>) -> Answer<Response> {
    let study_id = app.store.study_id(&study).await?;
    let receiver = app.hub.subscribe(&app, study_id);
    let (first, finished) = progress(&app, study_id).await?;
    let mut start = first.to_vec();
    if finished {
        start.extend_from_slice(&message("end", &json!({})));
    }
    let stream = stream_of(app.clone(), study_id, receiver, Bytes::from(start));
    let mut response = Response::new(Body::from_stream(stream));
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("text/event-stream"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    // A proxy that collects answers would hold events back.
    headers.insert("x-accel-buffering", HeaderValue::from_static("no"));
    Ok(response)
}

/// The first message, then what comes, a heartbeat in between.
fn stream_of(
    app: Shared,
    study_id: i64,
    receiver: broadcast::Receiver<Bytes>,
    first: Bytes,
) -> impl futures_util::Stream<Item = Result<Bytes, std::convert::Infallible>> {
    let start = (Some(first), receiver, app, false);
    futures_util::stream::unfold(start, move |(first, mut receiver, app, over)| async move {
        if let Some(first) = first {
            return Some((Ok(first), (None, receiver, app, over)));
        }
        if over {
            return None;
        }
        let (next, over) = match tokio::time::timeout(BEAT, receiver.recv()).await {
            Err(_) => (Bytes::from_static(b": still here\n\n"), false),
            Ok(Ok(next)) => {
                let over = next.starts_with(b"event: shutdown") || next.starts_with(b"event: deleted");
                (next, over)
            }
            // Too slow for some messages: the latest state makes up for them.
            Ok(Err(broadcast::error::RecvError::Lagged(_))) => match progress(&app, study_id).await {
                Ok((now, _)) => (now, false),
                Err(_) => return None,
            },
            Ok(Err(broadcast::error::RecvError::Closed)) => return None,
        };
        Some((Ok(next), (None, receiver, app, over)))
    })
}
