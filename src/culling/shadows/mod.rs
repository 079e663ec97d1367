//! Shadows of chosen occluders on the image plane, fused in a tree (Bittner, Havran &
//! Slavik 1998): the parts of the walk `occlusion_tree`.
//!
//! A plane through the eye and an edge is a line of the image plane, so all of this is
//! two-dimensional; with parallel rays, too. What rounding may do is held by three
//! numbers, each far above the one before:
//! - [`TAU`], by which a cut overlaps, so that no direction falls between two parts;
//! - `guard / MARGIN`, what coordinates of the image may be wrong by: boxes and edges seen
//!   so steeply that they might be worse are left out;
//! - `guard`, by which shadows shrink at edges that they do not share.
//!
//! At an edge that two shadows share there is no guard, else none could fuse. A direction
//! that rounding puts on the wrong side there is within `guard / MARGIN` of the edge and
//! `guard` away from its ends, so in the other shadow, whose angles are not that acute.

pub(super) mod caster;
pub(super) mod choice;
pub(super) mod image;
pub(super) mod merge;
pub(super) mod outline;
pub(super) mod polygons;
pub(super) mod tree;

/// Of the larger half extent of the image.
const GUARD: f64 = 1e-6;
const MARGIN: f64 = 200.0;
const TAU: f64 = 1e-7 * GUARD;
