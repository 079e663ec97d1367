//! glTF 2.0 and GLB: the default scene, nodes depth-first in file order,
//! primitives in order, strips and fans expanded. Transforms are composed in f64.

mod accessor;
mod buffers;

pub use buffers::external_files;

use super::Scene;
use crate::error::{Error, Result};
use crate::math::DVec3;
use accessor::Accessors;
use glam::{DMat4, DQuat};
use gltf::material::AlphaMode;
use gltf::mesh::{Mode, Semantic};
use gltf::scene::Transform;
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

/// A node instance multiplies its mesh: a small file can ask for any number of triangles.
const MAX_TRIANGLES: usize = 1 << 28;

/// Reads a glTF or GLB as it stands: file units and axes, every face, not yet
/// sanitised. `bytes` are the content of `path`; external buffers lie beside it.
///
/// # Errors
/// Truncated or malformed files, missing buffers, accessors out of range, and
/// required extensions that change geometry.
pub fn read(path: &Path, bytes: &[u8]) -> Result<Scene> {
    read_document(path, bytes).map_err(|e| e.in_file(path))
}

fn read_document(path: &Path, bytes: &[u8]) -> Result<Scene> {
    let (json, blob) = buffers::split(bytes)?;
    let document = parse(json)?;
    let data = buffers::load(&document, path, blob)?;
    let mut builder = Builder {
        accessors: Accessors::new(&data),
        scene: Scene::default(),
        object: 0,
        placed: HashMap::new(),
        visited: vec![false; document.nodes().len()],
        skinned: 0,
        morphed: 0,
    };
    builder.materials(&document);
    let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
        return Err(Error::new("the file has no scene").help("export a scene, not a library of meshes"));
    };
    builder.nodes(scene.nodes())?;
    let Builder { mut scene, skinned, morphed, .. } = builder;
    scene.source_triangle_count = scene.len() as u32;
    scene.source_triangle_id = (0..scene.source_triangle_count).collect();
    scene.report.triangles_in_file = scene.len() as u64;
    if skinned + morphed > 0 {
        scene.report.warnings.push(format!(
            "{skinned} skinned and {morphed} morphed meshes are taken as modelled: cullmark scenes do not move"
        ));
    }
    Ok(scene)
}

/// JSON text to a validated document.
fn parse(json: &[u8]) -> Result<gltf::Document> {
    let mut root: gltf::json::Root = gltf::json::deserialize::from_slice(json).map_err(|e| {
        let e = Error::new(format!("not a readable glTF: {e}"));
        if json.is_empty() { e.help("the file is empty or was cut short") } else { e }
    })?;
    // Extensions of appearance leave the triangles alone; the others are named with a way out.
    let harmless = |e: &String| {
        let looks = ["KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "MSFT_texture_"];
        looks.iter().any(|l| e.starts_with(l))
    };
    if let Some(e) = root.extensions_required.iter().find(|e| !harmless(e)) {
        let help = match e.as_str() {
            "KHR_draco_mesh_compression" => "decompress it: gltf-transform copy in.glb out.glb",
            "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
                "decompress it: gltf-transform copy in.glb out.glb"
            }
            "KHR_mesh_quantization" => "store positions as floats: gltf-transform dequantize in.glb out.glb",
            _ => "export it again without this extension",
        };
        return Err(Error::new(format!("requires the extension {e}, which cullmark does not read")).help(help));
    }
    root.extensions_required.clear();
    check_positions(&mut root)?;
    gltf::Document::from_json(root).map_err(|e| {
        let what = match &e {
            gltf::Error::Validation(all) => {
                let few: Vec<_> = all.iter().take(3).map(|(at, what)| format!("{at}: {what}")).collect();
                let more = if all.len() > 3 { format!(" and {} more", all.len() - 3) } else { String::new() };
                few.join("; ") + &more
            }
            other => other.to_string(),
        };
        Error::new(format!("not a valid glTF: {what}")).help("run the Khronos glTF validator on it, or export it again")
    })
}

/// What the crate's own validation needs first: it follows the accessors of
/// positions unchecked, and insists on their bounds, which cullmark never reads.
fn check_positions(root: &mut gltf::json::Root) -> Result<()> {
    use gltf::json::validation::Checked::Valid;
    for (n, mesh) in root.meshes.iter().enumerate() {
        for index in mesh.primitives.iter().filter_map(|p| p.attributes.get(&Valid(Semantic::Positions))) {
            let count = root.accessors.len();
            let Some(accessor) = root.accessors.get_mut(index.value()) else {
                let message = format!("mesh {n} has its positions in accessor {}, of {count}", index.value());
                return Err(Error::new(message).help("the file is damaged: export it again"));
            };
            accessor.min = Some(vec![0.0f32; 3].into());
            accessor.max = accessor.min.clone();
        }
    }
    Ok(())
}

struct Builder<'a> {
    accessors: Accessors<'a>,
    scene: Scene,
    object: u32,
    /// Of the current node, by accessor: vertex of the accessor -> vertex of the scene.
    placed: HashMap<usize, Placed>,
    visited: Vec<bool>,
    skinned: u32,
    morphed: u32,
}

impl Builder<'_> {
    fn materials(&mut self, document: &gltf::Document) {
        let name = |m: gltf::Material| match m.name() {
            Some(name) => name.to_string(),
            None => format!("material {}", m.index().unwrap_or(0)),
        };
        self.scene.material_names = document.materials().map(name).collect();
    }

    /// Depth-first in file order, without recursion: files nest as deep as they like.
    fn nodes<'d>(&mut self, roots: impl Iterator<Item = gltf::Node<'d>>) -> Result<()> {
        let reversed = |nodes: Vec<gltf::Node<'d>>, to_world: DMat4| {
            nodes.into_iter().rev().map(move |n| (n, to_world)).collect::<Vec<_>>()
        };
        let mut pending = reversed(roots.collect(), DMat4::IDENTITY);
        while let Some((node, parent)) = pending.pop() {
            if std::mem::replace(&mut self.visited[node.index()], true) {
                return Err(Error::new(format!("node {} has two parents or contains itself", node.index()))
                    .help("glTF nodes form trees: export it again"));
            }
            let to_world = parent * local(&node.transform());
            if let Some(mesh) = node.mesh() {
                self.skinned += u32::from(node.skin().is_some());
                self.placed.clear();
                for primitive in mesh.primitives() {
                    let place =
                        || format!("node {}, mesh {}, primitive {}", node.index(), mesh.index(), primitive.index());
                    self.primitive(&primitive, &to_world).map_err(|e| e.key(place()))?;
                }
                self.object += 1;
            }
            pending.extend(reversed(node.children().collect(), to_world));
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &gltf::Primitive, to_world: &DMat4) -> Result<()> {
        self.morphed += u32::from(primitive.morph_targets().len() > 0);
        let Some(accessor) = primitive.get(&Semantic::Positions) else {
            return Ok(()); // legal: nothing to draw without an extension
        };
        let positions = self.accessors.positions(&accessor)?;
        let indices: Rc<Vec<u32>> = match primitive.indices() {
            Some(a) => self.accessors.indices(&a)?,
            None => Rc::new((0..positions.len() as u32).collect()),
        };
        let corners = match primitive.mode() {
            Mode::Triangles => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            Mode::TriangleStrip => strip(&indices),
            Mode::TriangleFan => fan(&indices),
            mode => {
                self.scene.report.points_and_lines += points_or_lines(mode, indices.len());
                return Ok(());
            }
        };
        if let Some(i) = corners.iter().flatten().find(|i| **i as usize >= positions.len()) {
            return Err(Error::new(format!("index {i} is out of range: there are {} vertices", positions.len()))
                .help("the file is damaged: export it again"));
        }
        if self.scene.len() + corners.len() > MAX_TRIANGLES {
            return Err(Error::new(format!("the scene has more than {MAX_TRIANGLES} triangles"))
                .help("instances count each time they are placed: split the scene"));
        }
        // A mirrored node turns the mesh inside out; glTF says its winding flips with it.
        let mirrored = to_world.determinant() < 0.0;
        let dense = positions.len() < 16 * corners.len();
        let placed = self.placed.entry(accessor.index()).or_insert_with(|| Placed::new(positions.len(), dense));
        let vertices = &mut self.scene.positions;
        for [a, b, c] in &corners {
            let mut at = |i: u32| {
                placed.get_or_insert(i, || {
                    vertices.push(to_world.transform_point3(DVec3::from(positions[i as usize].map(f64::from))));
                    vertices.len() as u32 - 1
                })
            };
            let [a, b, c] = [at(*a), at(*b), at(*c)];
            self.scene.triangles.push(if mirrored { [a, c, b] } else { [a, b, c] });
        }
        let material = primitive.material();
        let names = &mut self.scene.material_names;
        let id = material.index().unwrap_or_else(|| {
            // Faces without material get one of their own, after those of the file.
            let default = names.iter().position(|n| n == "(none)").unwrap_or(names.len());
            if default == names.len() {
                names.push("(none)".to_string());
            }
            default
        });
        let total = self.scene.len();
        self.scene.object_id.resize(total, self.object);
        self.scene.material_id.resize(total, id as u32);
        self.scene.two_sided.resize(total, material.double_sided());
        self.scene.occluder.resize(total, material.alpha_mode() == AlphaMode::Opaque);
        Ok(())
    }
}

/// Which vertices of an accessor stand in the scene already, for one node. Only
/// used ones are placed: many files share one large accessor between small meshes.
enum Placed {
    Dense(Vec<u32>),
    Sparse(HashMap<u32, u32>),
}

impl Placed {
    fn new(vertices: usize, dense: bool) -> Placed {
        if dense { Placed::Dense(vec![u32::MAX; vertices]) } else { Placed::Sparse(HashMap::new()) }
    }

    fn get_or_insert(&mut self, i: u32, new: impl FnOnce() -> u32) -> u32 {
        match self {
            Placed::Sparse(map) => *map.entry(i).or_insert_with(new),
            Placed::Dense(table) => {
                let slot = &mut table[i as usize];
                if *slot == u32::MAX {
                    *slot = new();
                }
                *slot
            }
        }
    }
}

/// The node's own transform in f64. Rotations are made unit again, since f32 left
/// them a little off and scales would drift down a deep hierarchy.
fn local(transform: &Transform) -> DMat4 {
    match transform {
        Transform::Matrix { matrix } => DMat4::from_cols_array_2d(&matrix.map(|c| c.map(f64::from))),
        Transform::Decomposed { translation, rotation, scale } => {
            let rotation = DQuat::from_array(rotation.map(f64::from));
            let unit = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
            let vector = |v: &[f32; 3]| DVec3::from(v.map(f64::from));
            DMat4::from_scale_rotation_translation(vector(scale), unit, vector(translation))
        }
    }
}

/// Every other triangle of a strip has its first two corners swapped, so that all face alike.
fn strip(i: &[u32]) -> Vec<[u32; 3]> {
    i.windows(3).enumerate().map(|(n, w)| if n % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }).collect()
}

fn fan(i: &[u32]) -> Vec<[u32; 3]> {
    i.get(1..).unwrap_or(&[]).windows(2).map(|w| [i[0], w[0], w[1]]).collect()
}

fn points_or_lines(mode: Mode, indices: usize) -> u64 {
    (match mode {
        Mode::Lines => indices / 2,
        Mode::LineStrip => indices.saturating_sub(1),
        _ => indices, // points, and loops with as many segments as points
    }) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_one_facing() {
        assert_eq!(strip(&[0, 1, 2, 3, 4]), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
        assert_eq!(fan(&[7, 1, 2, 3]), [[7, 1, 2], [7, 2, 3]]);
        assert!(strip(&[0, 1]).is_empty() && fan(&[]).is_empty() && fan(&[0, 1]).is_empty());
    }

    #[test]
    fn a_rotation_off_unit_does_not_scale() {
        let t = Transform::Decomposed { translation: [1.0, 2.0, 3.0], rotation: [0.0, 0.0, 2.0, 0.0], scale: [1.0; 3] };
        assert_eq!(local(&t).transform_point3(DVec3::X), DVec3::new(0.0, 2.0, 3.0));
    }
}
