//! A game map with its own BSP and potentially visible set: what the map's compiler
//! (id Software's `vis`, after Teller 1992) says can be seen from where.
//!
//! Files: `<id>.q3.json` (planes, nodes, leaves with the surfaces that touch them) and
//! `<id>.pvs.bin` (a row of bits for every cluster of leaves), in units of the mesh.

use crate::common::shared;
use cullmark::math::{DVec3, Pose};
use cullmark::oracle::BitSet;
use cullmark::record::{PathSource, PathSpec, SceneSource, SceneSpec, Up, Winding};
use cullmark::scene::{Scene, load, walkthrough};
use serde::Deserialize;

/// Metres a unit: an inch.
pub const UNIT_M: f64 = 0.0254;

/// Plane, front, back; a child below 0 is leaf `-child - 1`.
type Node = (usize, i64, i64);
/// Cluster (below 0: solid or outside), area, bounds, surfaces that touch it.
type Leaf = (i64, i64, f64, f64, f64, f64, f64, f64, Vec<usize>);
/// First triangle, how many, BSP model (0: what stands still), shader.
type Surface = (u32, u32, u32, u32);

#[derive(Deserialize)]
struct Side {
    n_clusters: usize,
    planes: Vec<[f64; 4]>,
    nodes: Vec<Node>,
    leafs: Vec<Leaf>,
    surfaces: Vec<Surface>,
    spawns: Vec<[f64; 3]>,
}

pub struct Map {
    /// The map's own triangles first, then the lids.
    pub scene: Scene,
    /// How many of them are the map's.
    pub own: usize,
    pub spawns: Vec<DVec3>,
    pub clusters: usize,
    name: String,
    spec: SceneSpec,
    side: Side,
    row_bytes: usize,
    rows: Vec<u8>,
}

fn described(name: &str, file: &str, winding: Winding) -> Option<SceneSpec> {
    let source = SceneSource::File(shared(&format!("{name}/{file}")).filter(|f| f.exists())?);
    Some(load::describe(name, source, winding, Some(Up::Z), UNIT_M, false).unwrap())
}

/// Puts `more` behind `scene`, in numbers and in the arrays.
fn append(scene: &mut Scene, more: &Scene) {
    let (vertices, ids) = (scene.positions.len() as u32, scene.source_triangle_count);
    let (objects, materials) = (scene.object_id.iter().max().map_or(0, |o| o + 1), scene.material_names.len() as u32);
    scene.positions.extend(&more.positions);
    scene.triangles.extend(more.triangles.iter().map(|t| t.map(|v| v + vertices)));
    scene.source_triangle_id.extend(more.source_triangle_id.iter().map(|i| i + ids));
    scene.object_id.extend(more.object_id.iter().map(|o| o + objects));
    scene.material_id.extend(more.material_id.iter().map(|m| m + materials));
    scene.two_sided.extend(&more.two_sided);
    scene.occluder.extend(&more.occluder);
    scene.material_names.extend(more.material_names.iter().cloned());
    scene.source_triangle_count += more.source_triangle_count;
    scene.anchor();
}

impl Map {
    /// `None`, with a word, where this machine does not have it. `lids`: with the sky,
    /// which stops sight though it is not part of the mesh.
    pub fn read(name: &str, lids: bool) -> Option<Map> {
        let at = |ending: &str| shared(&format!("{name}/{name}.{ending}"));
        let side: Side = serde_json::from_slice(&std::fs::read(at("q3.json")?).unwrap()).unwrap();
        let bits = std::fs::read(at("pvs.bin")?).unwrap();
        let word = |at: usize| i32::from_le_bytes(bits[at..at + 4].try_into().unwrap()) as usize;
        let (clusters, row_bytes) = (word(0), word(4));
        assert_eq!((clusters, bits.len()), (side.n_clusters, 8 + clusters * row_bytes), "{name}.pvs.bin");
        // As the game draws them, fronts alone.
        let file = ["obj", "glb"].into_iter().find_map(|e| described(name, &format!("{name}.{e}"), Winding::Ccw));
        let spec = file.expect("the mesh beside its BSP");
        let mut scene = load::load(&spec).unwrap();
        assert_eq!(scene.source_triangle_count, side.surfaces.iter().map(|s| s.1).sum::<u32>(), "{name}");
        let own = scene.len();
        if let Some(sky) = described(name, &format!("{name}_sky.obj"), Winding::TwoSided).filter(|_| lids) {
            append(&mut scene, &load::load(&sky).unwrap());
        }
        let spawns = side.spawns.iter().map(|s| DVec3::from_array(*s)).collect();
        let (name, rows) = (name.to_string(), bits[8..].to_vec());
        Some(Map { scene, own, spawns, clusters, name, spec, side, row_bytes, rows })
    }

    /// A path of the map in world metres.
    pub fn path(&self, number: u32) -> Vec<Pose> {
        let source = PathSource::File(shared(&format!("{0}/{0}_path{number}.csv", self.name)).unwrap());
        let path = PathSpec { name: "path".into(), source, frames: None, stride: 1, fingerprint: String::new() };
        walkthrough::load(&path, &self.spec, &self.scene).unwrap()
    }

    /// Views all around, level and upward, from where players start, in world metres.
    pub fn starts(&self) -> Vec<Pose> {
        let view = |start: &DVec3, turn: u32| {
            let (yaw, pitch) = (f64::from(turn) * 1.3, f64::from(turn % 3) * 0.5);
            let flat = DVec3::new(yaw.cos(), yaw.sin(), 0.0);
            let forward = flat * pitch.cos() + DVec3::Z * pitch.sin();
            Pose { eye: *start * UNIT_M, forward, up: DVec3::Z }
        };
        self.spawns.iter().flat_map(|s| (0..5).map(|turn| view(s, turn))).collect()
    }

    /// The leaf that holds a place in units.
    fn leaf(&self, at: DVec3) -> &Leaf {
        let mut child = 0;
        while child >= 0 {
            let (plane, front, back) = self.side.nodes[child as usize];
            let [x, y, z, d] = self.side.planes[plane];
            child = if DVec3::new(x, y, z).dot(at) - d >= 0.0 { front } else { back };
        }
        &self.side.leafs[(-child - 1) as usize]
    }

    /// The cluster that holds a place in units; `None` in solid or outside.
    pub fn cluster(&self, at: DVec3) -> Option<usize> {
        usize::try_from(self.leaf(at).0).ok()
    }

    /// Whether the leaf found for a place has it within the bounds that the file states.
    pub fn is_within_its_leaf(&self, at: DVec3) -> bool {
        let (_, _, x0, y0, z0, x1, y1, z1, _) = self.leaf(at);
        at.cmpge(DVec3::new(*x0, *y0, *z0)).all() && at.cmple(DVec3::new(*x1, *y1, *z1)).all()
    }

    /// Whether `to` may be seen from `from`, by the map.
    pub fn may_see(&self, from: usize, to: usize) -> bool {
        self.rows[from * self.row_bytes + to / 8] >> (to % 8) & 1 == 1
    }

    /// Triangles of the scene that the map excludes for all of `from`: those of what
    /// stands still that touch no cluster which may be seen. `mirrored` reads the bits
    /// of every byte the wrong way round, to show that a wrong reading is noticed.
    pub fn excluded(&self, from: usize, mirrored: bool) -> BitSet {
        let mut touched = vec![false; self.side.surfaces.len()];
        for (cluster, .., surfaces) in &self.side.leafs {
            let Ok(cluster) = usize::try_from(*cluster) else { continue };
            if self.may_see(from, if mirrored { cluster ^ 7 } else { cluster }) {
                surfaces.iter().for_each(|s| touched[*s] = true);
            }
        }
        let mut out = BitSet::new(self.scene.len());
        for ((first, count, model, _), _) in self.side.surfaces.iter().zip(touched).filter(|(_, t)| !t) {
            if *model == 0 {
                // Loading dropped some, and kept the order.
                let ids = &self.scene.source_triangle_id[..self.own];
                let place = |id: u32| ids.partition_point(|i| *i < id) as u32;
                (place(*first)..place(first + count)).for_each(|t| out.insert(t));
            }
        }
        out
    }
}
