//! Two studies set side by side.

use super::analysis::{compute, ordinals, results};
use super::auth::Reader;
use super::dto::Spread;
use super::input::Query;
use super::problem::{Answer, Problem};
use super::state::Shared;
use crate::report::compare::{self, Change, PAIRED};
use crate::report::metrics;
use crate::results::RunResult;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use utoipa::{IntoParams, ToSchema};

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct CompareWanted {
    /// name or name@series
    first: String,
    second: String,
    /// By default culling time, paired frame by frame
    metric: Option<String>,
}

#[derive(Serialize, ToSchema)]
pub struct Side {
    ordinal: u32,
    value: Option<f64>,
}

#[derive(Serialize, ToSchema)]
pub struct PairLine {
    scene: String,
    structure: String,
    culling: String,
    label: String,
    first: Option<Side>,
    second: Option<Side>,
    /// Second over first
    ratio: Option<Spread>,
    /// `lower`, `higher`, `same`, `unknown` or `none`
    change: &'static str,
    note: String,
}

/// Two studies cell by cell, the largest change first.
#[derive(Serialize, ToSchema)]
pub struct Comparison {
    metric: String,
    unit: String,
    first: String,
    second: String,
    #[schema(value_type = Object)]
    counts: HashMap<&'static str, usize>,
    pairs: Vec<PairLine>,
}

/// Set two studies side by side
#[utoipa::path(get, path = "/compare", tag = "analysis", params(CompareWanted),
    responses((status = 200, body = Comparison), Problem))]
pub async fn compare_route(
    State(app): State<Shared>,
    _: Reader,
    Query(q): Query<CompareWanted>,
) -> Answer<axum::Json<Comparison>> {
    let metric = q.metric.unwrap_or_else(|| PAIRED.to_string());
    let (first, second) = (results(&app, &q.first, None).await?.0, results(&app, &q.second, None).await?.0);
    let names = {
        let (a, b) = (app.store.study_id(&q.first).await?, app.store.study_id(&q.second).await?);
        (app.overview(a).await?.reference, app.overview(b).await?.reference)
    };
    let (of_first, of_second) = (ordinals(&app, &q.first).await?, ordinals(&app, &q.second).await?);
    let answer = compute(move || {
        let pairs = compare::compare(&first, &second, &metric).map_err(|e| e.key("metric"))?;
        let shown = metrics::known(if metric == PAIRED { "median_frame_us" } else { &metric });
        let mut counts: HashMap<&'static str, usize> =
            ["lower", "higher", "same", "unknown", "none"].into_iter().map(|w| (w, 0)).collect();
        let mut lines = Vec::new();
        for p in &pairs {
            let Some(run) = p.first.or(p.second) else { continue };
            let change = match p.change {
                Change::Lower => "lower",
                Change::Higher => "higher",
                Change::Same => "same",
                Change::Unknown => "unknown",
                Change::None => "none",
            };
            *counts.entry(change).or_default() += 1;
            let side = |r: Option<&RunResult>, of: &HashMap<String, u32>| {
                r.map(|r| Side { ordinal: of[r.measurement_id.as_str()], value: shown.value(r) })
            };
            lines.push(PairLine {
                scene: run.scene().to_string(),
                structure: run.structure.clone(),
                culling: run.culling.clone(),
                label: run.label(),
                first: side(p.first, &of_first),
                second: side(p.second, &of_second),
                ratio: p.ratio.map(Spread::from),
                change,
                note: p.note.clone(),
            });
        }
        Ok(Comparison { unit: shown.unit.into(), metric, first: names.0, second: names.1, counts, pairs: lines })
    });
    Ok(axum::Json(answer.await?))
}
