//! Forest plot of the claims: every measured ratio with its interval beside what was published.

use super::claims::{Judged, Verdict};
use super::facets::{self, BODY, SMALL};
use super::figure::{Figure, Mark, Part, Rect, plain};
use super::font;
use super::metrics::{self, Kind};
use super::scale::Scale;
use super::style::{ALARM, Colour, FRAME, INK, MUTED, PALETTE, Shape};
use crate::claim::Relation;

const ROW: f64 = 18.0;
/// Of the text below the chart.
const LINE: f64 = 15.0;
const ASIDE: f64 = 0.4;
/// Behind what agrees with a claim.
const AGREES: Colour = PALETTE[2];

fn colour(verdict: Verdict) -> Colour {
    match verdict {
        Verdict::Reproduced => PALETTE[2],
        Verdict::ModelOnly => PALETTE[0],
        Verdict::Undecided => MUTED,
        Verdict::Contradicted => ALARM,
    }
}

/// None when no claim about a ratio has a number.
pub fn draw(judged: &[Judged]) -> Option<Figure> {
    let shown: Vec<&Judged> = judged
        .iter()
        // Values of other metrics have no place on an axis of ratios.
        .filter(|j| !j.claim.relation.is_own())
        .filter(|j| j.groups.iter().any(|g| g.name != "trend" && (g.ratio.is_some() || g.model_ratio.is_some())))
        .collect();
    let groups = || shown.iter().flat_map(|j| j.groups.iter().map(move |g| (j, g))).filter(|(_, g)| g.name != "trend");
    let mut values = vec![1.0];
    for (claim, g) in groups() {
        for (v, low, high) in [g.ratio, g.model_ratio].into_iter().flatten() {
            values.extend([v, low, high]);
        }
        let slack = claim.claim.tolerance.min(0.9);
        values.extend(
            claim.claim.published_of(&g.name).into_iter().flat_map(|[a, b]| [a * (1.0 - slack), b * (1.0 + slack)]),
        );
    }
    if shown.is_empty() || values.len() == 1 {
        return None;
    }
    let rows = groups().count() + shown.len();
    let names = groups().map(|(_, g)| font::width(&g.name, BODY, false)).fold(90.0, f64::max);
    let (left, w) = (16.0 + names + 20.0, 470.0);
    let (top, h) = (76.0, ROW * rows as f64 + 6.0);
    let words = font::width(Verdict::ModelOnly.word(), BODY, false);
    let left_out = left_out(judged, &shown, left + w + words);
    let mut figure = Figure::new(
        "claims",
        "Published claims against measured ratios",
        left + w + 20.0 + words + 24.0,
        top + h + 46.0 + if left_out.is_empty() { 0.0 } else { 10.0 + LINE * left_out.len() as f64 },
    );
    facets::title(
        &mut figure,
        "Published claims against measured ratios",
        "Bars: 95 % interval; green: where the claim holds; grey: the published range; line: equal.",
    );
    for (x, shape, words) in
        [(16.0, Shape::Circle, "measured or counted"), (150.0, Shape::Diamond, "with modelled frame time")]
    {
        figure.marker(x + 5.0, 59.0, 3.6, shape, MUTED, 1.0);
        figure.label(x + 15.0, 63.0, words, plain(SMALL, MUTED));
    }
    figure.label(315.0, 63.0, "pale: not what the claim names", plain(SMALL, MUTED));
    let plot = Rect::new(left, top, w, h);
    figure.part(Part::Plot, plot);
    let scale = Scale::log(values).onto(plot.x, plot.right());
    facets::x_axis(&mut figure, plot, &scale, 6);
    facets::x_title(&mut figure, plot, "ratio");
    figure.segment((scale.at(1.0), plot.y), (scale.at(1.0), plot.bottom()), FRAME, 1.6);
    let mut y = plot.y + 3.0;
    let mut described = String::new();
    for claim in &shown {
        y += ROW;
        let text = font::clipped(&claim.claim.text, BODY, true, left + w - 16.0 + words);
        // The statement stands above its rows, over a strip that hides the grid.
        figure.rect(Rect::new(16.0, y - 14.0, left + w - 16.0 + 20.0 + words, 18.0), super::style::SHADE, 1.0);
        figure.label(20.0, y - 1.0, &text, plain(BODY, INK).bold());
        for group in claim.groups.iter().filter(|g| g.name != "trend") {
            y += ROW;
            let middle = y - 5.0;
            figure.label(left - 12.0, middle + 3.8, &group.name, plain(BODY, INK).end());
            let mut band = |low: f64, high: f64, colour: Colour, alpha: f64| {
                let (x0, x1) = (scale.at(low), scale.at(high));
                figure.rect(Rect::new(x0 - 1.5, middle - 7.0, x1 - x0 + 3.0, 14.0), colour, alpha);
            };
            let published = claim.claim.published_of(&group.name);
            if let Some((low, high)) = agreement(claim, published) {
                band(low.max(scale.low), high.min(scale.high), AGREES, 0.14);
            }
            if let Some([a, b]) = published {
                band(a, b, MUTED, 0.30);
            }
            let ink = colour(group.verdict);
            let both = [(group.model_ratio, Shape::Diamond, 3.0), (group.ratio, Shape::Circle, -3.0)];
            for (ratio, shape, dy) in both {
                let Some((v, low, high)) = ratio else { continue };
                // The metric that the claim does not name stands in the background.
                let named = (shape == Shape::Diamond) == is_modelled(claim);
                let alpha = if named { 1.0 } else { ASIDE };
                let at = middle + if group.ratio.is_some() && group.model_ratio.is_some() { dy } else { 0.0 };
                let points = vec![(scale.at(low), at), (scale.at(high), at)];
                figure.marks.push(Mark::Line { points, colour: ink, width: 1.6, alpha });
                figure.marker(scale.at(v), at, 3.4, shape, ink, alpha);
            }
            figure.label(plot.right() + 20.0, middle + 3.8, group.verdict.word(), plain(SMALL, ink));
            described += &format!("{} at {}: {}. ", claim.claim.id, group.name, group.verdict.word());
        }
    }
    for (i, line) in left_out.iter().enumerate() {
        figure.label(16.0, plot.bottom() + 54.0 + LINE * i as f64, line, plain(SMALL, MUTED));
    }
    figure.description = described.trim_end().to_string();
    figure.caption = format!(
        "Ratios named by the claims, with 95 % bootstrap intervals over repeats, beside the published values. \
         Diamonds use modelled frame time, which is not measured. {}",
        left_out.join(" ")
    );
    figure.caption.truncate(figure.caption.trim_end().len());
    Some(figure)
}

fn is_modelled(claim: &Judged) -> bool {
    metrics::find(&claim.claim.metric).is_some_and(|m| m.kind == Kind::Modelled)
}

/// From where to where a ratio agrees with the claim.
fn agreement(claim: &Judged, published: Option<[f64; 2]>) -> Option<(f64, f64)> {
    let slack = claim.claim.tolerance;
    match claim.claim.relation {
        Relation::Less | Relation::Best => Some((0.0, 1.0)),
        Relation::Greater => Some((1.0, f64::INFINITY)),
        Relation::Ratio => published.map(|[a, b]| (a * (1.0 - slack), b * (1.0 + slack))),
        Relation::Grows | Relation::Zero | Relation::Value => None,
    }
}

/// Claims that have no place here, in lines of a width.
fn left_out(judged: &[Judged], shown: &[&Judged], width: f64) -> Vec<String> {
    let absent = judged.iter().filter(|j| !shown.iter().any(|s| s.claim.id == j.claim.id));
    let says = |j: &Judged| format!("{} ({})", j.claim.id, j.verdict.word());
    let all: Vec<String> = absent.map(says).collect();
    if all.is_empty() {
        return Vec::new();
    }
    let text =
        format!("Not drawn, being about values, trends or runs without a number: {}. See the table.", all.join(", "));
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line = lines.last_mut().expect("at least one line");
        let longer = if line.is_empty() { word.to_string() } else { format!("{line} {word}") };
        if line.is_empty() || font::width(&longer, SMALL, false) <= width {
            *line = longer;
        } else {
            lines.push(word.to_string());
        }
    }
    lines
}
