//! Studies: the list, one, and what may be done to it.

use super::auth::{Admin, Reader, Submitter};
use super::boards;
use super::dto::{MetricInfo, Summary};
use super::input::{Json, Path, Query};
use super::problem::{Answer, Problem};
use super::state::Shared;
use crate::report::metrics::METRICS;
use crate::store::control::PRIORITY_LIMIT;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::{IntoParams, ToSchema};

/// Studies a page unless the request says otherwise.
const PAGE: usize = 50;
pub const PAGE_LIMIT: usize = 1000;

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Pages {
    /// At most so many, 1 to 1000
    #[param(minimum = 1, maximum = 1000)]
    limit: Option<usize>,
    /// `next` of the page before
    cursor: Option<String>,
}

/// A page of studies, the latest submission first.
#[derive(Serialize, ToSchema)]
pub struct StudyPage {
    items: Vec<Summary>,
    next: Option<String>,
}

pub fn page_limit(asked: Option<usize>, usual: usize) -> Answer<usize> {
    match asked {
        None => Ok(usual),
        Some(n @ 1..=PAGE_LIMIT) => Ok(n),
        Some(n) => Err(Problem::bad(format!("`limit` is {n}, but must be from 1 to {PAGE_LIMIT}"))),
    }
}

/// List studies
#[utoipa::path(get, path = "/studies", tag = "studies", params(Pages),
    responses((status = 200, body = StudyPage), Problem))]
pub async fn list(State(app): State<Shared>, _: Reader, Query(q): Query<Pages>) -> Answer<axum::Json<StudyPage>> {
    let limit = page_limit(q.limit, PAGE)?;
    // Where the page starts: after the study submitted at that time.
    let after = q.cursor.as_deref().map(|c| {
        let parts = c.split_once('-').and_then(|(a, b)| Some((a.parse::<i64>().ok()?, b.parse::<i64>().ok()?)));
        parts.ok_or_else(|| Problem::bad("`cursor` is no cursor of this list").help("use `next` of the page before"))
    });
    let after = after.transpose()?;
    let all = app.store.study_ids().await?;
    let mut rest = all.into_iter().filter(|s| after.is_none_or(|a| *s < a)).peekable();
    let page: Vec<(i64, i64)> = rest.by_ref().take(limit).collect();
    let next = page.last().filter(|_| rest.peek().is_some()).map(|(at, id)| format!("{at}-{id}"));
    let ids: Vec<i64> = page.iter().map(|p| p.1).collect();
    let items = app.overviews(&ids).await?.into_iter().map(Summary::from).collect();
    Ok(axum::Json(StudyPage { items, next }))
}

/// A study and what is in it.
#[derive(Serialize, ToSchema)]
pub struct Study {
    #[serde(flatten)]
    summary: Summary,
    description: String,
    scenes: Vec<String>,
    combinations: Vec<String>,
    #[schema(value_type = Object)]
    axes: Value,
    /// What filters, sorts and columns may name
    fields: Vec<String>,
    /// Metrics with a value in some run
    metrics: Vec<String>,
    #[schema(value_type = Vec<Object>)]
    excluded_cells: Vec<Value>,
    claims: usize,
    #[schema(value_type = Object)]
    policy: Value,
    #[schema(value_type = Object)]
    environments: Value,
}

/// One study
#[utoipa::path(get, path = "/studies/{study}", tag = "studies", params(("study" = String, Path, description = "name or name@series")),
    responses((status = 200, body = Study), Problem))]
pub async fn one(State(app): State<Shared>, _: Reader, Path(study): Path<String>) -> Answer<axum::Json<Study>> {
    let id = app.store.study_id(&study).await?;
    let about = app.store.about(id).await?;
    let summary = Summary::from(app.overview(id).await?);
    let seen = boards::ask(&app, id, |b| {
        let c = &b.columns;
        let axes: serde_json::Map<String, Value> = c
            .axes
            .iter()
            .map(|(axis, column)| {
                let values: Vec<String> = match c.labels.get(axis.as_str()) {
                    Some(labels) => labels.values.clone(),
                    None => column.values.iter().map(|v| crate::registry::format_sum(v)).collect(),
                };
                (axis.clone(), json!(values))
            })
            .collect();
        let metrics: Vec<String> = c.known_metrics().into_iter().map(str::to_string).collect();
        Ok((c.places.clone(), c.combinations.clone(), axes, b.fields.names(), metrics))
    });
    let (scenes, combinations, axes, fields, metrics) = seen.await?;
    let description = description(&about.manifest_toml);
    let claims = serde_json::from_str::<Vec<Value>>(&about.claims_json).map_or(0, |c| c.len());
    let cells = about.excluded.iter().map(|e| json!({ "cell": e.cell, "why": e.why, "count": e.count })).collect();
    Ok(axum::Json(Study {
        summary,
        description,
        scenes,
        combinations,
        axes: Value::Object(axes),
        fields,
        metrics,
        excluded_cells: cells,
        claims,
        policy: serde_json::from_str(&about.policy_json).unwrap_or_default(),
        environments: json!(about.environments),
    }))
}

fn description(manifest: &str) -> String {
    let table = manifest.parse::<toml::Table>().ok();
    let study = table.as_ref().and_then(|t| t.get("study")).and_then(|s| s.get("description"));
    study.and_then(|d| d.as_str()).unwrap_or_default().to_string()
}

/// The manifest of a study
#[utoipa::path(get, path = "/studies/{study}/manifest", tag = "studies", params(("study" = String, Path, description = "name or name@series")),
    responses((status = 200, description = "TOML", content_type = "application/toml", body = String), Problem))]
pub async fn manifest(State(app): State<Shared>, _: Reader, Path(study): Path<String>) -> Answer<Response> {
    let id = app.store.study_id(&study).await?;
    let text = app.store.about(id).await?.manifest_toml;
    Ok(([(header::CONTENT_TYPE, "application/toml; charset=utf-8")], text).into_response())
}

#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// -100 to 100, higher first
    #[schema(minimum = -100, maximum = 100)]
    priority: i64,
}

/// Change the priority of a study
#[utoipa::path(patch, path = "/studies/{study}", tag = "studies", request_body = Change, params(("study" = String, Path, description = "name or name@series")),
    responses((status = 200, body = Summary), Problem))]
pub async fn change(
    State(app): State<Shared>,
    _: Submitter,
    Path(study): Path<String>,
    Json(change): Json<Change>,
) -> Answer<axum::Json<Summary>> {
    if change.priority.abs() > PRIORITY_LIMIT {
        return Err(Problem::bad(format!("`priority` must be from -{PRIORITY_LIMIT} to {PRIORITY_LIMIT}")));
    }
    app.store.set_priority(&study, change.priority).await?;
    after(&app, &study).await
}

/// What the study is like now, told to whoever watches it.
async fn after(app: &Shared, study: &str) -> Answer<axum::Json<Summary>> {
    let id = app.store.study_id(study).await?;
    app.wake.notify_waiters();
    app.hub.touch(id);
    Ok(axum::Json(app.overview(id).await?.into()))
}

macro_rules! action {
    ($name:ident, $path:literal, $about:literal, $id:literal) => {
        #[doc = $about]
        #[utoipa::path(post, path = $path, tag = "studies", operation_id = $id, params(("study" = String, Path, description = "name or name@series")),
            responses((status = 200, body = Summary), Problem))]
        pub async fn $name(State(app): State<Shared>, _: Submitter, Path(study): Path<String>) -> Answer<axum::Json<Summary>> {
            app.store.$name(&study).await?;
            after(&app, &study).await
        }
    };
}

action!(pause, "/studies/{study}/pause", "Let the jobs of a study wait", "pause_study");
action!(resume, "/studies/{study}/resume", "Go on with a paused or cancelled study", "resume_study");
action!(cancel, "/studies/{study}/cancel", "Drop what is left to do of a study; results stay", "cancel_study");
action!(retry, "/studies/{study}/retry", "Queue again what failed", "retry_study");

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Deletion {
    /// Also measurements that no other study has
    #[serde(default)]
    measurements: bool,
}

/// Delete a study
#[utoipa::path(delete, path = "/studies/{study}", tag = "studies", params(("study" = String, Path, description = "name or name@series"), Deletion),
    responses((status = 204), Problem))]
pub async fn delete(
    State(app): State<Shared>,
    _: Admin,
    Path(study): Path<String>,
    Query(q): Query<Deletion>,
) -> Answer<StatusCode> {
    let id = app.store.study_id(&study).await?;
    app.store.delete_study(&study, q.measurements).await?;
    tracing::info!(study, measurements = q.measurements, "study deleted");
    app.boards.forget(id);
    app.hub.touch(id);
    Ok(StatusCode::NO_CONTENT)
}

/// All metrics
#[utoipa::path(get, path = "/metrics", tag = "results",
    responses((status = 200, body = Vec<MetricInfo>), Problem))]
pub async fn metrics(_: Reader) -> axum::Json<Vec<MetricInfo>> {
    axum::Json(METRICS.iter().map(MetricInfo::from).collect())
}
