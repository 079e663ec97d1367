//! Nucleus: two concrete bases face each other across a round pit, in whose
//! middle a domed core stands; bridges, a ring walk and side tunnels join them.

use super::house::{House, Roof};
use super::kit::Kit;
use super::{Map, desert, rim};
use crate::scene::generate::builder::v3;
use crate::scene::generate::props::Prop;
use crate::scene::generate::terrain::{Terrain, hills};

const HALF: f64 = 64.0;

pub(super) fn build(seed: u64) -> Map {
    let ground = Terrain::new(HALF, 128, |x, y| {
        let cliffs = rim(x, y, 47.0, HALF, 15.0);
        0.4 * hills(seed, x / 17.0, y / 17.0) + cliffs * (1.0 + 0.25 * hills(seed + 9, x / 11.0, y / 11.0))
    });
    let mut k = Kit::new("", seed, ground);
    k.flatten(-34.0, -18.0, 34.0, 18.0, 0.0, 9.0);
    // The pit: a bowl with a flat floor.
    k.ground.shape(|x, y, h| {
        let r = libm::hypot(x, y);
        let floor = -7.0;
        if r < 20.5 { floor + ((r - 14.5).max(0.0) / 6.0).min(1.0) * (h.min(0.0) - floor) } else { h }
    });
    core(&mut k);
    k.twice(side);
    let area = [-60.0, -60.0, 60.0, 60.0];
    let rocks = [(Prop::Rock, 0.8, 2.6), (Prop::Rock, 0.4, 1.0)];
    k.scatter(&rocks, 90, area, |x, y, _, slope| slope > 0.35 && libm::hypot(x, y) > 24.0);
    k.scatter(&[(Prop::Bush, 0.6, 1.4), (Prop::Tuft, 0.8, 1.4)], 120, area, |x, y, _, s| {
        s < 0.8 && libm::hypot(x, y) > 23.0
    });
    Map { kit: k, bottom: -12.0, paint: desert, line: [v3(-12.0, 3.2, 5.0), v3(12.0, 3.2, 5.0)] }
}

fn core(k: &mut Kit) {
    k.b.object();
    k.b.paint("metal_core");
    k.b.column(v3(0.0, 0.0, -8.0), 5.0, 4.2, 7.6, 12);
    k.b.paint("concrete_deck");
    k.b.column(v3(0.0, 0.0, -0.5), 8.0, 8.0, 0.5, 16);
    // An open dome: ribs around a glowing ball.
    k.b.object();
    k.b.paint("gold_core");
    k.put(Prop::Ball, 0.0, 0.0, -0.1, 0.0, 2.2);
    k.b.paint("metal_rib");
    for i in 0..8 {
        let angle = std::f64::consts::TAU * (f64::from(i) + 0.5) / 8.0;
        let at = |r: f64, z: f64| v3(r * libm::cos(angle), r * libm::sin(angle), z);
        let arc = [at(7.2, -0.2), at(7.0, 3.0), at(5.4, 5.6), at(2.6, 7.0), at(0.0, 7.4)];
        for s in arc.windows(2) {
            k.b.beam(s[0], s[1], 0.35, 0.3);
        }
    }
    for quarter in 0..4 {
        let d = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarter];
        let p = |r: f64| v3(d.0 * r, d.1 * r, 0.02);
        k.bridge("metal_bridge", p(7.6), p(21.5), if quarter % 2 == 0 { 4.0 } else { 2.6 }, true);
    }
    k.b.object();
    k.b.paint("water_coolant");
    k.b.column(v3(0.0, 0.0, -9.0), 13.8, 14.2, 2.3, 24);
    k.keep_out(-21.0, -21.0, 21.0, 21.0);
}

/// One base and its side of the pit; the other is this one turned about.
fn side(k: &mut Kit, team: usize) {
    let paint = ["red_concrete", "blue_concrete"][team];
    k.flatten(30.0, -20.0, 54.0, 20.0, 0.6, 3.0);
    k.flatten(24.0, -4.0, 31.0, 4.0, 0.3, 3.0);
    k.at(41.0, 0.0, 0.7, 0, |k| {
        House {
            width: 18.0,
            depth: 26.0,
            storeys: 2,
            height: 4.2,
            wall: paint,
            roof: Roof::Flat,
            roof_paint: "concrete_roof",
            doors: &[
                (3, 0, 0.0, 4.0),
                (3, 0, 8.5, 1.8),
                (0, 0, 2.0, 1.8),
                (2, 0, -4.0, 1.8),
                (3, 1, -4.0, 3.0),
                (3, 1, 6.0, 1.8),
                (1, 0, 3.0, 1.8),
            ],
            windows: 4.0,
            stairs: true,
            partition: Some(2.0),
            foot: 3.0,
        }
        .build(k);
        // A balcony above the gate looks down into the pit.
        k.block("concrete_balcony", v3(-12.0, -9.0, 3.9), v3(-8.9, 9.0, 4.2));
        k.railing(
            "metal_railing",
            &[v3(-8.9, -8.9, 4.2), v3(-11.9, -8.9, 4.2), v3(-11.9, 8.9, 4.2), v3(-8.9, 8.9, 4.2)],
        );
        for y in [-8.0, 8.0] {
            k.block("concrete_pillar", v3(-11.8, y - 0.3, -2.0), v3(-11.2, y + 0.3, 3.95));
        }
        // A lookout on the roof.
        k.at(3.0, -6.0, 8.38, 0, |k| {
            House {
                width: 7.0,
                depth: 7.0,
                height: 3.2,
                wall: paint,
                roof: Roof::Tent(2.2),
                roof_paint: "metal_roof",
                doors: &[(3, 0, 0.0, 1.8)],
                windows: 2.4,
                stairs: false,
                foot: 0.2,
                ..House::default()
            }
            .build(k);
        });
    });
    // A tunnel beside the base: walls and a roof over a cut to the pit's ring.
    k.lay(&[v3(20.0, -13.0, -3.0), v3(28.0, -22.0, -2.2), v3(44.0, -22.0, 0.2)], 2.2, 2.0);
    k.at(36.0, -22.0, -1.2, 0, |k| {
        k.b.object();
        k.b.paint("concrete_tunnel");
        k.b.block(v3(-7.0, -3.4, -2.0), v3(5.0, -2.4, 3.4));
        k.b.block(v3(-7.0, 2.4, -2.0), v3(5.0, 3.4, 3.4));
        k.b.block(v3(-7.2, -3.6, 3.35), v3(5.2, 3.6, 4.0));
        k.keep_out(-9.0, -4.0, 9.0, 4.0);
        k.set(Prop::Pipe, -1.0, -2.2, 2.6, 0, 11.0);
        k.set(Prop::Pipe, -1.0, 2.2, 2.2, 0, 11.0);
    });
    k.crates(27.0, 9.0, 0.2, 4);
    k.crates(29.0, -12.0, 0.2, 3);
    k.barrels(25.5, 14.0, 0.1, 5);
    k.barrels(31.5, 5.0, 0.5, 3);
    for y in [-17.0, 17.0] {
        k.put(Prop::StreetLamp, 27.0, y, 0.0, 0.0, 1.5);
    }
    k.put(Prop::Sandbags, 24.0, 5.6, 0.1, 1.57, 1.0);
    k.put(Prop::Sandbags, 24.0, -5.6, 0.1, 1.57, 1.0);
    k.put(Prop::WaterTank, 47.0, 19.0, 0.6, 0.3, 2.2);
    k.put(Prop::Sign, 30.0, 7.0, 0.4, -1.4, 1.2);
    for i in 0..4 {
        k.set(Prop::Pipe, 33.5, -9.0 + 0.5 * f64::from(i), 0.9 + 0.35 * f64::from(i), 1, 8.0);
    }
    // A pump house and a store flank the pit; walls give cover between them.
    House {
        width: 14.0,
        depth: 10.0,
        storeys: 2,
        height: 3.8,
        wall: "concrete_pump_house",
        roof: Roof::Shed(1.6),
        roof_paint: "metal_roof",
        doors: &[(0, 0, -3.0, 3.0), (2, 0, 3.0, 1.8), (1, 0, 0.0, 1.8), (0, 1, 3.0, 1.8)],
        windows: 3.6,
        ..House::default()
    }
    .stand(k, 4.0, 33.0, 0);
    House {
        width: 11.0,
        depth: 8.0,
        height: 4.0,
        wall: paint,
        roof: Roof::Gable(2.0),
        roof_paint: "rust_sheet_roof",
        doors: &[(3, 0, 0.0, 3.0), (2, 0, 2.0, 1.8)],
        windows: 3.2,
        ..House::default()
    }
    .stand(k, 26.0, 31.0, 0);
    for (x, y, q) in [(15.0, 26.0, 0), (-12.0, 30.0, 1), (-20.0, 34.0, 0), (36.0, 22.0, 1)] {
        k.at(x, y, 0.0, q, |k| {
            k.block("concrete_wall", v3(-3.0, -0.25, -1.0), v3(3.0, 0.25, 1.5));
            k.keep_out(-3.0, -0.5, 3.0, 0.5);
        });
    }
    for (x, y) in [(14.0, 28.5), (-14.0, 33.0), (19.0, 38.0)] {
        k.crates(x, y, 0.1, 4);
    }
    k.barrels(-9.0, 36.0, 0.1, 5);
    k.put(Prop::WaterTank, 14.5, 37.0, 0.1, 0.3, 2.0);
    // Stairs from the pit's floor up to the rim.
    k.stairs("concrete_steps", v3(9.0, 10.2, -6.9), 0, 8.0, 6.9, 2.6);
    k.flatten(16.8, 8.5, 22.0, 12.0, 0.0, 1.5);
}
