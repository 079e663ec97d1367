//! Runs of a study: pages of a table, and one value a cell for heat maps.

use super::auth::Reader;
use super::boards::{self, Board};
use super::caching;
use super::dto::{MetricInfo, cell_json};
use super::input::{self, Path, Query};
use super::problem::{Answer, Problem};
use super::state::Shared;
use super::studies::page_limit;
use crate::error::{Error, Result};
use crate::report::fields::Field;
use crate::report::filter::Filter;
use crate::report::metrics;
use crate::report::query::DEFAULT_COLUMNS;
use crate::report::select::{cell, mask, page};
use crate::report::table::Table;
use crate::results::RunStatus;
use axum::extract::{OriginalUri, State};
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::{IntoParams, ToSchema};

/// Columns of one answer.
const COLUMNS: usize = 64;
/// Runs a page unless the request says otherwise.
const PAGE: usize = 100;

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// Filter, as of `cullmark query --where`
    #[serde(rename = "where")]
    filter: Option<String>,
    /// Fields joined with commas; a leading - turns the order round
    sort: Option<String>,
    /// Fields joined with commas
    columns: Option<String>,
    /// At most so many, 1 to 1000
    #[param(minimum = 1, maximum = 1000)]
    limit: Option<usize>,
    /// `next` of the page before
    cursor: Option<String>,
    /// `json`, or `csv`: everything at once
    #[param(inline)]
    format: Option<Form>,
}

#[derive(Deserialize, Clone, Copy, PartialEq, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    Json,
    Csv,
}

#[derive(Serialize, ToSchema)]
pub struct ColumnInfo {
    name: String,
    unit: String,
    about: String,
    /// Whether its cells are numbers, and whether with an interval
    numeric: bool,
    interval: bool,
}

#[derive(Serialize, ToSchema)]
pub struct RunLine {
    run: String,
    ordinal: u32,
    label: String,
    /// `pending`, `done`, `failed` or `wrong`
    status: &'static str,
    /// By column: text, number, null, or value, low and high
    #[schema(value_type = Object)]
    cells: Map<String, Value>,
}

/// A page of runs.
#[derive(Serialize, ToSchema)]
pub struct RunPage {
    columns: Vec<ColumnInfo>,
    items: Vec<RunLine>,
    /// How many pass the filter
    total: usize,
    next: Option<String>,
}

enum Found {
    Known(String),
    Page(String, RunPage),
    Csv(String, String),
}

fn columns_of(board: &Board, names: &[String]) -> Result<Vec<(String, Field)>> {
    let names: Vec<String> =
        if names.is_empty() { DEFAULT_COLUMNS.iter().map(|c| c.to_string()).collect() } else { names.to_vec() };
    let mut seen = std::collections::HashSet::new();
    let names: Vec<String> = names.into_iter().filter(|n| seen.insert(n.clone())).collect();
    if names.len() > COLUMNS {
        return Err(
            Error::new(format!("{} columns are asked for, {COLUMNS} at most are answered", names.len())).key("columns")
        );
    }
    names.into_iter().map(|n| board.fields.get(&n).map(|f| (n, f))).collect::<Result<_>>().map_err(|e| e.key("columns"))
}

fn filter_of(board: &Board, text: Option<&str>) -> Result<Option<Filter>> {
    let text = text.map(str::trim).filter(|t| !t.is_empty());
    text.map(|t| Filter::parse(t, &board.fields)).transpose().map_err(|e| e.key("where"))
}

/// Runs of a study
#[utoipa::path(get, path = "/studies/{study}/runs", tag = "results", params(("study" = String, Path, description = "name or name@series"), Wanted),
    responses((status = 200, content((RunPage = "application/json"), (String = "text/csv"))), (status = 304),
              Problem))]
pub async fn runs(
    State(app): State<Shared>,
    _: Reader,
    Path(study): Path<String>,
    Query(q): Query<Wanted>,
    OriginalUri(uri): OriginalUri,
    headers: HeaderMap,
) -> Answer<Response> {
    let limit = page_limit(q.limit, PAGE)?;
    let after = q.cursor.as_deref().map(|c| {
        let bytes = URL_SAFE_NO_PAD.decode(c).ok();
        let value: Option<Value> = bytes.and_then(|b| serde_json::from_slice(&b).ok());
        value.ok_or_else(|| Problem::bad("`cursor` is no cursor").help("use `next` of the page before"))
    });
    let after = after.transpose()?;
    let id = app.store.study_id(&study).await?;
    let uri = uri.to_string();
    let found = boards::ask(&app, id, move |b| {
        let tag = caching::tag(&b.version(), &uri);
        if caching::fresh(&headers, &tag) {
            return Ok(Found::Known(tag));
        }
        let columns = columns_of(b, &input::list(q.columns.as_deref()))?;
        let filter = filter_of(b, q.filter.as_deref())?;
        let sort = input::list(q.sort.as_deref());
        if q.format == Some(Form::Csv) {
            let all = page(&b.columns, &b.fields, filter.as_ref(), &sort, None, usize::MAX)?;
            return Ok(Found::Csv(tag, csv(b, &columns, &all.rows)));
        }
        let found = page(&b.columns, &b.fields, filter.as_ref(), &sort, after.as_ref(), limit)?;
        let next = found.next.map(|n| URL_SAFE_NO_PAD.encode(n.to_string()));
        let infos = columns.iter().map(|(name, field)| {
            let c = b.fields.column(name, field);
            ColumnInfo { name: name.clone(), unit: c.unit, about: c.about, numeric: c.numeric, interval: c.interval }
        });
        let items = found.rows.iter().map(|row| line(b, *row, &columns)).collect();
        Ok(Found::Page(tag, RunPage { columns: infos.collect(), items, total: found.total, next }))
    });
    Ok(match found.await? {
        Found::Known(tag) => caching::not_modified(&tag),
        Found::Page(tag, page) => caching::tagged(axum::Json(page), &tag),
        Found::Csv(tag, text) => {
            let name = format!("attachment; filename=\"{}.csv\"", file_name(&study));
            let headers =
                [(header::CONTENT_TYPE, "text/csv; charset=utf-8".to_string()), (header::CONTENT_DISPOSITION, name)];
            caching::tagged((headers, text).into_response(), &tag)
        }
    })
}

/// Only what every file system takes.
pub fn file_name(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '-' }).collect()
}

fn line(board: &Board, row: usize, columns: &[(String, Field)]) -> RunLine {
    let c = &board.columns;
    RunLine {
        run: c.id(row),
        ordinal: c.ordinals[row],
        label: c.label.get(row).clone(),
        status: c.status[row].word(),
        cells: columns.iter().map(|(name, field)| (name.clone(), cell_json(&cell(c, row, field)))).collect(),
    }
}

fn csv(board: &Board, columns: &[(String, Field)], rows: &[usize]) -> String {
    let mut table: Table = board.fields.table(columns);
    let mut out = table.csv();
    let heading = out.len();
    // As cells a large study takes many times as much memory as its text.
    for chunk in rows.chunks(1024) {
        let cells = |row: &usize| columns.iter().map(|(_, f)| cell(&board.columns, *row, f)).collect();
        table.rows = chunk.iter().map(cells).collect();
        out += &table.csv()[heading..];
    }
    out
}

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct MatrixWanted {
    /// Name of a metric
    metric: Option<String>,
    /// Filter, as of `cullmark query --where`
    #[serde(rename = "where")]
    filter: Option<String>,
}

/// One value a cell: parallel lists, one entry a run.
#[derive(Serialize, ToSchema)]
pub struct Cells {
    /// Index in `rows`
    row: Vec<u32>,
    /// Index in `columns`
    column: Vec<u32>,
    ordinal: Vec<u32>,
    /// 0 pending, 1 done, 2 failed, 3 wrong
    status: Vec<u8>,
    value: Vec<Option<f64>>,
}

/// A study as scenes x combinations.
#[derive(Serialize, ToSchema)]
pub struct Heat {
    metric: MetricInfo,
    /// Scenes, with their path where several walk one
    rows: Vec<String>,
    columns: Vec<String>,
    cells: Cells,
}

/// One metric over the whole matrix
#[utoipa::path(get, path = "/studies/{study}/matrix", tag = "results", params(("study" = String, Path, description = "name or name@series"), MatrixWanted),
    responses((status = 200, body = Heat), (status = 304), Problem))]
pub async fn matrix(
    State(app): State<Shared>,
    _: Reader,
    Path(study): Path<String>,
    Query(q): Query<MatrixWanted>,
    OriginalUri(uri): OriginalUri,
    headers: HeaderMap,
) -> Answer<Response> {
    let metric = metrics::get(q.metric.as_deref().unwrap_or("total_cull_ms")).map_err(|e| e.key("metric"))?;
    let index = metrics::METRICS.iter().position(|m| m.name == metric.name).unwrap_or(0);
    let id = app.store.study_id(&study).await?;
    let uri = uri.to_string();
    let found = boards::ask(&app, id, move |b| {
        let tag = caching::tag(&b.version(), &uri);
        if caching::fresh(&headers, &tag) {
            return Ok((tag, None));
        }
        let c = &b.columns;
        let filter = filter_of(b, q.filter.as_deref())?;
        let passed = mask(c, filter.as_ref());
        let rows: Vec<usize> = (0..c.len()).filter(|r| passed[*r]).collect();
        let cells = Cells {
            row: rows.iter().map(|r| c.names[*r].0).collect(),
            column: rows.iter().map(|r| c.names[*r].1).collect(),
            ordinal: rows.iter().map(|r| c.ordinals[*r]).collect(),
            status: rows.iter().map(|r| status_code(c.status[*r])).collect(),
            value: rows.iter().map(|r| c.metric(index, *r).map(|m| m.0)).collect(),
        };
        let heat =
            Heat { metric: MetricInfo::from(metric), rows: c.places.clone(), columns: c.combinations.clone(), cells };
        Ok((tag, Some(heat)))
    });
    Ok(match found.await? {
        (tag, None) => caching::not_modified(&tag),
        (tag, Some(heat)) => caching::tagged(axum::Json(heat), &tag),
    })
}

fn status_code(status: RunStatus) -> u8 {
    match status {
        RunStatus::Pending => 0,
        RunStatus::Done => 1,
        RunStatus::Failed => 2,
        RunStatus::Wrong => 3,
    }
}
