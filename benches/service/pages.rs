//! Pages, matrix and CSV of finished studies.

use super::http::{Connection, escape};
use super::made;
use super::server::Server;
use super::show::{many, ms, note, one};
use std::time::{Duration, Instant};

pub fn figure() {
    of("1,000 runs", 5, 2, "< 10 (p95)", "MLflow 30 / 56 p95");
    of("100,000 runs", 50, 20, "< 50 (p95)", "");
}

/// Numbers that vary from request to request, the same every time.
struct Draws(u64);

impl Draws {
    fn to(&mut self, n: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % n
    }
}

/// A question that nobody has asked before.
fn question(d: &mut Draws) -> String {
    let depth = d.to(9) + 2;
    let time = (d.to(1000) + 1) as f64 / 300.0;
    let fov = d.to(110) + 10;
    let triangles = d.to(60_000);
    let filter = match d.to(8) {
        0 => format!("structure = octree and depth >= {depth} and total_cull_ms < {time}"),
        1 => format!("depth in {}..{depth} and mean_triangles > {triangles}", depth / 2),
        2 => format!("total_cull_ms in {}..{time} or mean_draw_calls > {}", time / 2.0, triangles / 70),
        3 => format!("not (structure = list) and (culling in (none, \"frustum+back_face\") or total_cull_ms > {time})"),
        4 => format!("camera.fov_y_deg >= {fov} and scene.offset_m < {} and status = done", 1 + triangles * 10),
        5 => format!("culling != none and not (mean_triangles <= {triangles} or depth = {depth})"),
        6 => format!("class = conservative and build_ms in {time}..9"),
        _ => format!("mean_nodes_visited > {}", triangles / 20),
    };
    let sort = ["", "total_cull_ms", "-total_cull_ms,scene", "depth,-mean_triangles", "structure,culling", "-build_ms"]
        [d.to(6) as usize];
    format!("where={}&sort={}&limit={}", escape(&filter), escape(sort), [20, 50, 100, 200][d.to(4) as usize])
}

fn ask(connection: &mut Connection, path: &str) -> (f64, Vec<u8>) {
    let start = Instant::now();
    let reply = connection.get(path);
    let took = ms(start.elapsed());
    assert_eq!(reply.status, 200, "{path}: {}", String::from_utf8_lossy(&reply.body));
    (took, reply.body)
}

fn of(what: &str, scenes: usize, cameras: usize, target: &str, peers: &str) {
    let name = format!("wide-{}", scenes * cameras * 100);
    let kept = made::finished(&name, scenes, cameras);
    let dir = tempfile::tempdir().expect("a folder");
    let db = dir.path().join("x.db");
    std::fs::copy(&kept, &db).expect("room on the disk");
    let runs = format!("/api/v1/studies/{name}/runs");

    // The first time: metrics are computed of all frames, and kept.
    let server = Server::start(&db, &["--no-workers"]);
    let rest = server.rss_mib().0;
    let (first, _) = ask(&mut server.connect(), &runs);
    let (_, most) = server.rss_mib();
    one(&format!("{what}: first page ever (metrics are computed)"), first, "ms", "", "");
    note(&format!(
        "server: {rest:.0} MiB at rest, {most:.0} MiB at most meanwhile, CPU {:.1} s",
        server.cpu().as_secs_f64()
    ));
    drop(server);

    let server = Server::start(&db, &["--no-workers"]);
    let mut connection = server.connect();
    let (first, _) = ask(&mut connection, &runs);
    one(&format!("{what}: first page after a restart"), first, "ms", "", "");
    note(&format!("CPU {:.1} s", server.cpu().as_secs_f64()));
    let (first, _) = ask(&mut connection, "/api/v1/studies");
    one(&format!("{what}: first list of studies (runs are counted)"), first, "ms", "", "");
    let loaded = server.rss_mib();

    let before = server.cpu();
    let mut draws = Draws(0x9E37_79B9_7F4A_7C15);
    let (mut plain, mut packed, mut bytes, mut totals) = (Vec::new(), Vec::new(), 0, Vec::new());
    for round in 0..200 {
        // As browsers ask, every second time.
        connection.gzip = false;
        let mut path = format!("{runs}?{}", question(&mut draws));
        for _page in 0..3 {
            let (took, body) = ask(&mut connection, &path);
            plain.push(took);
            bytes += body.len();
            let page: serde_json::Value = serde_json::from_slice(&body).expect("JSON");
            totals.push(page["total"].as_f64().unwrap_or(0.0));
            let Some(next) = page["next"].as_str() else { break };
            let from = path.find("&cursor=").unwrap_or(path.len());
            path = format!("{}&cursor={next}", &path[..from]);
        }
        if round % 2 == 0 {
            connection.gzip = true;
            packed.push(ask(&mut connection, &format!("{runs}?{}", question(&mut draws))).0);
        }
    }
    connection.gzip = false;
    let cpu = ms(server.cpu() - before) / (plain.len() + packed.len()) as f64;
    many(&format!("{what}: filtered and sorted page, cursors"), &plain, "ms", target, peers);
    many(&format!("{what}: the same, gzip"), &packed, "ms", target, peers);
    note(&format!(
        "{cpu:.1} ms of the server's CPU a page; {} bytes, {:.0} runs pass in the median",
        bytes / plain.len(),
        cullmark::stats::median(&totals)
    ));

    let mut times = |path: &str, n: usize, gzip: bool| {
        connection.gzip = gzip;
        let all: Vec<(f64, usize)> = (0..n)
            .map(|_| {
                let (took, body) = ask(&mut connection, path);
                (took, body.len())
            })
            .collect();
        (all.iter().map(|a| a.0).collect::<Vec<f64>>(), all[0].1)
    };
    let list = format!("{runs}?limit=1000&sort=-total_cull_ms");
    for (gzip, suffix) in [(false, ""), (true, ", gzip")] {
        let (t, bytes) = times(&list, 30, gzip);
        many(&format!("{what}: list of 1,000 rows{suffix}"), &t, "ms", "< 50", "MLflow 1,040");
        note(&format!("{bytes} bytes"));
        let (t, bytes) = times(&format!("/api/v1/studies/{name}/matrix?metric=mean_triangles"), 10, gzip);
        many(&format!("{what}: matrix{suffix}"), &t, "ms", "", "");
        note(&format!("{bytes} bytes"));
        let (t, bytes) = times(&format!("{runs}?format=csv"), 5, gzip);
        many(&format!("{what}: CSV of all{suffix}"), &t, "ms", "", "");
        note(&format!("{bytes} bytes"));
    }
    let (t, _) = times("/api/v1/studies", 30, false);
    many(&format!("{what}: list of studies"), &t, "ms", "", "");
    let (t, _) = times(&format!("/api/v1/studies/{name}"), 10, false);
    many(&format!("{what}: the study itself"), &t, "ms", "", "");
    let (now, most) = server.rss_mib();
    std::thread::sleep(Duration::from_secs(11));
    let later = server.rss_mib().0;
    one(&format!("{what}: server RSS with the study in memory"), later, "MiB", "< 60 (500)", "MLflow 555 / 3,122");
    note(&format!("{:.0} MiB after its first page, {now:.0} after all this, at most {most:.0}", loaded.0));
    drop(server);
    let server = Server::start(&db, &[]);
    std::thread::sleep(Duration::from_secs(1));
    let before = server.cpu();
    std::thread::sleep(Duration::from_secs(15));
    let share = (server.cpu() - before).as_secs_f64() / 15.0;
    one(&format!("{what}: CPU of a server whose workers rest"), share * 100.0, "%", "", "");
}
