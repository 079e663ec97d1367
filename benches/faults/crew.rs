//! A server and a worker on one database: started, killed, started again at once, and
//! watched all the while.

use super::Plan;
use super::lab::Lab;
use super::proc::{self, Id};
use super::tally::Tally;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::RngCore;
use serde_json::Value;
use std::collections::{BTreeSet, HashMap};
use std::fs::{self, File};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// A dead child of a living program is asked how it ended before that.
const ZOMBIE: Duration = Duration::from_secs(2);
/// A program that gave up by itself is started again after so long.
const REST: Duration = Duration::from_millis(200);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    Server,
    Worker,
    /// An `exec` process of either.
    Child,
}

impl Role {
    pub fn any(rng: &mut ChaCha8Rng) -> Role {
        [Role::Server, Role::Worker, Role::Child][rng.next_u32() as usize % 3]
    }

    pub fn word(self) -> &'static str {
        ["server", "worker", "child"][self as usize]
    }
}

struct Program {
    role: Role,
    child: Child,
    id: Id,
    since: Instant,
    /// Ended by itself, and not yet started again.
    ended: Option<Instant>,
    stopped: bool,
}

pub struct Crew<'a> {
    lab: &'a Lab,
    reaper: bool,
    healthy_within: Duration,
    orphans_within: Duration,
    address: String,
    agent: ureq::Agent,
    programs: Vec<Program>,
    /// When the server was started, until it has answered; and whether something else was wrong.
    waiting: Option<(Instant, bool)>,
    orphans: Vec<(Id, Instant)>,
    zombies: HashMap<Id, Instant>,
    swept: Instant,
    asked: Instant,
    /// Runs done, jobs left: as last told.
    told: (u64, u64),
    over: bool,
    /// The disk is full or the database locked.
    pub troubled: bool,
    pub tally: Tally,
}

impl<'a> Crew<'a> {
    pub fn start(lab: &'a Lab, plan: &Plan) -> Crew<'a> {
        let port = std::net::TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port").port();
        let config = ureq::Agent::config_builder().timeout_global(Some(Duration::from_secs(2)));
        let now = Instant::now();
        let mut crew = Crew {
            lab,
            reaper: plan.reaper,
            healthy_within: plan.healthy_within,
            orphans_within: plan.orphans_within,
            address: format!("127.0.0.1:{port}"),
            agent: config.http_status_as_error(true).build().into(),
            programs: Vec::new(),
            waiting: None,
            orphans: Vec::new(),
            zombies: HashMap::new(),
            swept: now,
            asked: now,
            told: (0, u64::MAX),
            over: false,
            troubled: false,
            tally: Tally::default(),
        };
        crew.programs = vec![crew.spawn(Role::Server), crew.spawn(Role::Worker)];
        crew.waiting = Some((now, true));
        while crew.waiting.is_some() {
            crew.tick();
            assert!(now.elapsed() < Duration::from_secs(60), "the server never answered: {}", crew.last_words(0));
        }
        crew.tally.troubled_ms.clear();
        crew
    }

    fn log(&self, role: Role) -> std::path::PathBuf {
        self.lab.path().join(format!("{}.log", role.word()))
    }

    fn spawn(&self, role: Role) -> Program {
        let log = File::options().create(true).append(true).open(self.log(role)).expect("a log");
        let mut command = self.lab.command();
        if role == Role::Server {
            command.args(["serve", "--rate", "0", "--listen", &self.address]);
        } else {
            command.arg("worker");
        }
        command.arg("--db").arg(self.lab.database()).args(["--log", "json"]);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        // It ends with us, whatever ends us.
        // SAFETY: prctl with these arguments is safe between fork and exec.
        unsafe {
            command.pre_exec(|| {
                libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
                Ok(())
            })
        };
        let child = command.spawn().expect("the program starts");
        let id = proc::id_of(child.id()).expect("it was just started");
        Program { role, child, id, since: Instant::now(), ended: None, stopped: false }
    }

    fn restart(&mut self, at: usize) {
        self.programs[at] = self.spawn(self.programs[at].role);
        if self.programs[at].role == Role::Server {
            self.waiting = Some((self.programs[at].since, self.troubled));
        }
    }

    pub fn submit(&mut self, manifest: &str) {
        let body = serde_json::json!({ "manifest": manifest }).to_string();
        let request = self.agent.post(format!("http://{}/api/v1/studies", self.address));
        let request = request.config().timeout_global(Some(Duration::from_secs(60))).build();
        request.header("content-type", "application/json").send(body).expect("the study is taken in");
        self.asked = Instant::now();
    }

    /// Kills one of them, or another if there is no such process now, and starts it again at
    /// once. Who it was.
    pub fn kill(&mut self, role: Role, rng: &mut ChaCha8Rng) -> Role {
        let late = Instant::now() + Duration::from_millis(200);
        while role == Role::Child && Instant::now() < late {
            let of = |p: &Program| proc::children(p.child.id());
            let children: Vec<Id> = self.programs.iter().flat_map(of).filter(|c| !c.zombie).map(|c| c.id).collect();
            let children: Vec<Id> = children.into_iter().filter(|c| proc::verb(c.pid) == "exec").collect();
            if !children.is_empty() {
                proc::signal(children[rng.next_u32() as usize % children.len()], libc::SIGKILL);
                self.tally.killed[Role::Child as usize] += 1;
                return Role::Child;
            }
            self.tick();
        }
        let at = usize::from(role != Role::Server);
        if self.programs[at].ended.is_none() && !self.programs[at].stopped {
            let children = proc::children(self.programs[at].child.id());
            self.programs[at].child.kill().expect("it is ours");
            let now = Instant::now();
            self.orphans.extend(children.iter().filter(|c| !c.zombie).map(|c| (c.id, now)));
            self.programs[at].child.wait().expect("it is ours");
            self.restart(at);
            self.tally.killed[at] += 1;
        }
        [Role::Server, Role::Worker][at]
    }

    /// Stops the worker while it has a job; false if it has none for long.
    pub fn stop(&mut self) -> bool {
        let late = Instant::now() + Duration::from_secs(10);
        while Instant::now() < late {
            let worker = &mut self.programs[1];
            if proc::children(worker.child.id()).iter().any(|c| !c.zombie && proc::verb(c.id.pid) == "exec") {
                proc::signal(worker.id, libc::SIGSTOP);
                worker.stopped = true;
                return true;
            }
            self.tick();
        }
        false
    }

    pub fn go_on(&mut self) {
        proc::signal(self.programs[1].id, libc::SIGCONT);
        self.programs[1].stopped = false;
    }

    /// Lets time go by, watching.
    pub fn pass(&mut self, time: Duration) {
        let end = Instant::now() + time;
        while Instant::now() < end {
            self.tick();
        }
    }

    fn tick(&mut self) {
        for at in 0..self.programs.len() {
            let program = &mut self.programs[at];
            match program.ended {
                None => {
                    let Ok(Some(status)) = program.child.try_wait() else { continue };
                    program.ended = Some(Instant::now());
                    let what = format!("{} ({status}): {}", program.role.word(), self.last_words(at));
                    if !self.troubled {
                        self.tally.violations.push(format!("ended by itself while nothing was wrong: {what}"));
                    }
                    self.tally.gave_up.push(what);
                }
                Some(since) if since.elapsed() > REST => self.restart(at),
                Some(_) => {}
            }
        }
        if let Some((since, troubled)) = self.waiting {
            let troubled = troubled || self.troubled;
            self.waiting = Some((since, troubled));
            if self.get("/healthz").is_some() {
                let took = since.elapsed();
                let list = if troubled { &mut self.tally.troubled_ms } else { &mut self.tally.healthy_ms };
                list.push(took.as_secs_f64() * 1e3);
                self.waiting = None;
                if !troubled && took > self.healthy_within {
                    self.tally.violations.push(format!("a server answered only {took:?} after its start"));
                }
            }
        }
        if self.swept.elapsed() > Duration::from_millis(20) {
            self.sweep();
            self.swept = Instant::now();
        }
        std::thread::sleep(Duration::from_millis(2));
    }

    /// Children of the dead must be dead, children of the living waited for.
    fn sweep(&mut self) {
        let violations = &mut self.tally.violations;
        let (orphan_ms, within) = (&mut self.tally.orphan_ms, self.orphans_within);
        self.orphans.retain(|(id, since)| {
            if proc::runs(*id) {
                if since.elapsed() > within {
                    violations.push(format!("a child lives {:?} after its parent was killed", since.elapsed()));
                }
                return since.elapsed() <= within;
            }
            orphan_ms.push(since.elapsed().as_secs_f64() * 1e3);
            false
        });
        let ours = |pid: i32| self.programs.iter().find(|p| p.id.pid == pid);
        let dead: Vec<proc::Seen> = proc::all().into_iter().filter(|p| p.zombie).collect();
        let mut zombies = HashMap::new();
        for z in dead {
            if self.reaper && z.parent == std::process::id() as i32 && ours(z.id.pid).is_none() {
                proc::reap(z.id.pid);
            }
            if ours(z.parent).is_some_and(|p| !p.stopped) {
                let since = self.zombies.get(&z.id).copied().unwrap_or_else(Instant::now);
                if since.elapsed() > ZOMBIE {
                    violations.push(format!("a child of a living program is a zombie for {:?}", since.elapsed()));
                } else {
                    zombies.insert(z.id, since);
                }
            }
        }
        self.zombies = zombies;
    }

    fn get(&self, path: &str) -> Option<String> {
        let answer = self.agent.get(format!("http://{}{path}", self.address)).call();
        answer.ok()?.body_mut().read_to_string().ok()
    }

    /// Runs done and jobs left, as a healthy server tells.
    pub fn progress(&mut self) -> Option<(u64, u64)> {
        if self.waiting.is_some() || self.programs[0].ended.is_some() {
            return None;
        }
        let answer = self.get("/api/v1/studies").and_then(|text| serde_json::from_str::<Value>(&text).ok());
        self.tally.requests[usize::from(answer.is_none())] += 1;
        let study = &answer?["items"][0];
        let number = |v: &Value| v.as_u64().expect("a count");
        let (runs, jobs) = (&study["runs"], &study["jobs"]);
        let done = number(&runs["done"]);
        if done < self.told.0 {
            self.tally.violations.push(format!("{} runs were told to be done, then {done}", self.told.0));
        }
        self.told = (done, number(&jobs["trials"]) + number(&jobs["judgements"]));
        self.over = number(&runs["pending"]) == 0 && self.told.1 == 0;
        Some(self.told)
    }

    /// Jobs left when that was last told.
    pub fn left(&self) -> u64 {
        self.told.1
    }

    pub fn finished(&mut self) -> bool {
        if self.asked.elapsed() > Duration::from_millis(100) {
            self.progress();
            self.asked = Instant::now();
        }
        self.over
    }

    /// Waits until all is done, touching nothing.
    pub fn finish(&mut self, patience: Duration) {
        let end = Instant::now() + patience;
        while !self.finished() {
            if Instant::now() > end {
                let (done, left) = self.told;
                let words = format!("{}; {}", self.last_words(0), self.last_words(1));
                let what =
                    format!("not finished {patience:?} after the last fault: {done} runs done, {left} jobs left");
                self.tally.violations.push(format!("{what}; last words: {words}"));
                return;
            }
            self.pass(Duration::from_millis(50));
        }
    }

    /// Asks both to end; then nothing of ours may be left.
    pub fn end(&mut self) {
        for program in &mut self.programs {
            proc::signal(program.id, libc::SIGTERM);
            let late = Instant::now() + Duration::from_secs(30);
            let status = loop {
                match program.child.try_wait().expect("it is ours") {
                    Some(status) => break Some(status),
                    None if Instant::now() > late => break None,
                    None => std::thread::sleep(Duration::from_millis(5)),
                }
            };
            if !status.is_some_and(|s| s.success()) {
                let code = status.map(|s| (s.code(), s.signal()));
                self.tally.violations.push(format!("{} did not end well when asked: {code:?}", program.role.word()));
                let _ = program.child.kill();
                let _ = program.child.wait();
            }
        }
        std::thread::sleep(Duration::from_millis(100));
        self.sweep();
        for pid in proc::tagged(&format!("CULLMARK_LANE={}", self.lab.lane().display())) {
            self.tally.violations.push(format!("process {pid} ({}) is left over", proc::verb(pid)));
        }
        let left = proc::all().into_iter().filter(|p| p.zombie && p.parent == std::process::id() as i32).count();
        if self.reaper && left > 0 {
            self.tally.violations.push(format!("{left} zombies are left over"));
        }
    }

    fn lines(&self, role: Role) -> Vec<Value> {
        let text = fs::read(self.log(role)).unwrap_or_default();
        // A killed program may have been in the middle of a line.
        String::from_utf8_lossy(&text).lines().filter_map(|l| serde_json::from_str(l).ok()).collect()
    }

    fn last_words(&self, at: usize) -> String {
        let text = fs::read(self.log(self.programs.get(at).map_or(Role::Server, |p| p.role))).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let mut last: Vec<&str> = text.lines().rev().take(12).filter(|l| !l.starts_with('{')).collect();
        last.reverse();
        last.join(" ")
    }

    /// Troubles that the programs have told so far.
    pub fn troubles(&self) -> Vec<String> {
        let lines = [Role::Server, Role::Worker].into_iter().flat_map(|r| self.lines(r));
        lines.filter(|l| l["level"] == "ERROR").map(|l| l.to_string()).collect()
    }

    /// Labels of runs that some process said had ended, each with how.
    pub fn ended_runs(&self) -> BTreeSet<(String, String)> {
        let lines = [Role::Server, Role::Worker].into_iter().flat_map(|r| self.lines(r));
        let text = |v: &Value| v.as_str().unwrap_or_default().to_string();
        lines.filter(|l| l["message"] == "run ended").map(|l| (text(&l["run"]), text(&l["status"]))).collect()
    }
}
