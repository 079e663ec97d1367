//! All of one run, and the numbers of its frames.

use super::auth::Reader;
use super::boards;
use super::caching;
use super::columnar;
use super::input::{self, Path, Query};
use super::problem::{Answer, Problem};
use super::runs::file_name;
use super::state::Shared;
use crate::record::cameras;
use crate::registry::format_sum;
use crate::report::metrics::METRICS;
use crate::report::tables::class_word;
use crate::results::{RunResult, RunStatus};
use crate::store::Detail;
use crate::store::run_page::{Attempt, FrameSeries, TrialLine};
use axum::extract::{OriginalUri, State};
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use utoipa::{IntoParams, ToSchema};

/// All of one run.
#[derive(Serialize, ToSchema)]
pub struct Run {
    run: String,
    ordinal: u32,
    study: String,
    label: String,
    scene: String,
    path: String,
    structure: String,
    culling: String,
    walk: String,
    axes: BTreeMap<String, String>,
    camera: String,
    status: &'static str,
    reason: Option<String>,
    stop_reason: Option<String>,
    class: Option<&'static str>,
    observed: Option<&'static str>,
    machine_class: String,
    /// By name: a number, or value, low and high
    #[schema(value_type = Object)]
    metrics: Map<String, Value>,
    #[schema(value_type = Vec<Object>)]
    trials: Vec<TrialLine>,
    #[schema(value_type = Vec<Object>)]
    attempts: Vec<Attempt>,
    /// None before the first trial
    #[schema(value_type = Option<Object>)]
    environment: Value,
    #[schema(value_type = Vec<Object>)]
    judged_frames: Vec<Value>,
    #[schema(value_type = Vec<Object>)]
    series: Vec<Value>,
}

/// The study's number, the measurement and its ordinal, and what the answer is made of.
pub async fn locate(app: &Shared, study: &str, run: &str) -> Answer<(i64, String, u32, String)> {
    let id = app.store.study_id(study).await?;
    let wanted = run.to_string();
    let found = boards::ask(app, id, move |b| {
        Ok(b.columns.find(&wanted).map(|row| (b.columns.id(row), b.columns.ordinals[row], b.version())))
    });
    let (measurement, ordinal, version) = found.await?.ok_or_else(|| {
        Problem::missing(format!("`{run}` is no run of `{study}`"))
            .help("a run is named by its ordinal in the matrix, or by the 32 digits of its measurement_id")
    })?;
    Ok((id, measurement, ordinal, version))
}

pub async fn result(app: &Shared, study_id: i64, measurement: &str, detail: Detail) -> Answer<RunResult> {
    let runs = app.store.some_results(study_id, &[measurement.to_string()], detail).await?;
    runs.into_iter().next().ok_or_else(|| Problem::missing("the run was deleted"))
}

/// One run
#[utoipa::path(get, path = "/studies/{study}/runs/{run}", tag = "results",
    params(("study" = String, Path, description = "name or name@series"), ("run" = String, Path, description = "ordinal or measurement_id")),
    responses((status = 200, body = Run), Problem))]
pub async fn run(
    State(app): State<Shared>,
    _: Reader,
    Path((study, run)): Path<(String, String)>,
) -> Answer<axum::Json<Run>> {
    let (id, measurement, ordinal, _) = locate(&app, &study, &run).await?;
    let found = result(&app, id, &measurement, Detail::Frames).await?;
    let overview = app.overview(id).await?;
    let (mut trials, attempts, environment) = app.store.run_history(id, &measurement).await?;
    // Also those of a run that is not judged yet: it may turn out to be wrong.
    if found.status != RunStatus::Done {
        for t in &mut trials {
            (t.total_cull_ms, t.build_ms, t.prepare_ms, t.load_ms) = (None, None, None, None);
            t.peak_rss_mib = None;
        }
    }
    let series = app.store.frame_series(&measurement).await?;
    let spec = &found.spec;
    let metrics = METRICS.iter().filter_map(|m| {
        let (value, low, high) = m.interval(&found)?;
        let several = m.values(&found).len() > 1;
        Some((
            m.name.to_string(),
            if several { json!({ "value": value, "low": low, "high": high }) } else { json!(value) },
        ))
    });
    let mut listed: BTreeMap<(String, String), (usize, Vec<u32>)> = BTreeMap::new();
    for s in &series {
        let entry = listed.entry((s.name.clone(), s.unit.clone())).or_default();
        entry.0 = s.values.len();
        entry.1.extend(s.trial);
    }
    let judged = found.errors.iter().map(|e| serde_json::to_value(e).expect("plain data")).collect();
    Ok(axum::Json(Run {
        run: measurement,
        ordinal,
        study: overview.reference,
        label: found.label(),
        scene: spec.scene.name.clone(),
        path: spec.path.name.clone(),
        structure: found.structure.clone(),
        culling: found.culling.clone(),
        walk: found.walk.clone(),
        axes: spec.axes.iter().map(|(k, v)| (k.clone(), format_sum(std::slice::from_ref(v)))).collect(),
        camera: cameras::label(&cameras::spec_of(&spec.camera)),
        status: found.status.word(),
        reason: found.reason.clone(),
        stop_reason: found.stop_reason.clone(),
        class: found.class.map(class_word),
        observed: found.observed.map(class_word),
        machine_class: found.machine_class.clone(),
        metrics: metrics.collect(),
        trials,
        attempts,
        environment: environment.map_or(Value::Null, |e| json!(e)),
        judged_frames: judged,
        series: listed
            .into_iter()
            .map(|((name, unit), (frames, trials))| json!({ "name": name, "unit": unit, "frames": frames, "trials": trials }))
            .collect(),
    }))
}

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct SeriesWanted {
    /// Names joined with commas; all if absent
    names: Option<String>,
    /// `median` (the default), `all`, or the number of a trial
    trial: Option<String>,
    /// `json`, `csv` or `arrow` (an IPC stream)
    #[param(inline)]
    format: Option<SeriesForm>,
}

#[derive(Deserialize, Clone, Copy, PartialEq, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum SeriesForm {
    Json,
    Csv,
    Arrow,
}

/// Numbers of every frame.
#[derive(Serialize, ToSchema)]
pub struct SeriesAnswer {
    frames: usize,
    #[schema(value_type = Vec<Object>)]
    series: Vec<FrameSeries>,
}

/// Numbers of every frame of a run
#[utoipa::path(get, path = "/studies/{study}/runs/{run}/series", tag = "results",
    params(("study" = String, Path, description = "name or name@series"), ("run" = String, Path, description = "ordinal or measurement_id"), SeriesWanted),
    responses((status = 200, content((SeriesAnswer = "application/json"), (String = "text/csv"), (Vec<u8> = "application/vnd.apache.arrow.stream"))),
              (status = 304), Problem))]
pub async fn series(
    State(app): State<Shared>,
    _: Reader,
    Path((study, run)): Path<(String, String)>,
    Query(q): Query<SeriesWanted>,
    OriginalUri(uri): OriginalUri,
    headers: HeaderMap,
) -> Answer<Response> {
    let (id, measurement, ordinal, version) = locate(&app, &study, &run).await?;
    let tag = caching::tag(&version, &uri.to_string());
    // Times of a run that is wrong or failed, or not judged yet, are withheld here, too.
    let trusted = result(&app, id, &measurement, Detail::Summary).await?.status == RunStatus::Done;
    // Of an open run the first trial brings counted series, and no version tells.
    if trusted && caching::fresh(&headers, &tag) {
        return Ok(caching::not_modified(&tag));
    }
    let mut all = app.store.frame_series(&measurement).await?;
    all.retain(|s| trusted || s.unit != "ns");
    let names = input::list(q.names.as_deref());
    if let Some(strange) = names.iter().find(|n| all.iter().all(|s| s.name != **n)) {
        let mut known: Vec<&str> = all.iter().map(|s| s.name.as_str()).collect();
        known.dedup();
        return Err(
            Problem::bad(format!("the run has no series `{strange}`")).help(format!("it has: {}", known.join(", ")))
        );
    }
    all.retain(|s| names.is_empty() || names.contains(&s.name));
    let chosen = match q.trial.as_deref().unwrap_or("median") {
        "all" => all,
        "median" => columnar::medians(all),
        number => {
            let wanted: u32 = number
                .parse()
                .map_err(|_| Problem::bad(format!("`trial` is `{number}`, but must be median, all or a number")))?;
            all.retain(|s| s.trial.is_none_or(|t| t == wanted));
            all
        }
    };
    let frames = chosen.iter().map(|s| s.values.len()).max().unwrap_or(0);
    let name = |suffix: &str| format!("attachment; filename=\"{}-{ordinal}.{suffix}\"", file_name(&study));
    Ok(match q.format.unwrap_or(SeriesForm::Json) {
        SeriesForm::Json => caching::tagged(axum::Json(SeriesAnswer { frames, series: chosen }), &tag),
        SeriesForm::Csv => {
            let headers = [
                (header::CONTENT_TYPE, "text/csv; charset=utf-8".to_string()),
                (header::CONTENT_DISPOSITION, name("csv")),
            ];
            caching::tagged((headers, columnar::csv(&chosen, frames)).into_response(), &tag)
        }
        SeriesForm::Arrow => {
            let bytes = columnar::stream(&chosen, frames).map_err(|e| Problem::internal(&e))?;
            let kind = "application/vnd.apache.arrow.stream".to_string();
            let headers = [(header::CONTENT_TYPE, kind), (header::CONTENT_DISPOSITION, name("arrow"))];
            caching::tagged((headers, bytes).into_response(), &tag)
        }
    })
}
