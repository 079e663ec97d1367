//! A table for LaTeX: booktabs rules, text in paragraphs so that notes wrap, letters as
//! large as the page allows, turned where it is wide, `longtable` where it is long.

use super::format;
use super::table::{Cell, Column, Table};
use std::fmt::Write;

/// Text wider than this many characters may wrap.
const WORDY: f64 = 16.0;
/// No wrapped column gets narrower than this, in characters.
const NARROW: f64 = 9.0;
/// Text in a column as wide as this reads well.
const FAIR: f64 = 24.0;
/// Points between two columns (`2\tabcolsep`).
const GAP_PT: f64 = 6.0;
/// Mean width of a character, in em: of Computer Modern, rather too much.
const CHARACTER_EM: f64 = 0.53;

/// Sizes of type with their em in points, in an article of 10 pt: small letters are wide.
const SIZES: [(&str, f64); 4] =
    [("\\normalsize", 10.0), ("\\small", 9.3), ("\\footnotesize", 8.5), ("\\scriptsize", 8.0)];
/// Points a character of the last of them.
const SMALLEST: f64 = SIZES[3].1 * CHARACTER_EM;
/// Width and height of the text of an article, in points; rather too little.
const TEXT_PT: (f64, f64) = (340.0, 540.0);
/// Of the distance of rows: those of several lines must not run together.
const STRETCH: f64 = 1.2;
/// Of a page, what a float may take of its height: the rest is for the caption and for rules.
const FLOAT: f64 = 0.75;

/// Characters that a column takes: at least, so that no word is cut, and at best.
struct Room {
    least: f64,
    /// What is still good to read.
    fair: f64,
    best: f64,
}

struct Layout {
    size: &'static str,
    em_pt: f64,
    turned: bool,
    /// Characters of each column.
    widths: Vec<f64>,
}

/// A table with more columns than a page takes becomes several, each with the columns
/// that name the rows.
pub fn of(table: &Table) -> String {
    let parts = groups(table);
    if let [_] = parts[..] {
        return one(table);
    }
    let n = parts.len();
    let part = |(i, columns): (usize, Vec<usize>)| {
        let of = |all: &[Cell]| columns.iter().map(|c| all[*c].clone()).collect();
        one(&Table {
            id: if i == 0 { table.id.clone() } else { format!("{}-{}", table.id, i + 1) },
            title: format!("{} (part {} of {n})", table.title, i + 1),
            caption: if i == 0 { table.caption.clone() } else { String::new() },
            columns: columns.iter().map(|c| table.columns[*c].clone()).collect(),
            heads: table.heads,
            rows: table.rows.iter().map(|r| of(r)).collect(),
        })
    };
    parts.into_iter().enumerate().map(part).collect::<Vec<_>>().join("\n")
}

/// Columns of each part: as many as fit a turned page in the smallest type.
fn groups(table: &Table) -> Vec<Vec<usize>> {
    let heads: Vec<usize> = (0..table.heads.min(table.columns.len())).collect();
    let width = |columns: &[usize]| columns.iter().map(|c| room(table, *c).least * SMALLEST + GAP_PT).sum::<f64>();
    let mut out = vec![heads.clone()];
    for c in table.heads..table.columns.len() {
        let last = out.last_mut().expect("at least the heads");
        if last.len() > heads.len() && width(last) + width(&[c]) > TEXT_PT.1 {
            out.push(heads.clone());
        }
        out.last_mut().expect("at least the heads").push(c);
    }
    out
}

fn one(table: &Table) -> String {
    let rooms: Vec<Room> = (0..table.columns.len()).map(|c| room(table, c)).collect();
    let layout = layout(&rooms);
    let long = height_pt(table, &layout) > FLOAT * if layout.turned { TEXT_PT.0 } else { TEXT_PT.1 };
    let mut packages = vec!["array", "booktabs"];
    packages.extend(long.then_some("longtable"));
    packages.extend(layout.turned.then_some("pdflscape"));
    let mut out = format!("% needs \\usepackage{{{}}}\n", packages.join("} \\usepackage{"));
    let open = |out: &mut String, what: &str| *out += &format!("\\begin{{{what}}}\n");
    let close = |out: &mut String, what: &str| *out += &format!("\\end{{{what}}}\n");
    if layout.turned {
        open(&mut out, "landscape");
    }
    let (outer, inner) = if long { ("", "longtable") } else { ("table", "tabular") };
    let spec: String = table.columns.iter().zip(&layout.widths).map(|(c, w)| align(c, *w)).collect();
    let caption = format!("\\caption{}\\label{{tab:{}}}", caption(table), table.id);
    let heading = line(table.columns.iter().map(|c| breakable(&format::latex(&c.heading()))));
    let dress = format!(
        "{}\\setlength{{\\tabcolsep}}{{{}pt}}\\renewcommand{{\\arraystretch}}{{{STRETCH}}}",
        layout.size,
        GAP_PT / 2.0
    );
    if long {
        // Size and gap must not leave this table.
        let _ = writeln!(out, "\\begingroup\n{dress}\n\\setlength{{\\LTcapwidth}}{{\\linewidth}}");
        let _ =
            writeln!(out, "\\begin{{{inner}}}{{{spec}}}\n{caption}\\\\\n\\toprule\n{heading}\\midrule\n\\endfirsthead");
        let _ = writeln!(out, "\\toprule\n{heading}\\midrule\n\\endhead\n\\bottomrule\n\\endfoot");
    } else {
        open(&mut out, outer);
        let _ = writeln!(out, "\\centering\n{caption}\n{dress}");
        let _ = writeln!(out, "\\begin{{{inner}}}{{{spec}}}\n\\toprule\n{heading}\\midrule");
    }
    for row in &table.rows {
        out += &line(row.iter().map(cell));
    }
    if long {
        close(&mut out, inner);
        out += "\\endgroup\n";
    } else {
        out += "\\bottomrule\n";
        close(&mut out, inner);
        close(&mut out, outer);
    }
    if layout.turned {
        close(&mut out, "landscape");
    }
    out
}

/// Of all rows, as far as they can be told from numbers of characters.
fn height_pt(table: &Table, layout: &Layout) -> f64 {
    let lines = |(cell, width): (&Cell, &f64)| (cell.show().chars().count() as f64 / width).ceil();
    let rows = table.rows.iter().map(|r| r.iter().zip(&layout.widths).map(lines).fold(1.0, f64::max));
    1.2 * STRETCH * layout.em_pt * rows.sum::<f64>()
}

/// The title goes to the list of tables, the notes below it do not.
fn caption(table: &Table) -> String {
    let title = format::latex(&table.title);
    if table.caption.is_empty() {
        format!("{{{title}}}")
    } else {
        format!("[{{{title}}}]{{{title}. {}}}", format::latex(&table.caption))
    }
}

fn line(cells: impl Iterator<Item = String>) -> String {
    format!("{} \\\\\n", cells.collect::<Vec<_>>().join(" & "))
}

/// Every column is a paragraph of its width: headings wrap, too.
fn align(column: &Column, characters: f64) -> String {
    let side = if column.numeric { "\\raggedleft" } else { "\\raggedright" };
    format!(">{{{side}\\arraybackslash}}p{{{:.2}em}}", characters * CHARACTER_EM)
}

/// The two ends of an interval stay together, below its value if they must.
fn cell(cell: &Cell) -> String {
    let text = breakable(&format::latex(&cell.show()));
    if matches!(cell, Cell::Interval(..)) { text.replace(", ", ",~") } else { text }
}

/// Names of combinations have no spaces: they may break after a sign.
fn breakable(latex: &str) -> String {
    let mut out = String::with_capacity(latex.len());
    for (i, c) in latex.char_indices() {
        out.push(c);
        let inner = latex[i + c.len_utf8()..].starts_with(|n: char| n.is_alphanumeric() || n == '\\');
        if matches!(c, ':' | ',' | '+' | '_' | '=' | '/') && inner {
            out += "\\allowbreak{}";
        }
    }
    out
}

/// Pieces of a text that do not break.
fn pieces(text: &str) -> impl Iterator<Item = f64> + '_ {
    text.split_inclusive([' ', '-', ':', ',', '+', '_', '=', '/']).map(|p| p.trim_end().chars().count() as f64)
}

/// As [`cell`] breaks it.
fn shown(cell: &Cell) -> String {
    let text = cell.show();
    if matches!(cell, Cell::Interval(..)) { text.replace(", ", ".\u{A0}") } else { text }
}

fn room(table: &Table, c: usize) -> Room {
    let column = &table.columns[c];
    let heading = column.heading();
    let cells: Vec<String> = table.rows.iter().map(|r| shown(&r[c])).collect();
    let longest = |of: &dyn Fn(&str) -> f64| cells.iter().map(|t| of(t)).fold(0.0, f64::max);
    let whole = longest(&|t| t.chars().count() as f64);
    let piece = |t: &str| pieces(t).fold(1.0, f64::max);
    let unbroken = piece(&heading).max(longest(&piece));
    // A heading of few words keeps to few lines; an interval may go below its value.
    let best = whole.max(unbroken).max((heading.chars().count() as f64 / 3.0).ceil());
    let least = match column.numeric {
        true => unbroken,
        false if whole <= WORDY => best,
        false => unbroken.max(NARROW),
    };
    Room { least, fair: if column.numeric { least } else { FAIR }, best }
}

/// The largest type in which all fits, upright if it can be.
fn layout(rooms: &[Room]) -> Layout {
    let gaps = GAP_PT * rooms.len() as f64;
    let mut choices = [TEXT_PT.0, TEXT_PT.1].into_iter().enumerate().flat_map(|(t, w)| SIZES.map(|s| (t == 1, w, s)));
    let characters = |width: f64, pt: f64| (width - gaps) / (pt * CHARACTER_EM);
    let least: f64 = rooms.iter().map(|r| r.least).sum();
    // Notes wrap, but not into a column of single words: rather in smaller type.
    let fair: f64 = rooms.iter().map(|r| r.least.max(r.best.min(r.fair))).sum();
    let found = choices.find(|(_, w, (_, pt))| fair <= characters(*w, *pt));
    let (turned, width, (size, em_pt)) = found.unwrap_or((true, TEXT_PT.1, SIZES[3]));
    let free = (characters(width, em_pt) - least).max(0.0);
    // What is left goes to whoever lacks most.
    let lacking: f64 = rooms.iter().map(|r| r.best - r.least).sum();
    let share = if lacking > 0.0 { (free / lacking).min(1.0) } else { 0.0 };
    Layout { size, em_pt, turned, widths: rooms.iter().map(|r| r.least + share * (r.best - r.least)).collect() }
}

#[cfg(test)]
mod tests {
    use super::super::table::column;
    use super::*;

    fn table(rows: usize, note: &str) -> Table {
        let columns = vec![Column::text("combination"), column("frame, modelled", "ms", ""), Column::text("note")];
        let mut table = Table::new("t", "A & B", 1, columns);
        let row = vec![
            Cell::Text("octree:depth=4 × frustum †".into()),
            Cell::Interval(1.0, 0.5, 1.5),
            Cell::Text(note.into()),
        ];
        table.rows = vec![row; rows];
        table
    }

    #[test]
    fn a_short_table_floats_and_a_long_one_breaks_over_pages() {
        let (short, long) = (of(&table(3, "")), of(&table(816, "")));
        assert!(short.starts_with("% needs \\usepackage{array} \\usepackage{booktabs}\n"), "{short}");
        assert!(short.contains("\\begin{table}") && !short.contains("longtable"));
        let first = long.lines().next().unwrap();
        assert!(first.contains("{longtable}") && !long.contains("\\begin{table}"), "{first}");
        assert!(long.contains("\\endfirsthead") && long.contains("\\endhead"));
        for text in [short, long] {
            assert!(text.contains("\\dag{}") && !text.contains('†') && !text.contains('×'), "{text}");
            let ends = |what: &str| text.matches(&format!("\\{what}{{")).count();
            assert_eq!(ends("begin"), ends("end"), "{text}");
        }
    }

    #[test]
    fn notes_wrap_and_wide_tables_are_turned() {
        let note = "measured: octree:depth=4 against bsp; ".repeat(8);
        let text = of(&table(3, &note));
        assert!(!text.contains("longtable"), "{text}");
        // Few rows of long notes are higher than a page, too.
        assert!(of(&table(3, &note.repeat(20))).contains("longtable"));
        let spec = text.lines().find(|l| l.starts_with("\\begin{tabular}")).unwrap();
        assert_eq!(spec.matches("p{").count(), 3, "{spec}");
        let mut wide = table(3, "x");
        for row in &mut wide.rows {
            row.extend(vec![Cell::Interval(123.4, 111.1, 222.2); 8]);
        }
        wide.columns.extend(vec![column("frame, modelled", "ms", ""); 8]);
        let text = of(&wide);
        assert!(text.lines().next().unwrap().contains("pdflscape") && text.contains("\\begin{landscape}"), "{text}");
    }

    #[test]
    fn a_table_too_wide_for_any_page_comes_in_parts_that_name_their_rows() {
        let mut wide = table(100, "x");
        wide.heads = 1;
        for row in &mut wide.rows {
            row.extend(vec![Cell::Interval(123.4, 111.1, 222.2); 30]);
        }
        wide.columns.extend(vec![column("frame, modelled", "ms", ""); 30]);
        let text = of(&wide);
        let parts = text.matches("\\begin{longtable}").count();
        assert!(
            parts > 1 && text.contains(&format!("(part {parts} of {parts})")) && text.contains("tab:t-2"),
            "{parts}"
        );
        assert_eq!(text.matches("octree:").count(), 100 * parts, "every part names its rows");
        let columns: usize = groups(&wide).iter().map(|g| g.len() - 1).sum();
        assert_eq!(columns, wide.columns.len() - 1, "none is lost, none comes twice");
    }

    #[test]
    fn names_break_after_signs_only_where_more_of_them_follows() {
        assert_eq!(breakable("a:b=4+c, d"), "a:\\allowbreak{}b=\\allowbreak{}4+\\allowbreak{}c, d");
    }
}
