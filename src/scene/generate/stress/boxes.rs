//! `boxes`: a cloud of closed boxes, for frustum tests far from the origin, at
//! all scales and under all projections.

use super::soup::{Soup, box_corners, on_grid};
use super::{Axes, HOLLOW, RADIUS, SEED, Shell};
use crate::math::DVec3;
use crate::registry::{Default, Entry, Param, Spec};
use crate::scene::Scene;
use crate::scene::generate::Generator;
use crate::scene::generate::random::Random;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "boxes",
    about: "stress: a cloud of small closed boxes, exact at every whole offset",
    revision: 1,
    params: &[
        Param {
            name: "boxes",
            default: Default::Int { value: 2000, min: 1, max: 300_000 },
            about: "number of boxes, 12 triangles each",
        },
        Param {
            name: "size_m",
            default: Default::Float { value: 2.0, min: 0.02, max: 100.0 },
            about: "longest edge; the shortest is a twentieth",
        },
        Param {
            name: "turned",
            default: Default::Bool(true),
            about: "every box in an orientation of its own; false: all along the axes",
        },
        RADIUS,
        HOLLOW,
        SEED,
    ],
    make: |spec| Box::new(Boxes::new(spec)),
};

struct Boxes {
    boxes: usize,
    size_m: f64,
    turned: bool,
    shell: Shell,
    seed: u64,
}

impl Boxes {
    fn new(spec: &Spec) -> Boxes {
        Boxes {
            boxes: spec.int("boxes") as usize,
            size_m: spec.float("size_m"),
            turned: spec.bool("turned"),
            shell: Shell::of(spec),
            seed: spec.int("seed") as u64,
        }
    }
}

impl Generator for Boxes {
    fn generate(&self) -> Scene {
        let mut soup = Soup::new("boxes");
        let mut rng = Random::part(self.seed, 10);
        for _ in 0..self.boxes {
            soup.paint_one_of("box", &mut rng);
            soup.block(&random_box(self.size_m, self.turned, &self.shell, &mut rng));
        }
        soup.finish()
    }
}

/// Edges evenly between a twentieth of `size_m` and all of it.
pub(super) fn random_box(size_m: f64, turned: bool, shell: &Shell, rng: &mut Random) -> [DVec3; 8] {
    let mut edge = || rng.range(size_m * 0.05, size_m);
    let half = DVec3::new(edge(), edge(), edge()) * 0.5;
    let axes = if turned { Axes::random(rng) } else { Axes::WORLD };
    let at = shell.point(half.length(), rng);
    box_corners(half).map(|p| on_grid(axes.place(at, p)))
}
