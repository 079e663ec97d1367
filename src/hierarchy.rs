//! The one flattened layout that every structure compiles to and every walk reads.
//!
//! Nodes live in blocks of 8 siblings, bounds in structure-of-arrays form so
//! that one SIMD register holds one bound of all 8. A node is named
//! `block * 8 + lane`. The entries (triangles, or fragments of triangles) of a
//! subtree are contiguous positions, so "wholly inside" is one range.

pub mod portals;

pub use portals::Portals;

use crate::math::{Aabb, Box32, DVec3};
use crate::scene::Scene;
use glam::Vec3;

pub const LANES: usize = 8;
/// No child, no parent.
pub const NONE: u32 = u32::MAX;

/// Bounds of 8 siblings: `lo[axis][lane]`, `hi[axis][lane]`, f32 metres from
/// [`Scene::origin`], rounded outward. 192 bytes, three cache lines.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct BoundsBlock {
    pub lo: [[f32; LANES]; 3],
    pub hi: [[f32; LANES]; 3],
}

const _: () = assert!(size_of::<BoundsBlock>() == 192);

impl BoundsBlock {
    pub const EMPTY: BoundsBlock = BoundsBlock { lo: [[f32::INFINITY; LANES]; 3], hi: [[f32::NEG_INFINITY; LANES]; 3] };

    pub fn get(&self, lane: usize) -> Box32 {
        Box32 {
            lo: Vec3::new(self.lo[0][lane], self.lo[1][lane], self.lo[2][lane]),
            hi: Vec3::new(self.hi[0][lane], self.hi[1][lane], self.hi[2][lane]),
        }
    }

    pub fn set(&mut self, lane: usize, b: Box32) {
        for axis in 0..3 {
            self.lo[axis][lane] = b.lo[axis];
            self.hi[axis][lane] = b.hi[axis];
        }
    }
}

/// Links of 8 siblings. Lane `l` covers entries `first[l]..end[l]` (whole
/// subtree); `own_end[l]` ends the entries that sit at the node itself, which
/// come first in its range (policy E; 0 of them elsewhere, all of them in a leaf).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkBlock {
    /// Block of the children, or [`NONE`] for a leaf.
    pub child: [u32; LANES],
    pub first: [u32; LANES],
    pub own_end: [u32; LANES],
    pub end: [u32; LANES],
    /// Bit per lane in use; always the low bits (`0b111` for three children).
    pub live: u8,
}

impl LinkBlock {
    pub const EMPTY: LinkBlock =
        LinkBlock { child: [NONE; LANES], first: [0; LANES], own_end: [0; LANES], end: [0; LANES], live: 0 };
}

/// A half-space `normal . (p - origin) + offset_m >= 0` that holds a node's content.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    pub normal: DVec3,
    pub offset_m: f64,
}

/// The flattened structure.
#[derive(Debug, Clone, Default)]
pub struct Hierarchy {
    pub origin: DVec3,
    pub bounds: Vec<BoundsBlock>,
    pub links: Vec<LinkBlock>,
    /// Node that owns each block, or [`NONE`] for root blocks.
    pub parent: Vec<u32>,
    /// The first `root_blocks` blocks hold the roots: one lane for a tree, all
    /// clusters for a list. Later blocks are reached through `child` only.
    pub root_blocks: u32,
    /// Position -> triangle of the scene. Longer than the scene under
    /// replication or splitting.
    pub entries: Vec<u32>,
    /// Position -> number of the material run it belongs to, ascending by 0 or 1:
    /// draw calls of a range are `run[end - 1] - run[first] + 1`.
    pub material_run: Vec<u32>,
    /// Corners of split fragments, by position; `None` when entries are whole triangles.
    pub fragments: Option<Vec<[DVec3; 3]>>,
    /// Optional column, by node: what a BSP's partition plane says of the node.
    pub half_spaces: Option<Vec<Option<HalfSpace>>>,
    /// Optional column: the leaves as cells of a grid, and what is open between them.
    pub portals: Option<Portals>,
    pub stats: BuildStats,
}

/// Counts in the paper's terms, beside what the flat layout stores.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BuildStats {
    /// Nodes of the tree as the paper counts them (root included).
    pub nodes: u64,
    pub leaves: u64,
    pub depth: u64,
    pub largest_leaf: u64,
    /// Leaves larger than the structure's limit, because nothing could split them.
    pub oversized_leaves: u64,
}

impl Hierarchy {
    pub fn node_count(&self) -> usize {
        self.links.iter().map(|l| l.live.count_ones() as usize).sum()
    }

    /// Bytes of everything a walk may read: bounds, links, parents, entries,
    /// runs, fragments and optional columns. Counted, not measured.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.bounds[..])
            + size_of_val(&self.links[..])
            + size_of_val(&self.parent[..])
            + size_of_val(&self.entries[..])
            + size_of_val(&self.material_run[..])
            + self.fragments.as_ref().map_or(0, |f| size_of_val(&f[..]))
            + self.half_spaces.as_ref().map_or(0, |h| size_of_val(&h[..]))
            + self.portals.as_ref().map_or(0, Portals::bytes)
    }

    /// Entries over scene triangles: 1 without replication or splitting.
    pub fn duplication(&self, scene: &Scene) -> f64 {
        self.entries.len() as f64 / scene.len().max(1) as f64
    }

    /// Corners of the piece of triangle at `position`.
    pub fn piece(&self, scene: &Scene, position: u32) -> [DVec3; 3] {
        match &self.fragments {
            Some(f) => f[position as usize],
            None => scene.corners(self.entries[position as usize]),
        }
    }

    /// Draw calls that the range costs: its material runs.
    pub fn material_runs(&self, first: u32, end: u32) -> u32 {
        self.material_run[end as usize - 1] - self.material_run[first as usize] + 1
    }

    /// Fills `material_run` from the entries' materials.
    pub fn number_material_runs(&mut self, scene: &Scene) {
        let mut run = 0;
        self.material_run = (0..self.entries.len())
            .map(|i| {
                let material = |i: usize| scene.material_id[self.entries[i] as usize];
                run += u32::from(i > 0 && material(i) != material(i - 1));
                run
            })
            .collect();
    }

    /// Checks every invariant of the layout against the scene.
    ///
    /// # Panics
    /// With a sentence, if one is broken: that is a bug of the builder.
    pub fn assert_well_formed(&self, scene: &Scene) {
        let blocks = self.links.len();
        assert_eq!(self.bounds.len(), blocks, "one bounds block a link block");
        assert_eq!(self.parent.len(), blocks, "one parent a block");
        assert!(self.root_blocks as usize <= blocks, "root blocks exist");
        assert_eq!(self.material_run.len(), self.entries.len(), "one run number an entry");
        assert!(self.entries.iter().all(|t| (*t as usize) < scene.len()), "entries are triangles");
        let mut seen = vec![false; scene.len()];
        self.entries.iter().for_each(|t| seen[*t as usize] = true);
        assert!(seen.iter().all(|s| *s), "every triangle has an entry");
        self.portals.iter().for_each(|p| p.assert_fits(self));
        let mut reached = vec![false; blocks];
        let mut held = vec![Box32::EMPTY; scene.len()];
        let mut covered = 0;
        for root in 0..self.root_blocks {
            assert_eq!(self.parent[root as usize], NONE, "roots have no parent");
            for lane in self.lanes(root) {
                let links = &self.links[root as usize];
                assert_eq!(links.first[lane], covered, "roots tile the entries in order");
                covered = links.end[lane];
            }
            self.check_block(scene, root, &mut reached, &mut held);
        }
        assert_eq!(covered as usize, self.entries.len(), "roots cover every entry");
        assert!(reached.iter().all(|r| *r), "every block is reached exactly once");
        if self.fragments.is_none() {
            for (t, held) in held.iter().enumerate() {
                assert!(held.contains_box(&scene.triangle_box(t as u32)), "the copies of triangle {t} reach all of it");
            }
        }
    }

    fn lanes(&self, block: u32) -> impl Iterator<Item = usize> + use<> {
        let live = self.links[block as usize].live;
        (0..LANES).filter(move |l| live >> l & 1 == 1)
    }

    fn check_block(&self, scene: &Scene, block: u32, reached: &mut [bool], held: &mut [Box32]) {
        let mut pending = vec![block];
        while let Some(block) = pending.pop() {
            assert!(!std::mem::replace(&mut reached[block as usize], true), "block {block} is reached twice");
            let links = self.links[block as usize];
            assert!(links.live & links.live.wrapping_add(1) == 0 && links.live != 0, "live lanes are the low ones");
            for lane in self.lanes(block) {
                let bounds = self.bounds[block as usize].get(lane);
                let (first, own_end, end) = (links.first[lane], links.own_end[lane], links.end[lane]);
                assert!(first <= own_end && own_end <= end && first < end, "node {block}:{lane} has a proper range");
                for position in first..own_end {
                    let piece = Aabb::of_points(&self.piece(scene, position)).relative_to(self.origin);
                    // One of several copies may reach out of its node: the node
                    // answers for the part inside its box.
                    let clip = Box32 { lo: piece.lo.max(bounds.lo), hi: piece.hi.min(bounds.hi) };
                    assert!(!clip.is_empty(), "an entry touches its node");
                    assert!(self.fragments.is_none() || clip == piece, "bounds hold the own fragments");
                    let held = &mut held[self.entries[position as usize] as usize];
                    *held = held.union(clip);
                }
                let child = links.child[lane];
                if child == NONE {
                    assert_eq!(own_end, end, "a leaf owns its range");
                    continue;
                }
                assert_eq!(
                    self.parent[child as usize],
                    block * LANES as u32 + lane as u32,
                    "children know their parent"
                );
                let mut at = own_end;
                for l in self.lanes(child) {
                    assert_eq!(self.links[child as usize].first[l], at, "children tile the range");
                    at = self.links[child as usize].end[l];
                    assert!(bounds.contains_box(&self.bounds[child as usize].get(l)), "bounds hold the children");
                }
                assert_eq!(at, end, "children end where the parent ends");
                pending.push(child);
            }
        }
    }
}
