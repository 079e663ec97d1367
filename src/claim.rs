//! Published statements as data, and selections of runs: what the manifest
//! writes and the report judges. Plain types, no I/O.

mod metrics;

pub use metrics::{Better, METRICS, Metric};

use crate::error::{Error, Result};
use crate::math::Arithmetic;
use crate::record::{RunSpec, cameras};
use crate::registry::{Spec, Value};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A published statement about a ratio of two selections of runs, or about the
/// metric of one.
///
/// In every group (see [`Claim::for_each`]) the ratio is
/// `metric(numerator) / metric(denominator)`, runs paired by all axes that
/// neither selection fixes; several pairs in a group join by geometric mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Claim {
    pub id: String,
    /// The statement, as the source makes it.
    pub text: String,
    /// Paper and figure.
    pub source: String,
    /// One of [`METRICS`].
    pub metric: String,
    pub numerator: Selection,
    /// Empty where the relation is about the metric itself ([`Relation::is_own`]).
    #[serde(default)]
    pub denominator: Selection,
    pub relation: Relation,
    /// What the source printed for the ratio, low and high (equal for one value).
    pub published: Option<[f64; 2]>,
    /// The same for single groups, by group name (`nucleus`).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub published_for: BTreeMap<String, [f64; 2]>,
    /// Relative slack around the published range: 0.25 widens it by a quarter on both sides.
    pub tolerance: f64,
    /// Axis whose values are the groups (`scene`, `culling`); `None` makes one group of all.
    pub for_each: Option<String>,
}

/// What is stated of the ratio.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Relation {
    /// Below 1 in every group.
    #[serde(rename = "<")]
    Less,
    /// Above 1 in every group.
    #[serde(rename = ">")]
    Greater,
    /// Inside the published range, widened by the tolerance, in every group that has one.
    #[serde(rename = "ratio")]
    Ratio,
    /// Groups are scenes: the ratio grows with the scene's triangle count (rank
    /// correlation above 0).
    #[serde(rename = "grows")]
    Grows,
    /// The metric itself is 0 in every run of the numerator.
    #[serde(rename = "zero")]
    Zero,
    /// The metric itself, its mean over the numerator's runs of a group, is inside the
    /// published range, widened by the tolerance.
    #[serde(rename = "value")]
    Value,
    /// Of all runs that the denominator selects in a group, one that the numerator selects
    /// too has the best value: least, or greatest where more is better. The ratio is that of
    /// the two best, of the numerator and of the rest, so turned that below 1 is better.
    #[serde(rename = "best")]
    Best,
}

impl Relation {
    /// Spelling in a manifest.
    pub const ALL: &[(&str, Relation)] = &[
        ("<", Relation::Less),
        (">", Relation::Greater),
        ("ratio", Relation::Ratio),
        ("grows", Relation::Grows),
        ("zero", Relation::Zero),
        ("value", Relation::Value),
        ("best", Relation::Best),
    ];

    /// About the metric of the numerator alone, not about a ratio.
    pub fn is_own(self) -> bool {
        matches!(self, Relation::Zero | Relation::Value)
    }

    pub fn as_str(self) -> &'static str {
        Self::ALL.iter().find(|(_, r)| *r == self).map_or("", |(s, _)| s)
    }
}

impl Claim {
    /// Published range of a group, before tolerance.
    pub fn published_of(&self, group: &str) -> Option<[f64; 2]> {
        self.published_for.get(group).copied().or(self.published)
    }
}

/// Axis name to selectors, any of which may match; axes not named are free.
pub type Selection = BTreeMap<String, Vec<String>>;

/// Whether `run` is selected: for every axis named, one of its selectors matches.
/// A selector that does not parse matches nothing (manifests check them first).
pub fn selects(selection: &Selection, run: &RunSpec) -> bool {
    selection.iter().all(|(axis, selectors)| {
        selectors.iter().any(|text| Selector::parse(text).is_ok_and(|s| s.matches(&axis_value(run, axis))))
    })
}

/// Parts that `run` has on `axis`; a scene or path is a part without parameters.
pub fn axis_value(run: &RunSpec, axis: &str) -> Vec<Spec> {
    match axis {
        "scene" => vec![Spec::new(&run.scene.name)],
        "path" => vec![Spec::new(&run.path.name)],
        "structure" => vec![run.structure.clone()],
        "culling" => run.culling.clone(),
        "walk" => vec![run.walk.clone()],
        // What is usual is not stored: the default arithmetic, the camera of the section.
        "arithmetic" => {
            vec![run.axes.get(axis).cloned().unwrap_or_else(|| Spec::new(Arithmetic::default().name()))]
        }
        "camera" => vec![run.axes.get(axis).cloned().unwrap_or_else(|| cameras::spec_of(&run.camera))],
        other => run.axes.get(other).cloned().into_iter().collect(),
    }
}

/// A pattern for one value of an axis: `octree`, `bsp:min_leaf>=100`,
/// `frustum+normal_mask`, `frustum+*`, `none`, `world_*`.
///
/// - Names may hold `*` for any characters; a part that is `*` alone also
///   stands for any number of further parts of a sum.
/// - A condition is `key OP value` with `=`, `!=`, `<`, `<=`, `>`, `>=`;
///   `=` takes alternatives: `depth=3|4`. Parameters not named are free.
/// - The order of the parts of a sum does not matter.
#[derive(Debug, Clone, PartialEq)]
pub struct Selector {
    parts: Vec<Part>,
    open: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    pub kind: String,
    pub conditions: Vec<Condition>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    pub key: String,
    pub op: &'static str,
    pub values: Vec<Value>,
}

/// Between the name of a swept scene or path and the value that tells it from the others.
pub const FAMILY: char = '@';

/// Longest first, so that `<=` is not read as `<`.
const OPERATORS: &[&str] = &["!=", "<=", ">=", "=", "<", ">"];

impl Selector {
    /// # Errors
    /// When a part has no name or a condition no key, operator or value.
    pub fn parse(text: &str) -> Result<Selector> {
        let mut selector = Selector { parts: Vec::new(), open: false };
        if text.trim() == "none" {
            return Ok(selector);
        }
        for part in text.split('+').map(str::trim) {
            if part == "*" {
                selector.open = true;
                continue;
            }
            let (kind, rest) = part.split_once(':').map_or((part, None), |(k, r)| (k.trim(), Some(r)));
            if kind.is_empty() {
                return Err(Error::new(format!("`{text}` has a part without a name"))
                    .help("write name, name:key=value or parts joined with +"));
            }
            let conditions = rest.into_iter().flat_map(|r| r.split(',')).map(Condition::parse);
            selector.parts.push(Part { kind: kind.to_string(), conditions: conditions.collect::<Result<_>>()? });
        }
        Ok(selector)
    }

    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Whether `value` (the parts of a sum, or one part) fits: every part of the
    /// pattern takes a part of its own.
    pub fn matches(&self, value: &[Spec]) -> bool {
        if value.len() < self.parts.len() || (!self.open && value.len() != self.parts.len()) {
            return false;
        }
        assign(&self.parts, value, &mut vec![false; value.len()])
    }
}

/// Tries every assignment: sums have a handful of parts.
fn assign(parts: &[Part], value: &[Spec], taken: &mut Vec<bool>) -> bool {
    let Some((part, rest)) = parts.split_first() else { return true };
    for i in 0..value.len() {
        if !taken[i] && part.matches(&value[i]) {
            taken[i] = true;
            if assign(rest, value, taken) {
                return true;
            }
            taken[i] = false;
        }
    }
    false
}

impl Part {
    pub fn matches(&self, spec: &Spec) -> bool {
        // The plain name of a family selects all its members: `hall` is `hall@offset_m=1e4` too.
        let family = spec.kind.split_once(FAMILY).map(|(family, _)| family);
        (wildcard(&self.kind, &spec.kind) || family.is_some_and(|f| wildcard(&self.kind, f)))
            && self.conditions.iter().all(|c| spec.params.get(&c.key).is_some_and(|v| c.holds(v)))
    }
}

impl Condition {
    fn parse(text: &str) -> Result<Condition> {
        let wrong = || {
            Error::new(format!("`{text}` is not a condition"))
                .help("write key=value, key=3|4, key!=value or key>=value")
        };
        let found = text.find(['=', '!', '<', '>']).ok_or_else(wrong)?;
        let op = *OPERATORS.iter().find(|op| text[found..].starts_with(**op)).ok_or_else(wrong)?;
        let (key, value) = (text[..found].trim(), text[found + op.len()..].trim());
        let values: Vec<Value> = value.split('|').map(|v| Value::parse(v.trim())).collect();
        let alternatives = values.len() > 1 && !matches!(op, "=" | "!=");
        if key.is_empty() || value.split('|').any(|v| v.trim().is_empty()) || alternatives {
            return Err(wrong());
        }
        Ok(Condition { key: key.to_string(), op, values })
    }

    /// Numbers compare as numbers (`8` equals `8.0`), everything else as text.
    pub fn holds(&self, value: &Value) -> bool {
        let order = |wanted: &Value| match (number(value), number(wanted)) {
            (Some(a), Some(b)) => a.partial_cmp(&b),
            _ => Some(value.to_string().cmp(&wanted.to_string())),
        };
        let equal = self.values.iter().any(|v| order(v).is_some_and(|o| o.is_eq()));
        let first = || order(&self.values[0]);
        match self.op {
            "=" => equal,
            "!=" => !equal,
            "<" => first().is_some_and(|o| o.is_lt()),
            "<=" => first().is_some_and(|o| o.is_le()),
            ">" => first().is_some_and(|o| o.is_gt()),
            _ => first().is_some_and(|o| o.is_ge()),
        }
    }
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Int(i) => Some(*i as f64),
        Value::Float(x) => Some(*x),
        _ => None,
    }
}

/// `*` stands for any characters, also none.
fn wildcard(pattern: &str, text: &str) -> bool {
    let mut pieces = pattern.split('*');
    let first = pieces.next().unwrap_or_default();
    let Some(mut rest) = text.strip_prefix(first) else { return false };
    let pieces: Vec<&str> = pieces.collect();
    let Some((last, middle)) = pieces.split_last() else { return rest.is_empty() };
    for piece in middle {
        match rest.find(piece) {
            Some(at) => rest = &rest[at + piece.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::parse_sum;

    fn fits(selector: &str, value: &str) -> bool {
        Selector::parse(selector).unwrap().matches(&parse_sum(value).unwrap())
    }

    #[test]
    fn selectors_fit_kinds_conditions_sums_and_wildcards() {
        for (selector, value, expected) in [
            ("octree", "octree:depth=4", true),
            ("octree:depth=3|4", "octree:depth=4", true),
            ("octree:depth!=3|4", "octree:depth=4", false),
            ("octree:depth>4", "octree:depth=4", false),
            ("octree:depth>=4,depth<5", "octree:depth=4", true),
            ("bsp:weight=8", "bsp:weight=8.0", true),
            ("octree:root=cube", "octree:root=aabb", false),
            ("octree:leaf=3", "octree:depth=4", false),
            ("normal_mask+frustum", "frustum+normal_mask", true),
            ("frustum", "frustum+normal_mask", false),
            ("frustum+*", "frustum+normal_mask", true),
            ("frustum+*", "frustum", true),
            ("frustum+*", "none", false),
            ("none", "none", true),
            ("none", "frustum", false),
            ("*", "none", true),
            ("*+*", "frustum+normal_mask", true),
            ("world_*", "world_1", true),
            ("w*l*_1", "world_1", true),
            ("w*l*_1", "world_12", false),
            ("*_mask:cells=4", "normal_mask:cells=4", true),
            // Each part takes a part of its own: `*_mask` must not take the only `normal_mask`.
            ("*_mask+normal_mask", "normal_mask+octant_mask", true),
            ("normal_mask+normal_mask", "normal_mask+octant_mask", false),
            ("hall", "hall@offset_m=1e4", true),
            ("h*l", "hall@offset_m=1e4", true),
            ("hall@*", "hall@offset_m=1e4", true),
            ("hall@offset_m=1e4", "hall@offset_m=1e4", true),
            ("hall@offset_m=1", "hall@offset_m=1e4", false),
            ("hal", "hall@offset_m=1e4", false),
        ] {
            assert_eq!(fits(selector, value), expected, "{selector} on {value}");
        }
    }

    #[test]
    fn a_condition_without_key_operator_or_value_is_an_error() {
        for text in ["octree:depth", "octree:=4", "octree:depth=", "octree:depth>3|4", "", "a++b", ":x=1", "a:b!c"] {
            assert!(Selector::parse(text).is_err(), "{text}");
        }
    }
}
