//! CHC++.

pub const WALKS: [&str; 0] = [];
