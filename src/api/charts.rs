//! The report's charts, one by one, as SVG and PNG.

use super::analysis::{claims_of, compute, results};
use super::auth::Reader;
use super::boards;
use super::caching;
use super::input::{Path, Query};
use super::problem::{Answer, Problem};
use super::state::Shared;
use crate::claim::Claim;
use crate::report::labels::Grid;
use crate::report::{charts, claims, figure, raster, render, sweep_chart, sweeps};
use crate::results::StudyResults;
use axum::extract::{OriginalUri, State};
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::Arc;
use utoipa::{IntoParams, ToSchema};

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct ChartWanted {
    /// Filter, as of `cullmark query --where`
    #[serde(rename = "where")]
    filter: Option<String>,
}

#[derive(Serialize, ToSchema)]
pub struct ChartInfo {
    id: String,
    title: String,
    description: String,
}

#[derive(Serialize, ToSchema)]
pub struct Charts {
    items: Vec<ChartInfo>,
}

/// Charts of a study that somebody looks at: they ask for one after another, and each is
/// made of all results.
#[derive(Default)]
pub struct Drawn {
    kept: tokio::sync::Mutex<VecDeque<(String, Arc<Vec<figure::Figure>>)>>,
}

/// Sets of charts that are kept.
const KEPT: usize = 4;

/// One at a time: who waits finds what the other drew.
async fn figures_of(app: &Shared, study: &str, filter: Option<&str>) -> Answer<(Arc<Vec<figure::Figure>>, String)> {
    let id = app.store.study_id(study).await?;
    let version = boards::ask(app, id, |b| Ok(b.version())).await?;
    let key = format!("{version}?{}", filter.unwrap_or_default());
    let mut kept = app.drawn.kept.lock().await;
    if let Some((_, figures)) = kept.iter().find(|(k, _)| *k == key) {
        return Ok((figures.clone(), version));
    }
    let stated = claims_of(app, study).await?;
    let (results, _) = results(app, study, filter).await?;
    let drawn = Arc::new(compute(move || Ok(figures(&results, &stated))).await?);
    kept.push_back((key, drawn.clone()));
    if kept.len() > KEPT {
        kept.pop_front();
    }
    Ok((drawn, version))
}

fn figures(results: &StudyResults, stated: &[Claim]) -> Vec<figure::Figure> {
    let judged = claims::judge_all(results, stated);
    let mut all = charts::all(&Grid::of(results), &judged);
    let drawn: Vec<_> = results.sweeps.iter().filter_map(|s| sweeps::chart(results, s).ok()).collect();
    all.extend(drawn.iter().map(sweep_chart::draw));
    all
}

/// The charts of a study
#[utoipa::path(get, path = "/studies/{study}/charts", tag = "analysis", params(("study" = String, Path, description = "name or name@series"), ChartWanted),
    responses((status = 200, body = Charts), Problem))]
pub async fn chart_list(
    State(app): State<Shared>,
    _: Reader,
    Path(study): Path<String>,
    Query(q): Query<ChartWanted>,
) -> Answer<axum::Json<Charts>> {
    let (figures, _) = figures_of(&app, &study, q.filter.as_deref()).await?;
    let info =
        |f: &figure::Figure| ChartInfo { id: f.id.clone(), title: f.title.clone(), description: f.description.clone() };
    let items = figures.iter().map(info).collect();
    Ok(axum::Json(Charts { items }))
}

/// A chart as SVG or PNG
#[utoipa::path(get, path = "/studies/{study}/charts/{chart}", tag = "analysis",
    params(("study" = String, Path, description = "name or name@series"), ("chart" = String, Path, description = "id of a chart with .svg or .png"), ChartWanted),
    responses((status = 200, content((String = "image/svg+xml"), (Vec<u8> = "image/png"))), (status = 304),
              Problem))]
pub async fn chart(
    State(app): State<Shared>,
    _: Reader,
    Path((study, chart)): Path<(String, String)>,
    Query(q): Query<ChartWanted>,
    OriginalUri(uri): OriginalUri,
    headers: HeaderMap,
) -> Answer<Response> {
    let parts = chart.rsplit_once('.').filter(|(_, suffix)| matches!(*suffix, "svg" | "png"));
    let Some((name, suffix)) = parts.map(|(n, s)| (n.to_string(), s.to_string())) else {
        return Err(Problem::missing(format!("`{chart}` is no chart")).help("add .svg or .png to the id of one"));
    };
    let (all, version) = figures_of(&app, &study, q.filter.as_deref()).await?;
    let tag = caching::tag(&version, &uri.to_string());
    if caching::fresh(&headers, &tag) {
        return Ok(caching::not_modified(&tag));
    }
    let drawn = compute(move || {
        let Some(figure) = all.iter().find(|f| f.id == name) else {
            let known: Vec<&str> = all.iter().map(|f| f.id.as_str()).collect();
            return Err(Problem::missing(format!("the study has no chart `{name}`"))
                .help(format!("it has: {}", known.join(", "))));
        };
        Ok(if suffix == "svg" { render::svg(figure, true)?.into_bytes() } else { raster::png(figure)? })
    });
    let kind = if chart.ends_with(".svg") { "image/svg+xml" } else { "image/png" };
    Ok(caching::tagged(([(header::CONTENT_TYPE, kind)], drawn.await?).into_response(), &tag))
}
