//! `occlusion_tree`: nodes hidden behind the shadows of a few large occluders (Bittner,
//! Havran & Slavik, Hierarchical Visibility Culling with Occlusion Trees, 1998).
//!
//! A frame chooses its occluders (`shadows::choice`), fuses their shadows in a tree of
//! planes through the eye (`shadows::tree`) and goes down the hierarchy: a node whose
//! whole outline is in shadow, behind the occluder in each part, is skipped.
//!
//! What we changed:
//! - Neighbouring triangles of one plane are one occluder (`merge`), as the triangles of
//!   a wall take several places among the chosen else.
//! - All is done on the image plane, where a plane through the eye is a line; that serves
//!   parallel rays, too. Outlines are cut to the image: nobody sees what is beside it.
//! - The test of depth takes the whole box of the node instead of each part of its
//!   outline: one product a leaf, exact for boxes whose near side bulges out of the outline.
//! - A node starts in the tree where its parent's outline was first divided, and one that
//!   no shadow reaches stops asking for all below it.
//!
//! Conservative, in object space. Occluders are triangles of the scene, so what is hidden
//! by one is hidden whether or not that one is submitted itself. Back faces of one-sided
//! triangles hide nothing, nor does what is seen through, or is nearer than the near plane.
//! Outlines are those of boxes rounded outward, shadows shrink by more than any rounding,
//! cuts overlap, and what is in doubt shows (`shadows`).

use super::descent::Descent;
use super::shadows::caster::{Caster, share_edges};
use super::shadows::choice::Choice;
use super::shadows::image::Image;
use super::shadows::polygons::Polygons;
use super::shadows::tree::{Answer, OPEN, Place, Tree};
use super::skipping::{STILL, Skipping, WHOLE_BELOW};
use super::*;
use crate::hierarchy::NONE;

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "occlusion_tree",
    about: "skips what is in the fused shadows of a few large occluders (Bittner, Havran & Slavik 1998)",
    revision: 1,
    params: &[
        Param {
            name: "merge",
            default: Allowed::Bool(true),
            about: "triangles side by side in one plane are one occluder",
        },
        Param {
            name: "occluders",
            default: Allowed::Int { value: 32, min: 1, max: 256 },
            about: "occluders a frame, at most: those with the largest area |cos| / distance^2",
        },
        STILL,
        WHOLE_BELOW,
    ],
    make: |spec| {
        Box::new(OcclusionTree {
            merge: spec.bool("merge"),
            most: spec.int("occluders") as usize,
            skipping: Skipping::new(spec),
            ..OcclusionTree::default()
        })
    },
};

#[derive(Default)]
pub struct OcclusionTree {
    merge: bool,
    most: usize,
    polygons: Polygons,
    choice: Choice,
    tree: Tree,
    casters: Vec<Caster>,
    descent: Descent,
    /// By judged block on the stack, where its lanes start in the tree.
    places: Vec<Place>,
    /// No box has a coordinate beyond.
    reach_m: f64,
    skipping: Skipping,
}

impl OcclusionTree {
    fn cast(&mut self, view: &View, image: &Image, hierarchy: &Hierarchy, tally: &mut Tally) {
        self.tree.clear(image);
        self.casters.clear();
        let chosen = self.choice.choose(view, image, hierarchy, &self.polygons, self.most);
        let polygons = &self.polygons;
        self.casters.extend(chosen.filter_map(|p| Caster::new(image, polygons, &polygons.all[p as usize])));
        share_edges(&mut self.casters);
        tally.occluders_chosen += self.casters.len() as u64;
        for caster in self.casters.drain(..) {
            self.tree.insert(image, caster);
        }
        tally.shadow_planes += self.tree.len() as u64;
    }
}

impl Walk for OcclusionTree {
    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, occluded: true, ..Removes::default() }
    }

    fn refuses(&self, _: &Hierarchy) -> Option<String> {
        None
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.polygons = Polygons::of(scene, self.merge);
        self.choice = Choice::new(scene, hierarchy, &self.polygons);
        let all = hierarchy.bounds[..hierarchy.root_blocks as usize].iter();
        let reach = all.flat_map(|b| b.lo.iter().chain(&b.hi).flatten()).filter(|x| x.is_finite());
        self.reach_m = reach.fold(0.0f64, |m, x| m.max(f64::from(x.abs())));
        self.polygons.bytes() + self.choice.bytes()
    }

    fn skipping(&mut self) -> Option<&mut Skipping> {
        Some(&mut self.skipping)
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
        let image = Image::new(view, hierarchy.origin, self.reach_m);
        self.cast(view, &image, hierarchy, tally);
        let count = tests.len();
        for root in 0..hierarchy.root_blocks {
            self.descent.clear();
            self.places.clear();
            self.descent.enter(hierarchy, root, hierarchy.links[root as usize].live, 0, tests, None, tally);
            self.places.push(self.tree.root());
            while let Some(at) = self.descent.next(count) {
                let links = &hierarchy.links[at.block as usize];
                let (first, own_end, end) = (links.first[at.lane], links.own_end[at.lane], links.end[at.lane]);
                self.places.truncate(self.descent.depth());
                let mut place = self.places[self.descent.depth() - 1];
                if place != OPEN {
                    tally.boxes_queried += 1;
                    let bounds = image.relative(&hierarchy.bounds[at.block as usize].get(at.lane));
                    match self.tree.judge(&image, bounds, place) {
                        Answer::Hidden => {
                            tally.nodes_occluded += 1;
                            tally.entries_occluded += u64::from(end - first);
                            continue;
                        }
                        Answer::Shows(from) => place = from,
                    }
                }
                let child = links.child[at.lane];
                if child == NONE || place == OPEN && self.descent.is_settled(at, count) {
                    out.push(first, end);
                    continue;
                }
                out.push(first, own_end);
                self.descent.enter(hierarchy, child, hierarchy.links[child as usize].live, 0, tests, Some(at), tally);
                self.places.push(place);
                self.descent.expect_children(hierarchy);
            }
        }
    }
}
