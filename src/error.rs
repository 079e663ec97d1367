//! The one error type: what is wrong, where (file, line, column, key), and what to do.

use std::fmt;
use std::path::{Path, PathBuf};

pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Whose fault it is: what a service answers depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ErrorKind {
    /// The input's.
    #[default]
    Input,
    /// It names what is not there.
    Missing,
    /// It does not fit the state that things are in now.
    Conflict,
    /// The disk's, the database's, the system's: the same input may do later.
    Unavailable,
}

/// An error a user can act on. A panic, by contrast, is always our own bug.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Error {
    /// What is wrong, as a sentence without the place.
    pub message: String,
    pub file: Option<PathBuf>,
    /// 1-based.
    pub line: Option<u32>,
    /// 1-based, in characters.
    pub column: Option<u32>,
    /// Dotted key in a manifest, or the id of a run or frame.
    pub key: Option<String>,
    /// What to do about it.
    pub help: Option<String>,
    /// Source excerpt with carets, ready to print, where a reader has one.
    pub snippet: Option<String>,
    pub kind: ErrorKind,
}

impl Error {
    pub fn new(message: impl Into<String>) -> Self {
        Error { message: message.into(), ..Default::default() }
    }

    pub fn io(path: &Path, what: &str, source: &std::io::Error) -> Self {
        Error::new(format!("{what}: {source}")).in_file(path)
    }

    pub fn in_file(mut self, path: impl Into<PathBuf>) -> Self {
        self.file.get_or_insert(path.into());
        self
    }

    pub fn at(mut self, line: u32, column: Option<u32>) -> Self {
        self.line = Some(line);
        self.column = column;
        self
    }

    pub fn key(mut self, key: impl Into<String>) -> Self {
        self.key.get_or_insert(key.into());
        self
    }

    pub fn kind(mut self, kind: ErrorKind) -> Self {
        self.kind = kind;
        self
    }

    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", file.display())?;
            if let Some(line) = self.line {
                write!(f, "{line}:")?;
                if let Some(column) = self.column {
                    write!(f, "{column}:")?;
                }
            }
            write!(f, " ")?;
        }
        if let Some(key) = &self.key {
            write!(f, "`{key}`: ")?;
        }
        write!(f, "{}", self.message)?;
        if let Some(snippet) = &self.snippet {
            write!(f, "\n{}", snippet.trim_end())?;
        }
        if let Some(help) = &self.help {
            write!(f, "\n  help: {help}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Error {}

/// The candidate closest to `word` by edit distance, if close enough to be a
/// likely misspelling. Used for every "did you mean".
pub fn did_you_mean<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let length = word.chars().count();
    let allowed = move |c: &str| (c.chars().count().max(length) / 3).max(1);
    candidates
        .into_iter()
        // What is so much longer or shorter is no misspelling, and a stranger's word may be very long.
        .filter(|c| length <= 200 && c.chars().count().abs_diff(length) <= allowed(c))
        .map(|c| (edit_distance(word, c), c))
        .filter(|(d, c)| *d <= allowed(c))
        .min()
        .map(|(_, c)| c)
}

/// Damerau-Levenshtein distance in its optimal-string-alignment form: a swap of
/// neighbours (`timelmit` for `timelimit`) counts once.
fn edit_distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.chars().collect();
    let b: Vec<char> = b.chars().collect();
    let mut rows = vec![vec![0usize; b.len() + 1]; a.len() + 1];
    for (i, row) in rows.iter_mut().enumerate() {
        row[0] = i;
    }
    for (j, cell) in rows[0].iter_mut().enumerate() {
        *cell = j;
    }
    for i in 1..=a.len() {
        for j in 1..=b.len() {
            let cost = usize::from(a[i - 1] != b[j - 1]);
            let mut best = (rows[i - 1][j] + 1).min(rows[i][j - 1] + 1).min(rows[i - 1][j - 1] + cost);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            rows[i][j] = best;
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelling_finds_its_word_and_a_stranger_finds_none() {
        assert_eq!(did_you_mean("octre", ["octree", "bsp", "list"]), Some("octree"));
        assert_eq!(did_you_mean("timeoutS", ["timeout_s", "repeats"]), Some("timeout_s"));
        assert_eq!(did_you_mean("zebra", ["octree", "bsp", "list"]), None);
    }

    #[test]
    fn the_place_comes_first_and_the_help_last() {
        let e = Error::new("unknown key")
            .in_file("a.toml")
            .at(3, Some(7))
            .key("measure.repats")
            .help("did you mean `repeats`?");
        assert_eq!(e.to_string(), "a.toml:3:7: `measure.repats`: unknown key\n  help: did you mean `repeats`?");
    }
}
