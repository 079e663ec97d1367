//! What became of the nodes of the structure in an inspected frame.

use crate::culling::DrawList;
use crate::hierarchy::Hierarchy;
use crate::math::Aabb;
use crate::runner::Setup;
use crate::viewing::nodes::{CULLED, DRAWN, HIDDEN, NOT_REACHED, Numbers, WENT_ON, lanes};
use crate::viewing::watch::Watch;

/// Counts by decision, and the boxes of what the walk found hidden.
pub struct Nodes {
    pub drawn: u64,
    pub entered: u64,
    pub outside: u64,
    pub hidden: u64,
    pub not_reached: u64,
    /// In the world.
    pub hidden_boxes: Vec<Aabb>,
}

impl Nodes {
    /// After a frame whose tests were watched.
    pub fn of(setup: &Setup, watch: &Watch, list: &DrawList) -> Nodes {
        let (numbers, hierarchy) = (Numbers::of(&setup.hierarchy), &setup.hierarchy);
        let hides = setup.walk.removes().occluded;
        let decisions = watch.read(|heard| numbers.of_frame(hierarchy, heard, list, hides));
        let count = |is: &dyn Fn(u8) -> bool| decisions.iter().filter(|d| is(**d)).count() as u64;
        Nodes {
            drawn: count(&|d| d == DRAWN),
            entered: count(&|d| d == WENT_ON),
            outside: count(&|d| d >= CULLED),
            hidden: count(&|d| d == HIDDEN),
            not_reached: count(&|d| d == NOT_REACHED),
            hidden_boxes: hidden_boxes(hierarchy, &numbers, &decisions),
        }
    }
}

fn hidden_boxes(hierarchy: &Hierarchy, numbers: &Numbers, decisions: &[u8]) -> Vec<Aabb> {
    let nodes = (0..hierarchy.links.len())
        .flat_map(|block| lanes(hierarchy.links[block].live).map(move |lane| (block, lane)))
        .filter(|(block, lane)| decisions[numbers.node(*block as u32, *lane)] == HIDDEN);
    let bounds = |(block, lane): (usize, usize)| {
        let b = hierarchy.bounds[block].get(lane);
        Aabb { lo: b.lo.as_dvec3() + hierarchy.origin, hi: b.hi.as_dvec3() + hierarchy.origin }
    };
    nodes.map(bounds).collect()
}
