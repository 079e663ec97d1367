//! Generated walkthroughs: free-space walks, orbits, random poses and a standing camera.
//! Deterministic on every platform, like the scene generators.

mod random;
mod route;
mod space;

use crate::error::{Error, Result};
use crate::math::{DVec3, Pose};
use crate::registry::{Default, Entry, Param, Spec, find};
use crate::scene::Scene;
use crate::scene::generate::random::Random;
use std::f64::consts::{PI, TAU};

pub use space::{crosses, first_crossing};

/// A camera path that is made for a scene.
pub trait Walker: Send + Sync {
    /// World metres, z up, one pose a frame.
    ///
    /// # Errors
    /// When the scene is empty or has no free space to walk in.
    fn walk(&self, scene: &Scene) -> Result<Vec<Pose>>;
}

const FRAMES: Param =
    Param { name: "frames", default: Default::Int { value: 2000, min: 1, max: 1_000_000 }, about: "poses to make" };

/// Sorted by name.
pub static ALL: &[Entry<dyn Walker>] = &[
    Entry {
        name: "orbit",
        about: "once around the scene, outside its bounds, looking at the centre",
        revision: 1,
        params: &[
            FRAMES,
            Param {
                name: "elevation_deg",
                default: Default::Float { value: 25.0, min: -80.0, max: 80.0 },
                about: "height of the circle above the horizon, seen from the centre",
            },
            Param {
                name: "distance",
                default: Default::Float { value: 1.5, min: 1.01, max: 100.0 },
                about: "distance from the centre in half diagonals of the bounds",
            },
        ],
        make: |spec| {
            Box::new(Orbit {
                frames: spec.int("frames") as usize,
                elevation: spec.float("elevation_deg").to_radians(),
                distance: spec.float("distance"),
            })
        },
    },
    random::ENTRY,
    Entry {
        name: "static",
        about: "a camera that stands still",
        revision: 1,
        params: &[
            FRAMES,
            Param { name: "x_m", default: Default::Float { value: 0.0, min: -1e7, max: 1e7 }, about: "eye" },
            Param { name: "y_m", default: Default::Float { value: 0.0, min: -1e7, max: 1e7 }, about: "eye" },
            Param { name: "z_m", default: Default::Float { value: 1.6, min: -1e7, max: 1e7 }, about: "eye" },
            Param {
                name: "yaw_deg",
                default: Default::Float { value: 0.0, min: -360.0, max: 360.0 },
                about: "counter-clockwise from +x",
            },
            Param {
                name: "pitch_deg",
                default: Default::Float { value: 0.0, min: -89.0, max: 89.0 },
                about: "upwards",
            },
        ],
        make: |spec| {
            let eye = DVec3::new(spec.float("x_m"), spec.float("y_m"), spec.float("z_m"));
            let pose = facing(eye, spec.float("yaw_deg").to_radians(), spec.float("pitch_deg").to_radians());
            Box::new(Standing { frames: spec.int("frames") as usize, pose })
        },
    },
    Entry {
        name: "walk",
        about: "a walk through free space, near floors where there are any, that crosses no triangle",
        revision: 1,
        params: &[
            FRAMES,
            Param {
                name: "speed_m",
                default: Default::Float { value: 0.3, min: 0.001, max: 100.0 },
                about: "metres a frame",
            },
            Param { name: "seed", default: Default::Int { value: 1, min: 0, max: i64::MAX }, about: "chooses the way" },
            Param {
                name: "eye_height_m",
                default: Default::Float { value: 1.6, min: 0.01, max: 1000.0 },
                about: "height above the floor",
            },
            Param {
                name: "clearance_m",
                default: Default::Float { value: 0.25, min: 0.001, max: 100.0 },
                about: "the eye comes no closer to any triangle",
            },
            Param {
                name: "turn_deg",
                default: Default::Float { value: 4.0, min: 0.1, max: 180.0 },
                about: "most that the view turns between two frames",
            },
        ],
        make: |spec| {
            Box::new(Walk {
                frames: spec.int("frames") as usize,
                speed_m: spec.float("speed_m"),
                seed: spec.int("seed") as u64,
                eye_height_m: spec.float("eye_height_m"),
                clearance_m: spec.float("clearance_m"),
                turn: spec.float("turn_deg").to_radians(),
            })
        },
    },
];

/// The walker that `spec` names, with the spec's defaults filled in.
pub fn make(spec: &Spec) -> Result<(Box<dyn Walker>, Spec)> {
    let (entry, resolved) = find("walkthrough", ALL, spec)?;
    Ok((entry.build(&resolved), resolved))
}

fn empty() -> Error {
    Error::new("a walk needs a scene with triangles").help("see what was dropped with `cullmark scene info`")
}

fn facing(eye: DVec3, yaw: f64, pitch: f64) -> Pose {
    let (cy, sy, cp, sp) = (libm::cos(yaw), libm::sin(yaw), libm::cos(pitch), libm::sin(pitch));
    Pose { eye, forward: DVec3::new(cy * cp, sy * cp, sp), up: DVec3::new(-cy * sp, -sy * sp, cp) }
}

struct Orbit {
    frames: usize,
    elevation: f64,
    distance: f64,
}

impl Walker for Orbit {
    fn walk(&self, scene: &Scene) -> Result<Vec<Pose>> {
        if scene.is_empty() {
            return Err(empty());
        }
        let bounds = scene.bounds();
        let reach = bounds.size().length().max(1e-6) * 0.5 * self.distance;
        let pose = |i: usize| {
            let yaw = TAU * i as f64 / self.frames as f64 + PI;
            let pose = facing(bounds.centre(), yaw, -self.elevation);
            Pose { eye: bounds.centre() - pose.forward * reach, ..pose }
        };
        Ok((0..self.frames).map(pose).collect())
    }
}

struct Standing {
    frames: usize,
    pose: Pose,
}

impl Walker for Standing {
    fn walk(&self, _: &Scene) -> Result<Vec<Pose>> {
        Ok(vec![self.pose; self.frames])
    }
}

struct Walk {
    frames: usize,
    speed_m: f64,
    seed: u64,
    eye_height_m: f64,
    clearance_m: f64,
    turn: f64,
}

impl Walker for Walk {
    fn walk(&self, scene: &Scene) -> Result<Vec<Pose>> {
        if scene.is_empty() {
            return Err(empty());
        }
        // A walker of human size finds no room in a model of a statuette: scenes
        // smaller than a house shrink the walker with them.
        let scale = (scene.bounds().size().length() / 12.0).min(1.0);
        let (eye, clearance, speed) = (self.eye_height_m * scale, self.clearance_m * scale, self.speed_m * scale);
        let mut rng = Random::new(self.seed);
        let space = space::Space::new(scene, clearance, eye)?;
        let eyes = route::stroll(&space, self.frames, speed, &mut rng)?;
        let target = space.flying.then(|| scene.bounds().centre());
        let poses = look_around(&eyes, target, speed, self.turn, &mut rng);
        // The cells already prove it; exact arithmetic proves the cells.
        match first_crossing(scene, &poses) {
            None => Ok(poses),
            Some((frame, triangle)) => {
                Err(Error::new(format!("the walk crosses triangle {triangle} after frame {frame}"))
                    .help("use a larger clearance_m, and please report this: it is a bug"))
            }
        }
    }
}

/// Faces along the way, or a target, with some looking around, turning by no more than `turn` a frame.
fn look_around(eyes: &[DVec3], target: Option<DVec3>, speed: f64, turn: f64, rng: &mut Random) -> Vec<Pose> {
    let ahead = ((12.0 * speed).max(2.4) / speed) as usize;
    let (mut yaw, mut pitch) = (rng.range(0.0, TAU), 0.0);
    let mut wanted: Vec<[f64; 2]> = Vec::with_capacity(eyes.len());
    let phases = [rng.range(0.0, TAU), rng.range(0.0, TAU), rng.range(0.0, TAU), rng.range(0.0, TAU)];
    for (i, eye) in eyes.iter().enumerate() {
        let way = target.unwrap_or(eyes[(i + ahead).min(eyes.len() - 1)]) - *eye;
        let flat = libm::hypot(way.x, way.y);
        if flat > 2.0 * speed {
            let turned = libm::atan2(way.y, way.x) - yaw;
            // The turn the short way round.
            yaw += turned - TAU * libm::round(turned / TAU);
            pitch = libm::atan2(way.z, flat).clamp(-0.21, 0.21);
        }
        let wave = |period: f64, phase: f64| libm::sin(TAU * i as f64 / period + phase);
        let glance = 0.55 * wave(310.0, phases[0]) * wave(97.0, phases[1]);
        let nod = 0.10 * wave(230.0, phases[2]) + 0.03 * wave(71.0, phases[3]);
        wanted.push([yaw + glance, pitch + nod]);
    }
    // Averaging looks into corners early, as people do.
    const HALF: usize = 9;
    let mut sums = vec![[0.0; 2]];
    for w in &wanted {
        let last = sums[sums.len() - 1];
        sums.push([last[0] + w[0], last[1] + w[1]]);
    }
    let mut now: Option<[f64; 2]> = None;
    let mut poses = Vec::with_capacity(eyes.len());
    for (i, eye) in eyes.iter().enumerate() {
        let (lo, hi) = (i.saturating_sub(HALF), (i + HALF + 1).min(eyes.len()));
        let mean = [0, 1].map(|k| (sums[hi][k] - sums[lo][k]) / (hi - lo) as f64);
        // Yaw and pitch together stay within the limit: 0.9^2 + 0.4^2 < 1.
        let limited = now.map_or(mean, |n| {
            [
                n[0] + (mean[0] - n[0]).clamp(-0.9 * turn, 0.9 * turn),
                n[1] + (mean[1] - n[1]).clamp(-0.4 * turn, 0.4 * turn),
            ]
        });
        now = Some(limited);
        poses.push(facing(*eye, limited[0], limited[1].clamp(-0.349, 0.349)));
    }
    poses
}
