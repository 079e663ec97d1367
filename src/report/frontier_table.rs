//! The fronts of a study as tables: one for any two metrics, one for the report.

use super::figure::Figure;
use super::frontier::{Front, Gap, Point, fronts, over_submission};
use super::labels::Grid;
use super::metrics::{Kind, Metric, known};
use super::rows::may_lose;
use super::table::{Cell, Column, Table, column, interval, number};
use super::tables::class_word;
use crate::error::{Error, Result, did_you_mean};
use crate::results::RunResult;

/// x and y of the report's first figure, and of `cullmark frontier` unless it is told otherwise.
pub const X: &str = "median_frame_us";
pub const Y: &str = "false_cull_ppm";
/// The other time of the report's table.
const MODELLED: &str = "frame_ms_model";

/// The fronts by two metrics. Without `all`, only what is on a front or within its noise.
pub fn table(grid: &Grid, fronts: &[Front], (x, y): (&Metric, &Metric), all: bool) -> Table {
    let mut columns = vec![Column::text("scene"), Column::text("combination")];
    columns.extend([x, y].map(of));
    let over = y.name == "over_submission";
    if over {
        columns.push(column("over_submission at least", "", "against V_hi: what is not proved hidden"));
    }
    columns.extend(["class", "observed", "standing", "dominated_by", "measurement_id"].map(Column::text));
    let mut table = Table::new("frontier", &format!("{} against {}", x.name, y.name), 2, columns);
    for front in fronts {
        for p in front.points.iter().filter(|p| all || p.by.is_none() || p.standing == super::frontier::Standing::Noise)
        {
            let mut row = vec![Cell::Text(front.place.clone()), named(grid, p.combination)];
            row.extend([spread(x, p.x), spread(y, p.y)]);
            if over {
                row.push(number(over_submission(p.run).and_then(|o| o.0)));
            }
            row.extend(classes(p.run));
            row.extend([Cell::Text(p.standing.word().into()), by(grid, front, p)]);
            row.push(Cell::Text(p.run.measurement_id.clone()));
            table.rows.push(row);
        }
    }
    table
}

/// What is no point, one line a reason: "2 withheld ...: a, b".
pub fn gaps(grid: &Grid, front: &Front) -> Vec<String> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for gap in &front.gaps {
        let name = grid.combinations[gap.combination].as_str();
        match reasons.iter_mut().find(|(why, _)| *why == gap.why) {
            Some((_, names)) => names.push(name),
            None => reasons.push((&gap.why, vec![name])),
        }
    }
    reasons.into_iter().map(|(why, names)| format!("{}: {why}", names.join(", "))).collect()
}

/// For terminals: every scene with its points, then what is none and why.
pub fn text(grid: &Grid, fronts: &[Front], (x, y): (&Metric, &Metric), all: bool) -> String {
    let mut out = String::new();
    for front in fronts {
        let on = front.on_front().count();
        let noise = front.points.iter().filter(|p| p.standing == super::frontier::Standing::Noise).count();
        out += &format!(
            "{}: {} against {}; of {} points {on} on the front, {noise} within its noise, {} dominated\n",
            front.place,
            x.heading(),
            y.heading(),
            front.points.len(),
            front.points.len() - on - noise
        );
        let mut t = table(grid, std::slice::from_ref(front), (x, y), all);
        // The heading names the scene; ids are for programs, short ones for people.
        t.columns.remove(0);
        for row in &mut t.rows {
            row.remove(0);
            if let Some(Cell::Text(id)) = row.last_mut() {
                *id = id.chars().take(12).collect();
            }
        }
        if !t.rows.is_empty() {
            out += &t.terminal();
        }
        for line in gaps(grid, front) {
            out += &format!("no point: {line}\n");
        }
        out.push('\n');
    }
    out
}

/// The fronts of the scenes that are asked for.
///
/// # Errors
/// With the nearest scene there is.
pub fn only<'a>(fronts: Vec<Front<'a>>, scene: &str) -> Result<Vec<Front<'a>>> {
    let names: Vec<String> = fronts.iter().map(|f| f.place.clone()).collect();
    let found: Vec<Front> =
        fronts.into_iter().filter(|f| f.place == scene || f.place.split(" / ").next() == Some(scene)).collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let near = did_you_mean(scene, names.iter().map(String::as_str)).map(|n| format!("did you mean `{n}`?"));
    Err(Error::new(format!("there is no scene `{scene}` in the study"))
        .help(near.unwrap_or_else(|| format!("scenes: {}", names.join(", ")))))
}

/// Every run of the study with both times, its errors and its standings: what the
/// report's figures draw, to be traced point by point.
pub fn report(grid: &Grid) -> Table {
    let (culling, modelled, y) = (known(X), known(MODELLED), known(Y));
    let all = |_: &RunResult| true;
    let by_culling = fronts(grid, culling, y, &all);
    let by_frame = fronts(grid, modelled, y, &all);
    let mut columns = vec![Column::text("scene"), Column::text("combination")];
    columns.push(of(culling).named("median frame, culling"));
    columns.push(Column::text("by culling"));
    columns.push(of(modelled).named("frame, modelled"));
    columns.push(Column::text("by modelled frame"));
    columns.push(column("false-cull pixels", y.unit, y.about));
    columns.push(column("largest hole", "px", known("largest_blob_px").about));
    columns.push(column("over-submission, at least", "", "submitted over triangles not proved invisible"));
    columns.push(column("over-submission, at most", "", "submitted over triangles proved visible"));
    columns.extend(["class", "observed", "measurement"].map(Column::text));
    let mut table = Table::new("frontier", "Run time against error, run by run", 2, columns);
    for (run, names) in grid.named() {
        let over = over_submission(run);
        let mut row = vec![
            Cell::Text(names.place.clone()),
            Cell::Named(names.combination.clone(), grid.look(&names.combination)),
        ];
        row.push(interval(culling.interval(run)));
        row.push(Cell::Text(standing(grid, &by_culling, run)));
        row.push(interval(modelled.interval(run)));
        row.push(Cell::Text(standing(grid, &by_frame, run)));
        row.push(number(y.value(run)));
        row.push(number(known("largest_blob_px").value(run)));
        row.extend([number(over.and_then(|o| o.0)), number(over.map(|o| o.1))]);
        row.extend(classes(run));
        row.push(Cell::Text(run.measurement_id.clone()));
        table.rows.push(row);
    }
    table.caption = "Front: no other run of the scene is as fast and as right. Contested: another may be, within the \
                     95 % intervals over trials. Within noise: behind the front by value, not beyond the intervals. \
                     Dominated: beyond them, by the run that is named. Over-submission lies between both figures; the \
                     lower is known where hidden triangles were proved hidden. Class is declared, observed what the \
                     judged frames show."
        .into();
    table
}

/// "front", "dominated by list × frustum", "wrong ...".
fn standing(grid: &Grid, fronts: &[Front], run: &RunResult) -> String {
    for front in fronts {
        if let Some(p) = front.points.iter().find(|p| std::ptr::eq(p.run, run)) {
            return match p.by {
                Some(by) => format!("{}: {}", p.standing.word(), grid.combinations[front.points[by].combination]),
                None => p.standing.word().into(),
            };
        }
        if let Some(Gap { why, .. }) = front.gaps.iter().find(|g| std::ptr::eq(g.run, run)) {
            return format!("no point: {why}");
        }
    }
    String::new()
}

/// The title and the data attributes of a point in SVG.
pub fn tagged(figure: &mut Figure, grid: &Grid, p: &Point, words: String, draw: impl FnOnce(&mut Figure)) {
    let label = &grid.combinations[p.combination];
    let data = vec![
        ("measurement-id", p.run.measurement_id.clone()),
        ("label", label.clone()),
        ("standing", p.standing.word().into()),
    ];
    figure.tagged(format!("{label}: {words}"), data, draw);
}

fn of(m: &Metric) -> Column {
    let c = column(m.name, m.unit, m.about);
    if matches!(m.kind, Kind::Measured | Kind::Modelled) { c.with_interval() } else { c }
}

fn spread(m: &Metric, s: (f64, f64, f64)) -> Cell {
    if matches!(m.kind, Kind::Measured | Kind::Modelled) { interval(Some(s)) } else { Cell::Number(s.0) }
}

fn named(grid: &Grid, combination: usize) -> Cell {
    Cell::Named(grid.combinations[combination].clone(), grid.legend.entries[combination].look)
}

fn by(grid: &Grid, front: &Front, p: &Point) -> Cell {
    p.by.map_or(Cell::Missing, |by| named(grid, front.points[by].combination))
}

fn classes(run: &RunResult) -> [Cell; 2] {
    let word = |class: Option<crate::culling::Class>| class.map_or(Cell::Missing, |c| Cell::Text(class_word(c).into()));
    let mut declared = word(run.class);
    if let (true, Cell::Text(text)) = (may_lose(run), &mut declared) {
        text.insert_str(0, "† ");
    }
    [declared, word(run.observed)]
}
