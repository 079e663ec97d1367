//! `cullmark exec`: one trial or judgement in a process of its own.
//!
//! One JSON document in on standard input, one out on standard output. A
//! nameable error leaves with exit code 1; anything else is a crash, and the
//! worker says so.

use super::pipe;
use crate::error::{Error, Result};
use crate::record::RunSpec;
use crate::{machine, runner};
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct Args {}

/// What a worker asks of its child.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Job {
    pub job: JobKind,
    pub spec: RunSpec,
    pub cache_dir: PathBuf,
    #[serde(default)]
    pub memory_limit_mib: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    Trial,
    Judge,
}

pub fn run(_args: Args) -> anyhow::Result<ExitCode> {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text)?;
    let job: Job = serde_json::from_str(&text)?;
    pipe::answer(execute(&job))
}

fn execute(job: &Job) -> Result<serde_json::Value> {
    if let Some(mib) = job.memory_limit_mib {
        machine::limit_memory(mib)?;
    }
    let json = match job.job {
        JobKind::Trial => serde_json::to_value(runner::time_trial(&job.spec, &job.cache_dir)?),
        JobKind::Judge => serde_json::to_value(runner::judge(&job.spec, &job.cache_dir)?),
    };
    json.map_err(|e| Error::new(format!("the record cannot be written as JSON: {e}")))
}
