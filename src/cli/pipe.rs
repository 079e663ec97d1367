//! What the hidden verbs share that a service drives: JSON in on standard input,
//! JSON out on standard output, errors by name.

use crate::error::{Error, ErrorKind, Result};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::process::ExitCode;

/// Message with its place, and what to do: for one sentence to a user. A server passes it
/// on, and in which folder it keeps its files is nobody's business.
pub fn told(e: &Error) -> Value {
    let file = e.file.as_ref().map(|f| f.file_name().map_or_else(|| f.clone(), Into::into));
    let message = Error { help: None, file, ..e.clone() }.to_string();
    json!({ "message": message, "help": e.help, "unavailable": e.kind == ErrorKind::Unavailable })
}

/// Every part by itself: for an editor that marks the place.
pub fn located(e: &Error) -> Value {
    let Error { message, file, line, column, key, help, .. } = e;
    json!({ "message": message, "file": file, "line": line, "column": column, "key": key, "help": help })
}

/// A request that is no JSON, or not the JSON that was expected.
pub fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T> {
    serde_json::from_slice(bytes).map_err(|e| {
        Error::new(format!("the request cannot be read: {e}")).help("send one JSON document with the documented fields")
    })
}

/// The whole of standard input as one document.
pub fn read<T: DeserializeOwned>() -> Result<T> {
    let mut bytes = Vec::new();
    std::io::stdin().read_to_end(&mut bytes).map_err(|e| Error::new(format!("standard input cannot be read: {e}")))?;
    parse(&bytes)
}

/// `{"ok": ...}` with exit code 0, or `{"error": ...}` with 1.
pub fn answer(result: Result<Value>) -> anyhow::Result<ExitCode> {
    let (document, code) = match result {
        Ok(value) => (json!({ "ok": value }), ExitCode::SUCCESS),
        Err(e) => (json!({ "error": told(&e) }), ExitCode::from(1)),
    };
    print(&document)?;
    Ok(code)
}

pub fn print(document: &Value) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{document}")?;
    out.flush()
}
