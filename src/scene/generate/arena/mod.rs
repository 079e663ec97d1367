//! `arena`: game-like maps that mix interiors and exteriors, in the spirit of the
//! Team Fortress 2 maps of Serpa & Rodrigues (2014). Names and triangle counts are
//! theirs; layouts are our own, each with the character its name promises.

mod coal_town;
mod gold_rush;
mod gorge;
mod house;
mod kit;
mod nucleus;
mod ravine;
mod saw;
mod viaduct;
mod works;

use super::budget::spend;
use super::{Entry, Generator};
use crate::math::DVec3;
use crate::registry::{Default, Param, Spec};
use crate::scene::Scene;
use kit::Kit;

/// What differs between the maps.
struct Preset {
    name: &'static str,
    /// Triangles of the published map.
    triangles: usize,
    /// More than walls and coarsest ground need, whatever the seed.
    least: i64,
    build: fn(seed: u64) -> Map,
}

/// A built map, before detail.
struct Map {
    kit: Kit,
    /// Underside of the ground.
    bottom: f64,
    /// Material of the ground from its centre and normal.
    paint: fn(DVec3, DVec3) -> &'static str,
    /// Where pennants hang.
    line: [DVec3; 2],
}

/// In order of the published counts; `map` names them.
static PRESETS: &[Preset] = &[
    Preset { name: "nucleus", triangles: 19_963, least: 14_000, build: nucleus::build },
    Preset { name: "coal_town", triangles: 25_894, least: 16_000, build: coal_town::build },
    Preset { name: "ravine", triangles: 33_422, least: 16_000, build: ravine::build },
    Preset { name: "viaduct", triangles: 56_600, least: 24_000, build: viaduct::build },
    Preset { name: "gorge", triangles: 55_514, least: 16_000, build: gorge::build },
    Preset { name: "saw", triangles: 60_532, least: 20_000, build: saw::build },
    Preset { name: "gold_rush", triangles: 131_598, least: 56_000, build: gold_rush::build },
];

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "arena",
    about: "game-like maps of interiors and exteriors, after Serpa & Rodrigues 2014",
    revision: 1,
    params: &[
        Param {
            name: "map",
            default: Default::Choice(&["nucleus", "coal_town", "ravine", "viaduct", "gorge", "saw", "gold_rush"]),
            about: "layout; each has its own published triangle count",
        },
        Param {
            name: "triangles",
            default: Default::Int { value: 0, min: 0, max: 4_000_000 },
            about: "exact number of triangles, at least 14,000 to 56,000 by map; 0 takes the published count",
        },
        Param {
            name: "seed",
            default: Default::Int { value: 1, min: 0, max: i64::MAX },
            about: "hills, props and their places",
        },
    ],
    make: |spec| Box::new(Arena::new(spec)),
};

/// The least number of triangles of a resolved spec's map.
pub(super) fn least(spec: &Spec) -> i64 {
    let name = spec.text("map");
    PRESETS.iter().find(|p| p.name == name).map_or(0, |p| p.least)
}

struct Arena {
    preset: &'static Preset,
    triangles: usize,
    seed: u64,
}

impl Arena {
    fn new(spec: &Spec) -> Arena {
        let name = spec.text("map");
        let preset = PRESETS.iter().find(|p| p.name == name).expect("every choice has a preset");
        let triangles = match spec.int("triangles") {
            0 => preset.triangles,
            n => n as usize,
        };
        Arena { preset, triangles, seed: spec.int("seed") as u64 }
    }
}

impl Generator for Arena {
    fn generate(&self) -> Scene {
        let Map { mut kit, bottom, paint, line } = (self.preset.build)(self.seed);
        let mut scene = {
            kit.b.object();
            // The ground gets what the walls leave, but no more than a fifth of all.
            let room = self.triangles.saturating_sub(kit.b.len()) / 2;
            let paint = |centre: DVec3, normal: DVec3| {
                if normal.z > 0.85 && kit.ground.on_road(centre) { "road_dirt" } else { paint(centre, normal) }
            };
            kit.ground.emit(&mut kit.b, bottom, room.min(self.triangles / 5), paint);
            let mut props = kit.props;
            kit.rng.shuffle(&mut props);
            spend(kit.b, &props, self.triangles, line).finish()
        };
        scene.name = format!("arena {}", self.preset.name);
        scene
    }
}

/// Grass on flat ground, dirt where it leans, rock where it is steep.
fn meadow(_: DVec3, normal: DVec3) -> &'static str {
    match normal.z {
        z if z > 0.94 => "grass_ground",
        z if z > 0.8 => "dirt_ground",
        _ => "rock_ground",
    }
}

/// Sand and dirt with red rock.
fn desert(_: DVec3, normal: DVec3) -> &'static str {
    match normal.z {
        z if z > 0.93 => "dirt_desert",
        z if z > 0.75 => "sand_desert",
        _ => "rock_desert",
    }
}

/// Height of the rim of cliffs that closes a map: 0 within, rising outside of
/// `inner` (a distance from the middle in the maximum norm).
fn rim(x: f64, y: f64, inner: f64, outer: f64, height: f64) -> f64 {
    let d = libm::pow(libm::pow(x.abs() / outer, 6.0) + libm::pow(y.abs() / outer, 6.0), 1.0 / 6.0) * outer;
    height * ((d - inner) / (outer - inner)).clamp(0.0, 1.2)
}
