//! `blocks`: nine city blocks of sixteen buildings, after the outdoor worlds 5
//! and 6 of Silva (2009), of which only the counts are published.

use super::budget::spend;
use super::builder::{Builder, Frame, v2, v3};
use super::props::{Placed, Prop};
use super::random::Random;
use super::solids::Along;
use super::{Entry, Generator};
use crate::registry::{Default, Param, Spec};
use crate::scene::Scene;

/// Triangles of worlds 5 and 6 (Silva 2009).
const PUBLISHED: [usize; 2] = [2_548, 10_040];
/// Ground, pavements and 144 plain buildings.
pub(super) const TRIANGLES_MIN: i64 = 2_400;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "blocks",
    about: "9 city blocks of 16 buildings (Silva 2009, worlds 5 and 6)",
    revision: 1,
    params: &[
        Param {
            name: "world",
            default: Default::Int { value: 5, min: 5, max: 6 },
            about: "preset: 2,548 or 10,040 triangles",
        },
        Param {
            name: "triangles",
            default: Default::Int { value: 0, min: 0, max: 4_000_000 },
            about: "exact number of triangles, at least 2,400; 0 takes the world's",
        },
        Param {
            name: "distribution",
            default: Default::Later(&Default::Choice(&["uniform", "clustered"])),
            about: "windows, roofs and street furniture all over town, or crowded into two blocks",
        },
        Param {
            name: "seed",
            default: Default::Int { value: 1, min: 0, max: i64::MAX },
            about: "shapes the buildings",
        },
    ],
    make: |spec| Box::new(Blocks::new(spec)),
};

struct Blocks {
    world: usize,
    triangles: usize,
    clustered: bool,
    seed: u64,
}

/// Downtown and one block beside it: where things crowd.
const CROWDED: [u32; 2] = [4, 5];

impl Blocks {
    fn new(spec: &Spec) -> Blocks {
        let world = spec.int("world") as usize;
        let triangles = match spec.int("triangles") {
            0 => PUBLISHED[world - 5],
            n => n as usize,
        };
        let clustered = spec.text("distribution") == "clustered";
        Blocks { world, triangles, clustered, seed: spec.int("seed") as u64 }
    }
}

const PLOT: f64 = 16.0;
const PAVEMENT: f64 = 3.0;
const STREET: f64 = 12.0;
const BLOCK: f64 = 4.0 * PLOT + 2.0 * PAVEMENT;
const PITCH: f64 = BLOCK + STREET;
const KERB: f64 = 0.15;

impl Generator for Blocks {
    fn generate(&self) -> Scene {
        let mut b = Builder::new(&format!("blocks, world {}", self.world));
        let mut rng = Random::part(self.seed, 2);
        let (lo, hi) = (-STREET, 3.0 * PITCH);
        b.paint("asphalt_street");
        b.block(v3(lo, lo, -0.5), v3(hi, hi, 0.0));
        let mut props = Vec::new();
        for block in 0..9 {
            let corner = v3(f64::from(block % 3) * PITCH, f64::from(block / 3) * PITCH, 0.0);
            b.object();
            b.paint("pavement");
            b.block(corner - v3(0.0, 0.0, 0.1), corner + v3(BLOCK, BLOCK, KERB));
            // Downtown is tall, the corners of the map are low.
            let tall = match block {
                4 => 3.0,
                1 | 3 | 5 | 7 => 1.7,
                _ => 1.0,
            };
            for plot in 0..16 {
                building(&mut b, corner, plot, tall, &mut rng, &mut props);
            }
        }
        rng.shuffle(&mut props);
        street(&mut props, &mut rng);
        if self.clustered {
            props.retain(|p| CROWDED.iter().any(|block| is_in_block(p.frame.apply(v3(0.0, 0.0, 0.0)), *block)));
        }
        let line = [v3(PITCH - STREET, 40.0, 6.0), v3(PITCH, 40.0, 6.0)];
        spend(b, &props, self.triangles, line).finish()
    }
}

/// Whether `p` is in the block or in the half of the streets round it.
fn is_in_block(p: crate::math::DVec3, block: u32) -> bool {
    let (x, y) = (p.x - f64::from(block % 3) * PITCH, p.y - f64::from(block / 3) * PITCH);
    let within = |at: f64| (-STREET * 0.5..=BLOCK + STREET * 0.5).contains(&at);
    within(x) && within(y)
}

fn building(
    b: &mut Builder,
    corner: crate::math::DVec3,
    plot: usize,
    tall: f64,
    rng: &mut Random,
    props: &mut Vec<Placed>,
) {
    let (i, j) = (plot % 4, plot / 4);
    let centre = corner + v3(PAVEMENT + PLOT * (i as f64 + 0.5), PAVEMENT + PLOT * (j as f64 + 0.5), KERB);
    let inner = (i == 1 || i == 2) && (j == 1 || j == 2);
    let (w, d) = if inner {
        (rng.range(7.0, 10.0), rng.range(7.0, 10.0))
    } else {
        (rng.range(12.5, 15.6), rng.range(12.5, 15.6))
    };
    let storeys = if inner { rng.range(1.0, 2.6) } else { rng.range(2.0, 5.0) * tall }.floor();
    let height = storeys * 3.3 + 0.6;
    // Fronts stand on the pavement's edge, whatever the depth of the house.
    let push = |k: usize, size: f64| match k {
        0 => (size - PLOT) * 0.5,
        3 => (PLOT - size) * 0.5,
        _ => 0.0,
    };
    let at = centre + v3(push(i, w), push(j, d), 0.0);
    b.object();
    b.paint(["brick_house", "plaster_house", "concrete_house", "sand_house", "paint_house"][rng.below(5)]);
    let shape = rng.below(10);
    let gabled = shape < 3 && storeys <= 4.0;
    b.within(Frame::at(at), |b| {
        let (hw, hd) = (w * 0.5, d * 0.5);
        if gabled {
            // One solid from the ground to the ridge.
            let ridge = height + rng.range(2.0, 3.2);
            let section = [v2(-hd, -0.1), v2(hd, -0.1), v2(hd, height), v2(0.0, ridge), v2(-hd, height)];
            b.extrude(Along::X, &section, -hw, hw);
        } else {
            b.block(v3(-hw, -hd, -0.1), v3(hw, hd, height));
        }
    });
    let roof = Frame::at(at + v3(0.0, 0.0, height));
    if !gabled {
        let place = |x: f64, y: f64| roof.then(&Frame::at(v3(x, y, 0.0)));
        let prop = *rng.pick(&[Prop::AirUnit, Prop::AirUnit, Prop::WaterTank, Prop::Vent]);
        props.push(Placed {
            prop,
            frame: place(rng.range(-2.5, 2.5), rng.range(-2.5, 2.5)),
            size: 1.4,
            seed: rng.bits(),
        });
    }
    // Only fronts on a street, and the small houses inside a block, get doors and windows.
    for side in 0..4 {
        let (width, depth) = if side % 2 == 0 { (w, d) } else { (d, w) };
        let face = Frame::quarter(at, side).then(&Frame::at(v3(0.0, -depth * 0.5, 0.0)));
        let street_side = match side {
            0 => j == 0,
            1 => i == 3,
            2 => j == 3,
            _ => i == 0,
        };
        if !street_side && !inner {
            continue;
        }
        props.push(Placed { prop: Prop::Canopy, frame: face, size: 1.0, seed: rng.bits() });
        for floor in 1..storeys as usize {
            let bays = (width / 3.2) as usize;
            for bay in 0..bays {
                let x = width * ((bay as f64 + 0.5) / bays as f64 - 0.5);
                let frame = face.then(&Frame::at(v3(x, 0.0, 0.9 + 3.3 * floor as f64)));
                props.push(Placed { prop: Prop::Window, frame, size: 1.15, seed: rng.bits() });
                if rng.chance(0.08) {
                    let frame = face.then(&Frame::at(v3(x, 0.0, 3.3 * floor as f64)));
                    props.push(Placed { prop: Prop::Balcony, frame, size: 1.1, seed: rng.bits() });
                }
            }
        }
    }
}

/// Lamps, trees, benches and cars along the streets, behind the houses' own parts in the queue.
fn street(props: &mut Vec<Placed>, rng: &mut Random) {
    let mut things = Vec::new();
    for block in 0..9 {
        let corner = v3(f64::from(block % 3) * PITCH, f64::from(block / 3) * PITCH, KERB);
        for side in 0..4 {
            let edge = Frame::quarter(corner + v3(BLOCK * 0.5, BLOCK * 0.5, 0.0), side).then(&Frame::at(v3(
                0.0,
                -BLOCK * 0.5,
                0.0,
            )));
            for k in 0..6 {
                let x = BLOCK * ((k as f64 + 0.5) / 6.0 - 0.5) + rng.range(-1.0, 1.0);
                let prop = *rng.pick(&[Prop::StreetLamp, Prop::Tree, Prop::Tree, Prop::Bench]);
                let size = if prop == Prop::Tree { 5.0 } else { 1.2 };
                things.push(Placed { prop, frame: edge.then(&Frame::at(v3(x, 0.8, 0.0))), size, seed: rng.bits() });
                if rng.chance(0.45) {
                    let frame = edge.then(&Frame::at(v3(x + 4.0, -1.5, -KERB)));
                    things.push(Placed { prop: Prop::Car, frame, size: 1.0, seed: rng.bits() });
                }
            }
        }
    }
    rng.shuffle(&mut things);
    // Every few windows one thing of the street, so that a small budget has some of each.
    for (k, thing) in things.into_iter().enumerate() {
        props.insert((k * 4).min(props.len()), thing);
    }
}
