//! From the results of a study to charts, tables and one page.
//!
//! ```text
//! StudyResults -> Grid (places x combinations) -> Figure -> SVG, PNG
//!                                              -> Table  -> HTML, CSV, Markdown, LaTeX
//!              -> verdicts, findings           -> index.html
//! ```
//! Same results, same bytes: nothing here reads a clock, and every bootstrap has a stated seed.

mod best;
pub mod charts;
pub mod claims;
pub mod columns;
pub mod compare;
pub mod consolidate;
pub mod correlation;
pub mod curves;
pub mod facets;
pub mod facts;
pub mod fields;
pub mod figure;
pub mod filter;
pub mod findings;
pub mod font;
pub mod forest;
pub mod format;
pub mod frontier;
pub mod frontier_table;
pub mod knobs;
pub mod labels;
pub mod metrics;
pub mod occlusion;
pub mod over_frames;
mod own_value;
pub mod page;
mod pairs;
pub mod pareto;
pub mod query;
pub mod raster;
pub mod rates;
pub mod regret;
pub mod render;
pub mod repeatability;
pub mod repeatability_tables;
pub mod rows;
pub mod scale;
pub mod scatter;
pub mod select;
pub mod style;
pub mod sweep_chart;
pub mod sweep_tables;
pub mod sweeps;
pub mod table;
mod table_latex;
pub mod tables;
pub mod virtual_clock;

use crate::claim::Claim;
use crate::error::{Error, Result};
use crate::results::{Measured, StudyResults};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// What [`write`] wrote.
#[derive(Debug)]
pub struct Files {
    pub page: PathBuf,
    pub charts: Vec<PathBuf>,
    pub tables: Vec<PathBuf>,
}

impl Files {
    pub fn all(&self) -> Vec<PathBuf> {
        self.charts.iter().chain(&self.tables).chain([&self.page]).cloned().collect()
    }
}

/// Writes `index.html`, `charts/*.{svg,png}` and `tables/*.{csv,md,tex}` below `out_dir`.
///
/// # Errors
/// When a file cannot be written; names it.
pub fn write(results: &StudyResults, claims: &[Claim], out_dir: &Path) -> Result<Files> {
    write_with_series(results, claims, &[], out_dir)
}

/// As [`write`], with what all measurements of the study say together.
///
/// # Errors
/// As [`write`].
pub fn write_with_series(
    results: &StudyResults,
    claims: &[Claim],
    series: &[Measured],
    out_dir: &Path,
) -> Result<Files> {
    let grid = labels::Grid::of(results);
    let judged = claims::judge_all(results, claims);
    let mut figures = charts::all(&grid, &judged);
    let sweeps: Vec<_> = results.sweeps.iter().map(|s| sweeps::chart(results, s)).collect();
    figures.extend(sweeps.iter().flatten().map(sweep_chart::draw));
    let again = (series.len() > 1).then(|| repeatability::of(series));
    let mut tables = vec![
        findings::best_table(&grid),
        tables::times(&grid),
        rates::best_table(&grid),
        rates::all(&grid),
        tables::memory(&grid),
        tables::build(&grid),
        tables::scenes(results),
        frontier_table::report(&grid),
        regret::table(&grid),
        tables::errors(&grid),
        tables::problems(&grid),
        tables::excluded(results),
        tables::claims(&judged),
        tables::environments(results),
    ];
    for chart in sweeps.iter().flatten() {
        tables.push(sweep_tables::points(chart));
        tables.extend(chart.against.is_none().then(|| sweep_tables::slopes(chart)));
    }
    if let Some(again) = &again {
        use repeatability_tables::{agreements, differences, readings};
        tables.extend([agreements(again), differences(again), readings(again)]);
    }
    let mut files = Files { page: out_dir.join("index.html"), charts: Vec::new(), tables: Vec::new() };
    let mut inline = Vec::new();
    let base = out_dir.join("charts");
    let drawn = figures.par_iter().map(|figure| {
        let svg = save(&base.join(format!("{}.svg", figure.id)), render::svg(figure, true)?.as_bytes())?;
        let png = save(&base.join(format!("{}.png", figure.id)), &raster::png(figure)?)?;
        Ok(([svg, png], render::svg(figure, false)?))
    });
    for (paths, svg) in drawn.collect::<Result<Vec<_>>>()? {
        files.charts.extend(paths);
        inline.push(svg);
    }
    for table in tables.iter().filter(|t| !t.rows.is_empty()) {
        let base = out_dir.join("tables");
        for (suffix, text) in [("csv", table.csv()), ("md", table.markdown()), ("tex", table.latex())] {
            files.tables.push(save(&base.join(format!("{}.{suffix}", table.id)), text.as_bytes())?);
        }
    }
    let page = page::document(&page::Content {
        grid: &grid,
        judged: &judged,
        figures: &figures,
        svgs: &inline,
        tables: &tables,
        sweeps: &sweeps,
        again: again.as_ref(),
    });
    save(&files.page, page.as_bytes())?;
    Ok(files)
}

fn save(path: &Path, bytes: &[u8]) -> Result<PathBuf> {
    let write = || -> std::io::Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::write(path, bytes)
    };
    write().map_err(|e| {
        Error::io(path, "cannot write the report", &e).help("choose another folder with --out, or free some space")
    })?;
    Ok(path.to_path_buf())
}
