//! Errors as problem documents (RFC 9457): one shape for every mistake, whoever made it.

use crate::error::{Error, ErrorKind};
use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::collections::BTreeMap;
use utoipa::openapi::{ContentBuilder, Ref, RefOr, ResponseBuilder};
use utoipa::{IntoResponses, ToSchema};

/// What an answer is when it is none.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Problem {
    /// `urn:cullmark:problem:...`
    #[serde(rename = "type")]
    pub kind: String,
    pub title: String,
    pub status: u16,
    pub detail: String,
    /// What to do about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
    /// Single mistakes of a manifest.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<Mistake>,
    #[serde(skip)]
    pub retry_after_s: Option<u64>,
}

/// One mistake with its place.
#[derive(Debug, Clone, Serialize, serde::Deserialize, ToSchema)]
pub struct Mistake {
    pub message: String,
    pub file: Option<String>,
    /// From 1.
    pub line: Option<u32>,
    pub column: Option<u32>,
    pub key: Option<String>,
    pub help: Option<String>,
    pub snippet: Option<String>,
}

pub type Answer<T> = Result<T, Problem>;

impl From<Error> for Mistake {
    fn from(e: Error) -> Mistake {
        Mistake {
            message: e.message,
            file: e.file.map(|f| f.display().to_string()),
            line: e.line,
            column: e.column,
            key: e.key,
            help: e.help,
            snippet: e.snippet,
        }
    }
}

impl Problem {
    pub fn new(status: StatusCode, detail: impl Into<String>) -> Problem {
        let title = status.canonical_reason().unwrap_or("Problem");
        Problem {
            kind: format!("urn:cullmark:problem:{}", title.to_lowercase().replace(' ', "-")),
            title: title.to_string(),
            status: status.as_u16(),
            detail: detail.into(),
            help: None,
            errors: Vec::new(),
            retry_after_s: None,
        }
    }

    pub fn bad(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::BAD_REQUEST, detail)
    }

    pub fn missing(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::NOT_FOUND, detail)
    }

    pub fn help(mut self, help: impl Into<String>) -> Problem {
        self.help = Some(help.into());
        self
    }

    /// All mistakes of a manifest at once.
    pub fn mistakes(errors: Vec<Mistake>) -> Problem {
        let n = errors.len();
        let detail = errors.first().map(|e| e.message.clone()).unwrap_or_default();
        let place = errors.first().and_then(|e| e.line).map_or_else(String::new, |l| format!("line {l}: "));
        let key = errors.first().and_then(|e| e.key.as_ref()).map_or_else(String::new, |k| format!("`{k}` "));
        Problem {
            kind: "urn:cullmark:problem:invalid-manifest".into(),
            title: if n == 1 { "the manifest has a mistake".into() } else { format!("the manifest has {n} mistakes") },
            errors,
            ..Problem::new(StatusCode::UNPROCESSABLE_ENTITY, format!("{place}{key}{detail}"))
        }
    }

    /// For what is our own fault; the log has it, the asker gets no insides.
    pub fn internal(what: &str) -> Problem {
        tracing::error!(error = what, "a request failed");
        Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "the server made a mistake")
            .help("its log says more; asking again may do")
    }
}

impl From<Error> for Problem {
    fn from(e: Error) -> Problem {
        let status = match e.kind {
            ErrorKind::Input => StatusCode::BAD_REQUEST,
            ErrorKind::Missing => StatusCode::NOT_FOUND,
            ErrorKind::Conflict => StatusCode::CONFLICT,
            ErrorKind::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
        };
        if e.kind == ErrorKind::Unavailable {
            tracing::warn!(error = %e, "a request met trouble");
        }
        // Where files lie on the server is nobody's business: they are named by what they are.
        let key = e.key.map_or_else(String::new, |k| format!("`{k}`: "));
        let snippet = e.snippet.map_or_else(String::new, |s| format!("\n{}", s.trim_end()));
        Problem {
            help: e.help,
            retry_after_s: (e.kind == ErrorKind::Unavailable).then_some(5),
            ..Problem::new(status, format!("{key}{}{snippet}", e.message))
        }
    }
}

/// Every route may answer with one.
impl IntoResponses for Problem {
    fn responses() -> BTreeMap<String, RefOr<utoipa::openapi::Response>> {
        let schema = Ref::from_schema_name(Problem::name());
        let content = ContentBuilder::new().schema(Some(schema)).build();
        let response = |about: &str| {
            let built = ResponseBuilder::new().description(about).content("application/problem+json", content.clone());
            RefOr::T(built.build())
        };
        BTreeMap::from([
            ("4XX".to_string(), response("the request cannot be answered so")),
            ("5XX".to_string(), response("the server cannot answer now")),
        ])
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let retry = self.retry_after_s;
        let mut response = (status, Json(self)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some(seconds) = retry {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if status == StatusCode::UNAUTHORIZED {
            headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}
