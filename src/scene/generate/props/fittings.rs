//! Props that belong to houses and works.

use super::Prop;
use crate::math::DVec2;
use crate::scene::generate::builder::{Builder, Frame, v3};
use crate::scene::generate::random::Random;
use crate::scene::generate::solids::Along;

pub(super) fn emit(b: &mut Builder, prop: Prop, s: f64, l: usize, _: &mut Random) {
    // Legs and other thin parts sink a little, so that no face lies exactly in the floor's.
    let sunk = -0.02;
    let boxed = |b: &mut Builder, x: f64, y: f64, z: f64, w: f64, d: f64, h: f64| {
        b.block_on(v3(x * s, y * s, z * s), v3(w * s, d * s, h * s));
    };
    match prop {
        Prop::Pipe => {
            // Runs along x for `size` metres at the frame's height.
            b.paint("rust_pipe");
            b.tube(v3(-s * 0.5, 0.0, 0.0), v3(s * 0.5, 0.0, 0.0), 0.11, 5 + l);
            for k in 0..l.min(6) {
                let x = s * ((k as f64 + 0.5) / l.min(6) as f64 - 0.5);
                b.tube(v3(x - 0.06, 0.0, 0.0), v3(x + 0.06, 0.0, 0.0), 0.16, 5 + l);
            }
        }
        Prop::WaterTank => {
            b.paint("wood_tank");
            for (x, y) in [(-0.7, -0.7), (0.7, -0.7), (0.7, 0.7), (-0.7, 0.7)] {
                boxed(b, x, y, sunk, 0.12, 0.12, 1.3);
            }
            b.column(v3(0.0, 0.0, 1.25 * s), 1.1 * s, 1.05 * s, 1.7 * s, 6 + 2 * l);
            b.paint("metal_tank");
            b.within(Frame::at(v3(0.0, 0.0, 2.9 * s)), |b| {
                b.lathe(&[(1.2 * s, 0.0), (0.0, 0.7 * s)], 6 + 2 * l, (1.0, 1.0))
            });
        }
        Prop::AirUnit => {
            b.paint("metal_unit");
            boxed(b, 0.0, 0.0, sunk, 1.4, 1.0, 0.9);
            if l >= 1 {
                b.paint("black_fan");
                b.column(v3(0.0, 0.0, 0.85 * s), 0.38 * s, 0.38 * s, 0.12 * s, 5 + l);
            }
        }
        Prop::Vent => {
            b.paint("metal_vent");
            b.column(v3(0.0, 0.0, sunk), 0.16 * s, 0.16 * s, 0.9 * s, 5 + l);
            b.within(Frame::at(v3(0.0, 0.0, 0.85 * s)), |b| {
                b.lathe(&[(0.3 * s, 0.0), (0.3 * s, 0.08 * s), (0.0, 0.25 * s)], 5 + l, (1.0, 1.0));
            });
        }
        Prop::Balcony => {
            b.paint("concrete_balcony");
            boxed(b, 0.0, -0.45, 0.0, 2.0, 1.1, 0.14);
            if l >= 1 {
                b.paint("black_rail");
                b.block_on(v3(0.0, -0.95 * s, 0.95 * s), v3(2.0, 0.06, 0.06) * s);
                let posts = 1 + 2 * l.min(6);
                for k in 0..=posts {
                    boxed(b, -0.97 + 1.94 * k as f64 / posts as f64, -0.95, 0.1, 0.04, 0.04, 0.9);
                }
            }
        }
        Prop::Window => {
            // A framed pane a hand's breadth before the wall at y = 0.
            b.paint("glass_pane");
            boxed(b, 0.0, 0.0, 0.0, 1.0, 0.1, 1.4);
            if l >= 1 {
                b.paint("white_frame");
                boxed(b, 0.0, -0.03, -0.1, 1.2, 0.16, 0.1);
                boxed(b, 0.0, -0.02, 1.4, 1.2, 0.12, 0.1);
            }
            if l >= 2 {
                for x in [-0.55, 0.55] {
                    boxed(b, x, -0.01, -0.02, 0.1, 0.12, 1.44);
                }
                boxed(b, 0.0, -0.01, 0.66, 1.02, 0.11, 0.06);
            }
            if l >= 3 {
                boxed(b, 0.0, -0.015, -0.02, 0.06, 0.11, 1.44);
                b.paint("paint_shutter");
                for x in [-0.92, 0.92] {
                    boxed(b, x, 0.0, -0.05, 0.56, 0.08, 1.5);
                    for k in 0..l.min(9) - 2 {
                        let n = (l.min(9) - 2) as f64;
                        boxed(b, x, -0.03, 0.05 + 1.35 * k as f64 / n, 0.48, 0.06, 0.6 / n);
                    }
                }
            }
        }
        Prop::WindowFrame => {
            // Round an opening 1.4 m wide and 1.3 m high in a wall from y = 0 to 0.3.
            b.paint("white_window_frame");
            boxed(b, 0.0, 0.08, -0.1, 1.8, 0.5, 0.12);
            if l >= 1 {
                boxed(b, 0.0, 0.15, 1.26, 1.7, 0.42, 0.1);
                for x in [-0.72, 0.72] {
                    boxed(b, x, 0.15, 0.0, 0.12, 0.4, 1.28);
                }
            }
            if l >= 3 {
                b.paint("paint_window_shutter");
                for x in [-1.1, 1.1] {
                    boxed(b, x, -0.04, -0.02, 0.6, 0.06, 1.34);
                    for k in 0..(l - 2).min(7) {
                        let n = (l - 2).min(7) as f64;
                        boxed(b, x, -0.07, 0.08 + 1.2 * k as f64 / n, 0.5, 0.05, 0.7 / n);
                    }
                }
            }
        }
        Prop::DoorFrame => {
            // Round an opening 1.8 m wide and 2.4 m high in a wall from y = 0 to 0.3.
            b.paint("trim_door");
            boxed(b, 0.0, 0.15, 2.36, 2.3, 0.46, 0.2);
            for x in if l >= 1 { &[-0.95, 0.95][..] } else { &[][..] } {
                boxed(b, *x, 0.15, sunk, 0.2, 0.44, 2.39);
            }
            if l >= 2 {
                b.paint("lamp_door");
                b.within(Frame::at(v3(0.0, -0.16, 2.75)), |b| {
                    b.lathe(&[(0.0, -0.12), (0.12, 0.0), (0.0, 0.14)], 3 + l, (1.0, 1.0))
                });
            }
        }
        Prop::Ladder => {
            b.paint("metal_ladder");
            for x in [-0.25, 0.25] {
                b.block_on(v3(x, 0.0, sunk), v3(0.06, 0.06, s));
            }
            let rungs = (2 + 3 * l).min((s * 3.0) as usize);
            for k in 0..rungs {
                b.block_on(v3(0.0, 0.0, s * (k as f64 + 0.5) / rungs as f64), v3(0.5, 0.04, 0.04));
            }
        }
        Prop::Girder => {
            // A lattice beam along x, `size` metres long, hanging below the frame's origin.
            b.paint("metal_girder");
            for z in [-0.06, -0.66] {
                b.beam(v3(-s * 0.5, 0.0, z), v3(s * 0.5, 0.0, z), 0.14, 0.12);
            }
            let bays = (2 + 2 * l).min((s * 1.2) as usize).max(2);
            for k in 0..bays {
                let x = |k: usize| s * (k as f64 / bays as f64 - 0.5);
                let (z0, z1) = if k % 2 == 0 { (-0.66, -0.06) } else { (-0.06, -0.66) };
                b.beam(v3(x(k), 0.0, z0), v3(x(k + 1), 0.0, z1), 0.08, 0.08);
            }
        }
        Prop::Canopy => {
            b.paint("red_canopy");
            let section = [DVec2::new(0.1, 2.6), DVec2::new(-1.1, 2.25), DVec2::new(-1.1, 2.18), DVec2::new(0.1, 2.5)];
            b.extrude(Along::X, &section.map(|p| p * s), -1.1 * s, 1.1 * s);
            if l >= 1 {
                b.paint("wood_door");
                boxed(b, 0.0, 0.0, sunk, 1.1, 0.12, 2.2);
            }
            if l >= 2 {
                b.paint("concrete_step");
                boxed(b, 0.0, -0.3, sunk, 1.6, 0.8, 0.16);
            }
        }
        Prop::Sign => {
            b.paint("wood_post");
            boxed(b, -0.5, 0.0, sunk, 0.1, 0.1, 2.0);
            boxed(b, 0.5, 0.0, sunk, 0.1, 0.1, 2.0);
            b.paint("paper_sign");
            boxed(b, 0.0, -0.03, 1.0, 1.5, 0.08, 0.8);
            for k in 0..l.min(8) {
                b.paint("black_letters");
                boxed(
                    b,
                    -0.6 + 1.2 * (k as f64 + 0.5) / l.min(8) as f64,
                    -0.06,
                    1.25,
                    0.9 / l.min(8) as f64,
                    0.05,
                    0.3,
                );
            }
        }
        Prop::Sleepers => {
            // `size` metres of track bed along x: sleepers only, the rails are the map's.
            b.paint("wood_sleeper");
            let n = ((s / 1.2) as usize).max(1);
            for k in 0..n {
                let x = -s * 0.5 + s * (k as f64 + 0.5) / n as f64;
                b.block_on(v3(x, 0.0, -0.1), v3(0.28, 2.3, 0.16));
            }
            b.paint("metal_bolt");
            for k in 0..n * usize::from(l >= 1) {
                let x = -s * 0.5 + s * (k as f64 + 0.5) / n as f64;
                for y in [-0.9, -0.6, 0.6, 0.9] {
                    b.column(v3(x, y, 0.04), 0.06, 0.05, 0.07, 3 + l);
                }
            }
        }
        other => unreachable!("{other:?} is no prop of this file"),
    }
}
