//! A study of faults: real processes, killed, stopped and starved at seeded moments
//! while they work on a small study; then everything that must hold is checked in what
//! they left. Shared by `benches/faults.rs` (long) and `tests/it/service_faults.rs` (short).

mod check;
mod crew;
mod lab;
mod proc;
mod tally;
mod wrongs;

use crew::{Crew, Role};
use lab::Lab;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::fmt::Write;
use std::time::{Duration, Instant};

/// What is to be done to the service. Numbers are of the command line.
#[derive(Debug, Clone)]
pub struct Plan {
    pub kills: u64,
    pub runs: u64,
    pub repeats: u64,
    pub seed: u64,
    /// Times that the disk is full for a second or two.
    pub full: u64,
    /// Times that another connection holds the database for one to three seconds.
    pub locks: u64,
    /// The same for 25 seconds: longer than anyone waits for a lock.
    pub long_locks: u64,
    /// Times that a worker is stopped until its lease has run out.
    pub stops: u64,
    /// Orphans are ours to wait for (a flag of this process, see `prctl(2)`).
    pub reaper: bool,
    /// Leave the folder behind.
    pub keep: bool,
    /// A server must answer again after so long, while nothing else is wrong.
    pub healthy_within: Duration,
    /// Children of the killed must have died after so long.
    pub orphans_within: Duration,
}

impl Plan {
    pub fn long() -> Plan {
        Plan {
            kills: 200,
            runs: 1000,
            repeats: 2,
            seed: 1,
            full: 6,
            locks: 6,
            long_locks: 1,
            stops: 1,
            reaper: false,
            keep: false,
            healthy_within: Duration::from_secs(5),
            orphans_within: Duration::from_secs(1),
        }
    }

    pub fn words(&self) -> String {
        let Plan { kills, runs, repeats, seed, full, locks, long_locks, stops, .. } = self;
        format!(
            "--kills {kills} --runs {runs} --repeats {repeats} --seed {seed} --full {full} --locks {locks} \
             --long-locks {long_locks} --stops {stops}"
        )
    }
}

/// What came of it.
pub struct Report {
    pub text: String,
    pub violations: Vec<String>,
}

/// Mean time between kills at least: a job whose worker was lost five times is given up, by design.
const GAP_S: f64 = 0.2;
/// The study must end so long after the last fault.
const PATIENCE: Duration = Duration::from_secs(240);
/// After trouble that is over, so long nobody is killed: does everyone work again?
const LULL: Duration = Duration::from_millis(2500);

pub fn run(plan: &Plan) -> Report {
    let lab = Lab::new(plan);
    let calm = Instant::now();
    let reference = lab.undisturbed();
    let calm_s = calm.elapsed().as_secs_f64();

    let start = Instant::now();
    let mut crew = Crew::start(&lab, plan);
    crew.submit(&lab.manifest(plan));
    let mut rng = ChaCha8Rng::seed_from_u64(plan.seed);
    let mut applied = 0;
    // Kills come at random, evenly over the work that is left; other faults in between.
    let wrongs = wrongs::shuffled(plan, &mut rng);
    let jobs = lab::cells(plan) * (plan.repeats + 1);
    for n in 0..plan.kills {
        for _ in 0..wrongs.iter().filter(|(at, _)| *at == n).count() {
            let kills_left = plan.kills - crew.tally.kills();
            let with_kill = kills_left > 1 && real(&mut rng) < 0.5;
            wrongs::inflict(&lab, &mut crew, &mut rng, wrongs[applied].1, with_kill);
            applied += 1;
        }
        if crew.tally.kills() >= plan.kills {
            continue;
        }
        // As many of the kills as of eight tenths of the work: the machine's pace changes.
        let done = 1.0 - crew.left().min(jobs) as f64 / jobs as f64;
        let behind = (crew.tally.kills() as f64) < plan.kills as f64 * (done / 0.8).min(1.0);
        let gap_s = if behind { GAP_S } else { GAP_S.max(0.9 * calm_s / plan.kills as f64) };
        crew.pass(Duration::from_secs_f64(2.0 * gap_s * real(&mut rng)));
        if crew.finished() {
            break;
        }
        let mut role = Role::any(&mut rng);
        // A job whose child died again and again is taken to be at fault itself, by design: one at a time.
        if role == Role::Child && wrongs::is_a_crash_open(&lab) {
            role = if rng.next_u32() % 2 == 0 { Role::Server } else { Role::Worker };
        }
        crew.kill(role, &mut rng);
    }
    let faults_s = start.elapsed().as_secs_f64();
    crew.finish(PATIENCE);
    let total_s = start.elapsed().as_secs_f64();
    crew.end();

    let mut text = String::new();
    let _ = writeln!(
        text,
        "{} runs x {} repeats; undisturbed {calm_s:.1} s, with faults {total_s:.1} s (the last fault at {faults_s:.1} s)",
        plan.runs, plan.repeats
    );
    if !lab.can_be_full && plan.full > 0 {
        let _ = writeln!(text, "full disks left out: this process may not mount a tmpfs");
    }
    if crew.tally.kills() < plan.kills {
        let _ = writeln!(text, "the study was finished before all kills were done: more runs make room for them");
    }
    text += &crew.tally.table();
    let (told, mut violations) = check::all(&lab, plan, &reference, &crew.ended_runs());
    text += &told;
    let _ = writeln!(text, "half-written cache files left behind by killed children: {}", lab.partial_files());
    violations.append(&mut crew.tally.violations);
    if plan.keep || !violations.is_empty() {
        let _ = writeln!(text, "kept: {}", lab.keep());
    }
    Report { text, violations }
}

/// From 0 up to 1.
fn real(rng: &mut ChaCha8Rng) -> f64 {
    f64::from(rng.next_u32()) / (f64::from(u32::MAX) + 1.0)
}

/// Of a list with something in it.
fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * q).round() as usize]
}
