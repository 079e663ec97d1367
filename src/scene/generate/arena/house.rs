//! Houses with walls that have thickness, rooms to walk into, floors, stairs and roofs.

use super::kit::Kit;
use crate::scene::generate::builder::{Frame, v2, v3};
use crate::scene::generate::props::Prop;
use crate::scene::generate::solids::{Along, Rect};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Roof {
    /// A slab with a parapet.
    Flat,
    /// Ridge along x, this high above the eaves.
    Gable(f64),
    /// Falls from +y to -y by this much.
    Shed(f64),
    /// Teeth along x.
    Saw(f64, usize),
    /// Four sides to a tip.
    Tent(f64),
}

/// An opening that reaches the floor of a storey: side (0 = -y, 1 = +x, 2 = +y,
/// 3 = -x), storey, place along the side from its middle, width.
pub(super) type Door = (usize, usize, f64, f64);

/// A house about the frame's origin, ground floor at z = 0.
pub(super) struct House<'a> {
    pub width: f64,
    pub depth: f64,
    pub storeys: usize,
    pub height: f64,
    pub wall: &'a str,
    pub roof: Roof,
    pub roof_paint: &'a str,
    pub doors: &'a [Door],
    /// Metres from window to window; 0 for none.
    pub windows: f64,
    /// Stairs between the storeys, along the +y wall.
    pub stairs: bool,
    /// A wall across at this x, with a door, on every storey.
    pub partition: Option<f64>,
    /// How far the foundation goes down.
    pub foot: f64,
}

impl Default for House<'_> {
    fn default() -> Self {
        House {
            width: 12.0,
            depth: 10.0,
            storeys: 1,
            height: 3.6,
            wall: "plank_wall",
            roof: Roof::Gable(2.4),
            roof_paint: "roof_shingle",
            doors: &[(0, 0, 0.0, 1.8)],
            windows: 4.0,
            stairs: true,
            partition: None,
            foot: 3.0,
        }
    }
}

const WALL: f64 = 0.3;
const SLAB: f64 = 0.25;
const DOOR: f64 = 2.4;

impl House<'_> {
    pub fn build(&self, k: &mut Kit) {
        let (hw, hd) = (self.width * 0.5, self.depth * 0.5);
        k.keep_out(-hw - 0.8, -hd - 0.8, hw + 0.8, hd + 0.8);
        k.block("concrete_foundation", v3(-hw - 0.2, -hd - 0.2, -self.foot), v3(hw + 0.2, hd + 0.2, 0.0));
        let well = self.well();
        for storey in 0..self.storeys {
            let z = self.height * storey as f64;
            for side in 0..4 {
                self.wall(k, side, storey, z);
            }
            self.corner_posts(k, z);
            if storey > 0 {
                k.b.object();
                k.b.paint("plank_floor");
                let holes: Vec<Rect> = if self.stairs { vec![well] } else { Vec::new() };
                k.b.panel(Along::Z, [-hw + 0.05, -hd + 0.05, hw - 0.05, hd - 0.05], &holes, z - SLAB, z);
                if self.stairs {
                    self.flight(k, z - self.height, storey % 2 == 0);
                }
            }
            if let Some(x) = self.partition {
                k.b.object();
                k.b.paint("plaster_partition");
                let top = self.height - if storey + 1 < self.storeys { SLAB - 0.02 } else { 0.0 };
                // Clear of the stairs at the back.
                let end = if self.stairs && self.storeys > 1 { well[1] - 0.1 } else { hd - 0.05 };
                let door = [-hd * 0.25 - 0.9, z - 0.02, -hd * 0.25 + 0.9, z + DOOR];
                k.b.panel(Along::X, [-hd + 0.05, z - 0.02, end, z + top], &[door], x - 0.1, x + 0.1);
            }
        }
        self.roof(k);
        self.furnish(k);
    }

    fn well(&self) -> Rect {
        let (hw, hd) = (self.width * 0.5, self.depth * 0.5);
        let run = self.run();
        [-hw + 1.9, hd - WALL - 1.7, -hw + 1.9 + run, hd - WALL]
    }

    fn run(&self) -> f64 {
        (self.height * 1.35).min(self.width - 3.8)
    }

    /// Stairs from the storey at `z` up through the well; every second one goes back.
    fn flight(&self, k: &mut Kit, z: f64, back: bool) {
        let [x0, y0, x1, y1] = self.well();
        let centre = v3((x0 + x1) * 0.5, (y0 + y1) * 0.5, z);
        let (half, wide) = ((x1 - x0) * 0.5, (y1 - y0) * 0.5 - 0.05);
        let steps = (self.height / 0.22).round() as usize;
        k.b.object();
        k.b.paint("wood_stairs");
        k.b.within(Frame::quarter(centre, if back { 2 } else { 0 }), |b| {
            b.open_stairs(v3(-half, -wide, -0.02), v3(half + 0.02, wide, self.height - 0.01), steps, 0.2);
        });
        let rail = y0 - 0.06;
        k.railing("wood_rail", &[v3(x0 + 0.2, rail, z + self.height), v3(x1 - 0.2, rail, z + self.height)]);
    }

    fn wall(&self, k: &mut Kit, side: usize, storey: usize, z: f64) {
        let (length, depth) = if side.is_multiple_of(2) { (self.width, self.depth) } else { (self.depth, self.width) };
        let half = length * 0.5;
        let mut holes: Vec<Rect> = Vec::new();
        let mut frames: Vec<(Prop, f64, f64)> = Vec::new();
        for (_, _, at, width) in self.doors.iter().filter(|d| d.0 == side && d.1 == storey) {
            let head = if *width > 2.5 { self.height - 0.5 } else { DOOR };
            holes.push([at - width * 0.5, z - 0.02, at + width * 0.5, z + head]);
            if (width - 1.8).abs() < 0.01 {
                frames.push((Prop::DoorFrame, *at, z));
            }
        }
        if self.windows > 0.0 {
            let count = ((length - 2.0) / self.windows).floor().max(0.0) as usize;
            for i in 0..count {
                let u = self.windows * (i as f64 - (count as f64 - 1.0) * 0.5);
                let hole = [u - 0.7, z + 1.0, u + 0.7, z + 2.3];
                if holes.iter().all(|h| h[2] + 0.4 < hole[0] || h[0] - 0.4 > hole[2]) {
                    holes.push(hole);
                    frames.push((Prop::WindowFrame, u, z + 1.0));
                }
            }
        }
        let top = z + self.height + if storey + 1 == self.storeys { 0.0 } else { 0.01 };
        let outer = k.b.enter(Frame::quarter(v3(0.0, 0.0, 0.0), side as i32));
        k.b.object();
        k.b.paint(self.wall);
        // Walls of the long sides cover the corners, the others stop short of them.
        let short = if side.is_multiple_of(2) { 0.0 } else { WALL - 0.05 };
        let y = -depth * 0.5;
        k.b.panel(Along::Y, [-half + short, z - 0.02, half - short, top], &holes, y, y + WALL);
        for (prop, u, h) in frames {
            k.set(prop, u, y, h, 0, 1.0);
        }
        k.b.leave(outer);
    }

    fn corner_posts(&self, k: &mut Kit, z: f64) {
        let (hw, hd) = (self.width * 0.5, self.depth * 0.5);
        k.b.object();
        k.b.paint("trim_post");
        for (x, y) in [(-hw, -hd), (hw, -hd), (hw, hd), (-hw, hd)] {
            k.b.block_on(v3(x, y, z - 0.1), v3(0.5, 0.5, self.height + 0.08));
        }
        if z > 0.0 {
            for (y, d) in [(-hd, -1.0), (hd, 1.0)] {
                k.b.block_on(v3(0.0, y + d * 0.03, z - 0.3), v3(self.width - 0.1, 0.2, 0.3));
            }
        }
    }

    fn roof(&self, k: &mut Kit) {
        let (hw, hd) = (self.width * 0.5, self.depth * 0.5);
        let z = self.height * self.storeys as f64;
        let eaves = 0.6;
        k.b.object();
        k.b.paint(self.roof_paint);
        match self.roof {
            Roof::Flat => {
                k.b.block(v3(-hw + 0.1, -hd + 0.1, z - 0.3), v3(hw - 0.1, hd - 0.1, z - 0.02));
                k.b.paint("trim_parapet");
                for (x0, y0, x1, y1) in [
                    (-hw - 0.1, -hd - 0.1, hw + 0.1, -hd + 0.3),
                    (-hw - 0.1, hd - 0.3, hw + 0.1, hd + 0.1),
                    (-hw - 0.1, -hd + 0.25, -hw + 0.3, hd - 0.25),
                    (hw - 0.3, -hd + 0.25, hw + 0.1, hd - 0.25),
                ] {
                    k.b.block(v3(x0, y0, z - 0.1), v3(x1, y1, z + 0.6));
                }
                k.set(Prop::AirUnit, hw * 0.4, hd * 0.2, z, 0, 1.2);
                k.set(Prop::Vent, -hw * 0.4, -hd * 0.3, z, 0, 1.2);
            }
            Roof::Gable(rise) => {
                let slope = rise / hd;
                let (a, e) = (hd + eaves, z - eaves * slope);
                let t = 0.22;
                let section =
                    [v2(-a, e), v2(0.0, z + rise), v2(a, e), v2(a, e + t), v2(0.0, z + rise + t), v2(-a, e + t)];
                k.b.extrude(Along::X, &section, -hw - eaves, hw + eaves);
                k.b.paint(self.wall);
                let gable = [v2(-hd + 0.02, z - 0.02), v2(hd - 0.02, z - 0.02), v2(0.0, z + rise - 0.02)];
                for (w0, w1) in [(-hw, -hw + WALL), (hw - WALL, hw)] {
                    k.b.extrude(Along::X, &gable, w0, w1);
                }
                k.b.paint("wood_rafter");
                let ties = (self.width / 3.5) as usize;
                for i in 1..ties {
                    let x = self.width * (i as f64 / ties as f64 - 0.5);
                    k.b.block(v3(x - 0.1, -hd + 0.1, z - 0.25), v3(x + 0.1, hd - 0.1, z - 0.03));
                }
                if rise > 2.0 {
                    let y = hd * 0.4;
                    k.block("brick_chimney", v3(hw * 0.5, y, z - 0.5), v3(hw * 0.5 + 0.8, y + 0.8, z + rise + 0.7));
                }
            }
            Roof::Shed(fall) => {
                let slope = fall / self.depth;
                let (y0, y1) = (-hd - eaves, hd + eaves);
                let (z0, z1) = (z + 0.02 - eaves * slope, z + fall + 0.02 + eaves * slope);
                let section = [v2(y0, z0), v2(y1, z1), v2(y1, z1 + 0.2), v2(y0, z0 + 0.2)];
                k.b.extrude(Along::X, &section, -hw - eaves, hw + eaves);
                k.b.paint(self.wall);
                let fill = [v2(-hd + 0.3, z - 0.02), v2(hd, z - 0.02), v2(hd, z + fall)];
                for (w0, w1) in [(-hw, -hw + WALL), (hw - WALL, hw)] {
                    k.b.extrude(Along::X, &fill, w0, w1);
                }
                k.b.block(v3(-hw + 0.1, hd - WALL, z - 0.02), v3(hw - 0.1, hd - 0.02, z + fall * 0.97));
            }
            Roof::Saw(rise, teeth) => {
                let pitch = self.width / teeth as f64;
                for i in 0..teeth {
                    let x = -hw + pitch * i as f64;
                    let t = 0.2;
                    let section =
                        [v2(x - 0.1, z), v2(x + pitch, z + rise), v2(x + pitch, z + rise + t), v2(x - 0.1, z + t)];
                    k.b.paint(self.roof_paint);
                    k.b.extrude(Along::Y, &section, -hd - 0.4, hd + 0.4);
                    k.b.paint(self.wall);
                    let cheek = [v2(x + 0.3, z - 0.02), v2(x + pitch, z - 0.02), v2(x + pitch, z + rise)];
                    for (w0, w1) in [(-hd, -hd + WALL), (hd - WALL, hd)] {
                        k.b.extrude(Along::Y, &cheek, w0, w1);
                    }
                    k.b.paint("glass_skylight");
                    k.b.block(v3(x + pitch - 0.12, -hd + 0.1, z - 0.02), v3(x + pitch + 0.02, hd - 0.1, z + rise));
                }
            }
            Roof::Tent(rise) => {
                let (a, c, t) = (hw + eaves, hd + eaves, 0.25);
                let low = [v3(-a, -c, z), v3(a, -c, z), v3(a, c, z), v3(-a, c, z)];
                let high = low.map(|p| p + v3(0.0, 0.0, t));
                let tip = v3(0.0, 0.0, z + rise);
                k.b.quad(low[3], low[2], low[1], low[0]);
                for i in 0..4 {
                    let j = (i + 1) % 4;
                    k.b.quad(low[i], low[j], high[j], high[i]);
                    k.b.tri(high[i], high[j], tip);
                }
            }
        }
    }

    fn furnish(&self, k: &mut Kit) {
        let (hw, hd) = (self.width * 0.5 - 1.0, self.depth * 0.5 - 1.0);
        let things = [Prop::Table, Prop::Shelf, Prop::Crate, Prop::Barrel, Prop::Bench, Prop::Barrel];
        for storey in 0..self.storeys {
            let z = self.height * storey as f64;
            let count = ((self.width * self.depth) / 22.0) as usize;
            for i in 0..count.min(10) {
                let prop = *k.rng.pick(&things);
                // Along the walls without stairs, where nobody walks.
                let u = k.rng.range(-0.85, 0.85);
                let (x, y, q) = match i % 3 {
                    0 => (u * hw, -hd + 0.1, 2),
                    1 => (hw, u * hd * 0.8, 3),
                    _ => (-hw, u * hd * 0.6 - 0.3 * hd, 1),
                };
                let door_near = self.doors.iter().filter(|d| d.1 == storey).any(|d| match d.0 {
                    0 => i % 3 == 0 && (x - d.2).abs() < 1.0 + d.3 * 0.5,
                    1 => i % 3 == 1 && (y - d.2).abs() < 1.0 + d.3 * 0.5,
                    3 => i % 3 == 2 && (y + d.2).abs() < 1.0 + d.3 * 0.5,
                    _ => false,
                });
                if !door_near {
                    k.set(prop, x, y, z, q, 1.0);
                }
            }
            if storey + 1 < self.storeys || self.roof == Roof::Flat {
                let beams = (self.width / 5.0) as usize;
                for i in 0..beams {
                    let x = self.width * ((i as f64 + 0.5) / beams as f64 - 0.5);
                    k.set(Prop::Pipe, x, 0.0, z + self.height - 0.75, 1, (self.depth - 0.4).floor());
                }
            }
        }
    }
}
