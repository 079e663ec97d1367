//! The numbers of a run by name: `scene.offset_m`, `camera.fov_y_deg`,
//! `structure.depth`. Charts draw them along x, filters and sorts compare them.

use super::{PathSource, RunSpec, SceneSource, cameras};
use crate::registry::{Params, Spec, Value};
use std::collections::BTreeMap;

impl RunSpec {
    /// The number that `name` (axis, dot, parameter) has in this run.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.numbers().get(name).copied()
    }

    /// All of them. Of several parts of a sum with one parameter the first counts.
    pub fn numbers(&self) -> BTreeMap<String, f64> {
        let mut out = BTreeMap::new();
        // Parameters of a generator come first: they are what a sweep varies.
        if let SceneSource::Generated(spec) = &self.scene.source {
            add(&mut out, "scene", &spec.params);
        }
        if let PathSource::Generated(spec) = &self.path.source {
            add(&mut out, "path", &spec.params);
        }
        let own = [
            ("scene.offset_m", self.scene.distance_m()),
            ("scene.scale", self.scene.scale),
            ("path.stride", f64::from(self.path.stride)),
        ];
        for (name, x) in own {
            out.entry(name.to_string()).or_insert(x);
        }
        let mut camera = cameras::spec_of(&self.camera).params;
        // An infinite far plane is nowhere.
        camera.retain(|name, value| name != "far_m" || *value != Value::Float(0.0));
        add(&mut out, cameras::AXIS, &camera);
        add(&mut out, "structure", &self.structure.params);
        self.culling.iter().for_each(|part| add(&mut out, "culling", &part.params));
        add(&mut out, "walk", &self.walk.params);
        for (axis, spec) in self.axes.iter().filter(|(axis, _)| *axis != cameras::AXIS) {
            add(&mut out, axis, &spec.params);
        }
        out
    }

    /// Labels of the values that are not an axis' usual one: `f64`, `perspective:fov_y_deg=1`.
    pub fn further(&self) -> Vec<String> {
        let label = |(axis, spec): (&String, &Spec)| {
            if axis == cameras::AXIS { cameras::label(spec) } else { spec.to_string() }
        };
        self.axes.iter().map(label).collect()
    }
}

fn add(out: &mut BTreeMap<String, f64>, axis: &str, params: &Params) {
    for (name, value) in params {
        let number = match value {
            Value::Int(i) => Some(*i as f64),
            Value::Float(x) => Some(*x),
            // A choice may be a number: `sectors=8`.
            Value::Text(text) => text.parse().ok().filter(|x: &f64| x.is_finite()),
            Value::Bool(_) => None,
        };
        if let Some(x) = number {
            out.entry(format!("{axis}.{name}")).or_insert(x);
        }
    }
}

/// The number of at most twelve digits that is some roundings from `x`, else `x`:
/// what computing added goes (`9999.999999999998`), what somebody wrote stays.
pub fn tidy(x: f64) -> f64 {
    let short: f64 = format!("{x:.11e}").parse().unwrap_or(x);
    if (short - x).abs() <= 32.0 * f64::EPSILON * x.abs() { short } else { x }
}

/// `x` to so many digits in as few characters as can be: `0.01`, `1e4`, `2.5e-7`.
pub fn short(x: f64, digits: usize) -> String {
    let rounded: f64 = format!("{x:.*e}", digits.max(1) - 1).parse().unwrap_or(x);
    let (plain, scientific) = (format!("{rounded}"), format!("{rounded:e}"));
    if scientific.len() < plain.len() { scientific } else { plain }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_as_short_as_they_can_be() {
        let cases = [
            (1e4, "1e4"),
            (100.0, "100"),
            (0.0, "0"),
            (0.01, "0.01"),
            (2.5e-7, "2.5e-7"),
            (31.622_776_601_683_79, "31.6228"),
            (-1e15, "-1e15"),
            (16.0 / 9.0, "1.77778"),
        ];
        for (x, expected) in cases {
            assert_eq!(short(x, 6), expected);
        }
        assert_eq!(tidy(9_999.999_999_999_998), 1e4);
        assert_eq!(tidy(700_000.000_000_001_5), 7e5, "an end of a logarithmic range");
        assert_eq!(
            [0.1, 31.622_776_601_683_79, 0.123_456_789_012_345_6].map(tidy),
            [0.1, 31.622_776_601_683_79, 0.123_456_789_012_345_6]
        );
    }
}
