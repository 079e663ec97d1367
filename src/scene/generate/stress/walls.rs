//! `walls`: columns of upright or leaning walls, for tests that know normals by
//! azimuth alone. The columns have neither top nor bottom, so that every normal
//! is a wall's; from between their heights nobody sees that.

use super::soup::{Soup, on_grid};
use super::{HOLLOW, RADIUS, SEED, Shell};
use crate::math::DVec3;
use crate::registry::{Default, Entry, Param, Spec};
use crate::scene::Scene;
use crate::scene::generate::Generator;
use crate::scene::generate::random::Random;
use std::f64::consts::TAU;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "walls",
    about: "stress: many-sided columns of upright or leaning walls, for tests by azimuth",
    revision: 1,
    params: &[
        Param { name: "walls", default: Default::Int { value: 800, min: 1, max: 100_000 }, about: "number of columns" },
        Param {
            name: "sides",
            default: Default::Int { value: 12, min: 3, max: 256 },
            about: "walls a column, 2 triangles each",
        },
        Param {
            name: "slope_deg",
            default: Default::Float { value: 0.0, min: 0.0, max: 40.0 },
            about: "most that a column's walls lean, out or in",
        },
        RADIUS,
        HOLLOW,
        SEED,
    ],
    make: |spec| Box::new(Walls::new(spec)),
};

const HEIGHT_M: f64 = 3.0;

struct Walls {
    walls: usize,
    sides: usize,
    slope: f64,
    shell: Shell,
    seed: u64,
}

impl Walls {
    fn new(spec: &Spec) -> Walls {
        Walls {
            walls: spec.int("walls") as usize,
            sides: spec.int("sides") as usize,
            slope: spec.float("slope_deg").to_radians(),
            shell: Shell::of(spec),
            seed: spec.int("seed") as u64,
        }
    }
}

impl Generator for Walls {
    fn generate(&self) -> Scene {
        let mut soup = Soup::new("walls");
        let mut rng = Random::part(self.seed, 12);
        let n = self.sides as u32;
        let faces: Vec<[u32; 3]> = (0..n)
            .flat_map(|i| {
                let j = (i + 1) % n;
                [[i, j, j + n], [i, j + n, i + n]]
            })
            .collect();
        for _ in 0..self.walls {
            soup.paint_one_of("wall", &mut rng);
            // A wall leans by the angle of its own plane: the distance of the
            // sides from the axis, not of the corners, changes with its tangent.
            let to_corner = 1.0 / libm::cos(TAU * 0.5 / f64::from(n));
            let lean = 0.5 * HEIGHT_M * libm::tan(rng.range(-self.slope, self.slope));
            let (middle, turn) = (rng.range(1.6, 3.0), rng.range(0.0, TAU));
            let (below, above) = ((middle + lean) * to_corner, (middle - lean) * to_corner);
            let at = self.shell.point_on_disc(below.max(above), &mut rng);
            let ring = |r: f64, z: f64| {
                (0..n).map(move |i| {
                    let angle = turn + TAU * f64::from(i) / f64::from(n);
                    on_grid(at + DVec3::new(r * libm::cos(angle), r * libm::sin(angle), z))
                })
            };
            let corners: Vec<DVec3> = ring(below, -0.5 * HEIGHT_M).chain(ring(above, 0.5 * HEIGHT_M)).collect();
            soup.solid(&corners, &faces);
        }
        soup.finish()
    }
}
