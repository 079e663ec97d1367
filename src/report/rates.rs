//! Tables of frames per second and of how time goes with triangles, in the form of Silva
//! (2009): who is best in each scene, and every run, the fastest of its scene first. Runs
//! without a structure, or of one, are a selection of the second table's rows.

use super::findings::best;
use super::labels::Grid;
use super::metrics::known;
use super::rows::price;
use super::table::{Cell, Column, Table, column, number};
use super::tables::{cell, class_of, named};
use crate::results::RunResult;

/// Metrics with the headings of their columns: rates first.
const METRICS: [(&str, &str); 7] = [
    (RATES[0], "best, modelled"),
    (RATES[1], "worst, modelled"),
    (RATES[2], "mean, modelled"),
    ("pearson_triangles_cull", "r, culling time"),
    ("spearman_triangles_cull", "rank r, culling"),
    ("partial_triangles_cull", "r given nodes"),
    ("pearson_triangles_frame_model", "r, frame, modelled"),
];

const RATES: [&str; 3] = ["fps_best_model", "fps_worst_model", "fps_mean_model"];

/// Whether the model knows what a frame costs beyond culling and triangles. Without that a
/// rate is of no machine (a culled frame of a thousand triangles would be shown a million
/// times a second), and the times of its frames are shown instead.
pub fn has_rates(grid: &Grid) -> bool {
    grid.runs().all(|r| r.spec.model.frame_ns > 0.0)
}

/// For the page, above the tables.
pub fn words(grid: &Grid) -> String {
    let what = match has_rates(grid) {
        true => {
            "Frames per second are derived from the modelled frame, culling plus drawing, and never measured: best and \
             worst are the fastest and the slowest frame, the mean is frames over total time and not the mean of rates."
        }
        false => {
            "Times of frames are modelled, culling plus drawing, and never measured: best and worst are the fastest and \
             the slowest frame. They are no frame rates: this study's model has no price of a frame itself (frame_ns)."
        }
    };
    format!("{what} {WORDS}")
}

const WORDS: &str = "r is the correlation of triangles submitted with time over the frames of a run, rank r that of their ranks (Spearman). \
    Given nodes: with the nodes visited held constant, what is left of it. The modelled frame holds the triangles itself, so its r \
    is high by construction; that of culling time is measured. Where triangles do not vary there is none.";

fn plain(name: &str, heading: &str) -> Column {
    let metric = known(name);
    column(heading, metric.unit, metric.about)
}

/// A rate as the time of its frame, where the model has no rates.
fn heading(grid: &Grid, name: &str, heading: &str) -> Column {
    let interval = |c: Column| if with_interval(name) { c.with_interval() } else { c };
    match RATES.contains(&name) && !has_rates(grid) {
        true => interval(column(heading, "ms", "modelled time of the frame")),
        false => interval(plain(name, heading)),
    }
}

fn shown(grid: &Grid, run: &RunResult, name: &str, with_interval: bool) -> Cell {
    let times = RATES.contains(&name) && !has_rates(grid);
    let name = if times && name == "fps_mean_model" { "frame_ms_model" } else { name };
    match if with_interval { cell(known(name), run) } else { number(known(name).value(run)) } {
        // The fastest frame is the one of the shortest time.
        Cell::Number(fps) if times && name != "frame_ms_model" => Cell::Number(1e3 / fps),
        cell => cell,
    }
}

/// "Frames per second" or "Frame times": for titles.
pub fn title(grid: &Grid) -> &'static str {
    if has_rates(grid) { "Frames per second" } else { "Frame times" }
}

/// By scene: the shortest modelled frame among sound methods and, where one that may lose
/// triangles models a shorter one still, that.
pub fn best_table(grid: &Grid) -> Table {
    let mut columns = vec![
        Column::text("scene"),
        column("triangles", "", known("scene_triangles").about),
        Column::text("best combination"),
        Column::text("walk"),
    ];
    columns.extend(METRICS.map(|(name, words)| Column { interval: false, ..heading(grid, name, words) }));
    let title = format!("{} (modelled) of the best combination, scene by scene", title(grid));
    let mut table = Table::new("rates-best", &title, 1, columns);
    for (place, scene) in grid.places.iter().enumerate() {
        let (sound, bold) = (best(grid, place, true), best(grid, place, false));
        let frame = |run: &RunResult| known("frame_ms_model").value(run).unwrap_or(f64::INFINITY);
        let shorter = |b: &RunResult| sound.is_none_or(|(_, s)| frame(b) < frame(s));
        for (c, run) in sound.into_iter().chain(bold.filter(|(_, b)| shorter(b))) {
            let mut row = vec![
                Cell::Text(scene.clone()),
                number(known("scene_triangles").value(run)),
                // The price stands beside the name: a rate never goes without it.
                Cell::Named(
                    [Some(grid.combinations[c].clone()), price(run)]
                        .into_iter()
                        .flatten()
                        .collect::<Vec<_>>()
                        .join(" "),
                    grid.legend.entries[c].look,
                ),
                Cell::Text(run.walk.clone()),
            ];
            row.extend(METRICS.map(|(name, _)| shown(grid, run, name, false)));
            table.rows.push(row);
        }
    }
    table.caption = "The combination with the shortest modelled frame that must not lose visible triangles; below it, \
                     where it models a shorter one still, the best that may, with the pixels per million that lose theirs (†). \
                     Medians over trials."
        .into();
    table
}

/// Only the mean carries its interval: seven of them would bury the numbers.
fn with_interval(name: &str) -> bool {
    name == "fps_mean_model"
}

/// Every run: scene by scene, by mean rate; what has no rate comes last.
pub fn all(grid: &Grid) -> Table {
    let mut columns = vec![Column::text("scene"), Column::text("combination"), Column::text("status")];
    columns.extend(METRICS.map(|(name, words)| heading(grid, name, words)));
    columns.extend([Column::text("class"), plain("false_cull_ppm", "false-cull pixels")]);
    let title = format!("{} (modelled) and correlations of every run", title(grid));
    let mut table = Table::new("rates", &title, 2, columns);
    let mean = |run: &RunResult| known("fps_mean_model").value(run).unwrap_or(f64::NEG_INFINITY);
    let place = |name: &str| grid.places.iter().position(|p| p == name);
    let mut runs: Vec<_> = grid.named().map(|(run, names)| (place(&names.place), mean(run), run, names)).collect();
    // Stable: equal rates stay in the order of the matrix.
    runs.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    for (_, _, run, names) in runs {
        let mut row = vec![Cell::Text(names.place.clone()), named(grid, names), Cell::Status(run.status)];
        row.extend(METRICS.map(|(name, _)| shown(grid, run, name, with_interval(name))));
        row.extend([class_of(run), number(known("false_cull_ppm").value(run))]);
        table.rows.push(row);
    }
    table.caption = "Scene by scene, the shortest mean frame first. Brackets: 95 % bootstrap interval of the median over \
                     trials; the other columns are medians over trials. †: may lose visible triangles by design; read its \
                     speed beside its false-cull pixels."
        .into();
    table
}
