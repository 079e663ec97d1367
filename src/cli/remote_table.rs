//! A page of runs, as a server sends it, as a table of ours.

use crate::report::table::{Cell, Column, Table, column};
use serde_json::Value;

/// The columns of a page, without rows.
pub fn of(page: &Value) -> Table {
    let word = |c: &Value, name: &str| c[name].as_str().unwrap_or_default().to_string();
    let one = |c: &Value| {
        let name = word(c, "name");
        match (c["numeric"] == true, c["interval"] == true) {
            (_, true) => column(&name, &word(c, "unit"), &word(c, "about")).with_interval(),
            (true, _) => column(&name, &word(c, "unit"), &word(c, "about")),
            _ => Column::text(&name),
        }
    };
    let columns = page["columns"].as_array().into_iter().flatten().map(one).collect();
    Table::new("query", "Results", 0, columns)
}

/// The rows of a page, up to `limit` in all.
pub fn append(table: &mut Table, page: &Value, limit: usize) {
    for run in page["items"].as_array().into_iter().flatten() {
        if table.rows.len() >= limit {
            return;
        }
        table.rows.push(table.columns.iter().map(|c| cell(&run["cells"][&c.name])).collect());
    }
}

fn cell(value: &Value) -> Cell {
    let number = |name: &str| value[name].as_f64().unwrap_or(f64::NAN);
    match value {
        Value::String(s) => Cell::Text(s.clone()),
        Value::Number(n) => Cell::Number(n.as_f64().unwrap_or(f64::NAN)),
        Value::Object(_) => Cell::Interval(number("value"), number("low"), number("high")),
        _ => Cell::Missing,
    }
}
