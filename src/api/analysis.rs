//! What the report says of a study, as data: fronts and claims.

use super::auth::Reader;
use super::boards;
use super::caching;
use super::dto::{MetricInfo, Spread};
use super::input::{Path, Query};
use super::problem::{Answer, Problem};
use super::state::Shared;
use crate::claim::Claim;
use crate::report::fields::Fields;
use crate::report::filter::Filter;
use crate::report::frontier::{Standing, fronts};
use crate::report::frontier_table::{X, Y, only};
use crate::report::labels::Grid;
use crate::report::{claims, metrics};
use crate::results::{RunResult, StudyResults};
use crate::store::Detail;
use axum::extract::{OriginalUri, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use utoipa::{IntoParams, ToSchema};

/// Charts and fronts need every frame of every run: more runs than this are narrowed first.
const RUNS: usize = 5000;

/// All results of a study that pass a filter, and the version of the answer.
pub async fn results(app: &Shared, study: &str, filter: Option<&str>) -> Answer<(StudyResults, String)> {
    let id = app.store.study_id(study).await?;
    let overview = app.overview(id).await?;
    let version = boards::ask(app, id, |b| Ok(b.version())).await?;
    if overview.runs.total as usize > RUNS {
        return Err(Problem::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            format!("the study has {} runs; this answer is made of {RUNS} at most", overview.runs.total),
        )
        .help("`runs` and `matrix` have no such limit; `cullmark report` neither"));
    }
    let mut results = app.store.results_with(&overview.reference, Detail::Frames).await?;
    if let Some(text) = filter.map(str::trim).filter(|t| !t.is_empty()) {
        let fields = Fields::of(&results);
        let filter = Filter::parse(text, &fields).map_err(|e| e.key("where"))?;
        results.runs.retain(|r| filter.matches(r, &fields));
    }
    Ok((results, version))
}

pub async fn compute<T: Send + 'static>(work: impl FnOnce() -> Answer<T> + Send + 'static) -> Answer<T> {
    tokio::task::spawn_blocking(work).await.map_err(|e| Problem::internal(&e.to_string()))?
}

/// Where runs stand in the matrix, by measurement.
pub fn ordinals(results: &StudyResults) -> HashMap<&str, usize> {
    results.runs.iter().enumerate().map(|(i, r)| (r.measurement_id.as_str(), i)).collect()
}

#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
pub struct FrontWanted {
    /// Metric of the cost
    x: Option<String>,
    /// Metric of the error
    y: Option<String>,
    /// Filter, as of `cullmark query --where`
    #[serde(rename = "where")]
    filter: Option<String>,
    /// This scene alone
    scene: Option<String>,
}

#[derive(Serialize, ToSchema)]
pub struct Point {
    run: String,
    ordinal: usize,
    label: String,
    x: Spread,
    y: Spread,
    /// `front`, `within_noise` or `dominated`
    standing: &'static str,
    /// Who dominates it, or would by value alone
    by: Vec<String>,
}

#[derive(Serialize, ToSchema)]
pub struct LeftOut {
    label: String,
    why: String,
}

#[derive(Serialize, ToSchema)]
pub struct SceneFront {
    scene: String,
    points: Vec<Point>,
    left_out: Vec<LeftOut>,
}

/// Pareto fronts, scene by scene.
#[derive(Serialize, ToSchema)]
pub struct Fronts {
    x: MetricInfo,
    y: MetricInfo,
    scenes: Vec<SceneFront>,
}

/// Who is on the front of two metrics
#[utoipa::path(get, path = "/studies/{study}/front", tag = "analysis", params(("study" = String, Path, description = "name or name@series"), FrontWanted),
    responses((status = 200, body = Fronts), (status = 304), (status = "4XX", body = Problem), (status = "5XX", body = Problem)))]
pub async fn front(
    State(app): State<Shared>,
    _: Reader,
    Path(study): Path<String>,
    Query(q): Query<FrontWanted>,
    OriginalUri(uri): OriginalUri,
    headers: HeaderMap,
) -> Answer<Response> {
    let x = metrics::get(q.x.as_deref().unwrap_or(X)).map_err(|e| e.key("x"))?;
    let y = metrics::get(q.y.as_deref().unwrap_or(Y)).map_err(|e| e.key("y"))?;
    // The ordinal is that of the whole matrix: the filter is applied to points.
    let (results, version) = results(&app, &study, None).await?;
    let tag = caching::tag(&version, &uri.to_string());
    if caching::fresh(&headers, &tag) {
        return Ok(caching::not_modified(&tag));
    }
    let answer = compute(move || {
        let fields = Fields::of(&results);
        let text = q.filter.as_deref().map(str::trim).filter(|t| !t.is_empty());
        let filter = text.map(|t| Filter::parse(t, &fields)).transpose().map_err(|e| e.key("where"))?;
        let grid = Grid::of(&results);
        let number = ordinals(&results);
        let keep = |run: &RunResult| filter.as_ref().is_none_or(|f| f.matches(run, &fields));
        let mut found = fronts(&grid, x, y, &keep);
        if let Some(scene) = &q.scene {
            found = only(found, scene).map_err(|e| e.key("scene"))?;
        }
        let scenes = found.iter().map(|front| SceneFront {
            scene: front.place.clone(),
            points: front
                .points
                .iter()
                .map(|p| Point {
                    run: p.run.measurement_id.clone(),
                    ordinal: number[p.run.measurement_id.as_str()],
                    label: grid.combinations[p.combination].clone(),
                    x: p.x.into(),
                    y: p.y.into(),
                    standing: match p.standing {
                        Standing::Front | Standing::Contested => "front",
                        Standing::Noise => "within_noise",
                        Standing::Dominated => "dominated",
                    },
                    by: p.by.iter().map(|i| grid.combinations[front.points[*i].combination].clone()).collect(),
                })
                .collect(),
            left_out: front
                .gaps
                .iter()
                .map(|g| LeftOut { label: grid.combinations[g.combination].clone(), why: g.why.clone() })
                .collect(),
        });
        Ok(Fronts { x: x.into(), y: y.into(), scenes: scenes.collect() })
    });
    Ok(caching::tagged(axum::Json(answer.await?), &tag))
}

/// A claim and how it fared.
#[derive(Serialize, ToSchema)]
pub struct ClaimLine {
    id: String,
    text: String,
    source: String,
    verdict: &'static str,
    summary: String,
    groups: Vec<Group>,
}

/// One place of a claim.
#[derive(Serialize, ToSchema)]
pub struct Group {
    name: String,
    stated: String,
    verdict: &'static str,
    found: Option<Spread>,
    note: String,
}

#[derive(Serialize, ToSchema)]
pub struct Claims {
    items: Vec<ClaimLine>,
}

pub async fn claims_of(app: &Shared, study: &str) -> Answer<Vec<Claim>> {
    let text = app.store.claims_json(study).await?;
    Ok(serde_json::from_str(&text).unwrap_or_default())
}

/// How the claims of a study fared
#[utoipa::path(get, path = "/studies/{study}/claims", tag = "analysis", params(("study" = String, Path, description = "name or name@series")),
    responses((status = 200, body = Claims), (status = "4XX", body = Problem), (status = "5XX", body = Problem)))]
pub async fn claims_route(
    State(app): State<Shared>,
    _: Reader,
    Path(study): Path<String>,
) -> Answer<axum::Json<Claims>> {
    let stated = claims_of(&app, &study).await?;
    if stated.is_empty() {
        app.store.study_id(&study).await?;
        return Ok(axum::Json(Claims { items: Vec::new() }));
    }
    let (results, _) = results(&app, &study, None).await?;
    let items = compute(move || {
        let judged = claims::judge_all(&results, &stated);
        let line = |j: &claims::Judged| ClaimLine {
            id: j.claim.id.clone(),
            text: j.claim.text.clone(),
            source: j.claim.source.clone(),
            verdict: j.verdict.word(),
            summary: j.summary.clone(),
            groups: j
                .groups
                .iter()
                .map(|g| Group {
                    name: g.name.clone(),
                    stated: g.stated.clone(),
                    verdict: g.verdict.word(),
                    found: g.ratio.map(Spread::from),
                    note: g.note.clone(),
                })
                .collect(),
        };
        Ok(judged.iter().map(line).collect())
    });
    Ok(axum::Json(Claims { items: items.await? }))
}
