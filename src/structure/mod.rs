//! Spatial structures: each file builds one into the common [`Hierarchy`].
//! Adding one is its file and its line in [`ALL`].

pub mod bsp;
pub mod builder;
pub mod bvh;
pub mod hybrid;
pub mod irregular_grid;
pub mod kd_tree;
pub mod list;
pub mod nested_grid;
pub mod octree;
pub mod portal_octree;
pub mod uniform_grid;

use crate::error::Result;
use crate::hierarchy::Hierarchy;
use crate::registry::{Entry, Spec, find};
use crate::scene::Scene;

/// Parameters of a structure, ready to build it over any scene.
pub trait Structure: Send + Sync {
    /// # Errors
    /// When the parameters do not suit the scene (a BSP that splits without end);
    /// the message says which parameter to change.
    fn build(&self, scene: &Scene) -> Result<Hierarchy>;
}

/// Sorted by name.
pub static ALL: &[Entry<dyn Structure>] = &[
    bsp::ENTRY,
    bvh::ENTRY,
    hybrid::ENTRY,
    irregular_grid::ENTRY,
    kd_tree::ENTRY,
    list::ENTRY,
    nested_grid::ENTRY,
    octree::ENTRY,
    portal_octree::ENTRY,
    uniform_grid::ENTRY,
];

/// Finds and checks a structure, also what its parameters say together.
pub fn find_structure(spec: &Spec) -> Result<(&'static Entry<dyn Structure>, Spec)> {
    let (entry, resolved) = find("structure", ALL, spec)?;
    bvh::check(&resolved)?;
    Ok((entry, resolved))
}

/// The structure that `spec` names, with the spec's defaults filled in.
pub fn make(spec: &Spec) -> Result<(Box<dyn Structure>, Spec)> {
    let (entry, resolved) = find_structure(spec)?;
    Ok((entry.build(&resolved), resolved))
}
