//! What a run costs beyond what its child reports, through the whole pool.

use super::made;
use super::server::PROGRAM;
use super::show::{many, note, one};
use cullmark::machine;
use cullmark::results::RunStatus;
use cullmark::store::{Pool, Store};
use cullmark::worker::child::Launcher;
use cullmark::worker::{self, Event, Listener, Options, Phase};
use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::sync::watch;

const RUNS: usize = 200;

/// A trial on the lane. A disturbed one is taken twice: each is a process of its own.
struct Trial {
    started: Instant,
    run: String,
    take: u32,
    /// From its lease to the decision about its run.
    wall_ms: f64,
}

#[derive(Default)]
struct Times {
    trials: Vec<Trial>,
    ended: usize,
}

pub fn figure() {
    // On a thread of its own, which leaves the measuring lane as the program does.
    std::thread::spawn(|| {
        let mut launcher = Launcher::here().expect("a program");
        launcher.exe = PROGRAM.into();
        launcher.leave_the_lane();
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
        runtime.expect("a runtime").block_on(through_the_pool(launcher));
    })
    .join()
    .expect("a figure");
}

async fn through_the_pool(launcher: Launcher) {
    let dir = tempfile::tempdir().expect("a folder");
    let store = Store::open(&dir.path().join("x.db")).await.expect("a store");
    // One more: the first run also fills the cache, and the last has no successor.
    let asked = made::submission(&made::trivial("overhead", RUNS + 2, 10));
    store.submit(&asked).await.expect("a store");
    let options =
        Options { launcher, cache_dir: dir.path().join("cache"), lane_file: dir.path().join("lane"), auxiliary: 1 };
    let times: Arc<Mutex<Times>> = Arc::default();
    let (phase, phases) = watch::channel(Phase::Work);
    let tell: Listener = {
        let times = times.clone();
        Arc::new(move |event| {
            let mut times = times.lock().expect("a lock");
            match event {
                Event::JobStarted { measurement_id: run, take, .. } => {
                    times.trials.push(Trial { started: Instant::now(), run, take, wall_ms: f64::NAN });
                }
                Event::JobEnded { wall_ms, .. } => {
                    times.trials.last_mut().expect("it started").wall_ms = wall_ms;
                }
                Event::RunEnded { status, reason, .. } => {
                    assert_eq!(status, RunStatus::Done, "{reason:?}");
                    times.ended += 1;
                    if times.ended == RUNS + 2 {
                        let _ = phase.send(Phase::Drain);
                    }
                }
                _ => {}
            }
        })
    };
    let pool = Pool { machine_class: asked.machine_class.clone(), build_profile: machine::build_profile().into() };
    let before = (cpu(libc::RUSAGE_SELF), cpu(libc::RUSAGE_CHILDREN));
    worker::pool(&store, pool, &options, tell, phases, Arc::default()).await;
    let (own, children) = (cpu(libc::RUSAGE_SELF) - before.0, cpu(libc::RUSAGE_CHILDREN) - before.1);
    let walls = walls(store.path()).await;
    let times = std::mem::take(&mut *times.lock().expect("a lock"));
    let (mut overhead, mut child, mut sentinel) = (vec![], vec![], vec![]);
    let (mut stored, mut next, mut said) = (vec![], vec![], vec![]);
    for pair in times.trials.windows(2).skip(1).take(RUNS) {
        let (trial, wall) = (&pair[0], walls[&(pair[0].run.clone(), pair[0].take)]);
        let record = store.trial_record(&trial.run, 0, trial.take).await.expect("a trial");
        let passes: f64 = record.passes_ns.iter().flatten().sum();
        let reported = (record.load_ns + record.build_ns + record.prepare_ns) as f64 / 1e6 + passes / 1e6;
        let cycle = super::show::ms(pair[1].started - trial.started);
        // Five runs of it before the passes and five after; what is stored is their median.
        let watch = 5.0 * (record.sentinel.before_ns + record.sentinel.after_ns) / 1e6;
        overhead.push(cycle - reported);
        said.push(reported);
        sentinel.push(watch);
        child.push(wall - reported - watch);
        stored.push(trial.wall_ms - wall);
        next.push(cycle - trial.wall_ms);
    }
    let peers = "ReBench 15; Snakemake 19-24; Hydra 84; BenchExec 128";
    many("a trivial run beyond what its child reports", &overhead, "ms", "< 15", peers);
    many("  its sentinel, which measures the machine's noise", &sentinel, "ms", "", "");
    many("  its process: start, hand-over, counting pass, end", &child, "ms", "", "");
    many("  its result: accepted (durable), charged, settled", &stored, "ms", "", "");
    many("  the next: event, lane, lease", &next, "ms", "", "");
    many("  (the child reports)", &said, "ms", "", "");
    let n = times.trials.len() as f64;
    one("  CPU of the children, a run", super::show::ms(children) / n, "ms", "", "");
    one("  CPU of the pool, a run", super::show::ms(own) / n, "ms", "", "");
    let twice = times.trials.iter().filter(|t| t.take > 0).count();
    note(&format!(
        "load, build, prepare and the timed pass are what a child reports; {twice} were taken a second time"
    ));
    store.close().await;
}

fn cpu(whose: i32) -> Duration {
    // SAFETY: rusage is plain integers, valid when zeroed; getrusage fills it.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(whose, &mut usage);
        usage
    };
    let time = |t: libc::timeval| Duration::new(t.tv_sec as u64, t.tv_usec as u32 * 1000);
    time(usage.ru_utime) + time(usage.ru_stime)
}

/// Wall time of each trial's child, from its start until its answer is read.
async fn walls(db: &Path) -> HashMap<(String, u32), f64> {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(db).read_only(true);
    let pool = sqlx::SqlitePool::connect_with(options).await.expect("the database");
    let sql = "SELECT measurement_id, take, wall_ns FROM trials WHERE repeat_index = 0";
    let rows: Vec<(String, i64, i64)> = sqlx::query_as(sql).fetch_all(&pool).await.expect("rows");
    rows.into_iter().map(|(id, take, ns)| ((id, take as u32), ns as f64 / 1e6)).collect()
}
