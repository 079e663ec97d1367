//! Pairs of triangles that are one convex quadrilateral: a wall's halves.
//!
//! With inner coverage a pixel on the diagonal lies in neither half and would stay open;
//! drawn by its outer sides the pair fills it. Only exactly coplanar triangles of
//! one kind pair, so that one plane bounds the nearness of both. If rounding took a
//! quadrilateral for convex that is not, its sides leave only part of it. "Exactly" is of
//! corners about the scene's origin: what one rounding of f64 joins counts as joined.

use crate::math::{DVec3, exact};
use std::cmp::Ordering;
use std::collections::HashMap;

/// For each triangle of a batch how many positions on its partner is; 0 for none. `words`
/// name its corners by vertex, and its kind.
pub fn of(words: &[u32], corners: &[[DVec3; 3]]) -> Vec<i8> {
    let side = |t: usize, k: usize| ((words[t] >> (8 * k)) as u8, (words[t] >> (8 * ((k + 1) % 3))) as u8);
    let mut sides = HashMap::new();
    for t in (0..words.len()).filter(|t| words[*t] >> 24 != 0) {
        (0..3).for_each(|k| {
            sides.entry(side(t, k)).or_insert((t, k));
        });
    }
    let mut partner = vec![0i8; words.len()];
    for t in (0..words.len()).filter(|t| words[*t] >> 24 != 0) {
        if partner[t] != 0 {
            continue;
        }
        let mut best: Option<(f64, usize)> = None;
        for k in 0..3 {
            let (a, b) = side(t, k);
            let Some(&(o, ok)) = sides.get(&(b, a)) else { continue };
            // Positions of a batch are at most 127 apart.
            if o <= t || partner[o] != 0 || words[o] >> 24 != words[t] >> 24 {
                continue;
            }
            let quad = [corners[t][k], corners[o][(ok + 2) % 3], corners[t][(k + 1) % 3], corners[t][(k + 2) % 3]];
            let shared = quad[0].distance_squared(quad[2]);
            if best.is_none_or(|(most, _)| shared > most) && is_convex(&quad) && is_flat(&quad) {
                best = Some((shared, o));
            }
        }
        if let Some((_, o)) = best {
            (partner[t], partner[o]) = ((o - t) as i8, -((o - t) as i8));
        }
    }
    partner
}

fn is_flat(quad: &[DVec3; 4]) -> bool {
    exact::sign_of_differences(quad[0], quad[1], quad[2], quad[3]) == Ordering::Equal
}

fn is_convex(quad: &[DVec3; 4]) -> bool {
    let turn = |i: usize| {
        let (a, b, c) = (quad[i], quad[(i + 1) % 4], quad[(i + 2) % 4]);
        (b - a).cross(c - b)
    };
    let normal = turn(0) + turn(2);
    (0..4).all(|i| turn(i).dot(normal) > 0.0)
}

/// The quadrilateral of two triangles that are partners, from their corners by vertex, in order.
pub fn joined<T: Copy + PartialEq>(a: [T; 3], b: [T; 3]) -> Option<[T; 4]> {
    (0..3).find_map(|k| {
        let (from, to) = (a[k], a[(k + 1) % 3]);
        let apex = (0..3).find(|i| b[*i] == to && b[(i + 1) % 3] == from).map(|i| b[(i + 2) % 3])?;
        Some([from, apex, to, a[(k + 2) % 3]])
    })
}
