//! No pixel hides what the oracle's item buffer sees at the same sample.

use super::common::*;
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::oracle::image::Grid;
use cullmark::oracle::{item_buffer, sets};
use cullmark::raster::project::Screen;
use cullmark::raster::{Coverage, DepthBuffer, Kind, Occluders};
use cullmark::registry::Spec;
use cullmark::scene::{Scene, generate, walkthrough};

/// Pixels that hide something, all of them checked.
fn check(scene: &Scene, view: &View, coverage: Coverage, what: &str) -> usize {
    let (width_px, height_px) = (240, 135);
    let s = settings(width_px, height_px, coverage);
    let kind = |t: u32| match (scene.occluder[t as usize], scene.two_sided[t as usize]) {
        (false, _) => Kind::Clear,
        (true, false) => Kind::OneSided,
        (true, true) => Kind::TwoSided,
    };
    let occluders = Occluders::new(scene.len() as u32, scene.origin, |t| scene.corners(t), kind, &[]);
    let mut buffer = DepthBuffer::new(s);
    buffer.begin(view, scene.origin);
    buffer.draw(&occluders, 0, scene.len() as u32);
    let image = buffer.image();
    // Inner coverage holds over the whole pixel.
    let samples = if coverage == Coverage::Inner { 4 } else { 1 };
    let grid = Grid { width_px, height_px, samples };
    let standings = sets::standings(scene, view).0;
    let screen = Screen::new(view, scene.origin, s);
    let mut covered = 0;
    for (i, tile) in item_buffer::draw(scene, view, &standings, grid).iter().enumerate() {
        tile.for_each(grid.tile(i as u32), |run| {
            let corners =
                (run.winner != 0).then(|| scene.corners(run.winner - 1).map(|c| screen.camera(c - scene.origin)));
            for x in run.x..run.x + run.len {
                let hides = image[(run.y / samples * width_px + x / samples) as usize];
                let seen = corners.map_or(f64::NEG_INFINITY, |c| {
                    nearness(&screen, &c, [x, run.y].map(|v| (f64::from(v) + 0.5) / f64::from(samples)))
                });
                assert!(
                    f64::from(hides) <= seen + 1e-9 * seen.abs().min(1e300),
                    "{what}: at ({x}, {}) {hides} hides triangle {} at {seen}",
                    run.y,
                    run.winner
                );
                covered += usize::from(hides > f32::NEG_INFINITY);
            }
        });
    }
    covered
}

/// Of the triangle's plane at a place on the image, from corners in camera coordinates.
fn nearness(screen: &Screen, c: &[DVec3; 3], [x, y]: [f64; 2]) -> f64 {
    let (x, y) = (x - screen.width_px * 0.5, y - screen.height_px * 0.5);
    let normal = (c[1] - c[0]).cross(c[2] - c[0]);
    if screen.perspective {
        normal.dot(DVec3::new(x, y, 1.0)) / normal.dot(c[0])
    } else {
        -(normal.dot(c[0]) - normal.x * x - normal.y * y) / normal.z
    }
}

#[test]
fn nothing_that_a_sample_sees_is_hidden_in_generated_scenes() {
    let mut covered = 0;
    for spec in ["arena:map=gold_rush", "rooms:world=2"] {
        let scene = generate::make(&Spec::parse(spec).unwrap()).unwrap().0.generate();
        let walk = walkthrough::generate::make(&Spec::parse("walk:frames=300").unwrap()).unwrap().0;
        for (i, pose) in walk.walk(&scene).unwrap().iter().enumerate().step_by(17) {
            let projection = match i % 3 {
                2 => Projection::Orthographic { height_m: 12.0 },
                _ => Projection::Perspective { fov_y_rad: 1.0 },
            };
            let view = View::new(&Camera { projection, ..Default::default() }, pose);
            for coverage in [Coverage::Samples, Coverage::Inner] {
                covered += check(&scene, &view, coverage, &format!("{spec} frame {i} {coverage:?}"));
            }
        }
    }
    assert!(covered > 500_000, "{covered} pixels hide");
}

#[test]
fn nothing_that_a_sample_sees_is_hidden_in_soups() {
    let mut covered = 0;
    for seed in 0..40u64 {
        let scene = crate::common::soup(seed, 1500, 10.0, [0.05, 0.5, 3.0, 30.0][seed as usize % 4]);
        let mut r = Random::new(seed);
        let pose = Pose { eye: scene.origin + r.vector() * 15.0, forward: r.vector().normalize(), up: DVec3::Z };
        let view = View::new(&Camera::default(), &pose);
        for coverage in [Coverage::Samples, Coverage::Inner] {
            covered += check(&scene, &view, coverage, &format!("soup {seed} {coverage:?}"));
        }
    }
    assert!(covered > 200_000, "{covered} pixels hide");
}
