//! `[[sweep]]`: charts of a metric against a number that the runs differ in, checked
//! as far as names go. Whether the runs have such a number is known once the matrix is
//! expanded.

use super::axes::{axis_names, unknown_axis};
use super::claims::metric;
use super::fields::Fields;
use super::rules::Rule;
use super::source::Place;
use crate::error::Error;
use crate::sweep::Sweep;

/// A sweep and the places of what expansion checks.
#[derive(Debug, Clone)]
pub struct Drawn {
    pub sweep: Sweep,
    pub x: Place,
    pub of: Place,
}

pub fn read(top: &mut Fields) -> Vec<Rule<Drawn>> {
    let mut out: Vec<Rule<Drawn>> = Vec::new();
    let mut ids: Vec<String> = Vec::new();
    for mut f in top.tables("sweep") {
        let id = f.name("id", "name the chart's file, such as id = \"offset\"");
        if let Some(id) = &id {
            if ids.contains(id)
                && let Some(node) = f.get("id")
            {
                let e = Error::new(format!("`{id}` names two sweeps"));
                f.note(&node.place, "id", e.help(format!("rename one, such as \"{id}_2\"")));
            }
            ids.push(id.clone());
        }
        let (key, place) = (f.path.clone(), f.place.clone());
        if let Some(value) = sweep(f, id) {
            out.push(Rule { value, key, place });
        }
    }
    out
}

fn sweep(mut f: Fields, id: Option<String>) -> Option<Drawn> {
    let title = f.text("title").map(|t| t.trim().to_string()).filter(|t| !t.is_empty());
    let x = number(&mut f);
    let y = metric(&mut f, "y", "what is drawn, such as y = \"false_cull_ppm\"");
    let against = match f.has("against") {
        true => Some(metric(&mut f, "against", "what lies to the right, such as against = \"false_cull_ppm\"")),
        false => {
            f.known("against");
            None
        }
    };
    let by = by(&mut f);
    let x_unit = f.text("x_unit").map(str::to_string);
    let scales = [("log", true), ("linear", false)];
    let x_log = f.choice("x_scale", &scales).unwrap_or(true);
    let y_log = f.choice("y_scale", &scales).unwrap_or(true);
    let expected = expected(&mut f);
    let whole = f.place.clone();
    let place_of = |f: &mut Fields, name: &'static str| f.get(name).map_or(whole.clone(), |n| n.place.clone());
    let (at_x, at_expected) = (place_of(&mut f, "x"), place_of(&mut f, "expected"));
    f.finish();
    let (id, x, y, expected) = (id?, x?, y?, expected?);
    let against = match against {
        Some(metric) => Some(metric?),
        None => None,
    };
    let title = title.unwrap_or_else(|| format!("{y} against {}", against.as_ref().unwrap_or(&x)));
    let x_unit = x_unit.unwrap_or_else(|| unit(&x).to_string());
    let Expected { slope, of, why } = expected;
    let sweep = Sweep {
        id,
        title,
        x,
        x_unit,
        y,
        against,
        by: by?,
        x_log,
        y_log,
        expected_slope: slope,
        expected_for: of,
        expected_why: why,
    };
    Some(Drawn { sweep, x: at_x, of: at_expected })
}

/// `axis.parameter`, the axis a known one.
fn number(f: &mut Fields) -> Option<String> {
    let help = "what the runs differ in, axis and parameter: x = \"scene.offset_m\"";
    let text = f.sentence("x", help)?;
    let place = f.get("x")?.place.clone();
    match text.split_once('.') {
        Some((axis, param)) if !param.is_empty() => {
            if axis_names().any(|a| a == axis) {
                return Some(text);
            }
            f.note(&place, "x", unknown_axis(axis));
        }
        _ => f.note(&place, "x", Error::new(format!("`{text}` is no axis with a parameter")).help(help)),
    }
    None
}

fn by(f: &mut Fields) -> Option<String> {
    let Some(node) = f.get("by") else { return Some("arithmetic".to_string()) };
    let place = node.place.clone();
    let text = f.text("by")?;
    if axis_names().any(|a| a == text) {
        return Some(text.to_string());
    }
    f.note(&place, "by", unknown_axis(text));
    None
}

#[derive(Default)]
struct Expected {
    slope: Option<f64>,
    of: Option<String>,
    why: String,
}

/// The law drawn beside the lines: nothing where none is expected, `None` where it is wrong.
fn expected(f: &mut Fields) -> Option<Expected> {
    if !f.has("expected") {
        f.known("expected");
        return Some(Expected::default());
    }
    let mut e = f.table("expected")?;
    if !e.has("slope") {
        e.missing("slope", "the power of x that y grows with, such as slope = 1");
    }
    let slope = e.number("slope", "a power from -16 to 16", |x| (-16.0..=16.0).contains(&x));
    let of = e.sentence("of", "the line that it is expected of, such as of = \"f32_world\"");
    let why = e.sentence("why", "say why, with the source: the report prints it");
    e.finish();
    Some(Expected { slope: Some(slope?), of: Some(of?), why: why? })
}

/// What the name of a parameter ends in is its unit.
fn unit(x: &str) -> &'static str {
    let units = [("_m", "m"), ("_deg", "°"), ("_rad", "rad"), ("_px", "px"), ("_ns", "ns"), ("_ulps", "ulps")];
    units.iter().find(|(end, _)| x.ends_with(end)).map_or("", |(_, unit)| unit)
}
