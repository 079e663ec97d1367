//! Portal-octree: an octree whose leaves know through which part of each face one can
//! look into the neighbour (Silva 2009 reports such trees by depth; the cells and
//! portals are those of Luebke & Georges 1995).
//!
//! Silva's structure is not described beyond that; this is ours. The octree halves the
//! *numbers* of 2^depth - 1 planes an axis, so that its leaves are the cells of a
//! rectilinear grid: every leaf is at the same depth, a point is found by three binary
//! searches, and neighbours need no links. `planes` chooses them:
//! - `middle`: by halving the root box, the usual octree;
//! - `walls`: where triangles lie exactly across an axis, the coordinates with the
//!   largest product of their area and the gap that they divide first, and then halves
//!   of the widest gaps. Both faces of a wall can be planes, and only a wall in a plane
//!   closes anything.
//!
//! Triangles have a copy in every closed cell that they reach (policy R), as whoever
//! sees into a cell must draw all that is in it. Empty cells have no node, but are
//! looked through. Openings are found by [`openings`]; the column
//! is [`Portals`], which the walk `portals` reads. To all other walks this is an octree.
//!
//! Conservative: as [`super::octree`] under policy R.

use super::Structure;
use super::builder::axes::walls_across;
use super::builder::{cut, openings};
use super::octree::{Octree, Policy};
use crate::error::Result;
use crate::hierarchy::{Hierarchy, LANES, NONE, Portals};
use crate::math::Aabb;
use crate::registry::{Default, Entry, Param};
use crate::scene::Scene;

pub const ENTRY: Entry<dyn Structure> = Entry {
    name: "portal_octree",
    about: "octree of fixed depth whose leaves know what is open between them (Silva 2009)",
    revision: 1,
    params: &[
        Param {
            name: "depth",
            default: Default::Int { value: 4, min: 1, max: 6 },
            about: "levels below the root: 2^depth cells to an axis",
        },
        Param {
            name: "planes",
            default: Default::Choice(&["walls", "middle"]),
            about: "planes of the cells: where walls lie, then halves of the widest gaps; or halves of the root box",
        },
        Param {
            name: "texels",
            default: Default::Int { value: 32, min: 1, max: 128 },
            about: "texels to a side of a face, each open or certainly covered",
        },
    ],
    make: |spec| {
        Box::new(PortalOctree {
            depth: spec.int("depth") as u32,
            walls: spec.text("planes") == "walls",
            texels: spec.int("texels") as u32,
        })
    },
};

#[derive(Debug, Clone, Copy)]
pub struct PortalOctree {
    pub depth: u32,
    pub walls: bool,
    pub texels: u32,
}

impl Structure for PortalOctree {
    fn build(&self, scene: &Scene) -> Result<Hierarchy> {
        let root =
            Octree { depth: self.depth, policy: Policy::Replicate, cube: false, leaf_limit: 0, by_facing: false }
                .root_cell(scene);
        let planes = [0, 1, 2].map(|axis| {
            if self.walls { walls(scene, &root, axis, self.depth) } else { middle(&root, axis, self.depth) }
        });
        let (mut h, cells) = cut::build_cells(scene, &planes, self.depth)?;
        let mut portals = Portals {
            bits: self.depth,
            texels: self.texels,
            node: vec![NONE; 1 << (3 * self.depth)],
            openings: openings::openings(scene, &planes, self.depth, self.texels),
            planes,
        };
        for (cell, node) in cells.into_iter().zip(leaves(&h)) {
            let number = portals.cell(cell.map(|c| c as usize));
            portals.node[number] = node;
        }
        h.portals = Some(portals);
        Ok(h)
    }
}

/// Leaves in the order of their entries.
fn leaves(h: &Hierarchy) -> Vec<u32> {
    let lanes = |block: usize| (0..LANES).filter(move |l| h.links[block].live >> l & 1 == 1);
    let mut all: Vec<(u32, u32)> = (0..h.links.len())
        .flat_map(|block| lanes(block).map(move |lane| (block, lane)))
        .filter(|(block, lane)| h.links[*block].child[*lane] == NONE)
        .map(|(block, lane)| (h.links[block].first[lane], (block * LANES + lane) as u32))
        .collect();
    all.sort_unstable();
    all.into_iter().map(|(_, node)| node).collect()
}

/// The planes at which halving the root box `depth` times cuts an axis.
fn middle(root: &Aabb, axis: usize, depth: u32) -> Vec<f64> {
    let mut planes = vec![root.lo[axis], root.hi[axis]];
    for _ in 0..depth {
        let halves: Vec<f64> = planes.windows(2).map(|p| (p[0] + p[1]) * 0.5).collect();
        planes.extend(halves);
        planes.sort_by(f64::total_cmp);
    }
    planes
}

/// Share of the root's cross-section that triangles in one plane must have to be a
/// wall: sides of furniture are none.
const WALL_SHARE: f64 = 0.01;

/// The planes where most wall is, then halves of the widest gaps.
fn walls(scene: &Scene, root: &Aabb, axis: usize, depth: u32) -> Vec<f64> {
    let wanted = (1 << depth) - 1;
    let size = root.size();
    let least = WALL_SHARE * size[(axis + 1) % 3] * size[(axis + 2) % 3];
    let mut peaks = walls_across(scene, axis, root, |t| scene.occluder[t as usize]);
    peaks.retain(|(_, area)| *area >= least);
    let mut planes = vec![root.lo[axis], root.hi[axis]];
    while planes.len() < wanted + 2 && !peaks.is_empty() {
        // Where they do not all find room, area alone would crowd them into one end.
        let score = |(at, area): &(f64, f64)| {
            let above = planes.partition_point(|p| p < at);
            area * (planes[above] - planes[above - 1])
        };
        let scores: Vec<f64> = peaks.iter().map(score).collect();
        let best = (0..peaks.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b]).then(b.cmp(a)));
        let (at, _) = peaks.remove(best.expect("not empty"));
        planes.insert(planes.partition_point(|p| *p < at), at);
    }
    while planes.len() < wanted + 2 {
        let gap = |i: &usize| planes[i + 1] - planes[*i];
        let widest = (0..planes.len() - 1).max_by(|a, b| gap(a).total_cmp(&gap(b)).then(b.cmp(a)));
        let at = widest.expect("two planes at least");
        planes.insert(at + 1, (planes[at] + planes[at + 1]) * 0.5);
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;

    #[test]
    fn halves_of_the_root_are_those_of_the_octree() {
        let root = Aabb { lo: DVec3::new(-1.7, 0.0, 1e7), hi: DVec3::new(3.1, 0.3, 1e7 + 2.0) };
        for axis in 0..3 {
            let planes = middle(&root, axis, 3);
            let centre = root.centre()[axis];
            assert_eq!((planes[0], planes[4], planes[8]), (root.lo[axis], centre, root.hi[axis]));
            assert_eq!(planes[2], (root.lo[axis] + centre) * 0.5);
            assert_eq!(planes.len(), 9);
        }
    }

    #[test]
    fn planes_lie_where_walls_are_and_then_in_the_widest_gaps() {
        let mut scene = Scene::default();
        let mut wall = |x: f64, side: f64, occluder: bool| {
            let first = scene.positions.len() as u32;
            scene.positions.extend([(0.0, 0.0), (side, 0.0), (0.0, side)].map(|(y, z)| DVec3::new(x, y, z)));
            scene.triangles.push([first, first + 1, first + 2]);
            scene.occluder.push(occluder);
        };
        wall(0.0, 8.0, true);
        wall(16.0, 8.0, true);
        wall(3.3, 4.0, true);
        wall(3.1, 5.0, true);
        // Glass, and too small.
        wall(5.0, 8.0, false);
        wall(6.0, 0.5, true);
        let root = scene.bounds();
        assert_eq!(walls(&scene, &root, 0, 1), [0.0, 3.1, 16.0]);
        assert_eq!(walls(&scene, &root, 0, 2), [0.0, 3.1, 3.3, (3.3 + 16.0) * 0.5, 16.0]);
        assert_eq!(walls(&scene, &root, 1, 2), [0.0, 2.0, 4.0, 6.0, 8.0]);
    }
}
