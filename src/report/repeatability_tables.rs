//! Repeatability as tables, as text and as JSON.

use super::format;
use super::repeatability::Repeatability;
use super::table::{Cell, Column, Table, column, interval, number};
use serde_json::{Value, json};

/// Metric by metric.
pub fn agreements(r: &Repeatability) -> Table {
    let columns = vec![
        Column::text("metric"),
        column("pairs", "", "the same cell in two series"),
        column("intervals overlap", "%", "of the pairs in which both have an interval"),
        column("ratio not told from 1", "%", "pairs whose ratio's 95 % interval holds 1"),
        column("median ratio", "", "later over earlier series"),
        column("variation within", "%", "coefficient of variation over the trials of a series, median over runs"),
        column("variation between", "%", "coefficient of variation over series, median over cells"),
        column("largest ratio", "", "of the pair that moved most"),
        Column::text("where"),
    ];
    let mut table = Table::new("repeatability", "Measured again: do the numbers agree?", 1, columns);
    for a in &r.agreements {
        let share = |n: usize| (a.with_intervals > 0).then(|| 100.0 * n as f64 / a.with_intervals as f64);
        let percent = |v: Option<f64>| number(v.map(|v| 100.0 * v));
        let at = a.farthest.map(|(p, _)| format!("{}: {}", r.pairs[p].place, r.pairs[p].first.label()));
        table.rows.push(vec![
            Cell::Text(a.metric.heading()),
            Cell::Number(a.pairs as f64),
            number(share(a.overlapping)),
            number(share(a.holding_one)),
            Cell::Number(a.median_ratio),
            percent(a.variation_within),
            percent(a.variation_between),
            number(a.farthest.map(|f| f.1)),
            Cell::Text(at.unwrap_or_default()),
        ]);
    }
    table.caption = "Of two independent 95 % intervals about the same number some 99 in 100 pairs overlap, and 95 in 100 \
                     ratios hold 1 (Schenker and Gentleman 2001); fewer means that the machine changed between the series \
                     more than within them. Variation between above variation within says the same."
        .into();
    table
}

/// What must be identical and is not; without rows when all is well.
pub fn differences(r: &Repeatability) -> Table {
    let columns = ["scene", "combination", "what", "series", "first", "second"].map(Column::text).to_vec();
    let mut table = Table::new("repeatability-differences", "What must be identical and is not", 3, columns);
    for d in &r.differences {
        let series = format!("{} and {}", d.series.0, d.series.1);
        let cells = [&d.place, &d.label, &d.what, &series, &d.first, &d.second];
        table.rows.push(cells.map(|t| Cell::Text(t.clone())).to_vec());
    }
    table
}

/// Every metric of every pair.
pub fn readings(r: &Repeatability) -> Table {
    let mut columns = vec![Column::text("scene"), Column::text("combination"), Column::text("metric")];
    columns.push(Column::text("unit"));
    columns.push(column("first series", "", ""));
    columns.push(column("first", "", "median with its 95 % interval").with_interval());
    columns.push(column("second series", "", ""));
    columns.push(column("second", "", "median with its 95 % interval").with_interval());
    columns.push(column("ratio", "", "second over first").with_interval());
    columns.push(Column::text("intervals overlap"));
    let mut table = Table::new("repeatability-pairs", "Every measured number of every pair", 3, columns);
    for x in &r.readings {
        let p = &r.pairs[x.pair];
        let overlap = match x.overlap {
            Some(true) => "yes",
            Some(false) => "no",
            None => "single trial: no interval",
        };
        table.rows.push(vec![
            Cell::Text(p.place.clone()),
            Cell::Text(p.first.label()),
            Cell::Text(x.metric.name.into()),
            Cell::Text(x.metric.unit.into()),
            Cell::Number(f64::from(p.series.0)),
            interval(Some(x.first)),
            Cell::Number(f64::from(p.series.1)),
            interval(Some(x.second)),
            interval(Some(x.ratio)),
            Cell::Text(overlap.into()),
        ]);
    }
    table
}

/// For terminals: sentences, the table of metrics, the differences.
pub fn text(r: &Repeatability) -> String {
    let mut out = r.findings().join("\n") + "\n";
    let (agree, differ) = (agreements(r), differences(r));
    if !agree.rows.is_empty() {
        out += &format!("\n{}", agree.terminal());
    }
    if !differ.rows.is_empty() {
        out += &format!("\n{}", differ.terminal());
    }
    out
}

/// The sentences and both tables.
pub fn markdown(r: &Repeatability) -> String {
    let sentences: Vec<String> = r.findings().iter().map(|f| format!("- {}\n", format::markdown(f))).collect();
    let mut out = sentences.concat();
    for table in [agreements(r), differences(r)].iter().filter(|t| !t.rows.is_empty()) {
        out += &format!("\n{}", table.markdown());
    }
    out
}

pub fn json(r: &Repeatability) -> Value {
    let of = |(v, low, high): (f64, f64, f64)| json!({"value": v, "low": low, "high": high});
    let agreements = r.agreements.iter().map(|a| {
        json!({
            "metric": a.metric.name, "unit": a.metric.unit, "pairs": a.pairs, "pairs_with_intervals": a.with_intervals,
            "overlapping": a.overlapping, "ratio_holds_1": a.holding_one, "median_ratio": a.median_ratio,
            "variation_within": a.variation_within, "variation_between": a.variation_between,
            "largest_ratio": a.farthest.map(|f| f.1),
        })
    });
    let differences = r.differences.iter().map(|d| {
        json!({
            "scene": d.place, "combination": d.label, "what": d.what, "series": [d.series.0, d.series.1],
            "first": d.first, "second": d.second,
        })
    });
    let readings = r.readings.iter().map(|x| {
        let p = &r.pairs[x.pair];
        json!({
            "scene": p.place, "combination": p.first.label(), "metric": x.metric.name, "unit": x.metric.unit,
            "series": [p.series.0, p.series.1], "first": of(x.first), "second": of(x.second), "ratio": of(x.ratio),
            "overlap": x.overlap,
        })
    });
    json!({
        "series": r.series, "pairs": r.pairs.len(), "unpaired": r.unpaired, "numbers_compared": r.numbers_compared,
        "hashes_compared": r.hashes_compared, "agreements": agreements.collect::<Vec<_>>(),
        "differences": differences.collect::<Vec<_>>(), "readings": readings.collect::<Vec<_>>(),
    })
}
