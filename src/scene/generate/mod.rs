//! Seeded scene generators.

use super::Scene;
use crate::error::Result;
use crate::registry::{self, Entry, Spec};

/// Makes the same scene on every platform.
pub trait Generator: Send + Sync {
    fn generate(&self) -> Scene;
}

pub static ALL: &[Entry<dyn Generator>] = &[];

pub fn make(spec: &Spec) -> Result<(Box<dyn Generator>, Spec)> {
    let (entry, resolved) = registry::find("scene generator", ALL, spec)?;
    Ok(((entry.make)(&resolved), resolved))
}
