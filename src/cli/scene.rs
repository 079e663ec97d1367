//! `cullmark scene`.

use std::process::ExitCode;

#[derive(clap::Subcommand)]
pub enum Verb {
    /// What it is
    Generate,
}

pub fn run(_verb: Verb) -> anyhow::Result<ExitCode> {
    anyhow::bail!("not built yet")
}
