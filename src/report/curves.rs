//! Charts over the frames of a path. When colour means culling, one panel for
//! every scene (row) and structure (column), with one y axis a row, so that a
//! panel holds a handful of lines; else one panel a scene with all lines.

use super::consolidate::{BandPoint, band};
use super::facets::{self, BODY, HEAD, SMALL, Sample};
use super::figure::{Figure, Mark, Part, Rect, plain, text_box};
use super::findings::done;
use super::font;
use super::labels::Grid;
use super::metrics::{frames, known};
use super::rows::absence;
use super::scale::Scale;
use super::style::{IDLE, INK, Legend, Look, MUTED};
use crate::results::{RunResult, RunStatus};
use std::collections::BTreeSet;

pub struct Curves<'a> {
    pub id: &'a str,
    pub title: &'a str,
    pub sub: &'a str,
    /// Quantity and unit.
    pub axis: &'a str,
    /// Leave out whoever culls nothing.
    pub working_only: bool,
    /// Only these combinations, where a chart is about some of them.
    pub only: Option<Vec<usize>>,
    /// Per trial, frame by frame, in the unit of the axis; empty has no line.
    pub series: &'a dyn Fn(&RunResult) -> Vec<Vec<f64>>,
}

/// With more lines than this a panel shows [`FEW`] alone.
const MOST_LINES: usize = 16;
const FEW: usize = 6;
/// More columns than this are too narrow to read.
const MOST_COLUMNS: usize = 5;
/// Of the whole figure.
const WIDTH: f64 = 1040.0;
const LEFT: f64 = 74.0;

type Line = Vec<BandPoint>;

/// Which combinations are drawn, and how they look.
struct Chosen {
    legend: Legend,
    /// By combination.
    looks: Vec<Look>,
    /// By place, where not all are.
    few: Option<Vec<Vec<usize>>>,
}

/// One set of axes: a scene, and the combinations it shows.
struct Panel {
    place: usize,
    /// Over the plot: the structure, or the scene.
    head: String,
    shown: Vec<usize>,
    plot: Rect,
}

/// Where panels lie and what is written around them.
struct Layout {
    panels: Vec<Panel>,
    columns: usize,
    /// Columns are structures: lines are solid, scenes head rows.
    by_structure: bool,
    height: f64,
    legend: Sample,
}

pub fn draw(grid: &Grid, what: &Curves) -> Figure {
    let every = grid.results.consolidate_frames;
    let drawn = |r: &&RunResult| r.status == RunStatus::Done && !(what.working_only && r.culling == IDLE);
    let line =
        |cell: &Option<&RunResult>| cell.filter(drawn).map(what.series).map_or_else(Vec::new, |t| band(&t, every));
    let chosen = choose(grid, what.only.as_deref());
    let shows = |place: usize, c: &usize| chosen.few.as_ref().is_none_or(|few| few[place].contains(c));
    let curves: Vec<Vec<Line>> = (0..grid.places.len())
        .map(|p| {
            let cells = grid.cells[p].iter().enumerate();
            cells.map(|(c, cell)| if shows(p, &c) { line(cell) } else { Line::new() }).collect()
        })
        .collect();

    let log = log(grid, &curves);
    let layout = layout(grid, &chosen);
    let mut figure = Figure::new(what.id, what.title, WIDTH, layout.height);
    facets::title(&mut figure, what.title, what.sub);
    facets::legend(&mut figure, &chosen.legend, 16.0, 58.0, WIDTH - 32.0, layout.legend);
    let rows = layout.panels.len().div_ceil(layout.columns);
    for (i, panel) in layout.panels.iter().enumerate() {
        let (row, column) = (i / layout.columns, i % layout.columns);
        if layout.by_structure && column == 0 {
            row_head(&mut figure, grid, panel);
        }
        let lowest = !layout.by_structure || row + 1 == rows;
        // One y axis for all structures of a scene.
        let y = Scale::of(log, extent(&curves[panel.place])).onto(panel.plot.bottom(), panel.plot.y);
        draw_panel(&mut figure, grid, what, &layout, &chosen, panel, &curves[panel.place], y, (column == 0, lowest));
    }
    figure.description = describe(grid, &curves, what);
    figure
}

fn by_structure(grid: &Grid) -> bool {
    grid.legend.systematic && grid.legend.variants.len() <= MOST_COLUMNS
}

/// All, or of very many those with the shortest modelled frames of each scene.
fn choose(grid: &Grid, only: Option<&[usize]>) -> Chosen {
    let all = grid.legend.entries.iter().map(|e| e.look).collect();
    if let Some(only) = only {
        let mut chosen = few(grid, all, vec![only.to_vec(); grid.places.len()]);
        let shared = shared(chosen.legend.entries.iter().map(|e| e.label.as_str()));
        chosen.legend.entries.iter_mut().for_each(|e| _ = e.label.drain(..shared));
        return chosen;
    }
    if by_structure(grid) || grid.combinations.len() <= MOST_LINES {
        return Chosen { legend: grid.legend.clone(), looks: all, few: None };
    }
    let fastest = |place: usize| -> Vec<usize> {
        let timed = done(grid, place).filter(|(_, r)| r.culling != IDLE);
        let mut timed: Vec<(f64, usize)> =
            timed.filter_map(|(c, r)| Some((known("frame_ms_model").value(r)?, c))).collect();
        timed.sort_by(|a, b| a.0.total_cmp(&b.0));
        timed.into_iter().take(FEW).map(|(_, c)| c).collect()
    };
    few(grid, all, (0..grid.places.len()).map(fastest).collect())
}

/// Bytes of what all labels begin with, up to the end of a part: it need not be said again and again.
fn shared<'a>(mut labels: impl Iterator<Item = &'a str>) -> usize {
    let Some(first) = labels.next() else { return 0 };
    let ends = |l: &str| first.bytes().zip(l.bytes()).take_while(|(a, b)| a == b).count();
    let common = labels.map(ends).min().unwrap_or(0);
    first.match_indices(" × ").map(|(at, part)| at + part.len()).filter(|end| *end <= common).max().unwrap_or(0)
}

/// Of each place these alone.
fn few(grid: &Grid, all: Vec<Look>, few: Vec<Vec<usize>>) -> Chosen {
    let union: Vec<usize> = few.iter().flatten().copied().collect::<BTreeSet<_>>().into_iter().collect();
    let legend = grid.legend.few(&union);
    let mut looks: Vec<Look> = all;
    union.iter().zip(&legend.entries).for_each(|(c, entry)| looks[*c] = entry.look);
    Chosen { legend, looks, few: Some(few) }
}

/// For the caption: who is drawn, where it is not everybody.
pub fn words(grid: &Grid) -> String {
    match choose(grid, None).few {
        None => String::new(),
        Some(_) => format!(
            " Of {} combinations the {FEW} with the shortest modelled frame of each scene are drawn, in looks of this \
             chart's own; the tables hold all.",
            grid.combinations.len()
        ),
    }
}

fn layout(grid: &Grid, chosen: &Chosen) -> Layout {
    let legend = &chosen.legend;
    let by_structure = by_structure(grid) && chosen.few.is_none();
    let sample = if by_structure { Sample::CullingLine } else { Sample::Line };
    let top = 58.0 + facets::legend_height(legend, WIDTH - 32.0, sample);
    let of_variant = |v: usize| (0..grid.combinations.len()).filter(move |c| grid.variant_of[*c] == v).collect();
    if !by_structure {
        let columns = grid.places.len().clamp(1, 2);
        let (h, gap) = if columns == 1 { (300.0, 0.0) } else { (190.0, 84.0) };
        let w = (WIDTH - LEFT - 28.0 - gap * (columns as f64 - 1.0)) / columns as f64;
        let plots = facets::panels(grid.places.len(), columns, LEFT, top + 26.0, (w, h), (gap, 76.0));
        let height = plots.last().map_or(top, Rect::bottom) + 46.0;
        let panels = plots.into_iter().enumerate().map(|(place, plot)| Panel {
            place,
            head: grid.places[place].clone(),
            shown: match &chosen.few {
                Some(few) => few[place].clone(),
                None => (0..grid.combinations.len()).collect(),
            },
            plot,
        });
        return Layout { panels: panels.collect(), columns, by_structure, height, legend: sample };
    }
    let columns = legend.variants.len().max(1);
    let gap = 14.0;
    let w = (WIDTH - LEFT - 28.0 - gap * (columns as f64 - 1.0)) / columns as f64;
    let h = if grid.places.len() <= 2 { 210.0 } else { 128.0 };
    // Above a row: the scene, then the structures.
    let plots = facets::panels(grid.places.len() * columns, columns, LEFT, top + 46.0, (w, h), (gap, 70.0));
    let height = plots.last().map_or(top, Rect::bottom) + 46.0;
    let panels = plots.into_iter().enumerate().map(|(i, plot)| Panel {
        place: i / columns,
        head: legend.variants[i % columns].clone(),
        shown: of_variant(i % columns),
        plot,
    });
    Layout { panels: panels.collect(), columns, by_structure, height, legend: sample }
}

/// The scene, and what is missing of it.
fn row_head(figure: &mut Figure, grid: &Grid, panel: &Panel) {
    let y = panel.plot.y - 26.0;
    let r = figure.label(16.0, y, &grid.places[panel.place], plain(HEAD, INK).bold());
    let mut note = missing(grid, panel.place);
    let style = plain(SMALL, MUTED);
    while r.right() + 12.0 + font::width(&note, SMALL, false) > WIDTH - 20.0 {
        // A long list is cut after a whole part; tables name everything.
        match note.trim_end_matches(", …").rsplit_once(", ") {
            Some((kept, _)) => note = format!("{kept}, …"),
            None => return,
        }
    }
    if !note.is_empty() {
        figure.label(r.right() + 12.0, y, &note, style);
    }
}

fn draw_panel(
    figure: &mut Figure,
    grid: &Grid,
    what: &Curves,
    layout: &Layout,
    chosen: &Chosen,
    panel: &Panel,
    curves: &[Line],
    y: Scale,
    (leftmost, lowest): (bool, bool),
) {
    let plot = panel.plot;
    figure.part(Part::Plot, plot);
    let last = grid.cells[panel.place].iter().flatten().map(|r| frames(r)).max().unwrap_or(1);
    let x = Scale { high: last.max(1) as f64, ..Scale::from_zero([1.0]) }.onto(plot.x, plot.right());
    if layout.by_structure {
        figure.label(plot.x, plot.y - 7.0, &panel.head, plain(BODY, MUTED));
    } else {
        facets::panel_head(figure, plot, &panel.head, &missing(grid, panel.place));
    }
    if leftmost || !layout.by_structure {
        facets::y_axis(figure, plot, &y, 5);
        facets::y_title(figure, plot, what.axis, 50.0);
    } else {
        facets::y_grid(figure, plot, &y, 5);
    }
    // The label at the right end would run into that of the next panel's zero.
    facets::x_axis(figure, plot, &x, (plot.w / 60.0) as usize);
    if lowest {
        facets::x_title(figure, plot, "frame");
    }
    for c in &panel.shown {
        let colour = chosen.looks[*c].colour;
        let upper = curves[*c].iter().map(|p| (x.at(p.frame), y.at(p.high)));
        let lower = curves[*c].iter().rev().map(|p| (x.at(p.frame), y.at(p.low)));
        if curves[*c].iter().any(|p| p.high > p.low) {
            figure.marks.push(Mark::Polygon { points: upper.chain(lower).collect(), colour, alpha: 0.18 });
        }
    }
    for c in &panel.shown {
        let look = chosen.looks[*c];
        let line: Vec<(f64, f64)> = curves[*c].iter().map(|p| (x.at(p.frame), y.at(p.middle))).collect();
        figure.dashed(&line, look.colour, 1.5, 1.0, if layout.by_structure { &[] } else { look.dash });
        if line.len() == 1 {
            figure.marker(line[0].0, line[0].1, 3.0, look.shape, look.colour, 1.0);
        }
    }
    if panel.shown.iter().all(|c| curves[*c].is_empty()) {
        let absent = panel.shown.iter().all(|c| grid.cells[panel.place][*c].is_none());
        let words = if absent { "not in the matrix" } else { "no usable run" };
        let style = plain(SMALL, MUTED).middle();
        let (tx, ty) = (plot.x + plot.w / 2.0, plot.y + plot.h / 2.0);
        figure.rect(text_box(tx, ty, words, style), super::style::PAPER, 1.0);
        figure.label(tx, ty, words, style);
    }
}

fn extent(curves: &[Line]) -> Vec<f64> {
    curves.iter().flatten().flat_map(|p| [p.low, p.high]).collect()
}

/// Linear from zero unless the combinations that cull range widely in some scene: those that
/// cull nothing cost next to nothing and must not squeeze all others.
fn log(grid: &Grid, curves: &[Vec<Line>]) -> bool {
    let working = |place: usize| -> Vec<f64> {
        let culls = |c: &usize| grid.cells[place][*c].is_some_and(|r| r.culling != IDLE);
        (0..curves[place].len()).filter(culls).flat_map(|c| curves[place][c].iter().map(|p| p.middle)).collect()
    };
    let positive = curves.iter().flatten().flatten().all(|p| p.low > 0.0);
    positive && Scale::common_log(&(0..curves.len()).map(working).collect::<Vec<_>>())
}

/// "octree × frustum failed, ...": runs of the matrix that have no line, with the reason in a word.
fn missing(grid: &Grid, place: usize) -> String {
    let cells = grid.combinations.iter().zip(&grid.cells[place]);
    let gaps: Vec<String> = cells
        .filter(|(_, cell)| cell.is_some_and(|r| r.status != RunStatus::Done))
        .map(|(label, cell)| format!("{label} {}", absence(*cell).0))
        .collect();
    gaps.join(", ")
}

fn describe(grid: &Grid, curves: &[Vec<Line>], what: &Curves) -> String {
    let mut out = format!("{}. {}, against frame. ", what.title, what.axis);
    for (place, row) in grid.places.iter().zip(curves) {
        let parts: Vec<String> = grid
            .combinations
            .iter()
            .zip(row)
            .filter(|(_, c)| !c.is_empty())
            .map(|(label, c)| {
                let low = c.iter().map(|p| p.middle).fold(f64::INFINITY, f64::min);
                let high = c.iter().map(|p| p.middle).fold(0.0, f64::max);
                format!("{label} from {} to {}", super::format::number(low, 3), super::format::number(high, 3))
            })
            .collect();
        out += &format!("{place}: {}. ", parts.join(", "));
    }
    out.trim_end().to_string()
}
