//! facing
