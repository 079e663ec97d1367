//! Coal Town: a mining town on two terraces. A main street of wooden houses runs
//! up to the pithead; a conveyor carries coal over the roofs to the bunker by the railway.

use super::house::{House, Roof};
use super::kit::Kit;
use super::{Map, meadow, rim};
use crate::scene::generate::builder::v3;
use crate::scene::generate::props::Prop;
use crate::scene::generate::terrain::{Terrain, hills, mix};

const HALF: f64 = 62.0;

pub(super) fn build(seed: u64) -> Map {
    let ground = Terrain::new(HALF, 128, |x, y| {
        let terrace = mix(0.0, 3.2, (x - 9.0) / 2.2) + mix(0.0, 3.0, (y - 20.0) / 6.0);
        terrace
            + 0.3 * hills(seed, x / 15.0, y / 15.0)
            + rim(x, y, 48.0, HALF, 15.0) * (1.0 + 0.2 * hills(seed + 5, x / 9.0, y / 9.0))
    });
    let mut k = Kit::new("", seed, ground);
    // Main street, square and railway.
    k.road(&[v3(-2.0, -46.0, 0.0), v3(-2.0, 14.0, 0.0), v3(0.0, 30.0, 3.0)], 4.5, 3.0);
    k.flatten(-12.0, -12.0, 8.0, 6.0, 0.0, 3.0);
    k.lay(&[v3(-46.0, -33.0, 0.0), v3(46.0, -33.0, 0.0)], 3.0, 4.0);
    k.track(&[v3(-46.0, -33.0, 0.05), v3(46.0, -33.0, 0.05)]);
    for i in 0..4 {
        k.wagon(v3(12.0 + 4.6 * f64::from(i), -33.0, 0.05), 0.0, "coal_load");
    }
    houses(&mut k);
    bunker(&mut k);
    k.headframe(0.0, 36.0, k_height(&k, 0.0, 36.0), 15.0);
    House {
        width: 12.0,
        depth: 8.0,
        height: 4.2,
        roof: Roof::Shed(1.6),
        doors: &[(0, 0, -3.0, 1.8), (1, 0, 0.0, 3.0)],
        ..House::default()
    }
    .stand(&mut k, -14.0, 36.0, 0);
    // Up to the terrace by stairs, a ramp and a foot bridge over the street.
    k.stairs("wood_steps", v3(7.0, -4.0, 0.0), 0, 5.0, 3.25, 3.0);
    k.ramp("concrete_ramp", v3(4.5, 10.0, 0.2), 0, 8.0, 3.1, 3.4);
    k.bridge("plank_bridge", v3(-9.5, -19.0, 3.9), v3(11.5, -19.0, 3.5), 2.4, false);
    for (x, y) in [(-5.5, -8.0), (-5.5, 4.0), (3.5, -14.0), (3.0, 3.0), (-5.5, -26.0)] {
        k.put(Prop::StreetLamp, x, y, 0.0, 0.0, 1.3);
    }
    k.crates(5.0, -9.5, 0.0, 5);
    k.crates(-10.5, 3.5, 0.0, 3);
    k.barrels(-6.5, -15.0, 0.0, 4);
    k.barrels(4.5, 4.0, 0.0, 3);
    k.put(Prop::Sign, -6.5, -1.0, 0.0, 1.57, 1.1);
    k.fence("plank_fence", &[v3(-44.0, -28.5, 0.0), v3(-7.0, -28.5, 0.0)], 1.4);
    for (x, y, s) in [(27.0, -27.0, 3.0), (32.0, -25.5, 2.2), (22.0, -25.0, 1.8), (9.0, 33.0, 2.4), (-7.0, 44.0, 2.0)] {
        let z = k.ground.height(x, y);
        k.put(Prop::CoalHeap, x, y, z, 0.4 * x, s);
    }
    let area = [-60.0, -60.0, 60.0, 60.0];
    let out = |x: f64, y: f64| (x + 2.0).abs() > 8.0 && (y + 33.0).abs() > 4.0;
    k.scatter(&[(Prop::Pine, 5.0, 9.0), (Prop::Tree, 4.0, 6.0)], 60, area, move |x, y, _, s| {
        s < 1.4 && x.abs().max(y.abs()) > 40.0 && out(x, y)
    });
    k.scatter(&[(Prop::Rock, 0.6, 2.4)], 70, area, move |x, y, _, s| s > 0.4 && out(x, y));
    k.scatter(&[(Prop::Bush, 0.6, 1.3), (Prop::Tuft, 0.8, 1.4)], 120, area, move |x, y, _, s| s < 0.6 && out(x, y));
    Map { kit: k, bottom: -6.0, paint: meadow, line: [v3(-7.0, -8.0, 5.4), v3(5.0, -8.0, 5.4)] }
}

fn k_height(k: &Kit, x: f64, y: f64) -> f64 {
    k.ground.height(x, y)
}

fn houses(k: &mut Kit) {
    let plots: [(f64, f64, i32, usize, f64, &str); 9] = [
        (-12.5, -20.0, 1, 2, 2.6, "plank_house"),
        (-12.5, 12.0, 1, 1, 2.4, "brick_house"),
        (-26.0, -18.0, 1, 1, 2.2, "paint_house"),
        (-27.0, 2.0, 1, 2, 2.8, "plank_house"),
        (-26.0, 20.0, 0, 1, 2.2, "brick_house"),
        (18.0, -18.0, 3, 2, 2.6, "red_house"),
        (18.0, -2.0, 3, 1, 2.4, "plank_house"),
        (19.0, 13.0, 3, 2, 2.6, "paint_house"),
        (34.0, 4.0, 3, 1, 2.4, "plank_house"),
    ];
    for (i, (x, y, quarters, storeys, rise, wall)) in plots.into_iter().enumerate() {
        House {
            width: 11.0 + (i % 3) as f64,
            depth: 9.0,
            storeys,
            height: 3.5,
            wall,
            roof: if i == 4 { Roof::Flat } else { Roof::Gable(rise) },
            roof_paint: if i % 2 == 0 { "roof_shingle" } else { "rust_sheet_roof" },
            doors: &[(0, 0, -2.0, 1.8), (2, 0, 3.6, 1.8), (0, 1, 2.0, 1.8)],
            windows: 3.2,
            partition: (storeys == 1).then_some(1.5),
            ..House::default()
        }
        .stand(k, x, y, quarters);
    }
}

fn bunker(k: &mut Kit) {
    // Tall and square, the railway passes beneath its mouth.
    k.flatten(24.0, -50.0, 40.0, -36.0, 0.0, 3.0);
    k.at(32.0, -43.0, 0.1, 0, |k| {
        House {
            width: 13.0,
            depth: 11.0,
            storeys: 3,
            height: 4.0,
            wall: "brick_bunker",
            roof: Roof::Tent(3.0),
            roof_paint: "metal_roof",
            doors: &[(2, 0, -2.0, 3.0), (0, 0, 2.0, 1.8), (3, 0, 0.0, 1.8), (2, 2, 0.0, 3.0)],
            windows: 3.4,
            ..House::default()
        }
        .build(k);
    });
    // The conveyor: a slim gallery on trestles from the pithead.
    let (from, to) = (v3(5.5, 33.0, 13.0), v3(30.0, -37.0, 9.6));
    k.b.object();
    k.b.paint("rust_sheet_conveyor");
    k.b.beam(from, to, 2.2, 0.25);
    for x in [-1.0, 1.0] {
        k.b.beam(from + v3(x, 0.3 * x, 0.7), to + v3(x, 0.3 * x, 0.7), 0.12, 1.2);
    }
    k.b.beam(from + v3(0.0, 0.0, 2.4), to + v3(0.0, 0.0, 2.4), 2.8, 0.15);
    k.b.paint("wood_trestle");
    for i in 1..8 {
        let p = from + (to - from) * (f64::from(i) / 8.0);
        let z = k.ground.height(p.x, p.y) - 0.5;
        for s in [-1.2, 1.2] {
            k.b.beam(v3(p.x + 1.5 * s, p.y + 0.5 * s, z), p + v3(s, 0.35 * s, 0.0), 0.28, 0.28);
            k.b.beam(p + v3(s, 0.35 * s, 0.0), p + v3(s, 0.35 * s, 2.4), 0.16, 0.16);
        }
        let m = v3(p.x, p.y, (p.z + z) * 0.5);
        k.b.beam(m - v3(1.5, 0.5, 0.0), m + v3(1.5, 0.5, 0.0), 0.2, 0.24);
    }
}
