//! Charts with one row a combination and one panel a scene: total times, memory, build.
//! Labels stand beside the data, so no legend is needed, and a combination
//! without a number says why in its own row.

use super::facets::{self, BODY, SMALL};
use super::figure::{Figure, Part, Rect, plain};
use super::font;
use super::labels::Grid;
use super::scale::Scale;
use super::style::{ALARM, Colour, IDLE, INK, MUTED, SHADE};
use crate::culling::Class;
use crate::results::{RunResult, RunStatus};

const ROW: f64 = 19.0;
/// Of the whole figure, when panels fill it.
const WIDTH: f64 = 1040.0;

/// What a cell shows.
pub enum Datum {
    /// Value, ends of the interval.
    Dot(f64, f64, f64),
    /// Lengths of a stacked bar with the opacity of each.
    Bar(Vec<(f64, f64)>),
}

impl Datum {
    fn extent(&self) -> Vec<f64> {
        match self {
            Datum::Dot(v, low, high) => vec![*v, *low, *high],
            Datum::Bar(parts) => vec![parts.iter().map(|p| p.0).sum()],
        }
    }
}

pub struct Rows<'a> {
    pub id: &'a str,
    pub title: &'a str,
    pub sub: &'a str,
    /// Quantity and unit.
    pub axis: &'a str,
    /// Always from zero, as bars must be.
    pub linear: bool,
    /// Write beside a time what was lost for it.
    pub errors: bool,
    pub datum: &'a dyn Fn(&RunResult) -> Option<Datum>,
}

/// The words for a cell without a number; the flag asks for hatching.
pub fn absence(run: Option<&RunResult>) -> (&'static str, bool, Colour) {
    match run.map(|r| r.status) {
        None => ("not in the matrix", false, MUTED),
        Some(RunStatus::Pending) => ("pending", false, MUTED),
        Some(RunStatus::Failed) => ("failed", true, ALARM),
        Some(RunStatus::Wrong) => ("wrong: withheld", true, ALARM),
        Some(RunStatus::Done) => ("no value", false, MUTED),
    }
}

pub fn draw(grid: &Grid, what: &Rows) -> Figure {
    let data: Vec<Vec<Option<Datum>>> = grid
        .cells
        .iter()
        .map(|row| row.iter().map(|cell| cell.filter(|r| r.status == RunStatus::Done).and_then(what.datum)).collect())
        .collect();
    let extent: Vec<f64> = data.iter().flatten().flatten().flat_map(Datum::extent).collect();
    // Those that cull nothing cost next to nothing: they must not decide for a logarithm.
    let working: Vec<f64> = grid
        .cells
        .iter()
        .zip(&data)
        .flat_map(|(cells, data)| cells.iter().zip(data))
        .filter(|(cell, _)| cell.is_some_and(|r| r.culling != IDLE))
        .flat_map(|(_, datum)| datum.iter().flat_map(Datum::extent))
        .collect();
    let linear = what.linear || !Scale::fitting(&working).is_log();
    let scale = if linear { Scale::from_zero(extent) } else { Scale::log(extent) };

    let names = grid.combinations.iter().map(|l| font::width(l, BODY, false)).fold(0.0, f64::max);
    let left = 16.0 + names + 14.0;
    // As many panels beside each other as fit, in rows of equal length.
    let n = grid.places.len().max(1);
    let fitting = (((WIDTH - left - 24.0) / 172.0) as usize).clamp(1, 4);
    let rows = n.div_ceil(fitting);
    let columns = n.div_ceil(rows);
    let gap = (22.0, 72.0);
    let w = ((WIDTH - left - 24.0 - gap.0 * (columns as f64 - 1.0)) / columns as f64).clamp(120.0, 420.0);
    let h = ROW * grid.combinations.len() as f64 + 6.0;
    let width = left + w * columns as f64 + gap.0 * (columns as f64 - 1.0) + 24.0;
    let width = width.max(16.0 + font::width(what.sub, BODY, false) + 16.0);
    let top = 58.0 + 26.0;
    let height = top + rows as f64 * h + (rows as f64 - 1.0) * gap.1 + 46.0;
    let mut figure = Figure::new(what.id, what.title, width, height);
    facets::title(&mut figure, what.title, what.sub);

    for (i, plot) in facets::panels(grid.places.len(), columns, left, top, (w, h), gap).into_iter().enumerate() {
        let scale = scale.onto(plot.x, plot.right());
        figure.part(Part::Plot, plot);
        facets::panel_head(&mut figure, plot, &grid.places[i], "");
        facets::x_axis(&mut figure, plot, &scale, (w / 55.0) as usize);
        facets::x_title(&mut figure, plot, what.axis);
        for (c, label) in grid.combinations.iter().enumerate() {
            let y = plot.y + 3.0 + ROW * (c as f64 + 0.5);
            if i % columns == 0 {
                let x = left - 12.0;
                figure.label(x, y + 3.8, label, plain(BODY, INK).end());
            }
            let look = grid.legend.entries[c].look;
            match &data[i][c] {
                Some(datum) => {
                    draw_datum(&mut figure, &scale, y, datum, look);
                    if what.errors {
                        note_error(&mut figure, &scale, plot, y, datum, grid.cells[i][c]);
                    }
                }
                None => draw_absence(&mut figure, plot, y, grid.cells[i][c]),
            }
        }
    }
    figure.description = describe(grid, &data, what);
    figure
}

fn draw_datum(figure: &mut Figure, scale: &Scale, y: f64, datum: &Datum, look: super::style::Look) {
    match datum {
        Datum::Dot(value, low, high) => {
            let (x, x0, x1) = (scale.at(*value), scale.at(*low), scale.at(*high));
            figure.segment((scale.from, y), (x, y), super::style::GRID, 1.0);
            if x1 - x0 > 0.5 {
                figure.segment((x0, y), (x1, y), look.colour, 1.8);
                for end in [x0, x1] {
                    figure.segment((end, y - 4.0), (end, y + 4.0), look.colour, 1.8);
                }
            }
            figure.marker(x, y, 4.4, look.shape, look.colour, 1.0);
        }
        Datum::Bar(parts) => {
            let mut sum = 0.0;
            for (length, alpha) in parts {
                let (x0, x1) = (scale.at(sum), scale.at(sum + length));
                figure.rect(Rect::new(x0, y - 6.0, (x1 - x0).max(0.6), 12.0), look.colour, *alpha);
                sum += length;
            }
        }
    }
}

/// The speed of a method that may lose triangles never stands without its error.
fn note_error(figure: &mut Figure, scale: &Scale, plot: Rect, y: f64, datum: &Datum, run: Option<&RunResult>) {
    let Some(words) = run.and_then(price) else { return };
    let extent = datum.extent();
    let high = extent.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = extent.iter().copied().fold(f64::INFINITY, f64::min);
    let w = font::width(&words, SMALL, false);
    let (right, left) = (scale.at(high) + 9.0, scale.at(low) - 9.0);
    let style = plain(SMALL, ALARM);
    if right + w <= plot.right() + 20.0 {
        figure.label(right, y + 3.6, &words, style);
    } else if left - w >= plot.x {
        figure.label(left, y + 3.6, &words, style.end());
    }
}

/// "† 120 ppm" for a run whose class lets it lose visible triangles.
pub fn price(run: &RunResult) -> Option<String> {
    if !may_lose(run) {
        return None;
    }
    let lost = super::metrics::known("false_cull_ppm").value(run);
    Some(lost.map_or_else(|| "† not judged".into(), |ppm| format!("† {} ppm", super::format::number(ppm, 2))))
}

/// Whether the declared class allows visible triangles to be lost.
pub fn may_lose(run: &RunResult) -> bool {
    matches!(run.class, Some(Class::Aggressive | Class::Approximate))
}

fn draw_absence(figure: &mut Figure, plot: Rect, y: f64, run: Option<&RunResult>) {
    let (words, hatched, colour) = absence(run);
    let cell = Rect::new(plot.x + 1.0, y - ROW / 2.0 + 2.0, plot.w - 2.0, ROW - 4.0);
    if run.is_some() {
        figure.rect(cell, SHADE, 1.0);
    }
    let style = plain(SMALL, colour);
    let x = plot.x + if hatched { 19.0 } else { 8.0 };
    let text = super::figure::text_box(x, y + 3.6, words, style);
    if hatched {
        figure.marker(plot.x + 10.0, y, 3.4, super::style::Shape::Times, colour, 1.0);
        // The hatch keeps clear of the words.
        let from = text.right() + 6.0;
        figure.hatch(Rect::new(from, cell.y, (cell.right() - from).max(0.0), cell.h), colour, 6.0);
    }
    figure.label(x, y + 3.6, words, style);
}

/// The chart in words.
fn describe(grid: &Grid, data: &[Vec<Option<Datum>>], what: &Rows) -> String {
    let mut out = format!("{}. {}. ", what.title, what.axis);
    for (place, row) in grid.places.iter().zip(data) {
        out += &format!("{place}: ");
        let parts: Vec<String> = grid
            .combinations
            .iter()
            .zip(row)
            .zip(&grid.cells[grid.places.iter().position(|p| p == place).unwrap_or(0)])
            .map(|((label, datum), cell)| match datum {
                Some(d) => format!("{label} {}", super::format::number(d.extent()[0], 3)),
                None => format!("{label} {}", absence(*cell).0),
            })
            .collect();
        out += &parts.join(", ");
        out += ". ";
    }
    out.trim_end().to_string()
}
