//! Limits of one server: requests a second and client, time a request, and what a
//! panic of ours looks like from outside.

use super::problem::Problem;
use super::state::Shared;
use axum::body::{Body, BodyDataStream, HttpBody};
use axum::extract::{ConnectInfo, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::{StreamExt, stream};
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A client may ask so many times at once before the rate counts.
const BURST_S: f64 = 4.0;
/// What a refused request still sends is read so long.
const DRAIN: Duration = Duration::from_secs(20);
/// Clients that are remembered; the full ones are forgotten first.
const CLIENTS: usize = 4096;

/// A bucket of tokens a client: it fills at `rate` a second (Turner 1986).
#[derive(Debug)]
pub struct Rates {
    rate: f64,
    buckets: Mutex<HashMap<IpAddr, (f64, Instant)>>,
}

impl Rates {
    /// 0 is no limit.
    pub fn new(rate: f64) -> Rates {
        Rates { rate, buckets: Mutex::default() }
    }

    /// Seconds to wait, if it is too much.
    fn take(&self, client: IpAddr, now: Instant) -> Option<f64> {
        if self.rate <= 0.0 {
            return None;
        }
        let full = self.rate * BURST_S;
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        if buckets.len() >= CLIENTS {
            buckets.retain(|_, (level, at)| *level + now.duration_since(*at).as_secs_f64() * self.rate < full);
        }
        let (level, at) = buckets.entry(client).or_insert((full, now));
        *level = (*level + now.duration_since(*at).as_secs_f64() * self.rate).min(full);
        *at = now;
        if *level < 1.0 {
            return Some((1.0 - *level) / self.rate);
        }
        *level -= 1.0;
        None
    }
}

/// Turns away who asks too often.
pub async fn rate(State(app): State<Shared>, request: Request, next: Next) -> Response {
    let client = request.extensions().get::<ConnectInfo<SocketAddr>>().map(|c| c.0.ip());
    if let Some(wait) = client.and_then(|c| app.rates.take(c, Instant::now())) {
        let mut problem = Problem::new(StatusCode::TOO_MANY_REQUESTS, "too many requests from this address")
            .help("wait a moment, or raise `serve --rate`");
        problem.retry_after_s = Some(wait.ceil() as u64);
        return problem.into_response();
    }
    next.run(request).await
}

/// Ends requests that take too long. Streams and uploads have limits of their own.
pub async fn time(State(app): State<Shared>, request: Request, next: Next) -> Response {
    let path = request.uri().path();
    let own = path.ends_with("/events") || path.contains("/view") || path.ends_with("/uploads");
    let limit = if own { Duration::from_secs(600) } else { app.config.timeout };
    match tokio::time::timeout(limit, next.run(request)).await {
        Ok(response) => response,
        Err(_) => Problem::new(StatusCode::SERVICE_UNAVAILABLE, format!("no answer within {} s", limit.as_secs()))
            .help("ask for less at once (a filter, a smaller page), or raise `serve --timeout-s`")
            .into_response(),
    }
}

/// Reads what a refused request still sends, for a while: a client that writes on would see
/// its connection break instead of the answer.
pub async fn drain(request: Request, next: Next) -> Response {
    // One that waits for leave to send has sent nothing.
    if request.body().is_end_stream() || request.headers().contains_key(header::EXPECT) {
        return next.run(request).await;
    }
    let (parts, body) = request.into_parts();
    let rest = Arc::new(Mutex::new(body.into_data_stream()));
    let stream = |of: Arc<Mutex<BodyDataStream>>| {
        stream::poll_fn(move |cx| of.lock().unwrap_or_else(PoisonError::into_inner).poll_next_unpin(cx))
    };
    let response = next.run(Request::from_parts(parts, Body::from_stream(stream(rest.clone())))).await;
    if !response.status().is_success() {
        let mut rest = stream(rest);
        let _ = tokio::time::timeout(DRAIN, async { while let Some(Ok(_)) = rest.next().await {} }).await;
    }
    response
}

/// A panic is our bug: the log has it, the client gets a problem document.
pub fn panicked(cause: Box<dyn std::any::Any + Send>) -> Response {
    let text = cause.downcast_ref::<String>().cloned();
    let text = text.or_else(|| cause.downcast_ref::<&str>().map(|s| s.to_string()));
    Problem::internal(&format!("panic: {}", text.unwrap_or_default())).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_passes_and_then_the_rate_counts() {
        let rates = Rates::new(10.0);
        let (client, start) = ("10.0.0.1".parse().unwrap(), Instant::now());
        assert_eq!((0..40).filter(|_| rates.take(client, start).is_none()).count(), 40);
        let wait = rates.take(client, start).expect("the bucket is empty");
        assert!(wait > 0.09 && wait <= 0.1, "{wait}");
        assert!(rates.take("10.0.0.2".parse().unwrap(), start).is_none(), "another client has its own");
        assert!(rates.take(client, start + Duration::from_millis(101)).is_none());
        assert!(Rates::new(0.0).take(client, start).is_none());
    }
}
