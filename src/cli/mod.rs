//! The command line: one file a verb.

pub mod advise;
pub mod backup;
mod camera;
pub mod cancel;
pub mod check;
pub mod claims;
pub mod client;
pub mod compact;
pub mod compare;
pub mod doctor;
pub mod examine;
pub mod exec;
pub mod export;
pub mod frontier;
pub mod import;
pub mod inspect;
pub mod parts;
pub mod path;
mod pipe;
pub mod plan;
pub mod preflight;
pub mod progress;
pub mod query;
mod remote_table;
pub mod repeatability;
pub mod report;
pub mod run;
pub mod scene;
pub mod serve;
mod signals;
pub mod submit;
pub mod token;
pub mod view;
pub mod watch;
pub mod worker;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Visibility culling, measured: every speed stands beside its error.
#[derive(Parser)]
#[command(name = "cullmark", version, about, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    pub verb: Verb,
}

#[derive(Subcommand)]
pub enum Verb {
    /// Expand a manifest, run its matrix, store the results and write the report
    Run(run::Args),
    /// Check a manifest: every mistake with line, column and a suggestion
    Check(check::Args),
    /// What a manifest can name: structures, tests, walks, generators and all their parameters
    Parts(parts::Args),
    /// Show the matrix of a manifest without running it
    Plan(plan::Args),
    /// Write the report of a stored study
    Report(report::Args),
    /// Print results as a table, JSON or CSV, filtered
    Query(query::Args),
    /// Set two studies or versions side by side
    Compare(compare::Args),
    /// Who is on the front of run time against error, scene by scene
    Frontier(frontier::Args),
    /// How the claims of a study fared: exit status 1 if one does not hold
    Claims(claims::Args),
    /// A study measured more than once, compared with itself
    Repeatability(repeatability::Args),
    /// Serve studies, results and the page over HTTP, and work for them
    Serve(serve::Args),
    /// Work for every study of a database, without serving it
    Worker(worker::Args),
    /// Send a study to a server
    Submit(submit::Args),
    /// Watch a study on a server until it is finished
    Watch(watch::Args),
    /// Drop what is left to do of a study; --pause, --resume
    Cancel(cancel::Args),
    /// Who may ask a server what
    #[command(subcommand)]
    Token(token::Verb),
    /// Is this machine fit to measure?
    Doctor(doctor::Args),
    /// Copy the database while others work with it
    Backup(backup::Args),
    /// Which combination to use for a scene and a path, and why
    Advise(advise::Args),
    /// One frame of one method: counters, errors, image, submitted ids
    Inspect(inspect::Args),
    /// Scenes: info, generate, convert
    #[command(subcommand)]
    Scene(scene::Verb),
    /// Camera paths: generate
    #[command(subcommand)]
    Path(path::Verb),
    /// Write a study with all its results into one file
    Export(export::Args),
    /// Read an exported study into a database
    Import(import::Args),
    /// Shrink a database
    Compact(compact::Args),
    /// Run one trial from a specification on standard input (used by workers)
    #[command(hide = true)]
    Exec(exec::Args),
    /// Show a run or a scene: requests in, binary forms out (used by the server)
    #[command(hide = true)]
    View(view::Args),
    /// Check an uploaded scene or camera path (used by the server)
    #[command(hide = true)]
    Examine(examine::Args),
    /// Read the scenes and paths of runs before they are queued (used by the server)
    #[command(hide = true)]
    Preflight(preflight::Args),
}

/// Exit code 0: all well; 1: ran, but something failed or is wrong; 2: bad input.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.verb {
        Verb::Run(a) => run::run(a),
        Verb::Check(a) => check::run(a),
        Verb::Parts(a) => parts::run(a),
        Verb::Plan(a) => plan::run(a),
        Verb::Report(a) => report::run(a),
        Verb::Query(a) => query::run(a),
        Verb::Compare(a) => compare::run(a),
        Verb::Frontier(a) => frontier::run(a),
        Verb::Claims(a) => claims::run(a),
        Verb::Repeatability(a) => repeatability::run(a),
        Verb::Serve(a) => serve::run(a),
        Verb::Worker(a) => worker::run(a),
        Verb::Submit(a) => submit::run(a),
        Verb::Watch(a) => watch::run(a),
        Verb::Cancel(a) => cancel::run(a),
        Verb::Token(v) => token::run(v),
        Verb::Doctor(a) => doctor::run(a),
        Verb::Backup(a) => backup::run(a),
        Verb::Advise(a) => advise::run(a),
        Verb::Inspect(a) => inspect::run(a),
        Verb::Scene(v) => scene::run(v),
        Verb::Path(v) => path::run(v),
        Verb::Export(a) => export::run(a),
        Verb::Import(a) => import::run(a),
        Verb::Compact(a) => compact::run(a),
        Verb::Exec(a) => exec::run(a),
        Verb::View(a) => view::run(a),
        Verb::Examine(a) => examine::run(a),
        Verb::Preflight(a) => preflight::run(a),
    };
    match result {
        Ok(code) => code,
        Err(e) => {
            eprintln!("error: {e:#}");
            ExitCode::from(2)
        }
    }
}
