//! frustum
