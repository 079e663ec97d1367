//! Studies, queue and results in one SQLite file (WAL, embedded migrations).
//!
//! One connection writes, a few read. Every write that is more than a statement
//! is a `BEGIN IMMEDIATE` transaction: a deferred one that reads first and writes
//! later fails under contention whatever the busy time-out.
//!
//! - `submit`: a study's matrix becomes rows, idempotently;
//! - `queue`: jobs are leased with an epoch, renewed, given back, accepted once;
//! - `settle`: what the accepted trials and the judgement make of a measurement;
//! - `read`: results for reports, queries and comparisons;
//! - `control`: pause, resume, cancel, retry, delete; whose turn it is;
//! - `changes`, `facts`: what is new since a reader looked, and what it computed of it;
//! - `tokens`, `uploads`: who may ask, and files that users sent;
//! - `archive`, `compact`, `backup`: one-file exchange, size, a copy of all of it.

mod accept;
pub mod advice;
pub mod archive;
pub mod artifacts;
pub mod backup;
mod blob;
mod changes;
pub mod compact;
pub mod control;
mod error;
pub mod facts;
mod fetch;
pub mod known;
mod lease;
mod noise;
mod open_runs;
mod overview;
mod owner;
pub mod queue;
pub mod read;
mod rows;
pub mod run_page;
mod series;
pub mod settle;
pub mod submit;
pub mod tokens;
mod turns;
pub mod uploads;

use crate::error::{Error, Result};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{ConnectOptions, Connection};
use std::path::{Path, PathBuf};
use std::time::Duration;

pub use control::StudyState;
pub use lease::Pool;
pub use overview::{Counted, JobCounts, Overview, RunCounts};
pub use queue::{Accepted, Job, Kind, Lease, Left, Outcome};
pub use read::Detail;
pub use series::read_series;
pub use settle::Settled;
pub use submit::{Cell, Submission, Submitted};

static MIGRATIONS: sqlx::migrate::Migrator = sqlx::migrate!();

/// Where a study goes unless `--db` says otherwise.
pub const DEFAULT_DB: &str = ".cullmark/cullmark.db";

/// "CULM": tells our files from other SQLite databases.
const APPLICATION_ID: i64 = 0x4355_4c4d;

/// How long a writer waits for another process before it calls the file locked.
const BUSY_TIMEOUT: Duration = Duration::from_secs(20);

/// An open database. Cheap to clone; safe to share between tasks and processes.
#[derive(Clone, Debug)]
pub struct Store {
    path: PathBuf,
    writer: SqlitePool,
    readers: SqlitePool,
    /// Workers look for jobs here: slow readers must not hold them up.
    queue: SqlitePool,
}

impl Store {
    /// Opens `path`, creates it with its folder if missing, and brings its schema up to date.
    ///
    /// # Errors
    /// When it cannot be opened or written, is no SQLite file, belongs to another
    /// program or to a newer cullmark.
    pub async fn open(path: &Path) -> Result<Store> {
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|e| {
                Error::io(folder, "the folder of the database cannot be made", &e).help("choose another file with --db")
            })?;
        }
        Store::connect(path, true).await
    }

    /// Opens a database that must be there.
    ///
    /// # Errors
    /// As [`Store::open`], and when there is no such file.
    pub async fn open_existing(path: &Path) -> Result<Store> {
        if !path.is_file() {
            return Err(Error::new("there is no such database")
                .in_file(path)
                .help("run a study first (`cullmark run experiments/quick.toml`), or name another file with --db"));
        }
        Store::connect(path, false).await
    }

    async fn connect(path: &Path, create: bool) -> Result<Store> {
        let options = SqliteConnectOptions::new()
            .filename(path)
            .create_if_missing(create)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Normal)
            .busy_timeout(BUSY_TIMEOUT)
            .statement_cache_capacity(200)
            .disable_statement_logging();
        let pool = |connections| {
            SqlitePoolOptions::new()
                .max_connections(connections)
                .test_before_acquire(false)
                // A full disk ends a transaction behind sqlx's back: it then fails to roll back, and takes
                // the connection to be within that transaction for ever.
                .before_acquire(|c, _| Box::pin(std::future::ready(Ok(!c.is_in_transaction()))))
                .idle_timeout(None)
                .max_lifetime(None)
                .acquire_timeout(Duration::from_secs(60))
        };
        let writer = pool(1).connect_with(options.clone()).await.map_err(|e| error::explain(path, "opening it", &e))?;
        let readers = pool(4).connect_lazy_with(options.clone());
        let queue = pool(1).connect_lazy_with(options);
        let store = Store { path: path.to_path_buf(), writer, readers, queue };
        store.prepare().await?;
        Ok(store)
    }

    /// Migrations, after a look at whose file it is.
    async fn prepare(&self) -> Result<()> {
        let id: i64 = sqlx::query_scalar("PRAGMA application_id")
            .fetch_one(&self.writer)
            .await
            .map_err(|e| self.explain("opening it", &e))?;
        let tables: i64 = sqlx::query_scalar("SELECT count(*) FROM sqlite_master WHERE type = 'table'")
            .fetch_one(&self.writer)
            .await
            .map_err(|e| self.explain("opening it", &e))?;
        if id != APPLICATION_ID && tables > 0 && !self.is_half_made().await? {
            return Err(Error::new("this SQLite database belongs to another program")
                .in_file(&self.path)
                .help("choose another file with --db"));
        }
        // Two processes may create one file at once; the loser finds the work done when it looks again.
        let mut tries = 0;
        loop {
            match MIGRATIONS.run(&self.writer).await {
                Ok(()) => break,
                Err(sqlx::migrate::MigrateError::Execute(_) | sqlx::migrate::MigrateError::ExecuteMigration(..))
                    if tries < 5 =>
                {
                    tries += 1;
                    tokio::time::sleep(Duration::from_millis(40 * tries)).await;
                }
                Err(e) => return Err(error::explain_migration(&self.path, &e)),
            }
        }
        if id != APPLICATION_ID {
            sqlx::query("PRAGMA application_id = 1129663565")
                .execute(&self.writer)
                .await
                .map_err(|e| self.explain("preparing it", &e))?;
        }
        Ok(())
    }

    /// A process that is creating the file right now has made the table of
    /// migrations but not yet left its mark.
    async fn is_half_made(&self) -> Result<bool> {
        let ours: i64 = sqlx::query_scalar("SELECT count(*) FROM sqlite_master WHERE name = '_sqlx_migrations'")
            .fetch_one(&self.writer)
            .await
            .map_err(|e| self.explain("opening it", &e))?;
        Ok(ours > 0)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Closes all connections, so that SQLite folds its write-ahead log into the file.
    pub async fn close(self) {
        self.readers.close().await;
        self.queue.close().await;
        self.writer.close().await;
    }

    /// Makes SQLite refuse to grow the file beyond so many pages: a real
    /// "disk full" for those who want to see what happens then.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn limit_pages(&self, pages: u32) -> Result<()> {
        let sql = sqlx::AssertSqlSafe(format!("PRAGMA max_page_count = {pages}"));
        sqlx::query(sql).execute(&self.writer).await.map_err(|e| self.explain("limiting it", &e))?;
        Ok(())
    }

    fn explain(&self, doing: &str, e: &sqlx::Error) -> Error {
        error::explain(&self.path, doing, e)
    }

    async fn begin(&self, doing: &str) -> Result<sqlx::Transaction<'static, sqlx::Sqlite>> {
        self.writer.begin_with("BEGIN IMMEDIATE").await.map_err(|e| self.explain(doing, &e))
    }
}

/// Runs store work from a synchronous verb.
///
/// # Panics
/// If the system refuses the threads of a runtime.
pub fn block_on<T>(work: impl Future<Output = T>) -> T {
    tokio::runtime::Builder::new_current_thread().enable_all().build().expect("an async runtime").block_on(work)
}

/// The results of `study` (a name, or `name@series`) in the database at `db`: for synchronous verbs.
///
/// # Errors
/// When there is no such database or study, or reading fails.
pub fn read_results(db: &Path, study: &str, detail: Detail) -> Result<crate::results::StudyResults> {
    block_on(async {
        let store = Store::open_existing(db).await?;
        let results = store.results_with(study, detail).await;
        store.close().await;
        results
    })
}

/// How progress and logs call a run: `scene: structure × culling` by their short labels,
/// further axes where they are not the usual ones.
fn label(spec: &crate::record::RunSpec, structure: &str, culling: &str) -> String {
    let further: String = spec.further().iter().map(|l| format!(" × {l}")).collect();
    format!("{}: {structure} × {culling}{further}", spec.scene.name)
}

/// Milliseconds since 1970, UTC.
fn now_ms() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    since.as_millis() as i64
}
