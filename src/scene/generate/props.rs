//! Things that stand about. Each comes in levels of detail without end: level 0
//! is the plainest form, later levels add parts, then roundness.

use super::builder::{Builder, Frame, v3};
use super::random::Random;
use super::solids::Along;
use crate::math::{DVec2, DVec3};

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
    // Legs and other thin parts sink a little, so that no face lies exactly in the floor's.
    let sunk = -0.02;
    let boxed = |b: &mut Builder, x: f64, y: f64, z: f64, w: f64, d: f64, h: f64| {
        b.block_on(v3(x * s, y * s, z * s), v3(w * s, d * s, h * s));
    };
    let legs = |b: &mut Builder, x: f64, y: f64, h: f64, w: f64| {
        for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            if l < 4 {
                b.block_on(v3(sx * x * s, sy * y * s, sunk), v3(w * s, w * s, h * s - sunk));
            } else {
                b.column(v3(sx * x * s, sy * y * s, sunk), w * 0.4 * s, w * 0.6 * s, h * s - sunk, l + 1);
            }
        }
    };
    match prop {
        Prop::Table => {
            b.paint("wood_table");
            match l {
                0 => boxed(b, 0.0, 0.0, sunk, 1.3, 0.8, 0.76),
                _ => {
                    boxed(b, 0.0, 0.0, 0.7, 1.5, 0.9, 0.06);
                    if l == 1 {
                        boxed(b, 0.0, 0.0, sunk, 0.3, 0.5, 0.73);
                    } else {
                        legs(b, 0.65, 0.36, 0.71, 0.08);
                    }
                    if l >= 3 {
                        b.paint("white_porcelain");
                        let bowl = [(0.05, 0.75), (0.12, 0.79), (0.16, 0.86)];
                        b.within(Frame::at(v3(0.3 * s, 0.1 * s, 0.0)), |b| {
                            b.lathe(&bowl.map(|(r, z)| (r * s, z * s)), 4 + l, (1.0, 1.0));
                        });
                    }
                }
            }
        }
        Prop::Chair => {
            b.paint("wood_chair");
            boxed(b, 0.0, 0.0, if l < 2 { sunk } else { 0.42 }, 0.44, 0.44, if l < 2 { 0.48 } else { 0.05 });
            if l >= 1 {
                boxed(b, 0.0, 0.19, 0.44, 0.42, 0.05, 0.5);
            }
            if l >= 2 {
                legs(b, 0.18, 0.18, 0.43, 0.05);
            }
        }
        Prop::Shelf => {
            b.paint("plank_shelf");
            let rows = if l == 0 { 0 } else { 3 };
            let bays: Vec<_> = (0..rows).map(|i| [-0.5, 0.1 + 0.58 * i as f64, 0.5, 0.6 + 0.58 * i as f64]).collect();
            let scaled: Vec<_> = bays.iter().map(|r| r.map(|x| x * s)).collect();
            b.panel(Along::Y, [-0.56 * s, sunk, 0.56 * s, 1.9 * s], &scaled, -0.18 * s, 0.13 * s);
            if l >= 1 {
                b.panel(Along::Y, [-0.56 * s, sunk, 0.56 * s, 1.9 * s], &[], 0.12 * s, 0.16 * s);
            }
            for row in 0..rows {
                let books = if l < 2 { 0 } else { (2 + 2 * l).min(24) };
                let width = 0.92 / books.max(1) as f64;
                for k in 0..books {
                    b.paint(["red_books", "blue_books", "paper_books"][rng.below(3)]);
                    let (x, h) = (-0.46 + width * (k as f64 + 0.5), rng.range(0.3, 0.46));
                    boxed(b, x, -0.02, 0.08 + 0.58 * row as f64, width * 0.9, 0.24, h);
                }
            }
        }
        Prop::Bed => {
            b.paint("fabric_bed");
            boxed(b, 0.0, 0.0, if l == 0 { sunk } else { 0.3 }, 1.1, 2.0, if l == 0 { 0.5 } else { 0.22 });
            if l >= 1 {
                b.paint("wood_bed");
                boxed(b, 0.0, 1.02, sunk, 1.2, 0.08, 1.0);
                boxed(b, 0.0, 0.0, if l < 2 { sunk } else { 0.2 }, 1.18, 2.04, if l < 2 { 0.33 } else { 0.11 });
            }
            if l >= 2 {
                legs(b, 0.5, 0.92, 0.21, 0.1);
                b.paint("white_pillow");
                blob(b, v3(0.0, 0.72 * s, 0.54 * s), v3(0.4, 0.22, 0.09) * s, 4 + 2 * l, 2 + l, 0.04, rng);
            }
        }
        Prop::Sofa => {
            b.paint("fabric_sofa");
            boxed(b, 0.0, 0.0, sunk, 1.9, 0.8, 0.42);
            if l >= 1 {
                boxed(b, 0.0, 0.36, 0.38, 1.9, 0.2, 0.45);
            }
            if l >= 2 {
                boxed(b, -0.9, -0.02, sunk, 0.2, 0.84, 0.66);
                boxed(b, 0.9, -0.02, sunk, 0.2, 0.84, 0.66);
            }
            if l >= 3 {
                for x in [-0.4, 0.4] {
                    blob(b, v3(x * s, -0.04 * s, 0.44 * s), v3(0.42, 0.36, 0.11) * s, 4 + 2 * l, 2 + l, 0.02, rng);
                }
            }
        }
        Prop::FloorLamp => {
            b.paint("metal_lamp");
            let n = 3 + l;
            b.column(v3(0.0, 0.0, sunk), 0.15 * s, 0.13 * s, 0.06, n);
            b.column(v3(0.0, 0.0, 0.03), 0.025 * s, 0.02 * s, 1.5 * s, n);
            b.paint("lamp_shade");
            b.column(v3(0.0, 0.0, 1.42 * s), 0.26 * s, 0.16 * s, 0.3 * s, n + 1);
        }
        Prop::Column => {
            b.paint("concrete_column");
            let n = 4 + l;
            let shaft = [(0.28, 0.0), (0.28, 0.18), (0.2, 0.28), (0.18, 2.75), (0.27, 2.88), (0.27, 3.05)];
            let plain = [(0.24, 0.0), (0.2, 3.05)];
            let profile: &[(f64, f64)] = if l == 0 { &plain } else { &shaft };
            let scaled: Vec<_> = profile.iter().map(|(r, z)| (r * s, z * s + sunk)).collect();
            b.lathe(&scaled, n, (1.0, 1.0));
        }
        Prop::Ball => {
            b.paint("concrete_plinth");
            boxed(b, 0.0, 0.0, sunk, 0.5, 0.5, 0.82);
            b.paint("gold_ball");
            blob(b, v3(0.0, 0.0, 1.1 * s), DVec3::splat(0.32 * s), 4 + 2 * l, 2 + l, 0.0, rng);
        }
        Prop::Vase => {
            b.paint("blue_vase");
            let shape = [(0.12, 0.0), (0.22, 0.2), (0.2, 0.42), (0.08, 0.6), (0.13, 0.7)];
            let scaled: Vec<_> = shape.iter().map(|(r, z)| (r * s, z * s + sunk)).collect();
            b.lathe(&scaled, 3 + l, (1.0, 1.0));
        }
        Prop::Plant => {
            b.paint("brick_pot");
            b.column(v3(0.0, 0.0, sunk), 0.15 * s, 0.22 * s, 0.4 * s, 4 + l);
            b.paint("foliage_plant");
            blob(b, v3(0.0, 0.0, 0.78 * s), v3(0.32, 0.32, 0.44) * s, 4 + 2 * l, 3 + l, 0.3, rng);
        }
        Prop::Crate => {
            b.paint("plank_crate");
            if l == 0 {
                boxed(b, 0.0, 0.0, sunk, 1.0, 1.0, 1.0);
            } else {
                boxed(b, 0.0, 0.0, 0.0, 0.94, 0.94, 0.96);
                b.paint("wood_crate_trim");
                for x in [-0.45, 0.45] {
                    for y in [-0.45, 0.45] {
                        boxed(b, x, y, sunk, 0.12, 0.12, 1.02);
                    }
                }
                for z in if l >= 2 { &[0.01, 0.87][..] } else { &[][..] } {
                    for q in [-0.45, 0.45] {
                        boxed(b, 0.0, q, *z, 0.8, 0.1, 0.11);
                        boxed(b, q, 0.0, *z, 0.1, 0.8, 0.11);
                    }
                }
                let slats = if l >= 3 { (l - 1).min(7) } else { 0 };
                for k in 0..slats {
                    let z = 0.14 + 0.74 * (k as f64 + 0.5) / slats as f64;
                    boxed(b, 0.0, 0.0, z - 0.3 / slats as f64, 0.97, 0.97, 0.6 / slats as f64);
                }
            }
        }
        Prop::Barrel => {
            b.paint(if rng.chance(0.5) { "rust_barrel" } else { "blue_barrel" });
            let plain = [(0.3, 0.0), (0.3, 0.95)];
            let hooped = [
                (0.29, 0.0),
                (0.29, 0.28),
                (0.32, 0.31),
                (0.29, 0.34),
                (0.29, 0.6),
                (0.32, 0.63),
                (0.29, 0.66),
                (0.29, 0.95),
            ];
            let profile: &[(f64, f64)] = if l < 2 { &plain } else { &hooped };
            let scaled: Vec<_> = profile.iter().map(|(r, z)| (r * s, z * s + sunk)).collect();
            b.lathe(&scaled, 6 + 2 * l, (1.0, 1.0));
        }
        Prop::Rock | Prop::SnowRock => {
            b.paint(if prop == Prop::Rock { "rock_boulder" } else { "rock_frosted" });
            let r = v3(rng.range(0.8, 1.3), rng.range(0.6, 1.0), rng.range(0.5, 0.9)) * s;
            blob(b, v3(0.0, 0.0, r.z * 0.25), r, 5 + l, 3 + l / 2, 0.28, rng);
        }
        Prop::Pine | Prop::SnowPine => {
            let h = s * rng.range(0.85, 1.15);
            b.paint("bark_pine");
            b.column(v3(0.0, 0.0, -0.2), 0.05 * h, 0.03 * h, 0.4 * h, 4 + l / 2);
            b.paint(if prop == Prop::Pine { "pine_needles" } else { "frosted_pine" });
            let tiers = (2 + l / 2).min(6);
            for t in 0..tiers {
                let z = 0.18 + 0.62 * t as f64 / tiers as f64;
                let r = 0.24 * (1.0 - 0.75 * t as f64 / tiers as f64);
                let top = (z + 0.62 / tiers as f64 + 0.18).min(1.0);
                b.within(Frame::turned(DVec3::ZERO, t as f64 * 0.7), |b| {
                    b.lathe(&[(r * h, z * h), (0.0, top * h)], 5 + l, (1.0, 1.0));
                });
            }
        }
        Prop::Tree => {
            let h = s * rng.range(0.9, 1.2);
            b.paint("bark_tree");
            b.column(v3(0.0, 0.0, -0.2), 0.06 * h, 0.035 * h, 0.5 * h, 4 + l / 2);
            b.paint("foliage_tree");
            blob(b, v3(0.0, 0.0, 0.68 * h), v3(0.3, 0.3, 0.32) * h, 5 + l, 3 + l / 2, 0.22, rng);
            if l >= 2 {
                blob(b, v3(0.16 * h, 0.06 * h, 0.5 * h), v3(0.2, 0.2, 0.16) * h, 4 + l, 2 + l / 2, 0.2, rng);
                blob(b, v3(-0.14 * h, -0.1 * h, 0.56 * h), v3(0.2, 0.18, 0.17) * h, 4 + l, 2 + l / 2, 0.2, rng);
            }
        }
        Prop::Bush => {
            b.paint("foliage_bush");
            blob(b, v3(0.0, 0.0, 0.2 * s), v3(0.6, 0.55, 0.45) * s, 5 + l, 3 + l / 2, 0.3, rng);
        }
        Prop::Tuft => {
            b.paint("grass_tuft");
            for _ in 0..3 + l {
                let (x, y) = (rng.range(-0.3, 0.3) * s, rng.range(-0.3, 0.3) * s);
                let tip = v3(x + rng.range(-0.15, 0.15) * s, y + rng.range(-0.15, 0.15) * s, rng.range(0.3, 0.55) * s);
                let ring = |i: i32| {
                    v3(x + [0.05, -0.05, 0.0][i as usize] * s, y + [-0.04, -0.04, 0.05][i as usize] * s, -0.05)
                };
                let (p, q, r) = (ring(0), ring(1), ring(2));
                // Base p, q, r runs clockwise seen from above, so the base faces down as it is.
                b.tri(p, q, r);
                b.tri(q, p, tip);
                b.tri(r, q, tip);
                b.tri(p, r, tip);
            }
        }
        Prop::StreetLamp => {
            b.paint("black_iron");
            b.column(v3(0.0, 0.0, sunk), 0.12 * s, 0.07 * s, 3.6 * s, 4 + l);
            b.paint("lamp_glass");
            b.column(v3(0.0, 0.0, 3.55 * s), 0.12 * s, 0.2 * s, 0.4 * s, 4 + l);
            b.paint("black_iron");
            b.within(Frame::at(v3(0.0, 0.0, 3.93 * s)), |b| {
                b.lathe(&[(0.25 * s, 0.0), (0.0, 0.22 * s)], 4 + l, (1.0, 1.0))
            });
        }
        Prop::Hay => {
            b.paint("hay_bale");
            let r = 0.65 * s;
            b.tube(v3(0.0, -0.6 * s, r * 0.93), v3(0.0, 0.6 * s, r * 0.93), r, 7 + 2 * l);
        }
        Prop::Pipe => {
            // Runs along x for `size` metres at the frame's height.
            b.paint("rust_pipe");
            b.tube(v3(-s * 0.5, 0.0, 0.0), v3(s * 0.5, 0.0, 0.0), 0.11, 5 + l);
            for k in 0..l.min(6) {
                let x = s * ((k as f64 + 0.5) / l.min(6) as f64 - 0.5);
                b.tube(v3(x - 0.06, 0.0, 0.0), v3(x + 0.06, 0.0, 0.0), 0.16, 5 + l);
            }
        }
        Prop::WaterTank => {
            b.paint("wood_tank");
            for (x, y) in [(-0.7, -0.7), (0.7, -0.7), (0.7, 0.7), (-0.7, 0.7)] {
                boxed(b, x, y, sunk, 0.12, 0.12, 1.3);
            }
            b.column(v3(0.0, 0.0, 1.25 * s), 1.1 * s, 1.05 * s, 1.7 * s, 6 + 2 * l);
            b.paint("metal_tank");
            b.within(Frame::at(v3(0.0, 0.0, 2.9 * s)), |b| {
                b.lathe(&[(1.2 * s, 0.0), (0.0, 0.7 * s)], 6 + 2 * l, (1.0, 1.0))
            });
        }
        Prop::AirUnit => {
            b.paint("metal_unit");
            boxed(b, 0.0, 0.0, sunk, 1.4, 1.0, 0.9);
            if l >= 1 {
                b.paint("black_fan");
                b.column(v3(0.0, 0.0, 0.85 * s), 0.38 * s, 0.38 * s, 0.12 * s, 5 + l);
            }
        }
        Prop::Vent => {
            b.paint("metal_vent");
            b.column(v3(0.0, 0.0, sunk), 0.16 * s, 0.16 * s, 0.9 * s, 5 + l);
            b.within(Frame::at(v3(0.0, 0.0, 0.85 * s)), |b| {
                b.lathe(&[(0.3 * s, 0.0), (0.3 * s, 0.08 * s), (0.0, 0.25 * s)], 5 + l, (1.0, 1.0));
            });
        }
        Prop::Balcony => {
            b.paint("concrete_balcony");
            boxed(b, 0.0, -0.45, 0.0, 2.0, 1.1, 0.14);
            if l >= 1 {
                b.paint("black_rail");
                b.block_on(v3(0.0, -0.95 * s, 0.95 * s), v3(2.0, 0.06, 0.06) * s);
                let posts = 1 + 2 * l.min(6);
                for k in 0..=posts {
                    boxed(b, -0.97 + 1.94 * k as f64 / posts as f64, -0.95, 0.1, 0.04, 0.04, 0.9);
                }
            }
        }
        Prop::Window => {
            // A framed pane a hand's breadth before the wall at y = 0.
            b.paint("glass_pane");
            boxed(b, 0.0, 0.0, 0.0, 1.0, 0.1, 1.4);
            if l >= 1 {
                b.paint("white_frame");
                boxed(b, 0.0, -0.03, -0.1, 1.2, 0.16, 0.1);
                boxed(b, 0.0, -0.02, 1.4, 1.2, 0.12, 0.1);
            }
            if l >= 2 {
                for x in [-0.55, 0.55] {
                    boxed(b, x, -0.01, -0.02, 0.1, 0.12, 1.44);
                }
                boxed(b, 0.0, -0.01, 0.66, 1.02, 0.11, 0.06);
            }
            if l >= 3 {
                boxed(b, 0.0, -0.015, -0.02, 0.06, 0.11, 1.44);
                b.paint("paint_shutter");
                for x in [-0.92, 0.92] {
                    boxed(b, x, 0.0, -0.05, 0.56, 0.08, 1.5);
                    for k in 0..l.min(9) - 2 {
                        let n = (l.min(9) - 2) as f64;
                        boxed(b, x, -0.03, 0.05 + 1.35 * k as f64 / n, 0.48, 0.06, 0.6 / n);
                    }
                }
            }
        }
        Prop::WindowFrame => {
            // Round an opening 1.4 m wide and 1.3 m high in a wall from y = 0 to 0.3.
            b.paint("white_window_frame");
            boxed(b, 0.0, 0.08, -0.1, 1.8, 0.5, 0.12);
            if l >= 1 {
                boxed(b, 0.0, 0.15, 1.26, 1.7, 0.42, 0.1);
                for x in [-0.72, 0.72] {
                    boxed(b, x, 0.15, 0.0, 0.12, 0.4, 1.28);
                }
            }
            if l >= 3 {
                b.paint("paint_window_shutter");
                for x in [-1.1, 1.1] {
                    boxed(b, x, -0.04, -0.02, 0.6, 0.06, 1.34);
                    for k in 0..(l - 2).min(7) {
                        let n = (l - 2).min(7) as f64;
                        boxed(b, x, -0.07, 0.08 + 1.2 * k as f64 / n, 0.5, 0.05, 0.7 / n);
                    }
                }
            }
        }
        Prop::DoorFrame => {
            // Round an opening 1.8 m wide and 2.4 m high in a wall from y = 0 to 0.3.
            b.paint("trim_door");
            boxed(b, 0.0, 0.15, 2.36, 2.3, 0.46, 0.2);
            for x in if l >= 1 { &[-0.95, 0.95][..] } else { &[][..] } {
                boxed(b, *x, 0.15, sunk, 0.2, 0.44, 2.39);
            }
            if l >= 2 {
                b.paint("lamp_door");
                b.within(Frame::at(v3(0.0, -0.16, 2.75)), |b| {
                    b.lathe(&[(0.0, -0.12), (0.12, 0.0), (0.0, 0.14)], 3 + l, (1.0, 1.0))
                });
            }
        }
        Prop::Ladder => {
            b.paint("metal_ladder");
            for x in [-0.25, 0.25] {
                b.block_on(v3(x, 0.0, sunk), v3(0.06, 0.06, s));
            }
            let rungs = (2 + 3 * l).min((s * 3.0) as usize);
            for k in 0..rungs {
                b.block_on(v3(0.0, 0.0, s * (k as f64 + 0.5) / rungs as f64), v3(0.5, 0.04, 0.04));
            }
        }
        Prop::Girder => {
            // A lattice beam along x, `size` metres long, hanging below the frame's origin.
            b.paint("metal_girder");
            for z in [-0.06, -0.66] {
                b.beam(v3(-s * 0.5, 0.0, z), v3(s * 0.5, 0.0, z), 0.14, 0.12);
            }
            let bays = (2 + 2 * l).min((s * 1.2) as usize).max(2);
            for k in 0..bays {
                let x = |k: usize| s * (k as f64 / bays as f64 - 0.5);
                let (z0, z1) = if k % 2 == 0 { (-0.66, -0.06) } else { (-0.06, -0.66) };
                b.beam(v3(x(k), 0.0, z0), v3(x(k + 1), 0.0, z1), 0.08, 0.08);
            }
        }
        Prop::Canopy => {
            b.paint("red_canopy");
            let section = [DVec2::new(0.1, 2.6), DVec2::new(-1.1, 2.25), DVec2::new(-1.1, 2.18), DVec2::new(0.1, 2.5)];
            b.extrude(Along::X, &section.map(|p| p * s), -1.1 * s, 1.1 * s);
            if l >= 1 {
                b.paint("wood_door");
                boxed(b, 0.0, 0.0, sunk, 1.1, 0.12, 2.2);
            }
            if l >= 2 {
                b.paint("concrete_step");
                boxed(b, 0.0, -0.3, sunk, 1.6, 0.8, 0.16);
            }
        }
        Prop::Car => {
            b.paint(*rng.pick(&["red_car", "blue_car", "white_car", "paint_car"]));
            let hull = [
                (-2.1, 0.3),
                (2.1, 0.3),
                (2.1, 0.8),
                (1.0, 0.95),
                (0.5, 1.42),
                (-1.1, 1.42),
                (-1.7, 0.95),
                (-2.1, 0.9),
            ];
            let hull: Vec<DVec2> = hull.iter().map(|(x, z)| DVec2::new(x * s, z * s)).collect();
            b.extrude(Along::Y, &hull, -0.85 * s, 0.85 * s);
            if l >= 1 {
                b.paint("black_tyre");
                for (x, y) in [(-1.3, -0.8), (1.3, -0.8), (-1.3, 0.8), (1.3, 0.8)] {
                    b.tube(v3(x, y - 0.1, 0.32) * s, v3(x, y + 0.1, 0.32) * s, 0.34 * s, 5 + l);
                }
            }
        }
        Prop::Bench => {
            b.paint("plank_bench");
            boxed(b, 0.0, 0.0, 0.42, 1.6, 0.4, 0.06);
            boxed(b, -0.6, 0.0, sunk, 0.08, 0.36, 0.46);
            boxed(b, 0.6, 0.0, sunk, 0.08, 0.36, 0.46);
            if l >= 1 {
                boxed(b, 0.0, 0.2, 0.5, 1.6, 0.05, 0.4);
            }
        }
        Prop::Sandbags => {
            b.paint("sand_bag");
            for row in 0..3 {
                for k in 0..4 - (row & 1) {
                    let x = (k as f64 - 1.5 + 0.5 * f64::from(row & 1)) * 0.62;
                    let at = v3(x, 0.0, 0.12 + 0.2 * f64::from(row)) * s;
                    blob(b, at, v3(0.34, 0.2, 0.13) * s, 4 + l, 2 + l / 2, 0.05, rng);
                }
            }
        }
        Prop::Log => {
            b.paint("bark_log");
            let r = rng.range(0.16, 0.24);
            b.tube(v3(-s * 0.5, 0.0, r), v3(s * 0.5, 0.0, r), r, 5 + l);
        }
        Prop::CoalHeap => {
            b.paint("coal_heap");
            blob(b, v3(0.0, 0.0, -0.1 * s), v3(1.0, 0.9, 0.62) * s, 7 + 2 * l, 3 + l, 0.16, rng);
        }
        Prop::Sign => {
            b.paint("wood_post");
            boxed(b, -0.5, 0.0, sunk, 0.1, 0.1, 2.0);
            boxed(b, 0.5, 0.0, sunk, 0.1, 0.1, 2.0);
            b.paint("paper_sign");
            boxed(b, 0.0, -0.03, 1.0, 1.5, 0.08, 0.8);
            for k in 0..l.min(8) {
                b.paint("black_letters");
                boxed(
                    b,
                    -0.6 + 1.2 * (k as f64 + 0.5) / l.min(8) as f64,
                    -0.06,
                    1.25,
                    0.9 / l.min(8) as f64,
                    0.05,
                    0.3,
                );
            }
        }
        Prop::Sleepers => {
            // `size` metres of track bed along x: sleepers only, the rails are the map's.
            b.paint("wood_sleeper");
            let n = ((s / 1.2) as usize).max(1);
            for k in 0..n {
                let x = -s * 0.5 + s * (k as f64 + 0.5) / n as f64;
                b.block_on(v3(x, 0.0, -0.1), v3(0.28, 2.3, 0.16));
            }
            b.paint("metal_bolt");
            for k in 0..n * usize::from(l >= 1) {
                let x = -s * 0.5 + s * (k as f64 + 0.5) / n as f64;
                for y in [-0.9, -0.6, 0.6, 0.9] {
                    b.column(v3(x, y, 0.04), 0.06, 0.05, 0.07, 3 + l);
                }
            }
        }
    }
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
