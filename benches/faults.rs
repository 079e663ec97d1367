//! What `cullmark serve` and `cullmark worker` make of kills, full disks, locked
//! databases and stopped workers:
//! `cargo bench --bench faults -- --kills 200 --runs 1000 --seed 1`.
//!
//! Ends with a status other than 0 if anything was lost, counted twice or answered
//! otherwise than by an undisturbed run. A full disk needs the right to mount a tmpfs
//! (root in a container will do); without it that kind of fault is left out and said.

#[path = "faults/mod.rs"]
mod study;

use std::process::{Command, ExitCode};

const HELP: &str =
    "options: --kills N --runs N --repeats N --seed N --full N --locks N --long-locks N --stops N --keep";

fn main() -> ExitCode {
    let plan = match plan(std::env::args().skip(1)) {
        Ok(plan) => plan,
        Err(why) => {
            eprintln!("{why}\n{HELP}");
            return ExitCode::from(2);
        }
    };
    println!("{}", machine());
    println!("cargo bench --bench faults -- {}\n", plan.words());
    // Orphans come to us instead of to init: whoever lives on or is never waited for is seen.
    // SAFETY: prctl with these arguments sets a flag of this process and touches no memory.
    let plan = study::Plan { reaper: unsafe { libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 1) } == 0, ..plan };
    let report = study::run(&plan);
    println!("{}", report.text);
    if report.violations.is_empty() {
        println!("all checks hold");
        return ExitCode::SUCCESS;
    }
    for violation in &report.violations {
        println!("VIOLATED: {violation}");
    }
    ExitCode::FAILURE
}

fn plan(words: impl Iterator<Item = String>) -> Result<study::Plan, String> {
    let mut plan = study::Plan::long();
    let mut words = words.filter(|w| w != "--bench");
    while let Some(word) = words.next() {
        if word == "--keep" {
            plan.keep = true;
            continue;
        }
        let field = match word.as_str() {
            "--kills" => &mut plan.kills,
            "--runs" => &mut plan.runs,
            "--repeats" => &mut plan.repeats,
            "--full" => &mut plan.full,
            "--locks" => &mut plan.locks,
            "--long-locks" => &mut plan.long_locks,
            "--stops" => &mut plan.stops,
            "--seed" => &mut plan.seed,
            _ => return Err(format!("`{word}` is no option")),
        };
        let number = words.next().ok_or_else(|| format!("{word} needs a number"))?;
        *field = number.parse().map_err(|_| format!("`{number}` is no number"))?;
    }
    Ok(plan)
}

fn machine() -> String {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let info = read("/proc/cpuinfo");
    let cpu = info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':')).map_or("?", |(_, n)| n.trim());
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let kernel = Command::new("uname").arg("-sr").output().map(|o| o.stdout).unwrap_or_default();
    let load = read("/proc/loadavg");
    let load = load.split_whitespace().next().unwrap_or("?");
    let profile = if cfg!(debug_assertions) { "dev" } else { "release" };
    format!("{cpu}, {cores} cores, {}, {profile} profile, load {load}", String::from_utf8_lossy(&kernel).trim())
}
