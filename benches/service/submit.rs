//! Taking in a study, and again when all of it is done.

use super::made;
use super::server::{PROGRAM, Server};
use super::show::{many, ms, note};
use std::process::Command;
use std::time::Instant;

pub fn figure() {
    let mut checks = Vec::new();
    let mut takes = Vec::new();
    for _ in 0..5 {
        let dir = tempfile::tempdir().expect("a folder");
        let server = Server::start(&dir.path().join("x.db"), &["--no-workers"]);
        let mut connection = server.connect();
        let manifest = made::wide("wide-10000", 10, 10);
        checks.push(ms(made::submit(&mut connection, &manifest, true).0));
        let (took, reply) = made::submit(&mut connection, &manifest, false);
        assert_eq!(reply["submitted"]["new"], 10_000);
        takes.push(ms(took));
        if takes.len() == 5 {
            let again: Vec<f64> = (0..5).map(|_| ms(made::submit(&mut connection, &manifest, false).0)).collect();
            many("10,000 cells, nothing done: submit again", &again, "ms", "", "");
            let (now, most) = server.rss_mib();
            std::thread::sleep(std::time::Duration::from_secs(11));
            let later = server.rss_mib().0;
            note(&format!("server RSS: {now:.0} MiB, at most {most:.0}; 11 s later {later:.0}"));
        }
    }
    many("10,000 cells: validate_only", &checks, "ms", "", "");
    many("10,000 cells: submit (20,000 jobs)", &takes, "ms", "", "");
    again();
}

/// 1,000 finished cells.
fn again() {
    let kept = made::finished("wide-1000", 5, 2);
    let manifest = made::wide("wide-1000", 5, 2);
    let dir = tempfile::tempdir().expect("a folder");
    let db = dir.path().join("x.db");
    std::fs::copy(&kept, &db).expect("room on the disk");
    let peers = "Snakemake 1,080-1,630; ReBench 1,200-1,300 (200)";
    let server = Server::start(&db, &["--no-workers"]);
    let mut connection = server.connect();
    let mut times = Vec::new();
    for _ in 0..30 {
        let (took, reply) = made::submit(&mut connection, &manifest, false);
        assert_eq!((&reply["submitted"]["done"], &reply["submitted"]["jobs_added"]), (&1000.into(), &0.into()));
        times.push(ms(took));
    }
    many("1,000 finished cells: submit again, HTTP", &times, "ms", "< 200", peers);
    drop(server);
    let file = dir.path().join("bench.toml");
    std::fs::write(&file, &manifest).expect("a file");
    let run = |flags: &[&str]| {
        let start = Instant::now();
        let mut command = Command::new(PROGRAM);
        command.arg("run").arg(&file).arg("--db").arg(&db).arg("--quiet").args(flags);
        let done = command.env("CULLMARK_LANE", dir.path().join("lane")).output().expect("the program");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        ms(start.elapsed())
    };
    for (flags, what) in [(&["--no-report"][..], "`run --no-report`"), (&[], "`run`, its report written before")] {
        // The first writes the report.
        note(&format!("{what} for the first time: {:.0} ms", run(flags)));
        let times: Vec<f64> = (0..20).map(|_| run(flags)).collect();
        many(&format!("1,000 finished cells: {what}, a process"), &times, "ms", "< 200", peers);
    }
}
