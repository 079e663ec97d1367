//! A hundred watchers of one study while its runs end.

use super::made;
use super::server::Server;
use super::show::{many, ms, note, one};
use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

const WATCHERS: usize = 100;
const RUNS: usize = 200;

/// Milliseconds since 1970 at which the last watcher was told, by run; and how many were.
type Told = HashMap<String, (f64, usize)>;

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(f64::NAN, ms)
}

pub fn figure() {
    let dir = tempfile::tempdir().expect("a folder");
    let db = dir.path().join("x.db");
    let server = Server::start(&db, &[]);
    let alone = work(&server, "alone", 0).1;
    let (told, cpu) = work(&server, "watched", WATCHERS);
    let ended = ended(&db);
    assert!(told.len() == RUNS && told.values().all(|t| t.1 == WATCHERS), "{} of {RUNS} told", told.len());
    let delays: Vec<f64> = told.iter().map(|(run, (at, _))| at - ended[run]).collect();
    many("100 watchers: a run ends .. the last one knows", &delays, "ms", "", "");
    one("server CPU for 200 runs, nobody watching", alone.as_secs_f64(), "s", "", "");
    one("server CPU for 200 runs, 100 watchers", cpu.as_secs_f64(), "s", "", "");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let idle = runtime.block_on(async {
        let told = Arc::default();
        let watchers: Vec<_> = (0..WATCHERS)
            .map(|_| tokio::spawn(watch(server.address.clone(), "watched", Arc::clone(&told), false)))
            .collect();
        tokio::time::sleep(Duration::from_secs(1)).await;
        let before = server.cpu();
        tokio::time::sleep(Duration::from_secs(10)).await;
        watchers.iter().for_each(|w| w.abort());
        (server.cpu() - before).as_secs_f64() / 10.0
    });
    one("server CPU at rest, 100 watchers", idle * 100.0, "%", "", "");
    let (now, most) = server.rss_mib();
    note(&format!("changes are joined for 150 ms by design; server RSS {now:.0} MiB, at most {most:.0}"));
}

/// Runs a study of trivial cells while so many watch.
fn work(server: &Server, name: &'static str, watchers: usize) -> (Told, Duration) {
    let mut connection = server.connect();
    connection.post("/api/v1/pool/pause", &serde_json::json!({})).json();
    // Other cells than the study before had, which would be done already.
    made::submit(&mut connection, &made::trivial(name, RUNS, name.len()), false);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let told: Arc<Mutex<Told>> = Arc::default();
    let start = Instant::now();
    let cpu = runtime.block_on(async {
        let all: Vec<_> =
            (0..watchers).map(|_| tokio::spawn(watch(server.address.clone(), name, told.clone(), true))).collect();
        tokio::time::sleep(Duration::from_millis(500)).await;
        let before = server.cpu();
        connection.post("/api/v1/pool/resume", &serde_json::json!({})).json();
        for watcher in all {
            watcher.await.expect("a watcher");
        }
        if watchers == 0 {
            // Asking costs the server, too: rarely.
            while connection.get(&format!("/api/v1/studies/{name}")).json()["finished"] != true {
                tokio::time::sleep(Duration::from_millis(500)).await;
            }
        }
        server.cpu() - before
    });
    note(&format!("{RUNS} runs, {watchers} watchers: {:.1} s", start.elapsed().as_secs_f64()));
    (std::mem::take(&mut told.lock().expect("a lock")), cpu)
}

/// Notes when it hears of a run; until the study ends.
async fn watch(address: String, study: &'static str, told: Arc<Mutex<Told>>, until_end: bool) {
    let mut stream = TcpStream::connect(&address).await.expect("the server listens");
    let request = format!("GET /api/v1/studies/{study}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
    stream.write_all(request.as_bytes()).await.expect("the server reads");
    let (mut kept, mut buffer) = (String::new(), vec![0; 1 << 16]);
    loop {
        let n = stream.read(&mut buffer).await.expect("the server writes");
        assert!(n > 0, "the server closed the stream");
        let at = now();
        assert!(!buffer[..n].starts_with(b"HTTP/1.1 4"), "{}", String::from_utf8_lossy(&buffer[..n]));
        kept.push_str(&String::from_utf8_lossy(&buffer[..n]));
        while let Some(end) = kept.find('\n') {
            let line: String = kept.drain(..=end).collect();
            if until_end && line.starts_with("event: end") {
                return;
            }
            let run = line
                .strip_prefix("data: ")
                .filter(|d| d.contains("\"ordinal\""))
                .and_then(|d| d.split("\"run\":\"").nth(1));
            if let Some(run) = run.and_then(|r| r.get(..32)) {
                let mut told = told.lock().expect("a lock");
                let entry = told.entry(run.to_string()).or_insert((0.0, 0));
                *entry = (entry.0.max(at), entry.1 + 1);
            }
        }
    }
}

/// When the store decided that a run is over.
fn ended(db: &Path) -> HashMap<String, f64> {
    cullmark::store::block_on(async {
        let options = sqlx::sqlite::SqliteConnectOptions::new().filename(db).read_only(true);
        let pool = sqlx::SqlitePool::connect_with(options).await.expect("the database");
        let sql = "SELECT measurement_id, finished_ms FROM measurements WHERE finished_ms IS NOT NULL";
        let rows: Vec<(String, i64)> = sqlx::query_as(sql).fetch_all(&pool).await.expect("rows");
        rows.into_iter().map(|(id, at)| (id, at as f64)).collect()
    })
}
