//! Selections of cells in `[[exclude]]` and `[[claim]]`: one selector, a list
//! of them, or tables, by axis. Names and parameters are checked against the
//! registries, so that a misspelt rule is not a rule that matches nothing.

use super::axes::{Axis, axis, unknown_axis};
use super::scenes::{Names, unknown_name};
use super::source::Mistakes;
use super::tree::{Data, Key, Node, get};
use crate::claim::{Part, Selection, Selector};
use crate::error::{Error, did_you_mean};
use crate::registry::{Default, Spec, Value};

/// Reads the table `node` as a selection.
pub fn read(mistakes: &Mistakes, key: &str, node: &Node, names: &Names) -> Option<Selection> {
    let Some(table) = node.table() else {
        let e = Error::new(format!("must be a table of axes, not {}", node.noun()));
        mistakes.note(&node.place, key, e.help("write { structure = \"octree\", culling = \"frustum\" }"));
        return None;
    };
    if table.is_empty() {
        let e = Error::new("is empty, so it selects everything");
        mistakes.note(&node.place, key, e.help("name at least one axis, such as structure = \"octree\""));
        return None;
    }
    let mut selection = Selection::new();
    for (name, node) in table {
        read_axis(mistakes, key, name, node, names, &mut selection);
    }
    Some(selection)
}

/// Adds the selectors for one axis to `selection`; mistakes are noted.
pub fn read_axis(m: &Mistakes, parent: &str, name: &Key, node: &Node, names: &Names, selection: &mut Selection) {
    let key = format!("{parent}.{}", name.name);
    let axis = axis(&name.name);
    if axis.is_none() && names.of(&name.name).is_none() {
        m.note(&name.place, &key, unknown_axis(&name.name));
        return;
    }
    let items = node.array().unwrap_or(std::slice::from_ref(node));
    if items.is_empty() {
        let e = Error::new("is an empty list, so it selects nothing");
        m.note(&node.place, &key, e.help("name a value, or remove the key to leave the axis free"));
    }
    for item in items {
        let text = match &item.data {
            Data::Text(text) => text.clone(),
            Data::Table(_) => match from_table(m, &key, item) {
                Some(text) => text,
                None => continue,
            },
            _ => {
                let e = Error::new(format!("must be a selector, not {}", item.noun()));
                m.note(&item.place, &key, e.help("write \"octree\", \"octree:depth>=4\" or \"frustum+*\""));
                continue;
            }
        };
        let checked = Selector::parse(&text).and_then(|s| {
            let known = names.of(&name.name);
            s.parts().iter().try_for_each(|part| check(part, axis, &name.name, known)).map(|()| s)
        });
        match checked {
            Ok(_) => selection.entry(name.name.clone()).or_default().push(text),
            Err(mut e) => {
                e.key = None;
                m.note(&item.place, &key, e);
            }
        }
    }
}

/// The names and parameters of a pattern must exist somewhere.
fn check(part: &Part, axis: Option<&'static Axis>, what: &str, names: Option<&[String]>) -> Result<(), Error> {
    let Some(axis) = axis else {
        let known = names.unwrap_or_default();
        return match known.iter().any(|n| part.matches(&Spec::new(n))) {
            true => Ok(()),
            false => Err(unknown_name(what, &part.kind, known)),
        };
    };
    let parts = (axis.parts)();
    let bare = Part { kind: part.kind.clone(), conditions: Vec::new() };
    let fitting: Vec<_> = parts.iter().filter(|p| bare.matches(&Spec::new(p.name))).collect();
    if fitting.is_empty() {
        let names = parts.iter().map(|p| p.name);
        let mut e = Error::new(format!("unknown {} `{}`", axis.what, part.kind));
        e.help = Some(match did_you_mean(&part.kind, names.clone()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("known: {}", names.collect::<Vec<_>>().join(", ")),
        });
        return Err(e);
    }
    for condition in &part.conditions {
        let params: Vec<_> = fitting.iter().flat_map(|p| p.params).filter(|p| p.name == condition.key).collect();
        if params.is_empty() {
            let names: Vec<&str> = fitting.iter().flat_map(|p| p.params).map(|p| p.name).collect();
            let e = Error::new(format!("`{}` has no parameter `{}`", part.kind, condition.key));
            return Err(match did_you_mean(&condition.key, names.iter().copied()) {
                Some(near) => e.help(format!("did you mean `{near}`?")),
                None if names.is_empty() => e.help("it takes no parameters"),
                None => e.help(format!("it has: {}", names.join(", "))),
            });
        }
        for value in &condition.values {
            if let Some(help) = params.iter().find_map(|p| mismatch(&p.default, value)) {
                return Err(Error::new(format!("`{}` is never {value}", condition.key)).help(help));
            }
        }
    }
    Ok(())
}

/// Why a parameter cannot have `value`, as a help sentence.
fn mismatch(default: &Default, value: &Value) -> Option<String> {
    if default.is_later() && default.value() == *value {
        return Some(format!("{value} is the default, which parts do not name: leave the condition out"));
    }
    match (default.plain(), value) {
        (Default::Later(_) | Default::Only { .. }, _) => unreachable!("`plain` looks into it"),
        (Default::Int { min, max, .. }, Value::Int(i)) if (min..=max).contains(&i) => None,
        (Default::Int { min, max, .. }, _) => Some(format!("it is a whole number from {min} to {max}")),
        (Default::Float { .. }, Value::Int(_) | Value::Float(_)) => None,
        (Default::Float { min, max, .. }, _) => Some(format!("it is a number from {min} to {max}")),
        (Default::Bool(_), Value::Bool(_)) => None,
        (Default::Bool(_), _) => Some("it is true or false".into()),
        (Default::Choice(c) | Default::Axis(c), _) if c.contains(&value.to_string().as_str()) => None,
        (Default::Choice(c) | Default::Axis(c), _) => Some(format!("it is one of {}", c.join(", "))),
    }
}

/// `{ kind = "bsp", min_leaf = [50, 100] }` as a selector; a range is two bounds.
fn from_table(m: &Mistakes, key: &str, node: &Node) -> Option<String> {
    let table = node.table()?;
    let kind = get(table, "kind").map_or(Some("*"), Node::text);
    let Some(kind) = kind else {
        m.note(
            &node.place,
            key,
            Error::new("has no name under `kind`").help("write { kind = \"bsp\", min_leaf = 200 }"),
        );
        return None;
    };
    let mut conditions = Vec::new();
    for (name, value) in table.iter().filter(|(k, _)| k.name != "kind") {
        let path = format!("{key}.{}", name.name);
        let wrong = || {
            let e = Error::new(format!("is {}, which no parameter is compared with", value.noun()));
            m.note(&value.place, &path, e.help("give a value, a list of values, or { from = 50, to = 400 }"));
        };
        match &value.data {
            Data::Table(bounds) => {
                for (bound, node) in bounds {
                    let op = match bound.name.as_str() {
                        "from" => ">=",
                        "to" => "<=",
                        other => {
                            let e = Error::new(format!("unknown bound `{other}`"));
                            m.note(&bound.place, &format!("{path}.{other}"), e.help("use `from` and `to`"));
                            continue;
                        }
                    };
                    match scalar(node) {
                        Some(v) => conditions.push(format!("{}{op}{v}", name.name)),
                        None => wrong(),
                    }
                }
            }
            Data::Array(items) if !items.is_empty() => match items.iter().map(scalar).collect::<Option<Vec<_>>>() {
                Some(values) => conditions.push(format!("{}={}", name.name, values.join("|"))),
                None => wrong(),
            },
            _ => match scalar(value) {
                Some(v) => conditions.push(format!("{}={v}", name.name)),
                None => wrong(),
            },
        }
    }
    Some(if conditions.is_empty() { kind.to_string() } else { format!("{kind}:{}", conditions.join(",")) })
}

fn scalar(node: &Node) -> Option<String> {
    match &node.data {
        Data::Text(s) => Some(s.clone()),
        Data::Int(i) => Some(i.to_string()),
        Data::Float(x) => Some(format!("{x:?}")),
        Data::Bool(b) => Some(b.to_string()),
        _ => None,
    }
}
