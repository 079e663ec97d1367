//! Studies that share measurements, or change while they wait: nobody is left behind.

use super::fixture::{finish, judgement, lease, open, policy, record, spec, study, wait};
use cullmark::record::RepeatPolicy;
use cullmark::results::RunStatus;
use cullmark::store::{Kind, Pool, Store};

fn here() -> Pool {
    Pool { machine_class: "test".into(), build_profile: "release".into() }
}

async fn any(store: &Store) -> Option<cullmark::store::Lease> {
    for kind in [Kind::Judge, Kind::Trial] {
        if let Some(lease) = store.lease_any(&here(), kind).await.unwrap() {
            return Some(lease);
        }
    }
    None
}

/// Does whatever waits for a pool.
async fn work_off(store: &Store) {
    while let Some(l) = any(store).await {
        match l.job.kind {
            Kind::Judge => {
                store.accept_judgement(&l, &judgement(None, "h"), 1).await.unwrap();
                for (of, id) in store.waiting_for(l.study_id, &l.job.target).await.unwrap() {
                    let policy = store.policy_of(of).await.unwrap();
                    store.settle(of, &id, &policy).await.unwrap();
                }
            }
            Kind::Trial => {
                store.accept_trial(&l, &record(5.0, "h"), 1).await.unwrap();
                store.settle(l.study_id, &l.job.target, &l.policy).await.unwrap();
            }
        }
    }
}

#[test]
fn a_study_that_changes_its_matrix_lets_go_of_the_old_cells_and_holds_up_nobody() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let id = store.submit(&study("a", vec![spec("one", 1), spec("one", 2)], 1)).await.unwrap().study_id;
        store.submit(&study("b", vec![spec("one", 2)], 1)).await.unwrap();
        store.submit(&study("a", vec![spec("one", 3)], 1)).await.unwrap();
        assert!(!store.has_queued_trial(id).await.unwrap() || store.jobs_left(id).await.unwrap().trials == 1);
        work_off(&store).await;
        for name in ["a", "b"] {
            let overview = store.overview(name).await.unwrap();
            assert!(overview.finished && overview.runs.done == 1, "{overview:?}");
        }
        assert_eq!(store.queue_counts().await.unwrap(), vec![], "nothing waits for a cell that is no more");
    });
}

/// Two studies of one cell that ask for different judgements, before anything is judged:
/// the measurement now names the second one's.
async fn coarse_and_fine(store: &Store) {
    let cell = spec("one", 1);
    let mut finer = cell.clone();
    finer.accuracy.width_px = 128;
    store.submit(&study("coarse", vec![cell], 1)).await.unwrap();
    store.submit(&study("fine", vec![finer], 1)).await.unwrap();
}

#[test]
fn two_studies_may_judge_one_answer_differently_and_both_are_finished() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        coarse_and_fine(&store).await;
        work_off(&store).await;
        for name in ["coarse", "fine"] {
            let results = store.results(name).await.unwrap();
            assert_eq!(results.runs[0].status, RunStatus::Done, "{name}");
            assert_eq!(results.runs[0].errors.len(), 1, "{name} has a judgement of its own");
            assert!(store.overview(name).await.unwrap().finished);
        }
    });
}

#[test]
fn a_study_is_not_left_waiting_for_a_judgement_that_a_cancelled_one_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        coarse_and_fine(&store).await;
        store.cancel("fine").await.unwrap();
        work_off(&store).await;
        assert_eq!(store.results("coarse").await.unwrap().runs[0].status, RunStatus::Done);
    });
}

#[test]
fn a_shared_measurement_goes_on_until_the_stricter_study_is_satisfied() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        store.submit(&study("few", vec![spec("one", 1)], 2)).await.unwrap();
        let mut many = study("many", vec![spec("one", 1)], 2);
        many.policy = RepeatPolicy { relative_ci: Some(1e-12), max_repeats: 4, ..policy(2) };
        let id = store.submit(&many).await.unwrap().study_id;
        // Values vary, so that no interval is ever that narrow.
        let mut value = 5.0;
        while let Some(l) = any(&store).await {
            if l.job.kind == Kind::Judge {
                store.accept_judgement(&l, &judgement(None, "h"), 1).await.unwrap();
                continue;
            }
            value += 1.0;
            store.accept_trial(&l, &record(value, "h"), 1).await.unwrap();
            store.settle(l.study_id, &l.job.target, &l.policy).await.unwrap();
        }
        let results = store.results("few").await.unwrap();
        assert_eq!((results.runs[0].status, results.runs[0].trials.len()), (RunStatus::Done, 4));
        assert_eq!(store.jobs_left(id).await.unwrap().trials, 0);
    });
}

#[test]
fn readers_hear_of_an_import_and_of_judgements_that_another_study_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let other = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", vec![spec("one", 1)], 1);
        let id = store.submit(&s).await.unwrap().study_id;
        finish(&store, id, &s.policy, |_| record(5.0, "h")).await;
        let file = store.export("a").await.unwrap();

        let there = open(other.path()).await;
        let waiting = there.submit(&s).await.unwrap().study_id;
        let before = there.now().await.unwrap();
        there.import(&file, None).await.unwrap();
        assert!(there.now().await.unwrap() > before);
        assert_eq!(there.run_lines(waiting, before, None).await.unwrap().len(), 1);

        // A judgement that is accepted for one study is news of every study that asked for it.
        let again = store.submit(&study("again", vec![spec("two", 1)], 1)).await.unwrap().study_id;
        let twin = store.submit(&study("twin", vec![spec("two", 1)], 1)).await.unwrap().study_id;
        let seen = store.now().await.unwrap();
        let l = lease(&store, again, Kind::Judge).await;
        store.accept_judgement(&l, &judgement(None, "h"), 1).await.unwrap();
        assert_eq!(store.run_lines(twin, seen, None).await.unwrap().len(), 1);
    });
}
