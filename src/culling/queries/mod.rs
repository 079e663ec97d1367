//! Occlusion queries: how much of some boxes shows behind what was drawn so far.
//!
//! A [`Backend`] draws ranges of entries, takes queries, evaluates both in the order in
//! which they came, and gives each answer when it is ready. Two back ends answer by the
//! software depth buffer of `raster`: `immediate`, at once and on the CPU's own time, and
//! `latency`, the same answers but as late as a GPU would give them, on the virtual clock
//! of [`clock`]. A back end that asks a real GPU joins behind the same trait.
//!
//! Boxes are covered generously and occluders sparingly (`raster`), so an answer of 0
//! pixels is proof that nothing in the boxes shows; what is off the image answers 0, too.
//!
//! The walks over them share [`stage`], the queue of nodes by distance ([`front`]), the
//! memory of a node ([`history`]) and the switch `auto` ([`payback`]).

pub mod clock;
pub mod front;
pub mod history;
pub mod payback;
pub mod software;
pub mod stage;

pub(super) use super::occluders::{COVERAGE, HEIGHT_PX, WIDTH_PX};
use super::occluders::{class_of, occluders_of, settings_of};
use super::*;
use crate::math::Box32;
use crate::raster::Settings;
pub use clock::{Prices, Times};
pub use software::Software;
pub use stage::{Occlusion, Order, Stage};

/// A query that was issued. Answers are taken in the order of issue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ticket(pub(super) u64);

pub trait Backend: Send {
    /// Makes the entries ready to be drawn; returns the bytes of what it keeps.
    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize;
    /// Starts a frame: nothing is drawn, and queries of the frame before are answered.
    fn begin(&mut self, view: &View, hierarchy: &Hierarchy);
    /// Draws the entries at positions `first..end`, in `calls` draw calls (0: those of a
    /// later one, the image has them at once), none of them
    /// nearer to the eye than `distance_m`; returns how many triangles hide things from
    /// now on.
    fn draw(&mut self, first: u32, end: u32, calls: u32, distance_m: f32) -> u32;
    /// One query of several boxes. Only whether its answer is 0 matters unless `count`.
    fn issue(&mut self, boxes: &[Box32], count: bool) -> Ticket;
    fn is_ready(&self, ticket: Ticket) -> bool;
    /// Waits for the answer: at most so many pixels show something, summed over boxes.
    fn take(&mut self, ticket: Ticket) -> u32;
    /// The CPU judged so many nodes meanwhile.
    fn work(&mut self, nodes: u64);
    /// Of the frame so far.
    fn times(&self) -> Times;
    fn prices(&self) -> Prices;
    /// Forgets queries that were never taken.
    fn reset(&mut self);
    /// The depth of what was drawn, where it is to be had: for pictures.
    fn buffer(&mut self) -> Option<&mut DepthBuffer>;
}

pub(super) const AUTO: Param = Param {
    name: "auto",
    default: Allowed::Bool(false),
    about: "queries stop while they cost more than they spare (counted work, priced), and are tried again later",
};

pub(super) const BACKEND: Param = Param {
    name: "backend",
    default: Allowed::Choice(&["immediate", "latency"]),
    about: "who answers queries: a software depth buffer at once, or the same as late as a GPU on a virtual clock",
};

const WITH_LATENCY: &[&str] = &["latency"];

pub(super) const LATENCY_US: Param = Param {
    name: "latency_us",
    default: Allowed::Only {
        with: "backend",
        is: WITH_LATENCY,
        of: &Allowed::Int { value: 100, min: 0, max: 1_000_000 },
    },
    about: "microseconds from the GPU's completion of a query to its answer",
};

pub(super) const N_VP: Param = Param {
    name: "n_vp",
    default: Allowed::Int { value: 0, min: 0, max: u32::MAX as i64 },
    about: "what shows in at most so many pixels counts as hidden; above 0 aggressive",
};

pub(super) const OCCLUDER_PX: Param = Param {
    name: "occluder_px",
    default: Allowed::Float { value: 0.0, min: 0.0, max: 1e6 },
    about: "ranges whose triangles would cover fewer pixels on average hide nothing (costs less, loses nothing); 0: all hide",
};

pub(super) const QUERY_NS: Param = Param {
    name: "query_ns",
    default: Allowed::Only {
        with: "backend",
        is: WITH_LATENCY,
        of: &Allowed::Float { value: clock::QUERY_CPU_NS, min: 0.0, max: 1e9 },
    },
    about: "what a query costs the CPU on the virtual clock; the GPU half as much",
};

pub(super) const SORTED: Param = Param {
    name: "sorted",
    default: Allowed::Only { with: "backend", is: &["immediate"], of: &Allowed::Bool(false) },
    about: "all is submitted at the end of the frame and by position, so that neighbours merge; the queries need no GPU",
};

/// The back end that a resolved spec asks for.
pub(super) fn backend(spec: &Spec) -> Box<dyn Backend> {
    let settings = settings_of(spec);
    let latency = spec.text("backend") == "latency";
    let latency_ns = latency.then(|| spec.int("latency_us") as f64 * 1e3);
    let prices = if latency { Prices::gpu(spec.float("query_ns")) } else { Prices::software() };
    Box::new(Software::new(settings, prices, latency_ns, spec.float("occluder_px")))
}
