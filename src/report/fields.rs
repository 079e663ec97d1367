//! Names by which results are filtered, sorted and shown: axes, parameters,
//! metrics, and what describes a run.

use super::filter::{Op, holds};
use super::metrics::{self, Metric};
use super::table::{Cell, Column, Table, column, interval, number};
use super::tables::class_word;
use crate::claim::{Selector, axis_value};
use crate::error::{Error, Result, did_you_mean};
use crate::record::cameras;
use crate::registry::{Spec, Value, format_sum};
use crate::results::{RunResult, StudyResults};
use std::collections::BTreeSet;

#[derive(Debug, Clone, PartialEq)]
pub enum Field {
    /// `scene`, `structure`, `culling`, ...
    Axis(String),
    /// A parameter, of one kind of part or of any.
    Param(Option<String>, String),
    /// A number by axis and parameter: `scene.offset_m`, `camera.fov_y_deg`.
    Number(String),
    Metric(&'static str),
    About(&'static str),
}

/// What describes a run beside axes and metrics.
const ABOUT: &[&str] =
    &["answer_id", "class", "combination", "machine_class", "measurement_id", "reason", "series", "status"];
const AXES: &[&str] = &["scene", "path", "structure", "culling", "walk", "arithmetic", "camera"];

/// All fields of a study.
#[derive(Debug, Clone, Default)]
pub struct Fields {
    axes: Vec<String>,
    params: BTreeSet<(String, String)>,
    numbers: BTreeSet<String>,
}

impl Fields {
    pub fn of(results: &StudyResults) -> Fields {
        let of_run = |run: &RunResult| {
            parts(run).flat_map(|part| part.params.keys().map(|p| (part.kind.clone(), p.clone()))).collect::<Vec<_>>()
        };
        Fields::from_parts(
            results.runs.iter().flat_map(|run| run.spec.axes.keys().cloned()),
            results.runs.iter().flat_map(of_run).collect(),
            results.runs.iter().flat_map(|run| run.spec.numbers().into_keys()).collect(),
        )
    }

    /// Of runs whose parts are known otherwise.
    pub fn from_parts(
        further_axes: impl IntoIterator<Item = String>,
        params: BTreeSet<(String, String)>,
        numbers: BTreeSet<String>,
    ) -> Fields {
        let mut axes: Vec<String> = AXES.iter().map(|a| a.to_string()).collect();
        for axis in further_axes {
            if !axes.contains(&axis) {
                axes.push(axis);
            }
        }
        Fields { axes, params, numbers }
    }

    pub fn find(&self, name: &str) -> Option<Field> {
        if self.axes.iter().any(|a| a == name) {
            return Some(Field::Axis(name.into()));
        }
        if let Some(about) = ABOUT.iter().find(|a| **a == name) {
            return Some(Field::About(about));
        }
        if let Some(metric) = metrics::find(name) {
            // A parameter of the same name is still reached with its part: `octree.depth`.
            let shadowed = self.params.iter().any(|(_, p)| p == name);
            return Some(if shadowed { Field::Param(None, name.into()) } else { Field::Metric(metric.name) });
        }
        match name.split_once('.') {
            Some(_) if self.numbers.contains(name) => Some(Field::Number(name.into())),
            Some((kind, param)) => self
                .params
                .contains(&(kind.to_string(), param.to_string()))
                .then(|| Field::Param(Some(kind.into()), param.into())),
            None => self.params.iter().any(|(_, p)| p == name).then(|| Field::Param(None, name.into())),
        }
    }

    /// # Errors
    /// With the nearest name there is.
    pub fn get(&self, name: &str) -> Result<Field> {
        self.find(name).ok_or_else(|| {
            let names = self.names();
            let near = did_you_mean(name, names.iter().map(String::as_str)).map(|n| format!("did you mean `{n}`?"));
            Error::new(format!("there is no field `{name}`"))
                .help(near.unwrap_or_else(|| format!("fields: {}", names.join(", "))))
        })
    }

    pub fn names(&self) -> Vec<String> {
        let mut names: BTreeSet<String> = self.axes.iter().cloned().collect();
        names.extend(ABOUT.iter().map(|a| a.to_string()));
        names.extend(metrics::METRICS.iter().map(|m| m.name.to_string()));
        names.extend(self.numbers.iter().cloned());
        names.extend(self.params.iter().flat_map(|(kind, p)| [p.clone(), format!("{kind}.{p}")]));
        names.into_iter().collect()
    }

    /// Whether `op` and `values` make sense for the field.
    ///
    /// # Errors
    /// For an order on text, or text where a number is needed.
    pub fn check(&self, field: &Field, op: Op, values: &[String]) -> Result<()> {
        let ordered = !matches!(op, Op::Equal | Op::Unequal | Op::In | Op::NotIn);
        let text = values.iter().find(|v| v.parse::<f64>().is_err());
        match field {
            Field::Axis(name) => {
                if ordered {
                    return Err(Error::new(format!("`{name}` has no order"))
                        .help(format!("write {name} = value or {name} in (a, b)")));
                }
                values.iter().try_for_each(|v| Selector::parse(v).map(|_| ()))
            }
            Field::About(name) if ordered && *name != "series" => {
                Err(Error::new(format!("`{name}` has no order")).help(format!("write {name} = value")))
            }
            Field::Metric(name) => match text {
                Some(v) => Err(Error::new(format!("`{name}` is a number, and `{v}` is none"))
                    .help(format!("write {name} < 12.5, in {}", unit_words(name)))),
                None => Ok(()),
            },
            Field::Param(_, name) if ordered => match text {
                Some(v) => Err(Error::new(format!("`{v}` is no number, so it has no order"))
                    .help(format!("compare `{name}` with a number, or use ="))),
                None => Ok(()),
            },
            Field::Number(name) => {
                match text {
                    Some(v) => Err(Error::new(format!("`{name}` is a number, and `{v}` is none"))
                        .help(format!("write {name} >= 10"))),
                    None => Ok(()),
                }
            }
            Field::About(_) | Field::Param(..) => Ok(()),
        }
    }

    pub fn test(&self, run: &RunResult, field: &Field, op: Op, values: &[String]) -> bool {
        match field {
            Field::Axis(name) => {
                let found = axis_value(&run.spec, name);
                let any = values.iter().any(|v| Selector::parse(v).is_ok_and(|s| s.matches(&found)));
                any == matches!(op, Op::Equal | Op::In)
            }
            // Several parts may have the parameter: `=` asks for any of them, `!=` for none.
            Field::Param(kind, name) => {
                let found: Vec<Value> = params(run, kind.as_deref(), name);
                let negative = matches!(op, Op::Unequal | Op::NotIn | Op::OutsideRange);
                let each = |v: &Value| holds(op, v, values);
                if negative { !found.is_empty() && found.iter().all(each) } else { found.iter().any(each) }
            }
            Field::Number(name) => run.spec.number(name).is_some_and(|x| holds(op, &Value::Float(x), values)),
            Field::Metric(name) => metric(name).value(run).is_some_and(|x| holds(op, &Value::Float(x), values)),
            Field::About(name) => {
                let found = about(run, name).map(|t| if *name == "series" { Value::parse(&t) } else { Value::Text(t) });
                found.is_some_and(|v| holds(op, &v, values))
            }
        }
    }

    pub fn column(&self, name: &str, field: &Field) -> Column {
        match field {
            Field::Metric(name) => {
                let m = metric(name);
                let c = column(m.name, m.unit, m.about);
                if has_interval(m) { c.with_interval() } else { c }
            }
            Field::Param(..) | Field::Number(_) => column(name, "", "parameter"),
            _ => Column::text(name),
        }
    }

    pub fn cell(&self, run: &RunResult, field: &Field) -> Cell {
        let text = |t: String| if t.is_empty() { Cell::Missing } else { Cell::Text(t) };
        match field {
            Field::Axis(name) => match name.as_str() {
                "structure" => text(run.structure.clone()),
                "culling" => text(run.culling.clone()),
                "walk" => text(run.walk.clone()),
                "camera" => text(cameras::label(&cameras::spec_of(&run.spec.camera))),
                _ => text(format_sum(&axis_value(&run.spec, name))),
            },
            Field::Param(kind, name) => match params(run, kind.as_deref(), name).first() {
                None => Cell::Missing,
                Some(Value::Int(i)) => Cell::Number(*i as f64),
                Some(Value::Float(x)) => Cell::Number(*x),
                Some(other) => Cell::Text(other.to_string()),
            },
            Field::Number(name) => number(run.spec.number(name)),
            Field::Metric(name) if has_interval(metric(name)) => interval(metric(name).interval(run)),
            Field::Metric(name) => number(metric(name).value(run)),
            Field::About("status") => Cell::Status(run.status),
            Field::About(name) => about(run, name).map_or(Cell::Missing, text),
        }
    }

    /// An empty table with the columns of these fields.
    pub fn table(&self, columns: &[(String, Field)]) -> Table {
        Table::new("query", "Results", 0, columns.iter().map(|(name, f)| self.column(name, f)).collect())
    }
}

fn metric(name: &str) -> &'static Metric {
    metrics::known(name)
}

pub(super) fn has_interval(m: &Metric) -> bool {
    use super::metrics::Kind::{Measured, Modelled};
    matches!(m.kind, Measured | Modelled) && !["noise", "mad_total_cull_ms"].contains(&m.name)
}

fn unit_words(name: &str) -> &'static str {
    let unit = metric(name).unit;
    if unit.is_empty() { "no unit" } else { unit }
}

fn parts(run: &RunResult) -> impl Iterator<Item = &Spec> {
    let s = &run.spec;
    [&s.structure, &s.walk].into_iter().chain(&s.culling).chain(s.axes.values())
}

fn params(run: &RunResult, kind: Option<&str>, name: &str) -> Vec<Value> {
    parts(run).filter(|p| kind.is_none_or(|k| p.kind == k)).filter_map(|p| p.params.get(name).cloned()).collect()
}

fn about(run: &RunResult, name: &str) -> Option<String> {
    match name {
        "status" => Some(run.status.word().into()),
        "class" => run.class.map(|c| class_word(c).into()),
        "combination" => Some(run.label()),
        "machine_class" => Some(run.machine_class.clone()),
        "measurement_id" => Some(run.measurement_id.clone()),
        "answer_id" => Some(run.answer_id.clone()),
        "series" => Some(run.spec.series.to_string()),
        "reason" => run.reason.clone(),
        _ => None,
    }
}
