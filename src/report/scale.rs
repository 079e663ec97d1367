//! Scales: from data to pixels, with ticks.

use super::format;

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    Linear,
    Log,
    /// Logarithmic, with a bin of its own for zero: so many pixels, [`BREAK`] included.
    LogZero(f64),
}

/// Pixels between the bin of zeros and the logarithmic axis: the axis is broken there.
pub const BREAK: f64 = 9.0;

/// An axis with fewer numbers on it cannot be read: two do not tell what lies between them.
pub const FEWEST: usize = 3;

/// Pixels that labels keep clear of each other, and that one may stand out of its panel.
const GAP: f64 = 6.0;
const OVERHANG: f64 = 6.0;

/// Maps `low..high` onto the pixels `from..to` (`from` may be the larger).
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    pub kind: Kind,
    pub low: f64,
    pub high: f64,
    pub from: f64,
    pub to: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    pub at: f64,
    /// Empty for minor ticks.
    pub label: String,
}

/// Beyond this ratio of largest to smallest a logarithmic scale shows more.
const WIDE: f64 = 25.0;

impl Scale {
    /// A linear scale from zero with a little air at the end.
    pub fn from_zero(values: impl IntoIterator<Item = f64>) -> Scale {
        let high = values.into_iter().filter(|v| v.is_finite()).fold(0.0, f64::max);
        let high = if high > 0.0 { high } else { 1.0 };
        Scale { kind: Kind::Linear, low: 0.0, high: high * 1.06, from: 0.0, to: 1.0 }
    }

    /// A logarithmic scale over the positive values, with a little air.
    pub fn log(values: impl IntoIterator<Item = f64>) -> Scale {
        let (mut low, mut high) = (f64::INFINITY, 0.0f64);
        for v in values.into_iter().filter(|v| v.is_finite() && *v > 0.0) {
            low = low.min(v);
            high = high.max(v);
        }
        if high == 0.0 {
            (low, high) = (0.1, 10.0);
        }
        let air = (high / low).powf(0.06).max(1.15);
        let (mut low, mut high) = (low / air, high * air);
        // At least one decade line must be in sight, or the axis has no label.
        if low.log10().ceil() > high.log10().floor() && high / low < 4.0 {
            let middle = (low * high).sqrt();
            (low, high) = (middle / 2.2, middle * 2.2);
        }
        Scale { kind: Kind::Log, low, high, from: 0.0, to: 1.0 }
    }

    /// Logarithmic when all values are positive and range widely, else linear from zero.
    pub fn fitting(values: &[f64]) -> Scale {
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let (low, high) = finite.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        if !finite.is_empty() && low > 0.0 && high / low > WIDE { Scale::log(finite) } else { Scale::from_zero(finite) }
    }

    /// One kind of scale for all panels of a figure, whose shapes could not be compared
    /// otherwise: logarithmic when the values of one range widely and none anywhere is 0.
    pub fn common_log<'a>(panels: impl IntoIterator<Item = &'a Vec<f64>>) -> bool {
        let (mut wide, mut positive) = (false, true);
        for values in panels {
            wide |= Scale::fitting(values).is_log();
            positive &= values.iter().all(|v| *v > 0.0 || !v.is_finite());
        }
        wide && positive
    }

    pub fn of(log: bool, values: impl IntoIterator<Item = f64>) -> Scale {
        if log { Scale::log(values) } else { Scale::from_zero(values) }
    }

    pub fn onto(mut self, from: f64, to: f64) -> Scale {
        (self.from, self.to) = (from, to);
        self
    }

    pub fn is_log(&self) -> bool {
        self.kind != Kind::Linear
    }

    /// Pixel of `value`, kept inside the scale.
    pub fn at(&self, value: f64) -> f64 {
        let forward = (self.to - self.from).signum();
        let (from, share) = match self.kind {
            Kind::Linear => (self.from, (value - self.low) / (self.high - self.low)),
            Kind::LogZero(bin) if value <= 0.0 => return self.from + forward * (bin - BREAK) / 2.0,
            Kind::Log => (self.from, (value / self.low).ln() / (self.high / self.low).ln()),
            Kind::LogZero(bin) => (self.from + forward * bin, (value / self.low).ln() / (self.high / self.low).ln()),
        };
        let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        from + share * (self.to - from)
    }

    /// About `wanted` labelled ticks and never fewer than [`FEWEST`], as long as they have
    /// room: `extent` is what a label takes along the axis, in pixels.
    pub fn ticks(&self, wanted: usize, extent: &dyn Fn(&str) -> f64) -> Vec<Tick> {
        let wanted = wanted.max(FEWEST);
        let tiers = [self.usual(wanted), self.steps(wanted, &[8.0, 6.0, 4.0, 3.0, 2.5, 1.5])];
        // Rounder numbers first: the second tier only speaks where the first has no answer.
        let labelled = tiers.iter().find_map(|tier| {
            let fits = tier.iter().filter(|v| v.len() >= FEWEST && self.have_room(v, extent));
            fits.min_by_key(|v| v.len().abs_diff(wanted)).cloned()
        });
        let labelled =
            labelled.unwrap_or_else(|| self.squeezed(wanted, tiers.into_iter().flatten().flatten().collect(), extent));
        let minor = if self.is_log() { self.digits(&[1, 2, 3, 4, 5, 6, 7, 8, 9]) } else { Vec::new() };
        let of = |x: &f64| !labelled.iter().any(|l| (l - x).abs() <= 1e-9 * x.abs());
        let mut ticks: Vec<Tick> = minor.iter().filter(|x| of(x)).map(|x| tick(*x, false)).collect();
        ticks.extend(labelled.iter().map(|x| tick(*x, true)));
        ticks.sort_by(|a, b| a.at.total_cmp(&b.at));
        ticks
    }

    /// Sets of values to label; of equals the first is taken.
    fn usual(&self, wanted: usize) -> Vec<Vec<f64>> {
        let mut out = Vec::new();
        if self.is_log() {
            let decades = (self.high / self.low).log10();
            let most = (decades / FEWEST as f64).ceil().max(1.0) as i32;
            out.extend((1..=most).rev().map(|every| self.decades(every)));
            out.extend([&[1, 3][..], &[1, 2, 5], &[1, 2, 3, 5, 7]].map(|digits| self.digits(digits)));
            // Over many decades even steps would crowd at the upper end.
            if decades > 1.2 {
                return out;
            }
        }
        out.extend(self.steps(wanted, &[5.0, 2.0, 1.0]));
        out
    }

    /// Even steps of these times a power of ten, the largest first.
    fn steps(&self, wanted: usize, steps: &[f64]) -> Vec<Vec<f64>> {
        let power = 10f64.powf(((self.high - self.low) / wanted as f64).log10().floor());
        let powers = [10.0 * power, power, 0.1 * power];
        let sizes = powers.iter().flat_map(|p| steps.iter().map(move |n| n * p));
        let ends =
            sizes.map(|step| (step, (self.low / step - 1e-9).ceil() as i64, (self.high / step + 1e-9).floor() as i64));
        // As many as 40 no axis has room for.
        let few = ends.filter(|(_, first, last)| last - first < 40);
        few.map(|(step, first, last)| (first..=last).map(|i| decimal(i as f64 * step)).collect()).collect()
    }

    /// Every so many decades.
    fn decades(&self, every: i32) -> Vec<f64> {
        let whole = |x: &f64| (x.log10().round() as i32).rem_euclid(every) == 0;
        self.digits(&[1]).into_iter().filter(whole).collect()
    }

    /// These multiples of every power of ten, as far as they are in sight.
    fn digits(&self, digits: &[i32]) -> Vec<f64> {
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let all =
            (first..=last).flat_map(|e| digits.iter().map(move |digit| decimal(f64::from(*digit) * 10f64.powi(e))));
        all.filter(|x| *x >= self.low * 0.999_999 && *x <= self.high * 1.000_001).collect()
    }

    fn have_room(&self, values: &[f64], extent: &dyn Fn(&str) -> f64) -> bool {
        let spans: Vec<(f64, f64)> = values.iter().map(|x| self.span(*x, extent)).collect();
        spans.iter().enumerate().all(|(i, a)| spans[..i].iter().all(|b| a.0 >= b.1 + GAP || b.0 >= a.1 + GAP))
    }

    /// From where to where the label of a value goes, along the axis.
    fn span(&self, value: f64, extent: &dyn Fn(&str) -> f64) -> (f64, f64) {
        let half = extent(&format::tick(value)) / 2.0;
        let middle = self.kept(self.at(value), half);
        (middle - half, middle + half)
    }

    /// Where the middle of a label goes whose half reaches this far: beyond the right (or
    /// lower) end it may stand out by [`OVERHANG`] alone, since the next panel begins there.
    pub fn kept(&self, middle: f64, half: f64) -> f64 {
        middle.min(self.from.max(self.to) + OVERHANG - half)
    }

    /// The last resort of a short axis with long labels: the roundest values that have room,
    /// or from the low end on all that have.
    fn squeezed(&self, wanted: usize, values: Vec<f64>, extent: &dyn Fn(&str) -> f64) -> Vec<f64> {
        let pick = |values: &[f64], most: usize| {
            let mut kept: Vec<f64> = Vec::new();
            for x in values {
                let with: Vec<f64> = kept.iter().copied().chain([*x]).collect();
                if kept.len() < most && !kept.contains(x) && self.have_room(&with, extent) {
                    kept = with;
                }
            }
            kept
        };
        let round = pick(&values, wanted + 1);
        if round.len() >= FEWEST {
            return round;
        }
        let mut packed = values;
        packed.sort_by(f64::total_cmp);
        pick(&packed, FEWEST)
    }
}

/// 3 * 0.01 is not 0.03: what the decimal says.
fn decimal(x: f64) -> f64 {
    format!("{x:.9e}").parse().unwrap_or(x)
}

fn tick(at: f64, labelled: bool) -> Tick {
    Tick { at, label: if labelled { format::tick(at) } else { String::new() } }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: &Scale, wanted: usize, extent: &dyn Fn(&str) -> f64) -> Vec<(f64, String)> {
        let ticks = scale.ticks(wanted, extent);
        assert!(ticks.iter().all(|t| t.at >= scale.low * 0.999 && t.at <= scale.high * 1.001), "{scale:?} {ticks:?}");
        assert!(ticks.windows(2).all(|t| t[0].at < t[1].at), "{scale:?} {ticks:?}");
        ticks.into_iter().filter(|t| !t.label.is_empty()).map(|t| (t.at, t.label)).collect()
    }

    #[test]
    fn ticks_lie_inside_and_the_ends_map_to_the_ends() {
        for scale in [Scale::from_zero([3.7]), Scale::log([0.02, 900.0]), Scale::log([4.0, 4.1])] {
            let scale = scale.onto(100.0, 20.0);
            assert_eq!(scale.at(scale.high), 20.0);
            assert_eq!(scale.at(scale.low), 100.0);
            let n = labels(&scale, 4, &|_| 10.0).len();
            assert!((3..=6).contains(&n), "{n} labels on {scale:?}");
        }
    }

    #[test]
    fn every_axis_has_three_numbers_that_do_not_touch() {
        let width = |text: &str| 5.8 * text.chars().count() as f64;
        let height = |_: &str| 9.6;
        let mut seed = 7u32;
        let mut draw = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1 << 24)
        };
        for _ in 0..4000 {
            // Nine orders of magnitude, over a range of almost nothing up to six orders.
            let low = 10f64.powf(9.0 * draw() - 4.0);
            let high = low * 10f64.powf(6.0 * draw() * draw());
            for scale in [Scale::from_zero([high]), Scale::log([low, high])] {
                for wanted in [1, 2, 3, 5, 8] {
                    let (x, y) = (scale.onto(30.0, 150.0 + 300.0 * draw()), scale.onto(300.0, 200.0 - 150.0 * draw()));
                    for (scale, extent) in [(x, &width as &dyn Fn(&str) -> f64), (y, &height)] {
                        let found = labels(&scale, wanted, extent);
                        assert!(found.len() >= FEWEST, "{found:?} on {scale:?}");
                        let spans: Vec<_> = found.iter().map(|(at, _)| scale.span(*at, extent)).collect();
                        let apart = |a: &(f64, f64), b: &(f64, f64)| a.1 + GAP <= b.0 || b.1 + GAP <= a.0;
                        assert!(spans.windows(2).all(|s| apart(&s[0], &s[1])), "{found:?} on {scale:?}");
                        assert!(found.iter().all(|(_, text)| text.chars().count() <= 7), "{found:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn numbers_are_round() {
        let of = |scale: Scale, wanted: usize| {
            let scale = scale.onto(0.0, 172.0);
            labels(&scale, wanted, &|t| 5.8 * t.len() as f64).into_iter().map(|l| l.1).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(of(Scale::from_zero([19.0]), 3), "0 10 20");
        assert_eq!(of(Scale::from_zero([4400.0]), 2), "0 2000 4000");
        assert_eq!(of(Scale::from_zero([0.9]), 3), "0 0.2 0.4 0.6 0.8");
        assert_eq!(of(Scale::log([30.0, 600.0]), 3), "30 100 300");
        assert_eq!(of(Scale::log([60.0, 210.0]), 3), "70 100 200");
        assert_eq!(of(Scale::log([1.0, 1e6]), 3), "1 1000 1M");
    }

    #[test]
    fn zero_has_its_own_bin_below_every_positive_value() {
        let mut scale = Scale::log([1.0, 100.0]).onto(200.0, 0.0);
        scale.kind = Kind::LogZero(30.0);
        assert_eq!(scale.at(0.0), 189.5);
        assert!(scale.at(scale.low) <= 170.0 + 1e-9);
    }
}
