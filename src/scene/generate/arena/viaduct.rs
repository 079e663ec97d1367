//! Viaduct: a snowed-in mountain village; a stone railway viaduct strides across
//! the middle, chalets and a church on either side, firs all over.

use super::house::{House, Roof};
use super::kit::Kit;
use super::{Map, rim};
use crate::math::DVec3;
use crate::scene::generate::builder::v3;
use crate::scene::generate::props::Prop;
use crate::scene::generate::terrain::{Terrain, hills, mix};

const HALF: f64 = 76.0;
const DECK: f64 = 13.0;

fn snow(_: DVec3, normal: DVec3) -> &'static str {
    if normal.z > 0.72 { "snow_ground" } else { "rock_cliff" }
}

pub(super) fn build(seed: u64) -> Map {
    let ground = Terrain::new(HALF, 128, |x, y| {
        // The valley rises towards both villages and hard to the ends of the viaduct.
        let slope = mix(0.0, 3.4, (y.abs() - 12.0) / 10.0);
        let sides = mix(0.0, DECK, (x.abs() - 46.0) / 9.0);
        let rim = rim(x, y, 60.0, HALF, 18.0);
        slope.max(sides) + 0.5 * hills(seed, x / 16.0, y / 16.0) + rim * (1.0 + 0.2 * hills(seed + 3, x / 9.0, y / 9.0))
    });
    let mut k = Kit::new("", seed, ground);
    k.flatten(-34.0, -9.0, 34.0, 9.0, 0.0, 5.0);
    k.lay(&[v3(-HALF, 0.0, DECK - 0.6), v3(-50.0, 0.0, DECK - 0.6)], 3.4, 4.0);
    k.lay(&[v3(50.0, 0.0, DECK - 0.6), v3(HALF, 0.0, DECK - 0.6)], 3.4, 4.0);
    k.at(0.0, 0.0, DECK - 0.4, 0, |k| {
        k.arcade(9, 11.6, -DECK - 1.5, 6.0, "rock_viaduct");
        k.track(&[v3(-HALF + 1.0, 0.0, 0.05), v3(HALF - 1.0, 0.0, 0.05)]);
        for i in 0..3 {
            k.wagon(v3(-20.0 + 4.6 * f64::from(i), 0.0, 0.05), 0.0, "wood_load");
        }
    });
    k.twice(side);
    // The point to hold: a round platform under the middle arch.
    k.b.object();
    k.b.paint("concrete_platform");
    k.b.column(v3(0.0, 0.0, -0.6), 5.6, 5.2, 1.2, 20);
    k.b.paint("metal_ring");
    k.b.column(v3(0.0, 0.0, 0.55), 3.2, 3.0, 0.12, 20);
    k.keep_out(-7.0, -7.0, 7.0, 7.0);
    let area = [-74.0, -74.0, 74.0, 74.0];
    let way = |x: f64, y: f64| (y.abs() > 6.0 || x.abs() < 46.0) && !(x.abs() < 6.0 && y.abs() < 46.0);
    k.scatter(&[(Prop::SnowPine, 6.0, 12.0)], 210, area, move |x, y, _, s| {
        s < 1.5 && way(x, y) && (x.abs() > 34.0 || y.abs() > 42.0)
    });
    k.scatter(&[(Prop::SnowPine, 4.0, 7.0), (Prop::SnowRock, 0.6, 1.6)], 50, area, move |x, y, _, s| {
        s < 0.9 && way(x, y) && y.abs() > 11.0
    });
    k.scatter(&[(Prop::SnowRock, 0.7, 2.8)], 110, area, move |x, y, _, s| s > 0.5 && way(x, y));
    Map { kit: k, bottom: -8.0, paint: snow, line: [v3(-5.8, 3.4, 6.4), v3(5.8, 3.4, 6.4)] }
}

fn side(k: &mut Kit, team: usize) {
    let paint = ["red_chalet", "blue_chalet"][team];
    k.road(&[v3(0.0, 9.0, 0.0), v3(0.0, 24.0, 3.4), v3(2.0, 46.0, 3.6)], 3.4, 3.0);
    // The base closes the street.
    k.flatten(-14.0, 46.0, 16.0, 60.0, 3.6, 3.0);
    k.at(1.0, 52.0, 3.7, 0, |k| {
        House {
            width: 24.0,
            depth: 12.0,
            storeys: 2,
            height: 4.0,
            wall: paint,
            roof: Roof::Gable(4.4),
            roof_paint: "snow_roof",
            doors: &[(0, 0, 0.0, 4.0), (0, 0, 8.0, 1.8), (0, 0, -8.0, 1.8), (0, 1, 0.0, 3.0), (1, 0, 0.0, 1.8)],
            windows: 3.4,
            partition: Some(-5.0),
            ..House::default()
        }
        .build(k);
        k.block("plank_balcony", v3(-5.0, -8.4, 3.75), v3(5.0, -5.9, 4.0));
        k.railing("wood_rail", &[v3(-4.9, -6.0, 4.0), v3(-4.9, -8.3, 4.0), v3(4.9, -8.3, 4.0), v3(4.9, -6.0, 4.0)]);
        for x in [-4.7, 4.7] {
            k.block("wood_post", v3(x - 0.15, -8.3, -1.0), v3(x + 0.15, -8.0, 3.8));
        }
    });
    // Chalets along the street, gables to it.
    for (i, (x, y, q)) in
        [(-12.0, 18.0, 1), (-13.0, 33.0, 1), (12.5, 30.0, 3), (26.0, 22.0, 3), (-28.0, 24.0, 1)].into_iter().enumerate()
    {
        House {
            width: 10.0 + (i % 2) as f64 * 2.0,
            depth: 9.0,
            storeys: if i % 2 == 0 { 2 } else { 1 },
            height: 3.4,
            wall: ["plank_chalet", "plaster_chalet"][i % 2],
            roof: Roof::Gable(3.2),
            roof_paint: "snow_roof",
            doors: &[(0, 0, -1.5, 1.8), (2, 0, 3.0, 1.8), (0, 1, 2.0, 1.8)],
            windows: 3.0,
            ..House::default()
        }
        .stand(k, x, y, q);
    }
    church(k);
    // Up to the track: a stair tower against the viaduct's end.
    k.ramp("rock_ramp", v3(30.0, 6.4, 0.1), 0, 21.0, DECK - 0.4, 3.0);
    k.flatten(50.0, 4.0, 55.0, 9.0, DECK - 0.4, 2.0);
    k.crates(8.0, 10.5, 0.3, 5);
    k.crates(-9.0, -9.5, 0.3, 4);
    k.barrels(-6.5, 25.0, 3.4, 4);
    k.log_pile(18.0, 12.0, 0.1, 0, 5);
    k.log_pile(-22.0, 11.5, 0.2, 0, 4);
    for (x, y) in [(-4.6, 13.0), (4.6, 20.0), (-4.6, 28.0), (4.8, 38.0), (12.0, 7.6), (-12.0, 7.6)] {
        let p = k.b.frame().apply(v3(x, y, 0.0));
        let z = k.ground.height(p.x, p.y);
        k.put(Prop::StreetLamp, x, y, z, 0.0, 1.3);
    }
    k.put(Prop::Sandbags, 9.0, 4.5, 0.0, 0.5, 1.0);
    k.put(Prop::Sandbags, -9.0, 4.5, 0.0, -0.5, 1.0);
    k.put(Prop::Bench, 6.5, 24.0, 3.2, -1.57, 1.2);
    k.put(Prop::Sign, -5.0, 20.0, 2.7, 1.2, 1.1);
    k.fence("plank_fence", &[v3(8.0, 38.0, 0.0), v3(30.0, 40.0, 0.0)], 1.3);
}

fn church(k: &mut Kit) {
    House {
        width: 14.0,
        depth: 8.5,
        height: 6.0,
        wall: "plaster_church",
        roof: Roof::Gable(4.6),
        roof_paint: "slate_church_roof",
        doors: &[(3, 0, 0.0, 1.8), (0, 0, 4.0, 1.8)],
        windows: 3.2,
        ..House::default()
    }
    .stand(k, 30.0, 36.0, 0);
    House {
        width: 5.0,
        depth: 5.0,
        storeys: 4,
        height: 4.4,
        wall: "plaster_church",
        roof: Roof::Tent(7.0),
        roof_paint: "slate_church_roof",
        doors: &[(1, 0, 0.0, 1.8), (3, 0, 0.0, 1.8), (0, 3, 0.0, 1.6), (2, 3, 0.0, 1.6)],
        windows: 0.0,
        stairs: false,
        ..House::default()
    }
    .stand(k, 20.7, 36.0, 0);
}
