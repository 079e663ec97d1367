//! Reports from synthetic results: every status, several scenes, replicated noise.

#[path = "report/fixture.rs"]
mod fixture;

use cullmark::report;

#[test]
fn a_report_is_one_page_with_charts_and_tables() {
    let dir = std::env::var_os("CULLMARK_REPORT_DIR").map(std::path::PathBuf::from);
    let temp = tempfile::tempdir().unwrap();
    let out = dir.as_deref().unwrap_or(temp.path());
    let files = report::write(&fixture::study(), &fixture::claims(), out).unwrap();
    assert!(files.page.exists() && files.charts.len() >= 16 && files.tables.len() >= 18, "{files:?}");
}
