//! Gold Rush: a long canyon in three legs. A cart track winds through mining
//! camps, under bridges and through tunnels to a depot at the far end.

use super::house::{House, Roof};
use super::kit::Kit;
use super::{Map, desert};
use crate::math::DVec3;
use crate::scene::generate::builder::v3;
use crate::scene::generate::props::Prop;
use crate::scene::generate::terrain::{Terrain, hills};

const HALF: f64 = 104.0;

/// The cart's way: three legs joined by two bends, climbing all the time.
fn way() -> [DVec3; 11] {
    [
        v3(-88.0, -72.0, 0.0),
        v3(-20.0, -72.0, 0.6),
        v3(28.0, -66.0, 1.6),
        v3(68.0, -66.0, 2.6),
        v3(78.0, -50.0, 3.2),
        v3(74.0, -8.0, 4.6),
        v3(30.0, 0.0, 5.6),
        v3(-58.0, 2.0, 7.6),
        v3(-74.0, 20.0, 8.4),
        v3(-66.0, 62.0, 9.6),
        v3(84.0, 70.0, 11.6),
    ]
}

pub(super) fn build(seed: u64) -> Map {
    let ground = Terrain::new(HALF, 256, |x, y| {
        // Mesas in steps, which the canyon is then cut into.
        let h = 17.0 + 0.03 * y + 5.0 * hills(seed, x / 31.0, y / 31.0);
        let step = (h / 3.5).floor() * 3.5;
        step + (h - step) * (h - step) * (h - step) * (h - step) / 45.0 + 0.5 * hills(seed + 8, x / 7.0, y / 7.0)
    });
    let mut k = Kit::new("", seed, ground);
    let way = way();
    let rough: u64 = seed + 21;
    // The canyon's width varies, its walls are steep.
    let (wide, line) = (|x: f64, y: f64| 17.0 + 3.5 * hills(rough, x / 18.0, y / 18.0), way);
    k.ground.shape(|x, y, h| {
        let (d, z) = super::super::terrain::nearest(&line, x, y);
        super::super::terrain::mix(h, z + 0.35 * hills(rough + 5, x / 12.0, y / 12.0), (wide(x, y) + 5.0 - d) / 5.0)
    });
    k.road(&way, 2.4, 2.5);
    k.track(&way.map(|p| p + v3(0.0, 0.0, 0.05)));
    for (x, y, z, a) in [(-60.0, -72.0, 0.27, 0.0), (-56.0, -72.0, 0.3, 0.0), (0.0, 0.68, 6.32, 3.12)] {
        k.wagon(v3(x, y, z), a, "gold_load");
    }
    camps(&mut k);
    depot(&mut k);
    crossings(&mut k);
    clutter(&mut k);
    let area = [-102.0, -102.0, 102.0, 102.0];
    let off = |x: f64, y: f64| super::super::terrain::nearest(&way, x, y).0;
    k.scatter(&[(Prop::Rock, 0.6, 3.2), (Prop::Rock, 0.4, 1.2)], 330, area, |x, y, _, s| {
        s > 0.45 && off(x, y) > 5.0 && off(x, y) < 45.0
    });
    k.scatter(&[(Prop::Rock, 0.3, 0.9), (Prop::Bush, 0.5, 1.2), (Prop::Tuft, 0.7, 1.3)], 330, area, |x, y, _, s| {
        s < 0.5 && off(x, y) > 4.0
    });
    k.scatter(&[(Prop::Tree, 3.5, 5.5), (Prop::Pine, 4.0, 7.0)], 70, area, |x, y, _, s| s < 0.5 && off(x, y) > 9.0);
    Map { kit: k, bottom: -8.0, paint: desert, line: [v3(-21.0, -62.0, 6.2), v3(-21.0, -82.0, 6.2)] }
}

/// Houses on both sides of the track, fronts to it.
fn camps(k: &mut Kit) {
    // x, y, quarters, width, storeys, wall.
    let houses: [(f64, f64, i32, f64, usize, &str); 20] = [
        (-80.0, -60.0, 0, 14.0, 2, "red_shed"),
        (-58.0, -59.0, 0, 12.0, 1, "plank_shack"),
        (-40.0, -60.0, 0, 11.0, 2, "plank_saloon"),
        (-30.0, -84.0, 2, 12.0, 1, "brick_assay"),
        (-48.0, -84.0, 2, 13.0, 2, "plank_hotel"),
        (-4.0, -58.0, 0, 12.0, 2, "plaster_store"),
        (6.0, -82.0, 2, 12.0, 1, "plank_shack"),
        (44.0, -54.0, 0, 12.0, 2, "plank_barn"),
        (48.0, -79.0, 2, 14.0, 1, "rust_sheet_shed"),
        (89.0, -40.0, 3, 13.0, 2, "plank_store"),
        (63.0, -28.0, 1, 11.0, 1, "brick_pump"),
        (88.0, -16.0, 3, 11.0, 1, "plank_shack"),
        (36.0, 13.0, 0, 13.0, 2, "plank_saloon"),
        (20.0, -12.0, 2, 12.0, 1, "plaster_bank"),
        (-4.0, 13.5, 0, 12.0, 2, "brick_mill"),
        (-20.0, -11.0, 2, 13.0, 2, "plank_hotel"),
        (-44.0, 14.0, 0, 12.0, 1, "plank_shack"),
        (-86.0, 36.0, 1, 12.0, 2, "plank_barn"),
        (-44.0, 74.0, 0, 13.0, 1, "rust_sheet_shed"),
        (-20.0, 54.0, 2, 12.0, 2, "paint_office"),
    ];
    for (i, (x, y, q, width, storeys, wall)) in houses.into_iter().enumerate() {
        House {
            width,
            depth: 9.0,
            storeys,
            height: 3.7,
            wall,
            roof: match i % 4 {
                0 | 3 => Roof::Gable(2.6),
                1 => Roof::Shed(1.5),
                _ => Roof::Flat,
            },
            roof_paint: ["rust_sheet_roof", "roof_shingle", "plank_roof"][i % 3],
            // Quarter 0 has its back to +y: the track is at -y.
            doors: &[(0, 0, -2.0, 1.8), (0, 0, 3.0, 1.8), (2, 0, -3.4, 1.8), (0, 1, 0.0, 1.8)],
            windows: 3.1,
            partition: (i % 3 == 1).then_some(0.5),
            ..House::default()
        }
        .stand(k, x, y, q);
        porch(k, x, y, q, width);
    }
    for (x, y, h) in [
        (-66.0, -84.0, 8.0),
        (24.0, -56.0, 9.0),
        (62.0, -10.0, 8.0),
        (-34.0, -13.0, 10.0),
        (-84.0, 10.0, 9.0),
        (16.0, 54.0, 9.0),
    ] {
        k.watchtower(x, y, h);
    }
    for (x, y) in [(66.0, -82.0), (-58.0, -14.0), (8.0, 84.0)] {
        let z = k.ground.height(x, y);
        k.flatten(x - 4.0, y - 4.0, x + 11.0, y + 4.0, z, 3.0);
        k.headframe(x, y, z, 14.0);
    }
}

/// A boardwalk with a roof on posts before a front.
fn porch(k: &mut Kit, x: f64, y: f64, quarters: i32, width: f64) {
    let z = k.ground.height(x, y) + 0.12;
    k.at(x, y, z, quarters, |k| {
        let (w, front) = (width * 0.5, -4.5);
        k.b.object();
        k.b.paint("plank_porch");
        k.b.block(v3(-w, front - 2.6, -1.0), v3(w, front - 0.1, -0.03));
        k.b.paint("wood_post");
        let posts = 4;
        for i in 0..=posts {
            let u = -w + 0.2 + (width - 0.4) * f64::from(i) / f64::from(posts);
            k.b.block(v3(u - 0.1, front - 2.5, -0.1), v3(u + 0.1, front - 2.3, 2.75));
        }
        k.b.paint("plank_porch_roof");
        k.b.hexahedron([
            v3(-w, front - 2.8, 2.6),
            v3(w, front - 2.8, 2.6),
            v3(w, front + 0.1, 3.0),
            v3(-w, front + 0.1, 3.0),
            v3(-w, front - 2.8, 2.75),
            v3(w, front - 2.8, 2.75),
            v3(w, front + 0.1, 3.15),
            v3(-w, front + 0.1, 3.15),
        ]);
        k.set(Prop::Bench, 0.6, front - 0.6, -0.03, 0, 1.0);
        k.set(Prop::Barrel, -w + 0.8, front - 0.7, -0.03, 0, 1.0);
    });
}

/// The last stage: a great depot astride the end of the track, over a pit.
fn depot(k: &mut Kit) {
    k.flatten(50.0, 48.0, 98.0, 92.0, 11.4, 6.0);
    k.at(76.0, 69.0, 11.5, 0, |k| {
        House {
            width: 34.0,
            depth: 26.0,
            storeys: 2,
            height: 5.2,
            wall: "red_depot",
            roof: Roof::Saw(3.2, 4),
            roof_paint: "rust_sheet_roof",
            doors: &[
                (3, 0, 0.0, 5.0),
                (3, 0, 9.0, 1.8),
                (0, 0, -8.0, 3.0),
                (2, 0, 6.0, 3.0),
                (1, 0, 0.0, 4.0),
                (3, 1, 6.0, 3.0),
                (3, 1, -7.0, 1.8),
                (0, 1, 6.0, 1.8),
            ],
            windows: 4.0,
            partition: Some(6.0),
            ..House::default()
        }
        .build(k);
        k.block("plank_balcony", v3(-20.6, -12.0, 4.9), v3(-16.9, 12.0, 5.2));
        k.railing(
            "wood_rail",
            &[v3(-17.2, -11.9, 5.2), v3(-20.5, -11.9, 5.2), v3(-20.5, 11.9, 5.2), v3(-17.2, 11.9, 5.2)],
        );
        for y in [-11.0, -4.0, 4.0, 11.0] {
            k.block("wood_post", v3(-20.4, y - 0.2, -1.5), v3(-20.0, y + 0.2, 5.0));
        }
        for i in 0..5 {
            k.set(Prop::Girder, -14.0 + 7.0 * f64::from(i), 0.0, 10.3, 1, 25.0);
        }
        k.crates(-8.0, -8.0, 0.0, 6);
        k.crates(-6.0, 4.0, 0.0, 5);
        k.barrels(2.0, -9.0, 0.0, 5);
        k.crates(-10.0, 0.0, 5.2, 4);
        k.barrels(0.0, -6.0, 5.2, 5);
    });
    k.put(Prop::WaterTank, 54.0, 52.0, 11.3, 0.2, 2.8);
    k.put(Prop::WaterTank, 56.0, 88.0, 11.3, 0.7, 2.4);
}

/// Short cuts through the mesas and bridges over the track.
fn crossings(k: &mut Kit) {
    for (x, y, z, q, l) in [
        (-10.0, -36.0, 3.4, 1, 30.0),
        (52.0, -36.0, 3.8, 1, 26.0),
        (-30.0, 34.0, 8.2, 1, 26.0),
        (40.0, 36.0, 8.6, 1, 30.0),
    ] {
        k.lay(&[v3(x, y - l * 0.5 - 12.0, z - 1.2), v3(x, y, z), v3(x, y + l * 0.5 + 12.0, z + 1.4)], 2.6, 2.0);
        k.at(x, y, z, q, |k| k.tunnel(l, 4.0, 3.6, "rock_tunnel"));
    }
    // Bridges at the height of the upper floors, from house to house.
    k.bridge("plank_bridge", v3(-41.0, -64.4, 4.2), v3(-47.0, -79.6, 4.2), 2.2, true);
    k.bridge("plank_bridge", v3(-3.0, 9.0, 10.4), v3(-18.0, -6.6, 10.4), 2.2, true);
    for (x0, y0, x1, y1, z) in
        [(20.0, -46.0, 22.0, -88.0, 8.5), (52.0, 20.0, 56.0, -20.0, 12.0), (-88.0, 44.0, -50.0, 48.0, 16.0)]
    {
        k.bridge("wood_trestle_bridge", v3(x0, y0, z), v3(x1, y1, z), 3.0, true);
    }
}

/// What miners leave about: every few metres something beside the track.
fn clutter(k: &mut Kit) {
    for leg in way().windows(2) {
        let (d, length) = ((leg[1] - leg[0]).normalize(), leg[0].distance(leg[1]));
        let side = v3(d.y, -d.x, 0.0).normalize();
        for i in 1..(length / 9.0) as usize {
            let s = if i % 2 == 0 { 1.0 } else { -1.0 };
            let p = leg[0] + d * (9.0 * i as f64) + side * (s * k.rng.range(4.2, 6.4));
            let z = k.ground.height(p.x, p.y) - 0.02;
            match k.rng.below(7) {
                0 | 1 => k.crates(p.x, p.y, z, 4),
                2 => k.barrels(p.x, p.y, z, 5),
                3 => k.put(Prop::StreetLamp, p.x, p.y, z, 0.0, 1.3),
                4 => k.put(Prop::Sandbags, p.x, p.y, z, 0.4 * p.x, 1.0),
                5 => k.put(Prop::Hay, p.x, p.y, z, 0.7 * p.y, 1.1),
                _ => k.put(Prop::Sign, p.x, p.y, z, libm::atan2(d.y, d.x), 1.1),
            }
        }
    }
}
