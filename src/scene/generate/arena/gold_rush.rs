//! Gold Rush.
pub(super) use super::nucleus::build;
