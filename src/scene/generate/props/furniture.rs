//! Props of rooms.

use super::{Prop, blob};
use crate::math::DVec3;
use crate::scene::generate::builder::{Builder, Frame, v3};
use crate::scene::generate::random::Random;
use crate::scene::generate::solids::Along;

pub(super) fn emit(b: &mut Builder, prop: Prop, s: f64, l: usize, rng: &mut Random) {
    // Legs and other thin parts sink a little, so that no face lies exactly in the floor's.
    let sunk = -0.02;
    let boxed = |b: &mut Builder, x: f64, y: f64, z: f64, w: f64, d: f64, h: f64| {
        b.block_on(v3(x * s, y * s, z * s), v3(w * s, d * s, h * s));
    };
    let legs = |b: &mut Builder, x: f64, y: f64, h: f64, w: f64| {
        for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            if l < 4 {
                b.block_on(v3(sx * x * s, sy * y * s, sunk), v3(w * s, w * s, h * s - sunk));
            } else {
                b.column(v3(sx * x * s, sy * y * s, sunk), w * 0.4 * s, w * 0.6 * s, h * s - sunk, l + 1);
            }
        }
    };
    match prop {
        Prop::Table => {
            b.paint("wood_table");
            match l {
                0 => boxed(b, 0.0, 0.0, sunk, 1.3, 0.8, 0.76),
                _ => {
                    boxed(b, 0.0, 0.0, 0.7, 1.5, 0.9, 0.06);
                    if l == 1 {
                        boxed(b, 0.0, 0.0, sunk, 0.3, 0.5, 0.73);
                    } else {
                        legs(b, 0.65, 0.36, 0.71, 0.08);
                    }
                    if l >= 3 {
                        b.paint("white_porcelain");
                        let bowl = [(0.05, 0.75), (0.12, 0.79), (0.16, 0.86)];
                        b.within(Frame::at(v3(0.3 * s, 0.1 * s, 0.0)), |b| {
                            b.lathe(&bowl.map(|(r, z)| (r * s, z * s)), 4 + l, (1.0, 1.0));
                        });
                    }
                }
            }
        }
        Prop::Chair => {
            b.paint("wood_chair");
            boxed(b, 0.0, 0.0, if l < 2 { sunk } else { 0.42 }, 0.44, 0.44, if l < 2 { 0.48 } else { 0.05 });
            if l >= 1 {
                boxed(b, 0.0, 0.19, 0.44, 0.42, 0.05, 0.5);
            }
            if l >= 2 {
                legs(b, 0.18, 0.18, 0.43, 0.05);
            }
        }
        Prop::Shelf => {
            b.paint("plank_shelf");
            let rows = if l == 0 { 0 } else { 3 };
            let bays: Vec<_> = (0..rows).map(|i| [-0.5, 0.1 + 0.58 * i as f64, 0.5, 0.6 + 0.58 * i as f64]).collect();
            let scaled: Vec<_> = bays.iter().map(|r| r.map(|x| x * s)).collect();
            b.panel(Along::Y, [-0.56 * s, sunk, 0.56 * s, 1.9 * s], &scaled, -0.18 * s, 0.13 * s);
            if l >= 1 {
                b.panel(Along::Y, [-0.56 * s, sunk, 0.56 * s, 1.9 * s], &[], 0.12 * s, 0.16 * s);
            }
            for row in 0..rows {
                let books = if l < 2 { 0 } else { (2 + 2 * l).min(24) };
                let width = 0.92 / books.max(1) as f64;
                for k in 0..books {
                    b.paint(["red_books", "blue_books", "paper_books"][rng.below(3)]);
                    let (x, h) = (-0.46 + width * (k as f64 + 0.5), rng.range(0.3, 0.46));
                    boxed(b, x, -0.02, 0.08 + 0.58 * row as f64, width * 0.9, 0.24, h);
                }
            }
        }
        Prop::Bed => {
            b.paint("fabric_bed");
            boxed(b, 0.0, 0.0, if l == 0 { sunk } else { 0.3 }, 1.1, 2.0, if l == 0 { 0.5 } else { 0.22 });
            if l >= 1 {
                b.paint("wood_bed");
                boxed(b, 0.0, 1.02, sunk, 1.2, 0.08, 1.0);
                boxed(b, 0.0, 0.0, if l < 2 { sunk } else { 0.2 }, 1.18, 2.04, if l < 2 { 0.33 } else { 0.11 });
            }
            if l >= 2 {
                legs(b, 0.5, 0.92, 0.21, 0.1);
                b.paint("white_pillow");
                blob(b, v3(0.0, 0.72 * s, 0.54 * s), v3(0.4, 0.22, 0.09) * s, 4 + 2 * l, 2 + l, 0.04, rng);
            }
        }
        Prop::Sofa => {
            b.paint("fabric_sofa");
            boxed(b, 0.0, 0.0, sunk, 1.9, 0.8, 0.42);
            if l >= 1 {
                boxed(b, 0.0, 0.36, 0.38, 1.9, 0.2, 0.45);
            }
            if l >= 2 {
                boxed(b, -0.9, -0.02, sunk, 0.2, 0.84, 0.66);
                boxed(b, 0.9, -0.02, sunk, 0.2, 0.84, 0.66);
            }
            if l >= 3 {
                for x in [-0.4, 0.4] {
                    blob(b, v3(x * s, -0.04 * s, 0.44 * s), v3(0.42, 0.36, 0.11) * s, 4 + 2 * l, 2 + l, 0.02, rng);
                }
            }
        }
        Prop::FloorLamp => {
            b.paint("metal_lamp");
            let n = 3 + l;
            b.column(v3(0.0, 0.0, sunk), 0.15 * s, 0.13 * s, 0.06, n);
            b.column(v3(0.0, 0.0, 0.03), 0.025 * s, 0.02 * s, 1.5 * s, n);
            b.paint("lamp_shade");
            b.column(v3(0.0, 0.0, 1.42 * s), 0.26 * s, 0.16 * s, 0.3 * s, n + 1);
        }
        Prop::Column => {
            b.paint("concrete_column");
            let n = 4 + l;
            let shaft = [(0.28, 0.0), (0.28, 0.18), (0.2, 0.28), (0.18, 2.75), (0.27, 2.88), (0.27, 3.05)];
            let plain = [(0.24, 0.0), (0.2, 3.05)];
            let profile: &[(f64, f64)] = if l == 0 { &plain } else { &shaft };
            let scaled: Vec<_> = profile.iter().map(|(r, z)| (r * s, z * s + sunk)).collect();
            b.lathe(&scaled, n, (1.0, 1.0));
        }
        Prop::Ball => {
            b.paint("concrete_plinth");
            boxed(b, 0.0, 0.0, sunk, 0.5, 0.5, 0.82);
            b.paint("gold_ball");
            blob(b, v3(0.0, 0.0, 1.1 * s), DVec3::splat(0.32 * s), 4 + 2 * l, 2 + l, 0.0, rng);
        }
        Prop::Vase => {
            b.paint("blue_vase");
            let shape = [(0.12, 0.0), (0.22, 0.2), (0.2, 0.42), (0.08, 0.6), (0.13, 0.7)];
            let scaled: Vec<_> = shape.iter().map(|(r, z)| (r * s, z * s + sunk)).collect();
            b.lathe(&scaled, 3 + l, (1.0, 1.0));
        }
        Prop::Plant => {
            b.paint("brick_pot");
            b.column(v3(0.0, 0.0, sunk), 0.15 * s, 0.22 * s, 0.4 * s, 4 + l);
            b.paint("foliage_plant");
            blob(b, v3(0.0, 0.0, 0.78 * s), v3(0.32, 0.32, 0.44) * s, 4 + 2 * l, 3 + l, 0.3, rng);
        }
        other => unreachable!("{other:?} is no prop of this file"),
    }
}
