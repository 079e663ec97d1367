//! Ravine: a cleft with a stream divides two farmsteads; wooden bridges, a
//! covered bridge and paths down to the water join them.

use super::house::{House, Roof};
use super::kit::Kit;
use super::{Map, meadow, rim};
use crate::scene::generate::builder::v3;
use crate::scene::generate::props::Prop;
use crate::scene::generate::terrain::{Terrain, hills, mix};

const HALF: f64 = 72.0;
const WATER: f64 = -10.6;

/// Middle of the stream; odd in y, so that the halves match.
fn stream(y: f64) -> f64 {
    5.0 * libm::sin(y / 13.0)
}

pub(super) fn build(seed: u64) -> Map {
    let ground = Terrain::new(HALF, 128, |x, y| {
        let land = 1.2
            + 0.9 * hills(seed, x / 21.0, y / 21.0)
            + rim(x, y, 56.0, HALF, 15.0) * (1.0 + 0.2 * hills(seed + 4, x / 10.0, y / 10.0));
        let off = (x - stream(y)).abs();
        mix(
            land,
            -12.0 + 0.4 * hills(seed + 2, x / 6.0, y / 6.0),
            (12.0 + hills(seed + 7, x / 7.0, y / 7.0) - off) / 5.5,
        )
    });
    let mut k = Kit::new("", seed, ground);
    k.b.paint("water_stream");
    k.b.block(v3(-19.0, -HALF + 0.5, WATER - 4.0), v3(19.0, HALF - 0.5, WATER));
    k.twice(side);
    covered_bridge(&mut k);
    let area = [-70.0, -70.0, 70.0, 70.0];
    let bank = |x: f64, y: f64| (x - stream(y)).abs();
    k.scatter(&[(Prop::Rock, 0.5, 2.2)], 110, area, move |x, y, z, s| (s > 0.5 || bank(x, y) < 9.0) && z > WATER - 1.0);
    k.scatter(&[(Prop::Pine, 6.0, 11.0), (Prop::Tree, 5.0, 7.0)], 90, area, move |x, y, _, s| {
        s < 1.2 && bank(x, y) > 15.0 && (x.abs() > 50.0 || y.abs() > 30.0)
    });
    k.scatter(&[(Prop::Bush, 0.6, 1.4), (Prop::Tuft, 0.8, 1.5)], 160, area, move |x, y, z, s| {
        s < 0.7 && z > -1.0 && bank(x, y) > 12.0
    });
    Map { kit: k, bottom: -18.0, paint: meadow, line: [v3(-9.0, 1.6, 6.2), v3(9.0, 1.6, 6.2)] }
}

fn covered_bridge(k: &mut Kit) {
    k.at(0.0, 0.0, 1.25, 0, |k| {
        House {
            width: 36.0,
            depth: 6.0,
            height: 3.8,
            wall: "red_barn_boards",
            roof: Roof::Gable(2.2),
            doors: &[(1, 0, 0.0, 3.0), (3, 0, 0.0, 3.0)],
            windows: 3.6,
            foot: 0.9,
            ..House::default()
        }
        .build(k);
        k.b.object();
        k.b.paint("rock_pier");
        for x in [-7.0, 7.0] {
            k.b.block(v3(x - 1.2, -2.6, -15.0), v3(x + 1.2, 2.6, -0.6));
        }
    });
    for x in [-21.0, 21.0] {
        k.flatten(x - 4.0, -4.0, x + 4.0, 4.0, 1.2, 3.0);
    }
}

fn side(k: &mut Kit, team: usize) {
    let wall = ["red_barn_boards", "blue_boards"][team];
    k.flatten(30.0, -22.0, 54.0, 24.0, 1.4, 7.0);
    k.road(&[v3(18.0, 0.0, 1.2), v3(32.0, 0.0, 1.4)], 3.0, 4.0);
    // The barn, the house, the store and a loft bridge between the first two.
    House {
        width: 20.0,
        depth: 13.0,
        storeys: 2,
        height: 4.2,
        wall,
        roof: Roof::Gable(3.8),
        doors: &[(0, 0, 0.0, 4.0), (2, 0, 5.0, 1.8), (1, 0, 0.0, 1.8), (3, 1, 0.0, 1.8), (0, 1, -5.0, 3.0)],
        windows: 3.6,
        ..House::default()
    }
    .stand(k, 44.0, 12.0, 3);
    House {
        width: 12.0,
        depth: 10.0,
        storeys: 2,
        height: 4.2,
        wall: "plaster_house",
        roof: Roof::Gable(3.0),
        roof_paint: "slate_roof",
        doors: &[(0, 0, -2.0, 1.8), (2, 0, 2.0, 1.8), (1, 1, 0.0, 1.8), (3, 0, 0.0, 1.8)],
        windows: 3.0,
        ..House::default()
    }
    .stand(k, 43.0, -14.0, 3);
    k.bridge("plank_bridge", v3(43.0, -7.9, 5.7), v3(43.0, 2.0, 5.7), 2.2, false);
    House {
        width: 9.0,
        depth: 7.0,
        height: 3.6,
        roof: Roof::Shed(1.3),
        wall: "plank_store",
        doors: &[(0, 0, 0.0, 3.0)],
        windows: 3.0,
        ..House::default()
    }
    .stand(k, 27.0, 19.0, 3);
    // Foot bridges across, each half a side's own.
    k.flatten(15.0, -33.0, 22.0, -27.0, 1.5, 3.0);
    k.flatten(-16.0, -33.0, -10.0, -27.0, 1.5, 3.0);
    k.bridge("plank_bridge", v3(-12.5, -30.0, 1.65), v3(17.5, -30.0, 1.65), 2.6, true);
    // A path with steps down to the water.
    let x = stream(22.0) + 6.5;
    k.stairs("rock_steps", v3(x, 22.0, -10.6), 0, 12.5, 11.8, 2.6);
    k.flatten(x + 12.3, 20.0, x + 17.0, 24.0, 1.2, 2.0);
    k.flatten(x - 3.0, 19.5, x + 0.3, 24.5, -10.55, 1.5);
    k.watchtower(30.0, -24.0, 8.0);
    // A tunnel through the spur beside the cleft.
    k.ground.shape(|px, py, h| {
        let s = if team == 0 { 1.0 } else { -1.0 };
        let (dx, dy) = (px * s - 33.0, py * s - 34.0);
        h + 6.5 * libm::exp(-(dx * dx + dy * dy * 0.6) / 60.0)
    });
    k.at(33.0, 33.0, 1.3, 0, |k| k.tunnel(12.0, 3.6, 3.4, "rock_tunnel"));
    k.crates(33.0, 3.6, 1.35, 5);
    k.crates(35.0, -20.0, 1.4, 3);
    k.barrels(35.5, -8.0, 1.4, 4);
    for (x, y) in [(31.0, 8.0), (32.6, 9.5), (31.2, 10.4), (36.0, 22.0)] {
        k.put(Prop::Hay, x, y, 1.35, 0.3 * x, 1.1);
    }
    k.put(Prop::WaterTank, 52.5, -3.0, 1.3, 0.4, 2.0);
    k.fence("plank_fence", &[v3(24.0, -6.0, 0.0), v3(24.0, -20.0, 0.0), v3(34.0, -24.0, 0.0)], 1.2);
    for y in [-4.5, 4.5] {
        k.put(Prop::StreetLamp, 23.0, y, 1.2, 0.0, 1.3);
    }
    k.put(Prop::Sign, 25.0, -4.0, 1.2, -1.57, 1.1);
}
