//! Props of streets and yards.

use super::Prop;
use crate::math::DVec2;
use crate::scene::generate::builder::{Builder, Frame, v3};
use crate::scene::generate::random::Random;
use crate::scene::generate::solids::Along;

pub(super) fn emit(b: &mut Builder, prop: Prop, s: f64, l: usize, rng: &mut Random) {
    // Legs and other thin parts sink a little, so that no face lies exactly in the floor's.
    let sunk = -0.02;
    let boxed = |b: &mut Builder, x: f64, y: f64, z: f64, w: f64, d: f64, h: f64| {
        b.block_on(v3(x * s, y * s, z * s), v3(w * s, d * s, h * s));
    };
    match prop {
        Prop::Crate => {
            b.paint("plank_crate");
            if l == 0 {
                boxed(b, 0.0, 0.0, sunk, 1.0, 1.0, 1.0);
            } else {
                boxed(b, 0.0, 0.0, 0.0, 0.94, 0.94, 0.96);
                b.paint("wood_crate_trim");
                for x in [-0.45, 0.45] {
                    for y in [-0.45, 0.45] {
                        boxed(b, x, y, sunk, 0.12, 0.12, 1.02);
                    }
                }
                for z in if l >= 2 { &[0.01, 0.87][..] } else { &[][..] } {
                    for q in [-0.45, 0.45] {
                        boxed(b, 0.0, q, *z, 0.8, 0.1, 0.11);
                        boxed(b, q, 0.0, *z, 0.1, 0.8, 0.11);
                    }
                }
                let slats = if l >= 3 { (l - 1).min(7) } else { 0 };
                for k in 0..slats {
                    let z = 0.14 + 0.74 * (k as f64 + 0.5) / slats as f64;
                    boxed(b, 0.0, 0.0, z - 0.3 / slats as f64, 0.97, 0.97, 0.6 / slats as f64);
                }
            }
        }
        Prop::Barrel => {
            b.paint(if rng.chance(0.5) { "rust_barrel" } else { "blue_barrel" });
            let plain = [(0.3, 0.0), (0.3, 0.95)];
            let hooped = [
                (0.29, 0.0),
                (0.29, 0.28),
                (0.32, 0.31),
                (0.29, 0.34),
                (0.29, 0.6),
                (0.32, 0.63),
                (0.29, 0.66),
                (0.29, 0.95),
            ];
            let profile: &[(f64, f64)] = if l < 2 { &plain } else { &hooped };
            let scaled: Vec<_> = profile.iter().map(|(r, z)| (r * s, z * s + sunk)).collect();
            b.lathe(&scaled, 6 + 2 * l, (1.0, 1.0));
        }
        Prop::StreetLamp => {
            b.paint("black_iron");
            b.column(v3(0.0, 0.0, sunk), 0.12 * s, 0.07 * s, 3.6 * s, 4 + l);
            b.paint("lamp_glass");
            b.column(v3(0.0, 0.0, 3.55 * s), 0.12 * s, 0.2 * s, 0.4 * s, 4 + l);
            b.paint("black_iron");
            b.within(Frame::at(v3(0.0, 0.0, 3.93 * s)), |b| {
                b.lathe(&[(0.25 * s, 0.0), (0.0, 0.22 * s)], 4 + l, (1.0, 1.0))
            });
        }
        Prop::Car => {
            b.paint(["red_car", "blue_car", "white_car", "paint_car"][rng.below(4)]);
            let hull = [
                (-2.1, 0.3),
                (2.1, 0.3),
                (2.1, 0.8),
                (1.0, 0.95),
                (0.5, 1.42),
                (-1.1, 1.42),
                (-1.7, 0.95),
                (-2.1, 0.9),
            ];
            let hull: Vec<DVec2> = hull.iter().map(|(x, z)| DVec2::new(x * s, z * s)).collect();
            b.extrude(Along::Y, &hull, -0.85 * s, 0.85 * s);
            if l >= 1 {
                b.paint("black_tyre");
                for (x, y) in [(-1.3, -0.8), (1.3, -0.8), (-1.3, 0.8), (1.3, 0.8)] {
                    b.tube(v3(x, y - 0.1, 0.32) * s, v3(x, y + 0.1, 0.32) * s, 0.34 * s, 5 + l);
                }
            }
        }
        Prop::Bench => {
            b.paint("plank_bench");
            boxed(b, 0.0, 0.0, 0.42, 1.6, 0.4, 0.06);
            boxed(b, -0.6, 0.0, sunk, 0.08, 0.36, 0.46);
            boxed(b, 0.6, 0.0, sunk, 0.08, 0.36, 0.46);
            if l >= 1 {
                boxed(b, 0.0, 0.2, 0.5, 1.6, 0.05, 0.4);
            }
        }
        other => unreachable!("{other:?} is no prop of this file"),
    }
}
