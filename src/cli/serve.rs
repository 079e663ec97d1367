//! `cullmark serve`: what a lab leaves running.

use super::signals;
use crate::api::{self, App, Config};
use crate::error::Error;
use crate::machine;
use crate::store::{DEFAULT_DB, Pool, Store};
use crate::worker::child::Launcher;
use crate::worker::{self, Phase, lane};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Notify, watch};

#[derive(clap::Args)]
#[command(
    after_help = "Tokens are made with `cullmark token add`; without any, whoever reaches the address may do all.\n\
    Ctrl-C ends what is under way within --grace-s, or gives it back; again to stop at once."
)]
pub struct Args {
    /// Address to listen on; port 0 takes a free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:7878")]
    listen: SocketAddr,
    #[command(flatten)]
    workers: Workers,
    /// Only serve; `cullmark worker` or `cullmark run` does the work
    #[arg(long)]
    no_workers: bool,
    /// Folder whose scene and path files manifests may name (repeatable)
    #[arg(long, value_name = "DIR")]
    scenes: Vec<PathBuf>,
    /// Folder of uploads (default: beside the database)
    #[arg(long, value_name = "DIR")]
    upload_dir: Option<PathBuf>,
    #[arg(long, value_name = "MIB", default_value_t = 512)]
    max_upload_mib: u64,
    /// Cells a study may have
    #[arg(long, value_name = "N", default_value_t = 200_000)]
    max_cells: u64,
    /// Requests a second and client; 0 is no limit
    #[arg(long, value_name = "N", default_value_t = 200.0)]
    rate: f64,
    /// A request may take so long
    #[arg(long, value_name = "S", default_value_t = 60)]
    timeout_s: u64,
    /// A trial of a submitted study may take so long
    #[arg(long, value_name = "S", default_value_t = 3600.0)]
    run_timeout_s: f64,
    /// Memory of processes that read, show and measure scenes
    #[arg(long, value_name = "MIB", default_value_t = 8192)]
    memory_limit_mib: u64,
    /// Listen beyond this machine without any token
    #[arg(long)]
    open_to_all: bool,
    /// How log lines on standard error look
    #[arg(long, value_enum, default_value_t = Log::Text)]
    log: Log,
    /// Also log every request
    #[arg(long)]
    verbose: bool,
}

/// Flags of whoever works for a whole database.
#[derive(clap::Args)]
pub struct Workers {
    /// Database of results
    #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
    pub db: PathBuf,
    /// Parsed scenes and ground truth are kept here (default: beside the database)
    #[arg(long, value_name = "DIR")]
    pub cache_dir: Option<PathBuf>,
    /// Workers beside the measuring lane (default: one a spare core)
    #[arg(long, value_name = "N")]
    pub workers: Option<usize>,
    /// When asked to end, wait so long for what is under way
    #[arg(long, value_name = "S", default_value_t = 10)]
    pub grace_s: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Log {
    Text,
    /// One JSON object a line
    Json,
}

impl Workers {
    pub fn folder(&self) -> PathBuf {
        self.db.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_path_buf()
    }

    pub fn options(&self, launcher: &Launcher) -> crate::Result<worker::Options> {
        Ok(worker::Options {
            launcher: launcher.clone(),
            cache_dir: self.cache_dir.clone().unwrap_or_else(|| self.folder().join("cache")),
            lane_file: lane::default_path(),
            auxiliary: worker::auxiliary_workers(self.workers, launcher.cores.len())?,
        })
    }
}

pub fn start_log(log: Log, verbose: bool) {
    let level = if verbose { tracing::Level::DEBUG } else { tracing::Level::INFO };
    let builder = tracing_subscriber::fmt().with_max_level(level).with_writer(std::io::stderr).with_target(false);
    match log {
        Log::Text => builder.with_ansi(false).init(),
        Log::Json => builder.json().flatten_event(true).init(),
    }
}

/// Whose trials this program may measure here.
pub fn pool_here() -> Pool {
    Pool {
        machine_class: machine::environment(None).machine_class,
        build_profile: machine::build_profile().to_string(),
    }
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    // Counted and left before any thread starts: threads inherit where they may run.
    let launcher = Launcher::here()?;
    let pool = pool_here();
    launcher.leave_the_lane();
    start_log(args.log, args.verbose);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(4).enable_all().build()?;
    let code = runtime.block_on(serve(args, launcher, pool));
    runtime.shutdown_timeout(Duration::from_secs(2));
    code
}

fn allowed(folders: &[PathBuf]) -> crate::Result<Vec<PathBuf>> {
    folders
        .iter()
        .map(|f| match f.canonicalize() {
            Ok(real) if real.is_dir() => Ok(real),
            Ok(_) => Err(Error::new("is no folder").in_file(f).key("--scenes")),
            Err(e) => Err(Error::io(f, "cannot be read", &e).key("--scenes")),
        })
        .collect()
}

async fn serve(args: Args, launcher: Launcher, pool: Pool) -> anyhow::Result<ExitCode> {
    let store = Store::open(&args.workers.db).await?;
    if !args.listen.ip().is_loopback() && !args.open_to_all && !store.has_tokens().await? {
        return Err(Error::new(format!("{} can be reached from other machines, and there is no token", args.listen))
            .key("--listen")
            .help("make one (`cullmark token add NAME --role admin`), or say --open-to-all")
            .into());
    }
    let options = args.workers.options(&launcher)?;
    let config = Config {
        loopback: args.listen.ip().is_loopback(),
        folders: allowed(&args.scenes)?,
        upload_dir: args.upload_dir.clone().unwrap_or_else(|| args.workers.folder().join("uploads")),
        cache_dir: options.cache_dir.clone(),
        max_upload_bytes: args.max_upload_mib << 20,
        max_cells: args.max_cells,
        rate: args.rate,
        timeout: Duration::from_secs(args.timeout_s.max(1)),
        run_timeout_s: args.run_timeout_s,
        memory_limit_mib: args.memory_limit_mib,
        pool: pool.clone(),
        launcher,
    };
    let listener = listen(args.listen).await?;
    let (phase, phases) = watch::channel(Phase::Work);
    let wake = Arc::new(Notify::new());
    let workers = if args.no_workers { 0 } else { worker::crew_size(&options) };
    let app = Arc::new(App::new(store.clone(), config, workers, wake.clone(), phases.clone()));
    let address = listener.local_addr()?;
    tracing::info!(%address, workers, machine_class = pool.machine_class, "serving");
    println!("listening on http://{address}");

    let teller = app.clone();
    let tell: worker::Listener = Arc::new(move |event| teller.on(&event));
    let crew = {
        let store = store.clone();
        tokio::spawn(async move {
            if workers > 0 {
                worker::pool(&store, pool, &options, tell, phases, wake).await;
            }
        })
    };
    let http = tokio::spawn(api::serve(app, listener));
    ended(phase, Duration::from_secs(args.workers.grace_s), crew).await;
    // Whoever still downloads has had the grace, too.
    let _ = tokio::time::timeout(Duration::from_secs(5), http).await;
    store.close().await;
    tracing::info!("ended");
    Ok(ExitCode::SUCCESS)
}

/// A server that was killed while it forked a child keeps its socket until that child is
/// scheduled and dies, too: whoever starts the next one at once need not care.
async fn listen(address: SocketAddr) -> crate::Result<tokio::net::TcpListener> {
    let mut tries = 0;
    loop {
        match tokio::net::TcpListener::bind(address).await {
            Ok(listener) => return Ok(listener),
            Err(e) if e.kind() == std::io::ErrorKind::AddrInUse && tries < 20 => tries += 1,
            Err(e) => {
                return Err(Error::new(format!("cannot listen on {address}: {e}"))
                    .key("--listen")
                    .help("choose another port (0 takes a free one), or end what uses this one"));
            }
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Waits for a signal; then for the workers, as long as they are given.
pub async fn ended(phase: watch::Sender<Phase>, grace: Duration, mut crew: tokio::task::JoinHandle<()>) {
    let mut signals = signals::listen();
    tokio::select! {
        _ = signals.recv() => {}
        // Without workers on purpose they end at once; otherwise one of ours panicked.
        done = &mut crew => {
            if let Err(e) = done {
                tracing::error!(error = %e, "the workers ended by a mistake of ours: start the server again");
                let _ = phase.send(Phase::Stop);
                return;
            }
            signals.recv().await;
            let _ = phase.send(Phase::Drain);
            return;
        }
    }
    tracing::info!(
        grace_s = grace.as_secs(),
        "ending: what is under way is finished or given back (again to stop at once)"
    );
    let _ = phase.send(Phase::Drain);
    tokio::select! {
        _ = &mut crew => return,
        () = tokio::time::sleep(grace) => {}
        _ = signals.recv() => {}
    }
    let _ = phase.send(Phase::Stop);
    let _ = tokio::time::timeout(Duration::from_secs(20), crew).await;
}
