//! `grazing`: fins that point at the centre of the scene. Seen from there
//! (`random:spread=0`), the planes of eight of a fin's twelve triangles pass the eye at
//! `angle_rad`, some before it and some behind: the sign of facing hangs on a
//! distance of that angle times the distance to the fin.

use super::soup::{Soup, box_corners, on_grid};
use super::{Axes, HOLLOW, RADIUS, SEED, Shell};
use crate::math::DVec3;
use crate::registry::{Default, Entry, Param, Spec};
use crate::scene::Scene;
use crate::scene::generate::Generator;
use crate::scene::generate::random::Random;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "grazing",
    about: "stress: fins whose planes pass the centre of the scene at a small angle",
    revision: 1,
    params: &[
        Param {
            name: "fins",
            default: Default::Int { value: 1000, min: 1, max: 100_000 },
            about: "number of fins, 8 grazing triangles and 4 plain ones each",
        },
        Param {
            name: "angle_rad",
            default: Default::Float { value: 1e-4, min: 0.0, max: 0.1 },
            about: "between a fin's side and the line of sight, towards the eye or away from it",
        },
        RADIUS,
        HOLLOW,
        SEED,
    ],
    make: |spec| Box::new(Grazing::new(spec)),
};

struct Grazing {
    fins: usize,
    angle: f64,
    shell: Shell,
    seed: u64,
}

impl Grazing {
    fn new(spec: &Spec) -> Grazing {
        Grazing {
            fins: spec.int("fins") as usize,
            angle: spec.float("angle_rad"),
            shell: Shell::of(spec),
            seed: spec.int("seed") as u64,
        }
    }
}

const LENGTH_M: f64 = 3.0;

impl Generator for Grazing {
    fn generate(&self) -> Scene {
        let mut soup = Soup::new("grazing");
        let mut rng = Random::part(self.seed, 17);
        // Eight posts make the bounds symmetric, so that their centre, where the
        // eye is, is the origin exactly, whatever the fins are.
        soup.paint("grey_post");
        let reach = self.shell.radius_m + 1.0;
        for post in box_corners(DVec3::splat(reach)) {
            soup.block(&box_corners(DVec3::splat(0.25)).map(|p| on_grid(post) + p));
        }
        for _ in 0..self.fins {
            soup.paint_one_of("fin", &mut rng);
            let middle = self.shell.point(0.5 * LENGTH_M + 2.5, &mut rng);
            let away = middle.normalize();
            let axes = Axes::about(away, &mut rng);
            let near = middle.length() - 0.5 * LENGTH_M;
            // At least the tangent of 0.1 times the length, or a fin could turn inside out.
            let half = [rng.range(0.4, 1.0), rng.range(0.4, 1.0)];
            // With the growth of the cone of sight a side would pass the eye at angle 0.
            let mut far_half = |half: f64| {
                let side = if rng.chance(0.5) { 1.0 } else { -1.0 };
                half + LENGTH_M * (half / near + side * libm::tan(self.angle))
            };
            let (left, right) = (-far_half(half[0]), far_half(half[0]));
            let (low, high) = (-far_half(half[1]), far_half(half[1]));
            let corners: [DVec3; 8] = std::array::from_fn(|i| {
                let pick = |bit: usize, lo: f64, hi: f64| if i >> bit & 1 == 1 { hi } else { lo };
                if i & 4 == 0 {
                    DVec3::new(pick(0, -half[0], half[0]), pick(1, -half[1], half[1]), near)
                } else {
                    DVec3::new(pick(0, left, right), pick(1, low, high), near + LENGTH_M)
                }
            });
            soup.block(&corners.map(|p| axes.place(DVec3::ZERO, p)));
        }
        soup.finish()
    }
}
