//! What the maps are made with: ground, houses, bridges, rails, and props in place.

use crate::math::DVec3;
use crate::scene::generate::builder::{Builder, Frame, v2, v3};
use crate::scene::generate::props::{Placed, Prop};
use crate::scene::generate::random::Random;
use crate::scene::generate::solids::Along;
use crate::scene::generate::terrain::Terrain;

pub(super) struct Kit {
    pub b: Builder,
    pub ground: Terrain,
    pub props: Vec<Placed>,
    pub rng: Random,
    /// Boxes (in the map's frame) that nothing scattered may stand in.
    keep_out: Vec<[f64; 4]>,
}

impl Kit {
    pub fn new(name: &str, seed: u64, ground: Terrain) -> Kit {
        Kit { b: Builder::new(name), ground, props: Vec::new(), rng: Random::part(seed, 3), keep_out: Vec::new() }
    }

    /// Runs `f` in a frame at (x, y, z), turned by quarters.
    pub fn at(&mut self, x: f64, y: f64, z: f64, quarters: i32, f: impl FnOnce(&mut Kit)) {
        let outer = self.b.enter(Frame::quarter(v3(x, y, z), quarters));
        f(self);
        self.b.leave(outer);
    }

    /// Runs `f` for both halves of a map with two equal sides.
    pub fn twice(&mut self, f: impl Fn(&mut Kit, usize)) {
        for side in 0..2 {
            self.at(0.0, 0.0, 0.0, 2 * side, |k| f(k, side as usize));
        }
    }

    /// Flat ground at height `z` of the frame.
    pub fn flatten(&mut self, x0: f64, y0: f64, x1: f64, y1: f64, z: f64, blend: f64) {
        let f = self.b.frame();
        let (a, b) = (f.apply(v3(x0, y0, z)), f.apply(v3(x1, y1, z)));
        self.ground.flatten(a.truncate(), b.truncate(), a.z, blend);
    }

    /// Ground along a line, at the line's height.
    pub fn lay(&mut self, line: &[DVec3], half_width: f64, blend: f64) {
        let f = self.b.frame();
        let line: Vec<DVec3> = line.iter().map(|p| f.apply(*p)).collect();
        self.ground.lay(&line, half_width, blend);
    }

    /// Like [`Kit::lay`], and the ground looks trodden.
    pub fn road(&mut self, line: &[DVec3], half_width: f64, blend: f64) {
        self.lay(line, half_width, blend);
        let f = self.b.frame();
        let line: Vec<DVec3> = line.iter().map(|p| f.apply(*p)).collect();
        self.ground.pave(&line, half_width);
    }

    pub fn keep_out(&mut self, x0: f64, y0: f64, x1: f64, y1: f64) {
        let f = self.b.frame();
        let (a, b) = (f.apply(v3(x0, y0, 0.0)), f.apply(v3(x1, y1, 0.0)));
        self.keep_out.push([a.x.min(b.x), a.y.min(b.y), a.x.max(b.x), a.y.max(b.y)]);
    }

    /// A prop at a height of the frame, turned by an angle.
    pub fn put(&mut self, prop: Prop, x: f64, y: f64, z: f64, angle: f64, size: f64) {
        let frame = self.b.frame().then(&Frame::turned(v3(x, y, z), angle));
        let seed = self.rng.bits();
        self.props.push(Placed { prop, frame, size, seed });
    }

    /// A prop that faces a quarter, exactly.
    pub fn set(&mut self, prop: Prop, x: f64, y: f64, z: f64, quarters: i32, size: f64) {
        let frame = self.b.frame().then(&Frame::quarter(v3(x, y, z), quarters));
        let seed = self.rng.bits();
        self.props.push(Placed { prop, frame, size, seed });
    }

    /// `count` props on the ground of a box, where `accept(x, y, z, slope)` says so.
    pub fn scatter(
        &mut self,
        kinds: &[(Prop, f64, f64)],
        count: usize,
        [x0, y0, x1, y1]: [f64; 4],
        accept: impl Fn(f64, f64, f64, f64) -> bool,
    ) {
        let mut placed = 0;
        for _ in 0..count * 30 {
            if placed == count {
                break;
            }
            let (x, y) = (self.rng.range(x0, x1), self.rng.range(y0, y1));
            let (prop, lo, hi) = *self.rng.pick(kinds);
            let (size, turn) = (self.rng.range(lo, hi), self.rng.range(0.0, std::f64::consts::TAU));
            let z = self.ground.height(x, y);
            let slope = (self.ground.height(x + 1.0, y) - z).abs().max((self.ground.height(x, y + 1.0) - z).abs());
            let margin = 1.2;
            let blocked = self
                .keep_out
                .iter()
                .any(|k| x > k[0] - margin && x < k[2] + margin && y > k[1] - margin && y < k[3] + margin);
            // Things on a sheer face would stick out of it.
            if !blocked && slope < 2.2 && accept(x, y, z, slope) {
                let frame = Frame::turned(v3(x, y, z - 0.03), turn);
                // Few sizes, so that equal props cost equally.
                let seed = self.rng.bits();
                self.props.push(Placed { prop, frame, size: (size * 8.0).round() / 8.0, seed });
                placed += 1;
            }
        }
    }

    pub fn block(&mut self, paint: &str, lo: DVec3, hi: DVec3) {
        self.b.object();
        self.b.paint(paint);
        self.b.block(lo, hi);
    }

    /// Posts and two rails along a line; a gap is a new call.
    pub fn railing(&mut self, paint: &str, line: &[DVec3]) {
        self.b.object();
        self.b.paint(paint);
        for s in line.windows(2) {
            for z in [0.5, 1.0] {
                self.b.beam(s[0] + v3(0.0, 0.0, z), s[1] + v3(0.0, 0.0, z), 0.08, 0.1);
            }
            let posts = (s[0].distance(s[1]) / 2.4).ceil().max(1.0) as usize;
            for k in 0..=posts {
                let p = s[0] + (s[1] - s[0]) * (k as f64 / posts as f64);
                self.b.block_on(p - v3(0.0, 0.0, 0.05), v3(0.12, 0.12, 1.14));
            }
        }
    }

    /// A deck between two points of one height or two, with railings and legs down to the ground.
    pub fn bridge(&mut self, paint: &str, from: DVec3, to: DVec3, width: f64, legs: bool) {
        self.b.object();
        self.b.paint(paint);
        let along = (to - from).normalize();
        let side = v3(along.y, -along.x, 0.0).normalize() * (width * 0.5);
        self.b.beam(from - v3(0.0, 0.0, 0.15), to - v3(0.0, 0.0, 0.15), width, 0.3);
        for s in [side, -side] {
            let s = s * ((width - 0.2) / width);
            self.railing("wood_rail", &[from + s, to + s]);
        }
        let spans = (from.distance(to) / 6.0).round().max(1.0) as usize;
        for k in 1..if legs { spans } else { 0 } {
            let p = from + (to - from) * (k as f64 / spans as f64);
            for s in [side * 0.8, -side * 0.8] {
                let foot = self.b.frame().apply(p + s);
                let depth = foot.z - self.ground.height(foot.x, foot.y) + 0.5;
                if depth > 0.6 {
                    self.b.paint("wood_pile");
                    self.b.block_on(p + s - v3(0.0, 0.0, depth), v3(0.3, 0.3, depth - 0.2));
                }
            }
        }
    }

    /// A solid flight from (x, y, z) up along +x of a frame turned by quarters.
    pub fn stairs(&mut self, paint: &str, foot: DVec3, quarters: i32, run: f64, rise: f64, width: f64) {
        self.b.object();
        self.b.paint(paint);
        let steps = (rise / 0.22).round().max(1.0) as usize;
        self.b.within(Frame::quarter(foot, quarters), |b| {
            // It goes on down a metre, so that uneven ground never shows its base.
            let rise_step = rise / steps as f64;
            let mut section = vec![v2(0.0, -1.0), v2(run, -1.0), v2(run, rise)];
            for s in (1..=steps).rev() {
                let x = run * (s - 1) as f64 / steps as f64;
                section.push(v2(x, rise_step * s as f64));
                if s > 1 {
                    section.push(v2(x, rise_step * (s - 1) as f64));
                }
            }
            b.extrude(Along::Y, &section, -width * 0.5, width * 0.5);
        });
    }

    /// A ramp, like [`Kit::stairs`].
    pub fn ramp(&mut self, paint: &str, foot: DVec3, quarters: i32, run: f64, rise: f64, width: f64) {
        self.b.object();
        self.b.paint(paint);
        self.b.within(Frame::quarter(foot, quarters), |b| {
            let section = [v2(0.0, -1.0), v2(run, -1.0), v2(run, rise), v2(0.0, 0.0)];
            b.extrude(Along::Y, &section, -width * 0.5, width * 0.5);
        });
    }

    /// Rails on sleepers along a line of straight pieces.
    pub fn track(&mut self, line: &[DVec3]) {
        for s in line.windows(2) {
            let d = (s[1] - s[0]).normalize();
            let side = v3(d.y, -d.x, 0.0).normalize() * 0.75;
            self.b.object();
            self.b.paint("metal_rail");
            for o in [side, -side] {
                let up = v3(0.0, 0.0, 0.12);
                self.b.beam(s[0] + o + up - d * 0.1, s[1] + o + up + d * 0.1, 0.09, 0.16);
            }
            // Sleepers in pieces of some metres, so that small budgets keep some of them.
            let length = s[0].distance(s[1]);
            let pieces = (length / 6.0).ceil().max(1.0);
            for k in 0..pieces as usize {
                let p = s[0] + (s[1] - s[0]) * ((k as f64 + 0.5) / pieces);
                let angle = libm::atan2(d.y, d.x);
                self.put(Prop::Sleepers, p.x, p.y, p.z, angle, (length / pieces * 4.0).floor() / 4.0);
            }
        }
    }

    /// Crates in a loose heap.
    pub fn crates(&mut self, x: f64, y: f64, z: f64, count: usize) {
        const PLACES: [(f64, f64, f64); 6] =
            [(0.0, 0.0, 0.0), (1.5, 0.2, 0.0), (0.3, 1.4, 0.0), (0.2, 0.3, 1.3), (-1.5, 0.4, 0.0), (1.6, 1.7, 0.0)];
        for (dx, dy, dz) in PLACES.iter().take(count) {
            let angle = self.rng.range(-0.2, 0.2);
            self.put(Prop::Crate, x + dx, y + dy, z + dz, angle, 1.25);
        }
    }

    pub fn barrels(&mut self, x: f64, y: f64, z: f64, count: usize) {
        const PLACES: [(f64, f64); 5] = [(0.0, 0.0), (0.75, 0.1), (0.35, 0.7), (-0.6, 0.5), (1.1, 0.8)];
        for (dx, dy) in PLACES.iter().take(count) {
            self.put(Prop::Barrel, x + dx, y + dy, z, 0.0, 1.1);
        }
    }
}
