//! Results as a table: filtered, sorted, cut, with the columns asked for.

use super::fields::{Field, Fields};
use super::filter::Filter;
use super::table::{Cell, Table};
use crate::error::{Error, Result};
use crate::results::{RunResult, StudyResults};
use serde_json::{Map, Value, json};
use std::cmp::Ordering;

#[derive(Debug, Clone, Default)]
pub struct Query {
    pub filter: Option<String>,
    /// Names; empty takes [`DEFAULT_COLUMNS`].
    pub columns: Vec<String>,
    /// Names, `-` in front for descending.
    pub sort: Vec<String>,
    pub limit: Option<usize>,
}

pub const DEFAULT_COLUMNS: &[&str] = &[
    "scene",
    "structure",
    "culling",
    // Rows of two walks would look the same.
    "walk",
    "status",
    "total_cull_ms",
    "p99_frame_us",
    "frame_ms_model",
    "mean_triangles",
    "false_cull_ppm",
    "over_submission",
    "structure_mib",
];

/// # Errors
/// For a filter that does not parse and for names that are no fields.
pub fn query(results: &StudyResults, query: &Query) -> Result<Table> {
    let fields = Fields::of(results);
    let filter = query.filter.as_deref().map(|f| Filter::parse(f, &fields)).transpose()?;
    let names: Vec<String> = if query.columns.is_empty() {
        DEFAULT_COLUMNS.iter().map(|c| c.to_string()).collect()
    } else {
        query.columns.clone()
    };
    let columns: Vec<(String, Field)> =
        names.into_iter().map(|n| fields.get(&n).map(|f| (n, f))).collect::<Result<_>>()?;
    let mut runs: Vec<&RunResult> =
        results.runs.iter().filter(|r| filter.as_ref().is_none_or(|f| f.matches(r, &fields))).collect();
    // By the last key first: the sort is stable.
    for key in query.sort.iter().rev() {
        let (descending, name) = key.strip_prefix('-').map_or((false, key.as_str()), |k| (true, k));
        let field = fields.get(name).map_err(|e| e.key("--sort"))?;
        let mut keyed: Vec<(Cell, &RunResult)> = runs.iter().map(|r| (fields.cell(r, &field), *r)).collect();
        keyed.sort_by(|(a, _), (b, _)| compare(a, b, descending));
        runs = keyed.into_iter().map(|(_, r)| r).collect();
    }
    runs.truncate(query.limit.unwrap_or(usize::MAX));
    let mut table = fields.table(&columns);
    table.rows = runs.iter().map(|r| columns.iter().map(|(_, f)| fields.cell(r, f)).collect()).collect();
    Ok(table)
}

/// Numbers by size, text by letters; what is missing comes last either way.
pub(super) fn compare(a: &Cell, b: &Cell, descending: bool) -> Ordering {
    let number = |c: &Cell| match c {
        Cell::Number(x) | Cell::Interval(x, ..) => Some(*x),
        _ => None,
    };
    let order = match (a, b) {
        (Cell::Missing, Cell::Missing) => return Ordering::Equal,
        (Cell::Missing, _) => return Ordering::Greater,
        (_, Cell::Missing) => return Ordering::Less,
        _ => match (number(a), number(b)) {
            (Some(x), Some(y)) => x.total_cmp(&y),
            _ => a.show().cmp(&b.show()),
        },
    };
    if descending { order.reverse() } else { order }
}

/// How a table is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    #[value(alias = "text")]
    Table,
    Json,
    Csv,
    #[value(alias = "md")]
    Markdown,
    Latex,
}

pub fn print(table: &Table, format: Format) -> Result<String> {
    Ok(match format {
        Format::Table => table.terminal(),
        Format::Csv => table.csv(),
        Format::Markdown => table.markdown(),
        Format::Latex => table.latex(),
        Format::Json => {
            serde_json::to_string_pretty(&json(table)).map_err(|e| Error::new(format!("cannot write JSON: {e}")))?
                + "\n"
        }
    })
}

/// An array of objects; missing is null, an interval an object with `value`, `low`, `high`.
fn json(table: &Table) -> Value {
    let row = |cells: &Vec<Cell>| {
        let pairs = table.columns.iter().zip(cells).map(|(c, cell)| {
            let value = match cell {
                Cell::Text(t) | Cell::Named(t, _) => json!(t),
                Cell::Number(x) => json!(x),
                Cell::Interval(v, low, high) => json!({"value": v, "low": low, "high": high}),
                Cell::Status(_) => json!(cell.show()),
                Cell::Missing => Value::Null,
            };
            (c.name.clone(), value)
        });
        Value::Object(pairs.collect::<Map<_, _>>())
    };
    Value::Array(table.rows.iter().map(row).collect())
}
