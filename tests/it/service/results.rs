//! Results of a finished study: pages, tables, charts, comparisons and series.

use super::server::{RUNS, shared};
use arrow_array::{Array, Float64Array};
use serde_json::Value;

fn list<'a>(value: &'a Value, name: &str) -> &'a Vec<Value> {
    value[name].as_array().unwrap_or_else(|| panic!("no list `{name}` in {value}"))
}

fn ids(page: &Value) -> Vec<String> {
    list(page, "items").iter().map(|r| r["run"].as_str().unwrap().to_string()).collect()
}

#[test]
fn pages_of_one_run_are_together_the_one_big_page_in_its_order() {
    for query in [
        "",
        "sort=-total_cull_ms",
        "sort=culling,-mean_triangles",
        "sort=status,-structure&where=culling%20=%20frustum%20or%20structure%20=%20list",
        "sort=octree.depth",
        "sort=-reason,false_cull_ppm",
        "sort=measurement_id",
    ] {
        let path = format!("/studies/town@0/runs?{query}");
        let whole = shared().json(&path);
        assert_eq!(whole["next"], Value::Null);
        assert_eq!(whole["total"].as_u64().unwrap() as usize, list(&whole, "items").len());
        let (mut walked, mut cursor) = (Vec::new(), String::new());
        loop {
            let page = shared().json(&format!("{path}&limit=1{cursor}"));
            assert_eq!((list(&page, "items").len(), &page["total"]), (1, &whole["total"]), "{query}");
            walked.extend(ids(&page));
            assert!(walked.len() <= RUNS as usize, "{query} never ends");
            match page["next"].as_str() {
                Some(next) => cursor = format!("&cursor={next}"),
                None => break,
            }
        }
        assert_eq!(walked, ids(&whole), "{query}");
    }
    let all = shared().json("/studies/town@0/runs");
    assert_eq!(all["total"], RUNS);
    let studies = shared().json("/studies");
    let (mut names, mut cursor) = (Vec::new(), String::new());
    while names.len() < 9 {
        let page = shared().json(&format!("/studies?limit=1{cursor}"));
        names.push(list(&page, "items")[0]["ref"].clone());
        let Some(next) = page["next"].as_str() else { break };
        cursor = format!("&cursor={next}");
    }
    let expected: Vec<Value> = list(&studies, "items").iter().map(|s| s["ref"].clone()).collect();
    assert_eq!(names, expected, "the list of studies pages likewise");
}

#[test]
fn a_filter_a_sort_and_columns_give_what_they_say() {
    let path = "/studies/town@0/runs?where=culling%20=%20frustum%20and%20octree.depth%20%3E=%202\
                &sort=-octree.depth&columns=structure,octree.depth,mean_triangles,total_cull_ms,reason";
    let page = shared().json(path);
    let rows = list(&page, "items");
    let depths: Vec<f64> = rows.iter().map(|r| r["cells"]["octree.depth"].as_f64().unwrap()).collect();
    assert_eq!(depths, [3.0, 2.0]);
    for row in rows {
        // A disturbed machine is told beside the result.
        let reason = row["cells"]["reason"].as_str().unwrap_or("noisy machine");
        assert!(row["status"] == "done" && reason.starts_with("noisy machine"), "{row}");
        let time = &row["cells"]["total_cull_ms"];
        let [low, value, high] = ["low", "value", "high"].map(|n| time[n].as_f64().unwrap());
        assert!(0.0 < low && low <= value && value <= high, "{time}");
        assert!(row["cells"]["mean_triangles"].is_number());
    }
    let names: Vec<&str> = list(&page, "columns").iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["structure", "octree.depth", "mean_triangles", "total_cull_ms", "reason"]);
    // Failed and waiting runs have no times, and are not nought either.
    for (study, status) in [("late@0", "failed"), ("held@0", "pending")] {
        let page = shared().json(&format!("/studies/{study}/runs?columns=status,total_cull_ms,reason"));
        for row in list(&page, "items") {
            assert_eq!((&row["status"], &row["cells"]["status"]), (&Value::from(status), &Value::from(status)));
            assert_eq!(row["cells"]["total_cull_ms"], Value::Null);
            assert_eq!(row["cells"]["reason"].is_string(), status == "failed", "{row}");
        }
    }
}

#[test]
fn the_table_as_csv_has_the_rows_of_the_page() {
    let query = "/studies/town@0/runs?sort=-mean_triangles&columns=structure,culling,mean_triangles";
    let reply = shared().get(&format!("{query}&format=csv")).with(200);
    assert_eq!(reply.kind(), "text/csv");
    assert!(reply.header("content-disposition").unwrap().contains("town-0.csv"));
    let text = reply.text();
    let lines: Vec<&str> = text.lines().collect();
    let page = shared().json(query);
    assert_eq!(lines.len(), 1 + RUNS as usize);
    for (line, row) in lines[1..].iter().zip(list(&page, "items")) {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(
            (cells[0], cells[1]),
            (row["cells"]["structure"].as_str().unwrap(), row["cells"]["culling"].as_str().unwrap())
        );
        assert_eq!(cells[2].parse::<f64>().unwrap(), row["cells"]["mean_triangles"].as_f64().unwrap());
    }
}

#[test]
fn the_matrix_has_one_entry_a_run_in_parallel_lists() {
    let heat = shared().json("/studies/town@0/matrix?metric=mean_triangles");
    assert_eq!(list(&heat, "rows"), &["town"]);
    assert_eq!(list(&heat, "columns").len(), RUNS as usize);
    let page = shared().json("/studies/town@0/runs?columns=mean_triangles");
    for (i, row) in list(&page, "items").iter().enumerate() {
        let of = |name: &str| &heat["cells"][name][i];
        assert_eq!((of("ordinal"), of("status"), of("row")), (&row["ordinal"], &Value::from(1), &Value::from(0)));
        assert_eq!(of("value"), &row["cells"]["mean_triangles"]);
        assert_eq!(heat["columns"][of("column").as_u64().unwrap() as usize], row["label"]);
    }
    let late = shared().json("/studies/late@0/matrix");
    assert!(list(&late["cells"], "status").iter().all(|s| *s == 2));
    assert!(list(&late["cells"], "value").iter().all(Value::is_null));
    let held = shared().json("/studies/held@0/matrix?where=culling%20=%20none");
    assert_eq!(list(&held["cells"], "status"), &[0, 0]);
}

#[test]
fn fronts_claims_and_what_is_in_a_study_are_told() {
    let front = shared().json("/studies/town@0/front?x=mean_triangles&y=false_cull_ppm");
    let scene = &list(&front, "scenes")[0];
    assert_eq!((&front["x"]["name"], &scene["scene"]), (&Value::from("mean_triangles"), &Value::from("town")));
    let standing = |s: &str| list(scene, "points").iter().filter(|p| p["standing"] == s).count();
    assert!(standing("front") >= 1 && standing("dominated") >= 1, "{scene}");
    assert_eq!(list(scene, "points").len() + list(scene, "left_out").len(), RUNS as usize);
    for p in list(scene, "points").iter().filter(|p| p["standing"] == "dominated") {
        assert!(!list(p, "by").is_empty(), "{p}");
    }
    let late = shared().json("/studies/late@0/front");
    assert!(list(&late["scenes"][0], "points").is_empty(), "what failed is on no front");

    let claims = shared().json("/studies/town@0/claims");
    let claim = &list(&claims, "items")[0];
    assert_eq!(
        (&claim["id"], &claim["verdict"]),
        (&Value::from("frustum_pays"), &Value::from("reproduced")),
        "{claim}"
    );
    assert!(!list(claim, "groups").is_empty());

    let study = shared().json("/studies/town");
    assert_eq!(study["ref"], "town@1", "the latest series");
    assert_eq!((&study["claims"], &study["description"]), (&Value::from(1), &Value::from("Boxes in rows.")));
    assert_eq!(list(&study, "excluded_cells")[0]["why"], "nothing to see");
    assert_eq!(list(&study["axes"], "culling"), &["none", "frustum"]);
    let has = |name: &str, value: &str| list(&study, name).iter().any(|v| v == value);
    assert!(has("fields", "octree.depth") && has("metrics", "total_cull_ms") && !has("metrics", "fallbacks_f64_share"));
    let manifest = shared().get("/studies/town/manifest").with(200);
    assert_eq!(manifest.kind(), "application/toml");
    assert_eq!(manifest.text(), super::server::study("town"), "as it was sent");
}

#[test]
fn charts_are_listed_drawn_and_narrowed() {
    let charts = shared().json("/studies/town@0/charts");
    let ids: Vec<&str> = list(&charts, "items").iter().map(|c| c["id"].as_str().unwrap()).collect();
    assert!(ids.contains(&"total-time") && ids.contains(&"claims"), "{ids:?}");
    let svg = shared().get("/studies/town@0/charts/total-time.svg").with(200);
    assert_eq!(svg.kind(), "image/svg+xml");
    assert!(svg.text().contains("octree:depth=3"));
    let narrow = shared().get("/studies/town@0/charts/total-time.svg?where=structure%20=%20list").with(200).text();
    assert!(narrow.contains("list") && !narrow.contains("octree"), "the filter leaves the octrees out");
    let picture = shared().get("/studies/town@0/charts/total-time.png").with(200);
    assert_eq!(picture.kind(), "image/png");
    let info = png::Decoder::new(std::io::Cursor::new(picture.body)).read_info().unwrap().info().clone();
    assert!(info.width > 200 && info.height > 100);
}

#[test]
fn a_study_compared_with_itself_is_the_same_and_with_its_rerun_pairs_up() {
    let own = shared().json("/compare?first=town@0&second=town@0");
    assert_eq!(
        (&own["counts"]["same"], &own["first"], &own["second"]),
        (&Value::from(RUNS), &Value::from("town@0"), &Value::from("town@0"))
    );
    for pair in list(&own, "pairs") {
        assert_eq!((&pair["first"], &pair["ratio"]["value"]), (&pair["second"], &Value::from(1.0)), "{pair}");
    }
    let again = shared().json("/compare?first=town@0&second=town@1&metric=mean_triangles");
    assert_eq!(list(&again, "pairs").len(), RUNS as usize);
    assert_eq!(again["counts"]["same"], RUNS, "what is counted does not vary: {again}");
    for pair in list(&again, "pairs") {
        assert!(pair["first"]["value"].is_number() && pair["first"]["ordinal"] == pair["second"]["ordinal"], "{pair}");
    }
    let total: u64 = again["counts"].as_object().unwrap().values().filter_map(Value::as_u64).sum();
    assert_eq!(total, RUNS);
}

#[test]
fn all_of_a_run_is_told_by_its_ordinal_and_by_its_id() {
    let run = shared().json("/studies/town@0/runs/1");
    assert_eq!(shared().json(&format!("/studies/town@0/runs/{}", run["run"].as_str().unwrap())), run);
    assert_eq!(
        (&run["study"], &run["status"], &run["scene"]),
        (&Value::from("town@0"), &Value::from("done"), &Value::from("town"))
    );
    assert_eq!((list(&run, "judged_frames").len(), &run["class"]), (2, &Value::from("conservative")));
    let repeats: std::collections::BTreeSet<u64> =
        list(&run, "trials").iter().map(|t| t["repeat"].as_u64().unwrap()).collect();
    assert_eq!(repeats.into_iter().collect::<Vec<_>>(), [0, 1, 2]);
    let accepted = list(&run, "attempts").iter().filter(|a| a["outcome"] == "accepted").count();
    assert_eq!(accepted, list(&run, "trials").len() + 1, "trials and a judgement: {run}");
    assert!(run["environment"]["cpu"].is_string() && run["metrics"]["total_cull_ms"]["value"].is_number());

    let late = shared().json("/studies/late@0/runs/0");
    assert_eq!(late["status"], "failed");
    assert!(late["reason"].as_str().unwrap().contains("late.obj"), "{late}");
    assert_eq!((&late["metrics"].get("total_cull_ms"), list(&late, "trials").len()), (&None, 0));
    let held = shared().json("/studies/held@0/runs/0");
    assert_eq!((&held["status"], list(&held, "attempts").len()), (&Value::from("pending"), 0));
}

#[test]
fn series_are_the_same_numbers_as_json_csv_and_arrow() {
    let path = "/studies/town@0/runs/1/series?names=cull_ns,triangles&trial=all";
    let answer = shared().json(path);
    let series = list(&answer, "series");
    assert_eq!((series.len(), &answer["frames"]), (4, &Value::from(20)), "three trials, and what is counted once");
    let csv = shared().get(&format!("{path}&format=csv")).with(200).text();
    let rows: Vec<Vec<&str>> = csv.lines().map(|l| l.split(',').collect()).collect();
    assert_eq!((rows.len(), rows[0][0]), (21, "frame"));
    let arrow = shared().get(&format!("{path}&format=arrow")).with(200);
    assert_eq!(arrow.kind(), "application/vnd.apache.arrow.stream");
    let mut reader = arrow_ipc::reader::StreamReader::try_new(&arrow.body[..], None).unwrap();
    let batch = reader.next().unwrap().unwrap();
    assert_eq!((batch.num_rows(), batch.num_columns()), (20, 5));
    for (i, s) in series.iter().enumerate() {
        let values: Vec<f64> = list(s, "values").iter().map(|v| v.as_f64().unwrap()).collect();
        let from_csv: Vec<f64> = rows[1..].iter().map(|r| r[i + 1].parse().unwrap()).collect();
        assert_eq!(values, from_csv, "{}", s["name"]);
        let column = batch.column(i + 1).as_any().downcast_ref::<Float64Array>().unwrap();
        assert_eq!((column.values().to_vec(), column.null_count()), (values, 0));
        assert_eq!(batch.schema().field(i + 1).name(), rows[0][i + 1]);
    }
    // The median of three trials at each frame.
    let median = shared().json("/studies/town@0/runs/1/series?names=cull_ns");
    for frame in 0..20 {
        let mut of: Vec<f64> =
            series.iter().filter(|s| s["name"] == "cull_ns").map(|s| s["values"][frame].as_f64().unwrap()).collect();
        of.sort_by(f64::total_cmp);
        assert_eq!(median["series"][0]["values"][frame], of[1]);
    }
    let one = shared().json("/studies/town@0/runs/1/series?names=cull_ns&trial=2");
    assert_eq!((list(&one, "series").len(), &one["series"][0]["trial"]), (1, &Value::from(2)));
}

#[test]
fn answers_made_of_results_carry_a_tag_and_need_not_be_sent_twice() {
    let mut tags = std::collections::BTreeSet::new();
    for path in [
        "/studies/town@0/runs",
        "/studies/town@0/runs?limit=2",
        "/studies/town@0/runs?format=csv",
        "/studies/town@0/matrix",
        "/studies/town@0/front",
        "/studies/town@0/charts/total-time.svg",
        "/studies/town@0/runs/0/series",
        "/studies/town@0/runs/0/view/nodes",
        "/studies/town@1/runs",
    ] {
        let path = format!("/api/v1{path}");
        let first = shared().send("GET", &path, &[], b"").with(200);
        let tag = first.header("etag").unwrap_or_else(|| panic!("{path} has no tag")).to_string();
        assert!(tags.insert(tag.clone()), "{path} has the tag of another answer");
        for known in [tag.clone(), format!("W/{tag}"), format!("\"other\", {tag}")] {
            let again = shared().send("GET", &path, &[("if-none-match", &known)], b"");
            assert_eq!((again.status, again.body.len(), again.header("etag")), (304, 0, Some(tag.as_str())), "{path}");
        }
        shared().send("GET", &path, &[("if-none-match", "\"other\"")], b"").with(200);
    }
}
