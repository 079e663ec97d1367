//! Verdicts on published claims: four outcomes, place by place.

use super::best;
use super::metrics::{self, Kind, Metric};
use super::own_value;
use super::pairs::{Pairs, Trials, groups, trials};
use crate::claim::{Claim, Relation, selects};
use crate::results::{RunResult, StudyResults};
use crate::stats;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// The order is from agreement to disagreement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Reproduced,
    /// The claim is about modelled frame time, which shows it; measured culling time alone does not.
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
    } else if claim.relation == Relation::Best {
        best::groups(results, claim, measured, modelled)
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
    if let ([group], Some(place)) = (&mut out[..], only_place(results, claim)) {
        group.name = place;
    }
    let verdict = overall(&out);
    let summary = summary(verdict, &out);
    Judged { claim, verdict, summary, groups: out }
}

/// The scene of a claim that is not made scene by scene and speaks of one alone: then
/// "everywhere" is there.
fn only_place(results: &StudyResults, claim: &Claim) -> Option<String> {
    if claim.for_each.is_some() || claim.relation == Relation::Grows || !claim.published_for.is_empty() {
        return None;
    }
    let spoken = |r: &&RunResult| selects(&claim.numerator, &r.spec) || selects(&claim.denominator, &r.spec);
    // A claim about a metric itself has no denominator.
    let spoken = |r: &&RunResult| if claim.relation.is_own() { selects(&claim.numerator, &r.spec) } else { spoken(r) };
    let mut runs = results.runs.iter().filter(spoken);
    let first = runs.next()?;
    let same = |r: &RunResult| r.scene() == first.scene() && r.spec.path.name == first.spec.path.name;
    runs.all(same).then(|| super::labels::place(results, first))
}

fn twins(name: &str) -> (Option<&'static Metric>, Option<&'static Metric>) {
    let twin = TWINS.iter().find(|(a, b)| *a == name || *b == name);
    match (twin, metrics::find(name)) {
        (Some((a, b)), _) => (metrics::find(a), metrics::find(b)),
        (None, Some(m)) if m.kind == Kind::Modelled => (None, Some(m)),
        (None, m) => (m, None),
    }
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
        Relation::Less | Relation::Best => (f64::NEG_INFINITY, 1.0),
        Relation::Greater => (1.0, f64::INFINITY),
        Relation::Grows => (0.0, f64::INFINITY),
        Relation::Zero => (0.0, 0.0),
        Relation::Ratio | Relation::Value => match published {
            // A correlation may be below 0, and is widened all the same.
            Some([a, b]) => (a - tolerance * a.abs(), b + tolerance * b.abs()),
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
    } else if relation == Relation::Best && low <= to {
        // Level with the best of the rest is neither better nor worse.
        Verdict::Undecided
    } else if high < from || low > to || (!closed && (high <= from || low >= to)) {
        Verdict::Contradicted
    } else {
        Verdict::Undecided
    }
}

/// Measured and modelled verdicts to one. The metric that the claim names decides: the model
/// adds drawing, so that it can neither save nor fell a claim about culling alone; agreement
/// of the model without that of the measurement is said as such.
pub fn combine(claim_is_modelled: bool, measured: Option<Verdict>, model: Option<Verdict>) -> Verdict {
    use Verdict::{ModelOnly, Reproduced, Undecided};
    if !claim_is_modelled {
        return measured.unwrap_or(Undecided);
    }
    match (measured, model) {
        (Some(Reproduced), Some(Reproduced)) => Reproduced,
        (_, Some(Reproduced)) => ModelOnly,
        (_, Some(model)) => model,
        (Some(measured), None) => measured,
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
                    && !metric.is_virtual()
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
        (Relation::Best, None) => "best: below 1".into(),
        (Relation::Best, Some(r)) => format!("best: below 1 (published {r})"),
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
    let value = correlate(&points).unwrap_or(f64::NAN);
    let mut rng = ChaCha8Rng::seed_from_u64(metrics::SEED);
    let found: Vec<f64> = (0..stats::RESAMPLES / 5)
        // A resample of one scene alone has no correlation.
        .filter_map(|_| {
            let sample: Vec<(f64, f64)> = scenes
                .iter()
                .map(|_| &scenes[((u64::from(rng.next_u32()) * scenes.len() as u64) >> 32) as usize])
                .collect::<Vec<_>>()
                .into_iter()
                .map(|(n, pairs)| (*n, median_ratio(pairs, &mut |v| resample(v, &mut rng))))
                .collect();
            correlate(&sample)
        })
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
