//! Tests: generators.
