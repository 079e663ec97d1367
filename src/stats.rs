//! Medians, spreads and intervals.
