//! The program as a server: started, asked what it costs, ended.

use super::http::Connection;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_cullmark");

pub struct Server {
    child: Child,
    pub address: String,
}

impl Server {
    /// On a free port; the measuring lane is its own.
    pub fn start(db: &Path, more: &[&str]) -> Server {
        let mut command = Command::new(PROGRAM);
        command.args(["serve", "--listen", "127.0.0.1:0", "--rate", "0", "--timeout-s", "600", "--db"]).arg(db);
        command.args(more).env("CULLMARK_LANE", db.with_extension("lane"));
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the program starts");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("piped")).read_line(&mut line).expect("a line");
        let address = line.trim().rsplit("http://").next().unwrap_or_default().to_string();
        assert!(address.contains(':'), "the server did not start: `{line}`");
        Server { child, address }
    }

    pub fn connect(&self) -> Connection {
        Connection::new(&self.address)
    }

    fn read(&self, file: &str) -> String {
        std::fs::read_to_string(format!("/proc/{}/{file}", self.child.id())).unwrap_or_default()
    }

    /// Resident now, and at most so far.
    pub fn rss_mib(&self) -> (f64, f64) {
        let status = self.read("status");
        let field = |name: &str| {
            let line = status.lines().find(|l| l.starts_with(name));
            line.and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1024.0
        };
        (field("VmRSS:"), field("VmHWM:"))
    }

    /// Of all its threads so far, without its children.
    pub fn cpu(&self) -> Duration {
        let stat = self.read("stat");
        let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
        let ticks: u64 = [11, 12].iter().filter_map(|i| fields.get(*i)?.parse::<u64>().ok()).sum();
        // SAFETY: sysconf takes a number and answers one.
        let a_second = unsafe { libc::sysconf(libc::_SC_CLK_TCK) };
        Duration::from_secs_f64(ticks as f64 / a_second as f64)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // SAFETY: kill takes two integers, and the child has not been waited for.
        unsafe { libc::kill(self.child.id() as libc::pid_t, libc::SIGTERM) };
        let _ = self.child.wait();
    }
}
