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

/// Pearson correlation; NaN when either side does not vary.
pub fn pearson(x: &[f64], y: &[f64]) -> f64 {
    let (mx, my) = (mean(x), mean(y));
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (a, b) in x.iter().zip(y) {
        xy += (a - mx) * (b - my);
        xx += (a - mx).powi(2);
        yy += (b - my).powi(2);
    }
    xy / (xx * yy).sqrt()
}

/// Spearman rank correlation, ties given their mean rank.
pub fn spearman(x: &[f64], y: &[f64]) -> f64 {
    pearson(&ranks(x), &ranks(y))
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
    fn a_ratio_of_equal_samples_straddles_one() {
        let a = [1.0, 1.1, 0.9, 1.05, 0.95];
        let (r, lo, hi) = ratio_ci(&a, &a, 2000, 7);
        assert!(r == 1.0 && lo < 1.0 && hi > 1.0);
        let twice = a.map(|x| 2.0 * x);
        let (r, lo, _) = ratio_ci(&twice, &a, 2000, 7);
        assert!(r == 2.0 && lo > 1.5);
    }

    #[test]
    fn correlations_of_a_monotone_curve() {
        let x: Vec<f64> = (0..50).map(f64::from).collect();
        let y: Vec<f64> = x.iter().map(|v| v * v * v).collect();
        assert!((spearman(&x, &y) - 1.0).abs() < 1e-12);
        assert!(pearson(&x, &y) < 0.95);
        assert_eq!(ranks(&[5.0, 5.0, 1.0]), [1.5, 1.5, 0.0]);
    }
}
