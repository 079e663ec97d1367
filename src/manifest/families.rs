//! Families: one entry of `[[scene]]` or `[[path]]` whose values are lists or ranges is
//! a scene or path for each of them, named `hall@offset_m=1e4`. The plain name stands
//! for all of them wherever a manifest selects.

use super::fields::Fields;
use super::ranges;
use super::source::Place;
use super::tree::{Data, Node, get};
use crate::claim::FAMILY;
use crate::error::Error;
use crate::record::numbers::{short, tidy};
use crate::registry::{Default, Param, Spec, Value};
use crate::scene::placement::along;

/// What the name of a member shows of a value.
#[derive(Debug, Clone, PartialEq)]
pub enum Word {
    Number(f64),
    Text(String),
}

/// Values of one key that is swept, or one value that is not.
pub type Values<T> = Vec<(Word, T)>;

/// More scenes or paths of one entry are a slip of the pen.
pub const MAX_MEMBERS: usize = 1000;

/// Farther the mesh is dropped on load.
const FARTHEST_M: f64 = 1e12;

pub static SCALE: Param =
    Param { name: "scale", default: Default::Float { value: 1.0, min: 0.0, max: f64::MAX }, about: "metres a unit" };
static OFFSET_M: Param = Param {
    name: "offset_m",
    default: Default::Float { value: 0.0, min: 0.0, max: FARTHEST_M },
    about: "how far scene and path are moved",
};

/// The parts of names for the values of `key`: nothing for a single value.
pub fn suffixes<T>(key: &str, values: &Values<T>) -> Vec<String> {
    if values.len() < 2 {
        return vec![String::new(); values.len()];
    }
    let words: Vec<&Word> = values.iter().map(|(word, _)| word).collect();
    distinct(&words).into_iter().map(|word| format!("{FAMILY}{key}={word}")).collect()
}

/// With as few digits as tell all of them apart.
fn distinct(words: &[&Word]) -> Vec<String> {
    let written = |digits: usize| -> Vec<String> {
        let write = |w: &&Word| match w {
            Word::Number(x) => short(*x, digits),
            Word::Text(text) => text.clone(),
        };
        words.iter().map(write).collect()
    };
    let apart = |texts: &Vec<String>| (1..texts.len()).all(|i| !texts[..i].contains(&texts[i]));
    [4, 6, 9, 12].into_iter().map(written).find(apart).unwrap_or_else(|| written(17))
}

/// The specs of a generator, the numbers of its ranges free of rounding.
pub fn tidied(mut specs: Vec<Spec>) -> Vec<Spec> {
    if specs.len() > 1 {
        for value in specs.iter_mut().flat_map(|s| s.params.values_mut()) {
            if let Value::Float(x) = value {
                *x = tidy(*x);
            }
        }
    }
    specs
}

/// For each of `specs`, which differ in some parameters, the part of its name.
pub fn spec_suffixes(specs: &[Spec]) -> Vec<String> {
    let mut out = vec![String::new(); specs.len()];
    let Some(first) = specs.first() else { return out };
    for key in first.params.keys() {
        let mut values: Values<&Value> = Vec::new();
        for value in specs.iter().filter_map(|s| s.params.get(key)) {
            if !values.iter().any(|(_, v)| *v == value) {
                values.push((word(value), value));
            }
        }
        let suffixes = suffixes(key, &values);
        for (name, spec) in out.iter_mut().zip(specs) {
            let at = values.iter().position(|(_, v)| spec.params.get(key) == Some(v));
            name.push_str(at.map_or("", |i| &suffixes[i]));
        }
    }
    out
}

fn word(value: &Value) -> Word {
    match value {
        Value::Float(x) => Word::Number(*x),
        other => Word::Text(other.to_string()),
    }
}

/// One number, a list or a range. Nothing where the key is missing or wrong.
pub fn numbers(f: &mut Fields, param: &'static Param, want: &str, fits: fn(f64) -> bool) -> Values<f64> {
    let Some(node) = f.get(param.name) else { return Vec::new() };
    let mut out: Values<f64> = Vec::new();
    for x in spread(f, param, node, want, fits) {
        if !out.iter().any(|(_, y)| *y == x) {
            out.push((Word::Number(x), x));
        }
    }
    out
}

fn spread(f: &Fields, param: &'static Param, node: &Node, want: &str, fits: fn(f64) -> bool) -> Vec<f64> {
    let (Data::Array(_) | Data::Table(_)) = &node.data else {
        let x = match node.data {
            Data::Int(i) => Some(i as f64),
            Data::Float(x) => Some(x),
            _ => None,
        };
        return x.filter(|x| fits(*x)).or_else(|| f.wrong(node, param.name, want)).into_iter().collect();
    };
    let mut out = Vec::new();
    let mut wrong: Option<Place> = None;
    for (value, place) in ranges::read(f.mistakes, &f.key(param.name), param, node) {
        let x = match value {
            Value::Int(i) => i as f64,
            Value::Float(x) => tidy(x),
            _ => f64::NAN,
        };
        if fits(x) {
            out.push(x);
        } else if wrong.as_ref() != Some(&place) {
            let e = Error::new(format!("holds {value}, but every value must be {want}"));
            f.note(&place, param.name, e.help(format!("give {want}")));
            wrong = Some(place);
        }
    }
    out
}

/// `offset_m`: a distance along [`along`], a vector `{ x, y, z }`, or lists and ranges of them.
pub fn offsets(f: &mut Fields) -> Values<[f64; 3]> {
    let Some(node) = f.get(OFFSET_M.name) else { return Vec::new() };
    let mut out: Values<[f64; 3]> = Vec::new();
    let items = match node.array() {
        Some([]) => {
            let e = Error::new("is an empty list, so there would be no scene");
            f.note(&node.place, OFFSET_M.name, e.help("give a value, or remove the key"));
            return out;
        }
        Some(items) => items,
        None => std::slice::from_ref(node),
    };
    for item in items {
        for (word, offset) in offset(f, item) {
            if !out.iter().any(|(_, o)| *o == offset) {
                out.push((word, offset));
            }
        }
    }
    out
}

fn offset(f: &Fields, node: &Node) -> Values<[f64; 3]> {
    if let Some(table) = node.table()
        && ["x", "y", "z"].iter().any(|name| get(table, name).is_some())
    {
        let mut v = Fields::new(f.mistakes, f.key(OFFSET_M.name), &node.place, table);
        let fits = |x: f64| x.abs() <= FARTHEST_M;
        let part = ["x", "y", "z"].map(|name| v.number(name, "metres from -1e12 to 1e12", fits).unwrap_or(0.0));
        v.finish();
        return vec![(Word::Text(part.map(|x| short(x, 17)).join("_")), part)];
    }
    if node.array().is_some() {
        let e = Error::new("a list in a list");
        f.note(&node.place, OFFSET_M.name, e.help("a vector is { x = 1e4, y = 0, z = 0 }"));
        return Vec::new();
    }
    let want = "metres from 0 to 1e12, or { x = 1e4, y = 0, z = 0 }";
    let distances = spread(f, &OFFSET_M, node, want, |x| (0.0..=FARTHEST_M).contains(&x));
    distances.into_iter().map(|d| (Word::Number(d), along(d))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_as_short_as_they_can_be_and_differ() {
        let numbers = |all: &[f64]| all.iter().map(|x| (Word::Number(*x), ())).collect::<Values<()>>();
        assert_eq!(suffixes("scale", &numbers(&[0.01, 1.0, 1e4])), ["@scale=0.01", "@scale=1", "@scale=1e4"]);
        assert_eq!(suffixes("scale", &numbers(&[0.01])), [""]);
        assert_eq!(suffixes("a", &numbers(&[31.622_776, 31.622_777])), ["@a=31.622776", "@a=31.622777"]);
        let specs: Vec<Spec> =
            ["b:n=1,w=0.5", "b:n=1,w=2.0", "b:n=2,w=0.5"].iter().map(|t| Spec::parse(t).unwrap()).collect();
        assert_eq!(spec_suffixes(&specs), ["@n=1@w=0.5", "@n=1@w=2", "@n=2@w=0.5"]);
    }
}
