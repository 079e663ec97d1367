//! Sweeps are kept with their study, travel in its file, and are none in older files.

use super::fixture::*;
use cullmark::store::Store;
use cullmark::sweep::Sweep;

fn sweep() -> Sweep {
    Sweep {
        id: "offset".into(),
        title: "Far from home".into(),
        x: "scene.offset_m".into(),
        x_unit: "m".into(),
        y: "false_culls".into(),
        against: None,
        by: "arithmetic".into(),
        x_log: true,
        y_log: true,
        expected_slope: Some(1.0),
        expected_for: Some("f32_world".into()),
        expected_why: "half an ulp grows with the coordinate".into(),
    }
}

#[test]
fn sweeps_are_kept_changed_and_exchanged_with_their_study() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let mut s = study("a", vec![spec("one", 1)], 1);
        store.submit(&s).await.unwrap();
        assert!(store.results("a").await.unwrap().sweeps.is_empty());
        s.sweeps_json = serde_json::to_string(&[sweep()]).unwrap();
        store.submit(&s).await.unwrap();
        assert_eq!(store.results("a").await.unwrap().sweeps, [sweep()], "the same runs, another chart");
        let file = store.export("a").await.unwrap();
        let there = Store::open(&dir.path().join("there.db")).await.unwrap();
        there.import(&file, None).await.unwrap();
        assert_eq!(there.results("a").await.unwrap().sweeps, [sweep()]);
        assert_eq!(there.export("a").await.unwrap(), file, "to the byte");
    });
}

#[test]
fn a_file_from_before_there_were_sweeps_is_still_read() {
    let dir = tempfile::tempdir().unwrap();
    wait(async {
        let store = open(dir.path()).await;
        let s = study("a", vec![spec("one", 1)], 1);
        let id = store.submit(&s).await.unwrap().study_id;
        finish(&store, id, &s.policy, |_| record(100.0, "h")).await;
        let now = store.export("a").await.unwrap();
        // Version 1 ended before the sweeps and version 2 before the advice, which are here
        // strings `[]` with their lengths.
        let head = now.len() - now[51..].len();
        let plain = zstd::stream::decode_all(&now[head..]).unwrap();
        assert!(plain.ends_with(b"\x02[]\x02[]"));
        let mut file = now.clone();
        for (version, cut) in [(1u32, 6), (2, 3)] {
            let payload = zstd::bulk::compress(&plain[..plain.len() - cut], 9).unwrap();
            file = now[..15].to_vec();
            file.extend(version.to_le_bytes());
            file.extend(blake3::hash(&payload).as_bytes());
            file.extend(payload);
            let there = Store::open(&dir.path().join(format!("there{version}.db"))).await.unwrap();
            assert_eq!(there.import(&file, None).await.unwrap().trials_added, 1);
            let results = there.results("a").await.unwrap();
            assert!(results.sweeps.is_empty() && results.advice.is_empty());
            assert_eq!(there.export("a").await.unwrap(), now, "written again it is of this version");
        }
        let there = Store::open(&dir.path().join("there.db")).await.unwrap();
        file[15] = 4;
        let e = there.import(&file, None).await.unwrap_err();
        assert!(e.to_string().contains("up to version 3"), "{e}");
    });
}

#[test]
fn an_older_database_is_brought_up_to_date() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.db");
    wait(async {
        let store = open(dir.path()).await;
        store.submit(&study("a", vec![spec("one", 1)], 1)).await.unwrap();
        store.close().await;
        // As the first version left it.
        let pool = sqlx::SqlitePool::connect(path.to_str().unwrap()).await.unwrap();
        for sql in ["ALTER TABLE studies DROP COLUMN sweeps_json", "DELETE FROM _sqlx_migrations WHERE version = 2"] {
            sqlx::query(sql).execute(&pool).await.unwrap();
        }
        pool.close().await;
        let store = Store::open_existing(&path).await.unwrap();
        let results = store.results("a").await.unwrap();
        assert_eq!((results.runs.len(), results.sweeps.len()), (1, 0));
    });
}
