//! What a depth buffer draws of a scene: the pieces of a hierarchy, in its order.

use crate::hierarchy::{Hierarchy, LANES};
use crate::raster::{Kind, Occluders};
use crate::scene::Scene;

pub(super) fn occluders_of(scene: &Scene, hierarchy: &Hierarchy) -> Occluders {
    let kind = |position: u32| {
        let t = hierarchy.entries[position as usize] as usize;
        match (scene.occluder[t], scene.two_sided[t]) {
            (false, _) => Kind::Clear,
            (true, false) => Kind::OneSided,
            (true, true) => Kind::TwoSided,
        }
    };
    let mut starts = Vec::new();
    for links in &hierarchy.links {
        let own = |l: &usize| links.live >> l & 1 == 1 && links.own_end[*l] > links.first[*l];
        starts.extend((0..LANES).filter(own).map(|l| links.first[l]));
    }
    starts.sort_unstable();
    let corners = |position: u32| hierarchy.piece(scene, position);
    Occluders::new(hierarchy.entries.len() as u32, hierarchy.origin, corners, kind, &starts)
}
