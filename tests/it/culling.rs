//! Tests: culling.
