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

    /// About `wanted` labelled ticks.
    pub fn ticks(&self, wanted: usize) -> Vec<Tick> {
        match self.kind {
            Kind::Linear => {
                let step = nice_step((self.high - self.low) / wanted.max(1) as f64);
                let first = (self.low / step).ceil() as i64;
                let last = (self.high / step + 1e-9).floor() as i64;
                (first..=last).map(|i| tick(i as f64 * step, true)).collect()
            }
            Kind::Log | Kind::LogZero(_) => self.log_ticks(wanted),
        }
    }

    fn log_ticks(&self, wanted: usize) -> Vec<Tick> {
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let decades = (self.high / self.low).log10();
        // Few decades: label 1, 2, 5; many: every n-th decade.
        let labelled: &[i32] = match decades / wanted.max(1) as f64 {
            d if d <= 0.08 => &[1, 2, 3, 4, 5, 6, 7, 8, 9],
            d if d <= 0.16 => &[1, 2, 3, 5, 7],
            d if d <= 0.36 => &[1, 2, 5],
            d if d <= 0.8 => &[1, 3],
            _ => &[1],
        };
        let every = (decades / wanted.max(1) as f64).ceil().max(1.0) as i32;
        let mut ticks = Vec::new();
        for exponent in first..=last {
            for digit in 1..10 {
                let value = f64::from(digit) * 10f64.powi(exponent);
                // 3 * 0.01 is not 0.03: print what the decimal says.
                let value: f64 = format!("{value:.3e}").parse().unwrap_or(value);
                if value >= self.low * 0.999_999 && value <= self.high * 1.000_001 {
                    let label = labelled.contains(&digit) && exponent.rem_euclid(every) == 0;
                    ticks.push(tick(value, label));
                }
            }
        }
        ticks
    }
}

fn tick(at: f64, labelled: bool) -> Tick {
    Tick { at, label: if labelled { format::tick(at) } else { String::new() } }
}

/// 1, 2 or 5 times a power of ten, not below `rough`.
fn nice_step(rough: f64) -> f64 {
    let power = 10f64.powf(rough.log10().floor());
    let unit = rough / power;
    let nice = [1.0, 2.0, 5.0, 10.0].into_iter().find(|n| unit <= n * 1.000_001).unwrap_or(10.0);
    nice * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_lie_inside_and_the_ends_map_to_the_ends() {
        for scale in [Scale::from_zero([3.7]), Scale::log([0.02, 900.0]), Scale::log([4.0, 4.1])] {
            let scale = scale.onto(100.0, 20.0);
            assert_eq!(scale.at(scale.high), 20.0);
            assert_eq!(scale.at(scale.low), 100.0);
            let labels = scale.ticks(4).iter().filter(|t| !t.label.is_empty()).count();
            assert!((1..=9).contains(&labels), "{labels} labels on {scale:?}");
            assert!(scale.ticks(4).iter().all(|t| t.at >= scale.low * 0.999 && t.at <= scale.high * 1.001));
        }
    }

    #[test]
    fn zero_has_its_own_bin_below_every_positive_value() {
        let mut scale = Scale::log([1.0, 100.0]).onto(200.0, 0.0);
        scale.kind = Kind::LogZero(30.0);
        assert_eq!(scale.at(0.0), 189.5);
        assert!(scale.at(scale.low) <= 170.0 + 1e-9);
    }
}
