//! Studies and what came of their trials, made by hand.

use super::http::Connection;
use super::server::Server;
use cullmark::culling::{Class, Removes};
use cullmark::manifest::Manifest;
use cullmark::record::*;
use cullmark::store::{Kind, Lease, Store, Submission, block_on};
use cullmark::{intake, machine, matrix};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// `scenes` x 10 structures x 10 tests x `cameras` cells, judged.
pub fn wide(name: &str, scenes: usize, cameras: usize) -> String {
    format!(
        r#"
[study]
name = "{name}"
[measure]
repeats = 1
passes = 1
[accuracy]
frames = 2
width_px = 64
height_px = 36
[[scene]]
name = "hall"
generate = "rooms:world=1"
offset_m = {{ from = 1, to = 1e6, steps = {scenes}, scale = "log" }}
[[path]]
name = "walk"
generate = "walk:frames=20,seed=7"
[matrix]
structure = ["list", {{ kind = "octree", depth = {{ from = 2, to = 10, steps = 9 }} }}]
culling = ["none", "frustum", "back_face", "normal_mask", "octant_mask", "look_at", "normal_cone",
    "frustum+back_face", "frustum+normal_mask", "frustum+octant_mask"]
camera = [{{ kind = "perspective", fov_y_deg = {{ from = 10, to = 120, steps = {cameras} }} }}]
"#
    )
}

/// Cells that take next to nothing: twelve triangles, ten frames, the first of so many degrees.
pub fn trivial(name: &str, cells: usize, fov_y_deg: usize) -> String {
    let to = fov_y_deg + 110;
    format!(
        r#"
[study]
name = "{name}"
[measure]
repeats = 1
passes = 1
warmup_passes = 0
[accuracy]
frames = 0
[[scene]]
name = "box"
generate = "boxes:boxes=1"
[[path]]
name = "still"
generate = "static:frames=10"
[matrix]
structure = ["list"]
culling = ["frustum"]
camera = [{{ kind = "perspective", fov_y_deg = {{ from = {fov_y_deg}, to = {to}, steps = {cells} }} }}]
"#
    )
}

/// What the store takes in of a manifest, as the program on this machine makes it.
pub fn submission(manifest: &str) -> Submission {
    let manifest = Manifest::parse(manifest.into(), Path::new("bench.toml"), &[]).expect("a manifest");
    let matrix = matrix::expand(&manifest, &intake::setting(0)).expect("a matrix");
    let class = machine::environment(None).machine_class;
    intake::submission(&manifest, &matrix, class, intake::Wish::default())
}

pub fn submit(connection: &mut Connection, manifest: &str, validate_only: bool) -> (Duration, serde_json::Value) {
    let body = json!({ "manifest": manifest, "validate_only": validate_only });
    let start = Instant::now();
    let reply = connection.post("/api/v1/studies", &body);
    let took = start.elapsed();
    (took, reply.json())
}

/// Bits that differ from run to run and are the same every time.
fn draw(id: &str) -> f64 {
    f64::from(u32::from_str_radix(&id[..8], 16).unwrap_or(0)) / f64::from(u32::MAX)
}

/// A trial as the lab reports it: `frames` frames, six series, the usual counters.
pub fn record(id: &str, frames: u32, environment: &Environment) -> TrialRecord {
    let x = draw(id);
    let series = |name: &str, unit: &str, base: f64| Series {
        name: name.into(),
        unit: unit.into(),
        values: (0..frames).map(|f| (base * (1.0 + f64::from(f % 7) / 9.0)).floor()).collect(),
    };
    let cull = series("cull_ns", "ns", 900.0 + 2e5 * x * x);
    let all = vec![
        cull.clone(),
        series("triangles", "triangles", 100.0 + 5e4 * x),
        series("entries", "triangles", 100.0 + 6e4 * x),
        series("draw_calls", "calls", 1.0 + 900.0 * x),
        series("draw_calls_any_material", "calls", 1.0 + 800.0 * x),
        series("nodes_visited", "nodes", 1.0 + 3000.0 * x),
    ];
    let names = ["plane_tests", "masks", "cones", "faces", "boxes", "ranges", "predicates", "fallbacks_f64"];
    TrialRecord {
        load_ns: 1_000_000,
        build_ns: 200_000 + (1e6 * x) as u64,
        prepare_ns: 30_000,
        structure_bytes: 40_000,
        test_bytes: 5_000,
        peak_rss_bytes: 6 << 20,
        build: Default::default(),
        entries: 7_000,
        scene_triangles: 8_000,
        load: Default::default(),
        counters: names.map(|n| Counter { name: n.into(), unit: "1".into(), value: (1e6 * x).floor() }).to_vec(),
        passes_ns: vec![cull.values],
        series: all,
        frames_hash: id.into(),
        sentinel: Sentinel { before_ns: 100_000.0, after_ns: 100_000.0, involuntary_switches: 0 },
        environment: environment.clone(),
    }
}

fn judgement(hash: &str) -> Judgement {
    let frame = |frame| FrameErrors { frame, submitted: 900, visible: 300, potential: 700, ..Default::default() };
    Judgement {
        class: Class::Conservative,
        removes: Removes::default(),
        wrong: None,
        frames: vec![frame(0), frame(10)],
        frames_hash: hash.into(),
    }
}

/// Leases, accepts and settles all of a study, one job at a time.
pub async fn finish(store: &Store, study: i64, environment: &Environment) -> usize {
    while let Some(lease) = store.lease(study, Kind::Judge).await.expect("a store") {
        store.accept_judgement(&lease, &judgement(&lease.spec.answer_id()), 1_000_000).await.expect("a store");
    }
    let mut runs = 0;
    while let Some(lease) = store.lease(study, Kind::Trial).await.expect("a store") {
        accept(store, &lease, 20, environment).await;
        runs += 1;
    }
    runs
}

pub async fn accept(store: &Store, lease: &Lease, frames: u32, environment: &Environment) {
    let record = TrialRecord { frames_hash: lease.spec.answer_id(), ..record(&lease.job.target, frames, environment) };
    store.accept_trial(lease, &record, 2_000_000).await.expect("a store");
    let settled = store.settle(lease.study_id, &lease.job.target, &lease.policy).await.expect("a store");
    assert!(settled.trials_added == 0 && settled.reason.is_none(), "{settled:?}");
}

/// A folder whose files reach no disk, where there is one: finishing a hundred thousand
/// runs there costs the store's work and no waiting.
fn ram() -> tempfile::TempDir {
    let shared = Path::new("/dev/shm");
    if shared.is_dir() { tempfile::tempdir_in(shared) } else { tempfile::tempdir() }.expect("a folder")
}

/// A database made with other migrations would be refused.
fn schema() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("migrations");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("migrations").map(|e| e.expect("a file").path()).collect();
    files.sort();
    let mut hash = blake3::Hasher::new();
    for file in files {
        hash.update(&std::fs::read(file).expect("a migration"));
    }
    hash.finalize().to_hex().to_string()
}

/// A database with a finished study of so many cells, which no server has shown yet.
pub fn finished(name: &str, scenes: usize, cameras: usize) -> PathBuf {
    let manifest = wide(name, scenes, cameras);
    let environment = machine::environment(None);
    let all = (&manifest, &environment.machine_class, &environment.build_profile, schema());
    let key = blake3::hash(serde_json::to_string(&all).expect("plain data").as_bytes()).to_hex();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("service-bench");
    std::fs::create_dir_all(&folder).expect("a folder");
    let kept = folder.join(format!("{name}-{}.db", &key[..12]));
    if kept.is_file() {
        return kept;
    }
    let dir = ram();
    let db = dir.path().join("x.db");
    let server = Server::start(&db, &["--no-workers"]);
    let (took, reply) = submit(&mut server.connect(), &manifest, false);
    drop(server);
    let study = reply["submitted"]["study_id"].as_i64().expect("a study");
    let start = Instant::now();
    let runs = block_on(async {
        let store = Store::open(&db).await.expect("a store");
        let runs = finish(&store, study, &environment).await;
        store.close().await;
        runs
    });
    super::show::note(&format!(
        "{name}: {runs} cells submitted over HTTP in {:.1} s, judged, taken and settled in {:.0} s (RAM disk); kept as {}",
        took.as_secs_f64(),
        start.elapsed().as_secs_f64(),
        kept.display()
    ));
    let half = kept.with_extension("half");
    std::fs::copy(&db, &half).and_then(|_| std::fs::rename(&half, &kept)).expect("room on the disk");
    kept
}
