//! Tables of frames per second and of how time goes with triangles, in the form of Silva
//! (2009): who is best in each scene, and every run, the fastest of its scene first. Runs
//! without a structure, or of one, are a selection of the second table's rows.

use super::findings::best;
use super::labels::Grid;
use super::metrics::known;
use super::rows::price;
use super::table::{Cell, Column, Table, column, number};
use super::tables::{cell, class_of, named, of};
use crate::results::RunResult;

/// Metrics with the headings of their columns.
const METRICS: [(&str, &str); 7] = [
    ("fps_best_model", "best, modelled"),
    ("fps_worst_model", "worst, modelled"),
    ("fps_mean_model", "mean, modelled"),
    ("pearson_triangles_cull", "r, culling time"),
    ("spearman_triangles_cull", "rank r, culling"),
    ("partial_triangles_cull", "r given nodes"),
    ("pearson_triangles_frame_model", "r, frame, modelled"),
];

/// For the page, above the tables.
pub const WORDS: &str = "Frames per second are derived from the modelled frame, culling plus drawing, and never measured: \
    best and worst are the fastest and the slowest frame, the mean is frames over total time and not the mean of rates. \
    r is the correlation of triangles submitted with time over the frames of a run, rank r that of their ranks (Spearman). \
    Given nodes: with the nodes visited held constant, what is left of it. The modelled frame holds the triangles itself, so its r \
    is high by construction; that of culling time is measured. Where triangles do not vary there is none.";

fn plain(name: &str, heading: &str) -> Column {
    let metric = known(name);
    column(heading, metric.unit, metric.about)
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
    columns.extend(METRICS.map(|(name, heading)| plain(name, heading)));
    let title = "Frames per second (modelled) of the best combination, scene by scene";
    let mut table = Table::new("rates-best", title, 1, columns);
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
            row.extend(METRICS.map(|(name, _)| number(known(name).value(run))));
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
    let column_of = |(name, heading)| if with_interval(name) { of(known(name), heading) } else { plain(name, heading) };
    columns.extend(METRICS.map(column_of));
    columns.extend([Column::text("class"), plain("false_cull_ppm", "false-cull pixels")]);
    let mut table = Table::new("rates", "Frames per second (modelled) and correlations of every run", 2, columns);
    let mean = |run: &RunResult| known("fps_mean_model").value(run).unwrap_or(f64::NEG_INFINITY);
    let place = |name: &str| grid.places.iter().position(|p| p == name);
    let mut runs: Vec<_> = grid.named().map(|(run, names)| (place(&names.place), mean(run), run, names)).collect();
    // Stable: equal rates stay in the order of the matrix.
    runs.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    for (_, _, run, names) in runs {
        let value = |name: &str| match with_interval(name) {
            true => cell(known(name), run),
            false => number(known(name).value(run)),
        };
        let mut row = vec![Cell::Text(names.place.clone()), named(grid, names), Cell::Status(run.status)];
        row.extend(METRICS.map(|(name, _)| value(name)));
        row.extend([class_of(run), number(known("false_cull_ppm").value(run))]);
        table.rows.push(row);
    }
    table.caption = "Scene by scene, the highest mean rate first. Brackets: 95 % bootstrap interval of the median over \
                     trials; the other columns are medians over trials. †: may lose visible triangles by design; read its \
                     rates beside its false-cull pixels."
        .into();
    table
}
