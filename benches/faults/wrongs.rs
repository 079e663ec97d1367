//! What may go wrong beside kills: a full disk, a locked database, a worker that does not
//! move until its lease is another's.

use super::crew::{Crew, Role};
use super::lab::Lab;
use super::{LULL, Plan, real};
use cullmark::store::block_on;
use cullmark::store::queue::LEASE;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::RngCore;
use sqlx::{Connection, SqliteConnection};
use std::time::{Duration, Instant};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrong {
    Full,
    Lock,
    LongLock,
    Stop,
}

pub const NAMES: [&str; 4] =
    ["disk full, 1-2 s", "database locked, 1-3 s", "database locked, 25 s", "worker stopped until its lease ran out"];

/// A pool looks so often for leases that ran out.
const MEND: Duration = Duration::from_secs(5);

/// Which before which kill, in order.
pub fn shuffled(plan: &Plan, rng: &mut ChaCha8Rng) -> Vec<(u64, Wrong)> {
    let counts = [
        (Wrong::Full, plan.full),
        (Wrong::Lock, plan.locks),
        (Wrong::LongLock, plan.long_locks),
        (Wrong::Stop, plan.stops),
    ];
    let all = counts.into_iter().flat_map(|(w, n)| std::iter::repeat_n(w, n as usize));
    let mut out: Vec<(u64, Wrong)> = all.map(|w| (u64::from(rng.next_u32()) % plan.kills.max(1), w)).collect();
    out.sort_by_key(|(at, _)| *at);
    out
}

pub fn inflict(lab: &Lab, crew: &mut Crew, rng: &mut ChaCha8Rng, wrong: Wrong, with_kill: bool) {
    if (wrong == Wrong::Full && !lab.can_be_full) || (wrong == Wrong::Stop && !crew.stop()) {
        return;
    }
    let seconds = match wrong {
        Wrong::Full => 1.0 + real(rng),
        Wrong::Lock => 1.0 + 2.0 * real(rng),
        Wrong::LongLock => 25.0,
        Wrong::Stop => (LEASE + MEND).as_secs_f64() + 2.0,
    };
    let time = Duration::from_secs_f64(seconds);
    let before = time.mul_f64(real(rng) * 0.8);
    // A stopped worker is not killed: it is to come back.
    let role = if wrong == Wrong::Stop || rng.next_u32().is_multiple_of(2) { Role::Server } else { Role::Worker };
    let exclusive = rng.next_u32().is_multiple_of(2);
    crew.troubled = wrong != Wrong::Stop;
    let mut meanwhile = || {
        let end = Instant::now() + time;
        crew.pass(before);
        if with_kill {
            crew.kill(role, rng);
        }
        crew.pass(end.saturating_duration_since(Instant::now()));
    };
    match wrong {
        Wrong::Full => {
            fold_log(lab);
            lab.fill(time, meanwhile);
        }
        Wrong::Lock | Wrong::LongLock => lock(lab, exclusive, meanwhile),
        Wrong::Stop => {
            meanwhile();
            crew.go_on();
        }
    }
    crew.tally.wrongs[wrong as usize] += 1;
    // A new process would hide that an old one never works again; twice of each kind is enough.
    recover(crew, NAMES[wrong as usize], !with_kill && crew.tally.wrongs[wrong as usize] <= 3);
}

/// Work must go on, and nobody may be in trouble any more: that is `watched` for a while.
fn recover(crew: &mut Crew, name: &'static str, watched: bool) {
    let over = Instant::now();
    let mut first = None;
    while !crew.finished() {
        let told = crew.progress();
        first = first.or(told);
        if told.is_some() && told != first {
            crew.tally.recovered_ms.push((name, over.elapsed().as_secs_f64() * 1e3));
            break;
        }
        if over.elapsed() > Duration::from_secs(60) {
            crew.tally.violations.push(format!("{name}: over for a minute, and nothing goes on"));
            break;
        }
        crew.pass(Duration::from_millis(5));
    }
    crew.pass(Duration::from_secs(1).saturating_sub(over.elapsed()));
    crew.troubled = false;
    if watched {
        let told = crew.troubles().len();
        crew.pass(LULL);
        for trouble in crew.troubles().into_iter().skip(told) {
            crew.tally.violations.push(format!("{name}: over for more than a second, and still told: {trouble}"));
        }
    }
}

async fn connect(lab: &Lab) -> SqliteConnection {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(lab.database());
    let options = options.busy_timeout(Duration::from_secs(30));
    SqliteConnection::connect_with(&options).await.expect("the database opens")
}

/// Whether a job waits again, or is done again, after its child crashed. Looks without a trace:
/// a reader that may not write folds no log when it closes.
pub fn is_a_crash_open(lab: &Lab) -> bool {
    let sql = "SELECT EXISTS (SELECT 1 FROM jobs j JOIN attempts a ON a.job_id = j.id \
               WHERE j.state IN ('queued', 'leased') AND a.outcome = 'crashed')";
    block_on(async {
        let options = sqlx::sqlite::SqliteConnectOptions::new().filename(lab.database()).read_only(true);
        let Ok(mut connection) = SqliteConnection::connect_with(&options).await else { return true };
        let open = sqlx::query_scalar(sql).fetch_one(&mut connection).await;
        let _ = connection.close().await;
        open.unwrap_or(true)
    })
}

/// Folds the write-ahead log into the database, so that the next commit needs room.
fn fold_log(lab: &Lab) {
    block_on(async {
        let mut connection = connect(lab).await;
        sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").execute(&mut connection).await.expect("folding the log");
        connection.close().await.expect("closing");
    });
}

fn lock(lab: &Lab, exclusive: bool, meanwhile: impl FnOnce()) {
    block_on(async {
        let mut connection = connect(lab).await;
        let begin = if exclusive { "BEGIN EXCLUSIVE" } else { "BEGIN IMMEDIATE" };
        sqlx::query(begin).execute(&mut connection).await.expect("the lock");
        meanwhile();
        sqlx::query("ROLLBACK").execute(&mut connection).await.expect("letting go");
        connection.close().await.expect("closing");
    });
}
