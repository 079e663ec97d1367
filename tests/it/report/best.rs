//! Claims that something is the best of many, and values of what is modelled.

use super::fixture;
use cullmark::claim::{Claim, Relation, Selection};
use cullmark::report::claims::{Group, Verdict, judge};
use cullmark::results::{RunResult, RunStatus, StudyResults};

/// One scene, octrees of three depths, of which depth 4 culls fastest and depth 5 slowest.
fn depths(trials: u32) -> StudyResults {
    let mut results = fixture::study();
    let of = |depth: u32, factor: f64| {
        let mut run =
            fixture::run("nucleus", 2e4, &format!("octree:depth={depth}"), "frustum", 60, trials, u64::from(depth));
        scale(&mut run, factor);
        run
    };
    results.runs = vec![of(3, 1.2), of(4, 1.0), of(5, 1.5)];
    results
}

fn scale(run: &mut RunResult, factor: f64) {
    run.trial_cull_ns.iter_mut().flatten().for_each(|ns| *ns *= factor);
    run.trials.iter_mut().for_each(|t| t.total_cull_ns *= factor);
}

fn structure(selector: &str) -> Selection {
    fixture::select(&[("structure", selector)])
}

fn best(depth: u32, metric: &str) -> Claim {
    Claim {
        metric: metric.into(),
        numerator: structure(&format!("octree:depth={depth}")),
        denominator: structure("octree"),
        ..fixture::claim("best", Relation::Best)
    }
}

fn only(results: &StudyResults, claim: &Claim) -> Group {
    let judged = judge(results, claim);
    assert_eq!(judged.groups.len(), 1, "{}", judged.summary);
    judged.groups[0].clone()
}

#[test]
fn the_best_of_many_stands_against_the_best_of_the_rest() {
    let results = depths(5);
    let four = only(&results, &best(4, "total_cull_ms"));
    assert_eq!(four.verdict, Verdict::Reproduced, "{four:?}");
    let (ratio, low, high) = four.ratio.unwrap();
    assert!((ratio - 1.0 / 1.2).abs() < 0.04 && low < ratio && ratio < high && high < 1.0, "{four:?}");
    assert!(four.note.contains("octree:depth=4 × frustum × depth_first against octree:depth=3 × frustum"), "{four:?}");
    assert!(four.model_ratio.is_some(), "the modelled frame stands beside the measured culling");
    assert_eq!(four.stated, "best: below 1");
    for depth in [3, 5] {
        let other = only(&results, &best(depth, "total_cull_ms"));
        assert!(other.verdict == Verdict::Contradicted && other.ratio.unwrap().1 > 1.0, "{other:?}");
        assert!(other.note.contains("against octree:depth=4"), "{other:?}");
    }
    // One of two is enough: the numerator is as good as its best run.
    let two = Claim { numerator: structure("octree:depth=4|5"), ..best(4, "total_cull_ms") };
    assert_eq!(only(&results, &two).ratio, four.ratio);
}

#[test]
fn a_claim_about_culling_alone_is_not_saved_by_the_model_of_the_frame() {
    let mut results = depths(5);
    // Depth 4 culls slowest, and submits so little that its modelled frame is the shortest.
    scale(&mut results.runs[1], 2.0);
    results.runs[1].triangles.iter_mut().for_each(|t| *t = (*t / 50.0).floor());
    let culling = only(&results, &best(4, "total_cull_ms"));
    assert!(culling.ratio.unwrap().1 > 1.0 && culling.model_ratio.unwrap().2 < 1.0, "{culling:?}");
    assert_eq!(culling.verdict, Verdict::Contradicted, "{culling:?}");
    let frame = only(&results, &best(4, "total_frame_ms_model"));
    assert_eq!((frame.ratio, frame.model_ratio), (culling.ratio, culling.model_ratio));
    assert_eq!(frame.verdict, Verdict::ModelOnly, "{frame:?}");
}

#[test]
fn where_more_is_better_the_ratio_is_turned_round() {
    let results = depths(5);
    let four = only(&results, &best(4, "fps_mean_model"));
    assert_eq!(four.verdict, Verdict::ModelOnly, "{four:?}");
    assert!(four.ratio.is_none() && four.model_ratio.is_some_and(|(r, _, high)| r < 1.0 && high < 1.0), "{four:?}");
    assert_eq!(only(&results, &best(5, "fps_mean_model")).verdict, Verdict::Contradicted);
}

#[test]
fn equals_and_single_trials_are_not_the_best() {
    let mut results = depths(5);
    let mut twin = results.runs[1].clone();
    twin.structure = "octree:depth=6".into();
    twin.spec.structure = cullmark::registry::Spec::parse("octree:depth=6").unwrap();
    results.runs.push(twin);
    let level = only(&results, &best(4, "total_cull_ms"));
    assert_eq!((level.verdict, level.ratio), (Verdict::Undecided, Some((1.0, 1.0, 1.0))), "{level:?}");
    // None of them lost anything: 0 over 0 is level, not nothing.
    results.runs.iter_mut().flat_map(|r| &mut r.errors).for_each(|e| e.false_culls = 0);
    let zero = only(&results, &best(4, "false_culls"));
    assert_eq!((zero.verdict, zero.ratio), (Verdict::Undecided, Some((1.0, 1.0, 1.0))), "{zero:?}");
    let single = only(&depths(1), &best(4, "total_cull_ms"));
    assert!(single.verdict == Verdict::Undecided && single.note.contains("single trial"), "{single:?}");
}

#[test]
fn a_run_without_a_number_might_have_been_the_best_of_its_side() {
    let verdict = |failed: usize, status: RunStatus, depth: u32| {
        let mut results = depths(5);
        results.runs[failed].status = status;
        only(&results, &Claim { numerator: structure("octree:depth=4|5"), ..best(depth, "total_cull_ms") })
    };
    // Of the rest: it may be better. Of the numerator: it could only make it better still.
    let mut results = depths(5);
    results.runs[2].status = RunStatus::Failed;
    let rest = only(&results, &best(4, "total_cull_ms"));
    assert!(rest.verdict == Verdict::Undecided && rest.note.contains("is failed"), "{rest:?}");
    assert_eq!(only(&results, &best(3, "total_cull_ms")).verdict, Verdict::Contradicted);
    assert_eq!(verdict(2, RunStatus::Pending, 4).verdict, Verdict::Reproduced);
    let lost = verdict(1, RunStatus::Failed, 4);
    assert!(lost.verdict == Verdict::Undecided, "depth 5 loses, but depth 4 has no number: {lost:?}");
    // Wrong for its class: no contender.
    results.runs[2].status = RunStatus::Wrong;
    let wrong = only(&results, &best(4, "total_cull_ms"));
    assert!(wrong.verdict == Verdict::Reproduced && wrong.note.contains("1 wrong"), "{wrong:?}");
    results.runs[1].status = RunStatus::Wrong;
    assert!(only(&results, &best(4, "total_cull_ms")).verdict == Verdict::Undecided);
}

#[test]
fn scenes_and_cameras_are_not_mixed() {
    let mut results = depths(5);
    results.runs.push(fixture::run("saw", 6e4, "octree:depth=4", "frustum", 60, 5, 9));
    let mixed = only(&results, &Claim { for_each: None, ..best(4, "total_cull_ms") });
    assert!(mixed.verdict == Verdict::Undecided && mixed.note.contains("several scenes"), "{mixed:?}");
    let claim = best(4, "total_cull_ms");
    let apart = judge(&results, &claim);
    let verdicts: Vec<_> = apart.groups.iter().map(|g| (g.name.as_str(), g.verdict)).collect();
    assert_eq!(verdicts, [("nucleus", Verdict::Reproduced), ("saw", Verdict::Undecided)]);
    assert!(apart.groups[1].note.contains("no other run"), "{:?}", apart.groups[1]);
    results.runs.pop();
    results.runs[0].spec.camera.aspect *= 2.0;
    let cameras = only(&results, &best(4, "total_cull_ms"));
    assert!(cameras.verdict == Verdict::Undecided && cameras.note.contains("cameras"), "{cameras:?}");
    let claim = best(7, "total_cull_ms");
    let nobody = judge(&results, &claim);
    assert!(nobody.verdict == Verdict::Undecided && nobody.groups[0].name == "everywhere");
}

#[test]
fn a_modelled_value_is_at_best_reproduced_in_the_model_only() {
    let results = depths(5);
    let own = |metric: &str, published: [f64; 2]| Claim {
        metric: metric.into(),
        numerator: structure("octree:depth=4"),
        denominator: Selection::new(),
        published: None,
        published_for: [("nucleus".to_string(), published)].into(),
        tolerance: 0.05,
        ..fixture::claim("own", Relation::Value)
    };
    let value = |metric: &str| cullmark::report::metrics::known(metric).value(&results.runs[1]).unwrap();
    for metric in ["fps_spread_model", "pearson_triangles_frame_model"] {
        let group = only(&results, &own(metric, [value(metric); 2]));
        assert_eq!((group.verdict, group.ratio), (Verdict::ModelOnly, None), "{group:?}");
        let (v, low, high) = group.model_ratio.unwrap();
        assert!(low <= v && v <= high && low < high, "it has an interval: {group:?}");
    }
    let r = value("pearson_triangles_cull");
    let group = only(&results, &Claim { tolerance: 0.5, ..own("pearson_triangles_cull", [r, r]) });
    assert_eq!((group.verdict, group.model_ratio), (Verdict::Reproduced, None), "{group:?}");
    // A correlation below 0 is widened to both sides as any other value is.
    let below = only(&results, &own("pearson_triangles_cull", [-r.abs() - 0.5; 2]));
    assert_eq!(below.verdict, Verdict::Contradicted, "{below:?}");
    assert_eq!(
        cullmark::report::claims::decide(Relation::Value, Some([-0.5, -0.5]), 0.1, (-0.48, -0.54, -0.46)),
        Verdict::Reproduced
    );
    let single = only(&depths(1), &own("fps_spread_model", [5.0, 5.0]));
    assert!(single.verdict == Verdict::Undecided && single.note.contains("single trial"), "{single:?}");
}
