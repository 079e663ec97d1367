//! Reports from synthetic results: every status, several scenes, replicated noise.

#[path = "report/axes.rs"]
mod axes;
#[path = "report/best.rs"]
mod best;
#[path = "report/columns.rs"]
mod columns;
#[path = "report/fixture.rs"]
mod fixture;
#[path = "report/frontier.rs"]
mod frontier;
#[path = "report/own_values.rs"]
mod own_values;
#[path = "report/rates.rs"]
mod rates;
#[path = "report/regret.rs"]
mod regret;
#[path = "report/repeatability.rs"]
mod repeatability;
#[path = "report/sweeps.rs"]
mod sweeps;
#[path = "report/verdicts.rs"]
mod verdicts;
#[path = "report/xml.rs"]
mod xml;

use cullmark::claim::Relation;
use cullmark::report::claims::{Verdict, judge};
use cullmark::report::compare::{Change, PAIRED, compare};
use cullmark::report::fields::Fields;
use cullmark::report::figure::{Figure, Part};
use cullmark::report::filter::Filter;
use cullmark::report::labels::Grid;
use cullmark::report::metrics::known;
use cullmark::report::query::{Format, Query, print, query};
use cullmark::report::{self, charts, claims, raster, render, tables};
use cullmark::results::{RunStatus, StudyResults};
use std::path::Path;

/// Set to a folder, this also writes the report of a study as large as a real one there.
const KEEP: &str = "CULLMARK_REPORT_DIR";

fn figures(results: &StudyResults) -> Vec<Figure> {
    let published = fixture::claims();
    charts::all(&Grid::of(results), &claims::judge_all(results, &published))
}

#[test]
fn a_report_is_one_page_with_charts_and_tables_and_the_same_bytes_again() {
    if let Some(dir) = std::env::var_os(KEEP) {
        report::write(&fixture::large(), &fixture::claims(), Path::new(&dir)).unwrap();
        report::write(&fixture::wide(&fixture::SCENES[..6], 400, 5), &fixture::claims(), &Path::new(&dir).join("wide"))
            .unwrap();
    }
    let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    // Small and pale: PNGs of a debug build are slow.
    let mut results = fixture::sized(&fixture::SCENES[..1], 60, 3);
    results.title = "A <script>alert('x')</script> & \"quotes\"".into();
    let files = report::write(&results, &fixture::claims(), a.path()).unwrap();
    report::write(&results, &fixture::claims(), b.path()).unwrap();
    assert_eq!(files.charts.len(), 22, "{:?}", files.charts);
    for file in files.charts.iter().chain(&files.tables).chain([&files.page]) {
        let other = b.path().join(file.strip_prefix(a.path()).unwrap());
        assert!(std::fs::read(file).unwrap() == std::fs::read(&other).unwrap(), "{} differs", file.display());
    }

    let page = std::fs::read_to_string(&files.page).unwrap();
    assert!(page.contains("A &lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt; &amp; &quot;quotes&quot;"));
    assert!(!page.contains("<script"), "the page runs nothing");
    // Nothing is loaded: every address is a place in the page or a file beside it.
    for (i, _) in page.match_indices("http") {
        let around = &page[i.saturating_sub(40)..i + 30];
        assert!(around.contains("xmlns=") || around.contains("http-equiv"), "{around}");
    }
    for id in ["findings", "claims-section", "gaps", "times-section", "rates-section", "errors-section", "methods"] {
        assert!(page.contains(&format!("<section id=\"{id}\"")), "{id}");
    }
    for words in
        ["timed out after 30 s in trial 2", "3 false culls of a conservative method", "scope=\"row\"", "<caption"]
    {
        assert!(page.contains(words), "{words}");
    }
}

#[test]
fn svgs_are_xml_and_name_every_scene_and_combination() {
    let results = fixture::study();
    let grid = Grid::of(&results);
    for figure in figures(&results) {
        let svg = render::svg(&figure, true).unwrap();
        let texts = xml::texts(&svg).unwrap_or_else(|e| panic!("{}: {e}", figure.id));
        for place in &grid.places {
            assert!(texts.iter().any(|t| t == place), "{} lacks {place}", figure.id);
        }
        // Of claims, and of the best of each scene alone.
        if !["claims", "triangles-against-time"].contains(&figure.id.as_str()) {
            // By its whole label, or by its structure and its culling.
            let has = |name: &str| texts.iter().any(|t| t == name);
            for (label, entry) in grid.combinations.iter().zip(&grid.legend.entries) {
                let culling = label.rsplit(" × ").next().unwrap();
                let named = has(label) || has(&grid.legend.variants[entry.variant]) && has(culling);
                assert!(named, "{} lacks {label}", figure.id);
            }
        }
        assert!(!figure.description.is_empty() && !figure.caption.is_empty(), "{}", figure.id);
    }
}

#[test]
fn nothing_overlaps_with_seven_scenes_and_twelve_combinations() {
    nothing_overlaps(&fixture::sized(&fixture::SCENES, 60, 2));
}

#[test]
fn a_hundred_combinations_are_not_all_drawn_where_nobody_could_tell_them_apart() {
    let results = fixture::wide(&fixture::SCENES[..2], 60, 2);
    nothing_overlaps(&results);
    let drawn = figures(&results);
    let named = |id: &str| {
        let figure = drawn.iter().find(|f| f.id == id).unwrap_or_else(|| panic!("no {id}"));
        let texts = xml::texts(&render::svg(figure, true).unwrap()).unwrap();
        let labels = &Grid::of(&results).combinations;
        (figure, labels.iter().filter(|l| texts.contains(l)).count())
    };
    // Six of each scene, the same in both.
    for id in ["time-per-frame", "triangles-per-frame"] {
        let (figure, names) = named(id);
        assert!((6..=12).contains(&names) && figure.caption.contains("Of 128 combinations the 6"), "{id}: {names}");
    }
    for id in ["time-against-error", "time-against-over-submission"] {
        let (figure, names) = named(id);
        let texts = xml::texts(&render::svg(figure, true).unwrap()).unwrap();
        let family = ["list", "octree", "bsp"].iter().any(|f| texts.iter().any(|t| t == f));
        assert!((1..=12).contains(&names) && family, "{id}: at most six of each front are named: {names}");
    }
    assert_eq!(named("total-time").1, 128, "rows have room for everybody");
    let results = fixture::wide(&fixture::SCENES[..1], 20, 2);
    let folder = tempfile::tempdir().unwrap();
    let page = std::fs::read_to_string(report::write(&results, &[], folder.path()).unwrap().page).unwrap();
    let folded = page.find("<details class=\"tall\">").expect("tall charts are folded");
    assert!(page[folded..].starts_with("<details class=\"tall\"><summary>Total frame time"), "with their titles");
    assert!(page.contains("<summary>All 128 runs, the fastest of each scene first</summary>"));
}

fn nothing_overlaps(results: &StudyResults) {
    for figure in figures(results) {
        let of = |part: Part| figure.boxes.iter().filter(move |(p, _)| *p == part).map(|(_, r)| *r);
        for legend in of(Part::Legend) {
            assert!(of(Part::Plot).all(|plot| !plot.overlaps(&legend)), "{}: the legend covers data", figure.id);
        }
        let labels: Vec<_> = of(Part::Label).collect();
        for (i, a) in labels.iter().enumerate() {
            assert!(
                a.x >= 0.0 && a.right() <= figure.width && a.bottom() <= figure.height,
                "{}: {a:?} is cut",
                figure.id
            );
            for b in &labels[..i] {
                assert!(!a.overlaps(b), "{}: labels at {a:?} and {b:?} overlap", figure.id);
            }
        }
    }
}

#[test]
fn a_png_can_be_decoded_and_shows_something() {
    let results = fixture::sized(&fixture::SCENES[..1], 40, 2);
    let figure = &figures(&results)[0];
    let bytes = raster::png(figure).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(info.width as f64, 2.0 * figure.width.ceil());
    let inked = pixels.chunks(3).filter(|p| p.iter().any(|c| *c < 200)).count();
    let total = pixels.len() / 3;
    assert!(inked > total / 200 && inked < total / 2, "{inked} of {total} pixels are inked");
}

#[test]
fn missing_failed_and_wrong_are_told_apart_everywhere() {
    let results = fixture::study();
    let grid = Grid::of(&results);
    let svg = render::svg(&figures(&results)[0], true).unwrap();
    for words in ["failed", "wrong: withheld", "pending", "not in the matrix"] {
        assert!(xml::texts(&svg).unwrap().iter().any(|t| t == words), "{words}");
    }
    let csv = tables::times(&grid).csv();
    let row = |scene: &str, label: &str| {
        csv.lines()
            .find(|l| l.starts_with(&format!("{scene},{label},")))
            .unwrap_or_else(|| panic!("no {label}:\n{csv}"))
    };
    assert!(row("nucleus", "octree:depth=4 × normal_mask").contains(",failed,,,"));
    assert!(row("nucleus", "bsp:min_leaf=200 × normal_mask").contains(",wrong,,,"));
    assert!(row("ravine", "bsp:min_leaf=200 × frustum+octant_mask").contains(",pending,,,"));
    assert!(row("nucleus", "list × frustum").contains("1 noisy trial"));
    assert!(tables::problems(&grid).markdown().contains("timed out after 30 s"));
}

#[test]
fn times_of_a_wrong_run_are_withheld_even_if_they_are_there() {
    let mut run = fixture::run("nucleus", 2e4, "list", "frustum", 30, 2, 1);
    assert!(known("total_cull_ms").value(&run).is_some());
    run.status = RunStatus::Wrong;
    assert_eq!(known("total_cull_ms").value(&run), None);
    assert_eq!(known("frame_ms_model").value(&run), None);
    assert!(known("false_culls").value(&run).is_some(), "its errors are shown");
}

#[test]
fn the_modelled_frame_is_culling_plus_indices_plus_calls() {
    let run = fixture::run("nucleus", 2e4, "list", "frustum", 10, 1, 1);
    let by_hand: f64 =
        (0..10).map(|f| run.trial_cull_ns[0][f] + 0.32 * 3.0 * run.triangles[f] + 430.0 * run.draw_calls[f]).sum();
    let found = known("frame_ms_model").value(&run).unwrap();
    assert!((found - by_hand / 10.0 / 1e6).abs() < 1e-12, "{found}");
}

#[test]
fn filters_select_what_they_say() {
    let results = fixture::study();
    let fields = Fields::of(&results);
    let count = |text: &str| {
        let filter = Filter::parse(text, &fields).unwrap_or_else(|e| panic!("{text}: {e}"));
        results.runs.iter().filter(|r| filter.matches(r, &fields)).count()
    };
    let all = results.runs.len();
    assert_eq!(all, 35);
    for (text, expected) in [
        ("scene = nucleus", 12),
        ("scene=nucleus and structure=octree", 4),
        ("structure = octree and depth >= 4 and culling in (frustum, none) or scene = nucleus", 4 + 12),
        ("(scene = nucleus or scene = ravine) and structure = bsp", 4 + 3),
        ("scene = nucleus or scene = ravine and structure = bsp", 12 + 3),
        ("not scene = nucleus", all - 12),
        ("scene != nucleus", all - 12),
        ("scene in (nucleus, 'ravine')", 12 + 11),
        ("scene not in (nucleus, ravine)", 12),
        ("culling = frustum+*", 9 + 9),
        ("culling = octant_mask+frustum", 9),
        ("depth = 3..5", 12),
        ("depth = 5..9", 0),
        ("depth in 4..4", 12),
        ("depth != 3..5", 0),
        ("octree.depth == 4", 12),
        ("min_leaf > 100", 11),
        ("structure = 'octree:depth>=4'", 12),
        ("status = wrong", 1),
        ("status in (failed, pending)", 2),
        ("class = approximate and false_culls > 0", 8),
        ("total_cull_ms >= 0", all - 3),
        ("scene = coal_*", 12),
        ("NOT (scene = nucleus OR scene = ravine)", 12),
    ] {
        assert_eq!(count(text), expected, "{text}");
    }
}

#[test]
fn a_mistaken_filter_is_answered_with_place_and_suggestion() {
    let results = fixture::study();
    let fields = Fields::of(&results);
    for (text, column, words) in [
        ("scen = nucleus", 1, "did you mean `scene`"),
        ("scene = nucleus and dept >= 4", 21, "did you mean `depth`"),
        ("scene nucleus", 7, "expected =, !="),
        ("scene = ", 9, "expected a value"),
        ("(scene = nucleus", 17, "expected )"),
        ("scene = nucleus)", 16, "there is no ( for this )"),
        ("scene in (a b)", 13, "expected , or )"),
        ("scene = 'nucleus", 9, "never closed"),
        ("scene > nucleus", 7, "has no order"),
        ("total_cull_ms < fast", 15, "is a number"),
        ("depth > 3..5", 7, "a range goes with"),
        ("scene = a & b", 11, "does not belong here"),
        ("", 1, "expected the name of a field"),
        ("scene = a scene = b", 11, "expected `and`, `or`"),
    ] {
        let e = Filter::parse(text, &fields).expect_err(text);
        assert_eq!(e.column, Some(column), "{text}: {e}");
        assert!(e.to_string().contains(words), "{text}: {e}");
        assert!(e.help.is_some(), "{text}");
    }
}

#[test]
fn a_query_sorts_cuts_and_prints_in_every_format() {
    let results = fixture::study();
    let asked = Query {
        filter: Some("status = done".into()),
        columns: ["scene", "culling", "total_cull_ms", "depth"].map(String::from).to_vec(),
        sort: vec!["-total_cull_ms".into()],
        limit: Some(4),
    };
    let table = query(&results, &asked).unwrap();
    let json: serde_json::Value = serde_json::from_str(&print(&table, Format::Json).unwrap()).unwrap();
    let values: Vec<f64> =
        json.as_array().unwrap().iter().map(|r| r["total_cull_ms"]["value"].as_f64().unwrap()).collect();
    assert!(values.len() == 4 && values.windows(2).all(|w| w[0] >= w[1]), "{values:?}");
    let csv = print(&table, Format::Csv).unwrap();
    assert!(csv.starts_with("scene,culling,total_cull_ms (ms),total_cull_ms low (ms),total_cull_ms high (ms),depth\n"));
    assert_eq!(csv.lines().count(), 5);
    let e = query(&results, &Query { columns: vec!["totl_cull_ms".into()], ..Default::default() }).unwrap_err();
    assert!(e.to_string().contains("did you mean `total_cull_ms`"), "{e}");
}

#[test]
fn claims_are_judged_scene_by_scene_and_gaps_leave_them_undecided() {
    let results = fixture::study();
    let published = fixture::claims();
    let slower = judge(&results, &published[0]);
    assert_eq!(slower.verdict, Verdict::Reproduced, "{}", slower.summary);
    assert_eq!(slower.groups.len(), 3);
    let (value, low, high) = slower.groups[0].ratio.unwrap();
    assert!(low > 1.0 && low <= value && value <= high && high < 4.0);

    let ratio = judge(&results, &published[1]);
    assert_eq!(ratio.verdict, Verdict::Contradicted, "{}", ratio.summary);
    assert_eq!(ratio.groups[0].verdict, Verdict::Undecided, "the normal-mask run of nucleus failed");
    assert!(ratio.groups[0].note.contains("failed"), "{}", ratio.groups[0].note);

    let mut none = published[0].clone();
    none.numerator = fixture::select(&[("structure", "kd_tree")]);
    assert_eq!(judge(&results, &none).verdict, Verdict::Undecided);

    let mut counted = published[2].clone();
    counted.metric = "mean_triangles".into();
    let found = judge(&results, &counted);
    assert_eq!(found.groups[1].verdict, Verdict::Reproduced);
    let (v, low, high) = found.groups[1].ratio.unwrap();
    assert!(v == low && v == high, "counts have no interval");
}

#[test]
fn a_single_trial_leaves_a_measured_claim_undecided() {
    let results = fixture::sized(&fixture::SCENES[..1], 40, 1);
    let claim = fixture::claim("A5.4", Relation::Greater);
    let found = judge(&results, &claim);
    assert_eq!(found.verdict, Verdict::Undecided);
    assert!(found.groups[0].note.contains("single trial"), "{}", found.groups[0].note);
}

#[test]
fn a_study_differs_from_itself_in_nothing_and_from_a_slower_one_by_its_factor() {
    let first = fixture::study();
    let mut second = first.clone();
    second.runs.swap(0, 5);
    for pair in compare(&first, &second, PAIRED).unwrap() {
        if let Some((ratio, low, high)) = pair.ratio {
            assert!((ratio - 1.0).abs() < 1e-12 && low <= 1.0 && high >= 1.0);
            assert_eq!(pair.change, Change::Same);
        } else {
            assert!(!pair.note.is_empty());
        }
    }
    let slow = second.runs.iter_mut().find(|r| r.status == RunStatus::Done && r.culling == "frustum").unwrap();
    let id = slow.measurement_id.clone();
    slow.trial_cull_ns.iter_mut().flatten().for_each(|ns| *ns *= 1.5);
    second.runs.retain(|r| !(r.structure == "list" && r.culling == "none"));
    let pairs = compare(&first, &second, PAIRED).unwrap();
    assert_eq!(pairs[0].first.unwrap().measurement_id, id, "the largest change comes first");
    assert_eq!(pairs[0].change, Change::Higher);
    let (ratio, low, high) = pairs[0].ratio.unwrap();
    assert!((ratio - 1.5).abs() < 1e-9 && low <= ratio && ratio <= high);
    assert_eq!(pairs.iter().filter(|p| p.note == "only in the first").count(), 3);
}

#[test]
fn times_of_two_machines_are_never_compared() {
    let first = fixture::study();
    let mut second = first.clone();
    second.runs.iter_mut().for_each(|r| r.machine_class = "other".into());
    let pairs = compare(&first, &second, PAIRED).unwrap();
    assert!(pairs.iter().all(|p| p.ratio.is_none()));
    // What is counted is the same everywhere.
    let counted = compare(&first, &second, "mean_triangles").unwrap();
    assert!(counted.iter().any(|p| p.change == Change::Same));
}

#[test]
fn an_empty_study_still_has_a_page() {
    let mut results = fixture::study();
    results.runs.clear();
    let dir = tempfile::tempdir().unwrap();
    let files = report::write(&results, &fixture::claims(), dir.path()).unwrap();
    assert!(files.charts.is_empty());
    assert!(std::fs::read_to_string(files.page).unwrap().contains("undecided"));
}

#[test]
fn an_unwritable_folder_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "").unwrap();
    let mut results = fixture::study();
    results.runs.clear();
    let e = report::write(&results, &[], &file).unwrap_err();
    assert!(e.to_string().contains("file") && e.help.is_some(), "{e}");
}
