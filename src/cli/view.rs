//! `cullmark view`: a run or a scene to look at, kept open for one request after
//! another. A server holds it as a child process.
//!
//! One JSON document a line in on standard input: first what to open ([`Open`]), then
//! what to show ([`Request`]). Every reply is the line `{"bytes": N}` and N raw bytes,
//! or the line `{"error": {"message", "help"}}`; the one to the opening has 0 bytes.
//! `about` is JSON, `depth` a PNG, the rest are the forms of [`crate::viewing::forms`]. A mistaken
//! request ends nothing; a mistaken opening does, with exit code 1.

use super::pipe;
use crate::error::{Error, Result, did_you_mean};
use crate::machine;
use crate::record::{RunSpec, SceneSpec};
use crate::viewing::{About, RunView, SceneView};
use serde::Deserialize;
use std::io::{self, BufRead, Write};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {}

/// One of `spec` and `scene`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Open {
    #[serde(default)]
    pub spec: Option<RunSpec>,
    #[serde(default)]
    pub scene: Option<SceneSpec>,
    pub cache_dir: PathBuf,
    #[serde(default)]
    pub memory_limit_mib: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    pub ask: String,
    #[serde(default)]
    pub frame: Option<u64>,
    #[serde(default)]
    pub truth: bool,
}

const ASKS: [&str; 5] = ["about", "mesh", "nodes", "frame", "depth"];

enum Viewed {
    Run(Box<RunView>),
    Scene(Box<SceneView>),
}

pub fn run(_args: Args) -> anyhow::Result<ExitCode> {
    match talk(&mut io::stdin().lock(), &mut io::stdout().lock()) {
        // Who asked has gone, perhaps in the middle of a reply: nothing is left to do.
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(ExitCode::SUCCESS),
        ended => Ok(ended?),
    }
}

fn talk(input: &mut impl BufRead, out: &mut impl Write) -> io::Result<ExitCode> {
    let Some(line) = next_line(input)? else { return Ok(ExitCode::SUCCESS) };
    let mut viewed = match pipe::parse(&line).and_then(open) {
        Ok(viewed) => viewed,
        Err(e) => {
            reply(out, Err(e))?;
            return Ok(ExitCode::from(1));
        }
    };
    reply(out, Ok(Vec::new()))?;
    while let Some(line) = next_line(input)? {
        reply(out, pipe::parse(&line).and_then(|request| show(&mut viewed, &request)))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The next line that is not blank, as bytes: what is no UTF-8 is a mistaken request.
fn next_line(input: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    loop {
        let mut line = Vec::new();
        if input.read_until(b'\n', &mut line)? == 0 {
            return Ok(None);
        }
        if !line.trim_ascii().is_empty() {
            return Ok(Some(line));
        }
    }
}

fn reply(out: &mut impl Write, answer: Result<Vec<u8>>) -> io::Result<()> {
    match answer {
        Ok(bytes) => {
            writeln!(out, "{}", serde_json::json!({ "bytes": bytes.len() }))?;
            out.write_all(&bytes)?;
        }
        Err(e) => writeln!(out, "{}", serde_json::json!({ "error": pipe::told(&e) }))?,
    }
    out.flush()
}

fn open(request: Open) -> Result<Viewed> {
    if let Some(mib) = request.memory_limit_mib {
        machine::limit_memory(mib)?;
    }
    match (request.spec, request.scene) {
        (Some(spec), None) => {
            // A trial may be measured meanwhile: its core is not ours.
            if let Some(core) = spec.protocol.pin_core {
                let others = machine::auxiliary_cores(Some(core));
                if !others.is_empty() {
                    machine::pin_to(&others)?;
                }
            }
            Ok(Viewed::Run(Box::new(RunView::open(&spec, &request.cache_dir)?)))
        }
        (None, Some(scene)) => Ok(Viewed::Scene(Box::new(SceneView::open(&scene, &request.cache_dir)?))),
        _ => Err(Error::new("a view is of a run or of a scene").help("give one of `spec` and `scene`")),
    }
}

fn show(viewed: &mut Viewed, request: &Request) -> Result<Vec<u8>> {
    match (request.ask.as_str(), viewed) {
        ("about", Viewed::Run(run)) => json(&run.about()),
        ("about", Viewed::Scene(scene)) => json(&scene.about()),
        ("mesh", Viewed::Run(run)) => Ok(run.mesh()),
        ("mesh", Viewed::Scene(scene)) => Ok(scene.mesh()),
        ("nodes", Viewed::Run(run)) => Ok(run.nodes()),
        ("frame", Viewed::Run(run)) => run.frame(wanted(request)?, request.truth),
        ("depth", Viewed::Run(run)) => run.depth(wanted(request)?),
        (ask @ ("nodes" | "frame" | "depth"), Viewed::Scene(_)) => {
            Err(Error::new(format!("a scene alone has no {ask} to show"))
                .key("ask")
                .help("open a run, or ask for `about` or `mesh`"))
        }
        (other, _) => {
            Err(Error::new(format!("`{other}` cannot be shown")).key("ask").help(match did_you_mean(other, ASKS) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("ask for one of {}", ASKS.join(", ")),
            }))
        }
    }
}

fn wanted(request: &Request) -> Result<usize> {
    let missing = || Error::new("is missing").key("frame").help("say which frame of the path to show, from 0");
    // A number that no index can hold is beyond every path too.
    request.frame.map(|n| usize::try_from(n).unwrap_or(usize::MAX)).ok_or_else(missing)
}

fn json(about: &About) -> Result<Vec<u8>> {
    serde_json::to_vec(about).map_err(|e| Error::new(format!("cannot be written as JSON: {e}")))
}
