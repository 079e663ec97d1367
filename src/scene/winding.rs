//! Does the stated winding look right? Random rays are cast through the scene;
//! from free space nearly every first hit should show a front.

use super::Scene;
use crate::math::{Aabb, DVec3};
use crate::record::Winding;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rayon::prelude::*;

/// Rays of a probe: the share is then good to about 0.03.
const RAYS: usize = 512;
/// Fewer hits than this say nothing.
const MIN_HITS: u32 = 16;
/// Larger scenes go unprobed: a probe may cost a second, not a minute.
const MAX_TRIANGLES: usize = 30_000_000;
const SEED: u64 = 0x7769_6e64;

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

impl Ray {
    /// Möller and Trumbore 1997. Edge hits count, edge-on triangles do not.
    fn hit(&self, [a, b, c]: [DVec3; 3]) -> Option<f64> {
        let (e, f) = (b - a, c - a);
        let n = e.cross(f);
        let det = -n.dot(self.direction);
        let s = self.from - a;
        let t = n.dot(s) / det;
        if !(t > 0.0 && t < f64::INFINITY) {
            return None;
        }
        let m = s.cross(self.direction);
        let (u, v) = (f.dot(m) / det, -e.dot(m) / det);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(t)
    }

    /// Where the ray enters a box that it meets before `far`; the far side is moved
    /// out by a few roundings, so that no triangle in the box is missed (Ize 2013).
    fn enters(&self, b: &Aabb, far: f64) -> bool {
        let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (from, d) = (self.from[axis], self.direction[axis]);
            if d == 0.0 {
                // Along the slab: in it, walls included, or never.
                if from < b.lo[axis] || from > b.hi[axis] {
                    return false;
                }
                continue;
            }
            let (s, t) = ((b.lo[axis] - from) / d, (b.hi[axis] - from) / d);
            enter = enter.max(s.min(t));
            leave = leave.min(s.max(t));
        }
        enter <= leave * (1.0 + 8.0 * f64::EPSILON) && enter <= far * (1.0 + 8.0 * f64::EPSILON)
    }
}

/// Triangles a block of [`first_hits`].
const BLOCK: usize = 64;

/// Nearest hits of all rays, in their order. Ties go to the lower triangle, so
/// the result does not depend on the number of threads. Triangles are taken in
/// blocks along a Z-order curve (Morton 1966) and blocks passed over by their
/// bounds: no tree, and ten to thirty times less work.
pub fn first_hits(scene: &Scene, rays: &[Ray]) -> Vec<Option<Hit>> {
    let bounds = scene.bounds();
    let cell = 256.0 / bounds.size().max_element().max(f64::MIN_POSITIVE);
    let mut keyed: Vec<(u32, u32)> = (0..scene.len() as u32)
        .into_par_iter()
        .map(|t| {
            let [a, b, c] = scene.corners(t);
            (z_order(((a + b + c) / 3.0 - bounds.lo) * cell), t)
        })
        .collect();
    keyed.par_sort_unstable();
    let triangles: Vec<u32> = keyed.into_iter().map(|(_, t)| t).collect();
    let bounds: Vec<Aabb> = triangles
        .par_chunks(BLOCK)
        .map(|block| block.iter().fold(Aabb::EMPTY, |b, t| b.union(scene.triangle_aabb(*t))))
        .collect();
    let cast = |ray: &Ray| {
        let mut best: Option<Hit> = None;
        for (block, bounds) in triangles.chunks(BLOCK).zip(&bounds) {
            if !ray.enters(bounds, best.map_or(f64::INFINITY, |h| h.t)) {
                continue;
            }
            for triangle in block {
                if let Some(t) = ray.hit(scene.corners(*triangle))
                    && best.is_none_or(|h| (t, *triangle) < (h.t, h.triangle))
                {
                    best = Some(Hit { t, triangle: *triangle });
                }
            }
        }
        best
    };
    rays.par_iter().map(cast).collect()
}

/// Eight bits of each coordinate, interleaved.
fn z_order(p: DVec3) -> u32 {
    let spread = |x: f64| (0..8).fold(0, |s, bit| s | ((x as u32).min(255) >> bit & 1) << (3 * bit));
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

/// First hits seen from the front, of all first hits on one-sided triangles.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Probe {
    pub front: u32,
    pub hits: u32,
}

impl Probe {
    /// `None` if nothing one-sided was hit.
    pub fn share(&self) -> Option<f64> {
        (self.hits > 0).then(|| f64::from(self.front) / f64::from(self.hits))
    }
}

/// The probe without a camera path. Of a random triangle both sides are looked
/// from, along mirrored random directions; the side that sees farther is taken
/// for free space (solids are thinner than the space between them), and a ray
/// from there back to the triangle is a first hit. Random triangles, not random
/// places: modellers spend triangles where one looks, and the void around a
/// closed map has few. In the manner of Takayama et al. 2014, but for the whole
/// scene at once.
///
/// Open scenes give 0.7 and more; densely walled ones come near 0.5, so only a
/// share well below that speaks against the winding.
pub fn probe_blind(scene: &Scene) -> Probe {
    if scene.len() > MAX_TRIANGLES || scene.two_sided.iter().all(|t| *t) {
        return Probe::default();
    }
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(SEED));
    let mut rays = Vec::with_capacity(RAYS);
    // Bounded tries: nearly all triangles may be two-sided.
    for _ in 0..16 * RAYS {
        let t = ((dice.unit() * scene.len() as f64) as usize).min(scene.len() - 1);
        if scene.two_sided[t] || rays.len() == RAYS {
            continue;
        }
        let [a, b, c] = scene.corners(t as u32);
        let (centre, n) = ((a + b + c) / 3.0, scene.normal(t as u32).normalize_or_zero());
        let away = (n + dice.direction() * 0.999).normalize_or(n);
        let step = n * ((b - a).length() + (c - a).length()) * 1e-4;
        rays.push(Ray { from: centre + step, direction: away });
        rays.push(Ray { from: centre - step, direction: away - 2.0 * n * away.dot(n) });
    }
    let hits = first_hits(scene, &rays);
    let mut probe = Probe::default();
    for pair in hits.chunks_exact(2) {
        let reach = |h: Option<Hit>| h.map_or(f64::INFINITY, |h| h.t);
        let (front, back) = (reach(pair[0]), reach(pair[1]));
        if front != back {
            probe.hits += 1;
            probe.front += u32::from(front > back);
        }
    }
    probe
}

/// The probe from places known to be free, such as the eyes of a camera path:
/// well above 0.9 if the winding is right, well below 0.1 if it is inverted.
pub fn probe_from(scene: &Scene, eyes: &[DVec3]) -> Probe {
    if scene.len() > MAX_TRIANGLES || eyes.is_empty() {
        return Probe::default();
    }
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(SEED));
    let eye = |i: usize| eyes[i * eyes.len() / RAYS];
    let rays: Vec<Ray> = (0..RAYS).map(|i| Ray { from: eye(i), direction: dice.direction() }).collect();
    let mut probe = Probe::default();
    for (ray, hit) in rays.iter().zip(first_hits(scene, &rays)) {
        if let Some(hit) = hit.filter(|h| !scene.two_sided[h.triangle as usize]) {
            probe.hits += 1;
            probe.front += u32::from(scene.normal(hit.triangle).dot(ray.direction) < 0.0);
        }
    }
    probe
}

/// A blind share below this contradicts the stated winding. Of eleven real scenes the
/// lowest right one has 0.50 (a closed map); inverted, seven fall below 0.4.
const SUSPICIOUS_BLIND: f64 = 0.4;
/// Seen from eyes on a path the question is plain.
const SUSPICIOUS_FROM_EYES: f64 = 0.5;

/// Probes a loaded scene without a path, notes the share in its report, and warns
/// if the stated winding looks wrong.
pub fn check(scene: &mut Scene, stated: Winding) {
    let probe = probe_blind(scene);
    scene.report.front_hit_share = probe.share();
    scene.report.warnings.extend(warning(probe, SUSPICIOUS_BLIND, stated));
}

/// The warning, if any, that the eyes of a path give cause for.
pub fn warning_from(scene: &Scene, eyes: &[DVec3], stated: Winding) -> Option<String> {
    warning(probe_from(scene, eyes), SUSPICIOUS_FROM_EYES, stated)
}

fn warning(probe: Probe, limit: f64, stated: Winding) -> Option<String> {
    let share = probe.share().filter(|s| *s < limit && probe.hits >= MIN_HITS)?;
    let other = match stated {
        Winding::Ccw => "cw",
        Winding::Cw => "ccw",
        Winding::TwoSided => return None,
    };
    Some(format!(
        "winding looks wrong: only {:.0} % of first hits show a front; try winding = \"{other}\" (or \"two_sided\")",
        share * 100.0
    ))
}

/// Platform-independent randomness: no sine, no cosine.
struct Dice(ChaCha8Rng);

impl Dice {
    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform on the sphere, by rejection from the cube.
    fn direction(&mut self) -> DVec3 {
        loop {
            let d = DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0;
            if (1e-3..=1.0).contains(&d.length_squared()) {
                return d.normalize();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Winding;

    /// A closed unit cube around the origin, seen from outside; `n` copies in a row.
    fn cubes(n: u32) -> Scene {
        let mut s = Scene::default();
        for k in 0..n {
            let base = s.positions.len() as u32;
            for i in 0..8 {
                let corner = DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) - 0.5;
                s.positions.push(corner + DVec3::X * 4.0 * f64::from(k));
            }
            for q in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
                s.triangles.push([base + q[0], base + q[1], base + q[2]]);
                s.triangles.push([base + q[0], base + q[2], base + q[3]]);
            }
        }
        s.two_sided = vec![false; s.len()];
        s
    }

    #[test]
    fn an_inverted_scene_is_suspected_and_the_right_one_is_not() {
        let mut s = cubes(5);
        check(&mut s, Winding::Ccw);
        assert!(s.report.front_hit_share.unwrap() > 0.9 && s.report.warnings.is_empty(), "{:?}", s.report);
        s.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        check(&mut s, Winding::Ccw);
        assert!(s.report.front_hit_share.unwrap() < 0.1);
        assert!(s.report.warnings[0].contains("try winding = \"cw\""), "{:?}", s.report.warnings);
    }

    #[test]
    fn eyes_inside_a_room_decide_what_is_inverted() {
        // The same cube is a block from outside and an inverted room from inside.
        let mut s = cubes(1);
        assert_eq!(probe_from(&s, &[DVec3::ZERO]).share(), Some(0.0));
        assert!(warning_from(&s, &[DVec3::ZERO], Winding::Ccw).is_some());
        assert_eq!(probe_from(&s, &[DVec3::X * 0.6]).share(), Some(1.0));
        s.two_sided.fill(true);
        assert_eq!(probe_from(&s, &[DVec3::ZERO]).share(), None, "what has no back says nothing");
    }

    #[test]
    fn first_hits_take_the_nearest_and_the_lower_number_on_ties() {
        let mut s = cubes(2);
        s.triangles.extend_from_within(..12);
        let ray = Ray { from: DVec3::new(-5.0, 0.1, 0.2), direction: DVec3::X };
        let hit = first_hits(&s, &[ray])[0].unwrap();
        assert_eq!((hit.t, hit.triangle / 12), (4.5, 0));
        let away = Ray { direction: -DVec3::X, ..ray };
        assert_eq!(first_hits(&s, &[away]), [None]);
    }

    #[test]
    fn passing_over_blocks_changes_no_hit() {
        // Rays along the axes through corners and in the planes of faces are the hard ones.
        let s = cubes(40);
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(3));
        let mut rays: Vec<Ray> = Vec::new();
        for i in 0..300 {
            let from = (DVec3::new(dice.unit() * 80.0, dice.unit(), dice.unit()) * 4.0).round() * 0.5 - 1.0;
            let axis = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Z, DVec3::new(1.0, 0.0, 1.0), dice.direction()];
            rays.push(Ray { from, direction: axis[i % axis.len()] });
        }
        let naive = |ray: &Ray| {
            let hits = (0..s.len() as u32).filter_map(|t| Some(Hit { t: ray.hit(s.corners(t))?, triangle: t }));
            hits.reduce(|a, b| if b.t < a.t { b } else { a })
        };
        let found = first_hits(&s, &rays);
        assert_eq!(found, rays.iter().map(naive).collect::<Vec<_>>());
        assert!(found.iter().flatten().count() > 50, "the comparison is not about misses");
    }
}
