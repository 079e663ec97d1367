//! The filter of `query`: `structure = octree and depth >= 4 and culling in (frustum, none) or scene = nucleus`.
//!
//! ```text
//! or    := and ("or" and)*
//! and   := not ("and" not)*
//! not   := "not" not | "(" or ")" | field test
//! test  := OP value | ["not"] "in" "(" value ("," value)* ")" | ["not"] "in" value ".." value
//! OP    := = == != <> < <= > >=
//! ```
//! A field is an axis, a metric, `status`, `class`, `machine_class`, or a
//! parameter with or without its part (`octree.depth`, `depth`). Ranges include
//! both ends. A run without the field (not judged, another structure) matches
//! no test of it. Values with blanks or signs of the grammar stand in quotes.

use super::fields::{Field, Fields};
use crate::error::{Error, Result, did_you_mean};
use crate::registry::Value;
use crate::results::RunResult;

/// A checked filter.
#[derive(Debug, Clone, PartialEq)]
pub enum Filter {
    Any(Vec<Filter>),
    All(Vec<Filter>),
    Not(Box<Filter>),
    Test { field: Field, op: Op, values: Vec<String> },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Op {
    Equal,
    Unequal,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    In,
    NotIn,
    /// Both ends included.
    Range,
    OutsideRange,
}

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Word(String),
    Quoted(String),
    Op(Op),
    Open,
    Close,
    Comma,
    Dots,
    End,
}

struct Parser<'a> {
    text: &'a str,
    /// With 1-based columns.
    tokens: Vec<(Token, u32)>,
    at: usize,
    fields: &'a Fields,
    depth: usize,
}

/// Levels that a filter may have: each takes of the stack, and filters come from strangers.
const DEPTH: usize = 64;

impl Filter {
    /// # Errors
    /// Names the column, shows the place, and suggests what was meant.
    pub fn parse(text: &str, fields: &Fields) -> Result<Filter> {
        let mut parser = Parser { text, tokens: tokens(text)?, at: 0, fields, depth: 0 };
        let filter = parser.any()?;
        match parser.peek() {
            Token::End => Ok(filter),
            Token::Close => Err(parser.wrong("there is no ( for this )", "remove it, or open it earlier")),
            _ => Err(parser.wrong("expected `and`, `or` or the end", "join tests with `and` or `or`")),
        }
    }

    pub fn matches(&self, run: &RunResult, fields: &Fields) -> bool {
        match self {
            Filter::Any(parts) => parts.iter().any(|f| f.matches(run, fields)),
            Filter::All(parts) => parts.iter().all(|f| f.matches(run, fields)),
            Filter::Not(inner) => !inner.matches(run, fields),
            Filter::Test { field, op, values } => fields.test(run, field, *op, values),
        }
    }
}

impl Parser<'_> {
    fn peek(&self) -> &Token {
        &self.tokens[self.at].0
    }

    fn take(&mut self) -> Token {
        let token = self.peek().clone();
        if token != Token::End {
            self.at += 1;
        }
        token
    }

    fn keyword(&mut self, word: &str) -> bool {
        let found = matches!(self.peek(), Token::Word(w) if w.eq_ignore_ascii_case(word));
        if found {
            self.at += 1;
        }
        found
    }

    /// An error at the token in hand.
    fn wrong(&self, message: impl Into<String>, help: impl Into<String>) -> Error {
        at_column(self.text, self.tokens[self.at].1, message).help(help)
    }

    fn any(&mut self) -> Result<Filter> {
        let mut parts = vec![self.all()?];
        while self.keyword("or") {
            parts.push(self.all()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Filter::Any(parts) })
    }

    fn all(&mut self) -> Result<Filter> {
        let mut parts = vec![self.one()?];
        while self.keyword("and") {
            parts.push(self.one()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Filter::All(parts) })
    }

    fn one(&mut self) -> Result<Filter> {
        if self.depth >= DEPTH {
            return Err(self.wrong(format!("more than {DEPTH} levels of `not` and ("), "write it flatter"));
        }
        self.depth += 1;
        let found = self.term();
        self.depth -= 1;
        found
    }

    fn term(&mut self) -> Result<Filter> {
        if self.keyword("not") {
            return Ok(Filter::Not(Box::new(self.one()?)));
        }
        if *self.peek() == Token::Open {
            self.take();
            let inner = self.any()?;
            if *self.peek() != Token::Close {
                return Err(self.wrong("expected )", "close the parenthesis"));
            }
            self.take();
            return Ok(inner);
        }
        let name = match self.peek() {
            Token::Word(w) if !["and", "or", "in"].contains(&w.to_ascii_lowercase().as_str()) => w.clone(),
            _ => return Err(self.wrong("expected the name of a field", "as in: structure = octree and depth >= 4")),
        };
        let field = match self.fields.find(&name) {
            Some(field) => field,
            None => return Err(self.unknown(&name)),
        };
        self.take();
        self.test(&name, field)
    }

    fn unknown(&self, name: &str) -> Error {
        let names = self.fields.names();
        let help = match did_you_mean(name, names.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("fields: {}", names.join(", ")),
        };
        self.wrong(format!("there is no field `{name}`"), help)
    }

    fn test(&mut self, name: &str, field: Field) -> Result<Filter> {
        let column = self.tokens[self.at].1;
        let (mut op, mut values) = match self.peek().clone() {
            Token::Op(op) => {
                self.take();
                (op, vec![self.value()?])
            }
            Token::Word(w) if w.eq_ignore_ascii_case("in") || w.eq_ignore_ascii_case("not") => {
                let negated = self.keyword("not");
                if !self.keyword("in") {
                    return Err(self.wrong("expected `in`", format!("write {name} not in (a, b)")));
                }
                (if negated { Op::NotIn } else { Op::In }, self.list(name)?)
            }
            _ => {
                let help = format!("write {name} = value, {name} >= value or {name} in (a, b)");
                return Err(self.wrong("expected =, !=, <, <=, >, >= or in", help));
            }
        };
        if *self.peek() == Token::Dots {
            self.take();
            values.push(self.value()?);
            op = match op {
                Op::Equal | Op::In => Op::Range,
                Op::Unequal | Op::NotIn => Op::OutsideRange,
                _ => {
                    return Err(
                        at_column(self.text, column, "a range goes with =, != or in").help("write depth = 3..5")
                    );
                }
            };
        }
        self.fields.check(&field, op, &values).map_err(|e| {
            let mut placed = at_column(self.text, column, e.message);
            placed.help = e.help;
            placed
        })?;
        Ok(Filter::Test { field, op, values })
    }

    /// `(a, b, c)`, or the first end of a range.
    fn list(&mut self, name: &str) -> Result<Vec<String>> {
        if *self.peek() != Token::Open {
            return Ok(vec![self.value()?]);
        }
        self.take();
        let mut values = vec![self.value()?];
        loop {
            match self.take() {
                Token::Comma => values.push(self.value()?),
                Token::Close => return Ok(values),
                Token::End => return Err(self.wrong("expected )", "close the list")),
                _ => {
                    self.at -= 1;
                    return Err(self.wrong("expected , or )", format!("write {name} in (a, b)")));
                }
            }
        }
    }

    fn value(&mut self) -> Result<String> {
        match self.peek().clone() {
            Token::Word(v) | Token::Quoted(v) => {
                self.take();
                Ok(v)
            }
            _ => Err(self.wrong("expected a value", "a number, a name, or text in quotes")),
        }
    }
}

/// An error at a place in the one line of the filter.
fn at_column(text: &str, column: u32, message: impl Into<String>) -> Error {
    let mut e = Error::new(message).in_file("filter").at(1, Some(column));
    e.snippet = Some(format!("  {text}\n  {}^", " ".repeat(column as usize - 1)));
    e
}

fn tokens(text: &str) -> Result<Vec<(Token, u32)>> {
    let chars: Vec<char> = text.chars().collect();
    let mut out = Vec::new();
    let mut i = 0;
    while i < chars.len() {
        let column = i as u32 + 1;
        let two: String = chars[i..chars.len().min(i + 2)].iter().collect();
        let (token, length) = match (chars[i], two.as_str()) {
            (c, _) if c.is_whitespace() => {
                i += 1;
                continue;
            }
            (_, "..") => (Token::Dots, 2),
            (_, "==") => (Token::Op(Op::Equal), 2),
            (_, "!=") | (_, "<>") => (Token::Op(Op::Unequal), 2),
            (_, "<=") => (Token::Op(Op::LessEqual), 2),
            (_, ">=") => (Token::Op(Op::GreaterEqual), 2),
            ('=', _) => (Token::Op(Op::Equal), 1),
            ('<', _) => (Token::Op(Op::Less), 1),
            ('>', _) => (Token::Op(Op::Greater), 1),
            ('(', _) => (Token::Open, 1),
            (')', _) => (Token::Close, 1),
            (',', _) => (Token::Comma, 1),
            (quote @ ('"' | '\''), _) => {
                let Some(end) = chars[i + 1..].iter().position(|c| *c == quote) else {
                    return Err(
                        at_column(text, column, "this quote is never closed").help(format!("close it with {quote}"))
                    );
                };
                (Token::Quoted(chars[i + 1..i + 1 + end].iter().collect()), end + 2)
            }
            (c, _) if is_word(c) => {
                let mut end = i;
                // Two dots end a word: `3..5` is a range, `octree.depth` a name.
                while end < chars.len()
                    && is_word(chars[end])
                    && !(chars[end] == '.' && chars.get(end + 1) == Some(&'.'))
                {
                    end += 1;
                }
                (Token::Word(chars[i..end].iter().collect()), end - i)
            }
            (c, _) => {
                return Err(at_column(text, column, format!("`{c}` does not belong here"))
                    .help("put values with special signs in quotes"));
            }
        };
        out.push((token, column));
        i += length;
    }
    out.push((Token::End, chars.len() as u32 + 1));
    Ok(out)
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '+' | '*' | ':' | '@' | '/' | '×' | '|')
}

/// Whether a number or text stands to `values` as `op` says.
pub fn holds(op: Op, found: &Value, values: &[String]) -> bool {
    let order = |wanted: &str| -> Option<std::cmp::Ordering> {
        match (as_number(found), wanted.parse::<f64>()) {
            (Some(a), Ok(b)) => a.partial_cmp(&b),
            _ => None,
        }
    };
    let equal = |wanted: &String| match order(wanted) {
        Some(o) => o.is_eq(),
        None => same_text(&found.to_string(), wanted),
    };
    let within = || order(&values[0]).is_some_and(|o| o.is_ge()) && order(&values[1]).is_some_and(|o| o.is_le());
    match op {
        Op::Equal | Op::In => values.iter().any(equal),
        Op::Unequal | Op::NotIn => !values.iter().any(equal),
        Op::Less => order(&values[0]).is_some_and(|o| o.is_lt()),
        Op::LessEqual => order(&values[0]).is_some_and(|o| o.is_le()),
        Op::Greater => order(&values[0]).is_some_and(|o| o.is_gt()),
        Op::GreaterEqual => order(&values[0]).is_some_and(|o| o.is_ge()),
        Op::Range => within(),
        Op::OutsideRange => as_number(found).is_some() && !within(),
    }
}

fn as_number(value: &Value) -> Option<f64> {
    match value {
        Value::Int(i) => Some(*i as f64),
        Value::Float(x) => Some(*x),
        _ => None,
    }
}

/// Without regard to case; `*` stands for any characters.
fn same_text(text: &str, pattern: &str) -> bool {
    let (text, pattern) = (text.to_lowercase(), pattern.to_lowercase());
    let pieces: Vec<&str> = pattern.split('*').collect();
    let [first, middle @ .., last] = &pieces[..] else { return text == pattern };
    let Some(mut rest) = text.strip_prefix(first) else { return false };
    for piece in middle {
        match rest.find(piece) {
            Some(at) => rest = &rest[at + piece.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}
