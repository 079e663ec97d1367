//! Draws a sweep whose x is a knob: a metric against another one, the runs of a line
//! joined in the order of the knob, whose value stands at every point. What failed or is
//! wrong has no point; the table has its reason.

use super::facets::{self, BODY, SMALL, Sample};
use super::figure::{Figure, Part, Rect, plain, text_box};
use super::format;
use super::metrics::Metric;
use super::scale::{BREAK, Kind, Scale};
use super::style::{FRAME, INK, MUTED, PAPER, SHADE};
use super::sweep_chart::{axis_words, head, legend};
use super::sweeps::{Chart, Line, Panel, Point, value};

/// Of the bin of zeros at the left, its break included.
const BIN: f64 = 44.0;

/// Median and interval of both metrics.
type Place = [(f64, f64, f64); 2];

pub fn draw(chart: &Chart, against: &Metric) -> Figure {
    let n = chart.panels.len().max(1);
    let columns = n.min(2);
    let (w, h) = if columns == 1 { (860.0, 340.0) } else { (412.0, 270.0) };
    let (left, gap) = (74.0, (64.0, 78.0));
    let width = left + columns as f64 * w + (columns as f64 - 1.0) * gap.0 + 28.0;
    let legend = legend(chart);
    let inner = width - 32.0;
    let top = 58.0 + facets::legend_height(&legend, inner, Sample::Marker) + 26.0;
    let rows = n.div_ceil(columns);
    let height = top + rows as f64 * h + (rows as f64 - 1.0) * gap.1 + 46.0;
    let mut figure = Figure::new(&format!("sweep-{}", chart.sweep.id), &chart.sweep.title, width, height);
    let knob = axis_words(&chart.sweep.x, &chart.sweep.x_unit);
    let sub = format!("One line a value of {}; numbers at the points: {knob}. Lower left is better.", chart.sweep.by);
    facets::title(&mut figure, &chart.sweep.title, &sub);
    facets::legend(&mut figure, &legend, 16.0, 58.0, inner, Sample::Marker);
    for (panel, plot) in chart.panels.iter().zip(facets::panels(n, columns, left, top, (w, h), gap)) {
        figure.part(Part::Plot, plot);
        let (x, y) = scales(chart, against, panel, plot);
        axes(&mut figure, chart, against, plot, (&x, &y));
        head(&mut figure, plot, &panel.title);
        let mut taken = Vec::new();
        for line in &panel.lines {
            let look = legend.look(&line.by);
            let at = |p: &Place| (x.at(p[0].0), y.at(p[1].0));
            let placed: Vec<(&Point, Place)> =
                line.points.iter().filter_map(|p| Some((p, place(against, p)?))).collect();
            let way: Vec<(f64, f64)> = placed.iter().map(|(_, p)| at(p)).collect();
            figure.dashed(&way, look.colour, 1.6, 0.9, look.dash);
            for (point, p) in &placed {
                let ids: Vec<&str> = point.runs.iter().map(|r| r.measurement_id.as_str()).collect();
                let data = vec![("measurement-id", ids.join(" ")), ("label", line.by.clone())];
                figure.tagged(words(chart, against, line, point, p), data, |figure| {
                    let (px, py) = at(p);
                    if (y.at(p[1].1) - y.at(p[1].2)).abs() > 1.0 {
                        figure.segment((px, y.at(p[1].1)), (px, y.at(p[1].2)), look.colour, 1.4);
                    }
                    figure.marker(px, py, 4.0, look.shape, look.colour, 1.0);
                });
            }
            for ((point, _), (px, py)) in placed.iter().zip(&way) {
                name(&mut figure, &mut taken, plot, (*px, *py), &format::number(point.x, 3), look.colour);
            }
        }
    }
    figure.description = describe(chart, against);
    figure.caption = caption(chart, against, &knob);
    figure
}

/// Where a point stands; nothing without both metrics.
fn place(against: &Metric, p: &Point) -> Option<Place> {
    Some([value(against, &p.runs)?, p.value?])
}

/// Panels differ in scene: each has scales of its own.
fn scales(chart: &Chart, against: &Metric, panel: &Panel, plot: Rect) -> (Scale, Scale) {
    let points = panel.lines.iter().flat_map(|l| &l.points).filter_map(|p| place(against, p));
    let (xs, ys): (Vec<f64>, Vec<[f64; 3]>) = points.map(|[x, y]| (x.0, [y.0, y.1, y.2])).unzip();
    let ys: Vec<f64> = ys.into_iter().flatten().collect();
    let mut x = if chart.sweep.x_log { Scale::log(xs.iter().copied()) } else { Scale::from_zero(xs.iter().copied()) };
    if chart.sweep.x_log {
        x.kind = if xs.iter().all(|x| *x <= 0.0) { Kind::LogZero(plot.w + BREAK) } else { Kind::LogZero(BIN) };
    }
    let y = if chart.sweep.y_log && ys.iter().all(|y| *y > 0.0) { Scale::log(ys) } else { Scale::from_zero(ys) };
    // Air for the labels.
    (x.onto(plot.x, plot.right() - 22.0), y.onto(plot.bottom(), plot.y + 14.0))
}

fn axes(figure: &mut Figure, chart: &Chart, against: &Metric, plot: Rect, (x, y): (&Scale, &Scale)) {
    facets::y_axis(figure, plot, y, (plot.h / 60.0) as usize);
    match x.kind {
        Kind::LogZero(bin) if bin > plot.w => {
            let words = "all of them 0";
            figure.label(plot.x + plot.w / 2.0, plot.bottom() + 15.0, words, plain(SMALL, MUTED).middle());
        }
        Kind::LogZero(bin) => {
            figure.rect(Rect::new(plot.x, plot.y, bin - BREAK, plot.h), SHADE, 0.8);
            facets::x_axis(figure, plot, x, (plot.w / 62.0) as usize);
            let at = plot.x + bin - BREAK / 2.0;
            figure.dashed(&[(at, plot.y), (at, plot.bottom())], FRAME, 0.8, 0.8, &[2.0, 3.0]);
            figure.label(x.at(0.0), plot.bottom() + 15.0, "0", plain(SMALL, MUTED).middle());
        }
        _ => facets::x_axis(figure, plot, x, (plot.w / 62.0) as usize),
    }
    facets::x_title(figure, plot, &axis_words(against.name, against.unit));
    figure.upright(
        plot.x - 50.0,
        plot.y + plot.h / 2.0,
        &axis_words(chart.metric.name, chart.metric.unit),
        plain(BODY, INK).middle(),
    );
}

/// Writes the knob's value beside its point where nothing is written yet.
fn name(figure: &mut Figure, taken: &mut Vec<Rect>, plot: Rect, (x, y): (f64, f64), text: &str, colour: u32) {
    let style = plain(SMALL, colour);
    for (dx, dy) in [(6.0, -5.0), (6.0, 12.0), (-6.0, -5.0), (-6.0, 12.0)] {
        let style = if dx < 0.0 { style.end() } else { style };
        let room = text_box(x + dx, y + dy, text, style);
        if plot.contains(&room) && !taken.iter().any(|t| t.overlaps(&room)) {
            figure.rect(room, PAPER, 0.6);
            figure.label(x + dx, y + dy, text, style);
            taken.push(room);
            return;
        }
    }
}

/// "chc at 16 px: 12.5 px/M, 1.2 ms".
fn words(chart: &Chart, against: &Metric, line: &Line, point: &Point, p: &Place) -> String {
    let unit = |u: &str| if u.is_empty() { String::new() } else { format!(" {u}") };
    let told = |(v, low, high): (f64, f64, f64), m: &Metric| {
        format!("{}{} {}", format::interval(v, low, high), unit(m.unit), m.name)
    };
    let knob = format!("{}{}", format::number(point.x, 3), unit(&chart.sweep.x_unit));
    format!("{} at {knob}: {}, {}", line.by, told(p[0], against), told(p[1], chart.metric))
}

fn describe(chart: &Chart, against: &Metric) -> String {
    let mut out = format!("{}. {} against {}. ", chart.sweep.title, chart.metric.name, against.name);
    for panel in &chart.panels {
        for line in &panel.lines {
            let placed = line.points.iter().filter_map(|p| Some((p, place(against, p)?)));
            let points: Vec<String> = placed.map(|(p, at)| words(chart, against, line, p, &at)).collect();
            out += &format!("{} {}. ", panel.title, points.join("; "));
        }
    }
    out.trim_end().to_string()
}

fn caption(chart: &Chart, against: &Metric, knob: &str) -> String {
    format!(
        "{} against {}, one line a value of {}, in the order of the knob: {knob}, whose value stands at the points. Runs \
         that failed, are wrong for their class or pending have no point; the table names them.",
        format::capital(chart.metric.about),
        against.about,
        chart.sweep.by
    )
}
