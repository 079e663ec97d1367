//! An error against a stressor: which runs of a study stand on which line of a
//! [`Sweep`], and how fast each line grows.
//!
//! Runs that differ in nothing but the stressor and the axis of the lines share a
//! panel. Runs that agree even in those (other paths, say, or series) become one
//! point: the median, from the smallest to the largest. What failed or is wrong for
//! its class is no gap: its x is kept.

use super::metrics::{self, Metric};
use crate::claim::axis_value;
use crate::record::{PathSource, SceneSource, cameras};
use crate::registry::{Spec, format_sum, parse_sum};
use crate::results::{RunResult, RunStatus, StudyResults};
use crate::stats;
use crate::sweep::Sweep;

/// A sweep with its runs in place.
pub struct Chart<'a> {
    pub sweep: &'a Sweep,
    pub metric: &'static Metric,
    /// To the right, where x is a knob.
    pub against: Option<&'static Metric>,
    pub panels: Vec<Panel<'a>>,
}

pub struct Panel<'a> {
    /// Empty when there is one alone.
    pub title: String,
    pub lines: Vec<Line<'a>>,
}

pub struct Line<'a> {
    /// Value of the axis [`Sweep::by`].
    pub by: String,
    /// By ascending x.
    pub points: Vec<Point<'a>>,
}

pub struct Point<'a> {
    pub x: f64,
    /// Median over the runs that have one, smallest, largest; of one run its interval.
    pub value: Option<(f64, f64, f64)>,
    pub runs: Vec<&'a RunResult>,
}

impl Point<'_> {
    pub fn with(&self, status: RunStatus) -> usize {
        self.runs.iter().filter(|r| r.status == status).count()
    }
}

/// Growth of a line on logarithmic axes: y ~ x^slope, by least squares over the
/// points where both are above zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    pub slope: f64,
    /// Share of the variance that the straight line explains.
    pub r2: f64,
    pub points: usize,
}

/// Where the runs of a study stand on a chart.
///
/// # Errors
/// In words for the page, when the sweep names what the study does not have.
pub fn chart<'a>(results: &'a StudyResults, sweep: &'a Sweep) -> Result<Chart<'a>, String> {
    let metric = metrics::get(&sweep.y).map_err(|e| e.to_string())?;
    let against = sweep.against.as_ref().map(|name| metrics::get(name).map_err(|e| e.to_string())).transpose()?;
    let mut panels: Vec<(Vec<(String, String)>, Panel)> = Vec::new();
    let follows = camera_follows(results, &sweep.x);
    for run in &results.runs {
        let Some(x) = run.spec.number(&sweep.x) else { continue };
        let family = family(run, sweep, follows);
        let at = panels.iter().position(|(f, _)| *f == family).unwrap_or_else(|| {
            panels.push((family, Panel { title: String::new(), lines: Vec::new() }));
            panels.len() - 1
        });
        let lines = &mut panels[at].1.lines;
        let by = line_of(run, sweep);
        let at = lines.iter().position(|l| l.by == by).unwrap_or_else(|| {
            lines.push(Line { by, points: Vec::new() });
            lines.len() - 1
        });
        let points = &mut lines[at].points;
        match points.iter_mut().find(|p| p.x == x) {
            Some(p) => p.runs.push(run),
            None => points.push(Point { x, value: None, runs: vec![run] }),
        }
    }
    if panels.is_empty() {
        return Err(format!("no run has the number `{}` that the chart `{}` is to be drawn over", sweep.x, sweep.id));
    }
    // What stands at one place alone says nothing of the stressor, beside what moves along it.
    let moves = |l: &Line| l.points.len() > 1;
    if panels.iter().any(|(_, p)| p.lines.iter().any(moves)) {
        panels.iter_mut().for_each(|(_, p)| p.lines.retain(moves));
        panels.retain(|(_, p)| !p.lines.is_empty());
    }
    let titles = titles(&panels.iter().map(|(f, _)| f).collect::<Vec<_>>());
    let mut panels: Vec<Panel> = panels.into_iter().map(|(_, p)| p).collect();
    for (panel, title) in panels.iter_mut().zip(titles) {
        panel.title = title;
        for line in &mut panel.lines {
            line.points.sort_by(|a, b| a.x.total_cmp(&b.x));
            line.points.iter_mut().for_each(|p| p.value = value(metric, &p.runs));
        }
    }
    Ok(Chart { sweep, metric, against, panels })
}

/// The line of a run: its value of the axis [`Sweep::by`], less the stressor if it stands there.
fn line_of(run: &RunResult, sweep: &Sweep) -> String {
    let value = by_value(run, &sweep.by);
    match sweep.x.split_once('.') {
        Some((part, key)) if part == sweep.by && parse_sum(&value).is_ok() => without(&value, key),
        _ => value,
    }
}

/// A sum of parts without the parameter `key`.
fn without(sum: &str, key: &str) -> String {
    let strip = |mut part: Spec| {
        part.params.remove(key);
        part.to_string()
    };
    parse_sum(sum).unwrap_or_default().into_iter().map(strip).collect::<Vec<_>>().join("+")
}

/// The value of the axis whose values are the lines.
fn by_value(run: &RunResult, by: &str) -> String {
    match by {
        "scene" => run.scene().to_string(),
        "path" => run.spec.path.name.clone(),
        "structure" => run.structure.clone(),
        "culling" => run.culling.clone(),
        "walk" => run.walk.clone(),
        crate::math::arithmetic::NAME => super::labels::arithmetic(run),
        cameras::AXIS => axis_value(&run.spec, cameras::AXIS).iter().map(cameras::label).collect(),
        axis => format_sum(&axis_value(&run.spec, axis)),
    }
}

/// All that sets the panel of a run apart, by axis: everything but the stressor and
/// the axis of the lines, and the camera where it `follows` the stressor.
fn family(run: &RunResult, sweep: &Sweep, follows: bool) -> Vec<(String, String)> {
    let (part, key) = sweep.x.split_once('.').unwrap_or((&sweep.x, ""));
    let strip = |s: &Spec| {
        let mut s = s.clone();
        s.params.remove(key);
        s.to_string()
    };
    // Short labels without defaults; parsed again where the stressor must go.
    let label = |name: &str, text: &str| {
        if part != name {
            return text.to_string();
        }
        without(text, key)
    };
    let s = &run.spec;
    // Members of a family are named by the values that set them apart; without such a
    // name, scenes of one generator that differ in the stressor alone are a family too.
    let rest = |name: &str| {
        let value = format!("{key}=");
        let mut parts = name.split('@');
        let first = parts.next().unwrap_or_default().to_string();
        parts.filter(|p| !p.starts_with(&value)).fold(first, |name, p| format!("{name}@{p}"))
    };
    let scene = match &s.scene.source {
        _ if part != "scene" => s.scene.name.clone(),
        SceneSource::Generated(spec) if !s.scene.name.contains('@') => {
            let placed = |own: &str, text: String| if own == key { String::new() } else { text };
            let offset = placed("offset_m", format!("{:?}", s.scene.offset_m));
            format!("{} {} {offset}", strip(spec), placed("scale", s.scene.scale.to_string()))
        }
        _ => rest(&s.scene.name),
    };
    let path = match &s.path.source {
        _ if part != "path" => s.path.name.clone(),
        PathSource::Generated(spec) if !s.path.name.contains('@') => strip(spec),
        _ => rest(&s.path.name),
    };
    let mut camera = cameras::spec_of(&s.camera);
    if part == cameras::AXIS {
        camera.params.remove(key);
    }
    let mut out = vec![
        ("scene".to_string(), scene),
        ("path".into(), path),
        (cameras::AXIS.into(), cameras::label(&camera)),
        ("structure".into(), label("structure", &run.structure)),
        ("culling".into(), label("culling", &run.culling)),
        ("walk".into(), label("walk", &run.walk)),
    ];
    // The camera of a run is resolved: its axis says the same again.
    let axes = s.axes.iter().filter(|(axis, _)| *axis != "camera");
    out.extend(axes.map(|(axis, spec)| {
        (axis.clone(), if axis == part { strip(spec) } else { format_sum(std::slice::from_ref(spec)) })
    }));
    out.retain(|(axis, _)| *axis != sweep.by && !(follows && axis == "camera"));
    out
}

/// Whether the camera is a function of the stressor, as where both advance together.
fn camera_follows(results: &StudyResults, x: &str) -> bool {
    let mut cameras: Vec<(f64, &crate::math::Camera)> = Vec::new();
    for run in &results.runs {
        let Some(x) = run.spec.number(x) else { continue };
        match cameras.iter().find(|(at, _)| *at == x) {
            Some((_, camera)) if **camera != run.spec.camera => return false,
            Some(_) => {}
            None => cameras.push((x, &run.spec.camera)),
        }
    }
    true
}

/// Of each panel what the others do not share.
fn titles(families: &[&Vec<(String, String)>]) -> Vec<String> {
    let varies = |axis: &str, value: &str| {
        families.iter().any(|f| f.iter().find(|(a, _)| a == axis).is_none_or(|(_, v)| v != value))
    };
    let value = |f: &Vec<(String, String)>, axis: &str| f.iter().find(|(a, _)| a == axis).map(|(_, v)| v.clone());
    // The walk that goes with a structure says nothing beside it.
    let own = families.iter().all(|f| {
        families.iter().all(|g| value(f, "structure") != value(g, "structure") || value(f, "walk") == value(g, "walk"))
    });
    let of = |f: &Vec<(String, String)>| {
        let told = |axis: &str, value: &str| varies(axis, value) && !(own && axis == "walk");
        let parts = f.iter().filter(|(axis, value)| told(axis, value)).map(|(_, value)| value.as_str());
        parts.collect::<Vec<_>>().join(" × ")
    };
    families.iter().map(|f| of(f)).collect()
}

/// Median over the runs that are done, smallest and largest; of one run its interval.
pub fn value(metric: &Metric, runs: &[&RunResult]) -> Option<(f64, f64, f64)> {
    // Wrong runs show their errors in tables; on a chart of growth they are marks of their own.
    let done: Vec<&&RunResult> = runs.iter().filter(|r| r.status == RunStatus::Done).collect();
    if let [run] = done[..] {
        return metric.interval(run);
    }
    let values: Vec<f64> = done.iter().filter_map(|r| metric.value(r)).collect();
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    (!values.is_empty()).then(|| (stats::median(&values), low, high))
}

impl Line<'_> {
    /// log10 of the points where both coordinates are above zero.
    fn logs(&self) -> Vec<(f64, f64)> {
        let points = self.points.iter().filter_map(|p| Some((p.x, p.value?.0)));
        points.filter(|(x, y)| *x > 0.0 && *y > 0.0).map(|(x, y)| (x.log10(), y.log10())).collect()
    }

    pub fn slope(&self) -> Option<Slope> {
        fit(&self.logs())
    }

    /// log10 of the factor c of a law y = c x^slope through the middle of the line.
    pub fn anchor(&self, slope: f64) -> Option<f64> {
        let found: Vec<f64> = self.logs().iter().map(|(x, y)| y - slope * x).collect();
        (!found.is_empty()).then(|| stats::median(&found))
    }

    pub fn zeros(&self) -> usize {
        self.points.iter().filter(|p| p.value.is_some_and(|v| v.0 <= 0.0)).count()
    }
}

/// Least squares of y over x; `None` for fewer than two different x.
fn fit(points: &[(f64, f64)]) -> Option<Slope> {
    let (x, y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
    let (mx, my) = (stats::mean(&x), stats::mean(&y));
    let xx: f64 = x.iter().map(|x| (x - mx).powi(2)).sum();
    let xy: f64 = points.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    let yy: f64 = y.iter().map(|y| (y - my).powi(2)).sum();
    if points.len() < 2 || xx <= 0.0 {
        return None;
    }
    // A line without any growth is explained wholly; what rounding leaves of it is not variance.
    let rounding = 1e-24 * y.iter().map(|y| y * y).sum::<f64>();
    let r2 = if yy > rounding { xy * xy / (xx * yy) } else { 1.0 };
    Some(Slope { slope: xy / xx, r2, points: points.len() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_power_law_is_its_exponent() {
        for exponent in [-2.0, 0.0, 0.5, 1.0, 3.0] {
            let points: Vec<(f64, f64)> = (0..9).map(|i| (f64::from(i), 0.7 + exponent * f64::from(i))).collect();
            let found = fit(&points).unwrap();
            assert!((found.slope - exponent).abs() < 1e-12 && (found.r2 - 1.0).abs() < 1e-12, "{found:?}");
        }
        assert_eq!(fit(&[(1.0, 2.0)]), None);
        assert_eq!(fit(&[(1.0, 2.0), (1.0, 3.0)]), None, "one x has no slope");
        assert_eq!(fit(&[]), None);
    }
}
