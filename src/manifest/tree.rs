//! TOML as a tree in which every key and value knows its place, in the order
//! of the text; and back to TOML.

use super::source::{Mistakes, Place};
use crate::error::Error;
use std::fmt::Write;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

#[derive(Debug, Clone)]
pub struct Node {
    pub data: Data,
    pub place: Place,
}

#[derive(Debug, Clone)]
pub enum Data {
    Text(String),
    Int(i64),
    Float(f64),
    Bool(bool),
    /// Kept as text: no key takes one.
    Datetime(String),
    Array(Vec<Node>),
    Table(Table),
}

#[derive(Debug, Clone)]
pub struct Key {
    pub name: String,
    pub place: Place,
}

pub type Table = Vec<(Key, Node)>;

impl Node {
    /// The kind of value, for messages.
    pub fn noun(&self) -> &'static str {
        match &self.data {
            Data::Text(_) => "a string",
            Data::Int(_) => "a whole number",
            Data::Float(_) => "a number",
            Data::Bool(_) => "true or false",
            Data::Datetime(_) => "a date",
            Data::Array(_) => "a list",
            Data::Table(_) => "a table",
        }
    }

    pub fn table(&self) -> Option<&Table> {
        if let Data::Table(t) = &self.data { Some(t) } else { None }
    }

    pub fn array(&self) -> Option<&[Node]> {
        if let Data::Array(a) = &self.data { Some(a) } else { None }
    }

    pub fn text(&self) -> Option<&str> {
        if let Data::Text(s) = &self.data { Some(s) } else { None }
    }

    pub fn is_table(&self) -> bool {
        self.table().is_some()
    }
}

pub fn get<'a>(table: &'a Table, name: &str) -> Option<&'a Node> {
    table.iter().find(|(k, _)| k.name == name).map(|(_, v)| v)
}

/// Parses text number `source`; every syntax error is noted.
pub fn parse(mistakes: &Mistakes, source: usize) -> Option<Table> {
    let text = mistakes.sources.texts[source].text.clone();
    let (table, errors) = DeTable::parse_recoverable(&text);
    let before = mistakes.count();
    for e in &errors {
        // The parser's recovery may report what follows from an earlier error: one a line is enough.
        let span = e.span().unwrap_or(text.len()..text.len());
        let error = Error::new(format!("not TOML: {}", e.message()));
        note_once_a_line(mistakes, &Place { source, span }, error, &text);
    }
    let table = convert_table(mistakes, source, table.get_ref());
    (errors.is_empty() && mistakes.count() == before).then_some(table)
}

fn note_once_a_line(mistakes: &Mistakes, place: &Place, error: Error, text: &str) {
    let line = |at: usize| text.as_bytes()[..at.min(text.len())].iter().filter(|b| **b == b'\n').count() as u32 + 1;
    if !mistakes.has_line(place.source, line(place.span.start)) {
        mistakes.note(place, "", error);
    }
}

/// Parses `text`, the part of `--set` argument `source` from byte `offset` on, as a value.
/// Words that are no TOML value are strings, so that shells need no double quoting.
pub fn parse_value(mistakes: &Mistakes, source: usize, offset: usize) -> Result<Node, Error> {
    let text = &mistakes.sources.texts[source].text[offset..];
    match DeValue::parse(text) {
        Ok(value) => {
            let mut node = convert(mistakes, source, &value);
            shift(&mut node, offset);
            Ok(node)
        }
        Err(e) => {
            let word = text.trim();
            let quoted = word.starts_with(['"', '\'', '[', '{']) || word.is_empty();
            if quoted {
                return Err(Error::new(format!("not a TOML value: {}", e.message())));
            }
            let place = Place { source, span: offset..offset + text.len() };
            Ok(Node { data: Data::Text(word.to_string()), place })
        }
    }
}

fn shift(node: &mut Node, by: usize) {
    let moved = |place: &mut Place| place.span = place.span.start + by..place.span.end + by;
    moved(&mut node.place);
    match &mut node.data {
        Data::Array(items) => items.iter_mut().for_each(|n| shift(n, by)),
        Data::Table(table) => table.iter_mut().for_each(|(k, n)| {
            moved(&mut k.place);
            shift(n, by);
        }),
        _ => {}
    }
}

fn convert_table(mistakes: &Mistakes, source: usize, table: &DeTable<'_>) -> Table {
    let mut out: Table = table
        .iter()
        .map(|(key, value)| {
            let place = Place { source, span: key.span() };
            (Key { name: key.get_ref().to_string(), place }, convert(mistakes, source, value))
        })
        .collect();
    out.sort_by_key(|(k, _)| k.place.span.start);
    out
}

fn convert(mistakes: &Mistakes, source: usize, value: &Spanned<DeValue<'_>>) -> Node {
    let place = Place { source, span: value.span() };
    let data = match value.get_ref() {
        DeValue::String(s) => Data::Text(s.to_string()),
        DeValue::Integer(i) => match i64::from_str_radix(i.as_str(), i.radix()) {
            Ok(i) => Data::Int(i),
            Err(_) => {
                mistakes.note(&place, "", Error::new(format!("`{i}` is too large for a whole number")));
                Data::Int(0)
            }
        },
        DeValue::Float(x) => Data::Float(x.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(b) => Data::Bool(*b),
        DeValue::Datetime(d) => Data::Datetime(d.to_string()),
        DeValue::Array(items) => Data::Array(items.iter().map(|v| convert(mistakes, source, v)).collect()),
        DeValue::Table(table) => Data::Table(convert_table(mistakes, source, table)),
    };
    Node { data, place }
}

/// The tree as TOML: plain keys first, then tables, then lists of tables.
pub fn to_toml(table: &Table) -> String {
    let mut out = String::new();
    write_table(&mut out, "", table);
    out
}

fn write_table(out: &mut String, path: &str, table: &Table) {
    let is_tables = |n: &Node| n.array().is_some_and(|a| !a.is_empty() && a.iter().all(Node::is_table));
    for (key, node) in table.iter().filter(|(_, n)| !(n.is_table() || path.is_empty() && is_tables(n))) {
        let _ = writeln!(out, "{} = {}", bare(&key.name), inline(node));
    }
    for (key, node) in table {
        let name = if path.is_empty() { bare(&key.name) } else { format!("{path}.{}", bare(&key.name)) };
        if let Some(inner) = node.table() {
            let _ = writeln!(out, "\n[{name}]");
            write_table(out, &name, inner);
        } else if path.is_empty() && is_tables(node) {
            for item in node.array().unwrap_or_default() {
                let _ = writeln!(out, "\n[[{name}]]");
                for (key, value) in item.table().into_iter().flatten() {
                    let _ = writeln!(out, "{} = {}", bare(&key.name), inline(value));
                }
            }
        }
    }
}

fn bare(key: &str) -> String {
    let plain = !key.is_empty() && key.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
    if plain { key.to_string() } else { quote(key) }
}

fn quote(text: &str) -> String {
    toml::Value::String(text.to_string()).to_string()
}

fn inline(node: &Node) -> String {
    match &node.data {
        Data::Text(s) => quote(s),
        Data::Int(i) => i.to_string(),
        Data::Float(x) => toml::Value::Float(*x).to_string(),
        Data::Bool(b) => b.to_string(),
        Data::Datetime(d) => d.clone(),
        Data::Array(items) => format!("[{}]", items.iter().map(inline).collect::<Vec<_>>().join(", ")),
        Data::Table(table) if table.is_empty() => "{}".to_string(),
        Data::Table(table) => {
            let pairs: Vec<String> = table.iter().map(|(k, v)| format!("{} = {}", bare(&k.name), inline(v))).collect();
            format!("{{ {} }}", pairs.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::source::Sources;

    fn read(text: &str) -> (Mistakes, Option<Table>) {
        let mut sources = Sources::default();
        let source = sources.add("a.toml", text, true);
        let mistakes = Mistakes::new(sources);
        let table = parse(&mistakes, source);
        (mistakes, table)
    }

    #[test]
    fn a_tree_written_as_toml_reads_back_the_same() {
        let text = "a = 1\nb = [1.5, inf, 'x\"y']\n[t]\nk = {x = [true, {y = 1}], \"a b\" = 2}\n[t.u]\nz = 0x10\n[[s]]\nq = {}\n[[s]]\nr = []\n";
        let (_, table) = read(text);
        let once = to_toml(&table.unwrap());
        let (_, again) = read(&once);
        assert_eq!(to_toml(&again.unwrap()), once);
        assert!(once.contains("z = 16") && once.matches("[[s]]").count() == 2, "{once}");
    }

    #[test]
    fn several_syntax_errors_are_all_noted() {
        let (mistakes, table) = read("a = \nb = 1\nc = [1,\n[d]\ne = 99999999999999999999\n");
        assert!(table.is_none());
        let (_, errors) = mistakes.into_errors();
        assert!(errors.len() >= 2, "{errors:#?}");
        assert_eq!(errors[0].line, Some(1));
    }
}
