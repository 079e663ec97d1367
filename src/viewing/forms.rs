//! The binary forms: little-endian, four bytes a field unless said otherwise.
//!
//! - `CMSH`: magic, version, vertices V, triangles T; f32 x 3V positions, u32 x 3T
//!   indices, u32 x T colours (`0x00RRGGBB`, bit 24: two-sided).
//! - `CMND`: magic, version, nodes N, 0; per node f32 lo x 3, f32 hi x 3, u32 depth.
//! - `CMFR`: magic, version, triangles T, nodes N, submitted, visible, lost, flags
//!   (bit 0: truth was computed); T bytes ([`State`]), zeros up to a multiple of 4;
//!   N bytes ([`super::nodes`]).

use super::nodes::{self, Numbers};
use crate::hierarchy::Hierarchy;
use crate::preview::material_colours;
use crate::scene::Scene;

pub const VERSION: u32 = 1;
/// Flag of `CMFR`.
pub const TRUTH: u32 = 1;
/// Bit of a colour.
pub const TWO_SIDED: u32 = 1 << 24;

/// What became of a triangle: one byte.
pub struct State;

impl State {
    pub const NOT_SUBMITTED: u8 = 0;
    /// Submitted, and not seen (or nobody looked).
    pub const UNSEEN: u8 = 1;
    /// Submitted and seen.
    pub const SEEN: u8 = 2;
    /// Seen, and not submitted where it is seen: a false cull.
    pub const LOST: u8 = 3;
}

/// Sums of a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    pub submitted: u32,
    pub visible: u32,
    pub lost: u32,
    pub truth: bool,
}

fn start(magic: &[u8; 4], fields: &[u32], body: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(8 + 4 * fields.len() + body);
    out.extend_from_slice(magic);
    words(&mut out, [VERSION]);
    words(&mut out, fields.iter().copied());
    out
}

fn words(out: &mut Vec<u8>, words: impl IntoIterator<Item = u32>) {
    words.into_iter().for_each(|w| out.extend_from_slice(&w.to_le_bytes()));
}

pub fn mesh(scene: &Scene) -> Vec<u8> {
    let (vertices, triangles) = (scene.positions.len(), scene.len());
    let mut out = start(b"CMSH", &[vertices as u32, triangles as u32], 12 * vertices + 16 * triangles);
    for p in &scene.positions {
        words(&mut out, (*p - scene.origin).as_vec3().to_array().map(f32::to_bits));
    }
    words(&mut out, scene.triangles.iter().flatten().copied());
    let colours: Vec<u32> =
        material_colours(scene).iter().map(|[r, g, b]| u32::from_be_bytes([0, *r, *g, *b])).collect();
    let plain = 0x00b2_b2b2;
    for (material, two_sided) in scene.material_id.iter().zip(&scene.two_sided) {
        let colour = colours.get(*material as usize).copied().unwrap_or(plain);
        words(&mut out, [colour | if *two_sided { TWO_SIDED } else { 0 }]);
    }
    out
}

/// Bounds as the structure holds them: f32 offsets from the origin, rounded outward.
pub fn nodes(hierarchy: &Hierarchy) -> Vec<u8> {
    let numbers = Numbers::of(hierarchy);
    let depths = nodes::depths(hierarchy);
    let mut out = start(b"CMND", &[numbers.count(), 0], 28 * numbers.count() as usize);
    for (block, depth) in depths.iter().enumerate() {
        for lane in nodes::lanes(hierarchy.links[block].live) {
            let bounds = hierarchy.bounds[block].get(lane);
            words(&mut out, bounds.lo.to_array().map(f32::to_bits));
            words(&mut out, bounds.hi.to_array().map(f32::to_bits));
            words(&mut out, [*depth]);
        }
    }
    out
}

pub fn frame(states: &[u8], decisions: &[u8], counts: Counts) -> Vec<u8> {
    let flags = if counts.truth { TRUTH } else { 0 };
    let Counts { submitted, visible, lost, .. } = counts;
    let fields = [states.len() as u32, decisions.len() as u32, submitted, visible, lost, flags];
    let mut out = start(b"CMFR", &fields, states.len() + 3 + decisions.len());
    out.extend_from_slice(states);
    out.resize(out.len().next_multiple_of(4), 0);
    out.extend_from_slice(decisions);
    out
}
