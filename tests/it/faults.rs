//! Real faults, driven through the real program: killed, timed out, out of
//! memory, interrupted, full, unwritable. Nothing is simulated.

use super::common::town;
use cullmark::store::{Store, block_on};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A folder with a town of `n` x `n` boxes, a walk through it and a manifest.
struct Town(tempfile::TempDir);

impl Town {
    fn new(n: usize) -> Town {
        let dir = tempfile::tempdir().unwrap();
        let (mesh, walk) = town(n);
        let manifest = "[study]\nname = \"town\"\ntitle = \"A town\"\n[measure]\nrepeats = 3\npasses = 1\n\
            timeout_s = 120\n[accuracy]\nframes = 1\nwidth_px = 32\nheight_px = 18\n[[scene]]\nname = \"town\"\n\
            file = \"town.obj\"\nup = \"z\"\n[[path]]\nname = \"walk\"\nfile = \"walk.csv\"\n[matrix]\n\
            structure = [\"list\", \"octree:depth=2\"]\nculling = [\"none\", \"frustum\"]\n";
        for (name, text) in [("town.obj", mesh.as_str()), ("walk.csv", &walk), ("town.toml", manifest)] {
            std::fs::write(dir.path().join(name), text).unwrap();
        }
        Town(dir)
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// `cullmark run` here, with a measuring lane of its own.
    fn command(&self, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cullmark"));
        command.current_dir(self.path()).env("CULLMARK_LANE", self.path().join("lane"));
        command.args(["run", "town.toml", "--db", "x.db", "--no-report", "--json"]).args(more);
        command
    }

    fn run(&self, more: &[&str]) -> Output {
        self.command(more).output().unwrap()
    }

    fn start(&self, more: &[&str]) -> Child {
        self.command(more).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
    }

    fn reasons(&self) -> Vec<String> {
        block_on(async {
            let store = Store::open_existing(&self.path().join("x.db")).await.unwrap();
            let runs = store.results("town").await.unwrap().runs;
            runs.into_iter().filter_map(|r| r.reason).collect()
        })
    }
}

fn events(out: &[u8]) -> Vec<Value> {
    String::from_utf8_lossy(out).lines().map(|l| serde_json::from_str(l).unwrap()).collect()
}

/// Trials accepted, noisy ones too.
fn trials(events: &[Value]) -> usize {
    let accepted = |e: &&Value| e["kind"] == "trial" && (e["outcome"] == "accepted" || e["outcome"] == "noisy");
    events.iter().filter(accepted).count()
}

fn last(events: &[Value]) -> &Value {
    events.last().expect("at least the end is told")
}

/// Reads events until `count` trials were accepted.
fn read_until(child: &mut Child, count: usize) -> Vec<Value> {
    let mut seen = Vec::new();
    for line in BufReader::new(child.stdout.take().unwrap()).lines() {
        seen.push(serde_json::from_str(&line.unwrap()).unwrap());
        if trials(&seen) >= count {
            break;
        }
    }
    seen
}

/// Processes started by `parent`.
#[cfg(target_os = "linux")]
fn children(parent: u32) -> Vec<i32> {
    let stat = |e: std::fs::DirEntry| {
        let pid: i32 = e.file_name().to_str()?.parse().ok()?;
        let stat = std::fs::read_to_string(e.path().join("stat")).ok()?;
        let ppid: u32 = stat.rsplit_once(')')?.1.split_whitespace().nth(1)?.parse().ok()?;
        (ppid == parent).then_some(pid)
    };
    std::fs::read_dir("/proc").unwrap().filter_map(|e| stat(e.unwrap())).collect()
}

#[cfg(unix)]
fn signal(pid: i32, name: &str) {
    Command::new("kill").args([&format!("-{name}"), &pid.to_string()]).status().unwrap();
}

#[test]
fn a_study_runs_to_its_end_and_a_second_time_does_nothing() {
    let town = Town::new(4);
    let first = town.run(&["--set", "measure.repeats=1"]);
    assert!(first.status.success(), "{first:?}");
    let first = events(&first.stdout);
    assert_eq!((&last(&first)["done"], &last(&first)["failed"]), (&Value::from(4), &Value::from(0)));
    let second = town.run(&["--set", "measure.repeats=1"]);
    assert!(second.status.success());
    let second: Vec<Value> = events(&second.stdout).into_iter().filter(|e| e["event"] != "note").collect();
    assert_eq!((second.len(), &second[0]["done"]), (2, &Value::from(4)));
}

#[test]
fn a_time_out_fails_its_run_with_the_limit_in_the_reason() {
    let town = Town::new(4);
    let out = town.run(&["--set", "measure.timeout_s=0.001"]);
    assert_eq!(out.status.code(), Some(1));
    let reasons = town.reasons();
    assert_eq!(reasons.len(), 4);
    assert!(reasons.iter().all(|r| r.contains("timed out after 0.")), "{reasons:?}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_memory_limit_fails_its_run_and_says_so() {
    let town = Town::new(80);
    let out =
        town.run(&["--set", "measure.memory_limit_mib=16", "--set", "measure.repeats=1", "--set", "accuracy.frames=0"]);
    assert_eq!(out.status.code(), Some(1), "{out:?}");
    let reasons = town.reasons();
    assert!(!reasons.is_empty() && reasons.iter().all(|r| r.contains("memory")), "{reasons:?}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_killed_child_is_named_and_its_trial_taken_again() {
    let town = Town::new(4);
    // Trials alone, one after the other: a kill meant for the first attempt must not meet the second.
    let mut run = town.start(&["--set", "measure.repeats=6", "--set", "accuracy.frames=0"]);
    let lines = BufReader::new(run.stdout.take().unwrap()).lines();
    let (mut seen, mut killed) = (Vec::<Value>::new(), 0);
    for line in lines {
        seen.push(serde_json::from_str(&line.unwrap()).unwrap());
        // Kill until one is seen to have died of it: a child may be through before the signal.
        if killed < 20
            && !seen.iter().any(|e| e["outcome"] == "crashed")
            && seen.last().unwrap()["event"] == "job_started"
        {
            std::thread::sleep(Duration::from_millis(5));
            children(run.id()).iter().take(1).for_each(|pid| signal(*pid, "KILL"));
            killed += 1;
        }
    }
    let crash = seen.iter().find(|e| e["outcome"] == "crashed").expect("a child was killed");
    assert!(crash["reason"].as_str().unwrap().contains("SIGKILL (signal 9)"), "{crash}");
    assert_eq!(run.wait().unwrap().code(), Some(0), "{:?}", last(&seen));
}

#[test]
#[cfg(target_os = "linux")]
fn a_killed_program_loses_at_most_the_trial_in_flight() {
    let town = Town::new(4);
    let mut run = town.start(&[]);
    let before = read_until(&mut run, 3);
    let orphans = children(run.id());
    run.kill().unwrap();
    run.wait().unwrap();
    let out = town.run(&[]);
    assert!(out.status.success(), "{out:?}");
    let after = events(&out.stdout);
    assert_eq!(after[0]["new"], 0, "it goes on instead of starting again");
    // 12 trials; second takes of disturbed ones come on top.
    let extra = after.iter().filter(|e| e["outcome"] == "noisy").count()
        + before.iter().filter(|e| e["outcome"] == "noisy").count();
    assert!(
        (12..=12 + extra).contains(&(trials(&before) + trials(&after))),
        "{} + {}",
        trials(&before),
        trials(&after)
    );
    // Killed with its parent, an orphan may still wait for init to take note of its end:
    // then it has a number, but no command line.
    let runs = |pid: &i32| std::fs::read(format!("/proc/{pid}/cmdline")).is_ok_and(|line| !line.is_empty());
    let late = Instant::now() + Duration::from_secs(5);
    while orphans.iter().any(runs) {
        assert!(Instant::now() < late, "a child outlived the program");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn ctrl_c_ends_cleanly_and_the_next_start_goes_on() {
    let town = Town::new(4);
    let mut run = town.start(&[]);
    // The pipe stays open: the summary is still to come.
    let mut lines = BufReader::new(run.stdout.take().unwrap()).lines();
    let mut seen: Vec<Value> = Vec::new();
    while trials(&seen) < 2 {
        seen.push(serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap());
    }
    signal(run.id() as i32, "INT");
    seen.extend(lines.map(|l| serde_json::from_str::<Value>(&l.unwrap()).unwrap()));
    assert_eq!(run.wait().unwrap().code(), Some(130));
    assert_eq!((&last(&seen)["event"], &last(&seen)["stopped"]), (&Value::from("finished"), &Value::from(true)));
    let out = town.run(&[]);
    assert!(out.status.success(), "{out:?}");
    assert_eq!(last(&events(&out.stdout))["done"], 4);
}

#[test]
fn two_programs_on_one_file_share_the_work_and_never_a_trial() {
    let town = Town::new(4);
    let (a, b) = (town.start(&[]), town.start(&[]));
    let (a, b) = (a.wait_with_output().unwrap(), b.wait_with_output().unwrap());
    assert!(a.status.success() && b.status.success(), "{a:?} {b:?}");
    let both: Vec<Value> = events(&a.stdout).into_iter().chain(events(&b.stdout)).collect();
    let started: Vec<String> = both
        .iter()
        .filter(|e| e["kind"] == "trial" && e["event"] == "job_ended")
        .map(|e| format!("{} {} {}", e["measurement_id"], e["repeat"], e["outcome"]))
        .collect();
    let noisy = both.iter().filter(|e| e["outcome"] == "noisy").count();
    assert!((12..=12 + noisy).contains(&started.len()), "{started:?}");
    assert!(!both.iter().any(|e| e["outcome"] == "fenced"), "{started:?}");
}

#[test]
fn a_database_that_cannot_be_is_named_with_what_to_do() {
    let town = Town::new(2);
    std::fs::write(town.path().join("text.db"), "this is a letter, not a database; it goes on for a while").unwrap();
    std::fs::write(town.path().join("file"), "").unwrap();
    for (db, says) in [("text.db", "not an SQLite database"), (".", "cannot be opened"), ("file/x.db", "folder")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cullmark"));
        let out =
            command.current_dir(town.path()).args(["run", "town.toml", "--no-report", "--db", db]).output().unwrap();
        let text = String::from_utf8_lossy(&out.stderr).to_string();
        assert_eq!(out.status.code(), Some(2), "{text}");
        assert!(text.contains(says) && text.contains("--db") && text.contains("error:"), "{db}: {text}");
    }
}

#[test]
fn a_database_of_another_program_or_a_newer_cullmark_is_left_alone() {
    use sqlx::Connection;
    let dir = tempfile::tempdir().unwrap();
    let (foreign, newer) = (dir.path().join("foreign.db"), dir.path().join("newer.db"));
    block_on(async {
        let raw = |path: &Path| sqlx::sqlite::SqliteConnectOptions::new().filename(path).create_if_missing(true);
        let mut c = sqlx::SqliteConnection::connect_with(&raw(&foreign)).await.unwrap();
        sqlx::query("CREATE TABLE recipes (id INTEGER)").execute(&mut c).await.unwrap();
        c.close().await.unwrap();
        let e = Store::open(&foreign).await.unwrap_err().to_string();
        assert!(e.contains("another program") && e.contains("foreign.db"), "{e}");

        Store::open(&newer).await.unwrap().close().await;
        let mut c = sqlx::SqliteConnection::connect_with(&raw(&newer)).await.unwrap();
        sqlx::query(
            "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) \
             VALUES (9999, 'later', 1, x'00', 0)",
        )
        .execute(&mut c)
        .await
        .unwrap();
        c.close().await.unwrap();
        let e = Store::open(&newer).await.unwrap_err().to_string();
        assert!(e.contains("newer cullmark") && e.contains("9999"), "{e}");
    });
}

#[test]
fn a_full_disk_is_said_and_what_was_stored_stays() {
    let town = Town::new(4);
    assert!(town.run(&["--set", "measure.repeats=1"]).status.success());
    block_on(async {
        let store = Store::open_existing(&town.path().join("x.db")).await.unwrap();
        let file = store.export("town").await.unwrap();
        // SQLite's own limit raises the very error of a full disk.
        store.limit_pages(1).await.unwrap();
        let (mut n, mut full) = (0, None);
        while n < 500 && full.is_none() {
            full = store.import(&file, Some(&format!("copy {n}"))).await.err();
            n += 1;
        }
        let e = full.expect("the database cannot grow for ever").to_string();
        assert!(e.contains("the disk is full") && e.contains("x.db") && e.contains("compact"), "{e}");
        assert_eq!(store.results("town").await.unwrap().runs.len(), 4);
        // With room again the same connection goes on, though the error ended its transaction.
        store.limit_pages(1 << 30).await.unwrap();
        store.import(&file, Some("one more")).await.unwrap();
    });
}

/// What a study answers, without what may differ from run to run: its times.
fn answers(town: &Town) -> Vec<String> {
    block_on(async {
        let store = Store::open_existing(&town.path().join("x.db")).await.unwrap();
        let runs = store.results("town").await.unwrap().runs;
        let answer = |r: &cullmark::results::RunResult| {
            let counted = (&r.counters, &r.triangles, &r.draw_calls, &r.nodes_visited);
            let repeats: Vec<u32> = r.trials.iter().map(|t| t.repeat).collect();
            format!("{} {:?} {repeats:?} {counted:?} {:?}", r.measurement_id, r.status, r.errors)
        };
        runs.iter().map(answer).collect()
    })
}

/// `CULLMARK_KILLS` sets how many; the few of every day keep the suite short.
#[test]
#[cfg(target_os = "linux")]
fn kills_at_any_moment_change_nothing_but_the_time() {
    let kills: u64 = std::env::var("CULLMARK_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(6);
    let (calm, town) = (Town::new(4), Town::new(4));
    assert!(calm.run(&[]).status.success());
    let mut seed = 7u64;
    for _ in 0..kills {
        let mut run = town.start(&[]);
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        std::thread::sleep(std::time::Duration::from_millis(5 + (seed >> 33) % 250));
        run.kill().unwrap();
        run.wait().unwrap();
    }
    let out = town.run(&["--retry-failed"]);
    assert!(out.status.success(), "{out:?}");
    assert_eq!(answers(&town), answers(&calm));
}
