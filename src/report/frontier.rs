//! Run time against error: who is on the Pareto front of a scene, who is dominated
//! and by whom, and what the trials cannot tell.
//!
//! A point is *on the front* when no other is at least as good in both coordinates
//! and better in one. It is *dominated* when another beats it although both are
//! moved to the ends of their 95 % intervals that speak against the claim; between
//! the two it is *within noise* of the front. A conservative method above zero is a
//! bug and no point: it is withheld, and said to be.

use super::labels::Grid;
use super::metrics::{self, Kind, Metric};
use super::pareto;
use super::style::IDLE;
use super::tables::class_word;
use crate::claim::Better;
use crate::culling::Class;
use crate::error::Error;
use crate::record::FrameErrors;
use crate::results::{RunResult, RunStatus};
use crate::stats;

/// A value with the ends of its interval.
pub type Spread = (f64, f64, f64);

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Standing {
    /// Not dominated by value, and no interval of another reaches it.
    Front,
    /// Not dominated by value, but another might dominate it within the intervals.
    Contested,
    /// Dominated by value, though not beyond the intervals.
    Noise,
    Dominated,
}

impl Standing {
    pub fn word(self) -> &'static str {
        match self {
            Standing::Front => "front",
            Standing::Contested => "front, contested",
            Standing::Noise => "within noise",
            Standing::Dominated => "dominated",
        }
    }

    pub fn on_front(self) -> bool {
        matches!(self, Standing::Front | Standing::Contested)
    }
}

pub struct Point<'a> {
    pub run: &'a RunResult,
    /// Index in [`Grid::combinations`].
    pub combination: usize,
    /// With their 95 % intervals over trials; equal ends where nothing varies.
    pub x: Spread,
    pub y: Spread,
    pub standing: Standing,
    /// Who dominates it, or would by value alone: index in [`Front::points`].
    pub by: Option<usize>,
}

/// A run that is no point, and why.
pub struct Gap<'a> {
    pub run: &'a RunResult,
    pub combination: usize,
    pub why: String,
}

/// The metric of an axis: on both the lower end is where everybody wants to be.
///
/// # Errors
/// For a name that is no metric, and for a metric of which more is better.
pub fn coordinate(name: &str) -> Result<&'static Metric, Error> {
    let metric = metrics::get(name)?;
    match metric.better {
        Better::Less | Better::Neither => Ok(metric),
        Better::More => {
            Err(Error::new(format!("more of `{name}` is better, and a front is of what is better the less it is"))
                .help("take the time instead of the rate: frame_ms_model"))
        }
    }
}

/// All of one scene.
pub struct Front<'a> {
    pub place: String,
    /// By ascending x.
    pub points: Vec<Point<'a>>,
    pub gaps: Vec<Gap<'a>>,
}

impl Front<'_> {
    pub fn on_front(&self) -> impl Iterator<Item = &Point<'_>> {
        self.points.iter().filter(|p| p.standing.on_front())
    }
}

/// The front of every scene of the grid, of the runs that `keep` holds.
pub fn fronts<'a>(grid: &Grid<'a>, x: &Metric, y: &Metric, keep: &dyn Fn(&RunResult) -> bool) -> Vec<Front<'a>> {
    let places = grid.places.iter().zip(&grid.cells);
    places
        .map(|(place, cells)| {
            let mut front = Front { place: place.clone(), points: Vec::new(), gaps: Vec::new() };
            for (combination, run) in cells.iter().enumerate().filter_map(|(c, cell)| Some((c, (*cell)?))) {
                if !keep(run) {
                    continue;
                }
                match coordinates(run, x, y) {
                    Ok((x, y)) => {
                        let (standing, by) = (Standing::Front, None);
                        front.points.push(Point { run, combination, x, y, standing, by });
                    }
                    Err(why) => front.gaps.push(Gap { run, combination, why }),
                }
            }
            front.points.sort_by(|a, b| {
                a.x.0.total_cmp(&b.x.0).then(a.y.0.total_cmp(&b.y.0)).then(a.combination.cmp(&b.combination))
            });
            let ranked = rank(&front.points.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>());
            for (point, (standing, by)) in front.points.iter_mut().zip(ranked) {
                (point.standing, point.by) = (standing, by);
            }
            front
        })
        .collect()
}

/// Where a run stands, or why it has no place.
fn coordinates(run: &RunResult, x: &Metric, y: &Metric) -> Result<(Spread, Spread), String> {
    match run.status {
        RunStatus::Done => {}
        RunStatus::Wrong => {
            let reason = run.reason.as_deref().unwrap_or("it lost what it must keep");
            return Err(format!("wrong for its class, a bug and no point: withheld ({reason})"));
        }
        other => {
            let reason = run.reason.as_ref().map_or_else(String::new, |r| format!(": {r}"));
            return Err(format!("{}{reason}", other.word()));
        }
    }
    if let Some(why) = broken_promise(run) {
        return Err(why);
    }
    if x.kind == Kind::Measured && culls_in_time(x.name) && run.culling == IDLE {
        return Err("does no culling, so its culling time says nothing".into());
    }
    let x = x.interval(run).ok_or_else(|| format!("no {}", x.name))?;
    let missing = if y.kind == Kind::Judged { "not judged".to_string() } else { format!("no {}", y.name) };
    let y = y.interval(run).ok_or(missing)?;
    Ok((x, y))
}

/// Metrics by which a run that culls nothing would win without merit.
fn culls_in_time(name: &str) -> bool {
    ["cull_ms", "median_frame_us", "p99_cull_ms", "p99_frame_us", "total_cull_ms"].contains(&name)
}

/// A run that passed although it lost pixels that its class must keep: the judge
/// fails these, so one that is found here is a bug of ours.
fn broken_promise(run: &RunResult) -> Option<String> {
    let class = run.class.filter(|c| matches!(c, Class::Exact | Class::Conservative | Class::SampleConservative))?;
    let lost: u64 = run.errors.iter().map(|e| e.false_cull_pixels).sum();
    (lost > 0).then(|| format!("declared {}, yet it lost {lost} pixels: a bug and no point", class_word(class)))
}

/// `a` at least as good as `b` in both and better in one.
fn beats(a: (f64, f64), b: (f64, f64)) -> bool {
    a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1)
}

/// The standing of each of some points (x, y), and who dominates it or would by
/// value alone: of several the one of largest x, those on the front first.
pub fn rank(points: &[(Spread, Spread)]) -> Vec<(Standing, Option<usize>)> {
    let value = |i: usize| (points[i].0.0, points[i].1.0);
    let low = |i: usize| (points[i].0.1, points[i].1.1);
    let high = |i: usize| (points[i].0.2, points[i].1.2);
    let on = pareto::front(&(0..points.len()).map(value).collect::<Vec<_>>());
    let nearest = |mut found: Vec<usize>| {
        found.sort_by(|a, b| {
            on.contains(a).cmp(&on.contains(b)).then(value(*a).0.total_cmp(&value(*b).0)).then(b.cmp(a))
        });
        found.last().copied()
    };
    let of = |i: usize| {
        let others = || (0..points.len()).filter(move |j| *j != i);
        if on.contains(&i) {
            let contested = others().any(|j| beats(low(j), high(i)));
            return (if contested { Standing::Contested } else { Standing::Front }, None);
        }
        match nearest(others().filter(|j| beats(high(*j), low(i))).collect()) {
            Some(by) => (Standing::Dominated, Some(by)),
            None => (Standing::Noise, nearest(others().filter(|j| beats(value(*j), value(i))).collect())),
        }
    };
    (0..points.len()).map(of).collect()
}

/// Over-submission between its bounds, mean over judged frames: |S| / |V_hi|, and
/// |S| / |V_lo|. The lower is unknown where no hiding was proved. The truth is the
/// same for all methods of a scene, so these bounds are no noise between them.
pub fn over_submission(run: &RunResult) -> Option<(Option<f64>, f64)> {
    // Frames that show nothing have no upper bound: both means leave them out.
    let frames: Vec<&FrameErrors> = run.errors.iter().filter(|e| e.over_submission().is_finite()).collect();
    let mean = |of: &dyn Fn(&FrameErrors) -> f64| stats::mean(&frames.iter().map(|e| of(e)).collect::<Vec<_>>());
    if frames.is_empty() {
        return None;
    }
    let bracketed = run.spec.accuracy.hiding_cells > 0;
    let least = |e: &FrameErrors| if e.submitted == 0 { 1.0 } else { e.submitted as f64 / e.visible_hi as f64 };
    Some((bracketed.then(|| mean(&least)), mean(&FrameErrors::over_submission)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standings of points given as (x, its half width, y).
    fn standings(points: &[(f64, f64, f64)]) -> Vec<(Standing, Option<usize>)> {
        rank(&points.iter().map(|(x, half, y)| ((*x, x - half, x + half), (*y, *y, *y))).collect::<Vec<_>>())
    }

    #[test]
    fn domination_is_claimed_only_beyond_the_intervals() {
        use Standing::{Contested, Dominated, Front, Noise};
        // 10 and 10.5 overlap at the same error; 14 is slower for sure.
        assert_eq!(
            standings(&[(10.0, 0.4, 0.0), (10.5, 0.4, 0.0), (14.0, 0.4, 0.0), (5.0, 0.4, 9.0)]),
            [(Contested, None), (Noise, Some(0)), (Dominated, Some(0)), (Front, None)]
        );
        // Without spread the value alone decides.
        assert_eq!(standings(&[(10.0, 0.0, 0.0), (10.5, 0.0, 0.0)]), [(Front, None), (Dominated, Some(0))]);
        // As fast within noise, but with a smaller error for sure: the larger error may be the faster.
        assert_eq!(standings(&[(10.0, 1.0, 5.0), (10.5, 1.0, 0.0)]), [(Contested, None), (Front, None)]);
        assert_eq!(standings(&[(10.5, 1.0, 5.0), (10.0, 1.0, 0.0)]), [(Noise, Some(1)), (Front, None)]);
        // Of two that dominate the nearer is named.
        assert_eq!(standings(&[(1.0, 0.0, 3.0), (2.0, 0.0, 1.0), (4.0, 0.0, 3.0)])[2], (Dominated, Some(1)));
        assert!(standings(&[]).is_empty());
    }

    #[test]
    fn standings_agree_with_the_front_on_random_points() {
        use rand_chacha::rand_core::{RngCore, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let mut draw = |n: u32| f64::from(rng.next_u32() % n);
        for round in 0..300 {
            let points: Vec<(f64, f64, f64)> = (0..round % 17).map(|_| (draw(8), draw(3) / 2.0, draw(5))).collect();
            let values: Vec<(f64, f64)> = points.iter().map(|p| (p.0, p.2)).collect();
            let on = pareto::front(&values);
            for (i, (standing, by)) in standings(&points).into_iter().enumerate() {
                assert_eq!(standing.on_front(), on.contains(&i), "{points:?}");
                assert_eq!(by.is_none(), standing.on_front(), "{points:?}");
                assert!(by.is_none_or(|by| beats(values[by], values[i])), "{points:?}");
            }
        }
    }
}
