//! Gorge: a river gorge that narrows towards a concrete stronghold of three
//! floors; barns on the shelves, catwalks along the cliffs, a dam across the water.

use super::house::{House, Roof};
use super::kit::Kit;
use super::{Map, meadow, rim};
use crate::scene::generate::builder::v3;
use crate::scene::generate::props::Prop;
use crate::scene::generate::terrain::{Terrain, hills, mix};

const HALF: f64 = 76.0;
const WATER: f64 = -3.4;

fn river(x: f64) -> f64 {
    6.0 * libm::sin(x / 21.0)
}

pub(super) fn build(seed: u64) -> Map {
    let ground = Terrain::new(HALF, 128, |x, y| {
        let off = (y - river(x)).abs();
        // Shelves narrow towards the east, cliffs rise behind them.
        let shelf = 27.0 - 8.0 * ((x + 20.0) / 70.0).clamp(0.0, 1.0) + 2.0 * hills(seed + 1, x / 12.0, y / 12.0);
        let cliff = mix(0.0, 14.0, (off - shelf) / 6.0)
            + 1.2 * mix(0.0, 1.0, (off - shelf) / 3.0) * hills(seed + 6, x / 8.0, y / 8.0);
        let bed = mix(0.0, -6.0, (9.5 - off) / 3.4);
        bed + cliff + 0.35 * hills(seed, x / 14.0, y / 14.0) + rim(x, y, 64.0, HALF, 8.0)
    });
    let mut k = Kit::new("", seed, ground);
    k.b.paint("water_river");
    k.b.block(v3(-HALF + 0.5, -17.0, WATER - 5.0), v3(HALF - 0.5, 17.0, WATER));
    west(&mut k);
    dam(&mut k);
    stronghold(&mut k);
    let area = [-74.0, -74.0, 74.0, 74.0];
    let off = |x: f64, y: f64| (y - river(x)).abs();
    k.scatter(&[(Prop::Pine, 6.0, 12.0)], 170, area, move |x, y, z, s| s < 1.3 && z > 6.0 && off(x, y) > 24.0);
    k.scatter(&[(Prop::Rock, 0.6, 2.6)], 130, area, move |x, y, _, s| s > 0.5 || off(x, y) < 8.0);
    k.scatter(&[(Prop::Tree, 4.0, 6.0), (Prop::Bush, 0.7, 1.5)], 60, area, move |x, y, z, s| {
        s < 0.6 && z > -1.0 && off(x, y) > 11.0 && x < 20.0
    });
    k.scatter(&[(Prop::Tuft, 0.8, 1.5)], 120, area, move |x, y, z, s| s < 0.6 && z > -1.0 && off(x, y) > 10.5);
    Map { kit: k, bottom: -14.0, paint: meadow, line: [v3(-15.0, 10.0, 5.5), v3(-15.0, -10.0, 5.5)] }
}

/// The attackers' end: sheds and barns on both shelves, two bridges.
fn west(k: &mut Kit) {
    let barns: [(f64, f64, i32, f64, f64, usize, &str); 6] = [
        (-58.0, 12.0, 3, 14.0, 10.0, 1, "red_barn"),
        (-46.0, -24.0, 2, 14.0, 9.0, 2, "red_barn"),
        (-30.0, 16.0, 0, 15.0, 10.0, 2, "plank_barn"),
        (-12.0, 24.0, 0, 10.0, 8.0, 1, "plank_shed"),
        (-14.0, -20.0, 2, 13.0, 9.0, 2, "plaster_mill"),
        (10.0, 24.0, 0, 12.0, 8.0, 1, "plank_shed"),
    ];
    for (i, (x, y, q, width, depth, storeys, wall)) in barns.into_iter().enumerate() {
        House {
            width,
            depth,
            storeys,
            height: 3.8,
            wall,
            roof: [Roof::Gable(3.0), Roof::Gable(2.6), Roof::Gable(3.4), Roof::Shed(1.6), Roof::Flat, Roof::Shed(1.4)]
                [i],
            roof_paint: ["rust_sheet_roof", "roof_shingle"][i % 2],
            doors: &[(0, 0, 0.0, 3.0), (2, 0, -3.6, 1.8), (1, 0, 0.0, 1.8), (0, 1, 3.0, 1.8)],
            windows: 3.4,
            partition: (i % 2 == 0).then_some(-2.0),
            ..House::default()
        }
        .stand(k, x, y, q);
    }
    for x in [-44.0, -15.0] {
        let y = river(x);
        k.flatten(x - 3.0, y - 15.0, x + 3.0, y - 9.5, 0.2, 2.0);
        k.flatten(x - 3.0, y + 9.5, x + 3.0, y + 15.0, 0.2, 2.0);
        k.bridge("plank_bridge", v3(x, y - 12.0, 0.45), v3(x, y + 12.0, 0.45), 3.2, true);
    }
    k.watchtower(-36.0, -17.0, 7.0);
    k.watchtower(-22.0, -29.0, 9.0);
    k.crates(-52.0, 3.0 + river(-52.0) + 10.0, 0.1, 4);
    for (x, side) in [(-38.0, 1.0), (-24.0, -1.0), (-4.0, 1.0), (4.0, -1.0), (22.0, 1.0)] {
        let y = river(x) + side * 13.5;
        let z = k.ground.height(x, y);
        k.crates(x, y, z, 4);
        k.barrels(x + 3.0, y, z, 4);
        k.put(Prop::StreetLamp, x - 2.0, y, z, 0.0, 1.3);
        k.put(Prop::Sandbags, x + 5.0, y, z, 1.4, 1.0);
    }
    k.put(Prop::WaterTank, -60.0, -14.0, k.ground.height(-60.0, -14.0), 0.3, 2.2);
    k.log_pile(-6.0, -13.0 + river(-6.0), 0.1, 0, 4);
}

/// A concrete weir with a walk on top, and catwalks along the southern cliff.
fn dam(k: &mut Kit) {
    let (x, y) = (22.0, river(22.0));
    k.at(x, y, 0.0, 1, |k| {
        k.b.object();
        k.b.paint("concrete_dam");
        k.b.panel(
            crate::scene::generate::solids::Along::Y,
            [-12.0, -9.0, 12.0, 1.2],
            &[[-7.0, -4.6, -4.0, -1.0], [-1.5, -4.6, 1.5, -1.0], [4.0, -4.6, 7.0, -1.0]],
            -1.6,
            1.6,
        );
        k.railing("metal_railing", &[v3(-11.9, -1.45, 1.2), v3(11.9, -1.45, 1.2)]);
        k.railing("metal_railing", &[v3(-11.9, 1.45, 1.2), v3(11.9, 1.45, 1.2)]);
        k.flatten(-17.0, -2.5, -11.5, 2.5, 1.1, 2.5);
        k.flatten(11.5, -2.5, 17.0, 2.5, 1.1, 2.5);
        for u in [-9.0, -2.6, 2.6, 9.0] {
            k.block("metal_sluice", v3(u - 0.25, -0.3, 1.1), v3(u + 0.25, 0.3, 3.0));
        }
        for i in 0..3 {
            k.set(Prop::Pipe, -6.0 + 6.0 * f64::from(i), -1.9, 0.6, 0, 5.0);
        }
    });
    // A catwalk hangs on the cliff from the mill to the stronghold.
    let z = 5.4;
    let line = [v3(-8.0, -20.6, 3.9), v3(0.0, -21.5, z), v3(12.0, -18.0, z), v3(24.0, -14.5, z), v3(35.5, -10.5, z)];
    for s in line.windows(2) {
        k.bridge("metal_catwalk", s[0], s[1], 2.2, true);
    }
}

/// Three floors of concrete across the gorge's end; the river runs under it.
fn stronghold(k: &mut Kit) {
    let y = river(48.0);
    k.flatten(34.0, y - 20.0, 64.0, y + 20.0, 0.4, 4.0);
    k.at(48.0, y, 0.55, 0, |k| {
        House {
            width: 24.0,
            depth: 30.0,
            storeys: 3,
            height: 4.6,
            wall: "concrete_wall",
            roof: Roof::Flat,
            roof_paint: "concrete_roof",
            doors: &[
                (3, 0, 0.0, 4.0),
                (3, 0, 9.0, 1.8),
                (3, 0, -9.0, 1.8),
                (0, 0, -4.0, 1.8),
                (2, 0, 4.0, 1.8),
                (3, 1, 5.0, 3.0),
                (3, 1, -6.0, 3.0),
                (1, 1, 0.0, 1.8),
                (3, 2, 0.0, 4.0),
                (0, 2, 0.0, 3.0),
            ],
            windows: 3.8,
            partition: Some(3.0),
            foot: 6.0,
            ..House::default()
        }
        .build(k);
        // Rooms within the hall, a balcony all along the front.
        k.b.object();
        k.b.paint("plaster_inner");
        for (z, y) in [(0.0, -5.0), (0.0, 5.0), (4.6, 0.0), (9.2, -4.0)] {
            let door = [6.0, z - 0.02, 7.8, z + 2.4];
            k.b.panel(
                crate::scene::generate::solids::Along::Y,
                [3.08, z - 0.02, 11.8, z + 4.37],
                &[door],
                y - 0.1,
                y + 0.1,
            );
        }
        k.block("concrete_balcony", v3(-15.5, -12.0, 4.3), v3(-11.9, 12.0, 4.6));
        k.railing("metal_railing", &[v3(-12.1, -11.9, 4.6), v3(-15.4, -11.9, 4.6), v3(-15.4, -9.0, 4.6)]);
        k.railing("metal_railing", &[v3(-15.4, -6.0, 4.6), v3(-15.4, 11.9, 4.6), v3(-12.1, 11.9, 4.6)]);
        for u in [-11.0, -4.0, 4.0, 11.0] {
            k.block("concrete_pillar", v3(-15.3, u - 0.35, -3.0), v3(-14.6, u + 0.35, 4.4));
        }
        k.ramp("concrete_ramp", v3(-15.0, 21.5, 0.0), 3, 9.4, 4.55, 2.6);
        k.flatten(-17.0, 21.0, -12.0, 24.0, -0.1, 1.5);
        for i in 0..3 {
            k.set(Prop::Girder, -4.0, -8.0 + 8.0 * f64::from(i), 13.6, 0, 14.0);
            k.crates(-2.0 + 4.0 * f64::from(i), -12.0 + 9.0 * f64::from(i), 0.0, 4);
            k.barrels(6.0, -9.0 + 8.0 * f64::from(i), 4.6, 5);
        }
        for u in [-12.6, 12.6] {
            k.set(Prop::StreetLamp, -18.5, u, -0.1, 0, 1.4);
        }
        k.set(Prop::WaterTank, -5.0, 8.0, 13.78, 0, 1.8);
        k.at(5.0, -7.0, 13.78, 0, |k| {
            House {
                width: 9.0,
                depth: 8.0,
                height: 3.4,
                wall: "concrete_wall",
                roof: Roof::Shed(1.2),
                roof_paint: "metal_roof",
                doors: &[(3, 0, 0.0, 1.8)],
                windows: 2.6,
                foot: 0.2,
                ..House::default()
            }
            .build(k);
        });
    });
}
