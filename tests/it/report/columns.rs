//! Columns against their naive twin: the same questions asked of whole results give the
//! same rows, in the same order, cell by cell.

use super::fixture;
use cullmark::record::cameras;
use cullmark::registry::{Spec, Value};
use cullmark::report::columns::{Columns, Line};
use cullmark::report::facts::{Facts, revision};
use cullmark::report::fields::{Field, Fields};
use cullmark::report::filter::Filter;
use cullmark::report::metrics::METRICS;
use cullmark::report::query::{Query, query};
use cullmark::report::select::{cell, mask, page};
use cullmark::results::{RunStatus, StudyResults};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// Scenes, structures, parameters, further axes and numbers; runs of every status.
fn study() -> StudyResults {
    let mut results = fixture::study();
    for (i, run) in results.runs.iter_mut().enumerate() {
        let hash = |what: &str| blake3::hash(format!("{what} {i}").as_bytes()).to_hex()[..32].to_string();
        (run.measurement_id, run.answer_id) = (hash("m"), hash("a"));
        if i % 3 == 1 {
            run.spec.axes.insert("arithmetic".into(), Spec::new(["f64", "f32_world"][i / 3 % 2]));
        }
        if i % 5 == 0 {
            let text = format!("orthographic:height_m={},aspect=1.5,near_m=0.1,far_m=0", 10 + i % 2);
            run.spec.camera = cameras::camera_of(&Spec::parse(&text).unwrap()).unwrap();
            run.spec.axes.insert("camera".into(), cameras::spec_of(&run.spec.camera));
        }
        if i % 7 == 3 {
            run.spec.axes.insert("flavour".into(), Spec::new("salt").with("grains", Value::Int(i as i64)));
        }
        if i % 4 == 0 {
            run.spec.scene.offset_m = cullmark::scene::placement::along((i * 100) as f64);
        }
        run.spec.series = u32::from(i % 6 == 0);
        run.machine_class = ["lab", "office"][i / 2 % 2].into();
    }
    // Another failed one, with the very reason of the first.
    let reason = results.runs[6].reason.clone();
    (results.runs[13].status, results.runs[13].reason) = (RunStatus::Failed, reason);
    results
}

fn columns(results: &StudyResults) -> Columns {
    let mut builder = Columns::builder();
    for (i, run) in results.runs.iter().enumerate() {
        builder.push(&Line {
            // Ordinals have gaps where cells occur twice.
            ordinal: 2 * i as u32,
            measurement_id: &run.measurement_id,
            answer_id: &run.answer_id,
            machine_class: &run.machine_class,
            structure: &run.structure,
            culling: &run.culling,
            walk: &run.walk,
            spec: &run.spec,
            facts: &Facts::of(run),
        });
    }
    builder.finish()
}

struct Dice(ChaCha8Rng);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        (self.0.next_u64() % n as u64) as usize
    }

    fn one<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }
}

/// Values that some test of the field may meet, right and wrong ones.
fn values(results: &StudyResults, fields: &Fields, name: &str, field: &Field) -> Vec<String> {
    use cullmark::report::table::Cell;
    let shown = |r| match fields.cell(r, field) {
        Cell::Number(x) | Cell::Interval(x, ..) => Some(x.to_string()),
        Cell::Missing => None,
        other => Some(other.show()),
    };
    let mut all: Vec<String> = results.runs.iter().filter_map(shown).collect();
    match (field, name) {
        (Field::Axis(_), "structure") => all.extend(["octree", "bsp:min_leaf>100", "l*"].map(String::from)),
        (Field::Axis(_), "culling") => all.extend(["frustum+*", "*mask", "none"].map(String::from)),
        (Field::Axis(_), "camera") => all = ["perspective", "orthographic:height_m=10"].map(String::from).to_vec(),
        (Field::Axis(_), "flavour") => all = ["salt", "salt:grains>9", "pepper"].map(String::from).to_vec(),
        (Field::Metric(_) | Field::Number(_) | Field::Param(..), _) => all.extend(["0", "4.5"].map(String::from)),
        _ => all.extend(["*a*", "zebra"].map(String::from)),
    }
    all
}

fn test(dice: &mut Dice, results: &StudyResults, fields: &Fields, names: &[String]) -> String {
    let name = dice.one(names).clone();
    let field = fields.get(&name).unwrap();
    let all = values(results, fields, &name, &field);
    let value = |d: &mut Dice| format!("\"{}\"", d.one(&all));
    match dice.below(7) {
        0 => format!("{name} in ({}, {})", value(dice), value(dice)),
        1 => format!("{name} not in ({}, {})", value(dice), value(dice)),
        2 => format!("{name} in {} .. {}", value(dice), value(dice)),
        n => format!("{name} {} {}", ["=", "!=", "<", ">="][n - 3], value(dice)),
    }
}

fn filter(dice: &mut Dice, results: &StudyResults, fields: &Fields, names: &[String], depth: usize) -> String {
    match if depth == 0 { 9 } else { dice.below(6) } {
        0 => format!("not ({})", filter(dice, results, fields, names, depth - 1)),
        n @ 1..=3 => {
            let parts = [0; 2].map(|_| filter(dice, results, fields, names, depth - 1));
            format!("({}) {} ({})", parts[0], if n == 1 { "or" } else { "and" }, parts[1])
        }
        _ => test(dice, results, fields, names),
    }
}

#[test]
fn random_questions_get_the_rows_and_cells_of_the_naive_twin() {
    let results = study();
    let columns = columns(&results);
    let (fields, naive) = (columns.fields(), Fields::of(&results));
    assert_eq!(fields.names(), naive.names());
    let names = fields.names();
    for expected in ["flavour", "scene.offset_m", "octree.depth", "grains", "camera", "reason", "total_cull_ms"] {
        assert!(names.iter().any(|n| n == expected), "{expected} is asked about, too: {names:?}");
    }
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(2014));
    let (mut asked, mut some) = (0, 0);
    while asked < 400 {
        let text = filter(&mut dice, &results, &fields, &names, 2);
        let Ok(parsed) = Filter::parse(&text, &fields) else {
            // What makes no sense to one makes none to the other.
            assert!(Filter::parse(&text, &naive).is_err(), "{text}");
            continue;
        };
        asked += 1;
        let sort: Vec<String> =
            (0..dice.below(4)).map(|_| format!("{}{}", ["", "-"][dice.below(2)], dice.one(&names))).collect();
        let shown: Vec<String> = (0..4).map(|_| dice.one(&names).clone()).chain(["measurement_id".into()]).collect();
        let wanted = Query { filter: Some(text.clone()), columns: shown.clone(), sort: sort.clone(), limit: None };
        let expected = query(&results, &wanted).unwrap().rows;
        let whole = page(&columns, &fields, Some(&parsed), &sort, None, usize::MAX).unwrap();
        let shown: Vec<Field> = shown.iter().map(|n| fields.get(n).unwrap()).collect();
        let cells = |rows: &[usize]| -> Vec<Vec<_>> {
            rows.iter().map(|r| shown.iter().map(|f| cell(&columns, *r, f)).collect()).collect()
        };
        assert_eq!(cells(&whole.rows), expected, "{text} by {sort:?}");
        assert_eq!((whole.total, whole.next), (expected.len(), None));
        some += usize::from(!expected.is_empty() && expected.len() < results.runs.len());
        // Page by page it is the same.
        let limit = 1 + dice.below(9);
        let (mut walked, mut mark) = (Vec::new(), None);
        loop {
            let part = page(&columns, &fields, Some(&parsed), &sort, mark.as_ref(), limit).unwrap();
            assert!(part.rows.len() <= limit && part.total == whole.total, "{text} by {sort:?}");
            walked.extend(part.rows);
            // Through text and back, as a cursor goes.
            mark = part.next.map(|n| serde_json::from_str(&n.to_string()).unwrap());
            if mark.is_none() || walked.len() > whole.rows.len() {
                break;
            }
        }
        assert_eq!(walked, whole.rows, "{text} by {sort:?}, {limit} a page");
    }
    assert!(some > 150, "only {some} of the filters leave some out and some in");
}

#[test]
fn every_cell_of_every_field_is_that_of_the_twin() {
    let results = study();
    let columns = columns(&results);
    let fields = columns.fields();
    for name in fields.names() {
        let field = fields.get(&name).unwrap();
        for (row, run) in results.runs.iter().enumerate() {
            assert_eq!(cell(&columns, row, &field), fields.cell(run, &field), "{name} of run {row}");
        }
    }
    for (row, run) in results.runs.iter().enumerate() {
        assert_eq!((columns.id(row), columns.label.get(row)), (run.measurement_id.clone(), &run.label()));
        assert_eq!(columns.find(&run.measurement_id), Some(row));
        assert_eq!((columns.find(&(2 * row).to_string()), columns.find(&(2 * row + 1).to_string())), (Some(row), None));
    }
    let grid = cullmark::report::labels::Grid::of(&results);
    assert_eq!((&columns.places, &columns.combinations), (&grid.places, &grid.combinations));
    assert_eq!(mask(&columns, None), vec![true; results.runs.len()]);
}

#[test]
fn facts_survive_their_bytes_and_garbage_is_none() {
    for run in &study().runs {
        let facts = Facts::of(run);
        assert_eq!(Facts::decode(&facts.encode()), Some(facts.clone()));
        let bytes = facts.encode();
        assert_eq!(Facts::decode(&bytes[..bytes.len() / 2]), None);
        let known = facts.numbers.iter().map(|(m, ..)| METRICS[usize::from(*m)].name);
        assert_eq!(
            known.collect::<Vec<_>>(),
            METRICS.iter().filter(|m| m.value(run).is_some()).map(|m| m.name).collect::<Vec<_>>()
        );
    }
    assert_eq!(Facts::decode(b""), None);
    assert_eq!(revision().len(), 16);
}

#[test]
fn a_run_that_changed_reads_as_if_it_had_always_been_so() {
    let (results, mut before) = (study(), study());
    // As it was while nothing had been measured.
    for run in &mut before.runs {
        run.status = RunStatus::Pending;
        run.reason = None;
        run.class = None;
        run.observed = None;
        run.trials.clear();
        run.cull_ns.clear();
        run.trial_cull_ns.clear();
        run.triangles.clear();
        run.draw_calls.clear();
        run.nodes_visited.clear();
        run.counters.clear();
        run.errors.clear();
    }
    let mut grown = columns(&before);
    let fresh = columns(&results);
    for (row, run) in results.runs.iter().enumerate() {
        grown.set(row, &Facts::of(run));
    }
    let fields = fresh.fields();
    for name in fields.names() {
        let field = fields.get(&name).unwrap();
        for row in 0..results.runs.len() {
            assert_eq!(cell(&grown, row, &field), cell(&fresh, row, &field), "{name} of run {row}");
        }
    }
    assert_eq!(grown.known_metrics(), fresh.known_metrics());
    // And back: what a retried run had is gone.
    for (row, run) in before.runs.iter().enumerate() {
        grown.set(row, &Facts::of(run));
    }
    assert_eq!(grown.known_metrics(), ["trials"]);
}
