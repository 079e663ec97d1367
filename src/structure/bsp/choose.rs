//! Choice of a partition plane: `|F - B| + w S + a [not axis-aligned]` over a few
//! candidates, F, B, S the pieces in front, behind and split.
//!
//! `heuristic = "surface"` puts `A(F) F + A(B) B` in place of `|F - B|`, where A is the
//! surface of the box around a side as a share of that around both: what MacDonald &
//! Booth (1990) minimise for rays, with polygon planes as Ize, Wald & Parker (2008) do.
//! Boxes of the sample stand for the convex cells, as boxes are what culling tests.
//!
//! The form and the weights of the defaults are those of zdbsp, a node builder
//! for Doom maps (`SplitCost` 8, `AAPreference` 16). The score only guides:
//! it counts a sample of the pieces in f32, in structure-of-arrays form, so
//! that one candidate costs a few nanoseconds a piece. What a plane really does
//! is counted exactly before it is taken.

use super::Bsp;
use super::plane::SplitPlane;
use crate::math::{Box32, DVec3, Vec3};
use crate::scene::Scene;
use crate::structure::builder::piece::Piece;

/// Corners and normals of the sampled pieces, f32 offsets from `centre`.
#[derive(Default)]
struct Sample {
    centre: DVec3,
    corner: [[Vec<f32>; 3]; 3],
    normal: [Vec<f32>; 3],
    /// Distance within which a corner counts as in a plane.
    epsilon_m: f32,
}

/// Pieces of the sample in front, behind and split.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Counts {
    front: u32,
    back: u32,
    split: u32,
}

/// Planes worth trying, best first, with about how many pieces their larger side
/// will hold. Ties go to the earlier candidate, so the order depends on the
/// pieces alone.
pub fn ranked_planes(params: &Bsp, scene: &Scene, pieces: &[Piece]) -> Vec<(SplitPlane, usize)> {
    let picks = stride(pieces.len(), params.sample as usize);
    let sample = Sample::of(pieces, &picks);
    let size = picks.len() as u32;
    let scale = pieces.len() as f64 / f64::from(size);
    let mut ranked = Vec::new();
    for triangle in candidates(params.candidates as usize, pieces, &picks) {
        let Some(plane) = SplitPlane::of_triangle(scene.corners(triangle)) else { continue };
        let n = sample.count(&plane);
        // What makes no progress on the sample makes too little on the whole.
        if n.front.max(n.back) + n.split >= size {
            continue;
        }
        let penalty = if plane.is_axis_aligned() { 0.0 } else { params.axis_penalty };
        let sides = match params.surface {
            true => sample.surface(&plane),
            false => f64::from(n.front.abs_diff(n.back)),
        };
        let score = (sides + params.split_weight * f64::from(n.split)) * scale + penalty;
        let larger = f64::from(n.front.max(n.back) + n.split) * scale;
        ranked.push((score, plane, larger as usize));
    }
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().map(|r| (r.1, r.2)).collect()
}

/// About `count` indices spread evenly over `0..len`; all of them if few enough.
fn stride(len: usize, count: usize) -> Vec<usize> {
    if len <= count { (0..len).collect() } else { (0..count).map(|i| i * len / count).collect() }
}

/// Triangles whose planes are tried: a quarter are the largest by area in the
/// sample, the others one from each of equal strata of the pieces.
fn candidates(count: usize, pieces: &[Piece], picks: &[usize]) -> Vec<u32> {
    let largest = (count / 4).min(picks.len());
    let strata = (count - largest).min(pieces.len());
    // Seeded by the pieces: the same tree in every run and on every thread.
    let mut seed = pieces.len() as u64 ^ u64::from(pieces[0].triangle) << 32;
    let mut out: Vec<u32> = (0..strata)
        .map(|i| {
            let (from, to) = (i * pieces.len() / strata, (i + 1) * pieces.len() / strata);
            pieces[from + (splitmix(&mut seed) % (to - from) as u64) as usize].triangle
        })
        .collect();
    if largest > 0 {
        let mut by_area: Vec<(f64, usize)> = picks.iter().map(|i| (pieces[*i].normal().length_squared(), *i)).collect();
        by_area.select_nth_unstable_by(largest - 1, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        by_area.truncate(largest);
        by_area.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        out.extend(by_area.into_iter().map(|(_, i)| pieces[i].triangle));
    }
    let mut seen = std::collections::HashSet::with_capacity(out.len());
    out.retain(|t| seen.insert(*t));
    out
}

/// SplitMix64 (Steele, Lea & Flood 2014).
fn splitmix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ *state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

impl Sample {
    fn of(pieces: &[Piece], picks: &[usize]) -> Sample {
        let centre = pieces[picks[picks.len() / 2]].corners[0];
        let mut s = Sample { centre, ..Sample::default() };
        let mut reach = 0f32;
        for &i in picks {
            for (k, c) in pieces[i].corners.iter().enumerate() {
                let c: Vec3 = (*c - centre).as_vec3();
                reach = reach.max(c.abs().max_element());
                for axis in 0..3 {
                    s.corner[k][axis].push(c[axis]);
                }
            }
            let n: Vec3 = pieces[i].normal().normalize_or_zero().as_vec3();
            for axis in 0..3 {
                s.normal[axis].push(n[axis]);
            }
        }
        // A few roundings of f32 at the far end of the sample.
        s.epsilon_m = reach * 1e-6;
        s
    }

    /// Pieces of each side times the surface of the box around them, over the surface
    /// around all. A spanning piece counts on both sides, with all of its corners.
    fn surface(&self, plane: &SplitPlane) -> f64 {
        let n = plane.unit_normal();
        let offset = n.dot(self.centre - plane.point()) as f32;
        let n: Vec3 = n.as_vec3();
        let (mut boxes, mut counts) = ([Box32::EMPTY; 2], [0u32; 2]);
        for i in 0..self.normal[0].len() {
            let corners: [Vec3; 3] = self.corner.each_ref().map(|c| Vec3::new(c[0][i], c[1][i], c[2][i]));
            let at = corners.map(|c| n.dot(c) + offset);
            let whole = Box32 {
                lo: corners[0].min(corners[1]).min(corners[2]),
                hi: corners[0].max(corners[1]).max(corners[2]),
            };
            let reaches = [at.iter().any(|d| *d > self.epsilon_m), at.iter().any(|d| *d < -self.epsilon_m)];
            let faces = n.dot(Vec3::new(self.normal[0][i], self.normal[1][i], self.normal[2][i])) >= 0.0;
            let sides = if reaches == [false; 2] { [faces, !faces] } else { reaches };
            for side in (0..2).filter(|s| sides[*s]) {
                boxes[side] = boxes[side].union(whole);
                counts[side] += 1;
            }
        }
        let all = boxes[0].union(boxes[1]).half_area().max(f32::MIN_POSITIVE);
        (0..2).map(|s| f64::from(counts[s]) * f64::from(boxes[s].half_area() / all)).sum()
    }

    /// Branchless, so that the compiler can use lanes.
    fn count(&self, plane: &SplitPlane) -> Counts {
        let n = plane.unit_normal();
        let offset = n.dot(self.centre - plane.point()) as f32;
        let n: Vec3 = n.as_vec3();
        let epsilon = self.epsilon_m;
        let len = self.normal[0].len();
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] =
            self.corner.each_ref().map(|c| c.each_ref().map(|v| &v[..len]));
        let [mx, my, mz] = self.normal.each_ref().map(|v| &v[..len]);
        let (mut front, mut back, mut split) = (0u32, 0u32, 0u32);
        for i in 0..len {
            let a = n.x * ax[i] + n.y * ay[i] + n.z * az[i] + offset;
            let b = n.x * bx[i] + n.y * by[i] + n.z * bz[i] + offset;
            let c = n.x * cx[i] + n.y * cy[i] + n.z * cz[i] + offset;
            let faces = (n.x * mx[i] + n.y * my[i] + n.z * mz[i]) >= 0.0;
            let pos = (a > epsilon) | (b > epsilon) | (c > epsilon);
            let neg = (a < -epsilon) | (b < -epsilon) | (c < -epsilon);
            front += u32::from(!neg & (pos | faces));
            back += u32::from(!pos & (neg | !faces));
            split += u32::from(pos & neg);
        }
        Counts { front, back, split }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sampled_score_agrees_with_exact_classification() {
        let mut seed = 5u64;
        let mut unit = || (splitmix(&mut seed) >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
        let pieces: Vec<Piece> = (0..500u32)
            .map(|triangle| {
                let centre = DVec3::new(unit(), unit(), unit()) * 10.0;
                Piece { corners: [(); 3].map(|()| centre + DVec3::new(unit(), unit(), unit())), triangle, made: 0 }
            })
            .collect();
        let sample = Sample::of(&pieces, &stride(pieces.len(), pieces.len()));
        for candidate in pieces.iter().step_by(7) {
            let plane = SplitPlane::of_triangle(candidate.corners).unwrap();
            let mut exact = Counts::default();
            for p in &pieces {
                match plane.place(p, plane.sides(p)) {
                    1 => exact.front += 1,
                    -1 => exact.back += 1,
                    _ => exact.split += 1,
                }
            }
            let near = sample.count(&plane);
            assert_eq!(near.front + near.back + near.split, 500);
            for (a, b) in [(near.front, exact.front), (near.back, exact.back), (near.split, exact.split)] {
                assert!(a.abs_diff(b) <= 2, "{near:?} {exact:?}");
            }
        }
    }

    #[test]
    fn a_stride_is_even_and_never_leaves_the_range() {
        assert_eq!(stride(3, 8), [0, 1, 2]);
        assert_eq!(stride(10, 4), [0, 2, 5, 7]);
    }
}
