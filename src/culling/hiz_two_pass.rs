//! `hiz_two_pass`: what was seen in the last frame is drawn first and hides the rest; what
//! shows all the same is drawn second. The two-phase culling of GPU-driven renderers
//! (Haar & Aaltonen, GPU-Driven Rendering Pipelines, 2015), by software.
//!
//! 1. Nodes that showed at the end of the last frame and are in view are drawn, also into
//!    the depth buffer.
//! 2. All nodes in view are asked about, down the hierarchy: below a hidden one nothing is.
//!    Those that show and were not drawn yet are drawn.
//!
//! What showed in the second pass is what the next frame starts with, so a node that
//! became hidden is drawn once more, and one that appears is drawn in the same frame. The
//! first frame has nothing to start with and draws all that is in view.
//!
//! What we changed: the answers of the last frame are bits of nodes, not of objects; the
//! second pass asks about inner nodes, too, of a pyramid of farthest depth or of all
//! pixels (`pyramid`); what it draws does not go to the depth buffer, as nothing is asked
//! after it.
//!
//! Sample-conservative: a node is left out only if the triangles of the first pass, all of
//! them submitted, cover its box at every sample of the buffer. Conservative with inner
//! coverage.

use super::descent::Descent;
use super::occluders::{COVERAGE, HEIGHT_PX, WIDTH_PX, class_of, occluders_of, settings_of};
use super::*;
use crate::hierarchy::NONE;
use crate::raster::pyramid::Pyramid;
use crate::raster::{DepthBuffer, Occluders, Settings};

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "hiz_two_pass",
    about: "draws what the last frame saw, then what shows behind its depth (Haar & Aaltonen 2015)",
    revision: 1,
    params: &[
        COVERAGE,
        HEIGHT_PX,
        Param {
            name: "pyramid",
            default: Allowed::Bool(true),
            about: "boxes are looked up in a pyramid of farthest depth over 8 x 4 pixels, four texels each; false: in all pixels that they cover",
        },
        WIDTH_PX,
    ],
    make: |spec| Box::new(HizTwoPass::new(settings_of(spec), spec.bool("pyramid"))),
};

pub struct HizTwoPass {
    buffer: DepthBuffer,
    pyramid: bool,
    occluders: Occluders,
    descent: Descent,
    /// By block, the lanes that showed at the end of the last frame, and of this one. Those
    /// above such a lane showed, too.
    seen: Vec<u8>,
    shows: Vec<u8>,
}

impl HizTwoPass {
    pub fn new(settings: Settings, pyramid: bool) -> HizTwoPass {
        HizTwoPass {
            buffer: DepthBuffer::new(settings),
            pyramid,
            occluders: Occluders::default(),
            descent: Descent::default(),
            seen: Vec::new(),
            shows: Vec::new(),
        }
    }

    /// Submits what was seen in the last frame and is in view, and draws it as occluders.
    fn first_pass(
        &mut self,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        // The second pass visits all of these again, and counts them.
        let visited = tally.nodes_visited;
        let count = tests.len();
        for root in 0..hierarchy.root_blocks {
            if self.seen[root as usize] == 0 {
                continue;
            }
            self.descent.clear();
            self.descent.enter(hierarchy, root, self.seen[root as usize], 0, tests, None, tally);
            while let Some(at) = self.descent.next(count) {
                let links = &hierarchy.links[at.block as usize];
                out.push(links.first[at.lane], links.own_end[at.lane]);
                let child = links.child[at.lane];
                if child != NONE && self.seen[child as usize] != 0 {
                    self.descent.enter(hierarchy, child, self.seen[child as usize], 0, tests, Some(at), tally);
                    self.descent.expect_children(hierarchy);
                }
            }
        }
        tally.nodes_visited = visited;
        for (first, end) in &out.ranges {
            tally.occluders_drawn += u64::from(self.buffer.draw(&self.occluders, *first, *end));
        }
    }

    /// Submits what shows behind that and was not drawn yet; remembers all that shows.
    fn second_pass(
        &mut self,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        // Nothing hides anything in a frame that drew nothing: no need to look at all pixels.
        let pyramid: Option<Pyramid> = (self.pyramid && !out.ranges.is_empty()).then(|| self.buffer.pyramid());
        let count = tests.len();
        for root in 0..hierarchy.root_blocks {
            self.descent.clear();
            self.descent.enter(hierarchy, root, hierarchy.links[root as usize].live, 0, tests, None, tally);
            while let Some(at) = self.descent.next(count) {
                let (block, bit) = (at.block as usize, 1u8 << at.lane);
                let links = &hierarchy.links[block];
                let drawn = self.seen[block] & bit != 0;
                tally.boxes_queried += 1;
                let bounds = hierarchy.bounds[block].get(at.lane);
                let shown = match &pyramid {
                    Some(pyramid) => pyramid.shows(&bounds),
                    None => self.buffer.shows(&bounds),
                };
                if !shown {
                    if !drawn {
                        tally.nodes_occluded += 1;
                        tally.entries_occluded += u64::from(links.end[at.lane] - links.first[at.lane]);
                    }
                    continue;
                }
                self.shows[block] |= bit;
                if !drawn {
                    out.push(links.first[at.lane], links.own_end[at.lane]);
                }
                let child = links.child[at.lane];
                if child != NONE {
                    let live = hierarchy.links[child as usize].live;
                    self.descent.enter(hierarchy, child, live, 0, tests, Some(at), tally);
                    self.descent.expect_children(hierarchy);
                }
            }
        }
    }
}

impl Walk for HizTwoPass {
    fn class(&self) -> Class {
        class_of(self.buffer.settings().coverage)
    }

    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, occluded: true, ..Removes::default() }
    }

    fn buffer(&mut self) -> Option<&mut DepthBuffer> {
        Some(&mut self.buffer)
    }

    fn samples(&self) -> Option<(u32, u32)> {
        let settings = self.buffer.settings();
        Some((settings.width_px, settings.height_px))
    }

    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.occluders = occluders_of(scene, hierarchy);
        self.seen = vec![0; hierarchy.links.len()];
        self.shows = self.seen.clone();
        self.occluders.bytes() + self.buffer.bytes() + 2 * self.seen.len()
    }

    fn reset(&mut self) {
        self.seen.fill(0);
    }

    fn run(
        &mut self,
        view: &View,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        self.buffer.begin(view, hierarchy.origin);
        self.shows.fill(0);
        self.first_pass(hierarchy, tests, out, tally);
        self.second_pass(hierarchy, tests, out, tally);
        std::mem::swap(&mut self.seen, &mut self.shows);
    }
}
