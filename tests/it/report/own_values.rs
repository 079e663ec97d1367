//! Claims about a metric itself: 0 everywhere, or a published value.

use super::{fixture, xml};
use cullmark::claim::{Claim, Relation};
use cullmark::report::claims::{Verdict, judge, judge_all};
use cullmark::report::{forest, render};
use cullmark::results::RunStatus;

fn own(relation: Relation, metric: &str, culling: &str) -> Claim {
    Claim {
        metric: metric.into(),
        numerator: fixture::select(&[("structure", "octree"), ("culling", culling)]),
        denominator: Default::default(),
        ..fixture::claim("own", relation)
    }
}

#[test]
fn zero_holds_only_where_every_run_has_a_number_and_it_is_0() {
    let mut results = fixture::study();
    results.runs.retain(|r| r.structure.starts_with("octree") && r.culling == "frustum");
    assert!(results.runs.len() == 3 && results.runs.iter().all(|r| !r.errors.is_empty()));
    for run in &mut results.runs {
        run.status = RunStatus::Done;
        run.errors.iter_mut().for_each(|e| e.potential_lost = 0);
    }
    let claim = own(Relation::Zero, "potential_lost", "frustum");
    let found = judge(&results, &claim);
    assert_eq!((found.verdict, found.groups.len()), (Verdict::Reproduced, 3), "{}", found.summary);
    // A run that is wrong for its class has lost its times, not its errors.
    results.runs[1].status = RunStatus::Wrong;
    results.runs[1].errors[0].potential_lost = 2;
    let found = judge(&results, &claim);
    assert_eq!(found.verdict, Verdict::Contradicted);
    assert_eq!(found.groups[1].ratio, Some((2.0, 2.0, 2.0)));
    results.runs[1].errors[0].potential_lost = 0;
    results.runs[2].status = RunStatus::Failed;
    let found = judge(&results, &claim);
    assert_eq!(found.groups[2].verdict, Verdict::Undecided, "a failed run proves nothing");
    assert!(found.groups[2].note.contains("failed"), "{}", found.groups[2].note);
}

#[test]
fn a_published_value_is_compared_with_the_metric_itself() {
    let results = fixture::study();
    let mut claim = own(Relation::Value, "mean_triangles", "frustum");
    let first = judge(&results, &Claim { published: Some([1.0, 1e9]), ..claim.clone() }).groups[0].ratio.unwrap().0;
    claim.tolerance = 0.1;
    claim.published_for = [("nucleus".to_string(), [first * 0.95; 2]), ("saw".to_string(), [1.0; 2])].into();
    let found = judge(&results, &claim);
    let verdicts: Vec<(&str, Verdict)> = found.groups.iter().map(|g| (g.name.as_str(), g.verdict)).collect();
    assert!(verdicts.contains(&("nucleus", Verdict::Reproduced)), "{verdicts:?}");
    assert!(verdicts.iter().all(|(name, _)| claim.published_for.contains_key(*name)), "{verdicts:?}");
}

#[test]
fn a_claim_about_one_scene_names_it_and_the_chart_says_what_it_leaves_out() {
    let results = fixture::study();
    let ratio = |id: &str, scene: Option<&str>| {
        let mut claim = Claim { for_each: None, ..fixture::claim(id, Relation::Greater) };
        for selection in [&mut claim.numerator, &mut claim.denominator] {
            selection.extend(scene.map(|s| ("scene".to_string(), vec![s.to_string()])));
        }
        claim
    };
    let mut lost = own(Relation::Zero, "potential_lost", "frustum");
    lost.id = "loses-nothing".into();
    let claims = [ratio("one", Some("ravine")), ratio("all", None), lost];
    let judged = judge_all(&results, &claims);
    assert_eq!((judged[0].groups[0].name.as_str(), judged[1].groups[0].name.as_str()), ("ravine", "everywhere"));
    assert!(judged[0].summary.ends_with(" at ravine"), "{}", judged[0].summary);
    let figure = forest::draw(&judged).unwrap();
    let texts = xml::texts(&render::svg(&figure, true).unwrap()).unwrap();
    assert!(texts.iter().any(|t| t == "ravine") && texts.iter().any(|t| t == "everywhere"), "{texts:?}");
    for words in [texts.join(" "), figure.caption] {
        assert!(words.contains("Not drawn") && words.contains("loses-nothing ("), "{words}");
        assert!(!words.contains("one (") && !words.contains("all ("), "{words}");
    }
}
