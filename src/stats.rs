//! Medians, spreads and intervals. The unit that is resampled is the trial (one
//! child process), never the frame: frames of one walk are autocorrelated, so
//! an interval over them would be far too narrow.

mod nnls;

pub use nnls::nnls;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// Resamples of every bootstrap in reports.
pub const RESAMPLES: usize = 10_000;

/// Sorted copy without NaN.
fn sorted(values: &[f64]) -> Vec<f64> {
    let mut v: Vec<f64> = values.iter().copied().filter(|x| !x.is_nan()).collect();
    v.sort_unstable_by(f64::total_cmp);
    v
}

/// Quantile `q` in 0..=1 by linear interpolation between order statistics
/// (type 7 of Hyndman and Fan 1996); NaN for no values.
pub fn quantile(values: &[f64], q: f64) -> f64 {
    quantile_sorted(&sorted(values), q)
}

fn quantile_sorted(v: &[f64], q: f64) -> f64 {
    if v.is_empty() {
        return f64::NAN;
    }
    let at = q.clamp(0.0, 1.0) * (v.len() - 1) as f64;
    let (low, high) = (v[at.floor() as usize], v[at.ceil() as usize]);
    // Equal neighbours first: infinity minus infinity would be NaN.
    if low == high { low } else { low + (high - low) * at.fract() }
}

pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Median absolute deviation from the median, not scaled.
pub fn mad(values: &[f64]) -> f64 {
    let m = median(values);
    median(&values.iter().map(|x| (x - m).abs()).collect::<Vec<_>>())
}

/// Standard deviation over mean; NaN for fewer than two values.
pub fn coefficient_of_variation(values: &[f64]) -> f64 {
    let m = mean(values);
    let squares: f64 = values.iter().map(|x| (x - m).powi(2)).sum();
    (squares / (values.len() as f64 - 1.0)).sqrt() / m
}

/// Uniform index below `n`, by multiplication (bias below 2^-32 for our sizes).
fn below(rng: &mut ChaCha8Rng, n: usize) -> usize {
    ((u64::from(rng.next_u32()) * n as u64) >> 32) as usize
}

/// 95 % percentile-bootstrap interval of the median over trials: not drawn but computed.
/// Over all resamples of `n` values the distribution of their median is known (Maritz and
/// Jarrett 1978; Efron's ideal bootstrap), so nothing depends on a seed and ten
/// thousand draws are saved. One value gives itself twice.
pub fn median_ci(values: &[f64]) -> (f64, f64) {
    let v = sorted(values);
    let n = v.len();
    if n < 2 {
        let one = v.first().copied().unwrap_or(f64::NAN);
        return (one, one);
    }
    // Of very many values the middle two are as good as one.
    let mut weighted = if n % 2 == 1 || n > PAIRS { order_statistics(&v) } else { even_medians(&v) };
    weighted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let at = |q: f64| {
        let mut sum = 0.0;
        let found = weighted.iter().find(|(_, p)| {
            sum += p;
            sum >= q - 1e-12
        });
        found.or(weighted.last()).map_or(f64::NAN, |w| w.0)
    };
    (at(0.025), at(0.975))
}

/// Up to so many values [`median_ci`] reaches from the smallest to the largest.
pub const ENDS: usize = 5;

/// How often the interval from the smallest to the largest of `n` values holds the true
/// median, whatever the distribution: unless all of them fall on the same side of it.
pub fn coverage_of_ends(n: usize) -> f64 {
    1.0 - 0.5f64.powi(n as i32 - 1)
}

/// P(at least `k` of `n` draws fall among the first `i` of `n` values).
fn at_least(k: usize, i: usize, n: usize, ln_factorial: &[f64]) -> f64 {
    if i == 0 || i == n {
        return if i == n { 1.0 } else { 0.0 };
    }
    let p = i as f64 / n as f64;
    let term = |j: usize| {
        let choose = ln_factorial[n] - ln_factorial[j] - ln_factorial[n - j];
        (choose + j as f64 * p.ln() + (n - j) as f64 * (1.0 - p).ln()).exp()
    };
    (k..=n).map(term).sum()
}

fn ln_factorials(n: usize) -> Vec<f64> {
    let steps = (1..=n).scan(0.0, |sum, i| {
        *sum += (i as f64).ln();
        Some(*sum)
    });
    std::iter::once(0.0).chain(steps).collect()
}

/// Up to so many values the middle two of an even number are looked at in pairs.
const PAIRS: usize = 200;

/// Each value with the share of resamples whose median it is (whose lower middle, of an
/// even number).
fn order_statistics(v: &[f64]) -> Vec<(f64, f64)> {
    let (n, ln) = (v.len(), ln_factorials(v.len()));
    let cdf: Vec<f64> = (0..=n).map(|i| at_least(n.div_ceil(2), i, n, &ln)).collect();
    v.iter().zip(cdf.windows(2)).map(|(x, c)| (*x, c[1] - c[0])).collect()
}

/// Each mean of two values with the share of resamples whose middle two they are.
fn even_medians(v: &[f64]) -> Vec<(f64, f64)> {
    let (n, k, ln) = (v.len(), v.len() / 2, ln_factorials(v.len()));
    let middle_ln = ln[n] - 2.0 * ln[k];
    // k draws among the first i values and the other k from the j-th on; i < j, both from 1.
    let apart = |i: usize, j: usize| {
        let share = |m: usize| k as f64 * (m as f64 / n as f64).ln();
        if i == 0 || j > n { 0.0 } else { (middle_ln + share(i) + share(n + 1 - j)).exp() }
    };
    let mut out = Vec::with_capacity(n * (n + 1) / 2);
    for i in 1..=n {
        let mut rest = at_least(k, i, n, &ln) - at_least(k, i - 1, n, &ln);
        for j in i + 1..=n {
            let p = apart(i, j) - apart(i - 1, j) - apart(i, j + 1) + apart(i - 1, j + 1);
            rest -= p;
            out.push((if v[i - 1] == v[j - 1] { v[i - 1] } else { v[i - 1] + (v[j - 1] - v[i - 1]) / 2.0 }, p));
        }
        out.push((v[i - 1], rest));
    }
    out
}

/// Ratio of medians `a / b` with its 95 % interval; trials of `a` and `b` are
/// resampled independently, since they ran in different processes.
pub fn ratio_ci(a: &[f64], b: &[f64], resamples: usize, seed: u64) -> (f64, f64, f64) {
    let ratio = median(a) / median(b);
    if a.is_empty() || b.is_empty() || (a.len() < 2 && b.len() < 2) {
        return (ratio, ratio, ratio);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |from: &[f64]| -> f64 {
        let sample: Vec<f64> = from.iter().map(|_| from[below(&mut rng, from.len())]).collect();
        median(&sample)
    };
    let found: Vec<f64> = (0..resamples).map(|_| draw(a) / draw(b)).collect();
    let v = sorted(&found);
    (ratio, quantile_sorted(&v, 0.025), quantile_sorted(&v, 0.975))
}

/// Least number of values that a correlation is of: through two points there is always a line.
const FEWEST: usize = 3;

/// Deviations from the mean; none where the values do not vary, are too few or not all finite.
fn centred(values: &[f64]) -> Option<Vec<f64>> {
    let first = *values.first()?;
    let varies = values.iter().any(|v| *v != first);
    if values.len() < FEWEST || !varies || values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let m = mean(values);
    Some(values.iter().map(|v| v - m).collect())
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Cosine of two deviations: their correlation.
fn cosine(a: &[f64], b: &[f64]) -> Option<f64> {
    let r = dot(a, b) / (dot(a, a).sqrt() * dot(b, b).sqrt());
    // Rounding may go a last digit beyond 1.
    r.is_finite().then(|| r.clamp(-1.0, 1.0))
}

/// Pearson correlation. None when either side does not vary, for fewer than three values,
/// for values that are not finite and for sides of different lengths.
pub fn pearson(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.len() != y.len() {
        return None;
    }
    cosine(&centred(x)?, &centred(y)?)
}

/// Spearman rank correlation, ties given their mean rank; none where [`pearson`] has none.
pub fn spearman(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.iter().chain(y).any(|v| !v.is_finite()) {
        return None;
    }
    pearson(&ranks(x), &ranks(y))
}

/// What is less than this share of a side's variance is rounding and not left to correlate.
const NOTHING_LEFT: f64 = 1e-10;

/// Partial correlation of `x` and `y` with `z` held constant: the correlation of what a
/// straight line in `z` leaves of either. None where it leaves nothing of one of them, where
/// `x` or `y` does not vary, and for fewer than four values. A constant `z` holds nothing back.
pub fn partial(x: &[f64], y: &[f64], z: &[f64]) -> Option<f64> {
    if x.len() != y.len() || x.len() != z.len() || x.len() <= FEWEST {
        return None;
    }
    if z.iter().all(|v| *v == z[0]) {
        return pearson(x, y);
    }
    let z = centred(z)?;
    let rest = |side: &[f64]| {
        let side = centred(side)?;
        let slope = dot(&side, &z) / dot(&z, &z);
        let rest: Vec<f64> = side.iter().zip(&z).map(|(s, z)| s - slope * z).collect();
        (dot(&rest, &rest) > NOTHING_LEFT * dot(&side, &side)).then_some(rest)
    };
    cosine(&rest(x)?, &rest(y)?)
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut out = vec![0.0; values.len()];
    let mut start = 0;
    while start < order.len() {
        let mut end = start + 1;
        while end < order.len() && values[order[end]] == values[order[start]] {
            end += 1;
        }
        let rank = (start + end - 1) as f64 / 2.0;
        order[start..end].iter().for_each(|i| out[*i] = rank);
        start = end;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_and_survive_infinities() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[1.0, 2.0, 3.0, 4.0]), 2.5);
        assert_eq!(quantile(&[0.0, 10.0], 0.99), 9.9);
        assert_eq!(median(&[f64::INFINITY, f64::INFINITY]), f64::INFINITY);
        assert!(median(&[]).is_nan());
        assert_eq!(mad(&[1.0, 1.0, 2.0, 2.0, 4.0, 6.0, 9.0]), 1.0);
    }

    #[test]
    fn the_interval_covers_the_true_median_about_as_often_as_it_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let uniform = |rng: &mut ChaCha8Rng| f64::from(rng.next_u32()) / f64::from(u32::MAX);
        let covered = (0..200)
            .filter(|_| {
                let values: Vec<f64> = (0..25).map(|_| uniform(&mut rng)).collect();
                let (lo, hi) = median_ci(&values);
                lo <= 0.5 && 0.5 <= hi
            })
            .count();
        assert!((175..=200).contains(&covered), "{covered} of 200");
    }

    #[test]
    fn the_computed_interval_is_the_one_that_draws_come_near() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for n in [2, 3, 4, 5, 6, 7, 9, 10, 15, 30] {
            let values: Vec<f64> = (0..n).map(|_| f64::from(rng.next_u32() % 1000)).collect();
            let (lo, hi) = median_ci(&values);
            let mut sample = vec![0.0; n];
            let drawn: Vec<f64> = (0..20_000)
                .map(|_| {
                    sample.iter_mut().for_each(|s| *s = values[below(&mut rng, n)]);
                    median(&sample)
                })
                .collect();
            let share = |keep: &dyn Fn(f64) -> bool| drawn.iter().filter(|x| keep(**x)).count() as f64 / 2e4;
            // Ends of a discrete distribution: nothing outside weighs more than 2.5 %.
            assert!(share(&|x| x < lo) <= 0.03 && share(&|x| x <= lo) >= 0.02, "{n}: {lo}");
            assert!(share(&|x| x > hi) <= 0.03 && share(&|x| x >= hi) >= 0.02, "{n}: {hi}");
        }
        for weights in [order_statistics(&[1.0, 2.0, 3.0, 4.0, 5.0]), even_medians(&[1.0, 2.0, 3.0, 4.0])] {
            assert!((weights.iter().map(|w| w.1).sum::<f64>() - 1.0).abs() < 1e-12);
        }
        // All 27 resamples of three: 7 have the smallest as median, 13 the middle one.
        let three = order_statistics(&[1.0, 2.0, 3.0]);
        assert!((three[0].1 - 7.0 / 27.0).abs() < 1e-12 && (three[1].1 - 13.0 / 27.0).abs() < 1e-12);
        for n in [200, 201, 202, 1500, 5000] {
            let values: Vec<f64> = (0..n).map(f64::from).collect();
            let (lo, hi) = median_ci(&values);
            let (middle, root) = (f64::from(n) / 2.0, f64::from(n).sqrt());
            assert!(lo < middle && hi > middle && hi - lo < 3.0 * root && hi - lo > root, "{n}: {lo} {hi}");
        }
        assert_eq!(median_ci(&[f64::INFINITY; 3]), (f64::INFINITY, f64::INFINITY));
        assert_eq!(median_ci(&[4.0]), (4.0, 4.0));
    }

    #[test]
    fn few_values_are_spanned_by_their_interval_and_cover_what_is_said() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for n in 2..=ENDS {
            let drawn = (0..20_000).map(|_| (0..n).map(|_| f64::from(rng.next_u32())).collect::<Vec<f64>>());
            let intervals = drawn.map(|v| (median_ci(&v), (quantile(&v, 0.0), quantile(&v, 1.0))));
            let middle = f64::from(u32::MAX) / 2.0;
            let covered = intervals.inspect(|(a, b)| assert_eq!(a, b)).filter(|(i, _)| i.0 <= middle && middle <= i.1);
            assert!((covered.count() as f64 / 2e4 - coverage_of_ends(n)).abs() < 0.015, "{n}");
        }
        assert!(median_ci(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).0 > 1.0 && coverage_of_ends(3) == 0.75);
    }

    #[test]
    fn a_ratio_of_equal_samples_straddles_one() {
        let a = [1.0, 1.1, 0.9, 1.05, 0.95];
        let (r, lo, hi) = ratio_ci(&a, &a, 2000, 7);
        assert!(r == 1.0 && lo < 1.0 && hi > 1.0);
        let twice = a.map(|x| 2.0 * x);
        let (r, lo, _) = ratio_ci(&twice, &a, 2000, 7);
        assert!(r == 2.0 && lo > 1.5);
    }

    fn near(found: Option<f64>, by_hand: f64) {
        assert!(found.is_some_and(|r| (r - by_hand).abs() < 1e-12), "{found:?} is not {by_hand}");
    }

    #[test]
    fn correlations_of_a_monotone_curve() {
        let x: Vec<f64> = (0..50).map(f64::from).collect();
        let y: Vec<f64> = x.iter().map(|v| v * v * v).collect();
        near(spearman(&x, &y), 1.0);
        assert!(pearson(&x, &y).unwrap() < 0.95);
        assert_eq!(ranks(&[5.0, 5.0, 1.0]), [1.5, 1.5, 0.0]);
    }

    #[test]
    fn correlations_are_those_found_by_hand() {
        let (x, y) = ([1.0, 2.0, 3.0, 4.0, 5.0], [2.0, 1.0, 4.0, 3.0, 5.0]);
        // Deviations -2 -1 0 1 2 and -1 -2 1 0 2: products 8, squares 10 and 10.
        near(pearson(&x, &y), 0.8);
        near(spearman(&x, &y), 0.8);
        near(pearson(&x, &[-1.0, -3.0, -5.0, -7.0, -9.0]), -1.0);
        // Deviations -2 0 2 and -3 1 2: products 10, squares 8 and 14.
        near(pearson(&[1.0, 3.0, 5.0], &[0.0, 4.0, 5.0]), 10.0 / 112f64.sqrt());
        // Ties: ranks 0 1.5 1.5 3 and 0 1 2 3; products 4.5, squares 4.5 and 5.
        near(spearman(&[10.0, 20.0, 20.0, 90.0], &[1.0, 2.0, 3.0, 4.0]), 4.5 / 22.5f64.sqrt());
        // All tied on one side but one: ranks 1 1 1 3 about 1.5.
        near(spearman(&[7.0, 7.0, 7.0, 9.0], &[1.0, 2.0, 3.0, 4.0]), 3.0 / 15f64.sqrt());
        // A far offset must not eat the digits.
        let far = |v: [f64; 5]| v.map(|v| v + 1e9);
        near(pearson(&far(x), &far(y)), 0.8);
    }

    #[test]
    fn a_partial_correlation_is_that_of_the_residuals() {
        let (x, y) = ([1.0, 2.0, 3.0, 4.0, 5.0], [2.0, 1.0, 4.0, 3.0, 5.0]);
        let z = [1.0, 3.0, 2.0, 5.0, 4.0];
        // Deviations of z -2 0 -1 2 1: r_xy = 0.8, r_xz = 8/10, r_yz = 3/10,
        // so (0.8 - 0.8 x 0.3) / sqrt(0.36 x 0.91).
        near(pearson(&x, &z), 0.8);
        near(pearson(&y, &z), 0.3);
        near(partial(&x, &y, &z), 0.56 / 0.3276f64.sqrt());
        near(partial(&y, &x, &z), 0.56 / 0.3276f64.sqrt());
        // Triangles and time that both follow the nodes, and differ from them in opposite ways.
        let nodes = [1.0, 2.0, 3.0, 4.0];
        let (more, less) = ([1.1, 1.9, 2.9, 4.1], [0.9, 2.1, 3.1, 3.9]);
        assert!(pearson(&more, &less).unwrap() > 0.9);
        near(partial(&more, &less, &nodes), -1.0);
        near(partial(&x, &y, &[6.0; 5]), 0.8);
        assert_eq!(partial(&x, &y, &x.map(|v| 3.0 * v + 0.1)), None, "nothing is left of x");
        assert_eq!(partial(&nodes[..3], &more[..3], &less[..3]), None, "three points leave one degree of freedom");
    }

    #[test]
    fn where_a_series_does_not_vary_there_is_no_correlation() {
        let y = [1.0, 2.0, 3.0, 4.0];
        // A mean of tenths is none of them: deviations of rounding alone must not correlate.
        for x in [[0.1; 4], [0.0; 4], [f64::NAN, 1.0, 2.0, 3.0], [f64::INFINITY, 1.0, 2.0, 3.0]] {
            assert_eq!((pearson(&x, &y), pearson(&y, &x)), (None, None), "{x:?}");
            assert_eq!((spearman(&x, &y), spearman(&y, &x)), (None, None), "{x:?}");
            assert_eq!(partial(&x, &y, &[1.0, 3.0, 2.0, 5.0]), None, "{x:?}");
        }
        assert_eq!(pearson(&y, &y[..3]), None);
        assert_eq!(pearson(&[1.0, 2.0], &[5.0, 3.0]), None, "two points lie on a line whatever they are");
        assert_eq!((pearson(&[], &[]), spearman(&[], &[]), partial(&[], &[], &[])), (None, None, None));
    }
}
