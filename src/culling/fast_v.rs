//! `fast_v`: what is visible from a point, by dividing the view volume into frusta until
//! connected surfaces fill them (Chandak, Antani, Taylor and Manocha, "FastV: From-point
//! Visibility Culling on Complex Models", 2009).
//!
//! In every frustum triangles are taken from front to back. One that all four corner rays
//! pass inside of is a *blocker*; so is one that becomes one with its neighbours over welded
//! edges, growing across each edge that enters the frustum. Nothing in the frustum is seen
//! behind the farthest point of a blocker. The visible set is the union over all frusta: a
//! grid of `g x g`, or a quadtree that divides frusta with more than `limit` triangles left.
//!
//! What we changed:
//! - Frusta are found by quartering the image, and each hands what it left to its quarters,
//!   nodes unopened: what hides a part of the scene in a frustum hides it in all below, so
//!   no frustum starts at the root, and refinement never adds a triangle.
//! - Blockers are sought among what the central ray hits: what fills a frustum holds it.
//! - Across an edge of more than two triangles growth goes on with any one that lies on the
//!   other side as seen, where the paper gives up; the proof needs no more.
//! - `depth=clipped`: a blocker ends, and a candidate starts, where its part in the frustum
//!   does; `plane` takes planes at the corner rays and whole triangles, as published.
//! - Back faces of one-sided triangles are left out: they are in no picture.
//! - Parallel rays work alike: an image plane is all that is asked of a camera.
//!
//! Conservative. Take an open frustum C and a set B of triangles that face the eye, each of
//! area on the image, of which for each edge that enters C another one lies on the other side
//! as seen. Around a point of B in C that is inside a triangle or an edge, B covers a
//! neighbourhood; so it does around a corner, since one turns from triangle to triangle until
//! the turn is full. What B covers of C is therefore open in C; it is closed, too, and holds
//! the centre: B covers all of C, hence its borders. All of B in C is beyond the near plane.
//! A point behind the farthest of it is behind the point of B on its own ray. Which side of
//! an edge a ray passes is decided exactly, depths with bounds of their rounding; frusta
//! share borders exactly and together hold the view volume. Triangles with `occluder ==
//! false` are in no B.
//!
//! Nothing is connected in a soup: it hides only what single triangles do, and the surface
//! leaks along every seam at any `g`.

use super::descent::Descent;
use super::fast_v_frusta::{Pool, visible};
use super::fast_v_items::{Frame, Options};
use super::fast_v_lens::Lens;
use super::fast_v_mesh::Mesh;
use super::*;
use crate::hierarchy::NONE;

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "fast_v",
    about: "single triangles that no connected surface hides, frustum by frustum (Chandak et al. 2009)",
    revision: 1,
    params: &[
        Param {
            name: "g",
            default: Allowed::Int { value: 256, min: 1, max: 4096 },
            about: "frusta to a side of the image, a power of two; at most so many where the subdivision is adaptive",
        },
        Param {
            name: "subdivision",
            default: Allowed::Choice(&["uniform", "adaptive"]),
            about: "uniform: g x g frusta; adaptive: divide those in which more than `limit` triangles are left",
        },
        Param {
            name: "limit",
            default: Allowed::Only {
                with: "subdivision",
                is: &["adaptive"],
                of: &Allowed::Int { value: 64, min: 1, max: 1 << 20 },
            },
            about: "a frustum with at most so many triangles is not divided",
        },
        Param {
            name: "grow",
            default: Allowed::Int { value: 256, min: 1, max: 1 << 16 },
            about: "most connected triangles of a blocker; 1 takes single triangles only",
        },
        Param {
            name: "depth",
            default: Allowed::Choice(&["clipped", "plane"]),
            about: "clipped: of what lies in the frustum; plane: of a blocker's planes at the four rays, and of whole triangles",
        },
    ],
    make: |spec| {
        let adaptive = spec.text("subdivision") == "adaptive";
        Box::new(FastV::new(Options {
            levels: spec.int("g").trailing_zeros(),
            enough: if adaptive { spec.int("limit") as usize } else { 0 },
            grow: spec.int("grow") as usize,
            clipped: spec.text("depth") == "clipped",
        }))
    },
};

/// Quarters of quarters: what `g` the registry cannot refuse by itself.
///
/// # Errors
/// If it is no power of two.
pub fn check(resolved: &Spec) -> Result<()> {
    let g = match resolved.params.get("g") {
        Some(Value::Int(g)) if resolved.kind == ENTRY.name => *g,
        _ => return Ok(()),
    };
    if g.count_ones() == 1 {
        return Ok(());
    }
    let above = (g as u64).next_power_of_two();
    Err(Error::new(format!("is {g}, but must be a power of two"))
        .key("g")
        .help(format!("frusta are quartered: take {} or {above}", above / 2)))
}

pub struct FastV {
    options: Options,
    mesh: Mesh,
    descent: Descent,
    kept: Vec<u8>,
    settled: Vec<u8>,
    pool: Pool,
    /// Bit by position; all 0 between frames.
    seen: Vec<u64>,
}

impl FastV {
    pub fn new(options: Options) -> FastV {
        FastV {
            options,
            mesh: Mesh::default(),
            descent: Descent::default(),
            kept: Vec::new(),
            settled: Vec::new(),
            pool: Pool::default(),
            seen: Vec::new(),
        }
    }

    /// What the tests leave of the hierarchy.
    fn judge(&mut self, hierarchy: &Hierarchy, tests: &mut [Box<dyn Test>], tally: &mut Tally) {
        self.kept.clear();
        self.kept.resize(hierarchy.links.len(), 0);
        self.settled.clear();
        self.settled.resize(hierarchy.links.len(), 0);
        let nothing_to_ask = tests.iter().all(|t| t.initial_carry() == 0);
        for root in 0..hierarchy.root_blocks {
            let live = hierarchy.links[root as usize].live;
            if nothing_to_ask {
                self.kept[root as usize] = live;
                self.settled[root as usize] = live;
                continue;
            }
            self.descent.clear();
            self.descent.enter(hierarchy, root, live, 0, tests, None, tally);
            while let Some(at) = self.descent.next(tests.len()) {
                let (block, bit) = (at.block as usize, 1 << at.lane);
                self.kept[block] |= bit;
                let child = hierarchy.links[block].child[at.lane];
                if self.descent.is_settled(at, tests.len()) {
                    self.settled[block] |= bit;
                } else if child != NONE {
                    let live = hierarchy.links[child as usize].live;
                    self.descent.enter(hierarchy, child, live, 0, tests, Some(at), tally);
                    self.descent.expect_children(hierarchy);
                }
            }
        }
    }
}

impl Walk for FastV {
    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.mesh = Mesh::new(scene, &hierarchy.entries);
        self.mesh.bytes()
    }

    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, back_facing: true, occluded: true }
    }

    fn remembers(&self) -> bool {
        false
    }

    fn run(
        &mut self,
        view: &View,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        self.judge(hierarchy, tests, tally);
        let lens = Lens::new(view, hierarchy.origin);
        let frame = Frame {
            lens: &lens,
            mesh: &self.mesh,
            hierarchy,
            kept: &self.kept,
            settled: &self.settled,
            options: self.options,
        };
        let (found, work) = visible(&frame, &self.pool);
        *tally = [*tally, work].into_iter().sum();
        self.seen.resize(hierarchy.entries.len().div_ceil(64), 0);
        for position in found.into_iter().flatten() {
            self.seen[position as usize / 64] |= 1 << (position % 64);
        }
        out.compacted = true;
        for (word, bits) in (0u32..).zip(&mut self.seen) {
            let mut rest = std::mem::take(bits);
            while rest != 0 {
                // A run of ones is one range.
                let first = rest.trailing_zeros();
                let length = (rest >> first).trailing_ones();
                out.push(word * 64 + first, word * 64 + first + length);
                rest &= (!0u64).checked_shl(first + length).unwrap_or(0);
            }
        }
    }
}
