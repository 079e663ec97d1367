//! The store: queue, leases, decisions, results, exchange. Records are fed in
//! directly; `faults` drives the real program.

use cullmark::culling::{Class, Removes};
use cullmark::record::*;
use cullmark::registry::{Spec, Value};
use cullmark::results::{Excluded, RunStatus};
use cullmark::store::compact::Drop;
use cullmark::store::{Accepted, Cell, Detail, Kind, Lease, Outcome, Store, Submission, read_results};
use std::path::Path;
use std::time::{Duration, Instant};

fn wait<T>(work: impl Future<Output = T>) -> T {
    cullmark::store::block_on(work)
}

/// A plausible cell: `depth` tells runs apart, `scene` is its block.
fn spec(scene: &str, depth: i64) -> RunSpec {
    RunSpec {
        scene: SceneSpec {
            name: scene.into(),
            source: SceneSource::Generated(Spec::new("arena")),
            winding: Winding::Ccw,
            up: Up::Z,
            scale: 1.0,
            weld: false,
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
        accuracy: Accuracy { frames: 2, width_px: 64, height_px: 36, samples: 1 },
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

fn policy(repeats: u32) -> RepeatPolicy {
    RepeatPolicy { repeats, relative_ci: None, max_repeats: 9, timeout_s: 60.0, memory_limit_mib: None, seed: 7 }
}

fn study(name: &str, specs: Vec<RunSpec>, repeats: u32) -> Submission {
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
        consolidate_frames: 10,
        policy: policy(repeats),
        machine_class: "test".into(),
        series: specs.first().map_or(0, |s| s.series),
        cells: specs.into_iter().map(cell).collect(),
        excluded: vec![Excluded { cell: "bsp".into(), why: "too slow".into(), count: 3 }],
        retry_failed: false,
    }
}

/// A trial whose frames took `base_ns`, `base_ns + 1`, ...
fn record(base_ns: f64, hash: &str) -> TrialRecord {
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

fn judgement(wrong: Option<&str>, hash: &str) -> Judgement {
    Judgement {
        class: Class::Conservative,
        removes: Removes::default(),
        wrong: wrong.map(Into::into),
        frames: vec![FrameErrors { frame: 3, submitted: 10, visible: 9, ..Default::default() }],
        frames_hash: hash.into(),
    }
}

async fn open(dir: &Path) -> Store {
    Store::open(&dir.join("x.db")).await.unwrap()
}

async fn lease(store: &Store, study: i64, kind: Kind) -> Lease {
    store.lease(study, kind).await.unwrap().expect("a job waits")
}

/// Judges and takes trials until nothing waits; `make` answers each trial.
async fn finish(store: &Store, study: i64, policy: &RepeatPolicy, make: impl Fn(&Lease) -> TrialRecord) {
    loop {
        let mut worked = false;
        while let Some(l) = store.lease(study, Kind::Judge).await.unwrap() {
            store.accept_judgement(&l, &judgement(None, "h"), 1).await.unwrap();
            for id in store.unsettled(study, Some(&l.job.target)).await.unwrap() {
                store.settle(study, &id, policy).await.unwrap();
            }
            worked = true;
        }
        while let Some(l) = store.lease(study, Kind::Trial).await.unwrap() {
            store.accept_trial(&l, &make(&l), 1_000_000).await.unwrap();
            store.mark_noise(&l.job.target, l.job.repeat, l.job.take, 40).await.unwrap();
            store.settle(study, &l.job.target, policy).await.unwrap();
            worked = true;
        }
        if !worked {
            return;
        }
    }
}

#[test]
fn a_study_is_queued_once_interleaved_and_its_results_come_back() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", vec![spec("one", 1), spec("one", 2), spec("two", 1)], 2);
        let first = store.submit(&s).await.unwrap();
        assert_eq!((first.new, first.jobs_added), (3, 3 + 6));
        let again = store.submit(&s).await.unwrap();
        assert_eq!((again.new, again.resumed, again.jobs_added), (0, 3, 0));
        let (mut order, mut leases) = (Vec::new(), Vec::new());
        while let Some(l) = store.lease(first.study_id, Kind::Trial).await.unwrap() {
            order.push((l.spec.scene.name.clone(), l.job.repeat));
            leases.push(l);
        }
        // Blocked by scene, and all runs of a repeat before the next repeat.
        let sorted = {
            let mut o = order.clone();
            o.sort();
            o
        };
        assert_eq!(order, sorted);
        for l in &leases {
            store.give_back(l).await.unwrap();
        }
        finish(&store, first.study_id, &s.policy, |l| record(100.0 * f64::from(l.job.repeat + 1), "h")).await;
        let done = store.submit(&s).await.unwrap();
        assert_eq!((done.done, done.jobs_added), (3, 0));
        let results = store.results("a").await.unwrap();
        assert_eq!(results.runs.len(), 3);
        assert_eq!(results.excluded[0].count, 3);
        let r = &results.runs[1];
        assert_eq!((r.status, r.class, r.trials.len()), (RunStatus::Done, Some(Class::Conservative), 2));
        assert_eq!(r.spec, s.cells[1].spec, "a spec survives JSON to the bit");
        // The median of 100.25 and 200.25.
        assert_eq!(r.cull_ns[0], 150.25);
        assert_eq!(r.counters["plane_tests"], 99.0);
        assert_eq!(r.triangles[1], 501.0);
        assert_eq!(store.trial_record(&r.measurement_id, 1, 0).await.unwrap(), record(200.0, "h"), "lossless");
        let brief = store.results_with("a", Detail::Summary).await.unwrap();
        assert!(brief.runs[1].cull_ns.is_empty() && brief.runs[1].trials.len() == 2);
        // More repeats than before: only the missing ones are queued.
        let more = store.submit(&study("a", vec![spec("one", 1)], 3)).await.unwrap();
        assert_eq!((more.resumed, more.jobs_added), (1, 1));
    });
}

#[test]
fn an_expired_lease_passes_on_and_the_late_writer_is_fenced_off() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let id = store.submit(&study("a", vec![spec("one", 1)], 1)).await.unwrap().study_id;
        let late = store.lease_for(id, Kind::Trial, Duration::ZERO).await.unwrap().unwrap();
        tokio::time::sleep(Duration::from_millis(5)).await;
        let now = lease(&store, id, Kind::Trial).await;
        assert_eq!(now.job, late.job);
        assert!(now.epoch > late.epoch);
        assert!(!store.renew(&late).await.unwrap());
        assert_eq!(store.accept_trial(&late, &record(1.0, "h"), 1).await.unwrap(), Accepted::Fenced);
        assert_eq!(store.accept_trial(&now, &record(2.0, "h"), 1).await.unwrap(), Accepted::Yes);
        assert_eq!(store.accept_trial(&now, &record(3.0, "h"), 1).await.unwrap(), Accepted::Fenced, "once");
        let kept = store.trial_record(&now.job.target, 0, 0).await.unwrap();
        assert_eq!(kept, record(2.0, "h"));
    });
}

#[test]
fn a_job_that_loses_its_worker_again_and_again_fails_with_a_reason() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", vec![spec("one", 1)], 1);
        let id = store.submit(&s).await.unwrap().study_id;
        let mut times = 0;
        while let Some(l) = store.lease_for(id, Kind::Trial, Duration::ZERO).await.unwrap() {
            times += 1;
            tokio::time::sleep(Duration::from_millis(3)).await;
            assert_eq!(l.job.repeat, 0);
        }
        assert_eq!(times, 5);
        let run = store.unsettled(id, None).await.unwrap().remove(0);
        let settled = store.settle(id, &run, &s.policy).await.unwrap();
        assert_eq!(settled.status, RunStatus::Failed);
        assert!(settled.reason.unwrap().contains("lost 5 times"));
    });
}

#[test]
fn a_crash_is_tried_once_more_and_a_retry_on_request_starts_clean() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let mut s = study("a", vec![spec("one", 1)], 2);
        let id = store.submit(&s).await.unwrap().study_id;
        let crash = Outcome::Crashed("killed by SIGSEGV".into());
        let first = lease(&store, id, Kind::Trial).await;
        assert!(!store.fail(&first, &crash).await.unwrap());
        let second = lease(&store, id, Kind::Trial).await;
        assert_eq!(second.job, first.job);
        assert!(store.fail(&second, &crash).await.unwrap());
        let settled = store.settle(id, &first.job.target, &s.policy).await.unwrap();
        assert_eq!((settled.status, settled.trials_cancelled), (RunStatus::Failed, 1));
        assert!(store.lease(id, Kind::Trial).await.unwrap().is_none(), "its other trial is not needed");
        assert_eq!(store.submit(&s).await.unwrap().failed, 1);
        s.retry_failed = true;
        assert_eq!(store.submit(&s).await.unwrap().resumed, 1);
        finish(&store, id, &s.policy, |_| record(5.0, "h")).await;
        assert_eq!(store.results("a").await.unwrap().runs[0].status, RunStatus::Done);
    });
}

#[test]
fn a_wrong_method_keeps_its_errors_and_loses_its_times() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", vec![spec("one", 1)], 3);
        let id = store.submit(&s).await.unwrap().study_id;
        let trial = lease(&store, id, Kind::Trial).await;
        store.accept_trial(&trial, &record(1.0, "h"), 1).await.unwrap();
        let judge = lease(&store, id, Kind::Judge).await;
        store.accept_judgement(&judge, &judgement(Some("frame 3 loses 17"), "h"), 1).await.unwrap();
        let settled = store.settle(id, &trial.job.target, &s.policy).await.unwrap();
        assert_eq!((settled.status, settled.trials_cancelled), (RunStatus::Wrong, 2));
        let r = store.results("a").await.unwrap().runs.remove(0);
        assert_eq!(r.reason.as_deref(), Some("frame 3 loses 17"));
        assert!(r.trials.is_empty() && r.cull_ns.is_empty() && r.trial_cull_ns.is_empty());
        assert_eq!((r.errors.len(), r.triangles.len()), (1, 20));
    });
}

#[test]
fn counters_that_differ_between_trials_or_from_the_judgement_fail_the_run() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", vec![spec("one", 1), spec("one", 2)], 2);
        let id = store.submit(&s).await.unwrap().study_id;
        finish(&store, id, &s.policy, |l| {
            let mut r = record(1.0, if l.spec.structure.int("depth") == 2 { "other" } else { "h" });
            r.counters[0].value += f64::from(l.job.repeat);
            r
        })
        .await;
        let results = store.results("a").await.unwrap();
        let reasons: Vec<_> = results.runs.iter().map(|r| (r.status, r.reason.clone().unwrap())).collect();
        assert!(reasons.iter().all(|(s, _)| *s == RunStatus::Failed));
        assert_eq!(reasons[0].1, "counters differ between trials 0 and 1: plane_tests is 99 and 100");
        assert!(reasons[1].1.contains("and the judgement"), "{}", reasons[1].1);
        // Taken anew on request, all of them.
        let again = store.submit(&Submission { retry_failed: true, ..s.clone() }).await.unwrap();
        assert_eq!(again.resumed, 2);
        finish(&store, id, &s.policy, |_| record(1.0, "h")).await;
        assert!(store.results("a").await.unwrap().runs.iter().all(|r| r.status == RunStatus::Done));
    });
}

#[test]
fn repeats_go_on_until_the_interval_is_narrow_or_the_limit_is_reached() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let mut s = study("a", vec![spec("one", 1), spec("one", 2)], 3);
        s.policy.relative_ci = Some(0.02);
        let id = store.submit(&s).await.unwrap().study_id;
        finish(&store, id, &s.policy, |l| {
            // Depth 1 is steady, depth 2 never settles.
            let wild = f64::from(l.job.repeat % 3) * 400.0;
            record(if l.spec.structure.int("depth") == 1 { 1000.0 } else { 1000.0 + wild }, "h")
        })
        .await;
        let results = store.results("a").await.unwrap();
        assert_eq!(results.runs.iter().map(|r| r.trials.len()).collect::<Vec<_>>(), [3, 9]);
        let stop: Vec<_> = results.runs.iter().map(|r| r.stop_reason.clone().unwrap()).collect();
        assert!(stop[0].contains("after 3 repeats") && stop[1].starts_with("max_repeats 9 reached"), "{stop:?}");
    });
}

#[test]
fn a_disturbed_repeat_is_taken_once_more_and_both_are_kept() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", vec![spec("one", 1)], 7);
        let id = store.submit(&s).await.unwrap().study_id;
        finish(&store, id, &s.policy, |l| {
            let mut r = record(if l.job.take == 1 { 10.0 } else { 50.0 }, "h");
            if l.job.repeat >= 6 {
                r.sentinel.after_ns = 1500.0;
            }
            r
        })
        .await;
        let r = store.results("a").await.unwrap().runs.remove(0);
        assert_eq!((r.status, r.trials.len()), (RunStatus::Done, 7));
        assert!(r.trials[6].noisy && !r.trials[5].noisy && r.trials[6].noise > 1.4);
        assert!(r.reason.unwrap().contains("1 of 7 trials were disturbed"));
        assert_eq!(r.trial_cull_ns[6][0], 10.25, "the second take counts");
        assert_eq!(store.trial_record(&r.measurement_id, 6, 0).await.unwrap().series[0].values[0], 50.25);
    });
}

#[test]
fn the_next_series_measures_anew_and_shares_the_judgement() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        assert_eq!(store.next_series("a").await.unwrap(), 0);
        let s = study("a", vec![spec("one", 1)], 1);
        let id = store.submit(&s).await.unwrap().study_id;
        finish(&store, id, &s.policy, |_| record(1.0, "h")).await;
        assert_eq!(store.next_series("a").await.unwrap(), 1);
        let mut again = spec("one", 1);
        again.series = 1;
        let s = study("a", vec![again], 1);
        let next = store.submit(&s).await.unwrap();
        assert_eq!((next.new, next.jobs_added), (1, 1), "one trial, no second judgement");
        finish(&store, next.study_id, &s.policy, |_| record(2.0, "h")).await;
        assert_eq!(store.results("a").await.unwrap().runs[0].cull_ns[0], 2.25, "the latest");
        assert_eq!(store.results("a@0").await.unwrap().runs[0].cull_ns[0], 1.25);
        let e = store.results("b").await.unwrap_err();
        assert!(e.help.unwrap().contains('a'));
        // The same cell in another study is not measured again.
        let other = store.submit(&study("other", vec![spec("one", 1)], 1)).await.unwrap();
        assert_eq!((other.done, other.jobs_added), (1, 0));
    });
}

#[test]
fn an_export_comes_back_whole_twice_is_once_and_damage_is_found() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", vec![spec("one", 1), spec("two", 2)], 2);
        let id = store.submit(&s).await.unwrap().study_id;
        finish(&store, id, &s.policy, |l| record(f64::from(l.job.repeat), "h")).await;
        let file = store.export("a").await.unwrap();
        let there = Store::open(&dir.path().join("there.db")).await.unwrap();
        let brought = there.import(&file, None).await.unwrap();
        assert_eq!((brought.runs, brought.measurements_added, brought.trials_added), (2, 2, 4));
        assert!(there.import(&file, None).await.unwrap().is_nothing());
        let (a, b) = (store.results("a").await.unwrap(), there.results("a").await.unwrap());
        assert_eq!(serde_json::to_value(&a).unwrap(), serde_json::to_value(&b).unwrap());
        assert_eq!(there.export("a").await.unwrap(), file, "to the byte");
        assert_eq!(there.submit(&s).await.unwrap().done, 2, "finished there, finished here");
        let id = &a.runs[0].measurement_id;
        assert_eq!(there.trial_record(id, 1, 0).await.unwrap(), store.trial_record(id, 1, 0).await.unwrap());
        for at in [0, 16, 30, file.len() / 2, file.len() - 1] {
            let mut bad = file.clone();
            bad[at] ^= 1;
            assert!(there.import(&bad, Some("bad")).await.unwrap_err().help.is_some(), "byte {at}");
            assert!(there.import(&file[..at], Some("bad")).await.is_err(), "cut at {at}");
        }
        let other = store.submit(&study("a", vec![spec("one", 3)], 2)).await.unwrap();
        assert_eq!(other.new, 1);
        let e = store.import(&file, None).await.unwrap_err();
        assert!(e.help.unwrap().contains("--as"));
        assert_eq!(store.import(&file, Some("kept")).await.unwrap().study, "kept@0");
    });
}

#[test]
fn compacting_keeps_what_was_measured_and_drops_passes_only_when_asked() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", (0..30).map(|d| spec("one", d)).collect(), 2);
        let id = store.submit(&s).await.unwrap().study_id;
        finish(&store, id, &s.policy, |l| record(f64::from(l.job.repeat), "h")).await;
        let before = serde_json::to_value(store.results("a").await.unwrap()).unwrap();
        let run = before["runs"][0]["measurement_id"].as_str().unwrap().to_string();
        store.compact(Drop::default()).await.unwrap();
        assert_eq!(store.trial_record(&run, 0, 0).await.unwrap().passes_ns.len(), 2);
        let done = store.compact(Drop { passes: true, orphans: true }).await.unwrap();
        assert!(done.rows_dropped >= 120, "{done:?}");
        assert_eq!(serde_json::to_value(store.results("a").await.unwrap()).unwrap(), before);
    });
}

#[test]
fn a_thousand_finished_cells_are_submitted_again_at_once() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", (0..1000).map(|d| spec(["p", "q", "r"][d as usize % 3], d)).collect(), 1);
        assert_eq!(store.submit(&s).await.unwrap().new, 1000);
        // Finished the short way: what is timed is the looking up.
        store.close().await;
        let pool = Store::open(&dir.path().join("x.db")).await.unwrap();
        let start = Instant::now();
        let again = pool.submit(&s).await.unwrap();
        let elapsed = start.elapsed();
        assert_eq!((again.resumed, again.jobs_added), (1000, 0));
        // 0.2 s in a release build on an idle machine; far more here is a scan where an index should be.
        assert!(elapsed < Duration::from_secs(5), "{elapsed:?}");
    });
}

#[test]
fn a_synchronous_reader_names_a_missing_database_and_what_to_do() {
    let e = read_results(Path::new("/nowhere/x.db"), "a", Detail::Summary).unwrap_err();
    assert!(e.to_string().contains("/nowhere/x.db") && e.to_string().contains("cullmark run"), "{e}");
}
