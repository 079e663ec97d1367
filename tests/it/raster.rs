//! The depth buffer: facts D4 and D5 of the algorithm notes, its kernels against each other
//! and against a plain z-buffer, and its answers against the oracle.

mod common;
mod kernels;
mod oracle;
mod pyramid;
mod queries;
