//! All integration tests, one binary. Each file is one area; test names are sentences.
//! Those of the lab run without the service too: `cargo test --no-default-features --test it`.

mod common;

mod advice;

mod culling;
#[cfg(feature = "service")]
mod end_to_end;
#[cfg(feature = "service")]
mod faults;
mod generators;
#[cfg(feature = "service")]
mod manifest;
mod oracle;
#[cfg(feature = "service")]
mod preflight;
mod raster;
#[cfg(feature = "service")]
mod readers;
#[cfg(feature = "service")]
mod report;
#[cfg(feature = "service")]
mod scenes;
#[cfg(feature = "service")]
mod service;
#[cfg(feature = "service")]
mod service_faults;
#[cfg(feature = "service")]
mod store;
mod structures;
mod tidy;
#[cfg(feature = "service")]
mod viewing;
