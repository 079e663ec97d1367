//! Larger works that several maps share: tunnels, arcades, towers, flumes, wagons.

use super::house::House;
use super::kit::Kit;
use crate::math::{DVec2, DVec3};
use crate::scene::generate::builder::{Frame, v2, v3};
use crate::scene::generate::props::Prop;
use crate::scene::generate::solids::Along;

impl House<'_> {
    /// Builds the house on the ground that is there, levelled for it.
    pub fn stand(&self, k: &mut Kit, x: f64, y: f64, quarters: i32) {
        let place = k.b.frame().apply(v3(x, y, 0.0));
        let z = k.ground.height(place.x, place.y) - k.b.frame().origin.z;
        k.at(x, y, z + 0.12, quarters, |k| {
            let (w, d) = (self.width * 0.5 + 1.0, self.depth * 0.5 + 1.0);
            k.flatten(-w, -d, w, d, -0.12, 3.0);
            self.build(k);
        });
    }
}

impl Kit {
    /// A covered way along x of the frame: a cut in the ground, walls and a roof.
    pub fn tunnel(&mut self, length: f64, width: f64, height: f64, paint: &str) {
        let (l, w) = (length * 0.5, width * 0.5);
        self.lay(&[v3(-l - 5.0, 0.0, 0.0), v3(l + 5.0, 0.0, 0.0)], w + 0.9, 1.0);
        self.b.object();
        self.b.paint(paint);
        self.b.block(v3(-l, -w - 1.6, -1.5), v3(l, -w, height + 0.05));
        self.b.block(v3(-l, w, -1.5), v3(l, w + 1.6, height + 0.05));
        self.b.block(v3(-l - 0.2, -w - 1.8, height), v3(l + 0.2, w + 1.8, height + 1.2));
        self.b.paint("wood_prop");
        let frames = (length / 3.0).round().max(2.0) as usize;
        for i in 0..frames {
            let x = length * ((i as f64 + 0.5) / frames as f64 - 0.5);
            for y in [-w + 0.16, w - 0.16] {
                self.b.block(v3(x - 0.18, y - 0.18, -0.3), v3(x + 0.18, y + 0.18, height - 0.28));
            }
            self.b.block(v3(x - 0.2, -w - 0.05, height - 0.32), v3(x + 0.2, w + 0.05, height + 0.05));
        }
        for i in 0..(length / 6.0) as usize {
            self.set(Prop::Pipe, -l + 3.0 + 6.0 * i as f64, w - 0.45, height - 0.7, 0, 5.5);
        }
        self.keep_out(-l - 6.0, -w - 2.0, l + 6.0, w + 2.0);
    }

    /// A wall of arches along x from -length/2, its deck at height z = 0, standing down at `foot`.
    pub fn arcade(&mut self, bays: usize, bay: f64, foot: f64, width: f64, paint: &str) {
        let left = -(bays as f64) * bay * 0.5;
        let radius = bay * 0.38;
        let spring = -radius - 1.6;
        let mut section = Vec::new();
        for i in 0..bays {
            let c = left + bay * (i as f64 + 0.5);
            let pier = |x: f64, z: f64| v2(x, z);
            section.push(pier(c - bay * 0.5 + if i == 0 { 0.0 } else { 0.001 }, foot));
            section.push(pier(c - radius, foot));
            for s in 0..=10 {
                let angle = std::f64::consts::PI * (1.0 - f64::from(s) / 10.0);
                section.push(v2(c + radius * libm::cos(angle), spring + radius * libm::sin(angle)));
            }
            section.push(pier(c + radius, foot));
        }
        let right = -left;
        section.extend([v2(right, foot), v2(right, 0.0), v2(left, 0.0)]);
        section.dedup_by(|a, b| (*a - *b).length() < 0.01);
        self.b.object();
        self.b.paint(paint);
        self.b.extrude(Along::Y, &section, -width * 0.5, width * 0.5);
        self.b.paint("rock_coping");
        for y in [-width * 0.5, width * 0.5] {
            self.b.block(v3(left, y - 0.3, -0.1), v3(right, y + 0.3, 0.9));
        }
        for i in 0..=bays {
            let x = left + bay * i as f64;
            for y in [-width * 0.5, width * 0.5] {
                self.b.block(v3(x - 0.7, y - 0.45, foot), v3(x + 0.7, y + 0.45, -0.8));
            }
        }
    }

    /// A platform on four leaning legs with a railing, a roof and a ladder.
    pub fn watchtower(&mut self, x: f64, y: f64, height: f64) {
        let p = self.b.frame().apply(v3(x, y, 0.0));
        let z = self.ground.height(p.x, p.y) - self.b.frame().origin.z;
        let outer = self.b.enter(Frame::at(v3(x, y, z)));
        self.b.object();
        self.b.paint("wood_tower");
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        for (i, (sx, sy)) in corners.iter().enumerate() {
            self.b.beam(v3(sx * 2.4, sy * 2.4, -0.8), v3(sx * 1.6, sy * 1.6, height), 0.28, 0.28);
            let (nx, ny) = corners[(i + 1) % 4];
            let levels = (height / 4.0).ceil() as usize;
            for l in 0..levels {
                let at = |sx: f64, sy: f64, t: f64| v3(sx * (2.4 - 0.8 * t), sy * (2.4 - 0.8 * t), height * t);
                let (t0, t1) = (l as f64 / levels as f64 + 0.02, (l + 1) as f64 / levels as f64);
                self.b.beam(at(*sx, *sy, t0), at(nx, ny, t1), 0.14, 0.16);
                self.b.beam(at(*sx, *sy, t1), at(nx, ny, t1), 0.16, 0.2);
            }
        }
        self.b.paint("plank_deck");
        self.b.block(v3(-2.2, -2.2, height), v3(2.2, 2.2, height + 0.2));
        let h = height + 0.2;
        self.railing(
            "wood_rail",
            &[
                v3(0.6, -2.1, h),
                v3(2.1, -2.1, h),
                v3(2.1, 2.1, h),
                v3(-2.1, 2.1, h),
                v3(-2.1, -2.1, h),
                v3(-0.6, -2.1, h),
            ],
        );
        self.b.paint("wood_tower");
        for (sx, sy) in corners {
            self.b.block_on(v3(sx * 2.0, sy * 2.0, h), v3(0.2, 0.2, 2.6));
        }
        self.b.paint("roof_tower");
        let low = corners.map(|(sx, sy)| v3(sx * 2.7, sy * 2.7, h + 2.55));
        let tip = v3(0.0, 0.0, h + 4.2);
        self.b.quad(low[3], low[2], low[1], low[0]);
        for i in 0..4 {
            self.b.tri(low[i], low[(i + 1) % 4], tip);
        }
        self.set(Prop::Ladder, 0.0, -2.36, 0.0, 0, (height * 2.0).round() / 2.0);
        self.set(Prop::Crate, 1.2, 1.2, h, 0, 0.8);
        self.keep_out(-3.0, -3.0, 3.0, 3.0);
        self.b.leave(outer);
    }

    /// A trough on trestles from one point down to another, with water in it.
    pub fn flume(&mut self, from: DVec3, to: DVec3) {
        self.b.object();
        self.b.paint("plank_flume");
        let along = (to - from).normalize();
        let side = v3(along.y, -along.x, 0.0).normalize();
        self.b.beam(from, to, 1.8, 0.2);
        for s in [side * 0.85, side * -0.85] {
            self.b.beam(from + s + v3(0.0, 0.0, 0.4), to + s + v3(0.0, 0.0, 0.4), 0.15, 0.8);
        }
        self.b.paint("water_flume");
        self.b.beam(from + v3(0.0, 0.0, 0.2), to + v3(0.0, 0.0, 0.2), 1.6, 0.3);
        let count = (from.distance(to) / 5.0).ceil() as usize;
        self.b.paint("wood_trestle");
        for i in 0..=count {
            let p = from + (to - from) * (i as f64 / count as f64);
            let w = self.b.frame().apply(p);
            let z = p.z - (w.z - self.ground.height(w.x, w.y)) - 0.5;
            if p.z - z > 1.0 {
                for s in [1.0, -1.0] {
                    self.b.beam(
                        v3(p.x, p.y, z) + side * (s * 1.5),
                        p + side * (s * 0.6) - v3(0.0, 0.0, 0.1),
                        0.22,
                        0.22,
                    );
                }
                let m = (p + v3(p.x, p.y, z)) * 0.5;
                self.b.beam(m - side * 1.2, m + side * 1.2, 0.16, 0.2);
            }
        }
    }

    /// A wagon about (x, y, z), along x of an angle; loaded with coal or gold.
    pub fn wagon(&mut self, at: DVec3, angle: f64, load: &str) {
        let outer = self.b.enter(Frame::turned(at, angle));
        self.b.object();
        self.b.paint("rust_wagon");
        let hull = [
            v2(-0.8, 0.55),
            v2(0.8, 0.55),
            v2(1.15, 1.6),
            v2(1.0, 1.6),
            v2(0.7, 0.75),
            v2(-0.7, 0.75),
            v2(-1.0, 1.6),
            v2(-1.15, 1.6),
        ];
        self.b.extrude(Along::X, &hull, -1.7, 1.7);
        let ends: [DVec2; 4] = [v2(-0.8, 0.6), v2(0.8, 0.6), v2(1.1, 1.58), v2(-1.1, 1.58)];
        for (a, b) in [(-1.75, -1.6), (1.6, 1.75)] {
            self.b.extrude(Along::X, &ends, a, b);
        }
        self.b.paint("metal_wheel");
        for x in [-1.1, 1.1] {
            self.b.tube(v3(x, -0.82, 0.5), v3(x, 0.82, 0.5), 0.08, 6);
            for y in [-0.8, 0.66] {
                self.b.tube(v3(x, y, 0.5), v3(x, y + 0.14, 0.5), 0.36, 10);
            }
        }
        self.b.paint(load);
        let heap = [v2(-0.95, 1.3), v2(0.95, 1.3), v2(0.3, 1.85), v2(-0.35, 1.8)];
        self.b.extrude(Along::X, &heap, -1.5, 1.5);
        self.b.leave(outer);
    }

    /// A pithead: a leaning frame with a wheel on top, over a shaft house.
    pub fn headframe(&mut self, x: f64, y: f64, z: f64, height: f64) {
        let outer = self.b.enter(Frame::at(v3(x, y, z)));
        self.b.object();
        self.b.paint("wood_headframe");
        for s in [-1.0, 1.0] {
            self.b.beam(v3(-2.0, s * 2.2, -0.5), v3(-0.6, s * 1.0, height), 0.4, 0.4);
            self.b.beam(v3(2.0, s * 2.2, -0.5), v3(0.6, s * 1.0, height), 0.4, 0.4);
            self.b.beam(v3(9.0, s * 2.4, -0.5), v3(0.8, s * 1.0, height - 0.4), 0.4, 0.45);
        }
        let levels = (height / 3.0) as usize;
        for l in 1..levels {
            let t = l as f64 / levels as f64;
            let (h, u, w) = (height * t, 2.0 - 1.4 * t, 2.2 - 1.2 * t);
            for s in [-1.0, 1.0] {
                self.b.beam(v3(-u, s * w, h), v3(u, s * w, h), 0.22, 0.26);
                self.b.beam(v3(s * u, -w, h), v3(s * u, w, h), 0.22, 0.26);
                let (t2, g) = ((l as f64 - 1.0) / levels as f64, height * (l as f64 - 1.0) / levels as f64);
                let (u2, w2) = (2.0 - 1.4 * t2, 2.2 - 1.2 * t2);
                self.b.beam(v3(-u2, s * w2, g), v3(u, s * w, h), 0.16, 0.16);
            }
        }
        self.b.paint("metal_wheel");
        for a in 0..12 {
            let p = |a: i32| {
                let angle = std::f64::consts::TAU * f64::from(a) / 12.0;
                v3(1.5 * libm::cos(angle), 0.0, height + 1.2 + 1.5 * libm::sin(angle))
            };
            self.b.beam(p(a), p(a + 1), 0.24, 0.24);
            if a % 2 == 0 {
                self.b.beam(v3(0.0, 0.0, height + 1.2), p(a), 0.1, 0.1);
            }
        }
        self.b.tube(v3(0.0, -1.0, height + 1.2), v3(0.0, 1.0, height + 1.2), 0.16, 8);
        self.b.paint("wood_headframe");
        for s in [-0.9, 0.9] {
            self.b.block(v3(-0.7, s - 0.15, height - 0.3), v3(0.7, s + 0.15, height + 1.3));
        }
        self.keep_out(-3.0, -3.0, 10.0, 3.0);
        self.b.leave(outer);
    }

    /// Logs in a pyramid, along x.
    pub fn log_pile(&mut self, x: f64, y: f64, z: f64, quarters: i32, rows: usize) {
        self.at(x, y, z, quarters, |k| {
            for row in 0..rows {
                for i in 0..rows - row {
                    let y = (i as f64 - (rows - row - 1) as f64 * 0.5) * 0.46;
                    k.set(Prop::Log, 0.0, y, 0.4 * row as f64, 0, 6.0);
                }
            }
            k.keep_out(-3.5, -(rows as f64) * 0.3, 3.5, rows as f64 * 0.3);
        });
    }

    /// A board fence along a line on the ground.
    pub fn fence(&mut self, paint: &str, line: &[DVec3], height: f64) {
        self.b.object();
        self.b.paint(paint);
        for s in line.windows(2) {
            let pieces = (s[0].distance(s[1]) / 2.5).ceil().max(1.0) as usize;
            for i in 0..pieces {
                let at = |t: usize| {
                    let p = s[0] + (s[1] - s[0]) * (t as f64 / pieces as f64);
                    let w = self.b.frame().apply(p);
                    v3(p.x, p.y, p.z - w.z + self.ground.height(w.x, w.y))
                };
                let (a, c) = (at(i), at(i + 1));
                let up = v3(0.0, 0.0, height * 0.5 - 0.2);
                self.b.beam(a + up, c + up, 0.1, height + 0.3);
                self.b.block_on(a - v3(0.0, 0.0, 0.4), v3(0.22, 0.22, height + 0.7));
            }
        }
    }
}
