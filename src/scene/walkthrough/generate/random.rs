//! `random`: poses that have nothing to do with each other, for statistics over
//! viewpoints and for stress: every frame is a new draw.
//!
//! Eyes lie on a grid of about a millionth of the scene's size, laid from the
//! corner of its bounds: where the scene is exact when moved, so are the eyes.

use super::{FRAMES, Walker, empty, facing};
use crate::error::Result;
use crate::math::{Aabb, DVec3, Pose};
use crate::registry::{Default, Entry, Param, Spec};
use crate::scene::Scene;
use crate::scene::generate::random::Random;
use std::f64::consts::TAU;

pub const ENTRY: Entry<dyn Walker> = Entry {
    name: "random",
    about: "poses drawn one by one, inside the scene's bounds or around them",
    revision: 1,
    params: &[
        FRAMES,
        Param {
            name: "eyes",
            default: Default::Choice(&["inside", "outside"]),
            about: "within the bounds, or at least half a diagonal from their centre",
        },
        Param {
            name: "spread",
            default: Default::Float { value: 1.0, min: 0.0, max: 1.0 },
            about: "inside: part of the bounds' length, width and height that has eyes; 0 is the centre",
        },
        Param {
            name: "distance",
            default: Default::Float { value: 2.0, min: 1.0, max: 1e6 },
            about: "outside: the farthest eyes, in half diagonals from the centre",
        },
        Param {
            name: "aim",
            default: Default::Choice(&["level", "any", "scene"]),
            about: "without roll and up to `pitch_deg`; in any direction with any roll; at a point within the bounds",
        },
        Param {
            name: "pitch_deg",
            default: Default::Float { value: 20.0, min: 0.0, max: 89.0 },
            about: "level: most that the view goes up or down",
        },
        Param { name: "seed", default: Default::Int { value: 1, min: 0, max: i64::MAX }, about: "draws the poses" },
    ],
    make: |spec| Box::new(Draw::new(spec)),
};

enum Aim {
    Level { pitch: f64 },
    Any,
    Scene,
}

struct Draw {
    frames: usize,
    /// Part of the bounds, or none for outside.
    inside: Option<f64>,
    distance: f64,
    aim: Aim,
    seed: u64,
}

impl Draw {
    fn new(spec: &Spec) -> Draw {
        Draw {
            frames: spec.int("frames") as usize,
            inside: (spec.text("eyes") == "inside").then(|| spec.float("spread")),
            distance: spec.float("distance"),
            aim: match spec.text("aim") {
                "level" => Aim::Level { pitch: spec.float("pitch_deg").to_radians() },
                "any" => Aim::Any,
                _ => Aim::Scene,
            },
            seed: spec.int("seed") as u64,
        }
    }

    fn eye(&self, bounds: &Aabb, rng: &mut Random) -> DVec3 {
        let size = bounds.size();
        let within = DVec3::new(rng.unit(), rng.unit(), rng.unit());
        let from_corner = match self.inside {
            Some(spread) => size * (0.5 + (within - 0.5) * spread),
            None => size * 0.5 + direction(rng) * (0.5 * size.length() * rng.range(1.0, self.distance)),
        };
        bounds.lo + on_grid(from_corner, size.length())
    }
}

impl Walker for Draw {
    fn walk(&self, scene: &Scene) -> Result<Vec<Pose>> {
        if scene.is_empty() {
            return Err(empty());
        }
        let bounds = scene.bounds();
        let mut rng = Random::new(self.seed);
        let draw = |_| {
            let eye = self.eye(&bounds, &mut rng);
            match self.aim {
                Aim::Level { pitch } => facing(eye, rng.range(0.0, TAU), rng.range(-pitch, pitch)),
                Aim::Any => {
                    let Pose { forward, up, .. } = towards(eye, direction(&mut rng));
                    let roll = rng.range(0.0, TAU);
                    Pose { eye, forward, up: up * libm::cos(roll) + forward.cross(up) * libm::sin(roll) }
                }
                Aim::Scene => {
                    let share = DVec3::new(rng.unit(), rng.unit(), rng.unit());
                    towards(eye, bounds.lo + bounds.size() * share - eye)
                }
            }
        };
        Ok((0..self.frames).map(draw).collect())
    }
}

/// Without roll. No direction at all is +x.
fn towards(eye: DVec3, d: DVec3) -> Pose {
    facing(eye, libm::atan2(d.y, d.x), libm::atan2(d.z, libm::hypot(d.x, d.y)))
}

/// Evenly over the sphere: by Archimedes, z is even.
fn direction(rng: &mut Random) -> DVec3 {
    let (z, turn) = (rng.range(-1.0, 1.0), rng.range(0.0, TAU));
    let flat = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(flat * libm::cos(turn), flat * libm::sin(turn), z)
}

/// `p` on multiples of the power of two next below `size`, over 2^20.
fn on_grid(p: DVec3, size: f64) -> DVec3 {
    let power = f64::from_bits(size.to_bits() & f64::INFINITY.to_bits());
    let step = power / f64::from(1 << 20);
    // A scene of one point, or of subnormal size, has no grid.
    if step.is_normal() { (p / step).round() * step } else { p }
}
