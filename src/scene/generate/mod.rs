//! Seeded scene generators: the same bytes on every platform.
//!
//! Only integer and IEEE-exact f64 operations and `libm` take part, random
//! numbers are ChaCha8 with a mapping of our own, and every vertex of a building is a
//! multiple of 2^-12 m. A change of what a generator makes must raise its `revision`
//! (a test pins the content hashes), because scenes are cached by it.

mod arena;
mod blocks;
mod budget;
mod builder;
mod props;
pub(in crate::scene) mod random;
mod rooms;
mod solids;
mod stress;
mod terrain;

use crate::error::{Error, Result};
use crate::registry::{Entry, Spec, Value, find};
use crate::scene::Scene;

/// A scene that can be made from nothing but its parameters.
pub trait Generator: Send + Sync {
    fn generate(&self) -> Scene;
}

/// Sorted by name.
pub static ALL: &[Entry<dyn Generator>] = &[
    arena::ENTRY,
    blocks::ENTRY,
    stress::BOXES,
    stress::COPLANAR,
    stress::DEGENERATE,
    stress::GRAZING,
    rooms::ENTRY,
    stress::SLIVERS,
    stress::SPHERES,
    stress::WALLS,
];

/// The generator that `spec` names, with the spec's defaults filled in.
///
/// # Errors
/// Unknown names and parameters, and triangle counts too small to build the scene's walls.
pub fn make(spec: &Spec) -> Result<(Box<dyn Generator>, Spec)> {
    let (entry, resolved) = find("generator", ALL, spec)?;
    let least = match entry.name {
        "arena" => arena::least(&resolved),
        "blocks" => blocks::TRIANGLES_MIN,
        _ => rooms::TRIANGLES_MIN,
    };
    if let Some(Value::Int(n)) =
        resolved.params.get("triangles").filter(|n| **n != Value::Int(0) && **n < Value::Int(least))
    {
        return Err(Error::new(format!("is {n}, but `{}` needs at least {least} triangles for its walls", entry.name))
            .key("triangles")
            .help(format!("give {least} or more, or 0 for the published count")));
    }
    Ok((entry.build(&resolved), resolved))
}
