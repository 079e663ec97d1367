//! `rooms`: two floors of forty rooms with objects, after the indoor worlds 1-4
//! of Silva (2009), of which only the triangle counts and the number of rooms are
//! published. Four rows of ten rooms lie along two corridors; lobbies with stairs
//! join the corridors and the floors at both ends.

use super::budget::spend;
use super::builder::{Builder, Frame, v3};
use super::props::{Placed, Prop};
use super::random::Random;
use super::solids::{Along, Rect};
use super::{Entry, Generator};
use crate::registry::{Default, Param, Spec};
use crate::scene::Scene;

/// Triangles of worlds 1 to 4 (Silva 2009).
const PUBLISHED: [usize; 4] = [6_199, 102_232, 102_232, 30_199];
/// What the bare building needs, rounded up.
pub(super) const TRIANGLES_MIN: i64 = 5_500;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "rooms",
    about: "two floors of 40 rooms with objects (Silva 2009, worlds 1-4)",
    revision: 1,
    params: &[
        Param {
            name: "world",
            default: Default::Int { value: 1, min: 1, max: 4 },
            about: "preset: 6,199, 102,232, 102,232 (clustered) or 30,199 triangles",
        },
        Param {
            name: "triangles",
            default: Default::Int { value: 0, min: 0, max: 4_000_000 },
            about: "exact number of triangles, at least 5,500; 0 takes the world's",
        },
        Param {
            name: "distribution",
            default: Default::Choice(&["world", "uniform", "clustered"]),
            about: "objects spread over all rooms, or crowded into a few; world 3 is clustered",
        },
        Param { name: "seed", default: Default::Int { value: 1, min: 0, max: i64::MAX }, about: "places the objects" },
    ],
    make: |spec| Box::new(Rooms::new(spec)),
};

struct Rooms {
    world: usize,
    triangles: usize,
    clustered: bool,
    seed: u64,
}

impl Rooms {
    fn new(spec: &Spec) -> Rooms {
        let world = spec.int("world") as usize;
        let triangles = match spec.int("triangles") {
            0 => PUBLISHED[world - 1],
            n => n as usize,
        };
        let clustered = match spec.text("distribution") {
            "clustered" => true,
            "uniform" => false,
            _ => world == 3,
        };
        Rooms { world, triangles, clustered, seed: spec.int("seed") as u64 }
    }
}

const ROOM: f64 = 6.0;
const CORRIDOR: f64 = 3.0;
const LOBBY: f64 = 6.0;
const STOREY: f64 = 3.4;
const SLAB: f64 = 0.3;
const WALL: f64 = 0.2;
/// South edge of each row of rooms, and whether its door is in the north wall.
const ROWS: [(f64, bool); 4] =
    [(0.0, true), (ROOM + CORRIDOR, false), (2.0 * ROOM + CORRIDOR, true), (3.0 * ROOM + 2.0 * CORRIDOR, false)];
const LENGTH: f64 = 10.0 * ROOM;
const DEPTH: f64 = 4.0 * ROOM + 2.0 * CORRIDOR;

impl Generator for Rooms {
    fn generate(&self) -> Scene {
        let mut b = Builder::new(&format!("rooms, world {}", self.world));
        building(&mut b);
        let mut rng = Random::part(self.seed, 1);
        let mut props = Vec::new();
        let crowded: Vec<bool> = {
            let mut rooms: Vec<usize> = (0..80).collect();
            rng.shuffle(&mut rooms);
            (0..80).map(|r| rooms[..12].contains(&r)).collect()
        };
        // One thing a room first, so that even a small budget furnishes every room.
        for round in 0..16 {
            for (room, crowded) in crowded.iter().enumerate() {
                if !self.clustered || *crowded || round == 0 {
                    props.extend(furnish(room, round, &mut rng));
                }
            }
        }
        let line = [v3(4.0, ROOM + WALL * 0.5 + 0.06, 2.95), v3(34.0, ROOM + WALL * 0.5 + 0.06, 2.95)];
        spend(b, &props, self.triangles, line).finish()
    }
}

fn building(b: &mut Builder) {
    let (x0, x1) = (-LOBBY, LENGTH + LOBBY);
    b.paint("concrete_foundation");
    b.block(v3(x0 - 0.6, -0.6, -0.8), v3(x1 + 0.6, DEPTH + 0.6, 0.0));
    let stairwells: Vec<Rect> = vec![[x0 + 1.4, 9.0, x0 + 3.2, 15.0], [x1 - 3.2, 15.0, x1 - 1.4, 21.0]];
    b.object();
    b.paint("tile_floor");
    b.panel(Along::Z, [x0 - 0.1, -0.1, x1 + 0.1, DEPTH + 0.1], &stairwells, STOREY - SLAB, STOREY);
    b.object();
    b.paint("concrete_roof");
    b.block(v3(x0 - 0.5, -0.5, 2.0 * STOREY - SLAB), v3(x1 + 0.5, DEPTH + 0.5, 2.0 * STOREY));
    for floor in 0..2 {
        b.within(Frame::at(v3(0.0, 0.0, STOREY * f64::from(floor))), |b| storey(b, x0, x1));
    }
    b.paint("concrete_stairs");
    for (well, quarters) in stairwells.iter().zip([1, 3]) {
        b.object();
        let (cx, cy) = ((well[0] + well[2]) * 0.5, (well[1] + well[3]) * 0.5);
        let half = (well[3] - well[1]) * 0.5;
        b.within(Frame::quarter(v3(cx, cy, 0.0), quarters), |b| {
            b.open_stairs(v3(-half + 0.4, -0.85, -0.02), v3(half + 0.02, 0.85, STOREY - 0.01), 15, 0.25);
        });
    }
}

fn storey(b: &mut Builder, x0: f64, x1: f64) {
    let (z0, z1) = (-0.02, STOREY - SLAB + 0.02);
    let windows: Vec<Rect> = (0..10).map(|i| ROOM * f64::from(i) + 1.8).map(|x| [x, 0.9, x + 2.4, 2.3]).collect();
    let ends: Vec<Rect> = [6.6, 21.6].iter().map(|y| [*y, 0.9, y + 1.8, 2.3]).collect();
    b.object();
    b.paint("brick_outer");
    for y in [0.0, DEPTH] {
        b.panel(Along::Y, [x0, z0, x1, z1], &windows, y - WALL, y + WALL);
    }
    for x in [x0, x1] {
        b.panel(Along::X, [-WALL, z0, DEPTH + WALL, z1], &ends, x - WALL, x + WALL);
    }
    b.paint("plaster_wall");
    for (y, north) in ROWS {
        b.object();
        let door = if north { y + ROOM } else { y };
        let doors: Vec<Rect> = (0..10).map(|i| ROOM * f64::from(i) + 2.3).map(|x| [x, z0, x + 1.4, 2.2]).collect();
        b.panel(Along::Y, [0.0, z0, LENGTH, z1], &doors, door - WALL * 0.5, door + WALL * 0.5);
        for i in 0..=10 {
            let x = ROOM * f64::from(i);
            b.block(v3(x - WALL * 0.5, y + 0.05, z0), v3(x + WALL * 0.5, y + ROOM - 0.05, z1));
        }
    }
    // Back to back rows share one wall.
    b.block(v3(0.0, 15.0 - WALL * 0.5, z0), v3(LENGTH, 15.0 + WALL * 0.5, z1));
}

/// The `round`-th thing of a room: each has its own place there, so things never
/// stand in each other.
fn furnish(room: usize, round: usize, rng: &mut Random) -> Option<Placed> {
    const PLACES: [(f64, f64); 16] = [
        (0.0, -0.3),
        (-2.2, -2.0),
        (2.2, -2.0),
        (-2.3, 0.2),
        (2.35, 0.2),
        (-1.1, -2.45),
        (1.1, -2.45),
        (0.0, -1.4),
        (-2.4, 2.2),
        (2.4, 2.2),
        (-1.2, -0.3),
        (1.2, -0.3),
        (-0.9, 0.8),
        (0.9, 0.8),
        (-2.4, -1.0),
        (2.4, 1.2),
    ];
    const CENTRE: [Prop; 4] = [Prop::Table, Prop::Sofa, Prop::Bed, Prop::Table];
    const CORNER: [Prop; 6] = [Prop::FloorLamp, Prop::Plant, Prop::Vase, Prop::Column, Prop::Ball, Prop::Crate];
    const WALL_SIDE: [Prop; 3] = [Prop::Shelf, Prop::Shelf, Prop::Crate];
    const SMALL: [Prop; 4] = [Prop::Chair, Prop::Chair, Prop::Vase, Prop::Ball];
    let prop = match round {
        0 => *rng.pick(&CENTRE),
        1 | 2 | 8 | 9 => *rng.pick(&CORNER),
        3 | 4 | 14 | 15 => *rng.pick(&WALL_SIDE),
        5 | 6 => *rng.pick(&WALL_SIDE),
        _ => *rng.pick(&SMALL),
    };
    let (seed, jitter, size) = (rng.bits(), rng.range(-0.12, 0.12), 1.0);
    // A big thing in the middle leaves no room for small ones beside it.
    if (10..14).contains(&round) && room % 3 == 1 {
        return None;
    }
    let (floor, cell) = (room / 40, room % 40);
    let (row, column) = (cell / 10, cell % 10);
    let (y, north) = ROWS[row];
    // In the room's frame the door is towards +y.
    let turn = if north { 0 } else { 2 };
    let (px, py) = PLACES[round];
    let facing = match round {
        3 | 14 => 1,
        4 | 15 => 3,
        5 | 6 => 2,
        13 | 12 => 2,
        10 => 1,
        11 => 3,
        _ => 0,
    };
    let at = v3(ROOM * (column as f64 + 0.5), y + ROOM * 0.5, STOREY * floor as f64);
    let room_frame = Frame::quarter(at, turn);
    let frame = room_frame.then(&Frame::quarter(v3(px + jitter * 0.5, py, 0.0), facing));
    Some(Placed { prop, frame, size, seed })
}
