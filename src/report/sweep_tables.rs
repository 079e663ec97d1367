//! The numbers behind the charts of sweeps: every point, and how fast each line grows.

use super::sweeps::{Chart, value};
use super::table::{Cell, Column, Table, column, interval, number};
use crate::results::RunStatus;

/// Every point with its runs.
pub fn points(chart: &Chart) -> Table {
    let s = chart.sweep;
    let counts = [("wrong", RunStatus::Wrong), ("failed", RunStatus::Failed), ("pending", RunStatus::Pending)];
    let mut columns = vec![Column::text("panel"), Column::text(&s.by)];
    columns.push(column(&s.x, &s.x_unit, if chart.against.is_some() { "the knob" } else { "the stressor" }));
    columns.push(column(chart.metric.name, chart.metric.unit, chart.metric.about).with_interval());
    columns.extend(chart.against.map(|m| column(m.name, m.unit, m.about).with_interval()));
    columns.push(column("runs", "", "runs that share this place"));
    columns.extend(counts.map(|(name, _)| column(name, "", "of these")));
    columns.extend([Column::text("why"), Column::text("measurements")]);
    let mut table = Table::new(&format!("sweep-{}", s.id), &format!("{}: the numbers", s.title), 2, columns);
    for panel in &chart.panels {
        for line in &panel.lines {
            for p in &line.points {
                let mut row = vec![Cell::Text(panel.title.clone()), Cell::Text(line.by.clone()), Cell::Number(p.x)];
                row.push(interval(p.value));
                row.extend(chart.against.map(|m| interval(value(m, &p.runs))));
                row.push(Cell::Number(p.runs.len() as f64));
                row.extend(counts.map(|(_, status)| Cell::Number(p.with(status) as f64)));
                let reasons: Vec<&str> =
                    p.runs.iter().filter(|r| r.status != RunStatus::Done).filter_map(|r| r.reason.as_deref()).collect();
                row.push(Cell::Text(reasons.join("; ")));
                let ids: Vec<&str> = p.runs.iter().map(|r| r.measurement_id.as_str()).collect();
                row.push(Cell::Text(ids.join(" ")));
                table.rows.push(row);
            }
        }
    }
    table.caption =
        "Median over the runs that share a place, from the smallest to the largest; of a single run its 95 % \
                     interval. Wrong and failed runs have no value here; their reasons stand beside them."
            .into();
    table
}

/// Measured growth of every line beside what was expected.
pub fn slopes(chart: &Chart) -> Table {
    let s = chart.sweep;
    let columns = vec![
        Column::text("panel"),
        Column::text(&s.by),
        column("measured slope", "", "least squares of log y over log x, points above zero"),
        column("expected slope", "", "of the line that the law is for"),
        column("r²", "", "share of the variance that the straight line explains"),
        column("points above zero", "", "points that the slope is measured over"),
        column("points at zero", "", ""),
    ];
    let title = format!("{}: growth of every line", s.title);
    let mut table = Table::new(&format!("sweep-{}-growth", s.id), &title, 2, columns);
    for panel in &chart.panels {
        for line in &panel.lines {
            let found = line.slope();
            let concerned = s.expected_for.as_ref().is_none_or(|f| *f == line.by);
            let above = line.points.iter().filter(|p| p.value.is_some_and(|v| v.0 > 0.0)).count();
            table.rows.push(vec![
                Cell::Text(panel.title.clone()),
                Cell::Text(line.by.clone()),
                number(found.map(|f| f.slope)),
                number(s.expected_slope.filter(|_| concerned)),
                number(found.map(|f| f.r2)),
                Cell::Number(above as f64),
                Cell::Number(line.zeros() as f64),
            ]);
        }
    }
    table.caption = format!(
        "Slope on logarithmic axes: y grows as x to this power. None where fewer than two points are above zero. {}",
        s.expected_why
    )
    .trim_end()
    .into();
    table
}
