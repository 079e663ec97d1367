//! `[[claim]]`: published statements, checked as far as names go.

use super::axes::{axis, axis_names, unknown_axis};
use super::fields::Fields;
use super::rules::Rule;
use super::scenes::{Names, unknown_name};
use super::selections;
use super::tree::{Data, Node};
use crate::claim::{Better, Claim, METRICS, Relation, Selection};
use crate::error::{Error, did_you_mean};
use std::collections::BTreeMap;

pub fn read(top: &mut Fields, names: &Names) -> Vec<Rule<Claim>> {
    let mut out: Vec<Rule<Claim>> = Vec::new();
    let mut ids: Vec<String> = Vec::new();
    for mut f in top.tables("claim") {
        let id = f.name("id", "give it an id, such as id = \"A4.3\"");
        if let Some(id) = &id {
            if ids.contains(id)
                && let Some(node) = f.get("id")
            {
                let e = Error::new(format!("`{id}` names two claims"));
                f.note(&node.place, "id", e.help(format!("rename one, such as \"{id}_2\"")));
            }
            ids.push(id.clone());
        }
        let (key, place) = (f.path.clone(), f.place.clone());
        if let Some(value) = claim(f, id, names) {
            out.push(Rule { value, key, place });
        }
    }
    out
}

fn claim(mut f: Fields, id: Option<String>, names: &Names) -> Option<Claim> {
    let text = f.sentence("text", "quote or restate what the source says");
    let source = f.sentence("source", "name paper and figure, such as \"Serpa & Rodrigues 2014, fig. 3\"");
    let metric = metric(&mut f, "metric", "what is compared, such as metric = \"total_cull_ms\"");
    let numerator = selection(&mut f, "numerator", names);
    if !f.has("relation") {
        f.missing(
            "relation",
            "what is stated of numerator / denominator: \"<\", \">\", \"ratio\", \"grows\" or \"best\"; of the numerator alone: \"zero\" or \"value\"",
        );
    }
    let relation = f.choice("relation", Relation::ALL);
    let denominator = match relation {
        Some(own) if own.is_own() => {
            if let Some(node) = f.get("denominator") {
                let e =
                    Error::new(format!("stands beside relation = \"{}\", which is about one selection", own.as_str()));
                f.note(&node.place, "denominator", e.help("remove it, or state a ratio: \"<\", \">\" or \"ratio\""));
            }
            Some(Selection::new())
        }
        _ => selection(&mut f, "denominator", names),
    };
    let for_each = for_each(&mut f);
    let (published, published_for) = published(&mut f, relation, for_each.as_deref(), names);
    let tolerance = f.number("tolerance", "a share from 0 to 10, such as 0.25", |x| (0.0..=10.0).contains(&x));
    let nothing_published = published.is_none() && published_for.is_empty();
    if let Some(stated @ (Relation::Ratio | Relation::Value)) = relation
        && nothing_published
        && !f.has("published")
    {
        let word = stated.as_str();
        f.missing(
            "published",
            format!("relation = \"{word}\" needs the published {word}: 3.35, [1.71, 1.79] or {{ nucleus = 3.5 }}"),
        );
    }
    if relation == Some(Relation::Grows)
        && for_each.as_deref() != Some("scene")
        && let Some(node) = f.get("relation")
    {
        let e = Error::new("\"grows\" compares scenes by their triangle count");
        f.note(&node.place, "relation", e.help("add for_each = \"scene\""));
    }
    if relation == Some(Relation::Best)
        && let Some(name) = metric.as_deref().filter(|name| ranks_nothing(name))
        && let Some(node) = f.get("relation")
    {
        let e = Error::new(format!("no value of `{name}` is better than another, so none is best"));
        f.note(&node.place, "relation", e.help("name a metric that ranks, such as frame_ms_model or fps_mean_model"));
    }
    f.finish();
    Some(Claim {
        id: id?,
        text: text?,
        source: source?,
        metric: metric?,
        numerator: numerator?,
        denominator: denominator?,
        relation: relation?,
        published,
        published_for,
        tolerance: tolerance.unwrap_or(0.25),
        for_each,
    })
}

fn ranks_nothing(name: &str) -> bool {
    METRICS.iter().any(|m| m.name == name && m.better == Better::Neither)
}

/// A name of [`METRICS`] under the key `name`.
pub fn metric(f: &mut Fields, name: &'static str, help: &str) -> Option<String> {
    let text = f.sentence(name, help)?;
    if METRICS.iter().any(|m| m.name == text) {
        return Some(text);
    }
    let names = METRICS.iter().map(|m| m.name);
    let mut e = Error::new(format!("unknown metric `{text}`"));
    e.help = Some(match did_you_mean(&text, names.clone()) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => format!("known: {}", names.collect::<Vec<_>>().join(", ")),
    });
    let place = f.get(name)?.place.clone();
    f.note(&place, name, e);
    None
}

fn selection(f: &mut Fields, name: &'static str, names: &Names) -> Option<Selection> {
    if !f.has(name) {
        f.known(name);
        f.missing(name, format!("select runs, such as {name} = {{ structure = \"octree\", culling = \"frustum\" }}"));
        return None;
    }
    let key = f.key(name);
    let node = f.get(name)?;
    selections::read(f.mistakes, &key, node, names)
}

fn for_each(f: &mut Fields) -> Option<String> {
    let text = f.text("for_each")?;
    if axis_names().any(|a| a == text) {
        return Some(text.to_string());
    }
    let place = f.get("for_each")?.place.clone();
    f.note(&place, "for_each", unknown_axis(text));
    None
}

type Published = (Option<[f64; 2]>, BTreeMap<String, [f64; 2]>);

/// `3.35`, `[1.71, 1.79]`, or a table of either by group.
fn published(f: &mut Fields, relation: Option<Relation>, for_each: Option<&str>, names: &Names) -> Published {
    // A ratio of 0 says nothing; a share may well be 0, and a correlation below it.
    let own = relation == Some(Relation::Value);
    let least = if own { f64::NEG_INFINITY } else { f64::from_bits(1) };
    let not_a_ratio = || not_a_ratio(own);
    let mut by_group = BTreeMap::new();
    let Some(node) = f.get("published") else { return (None, by_group) };
    let Data::Table(table) = &node.data else {
        let range = ratio(node, least);
        if range.is_none() {
            f.note(&node.place, "published", not_a_ratio());
        }
        return (range, by_group);
    };
    let Some(axis_name) = for_each else {
        let e = Error::new("gives ratios by group, but the claim has no groups");
        f.note(&node.place, "published", e.help("add for_each = \"scene\", or give one ratio"));
        return (None, by_group);
    };
    for (key, value) in table {
        let path = format!("published.{}", key.name);
        if let Some(known) = names.of(axis_name)
            && !known.contains(&key.name)
        {
            f.note(&key.place, &path, unknown_name(axis_name, &key.name, known));
        } else if let Some(axis) = axis(axis_name)
            && !(axis.parts)().iter().any(|p| key.name.contains(p.name))
            && key.name != "none"
        {
            let e = Error::new(format!("no value of `{axis_name}` is labelled `{}`", key.name));
            f.note(&key.place, &path, e.help("use the label that `cullmark plan` prints, quoted"));
        }
        match ratio(value, least) {
            Some(range) => drop(by_group.insert(key.name.clone(), range)),
            None => f.note(&value.place, &path, not_a_ratio()),
        }
    }
    (None, by_group)
}

fn not_a_ratio(own: bool) -> Error {
    let what = if own {
        "must be a number, or a low and a high one"
    } else {
        "must be a ratio above 0, or a low and a high one"
    };
    Error::new(what).help("write published = 3.35, published = [1.71, 1.79] or published = { nucleus = 3.5 }")
}

fn ratio(node: &Node, least: f64) -> Option<[f64; 2]> {
    let number = |n: &Node| match n.data {
        Data::Int(i) => Some(i as f64),
        Data::Float(x) => Some(x),
        _ => None,
    };
    let range = match node.array() {
        None => [number(node)?; 2],
        Some([low, high]) => [number(low)?, number(high)?],
        Some(_) => return None,
    };
    let finite = range.iter().all(|x| x.is_finite());
    (finite && range[0] >= least && range[0] <= range[1]).then_some(range)
}
