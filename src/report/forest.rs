//! Forest plot of the claims: every measured ratio with its interval beside what was published.

use super::claims::{Judged, Verdict};
use super::facets::{self, BODY, SMALL};
use super::figure::{Figure, Mark, Part, Rect, plain};
use super::font;
use super::scale::Scale;
use super::style::{ALARM, Colour, FRAME, INK, MUTED, PALETTE, Shape};
use crate::claim::Relation;

const ROW: f64 = 18.0;

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
    let mut figure = Figure::new(
        "claims",
        "Published claims against measured ratios",
        left + w + 20.0 + words + 24.0,
        top + h + 46.0,
    );
    facets::title(
        &mut figure,
        "Published claims against measured ratios",
        "Bars: 95 % interval; grey: published range, pale with the tolerance; line: equal.",
    );
    for (x, shape, words) in
        [(16.0, Shape::Circle, "measured or counted"), (150.0, Shape::Diamond, "with modelled frame time")]
    {
        figure.marker(x + 5.0, 59.0, 3.6, shape, MUTED, 1.0);
        figure.label(x + 15.0, 63.0, words, plain(SMALL, MUTED));
    }
    let plot = Rect::new(left, top, w, h);
    figure.part(Part::Plot, plot);
    let scale = Scale::log(values).onto(plot.x, plot.right());
    facets::x_axis(&mut figure, plot, &scale, 6, true);
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
            if let Some([a, b]) = claim.claim.published_of(&group.name) {
                let slack = if claim.claim.relation == Relation::Ratio { claim.claim.tolerance } else { 0.0 };
                for (low, high) in [(a * (1.0 - slack), b * (1.0 + slack)), (a, b)] {
                    let (x0, x1) = (scale.at(low), scale.at(high));
                    figure.rect(Rect::new(x0 - 1.5, middle - 7.0, x1 - x0 + 3.0, 14.0), MUTED, 0.22);
                }
            }
            let ink = colour(group.verdict);
            for (ratio, shape, dy) in [(group.model_ratio, Shape::Diamond, 3.0), (group.ratio, Shape::Circle, -3.0)] {
                let Some((v, low, high)) = ratio else { continue };
                let at = middle + if group.ratio.is_some() && group.model_ratio.is_some() { dy } else { 0.0 };
                let points = vec![(scale.at(low), at), (scale.at(high), at)];
                figure.marks.push(Mark::Line { points, colour: ink, width: 1.6, alpha: 1.0 });
                figure.marker(scale.at(v), at, 3.4, shape, ink, 1.0);
            }
            figure.label(plot.right() + 20.0, middle + 3.8, group.verdict.word(), plain(SMALL, ink));
            described += &format!("{} at {}: {}. ", claim.claim.id, group.name, group.verdict.word());
        }
    }
    figure.description = described.trim_end().to_string();
    figure.caption =
        "Ratios named by the claims, with 95 % bootstrap intervals over repeats, beside the published values. \
                      Diamonds use modelled frame time, which is not measured."
            .into();
    Some(figure)
}
