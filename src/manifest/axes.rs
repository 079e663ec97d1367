//! Axes of `[matrix]`, one line each in [`AXES`]. A new axis is a registry and its line.

use crate::error::{Error, Result, did_you_mean};
use crate::math::{Arithmetic, Camera, arithmetic};
use crate::record::cameras::{self, CAMERAS};
use crate::registry::{Entry, Param, Spec, find};
use crate::{culling, structure};

/// An axis other than `scene` and `path`, whose values are the manifest's own.
pub struct Axis {
    pub name: &'static str,
    /// What one part is, for messages.
    pub what: &'static str,
    /// Values are sums of parts (`frustum+normal_mask`, `none`); else one part.
    pub sum: bool,
    /// Values when the manifest gives none.
    pub default: &'static [&'static str],
    /// What the value `auto` stands for beside the given structure.
    pub auto: Option<fn(&Spec) -> Spec>,
    /// The value beside the given culling, where that leaves no choice.
    pub settled: Option<fn(&[Spec]) -> Option<Spec>>,
    /// Fills a value in from the section `[camera]`.
    pub(super) complete: Option<fn(&Spec, &Camera) -> Spec>,
    pub parts: fn() -> Vec<Part>,
    pub(super) check: fn(&Spec) -> Result<Spec>,
}

/// A registry line without its constructor.
pub struct Part {
    pub name: &'static str,
    pub revision: u32,
    pub params: &'static [Param],
}

pub fn parts<T: ?Sized>(entries: &'static [Entry<T>]) -> Vec<Part> {
    entries.iter().map(|e| Part { name: e.name, revision: e.revision, params: e.params }).collect()
}

pub static AXES: &[Axis] = &[
    Axis {
        name: "structure",
        what: "structure",
        sum: false,
        default: &[],
        auto: None,
        settled: None,
        complete: None,
        parts: || parts(structure::ALL),
        check: |spec| find("structure", structure::ALL, spec).map(|(_, s)| s),
    },
    Axis {
        name: "culling",
        what: "culling test",
        sum: true,
        default: &[],
        auto: None,
        settled: None,
        complete: None,
        parts: || parts(culling::TESTS),
        check: |spec| culling::find_test(spec).map(|(_, s)| s),
    },
    Axis {
        name: "walk",
        what: "walk",
        sum: false,
        default: &["auto"],
        auto: Some(culling::usual_walk),
        settled: None,
        complete: None,
        parts: || parts(culling::WALKS),
        check: |spec| culling::find_walk(spec).map(|(_, s)| s),
    },
    Axis {
        name: arithmetic::NAME,
        what: "arithmetic",
        sum: false,
        default: &["f32_relative"],
        auto: None,
        settled: Some(arithmetic_for),
        complete: None,
        parts: arithmetics,
        check: arithmetic_named,
    },
    Axis {
        name: cameras::AXIS,
        what: "camera",
        sum: false,
        default: &[],
        auto: None,
        settled: None,
        complete: Some(cameras::complete),
        parts: || parts(CAMERAS),
        check: cameras::check,
    },
];

fn arithmetics() -> Vec<Part> {
    let part = |a: Arithmetic| Part { name: a.name(), revision: a.revision(), params: &[] };
    Arithmetic::ALL.into_iter().map(part).collect()
}

fn arithmetic_named(spec: &Spec) -> Result<Spec> {
    Arithmetic::parse(&spec.kind)?;
    spec.resolve(&[])
}

/// Where no part of the culling takes the axis, all its values are the same work.
fn arithmetic_for(culling: &[Spec]) -> Option<Spec> {
    let takes = |s: &Spec| culling::knows_arithmetic(s) && !s.params.contains_key(arithmetic::NAME);
    (!culling.iter().any(takes)).then(|| Spec::new(Arithmetic::default().name()))
}

pub fn axis(name: &str) -> Option<&'static Axis> {
    AXES.iter().find(|a| a.name == name)
}

/// Names that a selection or a matrix may use for its axes.
pub fn axis_names() -> impl Iterator<Item = &'static str> + Clone {
    ["scene", "path"].into_iter().chain(AXES.iter().map(|a| a.name))
}

pub fn unknown_axis(name: &str) -> Error {
    let mut e = Error::new(format!("unknown axis `{name}`"));
    e.help = Some(match did_you_mean(name, axis_names()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("axes: {}", axis_names().collect::<Vec<_>>().join(", ")),
    });
    e
}

/// One value of an axis: the resolved parts of a sum, or exactly one part.
pub type AxisValue = Vec<Spec>;

#[derive(Debug, Clone, PartialEq)]
pub struct AxisValues {
    pub axis: &'static str,
    pub values: Vec<AxisValue>,
    /// Values written twice, left out.
    pub repeated: usize,
}

/// Values that an axis has when the manifest is silent.
pub fn default_values(axis: &'static Axis, section: &Camera) -> AxisValues {
    let values = match axis.complete {
        Some(_) => vec![vec![cameras::spec_of(section)]],
        None => axis.default.iter().map(|text| vec![Spec::new(text)]).collect(),
    };
    AxisValues { axis: axis.name, values, repeated: 0 }
}
