//! Things that stand about. Each comes in levels of detail without end: level 0
//! is the plainest form, later levels add parts, then roundness.

mod fittings;
mod furniture;
mod goods;
mod nature;

use super::builder::{Builder, Frame, v3};
use super::random::Random;
use crate::math::DVec3;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Prop {
    Table,
    Chair,
    Shelf,
    Bed,
    Sofa,
    FloorLamp,
    Column,
    Ball,
    Vase,
    Plant,
    Crate,
    Barrel,
    Rock,
    SnowRock,
    Pine,
    SnowPine,
    Tree,
    Bush,
    StreetLamp,
    Hay,
    Pipe,
    WaterTank,
    AirUnit,
    Balcony,
    Window,
    Canopy,
    Car,
    Bench,
    Sandbags,
    Log,
    CoalHeap,
    Sign,
    Sleepers,
    Vent,
    Tuft,
    WindowFrame,
    DoorFrame,
    Ladder,
    Girder,
}

/// A prop in its place: at the frame's origin, facing its -y, `size` as a factor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    pub prop: Prop,
    pub frame: Frame,
    pub size: f64,
    pub seed: u64,
}

impl Placed {
    pub fn emit(&self, b: &mut Builder, level: u32) {
        b.object();
        let l = level as usize;
        let mut rng = Random::new(self.seed);
        b.within(self.frame, |b| emit(b, self.prop, self.size, l, &mut rng));
    }
}

fn emit(b: &mut Builder, prop: Prop, s: f64, l: usize, rng: &mut Random) {
    let of = match prop {
        Prop::Table
        | Prop::Chair
        | Prop::Shelf
        | Prop::Bed
        | Prop::Sofa
        | Prop::FloorLamp
        | Prop::Column
        | Prop::Ball
        | Prop::Vase
        | Prop::Plant => furniture::emit,
        Prop::Rock
        | Prop::SnowRock
        | Prop::Pine
        | Prop::SnowPine
        | Prop::Tree
        | Prop::Bush
        | Prop::Tuft
        | Prop::Hay
        | Prop::Sandbags
        | Prop::Log
        | Prop::CoalHeap => nature::emit,
        Prop::Pipe
        | Prop::WaterTank
        | Prop::AirUnit
        | Prop::Vent
        | Prop::Balcony
        | Prop::Window
        | Prop::WindowFrame
        | Prop::DoorFrame
        | Prop::Ladder
        | Prop::Girder
        | Prop::Canopy
        | Prop::Sign
        | Prop::Sleepers => fittings::emit,
        Prop::Crate | Prop::Barrel | Prop::StreetLamp | Prop::Car | Prop::Bench => goods::emit,
    };
    of(b, prop, s, l, rng);
}

/// A closed, star-shaped lump: an ellipsoid whose radius waves with the direction.
pub(super) fn blob(
    b: &mut Builder,
    centre: DVec3,
    radii: DVec3,
    sides: usize,
    stacks: usize,
    rough: f64,
    rng: &mut Random,
) {
    let mut wave = || {
        let d = v3(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(-1.0, 1.0));
        (d * rng.range(2.0, 5.5), rng.range(0.0, std::f64::consts::TAU))
    };
    let waves = [wave(), wave(), wave()];
    let profile: Vec<(f64, f64)> = (0..=stacks)
        .map(|i| {
            let angle = std::f64::consts::PI * (i as f64 / stacks as f64 - 0.5);
            let tip = i == 0 || i == stacks;
            (if tip { 0.0 } else { libm::cos(angle) }, libm::sin(angle))
        })
        .collect();
    b.lathe_with(&profile, sides, |c, s, (r, z), _, side| {
        // Tips must be one point for every side.
        let d = if r == 0.0 { v3(0.0, 0.0, z) } else { v3(c * r, s * r, z) };
        debug_assert!(r > 0.0 || side == 0);
        let bump: f64 = waves.iter().map(|(k, phase)| libm::sin(k.dot(d) + phase)).sum();
        centre + d * radii * (1.0 + rough * bump / 2.0)
    });
}
