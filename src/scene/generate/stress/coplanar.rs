//! `coplanar`: every box two or more times in the same place, or a few units in
//! the last place apart: which copy is seen is a tie that has to be named one.

use super::boxes::random_box;
use super::soup::Soup;
use super::{HOLLOW, RADIUS, SEED, Shell};
use crate::math::DVec3;
use crate::registry::{Default, Entry, Param, Spec};
use crate::scene::Scene;
use crate::scene::generate::Generator;
use crate::scene::generate::random::Random;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "coplanar",
    about: "stress: boxes that stand in the same place, or some ulps apart",
    revision: 1,
    params: &[
        Param {
            name: "boxes",
            default: Default::Int { value: 800, min: 1, max: 100_000 },
            about: "number of places, 12 triangles a copy",
        },
        Param { name: "copies", default: Default::Int { value: 2, min: 2, max: 8 }, about: "boxes in each place" },
        Param {
            name: "ulps",
            default: Default::Int { value: 0, min: 0, max: 1_000_000 },
            about: "units in the last place from a copy's coordinates to the next one's",
        },
        Param { name: "of", default: Default::Choice(&["f32", "f64"]), about: "the numbers whose last place is meant" },
        RADIUS,
        HOLLOW,
        SEED,
    ],
    make: |spec| Box::new(Coplanar::new(spec)),
};

struct Coplanar {
    boxes: usize,
    copies: i64,
    ulps: i64,
    single: bool,
    shell: Shell,
    seed: u64,
}

impl Coplanar {
    fn new(spec: &Spec) -> Coplanar {
        Coplanar {
            boxes: spec.int("boxes") as usize,
            copies: spec.int("copies"),
            ulps: spec.int("ulps"),
            single: spec.text("of") == "f32",
            shell: Shell::of(spec),
            seed: spec.int("seed") as u64,
        }
    }
}

const SIZE_M: f64 = 4.0;

impl Generator for Coplanar {
    fn generate(&self) -> Scene {
        let mut soup = Soup::new("coplanar");
        let mut rng = Random::part(self.seed, 14);
        let names: Vec<String> = (0..self.copies).map(|c| format!("copy_{c}")).collect();
        for _ in 0..self.boxes {
            let corners = random_box(SIZE_M, true, &self.shell, &mut rng);
            for copy in 0..self.copies {
                // 0, +1, -1, +2, ...: on both sides of the first.
                let side = if copy % 2 == 1 { copy / 2 + 1 } else { -copy / 2 };
                soup.paint(&names[copy as usize]);
                soup.block(&corners.map(|p| moved(p, side * self.ulps, self.single)));
            }
        }
        soup.finish()
    }
}

/// `p` with `ulps` more in the last place of each coordinate, away from zero if positive.
fn moved(p: DVec3, ulps: i64, single: bool) -> DVec3 {
    let step = |x: f64| {
        if x == 0.0 {
            // Around zero the last place is 10^-45 m: the origin of a box never is there.
            return x;
        }
        if single {
            // Corners are multiples of 2^-12 m, hence exact in f32.
            f64::from(f32::from_bits(((x as f32).to_bits() as i64 + ulps) as u32))
        } else {
            f64::from_bits((x.to_bits() as i64 + ulps) as u64)
        }
    };
    DVec3::new(step(p.x), step(p.y), step(p.z))
}
