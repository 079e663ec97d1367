//! cullmark: a laboratory and service for visibility culling.
//!
//! # Code map
//! Two halves meet at plain types in [`record`]:
//! - the **lab** (`math`, `scene`, `hierarchy`, `raster`, `structure`, `culling`, `oracle`,
//!   `runner`, `advice`, `stats`, `viewing`) is synchronous: no tokio, no SQL, no HTTP, no clock
//!   inside an algorithm;
//! - the **service** (`manifest`, `matrix`, `store`, `worker`, `report`, `cli`)
//!   knows nothing of triangles; what it needs of them it asks of the lab in a
//!   child process.
//!
//! # Conventions
//! Right-handed, z up, metres, radians. Sources are f64; hot data are f32
//! offsets from [`scene::Scene::origin`], bounds rounded outward. Triangles are
//! counter-clockwise seen from the front. Depth grows away from the eye.
//! Durations end in `_ns`, lengths in `_m`. Ranges are half-open, indices `u32`.

pub mod advice;
pub mod culling;
pub mod error;
pub mod hierarchy;
pub mod machine;
pub mod math;
pub mod oracle;
pub mod preview;
pub mod raster;
pub mod record;
pub mod registry;
pub mod runner;
pub mod scene;
pub mod stats;
pub mod structure;
pub mod viewing;

#[cfg(feature = "service")]
pub mod api;
#[cfg(feature = "manifest")]
pub mod claim;
#[cfg(feature = "service")]
pub mod cli;
#[cfg(feature = "service")]
pub mod intake;
#[cfg(feature = "manifest")]
pub mod manifest;
#[cfg(feature = "manifest")]
pub mod matrix;
#[cfg(feature = "service")]
pub mod report;
#[cfg(feature = "manifest")]
pub mod results;
#[cfg(feature = "service")]
pub mod store;
#[cfg(feature = "manifest")]
pub mod sweep;
#[cfg(feature = "service")]
pub mod worker;

pub use error::{Error, Result};
