//! For whoever runs the server: is it well, and what does it do (Prometheus text format).

use super::auth::Reader;
use super::problem::{Answer, Problem};
use super::state::Shared;
use crate::worker::Event;
use axum::extract::{MatchedPath, Request, State};
use axum::http::header;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Upper ends of the classes of a request's time, seconds.
const CLASSES: [f64; 8] = [0.001, 0.005, 0.02, 0.1, 0.5, 2.0, 10.0, f64::INFINITY];

#[derive(Default)]
struct Route {
    by_status: BTreeMap<u16, u64>,
    classes: [u64; CLASSES.len()],
    seconds: f64,
}

/// Counted since the server started.
pub struct Counts {
    start: Instant,
    routes: Mutex<BTreeMap<String, Route>>,
    outcomes: Mutex<BTreeMap<(&'static str, String), u64>>,
    troubles: AtomicU64,
}

impl Default for Counts {
    fn default() -> Self {
        let (routes, outcomes) = (Mutex::default(), Mutex::default());
        Counts { start: Instant::now(), routes, outcomes, troubles: AtomicU64::new(0) }
    }
}

impl Counts {
    pub fn on(&self, event: &Event) {
        match event {
            Event::JobEnded { kind, outcome, .. } => {
                let mut outcomes = self.outcomes.lock().unwrap_or_else(PoisonError::into_inner);
                *outcomes.entry((kind.word(), outcome.to_string())).or_default() += 1;
            }
            Event::Trouble { .. } => {
                self.troubles.fetch_add(1, Ordering::Relaxed);
            }
            _ => {}
        }
    }

    fn request(&self, route: &str, status: u16, seconds: f64) {
        let mut routes = self.routes.lock().unwrap_or_else(PoisonError::into_inner);
        let route = routes.entry(route.to_string()).or_default();
        *route.by_status.entry(status).or_default() += 1;
        route.seconds += seconds;
        let class = CLASSES.iter().position(|c| seconds <= *c).unwrap_or(CLASSES.len() - 1);
        route.classes[class] += 1;
    }
}

/// Logs and counts every request; neither token nor query is written anywhere.
pub async fn log(State(app): State<Shared>, request: Request, next: Next) -> Response {
    let start = Instant::now();
    let route = request.extensions().get::<MatchedPath>().map_or("other", MatchedPath::as_str).to_string();
    let (method, path) = (request.method().clone(), request.uri().path().to_string());
    let response = next.run(request).await;
    let (status, time) = (response.status().as_u16(), start.elapsed());
    // Any word may stand for a method; those of the standard are counted by name.
    let known = ["GET", "HEAD", "POST", "PATCH", "DELETE", "OPTIONS", "PUT"].contains(&method.as_str());
    let counted = if known { method.as_str() } else { "OTHER" };
    app.counts.request(&format!("{counted} {route}"), status, time.as_secs_f64());
    tracing::debug!(%method, path, status, ms = time.as_secs_f64() * 1e3, "request");
    response
}

/// 200 when the database answers.
pub async fn healthz(State(app): State<Shared>) -> Answer<axum::Json<serde_json::Value>> {
    app.store.now().await?;
    let stopping = *app.phase.borrow() != crate::worker::Phase::Work;
    if stopping {
        let status = axum::http::StatusCode::SERVICE_UNAVAILABLE;
        return Err(Problem::new(status, "the server is stopping"));
    }
    Ok(axum::Json(json!({ "status": "ok", "version": env!("CARGO_PKG_VERSION") })))
}

/// Prometheus text.
pub async fn metrics(State(app): State<Shared>, _: Reader) -> Answer<Response> {
    let mut out = String::new();
    let gauge = |out: &mut String, name: &str, help: &str, value: f64| {
        let _ = writeln!(out, "# HELP {name} {help}\n# TYPE {name} gauge\n{name} {value}");
    };
    gauge(&mut out, "cullmark_uptime_seconds", "since the server started", app.counts.start.elapsed().as_secs_f64());
    gauge(&mut out, "cullmark_resident_bytes", "memory of the server", resident_bytes());
    gauge(&mut out, "cullmark_watchers", "open event streams", app.hub.watchers() as f64);
    gauge(
        &mut out,
        "cullmark_pool_paused",
        "1 when all jobs wait",
        f64::from(u8::from(app.store.pool_paused().await?)),
    );
    let busy = app.workers.lock().unwrap_or_else(PoisonError::into_inner).iter().filter(|w| w.kind.is_some()).count();
    gauge(&mut out, "cullmark_workers_busy", "workers of this server under way", busy as f64);
    let _ = writeln!(out, "# HELP cullmark_jobs jobs that wait or are under way\n# TYPE cullmark_jobs gauge");
    for (kind, state, n) in app.store.queue_counts().await? {
        let _ = writeln!(out, "cullmark_jobs{{kind=\"{kind}\",state=\"{state}\"}} {n}");
    }
    let _ = writeln!(
        out,
        "# HELP cullmark_jobs_ended_total jobs of this server by outcome\n# TYPE cullmark_jobs_ended_total counter"
    );
    for ((kind, outcome), n) in app.counts.outcomes.lock().unwrap_or_else(PoisonError::into_inner).iter() {
        let _ = writeln!(out, "cullmark_jobs_ended_total{{kind=\"{kind}\",outcome=\"{outcome}\"}} {n}");
    }
    let troubles = app.counts.troubles.load(Ordering::Relaxed);
    let _ = writeln!(
        out,
        "# HELP cullmark_worker_troubles_total times a worker met a full disk, a locked database or the like\n# TYPE cullmark_worker_troubles_total counter\ncullmark_worker_troubles_total {troubles}"
    );
    requests(&mut out, &app.counts.routes.lock().unwrap_or_else(PoisonError::into_inner));
    Ok(([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], out).into_response())
}

fn requests(out: &mut String, routes: &BTreeMap<String, Route>) {
    let _ = writeln!(
        out,
        "# HELP cullmark_requests_total requests by route and status\n# TYPE cullmark_requests_total counter"
    );
    for (route, r) in routes {
        for (status, n) in &r.by_status {
            let _ = writeln!(out, "cullmark_requests_total{{route=\"{route}\",status=\"{status}\"}} {n}");
        }
    }
    let _ =
        writeln!(out, "# HELP cullmark_request_seconds time of requests\n# TYPE cullmark_request_seconds histogram");
    for (route, r) in routes {
        let mut sum = 0;
        for (n, class) in r.classes.iter().zip(CLASSES) {
            sum += n;
            let le = if class.is_finite() { class.to_string() } else { "+Inf".into() };
            let _ = writeln!(out, "cullmark_request_seconds_bucket{{route=\"{route}\",le=\"{le}\"}} {sum}");
        }
        let _ = writeln!(out, "cullmark_request_seconds_sum{{route=\"{route}\"}} {}", r.seconds);
        let _ = writeln!(out, "cullmark_request_seconds_count{{route=\"{route}\"}} {sum}");
    }
}

/// Of this process, from /proc; 0 where there is none.
fn resident_bytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"));
    let kib = line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok());
    kib.unwrap_or(0.0) * 1024.0
}
