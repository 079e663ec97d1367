//! Entries of an axis: strings of the grammar, or tables that may hold lists and ranges.

use super::axes::{Axis, AxisValue, AxisValues, Part};
use super::fields::Fields;
use super::ranges;
use super::source::{Mistakes, Place};
use super::tree::{Data, Node, get};
use crate::error::{Error, Result, did_you_mean};
use crate::math::Camera;
use crate::record::cameras;
use crate::registry::{Param, Spec, Value, format_sum, parse_sum};
use std::collections::HashSet;

/// Expands the entries of one axis. Mistakes are noted; equal values are kept once.
pub fn read_values(
    mistakes: &Mistakes,
    key: &str,
    axis: &'static Axis,
    nodes: &[Node],
    section: &Camera,
) -> AxisValues {
    let mut out = AxisValues { axis: axis.name, values: Vec::new(), repeated: 0 };
    let mut seen = HashSet::new();
    for node in nodes {
        for mut value in read_entry(mistakes, key, axis, node) {
            if let Some(complete) = axis.complete {
                value.iter_mut().for_each(|spec| *spec = complete(spec, section));
                if let Err(e) = value.iter().try_for_each(|spec| cameras::camera_of(spec).map(|_| ())) {
                    mistakes.note(&node.place, key, e);
                    continue;
                }
            }
            if seen.insert(format_sum(&value)) {
                out.values.push(value);
            } else {
                out.repeated += 1;
            }
        }
    }
    out
}

fn read_entry(mistakes: &Mistakes, key: &str, axis: &'static Axis, node: &Node) -> Vec<AxisValue> {
    match &node.data {
        Data::Text(text) => match read_text(axis, text) {
            Ok(value) => vec![value],
            Err((word, e)) => {
                mistakes.note(&within(mistakes, node, word.as_deref()), key, e);
                Vec::new()
            }
        },
        Data::Table(table) if axis.sum && get(table, "sum").is_some() => {
            let mut f = Fields::new(mistakes, key, &node.place, table);
            let terms = f.one_or_more("sum").unwrap_or_default();
            let path = f.key("sum");
            f.finish();
            let terms: Vec<Vec<AxisValue>> = terms.iter().map(|n| read_entry(mistakes, &path, axis, n)).collect();
            let sums: Vec<AxisValue> = product(&terms).into_iter().map(|s| s.concat()).collect();
            if let Some(twice) = sums.iter().find_map(|s| repeated_part(s)) {
                mistakes.note(&node.place, key, twice_error(&twice));
                return Vec::new();
            }
            sums
        }
        Data::Table(_) => read_part(mistakes, key, axis, node).into_iter().map(|spec| vec![spec]).collect(),
        _ => {
            let e = Error::new(format!("must be a string or a table, not {}", node.noun()));
            let example = (axis.parts)().first().map_or("list", |p| p.name);
            mistakes.note(&node.place, key, e.help(format!("write \"{example}\" or {{ kind = \"{example}\" }}")));
            Vec::new()
        }
    }
}

/// A mistake in a string, and the word of it that is to blame.
pub type Blamed = (Option<String>, Error);

fn read_text(axis: &'static Axis, text: &str) -> std::result::Result<AxisValue, Blamed> {
    if let Some(bracket) = text.find(['[', '{']) {
        let e = Error::new("a string holds single values only");
        let kind = text.split(':').next().unwrap_or_default().trim();
        let e = e.help(format!("for lists and ranges write a table: {{ kind = \"{kind}\", ... = [3, 4] }}"));
        return Err((Some(text[bracket..=bracket].to_string()), e));
    }
    if axis.auto.is_some() && text.trim() == "auto" {
        return Ok(vec![Spec::new("auto")]);
    }
    let specs = if axis.sum { parse_sum(text) } else { Spec::parse(text).map(|s| vec![s]) };
    let known = (axis.parts)();
    let mut value = Vec::new();
    for spec in specs.map_err(|e| (None, grammar_help(e)))? {
        if axis.sum && spec.kind == "none" {
            let e = Error::new("`none` stands alone: it culls nothing");
            return Err((Some("none".into()), e.help("remove it from the sum")));
        }
        value.push(checked(&spec, &known, axis.check)?);
    }
    match repeated_part(&value) {
        Some(twice) => Err((Some(twice.clone()), twice_error(&twice))),
        None => Ok(value),
    }
}

/// One part in the string grammar, for generators.
pub fn read_single(check: fn(&Spec) -> Result<Spec>, known: &[Part], text: &str) -> std::result::Result<Spec, Blamed> {
    let spec = Spec::parse(text).map_err(|e| (None, grammar_help(e)))?;
    checked(&spec, known, check)
}

fn grammar_help(mut e: Error) -> Error {
    e.help.get_or_insert_with(|| "write name:key=value,key=value".into());
    e
}

fn checked(spec: &Spec, known: &[Part], check: fn(&Spec) -> Result<Spec>) -> std::result::Result<Spec, Blamed> {
    check(spec).map_err(|mut e| {
        let params = known.iter().find(|p| p.name == spec.kind).map_or(&[][..], |p| p.params);
        let Some(key) = e.key.take() else { return (Some(spec.kind.clone()), e) };
        let e = advise(e, params, &key);
        let message =
            if e.message.contains(&format!("`{key}`")) { e.message } else { format!("`{key}` {}", e.message) };
        (Some(key), Error { message, ..e })
    })
}

/// Every mistake says what to do: by default, what the parameter would be if left out.
fn advise(mut e: Error, params: &[Param], key: &str) -> Error {
    if let Some(param) = params.iter().find(|p| p.name == key) {
        e.help.get_or_insert_with(|| format!("correct it, or leave it out for the default, {}", param.default.value()));
    }
    e
}

fn repeated_part(value: &[Spec]) -> Option<String> {
    let twice = |i: usize| value[..i].iter().any(|s| s.kind == value[i].kind);
    (0..value.len()).find(|i| twice(*i)).map(|i| value[i].kind.clone())
}

fn twice_error(kind: &str) -> Error {
    Error::new(format!("`{kind}` occurs twice in a sum")).help("name each part of a sum once")
}

/// The place of `word` in the string `node`, else of the whole string.
pub fn within(mistakes: &Mistakes, node: &Node, word: Option<&str>) -> Place {
    let raw = mistakes.sources.text(&node.place);
    match word.and_then(|w| raw.find(w).map(|at| (at, w.len()))) {
        Some((at, len)) => {
            let start = node.place.span.start + at;
            Place { source: node.place.source, span: start..start + len }
        }
        None => node.place.clone(),
    }
}

/// Every spec that the table `{ kind = ..., parameter = value | list | range }` means.
pub fn read_part(mistakes: &Mistakes, key: &str, axis: &'static Axis, node: &Node) -> Vec<Spec> {
    let known = (axis.parts)();
    let Some((kind, part)) = read_kind(mistakes, key, axis.what, &known, node) else { return Vec::new() };
    expand_part(mistakes, key, node, &kind, part.params, axis.check)
}

pub fn read_kind<'p>(
    m: &Mistakes,
    key: &str,
    what: &str,
    known: &'p [Part],
    node: &Node,
) -> Option<(String, &'p Part)> {
    let table = node.table()?;
    let names = known.iter().map(|p| p.name);
    let Some(kind) = get(table, "kind") else {
        let e = Error::new("has no `kind`");
        let help = format!("name the {what}: kind = \"{}\"", known.first().map_or("...", |p| p.name));
        m.note(&node.place, key, e.help(help));
        return None;
    };
    let Some(text) = kind.text() else {
        m.note(&kind.place, &format!("{key}.kind"), Error::new(format!("must be a name, not {}", kind.noun())));
        return None;
    };
    let Some(part) = known.iter().find(|p| p.name == text) else {
        let mut e = Error::new(format!("unknown {what} `{text}`"));
        e.help = Some(match did_you_mean(text, names.clone()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("known: {}", names.collect::<Vec<_>>().join(", ")),
        });
        m.note(&kind.place, &format!("{key}.kind"), e);
        return None;
    };
    Some((text.to_string(), part))
}

/// The product over the parameters of the table `node`, each checked at its own place.
pub fn expand_part(
    mistakes: &Mistakes,
    key: &str,
    node: &Node,
    kind: &str,
    params: &'static [Param],
    check: impl Fn(&Spec) -> Result<Spec>,
) -> Vec<Spec> {
    let before = mistakes.count();
    let mut lists: Vec<Vec<(String, Value)>> = Vec::new();
    for (name, value) in node.table().into_iter().flatten().filter(|(k, _)| k.name != "kind") {
        let path = format!("{key}.{}", name.name);
        let param = params.iter().find(|p| p.name == name.name);
        // An unknown parameter is the key's fault, a wrong value the value's.
        let values = match param {
            Some(param) => ranges::read(mistakes, &path, param, value),
            None => vec![(Value::Int(0), name.place.clone())],
        };
        let mut list = Vec::new();
        let mut wrong: Option<Place> = None;
        for (v, place) in values {
            // All values of a range stand at one place: its first mistake is enough.
            if wrong.as_ref() == Some(&place) {
                continue;
            }
            // Alone, that is where it has an effect: what stands beside it is checked below.
            let conditions = param.map_or_else(Vec::new, |p| p.default.conditions());
            let alone =
                conditions.into_iter().fold(Spec::new(kind), |s, (with, is)| s.with(with, Value::Text(is[0].into())));
            match check(&alone.with(&name.name, v.clone())) {
                Ok(_) => list.push((name.name.clone(), v)),
                Err(mut e) => {
                    e.key = None;
                    mistakes.note(&place, &path, advise(e, params, &name.name));
                    wrong = Some(place);
                }
            }
        }
        lists.push(list);
    }
    if mistakes.count() > before {
        return Vec::new();
    }
    let cells = lists.iter().try_fold(1usize, |n, l| n.checked_mul(l.len()));
    if cells.is_none_or(|n| n > MAX_VALUES) {
        let e = Error::new(format!("`{kind}` expands to more than {MAX_VALUES} variants"));
        mistakes.note(&node.place, key, e.help("shorten its lists and ranges"));
        return Vec::new();
    }
    // Each parameter is right alone: what is left are those that do not go together.
    let mut told = HashSet::new();
    let mut specs = Vec::new();
    for params in product(&lists) {
        let spec = params.into_iter().fold(Spec::new(kind), |s, (k, v)| s.with(&k, v));
        match check(&spec) {
            Ok(spec) => specs.push(spec),
            Err(e) if told.insert(e.message.clone()) => note_together(mistakes, key, node, e),
            Err(_) => {}
        }
    }
    specs
}

/// A mistake of several parameters, at the value of the one that is to blame.
fn note_together(mistakes: &Mistakes, key: &str, node: &Node, mut e: Error) {
    let blamed = e.key.take();
    let entry = node.table().into_iter().flatten().find(|(name, _)| Some(&name.name) == blamed.as_ref());
    match entry {
        Some((name, value)) => mistakes.note(&value.place, &format!("{key}.{}", name.name), e),
        None => mistakes.note(&node.place, key, e),
    }
}

/// Variants of one table: more is a slip of the pen.
const MAX_VALUES: usize = 100_000;

/// Cartesian product, the last list fastest.
fn product<T: Clone>(lists: &[Vec<T>]) -> Vec<Vec<T>> {
    lists.iter().fold(vec![Vec::new()], |rows, list| {
        rows.iter()
            .flat_map(|row| {
                list.iter().map(move |item| {
                    let mut row = row.clone();
                    row.push(item.clone());
                    row
                })
            })
            .collect()
    })
}
