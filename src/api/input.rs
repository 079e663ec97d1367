//! What requests hold, read so that every mistake becomes a problem document: axum's
//! own extractors answer in plain text.

use super::problem::{Answer, Problem};
use axum::body::Bytes;
use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::StatusCode;
use axum::http::request::Parts;
use serde::de::DeserializeOwned;

/// Parameters behind `?`.
pub struct Query<T>(pub T);

/// Parameters within the path.
pub struct Path<T>(pub T);

/// A JSON document as body.
pub struct Json<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Answer<Self> {
        let read: Result<axum::extract::Query<T>, QueryRejection> =
            axum::extract::Query::from_request_parts(parts, state).await;
        read.map(|q| Query(q.0))
            .map_err(|e| Problem::bad(e.body_text()).help("the parameters are listed in docs/API.md"))
    }
}

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for Path<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Answer<Self> {
        let read: Result<axum::extract::Path<T>, PathRejection> =
            axum::extract::Path::from_request_parts(parts, state).await;
        read.map(|p| Path(p.0)).map_err(|e| Problem::missing(e.body_text()))
    }
}

impl<S: Send + Sync, T: DeserializeOwned> FromRequest<S> for Json<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Answer<Self> {
        let read: Result<axum::Json<T>, JsonRejection> = axum::Json::from_request(request, state).await;
        read.map(|j| Json(j.0)).map_err(|e| Problem::new(e.status(), e.body_text()))
    }
}

/// The whole body, up to the limit of the route.
pub async fn body<S: Send + Sync>(request: Request, state: &S) -> Answer<Bytes> {
    Bytes::from_request(request, state).await.map_err(|e| match e.status() {
        StatusCode::PAYLOAD_TOO_LARGE => Problem::new(StatusCode::PAYLOAD_TOO_LARGE, "the body is too large")
            .help("a manifest may have 4 MiB; scenes are uploads of their own"),
        status => Problem::new(status, e.body_text()),
    })
}

/// `a,b,c` without blanks and empty parts.
pub fn list(text: Option<&str>) -> Vec<String> {
    let parts = text.unwrap_or_default().split(',');
    parts.map(str::trim).filter(|p| !p.is_empty()).map(str::to_string).collect()
}
