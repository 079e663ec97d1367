//! Filters, sorts and pages over [`Columns`]: each word of a filter is compared once a
//! distinct value and not once a run.

use super::columns::{Coded, Columns};
use super::fields::{Field, Fields, has_interval};
use super::filter::{Filter, Op, holds};
use super::metrics::{METRICS, Metric};
use super::query::compare;
use super::table::Cell;
use super::tables::class_word;
use crate::claim::Selector;
use crate::error::{Error, Result};
use crate::registry::{Spec, Value, format_sum};
use serde_json::{Value as Json, json};
use std::cmp::Ordering;

fn index(name: &str) -> usize {
    METRICS.binary_search_by(|m: &Metric| m.name.cmp(name)).expect("fields name known metrics")
}

/// Which rows pass.
pub fn mask(columns: &Columns, filter: Option<&Filter>) -> Vec<bool> {
    match filter {
        None => vec![true; columns.len()],
        Some(Filter::Any(parts)) => join(columns, parts, false),
        Some(Filter::All(parts)) => join(columns, parts, true),
        Some(Filter::Not(inner)) => mask(columns, Some(inner)).into_iter().map(|b| !b).collect(),
        Some(Filter::Test { field, op, values }) => test(columns, field, *op, values),
    }
}

fn join(columns: &Columns, parts: &[Filter], all: bool) -> Vec<bool> {
    let mut out = vec![all; columns.len()];
    for part in parts {
        let passed = mask(columns, Some(part));
        out.iter_mut().zip(passed).for_each(|(o, p)| *o = if all { *o && p } else { *o || p });
    }
    out
}

/// Asks once a distinct value.
fn by_code<T>(column: &Coded<T>, ask: impl Fn(&T) -> bool) -> Vec<bool> {
    let answers: Vec<bool> = column.values.iter().map(ask).collect();
    column.codes.iter().map(|c| answers[*c as usize]).collect()
}

/// Of values of which there are few: asks each kind once.
fn by_few<T: PartialEq>(values: &[T], ask: impl Fn(&T) -> bool) -> Vec<bool> {
    let mut known: Vec<(&T, bool)> = Vec::new();
    let answer = |value| match known.iter().find(|(k, _)| *k == value) {
        Some((_, answer)) => *answer,
        None => {
            known.push((value, ask(value)));
            known[known.len() - 1].1
        }
    };
    values.iter().map(answer).collect()
}

/// Numbers of which each may be another; NaN is none.
fn of_numbers(found: &[f64], op: Op, values: &[String]) -> Vec<bool> {
    let parsed = |v: &String| v.parse::<f64>().ok().filter(|x| !x.is_nan());
    let Some(wanted) = values.iter().map(parsed).collect::<Option<Vec<f64>>>() else {
        return found.iter().map(|x| !x.is_nan() && holds(op, &Value::Float(*x), values)).collect();
    };
    let all = |ask: &dyn Fn(f64) -> bool| found.iter().map(|x| !x.is_nan() && ask(*x)).collect();
    match (op, &wanted[..]) {
        (Op::Equal | Op::In, w) => all(&|x| w.contains(&x)),
        (Op::Unequal | Op::NotIn, w) => all(&|x| !w.contains(&x)),
        (Op::Less, [w, ..]) => all(&|x| x < *w),
        (Op::LessEqual, [w, ..]) => all(&|x| x <= *w),
        (Op::Greater, [w, ..]) => all(&|x| x > *w),
        (Op::GreaterEqual, [w, ..]) => all(&|x| x >= *w),
        (Op::Range, [low, high, ..]) => all(&|x| (*low..=*high).contains(&x)),
        (Op::OutsideRange, [low, high, ..]) => all(&|x| !(*low..=*high).contains(&x)),
        // The grammar gives every other sign its values.
        _ => vec![false; found.len()],
    }
}

fn test(columns: &Columns, field: &Field, op: Op, values: &[String]) -> Vec<bool> {
    let rows = 0..columns.len();
    let text = |t: &str| holds(op, &Value::Text(t.to_string()), values);
    match field {
        Field::Axis(name) => {
            let selectors: Vec<Selector> = values.iter().filter_map(|v| Selector::parse(v).ok()).collect();
            let wanted = matches!(op, Op::Equal | Op::In);
            let ask = |found: &Vec<Spec>| selectors.iter().any(|s| s.matches(found)) == wanted;
            match columns.axes.get(name) {
                Some(column) => by_code(column, ask),
                None => vec![ask(&Vec::new()); columns.len()],
            }
        }
        Field::Param(kind, name) => by_param(columns, kind.as_deref(), name, op, values),
        Field::Number(name) => match columns.numbers.get(name) {
            Some(column) => by_code(column, |x| !x.is_nan() && holds(op, &Value::Float(*x), values)),
            None => vec![false; columns.len()],
        },
        Field::Metric(name) => match columns.metrics.get(&index(name)) {
            Some(numbers) => {
                let mut passed = of_numbers(&numbers.value, op, values);
                passed.resize(columns.len(), false);
                passed
            }
            None => vec![false; columns.len()],
        },
        Field::About("status") => by_few(&columns.status, |s| text(s.word())),
        Field::About("class") => by_few(&columns.class, |c| c.is_some_and(|c| text(class_word(c)))),
        Field::About("machine_class") => by_code(&columns.machine, |m| text(m)),
        Field::About("combination") => by_code(&columns.label, |l| text(l)),
        Field::About("reason") => by_code(&columns.reason, |r| r.as_ref().is_some_and(|r| text(r))),
        Field::About("series") => {
            columns.series.iter().map(|s| holds(op, &Value::Int(i64::from(*s)), values)).collect()
        }
        Field::About(name) => rows.map(|row| about_id(columns, name, row).is_some_and(|id| text(&id))).collect(),
    }
}

fn about_id(columns: &Columns, name: &str, row: usize) -> Option<String> {
    match name {
        "measurement_id" => Some(columns.id(row)),
        "answer_id" => Some(columns.answer(row)),
        _ => None,
    }
}

/// Several parts may have the parameter: `=` asks for any of them, `!=` for none.
fn by_param(columns: &Columns, kind: Option<&str>, name: &str, op: Op, values: &[String]) -> Vec<bool> {
    let negative = matches!(op, Op::Unequal | Op::NotIn | Op::OutsideRange);
    // Of each distinct value: whether it has the parameter, some hold, all hold.
    let ask = |specs: &Vec<Spec>| {
        let found = specs.iter().filter(|p| kind.is_none_or(|k| p.kind == k)).filter_map(|p| p.params.get(name));
        found.fold((false, false, true), |(_, any, all), v| {
            let held = holds(op, v, values);
            (true, any || held, all && held)
        })
    };
    let mut out = vec![(false, false, true); columns.len()];
    let axes = ["structure", "walk", "culling"].iter().filter_map(|a| columns.axes.get(*a));
    for column in axes.chain([&columns.stated]) {
        let answers: Vec<_> = column.values.iter().map(ask).collect();
        for (o, code) in out.iter_mut().zip(&column.codes) {
            let (has, any, all) = answers[*code as usize];
            *o = (o.0 || has, o.1 || any, o.2 && all);
        }
    }
    out.into_iter().map(|(has, any, all)| if negative { has && all } else { any }).collect()
}

/// What a table shows of a run.
pub fn cell(columns: &Columns, row: usize, field: &Field) -> Cell {
    let text = |t: String| if t.is_empty() { Cell::Missing } else { Cell::Text(t) };
    match field {
        Field::Axis(name) => match columns.labels.get(name.as_str()) {
            Some(labels) => text(labels.get(row).clone()),
            None => columns.axes.get(name).map_or(Cell::Missing, |c| text(format_sum(c.get(row)))),
        },
        Field::Param(kind, name) => {
            let axes = ["structure", "walk", "culling"].iter().filter_map(|a| columns.axes.get(*a));
            let mut parts = axes.chain([&columns.stated]).flat_map(|c| c.get(row));
            let found =
                parts.find_map(|p| kind.as_ref().is_none_or(|k| p.kind == *k).then(|| p.params.get(name)).flatten());
            match found {
                None => Cell::Missing,
                Some(Value::Int(i)) => Cell::Number(*i as f64),
                Some(Value::Float(x)) => Cell::Number(*x),
                Some(other) => Cell::Text(other.to_string()),
            }
        }
        Field::Number(name) => match columns.numbers.get(name).map(|c| *c.get(row)) {
            Some(x) if !x.is_nan() => Cell::Number(x),
            _ => Cell::Missing,
        },
        Field::Metric(name) => {
            let i = index(name);
            match columns.metric(i, row) {
                None => Cell::Missing,
                Some((v, Some((low, high)))) if has_interval(&METRICS[i]) => Cell::Interval(v, low, high),
                Some((v, _)) => Cell::Number(v),
            }
        }
        Field::About("status") => Cell::Status(columns.status[row]),
        Field::About("class") => columns.class[row].map_or(Cell::Missing, |c| Cell::Text(class_word(c).into())),
        Field::About("machine_class") => text(columns.machine.get(row).clone()),
        Field::About("combination") => text(columns.label.get(row).clone()),
        Field::About("reason") => columns.reason.get(row).clone().map_or(Cell::Missing, text),
        Field::About("series") => Cell::Text(columns.series[row].to_string()),
        Field::About(name) => about_id(columns, name, row).map_or(Cell::Missing, text),
    }
}

/// Rows by one key, ready to be compared.
enum Keys {
    Numbers(Vec<f64>),
    /// Place of the row's word among all words.
    Ranks(Vec<u32>, Vec<String>),
    Cells(Vec<Cell>),
}

struct Key {
    keys: Keys,
    descending: bool,
}

fn key(columns: &Columns, field: &Field, descending: bool) -> Key {
    let ranks = |values: &[String], codes: &[u32]| {
        let mut words = values.to_vec();
        words.sort();
        words.dedup();
        let rank: Vec<u32> = values.iter().map(|w| words.binary_search(w).expect("one of them") as u32).collect();
        Keys::Ranks(codes.iter().map(|c| rank[*c as usize]).collect(), words)
    };
    let cells = || Keys::Cells((0..columns.len()).map(|r| cell(columns, r, field)).collect());
    let keys = match field {
        Field::Axis(name) => match (columns.labels.get(name.as_str()), columns.axes.get(name)) {
            (Some(labels), _) => ranks(&labels.values, &labels.codes),
            (None, Some(column)) => {
                let words: Vec<String> = column.values.iter().map(|v| format_sum(v)).collect();
                // A run without a value comes last, either way round.
                if words.iter().any(String::is_empty) { cells() } else { ranks(&words, &column.codes) }
            }
            (None, None) => cells(),
        },
        Field::About("combination") => ranks(&columns.label.values, &columns.label.codes),
        Field::Metric(name) => match columns.metrics.get(&index(name)) {
            Some(n) => Keys::Numbers((0..columns.len()).map(|r| n.value.get(r).copied().unwrap_or(f64::NAN)).collect()),
            None => Keys::Numbers(vec![f64::NAN; columns.len()]),
        },
        Field::Number(name) if columns.numbers.contains_key(name) => {
            let c = &columns.numbers[name];
            Keys::Numbers((0..columns.len()).map(|r| *c.get(r)).collect())
        }
        _ => cells(),
    };
    Key { keys, descending }
}

/// Missing comes last either way; NaN is missing.
fn number_order(a: f64, b: f64, descending: bool) -> Ordering {
    match (a.is_nan(), b.is_nan()) {
        (true, true) => Ordering::Equal,
        (true, false) => Ordering::Greater,
        (false, true) => Ordering::Less,
        _ if descending => b.total_cmp(&a),
        _ => a.total_cmp(&b),
    }
}

impl Key {
    fn order(&self, a: usize, b: usize) -> Ordering {
        match &self.keys {
            Keys::Numbers(x) => number_order(x[a], x[b], self.descending),
            Keys::Ranks(r, _) if self.descending => r[b].cmp(&r[a]),
            Keys::Ranks(r, _) => r[a].cmp(&r[b]),
            Keys::Cells(c) => compare(&c[a], &c[b], self.descending),
        }
    }

    /// Where a row stands to what a cursor remembers.
    fn order_to(&self, row: usize, mark: &Json) -> Ordering {
        match &self.keys {
            Keys::Numbers(x) => number_order(x[row], mark.as_f64().unwrap_or(f64::NAN), self.descending),
            Keys::Ranks(r, words) => {
                let order = words[r[row] as usize].as_str().cmp(mark.as_str().unwrap_or_default());
                if self.descending { order.reverse() } else { order }
            }
            Keys::Cells(c) => {
                let mark = match mark {
                    Json::Number(n) => Cell::Number(n.as_f64().unwrap_or(f64::NAN)),
                    Json::String(s) => Cell::Text(s.clone()),
                    _ => Cell::Missing,
                };
                compare(&c[row], &mark, self.descending)
            }
        }
    }

    fn mark(&self, row: usize) -> Json {
        match &self.keys {
            Keys::Numbers(x) if x[row].is_nan() => Json::Null,
            Keys::Numbers(x) => json!(x[row]),
            Keys::Ranks(r, words) => json!(words[r[row] as usize]),
            Keys::Cells(c) => match &c[row] {
                Cell::Number(x) | Cell::Interval(x, ..) => json!(x),
                Cell::Missing => Json::Null,
                other => json!(other.show()),
            },
        }
    }
}

/// A page of rows in order.
pub struct Page {
    pub rows: Vec<usize>,
    /// How many pass the filter in all.
    pub total: usize,
    /// What the next page starts after: values of the sort keys, then the ordinal.
    pub next: Option<Json>,
}

/// The first `limit` rows that pass, by the sort keys and then the order of the matrix,
/// after the row that `after` remembers. Rows may change between pages: no row that
/// stays is skipped or shown twice.
///
/// # Errors
/// For names that are no fields, and marks that are not of this sort.
pub fn page(
    columns: &Columns,
    fields: &Fields,
    filter: Option<&Filter>,
    sort: &[String],
    after: Option<&Json>,
    limit: usize,
) -> Result<Page> {
    let keys = sort
        .iter()
        .map(|name| {
            let (descending, name) = name.strip_prefix('-').map_or((false, name.as_str()), |n| (true, n));
            Ok(key(columns, &fields.get(name).map_err(|e| e.key("sort"))?, descending))
        })
        .collect::<Result<Vec<Key>>>()?;
    let passed = mask(columns, filter);
    let total = passed.iter().filter(|p| **p).count();
    let mut rows: Vec<usize> = (0..columns.len()).filter(|r| passed[*r]).collect();
    if let Some(after) = after {
        let marks = after.as_array().filter(|m| m.len() == keys.len() + 1 && m[keys.len()].is_u64());
        let marks = marks.ok_or_else(|| {
            Error::new("is not a cursor of this sort")
                .key("cursor")
                .help("use `next` of the page before, with its sort")
        })?;
        let ordinal = marks[keys.len()].as_u64().unwrap_or(0);
        rows.retain(|row| {
            let order = keys.iter().zip(marks).map(|(k, m)| k.order_to(*row, m)).find(|o| o.is_ne());
            order.unwrap_or(u64::from(columns.ordinals[*row]).cmp(&ordinal)).is_gt()
        });
    }
    let order = |a: &usize, b: &usize| keys.iter().map(|k| k.order(*a, *b)).find(|o| o.is_ne()).unwrap_or(a.cmp(b));
    let more = rows.len() > limit;
    if more {
        // Only the page is put in order.
        rows.select_nth_unstable_by(limit, order);
        rows.truncate(limit);
    }
    rows.sort_unstable_by(order);
    let next = rows.last().filter(|_| more).map(|row| {
        let marks = keys.iter().map(|k| k.mark(*row)).chain([json!(columns.ordinals[*row])]);
        Json::Array(marks.collect())
    });
    Ok(Page { rows, total, next })
}
