//! SQLite's result codes as sentences that name the file and say what to do.

use crate::error::{Error, ErrorKind};
use sqlx::migrate::MigrateError;
use std::path::Path;

/// Primary result codes (sqlite.org/rescode.html); extended ones carry them in the low byte.
const PERM: i32 = 3;
const BUSY: i32 = 5;
const LOCKED: i32 = 6;
const READONLY: i32 = 8;
const IOERR: i32 = 10;
const CORRUPT: i32 = 11;
const FULL: i32 = 13;
const CANTOPEN: i32 = 14;
const NOTADB: i32 = 26;

/// What went wrong with the database at `path` while `doing` something.
pub fn explain(path: &Path, doing: &str, e: &sqlx::Error) -> Error {
    let code = match e {
        sqlx::Error::Database(d) => d.code().and_then(|c| c.parse::<i32>().ok()).map(|c| c & 0xff),
        _ => None,
    };
    let (message, help) = match code {
        Some(CANTOPEN) => (
            "the database cannot be opened".to_string(),
            "check that its folder exists and that you may write there, or choose another file with --db".to_string(),
        ),
        Some(READONLY | PERM) => (
            "the database cannot be written".to_string(),
            "make the file and its folder writable (SQLite needs both), or choose another file with --db".to_string(),
        ),
        Some(NOTADB) => {
            ("this file is not an SQLite database".to_string(), "choose another file with --db".to_string())
        }
        Some(CORRUPT) => (
            format!("the database is damaged ({e})"),
            "restore it from a copy, or import an exported study into a fresh file".to_string(),
        ),
        Some(FULL) => (
            format!("the disk is full: {doing} was not stored"),
            "free some space (`cullmark compact` shrinks the database) and run again: finished work is kept"
                .to_string(),
        ),
        Some(IOERR) => (
            format!("reading or writing the disk failed ({e})"),
            "check the disk and its free space and run again: finished work is kept".to_string(),
        ),
        Some(BUSY | LOCKED) => (
            "the database is locked by another program".to_string(),
            "wait for it, or close what holds the file open; a network file system is no place for it".to_string(),
        ),
        _ => (format!("{doing}: {e}"), String::new()),
    };
    let error = Error::new(message).in_file(path).kind(ErrorKind::Unavailable);
    if help.is_empty() { error } else { error.help(help) }
}

/// The same for opening and migrating.
pub fn explain_migration(path: &Path, e: &MigrateError) -> Error {
    match e {
        MigrateError::VersionMissing(v) | MigrateError::VersionTooNew(v, _) => Error::new(format!(
            "the database was written by a newer cullmark (its schema has step {v}, which this program does not know)"
        ))
        .in_file(path)
        .help("use the newer cullmark, or choose another file with --db"),
        MigrateError::VersionMismatch(v) => Error::new(format!(
            "step {v} of the database's schema is not the one of this cullmark: a development build wrote it"
        ))
        .in_file(path)
        .help("export its studies with the program that wrote it, or choose another file with --db"),
        MigrateError::Dirty(v) => Error::new(format!("step {v} of the database's schema was interrupted"))
            .in_file(path)
            .help("restore the file from a copy, or choose another with --db"),
        MigrateError::Execute(e) | MigrateError::ExecuteMigration(e, _) => explain(path, "preparing the database", e),
        other => Error::new(format!("preparing the database: {other}")).in_file(path),
    }
}
