//! Saw: a tall sawmill in the woods. A hall with a saw-tooth roof, a tower of
//! seven storeys, a flume on trestles from the upper pond, stacks of logs.

use super::house::{House, Roof};
use super::kit::Kit;
use super::{Map, meadow, rim};
use crate::scene::generate::builder::{Frame, v3};
use crate::scene::generate::props::Prop;
use crate::scene::generate::terrain::{Terrain, hills, mix};

const HALF: f64 = 70.0;

pub(super) fn build(seed: u64) -> Map {
    let ground = Terrain::new(HALF, 128, |x, y| {
        let upper = mix(0.0, 9.0, (y - 26.0 + 3.0 * hills(seed + 1, x / 13.0, y / 13.0)) / 9.0);
        let lower = mix(0.0, -4.5, (-28.0 - y + 2.0 * hills(seed + 2, x / 11.0, y / 11.0)) / 7.0);
        upper
            + lower
            + 0.6 * hills(seed, x / 15.0, y / 15.0)
            + rim(x, y, 54.0, HALF, 15.0) * (1.0 + 0.2 * hills(seed + 3, x / 9.0, y / 9.0))
    });
    let mut k = Kit::new("", seed, ground);
    k.flatten(-26.0, -18.0, 26.0, 18.0, 0.0, 6.0);
    mill(&mut k);
    tower(&mut k);
    yards(&mut k);
    // Ponds above and below; the flume joins the upper one to the mill.
    k.ground.shape(|x, y, h| {
        let d = libm::hypot(x - 34.0, y - 42.0);
        let h = mix(h, 6.6, (13.0 - d) / 5.0);
        let d = libm::hypot(x + 18.0, (y + 42.0) * 1.5);
        mix(h, -6.5, (20.0 - d) / 6.0)
    });
    k.b.object();
    k.b.paint("water_pond");
    k.b.column(v3(34.0, 42.0, 5.0), 12.0, 12.0, 3.2, 20);
    k.b.within(Frame::at(v3(-18.0, -42.0, -8.5)), |b| b.lathe(&[(18.0, 0.0), (18.0, 3.4)], 24, (1.0, 0.72)));
    k.flume(v3(27.0, 33.0, 8.6), v3(15.2, 9.0, 6.6));
    k.bridge("plank_jetty", v3(-18.0, -28.0, -4.3), v3(-18.0, -41.0, -4.3), 2.4, true);
    k.flatten(-20.5, -28.5, -15.5, -25.0, -4.4, 2.0);
    for (x, y, a) in [(-14.0, -42.0, 0.4), (-23.0, -45.0, 0.9), (-12.0, -38.0, -0.3), (-24.0, -38.0, 0.2)] {
        k.put(Prop::Log, x, y, -5.25, a, 6.0);
    }
    let area = [-68.0, -68.0, 68.0, 68.0];
    let yard = |x: f64, y: f64| x.abs() > 27.0 || y.abs() > 20.0;
    k.scatter(&[(Prop::Pine, 8.0, 16.0), (Prop::Pine, 5.0, 9.0)], 230, area, move |x, y, z, s| {
        s < 1.3 && yard(x, y) && z > -3.9 && (x.abs() > 36.0 || y.abs() > 30.0)
    });
    k.scatter(&[(Prop::Rock, 0.6, 2.4)], 100, area, move |x, y, _, s| s > 0.45 && yard(x, y));
    k.scatter(&[(Prop::Bush, 0.6, 1.4), (Prop::Tuft, 0.8, 1.5)], 140, area, move |x, y, z, s| {
        s < 0.7 && yard(x, y) && z > -4.0
    });
    Map { kit: k, bottom: -14.0, paint: meadow, line: [v3(-15.5, -13.0, 7.0), v3(-15.5, 13.0, 7.0)] }
}

fn mill(k: &mut Kit) {
    k.at(0.0, 0.0, 0.15, 0, |k| {
        House {
            width: 30.0,
            depth: 20.0,
            storeys: 1,
            height: 8.2,
            wall: "plank_mill",
            roof: Roof::Saw(3.0, 5),
            roof_paint: "rust_sheet_roof",
            doors: &[
                (0, 0, -8.0, 4.0),
                (0, 0, 8.0, 4.0),
                (2, 0, 0.0, 4.0),
                (1, 0, -5.0, 1.8),
                (3, 0, 5.0, 1.8),
                (3, 0, -5.0, 3.0),
            ],
            windows: 4.4,
            ..House::default()
        }
        .build(k);
        // A gallery runs round three sides within, with stairs up to it.
        k.b.object();
        k.b.paint("plank_gallery");
        k.b.block(v3(-14.75, 6.8, 4.0), v3(14.75, 9.75, 4.25));
        k.b.block(v3(-14.75, -9.75, 4.0), v3(-11.8, 6.85, 4.25));
        k.b.block(v3(11.8, -9.75, 4.0), v3(14.75, 6.85, 4.25));
        k.railing(
            "wood_rail",
            &[v3(-11.9, -6.0, 4.25), v3(-11.9, 6.9, 4.25), v3(11.9, 6.9, 4.25), v3(11.9, -6.0, 4.25)],
        );
        for (x, y) in [(-11.9, -4.0), (-11.9, 6.9), (-4.0, 6.9), (4.0, 6.9), (11.9, 6.9), (11.9, -4.0)] {
            k.block("wood_post", v3(x - 0.18, y - 0.18, -0.1), v3(x + 0.18, y + 0.18, 8.1));
        }
        k.stairs("wood_stairs", v3(-6.0, -8.6, 0.0), 2, 6.0, 4.24, 2.0);
        k.stairs("wood_stairs", v3(6.0, -8.6, 0.0), 0, 6.0, 4.24, 2.0);
        // Saws: tables with great blades, and conveyors that feed them.
        for x in [-5.5, 5.5] {
            k.block("metal_bench", v3(x - 1.2, -4.5, -0.02), v3(x + 1.2, 4.0, 1.0));
            k.b.object();
            k.b.paint("metal_blade");
            k.b.tube(v3(x - 0.05, 0.0, 1.1), v3(x + 0.05, 0.0, 1.1), 1.5, 24);
            k.b.paint("rust_axle");
            k.b.tube(v3(x - 0.8, 0.0, 1.25), v3(x + 0.8, 0.0, 1.25), 0.14, 8);
            k.set(Prop::Log, x, -2.6, 1.0, 1, 3.0);
        }
        for i in 0..5 {
            k.set(Prop::Girder, -12.0 + 6.0 * f64::from(i), 0.0, 8.15, 1, 19.0);
        }
        k.crates(0.0, 2.0, 0.0, 5);
        k.barrels(-9.5, 4.0, 0.0, 5);
        k.barrels(9.0, 3.5, 0.0, 4);
        k.crates(8.0, 8.0, 4.25, 2);
    });
}

/// Seven storeys beside the hall: what makes the map's box tall.
fn tower(k: &mut Kit) {
    k.at(-20.5, 9.0, 0.15, 0, |k| {
        House {
            width: 9.6,
            depth: 9.6,
            storeys: 7,
            height: 4.2,
            wall: "plank_tower",
            roof: Roof::Tent(5.0),
            roof_paint: "rust_sheet_roof",
            doors: &[
                (0, 0, 0.0, 3.0),
                (3, 0, 0.0, 1.8),
                (1, 1, -2.6, 1.8),
                (0, 4, 0.0, 3.0),
                (3, 6, 0.0, 3.0),
                (0, 6, 0.0, 3.0),
            ],
            windows: 3.0,
            ..House::default()
        }
        .build(k);
        k.block("plank_balcony", v3(-4.0, -7.0, 16.55), v3(4.0, -4.7, 16.8));
        k.railing("wood_rail", &[v3(-3.9, -4.8, 16.8), v3(-3.9, -6.9, 16.8), v3(3.9, -6.9, 16.8), v3(3.9, -4.8, 16.8)]);
        for x in [-3.6, 3.6] {
            k.b.beam(v3(x, -4.7, 14.6), v3(x, -6.8, 16.6), 0.2, 0.2);
        }
        // A hoist beam and its rope.
        k.b.object();
        k.b.paint("wood_hoist");
        k.b.beam(v3(-4.0, 0.0, 28.6), v3(-8.6, 0.0, 28.9), 0.3, 0.4);
        k.b.paint("hay_rope");
        k.b.tube(v3(-8.2, 0.0, 28.7), v3(-8.2, 0.0, 6.0), 0.06, 5);
        k.put(Prop::Crate, -8.2, 0.0, 4.8, 0.4, 1.2);
    });
    k.at(21.0, -11.0, 0.15, 0, |k| {
        House {
            width: 8.0,
            depth: 8.0,
            storeys: 4,
            height: 4.0,
            wall: "brick_stack_house",
            roof: Roof::Flat,
            roof_paint: "concrete_roof",
            doors: &[(3, 0, 0.0, 3.0), (2, 0, 0.0, 1.8), (3, 3, 0.0, 1.8)],
            windows: 2.8,
            ..House::default()
        }
        .build(k);
        k.b.object();
        k.b.paint("brick_chimney");
        k.b.column(v3(2.0, -2.2, 15.6), 1.1, 0.8, 18.0, 12);
    });
}

/// Spawns, sheds, watchtowers and stacks round the mill.
fn yards(k: &mut Kit) {
    for (x, y, q, wall) in [(-40.0, -14.0, 1, "red_shed"), (41.0, 8.0, 3, "blue_shed")] {
        House {
            width: 14.0,
            depth: 10.0,
            storeys: 2,
            height: 3.8,
            wall,
            roof: Roof::Gable(3.0),
            roof_paint: "rust_sheet_roof",
            doors: &[(0, 0, 0.0, 4.0), (2, 0, -3.0, 1.8), (1, 0, 0.0, 1.8), (0, 1, 3.5, 1.8)],
            windows: 3.2,
            ..House::default()
        }
        .stand(k, x, y, q);
    }
    for (x, y, q) in [(4.0, -40.0, 0), (38.0, -20.0, 3), (-38.0, 12.0, 1), (-4.0, 40.0, 2)] {
        House {
            width: 9.0,
            depth: 7.0,
            height: 3.4,
            wall: "plank_shed",
            roof: Roof::Shed(1.4),
            roof_paint: "roof_shingle",
            doors: &[(0, 0, 0.0, 3.0), (2, 0, -2.0, 1.8)],
            windows: 3.0,
            ..House::default()
        }
        .stand(k, x, y, q);
    }
    for (x, y, h) in [(30.0, 20.0, 14.0), (-31.0, -29.0, 11.0), (12.0, 30.0, 8.0)] {
        k.watchtower(x, y, h);
    }
    for (x, y, q, rows) in [
        (-4.0, -15.5, 0, 6),
        (6.0, -17.0, 0, 5),
        (-14.0, -17.5, 0, 4),
        (24.0, 2.0, 1, 6),
        (28.0, 6.0, 1, 5),
        (-8.0, 16.0, 0, 5),
        (10.0, 15.5, 0, 4),
        (-30.0, 0.0, 1, 5),
    ] {
        let z = k.ground.height(x, y);
        k.log_pile(x, y, z, q, rows);
    }
    k.bridge("plank_bridge", v3(-15.0, 2.0, 4.4), v3(-16.0, 6.4, 4.4), 2.0, false);
    k.stairs("rock_steps", v3(0.0, 23.0, 0.2), 1, 14.0, 8.6, 3.0);
    k.stairs("wood_steps", v3(-18.0, -24.6, -4.5), 1, 6.4, 4.4, 3.0);
    for (x, y) in [(-18.0, -8.0), (18.0, 6.0), (4.0, -13.0), (-4.0, 13.5)] {
        k.put(Prop::StreetLamp, x, y, 0.0, 0.0, 1.4);
    }
    k.crates(18.0, 12.0, 0.0, 5);
    k.crates(-20.0, -6.0, 0.0, 4);
    k.barrels(17.5, -4.0, 0.0, 5);
    k.put(Prop::WaterTank, 22.0, -19.5, 0.0, 0.2, 2.4);
    k.put(Prop::Sign, 12.0, -13.0, 0.0, 0.2, 1.3);
    k.put(Prop::Sandbags, -10.0, -13.0, 0.0, 0.1, 1.0);
    k.put(Prop::Sandbags, 17.0, 2.0, 0.0, 1.5, 1.0);
}
