//! Culling: a [`Test`] judges blocks of 8 siblings, or single triangles of what is
//! left, or both; a [`Walk`] owns order and temporal state. The manifest composes
//! them; neither knows any structure.

pub mod back_face;
pub mod chc;
pub mod chc_pp;
pub mod depth_first;
mod descent;
pub mod distinct;
mod draw_list;
pub mod facing_columns;
pub mod facing_fixed;
pub mod facing_kernels;
#[cfg(target_arch = "x86_64")]
pub mod facing_x86;
pub mod fast_v;
mod fast_v_blockers;
mod fast_v_facet;
mod fast_v_frusta;
mod fast_v_items;
mod fast_v_lens;
mod fast_v_mesh;
pub mod flat;
pub mod frustum;
pub mod frustum_arithmetic;
pub mod frustum_exact;
pub mod frustum_f64;
#[cfg(target_arch = "x86_64")]
pub mod frustum_f64_x86;
pub mod frustum_filtered;
pub mod frustum_fixed;
#[cfg(target_arch = "x86_64")]
pub mod frustum_fixed_x86;
pub mod frustum_octant;
#[cfg(target_arch = "x86_64")]
pub mod frustum_octant_x86;
pub mod frustum_planes;
pub mod frustum_relative;
pub mod frustum_sat;
pub mod frustum_scalar;
pub mod frustum_sphere;
#[cfg(target_arch = "x86_64")]
pub mod frustum_sphere_x86;
pub mod frustum_volume;
pub mod frustum_world;
#[cfg(target_arch = "x86_64")]
pub mod frustum_x86;
pub mod hiz_two_pass;
pub mod look_at;
pub mod mailbox;
pub mod nested_query;
pub mod normal_cone;
pub mod normal_mask;
mod normal_mask_local;
mod occluders;
pub mod occlusion_tree;
pub mod octant_mask;
pub mod portals;
pub mod portals_screen;
#[cfg(target_arch = "x86_64")]
mod prefetch_x86;
pub mod pvs;
mod pvs_cells;
pub mod queries;
mod saturation;
pub mod sector;
#[cfg(target_arch = "x86_64")]
pub mod sector_x86;
mod shadows;
mod skipping;
mod tally;
pub mod triangle_words;

pub use draw_list::DrawList;

use crate::error::{Error, Result};
use crate::hierarchy::Hierarchy;
use crate::math::{Arithmetic, View, arithmetic};
use crate::raster::DepthBuffer;
use crate::registry::{Default as Allowed, Entry, Param, Spec, Value, find};
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
pub use skipping::Skipping;
pub use tally::Tally;

/// What a method promises of its submitted set S against the visible set V*.
/// The order is from the strongest promise to the weakest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// S = V*.
    Exact,
    /// S contains V*, in object space.
    Conservative,
    /// Nothing that the same samples see is lost.
    SampleConservative,
    /// May lose members of V*.
    Aggressive,
    /// May lose and may add.
    Approximate,
}

/// Which invisible triangles a test is entitled to remove; the oracle judges
/// against exactly these sets.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Removes {
    pub outside_frustum: bool,
    pub back_facing: bool,
    pub occluded: bool,
}

impl Removes {
    pub fn union(self, o: Removes) -> Removes {
        Removes {
            outside_frustum: self.outside_frustum || o.outside_frustum,
            back_facing: self.back_facing || o.back_facing,
            occluded: self.occluded || o.occluded,
        }
    }
}

/// Judgement of one block. A lane that is not outside goes on with its `carry`:
/// the work that is left for the lane's children, meaningful to the test alone
/// except that 0 means "wholly inside: nothing below can be outside".
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verdict {
    /// Bit per lane.
    pub outside: u8,
    pub carry: [u8; 8],
}

/// A culling test with the per-scene columns it owns.
pub trait Test: Send {
    fn class(&self) -> Class;
    fn removes(&self) -> Removes;
    /// Builds the per-node columns; returns their bytes. Timed as part of building.
    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize;
    /// Forgets what was learnt in earlier frames, so that every pass over a path
    /// does the same work.
    fn reset(&mut self) {}
    /// Once a frame, before any judgement.
    fn begin(&mut self, view: &View, hierarchy: &Hierarchy);
    /// Carry of the roots; not 0 unless this frame nothing can be culled.
    fn initial_carry(&self) -> u8;
    /// Judges the `live` lanes of `block` and counts its own work (`lane_tests` and
    /// what it compares) in `tally`. `carry` is what the parent got
    /// (never 0: the walk does not ask then).
    /// What was learnt in earlier frames may save work; it never changes a verdict.
    fn judge(&mut self, hierarchy: &Hierarchy, block: u32, live: u8, carry: u8, tally: &mut Tally) -> Verdict;
    /// Judges the root blocks one after another without a hierarchy below them:
    /// ORs the outside lanes of block `b` into `outside[b]`; lanes that are not
    /// live may come back set. A test with a wide kernel overrides it.
    fn judge_flat(&mut self, hierarchy: &Hierarchy, outside: &mut [u8], tally: &mut Tally) {
        judge_flat_by_block(self, hierarchy, outside, tally);
    }
    /// Judges single triangles after the walk: takes out of `list` what it is
    /// entitled to remove ([`DrawList::retain`]). A test of nodes alone leaves it.
    fn filter(&mut self, hierarchy: &Hierarchy, list: &mut DrawList, tally: &mut Tally) {
        let _ = (hierarchy, list, tally);
    }
    /// Why the passes since the last [`Test::reset`] are void, as a sentence that says
    /// what to do, if they are: an overflow of fixed point, say. The run then fails.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// One frame: tests begin, the walk visits nodes, tests of triangles go through
/// what is left; unless the walk needs none of that. Into the same `out` every frame,
/// a walk finds what the last one left there.
#[inline]
pub fn cull(
    view: &View,
    hierarchy: &Hierarchy,
    tests: &mut [Box<dyn Test>],
    walk: &mut dyn Walk,
    out: &mut DrawList,
    tally: &mut Tally,
) {
    if walk.skipping().is_some_and(|s| s.skips(view, hierarchy, out, tally)) {
        return;
    }
    out.clear();
    for test in tests.iter_mut() {
        test.begin(view, hierarchy);
    }
    walk.run(view, hierarchy, tests, out, tally);
    for test in tests.iter_mut() {
        test.filter(hierarchy, out, tally);
    }
    if let Some(skipping) = walk.skipping() {
        skipping.keep(view, out);
    }
}

/// [`Test::judge_flat`] by way of [`Test::judge`].
pub fn judge_flat_by_block<T: Test + ?Sized>(
    test: &mut T,
    hierarchy: &Hierarchy,
    outside: &mut [u8],
    tally: &mut Tally,
) {
    let carry = test.initial_carry();
    for (block, out) in outside.iter_mut().enumerate() {
        let live = hierarchy.links[block].live & !*out;
        if live != 0 {
            *out |= test.judge(hierarchy, block as u32, live, carry, tally).outside & live;
        }
    }
}

/// Order of visit and temporal state.
pub trait Walk: Send {
    /// A reason why this walk cannot run on `hierarchy`, if it cannot.
    fn refuses(&self, hierarchy: &Hierarchy) -> Option<String>;
    /// Builds what the walk itself keeps of scene and hierarchy (occluders, adjacency);
    /// returns its bytes. Timed as part of building; never asked of what it refuses.
    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        let _ = (scene, hierarchy);
        0
    }
    /// What the walk itself promises and is entitled to remove, whatever the tests.
    fn class(&self) -> Class {
        Class::Conservative
    }
    fn removes(&self) -> Removes {
        Removes::default()
    }
    /// The samples at which a sample-conservative walk promises to lose nothing; truth for
    /// its verdict is taken there.
    fn samples(&self) -> Option<(u32, u32)> {
        None
    }
    /// What lets it skip whole frames, if it has that.
    fn skipping(&mut self) -> Option<&mut Skipping> {
        None
    }
    /// Forgets earlier frames, as [`Test::reset`].
    fn reset(&mut self) {
        self.skipping().into_iter().for_each(Skipping::reset);
    }
    /// Its depth of occluders, if it has one; after a frame as that frame left it. For pictures.
    fn buffer(&mut self) -> Option<&mut DepthBuffer> {
        None
    }
    /// Whether earlier frames of the pass may change what is submitted. If not, any
    /// frame can be culled by itself.
    fn remembers(&self) -> bool {
        true
    }
    /// Appends what to draw for this frame. `tests` have begun the frame.
    fn run(
        &mut self,
        view: &View,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    );
}

/// Sorted by name.
pub static TESTS: &[Entry<dyn Test>] = &[
    back_face::ENTRY,
    frustum::ENTRY,
    look_at::ENTRY,
    mailbox::ENTRY,
    normal_cone::ENTRY,
    normal_mask::ENTRY,
    octant_mask::ENTRY,
    sector::ENTRY,
];

/// Sorted by name.
pub static WALKS: &[Entry<dyn Walk>] = &[
    chc::ENTRY,
    chc_pp::ENTRY,
    depth_first::ENTRY,
    fast_v::ENTRY,
    flat::ENTRY,
    hiz_two_pass::ENTRY,
    nested_query::ENTRY,
    occlusion_tree::ENTRY,
    portals::ENTRY,
    pvs::ENTRY,
];

/// The parts of a sum, made, and their resolved specs.
pub type Sum = (Vec<Box<dyn Test>>, Vec<Spec>);

/// Finds and checks a test, also what its parameters say together.
pub fn find_test(spec: &Spec) -> Result<(&'static Entry<dyn Test>, Spec)> {
    let (entry, resolved) = find("culling test", TESTS, spec)?;
    frustum::check(&resolved)?;
    Ok((entry, resolved))
}

/// The tests that `specs` name, in order, with defaults filled in.
pub fn make_tests(specs: &[Spec]) -> Result<Sum> {
    make_tests_in(specs, Arithmetic::default())
}

/// The same; a test that knows arithmetics and names none takes `arithmetic`. The
/// resolved specs name it only where the given ones do.
pub fn make_tests_in(specs: &[Spec], arithmetic: Arithmetic) -> Result<Sum> {
    let mut tests = Vec::new();
    let mut resolved = Vec::new();
    for spec in specs {
        let (entry, spec) = find_test(spec)?;
        let mut own = spec.clone();
        state_arithmetic(&mut own, arithmetic);
        tests.push(entry.build(&own));
        resolved.push(spec);
    }
    Ok((tests, resolved))
}

/// Writes `arithmetic` into a part that takes one and states none.
pub fn state_arithmetic(part: &mut Spec, arithmetic: Arithmetic) {
    if knows_arithmetic(part) {
        let stated = || Value::Text(arithmetic.name().to_string());
        part.params.entry(arithmetic::NAME.to_string()).or_insert_with(stated);
    }
}

/// Whether the test `part` is evaluated in the arithmetic of the axis.
pub fn knows_arithmetic(part: &Spec) -> bool {
    let entry = TESTS.iter().find(|e| e.name == part.kind);
    entry.is_some_and(|e| e.params.iter().any(|p| p.name == arithmetic::NAME)) && !frustum::has_one_arithmetic(part)
}

/// The parameter of tests that know arithmetics.
pub const ARITHMETIC: Param = Param {
    name: arithmetic::NAME,
    default: Allowed::Axis(Arithmetic::NAMES),
    about: "numbers in which it is evaluated; by default what the axis `arithmetic` says",
};

/// The arithmetic of a spec that a constructor gets.
pub fn arithmetic_of(spec: &Spec) -> Arithmetic {
    match spec.params.get(arithmetic::NAME) {
        Some(Value::Text(name)) => Arithmetic::named(name).expect("a resolved spec names a known arithmetic"),
        _ => Arithmetic::default(),
    }
}

/// Finds and checks a walk, also what the type of a parameter cannot say.
pub fn find_walk(spec: &Spec) -> Result<(&'static Entry<dyn Walk>, Spec)> {
    let (entry, resolved) = find("walk", WALKS, spec)?;
    fast_v::check(&resolved)?;
    Ok((entry, resolved))
}

pub fn make_walk(spec: &Spec) -> Result<(Box<dyn Walk>, Spec)> {
    let (entry, resolved) = find_walk(spec)?;
    Ok((entry.build(&resolved), resolved))
}

/// The walk over a structure that none is chosen for: what has no hierarchy (a list, a
/// grid of cells) is judged block by block, portals are there to be looked through.
pub fn usual_walk(structure: &Spec) -> Spec {
    let in_rows = structure.params.get("layout") == Some(&Value::Text("rows".into()));
    let spec = Spec::new(match structure.kind.as_str() {
        "list" => "flat",
        "uniform_grid" | "irregular_grid" if !in_rows => "flat",
        "portal_octree" => "portals",
        _ => "depth_first",
    });
    find("walk", WALKS, &spec).map_or(spec, |(_, resolved)| resolved)
}

/// Class and entitlement of a sum of tests under a walk: the weakest class, the union
/// of sets.
pub fn promise(tests: &[Box<dyn Test>], walk: &dyn Walk) -> (Class, Removes) {
    tests
        .iter()
        .fold((walk.class(), walk.removes()), |(class, removes), t| (class.max(t.class()), removes.union(t.removes())))
}
