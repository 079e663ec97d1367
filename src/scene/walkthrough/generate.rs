//! Seeded walks through free space.

use crate::error::Result;
use crate::math::Pose;
use crate::registry::{self, Entry, Spec};
use crate::scene::Scene;

pub trait Walker: Send + Sync {
    fn walk(&self, scene: &Scene) -> Result<Vec<Pose>>;
}

pub static ALL: &[Entry<dyn Walker>] = &[];

pub fn make(spec: &Spec) -> Result<(Box<dyn Walker>, Spec)> {
    let (entry, resolved) = registry::find("walkthrough generator", ALL, spec)?;
    Ok(((entry.make)(&resolved), resolved))
}
