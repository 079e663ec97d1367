//! What following an adviser costs: its choice beside the best of the full matrix.

use super::claims::{Ratio, ratio};
use super::labels::Grid;
use super::metrics;
use super::table::{Cell, Column, Table, column, interval};
use crate::results::{Advised, RunStatus};
use std::collections::BTreeMap;

/// Published nowhere: the bound that the adviser has to keep.
const BOUND: f64 = 1.10;

/// An advice with the runs it speaks of.
struct Place<'a> {
    advised: &'a Advised,
    chosen: usize,
    best: usize,
    /// Of the candidates that have a value: index of the run, value.
    values: Vec<(usize, f64)>,
    ratio: Ratio,
}

fn places<'a>(grid: &'a Grid) -> Vec<Place<'a>> {
    let results = grid.results;
    let number: BTreeMap<&str, usize> =
        results.runs.iter().enumerate().map(|(i, r)| (r.measurement_id.as_str(), i)).collect();
    let mut out = Vec::new();
    for advised in &results.advice {
        let Some(metric) = metrics::find(&advised.metric) else { continue };
        let run = |id: &String| number.get(id.as_str()).copied();
        let done = |i: &usize| results.runs[*i].status == RunStatus::Done;
        let candidates = advised.candidates.iter().filter_map(run).filter(done);
        let values: Vec<(usize, f64)> = candidates.filter_map(|i| Some((i, metric.value(&results.runs[i])?))).collect();
        let best = values.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|v| v.0);
        let chosen = run(&advised.measurement_id).filter(|i| values.iter().any(|v| v.0 == *i));
        let (Some(best), Some(chosen)) = (best, chosen) else { continue };
        let of = |i: usize| metric.values(&results.runs[i]);
        let ratio = if best == chosen { (1.0, 1.0, 1.0) } else { ratio(&[(of(chosen), of(best))]) };
        out.push(Place { advised, chosen, best, values, ratio });
    }
    out
}

/// A row for each place, then what one combination everywhere would cost at best and at worst.
pub fn table(grid: &Grid) -> Table {
    let columns = vec![
        Column::text("scene"),
        Column::text("metric"),
        Column::text("advised"),
        Column::text("best of the matrix"),
        column("regret", "%", "how much more the advised combination takes than the best one").with_interval(),
        column("of", "combinations", "of the matrix, that is candidates with a value"),
        column("timed", "combinations", "by the adviser, on frames of a probe"),
        Column::text("within 10 %"),
    ];
    let mut table = Table::new("advice", "Advice and its regret", 2, columns);
    let places = places(grid);
    let percent = |x: f64| 100.0 * (x - 1.0);
    for p in &places {
        let (value, low, high) = p.ratio;
        table.rows.push(vec![
            Cell::Text(grid.named().nth(p.chosen).map(|(_, n)| n.place.clone()).unwrap_or_default()),
            Cell::Text(p.advised.metric.clone()),
            named(grid, p.chosen),
            named(grid, p.best),
            interval(Some((percent(value), percent(low), percent(high)))),
            Cell::Number(p.values.len() as f64),
            Cell::Number(f64::from(p.advised.short_list)),
            Cell::Text(if value <= BOUND { "yes".into() } else { "no".into() }),
        ]);
    }
    for (metric, words) in fixed(grid, &places) {
        for (what, mean) in words {
            table.rows.push(vec![
                Cell::Text("all, mean".into()),
                Cell::Text(metric.clone()),
                Cell::Text(what),
                Cell::Text(String::new()),
                interval(Some((percent(mean), percent(mean), percent(mean)))),
                Cell::Text(String::new()),
                Cell::Text(String::new()),
                Cell::Text(if mean <= BOUND { "yes".into() } else { "no".into() }),
            ]);
        }
    }
    table.caption = "The adviser (`cullmark advise`) counted every candidate on a sample of the scene, timed a short \
                     list on a few frames, and chose. Regret: how much more its choice takes over the whole path than \
                     the best candidate of the matrix; brackets: 95 % bootstrap interval over trials. The last rows: \
                     geometric means over all places, beside one combination for all of them."
        .into();
    table
}

fn named(grid: &Grid, run: usize) -> Cell {
    let name = grid.named().nth(run).map(|(_, n)| n.combination.clone()).unwrap_or_default();
    let look = grid.look(&name);
    Cell::Named(name, look)
}

/// By metric: the adviser's mean, and those of the best and the worst single combination
/// among those that every place has.
fn fixed(grid: &Grid, places: &[Place]) -> Vec<(String, Vec<(String, f64)>)> {
    let mut metrics: Vec<&str> = places.iter().map(|p| p.advised.metric.as_str()).collect();
    metrics.sort_unstable();
    metrics.dedup();
    let mut out = Vec::new();
    for metric in metrics {
        let own: Vec<&Place> = places.iter().filter(|p| p.advised.metric == metric).collect();
        if own.len() < 2 {
            continue;
        }
        let mean = |logs: &[f64]| (logs.iter().sum::<f64>() / logs.len() as f64).exp();
        let least = |p: &Place| p.values.iter().find(|v| v.0 == p.best).map_or(f64::NAN, |v| v.1);
        let mut logs: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for p in &own {
            for (run, value) in &p.values {
                let name = grid.named().nth(*run).map_or("", |(_, n)| n.combination.as_str());
                logs.entry(name).or_default().push((value / least(p)).ln());
            }
        }
        let everywhere: Vec<(&str, f64)> =
            logs.iter().filter(|(_, l)| l.len() == own.len()).map(|(name, l)| (*name, mean(l))).collect();
        let mut rows = vec![("the adviser".to_string(), mean(&own.iter().map(|p| p.ratio.0.ln()).collect::<Vec<_>>()))];
        let by = |a: &&(&str, f64), b: &&(&str, f64)| a.1.total_cmp(&b.1);
        rows.extend(everywhere.iter().min_by(by).map(|(name, m)| (format!("always {name} (best fixed)"), *m)));
        rows.extend(everywhere.iter().max_by(by).map(|(name, m)| (format!("always {name} (worst fixed)"), *m)));
        out.push((metric.to_string(), rows));
    }
    out
}
