//! `cullmark doctor`: is this machine fit to measure?

use crate::machine::{self, fitness};
use crate::store::{DEFAULT_DB, Store, block_on};
use crate::worker::lane::{self, Lane};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Exit status 1 if something is bad; what is unknown is no reason against measuring.")]
pub struct Args {
    /// Database, beside which results go and which knows earlier trials
    #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
    db: PathBuf,
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let class = machine::environment(None).machine_class;
    let noise = if args.db.is_file() {
        block_on(async {
            let store = Store::open_existing(&args.db).await?;
            let noise = store.recent_noise(&class).await;
            store.close().await;
            noise
        })?
    } else {
        None
    };
    let existing = args.db.ancestors().skip(1).find(|f| f.is_dir()).unwrap_or(Path::new("."));
    // Held meanwhile: the probe must disturb no trial, and no trial the probe.
    let held = Lane::new(&lane::default_path()).try_hold()?;
    let checks = fitness::checks(existing, machine::measuring_core(), noise, held.is_some());
    drop(held);
    let fit = fitness::fit(&checks);
    if args.json {
        let list: Vec<_> = checks
            .iter()
            .map(|c| serde_json::json!({ "name": c.name, "verdict": c.verdict.word(), "value": c.value, "advice": c.advice }))
            .collect();
        println!("{:#}", serde_json::json!({ "fit": fit, "machine_class": class, "checks": list }));
    } else {
        println!("{class}");
        for c in &checks {
            println!("{:8} {:15} {}", c.verdict.word(), c.name, c.value);
            if !c.advice.is_empty() {
                println!("{:24} {}", "", c.advice);
            }
        }
        println!("{}", if fit { "fit to measure" } else { "not fit to measure: times would be doubtful" });
    }
    Ok(ExitCode::from(u8::from(!fit)))
}
