//! One table, four ways out: HTML, CSV, Markdown, LaTeX (booktabs).

use super::format;
use super::render;
use super::style::Look;
use crate::results::RunStatus;

#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    Text(String),
    /// A combination with its look in the charts.
    Named(String, Look),
    Number(f64),
    /// Value, ends of its 95 % interval.
    Interval(f64, f64, f64),
    Status(RunStatus),
    Missing,
}

#[derive(Debug, Clone)]
pub struct Column {
    pub name: String,
    pub unit: String,
    pub about: String,
    pub numeric: bool,
    /// CSV gets two more columns, with the ends.
    pub interval: bool,
}

pub fn column(name: &str, unit: &str, about: &str) -> Column {
    Column { name: name.into(), unit: unit.into(), about: about.into(), numeric: true, interval: false }
}

impl Column {
    pub fn text(name: &str) -> Column {
        Column { numeric: false, ..column(name, "", "") }
    }

    pub fn named(mut self, name: &str) -> Column {
        self.name = name.into();
        self
    }

    pub fn with_interval(mut self) -> Column {
        self.interval = true;
        self
    }

    pub(super) fn heading(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }
}

#[derive(Debug, Clone)]
pub struct Table {
    pub id: String,
    pub title: String,
    pub caption: String,
    pub columns: Vec<Column>,
    /// Leading columns that name the row.
    pub heads: usize,
    pub rows: Vec<Vec<Cell>>,
}

pub fn number(value: Option<f64>) -> Cell {
    value.map_or(Cell::Missing, Cell::Number)
}

pub fn interval(value: Option<(f64, f64, f64)>) -> Cell {
    value.map_or(Cell::Missing, |(v, low, high)| Cell::Interval(v, low, high))
}

impl Cell {
    /// For people.
    pub fn show(&self) -> String {
        match self {
            Cell::Text(t) | Cell::Named(t, _) => t.clone(),
            Cell::Number(x) => format::number(*x, 3),
            Cell::Interval(v, low, high) => format::interval(*v, *low, *high),
            Cell::Status(s) => s.word().into(),
            Cell::Missing => "–".into(),
        }
    }

    /// For programs: all digits, nothing grouped; empty where there is none.
    fn raw(&self, interval: bool) -> Vec<String> {
        let plain = |x: f64| if x.is_finite() { format!("{x}") } else { String::new() };
        let mut fields = match self {
            Cell::Text(t) | Cell::Named(t, _) => vec![t.clone()],
            Cell::Number(x) => vec![plain(*x)],
            Cell::Interval(v, low, high) => vec![plain(*v), plain(*low), plain(*high)],
            Cell::Status(s) => vec![s.word().into()],
            Cell::Missing => vec![String::new()],
        };
        fields.resize(if interval { 3 } else { 1 }, String::new());
        fields
    }
}

impl Table {
    pub fn new(id: &str, title: &str, heads: usize, columns: Vec<Column>) -> Table {
        Table { id: id.into(), title: title.into(), caption: String::new(), columns, heads, rows: Vec::new() }
    }

    pub fn csv(&self) -> String {
        let mut heading = Vec::new();
        for c in &self.columns {
            let unit = if c.unit.is_empty() { String::new() } else { format!(" ({})", c.unit) };
            heading.push(format!("{}{unit}", c.name));
            if c.interval {
                heading.push(format!("{} low{unit}", c.name));
                heading.push(format!("{} high{unit}", c.name));
            }
        }
        let mut out = csv_line(&heading);
        for row in &self.rows {
            let fields: Vec<String> =
                row.iter().zip(&self.columns).flat_map(|(cell, c)| cell.raw(c.interval)).collect();
            out += &csv_line(&fields);
        }
        out
    }

    pub fn markdown(&self) -> String {
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut out = format!("**{}**\n\n", format::markdown(&self.title));
        out += &line(self.columns.iter().map(|c| format::markdown(&c.heading())).collect());
        out += &line(self.columns.iter().map(|c| if c.numeric { "---:".into() } else { ":---".into() }).collect());
        for row in &self.rows {
            out += &line(row.iter().map(|c| format::markdown(&c.show())).collect());
        }
        if !self.caption.is_empty() {
            out += &format!("\n{}\n", format::markdown(&self.caption));
        }
        out
    }

    pub fn latex(&self) -> String {
        super::table_latex::of(self)
    }

    pub fn html(&self) -> String {
        let mut out = format!(
            "<div class=\"scroll rows\" tabindex=\"0\" role=\"region\" aria-labelledby=\"t-{id}\"><table>\n<caption id=\"t-{id}\">{}</caption>\n<thead><tr>",
            format::html(&self.title),
            id = self.id,
        );
        for c in &self.columns {
            let about =
                if c.about.is_empty() { String::new() } else { format!(" title=\"{}\"", format::html(&c.about)) };
            let class = if c.numeric { " class=\"n\"" } else { "" };
            // Value and interval are columns of their own, so that values align.
            let (span, unit) = (if c.interval { " colspan=\"2\"" } else { "" }, format::html(&c.unit));
            let unit = if unit.is_empty() { unit } else { format!(" <span class=\"unit\">{unit}</span>") };
            let class = if c.interval { " class=\"i\"" } else { class };
            out += &format!("<th scope=\"col\"{class}{span}{about}>{}{unit}</th>", format::html(&c.name));
        }
        out += "</tr></thead>\n<tbody>\n";
        for row in &self.rows {
            out += "<tr>";
            for (i, (cell, c)) in row.iter().zip(&self.columns).enumerate() {
                out += &html_cell(cell, c, i < self.heads);
            }
            out += "</tr>\n";
        }
        out += "</tbody></table></div>\n";
        if !self.caption.is_empty() {
            out += &format!("<p class=\"note\">{}</p>\n", format::html(&self.caption));
        }
        out
    }

    /// Columns padded with spaces, for a terminal.
    pub fn terminal(&self) -> String {
        let mut lines = vec![self.columns.iter().map(Column::heading).collect::<Vec<_>>()];
        lines.extend(self.rows.iter().map(|r| r.iter().map(Cell::show).collect()));
        let width = |c: usize| lines.iter().map(|l| l[c].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let mut out = String::new();
        for (i, line) in lines.iter().enumerate() {
            let cells = line.iter().zip(&widths).zip(&self.columns).map(|((text, w), c)| {
                let pad = " ".repeat(w - text.chars().count());
                if c.numeric { format!("{pad}{text}") } else { format!("{text}{pad}") }
            });
            out += cells.collect::<Vec<_>>().join("  ").trim_end();
            out.push('\n');
            if i == 0 {
                out += &widths.iter().map(|w| "─".repeat(*w)).collect::<Vec<_>>().join("  ");
                out.push('\n');
            }
        }
        out
    }
}

/// One table cell, or two for a value with its interval.
fn html_cell(cell: &Cell, column: &Column, head: bool) -> String {
    let text = match cell {
        Cell::Status(s) => format!("<span class=\"s {0}\">{0}</span>", s.word()),
        Cell::Named(t, look) => format!("{}{}", render::swatch(*look), format::html(t)),
        Cell::Interval(v, ..) => format::number(*v, 3),
        other => format::html(&other.show()),
    };
    if head {
        return format!("<th scope=\"row\">{text}</th>");
    }
    let class = match cell {
        // Reasons wrap; names and numbers do not.
        Cell::Text(t) if t.chars().count() > 34 => " class=\"t\"",
        _ if column.numeric => " class=\"n\"",
        _ => "",
    };
    let mut out = format!("<td{class}>{text}</td>");
    if column.interval {
        let ends = match cell {
            Cell::Interval(_, low, high) if low != high => {
                format!("[{}, {}]", format::number(*low, 3), format::number(*high, 3))
            }
            _ => String::new(),
        };
        out += &format!("<td class=\"ci\">{ends}</td>");
    }
    out
}

fn csv_line(fields: &[String]) -> String {
    let escaped: Vec<String> = fields.iter().map(|f| format::csv(f)).collect();
    escaped.join(",") + "\n"
}
