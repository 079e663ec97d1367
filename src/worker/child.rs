//! One `cullmark exec` child: a document in, a document out, and every way it can end.
//!
//! The child leads its own process group, so that a time-out kills all that it
//! started and Ctrl-C on the terminal reaches the worker alone. It dies with the
//! worker, so that nothing keeps computing on the measuring lane unseen.

use crate::error::{Error, ErrorKind, Result};
use crate::machine;
use crate::record::RunSpec;
use crate::store::Kind;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::sync::{OnceLock, mpsc};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWriteExt};
use tokio::process::{Child, Command};

/// Of standard error, the end tells why.
const TAIL_BYTES: usize = 2000;

/// What `cullmark exec` reads.
#[derive(Debug, Serialize)]
pub struct Request<'a> {
    pub job: Kind,
    pub spec: &'a RunSpec,
    pub cache_dir: &'a Path,
    pub memory_limit_mib: Option<u64>,
}

/// Where and how children run.
#[derive(Debug, Clone)]
pub struct Launcher {
    /// The `cullmark` program.
    pub exe: PathBuf,
    /// The measuring lane's core, kept free of everything else of ours.
    pub lane_core: Option<u32>,
    /// All cores we may use, asked before this process left the lane's.
    pub cores: Vec<u32>,
}

/// How a child ended.
#[derive(Debug)]
pub enum Ended<T> {
    Answered(T),
    /// It named an error; running it again would only repeat it.
    Refused(String),
    TimedOut(String),
    /// It died without a word of its own.
    Crashed(String),
}

#[derive(Deserialize)]
struct Reply<T> {
    ok: Option<T>,
    error: Option<Named>,
}

#[derive(Deserialize)]
struct Named {
    message: String,
    help: Option<String>,
    /// Not the run's fault (a full disk): it may do later.
    #[serde(default)]
    unavailable: bool,
}

impl Launcher {
    /// For this machine and the running program.
    ///
    /// # Errors
    /// When the program cannot tell where it is.
    pub fn here() -> Result<Launcher> {
        let exe = std::env::current_exe()
            .map_err(|e| Error::new(format!("the path of the running program is unknown: {e}")))?;
        Ok(Launcher { exe, lane_core: machine::measuring_core(), cores: machine::cores().to_vec() })
    }

    /// Keeps this thread, and those it starts later, off the measuring lane.
    /// Best effort: a container may forbid it, and the sentinel then tells.
    pub fn leave_the_lane(&self) {
        let auxiliary = machine::auxiliary_cores(self.lane_core);
        if self.lane_core.is_some() && !auxiliary.is_empty() {
            let _ = machine::pin_to(&auxiliary);
        }
    }

    /// Runs one job to its end or `limit`. Dropping the future kills the child.
    ///
    /// # Errors
    /// When the child cannot be started at all, or met trouble that is not the run's.
    pub async fn run<T: for<'a> Deserialize<'a>>(&self, request: &Request<'_>, limit: Duration) -> Result<Ended<T>> {
        let child = self.start("exec", request.job)?;
        let Some((out, err, status)) = converse(child, request, limit).await else {
            return Ok(Ended::TimedOut(format!("timed out after {} s", limit.as_secs_f64())));
        };
        let status = status.map_err(|e| Error::new(format!("waiting for a child process: {e}")))?;
        interpret(&out, &err, status, request.memory_limit_mib)
    }

    /// Asks a verb of the program one thing, beside the measuring lane: JSON in, whatever
    /// it writes out.
    ///
    /// # Errors
    /// When it cannot be started or takes longer than `limit`.
    pub async fn ask(&self, verb: &str, request: &impl Serialize, limit: Duration) -> Result<Answered> {
        let Some((stdout, stderr, _)) = converse(self.beside(verb)?, request, limit).await else {
            return Err(Error::new(format!("reading it took longer than {} s", limit.as_secs()))
                .help("send a smaller scene, or several"));
        };
        Ok(Answered { stdout, stderr })
    }

    /// A child of this machine's other cores, which talks by its standard streams.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn beside(&self, verb: &str) -> Result<Child> {
        self.start(verb, Kind::Judge)
    }

    fn start(&self, verb: &str, kind: Kind) -> Result<Child> {
        let mut command = Command::new(&self.exe);
        command.arg(verb).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).kill_on_drop(true);
        #[cfg(unix)]
        command.process_group(0);
        #[cfg(target_os = "linux")]
        die_with_worker(&mut command);
        let launcher = self.clone();
        let child = on_the_spawner(move || {
            // Affinity is inherited: a trial may build on every core and then pins itself to the lane.
            if kind == Kind::Trial && launcher.lane_core.is_some() {
                let _ = machine::pin_to(&launcher.cores);
            }
            let child = command.spawn();
            launcher.leave_the_lane();
            child
        });
        child.map_err(|e| {
            Error::new(format!("the program for trials cannot be started: {e}"))
                .in_file(&self.exe)
                .help("was it moved or rebuilt while a study ran? start the study again: it goes on where it stopped")
        })
    }
}

/// Starts children on a thread that never ends: the system's promise to kill a child
/// when its parent dies is about the *thread* that forked it, and threads of a runtime
/// come and go.
fn on_the_spawner(spawn: impl FnOnce() -> std::io::Result<Child> + Send + 'static) -> std::io::Result<Child> {
    type Work = Box<dyn FnOnce() + Send>;
    static SPAWNER: OnceLock<mpsc::Sender<Work>> = OnceLock::new();
    let spawner = SPAWNER.get_or_init(|| {
        let (sender, receiver) = mpsc::channel::<Work>();
        std::thread::Builder::new()
            .name("spawner".into())
            .spawn(move || receiver.iter().for_each(|work| work()))
            .expect("a thread can be started");
        sender
    });
    let (sender, receiver) = mpsc::channel();
    // The runtime must know of the child, to tell when it ends.
    let runtime = tokio::runtime::Handle::current();
    let work = move || {
        let _entered = runtime.enter();
        let _ = sender.send(spawn());
    };
    spawner.send(Box::new(work)).expect("the spawner never ends");
    receiver.recv().expect("the spawner answers")
}

/// What [`Launcher::ask`] brought.
#[derive(Debug)]
pub struct Answered {
    pub stdout: Vec<u8>,
    /// Its end.
    pub stderr: String,
}

impl Answered {
    /// Why there is no answer, from what it wrote beside.
    pub fn why(&self) -> String {
        let last = self.stderr.lines().rfind(|l| !l.trim().is_empty());
        last.map_or_else(|| "its process ended without a word".to_string(), str::to_string)
    }
}

/// Hands `request` to the child and waits for its end: what it wrote, the end of what it
/// wrote beside, and its status. `None` when it took longer than `limit` and was killed.
async fn converse(
    mut child: Child,
    request: &impl Serialize,
    limit: Duration,
) -> Option<(Vec<u8>, String, std::io::Result<ExitStatus>)> {
    let input = serde_json::to_vec(request).expect("a request is plain data");
    let mut group = Group(child.id());
    let mut stdin = child.stdin.take().expect("piped");
    let mut stdout = child.stdout.take().expect("piped");
    let mut stderr = child.stderr.take().expect("piped");
    let talk = async {
        let write = async move {
            // A child that dies before it has read everything shows in its status.
            let _ = stdin.write_all(&input).await;
            drop(stdin);
        };
        let read = async {
            let mut out = Vec::new();
            let _ = stdout.read_to_end(&mut out).await;
            out
        };
        let ((), out, err) = tokio::join!(write, read, tail(&mut stderr));
        (out, err, child.wait().await)
    };
    match tokio::time::timeout(limit, talk).await {
        Ok(said) => {
            group.0 = None;
            Some(said)
        }
        Err(_) => {
            group.kill();
            let _ = child.wait().await;
            None
        }
    }
}

/// Kills a whole process group, unless told that its leader has been waited for.
struct Group(Option<u32>);

impl Group {
    fn kill(&mut self) {
        #[cfg(unix)]
        if let Some(pid) = self.0.take() {
            // SAFETY: kill takes two integers. The leader has not been waited for,
            // so its number cannot belong to another group yet.
            unsafe { libc::kill(-(pid as libc::pid_t), libc::SIGKILL) };
        }
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.kill();
    }
}

#[cfg(target_os = "linux")]
fn die_with_worker(command: &mut Command) {
    let worker = std::process::id();
    // SAFETY: between fork and exec only prctl, getppid and _exit are called, which
    // are async-signal-safe and touch no memory of ours.
    unsafe {
        command.pre_exec(move || {
            libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
            // The worker may have died before the system knew of our wish.
            if libc::getppid() as u32 != worker {
                libc::_exit(1);
            }
            Ok(())
        });
    }
}

async fn tail(stream: &mut (impl AsyncRead + Unpin)) -> String {
    let mut kept: Vec<u8> = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(n @ 1..) = stream.read(&mut buffer).await {
        kept.extend_from_slice(&buffer[..n]);
        if kept.len() > 2 * TAIL_BYTES {
            kept.drain(..kept.len() - TAIL_BYTES);
        }
    }
    let start = kept.len().saturating_sub(TAIL_BYTES);
    String::from_utf8_lossy(&kept[start..]).trim().to_string()
}

fn interpret<T: for<'a> Deserialize<'a>>(
    out: &[u8],
    err: &str,
    status: ExitStatus,
    memory_limit_mib: Option<u64>,
) -> Result<Ended<T>> {
    let said = if err.is_empty() { "it wrote nothing to standard error".to_string() } else { err.to_string() };
    // The system's answer to a refused allocation is an abort; the reason is the limit.
    if let Some(mib) = memory_limit_mib
        && !status.success()
        && ["memory allocation of", "out of memory", "Cannot allocate memory"].iter().any(|w| err.contains(w))
    {
        return Ok(Ended::Refused(format!("ran into its memory limit of {mib} MiB ({})", last_line(err))));
    }
    Ok(match (status.code(), serde_json::from_slice::<Reply<T>>(out)) {
        (Some(0), Ok(Reply { ok: Some(answer), .. })) => Ended::Answered(answer),
        (Some(1), Ok(Reply { error: Some(e), .. })) if e.unavailable => {
            let error = Error::new(e.message).kind(ErrorKind::Unavailable);
            return Err(e.help.into_iter().fold(error, Error::help));
        }
        (Some(1), Ok(Reply { error: Some(e), .. })) => Ended::Refused(match e.help {
            Some(help) => format!("{} (help: {help})", e.message),
            None => e.message,
        }),
        (Some(0), Err(e)) => Ended::Crashed(format!("its answer cannot be read ({e}): {said}")),
        (Some(101), _) => Ended::Crashed(format!("panicked: {said}")),
        (Some(code), _) => Ended::Crashed(format!("exit code {code}: {said}")),
        (None, _) => Ended::Crashed(format!("{}: {said}", signal(status))),
    })
}

fn last_line(text: &str) -> &str {
    text.lines().rfind(|l| l.contains("memory")).unwrap_or(text).trim()
}

#[cfg(unix)]
fn signal(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt;
    let names = [
        (libc::SIGHUP, "SIGHUP"),
        (libc::SIGINT, "SIGINT"),
        (libc::SIGQUIT, "SIGQUIT"),
        (libc::SIGILL, "SIGILL"),
        (libc::SIGTRAP, "SIGTRAP"),
        (libc::SIGABRT, "SIGABRT"),
        (libc::SIGBUS, "SIGBUS"),
        (libc::SIGFPE, "SIGFPE"),
        (libc::SIGKILL, "SIGKILL"),
        (libc::SIGSEGV, "SIGSEGV"),
        (libc::SIGPIPE, "SIGPIPE"),
        (libc::SIGTERM, "SIGTERM"),
        (libc::SIGXCPU, "SIGXCPU"),
        (libc::SIGXFSZ, "SIGXFSZ"),
        (libc::SIGSYS, "SIGSYS"),
    ];
    let number = status.signal().unwrap_or(0);
    match names.iter().find(|(n, _)| *n == number) {
        Some((_, name)) => format!("killed by {name} (signal {number})"),
        None => format!("killed by signal {number}"),
    }
}

#[cfg(not(unix))]
fn signal(status: ExitStatus) -> String {
    format!("ended with {status}")
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;

    fn read(out: &str, err: &str, raw: i32) -> Ended<u32> {
        interpret(out.as_bytes(), err, ExitStatus::from_raw(raw), Some(64)).unwrap()
    }

    #[test]
    fn trouble_that_is_not_the_runs_is_an_error_of_the_worker() {
        let out = r#"{"error":{"message":"no space left","help":"free some","unavailable":true}}"#;
        let e = interpret::<u32>(out.as_bytes(), "", ExitStatus::from_raw(1 << 8), None).unwrap_err();
        assert!(e.kind == ErrorKind::Unavailable && e.help.is_some() && e.message == "no space left");
    }

    #[test]
    fn a_named_error_is_told_from_a_crash() {
        assert!(matches!(read(r#"{"ok":7}"#, "", 0), Ended::Answered(7)));
        let Ended::Refused(r) = read(r#"{"error":{"message":"no frames","help":"add some"}}"#, "", 1 << 8) else {
            panic!()
        };
        assert_eq!(r, "no frames (help: add some)");
        let Ended::Crashed(r) = read("", "thread 'main' panicked at x.rs", 101 << 8) else { panic!() };
        assert!(r.contains("panicked") && r.contains("x.rs"), "{r}");
        let Ended::Crashed(r) = read(r#"{"ok":7}"#, "", 9) else { panic!("an answer of a killed child is no answer") };
        assert!(r.contains("SIGKILL (signal 9)"), "{r}");
        let Ended::Refused(r) = read("", "memory allocation of 800 bytes failed", 6) else { panic!() };
        assert!(r.contains("memory limit of 64 MiB"), "{r}");
        assert!(matches!(read("gibberish", "", 0), Ended::Crashed(_)));
    }
}
