//! Walkthroughs.

pub mod generate;
