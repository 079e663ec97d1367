//! `cullmark watch`: a study on a server, until it is finished.

use super::client::{Client, Server, escape};
use crate::error::ErrorKind;
use serde_json::Value;
use std::io::IsTerminal;
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
pub struct Args {
    /// `name@series`, or the name of a study (its latest series)
    study: String,
    #[command(flatten)]
    server: Server,
    /// One JSON object a line
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    until_finished(&args.server.client()?, &args.study, args.json)
}

/// Connections that break in a row before it is given up.
const TRIES: u32 = 8;

/// Tells what happens. Exit status 1 if a run failed or is wrong, or the study was cancelled.
///
/// # Errors
/// When the server cannot be reached, also not again after a while.
pub fn until_finished(client: &Client, study: &str, json: bool) -> anyhow::Result<ExitCode> {
    let path = format!("/studies/{}/events", escape(study));
    let (mut last, mut finished, mut tries) = (Value::Null, false, 0);
    while !finished {
        let mut heard = false;
        let stream = client.events(&path, |event, data| {
            heard = true;
            if json {
                println!("{}", serde_json::json!({ "event": event, "data": data }));
            } else {
                tell(event, data);
            }
            if event == "progress" {
                last = data.clone();
            }
            finished = matches!(event, "end" | "deleted");
            !finished
        });
        match stream {
            Err(e) if e.kind != ErrorKind::Unavailable => return Err(e.into()),
            Err(e) if tries >= TRIES => return Err(e.into()),
            // The server may be starting anew: what it knows is in its database.
            Err(_) | Ok(()) if !finished => {
                tries = if heard { 0 } else { tries + 1 };
                std::thread::sleep(Duration::from_millis(200 << tries.min(6)));
            }
            _ => {}
        }
    }
    if std::io::stderr().is_terminal() && !json {
        eprintln!();
    }
    let runs = &last["runs"];
    let bad = runs["failed"].as_u64().unwrap_or(0) + runs["wrong"].as_u64().unwrap_or(0);
    let whole = bad == 0 && runs["pending"].as_u64() == Some(0);
    Ok(ExitCode::from(u8::from(!whole)))
}

fn tell(event: &str, data: &Value) {
    let (r, terminal) = (&data["runs"], std::io::stderr().is_terminal());
    match event {
        "progress" => {
            let of = |name: &str| r[name].as_u64().unwrap_or(0);
            let mut line = format!("{} of {} runs done", of("done"), of("total"));
            for name in ["failed", "wrong"] {
                if of(name) > 0 {
                    line += &format!(", {} {name}", of(name));
                }
            }
            let state = data["state"].as_str().unwrap_or_default();
            if state != "active" {
                line += &format!(" ({state})");
            }
            if let Some(run) = data["running"].as_array().and_then(|l| l.first()) {
                line += &format!("; {}", run["run"].as_str().unwrap_or_default());
            }
            // One line that is written over where somebody looks.
            if terminal { eprint!("\r\x1b[K{line}") } else { eprintln!("{line}") }
        }
        "run" if data["status"] != "done" => {
            let word = |name: &str| data[name].as_str().unwrap_or_default().to_string();
            let start = if terminal { "\r\x1b[K" } else { "" };
            eprintln!("{start}{}  {}  {}", word("status"), word("label"), word("reason"));
        }
        "deleted" => eprintln!("the study was deleted"),
        _ => {}
    }
}
