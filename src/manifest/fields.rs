//! Typed reading of one table. Whatever is wrong is noted with its place, and
//! reading goes on, so that one check finds every mistake.

use super::source::{Mistakes, Place};
use super::tree::{Data, Key, Node, Table};
use crate::error::{Error, did_you_mean};
use std::ops::RangeInclusive;

/// A table being read: remembers which keys were asked for, so that
/// [`Fields::finish`] can name the ones nobody knows.
pub struct Fields<'a> {
    pub mistakes: &'a Mistakes,
    /// Dotted key of the table, as `--set` would write it.
    pub path: String,
    pub place: Place,
    table: &'a Table,
    known: Vec<&'static str>,
}

impl<'a> Fields<'a> {
    pub fn new(mistakes: &'a Mistakes, path: impl Into<String>, place: &Place, table: &'a Table) -> Self {
        Fields { mistakes, path: path.into(), place: place.clone(), table, known: Vec::new() }
    }

    pub fn key(&self, name: &str) -> String {
        if name.is_empty() {
            self.path.clone()
        } else if self.path.is_empty() {
            name.to_string()
        } else {
            format!("{}.{name}", self.path)
        }
    }

    /// The value of `name`; asking makes the key a known one.
    pub fn get(&mut self, name: &'static str) -> Option<&'a Node> {
        self.entry(name).map(|(_, node)| node)
    }

    pub fn entry(&mut self, name: &'static str) -> Option<&'a (Key, Node)> {
        self.known(name);
        self.table.iter().find(|(k, _)| k.name == name)
    }

    pub fn has(&self, name: &str) -> bool {
        self.table.iter().any(|(k, _)| k.name == name)
    }

    pub fn note(&self, place: &Place, name: &str, error: Error) {
        self.mistakes.note(place, &self.key(name), error);
    }

    /// Notes that `name` is missing and why it is wanted.
    pub fn missing(&self, name: &str, help: impl Into<String>) {
        self.note(&self.place, name, Error::new("is missing").help(help));
    }

    pub fn wrong<T>(&self, node: &Node, name: &str, want: &str) -> Option<T> {
        let text = self.mistakes.sources.text(&node.place);
        let got = match &node.data {
            Data::Array(_) | Data::Table(_) => node.noun().to_string(),
            _ if text.len() <= 60 => format!("`{text}`"),
            _ => node.noun().to_string(),
        };
        self.note(&node.place, name, Error::new(format!("is {got}, but must be {want}")).help(hint(node, want)));
        None
    }

    pub fn int(&mut self, name: &'static str, range: RangeInclusive<i64>) -> Option<i64> {
        let node = self.get(name)?;
        match node.data {
            Data::Int(i) if range.contains(&i) => Some(i),
            _ => {
                let upper = if *range.end() == i64::MAX { String::new() } else { format!(" to {}", range.end()) };
                self.wrong(node, name, &format!("a whole number from {}{upper}", range.start()))
            }
        }
    }

    pub fn u32(&mut self, name: &'static str, range: RangeInclusive<u32>) -> Option<u32> {
        self.int(name, i64::from(*range.start())..=i64::from(*range.end())).map(|i| i as u32)
    }

    /// A number for which `fits`; `want` says what that is. Whole numbers count as numbers.
    pub fn number(&mut self, name: &'static str, want: &str, fits: impl Fn(f64) -> bool) -> Option<f64> {
        let node = self.get(name)?;
        match node.data {
            Data::Float(x) if fits(x) => Some(x),
            Data::Int(i) if fits(i as f64) => Some(i as f64),
            _ => self.wrong(node, name, want),
        }
    }

    pub fn bool(&mut self, name: &'static str) -> Option<bool> {
        let node = self.get(name)?;
        match node.data {
            Data::Bool(b) => Some(b),
            _ => self.wrong(node, name, "true or false"),
        }
    }

    pub fn text(&mut self, name: &'static str) -> Option<&'a str> {
        let node = self.get(name)?;
        match &node.data {
            Data::Text(s) => Some(s),
            _ => self.wrong(node, name, "a string"),
        }
    }

    /// A string that is not blank.
    pub fn sentence(&mut self, name: &'static str, help: &str) -> Option<String> {
        if !self.has(name) {
            self.known(name);
            self.missing(name, help);
            return None;
        }
        let node = self.get(name)?;
        match &node.data {
            Data::Text(s) if !s.trim().is_empty() => Some(s.trim().to_string()),
            Data::Text(_) => {
                self.note(&node.place, name, Error::new("is empty").help(help));
                None
            }
            _ => self.wrong(node, name, "a string"),
        }
    }

    /// A name that can stand in selectors, keys and file names.
    pub fn name(&mut self, name: &'static str, help: &str) -> Option<String> {
        let value = self.sentence(name, help)?;
        let ok = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
        if value.chars().all(ok) && value != "none" && value.len() <= 80 {
            return Some(value);
        }
        let place = &self.get(name)?.place;
        let fixed: String = value.chars().map(|c| if ok(c) { c } else { '_' }).take(80).collect();
        let e = Error::new(format!("`{value}` is no name")).help(format!(
            "use letters, digits, `_`, `-` and `.`, such as `{}`",
            if fixed == "none" { "nothing" } else { &fixed }
        ));
        self.note(place, name, e);
        None
    }

    pub fn choice<T: Copy>(&mut self, name: &'static str, choices: &[(&str, T)]) -> Option<T> {
        let node = self.get(name)?;
        if let Some((_, value)) = node.text().and_then(|s| choices.iter().find(|(c, _)| *c == s)) {
            return Some(*value);
        }
        let list = choices.iter().map(|(c, _)| format!("\"{c}\"")).collect::<Vec<_>>().join(", ");
        let Some(text) = node.text() else { return self.wrong(node, name, &format!("one of {list}")) };
        let mut e = Error::new(format!("is \"{text}\", but must be one of {list}"));
        e.help = did_you_mean(text, choices.iter().map(|(c, _)| *c)).map(|n| format!("did you mean \"{n}\"?"));
        if e.help.is_none() {
            e.help = Some(format!("one of {list}"));
        }
        self.note(&node.place, name, e);
        None
    }

    /// A value, or each value of a list: `x = 1` and `x = [1]` mean the same.
    pub fn one_or_more(&mut self, name: &'static str) -> Option<&'a [Node]> {
        let node = self.get(name)?;
        Some(node.array().unwrap_or(std::slice::from_ref(node)))
    }

    /// The table under `name`, or `None` (a wrong type is noted).
    pub fn table(&mut self, name: &'static str) -> Option<Fields<'a>> {
        let path = self.key(name);
        let mistakes = self.mistakes;
        let (key, node) = self.entry(name)?;
        match &node.data {
            Data::Table(t) => Some(Fields::new(mistakes, path, &key.place, t)),
            _ => self.wrong(node, name, &format!("a table: [{path}]")),
        }
    }

    /// Every entry of the list of tables `[[name]]`.
    pub fn tables(&mut self, name: &'static str) -> Vec<Fields<'a>> {
        let path = self.key(name);
        let mistakes = self.mistakes;
        let Some(node) = self.get(name) else { return Vec::new() };
        let Some(items) = node.array() else {
            self.wrong::<()>(node, name, &format!("a list of tables: [[{path}]]"));
            return Vec::new();
        };
        let mut out = Vec::new();
        for (i, item) in items.iter().enumerate() {
            match item.table() {
                Some(t) => out.push(Fields::new(mistakes, format!("{path}.{i}"), &item.place, t)),
                None => drop(self.wrong::<()>(item, name, &format!("a table: [[{path}]]"))),
            }
        }
        out
    }

    /// All entries, for tables whose keys are data.
    pub fn entries(&self) -> &'a Table {
        self.table
    }

    pub fn known(&mut self, name: &'static str) {
        if !self.known.contains(&name) {
            self.known.push(name);
        }
    }

    /// Notes every key that nobody asked for.
    pub fn finish(self) {
        for (key, _) in self.table {
            if self.known.contains(&key.name.as_str()) {
                continue;
            }
            let mut e = Error::new("unknown key");
            e.help = Some(match did_you_mean(&key.name, self.known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("known here: {}", self.known.join(", ")),
            });
            self.note(&key.place, &key.name, e);
        }
    }
}

fn hint(node: &Node, want: &str) -> String {
    match &node.data {
        Data::Text(s) if s.parse::<f64>().is_ok() && want.contains("number") => format!("without quotes: {s}"),
        Data::Float(x) if x.fract() == 0.0 && want.contains("whole number") => {
            format!("write {x:.0} without a fraction")
        }
        _ => format!("give {want}"),
    }
}
