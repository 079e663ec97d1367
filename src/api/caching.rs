//! Answers made of results change only when results do: a tag names what they were made of.

use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

/// The tag of an answer: results of `version`, asked as `query`, in this program.
pub fn tag(version: &str, query: &str) -> String {
    let mut hash = blake3::Hasher::new();
    for part in [version, query, env!("CARGO_PKG_VERSION"), env!("CULLMARK_COMMIT")] {
        hash.update(part.as_bytes()).update(b"\n");
    }
    format!("\"{}\"", &hash.finalize().to_hex()[..24])
}

/// Whether the asker has that answer already.
pub fn fresh(headers: &HeaderMap, tag: &str) -> bool {
    let known = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|h| h.to_str().ok());
    known.flat_map(|h| h.split(',')).any(|t| t.trim().trim_start_matches("W/") == tag || t.trim() == "*")
}

pub fn not_modified(tag: &str) -> Response {
    let mut response = StatusCode::NOT_MODIFIED.into_response();
    mark(&mut response, tag);
    response
}

/// Every use asks whether it still holds.
pub fn tagged(response: impl IntoResponse, tag: &str) -> Response {
    let mut response = response.into_response();
    mark(&mut response, tag);
    response
}

fn mark(response: &mut Response, tag: &str) {
    let headers = response.headers_mut();
    if let Ok(value) = HeaderValue::from_str(tag) {
        headers.insert(header::ETAG, value);
    }
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
}
