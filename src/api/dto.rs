//! Shapes that several answers share.

use crate::claim::Better;
use crate::report::metrics::{Kind, Metric};
use crate::report::table::Cell;
use crate::store::Overview;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::ToSchema;

/// A study at a glance.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
pub struct Summary {
    /// `name@series`
    #[serde(rename = "ref")]
    pub reference: String,
    pub name: String,
    pub series: u32,
    pub title: String,
    /// `active`, `paused` or `cancelled`
    pub state: String,
    pub priority: i64,
    pub machine_class: String,
    pub created: String,
    pub submitted: String,
    pub runs: Runs,
    pub excluded: u64,
    pub jobs: Jobs,
    pub finished: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Runs {
    pub total: u64,
    pub pending: u64,
    pub done: u64,
    pub failed: u64,
    pub wrong: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Jobs {
    pub trials: u64,
    pub judgements: u64,
    pub running: u64,
}

impl From<Overview> for Summary {
    fn from(o: Overview) -> Summary {
        let (r, j) = (o.runs, o.jobs);
        Summary {
            reference: o.reference,
            name: o.name,
            series: o.series,
            title: o.title,
            state: o.state.word().to_string(),
            priority: o.priority,
            machine_class: o.machine_class,
            created: o.created,
            submitted: o.submitted,
            runs: Runs { total: r.total, pending: r.pending, done: r.done, failed: r.failed, wrong: r.wrong },
            excluded: o.excluded,
            jobs: Jobs { trials: j.trials, judgements: j.judgements, running: j.running },
            finished: o.finished,
        }
    }
}

/// A number that a run has, by name.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct MetricInfo {
    pub name: String,
    pub unit: String,
    /// `measured`, `modelled`, `counted` or `judged`
    pub kind: String,
    /// Which of two values is the better one: `less`, `more` or `neither`
    pub better: String,
    pub about: String,
}

impl From<&Metric> for MetricInfo {
    fn from(m: &Metric) -> MetricInfo {
        let kind = match m.kind {
            Kind::Measured => "measured",
            Kind::Modelled => "modelled",
            Kind::Counted => "counted",
            Kind::Judged => "judged",
        };
        let better = match m.better {
            Better::Less => "less",
            Better::More => "more",
            Better::Neither => "neither",
        };
        MetricInfo {
            name: m.name.into(),
            unit: m.unit.into(),
            kind: kind.into(),
            better: better.into(),
            about: m.about.into(),
        }
    }
}

/// A value with the ends of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Spread {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

impl From<(f64, f64, f64)> for Spread {
    fn from((value, low, high): (f64, f64, f64)) -> Spread {
        Spread { value, low, high }
    }
}

/// Text, number, `null`, or `{value, low, high}`.
pub fn cell_json(cell: &Cell) -> Value {
    match cell {
        Cell::Text(t) | Cell::Named(t, _) => json!(t),
        Cell::Number(x) => json!(x),
        Cell::Interval(v, low, high) => json!({ "value": v, "low": low, "high": high }),
        Cell::Status(_) => json!(cell.show()),
        Cell::Missing => Value::Null,
    }
}
