//! `back_face`: exact back-face culling of single triangles, after the walk.
//!
//! A triangle shows its front iff `n.(e - v0) > 0` (parallel rays: `n.f < 0`);
//! exactly edge-on is not front. Two-sided triangles have no back and triangles
//! without area no front either: both are kept, for facing says nothing of them.
//! Of a triangle that a structure split, each fragment is judged by the plane of
//! the whole.
//!
//! The parameter `arithmetic` chooses the numbers: `f32_world` has no guard and is
//! **aggressive** (as engines write it, in the plane or the difference form);
//! `f32_relative` and `f64` keep what their error bound cannot tell; `filtered`
//! asks f32, then f64, then whole numbers, and `exact` the predicates of Shewchuk
//! (1997) at once: these two give one answer; `fixed_q16` counts in quanta.
//! All but the first are **conservative**.
//!
//! What we changed: the usual test is part of the rasteriser or of a shader; here
//! it runs over the ranges that the walk leaves, sixteen triangles at once.

use super::facing_columns::*;
use super::facing_fixed::{Fixed, FixedEye, FixedTriangle, triangles};
use super::facing_kernels::{Kernels, kernels};
use super::triangle_words::WORD;
use super::*;
use crate::math::DVec3;
use crate::math::predicates::{Facing, Predicates};

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "back_face",
    about: "triangles that turn their back to the eye, one by one, in six arithmetics",
    revision: 1,
    params: &[
        ARITHMETIC,
        Param {
            name: "form",
            default: Allowed::Only {
                with: arithmetic::NAME,
                is: &["f32_world"],
                of: &Allowed::Choice(&["plane", "difference"]),
            },
            about: "what f32_world evaluates: n.e + d, or n.(e - v); the others know one form",
        },
    ],
    make: |spec| {
        let difference = spec.text("form") == "difference";
        Box::new(BackFace::new(arithmetic_of(spec), difference, kernels()[0]))
    },
};

/// Columns and frame of one arithmetic.
enum State {
    Plane { blocks: Vec<PlaneBlock>, eye: Eye32 },
    Difference { blocks: Vec<PointBlock>, eye: Eye32 },
    Guarded { blocks: Vec<PointBlock>, eye: Eye32 },
    Double { blocks: Vec<DoubleBlock>, eye: Eye64 },
    Filtered { blocks: Vec<PointBlock>, eye: Eye32, exact: Exact },
    Exact(Exact),
    Fixed { triangles: Vec<FixedTriangle>, unasked: Vec<u64>, eye: FixedEye },
}

/// Corners in f64 by position, and who is kept unasked.
#[derive(Default)]
struct Exact {
    corners: Vec<[DVec3; 3]>,
    unasked: Vec<u64>,
    /// The eye, or the direction of parallel rays.
    eye: DVec3,
    parallel: bool,
}

impl Exact {
    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.corners = hierarchy.entries.iter().map(|t| scene.corners(*t)).collect();
        self.unasked = kept_unasked(scene, hierarchy);
        size_of_val(&self.corners[..]) + size_of_val(&self.unasked[..])
    }

    fn begin(&mut self, view: &View) {
        self.parallel = !view.is_perspective();
        self.eye = if self.parallel { view.forward } else { view.eye };
    }

    /// Takes out of `keep` those of `asked`, a word of positions, that show no front.
    fn judge(&self, word: usize, asked: u64, keep: &mut u64, predicates: &mut Predicates) {
        for bit in bits_of(asked & !self.unasked[word]) {
            let [a, b, c] = self.corners[word * WORD + bit];
            let facing = match self.parallel {
                false => predicates.facing(a, b, c, self.eye),
                true => predicates.facing_along(a, b, c, self.eye),
            };
            *keep &= !(u64::from(facing != Facing::Front) << bit);
        }
    }
}

/// The test.
pub struct BackFace {
    state: State,
    kernels: Kernels,
    /// Words that the f32 stage of `filtered` leaves open.
    open: Vec<u64>,
    failure: Option<String>,
}

impl BackFace {
    pub fn new(arithmetic: Arithmetic, difference: bool, kernels: Kernels) -> BackFace {
        let (eye, blocks) = (Eye32::default(), Vec::new());
        let state = match arithmetic {
            Arithmetic::F32World if difference => State::Difference { blocks, eye },
            Arithmetic::F32World => State::Plane { blocks: Vec::new(), eye },
            Arithmetic::F32Relative => State::Guarded { blocks, eye },
            Arithmetic::F64 => State::Double { blocks: Vec::new(), eye: Eye64::default() },
            Arithmetic::Filtered => State::Filtered { blocks, eye, exact: Exact::default() },
            Arithmetic::Exact => State::Exact(Exact::default()),
            Arithmetic::FixedQ16 => {
                State::Fixed { triangles: Vec::new(), unasked: Vec::new(), eye: FixedEye::OutOfReach }
            }
        };
        BackFace { state, kernels, open: Vec::new(), failure: None }
    }
}

impl Test for BackFace {
    fn class(&self) -> Class {
        match self.state {
            State::Plane { .. } | State::Difference { .. } => Class::Aggressive,
            _ => Class::Conservative,
        }
    }

    fn removes(&self) -> Removes {
        Removes { back_facing: true, ..Default::default() }
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        match &mut self.state {
            State::Plane { blocks, .. } => {
                *blocks = world_planes(scene, hierarchy);
                size_of_val(&blocks[..])
            }
            State::Difference { blocks, .. } => {
                *blocks = world_points(scene, hierarchy);
                size_of_val(&blocks[..])
            }
            State::Guarded { blocks, .. } => {
                *blocks = relative_points(scene, hierarchy);
                size_of_val(&blocks[..])
            }
            State::Double { blocks, .. } => {
                *blocks = double_points(scene, hierarchy);
                size_of_val(&blocks[..])
            }
            State::Filtered { blocks, exact, .. } => {
                *blocks = relative_points(scene, hierarchy);
                size_of_val(&blocks[..]) + exact.prepare(scene, hierarchy)
            }
            State::Exact(exact) => exact.prepare(scene, hierarchy),
            State::Fixed { triangles: all, unasked, .. } => {
                *all = triangles(scene, hierarchy);
                *unasked = kept_unasked(scene, hierarchy);
                size_of_val(&all[..]) + size_of_val(&unasked[..])
            }
        }
    }

    fn reset(&mut self) {
        self.failure = None;
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        match &mut self.state {
            State::Plane { eye, .. } | State::Difference { eye, .. } => *eye = Eye32::world(view),
            State::Guarded { eye, .. } => *eye = Eye32::relative(view, hierarchy.origin),
            State::Double { eye, .. } => *eye = Eye64::new(view),
            State::Filtered { eye, exact, .. } => {
                *eye = Eye32::relative(view, hierarchy.origin);
                exact.begin(view);
            }
            State::Exact(exact) => exact.begin(view),
            State::Fixed { eye, .. } => *eye = FixedEye::new(view, hierarchy.origin),
        }
    }

    /// Nodes are none of its business.
    fn initial_carry(&self) -> u8 {
        0
    }

    fn judge(&mut self, _: &Hierarchy, _: u32, _: u8, _: u8, _: &mut Tally) -> Verdict {
        Verdict { outside: 0, carry: [0; 8] }
    }

    fn filter(&mut self, _: &Hierarchy, list: &mut DrawList, tally: &mut Tally) {
        let k = self.kernels;
        let mut predicates = Predicates::default();
        tally.triangle_tests += match &self.state {
            State::Plane { blocks, eye } => list.retain_words(|w, keep| (k.plane)(eye, &blocks[4 * w..], keep)),
            State::Difference { blocks, eye } => {
                list.retain_words(|w, keep| (k.difference)(eye, &blocks[4 * w..], keep))
            }
            State::Guarded { blocks, eye } => list.retain_words(|w, keep| (k.guarded)(eye, &blocks[4 * w..], keep)),
            State::Double { blocks, eye } => list.retain_words(|w, keep| (k.double)(eye, &blocks[8 * w..], keep)),
            State::Filtered { blocks, eye, exact } => {
                let open = &mut self.open;
                list.retain_words(|w, keep| {
                    open.resize(keep.len(), 0);
                    for (i, word) in keep.iter().enumerate() {
                        tally.predicates += u64::from((word & !exact.unasked[w + i]).count_ones());
                    }
                    (k.split)(eye, &blocks[4 * w..], keep, open);
                    for (i, word) in keep.iter_mut().enumerate().filter(|(i, _)| open[*i] != 0) {
                        exact.judge(w + i, open[i], word, &mut predicates);
                    }
                })
            }
            State::Exact(exact) => list.retain_words(|w, keep| {
                for (i, word) in keep.iter_mut().enumerate() {
                    exact.judge(w + i, *word, word, &mut predicates);
                }
            }),
            State::Fixed { triangles, unasked, eye } => {
                let failure = &mut self.failure;
                list.retain_words(|w, keep| {
                    for (i, word) in keep.iter_mut().enumerate() {
                        for bit in bits_of(*word & !unasked[w + i]) {
                            let judged = eye.judge(&triangles[(w + i) * WORD + bit]);
                            *word &= !(u64::from(judged == Fixed::Back) << bit);
                            if judged == Fixed::Overflow {
                                let parallel = matches!(eye, FixedEye::Direction(_));
                                failure
                                    .get_or_insert_with(|| if parallel { OVERFLOW_PARALLEL } else { OVERFLOW }.into());
                            }
                        }
                    }
                })
            }
        };
        if let State::Filtered { .. } = self.state {
            tally.fallbacks_f64 += predicates.calls;
            tally.fallbacks_exact += predicates.fallbacks;
        }
    }

    fn failure(&self) -> Option<String> {
        self.failure.clone()
    }
}

const OVERFLOW: &str = "back_face: a triangle lies more than 32,768 m from the camera, which Q15.16 cannot hold; \
                        choose another arithmetic, or put `frustum` with a far plane before it";
const OVERFLOW_PARALLEL: &str = "back_face: a triangle has an edge of more than 32,768 m, or lies 67,000 km from the \
                                 scene's middle, which Q15.16 cannot hold; choose another arithmetic, or a smaller \
                                 `scale` for the scene";

/// Numbers of the set bits, ascending.
fn bits_of(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then_some(word.trailing_zeros() as usize);
        word &= word.wrapping_sub(1);
        bit
    })
}
