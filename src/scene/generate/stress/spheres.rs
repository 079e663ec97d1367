//! `spheres`: icospheres turned at random, so that normals have no favoured
//! direction: the setting of the statistics of facing tests.

use super::soup::{Soup, on_grid};
use super::{Axes, HOLLOW, RADIUS, SEED, Shell};
use crate::math::DVec3;
use crate::registry::{Default, Entry, Param, Spec};
use crate::scene::Scene;
use crate::scene::generate::Generator;
use crate::scene::generate::random::Random;
use std::collections::HashMap;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "spheres",
    about: "stress: closed spheres of isotropic normals, for statistics of facing tests",
    revision: 1,
    params: &[
        Param {
            name: "spheres",
            default: Default::Int { value: 150, min: 1, max: 100_000 },
            about: "number of spheres",
        },
        Param {
            name: "level",
            default: Default::Int { value: 2, min: 0, max: 5 },
            about: "times that an icosahedron's faces are split in four: 20 * 4^level triangles a sphere",
        },
        Param {
            name: "size_m",
            default: Default::Float { value: 2.0, min: 0.5, max: 100.0 },
            about: "largest diameter; the smallest is half of it",
        },
        RADIUS,
        HOLLOW,
        SEED,
    ],
    make: |spec| Box::new(Spheres::new(spec)),
};

struct Spheres {
    spheres: usize,
    level: usize,
    size_m: f64,
    shell: Shell,
    seed: u64,
}

impl Spheres {
    fn new(spec: &Spec) -> Spheres {
        Spheres {
            spheres: spec.int("spheres") as usize,
            level: spec.int("level") as usize,
            size_m: spec.float("size_m"),
            shell: Shell::of(spec),
            seed: spec.int("seed") as u64,
        }
    }
}

impl Generator for Spheres {
    fn generate(&self) -> Scene {
        let mut soup = Soup::new("spheres");
        let mut rng = Random::part(self.seed, 11);
        let (corners, faces) = icosphere(self.level);
        for _ in 0..self.spheres {
            soup.paint_one_of("ball", &mut rng);
            let r = 0.25 * self.size_m * rng.range(1.0, 2.0);
            let axes = Axes::random(&mut rng);
            let at = self.shell.point(r, &mut rng);
            let placed: Vec<DVec3> = corners.iter().map(|p| on_grid(axes.place(at, *p * r))).collect();
            soup.solid(&placed, &faces);
        }
        soup.finish()
    }
}

/// Unit corners, and faces counter-clockwise from outside.
fn icosphere(level: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    // Three golden rectangles.
    let g = (1.0 + 5f64.sqrt()) * 0.5;
    let mut corners: Vec<DVec3> = Vec::with_capacity(12);
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        corners.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)]);
    }
    // Faces are the triples of neighbours, which are 2 apart.
    let near = |a: DVec3, b: DVec3| (a.distance_squared(b) - 4.0).abs() < 1e-9;
    let mut faces = Vec::with_capacity(20);
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [i, j, k].map(|v| corners[v]);
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    faces.push(if outward { [i, j, k] } else { [i, k, j] }.map(|v| v as u32));
                }
            }
        }
    }
    corners.iter_mut().for_each(|p| *p = p.normalize());
    for _ in 0..level {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                corners.push((corners[a as usize] + corners[b as usize]).normalize());
                corners.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    (corners, faces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn icospheres_are_closed_and_have_their_count() {
        for level in 0..4 {
            let (corners, faces) = icosphere(level);
            assert_eq!(faces.len(), 20 << (2 * level));
            assert_eq!(corners.len() * 2, faces.len() + 4, "Euler's formula");
        }
    }
}
