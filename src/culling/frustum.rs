//! `frustum`: view-frustum culling of boxes, in the arithmetic that is asked for.
//!
//! The p-/n-vertex test of Greene (1994) and Haines & Wallace (1991): of the eight
//! corners of a box, the one farthest along a plane's normal decides "outside",
//! the nearest decides "inside". Two accelerations of Assarsson & Möller (2000)
//! are switches, and neither changes the answer: `plane_mask` (a plane that the
//! parent is inside of is not tested again) and `last_plane` (start with the plane
//! that rejected the node last). Silva (2009) tests a BSP's partition plane
//! against the corners of the frustum instead: `node_test`; half-spaces are judged
//! in guarded f64 whatever the arithmetic.
//!
//! What we changed: 8 siblings at once (16 in a list), and a proved guard in place
//! of an epsilon (`frustum_planes`), so the class is conservative for the scene in
//! f64 at any distance from the origin. Boxes with NaN or infinite bounds are kept.
//! The arithmetic is a choice between six [`PlaneTest`]s; of `f32_world` alone the
//! class is aggressive.
//!
//! `octant` (`frustum_octant`) is a third acceleration with the same answer; `sat`
//! (`frustum_sat`) makes the test of boxes exact; `primitive` (`frustum_sphere`) puts a
//! sphere, or the middle alone, in place of the box. Those are single precision relative
//! to the camera whatever the axis `arithmetic` says.

use super::frustum_arithmetic::{Ask, PlaneTest, all, bits};
use super::frustum_exact::Exact;
use super::frustum_f64::Double;
use super::frustum_filtered::Filtered;
use super::frustum_fixed::Fixed;
use super::frustum_octant::{Far, Halves};
use super::frustum_planes::{PlaneMasks, planes_left};
use super::frustum_relative::Relative;
pub use super::frustum_relative::{Kernels, kernels};
use super::frustum_sat::SeparatingAxes;
use super::frustum_sphere::{self as sphere, Points, Spheres};
use super::frustum_volume::Volume;
use super::frustum_world::World;
use super::*;
use crate::hierarchy::{HalfSpace, LANES, NONE};
use crate::registry::{Default as Allowed, Param};

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "frustum",
    about: "boxes against the view frustum; by default f32 relative to the camera with a proved error bound",
    revision: 1,
    params: &[
        ARITHMETIC,
        Param {
            name: "last_plane",
            default: Allowed::Only { with: NODE_TEST, is: BOXES, of: &Allowed::Bool(false) },
            about: "test first the plane that rejected the node last (same answer, fewer plane tests)",
        },
        Param {
            name: NODE_TEST,
            default: Allowed::Choice(&["box", "plane", "box_plane"]),
            about: "what stands for a node: its box, its BSP partition plane where it has one, or both",
        },
        Param {
            name: "octant",
            default: Allowed::Only { with: NODE_TEST, is: BOXES, of: &Allowed::Later(&Allowed::Bool(false)) },
            about: "only the planes on whose side of the view a box has its centre are tested (same answer)",
        },
        Param {
            name: "plane_mask",
            default: Allowed::Only { with: NODE_TEST, is: BOXES, of: &Allowed::Bool(true) },
            about: "planes that a node is inside of are not tested for its children (same answer)",
        },
        Param {
            name: PRIMITIVE,
            default: Allowed::Only {
                with: NODE_TEST,
                is: BOXES,
                of: &Allowed::Later(&Allowed::Choice(&[BOX, "sphere", "point"])),
            },
            about: "what stands for a node's extent: its box, the sphere around that, or its middle alone (aggressive)",
        },
        Param {
            name: "sat",
            default: Allowed::Only { with: NODE_TEST, is: BOXES, of: &Allowed::Later(&Allowed::Bool(false)) },
            about: "boxes that planes do not decide are tested on all separating axes: exact for single boxes",
        },
    ],
    make: |spec| {
        let options = Options {
            node_test: NodeTest::named(spec.text("node_test")),
            plane_mask: spec.bool("plane_mask"),
            last_plane: spec.bool("last_plane"),
            octant: spec.bool("octant"),
            sat: spec.bool("sat"),
        };
        match spec.text(PRIMITIVE) {
            "sphere" => return Box::new(Frustum::new(options, Spheres::new(sphere::kernels()[0]))),
            "point" => return Box::new(Frustum::new(options, Points::new(sphere::kernels()[0]))),
            _ => {}
        }
        match arithmetic_of(spec) {
            Arithmetic::F32Relative => Box::new(Frustum::new(options, Relative::new(kernels()[0]))),
            Arithmetic::F32World => Box::new(Frustum::new(options, World::default())),
            Arithmetic::F64 => Box::new(Frustum::new(options, Double::default())),
            Arithmetic::Filtered => Box::new(Frustum::new(options, Filtered::default())),
            Arithmetic::Exact => Box::new(Frustum::new(options, Exact::default())),
            Arithmetic::FixedQ16 => Box::new(Frustum::new(options, Fixed::default())),
        }
    },
};

const NODE_TEST: &str = "node_test";
/// Node tests that ask about boxes.
const BOXES: &[&str] = &[BOX, "box_plane"];
const PRIMITIVE: &str = "primitive";
const BOX: &str = "box";

/// Spheres and points know one arithmetic, whatever the axis says.
pub(super) fn has_one_arithmetic(part: &Spec) -> bool {
    part.kind == ENTRY.name && matches!(part.params.get(PRIMITIVE), Some(Value::Text(p)) if p != BOX)
}

/// What the parameters of a resolved spec say together.
pub(super) fn check(spec: &Spec) -> Result<()> {
    match spec.params.get(arithmetic::NAME) {
        Some(stated) if has_one_arithmetic(spec) && *stated != Value::Text(Arithmetic::F32Relative.name().into()) => {
            let primitive = &spec.params[PRIMITIVE];
            Err(Error::new(format!(
                "is {stated}, but `{PRIMITIVE}={primitive}` knows {} alone",
                Arithmetic::F32Relative
            ))
            .key(arithmetic::NAME)
            .help(format!("leave `{}` out, or take `{PRIMITIVE}={BOX}`", arithmetic::NAME)))
        }
        _ => Ok(()),
    }
}

/// What stands for a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NodeTest {
    Box,
    /// The half-space column; the box where the structure has no such column.
    Plane,
    BoxPlane,
}

impl NodeTest {
    fn named(name: &str) -> NodeTest {
        match name {
            "box" => NodeTest::Box,
            "plane" => NodeTest::Plane,
            _ => NodeTest::BoxPlane,
        }
    }
}

/// The switches of the test.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    pub node_test: NodeTest,
    pub plane_mask: bool,
    pub last_plane: bool,
    pub octant: bool,
    pub sat: bool,
}

/// Carry while only half-spaces are tested: they never prove "wholly inside".
const HALF_SPACE: u8 = 0x80;

/// The test. Columns: the live lanes of root blocks, and with `last_plane` one
/// byte a plane and block, whose bits are the lanes that the plane rejected last.
pub struct Frustum<P> {
    options: Options,
    boxes: P,
    volume: Volume,
    halves: Halves,
    axes: SeparatingAxes,
    /// This frame tests half-spaces, boxes.
    with_planes: bool,
    with_boxes: bool,
    live: Vec<u8>,
    last: Vec<[u8; 6]>,
}

impl<P: PlaneTest> Frustum<P> {
    pub fn new(options: Options, boxes: P) -> Frustum<P> {
        Frustum {
            options,
            boxes,
            volume: Volume::default(),
            halves: Halves::default(),
            axes: SeparatingAxes::default(),
            with_planes: false,
            with_boxes: true,
            live: Vec::new(),
            last: Vec::new(),
        }
    }

    /// Lanes that no plane rejects, in index order.
    #[inline(always)]
    fn in_order(&mut self, h: &Hierarchy, ask: Ask, far: &Far, masks: &mut PlaneMasks, tally: &mut Tally) -> u8 {
        self.boxes.block(h, &ask, masks, tally);
        let mut alive = ask.lanes;
        for k in bits(ask.planes) {
            let tested = alive & !far.skip[k];
            tally.plane_tests += u64::from(tested.count_ones());
            alive &= !(masks.outside[k] & tested);
        }
        alive
    }

    /// The same, each lane starting with the plane that rejected it last.
    #[inline(always)]
    fn last_first(&mut self, h: &Hierarchy, ask: Ask, far: &Far, masks: &mut PlaneMasks, tally: &mut Tally) -> u8 {
        let last = &mut self.last[ask.block as usize];
        let mut alive = ask.lanes;
        let first = bits(ask.planes).filter(|k| last[*k] & alive & !far.skip[*k] != 0).fold(0, |m, k| m | 1 << k);
        if first != 0 {
            // A lane's own last plane need not be the first of these.
            let ask = Ask { planes: first, until_rejected: false, ..ask };
            self.boxes.block(h, &ask, masks, tally);
            for k in bits(first) {
                let tested = alive & last[k] & !far.skip[k];
                tally.plane_tests += u64::from(tested.count_ones());
                alive &= !(masks.outside[k] & tested);
            }
            if alive == 0 {
                return 0;
            }
        }
        self.boxes.block(h, &Ask { planes: ask.planes & !first, lanes: alive, ..ask }, masks, tally);
        for k in bits(ask.planes) {
            let tested = alive & !last[k] & !far.skip[k];
            tally.plane_tests += u64::from(tested.count_ones());
            let rejected = tested & masks.outside[k];
            if rejected != 0 {
                alive &= !rejected;
                last.iter_mut().for_each(|l| *l &= !rejected);
                last[k] |= rejected;
            }
        }
        alive
    }

    /// The same without the planes that the octant test leaves out.
    #[inline(never)]
    fn by_octant(&mut self, h: &Hierarchy, ask: Ask, masks: &mut PlaneMasks, tally: &mut Tally) -> u8 {
        let mut far = Far::NONE;
        if let Some(known) = self.boxes.far_planes(&self.halves, h, ask.block) {
            tally.octant_tests += u64::from(ask.lanes.count_ones());
            far = known;
        }
        let needed = Ask { planes: far.needed(ask.planes, ask.lanes), ..ask };
        let alive = if self.options.last_plane {
            self.last_first(h, needed, &far, masks, tally)
        } else {
            self.in_order(h, needed, &far, masks, tally)
        };
        if ask.inside && alive != 0 {
            self.inside_of_far(h, ask, &far, alive, masks, tally);
        }
        alive
    }

    /// Planes that were left out: a lane is inside if that is certain by itself, or if
    /// it is asked after all, because nothing else keeps it from being wholly inside.
    fn inside_of_far(
        &mut self,
        h: &Hierarchy,
        ask: Ask,
        far: &Far,
        alive: u8,
        masks: &mut PlaneMasks,
        tally: &mut Tally,
    ) {
        let mut settled = alive;
        for k in bits(ask.planes) {
            masks.inside[k] = masks.inside[k] & !far.skip[k] | far.inside[k];
            settled &= masks.inside[k] | far.skip[k];
        }
        let open = bits(ask.planes).filter(|k| settled & !masks.inside[*k] != 0).fold(0, |m, k| m | 1 << k);
        if open != 0 {
            let mut more = PlaneMasks::default();
            self.boxes.block(h, &Ask { planes: open, lanes: settled, ..ask }, &mut more, tally);
            for k in bits(open) {
                let asked = settled & !masks.inside[k];
                tally.plane_tests += u64::from(asked.count_ones());
                masks.inside[k] |= more.inside[k] & asked;
            }
        }
    }

    fn half_spaces(&self, column: &[Option<HalfSpace>], block: u32, alive: u8, tally: &mut Tally) -> u8 {
        let mut left = alive;
        for lane in bits(alive) {
            if let Some(space) = &column[block as usize * LANES + lane] {
                tally.plane_tests += 1;
                if self.volume.misses(space) {
                    left &= !(1 << lane);
                }
            }
        }
        left
    }
}

impl<P: PlaneTest> Test for Frustum<P> {
    fn class(&self) -> Class {
        P::CLASS
    }

    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, ..Default::default() }
    }

    fn prepare(&mut self, _scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.live = hierarchy.links[..hierarchy.root_blocks as usize].iter().map(|l| l.live).collect();
        self.last = if self.options.last_plane { vec![[0; 6]; hierarchy.links.len()] } else { Vec::new() };
        self.boxes.prepare(hierarchy) + size_of_val(&self.live[..]) + size_of_val(&self.last[..])
    }

    fn reset(&mut self) {
        self.last.fill([0; 6]);
        self.boxes.reset();
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.boxes.begin(view, hierarchy);
        self.with_planes = self.options.node_test != NodeTest::Box && hierarchy.half_spaces.is_some();
        self.with_boxes = self.options.node_test != NodeTest::Plane || !self.with_planes;
        if self.with_planes {
            self.volume = Volume::new(view, hierarchy.origin);
        }
        if self.options.octant {
            self.halves = Halves::new(view, hierarchy.origin);
        }
        if self.options.sat {
            self.axes = SeparatingAxes::new(view, hierarchy.origin, !P::BOXES);
        }
    }

    fn initial_carry(&self) -> u8 {
        if self.with_boxes { all(self.boxes.planes()) } else { HALF_SPACE }
    }

    fn judge(&mut self, hierarchy: &Hierarchy, block: u32, live: u8, carry: u8, tally: &mut Tally) -> Verdict {
        tally.lane_tests += u64::from(live.count_ones());
        let mut alive = live;
        let mut carries = [HALF_SPACE; LANES];
        if self.with_boxes {
            let mut masks = PlaneMasks::default();
            // Nobody inherits what a block of leaves is inside of.
            let inside = hierarchy.links[block as usize].child.iter().any(|c| *c != NONE) || self.options.sat;
            let ask = Ask { block, lanes: live, planes: carry, inside, until_rejected: true };
            alive = match self.options {
                Options { octant: true, .. } => self.by_octant(hierarchy, ask, &mut masks, tally),
                Options { last_plane: true, .. } => self.last_first(hierarchy, ask, &Far::NONE, &mut masks, tally),
                _ => self.in_order(hierarchy, ask, &Far::NONE, &mut masks, tally),
            };
            carries = planes_left(&masks, carry, self.options.plane_mask);
            if self.options.sat {
                let open = bits(alive).filter(|l| carries[*l] != 0).fold(0, |m, l| m | 1 << l);
                alive &= !self.axes.separated(&hierarchy.bounds[block as usize], open, tally);
            }
        }
        if let (true, Some(column)) = (self.with_planes, &hierarchy.half_spaces) {
            alive = self.half_spaces(column, block, alive, tally);
        }
        Verdict { outside: live & !alive, carry: carries }
    }

    fn judge_flat(&mut self, hierarchy: &Hierarchy, outside: &mut [u8], tally: &mut Tally) {
        let Options { last_plane, octant, sat, .. } = self.options;
        if last_plane || octant || sat || self.with_planes {
            return super::judge_flat_by_block(self, hierarchy, outside, tally);
        }
        let work = self.boxes.flat(hierarchy, &self.live, outside, tally);
        tally.lane_tests += work.lanes;
        tally.plane_tests += work.planes;
    }

    fn failure(&self) -> Option<String> {
        self.boxes.failure()
    }
}
