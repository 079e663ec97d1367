//! Texts that a manifest is made of (files and `--set` arguments), places in
//! them, and errors that show the place.

use super::reach::Reach;
use crate::error::{Error, Result};
use std::cell::RefCell;
use std::fmt::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// One text: a file, or a `--set` argument.
#[derive(Debug, Clone)]
pub struct Source {
    /// Path as the user gave it, or `--set key=value`.
    pub name: PathBuf,
    pub text: String,
    pub is_file: bool,
}

/// Every text read so far; a [`Place`] points into it.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    pub texts: Vec<Source>,
    /// Which files they may name.
    pub reach: Reach,
}

/// Bytes `span` of text `source`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    pub source: usize,
    pub span: Range<usize>,
}

/// Widest excerpt shown, in characters; longer lines are cut around the caret.
const EXCERPT: usize = 100;

impl Sources {
    pub fn add(&mut self, name: impl Into<PathBuf>, text: impl Into<String>, is_file: bool) -> usize {
        self.texts.push(Source { name: name.into(), text: text.into(), is_file });
        self.texts.len() - 1
    }

    pub fn text(&self, place: &Place) -> &str {
        self.texts[place.source].text.get(place.span.clone()).unwrap_or("")
    }

    /// Folder that relative files at `place` start from: that of the manifest, or
    /// the current one for `--set`.
    pub fn folder(&self, place: &Place) -> PathBuf {
        let source = &self.texts[place.source];
        let parent = source.name.parent().filter(|_| source.is_file);
        parent.map(Path::to_path_buf).unwrap_or_default()
    }

    /// The file that `text` at `place` names.
    ///
    /// # Errors
    /// When it is out of reach.
    pub fn resolve(&self, place: &Place, text: &str) -> Result<PathBuf> {
        self.reach.resolve(&self.folder(place), text)
    }

    /// `error` placed at `place`, with file, line, column and an excerpt.
    pub fn locate(&self, place: &Place, error: Error) -> Error {
        let source = &self.texts[place.source];
        let text = &source.text;
        let start = floor_boundary(text, place.span.start);
        let end = floor_boundary(text, place.span.end).max(start);
        let line_start = text[..start].rfind('\n').map_or(0, |i| i + 1);
        let line_end = text[line_start..].find(['\n', '\r']).map_or(text.len(), |i| line_start + i).max(start);
        let line_number = text[..start].matches('\n').count() + 1;
        let before = text[line_start..start].chars().count();
        // A span over several lines is shown by its first.
        let marked = text[start..end.min(line_end).max(start)].chars().count().max(1);
        let mut error = error.in_file(&source.name);
        if source.is_file {
            error = error.at(line_number as u32, Some(before as u32 + 1));
        }
        error.snippet = Some(excerpt(&text[line_start..line_end], line_number, before, marked, source.is_file));
        error
    }
}

fn floor_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// ```text
///   |
/// 4 | repats = 5
///   | ^^^^^^
/// ```
fn excerpt(line: &str, number: usize, before: usize, marked: usize, numbered: bool) -> String {
    let chars: Vec<char> = line.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let first = if before + marked > EXCERPT { before.saturating_sub(EXCERPT / 4) } else { 0 };
    let shown: String = chars.iter().skip(first).take(EXCERPT).collect();
    let carets = marked.min(EXCERPT.saturating_sub(before - first)).max(1);
    let number = if numbered { number.to_string() } else { String::new() };
    let margin = " ".repeat(number.len());
    let mut out = String::new();
    let ellipsis = if first > 0 { "..." } else { "" };
    let indent = " ".repeat(before - first + ellipsis.len());
    let _ = writeln!(out, "{margin} |\n{number} | {ellipsis}{}", shown.trim_end());
    let _ = write!(out, "{margin} | {indent}{}", "^".repeat(carets));
    out
}

/// Collects every mistake, so that one check shows them all.
#[derive(Debug, Default)]
pub struct Mistakes {
    pub sources: Sources,
    found: RefCell<Vec<((usize, usize), Error)>>,
}

impl Mistakes {
    pub fn new(sources: Sources) -> Self {
        Mistakes { sources, found: RefCell::default() }
    }

    /// Notes `error` about `key` at `place`.
    pub fn note(&self, place: &Place, key: &str, error: Error) {
        let mut error = error;
        error.key = (!key.is_empty()).then(|| key.to_string());
        let error = self.sources.locate(place, error);
        let mut found = self.found.borrow_mut();
        let order = (place.source, place.span.start);
        if !found.iter().any(|(o, e)| *o == order && e.message == error.message) {
            found.push((order, error));
        }
    }

    pub fn is_empty(&self) -> bool {
        self.found.borrow().is_empty()
    }

    pub fn count(&self) -> usize {
        self.found.borrow().len()
    }

    pub fn has_line(&self, source: usize, line: u32) -> bool {
        self.found.borrow().iter().any(|((s, _), e)| *s == source && e.line == Some(line))
    }

    /// All mistakes in the order of the text.
    pub fn into_errors(self) -> (Sources, Vec<Error>) {
        let mut found = self.found.into_inner();
        found.sort_by_key(|(order, _)| *order);
        (self.sources, found.into_iter().map(|(_, e)| e).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_shows_its_line_column_and_caret() {
        let mut sources = Sources::default();
        let source = sources.add("a.toml", "[measure]\nrepéats = 5\r\nx = 1", true);
        let e = sources.locate(&Place { source, span: 10..18 }, Error::new("unknown key"));
        assert_eq!(e.to_string(), "a.toml:2:1: unknown key\n  |\n2 | repéats = 5\n  | ^^^^^^^");
        // Spans at the end, past it or over several lines stay inside the text.
        for span in [30..31, 99..120, 0..28, 14..14] {
            assert!(sources.locate(&Place { source, span }, Error::new("x")).snippet.is_some());
        }
    }

    #[test]
    fn a_long_line_is_cut_around_the_caret() {
        let text = format!("x = \"{}\" # {}", "a".repeat(300), "b".repeat(300));
        let mut sources = Sources::default();
        let source = sources.add("a.toml", text, true);
        let e = sources.locate(&Place { source, span: 308..310 }, Error::new("x"));
        assert!(e.snippet.unwrap().lines().all(|l| l.chars().count() < EXCERPT + 12));
    }
}
