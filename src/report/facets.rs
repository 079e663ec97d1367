//! Layout shared by the charts: small multiples, axes, legends.

use super::figure::{Figure, Part, Rect, plain, text_box};
use super::font;
use super::scale::Scale;
use super::style::{Colour, FRAME, GRID, INK, Legend, Look, MUTED};

/// Em sizes.
pub const TITLE: f64 = 15.0;
pub const HEAD: f64 = 12.0;
pub const BODY: f64 = 11.0;
pub const SMALL: f64 = 10.0;

/// Places `count` panels of `w` x `h` in rows of `columns` below `top`, after `left` pixels.
pub fn panels(
    count: usize,
    columns: usize,
    left: f64,
    top: f64,
    (w, h): (f64, f64),
    (gap_x, gap_y): (f64, f64),
) -> Vec<Rect> {
    (0..count)
        .map(|i| {
            let (column, row) = ((i % columns) as f64, (i / columns) as f64);
            Rect::new(left + column * (w + gap_x), top + row * (h + gap_y), w, h)
        })
        .collect()
}

/// Title at the top left; returns the y below it.
pub fn title(figure: &mut Figure, text: &str, sub: &str) -> f64 {
    figure.label(16.0, 26.0, text, plain(TITLE, INK).bold());
    if sub.is_empty() {
        return 40.0;
    }
    figure.label(16.0, 45.0, sub, plain(BODY, MUTED));
    58.0
}

/// How the legend shows an entry.
#[derive(Clone, Copy, PartialEq)]
pub enum Sample {
    Line,
    Marker,
    /// Solid lines by culling alone: the structure is said elsewhere.
    CullingLine,
}

enum Item<'a> {
    /// What the next samples mean.
    Group(&'static str),
    Look(&'a str, Look),
    /// A patch: the colour without a shape.
    Patch(&'a str, Colour),
}

impl Item<'_> {
    fn width(&self) -> f64 {
        match self {
            Item::Group(text) => font::width(text, SMALL, false) + 10.0,
            Item::Look(text, _) => 34.0 + font::width(text, BODY, false) + 18.0,
            Item::Patch(text, _) => 18.0 + font::width(text, BODY, false) + 18.0,
        }
    }
}

/// Rows of the legend: one group a row, wrapped where it must be.
fn legend_rows(legend: &Legend, width: f64, sample: Sample) -> Vec<Vec<Item<'_>>> {
    let mut groups: Vec<Vec<Item>> = Vec::new();
    if legend.systematic {
        let colours = legend.cullings.iter().map(|c| Item::Patch(c, legend.culling_colour(c)));
        groups.push(std::iter::once(Item::Group("colour: culling")).chain(colours).collect());
        if sample != Sample::CullingLine {
            let head = if sample == Sample::Line { "line: structure" } else { "marker: structure" };
            let looks = legend.variants.iter().enumerate().map(|(i, v)| Item::Look(v, legend.variant_look(i)));
            groups.push(std::iter::once(Item::Group(head)).chain(looks).collect());
        }
    } else {
        groups.push(legend.entries.iter().map(|e| Item::Look(&e.label, e.look)).collect());
    }
    let mut rows = Vec::new();
    for group in groups {
        let mut x = 0.0;
        rows.push(Vec::new());
        for item in group {
            if x + item.width() > width && x > 0.0 {
                rows.push(Vec::new());
                x = 0.0;
            }
            x += item.width();
            rows.last_mut().expect("at least one row").push(item);
        }
    }
    rows
}

/// Height of the legend for a width.
pub fn legend_height(legend: &Legend, width: f64, sample: Sample) -> f64 {
    legend_rows(legend, width, sample).len() as f64 * 18.0 + 8.0
}

/// Draws the legend in rows from (`x`, `y`) downward, outside every plot.
pub fn legend(figure: &mut Figure, legend: &Legend, x: f64, y: f64, width: f64, sample: Sample) {
    for (r, row) in legend_rows(legend, width, sample).iter().enumerate() {
        let (mut at, base) = (x, y + 14.0 + 18.0 * r as f64);
        for item in row {
            let middle = base - 4.0;
            match item {
                Item::Group(text) => drop(figure.label(at, base, text, plain(SMALL, MUTED))),
                Item::Patch(text, colour) => {
                    figure.rect(Rect::new(at, middle - 5.0, 12.0, 10.0), *colour, 1.0);
                    figure.label(at + 18.0, base, text, plain(BODY, INK));
                }
                Item::Look(text, look) => {
                    if sample == Sample::Marker {
                        figure.marker(at + 13.0, middle, 4.5, look.shape, look.colour, 1.0);
                    } else {
                        figure.dashed(&[(at, middle), (at + 26.0, middle)], look.colour, 2.0, 1.0, look.dash);
                    }
                    figure.label(at + 34.0, base, text, plain(BODY, INK));
                }
            }
            at += item.width();
        }
    }
    let height = legend_height(legend, width, sample);
    figure.part(Part::Legend, Rect::new(x, y, width, height));
}

/// Head of a panel, above its plot.
pub fn panel_head(figure: &mut Figure, plot: Rect, text: &str, note: &str) {
    let r = figure.label(plot.x, plot.y - 8.0, text, plain(HEAD, INK).bold());
    if !note.is_empty() {
        let style = plain(SMALL, MUTED);
        let x = r.right() + 8.0;
        if text_box(x, 0.0, note, style).right() <= plot.right() {
            figure.label(x, plot.y - 8.0, note, style);
        }
    }
}

/// Vertical grid lines and labels below: an x axis.
pub fn x_axis(figure: &mut Figure, plot: Rect, scale: &Scale, wanted: usize) {
    let width = |text: &str| font::width(text, SMALL, false);
    for tick in scale.ticks(wanted, &width) {
        let x = scale.at(tick.at);
        if tick.label.is_empty() {
            figure.segment((x, plot.bottom()), (x, plot.bottom() - 3.0), FRAME, 0.8);
            continue;
        }
        figure.segment((x, plot.y), (x, plot.bottom()), GRID, 1.0);
        figure.segment((x, plot.bottom()), (x, plot.bottom() + 4.0), FRAME, 1.0);
        // A label at the right end stays within its panel: the next one begins there.
        let middle = scale.kept(x, width(&tick.label) / 2.0);
        figure.label(middle, plot.bottom() + 15.0, &tick.label, plain(SMALL, MUTED).middle());
    }
    figure.segment((plot.x, plot.bottom()), (plot.right(), plot.bottom()), FRAME, 1.0);
}

/// What a label takes along an upright axis.
fn line_height(_: &str) -> f64 {
    0.96 * SMALL
}

/// Horizontal grid lines and labels at the left: a y axis.
pub fn y_axis(figure: &mut Figure, plot: Rect, scale: &Scale, wanted: usize) {
    y_grid(figure, plot, scale, wanted);
    for tick in scale.ticks(wanted, &line_height).iter().filter(|t| !t.label.is_empty()) {
        let y = scale.kept(scale.at(tick.at), line_height(&tick.label) / 2.0);
        figure.label(plot.x - 7.0, y + 3.6, &tick.label, plain(SMALL, MUTED).end());
    }
}

/// A y axis that shares the labels of the panel to its left.
pub fn y_grid(figure: &mut Figure, plot: Rect, scale: &Scale, wanted: usize) {
    for tick in scale.ticks(wanted, &line_height) {
        let y = scale.at(tick.at);
        if tick.label.is_empty() {
            figure.segment((plot.x, y), (plot.x + 3.0, y), FRAME, 0.8);
        } else {
            figure.segment((plot.x, y), (plot.right(), y), GRID, 1.0);
        }
    }
    figure.segment((plot.x, plot.y), (plot.x, plot.bottom()), FRAME, 1.0);
}

/// Two slanted strokes on a gap in the y axis around `y`.
pub fn axis_break(figure: &mut Figure, plot: Rect, y: f64) {
    let half = super::scale::BREAK / 2.0;
    figure.rect(Rect::new(plot.x - 4.0, y - half, plot.w + 5.0, 2.0 * half), super::style::PAPER, 1.0);
    for dy in [-half, half] {
        figure.segment((plot.x - 5.0, y + dy + 2.5), (plot.x + 5.0, y + dy - 2.5), FRAME, 1.2);
        figure.dashed(&[(plot.x + 5.0, y + dy), (plot.right(), y + dy)], FRAME, 0.8, 0.8, &[2.0, 3.0]);
    }
}

pub fn x_title(figure: &mut Figure, plot: Rect, text: &str) {
    figure.label(plot.x + plot.w / 2.0, plot.bottom() + 32.0, text, plain(BODY, INK).middle());
}

/// Upward text left of the tick labels, `gap` pixels from the plot.
pub fn y_title(figure: &mut Figure, plot: Rect, text: &str, gap: f64) {
    figure.upright(plot.x - gap, plot.y + plot.h / 2.0, text, plain(BODY, INK).middle());
}
