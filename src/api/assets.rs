//! The page: our own files, embedded, under a policy that lets nothing else run.

use super::problem::Problem;
use axum::http::{HeaderMap, HeaderValue, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use rust_embed::RustEmbed;

#[derive(RustEmbed)]
#[folder = "web/"]
struct Files;

/// Nothing but this server's own files; blobs are charts and pictures that the page made.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
    connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Addresses that the page routes itself: a study's name may have a dot.
const VIEWS: &[&str] = &["studies", "submit", "compare", "scenes", "machine"];

/// On every answer.
pub async fn headers(request: axum::extract::Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let fixed = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    let headers = response.headers_mut();
    for (name, value) in fixed {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.insert("cross-origin-opener-policy", HeaderValue::from_static("same-origin"));
    headers.insert("cross-origin-resource-policy", HeaderValue::from_static("same-origin"));
    response
}

fn kind(path: &str) -> &'static str {
    match path.rsplit_once('.').map(|(_, suffix)| suffix) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        _ => "application/octet-stream",
    }
}

/// A file of the page; any other address is one of the page's own views.
pub async fn asset(uri: Uri, asked: HeaderMap) -> Response {
    let path = uri.path().trim_start_matches('/');
    if path == "api" || path.starts_with("api/") {
        return Problem::missing(format!("there is no `{}`", uri.path()))
            .help("routes: /api/v1/openapi.json")
            .into_response();
    }
    let view = VIEWS.contains(&path.split('/').next().unwrap_or_default());
    let (name, file) = match Files::get(path) {
        Some(file) => (path, file),
        // What looks like a file and is none is missing; the rest the page routes itself.
        None if !view && path.rsplit('/').next().is_some_and(|last| last.contains('.')) => {
            return Problem::missing(format!("there is no `{}`", uri.path())).into_response();
        }
        None => match Files::get("index.html") {
            Some(file) => ("index.html", file),
            None => return Problem::internal("the page is not embedded").into_response(),
        },
    };
    let hash: String = file.metadata.sha256_hash().iter().take(12).map(|b| format!("{b:02x}")).collect();
    let tag = format!("\"{hash}\"");
    if super::caching::fresh(&asked, &tag) {
        return super::caching::not_modified(&tag);
    }
    super::caching::tagged(([(header::CONTENT_TYPE, kind(name))], file.data.into_owned()).into_response(), &tag)
}
