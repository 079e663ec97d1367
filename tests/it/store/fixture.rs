//! Cells, records and judgements made by hand, and a loop that finishes a study with them.

use cullmark::culling::{Class, Removes};
use cullmark::record::*;
use cullmark::registry::{Spec, Value};
use cullmark::results::Excluded;
use cullmark::store::{Cell, Kind, Lease, Store, Submission};
use std::path::Path;

pub(super) fn wait<T>(work: impl Future<Output = T>) -> T {
    cullmark::store::block_on(work)
}

/// A plausible cell: `depth` tells runs apart, `scene` is its block.
pub(super) fn spec(scene: &str, depth: i64) -> RunSpec {
    RunSpec {
        scene: SceneSpec {
            name: scene.into(),
            source: SceneSource::Generated(Spec::new("arena")),
            winding: Winding::Ccw,
            up: Up::Z,
            scale: 1.0,
            weld: false,
            offset_m: [0.0; 3],
            fingerprint: format!("scene {scene}"),
        },
        path: PathSpec {
            name: "walk".into(),
            source: PathSource::Generated(Spec::new("walk")),
            frames: None,
            stride: 1,
            fingerprint: "path".into(),
        },
        camera: Default::default(),
        structure: Spec::new("octree").with("depth", Value::Int(depth)),
        culling: vec![Spec::new("frustum")],
        walk: Spec::new("depth_first"),
        axes: Default::default(),
        revisions: Default::default(),
        accuracy: Accuracy { frames: 2, width_px: 64, height_px: 36, samples: 1, ..Accuracy::default() },
        protocol: Protocol {
            passes: 2,
            warmup_passes: 1,
            pin_core: None,
            build_profile: "release".into(),
            isa: "scalar".into(),
            threads: 1,
        },
        series: 0,
        model: TimeModel::default(),
    }
}

pub(super) fn policy(repeats: u32) -> RepeatPolicy {
    RepeatPolicy { repeats, relative_ci: None, max_repeats: 9, timeout_s: 60.0, memory_limit_mib: None, seed: 7 }
}

pub(super) fn study(name: &str, specs: Vec<RunSpec>, repeats: u32) -> Submission {
    let cell = |spec: RunSpec| Cell {
        structure: spec.structure.to_string(),
        culling: "frustum".into(),
        walk: "depth_first".into(),
        spec,
    };
    Submission {
        name: name.into(),
        title: format!("Study {name}"),
        manifest_toml: "# nothing".into(),
        claims_json: "[]".into(),
        sweeps_json: "[]".into(),
        consolidate_frames: 10,
        policy: policy(repeats),
        machine_class: "test".into(),
        series: specs.first().map_or(0, |s| s.series),
        cells: specs.into_iter().map(cell).collect(),
        excluded: vec![Excluded { cell: "bsp".into(), why: "too slow".into(), count: 3 }],
        retry_failed: false,
        priority: 0,
        folder: String::new(),
    }
}

/// A trial whose frames took `base_ns`, `base_ns + 1`, ...
pub(super) fn record(base_ns: f64, hash: &str) -> TrialRecord {
    let times: Vec<f64> = (0..20).map(|f| base_ns + f64::from(f) + 0.25).collect();
    let counted = |name: &str, k: f64| Series {
        name: name.into(),
        unit: "1".into(),
        values: (0..20).map(|f| k + f64::from(f % 3)).collect(),
    };
    TrialRecord {
        load_ns: 1,
        build_ns: 2,
        prepare_ns: 3,
        structure_bytes: 4,
        test_bytes: 5,
        peak_rss_bytes: 6,
        build: Default::default(),
        entries: 7,
        scene_triangles: 8,
        load: Default::default(),
        counters: vec![Counter { name: "plane_tests".into(), unit: "planes".into(), value: 99.0 }],
        series: vec![
            Series { name: "cull_ns".into(), unit: "ns".into(), values: times.clone() },
            counted("triangles", 500.0),
            counted("draw_calls", 3.0),
            counted("nodes_visited", 40.0),
        ],
        passes_ns: vec![times.iter().map(|t| t + 0.1).collect(), times],
        frames_hash: hash.into(),
        sentinel: Sentinel { before_ns: 1000.0, after_ns: 1000.0, involuntary_switches: 0 },
        environment: Environment { machine_class: "test".into(), cores: 2, ..Default::default() },
    }
}

pub(super) fn judgement(wrong: Option<&str>, hash: &str) -> Judgement {
    Judgement {
        class: Class::Conservative,
        removes: Removes::default(),
        wrong: wrong.map(Into::into),
        frames: vec![FrameErrors { frame: 3, submitted: 10, visible: 9, ..Default::default() }],
        frames_hash: hash.into(),
    }
}

pub(super) async fn open(dir: &Path) -> Store {
    Store::open(&dir.join("x.db")).await.unwrap()
}

pub(super) async fn lease(store: &Store, study: i64, kind: Kind) -> Lease {
    store.lease(study, kind).await.unwrap().expect("a job waits")
}

/// Judges and takes trials until nothing waits; `make` answers each trial.
pub(super) async fn finish(store: &Store, study: i64, policy: &RepeatPolicy, make: impl Fn(&Lease) -> TrialRecord) {
    loop {
        let mut worked = false;
        while let Some(l) = store.lease(study, Kind::Judge).await.unwrap() {
            store.accept_judgement(&l, &judgement(None, "h"), 1).await.unwrap();
            for (_, id) in store.waiting_for(study, &l.job.target).await.unwrap() {
                store.settle(study, &id, policy).await.unwrap();
            }
            worked = true;
        }
        while let Some(l) = store.lease(study, Kind::Trial).await.unwrap() {
            store.accept_trial(&l, &make(&l), 1_000_000).await.unwrap();
            store.settle(study, &l.job.target, policy).await.unwrap();
            worked = true;
        }
        if !worked {
            return;
        }
    }
}
