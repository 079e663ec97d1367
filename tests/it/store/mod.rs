//! The store: queue, leases, decisions, results, exchange. Records are fed in
//! directly; `faults` drives the real program.

mod figures;
mod fixture;
mod migrations;
mod pool;
mod shared;
mod sweeps;

use cullmark::culling::Class;
use cullmark::results::RunStatus;
use cullmark::store::compact::Drop;
use cullmark::store::{Accepted, Detail, Kind, Outcome, Store, Submission, read_results};
use fixture::*;
use std::path::Path;
use std::time::Duration;

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
        // A crash of the child is no loss of the worker.
        let first = store.lease(id, Kind::Trial).await.unwrap().unwrap();
        assert!(!store.fail(&first, &Outcome::Crashed("a kill".into())).await.unwrap());
        let mut times = 0;
        while let Some(l) = store.lease_for(id, Kind::Trial, Duration::ZERO).await.unwrap() {
            times += 1;
            tokio::time::sleep(Duration::from_millis(3)).await;
            assert_eq!(l.job.repeat, 0);
        }
        assert_eq!(times, 5);
        let run = store.loose_ends(id).await.unwrap().remove(0);
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
fn a_synchronous_reader_names_a_missing_database_and_what_to_do() {
    let e = read_results(Path::new("/nowhere/x.db"), "a", Detail::Summary).unwrap_err();
    assert!(e.to_string().contains("/nowhere/x.db") && e.to_string().contains("cullmark run"), "{e}");
}

#[test]
fn the_numbers_of_deleted_jobs_are_used_again_without_harm() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let s = study("a", vec![spec("one", 1)], 2);
        let there = Store::open(&dir.path().join("there.db")).await.unwrap();
        let id = there.submit(&s).await.unwrap().study_id;
        finish(&there, id, &s.policy, |_| record(1.0, "h")).await;
        let file = there.export("a").await.unwrap();
        // Begun here as well: a trial is under way and another was lost when the finished study comes in.
        let store = open(dir.path()).await;
        let id = store.submit(&s).await.unwrap().study_id;
        let stale = lease(&store, id, Kind::Trial).await;
        lease(&store, id, Kind::Trial).await;
        store.import(&file, None).await.unwrap();
        let next = study("b", vec![spec("two", 9)], 3);
        let other = store.submit(&next).await.unwrap().study_id;
        let mut leases = Vec::new();
        while let Some(l) = store.lease(other, Kind::Trial).await.unwrap() {
            leases.push(l);
        }
        assert_eq!(leases.len(), 3);
        assert_eq!(store.accept_trial(&stale, &record(9.0, "h"), 1).await.unwrap(), Accepted::Fenced);
        for l in &leases {
            assert_eq!(store.accept_trial(l, &record(2.0, "h"), 1).await.unwrap(), Accepted::Yes);
        }
        assert_eq!(store.trial_record(&stale.job.target, 0, 0).await.unwrap(), record(1.0, "h"));
    });
}

#[test]
fn another_class_of_machine_is_measured_apart_and_the_first_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let here = study("a", vec![spec("one", 1)], 1);
        let there = Submission { machine_class: "faster".into(), ..here.clone() };
        let id = store.submit(&here).await.unwrap().study_id;
        finish(&store, id, &here.policy, |_| record(5.0, "h")).await;
        let second = store.submit(&there).await.unwrap();
        assert_eq!((second.new, second.jobs_added), (1, 1), "the judgement is shared, times are not");
        finish(&store, id, &there.policy, |_| record(1.0, "h")).await;
        let r = store.results("a").await.unwrap().runs.remove(0);
        assert_eq!((r.machine_class.as_str(), r.cull_ns[0]), ("faster", 1.25));
        assert_eq!(store.submit(&here).await.unwrap().done, 1);
        assert_eq!(store.results("a").await.unwrap().runs[0].cull_ns[0], 5.25);
    });
}
