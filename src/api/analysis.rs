//! What the report says of a study, as data: fronts and claims.

use super::auth::Reader;
use super::boards;
use super::caching;
use super::dto::{MetricInfo, Spread};
use super::input::{Path, Query};
use super::problem::{Answer, Problem};
use super::state::Shared;
use crate::claim::Claim;
use crate::report::claims;
use crate::report::filter::Filter;
use crate::report::frontier::{Standing, coordinate, fronts};
use crate::report::frontier_table::{X, Y, only};
use crate::report::labels::Grid;
use crate::report::select::mask;
use crate::results::StudyResults;
use crate::store::Detail;
use axum::extract::{OriginalUri, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use utoipa::{IntoParams, ToSchema};

/// Charts and fronts need every frame of every run: more than this is narrowed first.
const RUNS: usize = 5000;
const SERIES_BYTES: u64 = 160 << 20;

/// All results of a study that pass a filter, and the version of the answer.
pub async fn results(app: &Shared, study: &str, filter: Option<&str>) -> Answer<(StudyResults, String)> {
    let id = app.store.study_id(study).await?;
    let overview = app.overview(id).await?;
    let text = filter.map(str::trim).filter(|t| !t.is_empty()).map(str::to_string);
    let chosen = boards::ask(app, id, move |b| {
        let filter = text.map(|t| Filter::parse(&t, &b.fields)).transpose().map_err(|e| e.key("where"))?;
        let passed = mask(&b.columns, filter.as_ref());
        let ids: Vec<String> = (0..passed.len()).filter(|r| passed[*r]).map(|r| b.columns.id(r)).collect();
        Ok((ids, b.version()))
    });
    let (ids, version) = chosen.await?;
    let help = "narrow it with `where`; `runs` and `matrix` have no such limit, `cullmark report` neither";
    if ids.len() > RUNS {
        let detail = format!("{} runs; this answer is made of {RUNS} at most", ids.len());
        return Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, detail).help(help));
    }
    let bytes = app.store.series_bytes(&ids).await?;
    if bytes > SERIES_BYTES {
        let detail = format!(
            "the frames of {} runs are {} MiB; this answer is made of {} MiB at most",
            ids.len(),
            bytes >> 20,
            SERIES_BYTES >> 20
        );
        return Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, detail).help(help));
    }
    Ok((app.store.results_of(&overview.reference, &ids, Detail::Frames).await?, version))
}

pub async fn compute<T: Send + 'static>(work: impl FnOnce() -> Answer<T> + Send + 'static) -> Answer<T> {
    tokio::task::spawn_blocking(work).await.map_err(|e| Problem::internal(&e.to_string()))?
}

/// Where runs of a study stand in the matrix, by measurement.
pub async fn ordinals(app: &Shared, study: &str) -> Answer<HashMap<String, u32>> {
    let id = app.store.study_id(study).await?;
    boards::ask(app, id, |b| Ok((0..b.columns.len()).map(|r| (b.columns.id(r), b.columns.ordinals[r])).collect())).await
}

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
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
    ordinal: u32,
    label: String,
    structure: String,
    culling: String,
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
    responses((status = 200, body = Fronts), (status = 304), Problem))]
pub async fn front(
    State(app): State<Shared>,
    _: Reader,
    Path(study): Path<String>,
    Query(q): Query<FrontWanted>,
    OriginalUri(uri): OriginalUri,
    headers: HeaderMap,
) -> Answer<Response> {
    let x = coordinate(q.x.as_deref().unwrap_or(X)).map_err(|e| e.key("x"))?;
    let y = coordinate(q.y.as_deref().unwrap_or(Y)).map_err(|e| e.key("y"))?;
    let (results, version) = results(&app, &study, q.filter.as_deref()).await?;
    let tag = caching::tag(&version, &uri.to_string());
    if caching::fresh(&headers, &tag) {
        return Ok(caching::not_modified(&tag));
    }
    let number = ordinals(&app, &study).await?;
    let answer = compute(move || {
        let grid = Grid::of(&results);
        let mut found = fronts(&grid, x, y, &|_| true);
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
                    structure: p.run.structure.clone(),
                    culling: p.run.culling.clone(),
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
    responses((status = 200, body = Claims), Problem))]
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
