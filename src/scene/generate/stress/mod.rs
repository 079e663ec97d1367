//! Scenes that are hard on arithmetic, one number to turn for each hardship.
//!
//! Every entry scatters many small closed solids around free space at the world
//! origin: `hollow_m` of it, where the walkthrough `random:spread=…` puts its
//! eyes. Far worlds, sizes and cameras are not here: any scene can be moved,
//! scaled and looked at in other ways by the manifest.

mod boxes;
mod coplanar;
mod degenerate;
mod grazing;
mod slivers;
mod soup;
mod spheres;
mod walls;

pub use boxes::ENTRY as BOXES;
pub use coplanar::ENTRY as COPLANAR;
pub use degenerate::ENTRY as DEGENERATE;
pub use grazing::ENTRY as GRAZING;
pub use slivers::ENTRY as SLIVERS;
pub use spheres::ENTRY as SPHERES;
pub use walls::ENTRY as WALLS;

use super::random::Random;
use crate::math::DVec3;
use crate::registry::{Default, Param};
use std::f64::consts::TAU;

const SEED: Param =
    Param { name: "seed", default: Default::Int { value: 1, min: 0, max: i64::MAX }, about: "places the solids" };
const RADIUS: Param = Param {
    name: "radius_m",
    default: Default::Float { value: 60.0, min: 1.0, max: 2000.0 },
    about: "solids lie no farther from the origin",
};
const HOLLOW: Param = Param {
    name: "hollow_m",
    default: Default::Float { value: 8.0, min: 0.0, max: 1000.0 },
    about: "free space around the origin, for the camera",
};

/// Where solids may lie: between two spheres around the origin.
struct Shell {
    hollow_m: f64,
    radius_m: f64,
}

impl Shell {
    fn of(spec: &crate::registry::Spec) -> Shell {
        let radius_m = spec.float("radius_m");
        Shell { hollow_m: spec.float("hollow_m").min(radius_m), radius_m }
    }

    /// A centre, evenly by volume, for a solid that reaches `reach` from it.
    fn point(&self, reach: f64, rng: &mut Random) -> DVec3 {
        let near = self.hollow_m + reach;
        let far = (self.radius_m - reach).max(near);
        let cubed = rng.range(near * near * near, far * far * far);
        direction(rng) * libm::cbrt(cubed)
    }

    /// The same by area, in the plane z = 0.
    fn point_on_disc(&self, reach: f64, rng: &mut Random) -> DVec3 {
        let near = self.hollow_m + reach;
        let far = (self.radius_m - reach).max(near);
        let (r, turn) = (rng.range(near * near, far * far).sqrt(), rng.range(0.0, TAU));
        DVec3::new(r * libm::cos(turn), r * libm::sin(turn), 0.0)
    }
}

/// A unit vector, evenly over the sphere: by Archimedes, z is even.
fn direction(rng: &mut Random) -> DVec3 {
    let (z, turn) = (rng.range(-1.0, 1.0), rng.range(0.0, TAU));
    let flat = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(flat * libm::cos(turn), flat * libm::sin(turn), z)
}

/// Right-handed orthonormal axes.
#[derive(Clone, Copy)]
struct Axes([DVec3; 3]);

impl Axes {
    const WORLD: Axes = Axes([DVec3::X, DVec3::Y, DVec3::Z]);

    /// Evenly over all orientations (Shoemake 1992, "Uniform random rotations").
    fn random(rng: &mut Random) -> Axes {
        let share = rng.unit();
        let (s, t) = (rng.range(0.0, TAU), rng.range(0.0, TAU));
        let (p, q) = ((1.0 - share).sqrt(), share.sqrt());
        let (x, y, z, w) = (p * libm::sin(s), p * libm::cos(s), q * libm::sin(t), q * libm::cos(t));
        Axes([
            DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)),
            DVec3::new(2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)),
            DVec3::new(2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)),
        ])
    }

    /// The third axis along the unit vector `along`, turned about it at random.
    fn about(along: DVec3, rng: &mut Random) -> Axes {
        // Any vector that is not parallel will do: the least component is at most 1/sqrt(3).
        let least = along.abs().min_position();
        let side = along.cross(DVec3::AXES[least]).normalize();
        let other = along.cross(side);
        let turn = rng.range(0.0, TAU);
        let (cos, sin) = (libm::cos(turn), libm::sin(turn));
        Axes([side * cos + other * sin, other * cos - side * sin, along])
    }

    fn place(&self, at: DVec3, p: DVec3) -> DVec3 {
        at + self.0[0] * p.x + self.0[1] * p.y + self.0[2] * p.z
    }
}
