//! A study in memory, column by column, so that filters, sorts and heat maps over a
//! hundred thousand runs take milliseconds: words are kept once and numbered, numbers
//! lie side by side. `select.rs` asks it the questions of `query.rs`, whose answers
//! over whole results are the naive twin of those given here.

use super::facts::Facts;
use super::fields::Fields;
use super::labels::{Names, Parts, names};
use super::metrics::METRICS;
use crate::claim::axis_value;
use crate::culling::Class;
use crate::record::{RunSpec, cameras};
use crate::registry::{Spec, format_sum};
use crate::results::RunStatus;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Values of which many rows have the same one.
#[derive(Debug, Clone)]
pub struct Coded<T> {
    pub values: Vec<T>,
    /// Of each row the number of its value.
    pub codes: Vec<u32>,
    known: HashMap<String, u32>,
}

impl<T> Default for Coded<T> {
    fn default() -> Self {
        Coded { values: Vec::new(), codes: Vec::new(), known: HashMap::new() }
    }
}

impl<T> Coded<T> {
    /// Appends a row; `key` tells values apart.
    fn push(&mut self, key: String, make: impl FnOnce() -> T) {
        let code = self.code(key, make);
        self.codes.push(code);
    }

    fn code(&mut self, key: String, make: impl FnOnce() -> T) -> u32 {
        let next = self.values.len() as u32;
        match self.known.entry(key) {
            std::collections::hash_map::Entry::Occupied(e) => *e.get(),
            std::collections::hash_map::Entry::Vacant(e) => {
                self.values.push(make());
                *e.insert(next)
            }
        }
    }

    pub fn get(&self, row: usize) -> &T {
        &self.values[self.codes[row] as usize]
    }
}

/// One metric: NaN where a run has none.
#[derive(Debug, Clone, Default)]
pub struct Numbers {
    pub value: Vec<f64>,
    /// Ends of the intervals; empty for a metric that has none.
    pub ends: Vec<(f64, f64)>,
}

/// What is new of a run, as the store tells it.
pub struct Line<'a> {
    pub ordinal: u32,
    pub measurement_id: &'a str,
    pub answer_id: &'a str,
    pub machine_class: &'a str,
    pub structure: &'a str,
    pub culling: &'a str,
    pub walk: &'a str,
    pub spec: &'a RunSpec,
    pub facts: &'a Facts,
}

/// All runs of a study, in the order of the matrix.
#[derive(Debug, Clone, Default)]
pub struct Columns {
    pub ordinals: Vec<u32>,
    ids: Vec<[u8; 16]>,
    answers: Vec<[u8; 16]>,
    pub status: Vec<RunStatus>,
    pub class: Vec<Option<Class>>,
    pub series: Vec<u32>,
    pub machine: Coded<String>,
    pub reason: Coded<Option<String>>,
    /// Short labels of the three axes that have them.
    pub labels: BTreeMap<&'static str, Coded<String>>,
    /// Values of every axis, the usual ones where a run states none.
    pub axes: BTreeMap<String, Coded<Vec<Spec>>>,
    /// Those that runs state, joined: whose parameters they have.
    pub stated: Coded<Vec<Spec>>,
    /// `scene.offset_m`, `camera.fov_y_deg`, ...; NaN where a run has none.
    pub numbers: BTreeMap<String, Coded<f64>>,
    /// By number of the metric.
    pub metrics: BTreeMap<usize, Numbers>,
    /// [`crate::results::RunResult::label`].
    pub label: Coded<String>,
    pub names: Vec<(u32, u32)>,
    pub places: Vec<String>,
    pub combinations: Vec<String>,
}

impl Columns {
    pub fn len(&self) -> usize {
        self.ordinals.len()
    }

    pub fn is_empty(&self) -> bool {
        self.ordinals.is_empty()
    }

    pub fn id(&self, row: usize) -> String {
        hex(&self.ids[row])
    }

    pub fn answer(&self, row: usize) -> String {
        hex(&self.answers[row])
    }

    /// The row of a run by its ordinal or the id of its measurement.
    pub fn find(&self, run: &str) -> Option<usize> {
        if run.len() == 32 {
            let id = unhex(run)?;
            return self.ids.iter().position(|i| *i == id);
        }
        let ordinal: u32 = run.parse().ok()?;
        self.ordinals.binary_search(&ordinal).ok()
    }

    pub fn builder() -> Builder {
        Builder::default()
    }

    fn name(&mut self, names: &[Names]) {
        let mut places = Coded::default();
        let mut combinations = Coded::default();
        for n in names {
            places.push(n.place.clone(), || n.place.clone());
            combinations.push(n.combination.clone(), || n.combination.clone());
        }
        self.names = places.codes.iter().copied().zip(combinations.codes).collect();
        (self.places, self.combinations) = (places.values, combinations.values);
    }

    fn push(&mut self, line: &Line) {
        let (row, spec) = (self.ordinals.len(), line.spec);
        self.ordinals.push(line.ordinal);
        self.ids.push(unhex(line.measurement_id).unwrap_or_default());
        self.answers.push(unhex(line.answer_id).unwrap_or_default());
        self.series.push(spec.series);
        self.machine.push(line.machine_class.into(), || line.machine_class.into());
        for (axis, text) in [("structure", line.structure), ("culling", line.culling), ("walk", line.walk)] {
            self.labels.entry(axis).or_default().push(text.into(), || text.into());
        }
        let camera = cameras::label(&cameras::spec_of(&spec.camera));
        self.labels.entry("camera").or_default().push(camera.clone(), || camera);
        let further: String = spec.further().iter().map(|l| format!(" × {l}")).collect();
        let label = format!("{} × {}{further}", line.structure, line.culling);
        self.label.push(label.clone(), || label);

        let usual = ["scene", "path", "structure", "culling", "walk", "arithmetic", "camera"];
        let axes = usual.into_iter().chain(spec.axes.keys().map(String::as_str).filter(|a| !usual.contains(a)));
        for axis in axes {
            let value = axis_value(spec, axis);
            fill(self.axes.entry(axis.to_string()).or_default(), row, Vec::new);
            self.axes.get_mut(axis).expect("just made").push(format_sum(&value), || value);
        }
        let stated: Vec<Spec> = spec.axes.values().cloned().collect();
        self.stated.push(format_sum(&stated), || stated);
        for (name, x) in spec.numbers() {
            let column = self.numbers.entry(name).or_default();
            fill(column, row, || f64::NAN);
            column.push(x.to_bits().to_string(), || x);
        }
        // Rows of another study's shape lack what this one has.
        self.axes.values_mut().for_each(|c| fill(c, row + 1, Vec::new));
        self.numbers.values_mut().for_each(|c| fill(c, row + 1, || f64::NAN));
        self.status.push(line.facts.status);
        self.class.push(line.facts.class);
        self.reason.codes.push(0);
        self.set(row, line.facts);
    }

    /// Takes what became of a run.
    pub fn set(&mut self, row: usize, facts: &Facts) {
        self.status[row] = facts.status;
        self.class[row] = facts.class;
        let key = facts.reason.as_ref().map_or_else(String::new, |r| format!("+{r}"));
        self.reason.codes[row] = self.reason.code(key, || facts.reason.clone());
        for numbers in self.metrics.values_mut() {
            numbers.resize(row + 1);
            numbers.value[row] = f64::NAN;
        }
        for (metric, value, ends) in &facts.numbers {
            let numbers = self.metrics.entry(usize::from(*metric)).or_default();
            numbers.resize(row + 1);
            numbers.value[row] = *value;
            if let Some(ends) = ends {
                let rows = numbers.value.len();
                numbers.ends.resize(rows.max(numbers.ends.len()), (f64::NAN, f64::NAN));
                numbers.ends[row] = *ends;
            }
        }
    }

    /// Metrics that some run has a value of.
    pub fn known_metrics(&self) -> Vec<&'static str> {
        let has = |n: &Numbers| n.value.iter().any(|x| !x.is_nan());
        self.metrics.iter().filter(|(_, n)| has(n)).map(|(m, _)| METRICS[*m].name).collect()
    }

    /// What filters, sorts and columns may name.
    pub fn fields(&self) -> Fields {
        let mut params = BTreeSet::new();
        let parts = ["structure", "walk", "culling"].iter().filter_map(|a| self.axes.get(*a));
        for part in parts.flat_map(|c| c.values.iter().flatten()).chain(self.stated.values.iter().flatten()) {
            params.extend(part.params.keys().map(|p| (part.kind.clone(), p.clone())));
        }
        Fields::from_parts(self.axes.keys().cloned(), params, self.numbers.keys().cloned().collect())
    }

    pub fn metric(&self, index: usize, row: usize) -> Option<(f64, Option<(f64, f64)>)> {
        let numbers = self.metrics.get(&index)?;
        let value = *numbers.value.get(row)?;
        let ends = numbers.ends.get(row).copied().filter(|e| !e.0.is_nan());
        (!value.is_nan()).then_some((value, ends))
    }
}

/// Columns while lines come in, by ascending ordinal.
#[derive(Default)]
pub struct Builder {
    columns: Columns,
    parts: Vec<Parts>,
}

impl Builder {
    pub fn push(&mut self, line: &Line) {
        self.columns.push(line);
        self.parts.push(Parts {
            scene: line.spec.scene.name.clone(),
            path: line.spec.path.name.clone(),
            structure: line.structure.into(),
            culling: line.culling.into(),
            walk: line.walk.into(),
            arithmetic: format_sum(&axis_value(line.spec, "arithmetic")),
            states_arithmetic: line.spec.axes.contains_key("arithmetic"),
            further: line.spec.further(),
            machine_class: line.machine_class.into(),
            series: line.spec.series,
        });
    }

    /// Names depend on all runs, so they come last.
    pub fn finish(mut self) -> Columns {
        self.columns.name(&names(&self.parts));
        self.columns
    }
}

impl Numbers {
    fn resize(&mut self, rows: usize) {
        if self.value.len() < rows {
            self.value.resize(rows, f64::NAN);
        }
    }
}

/// Rows that came before a column was known have no value in it.
fn fill<T>(column: &mut Coded<T>, rows: usize, make: impl FnOnce() -> T) {
    if column.codes.len() < rows {
        let code = column.code("\u{0}none".into(), make);
        column.codes.resize(rows, code);
    }
}

fn unhex(text: &str) -> Option<[u8; 16]> {
    let mut out = [0; 16];
    let (pairs, rest) = text.as_bytes().as_chunks::<2>();
    if pairs.len() != out.len() || !rest.is_empty() {
        return None;
    }
    let digit = |b: u8| char::from(b).to_digit(16).map(|d| d as u8);
    for (byte, [high, low]) in out.iter_mut().zip(pairs) {
        *byte = digit(*high)? << 4 | digit(*low)?;
    }
    Some(out)
}

fn hex(bytes: &[u8; 16]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
