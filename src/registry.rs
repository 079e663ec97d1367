//! One grammar and one kind of table for everything a manifest can name:
//! `name[:key=value[,key=value]]`, parts joined with `+`.
//!
//! A registry entry declares its parameters as data, so that a typo, a wrong
//! type or a value out of range is found at expansion, before anything runs,
//! and so that a new structure or test needs no change of the manifest.

mod param;

pub use param::{Default, Param};

use crate::error::{Error, Result, did_you_mean};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// One parameter value. Serialised untagged: `4`, `0.5`, `true`, `"aabb"`.
#[derive(Debug, Clone, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Bool(b) => write!(f, "{b}"),
            Value::Int(i) => write!(f, "{i}"),
            // `{:?}` keeps the ".0", so that text and back gives the same type.
            Value::Float(x) => write!(f, "{x:?}"),
            Value::Text(s) => write!(f, "{s}"),
        }
    }
}

impl Value {
    /// The value of a bare word in the string grammar.
    pub fn parse(word: &str) -> Value {
        if let Ok(i) = word.parse::<i64>() {
            Value::Int(i)
        } else if let Ok(x) = word.parse::<f64>() {
            Value::Float(x)
        } else if let Ok(b) = word.parse::<bool>() {
            Value::Bool(b)
        } else {
            Value::Text(word.to_string())
        }
    }
}

pub type Params = BTreeMap<String, Value>;

/// A named part with parameters: `octree:depth=4`. After [`Spec::resolve`] every
/// parameter of the entry is present, so equal specs mean equal work.
#[derive(Debug, Clone, PartialEq, PartialOrd, Serialize, Deserialize)]
pub struct Spec {
    pub kind: String,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub params: Params,
}

impl Spec {
    pub fn new(kind: &str) -> Spec {
        Spec { kind: kind.to_string(), params: Params::new() }
    }

    pub fn with(mut self, key: &str, value: Value) -> Spec {
        self.params.insert(key.to_string(), value);
        self
    }

    /// Parses one part of the grammar (no `+`).
    pub fn parse(text: &str) -> Result<Spec> {
        let (kind, rest) = match text.split_once(':') {
            Some((kind, rest)) => (kind.trim(), Some(rest)),
            None => (text.trim(), None),
        };
        if kind.is_empty() {
            return Err(Error::new(format!("`{text}` names nothing")).help("write name[:key=value[,key=value]]"));
        }
        let mut spec = Spec::new(kind);
        for pair in rest.into_iter().flat_map(|r| r.split(',')) {
            let Some((key, value)) = pair.split_once('=') else {
                return Err(
                    Error::new(format!("`{pair}` in `{text}` is not key=value")).help("write name:key=value,key=value")
                );
            };
            let (key, value) = (key.trim(), value.trim());
            if key.is_empty() || value.is_empty() {
                return Err(Error::new(format!("`{pair}` in `{text}` lacks a key or a value"))
                    .help("write name:key=value,key=value"));
            }
            if spec.params.insert(key.to_string(), Value::parse(value)).is_some() {
                return Err(Error::new(format!("`{key}` is given twice in `{text}`")));
            }
        }
        Ok(spec)
    }

    /// Checks against `entry`, fills in defaults, converts whole floats and ints.
    pub fn resolve(&self, params: &'static [Param]) -> Result<Spec> {
        let mut out = Spec::new(&self.kind);
        for (key, value) in &self.params {
            let Some(param) = params.iter().find(|p| p.name == key) else {
                let names = params.iter().map(|p| p.name);
                let mut e = Error::new(format!("`{}` has no parameter `{key}`", self.kind)).key(key);
                e.help = Some(match did_you_mean(key, names.clone()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None if params.is_empty() => "it takes no parameters".to_string(),
                    None => format!("it has: {}", names.collect::<Vec<_>>().join(", ")),
                });
                return Err(e);
            };
            out.params.insert(key.clone(), param.check(value)?);
        }
        for param in params {
            if matches!(param.default.plain(), Default::Axis(_)) {
                continue;
            }
            if !param.default.is_later() {
                out.params.entry(param.name.to_string()).or_insert_with(|| param.default.value());
            } else if out.params.get(param.name) == Some(&param.default.value()) {
                out.params.remove(param.name);
            }
        }
        for param in params {
            param.is_asked_for(&out, params)?;
        }
        Ok(out)
    }

    /// # Panics
    /// If the spec was not resolved: every `get_*` is for constructors in a registry.
    pub fn int(&self, key: &str) -> i64 {
        match self.params.get(key) {
            Some(Value::Int(i)) => *i,
            other => panic!("unresolved spec: {}.{key} is {other:?}", self.kind),
        }
    }

    pub fn float(&self, key: &str) -> f64 {
        match self.params.get(key) {
            Some(Value::Float(x)) => *x,
            other => panic!("unresolved spec: {}.{key} is {other:?}", self.kind),
        }
    }

    pub fn bool(&self, key: &str) -> bool {
        match self.params.get(key) {
            Some(Value::Bool(b)) => *b,
            other => panic!("unresolved spec: {}.{key} is {other:?}", self.kind),
        }
    }

    pub fn text(&self, key: &str) -> &str {
        match self.params.get(key) {
            Some(Value::Text(s)) => s,
            other => panic!("unresolved spec: {}.{key} is {other:?}", self.kind),
        }
    }

    /// The spec without parameters that have their default: short labels for charts.
    pub fn label(&self, params: &'static [Param]) -> String {
        let mut short = Spec::new(&self.kind);
        for (key, value) in &self.params {
            let default = params.iter().find(|p| p.name == key).map(|p| p.default.value());
            if default.as_ref() != Some(value) {
                short.params.insert(key.clone(), value.clone());
            }
        }
        short.to_string()
    }
}

impl fmt::Display for Spec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.kind)?;
        for (i, (key, value)) in self.params.iter().enumerate() {
            write!(f, "{}{key}={value}", if i == 0 { ':' } else { ',' })?;
        }
        Ok(())
    }
}

/// Splits `a:x=1+b` into its parts; `none` and the empty string are no parts.
pub fn parse_sum(text: &str) -> Result<Vec<Spec>> {
    if text.trim() == "none" {
        return Ok(Vec::new());
    }
    // `+` also occurs in exponents (`1e+5`), where it follows an `e` after a digit.
    let bytes = text.as_bytes();
    let mut parts = Vec::new();
    let mut start = 0;
    for (i, b) in bytes.iter().enumerate() {
        let exponent =
            i >= 2 && matches!(bytes[i - 1], b'e' | b'E') && (bytes[i - 2].is_ascii_digit() || bytes[i - 2] == b'.');
        if *b == b'+' && !exponent {
            parts.push(Spec::parse(&text[start..i])?);
            start = i + 1;
        }
    }
    parts.push(Spec::parse(&text[start..])?);
    Ok(parts)
}

/// Joins parts back; the inverse of [`parse_sum`].
pub fn format_sum(parts: &[Spec]) -> String {
    if parts.is_empty() {
        return "none".to_string();
    }
    parts.iter().map(Spec::to_string).collect::<Vec<_>>().join("+")
}

/// One line of a registry: name, parameters and constructor of a `T`.
pub struct Entry<T: ?Sized> {
    pub name: &'static str,
    pub about: &'static str,
    /// Raised when the submitted sets change; part of `answer_id`.
    pub revision: u32,
    pub params: &'static [Param],
    /// Called by [`Entry::build`] alone, with every parameter present.
    pub make: fn(&Spec) -> Box<T>,
}

impl<T: ?Sized> Entry<T> {
    /// Makes what `resolved`, a resolved spec, says.
    pub fn build(&self, resolved: &Spec) -> Box<T> {
        let mut all = resolved.clone();
        for param in self.params.iter().filter(|p| p.default.is_later()) {
            all.params.entry(param.name.to_string()).or_insert_with(|| param.default.value());
        }
        (self.make)(&all)
    }
}

/// Finds and checks: unknown names come back with a suggestion.
pub fn find<'a, T: ?Sized>(what: &str, entries: &'a [Entry<T>], spec: &Spec) -> Result<(&'a Entry<T>, Spec)> {
    let Some(entry) = entries.iter().find(|e| e.name == spec.kind) else {
        let names = entries.iter().map(|e| e.name);
        let mut e = Error::new(format!("unknown {what} `{}`", spec.kind));
        e.help = Some(match did_you_mean(&spec.kind, names.clone()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("known: {}", names.collect::<Vec<_>>().join(", ")),
        });
        return Err(e);
    };
    let resolved = spec.resolve(entry.params)?;
    Ok((entry, resolved))
}

#[cfg(test)]
mod tests {
    use super::*;

    static PARAMS: &[Param] = &[
        Param { name: "depth", default: Default::Int { value: 4, min: 0, max: 10 }, about: "" },
        Param { name: "root", default: Default::Choice(&["aabb", "cube"]), about: "" },
        Param { name: "weight", default: Default::Float { value: 8.0, min: 0.0, max: 1e3 }, about: "" },
    ];

    #[test]
    fn the_grammar_reads_back_what_it_writes() {
        for text in ["octree:depth=4,root=cube", "list", "frustum+normal_mask:cells=4", "none", "bsp:weight=1e+2"] {
            let parts = parse_sum(text).unwrap();
            assert_eq!(parse_sum(&format_sum(&parts)).unwrap(), parts, "{text}");
        }
    }

    #[test]
    fn resolving_fills_defaults_and_names_what_is_wrong() {
        let s = Spec::parse("octree:depth=3,weight=2").unwrap().resolve(PARAMS).unwrap();
        assert_eq!(s.to_string(), "octree:depth=3,root=aabb,weight=2.0");
        assert_eq!(s.label(PARAMS), "octree:depth=3,weight=2.0");
        let e = Spec::parse("octree:dept=3").unwrap().resolve(PARAMS).unwrap_err();
        assert_eq!(e.help.as_deref(), Some("did you mean `depth`?"));
        let e = Spec::parse("octree:depth=11").unwrap().resolve(PARAMS).unwrap_err();
        assert!(e.to_string().contains("from 0 to 10"), "{e}");
        let e = Spec::parse("octree:root=cub").unwrap().resolve(PARAMS).unwrap_err();
        assert_eq!(e.help.as_deref(), Some("did you mean \"cube\"?"));
    }

    #[test]
    fn a_later_parameter_is_named_only_where_it_is_not_the_default() {
        static PARAMS: &[Param] = &[
            Param { name: "cells", default: Default::Int { value: 4, min: 1, max: 18 }, about: "" },
            Param { name: "rays", default: Default::Later(&Default::Choice(&["view", "node"])), about: "" },
        ];
        let resolved = |text: &str| Spec::parse(text).unwrap().resolve(PARAMS);
        for text in ["normal_mask", "normal_mask:rays=view"] {
            let spec = resolved(text).unwrap();
            assert_eq!(spec.to_string(), "normal_mask:cells=4");
        }
        let spec = resolved("normal_mask:rays=node").unwrap();
        assert_eq!(spec.to_string(), "normal_mask:cells=4,rays=node");
        assert_eq!((spec.label(PARAMS).as_str(), spec.text("rays")), ("normal_mask:rays=node", "node"));
        let e = resolved("normal_mask:rays=nodes").unwrap_err();
        assert_eq!(e.help.as_deref(), Some("did you mean \"node\"?"));
    }
}
