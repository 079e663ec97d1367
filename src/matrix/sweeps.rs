//! Whether every `[[sweep]]` has something to draw: a number that its runs differ in,
//! and the line that a law is expected of.

use super::{distinct, labels};
use crate::error::{Error, did_you_mean};
use crate::manifest::Manifest;
use crate::manifest::source::Mistakes;
use crate::record::RunSpec;
use std::collections::BTreeSet;

pub fn check(manifest: &Manifest, runs: &[RunSpec], mistakes: &Mistakes) {
    for rule in &manifest.sweeps {
        let (drawn, key) = (&rule.value, |name: &str| format!("{}.{name}", rule.key));
        let sweep = &drawn.sweep;
        let mut values: Vec<f64> = runs.iter().filter_map(|r| r.number(&sweep.x)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        if values.is_empty() {
            mistakes.note(&drawn.x, &key("x"), unknown(&sweep.x, runs));
            continue;
        }
        let (axis, param) = sweep.x.split_once('.').unwrap_or((&sweep.x, ""));
        if values.len() == 1 {
            let e = Error::new(format!("`{}` is {} in every run: there is nothing to draw along", sweep.x, values[0]));
            mistakes.note(&drawn.x, &key("x"), e.help(format!("give `{param}` of the {axis} a list or a range")));
        } else if sweep.x_log && values.iter().filter(|x| **x > 0.0).count() < 2 {
            let e = Error::new(format!("`{}` has no two values above 0, which a logarithmic axis needs", sweep.x));
            mistakes.note(&drawn.x, &key("x"), e.help("add x_scale = \"linear\""));
        }
        let Some(of) = &sweep.expected_for else { continue };
        let lines: Vec<String> = runs.iter().map(|r| labels(r).of(&sweep.by)).collect();
        if !lines.contains(of) {
            let e = Error::new(format!("no line is `{of}`"));
            let help = match did_you_mean(of, lines.iter().map(String::as_str)) {
                Some(near) => format!("did you mean \"{near}\"?"),
                None => format!("values of `{}`: {}", sweep.by, distinct(&lines).join(", ")),
            };
            mistakes.note(&drawn.of, &key("expected.of"), e.help(help));
        }
    }
}

fn unknown(x: &str, runs: &[RunSpec]) -> Error {
    let names: BTreeSet<String> = runs.iter().flat_map(|r| r.numbers().into_keys()).collect();
    let e = Error::new(format!("no run has the number `{x}`"));
    if let Some(near) = did_you_mean(x, names.iter().map(String::as_str)) {
        return e.help(format!("did you mean \"{near}\"?"));
    }
    let axis = x.split('.').next().unwrap_or(x);
    let beside: Vec<&str> = names.iter().map(String::as_str).filter(|n| n.split('.').next() == Some(axis)).collect();
    e.help(match beside.is_empty() {
        true => format!("the {axis} of these runs has no numbers"),
        false => format!("numbers of the {axis}: {}", beside.join(", ")),
    })
}
