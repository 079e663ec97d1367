//! A study measured more than once: what agrees, what must be identical, how it is said.

use super::fixture;
use cullmark::report::repeatability::of;
use cullmark::report::repeatability_tables::{agreements, differences, json, readings, text};
use cullmark::report::{self};
use cullmark::results::{Measured, StudyResults};

fn measured(series: u32, mut results: StudyResults) -> Measured {
    for run in &mut results.runs {
        run.spec.series = series;
        run.measurement_id += &format!("@{series}");
    }
    let hashes = results.runs.iter().map(|r| (r.measurement_id.clone(), [format!("h/{}", r.answer_id)].into()));
    Measured { series, frames_hashes: hashes.collect(), results }
}

fn twice() -> Vec<Measured> {
    vec![measured(0, fixture::study()), measured(1, fixture::study())]
}

#[test]
fn a_study_repeats_itself_exactly() {
    let all = twice();
    let r = of(&all);
    assert_eq!((r.pairs.len(), r.unpaired, r.differences.len()), (35, 0, 0));
    assert_eq!(r.hashes_compared, 35);
    assert!(r.numbers_compared > 35 * 3);
    let total = r.agreements.iter().find(|a| a.metric.name == "total_cull_ms").unwrap();
    // 35 less one failed, one wrong and one pending.
    assert_eq!((total.pairs, total.with_intervals, total.overlapping, total.holding_one), (32, 32, 32, 32));
    assert_eq!(total.median_ratio, 1.0);
    assert_eq!(total.variation_between, Some(0.0));
    assert!(total.variation_within.unwrap() > 0.0);
    assert!(r.agreements.iter().any(|a| a.metric.name == "build_ms"));
    assert!(r.findings().iter().any(|f| f.contains("are identical")), "{:?}", r.findings());
}

#[test]
fn a_slower_series_does_not_overlap_and_varies_between() {
    let mut all = twice();
    for run in &mut all[1].results.runs {
        run.trials.iter_mut().for_each(|t| t.total_cull_ns *= 1.5);
    }
    let r = of(&all);
    let total = r.agreements.iter().find(|a| a.metric.name == "total_cull_ms").unwrap();
    assert_eq!((total.overlapping, total.holding_one), (0, 0));
    assert!((total.median_ratio - 1.5).abs() < 1e-9);
    // Half the difference over the mean, times the root of two: 0.5 / 2.5 * 1.414.
    assert!((total.variation_between.unwrap() - 0.2 * 2f64.sqrt()).abs() < 1e-9);
    assert!(r.readings.iter().any(|x| x.overlap == Some(false)));
}

#[test]
fn every_difference_in_what_must_be_identical_is_named() {
    let mut all = twice();
    let run = &mut all[1].results.runs[2];
    *run.counters.get_mut("nodes").unwrap() += 1.0;
    run.triangles[7] += 1.0;
    let id = run.measurement_id.clone();
    all[1].frames_hashes.insert(id, ["other".to_string()].into());
    all[1].results.runs.remove(20);
    let r = of(&all);
    assert_eq!(r.unpaired, 1);
    let found: Vec<(&str, &str, &str)> =
        r.differences.iter().map(|d| (d.what.as_str(), d.first.as_str(), d.second.as_str())).collect();
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found.contains(&("nodes", "585", "586")));
    assert!(found.iter().any(|f| f.0 == "triangles of frame 7"));
    assert!(found.iter().any(|f| f.0 == "hash of the submitted sets" && f.2 == "other"));
    let t = differences(&r);
    assert_eq!(t.rows.len(), 3);
    let out = text(&r);
    assert!(out.contains("3 differences in what must be identical.") && out.contains("triangles of frame 7"), "{out}");
    assert!(out.contains("1 run stands in one series alone."), "{out}");
}

#[test]
fn text_csv_and_json_have_the_same_pairs() {
    let all = twice();
    let r = of(&all);
    let out = text(&r);
    assert!(out.starts_with("2 measurements (series 0, 1), 35 pairs of the same cell.\n"), "{out}");
    for heading in ["metric", "intervals overlap (%)", "variation within (%)", "variation between (%)"] {
        assert!(out.lines().any(|l| l.contains(heading)), "{heading}");
    }
    assert_eq!(out.lines().filter(|l| l.starts_with("total_cull_ms (ms)")).count(), 1);
    assert_eq!(readings(&r).rows.len(), r.readings.len());
    let j = json(&r);
    assert_eq!(j["readings"].as_array().unwrap().len(), r.readings.len());
    assert_eq!(j["agreements"].as_array().unwrap().len(), agreements(&r).rows.len());
    assert_eq!(j["series"], serde_json::json!([0, 1]));
}

#[test]
fn single_trials_and_other_machines_claim_nothing() {
    let single = || fixture::sized(&fixture::SCENES[..1], 20, 1);
    let all = vec![measured(0, single()), measured(1, single())];
    let r = of(&all);
    assert!(r.agreements.iter().all(|a| a.with_intervals == 0));
    assert!(text(&r).contains("–"), "no share of nothing");
    let mut all = twice();
    all[1].results.runs.iter_mut().for_each(|run| run.machine_class = "other".into());
    let r = of(&all);
    assert!(r.readings.is_empty() && r.agreements.is_empty(), "times of two machines are never compared");
    assert!(r.numbers_compared > 0, "counts are the same everywhere");
}

#[test]
fn the_page_has_a_section_only_when_there_is_more_than_one_series() {
    let mut small = fixture::sized(&fixture::SCENES[..1], 20, 2);
    small.runs.truncate(3);
    let all = [measured(0, small.clone()), measured(1, small.clone())];
    let dir = tempfile::tempdir().unwrap();
    for (series, expected) in [(&all[..], true), (&all[..1], false), (&[][..], false)] {
        let files = report::write_with_series(&small, &[], series, dir.path()).unwrap();
        let page = std::fs::read_to_string(files.page).unwrap();
        assert_eq!(page.contains("<section id=\"repeatability-section\""), expected);
    }
    let nothing: Vec<Measured> = Vec::new();
    assert!(of(&nothing).pairs.is_empty());
}
