//! Props that grow, lie about or are heaped up.

use super::{Prop, blob};
use crate::math::DVec3;
use crate::scene::generate::builder::{Builder, Frame, v3};
use crate::scene::generate::random::Random;

pub(super) fn emit(b: &mut Builder, prop: Prop, s: f64, l: usize, rng: &mut Random) {
    match prop {
        Prop::Rock | Prop::SnowRock => {
            b.paint(if prop == Prop::Rock { "rock_boulder" } else { "rock_frosted" });
            let r = v3(rng.range(0.8, 1.3), rng.range(0.6, 1.0), rng.range(0.5, 0.9)) * s;
            blob(b, v3(0.0, 0.0, r.z * 0.25), r, 5 + l, 3 + l / 2, 0.28, rng);
        }
        Prop::Pine | Prop::SnowPine => {
            let h = s * rng.range(0.85, 1.15);
            b.paint("bark_pine");
            b.column(v3(0.0, 0.0, -0.2), 0.05 * h, 0.03 * h, 0.4 * h, 4 + l / 2);
            b.paint(if prop == Prop::Pine { "pine_needles" } else { "frosted_pine" });
            let tiers = (2 + l / 2).min(6);
            for t in 0..tiers {
                let z = 0.18 + 0.62 * t as f64 / tiers as f64;
                let r = 0.24 * (1.0 - 0.75 * t as f64 / tiers as f64);
                let top = (z + 0.62 / tiers as f64 + 0.18).min(1.0);
                b.within(Frame::turned(DVec3::ZERO, t as f64 * 0.7), |b| {
                    b.lathe(&[(r * h, z * h), (0.0, top * h)], 5 + l, (1.0, 1.0));
                });
            }
        }
        Prop::Tree => {
            let h = s * rng.range(0.9, 1.2);
            b.paint("bark_tree");
            b.column(v3(0.0, 0.0, -0.2), 0.06 * h, 0.035 * h, 0.5 * h, 4 + l / 2);
            b.paint("foliage_tree");
            blob(b, v3(0.0, 0.0, 0.68 * h), v3(0.3, 0.3, 0.32) * h, 5 + l, 3 + l / 2, 0.22, rng);
            if l >= 2 {
                blob(b, v3(0.16 * h, 0.06 * h, 0.5 * h), v3(0.2, 0.2, 0.16) * h, 4 + l, 2 + l / 2, 0.2, rng);
                blob(b, v3(-0.14 * h, -0.1 * h, 0.56 * h), v3(0.2, 0.18, 0.17) * h, 4 + l, 2 + l / 2, 0.2, rng);
            }
        }
        Prop::Bush => {
            b.paint("foliage_bush");
            blob(b, v3(0.0, 0.0, 0.2 * s), v3(0.6, 0.55, 0.45) * s, 5 + l, 3 + l / 2, 0.3, rng);
        }
        Prop::Tuft => {
            b.paint("grass_tuft");
            for _ in 0..3 + l {
                let (x, y) = (rng.range(-0.3, 0.3) * s, rng.range(-0.3, 0.3) * s);
                let tip = v3(x + rng.range(-0.15, 0.15) * s, y + rng.range(-0.15, 0.15) * s, rng.range(0.3, 0.55) * s);
                let ring = |i: i32| {
                    v3(x + [0.05, -0.05, 0.0][i as usize] * s, y + [-0.04, -0.04, 0.05][i as usize] * s, -0.05)
                };
                let (p, q, r) = (ring(0), ring(1), ring(2));
                // Base p, q, r runs clockwise seen from above, so the base faces down as it is.
                b.tri(p, q, r);
                b.tri(q, p, tip);
                b.tri(r, q, tip);
                b.tri(p, r, tip);
            }
        }
        Prop::Hay => {
            b.paint("hay_bale");
            let r = 0.65 * s;
            b.tube(v3(0.0, -0.6 * s, r * 0.93), v3(0.0, 0.6 * s, r * 0.93), r, 7 + 2 * l);
        }
        Prop::Sandbags => {
            b.paint("sand_bag");
            for row in 0..3 {
                for k in 0..4 - (row & 1) {
                    let x = (k as f64 - 1.5 + 0.5 * f64::from(row & 1)) * 0.62;
                    let at = v3(x, 0.0, 0.12 + 0.2 * f64::from(row)) * s;
                    blob(b, at, v3(0.34, 0.2, 0.13) * s, 4 + l, 2 + l / 2, 0.05, rng);
                }
            }
        }
        Prop::Log => {
            b.paint("bark_log");
            let r = rng.range(0.16, 0.24);
            b.tube(v3(-s * 0.5, 0.0, r), v3(s * 0.5, 0.0, r), r, 5 + l);
        }
        Prop::CoalHeap => {
            b.paint("coal_heap");
            blob(b, v3(0.0, 0.0, -0.1 * s), v3(1.0, 0.9, 0.62) * s, 7 + 2 * l, 3 + l, 0.16, rng);
        }
        other => unreachable!("{other:?} is no prop of this file"),
    }
}
