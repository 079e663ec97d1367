//! Curves over a path: one point every so many frames.

use crate::stats;

/// Middle frame of a group with the mean over the group's frames.
/// The last group may be shorter. `every` of 0 is taken as 1.
pub fn consolidate(values: &[f64], every: u32) -> Vec<(f64, f64)> {
    let every = every.max(1) as usize;
    values
        .chunks(every)
        .enumerate()
        .map(|(i, group)| ((i * every) as f64 + (group.len() as f64 - 1.0) / 2.0, stats::mean(group)))
        .collect()
}

/// One consolidated point over several trials: median, smallest and largest of
/// the trials' means. The line is the median of the same means that the band
/// spans, so it never leaves the band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandPoint {
    pub frame: f64,
    pub middle: f64,
    pub low: f64,
    pub high: f64,
}

pub fn band(trials: &[Vec<f64>], every: u32) -> Vec<BandPoint> {
    let curves: Vec<Vec<(f64, f64)>> = trials.iter().map(|t| consolidate(t, every)).collect();
    let length = curves.iter().map(Vec::len).min().unwrap_or(0);
    (0..length)
        .map(|i| {
            let at: Vec<f64> = curves.iter().map(|c| c[i].1).collect();
            let low = at.iter().copied().fold(f64::INFINITY, f64::min);
            let high = at.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            BandPoint { frame: curves[0][i].0, middle: stats::median(&at), low, high }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_means_and_the_last_may_be_short() {
        assert_eq!(consolidate(&[1.0, 3.0, 5.0, 7.0, 10.0], 2), [(0.5, 2.0), (2.5, 6.0), (4.0, 10.0)]);
        assert_eq!(consolidate(&[4.0, 6.0], 0), [(0.0, 4.0), (1.0, 6.0)]);
        assert!(consolidate(&[], 20).is_empty());
    }

    #[test]
    fn the_band_spans_the_trials_and_holds_the_line() {
        let trials = [vec![1.0, 1.0, 9.0, 9.0], vec![2.0, 2.0, 3.0, 3.0], vec![6.0, 6.0, 3.0, 5.0]];
        let points = band(&trials, 2);
        assert_eq!(points[0], BandPoint { frame: 0.5, middle: 2.0, low: 1.0, high: 6.0 });
        assert_eq!(points[1], BandPoint { frame: 2.5, middle: 4.0, low: 3.0, high: 9.0 });
    }
}
