//! Tests: structures.
