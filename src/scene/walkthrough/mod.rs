//! Walkthroughs.
