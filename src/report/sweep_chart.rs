//! Draws a sweep: log-log with a bin of zeros, one line a value of an axis, one panel
//! a combination of the others, the law that is expected dashed beside it. What
//! failed or is wrong stands at the upper edge over its x.

use super::facets::{self, BODY, SMALL, Sample};
use super::figure::{Figure, Part, Rect, plain};
use super::font;
use super::format;
use super::knobs;
use super::scale::{BREAK, Kind, Scale};
use super::style::{ALARM, FRAME, INK, Legend, Look, MUTED, SHADE, Shape};
use super::sweeps::{Chart, Line, Panel, Point};
use crate::results::RunStatus;

/// Height of the strip in which marks of failed and wrong runs stand.
const STRIP: f64 = 20.0;
/// Of the bin of zeros, its break included.
const BIN: f64 = 58.0;

pub fn draw(chart: &Chart) -> Figure {
    if let Some(against) = chart.against {
        return knobs::draw(chart, against);
    }
    let n = chart.panels.len().max(1);
    let columns = match n {
        1 => 1,
        2 | 4 => 2,
        _ => 3,
    };
    let (w, h) = [(860.0, 340.0), (412.0, 270.0), (290.0, 240.0)][columns - 1];
    let (left, gap) = (74.0, (40.0, 78.0));
    let width = left + columns as f64 * w + (columns as f64 - 1.0) * gap.0 + 28.0;
    let legend = legend(chart);
    let inner = width - 32.0;
    let top = 58.0 + facets::legend_height(&legend, inner, Sample::Line) + 18.0 + 26.0;
    let rows = n.div_ceil(columns);
    let height = top + rows as f64 * h + (rows as f64 - 1.0) * gap.1 + 46.0;
    let id = format!("sweep-{}", chart.sweep.id);
    let mut figure = Figure::new(&id, &chart.sweep.title, width, height);
    let sub = format!("One line a value of {}; {}.", chart.sweep.by, chart.metric.about);
    facets::title(&mut figure, &chart.sweep.title, &sub);
    facets::legend(&mut figure, &legend, 16.0, 58.0, inner, Sample::Line);
    signs(&mut figure, chart, top - 34.0);

    let (x, y) = scales(chart);
    for (i, (panel, plot)) in chart.panels.iter().zip(facets::panels(n, columns, left, top, (w, h), gap)).enumerate() {
        figure.part(Part::Plot, plot);
        let x = x.onto(plot.x, plot.right());
        let mut y = y.onto(plot.bottom(), plot.y + STRIP);
        let all_zero = chart.panels.iter().flat_map(values).all(|v| v <= 0.0);
        if let (Kind::LogZero(_), true) = (y.kind, all_zero) {
            y.kind = Kind::LogZero(plot.h - STRIP + BREAK);
        }
        axes(&mut figure, chart, plot, (&x, &y), (i % columns == 0, all_zero));
        head(&mut figure, plot, &panel.title);
        facets::x_title(&mut figure, plot, &axis_words(&chart.sweep.x, &chart.sweep.x_unit));
        lines(&mut figure, chart, panel, &legend, plot, (&x, &y));
    }
    figure.description = describe(chart);
    figure.caption = caption(chart);
    figure
}

pub(super) fn legend(chart: &Chart) -> Legend {
    let mut legend = Legend::default();
    for line in chart.panels.iter().flat_map(|p| &p.lines) {
        legend.add(&line.by);
    }
    legend
}

fn values<'a>(panel: &'a Panel<'a>) -> impl Iterator<Item = f64> + 'a {
    panel.lines.iter().flat_map(|l| &l.points).filter_map(|p| p.value).flat_map(|(v, low, high)| [v, low, high])
}

/// The scales that all panels share, so that they can be compared.
fn scales(chart: &Chart) -> (Scale, Scale) {
    let xs: Vec<f64> = chart.panels.iter().flat_map(|p| &p.lines).flat_map(|l| &l.points).map(|p| p.x).collect();
    let ys: Vec<f64> = chart.panels.iter().flat_map(values).collect();
    let mut x = if chart.sweep.x_log { Scale::log(xs.iter().copied()) } else { Scale::from_zero(xs.iter().copied()) };
    if chart.sweep.x_log && xs.iter().any(|x| *x <= 0.0) {
        x.kind = Kind::LogZero(44.0);
    }
    let mut y = if chart.sweep.y_log { Scale::log(ys.iter().copied()) } else { Scale::from_zero(ys.iter().copied()) };
    if chart.sweep.y_log {
        y.kind = Kind::LogZero(BIN);
    }
    (x, y)
}

pub(super) fn axis_words(name: &str, unit: &str) -> String {
    // A unit that ends the name is said once.
    let name = name.strip_suffix(unit).and_then(|n| n.strip_suffix('_')).unwrap_or(name).replace(['.', '_'], " ");
    if unit.is_empty() { name } else { format!("{name} ({unit})") }
}

fn axes(figure: &mut Figure, chart: &Chart, plot: Rect, (x, y): (&Scale, &Scale), (first, all_zero): (bool, bool)) {
    figure.rect(Rect::new(plot.x, plot.y, plot.w, STRIP), SHADE, 0.55);
    let ticks = (plot.h / 60.0) as usize;
    if !all_zero {
        if first { facets::y_axis(figure, plot, y, ticks) } else { facets::y_grid(figure, plot, y, ticks) }
    }
    if let Kind::LogZero(bin) = y.kind {
        let height = bin - BREAK;
        figure.rect(Rect::new(plot.x, plot.bottom() - height, plot.w, height), SHADE, 0.8);
        if first {
            figure.label(plot.x - 7.0, plot.bottom() - height / 2.0 + 3.6, "0", plain(SMALL, MUTED).end());
        }
        if !all_zero {
            facets::axis_break(figure, plot, plot.bottom() - height - BREAK / 2.0);
        }
    }
    facets::x_axis(figure, plot, x, (plot.w / 62.0) as usize);
    if let Kind::LogZero(bin) = x.kind {
        let at = plot.x + bin - BREAK / 2.0;
        figure.dashed(&[(at, plot.y), (at, plot.bottom())], FRAME, 0.8, 0.8, &[2.0, 3.0]);
        figure.segment((x.at(0.0), plot.bottom()), (x.at(0.0), plot.bottom() + 4.0), FRAME, 1.0);
        figure.label(x.at(0.0), plot.bottom() + 15.0, "0", plain(SMALL, MUTED).middle());
    }
    if first {
        facets::y_title(figure, plot, &axis_words(chart.metric.name, chart.metric.unit), 50.0);
    }
}

/// The title of a panel, cut where it would leave it: the table has all of it.
pub(super) fn head(figure: &mut Figure, plot: Rect, title: &str) {
    let fits = |text: &str| font::width(text, facets::HEAD, true) <= plot.w;
    let mut text = title.to_string();
    if !fits(&text) {
        while !fits(&format!("{text}…")) && text.pop().is_some() {}
        text.push('…');
    }
    if !text.is_empty() {
        facets::panel_head(figure, plot, &text, "");
    }
}

/// What the dashed line and the crosses mean, where there are any.
fn signs(figure: &mut Figure, chart: &Chart, y: f64) {
    let mut x = 16.0;
    if let Some(slope) = chart.sweep.expected_slope {
        figure.dashed(&[(x, y - 4.0), (x + 26.0, y - 4.0)], INK, 1.4, 0.8, EXPECTED);
        let of = chart.sweep.expected_for.as_ref().map_or_else(String::new, |f| format!(" of {f}"));
        let r = figure.label(x + 34.0, y, &format!("growth expected{of}: {}", law(slope)), plain(BODY, INK));
        x = r.right() + 22.0;
    }
    for (status, words, colour) in [
        (RunStatus::Wrong, "wrong for its class", ALARM),
        (RunStatus::Failed, "failed", ALARM),
        (RunStatus::Pending, "pending", MUTED),
    ] {
        if chart.panels.iter().flat_map(|p| &p.lines).flat_map(|l| &l.points).any(|p| p.with(status) > 0) {
            sign(figure, (x + 6.0, y - 4.0), status, colour);
            x = figure.label(x + 16.0, y, words, plain(BODY, INK)).right() + 20.0;
        }
    }
}

fn law(slope: f64) -> String {
    if slope == 0.0 { "flat".into() } else { format!("∝ x^{}", format::number(slope, 3)) }
}

const EXPECTED: &[f64] = &[6.0, 4.0];

/// A slanted cross for wrong, one in a ring for failed, a dot for pending.
fn sign(figure: &mut Figure, (x, y): (f64, f64), status: RunStatus, colour: u32) {
    match status {
        RunStatus::Wrong => figure.marker(x, y, 4.2, Shape::Times, colour, 1.0),
        RunStatus::Failed => {
            figure.hollow(x, y, 5.4, Shape::Circle, colour);
            figure.marker(x, y, 3.2, Shape::Times, colour, 1.0);
        }
        _ => figure.marker(x, y, 2.4, Shape::Circle, colour, 1.0),
    }
}

fn lines(figure: &mut Figure, chart: &Chart, panel: &Panel, legend: &Legend, plot: Rect, (x, y): (&Scale, &Scale)) {
    if let Some(points) = expected(chart, panel, (x, y)) {
        figure.dashed(&points, INK, 1.4, 0.8, EXPECTED);
    }
    let n = panel.lines.len().max(1) as f64;
    let room = match y.kind {
        Kind::LogZero(bin) => ((bin - BREAK - 12.0) / n).min(12.0),
        _ => 0.0,
    };
    for (i, line) in panel.lines.iter().enumerate() {
        let look = legend.look(&line.by);
        // Lines at zero would hide each other: in the bin height says nothing.
        let lane = (i as f64 - (n - 1.0) / 2.0) * room;
        let at = |p: &Point| p.value.map(|(v, ..)| (x.at(p.x), y.at(v) + if v <= 0.0 { lane } else { 0.0 }));
        for pair in line.points.windows(2) {
            let (Some(a), Some(b)) = (at(&pair[0]), at(&pair[1])) else { continue };
            let zeros = [&pair[0], &pair[1]].iter().filter(|p| p.value.is_some_and(|v| v.0 <= 0.0)).count();
            let crosses = zeros == 1 && chart.sweep.y_log;
            let (dash, alpha): (&[f64], f64) = if crosses { (&[1.5, 3.0], 0.7) } else { (&[], 1.0) };
            figure.dashed(&[a, b], look.colour, 1.8, alpha, dash);
        }
        for p in &line.points {
            let ids: Vec<&str> = p.runs.iter().map(|r| r.measurement_id.as_str()).collect();
            let data = vec![("measurement-id", ids.join(" ")), ("label", line.by.clone())];
            figure.tagged(words(chart, line, p), data, |figure| {
                if let (Some(at), Some((_, low, high))) = (at(p), p.value) {
                    point(figure, at, (y.at(low), y.at(high)), look);
                }
                let edge = (x.at(p.x) + (i as f64 - (n - 1.0) / 2.0) * 3.0, plot.y + STRIP / 2.0);
                for (status, colour) in
                    [(RunStatus::Pending, MUTED), (RunStatus::Failed, look.colour), (RunStatus::Wrong, look.colour)]
                {
                    if p.with(status) > 0 {
                        sign(figure, edge, status, colour);
                    }
                }
                if p.value.is_none() && p.with(RunStatus::Done) > 0 {
                    sign(figure, edge, RunStatus::Pending, MUTED);
                }
            });
        }
    }
}

fn point(figure: &mut Figure, (x, y): (f64, f64), (low, high): (f64, f64), look: Look) {
    if (low - high).abs() > 1.0 {
        figure.segment((x, low), (x, high), look.colour, 1.4);
    }
    figure.marker(x, y, 4.0, look.shape, look.colour, 1.0);
}

/// The line that growth by the expected law would follow, cut to the panel.
fn expected(chart: &Chart, panel: &Panel, (x, y): (&Scale, &Scale)) -> Option<Vec<(f64, f64)>> {
    let slope = chart.sweep.expected_slope?;
    let line = panel.lines.iter().find(|l| chart.sweep.expected_for.as_ref().is_none_or(|f| *f == l.by))?;
    let c = line.anchor(slope)?;
    let steps = 64;
    let (from, to) = if x.is_log() { (x.low.log10(), x.high.log10()) } else { (x.low, x.high) };
    let points = (0..=steps).filter_map(|i| {
        let t = from + (to - from) * f64::from(i) / f64::from(steps);
        let at = if x.is_log() { 10f64.powf(t) } else { t };
        let v = 10f64.powf(c + slope * at.log10());
        (v >= y.low && v <= y.high).then(|| (x.at(at), y.at(v)))
    });
    Some(points.collect::<Vec<_>>()).filter(|p| p.len() > 1)
}

/// "f32_world at 1000 m: 12.5 px/M".
fn words(chart: &Chart, line: &Line, p: &Point) -> String {
    let unit = |u: &str| if u.is_empty() { String::new() } else { format!(" {u}") };
    let mut out = format!("{} at {}{}: ", line.by, format::number(p.x, 3), unit(&chart.sweep.x_unit));
    out += &p.value.map_or_else(
        || "no value".into(),
        |(v, low, high)| format!("{}{}", format::interval(v, low, high), unit(chart.metric.unit)),
    );
    for run in p.runs.iter().filter(|r| r.status != RunStatus::Done) {
        out += &format!("; {}", run.status.word());
        out += &run.reason.as_ref().map_or_else(String::new, |why| format!(" ({why})"));
    }
    out
}

fn describe(chart: &Chart) -> String {
    let mut out = format!("{}. {} against {}. ", chart.sweep.title, chart.metric.name, chart.sweep.x);
    for panel in &chart.panels {
        for line in &panel.lines {
            let points: Vec<String> = line
                .points
                .iter()
                .map(|p| {
                    let value = p.value.map_or_else(|| "no value".into(), |v| format::number(v.0, 3));
                    format!("{} at {}", value, format::number(p.x, 3))
                })
                .collect();
            out += &format!("{} {}: {}. ", panel.title, line.by, points.join(", "));
        }
    }
    out.trim_end().to_string()
}

fn caption(chart: &Chart) -> String {
    let s = chart.sweep;
    let several = chart.panels.iter().flat_map(|p| &p.lines).flat_map(|l| &l.points).any(|p| p.runs.len() > 1);
    let mut out = format!(
        "{} against {}, one line a value of {}.",
        format::capital(chart.metric.about),
        axis_words(&s.x, &s.x_unit),
        s.by
    );
    if several {
        out += " Where several runs share a place the median is drawn, with a bar from the smallest to the largest.";
    }
    if s.y_log {
        out += " The bin below the break holds exact zeros; height says nothing in it.";
    }
    out += " Marks in the strip above stand for runs without a usable value: failed, wrong for the declared class, or pending.";
    if let Some(slope) = s.expected_slope {
        out += &format!(" Dashed: {}.", law(slope));
        if !s.expected_why.is_empty() {
            out += &format!(" {}", s.expected_why.trim());
            if !out.ends_with('.') {
                out.push('.');
            }
        }
        let lines = chart.panels.iter().flat_map(|p| &p.lines).filter(|l| s.expected_for.as_ref() == Some(&l.by));
        let slopes: Vec<String> = lines.filter_map(Line::slope).map(|s| format::number(s.slope, 3)).collect();
        let of = s.expected_for.as_deref().unwrap_or("the lines");
        out += &match slopes.len() {
            0 => format!(" No growth of {of} can be measured: it has fewer than two points above zero."),
            _ => format!(" Measured growth of {of}: x^{}.", slopes.join(", x^")),
        };
    }
    out
}
