//! Who asks, and whether they may: bearer tokens with roles, and a guard against pages of
//! other origins that use a visitor's browser (DNS rebinding, cross-site requests).

use super::problem::{Answer, Problem};
use super::state::Shared;
use crate::store::tokens::Role;
use axum::extract::{FromRequestParts, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Anybody who may read.
pub struct Reader(pub Role);
/// Who may submit studies and files.
pub struct Submitter;
/// Who may delete, and rule the pool.
pub struct Admin;

async fn role(parts: &Parts, app: &Shared) -> Answer<Role> {
    // Once there were tokens, removing the last one opens nothing.
    if !app.wants_tokens().await? {
        return Ok(Role::Admin);
    }
    let header = parts.headers.get(header::AUTHORIZATION).and_then(|h| h.to_str().ok());
    let Some(header) = header else {
        return Err(Problem::new(StatusCode::UNAUTHORIZED, "this server wants a token")
            .help("send `Authorization: Bearer TOKEN`; `cullmark token add` makes one on the server"));
    };
    let token =
        header.split_once(' ').filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer")).map(|(_, t)| t.trim());
    match app.store.role_of(token.unwrap_or_default()).await? {
        Some(role) => Ok(role),
        None => Err(Problem::new(StatusCode::UNAUTHORIZED, "the token is unknown to this server")
            .help("it may have been removed; ask whoever runs the server for another")),
    }
}

async fn at_least(needed: Role, parts: &Parts, app: &Shared) -> Answer<Role> {
    let has = role(parts, app).await?;
    if has >= needed {
        return Ok(has);
    }
    Err(Problem::new(
        StatusCode::FORBIDDEN,
        format!("this needs the role `{}`, the token has `{}`", needed.word(), has.word()),
    )
    .help("`cullmark token add --role` makes one with more rights"))
}

impl FromRequestParts<Shared> for Reader {
    type Rejection = Problem;
    async fn from_request_parts(parts: &mut Parts, app: &Shared) -> Answer<Self> {
        at_least(Role::Read, parts, app).await.map(Reader)
    }
}

impl FromRequestParts<Shared> for Submitter {
    type Rejection = Problem;
    async fn from_request_parts(parts: &mut Parts, app: &Shared) -> Answer<Self> {
        at_least(Role::Submit, parts, app).await.map(|_| Submitter)
    }
}

impl FromRequestParts<Shared> for Admin {
    type Rejection = Problem;
    async fn from_request_parts(parts: &mut Parts, app: &Shared) -> Answer<Self> {
        at_least(Role::Admin, parts, app).await.map(|_| Admin)
    }
}

/// Refuses what a page of another origin made a browser send.
pub async fn guard(State(app): State<Shared>, request: Request, next: Next) -> Response {
    match foreign(&app, request.method(), request.headers()) {
        Some(problem) => problem.into_response(),
        None => next.run(request).await,
    }
}

fn foreign(app: &Shared, method: &Method, headers: &HeaderMap) -> Option<Problem> {
    let text = |name| headers.get(name).and_then(|h| h.to_str().ok());
    let host = text(header::HOST).unwrap_or_default();
    // A name that somebody's DNS points at us is not ours: on a loopback address only its own names are.
    if app.config.loopback && !host.is_empty() && !is_loopback(host) {
        return Some(
            Problem::new(StatusCode::MISDIRECTED_REQUEST, format!("`{host}` is no name of this server"))
                .help("it listens on a loopback address: use localhost, 127.0.0.1 or [::1]"),
        );
    }
    // What costs the machine work is not for pages of others to trigger, by pictures say.
    if text(header::HeaderName::from_static("sec-fetch-site")) == Some("cross-site")
        && text(header::HeaderName::from_static("sec-fetch-mode")) != Some("navigate")
    {
        return Some(Problem::new(StatusCode::FORBIDDEN, "a page of another origin may not use this server"));
    }
    let safe = matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS);
    let origin = text(header::ORIGIN)?;
    let same = origin.split_once("://").is_some_and(|(_, place)| place.eq_ignore_ascii_case(host));
    (!safe && !same)
        .then(|| Problem::new(StatusCode::FORBIDDEN, "a page of another origin may not change anything here"))
}

/// `localhost`, `127.x.y.z` or `[::1]`, with or without a port.
pub fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    name.eq_ignore_ascii_case("localhost") || name.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::is_loopback;

    #[test]
    fn names_of_this_machine() {
        for ours in ["localhost", "localhost:8080", "127.0.0.1:1", "127.9.9.9", "[::1]:80", "LOCALHOST:1"] {
            assert!(is_loopback(ours), "{ours}");
        }
        for foreign in ["example.com", "localhost.example.com:80", "10.0.0.1", "[::2]:80", "127.0.0.1.example.com", ""]
        {
            assert!(!is_loopback(foreign), "{foreign}");
        }
    }
}
