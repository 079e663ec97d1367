//! Parameter values: single ones, lists, and ranges `{ from, to, steps, scale }`.

use super::fields::Fields;
use super::source::{Mistakes, Place};
use super::tree::{Data, Node};
use crate::error::Error;
use crate::registry::{Default, Param, Value};

/// Values of one parameter with the place of each. Wrong ones are noted.
pub fn read(mistakes: &Mistakes, key: &str, param: &Param, node: &Node) -> Vec<(Value, Place)> {
    match &node.data {
        Data::Array(items) if items.is_empty() => {
            let e = Error::new("is an empty list, so nothing would run");
            mistakes.note(&node.place, key, e.help("give a value, or remove the key for its default"));
            Vec::new()
        }
        Data::Array(items) => {
            let mut out: Vec<(Value, Place)> = Vec::new();
            for item in items {
                let values = match &item.data {
                    Data::Array(_) => {
                        mistakes.note(&item.place, key, Error::new("a list in a list").help("write one flat list"));
                        Vec::new()
                    }
                    _ => read(mistakes, key, param, item),
                };
                for (value, place) in values {
                    if !out.iter().any(|(v, _)| *v == value) {
                        out.push((value, place));
                    }
                }
            }
            out
        }
        Data::Table(table) => {
            let mut f = Fields::new(mistakes, key, &node.place, table);
            let values = range(&mut f, param);
            f.finish();
            values.into_iter().map(|v| (v, node.place.clone())).collect()
        }
        Data::Text(s) => vec![(Value::Text(s.clone()), node.place.clone())],
        Data::Int(i) => vec![(Value::Int(*i), node.place.clone())],
        Data::Float(x) => vec![(Value::Float(*x), node.place.clone())],
        Data::Bool(b) => vec![(Value::Bool(*b), node.place.clone())],
        Data::Datetime(_) => {
            mistakes.note(&node.place, key, Error::new("is a date").help("give a number, true, false or a string"));
            Vec::new()
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Scale {
    Linear,
    Log,
}

const MAX_STEPS: u32 = 10_000;

fn range(f: &mut Fields, param: &Param) -> Vec<Value> {
    let whole = match param.default.plain() {
        Default::Int { .. } => true,
        Default::Float { .. } => false,
        _ => {
            ["from", "to", "steps", "step", "scale"].into_iter().for_each(|name| f.known(name));
            let e = Error::new("takes no range: it is not a number");
            f.note(&f.place.clone(), "", e.help("give a list of values"));
            return Vec::new();
        }
    };
    for name in ["from", "to"] {
        if !f.has(name) {
            f.missing(name, "a range is { from = 50, to = 400, steps = 4 }, or step = 50 in place of steps");
        }
    }
    let from = f.number("from", "a number", f64::is_finite);
    let to = f.number("to", "a number", f64::is_finite);
    let steps = f.u32("steps", 1..=MAX_STEPS);
    let step = f.number("step", "a number above 0", |x| x > 0.0 && x.is_finite());
    let scale = f.choice("scale", &[("linear", Scale::Linear), ("log", Scale::Log)]).unwrap_or(Scale::Linear);
    let (Some(from), Some(to)) = (from, to) else { return Vec::new() };
    let place = f.place.clone();
    let values = match (f.has("steps"), f.has("step")) {
        (true, false) => steps.map(|n| spread(from, to, n, scale)),
        (false, true) => step.map(|s| stride(from, to, s)),
        _ => {
            let e = Error::new("needs either `steps` or `step`");
            f.note(&place, "", e.help("steps = how many values, both ends included; step = their distance"));
            None
        }
    };
    if scale == Scale::Log && (from <= 0.0 || to <= 0.0 || f.has("step")) {
        let e = Error::new("a logarithmic range needs `steps` and ends above 0");
        f.note(&place, "", e.help("raise `from`, or use scale = \"linear\""));
        return Vec::new();
    }
    let Some(values) = values else { return Vec::new() };
    if values.is_empty() || values.len() > MAX_STEPS as usize {
        let e = Error::new(format!("holds {} values", if values.is_empty() { "no" } else { "too many" }));
        f.note(&place, "", e.help("make `to` larger than `from` and `step` smaller than their distance"));
        return Vec::new();
    }
    let mut out: Vec<Value> = Vec::new();
    for x in values {
        let value = if whole { Value::Int(x.round() as i64) } else { Value::Float(x) };
        if !out.contains(&value) {
            out.push(value);
        }
    }
    out
}

/// `n` values with both ends, the ends exact. One step is `from` alone.
fn spread(from: f64, to: f64, n: u32, scale: Scale) -> Vec<f64> {
    let at = |i: u32| {
        if i == 0 {
            return from;
        }
        if i + 1 == n {
            return to;
        }
        let t = f64::from(i) / f64::from(n - 1);
        match scale {
            Scale::Linear => from + (to - from) * t,
            // `libm`, so that the same manifest is the same matrix everywhere.
            Scale::Log => libm::exp(libm::log(from) + (libm::log(to) - libm::log(from)) * t),
        }
    };
    (0..n).map(at).collect()
}

/// `from`, `from + step`, ... up to `to`, whose rounding is forgiven.
fn stride(from: f64, to: f64, step: f64) -> Vec<f64> {
    let count = ((to - from) / step + 1e-9).floor();
    if count.is_nan() || count < 0.0 {
        return Vec::new();
    }
    // One more than allowed is enough to be told.
    let count = count.min(f64::from(MAX_STEPS)) as u32;
    (0..=count).map(|i| from + f64::from(i) * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_both_ends_exactly() {
        let log: Vec<f64> = spread(50.0, 400.0, 4, Scale::Log).iter().map(|x| x.round()).collect();
        assert_eq!(log, [50.0, 100.0, 200.0, 400.0]);
        assert_eq!(spread(0.1, 0.7, 3, Scale::Linear), [0.1, 0.1 + (0.7 - 0.1) * 0.5, 0.7]);
        assert_eq!(spread(4.0, 9.0, 1, Scale::Linear), [4.0]);
        assert_eq!(spread(5.0, 2.0, 4, Scale::Linear), [5.0, 4.0, 3.0, 2.0]);
    }

    #[test]
    fn a_step_reaches_its_end_despite_rounding() {
        assert_eq!(stride(0.0, 0.3, 0.1).len(), 4);
        assert_eq!(stride(1.0, 10.0, 4.0), [1.0, 5.0, 9.0]);
        assert!(stride(2.0, 1.0, 1.0).is_empty());
    }
}
