//! Triangles submitted against culling time, frame by frame, of the best combination of
//! each scene: what the correlation is of, for the eye.

use super::consolidate::consolidate;
use super::facets::{self, BODY, HEAD, SMALL};
use super::figure::{Figure, Part, Rect, plain};
use super::findings::best_of;
use super::font;
use super::format::{self, count};
use super::labels::Grid;
use super::metrics::known;
use super::rows::may_lose;
use super::scale::Scale;
use super::style::{IDLE, INK, Look, MUTED};
use crate::results::RunResult;
use crate::stats;

const TITLE: &str = "Triangles against culling time";
const SUB: &str = "The best sound combination of each scene that culls, measured; a point is a few frames, dashed their straight line.";
const LEFT: f64 = 74.0;

/// What a panel shows.
struct Cloud<'a> {
    scene: &'a str,
    combination: &'a str,
    look: Look,
    /// "r = 0.97, rank r = 0.95", or why there is none.
    found: String,
    points: Vec<(f64, f64)>,
}

/// None where no scene has a best combination with its frames.
pub fn draw(grid: &Grid) -> Option<Figure> {
    let clouds: Vec<Cloud> = (0..grid.places.len()).filter_map(|place| cloud(grid, place)).collect();
    if clouds.is_empty() {
        return None;
    }
    let columns = clouds.len().min(3);
    let rows = clouds.len().div_ceil(columns);
    let gap = (66.0, 92.0);
    let inner = 1040.0 - LEFT - 28.0;
    let w = ((inner - gap.0 * (columns as f64 - 1.0)) / columns as f64).min(560.0);
    let (top, h) = (58.0 + 48.0, if columns == 1 { 300.0 } else { 210.0 });
    let width = LEFT + columns as f64 * w + gap.0 * (columns as f64 - 1.0) + 28.0;
    let width = width.max(16.0 + font::width(SUB, BODY, false) + 16.0);
    let height = top + rows as f64 * h + (rows as f64 - 1.0) * gap.1 + 46.0;
    let mut figure = Figure::new("triangles-against-time", TITLE, width, height);
    facets::title(&mut figure, TITLE, SUB);
    let plots = facets::panels(clouds.len(), columns, LEFT, top, (w, h), gap);
    for (i, (cloud, plot)) in clouds.iter().zip(plots).enumerate() {
        panel(&mut figure, cloud, plot, i % columns == 0);
    }
    let said = |c: &Cloud| format!("{}, {}: {}", c.scene, c.combination, c.found);
    let all = clouds.iter().map(said).collect::<Vec<_>>().join("; ");
    let every = count(grid.results.consolidate_frames.max(1).into(), "frame", "frames");
    figure.description = format!("{TITLE}. {all}.");
    figure.caption = format!(
        "Of every scene the sound combination that culls with the shortest modelled frame. Each point is the mean of {every} \
         (median over repeats); r and rank r (Spearman) are over all single frames, medians over \
         repeats. {all}."
    );
    Some(figure)
}

fn cloud<'a>(grid: &'a Grid, place: usize) -> Option<Cloud<'a>> {
    // Without culling the triangles never vary.
    let (c, run) = best_of(grid, place, &|r| !may_lose(r) && r.culling != IDLE)?;
    let every = grid.results.consolidate_frames;
    if run.triangles.is_empty() || run.triangles.len() != run.cull_ns.len() {
        return None;
    }
    let mean = |values: &[f64]| consolidate(values, every).into_iter().map(|p| p.1);
    Some(Cloud {
        scene: &grid.places[place],
        combination: &grid.combinations[c],
        look: grid.legend.entries[c].look,
        found: found(run),
        points: mean(&run.triangles).zip(mean(&run.cull_ns).map(|ns| ns / 1e3)).collect(),
    })
}

fn found(run: &RunResult) -> String {
    let of = |name: &str| known(name).value(run).map(|r| format::number(r, 3));
    match (of("pearson_triangles_cull"), of("spearman_triangles_cull")) {
        (Some(r), Some(rank)) => format!("r = {r}, rank r = {rank}"),
        _ => "no r: triangles or time do not vary".into(),
    }
}

/// Linear, from zero unless that would leave most of the axis empty.
fn axis(values: impl Iterator<Item = f64> + Clone) -> Scale {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.clone().fold(0.0, f64::max);
    let air = 0.08 * (high - low);
    let scale = Scale::from_zero(values);
    if low > 0.5 * high && air > 0.0 { Scale { low: low - air, high: high + air, ..scale } } else { scale }
}

fn panel(figure: &mut Figure, cloud: &Cloud, plot: Rect, leftmost: bool) {
    figure.part(Part::Plot, plot);
    figure.label(plot.x, plot.y - 22.0, cloud.scene, plain(HEAD, INK).bold());
    figure.label(plot.right(), plot.y - 22.0, &cloud.found, plain(SMALL, INK).end());
    figure.label(plot.x, plot.y - 8.0, &font::clipped(cloud.combination, SMALL, false, plot.w), plain(SMALL, MUTED));
    let x = axis(cloud.points.iter().map(|p| p.0)).onto(plot.x, plot.right());
    let y = axis(cloud.points.iter().map(|p| p.1)).onto(plot.bottom(), plot.y);
    facets::y_axis(figure, plot, &y, 5);
    facets::x_axis(figure, plot, &x, (plot.w / 60.0) as usize);
    facets::x_title(figure, plot, "triangles submitted");
    if leftmost {
        facets::y_title(figure, plot, "culling time (µs)", 50.0);
    }
    for (triangles, us) in &cloud.points {
        figure.marker(x.at(*triangles), y.at(*us), 3.0, cloud.look.shape, cloud.look.colour, 0.55);
    }
    if let Some((from, to)) = line(&cloud.points) {
        let ends = [(x.at(from.0), y.at(from.1)), (x.at(to.0), y.at(to.1))];
        figure.dashed(&ends, INK, 1.2, 0.8, &[5.0, 3.0]);
    }
}

/// Least squares through the points, from the least to the greatest x.
fn line(points: &[(f64, f64)]) -> Option<((f64, f64), (f64, f64))> {
    let (xs, ys): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
    stats::pearson(&xs, &ys)?;
    let (mx, my) = (stats::mean(&xs), stats::mean(&ys));
    let slope =
        points.iter().map(|(x, y)| (x - mx) * (y - my)).sum::<f64>() / xs.iter().map(|x| (x - mx).powi(2)).sum::<f64>();
    let low = xs.iter().copied().fold(f64::INFINITY, f64::min);
    let high = xs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let at = |x: f64| (x, my + slope * (x - mx));
    Some((at(low), at(high)))
}
