//! Verdicts on published claims: four outcomes, place by place.

use super::metrics::{self, Kind, Metric};
use super::{labels, own_value};
use crate::claim::{Claim, Relation, axis_value, selects};
use crate::culling;
use crate::registry::format_sum;
use crate::results::{RunResult, RunStatus, StudyResults};
use crate::stats;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::collections::{BTreeMap, BTreeSet};

/// The order is from agreement to disagreement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Reproduced,
    /// Measured culling time alone does not show it, the modelled frame time does.
    ModelOnly,
    /// The interval holds both outcomes, or data are missing.
    Undecided,
    Contradicted,
}

impl Verdict {
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Reproduced => "reproduced",
            Verdict::ModelOnly => "reproduced in the model only",
            Verdict::Undecided => "undecided",
            Verdict::Contradicted => "contradicted",
        }
    }
}

/// A ratio with the ends of its 95 % interval.
pub type Ratio = (f64, f64, f64);

/// A claim with its verdict in every group.
pub struct Judged<'a> {
    pub claim: &'a Claim,
    pub verdict: Verdict,
    /// "contradicted at 2 of 7: gorge, saw".
    pub summary: String,
    pub groups: Vec<Group>,
}

#[derive(Debug, Clone)]
pub struct Group {
    pub name: String,
    /// "below 1", "3.5 to 3.9 ± 25 %".
    pub stated: String,
    pub verdict: Verdict,
    /// By the measured (or counted) metric.
    pub ratio: Option<Ratio>,
    /// By the model's twin of the metric.
    pub model_ratio: Option<Ratio>,
    pub note: String,
}

/// The measured metric and its modelled twin.
const TWINS: &[(&str, &str)] = &[("total_cull_ms", "total_frame_ms_model"), ("cull_ms", "frame_ms_model")];

pub fn judge_all<'a>(results: &StudyResults, claims: &'a [Claim]) -> Vec<Judged<'a>> {
    claims.iter().map(|claim| judge(results, claim)).collect()
}

pub fn judge<'a>(results: &StudyResults, claim: &'a Claim) -> Judged<'a> {
    let (measured, modelled) = twins(&claim.metric);
    let mut out: Vec<Group> = if claim.relation.is_own() {
        own_value::groups(results, claim)
    } else if claim.relation == Relation::Grows {
        grows(claim, &groups(results, claim), measured, modelled)
    } else {
        groups(results, claim).iter().filter_map(|g| in_group(claim, g, measured, modelled)).collect()
    };
    if out.is_empty() {
        out.push(Group {
            name: "everywhere".into(),
            stated: claim.relation.as_str().into(),
            verdict: Verdict::Undecided,
            ratio: None,
            model_ratio: None,
            note: match claim.relation.is_own() {
                true => "the study has no run that the claim speaks of".into(),
                false => "the study has no pair of runs that the claim speaks of".into(),
            },
        });
    }
    let verdict = overall(&out);
    let summary = summary(verdict, &out);
    Judged { claim, verdict, summary, groups: out }
}

fn twins(name: &str) -> (Option<&'static Metric>, Option<&'static Metric>) {
    let twin = TWINS.iter().find(|(a, b)| *a == name || *b == name);
    match (twin, metrics::find(name)) {
        (Some((a, b)), _) => (metrics::find(a), metrics::find(b)),
        (None, Some(m)) if m.kind == Kind::Modelled => (None, Some(m)),
        (None, m) => (m, None),
    }
}

/// Runs of one group, in pairs that agree in all axes neither selection fixes.
struct Pairs<'a> {
    name: String,
    scene_triangles: Option<f64>,
    pairs: Vec<(&'a RunResult, &'a RunResult)>,
}

fn groups<'a>(results: &'a StudyResults, claim: &Claim) -> Vec<Pairs<'a>> {
    let mut walks: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for run in &results.runs {
        let structure = format_sum(std::slice::from_ref(&run.spec.structure));
        walks.entry(structure).or_default().insert(run.spec.walk.to_string());
    }
    let fixed = |axis: &str| !claim.numerator.contains_key(axis) && !claim.denominator.contains_key(axis);
    let free = |run: &RunResult, arithmetic: &str| -> String {
        let mut axes = vec!["scene", "path", "structure", "culling", "walk", "arithmetic"];
        axes.extend(run.spec.axes.keys().map(String::as_str).filter(|a| !matches!(*a, "arithmetic" | "camera")));
        axes.retain(|a| fixed(a));
        let value = |axis: &str| match axis {
            // A structure's only walk is its own: a list is scanned, a tree descended,
            // and a claim about structures compares the two.
            "walk" if walks[&format_sum(std::slice::from_ref(&run.spec.structure))].len() == 1 => "its own".to_string(),
            "arithmetic" => arithmetic.to_string(),
            _ => format_sum(&axis_value(&run.spec, axis)),
        };
        let values = axes.iter().map(|a| format!("{a}={}", value(a)));
        // Times of different machines or series are never mixed; nor, unless a claim
        // asks for it, are scenes of two cameras.
        let camera = if fixed("camera") { format!("{:?}", run.spec.camera) } else { String::new() };
        let key = format!("{} {} {camera}", run.machine_class, run.spec.series);
        values.chain([key]).collect::<Vec<_>>().join(";")
    };
    // What takes no arithmetic ran once, and stands beside the others in each of them.
    let arithmetic = |run: &RunResult| format_sum(&axis_value(&run.spec, "arithmetic"));
    let all: BTreeSet<String> = results.runs.iter().map(arithmetic).collect();
    let keys = |run: &RunResult| -> BTreeSet<String> {
        let takes = run.spec.culling.iter().any(|part| culling::knows_arithmetic(&part.kind));
        if takes { BTreeSet::from([free(run, &arithmetic(run))]) } else { all.iter().map(|a| free(run, a)).collect() }
    };
    let mut partners: BTreeMap<String, Vec<&RunResult>> = BTreeMap::new();
    for b in results.runs.iter().filter(|b| selects(&claim.denominator, &b.spec)) {
        for key in keys(b) {
            partners.entry(key).or_default().push(b);
        }
    }
    let mut groups: Vec<Pairs> = Vec::new();
    for a in results.runs.iter().filter(|r| selects(&claim.numerator, &r.spec)) {
        let name = group_name(results, claim, a);
        let mut beside: Vec<&RunResult> = Vec::new();
        for b in keys(a).iter().flat_map(|key| partners.get(key).into_iter().flatten()) {
            if !beside.iter().any(|other| std::ptr::eq(*other, *b)) {
                beside.push(b);
            }
        }
        for b in beside {
            let group = match groups.iter_mut().position(|g| g.name == name) {
                Some(i) => &mut groups[i],
                None => {
                    let scene_triangles = metrics::known("scene_triangles").value(a);
                    groups.push(Pairs { name: name.clone(), scene_triangles, pairs: Vec::new() });
                    groups.last_mut().expect("just pushed")
                }
            };
            group.pairs.push((a, b));
        }
    }
    groups
}

/// Name of the group that `run` belongs to.
pub(super) fn group_name(results: &StudyResults, claim: &Claim, run: &RunResult) -> String {
    match claim.for_each.as_deref() {
        None => "everywhere".to_string(),
        Some("scene") => labels::place(results, run),
        Some("culling") => run.culling.clone(),
        Some("structure") => run.structure.clone(),
        Some(axis) => format_sum(&axis_value(&run.spec, axis)),
    }
}

/// Values of the pairs: (numerator trials, denominator trials); or why there are none.
type Trials = Vec<(Vec<f64>, Vec<f64>)>;

fn trials(pairs: &Pairs, metric: &Metric) -> Result<Trials, String> {
    let mut out = Vec::new();
    for (a, b) in &pairs.pairs {
        for run in [a, b] {
            if run.status != RunStatus::Done {
                return Err(format!("{} is {}", run.label(), super::table::status_word(run.status)));
            }
            if metric.value(run).is_none() {
                return Err(format!("{} has no {}", run.label(), metric.name));
            }
        }
        out.push((metric.values(a), metric.values(b)));
    }
    Ok(out)
}

/// Geometric mean of the ratios of medians, and its 95 % interval over resampled trials.
pub fn ratio(pairs: &[(Vec<f64>, Vec<f64>)]) -> Ratio {
    let of = |medians: &mut dyn FnMut(&[f64]) -> f64| -> f64 {
        let logs: f64 = pairs.iter().map(|(a, b)| (medians(a) / medians(b)).ln()).sum();
        (logs / pairs.len() as f64).exp()
    };
    let value = of(&mut stats::median);
    if pairs.iter().all(|(a, b)| a.len() < 2 && b.len() < 2) {
        return (value, value, value);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(metrics::SEED);
    let mut resampled = |from: &[f64]| resample(from, &mut rng);
    let found: Vec<f64> = (0..stats::RESAMPLES).map(|_| of(&mut resampled)).collect();
    (value, stats::quantile(&found, 0.025), stats::quantile(&found, 0.975))
}

fn resample(from: &[f64], rng: &mut ChaCha8Rng) -> f64 {
    let pick = |rng: &mut ChaCha8Rng| from[((u64::from(rng.next_u32()) * from.len() as u64) >> 32) as usize];
    let sample: Vec<f64> = from.iter().map(|_| pick(rng)).collect();
    stats::median(&sample)
}

/// Whether an interval lies wholly where the claim says (`Reproduced`), wholly
/// elsewhere, or on both sides.
pub fn decide(relation: Relation, published: Option<[f64; 2]>, tolerance: f64, (value, low, high): Ratio) -> Verdict {
    let (from, to) = match relation {
        Relation::Less => (f64::NEG_INFINITY, 1.0),
        Relation::Greater => (1.0, f64::INFINITY),
        Relation::Grows => (0.0, f64::INFINITY),
        Relation::Zero => (0.0, 0.0),
        Relation::Ratio | Relation::Value => match published {
            Some([a, b]) => (a * (1.0 - tolerance), b * (1.0 + tolerance)),
            None => return Verdict::Undecided,
        },
    };
    if !value.is_finite() || !low.is_finite() || !high.is_finite() {
        return Verdict::Undecided;
    }
    // A published range includes its ends; "below", "above" and "grows" do not.
    let closed = matches!(relation, Relation::Ratio | Relation::Value | Relation::Zero);
    let inside = |x: f64| if closed { from <= x && x <= to } else { from < x && x < to };
    if inside(low) && inside(high) {
        Verdict::Reproduced
    } else if high < from || low > to || (!closed && (high <= from || low >= to)) {
        Verdict::Contradicted
    } else {
        Verdict::Undecided
    }
}

/// Measured and modelled verdicts to one: agreement of the model alone is said as such.
pub fn combine(claim_is_modelled: bool, measured: Option<Verdict>, model: Option<Verdict>) -> Verdict {
    use Verdict::{ModelOnly, Reproduced, Undecided};
    match (measured, model) {
        (Some(Reproduced), _) if !claim_is_modelled => Reproduced,
        (Some(Reproduced), Some(Reproduced)) => Reproduced,
        (_, Some(Reproduced)) => ModelOnly,
        (_, Some(model)) if claim_is_modelled => model,
        (Some(measured), _) => measured,
        (None, Some(model)) => model,
        (None, None) => Undecided,
    }
}

fn in_group(claim: &Claim, group: &Pairs, measured: Option<&Metric>, modelled: Option<&Metric>) -> Option<Group> {
    let published = claim.published_of(&group.name);
    if claim.relation == Relation::Ratio && published.is_none() {
        return None;
    }
    let mut note = String::new();
    let mut one = |metric: Option<&Metric>| -> (Option<Ratio>, Option<Verdict>) {
        let Some(metric) = metric else { return (None, None) };
        match trials(group, metric) {
            Err(why) => {
                note = why;
                (None, None)
            }
            Ok(pairs) => {
                let found = ratio(&pairs);
                let verdict = decide(claim.relation, published, claim.tolerance, found);
                // One trial says nothing of its own spread.
                let lonely = matches!(metric.kind, Kind::Measured | Kind::Modelled)
                    && pairs.iter().any(|(a, b)| a.len() < 2 || b.len() < 2);
                if lonely {
                    note = "a single trial: no interval".into();
                }
                (Some(found), Some(if lonely { Verdict::Undecided } else { verdict }))
            }
        }
    };
    let (ratio, measured) = one(measured);
    let (model_ratio, model) = one(modelled);
    let is_modelled = metrics::find(&claim.metric).is_some_and(|m| m.kind == Kind::Modelled);
    let verdict = combine(is_modelled, measured, model);
    Some(Group { name: group.name.clone(), stated: stated(claim, published), verdict, ratio, model_ratio, note })
}

pub(super) fn stated(claim: &Claim, published: Option<[f64; 2]>) -> String {
    let number = |x| super::format::number(x, 3);
    let range = published.map(|[a, b]| if a == b { number(a) } else { format!("{} to {}", number(a), number(b)) });
    match (claim.relation, range) {
        (Relation::Less, None) => "below 1".into(),
        (Relation::Less, Some(r)) => format!("below 1 (published {r})"),
        (Relation::Greater, None) => "above 1".into(),
        (Relation::Greater, Some(r)) => format!("above 1 (published {r})"),
        (Relation::Zero, _) => format!("{} is 0", claim.metric),
        (Relation::Ratio | Relation::Value, r) => {
            format!("{} ± {} %", r.unwrap_or_default(), number(100.0 * claim.tolerance))
        }
        (Relation::Grows, _) => "grows with triangles".into(),
    }
}

/// One group for all: rank correlation of the ratio with the scene's triangles.
fn grows(claim: &Claim, groups: &[Pairs], measured: Option<&Metric>, modelled: Option<&Metric>) -> Vec<Group> {
    let mut note = String::new();
    let mut one = |metric: Option<&Metric>| -> (Option<Ratio>, Option<Verdict>) {
        let Some(metric) = metric else { return (None, None) };
        let mut usable: Vec<(f64, Trials)> = Vec::new();
        for g in groups {
            match (g.scene_triangles, trials(g, metric)) {
                (Some(n), Ok(pairs)) => usable.push((n, pairs)),
                (None, _) => note = format!("{}: triangles unknown", g.name),
                (_, Err(why)) => note = format!("{}: {why}", g.name),
            }
        }
        if usable.len() < 3 {
            note = format!("{} usable scenes; a trend needs three", usable.len());
            return (None, None);
        }
        let found = trend(&usable);
        (Some(found), Some(decide(Relation::Grows, None, 0.0, found)))
    };
    let (ratio, measured) = one(measured);
    let (model_ratio, model) = one(modelled);
    if ratio.is_none() && model_ratio.is_none() && groups.is_empty() {
        return Vec::new();
    }
    let is_modelled = metrics::find(&claim.metric).is_some_and(|m| m.kind == Kind::Modelled);
    let verdict = combine(is_modelled, measured, model);
    if note.is_empty() {
        note = format!("rank correlation over {} scenes", groups.len());
    }
    vec![Group { name: "trend".into(), stated: stated(claim, None), verdict, ratio, model_ratio, note }]
}

/// Spearman correlation of triangles with ratio. The interval resamples scenes
/// and trials: with few scenes a perfect ranking is still weak evidence.
fn trend(scenes: &[(f64, Trials)]) -> Ratio {
    let points: Vec<(f64, f64)> =
        scenes.iter().map(|(n, pairs)| (*n, median_ratio(pairs, &mut stats::median))).collect();
    let correlate = |points: &[(f64, f64)]| {
        stats::spearman(
            &points.iter().map(|p| p.0).collect::<Vec<_>>(),
            &points.iter().map(|p| p.1).collect::<Vec<_>>(),
        )
    };
    let value = correlate(&points);
    let mut rng = ChaCha8Rng::seed_from_u64(metrics::SEED);
    let found: Vec<f64> = (0..stats::RESAMPLES / 5)
        .map(|_| {
            let sample: Vec<(f64, f64)> = scenes
                .iter()
                .map(|_| &scenes[((u64::from(rng.next_u32()) * scenes.len() as u64) >> 32) as usize])
                .collect::<Vec<_>>()
                .into_iter()
                .map(|(n, pairs)| (*n, median_ratio(pairs, &mut |v| resample(v, &mut rng))))
                .collect();
            correlate(&sample)
        })
        // A resample of one scene alone has no correlation.
        .filter(|c| !c.is_nan())
        .collect();
    (value, stats::quantile(&found, 0.025), stats::quantile(&found, 0.975))
}

fn median_ratio(pairs: &Trials, median: &mut dyn FnMut(&[f64]) -> f64) -> f64 {
    let logs: f64 = pairs.iter().map(|(a, b)| (median(a) / median(b)).ln()).sum();
    (logs / pairs.len() as f64).exp()
}

/// Claims speak of every group: one contradiction contradicts, one doubt leaves doubt.
fn overall(groups: &[Group]) -> Verdict {
    let has = |v| groups.iter().any(|g| g.verdict == v);
    [Verdict::Contradicted, Verdict::Undecided, Verdict::ModelOnly]
        .into_iter()
        .find(|v| has(*v))
        .unwrap_or(Verdict::Reproduced)
}

fn summary(verdict: Verdict, groups: &[Group]) -> String {
    let at: Vec<&str> = groups.iter().filter(|g| g.verdict == verdict).map(|g| g.name.as_str()).collect();
    match (at.len() == groups.len(), groups.len()) {
        (true, 1) if groups[0].name == "everywhere" || groups[0].name == "trend" => verdict.word().to_string(),
        (true, 1) => format!("{} at {}", verdict.word(), at[0]),
        (true, n) => format!("{} at all {n}", verdict.word()),
        (false, n) => format!("{} at {} of {n}: {}", verdict.word(), at.len(), at.join(", ")),
    }
}
