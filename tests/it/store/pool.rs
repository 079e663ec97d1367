//! Many studies, one pool: whose turn it is, what they share, and who may work for whom.

use super::fixture::*;
use cullmark::results::RunStatus;
use cullmark::store::{Accepted, Kind, Lease, Pool, Store, Submission};
use std::time::Duration;

fn here() -> Pool {
    Pool { machine_class: "test".into(), build_profile: "release".into() }
}

async fn next(store: &Store, kind: Kind) -> Option<Lease> {
    store.lease_any(&here(), kind).await.unwrap()
}

/// `count` cells of a scene of their own, judged by nobody.
fn unjudged(name: &str, count: i64, repeats: u32) -> Submission {
    let cell = |depth| {
        let mut s = spec(name, depth);
        s.accuracy.frames = 0;
        s
    };
    study(name, (1..=count).map(cell).collect(), repeats)
}

/// Takes the next trial of whichever study's turn it is and stores it; `cost_ms` is what it is charged.
async fn step(store: &Store, cost_ms: impl Fn(i64) -> u64) -> Option<i64> {
    let l = next(store, Kind::Trial).await?;
    assert_eq!(store.accept_trial(&l, &record(100.0, "h"), 1).await.unwrap(), Accepted::Yes);
    store.charge(&l, Duration::from_millis(cost_ms(l.study_id))).await.unwrap();
    store.settle(l.study_id, &l.job.target, &l.policy).await.unwrap();
    Some(l.study_id)
}

/// Works until nothing waits, judgements first.
async fn all_done(store: &Store) {
    loop {
        if let Some(l) = next(store, Kind::Judge).await {
            store.accept_judgement(&l, &judgement(None, "h"), 1).await.unwrap();
            for (of, id) in store.waiting_for(l.study_id, &l.job.target).await.unwrap() {
                let policy = store.policy_of(of).await.unwrap();
                store.settle(of, &id, &policy).await.unwrap();
            }
        } else if step(store, |_| 1).await.is_none() {
            return;
        }
    }
}

async fn statuses(store: &Store, study: &str) -> Vec<RunStatus> {
    store.results(study).await.unwrap().runs.iter().map(|r| r.status).collect()
}

fn share(order: &[i64], id: i64) -> usize {
    order.iter().filter(|s| **s == id).count()
}

#[test]
fn a_higher_priority_goes_first_whenever_it_came() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let usual = store.submit(&unjudged("usual", 3, 2)).await.unwrap().study_id;
        let mut urgent = unjudged("urgent", 2, 2);
        urgent.priority = 5;
        assert_eq!(step(&store, |_| 1).await, Some(usual));
        let urgent = store.submit(&urgent).await.unwrap().study_id;
        for _ in 0..2 {
            assert_eq!(step(&store, |_| 1000).await, Some(urgent), "whatever it had already");
        }
        store.set_priority("usual", 6).await.unwrap();
        assert_eq!(step(&store, |_| 1).await, Some(usual));
        store.set_priority("usual", -6).await.unwrap();
        let mut order = Vec::new();
        while let Some(id) = step(&store, |_| 1).await {
            order.push(id);
        }
        assert_eq!(order, [urgent, urgent, usual, usual, usual, usual]);
        for beyond in [101, -101, i64::MAX] {
            assert!(store.set_priority("usual", beyond).await.is_err());
        }
    });
}

#[test]
fn what_an_urgent_study_shares_with_a_patient_one_is_urgent_too() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        // Their first cells are the same measurements.
        let patient = store.submit(&unjudged("patient", 4, 1)).await.unwrap().study_id;
        let other = with_priority(study("other", vec![spec("elsewhere", 1)], 1), 1);
        let other = store.submit(&other).await.unwrap().study_id;
        let urgent = with_priority(study("urgent", vec![spec("patient", 1), spec("patient", 2)], 1), 2);
        let urgent = store.submit(&urgent).await.unwrap().study_id;
        assert_eq!(step(&store, |_| 1).await, Some(urgent), "though the patient one asked for it first");
        store.set_priority("urgent", -1).await.unwrap();
        assert_eq!(step(&store, |_| 1).await, Some(other));
        store.set_priority("urgent", 7).await.unwrap();
        assert_eq!(step(&store, |_| 1).await, Some(urgent));
        let mut order = Vec::new();
        while let Some(id) = step(&store, |_| 1).await {
            order.push(id);
        }
        assert_eq!(order, [patient, patient]);
    });
}

fn with_priority(mut submission: Submission, priority: i64) -> Submission {
    submission.priority = priority;
    submission.cells.iter_mut().for_each(|c| c.spec.accuracy.frames = 0);
    submission
}

#[test]
fn studies_of_one_priority_alternate_and_get_equal_time_rather_than_equal_turns() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let a = store.submit(&unjudged("a", 2, 8)).await.unwrap().study_id;
        let b = store.submit(&unjudged("b", 2, 8)).await.unwrap().study_id;
        let mut order = Vec::new();
        for _ in 0..10 {
            order.extend(step(&store, |_| 50).await);
        }
        assert!(order.windows(2).all(|w| w[0] != w[1]), "{order:?}");
        // From here on a trial of `a` takes three times as long.
        let mut order = Vec::new();
        for _ in 0..8 {
            order.extend(step(&store, |id| if id == a { 150 } else { 50 }).await);
        }
        assert_eq!((share(&order, a), share(&order, b)), (2, 6), "{order:?}");
    });
}

#[test]
fn a_late_joiner_neither_waits_for_the_others_nor_they_for_it() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let a = store.submit(&unjudged("a", 4, 9)).await.unwrap().study_id;
        for _ in 0..12 {
            assert_eq!(step(&store, |_| 1000).await, Some(a));
        }
        let b = store.submit(&unjudged("b", 4, 9)).await.unwrap().study_id;
        let mut order = Vec::new();
        for _ in 0..8 {
            order.extend(step(&store, |_| 1000).await);
        }
        assert_eq!((share(&order, a), share(&order, b)), (4, 4), "{order:?}");
        assert!(order[..2].contains(&a) && order[..2].contains(&b), "{order:?}");
        // One that rested has saved nothing up.
        store.pause("a").await.unwrap();
        for _ in 0..10 {
            assert_eq!(step(&store, |_| 1000).await, Some(b));
        }
        store.resume("a").await.unwrap();
        let mut order = Vec::new();
        for _ in 0..6 {
            order.extend(step(&store, |_| 1000).await);
        }
        assert_eq!((share(&order, a), share(&order, b)), (3, 3), "{order:?}");
    });
}

#[test]
fn judgements_take_turns_by_their_own_time() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let of = |name: &str| study(name, (1..=4).map(|d| spec(name, d)).collect(), 1);
        let a = store.submit(&of("a")).await.unwrap().study_id;
        let b = store.submit(&of("b")).await.unwrap().study_id;
        // Much time on the lane is none beside it.
        let lane = next(&store, Kind::Trial).await.unwrap();
        store.charge(&lane, Duration::from_secs(100)).await.unwrap();
        store.give_back(&lane).await.unwrap();
        let mut order = Vec::new();
        while let Some(l) = next(&store, Kind::Judge).await {
            store.accept_judgement(&l, &judgement(None, "h"), 1).await.unwrap();
            store.charge(&l, Duration::from_millis(10)).await.unwrap();
            order.push(l.study_id);
        }
        assert_eq!((order.len(), share(&order[..4], a), share(&order[..4], b)), (8, 2, 2), "{order:?}");
    });
}

#[test]
fn what_two_studies_share_is_done_for_one_when_the_other_is_put_away() {
    for way in ["pause", "cancel", "delete", "delete all", "cancel first"] {
        let dir = tempfile::tempdir().unwrap();
        wait(async {
            let store = open(dir.path()).await;
            let cells = || vec![spec("one", 1), spec("one", 2)];
            let a = store.submit(&study("a", cells(), 2)).await.unwrap().study_id;
            if way == "cancel first" {
                store.cancel("a").await.unwrap();
            }
            let added = store.submit(&study("b", cells(), 2)).await.unwrap();
            assert_eq!(added.resumed, 2, "{way}: the measurements are known");
            // One is under way when it happens.
            let early = if way == "cancel first" { None } else { next(&store, Kind::Trial).await };
            match way {
                "pause" => store.pause("a").await.unwrap(),
                "cancel" => store.cancel("a").await.unwrap(),
                "delete" => store.delete_study("a", false).await.unwrap(),
                "delete all" => store.delete_study("a", true).await.unwrap(),
                _ => {}
            }
            if let Some(early) = early {
                assert_eq!(early.study_id, a, "{way}");
                assert!(store.renew(&early).await.unwrap(), "{way}: another study wants it");
                assert_eq!(store.accept_trial(&early, &record(1.0, "h"), 1).await.unwrap(), Accepted::Yes, "{way}");
            }
            let l = next(&store, Kind::Trial).await.unwrap_or_else(|| panic!("{way}: nothing waits for b"));
            assert_eq!(l.study_id, added.study_id, "{way}");
            store.give_back(&l).await.unwrap();
            all_done(&store).await;
            let overview = store.overview("b").await.unwrap();
            assert_eq!((overview.runs.done, overview.jobs.trials, overview.finished), (2, 0, true), "{way}");
            assert_eq!(statuses(&store, "b").await, [RunStatus::Done; 2], "{way}");
            if matches!(way, "pause" | "cancel" | "cancel first") {
                store.resume("a").await.unwrap();
                assert!(
                    next(&store, Kind::Trial).await.is_none() && next(&store, Kind::Judge).await.is_none(),
                    "{way}"
                );
                assert_eq!(store.overview("a").await.unwrap().runs.done, 2, "{way}: done for both");
            } else {
                assert!(store.overview("a").await.is_err());
            }
        });
    }
}

#[test]
fn a_paused_pool_leases_nothing_and_goes_on_where_it_was() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        store.submit(&study("a", vec![spec("one", 1)], 2)).await.unwrap();
        assert!(!store.pool_paused().await.unwrap() && store.has_trial_for(&here()).await.unwrap());
        store.pause_pool(true).await.unwrap();
        // Another process asks the same database.
        let other = open(dir.path()).await;
        assert!(other.pool_paused().await.unwrap() && !other.has_trial_for(&here()).await.unwrap());
        for kind in [Kind::Trial, Kind::Judge] {
            assert!(next(&other, kind).await.is_none());
        }
        store.pause_pool(false).await.unwrap();
        all_done(&other).await;
        assert_eq!(store.overview("a").await.unwrap().runs.done, 1);
    });
}

#[test]
fn a_paused_study_keeps_its_jobs_and_a_cancelled_one_gets_them_back() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let id = store.submit(&study("a", vec![spec("one", 1), spec("one", 2)], 3)).await.unwrap().study_id;
        let under_way = next(&store, Kind::Trial).await.unwrap();
        store.pause("a").await.unwrap();
        assert!(next(&store, Kind::Trial).await.is_none() && next(&store, Kind::Judge).await.is_none());
        assert_eq!(
            store.accept_trial(&under_way, &record(1.0, "h"), 1).await.unwrap(),
            Accepted::Yes,
            "what runs ends"
        );
        let paused = store.overview("a").await.unwrap();
        assert_eq!((paused.jobs.trials, paused.jobs.judgements, paused.finished), (5, 2, false));
        store.cancel("a").await.unwrap();
        let cancelled = store.overview("a").await.unwrap();
        assert_eq!((cancelled.jobs.trials, cancelled.jobs.judgements, cancelled.finished), (0, 0, true));
        store.resume("a").await.unwrap();
        assert_eq!(store.overview("a").await.unwrap().jobs, paused.jobs);
        all_done(&store).await;
        assert_eq!(store.jobs_left(id).await.unwrap(), Default::default());
        assert_eq!(statuses(&store, "a").await, [RunStatus::Done; 2]);
        // Submitting a cancelled study again is a resumption, too.
        store.submit(&study("a", vec![spec("one", 3)], 1)).await.unwrap();
        store.cancel("a").await.unwrap();
        store.submit(&study("a", vec![spec("one", 3)], 1)).await.unwrap();
        all_done(&store).await;
        assert_eq!(statuses(&store, "a").await, [RunStatus::Done]);
    });
}

#[test]
fn a_lease_lost_to_cancel_is_fenced_and_its_attempt_says_so() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let id = store.submit(&study("a", vec![spec("one", 1)], 1)).await.unwrap().study_id;
        let (trial, judge) = (next(&store, Kind::Trial).await.unwrap(), next(&store, Kind::Judge).await.unwrap());
        store.cancel("a").await.unwrap();
        for lost in [&trial, &judge] {
            assert!(!store.renew(lost).await.unwrap());
            store.give_back(lost).await.unwrap();
        }
        assert_eq!(store.accept_trial(&trial, &record(1.0, "h"), 1).await.unwrap(), Accepted::Fenced);
        assert_eq!(store.accept_judgement(&judge, &judgement(None, "h"), 1).await.unwrap(), Accepted::Fenced);
        assert!(!store.fail(&trial, &cullmark::store::Outcome::TimedOut("late".into())).await.unwrap());
        let (trials, attempts, _) = store.run_history(id, &trial.job.target).await.unwrap();
        assert!(trials.is_empty());
        let outcomes: Vec<_> = attempts.iter().map(|a| a.outcome.clone().unwrap()).collect();
        assert_eq!(outcomes.len(), 2);
        assert!(outcomes.iter().all(|o| o == "cancelled" || o == "fenced"), "{outcomes:?}");
        store.resume("a").await.unwrap();
        let again = next(&store, Kind::Trial).await.unwrap();
        assert!(again.job.target == trial.job.target && again.epoch > trial.epoch);
        assert_eq!(store.accept_trial(&trial, &record(1.0, "h"), 1).await.unwrap(), Accepted::Fenced, "still");
        assert_eq!(store.accept_trial(&again, &record(1.0, "h"), 1).await.unwrap(), Accepted::Yes);
    });
}

#[test]
fn a_study_of_another_machine_or_another_build_is_left_to_those() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        store.submit(&study("a", vec![spec("one", 1)], 1)).await.unwrap();
        let elsewhere = Pool { machine_class: "another".into(), ..here() };
        let slow = Pool { build_profile: "debug".into(), ..here() };
        for pool in [&elsewhere, &slow] {
            for kind in [Kind::Trial, Kind::Judge] {
                assert!(store.lease_any(pool, kind).await.unwrap().is_none(), "{pool:?}");
            }
            assert!(!store.has_trial_for(pool).await.unwrap());
            assert_eq!(store.undecided(pool).await.unwrap(), [0i64; 0]);
        }
        assert!(next(&store, Kind::Trial).await.is_some());
    });
}

#[test]
fn deleting_with_measurements_takes_what_no_other_study_has() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        store.submit(&study("a", vec![spec("one", 1), spec("one", 2)], 1)).await.unwrap();
        store.submit(&study("b", vec![spec("one", 2), spec("one", 3)], 1)).await.unwrap();
        all_done(&store).await;
        let before = store.results("b").await.unwrap();
        store.delete_study("a", true).await.unwrap();
        let after = store.results("b").await.unwrap();
        assert_eq!(format!("{:?}", after.runs), format!("{:?}", before.runs), "what they shared is whole");
        let again = store.submit(&study("a", vec![spec("one", 1), spec("one", 2)], 1)).await.unwrap();
        assert_eq!((again.new, again.done), (1, 1));
        all_done(&store).await;
        assert_eq!(statuses(&store, "a").await, [RunStatus::Done; 2]);
    });
}
