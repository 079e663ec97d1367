//! Run time against error, one panel a scene, with the Pareto front: what is
//! dominated fades, what the trials cannot tell from the front is hollow, what is
//! on the front is full, joined and named. Every point carries its run.

use super::facets::{self, SMALL, Sample};
use super::figure::{Anchor, Figure, Part, Rect, TextStyle, plain, text_box};
use super::format;
use super::frontier::{Front, Point, Standing, fronts, over_submission};
use super::frontier_table::tagged;
use super::labels::Grid;
use super::metrics::Metric;
use super::rows;
use super::scale::{BREAK, Kind, Scale};
use super::style::{ALARM, INK, Legend, Look, MUTED, SHADE, Shape};
use std::collections::BTreeSet;

pub struct Scatter<'a> {
    pub id: &'a str,
    pub title: &'a str,
    pub sub: &'a str,
    pub x_axis: &'a str,
    pub y_axis: &'a str,
    /// Give zero a bin of its own below the logarithmic axis.
    pub zero_bin: bool,
    pub x: &'a Metric,
    pub y: &'a Metric,
}

/// A point with its place on the figure.
struct Dot<'a> {
    point: &'a Point<'a>,
    at: (f64, f64),
}

pub fn draw(grid: &Grid, what: &Scatter) -> Figure {
    let all = fronts(grid, what.x, what.y, &|_| true);
    let columns = grid.places.len().clamp(1, 2);
    let rows = grid.places.len().div_ceil(columns);
    let (w, h) = if columns == 1 { (840.0, 340.0) } else { (404.0, 256.0) };
    let (left, gap) = (74.0, (84.0, 78.0));
    let width = left + columns as f64 * w + (columns as f64 - 1.0) * gap.0 + 28.0;
    let inner = width - 32.0;
    // A legend of very many combinations names nobody: there a marker is a kind of structure.
    let many = grid.legend.overflows();
    let leading: BTreeSet<usize> = all.iter().flat_map(|f| f.on_front().map(|p| p.combination)).collect();
    let keep: Vec<usize> = leading.iter().copied().collect();
    let legend = if many { grid.legend.families(&keep) } else { grid.legend.clone() };
    let look = |c: usize| match leading.contains(&c) {
        _ if !many => grid.legend.entries[c].look,
        true => legend.look(Legend::family(&grid.combinations[c])),
        false => Look { colour: MUTED, shape: Shape::Circle, dash: &[] },
    };
    let xs = all.iter().map(|f| f.points.iter().flat_map(|p| [p.x.0, p.x.1, p.x.2]).collect()).collect::<Vec<_>>();
    let ys = all.iter().map(|f| heights(what, f)).collect::<Vec<_>>();
    let log = (Scale::common_log(&xs), Scale::common_log(&ys));
    let top = 58.0 + facets::legend_height(&legend, inner, Sample::Marker) + 18.0 + 26.0;
    let height = top + rows as f64 * h + (rows as f64 - 1.0) * gap.1 + 46.0;
    let mut figure = Figure::new(what.id, what.title, width, height);
    facets::title(&mut figure, what.title, what.sub);
    facets::legend(&mut figure, &legend, 16.0, 58.0, inner, Sample::Marker);
    standings_legend(&mut figure, top - 34.0);
    let mut words = format!("{}. {} against {}. ", what.title, what.y_axis, what.x_axis);
    for (front, plot) in all.iter().zip(facets::panels(all.len(), columns, left, top, (w, h), gap)) {
        figure.part(Part::Plot, plot);
        panel(&mut figure, grid, what, front, plot, log, &look);
        let names: Vec<&str> = front.on_front().map(|p| grid.combinations[p.combination].as_str()).collect();
        words += &format!("{}: on the front {}. ", front.place, names.join(", "));
    }
    if many {
        let words = "marker: kind of structure; grey: not on the front of any scene";
        figure.label(16.0 + inner, top - 34.0, words, plain(SMALL, MUTED).end());
    }
    figure.description = words.trim_end().to_string();
    figure
}

/// What full, hollow and faded mean.
fn standings_legend(figure: &mut Figure, y: f64) {
    let mut x = 16.0;
    let r = figure.label(x, y, "standing", plain(SMALL, MUTED));
    x = r.right() + 10.0;
    for (standing, words) in [
        (Standing::Front, "on the front"),
        (Standing::Noise, "within noise of the front"),
        (Standing::Dominated, "dominated beyond the intervals"),
    ] {
        mark(figure, (x + 6.0, y - 3.6), standing, Look { colour: INK, shape: Shape::Circle, dash: &[] });
        let r = figure.label(x + 17.0, y, words, plain(facets::BODY, INK));
        x = r.right() + 20.0;
    }
}

fn mark(figure: &mut Figure, (x, y): (f64, f64), standing: Standing, look: Look) {
    match standing {
        Standing::Front | Standing::Contested => figure.marker(x, y, 5.0, look.shape, look.colour, 1.0),
        Standing::Noise => figure.hollow(x, y, 4.6, look.shape, look.colour),
        Standing::Dominated => figure.marker(x, y, 4.2, look.shape, look.colour, FADED),
    }
}

const FADED: f64 = 0.38;

/// The lower end of the bar of a point: over-submission has one where it is bracketed.
fn at_least(what: &Scatter, p: &Point) -> Option<f64> {
    if what.y.name == "over_submission" { over_submission(p.run)?.0 } else { None }
}

/// What the y axis has to hold.
fn heights(what: &Scatter, front: &Front) -> Vec<f64> {
    front.points.iter().flat_map(|p| [Some(p.y.0), at_least(what, p)]).flatten().collect()
}

fn panel(
    figure: &mut Figure,
    grid: &Grid,
    what: &Scatter,
    front: &Front,
    plot: Rect,
    log: (bool, bool),
    look: &dyn Fn(usize) -> Look,
) {
    let ys: Vec<f64> = front.points.iter().map(|p| p.y.0).collect();
    let zeros = ys.iter().filter(|y| **y <= 0.0).count();
    facets::panel_head(figure, plot, &front.place, &notes(what, front, zeros));

    let xs: Vec<f64> = front.points.iter().flat_map(|p| [p.x.0, p.x.1, p.x.2]).collect();
    // Air at both ends, or markers and labels would leave the panel.
    let x = Scale::of(log.0, xs);
    let inset = if x.is_log() { 14.0 } else { 0.0 };
    let x = x.onto(plot.x + inset, plot.right() - 14.0);
    let all_zero = what.zero_bin && zeros == ys.len();
    let y = if what.zero_bin {
        // Room for names above and below the points at zero.
        let bin = match zeros {
            0 => 26.0 + BREAK,
            _ if all_zero => plot.h + BREAK,
            _ => 74.0 + BREAK,
        };
        let mut y = Scale::log(ys.iter().copied()).onto(plot.bottom(), plot.y);
        y.kind = Kind::LogZero(bin);
        y
    } else {
        Scale::of(log.1, heights(what, front)).onto(plot.bottom(), plot.y + 8.0)
    };
    if !all_zero {
        facets::y_axis(figure, plot, &y, 4);
    }
    if let Kind::LogZero(bin) = y.kind {
        zero_bin(figure, plot, bin - BREAK, all_zero);
    }
    facets::x_axis(figure, plot, &x, 6);
    facets::x_title(figure, plot, what.x_axis);
    facets::y_title(figure, plot, what.y_axis, 50.0);

    let mut dots: Vec<Dot> =
        front.points.iter().map(|point| Dot { point, at: (x.at(point.x.0), y.at(point.y.0)) }).collect();
    if let Kind::LogZero(bin) = y.kind {
        spread_zeros(&mut dots, (bin - BREAK) / 2.0 - 9.0);
    }
    let on: Vec<(f64, f64)> = dots.iter().filter(|d| d.point.standing.on_front()).map(|d| d.at).collect();
    let stairs = staircase(&on, plot);
    figure.dashed(&stairs, MUTED, 1.1, 0.9, &[4.0, 3.0]);
    // What matters comes last and lies on top.
    for wanted in [Standing::Dominated, Standing::Noise, Standing::Contested, Standing::Front] {
        for dot in dots.iter().filter(|d| d.point.standing == wanted) {
            let p = dot.point;
            let low = at_least(what, p);
            tagged(figure, grid, p, describe(what, p, low), |figure| {
                let look = look(p.combination);
                let alpha = if wanted == Standing::Dominated { FADED } else { 0.9 };
                let (x0, x1) = (x.at(p.x.1), x.at(p.x.2));
                if x1 - x0 > 1.0 {
                    figure.line(vec![(x0, dot.at.1), (x1, dot.at.1)], look.colour, 1.4, alpha);
                }
                if let Some(low) = low {
                    let y0 = y.at(low);
                    figure.line(vec![(dot.at.0, y0), dot.at], look.colour, 1.4, alpha);
                    figure.line(vec![(dot.at.0 - 3.0, y0), (dot.at.0 + 3.0, y0)], look.colour, 1.4, alpha);
                }
                mark(figure, dot.at, wanted, look);
            });
        }
    }
    name_front(figure, grid, &dots, &stairs, plot);
}

/// What stands beside the name of the scene.
fn notes(what: &Scatter, front: &Front, zeros: usize) -> String {
    let mut notes = Vec::new();
    let n = front.points.len();
    if what.zero_bin && zeros == n && zeros > 0 {
        notes.push(format!("none of {n} lost a sampled pixel"));
    } else if what.zero_bin && zeros > 0 {
        notes.push(format!("{zeros} of {n} lost no sampled pixel"));
    }
    let without = front.gaps.iter().filter(|g| g.run.culling != super::style::IDLE).count();
    if without > 0 {
        notes.push(format!("{without} without a point"));
    }
    notes.join("; ")
}

/// "12.3 µs [12.1, 12.6], 140 px/M, dominated".
fn describe(what: &Scatter, p: &Point, low: Option<f64>) -> String {
    let unit = |m: &Metric| if m.unit.is_empty() { String::new() } else { format!(" {}", m.unit) };
    let bracket = low.map_or_else(String::new, |low| format!(" (at least {})", format::number(low, 3)));
    format!(
        "{}{} {}, {}{} {}{bracket}; {}; measurement {}",
        format::interval(p.x.0, p.x.1, p.x.2),
        unit(what.x),
        what.x.name,
        format::number(p.y.0, 3),
        unit(what.y),
        what.y.name,
        p.standing.word(),
        p.run.measurement_id
    )
}

/// Points at zero that would lie on each other are set apart upward and downward:
/// in the bin of zeros height says nothing.
fn spread_zeros(dots: &mut [Dot], room: f64) {
    let mut order: Vec<usize> = (0..dots.len()).filter(|i| dots[*i].point.y.0 <= 0.0).collect();
    order.sort_by_key(|i| (!dots[*i].point.standing.on_front(), *i));
    let lanes = (room / 11.0).max(0.0) as i32;
    let offsets = || std::iter::once(0).chain((1..=lanes).flat_map(|n| [n, -n])).map(|n| 11.0 * f64::from(n));
    let mut placed: Vec<(f64, f64)> = Vec::new();
    for i in order {
        let x = dots[i].at.0;
        let free = |dy: &f64| !placed.iter().any(|(px, pdy)| pdy == dy && (px - x).abs() < 11.0);
        let dy = offsets().find(free).unwrap_or(0.0);
        placed.push((x, dy));
        dots[i].at.1 += dy;
    }
}

/// The bin of exact zeros, drawn apart: the axis is broken between it and the rest.
fn zero_bin(figure: &mut Figure, plot: Rect, bin: f64, alone: bool) {
    let y = plot.bottom() - bin;
    figure.rect(Rect::new(plot.x, y, plot.w, bin), SHADE, 0.8);
    figure.label(plot.x - 7.0, plot.bottom() - bin / 2.0 + 3.6, "0", plain(SMALL, MUTED).end());
    if alone {
        return;
    }
    facets::axis_break(figure, plot, y - BREAK / 2.0);
}

/// The border of what is attainable: from each point of the front right, then down.
fn staircase(front: &[(f64, f64)], plot: Rect) -> Vec<(f64, f64)> {
    let Some(first) = front.first() else { return Vec::new() };
    let mut line = vec![(first.0, plot.y)];
    for (i, p) in front.iter().enumerate() {
        line.push(*p);
        let right = front.get(i + 1).map_or(plot.right(), |n| n.0);
        line.push((right, p.1));
    }
    line
}

/// So many points of a front are named: more would lie on each other or far from their points.
const NAMES: usize = 6;

/// The ends of the front, then whoever lies farthest from those that came before.
fn in_turn<'a, 'b>(dots: &'b [Dot<'a>]) -> Vec<&'b Dot<'a>> {
    let mut rest: Vec<&Dot> = dots.iter().filter(|d| d.point.standing.on_front()).collect();
    rest.sort_by(|a, b| a.at.0.total_cmp(&b.at.0).then(a.point.combination.cmp(&b.point.combination)));
    let mut out: Vec<&Dot> = Vec::new();
    if let Some(last) = rest.pop() {
        out.extend((!rest.is_empty()).then(|| rest.remove(0)));
        out.push(last);
    }
    while !rest.is_empty() {
        let apart = |d: &Dot| {
            let to = |o: &&Dot| (o.at.0 - d.at.0).hypot(o.at.1 - d.at.1);
            out.iter().map(to).fold(f64::INFINITY, f64::min)
        };
        let farthest = (0..rest.len()).max_by(|a, b| apart(rest[*a]).total_cmp(&apart(rest[*b]))).unwrap_or(0);
        out.push(rest.remove(farthest));
    }
    out
}

/// Names of a few dots on the front, clear of dots, of the front's line and of each other,
/// with the price of those that may lose triangles; of others of these the dagger alone.
fn name_front(figure: &mut Figure, grid: &Grid, dots: &[Dot<'_>], stairs: &[(f64, f64)], plot: Rect) {
    // Marks of points keep clear, and so do the lines of the front.
    let mut taken: Vec<Rect> = dots.iter().map(|d| Rect::new(d.at.0 - 5.0, d.at.1 - 5.0, 10.0, 10.0)).collect();
    taken.extend(stairs.windows(2).map(|s| {
        let (x, y) = (s[0].0.min(s[1].0), s[0].1.min(s[1].1));
        Rect::new(x - 1.0, y - 1.0, (s[1].0 - s[0].0).abs() + 2.0, (s[1].1 - s[0].1).abs() + 2.0)
    }));
    // Of names and of lines to them: no other line goes through.
    let mut words: Vec<Rect> = Vec::new();
    for (i, dot) in in_turn(dots).into_iter().enumerate() {
        let name = &grid.combinations[dot.point.combination];
        let price = rows::price(dot.point.run);
        let (text, colour) = match &price {
            Some(price) => (format!("{name} {price}"), ALARM),
            None => (name.clone(), INK),
        };
        let style = plain(SMALL, colour).bold();
        // The two ends of a front are named wherever there is room.
        let reach = if i < 2 { 14 } else { 3 };
        let place = if words.len() < 2 * NAMES {
            free_place(dot.at, &text, style, plot, (&taken, &words), reach)
        } else {
            None
        };
        let Some((r, style, x, y)) = place else {
            if let (Some(_), Some((r, style, x, y))) =
                (price, free_place(dot.at, "†", style, plot, (&taken, &words), 0))
            {
                figure.label(x, y, "†", style);
                taken.push(r);
            }
            continue;
        };
        figure.label(x, y, &text, style);
        let (from, line) = leader(dot.at, r);
        taken.extend([r, line]);
        words.extend([r, line]);
        // A name that had to move away gets a thin line back to its dot.
        if (x - dot.at.0).hypot(y - dot.at.1) >= NEAR {
            figure.segment(from, dot.at, MUTED, 0.8);
        }
    }
}

/// A name this close needs no line.
const NEAR: f64 = 20.0;

/// Where the line from a name to its dot begins, and what it covers.
fn leader(dot: (f64, f64), name: Rect) -> ((f64, f64), Rect) {
    let from = (dot.0.clamp(name.x, name.right()), if name.y > dot.1 { name.y } else { name.bottom() });
    let (x, y) = (from.0.min(dot.0), from.1.min(dot.1));
    (from, Rect::new(x, y, (from.0 - dot.0).abs(), (from.1 - dot.1).abs()))
}

/// A place for `name` that touches nothing: right of the dot, left, above, below.
fn free_place(
    at: (f64, f64),
    name: &str,
    style: TextStyle,
    plot: Rect,
    (taken, words): (&[Rect], &[Rect]),
    reach: i32,
) -> Option<(Rect, TextStyle, f64, f64)> {
    let beside = [
        (Anchor::Start, 9.0, 3.6),
        (Anchor::Start, 7.0, -5.0),
        (Anchor::Start, 7.0, 13.0),
        (Anchor::End, -9.0, 3.6),
        (Anchor::End, -7.0, -5.0),
        (Anchor::End, -7.0, 13.0),
        (Anchor::Middle, 0.0, -9.0),
        (Anchor::Middle, 0.0, 17.0),
    ];
    // Then farther above and below, within reach: what is far away is taken for another's name.
    let away = (2..reach).flat_map(|n| {
        let d = 13.0 * f64::from(n);
        [(Anchor::Start, 6.0, -d), (Anchor::Start, 6.0, d), (Anchor::End, -6.0, -d), (Anchor::End, -6.0, d)]
    });
    beside.into_iter().chain(away).find_map(|(anchor, dx, dy)| {
        let style = TextStyle { anchor, ..style };
        let (x, y) = (at.0 + dx, at.1 + dy);
        let r = text_box(x, y, name, style);
        let far = dx.hypot(dy) >= NEAR;
        let crosses = far && words.iter().any(|w| w.overlaps(&leader(at, r).1));
        (plot.contains(&r) && !crosses && !taken.iter().any(|t| t.overlaps(&r))).then_some((r, style, x, y))
    })
}
